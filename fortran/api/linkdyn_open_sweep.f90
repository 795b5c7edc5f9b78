!> An open sweep: planned, on its way in rounds, kept beside a file of results or in the caller's memory.
module linkdyn_open_sweep
    use, intrinsic :: iso_c_binding, only: c_double, c_intptr_t
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_dataset, only: dataset_type
    use linkdyn_handles, only: held_thing, make_handle, take, give_back
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_processes, only: process_group
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_variant, only: variants_of
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_spool, only: check_spool, read_spool
    use linkdyn_sweep, only: sweep_run, start_sweep, finish_sweep
    use linkdyn_sweep_rounds, only: sweep_rounds, begin_rounds, keep_beside, compute_round, end_rounds
    use linkdyn_sweep_wishes, only: choose_kept
    implicit none (type, external)
    private
    public :: open_sweep, start_open_sweep, take_sweep, leave_sweep, advance_sweep, take_kept, copy_numbers

    type, extends(held_thing) :: open_sweep
        type(sweep_run) :: run
        type(sweep_rounds) :: rounds
        logical :: has_ended = .false.                !! the caller has the results: nothing need be kept any more
    contains
        procedure :: release => release_sweep
    end type open_sweep

contains

    !> Plan a sweep, and go on where an earlier run stands. An interrupt leaves none.
    subroutine start_open_sweep(scene, folder, solver, keep, threads, output, resumes, interval, handle, status)
        type(scene_type), intent(in) :: scene
        character(len=*), intent(in) :: folder        !! where its tables lie
        integer, intent(in) :: solver
        character(len=*), intent(in) :: keep          !! names with commas; blank: as the scene says
        integer, intent(in) :: threads
        character(len=*), intent(in) :: output        !! file for which the results are; blank: none, and nothing is kept
        logical, intent(in) :: resumes                !! an interrupted run kept there is gone on with
        real(c_double), intent(in) :: interval        !! between two checkpoints [s]
        integer(c_intptr_t), intent(out) :: handle
        type(status_type), intent(inout) :: status
        type(open_sweep), pointer :: new
        class(held_thing), pointer :: thing
        type(scene_type) :: wished

        handle = 0
        wished = scene
        if (len(keep) > 0) call choose_kept(keep, wished%sweep, status)
        if (.not. status%is_ok()) return
        allocate (new)
        call start_sweep(wished, variants_of(wished, folder), solver, new%run, status)
        call begin_rounds(threads, process_group(), new%rounds)
        if (len(output) > 0 .and. .not. is_interrupted()) &
            call keep_beside(output, resumes, interval, "resume=True", new%run, new%rounds, status)
        thing => new
        if (status%is_ok() .and. .not. is_interrupted()) call make_handle(thing, handle, status)
        if (handle /= 0) return
        call new%release()
        deallocate (new)
    end subroutine start_open_sweep

    !> Use a sweep alone until `leave_sweep`. Null: the call has failed.
    subroutine take_sweep(handle, sweep, status)
        integer(c_intptr_t), intent(in) :: handle
        type(open_sweep), pointer, intent(out) :: sweep
        type(status_type), intent(inout) :: status
        class(held_thing), pointer :: thing

        nullify (sweep)
        call take(handle, "sweep", .true., thing, status)
        if (.not. associated(thing)) return
        select type (thing)
        type is (open_sweep)
            sweep => thing
        class default
            call give_back(handle)
            call fail(status, status_bad_input, "the handle is not that of a sweep")
        end select
    end subroutine take_sweep

    !> The end of a use; nothing for a sweep that could not be taken.
    subroutine leave_sweep(handle, sweep)
        integer(c_intptr_t), intent(in) :: handle
        type(open_sweep), pointer, intent(inout) :: sweep

        if (associated(sweep)) call give_back(handle)
        nullify (sweep)
    end subroutine leave_sweep

    subroutine release_sweep(self)
        class(open_sweep), intent(inout) :: self

        type(status_type) :: status

        call end_rounds(self%run, self%has_ended, self%rounds, status)
        call finish_sweep(self%run)
    end subroutine release_sweep

    !> Compute and join the next chunks; none of them when the process is told to stop.
    subroutine advance_sweep(sweep, threads, records, n_kept, status)
        type(open_sweep), intent(inout) :: sweep
        integer, intent(in) :: threads
        real(c_double), intent(inout) :: records(:, :)    !! kept samples, if there is no file for which they are (width, sample)
        integer, intent(out) :: n_kept                    !! these
        type(status_type), intent(inout) :: status

        call compute_round(threads, process_group(), sweep%run, sweep%rounds, status, records, n_kept)
    end subroutine advance_sweep

    !> Kept samples of the file for which the results are.
    subroutine take_kept(sweep, first, records, status)
        type(open_sweep), intent(in) :: sweep
        integer(int64), intent(in) :: first               !! sample, from 0
        real(c_double), intent(out), contiguous :: records(:, :)    !! (width, sample)
        type(status_type), intent(inout) :: status

        if (first == 0) call check_spool(sweep%rounds%spool, status)
        call read_spool(sweep%rounds%spool, first, records, status)
    end subroutine take_kept

    !> All numbers of a dataset in the order of the variables.
    subroutine copy_numbers(dataset, reals, integers)
        type(dataset_type), intent(in) :: dataset
        real(c_double), intent(inout) :: reals(:), integers(:)
        integer :: i, n_real, n_integer

        n_real = 0
        n_integer = 0
        do i = 1, size(dataset%variable)
            associate (variable => dataset%variable(i))
                if (allocated(variable%real)) then
                    reals(n_real + 1:n_real + size(variable%real)) = variable%real
                    n_real = n_real + size(variable%real)
                end if
                if (allocated(variable%integer)) then
                    integers(n_integer + 1:n_integer + size(variable%integer)) = real(variable%integer, c_double)
                    n_integer = n_integer + size(variable%integer)
                end if
            end associate
        end do
    end subroutine copy_numbers
end module linkdyn_open_sweep
