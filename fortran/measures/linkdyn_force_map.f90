!> How the driving forces answer a wrench on a link, in closed form: the actuators' Jacobian, its inverse, how near it
!> is to losing rank.
!>
!> By virtual work the driving forces f of a wrench w on a marker obey J^T f = -B^T w, with J the rates of the actuators
!> and B the twist of the marker, both for unit rates of the coordinates (of a pose: of velocity and angular
!> velocity, so that no choice of angles enters). The rows of the map w -> f are all there is to know of the loads: their
!> lengths are the largest forces that unit forces and unit moments can ask for, their directions the worst loads.
module linkdyn_force_map
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_joint_rates, only: actuator_columns
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, orientation_of, scene_size, side_of, point_on, step_parts, step_pose, step_ups, &
        beyond_leg, direction_of_leg
    use linkdyn_vec2, only: vec2, operator(.rotate.)
    use linkdyn_vec3, only: vec3, operator(+), operator(.cross.), operator(.rotate.)
    implicit none (type, external)
    private
    public :: force_map, prepare_force_map, evaluate_force_map, scaled_condition, typical_length

    !> A leg between the frame and a link whose pose is given: its row of the Jacobian needs no acceleration columns.
    type :: plain_leg
        integer :: leg = 0
        integer :: link = 0
        integer :: coordinate(6) = 0          !! of the link
        real(wp) :: point(3) = 0              !! where it holds the link, link axes [m]
        real(wp) :: direction(3) = 0          !! in which the slide's variable grows that way, axes of the leg's lower half
    end type plain_leg

    !> What is constant for a mechanism.
    type :: force_map
        logical :: needs_columns = .true.     !! of accelerations; false where all actuators are plain legs
        type(plain_leg), allocatable :: leg(:)
        integer :: link = 0                   !! on which the wrench acts; 0: none wanted
        real(wp) :: point(3) = 0              !! where, link axes [m]
        integer :: coordinate(6) = 0          !! of the link, if its pose is given
        real(wp), allocatable :: scale(:, :)  !! (n_actuator, n_q) makes the Jacobian free of units
        real(wp) :: length = 1                !! characteristic [m]
    end type force_map

contains

    !> Recognise what can be had without acceleration columns, and scale by the characteristic length.
    subroutine prepare_force_map(model, link, point, length, map)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link           !! 0: no wrench
        real(wp), intent(in) :: point(3)
        real(wp), intent(in) :: length        !! [m]; 0: the typical one
        type(force_map), intent(out) :: map
        integer :: i, k

        map%link = link
        map%point = point
        map%length = length
        if (.not. length > 0) map%length = typical_length(model)
        allocate (map%scale(model%n_actuator, model%n_q), map%leg(model%n_actuator))
        map%scale = 1
        do k = 1, model%n_q
            if (model%scene%coordinate(k)%unit == "m") map%scale(:, k) = map%length
        end do
        do i = 1, model%n_actuator
            if (model%scene%actuator(i)%unit == "N") map%scale(i, :) = map%scale(i, :)/map%length
        end do
        if (link > 0) map%coordinate = pose_coordinates(model, link)
        map%needs_columns = link > 0 .and. all(map%coordinate == 0)
        do i = 1, model%n_actuator
            call find_leg(model, model%joint(model%scene%actuator(i)%joint)%leg, map%leg(i))
            map%needs_columns = map%needs_columns .or. map%leg(i)%leg == 0
        end do
    end subroutine prepare_force_map

    !> The leg of an actuator, if it is a plain one.
    subroutine find_leg(model, number, leg)
        type(model_type), intent(in) :: model
        integer, intent(in) :: number         !! 0: none
        type(plain_leg), intent(out) :: leg
        logical :: is_against                 !! the slide's variable grows as the leg becomes shorter
        integer :: i, end, ends(2)

        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (number == 0 .or. step%kind /= step_ups .or. step%first /= number) cycle
                associate (slide => model%joint(step%joint(2)))
                    is_against = side_of(slide, step%link(1)) == 2 .neqv. step%branch < 0
                end associate
                ends = [beyond_leg(model, step, 1), beyond_leg(model, step, 2)]
                end = findloc(ends == 0, .false., dim=1)
                if (end == 0 .or. all(ends > 0)) return
                leg%link = ends(end)
                leg%point = point_on(model%joint(step%joint(2*end - 1)), leg%link)
                leg%direction = direction_of_leg(model, step, 1)
                if (is_against .neqv. end == 1) leg%direction = -leg%direction
                leg%coordinate = pose_coordinates(model, leg%link)
                if (any(leg%coordinate > 0)) leg%leg = number
            end associate
        end do
    end subroutine find_leg

    !> Coordinates that give the pose of a link; zeros if none do.
    pure function pose_coordinates(model, link) result(coordinate)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        integer :: coordinate(6)
        integer :: i

        coordinate = 0
        if (model%is_planar) return
        do i = 1, size(model%step)
            if (model%step(i)%kind == step_pose .and. model%step(i)%link(1) == link) coordinate = model%step(i)%coordinate
        end do
    end function pose_coordinates

    !> Do coordinates give the pose of a link, in a plane or in space?
    pure logical function is_posed(model, link)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link

        is_posed = any((model%step%kind == step_pose .or. model%step%kind == step_parts) .and. model%step%link(1) == link)
    end function is_posed

    !> A length to compare turning with moving: the largest distance of a joint from the origin of a link whose pose is
    !> given, such as a platform; else the mechanism's size.
    pure real(wp) function typical_length(model) result(length)
        type(model_type), intent(in) :: model
        integer :: j, side

        length = 0
        do j = 1, model%n_joint
            do side = 1, 2
                associate (link => model%joint(j)%link(side))
                    if (link == 0) cycle
                    if (is_posed(model, link)) length = max(length, norm2(model%joint(j)%point(:, side)))
                end associate
            end do
        end do
        if (.not. length > 0) length = scene_size(model)
    end function typical_length

    !> Jacobian, and the driving forces of the six unit wrenches. Rows of a singular lane are NaN.
    subroutine evaluate_force_map(model, map, state, jacobian, force, determinant)
        type(model_type), intent(in) :: model
        type(force_map), intent(in) :: map
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: jacobian(lanes, model%n_actuator, model%n_q)  !! scaled, no unit
        real(wp), intent(out) :: force(lanes, model%n_actuator, 6)   !! of Fx Fy Fz Mx My Mz = 1 on the marker, world axes
        real(wp), intent(out) :: determinant(lanes)                  !! of the scaled Jacobian
        real(wp) :: matrix(lanes, model%n_q, model%n_actuator), growth(lanes)
        logical :: is_singular(lanes)
        integer :: i, k

        if (map%needs_columns) then
            call actuator_columns(model, state, jacobian)
            call twist_columns(model, map, state, force)
        else
            call plain_columns(model, map, state, jacobian, force)
        end if
        do k = 1, model%n_q
            do i = 1, model%n_actuator
                jacobian(:, i, k) = jacobian(:, i, k)*map%scale(i, k)
                matrix(:, k, i) = jacobian(:, i, k)
            end do
        end do
        ! Row k of the scaled matrix is s_k/s_i times that of the plain one, so the right-hand side takes s_k and the
        ! solution gives 1/s_i back.
        do k = 1, model%n_q
            force(:, k, :) = -force(:, k, :)*map%scale(1, k)
        end do
        call solve_gauss_jordan(model%n_q, 6, matrix, force, growth, is_singular, determinant)
        do i = 1, model%n_actuator
            force(:, i, :) = force(:, i, :)*(map%scale(i, 1)/map%scale(1, 1))
        end do
    end subroutine evaluate_force_map

    !> Legs from the frame to links whose poses are given.
    subroutine plain_columns(model, map, state, jacobian, twist)
        type(model_type), intent(in) :: model
        type(force_map), intent(in) :: map
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: jacobian(lanes, model%n_actuator, model%n_q)
        real(wp), intent(out) :: twist(lanes, model%n_q, 6)
        type(vec3) :: arm, turn
        integer :: i, k

        jacobian = 0
        do i = 1, model%n_actuator
            associate (leg => map%leg(i), &
                       s => state%rotation(orientation_of(model, model%leg(map%leg(i)%leg)%lower)) .rotate.map%leg(i)%direction)
                arm = state%rotation(model%link(leg%link)%orientation).rotate.leg%point
                turn = arm.cross.s
                call put(jacobian(:, i, :), leg%coordinate(1:3), s)
                call put(jacobian(:, i, :), leg%coordinate(4:6), turn)
            end associate
        end do
        twist = 0
        if (map%link == 0) return
        arm = state%rotation(model%link(map%link)%orientation).rotate.map%point
        do k = 1, 3
            twist(:, map%coordinate(k), k) = 1
            twist(:, map%coordinate(k + 3), k + 3) = 1
        end do
        ! Velocity of the point for a unit angular velocity about x, y, z.
        associate (c => map%coordinate)
            twist(:, c(4), 2) = -arm%z
            twist(:, c(4), 3) = arm%y
            twist(:, c(5), 1) = arm%z
            twist(:, c(5), 3) = -arm%x
            twist(:, c(6), 1) = -arm%y
            twist(:, c(6), 2) = arm%x
        end associate
    end subroutine plain_columns

    pure subroutine put(row, place, v)
        real(wp), intent(inout) :: row(:, :)  !! (lane, n_q)
        integer, intent(in) :: place(3)
        type(vec3), intent(in) :: v

        row(:, place(1)) = v%x
        row(:, place(2)) = v%y
        row(:, place(3)) = v%z
    end subroutine put

    !> Twist of the marker for a unit rate of each coordinate, from the acceleration columns, which are those of the
    !> velocity too.
    subroutine twist_columns(model, map, state, twist)
        type(model_type), intent(in) :: model
        type(force_map), intent(in) :: map
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: twist(lanes, model%n_q, 6)
        type(vec3) :: arm, velocity
        type(vec2) :: flat
        integer :: k, o

        twist = 0
        if (map%link == 0) return
        o = model%link(map%link)%orientation
        do k = 1, model%n_q
            if (model%is_planar) then
                flat = state%plane%rotation(o).rotate.map%point(:2)
                associate (turn => state%plane%angular(:, k, o), origin => state%plane%linear(k, map%link))
                    twist(:, k, 1) = origin%x - turn*flat%y
                    twist(:, k, 2) = origin%y + turn*flat%x
                    twist(:, k, 6) = turn
                end associate
            else
                arm = state%rotation(o).rotate.map%point
                velocity = state%acceleration(k, map%link) + (state%alpha(k, o).cross.arm)
                twist(:, k, 1) = velocity%x
                twist(:, k, 2) = velocity%y
                twist(:, k, 3) = velocity%z
                twist(:, k, 4) = state%alpha(k, o)%x
                twist(:, k, 5) = state%alpha(k, o)%y
                twist(:, k, 6) = state%alpha(k, o)%z
            end if
        end do
    end subroutine twist_columns

    !> Largest over smallest singular value of a square matrix.
    !>
    !> One-sided Jacobi rotations make the columns square to each other; their lengths are then the singular values,
    !> small ones as exact as large ones. A lane is done when its own columns are: what it gives does not hang on others.
    subroutine scaled_condition(n, a, condition)
        integer, intent(in) :: n
        real(wp), intent(inout) :: a(lanes, n, n)      !! destroyed
        real(wp), intent(out) :: condition(lanes)      !! infinite where singular
        integer, parameter :: most_sweeps = 20
        real(wp), dimension(lanes) :: alpha, beta, gamma, zeta, t, c, s, kept, largest, smallest, length, worst
        logical :: is_done(lanes)
        integer :: sweep, i, j, k

        is_done = .false.
        do sweep = 1, most_sweeps
            worst = 0
            do i = 1, n - 1
                do j = i + 1, n
                    alpha = 0
                    beta = 0
                    gamma = 0
                    do k = 1, n
                        alpha = alpha + a(:, k, i)**2
                        beta = beta + a(:, k, j)**2
                        gamma = gamma + a(:, k, i)*a(:, k, j)
                    end do
                    length = abs(gamma)/max(sqrt(alpha*beta), tiny(1.0_wp))
                    worst = max(worst, length)
                    zeta = (beta - alpha)/sign(max(abs(2*gamma), tiny(1.0_wp)), gamma)
                    t = sign(1.0_wp, zeta)/(abs(zeta) + sqrt(1 + zeta**2))
                    t = merge(t, 0.0_wp, length > epsilon(1.0_wp) .and. .not. is_done)
                    c = 1/sqrt(1 + t**2)
                    s = c*t
                    do k = 1, n
                        kept = a(:, k, i)
                        a(:, k, i) = c*kept - s*a(:, k, j)
                        a(:, k, j) = s*kept + c*a(:, k, j)
                    end do
                end do
            end do
            ! The rotations of this sweep leave about the square of what they found.
            is_done = is_done .or. .not. worst > sqrt(epsilon(1.0_wp))
            if (all(is_done)) exit
        end do
        largest = 0
        smallest = huge(1.0_wp)
        do j = 1, n
            length = 0
            do k = 1, n
                length = length + a(:, k, j)**2
            end do
            largest = max(largest, length)
            smallest = min(smallest, length)
        end do
        condition = sqrt(largest/smallest)
    end subroutine scaled_condition
end module linkdyn_force_map
