!> UPS legs that stand on the frame, seen from the link they carry: an apparent mass and a force at their point S.
!>
!> Such a leg moves with S alone. With g = 1/length and c the tilt (see `linkdyn_ups_leg`), a unit acceleration of S
!> along x, y, z of the leg turns both its links by g (0, 1, 0), -g (1, 0, c) and 0, and moves the upper link's origin,
!> which is S. On these three columns virtual work turns the wrenches of both links into a force at S and their inertia
!> into a symmetric 3x3 matrix there, so that no leg carries columns for all the coordinates that move it.
!>
!> **Source**: derived here; checked against the columns of all links in the tests.
module linkdyn_carried_legs
    use linkdyn_assembly, only: subtract_applied
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, leg_type, step_pose, step_ups
    use linkdyn_point, only: point_column
    use linkdyn_ups_leg, only: ups_leg
    use linkdyn_vec3, only: vec3, operator(.dot.), operator(.rotate.), zero_vec3
    implicit none (type, external)
    private
    public :: plan_carried_legs, add_leg_inertia, add_leg_wrench, carried_leg_of, leg_slide_column

contains

    !> Which legs can be condensed: on the frame, with no further joint on their links and driven by their slide only.
    subroutine plan_carried_legs(model)
        type(model_type), intent(inout) :: model
        integer :: i

        allocate (model%leg(model%n_leg))
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (step%kind == step_pose) model%link(step%link(1))%pose = i
                if (step%kind /= step_ups) cycle
                call describe_leg(model, step%joint, step%link, model%leg(step%first))
                associate (leg => model%leg(step%first))
                    leg%is_carried = .not. step%base_moves .and. leg%top > 0 &
                                     .and. n_joint_of(step%link(1)) == 2 .and. n_joint_of(step%link(2)) == 2 &
                                     .and. .not. is_driven(step%joint(1)) .and. .not. is_driven(step%joint(3)) &
                                     .and. .not. any(model%payload%link == step%link(1) .or. model%payload%link == step%link(2))
                    if (leg%is_carried) model%link(step%link)%is_carried_leg = .true.
                end associate
            end associate
        end do

    contains

        pure integer function n_joint_of(link)
            integer, intent(in) :: link

            n_joint_of = model%first_at(link + 1) - model%first_at(link)
        end function n_joint_of

        pure logical function is_driven(joint)
            integer, intent(in) :: joint

            is_driven = any(model%scene%actuator%joint == joint)
        end function is_driven
    end subroutine plan_carried_legs

    !> Constants of the two links taken together.
    subroutine describe_leg(model, joint, link, leg)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint(3), link(2)
        type(leg_type), intent(out) :: leg

        leg%lower = link(1)
        leg%upper = link(2)
        leg%top = model%joint(joint(3))%link(2)
        leg%point = model%joint(joint(3))%point(:, 2)
        leg%mass = model%link(leg%upper)%mass
        leg%moment = leg%mass*model%link(leg%upper)%cog
        leg%lower_moment = model%link(leg%lower)%mass*model%link(leg%lower)%cog
        leg%inertia = inertia_about_origin(leg%lower) + inertia_about_origin(leg%upper)

    contains

        pure function inertia_about_origin(l) result(inertia)
            integer, intent(in) :: l
            real(wp) :: inertia(3, 3)
            integer :: i

            associate (c => model%link(l)%cog, m => model%link(l)%mass)
                inertia = model%link(l)%inertia - m*spread(c, 2, 3)*spread(c, 1, 3)
                do i = 1, 3
                    inertia(i, i) = inertia(i, i) + m*dot_product(c, c)
                end do
            end associate
        end function inertia_about_origin
    end subroutine describe_leg

    !> Add the inertia of the legs that carry a link to the link's own: see `mass_matrix`.
    subroutine add_leg_inertia(model, state, link, inertia)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link
        real(wp), intent(inout) :: inertia(lanes, 6, 6)
        type(vec3) :: arm
        integer :: i

        do i = 1, model%n_leg
            if (.not. model%leg(i)%is_carried .or. model%leg(i)%top /= link) cycle
            arm = state%rotation(model%link(link)%orientation).rotate.model%leg(i)%point
            call add_apparent_mass(model%leg(i), state%leg(i), arm, inertia)
        end do
    end subroutine add_leg_inertia

    !> Add the inertia of one leg against the motion of the link it carries: wrench about the link's origin, per
    !> acceleration of the origin and angular acceleration, world axes. Only the upper triangle is filled.
    !>
    !> Numbers instead of vectors in one loop over the lanes: nothing but the sums then leaves the registers, which is
    !> ten times faster here.
    pure subroutine add_apparent_mass(leg, position, arm, inertia)
        type(leg_type), intent(in) :: leg
        type(ups_leg), intent(in) :: position
        type(vec3), intent(in) :: arm                    !! from the link's origin to S, world axes [m]
        real(wp), intent(inout) :: inertia(lanes, 6, 6)
        real(wp) :: xx, yy, xy, xz, yz, g, c, x1, x2, x3, y1, y2, y3, z1, z2, z3, p1, p2, p3, q1, q2, q3, r1, r2, r3
        real(wp) :: a1, a2, a3, w11, w22, w33, w12, w13, w23, b11, b21, b31, b12, b22, b32, b13, b23, b33
        integer :: l

        !$omp simd
        do l = 1, lanes
            ! Apparent mass in leg axes; zz is the mass of the upper link.
            g = position%inverse_length(l)
            c = position%tilt(l)
            associate (i => leg%inertia, m => leg%moment)
                xx = leg%mass + g*(2*m(3) + g*i(2, 2))
                yy = leg%mass + g*(2*(m(3) - c*m(1)) + g*(i(1, 1) + c*(2*i(1, 3) + c*i(3, 3))))
                xy = g*(c*m(2) - g*(i(1, 2) + c*i(2, 3)))
                xz = -m(1)*g
                yz = -m(2)*g
            end associate
            ! In world axes: w = p x^T + q y^T + r z^T, with p, q, r the forces for unit accelerations along the leg's axes.
            x1 = position%axes%x%x(l)
            x2 = position%axes%x%y(l)
            x3 = position%axes%x%z(l)
            y1 = position%axes%y%x(l)
            y2 = position%axes%y%y(l)
            y3 = position%axes%y%z(l)
            z1 = position%axes%z%x(l)
            z2 = position%axes%z%y(l)
            z3 = position%axes%z%z(l)
            p1 = xx*x1 + xy*y1 + xz*z1
            p2 = xx*x2 + xy*y2 + xz*z2
            p3 = xx*x3 + xy*y3 + xz*z3
            q1 = xy*x1 + yy*y1 + yz*z1
            q2 = xy*x2 + yy*y2 + yz*z2
            q3 = xy*x3 + yy*y3 + yz*z3
            r1 = xz*x1 + yz*y1 + leg%mass*z1
            r2 = xz*x2 + yz*y2 + leg%mass*z2
            r3 = xz*x3 + yz*y3 + leg%mass*z3
            w11 = p1*x1 + q1*y1 + r1*z1
            w12 = p1*x2 + q1*y2 + r1*z2
            w13 = p1*x3 + q1*y3 + r1*z3
            w22 = p2*x2 + q2*y2 + r2*z2
            w23 = p2*x3 + q2*y3 + r2*z3
            w33 = p3*x3 + q3*y3 + r3*z3
            ! A turn about axis k moves S by e_k x arm.
            a1 = arm%x(l)
            a2 = arm%y(l)
            a3 = arm%z(l)
            b11 = a2*w13 - a3*w12
            b21 = a2*w23 - a3*w22
            b31 = a2*w33 - a3*w23
            b12 = a3*w11 - a1*w13
            b22 = a3*w12 - a1*w23
            b32 = a3*w13 - a1*w33
            b13 = a1*w12 - a2*w11
            b23 = a1*w22 - a2*w12
            b33 = a1*w23 - a2*w13
            inertia(l, 1, 1) = inertia(l, 1, 1) + w11
            inertia(l, 1, 2) = inertia(l, 1, 2) + w12
            inertia(l, 2, 2) = inertia(l, 2, 2) + w22
            inertia(l, 1, 3) = inertia(l, 1, 3) + w13
            inertia(l, 2, 3) = inertia(l, 2, 3) + w23
            inertia(l, 3, 3) = inertia(l, 3, 3) + w33
            inertia(l, 1, 4) = inertia(l, 1, 4) + b11
            inertia(l, 2, 4) = inertia(l, 2, 4) + b21
            inertia(l, 3, 4) = inertia(l, 3, 4) + b31
            inertia(l, 1, 5) = inertia(l, 1, 5) + b12
            inertia(l, 2, 5) = inertia(l, 2, 5) + b22
            inertia(l, 3, 5) = inertia(l, 3, 5) + b32
            inertia(l, 1, 6) = inertia(l, 1, 6) + b13
            inertia(l, 2, 6) = inertia(l, 2, 6) + b23
            inertia(l, 3, 6) = inertia(l, 3, 6) + b33
            inertia(l, 4, 4) = inertia(l, 4, 4) + a2*b31 - a3*b21
            inertia(l, 4, 5) = inertia(l, 4, 5) + a2*b32 - a3*b22
            inertia(l, 5, 5) = inertia(l, 5, 5) + a3*b12 - a1*b32
            inertia(l, 4, 6) = inertia(l, 4, 6) + a2*b33 - a3*b23
            inertia(l, 5, 6) = inertia(l, 5, 6) + a3*b13 - a1*b33
            inertia(l, 6, 6) = inertia(l, 6, 6) + a1*b23 - a2*b13
        end do
    end subroutine add_apparent_mass

    !> Add to the wrench of a link about its origin, world axes, what the legs that carry it ask for.
    subroutine add_leg_wrench(model, state, link, load, force, moment)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link
        real(wp), intent(in) :: load(:, :, :)              !! (lane, 6, n_load)
        type(vec3), intent(inout) :: force, moment
        real(wp), parameter :: origin(3) = 0
        type(vec3) :: arm, upper_force, lower_force, leg_moment
        integer :: i, o

        lower_force = zero_vec3()
        do i = 1, model%n_leg
            if (.not. model%leg(i)%is_carried .or. model%leg(i)%top /= link) cycle
            associate (leg => model%leg(i), position => state%leg(i))
                o = model%link(leg%upper)%orientation
                call inertia_of_leg(leg, position%omega, state%alpha_body(0, o), state%acceleration_body(0, leg%upper), &
                                    state%gravity_body(o), upper_force, leg_moment)
                ! The lower link's origin rests: forces there do no work.
                call subtract_applied(model, leg%upper, origin, state, load, upper_force, leg_moment)
                call subtract_applied(model, leg%lower, origin, state, load, lower_force, leg_moment)
                arm = state%rotation(model%link(link)%orientation).rotate.leg%point
                call add_force_at_point(position, upper_force, leg_moment, arm, force, moment)
            end associate
        end do
    end subroutine add_leg_wrench

    !> Add the force at S that does the work of an upper link's force and a moment on both links.
    pure subroutine add_force_at_point(position, upper_force, leg_moment, arm, force, moment)
        type(ups_leg), intent(in) :: position
        type(vec3), intent(in) :: upper_force, leg_moment  !! leg axes
        type(vec3), intent(in) :: arm                      !! from the link's origin to S, world axes [m]
        type(vec3), intent(inout) :: force, moment         !! world axes
        real(wp) :: f1, f2, f3, p1, p2, p3
        integer :: l

        associate (x => position%axes%x, y => position%axes%y, z => position%axes%z)
            !$omp simd
            do l = 1, lanes
                f1 = upper_force%x(l) + position%inverse_length(l)*leg_moment%y(l)
                f2 = upper_force%y(l) - position%inverse_length(l)*(leg_moment%x(l) + position%tilt(l)*leg_moment%z(l))
                f3 = upper_force%z(l)
                p1 = f1*x%x(l) + f2*y%x(l) + f3*z%x(l)
                p2 = f1*x%y(l) + f2*y%y(l) + f3*z%y(l)
                p3 = f1*x%z(l) + f2*y%z(l) + f3*z%z(l)
                force%x(l) = force%x(l) + p1
                force%y(l) = force%y(l) + p2
                force%z(l) = force%z(l) + p3
                moment%x(l) = moment%x(l) + (arm%y(l)*p3 - arm%z(l)*p2)
                moment%y(l) = moment%y(l) + (arm%z(l)*p1 - arm%x(l)*p3)
                moment%z(l) = moment%z(l) + (arm%x(l)*p2 - arm%y(l)*p1)
            end do
        end associate
    end subroutine add_force_at_point

    !> Inertia less weight of both links, leg axes: force of the upper link, and the sum of the lower link's moment about
    !> U and the upper link's about S. Numbers in one loop, as in `add_apparent_mass`.
    pure subroutine inertia_of_leg(leg, omega, alpha, acceleration, gravity, force, moment)
        type(leg_type), intent(in) :: leg
        type(vec3), intent(in) :: omega, alpha             !! of both links [rad/s, rad/s2]
        type(vec3), intent(in) :: acceleration             !! of S [m/s2]
        type(vec3), intent(in) :: gravity                  !! [m/s2]
        type(vec3), intent(out) :: force, moment
        real(wp) :: w1, w2, w3, e1, e2, e3, a1, a2, a3, g1, g2, g3, c1, c2, c3, h1, h2, h3
        integer :: l

        !$omp simd
        do l = 1, lanes
            w1 = omega%x(l)
            w2 = omega%y(l)
            w3 = omega%z(l)
            e1 = alpha%x(l)
            e2 = alpha%y(l)
            e3 = alpha%z(l)
            g1 = gravity%x(l)
            g2 = gravity%y(l)
            g3 = gravity%z(l)
            a1 = acceleration%x(l) - g1
            a2 = acceleration%y(l) - g2
            a3 = acceleration%z(l) - g3
            associate (m => leg%moment, n => leg%lower_moment, i => leg%inertia)
                ! m (a - g) + alpha x m c + omega x (omega x m c)
                c1 = w2*m(3) - w3*m(2)
                c2 = w3*m(1) - w1*m(3)
                c3 = w1*m(2) - w2*m(1)
                force%x(l) = leg%mass*a1 + (e2*m(3) - e3*m(2)) + (w2*c3 - w3*c2)
                force%y(l) = leg%mass*a2 + (e3*m(1) - e1*m(3)) + (w3*c1 - w1*c3)
                force%z(l) = leg%mass*a3 + (e1*m(2) - e2*m(1)) + (w1*c2 - w2*c1)
                ! I alpha + omega x I omega + m c x (a - g), and of the lower link m c x (-g)
                h1 = i(1, 1)*w1 + i(1, 2)*w2 + i(1, 3)*w3
                h2 = i(2, 1)*w1 + i(2, 2)*w2 + i(2, 3)*w3
                h3 = i(3, 1)*w1 + i(3, 2)*w2 + i(3, 3)*w3
                moment%x(l) = (i(1, 1)*e1 + i(1, 2)*e2 + i(1, 3)*e3) + (w2*h3 - w3*h2) + (m(2)*a3 - m(3)*a2) - (n(2)*g3 - n(3)*g2)
                moment%y(l) = (i(2, 1)*e1 + i(2, 2)*e2 + i(2, 3)*e3) + (w3*h1 - w1*h3) + (m(3)*a1 - m(1)*a3) - (n(3)*g1 - n(1)*g3)
                moment%z(l) = (i(3, 1)*e1 + i(3, 2)*e2 + i(3, 3)*e3) + (w1*h2 - w2*h1) + (m(1)*a2 - m(2)*a1) - (n(1)*g2 - n(2)*g1)
            end associate
        end do
    end subroutine inertia_of_leg

    !> The leg whose slide a joint is, if that leg is carried; 0 else.
    pure integer function carried_leg_of(model, joint) result(leg)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint

        leg = model%joint(joint)%leg
        if (leg == 0) return
        if (.not. model%leg(leg)%is_carried) leg = 0
    end function carried_leg_of

    !> Rate of the length of a leg for a unit rate of coordinate k.
    pure function leg_slide_column(model, state, leg, k) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: leg, k
        real(wp) :: rate(lanes)
        integer :: o

        associate (top => model%leg(leg)%top)
            o = model%link(top)%orientation
            rate = state%leg(leg)%axes%z.dot.point_column(state%acceleration(k, top), state%alpha(k, o), &
                                                          state%rotation(o).rotate.model%leg(leg)%point)
        end associate
    end function leg_slide_column
end module linkdyn_carried_legs
