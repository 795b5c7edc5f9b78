!> Kernels that code is generated from: inverse dynamics, forward dynamics, kinematics. The same on every machine: multiply-adds
!> are formed, and whoever compiles the code says what they become.
module linkdyn_code_kernel
    use linkdyn_result_kinds, only: result_qdd
    use linkdyn_closing_programs, only: turning_each, trace_group_step, list_group_step
    use linkdyn_force_program, only: trace_forces, trace_redundancy, list_forces
    use linkdyn_inputs, only: trace_request, sample_set, input_blocks, n_block
    use linkdyn_interpreter, only: interpret
    use linkdyn_kernel, only: kernel_type, compile_kernel
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_newton_step, only: newton_step
    use linkdyn_rate_program, only: trace_accelerations
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene_program, only: output_list
    use linkdyn_trace, only: traced_type
    implicit none (type, external)
    private
    public :: controller_kernel, make_controller_kernel, make_closing_kernel, run_kernel

    type :: controller_kernel
        type(kernel_type) :: kernel
        integer, allocatable :: block(:), place(:)     !! where an input stands: `in_*`, and in that block (input)
        integer, allocatable :: id(:), item(:)         !! what an output is: `result_*` or `out_*`, and its number there (output)
        logical :: is_made = .false.                   !! false: no pivots serve the samples
    end type controller_kernel

contains

    subroutine make_controller_kernel(model, request, wanted, sample, controller)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        integer, intent(in) :: wanted(:)               !! `result_*` of the catalogue
        type(sample_set), intent(in) :: sample         !! representative: pivots are chosen by them
        type(controller_kernel), intent(out) :: controller
        type(record_type), target :: record
        type(traced_type) :: traced
        type(output_list) :: out

        call open_record(record, sample%n)
        if (any(wanted == result_qdd)) then
            call trace_accelerations(model, request, sample, traced)
            call trace_redundancy(wanted, traced)
        else
            call trace_forces(model, request, wanted, sample, traced)
        end if
        controller%is_made = traced%mechanism%is_solved
        if (controller%is_made) then
            call list_forces(wanted, traced, out)
            call compile_and_name(record, traced%in, out, controller)
        end if
        call close_record(record)
    end subroutine make_controller_kernel

    !> Newton's step of a group closed by iteration: from coordinates and places to corrections and what they are judged by.
    subroutine make_closing_kernel(model, g, sample, controller)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g                       !! number of the group
        type(sample_set), intent(in) :: sample
        type(controller_kernel), intent(out) :: controller
        type(model_type), target :: own
        type(record_type), target :: record
        type(traced_type) :: traced
        type(newton_step) :: step
        type(output_list) :: out

        own = turning_each(model)
        call open_record(record, sample%n)
        call trace_group_step(own, g, sample, traced, step)
        controller%is_made = step%is_solved
        if (controller%is_made) then
            call list_group_step(own%group(g), traced, step, out)
            call compile_and_name(record, traced%in, out, controller)
        end if
        call close_record(record)
    end subroutine make_closing_kernel

    !> One sample through the kernel.
    subroutine run_kernel(controller, sample, s, output)
        type(controller_kernel), intent(in) :: controller
        type(sample_set), intent(in) :: sample         !! what is not there is zero
        integer, intent(in) :: s                       !! which of them
        real(wp), allocatable, intent(out) :: output(:)
        real(wp) :: input(controller%kernel%n_input)
        integer :: k

        input = 0
        do k = 1, size(input)
            associate (block => sample%of(controller%block(k)))
                if (allocated(block%x)) input(k) = block%x(controller%place(k), s)
            end associate
        end do
        allocate (output(controller%kernel%n_output))
        call interpret(controller%kernel, input, output)
    end subroutine run_kernel

    subroutine compile_and_name(record, in, out, controller)
        type(record_type), intent(in) :: record
        type(input_blocks), intent(in) :: in
        type(output_list), intent(in) :: out
        type(controller_kernel), intent(inout) :: controller
        integer :: b, k, i

        call compile_kernel(record, out%v, .true., controller%kernel, parts=out%n)
        controller%id = [((out%id(k), i=1, out%n(k)), k=1, size(out%n))]
        controller%item = [((i, i=1, out%n(k)), k=1, size(out%n))]
        allocate (controller%block(controller%kernel%n_input), controller%place(controller%kernel%n_input))
        controller%block = 0
        controller%place = 0
        do b = 1, n_block
            if (.not. allocated(in%of(b)%which)) cycle
            do k = 1, size(in%of(b)%which)
                controller%block(in%of(b)%first + k - 1) = b
                controller%place(in%of(b)%first + k - 1) = in%of(b)%which(k)
            end do
        end do
    end subroutine compile_and_name
end module linkdyn_code_kernel
