!> Friction that fits the reactions which it changes, by a record: what does not depend on it is computed once a sample.
!>
!> Three programs of one trace. The first finds all that friction leaves alone: motion, elimination of the matrix, how fast
!> contacts slide. The second has what presses for given friction; it is run until nothing changes. The third has the results.
!>
!> Motors whose transmissions lose some of a given torque (`linkdyn_loss_balance`) hang on friction, and friction on them: the
!> second program has what they transmit, too, and how that changes with driving forces, so that both settle in the same rounds.
module linkdyn_recorded_friction
    use linkdyn_block, only: block_lanes
    use linkdyn_contact, only: contact_type, has_settled, most_rounds, n_part
    use linkdyn_force_program, only: trace_forces, list_forces
    use linkdyn_friction, only: pressing_force
    use linkdyn_friction_law, only: friction_of_speeds, friction_one_way
    use linkdyn_inputs, only: trace_request, sample_set, in_effort, in_friction, in_found, in_sense
    use linkdyn_kernel, only: find_boundary
    use linkdyn_kinds, only: wp
    use linkdyn_loss_balance, only: lossy_samples, renew_losses
    use linkdyn_model, only: model_type
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene_program, only: scene_program, program_space, sample_arrays, output_list, add_output, make_scene_program, &
        load_samples, load_block, run_columns, run_ahead, hand_found_on, run_one_sample, load_one_sample, run_loaded_one, goes_to, &
        free_scene_program, free_program_space, most_lanes
    use linkdyn_trace, only: traced_type, pressed_by
    use linkdyn_value, only: value
    implicit none (type, external)
    private
    public :: friction_programs, friction_space, make_friction_programs, compile_with_friction, settle_block, load_settled, &
        settle_one, free_friction_programs, free_friction_space

    integer, parameter :: out_found = 103, out_square = 104, out_force = 105, out_transmitted = 106

    type :: friction_programs
        type(scene_program) :: before, press
        type(contact_type), allocatable :: contact(:)
        integer :: n_found = 0                         !! numbers that the first program hands on
        integer :: n_lossy = 0                         !! motors of whose losses the second tells
        logical :: is_made = .false.
    end type friction_programs

    !> Scratch of one thread.
    type :: friction_space
        type(program_space) :: before, press           !! of blocks; what the first has found stays among the second's inputs
        type(program_space) :: before_one, press_one   !! of single samples
        real(wp), allocatable :: speed(:, :)           !! at which contacts slide (lane, contact) [m/s]
        real(wp), allocatable :: factor(:, :)          !! friction over pressing force and speed (lane, contact) [s/m]
        real(wp), allocatable :: force(:, :)           !! that presses (lane, contact) [N]
        real(wp), allocatable :: force_after(:, :)     !! with friction as that makes it
        real(wp), allocatable :: amount(:, :)          !! of friction (lane, contact) [N s/m]
        real(wp), allocatable :: effort(:, :)          !! driving forces (lane, n_actuator) [N, N m]
        real(wp), allocatable :: transmitted(:, :)     !! by lossy motors, then how that changes with each (lane, number)
        real(wp), allocatable :: found_of_one(:, :), amount_of_one(:, :)       !! of a single sample (number, 1)
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
    subroutine compile_with_friction(record, traced, results, programs, after, effort, transmitted)
        type(record_type), intent(in) :: record
        type(traced_type), intent(inout) :: traced
        type(output_list), intent(in) :: results
        type(friction_programs), intent(inout) :: programs
        type(scene_program), intent(inout) :: after
        type(value), intent(in), optional :: effort(:)        !! driving forces of lossy motors (motor)
        type(value), intent(in), optional :: transmitted(:)   !! by them, then how that changes with each (motor + motor, of motor)
        type(output_list) :: press, before
        type(value) :: force(size(traced%contact))
        type(value), allocatable :: late(:)
        integer, allocatable :: boundary(:)
        integer :: i

        associate (contact => traced%mechanism%model%contact)
            do i = 1, size(force)
                force(i) = pressing_force(traced%mechanism, i, pressed_by(traced, i))
            end do
            programs%contact = contact
        end associate
        call add_output(press, out_force, force)
        late = traced%in%of(in_friction)%v
        if (present(effort)) then
            late = [late, effort]
            programs%n_lossy = size(effort)
            if (size(effort) > 0) call add_output(press, out_transmitted, transmitted)
        end if
        call find_boundary(record, [press%v, results%v], late, boundary)
        call add_output(before, out_found, [(value(boundary(i), 1), i=1, size(boundary))])
        call add_output(before, out_square, traced%contact%square)
        call make_scene_program(record, traced%in, before, programs%before)
        call make_scene_program(record, traced%in, press, programs%press, boundary)
        call make_scene_program(record, traced%in, results, after, boundary)
        programs%n_found = size(boundary)
        programs%is_made = .true.
    end subroutine compile_with_friction

    !> Friction of the samples first, ..., first + count - 1, for the third program (`load_settled`). Samples at which it does not
    !> come to rest are left. Numbers lie in columns, as programs take and give them.
    subroutine settle_block(programs, arrays, first, count, space, is_left, lossy)
        type(friction_programs), intent(in) :: programs
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: first, count
        type(friction_space), intent(inout), target :: space
        logical, intent(inout) :: is_left(count)
        type(lossy_samples), intent(inout), optional :: lossy  !! of all samples; their driving forces in the arrays are less what
                                                               !! is lost
        real(wp), dimension(most_lanes) :: change, change_before
        logical, dimension(most_lanes) :: rests, fails
        integer :: n

        call make_room(programs, space)
        call find_factors(programs, arrays, first, count, space)
        space%amount = 0
        call load_samples(programs%press, arrays, first, count, space%press, without=[in_found, in_friction])
        call find_forces(programs, count, space, space%force, fails)
        is_left = is_left .or. fails(:count)
        rests(:count) = is_left
        change_before(:count) = 1                      ! from no friction to some
        change(:count) = 0
        if (present(lossy)) call find_losses(first, count, rests(:count), space%transmitted, lossy, is_left, change(:count))
        do n = 1, most_rounds
            if (all(rests(:count))) exit
            call multiply(size(space%force), space%factor, space%force, space%amount)
            if (present(lossy)) call load_efforts()
            call find_forces(programs, count, space, space%force_after, fails)
            call find_changes(size(space%force, 1), size(space%force, 2), space%force, space%force_after, change)
            if (present(lossy)) &
                call find_losses(first, count, rests(:count) .or. fails(:count), space%transmitted, lossy, is_left, change(:count))
            call keep_forces(rests(:count), space%force, space%force_after)
            call exchange(space%force, space%force_after)
            is_left = is_left .or. (fails(:count) .and. .not. rests(:count))
            rests(:count) = rests(:count) .or. fails(:count) .or. is_left .or. has_settled(change(:count), change_before(:count))
            change_before(:count) = change(:count)
        end do
        is_left = is_left .or. .not. rests(:count)
        call multiply(size(space%force), space%factor, space%force, space%amount)
        if (present(lossy)) call put_efforts(arrays, first, count, lossy)

    contains

        subroutine load_efforts()
            call put_efforts(arrays, first, count, lossy)
            associate (x => arrays%of(in_effort)%x)
                if (.not. allocated(space%effort)) allocate (space%effort(block_lanes(), size(x, 1)), source=0.0_wp)
                space%effort(:count, :) = transpose(x(:, first:first + count - 1))
            end associate
            call load_block(programs%press, in_effort, size(space%effort, 1), space%effort, count, space%press)
        end subroutine load_efforts
    end subroutine settle_block

    !> Driving forces less what is lost, where programs take them.
    subroutine put_efforts(arrays, first, count, lossy)
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: first, count
        type(lossy_samples), intent(in) :: lossy
        integer :: s

        do s = first, first + count - 1
            arrays%of(in_effort)%x(lossy%actuator, s) = lossy%efforts(s)
        end do
    end subroutine put_efforts

    !> What is lost, of samples that do not rest; where that may not be the only solution they are left.
    pure subroutine find_losses(first, count, rests, transmitted, lossy, is_left, change)
        integer, intent(in) :: first, count
        logical, intent(in) :: rests(count)
        real(wp), intent(in) :: transmitted(:, :)      !! as in `friction_space`
        type(lossy_samples), intent(inout) :: lossy
        logical, intent(inout) :: is_left(count)
        real(wp), intent(inout) :: change(count)       !! the largest, relative
        real(wp) :: of_losses
        logical :: is_unique
        integer :: i, n

        n = size(lossy%actuator)
        do i = 1, count
            if (rests(i) .or. is_left(i)) cycle
            call renew_losses(transmitted(i, :n), reshape(transmitted(i, n + 1:), [n, n]), first + i - 1, lossy, &
                              is_unique, of_losses)
            is_left(i) = .not. is_unique
            change(i) = max(change(i), of_losses)
        end do
    end subroutine find_losses

    !> What friction leaves alone goes to the second program; and how much contacts rub for each newton that presses.
    subroutine find_factors(programs, arrays, first, count, space)
        type(friction_programs), intent(in) :: programs
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: first, count
        type(friction_space), intent(inout), target :: space
        integer :: i

        call load_samples(programs%before, arrays, first, count, space%before)
        call run_ahead(programs%before, space%before, count, out_found, programs%press, space%press, &
                       goes_to(out_square, space%factor, is_of_block=.true.))
        associate (speed => space%speed)
            call find_speeds(size(speed), space%factor, speed)
            speed(count + 1:, :) = 0                   ! of lanes to spare
            call friction_of_speeds(programs%contact, size(speed, 1), speed, space%factor)
            if (.not. associated(arrays%of(in_sense)%x)) return
            do i = 1, size(programs%contact)
                call slide_one_way(programs%contact(i), senses(arrays, i, first, count), speed(:count, i), space%factor(:count, i))
            end do
        end associate
    end subroutine find_factors

    !> Of their squares, which rounding may have taken below zero.
    pure subroutine find_speeds(n, square, speed)
        integer, intent(in) :: n
        real(wp), intent(in) :: square(n)              !! [m2/s2]
        real(wp), intent(inout) :: speed(n)            !! [m/s]
        integer :: i

        do i = 1, n
            speed(i) = sqrt(merge(square(i), 0.0_wp, square(i) > 0))
        end do
    end subroutine find_speeds

    !> Factors of a contact that may stick, in samples in which it slides one way or holds.
    pure subroutine slide_one_way(contact, sense, speed, factor)
        type(contact_type), intent(in) :: contact
        real(wp), intent(in) :: sense(:)               !! 0: smooth over its speed (sample)
        real(wp), intent(in) :: speed(:)               !! (sample) [m/s]
        real(wp), intent(inout) :: factor(:)           !! (sample) [s/m]
        integer :: i

        do i = 1, size(factor)
            if (sense(i) > 0) factor(i) = friction_one_way(contact, sense(i), speed(i))
        end do
    end subroutine slide_one_way

    !> The largest part of a contact's direction in each sample of arrays that know it.
    pure function senses(arrays, contact, first, count) result(sense)
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: contact, first, count
        real(wp) :: sense(count)

        sense = maxval(abs(arrays%of(in_sense)%x(n_part*(contact - 1) + 1:n_part*contact, first:first + count - 1)), dim=1)
    end function senses

    !> What presses with the friction that there is.
    subroutine find_forces(programs, count, space, force, fails)
        type(friction_programs), intent(in) :: programs
        integer, intent(in) :: count
        type(friction_space), intent(inout), target :: space
        real(wp), intent(inout), target, contiguous :: force(:, :)     !! (lane, contact) [N]
        logical, intent(out) :: fails(:)               !! one of a sample is not finite (count)

        call load_block(programs%press, in_friction, size(space%amount, 1), space%amount, count, space%press)
        call run_columns(programs%press, space%press, 1, count, [goes_to(out_force, force, is_of_block=.true.), &
                                                                 goes_to(out_transmitted, space%transmitted, is_of_block=.true.)], &
                         fails(:count))
    end subroutine find_forces

    !> c = a b.
    pure subroutine multiply(n, a, b, c)
        integer, intent(in) :: n
        real(wp), intent(in) :: a(n), b(n)
        real(wp), intent(inout) :: c(n)

        c = a*b
    end subroutine multiply

    !> The largest change of a force in each sample, relative to its largest force.
    pure subroutine find_changes(lanes, n, force, force_after, change)
        integer, intent(in) :: lanes, n
        real(wp), intent(in), dimension(lanes, n) :: force, force_after    !! (lane, contact) [N]
        real(wp), intent(out) :: change(lanes)
        real(wp) :: largest(most_lanes)
        integer :: i, k

        change = 0
        largest(:lanes) = tiny(1.0_wp)
        do k = 1, n
            do i = 1, lanes
                change(i) = max(change(i), abs(force_after(i, k) - force(i, k)))
                largest(i) = max(largest(i), force_after(i, k))
            end do
        end do
        change = change/largest(:lanes)
    end subroutine find_changes

    !> Samples that rest keep the forces that they have: what becomes of one does not hang on those beside it.
    pure subroutine keep_forces(rests, force, force_after)
        logical, intent(in) :: rests(:)
        real(wp), intent(in) :: force(:, :)            !! (lane, contact) [N]
        real(wp), intent(inout) :: force_after(:, :)
        integer :: i

        if (.not. any(rests)) return
        do i = 1, size(rests)
            if (rests(i)) force_after(i, :) = force(i, :)
        end do
    end subroutine keep_forces

    pure subroutine exchange(a, b)
        real(wp), allocatable, intent(inout) :: a(:, :), b(:, :)
        real(wp), allocatable :: other(:, :)

        call move_alloc(a, other)
        call move_alloc(b, a)
        call move_alloc(other, b)
    end subroutine exchange

    !> Inputs of the third program, for the samples that have been settled.
    subroutine load_settled(programs, program, arrays, first, count, settled, space)
        type(friction_programs), intent(in) :: programs
        type(scene_program), intent(in) :: program     !! the third
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: first, count
        type(friction_space), intent(in) :: settled
        type(program_space), intent(inout) :: space

        call load_samples(program, arrays, first, count, space, without=[in_found, in_friction])
        call hand_found_on(programs%press, settled%press, program, space)
        call load_block(program, in_friction, size(settled%amount, 1), settled%amount, count, space)
    end subroutine load_settled

    !> The same for the first sample of the arrays alone: `settled` are the arrays with its friction, for the third program.
    subroutine settle_one(programs, arrays, space, settled, is_left, lossy)
        type(friction_programs), intent(in) :: programs
        type(sample_arrays), intent(in) :: arrays
        type(friction_space), intent(inout), target :: space
        type(sample_arrays), intent(out) :: settled
        logical, intent(out) :: is_left
        type(lossy_samples), intent(inout), optional :: lossy  !! as in `settle_block`
        real(wp) :: both(programs%n_found + size(programs%contact)), change, change_before
        real(wp) :: pressed(1, size(programs%contact) + programs%n_lossy*(1 + programs%n_lossy))
        real(wp), dimension(size(programs%contact)) :: speed, factor, force, force_before
        logical :: fails(1)
        integer :: n, i

        if (.not. allocated(space%found_of_one)) &
            allocate (space%found_of_one(programs%n_found, 1), space%amount_of_one(size(programs%contact), 1))
        settled = arrays
        settled%of(in_found)%x => space%found_of_one
        settled%of(in_friction)%x => space%amount_of_one
        call run_one_sample(programs%before, arrays, space%before_one, both)
        associate (amount => space%amount_of_one(:, 1))
            space%found_of_one(:, 1) = both(:programs%n_found)
            speed = sqrt(max(both(programs%n_found + 1:), 0.0_wp))
            call friction_of_speeds(programs%contact, 1, speed, factor)
            if (associated(arrays%of(in_sense)%x)) then
                do i = 1, size(factor)
                    call slide_one_way(programs%contact(i), senses(arrays, i, 1, 1), speed(i:i), factor(i:i))
                end do
            end if
            amount = 0
            call load_one_sample(programs%press, settled, space%press_one)
            call run_loaded_one(programs%press, space%press_one, pressed(1, :))
            force_before = pressed(1, :size(force))
            change_before = 1                          ! from no friction to some
            change = 0
            fails = .false.
            if (present(lossy)) call lose()
            do n = 1, most_rounds
                if (fails(1)) exit
                amount = factor*force_before
                call load_one_sample(programs%press, settled, space%press_one, only_block=in_friction)
                if (present(lossy)) call load_one_sample(programs%press, settled, space%press_one, only_block=in_effort)
                call run_loaded_one(programs%press, space%press_one, pressed(1, :))
                force = pressed(1, :size(force))
                change = maxval(abs(force - force_before))/max(maxval(force), tiny(1.0_wp))
                if (present(lossy)) call lose()
                is_left = fails(1)
                if (has_settled(change, change_before)) then
                    amount = factor*force
                    return
                end if
                force_before = force
                change_before = change
            end do
        end associate
        is_left = .true.

    contains

        subroutine lose()
            real(wp) :: of_losses(1)

            of_losses = change
            call find_losses(1, 1, [.false.], pressed(:, size(force) + 1:), lossy, fails, of_losses)
            change = of_losses(1)
            call put_efforts(settled, 1, 1, lossy)
        end subroutine lose
    end subroutine settle_one

    !> Scratch of blocks, made by whoever comes first.
    subroutine make_room(programs, space)
        type(friction_programs), intent(in) :: programs
        type(friction_space), intent(inout) :: space

        if (allocated(space%force)) return
        associate (n => size(programs%contact), lanes => block_lanes())
            allocate (space%speed(lanes, n), source=0.0_wp)
            allocate (space%factor(lanes, n), space%force(lanes, n), space%force_after(lanes, n), space%amount(lanes, n))
            allocate (space%transmitted(lanes, programs%n_lossy*(1 + programs%n_lossy)))
        end associate
        space%factor = 0                               ! in lanes that no sample has
        space%force = 0
        space%force_after = 0
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
