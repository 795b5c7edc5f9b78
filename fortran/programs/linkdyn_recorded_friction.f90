!> Friction that fits the reactions which it changes, by a record: what does not depend on it is computed once a sample.
!>
!> Three programs of one trace. The first finds all that friction leaves alone: motion, elimination of the matrix, how fast
!> contacts slide. The second has what presses for given friction; it is run until nothing changes. The third has the results.
module linkdyn_recorded_friction
    use linkdyn_contact, only: contact_type, friction_of_speed, has_settled, most_rounds
    use linkdyn_force_program, only: trace_forces, list_forces
    use linkdyn_friction, only: pressing_force
    use linkdyn_inputs, only: trace_request, sample_set, in_friction, in_found
    use linkdyn_kernel, only: find_boundary
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene_program, only: scene_program, program_space, sample_arrays, output_list, add_output, make_scene_program, &
        load_samples, run_samples, run_one_sample, goes_to, free_scene_program, free_program_space
    use linkdyn_trace, only: traced_type, pressed_by
    use linkdyn_value, only: value
    implicit none (type, external)
    private
    public :: friction_programs, friction_space, make_friction_programs, compile_with_friction, settle_block, settle_one, &
        free_friction_programs, free_friction_space

    integer, parameter :: out_found = 103, out_square = 104, out_force = 105

    type :: friction_programs
        type(scene_program) :: before, press
        type(contact_type), allocatable :: contact(:)
        integer :: n_found = 0                         !! numbers that the first program hands on
        logical :: is_made = .false.
    end type friction_programs

    !> Scratch of one thread.
    type :: friction_space
        type(program_space) :: before, press           !! of blocks
        type(program_space) :: before_one, press_one   !! of single samples
        real(wp), allocatable :: found(:, :)           !! (n_found, lane)
        real(wp), allocatable :: square(:, :)          !! of the speeds of surfaces (contact, lane) [m2/s2]
        real(wp), allocatable :: force(:, :)           !! that presses (contact, lane) [N]
        real(wp), allocatable :: amount(:, :)          !! of friction (contact, lane) [N s/m]
        real(wp), allocatable :: force_before(:, :), factor(:, :)
    end type friction_space

contains

    !> Trace a scene and compile all three. Without pivots that serve the samples none is made.
    subroutine make_friction_programs(model, request, wanted, sample, programs, after)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        integer, intent(in) :: wanted(:)               !! `result_*` of the catalogue, some of which need equations
        type(sample_set), intent(in) :: sample         !! representative: pivots are chosen by them
        type(friction_programs), intent(inout) :: programs
        type(scene_program), intent(inout) :: after
        type(record_type), target :: record
        type(traced_type) :: traced
        type(output_list) :: results

        call open_record(record, sample%n)
        call trace_forces(model, request, wanted, sample, traced)
        if (traced%mechanism%is_solved .and. allocated(traced%contact)) then
            call list_forces(wanted, traced, results)
            call compile_with_friction(record, traced, results, programs, after)
        end if
        call close_record(record)
    end subroutine make_friction_programs

    !> All three of an open record, its equations solved.
    subroutine compile_with_friction(record, traced, results, programs, after)
        type(record_type), intent(in) :: record
        type(traced_type), intent(inout) :: traced
        type(output_list), intent(in) :: results
        type(friction_programs), intent(inout) :: programs
        type(scene_program), intent(inout) :: after
        type(output_list) :: press, before
        type(value) :: force(size(traced%contact))
        integer, allocatable :: boundary(:)
        integer :: i

        associate (contact => traced%mechanism%model%contact)
            do i = 1, size(force)
                force(i) = pressing_force(traced%mechanism, i, pressed_by(traced, i))
            end do
            programs%contact = contact
        end associate
        call add_output(press, out_force, force)
        call find_boundary(record, [press%v, results%v], traced%in%of(in_friction)%v, boundary)
        call add_output(before, out_found, [(value(boundary(i), 1), i=1, size(boundary))])
        call add_output(before, out_square, traced%contact%square)
        call make_scene_program(record, traced%in, before, programs%before)
        call make_scene_program(record, traced%in, press, programs%press, boundary)
        call make_scene_program(record, traced%in, results, after, boundary)
        programs%n_found = size(boundary)
        programs%is_made = .true.
    end subroutine compile_with_friction

    !> Friction of the samples first, ..., first + count - 1: `settled` are the arrays with it, for the third program. Samples at
    !> which it does not come to rest are left.
    subroutine settle_block(programs, lanes, arrays, first, count, space, settled, is_left)
        type(friction_programs), intent(in) :: programs
        integer, intent(in) :: lanes                   !! of a block
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: first, count
        type(friction_space), intent(inout), target :: space
        type(sample_arrays), intent(out) :: settled
        logical, intent(inout) :: is_left(count)
        real(wp), dimension(count) :: change, change_before
        logical :: rests(count)
        integer :: n, i

        if (.not. allocated(space%found)) call make_room(programs, lanes, space)
        settled = arrays
        settled%of(in_found)%x => space%found
        settled%of(in_found)%before = first - 1
        settled%of(in_friction)%x => space%amount
        settled%of(in_friction)%before = first - 1
        call load_samples(programs%before, arrays, first, count, space%before)
        call run_samples(programs%before, space%before, first, count, [goes_to(out_found, space%found, is_of_block=.true.), &
                                                                      goes_to(out_square, space%square, is_of_block=.true.)])
        do i = 1, count
            space%factor(:, i) = friction_of_speed(programs%contact, sqrt(max(space%square(:, i), 0.0_wp)))
        end do
        space%amount = 0
        call load_samples(programs%press, settled, first, count, space%press)
        call run_samples(programs%press, space%press, first, count, [goes_to(out_force, space%force_before, is_of_block=.true.)])
        rests = is_left
        change_before = 1                              ! from no friction to some
        do n = 1, most_rounds
            do i = 1, count
                if (.not. rests(i)) space%amount(:, i) = space%factor(:, i)*space%force_before(:, i)
            end do
            call load_samples(programs%press, settled, first, count, space%press, only_block=in_friction)
            call run_samples(programs%press, space%press, first, count, [goes_to(out_force, space%force, is_of_block=.true.)])
            do i = 1, count
                change(i) = maxval(abs(space%force(:, i) - space%force_before(:, i)))/max(maxval(space%force(:, i)), tiny(1.0_wp))
            end do
            do i = 1, count
                if (rests(i)) cycle
                rests(i) = has_settled(change(i), change_before(i))
                if (rests(i)) space%amount(:, i) = space%factor(:, i)*space%force(:, i)
            end do
            if (all(rests)) exit
            space%force_before(:, :count) = space%force(:, :count)
            change_before = change
        end do
        is_left = is_left .or. .not. rests
    end subroutine settle_block

    !> The same for the first sample of the arrays alone.
    subroutine settle_one(programs, lanes, arrays, space, settled, is_left)
        type(friction_programs), intent(in) :: programs
        integer, intent(in) :: lanes                   !! of a block
        type(sample_arrays), intent(in) :: arrays
        type(friction_space), intent(inout), target :: space
        type(sample_arrays), intent(out) :: settled
        logical, intent(out) :: is_left
        real(wp) :: both(programs%n_found + size(programs%contact)), change, change_before
        integer :: n

        if (.not. allocated(space%found)) call make_room(programs, lanes, space)
        settled = arrays
        settled%of(in_found)%x => space%found
        settled%of(in_friction)%x => space%amount
        call run_one_sample(programs%before, arrays, space%before_one, both)
        associate (amount => space%amount(:, 1), factor => space%factor(:, 1), force => space%force(:, 1), &
                   force_before => space%force_before(:, 1))
            space%found(:, 1) = both(:programs%n_found)
            factor = friction_of_speed(programs%contact, sqrt(max(both(programs%n_found + 1:), 0.0_wp)))
            amount = 0
            call run_one_sample(programs%press, settled, space%press_one, force_before)
            change_before = 1                          ! from no friction to some
            is_left = .false.
            do n = 1, most_rounds
                amount = factor*force_before
                call run_one_sample(programs%press, settled, space%press_one, force)
                change = maxval(abs(force - force_before))/max(maxval(force), tiny(1.0_wp))
                if (has_settled(change, change_before)) then
                    amount = factor*force
                    return
                end if
                force_before = force
                change_before = change
            end do
        end associate
        is_left = .true.
    end subroutine settle_one

    subroutine make_room(programs, lanes, space)
        type(friction_programs), intent(in) :: programs
        integer, intent(in) :: lanes
        type(friction_space), intent(inout) :: space

        associate (n => size(programs%contact))
            allocate (space%found(programs%n_found, lanes), space%square(n, lanes), space%force(n, lanes), &
                      space%amount(n, lanes), space%force_before(n, lanes), space%factor(n, lanes))
        end associate
        space%found = 0
        space%square = 0
        space%force = 0
        space%force_before = 0
        space%factor = 0
    end subroutine make_room

    subroutine free_friction_programs(programs)
        type(friction_programs), intent(inout) :: programs

        call free_scene_program(programs%before)
        call free_scene_program(programs%press)
        programs%is_made = .false.
    end subroutine free_friction_programs

    subroutine free_friction_space(space)
        type(friction_space), intent(inout) :: space

        call free_program_space(space%before)
        call free_program_space(space%press)
        call free_program_space(space%before_one)
        call free_program_space(space%press_one)
    end subroutine free_friction_space
end module linkdyn_recorded_friction
