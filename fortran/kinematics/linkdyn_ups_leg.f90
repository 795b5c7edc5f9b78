!> The UPS leg: two links between a universal joint U and a spherical joint S, sliding on each other.
!>
!> Axes of both links: z = s, the unit vector from U to S; y = unit(s x u) with u the first axis of the universal
!> joint; x = y x z. All rates come out in these leg axes, where they are cheapest and where Newton-Euler wants them.
!>
!> The direction s fixes two components of the angular velocity; the third, the spin about s, is what the universal
!> joint allows: no relative rotation about n = u x y. In leg axes u = (m, 0, c) with c = u.s and m = |s x u|, and
!> n = (-c, 0, m).
!>
!> **Source**: derived here; checked against series differentiation of R(t) in the tests.
module linkdyn_ups_leg
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_vec3, only: vec3, mat3, operator(*), operator(.dot.), operator(.cross.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: ups_leg, locate_ups_leg, move_ups_leg, accelerate_ups_leg, map_ups_column

    !> Position of a leg, kept for the velocity and acceleration maps.
    type :: ups_leg
        type(mat3) :: axes                     !! x, y, s in world axes
        real(wp) :: length(lanes)              !! |US| [m]
        real(wp) :: inverse_length(lanes)      !! [1/m]
        real(wp) :: tilt(lanes)                !! c/m: cotangent of the angle between u and s
        real(wp) :: rate(lanes)                !! of the length [m/s]
        type(vec3) :: omega                    !! angular velocity, leg axes [rad/s]
    end type ups_leg

contains

    !> Position: where the leg points. Not finite where U = S or u is parallel to s.
    pure subroutine locate_ups_leg(span, axis, leg)
        type(vec3), intent(in) :: span         !! from U to S, world axes [m]
        type(vec3), intent(in) :: axis         !! first axis u of the universal joint, world axes, unit
        type(ups_leg), intent(inout) :: leg
        type(vec3) :: across
        real(wp) :: across_length(lanes), inverse_product(lanes)

        ! One division serves both lengths.
        leg%length = sqrt(span.dot.span)
        across = span.cross.axis
        across_length = sqrt(across.dot.across)
        inverse_product = 1/(leg%length*across_length)
        leg%inverse_length = across_length*inverse_product
        leg%axes%z = leg%inverse_length*span
        leg%axes%y = (leg%length*inverse_product)*across
        leg%axes%x = leg%axes%y.cross.leg%axes%z
        leg%tilt = (leg%length*inverse_product)*(span.dot.axis)
    end subroutine locate_ups_leg

    !> Velocity: rate of the length and angular velocity of both links. With a moving base give its angular velocity.
    pure subroutine move_ups_leg(span_rate, omega_base, base_moves, leg)
        type(vec3), intent(in) :: span_rate    !! velocity of S minus velocity of U, world axes [m/s]
        type(vec3), intent(in) :: omega_base   !! angular velocity of the base link, world axes [rad/s]
        logical, intent(in) :: base_moves      !! false: `omega_base` is zero and not read
        type(ups_leg), intent(inout) :: leg
        type(vec3) :: v, b

        v = leg%axes.unrotate.span_rate
        leg%rate = v%z
        leg%omega%x = -leg%inverse_length*v%y
        leg%omega%y = leg%inverse_length*v%x
        if (base_moves) then
            b = leg%axes.unrotate.omega_base
            leg%omega%z = b%z + leg%tilt*(leg%omega%x - b%x)
        else
            leg%omega%z = leg%tilt*leg%omega%x
        end if
    end subroutine move_ups_leg

    !> Acceleration: angular acceleration of both links in leg axes.
    pure subroutine accelerate_ups_leg(leg, span_acceleration, omega_base, alpha_base, base_moves, alpha)
        type(ups_leg), intent(in) :: leg
        type(vec3), intent(in) :: span_acceleration     !! of S minus U, LEG axes [m/s2]
        type(vec3), intent(in) :: omega_base            !! as for `move_ups_leg`
        type(vec3), intent(in) :: alpha_base            !! angular acceleration of the base link, world axes [rad/s2]
        logical, intent(in) :: base_moves
        type(vec3), intent(out) :: alpha                !! leg axes [rad/s2]
        type(vec3) :: b, db
        real(wp) :: twice_rate(lanes)

        associate (w => leg%omega, a => span_acceleration, k => leg%tilt)
            twice_rate = 2*leg%rate
            alpha%x = w%z*w%y - leg%inverse_length*(a%y + twice_rate*w%x)
            alpha%y = leg%inverse_length*(a%x - twice_rate*w%y) - w%z*w%x
            if (base_moves) then
                b = leg%axes.unrotate.omega_base
                db = leg%axes.unrotate.alpha_base
                alpha%z = db%z + k*(alpha%x - db%x) - b%y*(w%x - b%x + k*(w%z - b%z)) + (k*w%z + w%x)*(w%y - b%y)
            else
                alpha%z = k*alpha%x + (k*w%z + w%x)*w%y
            end if
        end associate
    end subroutine accelerate_ups_leg

    !> The linear part of the acceleration map, which is the velocity map too: one column.
    pure subroutine map_ups_column(leg, span_column, alpha_base, base_moves, alpha)
        type(ups_leg), intent(in) :: leg
        type(vec3), intent(in) :: span_column     !! column of S minus column of U, LEG axes
        type(vec3), intent(in) :: alpha_base      !! column of the base link's angular acceleration, world axes
        logical, intent(in) :: base_moves
        type(vec3), intent(out) :: alpha          !! leg axes
        type(vec3) :: db

        alpha%x = -leg%inverse_length*span_column%y
        alpha%y = leg%inverse_length*span_column%x
        if (base_moves) then
            db = leg%axes.unrotate.alpha_base
            alpha%z = db%z + leg%tilt*(alpha%x - db%x)
        else
            alpha%z = leg%tilt*alpha%x
        end if
    end subroutine map_ups_column
end module linkdyn_ups_leg
