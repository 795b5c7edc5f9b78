!> Kernels that code is generated from: inverse dynamics, forward dynamics, kinematics. The same on every machine: multiply-adds
!> are formed, and whoever compiles the code says what they become.
module linkdyn_controller_kernel
    use linkdyn_catalogue, only: result_qdd
    use linkdyn_force_program, only: trace_forces, list_forces
    use linkdyn_inputs, only: trace_request, sample_set, input_blocks, n_block
    use linkdyn_kernel, only: kernel_type, compile_kernel
    use linkdyn_model, only: model_type
    use linkdyn_rate_program, only: trace_accelerations
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene_program, only: output_list
    use linkdyn_trace, only: traced_type
    implicit none (type, external)
    private
    public :: controller_kernel, make_controller_kernel

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
        integer :: k, i

        call open_record(record, sample%n)
        if (any(wanted == result_qdd)) then
            call trace_accelerations(model, request, sample, traced)
        else
            call trace_forces(model, request, wanted, sample, traced)
        end if
        controller%is_made = traced%mechanism%is_solved
        if (controller%is_made) then
            call list_forces(wanted, traced, out)
            call compile_kernel(record, out%v, .true., controller%kernel, parts=out%n)
            call name_inputs(traced%in, controller)
            controller%id = [((out%id(k), i=1, out%n(k)), k=1, size(out%n))]
            controller%item = [((i, i=1, out%n(k)), k=1, size(out%n))]
        end if
        call close_record(record)
    end subroutine make_controller_kernel

    subroutine name_inputs(in, controller)
        type(input_blocks), intent(in) :: in
        type(controller_kernel), intent(inout) :: controller
        integer :: b, k

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
    end subroutine name_inputs
end module linkdyn_controller_kernel
