!> Inverse dynamics of many samples by a record of the scene: traced once for the results wanted, run on blocks of samples.
!>
!> Loops are closed by closed forms, legs in any axes among them. Where a group of links has none, its links' places are given
!> for every sample, by whoever has closed it by iteration. A sample at which the record raises its alarm, near a dead point
!> or where a pivot fails, or that is not finite, is left to whoever solves with pivots of its own.
module linkdyn_recorded_forces
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_block, only: block_lanes
    use linkdyn_force_program, only: make_force_program, out_alarm, out_reach
    use linkdyn_inputs, only: trace_request, sample_set, in_q, in_qd, in_qdd, in_load, in_branch, in_place, in_pull, in_payload
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_finite, only: all_are_finite
    use linkdyn_kinds, only: wp
    use linkdyn_lock, only: hold_lock, release_lock
    use linkdyn_model, only: model_type
    use linkdyn_planner, only: plan_steps
    use linkdyn_recorded_friction, only: friction_programs, friction_space, make_friction_programs, settle_block, &
        load_settled, free_friction_programs, free_friction_space
    use linkdyn_catalogue, only: needs_equations
    use linkdyn_samples, only: sample_arrays, result_list, most_results
    use linkdyn_scene_program, only: scene_program, program_space, load_samples, run_samples, output_target, goes_to, &
        free_scene_program, free_program_space
    use linkdyn_status, only: status_type, sample_ok
    use linkdyn_threads, only: team_size
    implicit none (type, external)
    private
    public :: recorded_forces, record_shelf, record_forces, run_recorded, free_recorded, plan_for_records, &
        prepare_forces

    integer, parameter :: largest_share = 8    !! blocks that a thread takes at a time: their work outweighs the taking

    !> Slots that no thread is using: a list, changed by one thread at a time.
    type :: idle_space
        type(program_space) :: slots
        type(friction_space) :: friction
        real(wp), allocatable :: alarm(:, :), reach(:, :)      !! (1, lane)
        logical, allocatable :: is_left(:)                     !! (sample of a batch)
        type(idle_space), pointer :: next => null()
    end type idle_space

    type :: space_pool
        type(idle_space), pointer :: first => null()
    end type space_pool

    !> A scene's record for some results.
    type :: recorded_forces
        integer, allocatable :: wanted(:)                      !! `result_*` of the catalogue
        logical :: is_usable = .false.                         !! false: the scene has no record
        logical :: is_refuted = .false.                        !! it has one, which does not find what the lanes find
        logical :: needs_branches = .false.                    !! there are ways to close
        logical :: needs_places = .false.                      !! some links stand where they have been found by iteration
        type(model_type), pointer :: model => null()           !! planned for records
        type(scene_program) :: program
        type(friction_programs) :: friction                    !! there if joints rub and forces are wanted
        type(space_pool), pointer, private :: pool => null()
    end type recorded_forces

    !> One of several records.
    type :: shelved_record
        type(recorded_forces) :: recorded
        type(shelved_record), pointer :: next => null()
    end type shelved_record

    !> The records of a scene that its runs have asked for, one for each choice of results.
    type :: record_shelf
        integer :: n_asked = 0                         !! samples of all batches for which somebody looked for one
        type(shelved_record), pointer, private :: first => null()
    contains
        procedure :: find => find_record
        procedure :: add => add_record
        procedure :: free => free_records
    end type record_shelf

contains

    !> The record for some results; null if there is none yet.
    function find_record(self, wanted) result(recorded)
        class(record_shelf), intent(in) :: self
        integer, intent(in) :: wanted(:)                       !! `result_*` of the catalogue
        type(recorded_forces), pointer :: recorded
        type(shelved_record), pointer :: place

        nullify (recorded)
        place => self%first
        do while (associated(place))
            if (size(place%recorded%wanted) == size(wanted)) then
                if (all(place%recorded%wanted == wanted)) recorded => place%recorded
            end if
            place => place%next
        end do
    end function find_record

    !> Room for one more.
    function add_record(self) result(recorded)
        class(record_shelf), intent(inout) :: self
        type(recorded_forces), pointer :: recorded
        type(shelved_record), pointer :: place

        allocate (place)
        place%next => self%first
        self%first => place
        recorded => place%recorded
    end function add_record

    !> Give all records back. No batch may be running.
    subroutine free_records(self)
        class(record_shelf), intent(inout) :: self
        type(shelved_record), pointer :: place

        do while (associated(self%first))
            place => self%first
            self%first => place%next
            call free_recorded(place%recorded)
            deallocate (place)
        end do
    end subroutine free_records

    !> Trace the scene for the results wanted. Poses are representative: pivots are chosen by them.
    subroutine record_forces(model, wanted, q, stand, recorded, place, by_work)
        type(model_type), intent(in) :: model
        integer, intent(in) :: wanted(:)                       !! `result_*` of the catalogue
        real(wp), intent(in) :: q(:, :)                        !! (n_q, pose), at which all loops close on the start's assembly
        real(wp), intent(in) :: stand(:, :, 0:)                !! axes and origins of the links at the first (3, 4, 0:n_link)
        type(recorded_forces), intent(out) :: recorded
        real(wp), intent(in), optional :: place(:, :, :)       !! there, of links closed by iteration (place_size, n_link, pose);
                                                               !! absent: there are none
        logical, intent(in), optional :: by_work               !! virtual work in place of all links' equations; absent: false
        type(trace_request) :: request
        type(sample_set) :: sample
        logical :: is_planned

        recorded%wanted = wanted
        allocate (recorded%model, recorded%pool)
        call prepare_forces(model, q, stand, recorded%model, request, sample, is_planned, place)
        if (.not. is_planned) return
        recorded%needs_branches = any(recorded%model%step%has_margin)
        recorded%needs_places = size(recorded%model%group) > 0
        if (present(by_work)) request%by_work = by_work
        request%has_friction = size(model%contact) > 0 .and. any(needs_equations(wanted))
        if (request%has_friction) then
            call make_friction_programs(recorded%model, request, wanted, sample, recorded%friction, recorded%program)
        else
            call make_force_program(recorded%model, request, wanted, sample, recorded%program)
        end if
        recorded%is_usable = recorded%program%is_made
    end subroutine record_forces

    !> What a trace of inverse dynamics takes: the mechanism planned for records, inputs, samples.
    subroutine prepare_forces(model, q, stand, own, request, sample, is_planned, place)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)                        !! (n_q, pose)
        real(wp), intent(in) :: stand(:, :, 0:)                !! (3, 4, 0:n_link)
        type(model_type), intent(out) :: own
        type(trace_request), intent(out) :: request
        type(sample_set), intent(out) :: sample
        logical, intent(out) :: is_planned                     !! false: there is no pose, or no such plan
        real(wp), intent(in), optional :: place(:, :, :)       !! (place_size, n_link, pose)

        is_planned = size(q, 2) > 0
        if (is_planned) is_planned = plan_for_records(model, stand, own)
        if (.not. is_planned) return
        allocate (request%has_load(6, own%n_load))
        request%has_load = .true.
        sample%n = size(q, 2)
        sample%of(in_q)%x = q
        sample%of(in_branch)%x = spread(own%branch, 2, sample%n)
        if (present(place)) &
            sample%of(in_place)%x = reshape(place(:, :, :sample%n), [size(place, 1)*size(place, 2), sample%n])
    end subroutine prepare_forces

    !> The same mechanism, planned anew. False: a link is closed by iteration that was not so before, or a branch has no place
    !> of its own.
    logical function plan_for_records(model, stand, own) result(is_planned)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: stand(:, :, 0:)
        type(model_type), intent(out) :: own
        type(status_type) :: status
        logical :: is_placed(model%n_link)                     ! by iteration
        integer :: g

        own = model
        own%n_dyad = 0
        own%n_branch = 0
        own%n_leg = 0
        deallocate (own%step, own%group)
        if (allocated(own%moves)) deallocate (own%moves)
        call plan_steps(own, status, stand=stand)
        is_planned = status%is_ok()
        if (is_planned) is_planned = own%n_branch == model%n_branch
        if (.not. is_planned) return
        is_placed = .false.
        do g = 1, size(model%group)
            is_placed(model%group(g)%link) = .true.
        end do
        do g = 1, size(own%group)
            is_planned = is_planned .and. all(is_placed(own%group(g)%link))
        end do
    end function plan_for_records

    !> Run samples in order. Those in `left` have been left: their status and results are as they were. Nothing is allocated
    !> but this list, if some are, and scratch for larger batches than there were.
    subroutine run_recorded(recorded, threads, n, arrays, way_status, results, n_left, left)
        type(recorded_forces), intent(in) :: recorded
        integer, intent(in) :: threads                         !! at most; a short batch takes fewer
        integer, intent(in) :: n                               !! samples
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: way_status(:)                   !! what is not ok is left (n), or one for all
        type(result_list), intent(in) :: results
        integer, intent(out) :: n_left
        integer, allocatable, intent(out) :: left(:)           !! absent if there are none
        type(idle_space), pointer :: own
        integer :: lanes, n_block, n_thread, share, n_taken, i

        lanes = block_lanes()
        n_block = (n + lanes - 1)/lanes
        n_thread = team_size(threads, n_block)
        share = max(1, min(largest_share, n_block/(2*n_thread)))
        call take_space(recorded%pool, lanes, own)
        if (size(own%is_left) < n) then
            deallocate (own%is_left)
            allocate (own%is_left(n))
        end if
        n_taken = 0
        if (n_thread > 1) then
            !$omp parallel num_threads(n_thread)
            call run_blocks()
            !$omp end parallel
        else
            call run_blocks()                  ! without a team, whose making takes as long as a block
        end if
        n_left = count(own%is_left(:n))
        if (n_left > 0) left = pack([(i, i=1, n)], own%is_left(:n))
        call return_space(recorded%pool, own)

    contains

        !> One thread's share of the blocks: it takes some, and comes again.
        subroutine run_blocks()
            type(idle_space), pointer :: space
            type(output_target) :: to(most_results + 2)
            integer :: done, block, first, last, k

            call take_space(recorded%pool, lanes, space)
            to(1) = goes_to(out_alarm, space%alarm, is_of_block=.true.)
            to(2) = goes_to(out_reach, space%reach, is_of_block=.true.)
            do k = 1, results%n
                to(k + 2) = goes_to(results%id(k), results%of(k)%x)
            end do
            do
                !$omp atomic capture
                done = n_taken
                n_taken = n_taken + share
                !$omp end atomic
                if (done >= n_block) exit
                do block = done + 1, min(n_block, done + share)
                    first = lanes*(block - 1) + 1
                    last = min(n, first + lanes - 1)
                    own%is_left(first:last) = .true.
                    if (is_interrupted()) cycle
                    call run_one_block(recorded, first, last - first + 1, arrays, way_status, to(:results%n + 2), results%status, &
                                       space, own%is_left(first:last))
                end do
            end do
            call return_space(recorded%pool, space)
        end subroutine run_blocks
    end subroutine run_recorded

    !> Samples first, ..., first + count - 1.
    subroutine run_one_block(recorded, first, count, arrays, way_status, to, status, space, is_left)
        type(recorded_forces), intent(in) :: recorded
        integer, intent(in) :: first, count
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: way_status(:)
        type(output_target), intent(in) :: to(:)
        integer, pointer, contiguous, intent(in) :: status(:)  !! (sample)
        type(idle_space), intent(inout), target :: space
        logical, intent(out) :: is_left(count)
        integer :: i

        if (size(way_status) == 1) then
            is_left = way_status(1) /= sample_ok
        else
            is_left = way_status(first:first + count - 1) /= sample_ok
        end if
        call leave_what_is_no_number(in_q)
        call leave_what_is_no_number(in_qd)
        call leave_what_is_no_number(in_qdd)
        if (size(recorded%model%scene%laws%law) > 0) then      ! which have no value everywhere
            call leave_what_is_no_number(in_load)
            call leave_what_is_no_number(in_pull)
        end if
        if (size(recorded%model%payload) > 0) call leave_what_is_no_number(in_payload)     ! of a mass below zero
        if (all(is_left)) return
        if (recorded%friction%is_made) then
            call settle_block(recorded%friction, arrays, first, count, space%friction, is_left)
            if (all(is_left)) return
            call load_settled(recorded%friction, recorded%program, arrays, first, count, space%friction, space%slots)
        else
            call load_samples(recorded%program, arrays, first, count, space%slots)
        end if
        call run_samples(recorded%program, space%slots, first, count, to, is_left)
        do i = 1, count
            ! Written so that what is no number counts as an alarm.
            if (.not. (space%alarm(1, i) <= 1 .and. space%reach(1, i) > 0)) is_left(i) = .true.
        end do
        if (.not. associated(status)) return
        do i = 1, count
            if (.not. is_left(i)) status(first + i - 1) = sample_ok
        end do

    contains

        !> Samples that have no numbers where the record needs some.
        subroutine leave_what_is_no_number(block)
            integer, intent(in) :: block                       !! one of `in_*`

            if (.not. associated(arrays%of(block)%x)) return
            associate (x => arrays%of(block)%x)
                if (size(x) == 0) return
                if (size(x, 2) == 1) then      ! which serves all samples
                    is_left = is_left .or. .not. all_are_finite(size(x, 1, int64), x(1, 1))
                    return
                end if
                if (all_are_finite(size(x, 1, int64)*count, x(1, first))) return       ! all at once, as nearly always
                do i = 1, count
                    is_left(i) = is_left(i) .or. .not. all_are_finite(size(x, 1, int64), x(1, first + i - 1))
                end do
            end associate
        end subroutine leave_what_is_no_number
    end subroutine run_one_block

    !> Idle slots, or new.
    subroutine take_space(pool, lanes, space)
        type(space_pool), pointer, intent(in) :: pool
        integer, intent(in) :: lanes
        type(idle_space), pointer, intent(out) :: space

        call hold_lock()
        space => pool%first
        if (associated(space)) pool%first => space%next
        call release_lock()
        if (associated(space)) return
        allocate (space)
        allocate (space%alarm(1, lanes), space%reach(1, lanes), space%is_left(lanes))
    end subroutine take_space

    subroutine return_space(pool, space)
        type(space_pool), pointer, intent(in) :: pool
        type(idle_space), pointer, intent(inout) :: space

        call hold_lock()
        space%next => pool%first
        pool%first => space
        call release_lock()
    end subroutine return_space

    !> Give everything back. No batch may be running.
    subroutine free_recorded(recorded)
        type(recorded_forces), intent(inout) :: recorded
        type(idle_space), pointer :: space

        if (associated(recorded%pool)) then
            do while (associated(recorded%pool%first))
                space => recorded%pool%first
                recorded%pool%first => space%next
                call free_program_space(space%slots)
                call free_friction_space(space%friction)
                deallocate (space)
            end do
            deallocate (recorded%pool)
        end if
        call free_scene_program(recorded%program)
        call free_friction_programs(recorded%friction)
        if (associated(recorded%model)) deallocate (recorded%model)
        recorded%is_usable = .false.
    end subroutine free_recorded
end module linkdyn_recorded_forces
