!> An open sweep.
module linkdyn_open_sweep
    use, intrinsic :: iso_c_binding, only: c_double, c_intptr_t
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_dataset, only: dataset_type
    use linkdyn_handles, only: held_thing, make_handle, take, give_back
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_variant, only: variants_of
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_sweep, only: sweep_run, start_sweep, compute_chunks, join_chunks, finish_sweep
    use linkdyn_sweep_chunk, only: kept_chunk, make_records
    use linkdyn_sweep_plan, only: samples_of_chunk
    use linkdyn_sweep_totals, only: totals_type
    use linkdyn_sweep_wishes, only: choose_kept
    implicit none (type, external)
    private
    public :: open_sweep, start_open_sweep, take_sweep, leave_sweep, advance_sweep, kept_width, copy_numbers

    type, extends(held_thing) :: open_sweep
        type(sweep_run) :: run
    contains
        procedure :: release => release_sweep
    end type open_sweep

contains

    !> Plan a sweep. An interrupt leaves none.
    subroutine start_open_sweep(scene, folder, solver, keep, handle, status)
        type(scene_type), intent(in) :: scene
        character(len=*), intent(in) :: folder        !! where its tables lie
        integer, intent(in) :: solver
        character(len=*), intent(in) :: keep          !! names with commas; blank: as the scene says
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

        call finish_sweep(self%run)
    end subroutine release_sweep

    !> Values kept of a sample; 0: nothing is kept.
    pure integer function kept_width(run) result(width)
        type(sweep_run), intent(in) :: run

        width = 0
        if (any(run%spec%keeps)) width = 1 + size(run%plan%axis) + size(run%keep)
    end function kept_width

    !> Compute and join the next chunks; none of them when the process is told to stop.
    subroutine advance_sweep(run, n_chunk, threads, records, n_kept)
        type(sweep_run), intent(inout) :: run
        integer, intent(in) :: n_chunk, threads
        real(c_double), intent(inout) :: records(:, :)
        integer, intent(out) :: n_kept
        type(totals_type), allocatable :: part(:)
        type(kept_chunk), allocatable :: kept(:)
        integer(int64) :: design, first
        integer :: k, n

        n_kept = 0
        n = int(min(int(n_chunk, int64), run%plan%n_chunk - run%n_done))
        if (n < 1) return
        allocate (part(n), kept(n))
        call compute_chunks(run, run%n_done, 1_int64, threads, part, kept)
        if (is_interrupted()) return
        if (kept_width(run) > 0) then
            do k = 1, size(kept)
                call samples_of_chunk(run%plan, run%n_done + k - 1, design, first, n)
                call make_records(kept(k), n, records(:, n_kept + 1:n_kept + n))
                n_kept = n_kept + n
            end do
        end if
        call join_chunks(run, part, kept)
    end subroutine advance_sweep

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
