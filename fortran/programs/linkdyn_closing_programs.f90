!> Newton's steps of all groups closed by iteration, by records: one program a group, from coordinates, rates along a way and
!> places to correction, velocities and margin.
!>
!> Rows, probes and units are those of the lanes' groups, so that the margins of both are the same numbers. This is looked at
!> when the programs are made: a difference would be a defect, and the lanes are believed.
module linkdyn_closing_programs
    use linkdyn_block, only: block_lanes
    use linkdyn_corrected_links, only: corrected_links, correct_links, fastest
    use linkdyn_group_motion, only: group_closer
    use linkdyn_group_rates, only: group_constraints
    use linkdyn_inputs, only: trace_request, sample_set, in_q, in_qd, in_branch, in_place
    use linkdyn_kinds, only: wp
    use linkdyn_lock, only: hold_lock, release_lock
    use linkdyn_model, only: model_type, group_type, step_group, n_probe
    use linkdyn_newton_step, only: newton_step, trace_newton_step
    use linkdyn_placing, only: place_group
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene_program, only: scene_program, program_space, sample_arrays, output_list, add_output, output_target, goes_to, &
        make_scene_program, free_scene_program, free_program_space, load_columns, run_columns, run_one_sample, has_output, &
        most_lanes
    use linkdyn_threads_of_group, only: group_threads, measure_threads, surely_same_turn
    use linkdyn_trace, only: traced_type, begin_trace, trace_steps, alarm_of
    use linkdyn_value, only: value, zero, constant, operator(+), operator(*), square
    implicit none (type, external)
    private
    public :: closing_programs, make_closing_programs
    public :: turning_each, trace_group_step, list_group_step, out_correction, out_response, out_determinant, out_closing_alarm

    ! ---- outputs
    integer, parameter :: out_correction = 201
    integer, parameter :: out_rate = 202
    integer, parameter :: out_response = 203       !! sum of the squares of A^-1 v, in the units of the unknowns
    integer, parameter :: out_determinant = 204
    integer, parameter :: out_closing_alarm = 205  !! beyond one, rounding may have grown, or a nut is off its thread
    integer, parameter :: out_thread = 206         !! angles of threads by their slides, then their rates
    integer, parameter :: out_corrected = 207      !! places with the correction taken
    integer, parameter :: out_extent = 208         !! how large that is, see `corrected_links`, and how fast the links move

    type :: closing_program
        type(scene_program) :: program
        integer :: n = 0                           !! rows
        integer :: n_thread = 0
        real(wp) :: sense = 1                      !! of the determinant's sign
    end type closing_program

    !> Scratch of one thread.
    type :: closing_space
        type(program_space), allocatable :: slots(:), one(:)   !! (group) for blocks, and for single samples
        type(closing_space), pointer :: next => null()         !! idle as well
    end type closing_space

    type :: space_pool
        type(closing_space), pointer :: first => null()
    end type space_pool

    !> Threads share it. Freed by `free`.
    type, extends(group_closer) :: closing_programs
        type(closing_program), allocatable, private :: of(:)   !! (group)
        type(space_pool), pointer, private :: pool => null()
        logical :: is_tried = .false.                          !! made, or found that it cannot be
        logical :: is_usable = .false.
    contains
        procedure :: make_steps => make_steps_by_record
        procedure :: free => free_programs
    end type closing_programs

contains

    !> Trace the steps of all groups. Poses are representative: pivots are chosen by them.
    subroutine make_closing_programs(model, q, place, margin, programs)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)                        !! (n_q, pose)
        real(wp), intent(in) :: place(:, :, :)                 !! there, as the lanes have found them (place_size, n_link, pose)
        real(wp), intent(in) :: margin(:, :)                   !! likewise (n_group, pose)
        type(closing_programs), intent(out) :: programs
        type(model_type), target :: own
        type(sample_set) :: sample
        integer :: g

        programs%is_tried = .true.
        programs%samples_at_once = block_lanes()
        if (size(q, 2) == 0) return
        own = turning_each(model)
        sample%n = size(q, 2)
        sample%of(in_q)%x = q
        sample%of(in_branch)%x = spread(model%branch, 2, sample%n)
        sample%of(in_place)%x = reshape(place, [size(place, 1)*size(place, 2), sample%n])
        allocate (programs%of(size(model%group)), programs%pool)
        do g = 1, size(model%group)
            call make_program_of_group(own, g, sample, programs%of(g))
            if (.not. programs%of(g)%program%is_made) return
        end do
        programs%is_usable = .true.
        do g = 1, size(model%group)
            if (programs%is_usable) call compare_margins(model, g, q, place, margin(g, :), programs)
        end do
    end subroutine make_closing_programs

    !> The mechanism with all links turning on their own: the groups' rows know of each link's turn, of links that only slide on
    !> each other, too.
    pure function turning_each(model) result(own)
        type(model_type), intent(in) :: model
        type(model_type) :: own
        integer :: l

        own = model
        own%n_orientation = model%n_link
        do l = 1, model%n_link
            own%link(l)%orientation = l
        end do
    end function turning_each

    !> What stands behind a group, if it is needed for it.
    pure function steps_needed(model, at) result(is_needed)
        type(model_type), intent(in) :: model
        integer, intent(in) :: at                              !! step of the group
        logical :: is_needed(at - 1)
        logical :: matters(0:model%n_link)
        integer, allocatable :: link(:), joint(:)
        integer :: i

        matters = .false.
        call find_parts(model, at, link, joint)
        call note(joint, matters)
        do i = at - 1, 1, -1
            call find_parts(model, i, link, joint)
            is_needed(i) = any(matters(link))
            if (is_needed(i)) call note(joint, matters)
        end do

    contains

        pure subroutine note(joint, matters)
            integer, intent(in) :: joint(:)
            logical, intent(inout) :: matters(0:)
            integer :: k

            do k = 1, size(joint)
                matters(model%joint(joint(k))%link) = .true.
            end do
        end subroutine note
    end function steps_needed

    !> Links that a step places, and the joints by which it does: those that lead its variables by gears among them.
    pure subroutine find_parts(model, i, link, joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        integer, allocatable, intent(out) :: link(:), joint(:)
        integer, allocatable :: given(:)
        integer :: k

        associate (step => model%step(i))
            if (step%kind == step_group) then
                link = model%group(step%first)%link
                joint = model%group(step%first)%joint
                given = pack(model%group(step%first)%coordinate, model%group(step%first)%coordinate > model%n_q)
            else
                link = step%link(:step%n_link)
                joint = pack(step%joint, step%joint > 0)
                given = pack(step%coordinate, step%coordinate > model%n_q)
            end if
        end associate
        do k = 1, size(given)
            joint = [joint, model%led(given(k) - model%n_q)%source]
        end do
    end subroutine find_parts

    subroutine make_program_of_group(model, g, sample, closing)
        type(model_type), intent(in), target :: model
        integer, intent(in) :: g
        type(sample_set), intent(in) :: sample
        type(closing_program), intent(inout) :: closing
        type(record_type), target :: record
        type(traced_type) :: traced
        type(newton_step) :: step
        type(group_threads) :: threads
        type(corrected_links) :: corrected
        type(output_list) :: out
        integer :: i

        call open_record(record, sample%n)
        call trace_group_step(model, g, sample, traced, step)
        if (step%is_solved) then
            closing%n = size(model%group(g)%unit)
            closing%n_thread = model%group(g)%n_thread
            call measure_threads(traced%mechanism, model%group(g)%joint, model%group(g)%link, step%rate, threads)
            ! farther off, the nearest turn of a thread need not be that on which its nut is
            traced%mechanism%watched = [traced%mechanism%watched, &
                                        (constant(1/surely_same_turn)*threads%off(i), i=1, model%group(g)%n_thread)]
            call list_group_step(model%group(g), traced, step, out)
            call correct_links(model, model%group(g), traced%place, step%correction, corrected)
            call add_output(out, out_corrected, [corrected%place])
            call add_output(out, out_extent, [corrected%largest, corrected%bounded, corrected%distance, &
                                            fastest(traced%mechanism, model%group(g), step%rate)])
            call add_output(out, out_rate, step%rate)
            if (model%group(g)%n_thread > 0) call add_output(out, out_thread, [threads%angle, threads%rate])
            call make_scene_program(record, traced%in, out, closing%program)
        end if
        call close_record(record)
    end subroutine make_program_of_group

    !> Newton's step of a group into the open record; ask `is_solved` whether there is one.
    subroutine trace_group_step(model, g, sample, traced, step)
        type(model_type), intent(in), target :: model          !! with all links turning on their own
        integer, intent(in) :: g
        type(sample_set), intent(in) :: sample
        type(traced_type), intent(inout) :: traced
        type(newton_step), intent(out) :: step
        type(group_constraints) :: constraints
        integer :: at

        at = findloc(model%step%kind == step_group .and. model%step%first == g, .true., dim=1)
        call begin_trace(model, trace_request(), sample, traced)
        call trace_steps(at - 1, .false., traced, steps_needed(model, at))
        call place_group(traced%mechanism, g, traced%place, constraints)
        if (all(constraints%turns) .and. traced%mechanism%is_solved) &
            call trace_newton_step(traced%mechanism, constraints, model%group(g)%probe, step)
        if (step%is_solved) traced%mechanism%watched = [traced%mechanism%watched, step%watched]
    end subroutine trace_group_step

    !> What it takes from the places, and what it is judged by.
    subroutine list_group_step(group, traced, step, out)
        type(group_type), intent(in) :: group
        type(traced_type), intent(in) :: traced
        type(newton_step), intent(in) :: step
        type(output_list), intent(inout) :: out

        call add_output(out, out_correction, step%correction)
        call add_output(out, out_response, [sum_of_squares(step%response, group%unit)])
        call add_output(out, out_determinant, [step%determinant])
        call add_output(out, out_closing_alarm, [alarm_of(traced)])
    end subroutine list_group_step

    !> In units of the unknowns.
    function sum_of_squares(response, unit) result(s)
        type(value), intent(in) :: response(:, :)              !! (row, probe)
        real(wp), intent(in) :: unit(:)                        !! (row)
        type(value) :: s
        integer :: i, k

        s = zero()
        do k = 1, size(response, 2)
            do i = 1, size(unit)
                s = s + square(constant(1/unit(i))*response(i, k))
            end do
        end do
    end function sum_of_squares

    !> The sense of the determinants; usable if the margins at the representative poses are those of the lanes.
    subroutine compare_margins(model, g, q, place, margin, programs)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g
        real(wp), intent(in), contiguous :: q(:, :), place(:, :, :)
        real(wp), intent(in) :: margin(:)
        type(closing_programs), intent(inout) :: programs
        real(wp), parameter :: alike = 1.0e-6_wp               !! eps over the margin, for margins that say something
        real(wp), dimension(size(q, 2)) :: found
        logical, dimension(size(q, 2)) :: is_sure
        integer :: k

        call programs%make_steps(g, transpose(q), 0*transpose(q), spread(model%branch, 1, size(q, 2)), &
                                 reshape(place, [size(place, 3), size(place, 1), size(place, 2)], order=[2, 3, 1]), found, is_sure)
        k = findloc(is_sure, .true., dim=1)
        programs%is_usable = k > 0
        if (k == 0) return
        if (found(k)*margin(k) < 0) then
            programs%of(g)%sense = -1
            found = -found
        end if
        programs%is_usable = all(abs(found - margin) <= alike*abs(margin) .or. .not. is_sure)
    end subroutine compare_margins

    !> See `group_closer`.
    subroutine make_steps_by_record(self, g, q, qd, branch, place, margin, is_sure, correction, rate, thread, corrected, extent, &
                                    only_leads)
        class(closing_programs), intent(in) :: self
        integer, intent(in) :: g
        real(wp), intent(in), contiguous, target :: q(:, :), qd(:, :), branch(:, :), place(:, :, :)
        real(wp), intent(out) :: margin(:)
        logical, intent(out) :: is_sure(:)
        real(wp), intent(out), contiguous, target, optional :: correction(:, :), rate(:, :), thread(:, :), corrected(:, :), &
            extent(:, :)
        logical, intent(in), optional :: only_leads
        !> Pivots so much smaller than usual, as they are where a margin has gone down to the least that can be told: nine digits
        !> are left of a step at least, and of a margin's rate two.
        real(wp), parameter :: forgiven = 1.0e5_wp
        type(closing_space), pointer :: space
        real(wp) :: limit
        type(sample_arrays) :: arrays
        type(output_target) :: to(8)
        real(wp), dimension(most_lanes, 1), target :: response, determinant, alarm
        logical :: is_bad(most_lanes)
        integer :: first, n

        call show(in_q, size(q, 2), q)
        call show(in_qd, size(qd, 2), qd)
        call show(in_branch, size(branch, 2), branch)
        call show(in_place, size(place, 2)*size(place, 3), place)
        to(:3) = [goes_to(out_response, response, .true.), goes_to(out_determinant, determinant, .true.), &
                  goes_to(out_closing_alarm, alarm, .true.)]
        if (present(correction)) to(4) = goes_to(out_correction, correction)
        if (present(rate)) to(5) = goes_to(out_rate, rate)
        if (present(thread)) to(6) = goes_to(out_thread, thread)
        if (present(corrected)) to(7) = goes_to(out_corrected, corrected)
        if (present(extent)) to(8) = goes_to(out_extent, extent)
        limit = 1
        if (present(only_leads) .and. self%of(g)%n_thread == 0) limit = merge(forgiven**2, limit, only_leads)
        call take_space(self, space)
        do first = 1, size(q, 1), self%samples_at_once
            n = min(self%samples_at_once, size(q, 1) - first + 1)
            if (size(q, 1) == 1) then
                call run_alone(self%of(g)%program, arrays, space%one(g), to, is_bad(1))
            else
                call load_columns(self%of(g)%program, arrays, first, n, space%slots(g))
                call run_columns(self%of(g)%program, space%slots(g), first, n, to, is_bad(:n))
            end if
            ! A direction of n has the n-th part of a unit vector's square, on average.
            margin(first:first + n - 1) = sign(sqrt(n_probe/(self%of(g)%n*response(:n, 1))), self%of(g)%sense*determinant(:n, 1))
            ! Written so that what is no number is not sure.
            is_sure(first:first + n - 1) = alarm(:n, 1) <= limit .and. .not. is_bad(:n)
        end do
        call return_space(self, space)

    contains

        !> Numbers of the samples; those of a single one stand in a row.
        subroutine show(block, n, x)
            integer, intent(in) :: block                       !! one of `in_*`
            integer, intent(in) :: n
            real(wp), intent(in), target :: x(*)               !! (sample, n)

            if (size(q, 1) == 1) then
                arrays%of(block)%x(1:n, 1:1) => x(:n)
            else
                arrays%of(block)%x(1:size(q, 1), 1:n) => x(:size(q, 1)*n)
            end if
        end subroutine show
    end subroutine make_steps_by_record

    !> One sample, as a run has it, which takes a part of what a block takes.
    subroutine run_alone(program, arrays, one, to, is_bad)
        type(scene_program), intent(in) :: program
        type(sample_arrays), intent(in) :: arrays
        type(program_space), intent(inout) :: one
        type(output_target), intent(in) :: to(:)               !! (sample, value)
        logical, intent(out) :: is_bad
        real(wp) :: output(program%program%n_output)
        integer :: t, k

        call run_one_sample(program, arrays, one, output)
        is_bad = .false.
        do t = 1, size(to)
            if (to(t)%id == 0) cycle
            k = has_output(program, to(t)%id)
            if (k == 0) cycle
            associate (found => output(program%first(k):program%first(k) + program%n(k) - 1))
                to(t)%x(1, :size(found)) = found
                is_bad = is_bad .or. .not. all(abs(found) <= huge(1.0_wp))
            end associate
        end do
    end subroutine run_alone

    !> Idle scratch, or new.
    subroutine take_space(self, space)
        type(closing_programs), intent(in) :: self
        type(closing_space), pointer, intent(out) :: space

        call hold_lock()
        space => self%pool%first
        if (associated(space)) self%pool%first => space%next
        call release_lock()
        if (associated(space)) return
        allocate (space)
        allocate (space%slots(size(self%of)), space%one(size(self%of)))
    end subroutine take_space

    subroutine return_space(self, space)
        type(closing_programs), intent(in) :: self
        type(closing_space), pointer, intent(inout) :: space

        call hold_lock()
        space%next => self%pool%first
        self%pool%first => space
        call release_lock()
    end subroutine return_space

    !> Give everything back. No thread may be using it.
    subroutine free_programs(self)
        class(closing_programs), intent(inout) :: self
        type(closing_space), pointer :: space
        integer :: g

        self%is_usable = .false.
        if (associated(self%pool)) then
            do while (associated(self%pool%first))
                space => self%pool%first
                self%pool%first => space%next
                do g = 1, size(space%slots)
                    call free_program_space(space%slots(g))
                    call free_program_space(space%one(g))
                end do
                deallocate (space)
            end do
            deallocate (self%pool)
        end if
        if (.not. allocated(self%of)) return
        do g = 1, size(self%of)
            call free_scene_program(self%of(g)%program)
        end do
    end subroutine free_programs
end module linkdyn_closing_programs
