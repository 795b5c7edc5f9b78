!> Room between straight bodies, and how far joints swing: what bounds the workspace besides the strokes.
module linkdyn_clearance
    use linkdyn_joint_table, only: turns_about_point
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type, step_ups, orientation_of, point_on, beyond_leg, direction_of_leg
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.dot.), operator(.rotate.), &
        operator(.unrotate.), lane_of
    implicit none (type, external)
    private
    public :: rod, swing_joint, legs_of, swings_of, swing_angle, smallest_gap, have_gaps

    !> A straight body with round ends between points of two links.
    type :: rod
        integer :: link(2) = 0                !! 0 is the frame
        real(wp) :: point(3, 2) = 0           !! link axes [m]
        real(wp) :: radius = 0                !! [m]
    end type rod

    !> A joint whose leg may swing about a neutral direction.
    type :: swing_joint
        integer :: joint = 0
        integer :: leg_link = 0, other_link = 0
        real(wp) :: direction(3) = 0          !! of the leg, in its own axes
        real(wp) :: neutral(3) = 0            !! in the axes of the other link
    end type swing_joint

contains

    !> The legs as rods between the joints at their ends.
    function legs_of(model, diameter) result(legs)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: diameter      !! [m]
        type(rod), allocatable :: legs(:)
        integer :: i, ends(2)

        allocate (legs(0))
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (step%kind /= step_ups) cycle
                ends = [beyond_leg(model, step, 1), beyond_leg(model, step, 2)]
                legs = [legs, rod(ends, reshape([point_on(model%joint(step%joint(1)), ends(1)), &
                                                 point_on(model%joint(step%joint(3)), ends(2))], [3, 2]), diameter/2)]
            end associate
        end do
    end function legs_of

    !> Every universal and spherical joint. The leg is the link of a UPS or UCU leg, else the second link, and points along its
    !> slide, else along the marker's axis; neutral is how it points at the start of the scene.
    subroutine swings_of(model, swing)
        type(model_type), intent(in) :: model
        type(swing_joint), allocatable, intent(out) :: swing(:)
        type(kinematic_state) :: state
        type(vec3) :: direction
        integer :: j, side, i, n, half

        n = count(turns_about_point(model%joint%kind))
        allocate (swing(n))
        if (n == 0) return
        call prepare_kinematics(model, 0, state)
        do i = 1, model%n_q
            state%q(:, i) = model%scene%coordinate(i)%start_position
        end do
        call evaluate_kinematics(model, state)
        n = 0
        do j = 1, model%n_joint
            associate (joint => model%joint(j))
                if (.not. turns_about_point(joint%kind)) cycle
                n = n + 1
                side = 2
                do i = 1, size(model%step)
                    if (model%step(i)%kind == step_ups .and. any(model%step(i)%link(:2) == joint%link(1))) side = 1
                end do
                swing(n)%joint = j
                swing(n)%leg_link = joint%link(side)
                swing(n)%other_link = joint%link(3 - side)
                swing(n)%direction = joint%frame(:, 3, side)
                do i = 1, size(model%step)
                    if (model%step(i)%kind /= step_ups) cycle
                    half = findloc(model%step(i)%link(:2), joint%link(side), dim=1)
                    if (half > 0) swing(n)%direction = direction_of_leg(model, model%step(i), half)
                end do
                direction = state%rotation(orientation_of(model, swing(n)%leg_link)).rotate.swing(n)%direction
                direction = state%rotation(orientation_of(model, swing(n)%other_link)).unrotate.direction
                swing(n)%neutral = lane_of(direction, 1)
            end associate
        end do
    end subroutine swings_of

    !> Angle between the leg and its neutral direction.
    subroutine swing_angle(model, swing, state, angle)
        type(model_type), intent(in) :: model
        type(swing_joint), intent(in) :: swing
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: angle(lanes)     !! [rad]
        type(vec3) :: leg, neutral, apart, together

        leg = state%rotation(orientation_of(model, swing%leg_link)).rotate.swing%direction
        neutral = state%rotation(orientation_of(model, swing%other_link)).rotate.swing%neutral
        ! Exact near 0 and near 180 degrees, where the cosine is not.
        apart = leg - neutral
        together = leg + neutral
        angle = 2*atan2(sqrt(apart.dot.apart), sqrt(together.dot.together))
    end subroutine swing_angle

    !> The smallest gap between any two rods that share no end; negative where they overlap.
    subroutine smallest_gap(model, rods, state, gap)
        type(model_type), intent(in) :: model
        type(rod), intent(in) :: rods(:)
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: gap(lanes)       !! [m]
        type(vec3) :: point(2, size(rods))
        integer :: i, j, side

        do i = 1, size(rods)
            do side = 1, 2
                associate (link => rods(i)%link(side))
                    point(side, i) = state%rotation(orientation_of(model, link)).rotate.rods(i)%point(:, side)
                    point(side, i) = point(side, i) + state%position(link)
                end associate
            end do
        end do
        gap = huge(1.0_wp)
        do i = 1, size(rods) - 1
            do j = i + 1, size(rods)
                if (share_end(rods(i), rods(j))) cycle
                gap = min(gap, distance(point(:, i), point(:, j)) - (rods(i)%radius + rods(j)%radius))
            end do
        end do
    end subroutine smallest_gap

    !> Are there two rods at all that share no end?
    pure logical function have_gaps(rods)
        type(rod), intent(in) :: rods(:)
        integer :: i, j

        have_gaps = .false.
        do i = 1, size(rods) - 1
            do j = i + 1, size(rods)
                have_gaps = have_gaps .or. .not. share_end(rods(i), rods(j))
            end do
        end do
    end function have_gaps

    pure logical function share_end(a, b)
        type(rod), intent(in) :: a, b
        integer :: i, j

        share_end = .false.
        do i = 1, 2
            do j = 1, 2
                share_end = share_end .or. (a%link(i) == b%link(j) .and. all(a%point(:, i) == b%point(:, j)))
            end do
        end do
    end function share_end

    !> Distance of two segments.
    !>
    !> **Source**: Ericson (2005), Real-Time Collision Detection, 5.1.9, without branches.
    pure function distance(p, q) result(d)
        type(vec3), intent(in) :: p(2), q(2)      !! ends
        real(wp) :: d(lanes)
        type(vec3) :: u, v, r, apart
        real(wp), dimension(lanes) :: a, b, c, e, f, s, t, denominator

        u = p(2) - p(1)
        v = q(2) - q(1)
        r = p(1) - q(1)
        a = max(u.dot.u, tiny(1.0_wp))
        e = max(v.dot.v, tiny(1.0_wp))
        b = u.dot.v
        c = u.dot.r
        f = v.dot.r
        denominator = a*e - b*b
        ! Parallel lines: any point of the first will do to start from.
        s = merge(clamp((b*f - c*e)/max(denominator, tiny(1.0_wp))), 0.0_wp, denominator > epsilon(1.0_wp)*a*e)
        t = clamp((b*s + f)/e)
        s = clamp((b*t - c)/a)
        apart = r + s*u - t*v
        d = sqrt(apart.dot.apart)
    end function distance

    elemental real(wp) function clamp(x)
        real(wp), intent(in) :: x

        clamp = min(1.0_wp, max(0.0_wp, x))
    end function clamp
end module linkdyn_clearance
