!> Does a kernel find what the engine finds on its lanes? Asked once for each that code is made of, at representative poses in
!> motion: what the code would find is what its kernel finds here. A difference would be a defect, and the code is not written.
module linkdyn_kernel_check
    use linkdyn_agreement, only: agreement, are_alike
    use linkdyn_assembly_trail, only: sample_assembly, place_sample
    use linkdyn_catalogue, only: needs_equations
    use linkdyn_result_kinds, only: result_driving_force, result_qdd, result_joint_variable, result_velocity, &
        result_angular_velocity
    use linkdyn_constants, only: golden, two_pi
    use linkdyn_code_kernel, only: controller_kernel, run_kernel
    use linkdyn_equations, only: equations_type
    use linkdyn_force_program, only: out_alarm, out_reach
    use linkdyn_inputs, only: sample_set, in_q, in_qd, in_qdd, in_load, in_effort, in_target
    use linkdyn_inverse, only: inverse_solver, inverse_results, motion_batch, motion_of, run_prepared
    use linkdyn_inverse_results, only: is_of_inverse
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type, has_assemblies, scene_size
    use linkdyn_status, only: sample_ok
    use linkdyn_vec3, only: lane_of
    implicit none (type, external)
    private
    public :: compare_kernel, kernel_agrees, kernel_differs, kernel_unsure

    integer, parameter :: kernel_agrees = 1
    integer, parameter :: kernel_differs = 2
    integer, parameter :: kernel_unsure = 3            !! there was no pose at which both have an answer

    !> What is in balance at a pose is rounding there: of the largest at all poses, and of motions at a rate of about one.
    real(wp), parameter :: share_of_rounding = 1.0e-12_wp, rounding_of_motion = 1.0e-9_wp

contains

    !> Ask both at the same states, loads and driving forces.
    subroutine compare_kernel(model, equations, assembly, sample, kernel, drives, verdict)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations  !! that the engine solves for the same; none for kinematics
        type(sample_assembly), intent(in) :: assembly  !! at the poses
        type(sample_set), intent(in) :: sample         !! the poses
        type(controller_kernel), intent(in) :: kernel
        type(controller_kernel), intent(in) :: drives  !! tells the driving forces of the same states; not made: all are unknown
        integer, intent(out) :: verdict                !! `kernel_*`
        type(sample_set) :: asked
        type(inverse_results) :: found
        type(agreement) :: of_both
        real(wp), allocatable :: output(:), speed(:, :)
        integer, allocatable :: id(:)
        integer :: s, k, n_compared

        asked = sample
        call set_in_motion(model, equations, asked)
        id = distinct(kernel%id)
        call ask_engine(model, equations, assembly, asked, drives, id, found)
        if (any(id == result_velocity .or. id == result_angular_velocity)) call ask_for_speeds(model, assembly, asked, speed)
        n_compared = 0
        do s = 1, sample%n
            if (found%status(s) /= sample_ok) cycle
            call run_kernel(kernel, asked, s, output)
            if (.not. is_sure(kernel, output)) cycle
            n_compared = n_compared + 1
            call of_both%note(all([(is_alike(id(k), s), k=1, size(id))]))
        end do
        verdict = merge(kernel_agrees, kernel_differs, of_both%is_reached())
        if (n_compared == 0) verdict = kernel_unsure
        deallocate (found%status)
        call found%free()

    contains

        logical function is_alike(id, s)
            integer, intent(in) :: id, s               !! what, of which sample
            real(wp), allocatable :: own(:)

            is_alike = .true.
            own = pack(output, kernel%id == id)
            ! both tell angles within half a turn: of half a turn rounding decides on which side (and no slide is off by 2 pi m)
            if (id == result_joint_variable) own = own - two_pi*nint((own - found%of(id)%x(:, s))/two_pi)
            select case (id)
            case (result_velocity)
                is_alike = has_same(id, own, speed(:3*model%n_link, s), speed(:3*model%n_link, :))
            case (result_angular_velocity)
                is_alike = has_same(id, own, speed(3*model%n_link + 1:, s), speed(3*model%n_link + 1:, :))
            case default
                if (.not. is_of_inverse(id)) return
                if (found%wants(id)) is_alike = has_same(id, own, found%of(id)%x(:, s), found%of(id)%x)
            end select
        end function is_alike

        logical function has_same(id, own, engine, all_of_it)
            integer, intent(in) :: id
            real(wp), intent(in) :: own(:), engine(:)      !! of a sample
            real(wp), intent(in) :: all_of_it(:, :)        !! of all samples
            real(wp) :: in_balance

            in_balance = share_of_rounding*maxval(abs(pack(all_of_it, spread(found%status == sample_ok, 1, size(own)))))
            if (.not. needs_equations(id) .or. id == result_qdd) &
                in_balance = max(in_balance, rounding_of_motion*min(1.0_wp, scene_size(model)))
            has_same = are_alike(own, engine) .or. maxval(abs(own - engine)) <= in_balance
        end function has_same
    end subroutine compare_kernel

    !> Rates, accelerations, loads, targets and driving forces as chance has them. Accelerations that are unknown are zero.
    subroutine set_in_motion(model, equations, asked)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(sample_set), intent(inout) :: asked
        integer :: k

        asked%of(in_qd)%x = chance(model%n_q, 0.0_wp)
        asked%of(in_qdd)%x = chance(model%n_q, 0.3_wp)
        do k = 1, model%n_q
            if (equations%unknown%acceleration(k)) asked%of(in_qdd)%x(k, :) = 0
        end do
        asked%of(in_load)%x = chance(6*model%n_load, 0.7_wp)
        asked%of(in_effort)%x = chance(model%n_actuator, 0.1_wp)
        asked%of(in_target)%x = chance(2*model%n_actuator, 0.9_wp)

    contains

        function chance(n, shift) result(x)
            integer, intent(in) :: n
            real(wp), intent(in) :: shift
            real(wp) :: x(n, asked%n)
            integer :: i

            x = reshape([(modulo(i*golden + shift, 1.0_wp) - 0.5_wp, i=1, size(x))], shape(x))
        end function chance
    end subroutine set_in_motion

    !> What the lanes find.
    subroutine ask_engine(model, equations, assembly, asked, drives, id, found)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(sample_assembly), intent(in) :: assembly
        type(sample_set), intent(in), target :: asked
        type(controller_kernel), intent(in) :: drives
        integer, intent(in) :: id(:)                   !! `result_*`, others are passed over
        type(inverse_results), intent(inout) :: found
        type(inverse_solver) :: by_lanes
        type(motion_batch) :: motion
        real(wp), target :: force(model%n_actuator, asked%n), load(6, model%n_load, asked%n), t(asked%n)
        real(wp), allocatable :: output(:)
        integer :: s, k

        allocate (found%status(asked%n))
        do k = 1, size(id)
            if (is_of_inverse(id(k))) call found%add(model, id(k), asked%n)
        end do
        force = 0
        if (drives%is_made) then
            do s = 1, asked%n
                call run_kernel(drives, asked, s, output)
                force(:, s) = pack(output, drives%id == result_driving_force)
            end do
        end if
        load = reshape(asked%of(in_load)%x, shape(load))
        if (model%is_planar) load(3:5, :, :) = 0
        t = model%scene%time%first
        by_lanes%equations = equations
        motion = motion_of(asked%of(in_q)%x, asked%of(in_qd)%x, asked%of(in_qdd)%x, load)
        motion%given_force => force
        motion%t => t
        call run_prepared(model, by_lanes, 1, motion, found, known=assembly)
    end subroutine ask_engine

    !> Velocities of all links' origins, then angular velocities, world axes.
    subroutine ask_for_speeds(model, assembly, asked, speed)
        type(model_type), intent(in) :: model
        type(sample_assembly), intent(in) :: assembly
        type(sample_set), intent(in) :: asked
        real(wp), allocatable, intent(out) :: speed(:, :)      !! (6 n_link, sample)
        type(kinematic_state) :: state
        integer :: first, lane, s, l

        allocate (speed(6*model%n_link, asked%n))
        call prepare_kinematics(model, 0, state)
        state%qdd = 0
        do first = 1, asked%n, lanes
            do lane = 1, lanes
                s = min(first + lane - 1, asked%n)
                state%q(lane, :) = asked%of(in_q)%x(:, s)
                state%qd(lane, :) = asked%of(in_qd)%x(:, s)
                if (has_assemblies(model)) call place_sample(model, assembly, s, lane, state)
            end do
            call evaluate_kinematics(model, state)
            do s = first, min(first + lanes - 1, asked%n)
                lane = s - first + 1
                do l = 1, model%n_link
                    associate (o => model%link(l)%orientation, v => speed(3*l - 2:3*l, s), &
                               w => speed(3*(model%n_link + l) - 2:3*(model%n_link + l), s))
                        if (model%is_planar) then
                            v = [state%plane%linear(-1, l)%x(lane), state%plane%linear(-1, l)%y(lane), 0.0_wp]
                            w = [0.0_wp, 0.0_wp, state%plane%angular(lane, -1, o)]
                        else
                            v = lane_of(state%velocity(l), lane)
                            w = lane_of(state%omega(o), lane)
                        end if
                    end associate
                end do
            end do
        end do
    end subroutine ask_for_speeds

    !> Does the kernel answer, so that the code would?
    pure logical function is_sure(kernel, output)
        type(controller_kernel), intent(in) :: kernel
        real(wp), intent(in) :: output(:)

        ! written so that what is no number counts as an alarm
        is_sure = all(output <= 1 .or. kernel%id /= out_alarm) .and. all(output > 0 .or. kernel%id /= out_reach)
    end function is_sure

    pure function distinct(id) result(each)
        integer, intent(in) :: id(:)
        integer, allocatable :: each(:)
        integer :: i

        each = pack(id, [(findloc(id, id(i), dim=1) == i, i=1, size(id))])
    end function distinct
end module linkdyn_kernel_check
