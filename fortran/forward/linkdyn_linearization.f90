!> Linearization of a mechanism at a state: columns of its accelerations and joint variables by coordinates, their rates and what
!> drives. A run is asked for its record, how its links stand, and what acts there; the columns come from one more program of the
!> record (`linkdyn_linear_program`), so that nothing is approximated.
!>
!> What no column tells is refused by its name: parts with states of their own, and those that hold.
module linkdyn_linearization
    use linkdyn_clutch_friction, only: has_sticking
    use linkdyn_contact, only: most_rounds
    use linkdyn_dense, only: dense_workspace, solve_dense
    use linkdyn_effort_laws, only: compares_motion
    use linkdyn_forward_record, only: make_forward_columns
    use linkdyn_forward_system, only: forward_system
    use linkdyn_friction_law, only: friction_of_speed, friction_slope
    use linkdyn_inputs, only: in_q, in_qd, in_load, in_target, in_effort, in_branch, in_place, in_pull, in_base, in_payload, &
        in_counted, in_friction, in_direction
    use linkdyn_kinds, only: wp
    use linkdyn_law_values, only: differentiate_laws
    use linkdyn_laws, only: evaluate_law
    use linkdyn_linear_program, only: direction_places, linear_outputs, directions_of, run_linear
    use linkdyn_lock, only: hold_records, release_records
    use linkdyn_model, only: pull_power, effort_power
    use linkdyn_motor_laws, only: torque_of_law, available_torque, has_winding
    use linkdyn_samples, only: sample_arrays, set_block
    use linkdyn_scene, only: effort_law, effort_inverse, effort_constant, effort_over, law_spec, law_over, law_none, side_voltage, &
        side_opening, is_at_motor, n_clutch, n_controller
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_stop_states, only: rests_anywhere
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: linearization, linearize_system

    type :: linearization
        real(wp), allocatable :: at(:)                 !! accelerations of the coordinates (n_q), joint variables, their rates (2
                                                       !! n_variable)
        real(wp), allocatable :: column(:, :)          !! how these change with coordinates, their rates, what drives (of, 2 n_q +
                                                       !! n_actuator)
    end type linearization

contains

    !> Columns at a state of a run whose actuators do as they are told.
    !>
    !> **Errors**: parts that no column tells; a state that the record does not serve.
    subroutine linearize_system(system, law, t, y, q, qd, effort, follows_laws, found, status)
        type(forward_system), intent(inout) :: system
        type(effort_law), intent(in) :: law(:)         !! of the scene's actuators (n_actuator)
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:)                   !! the state (n)
        real(wp), intent(in), target :: q(:), qd(:)    !! the same (n_q) [m, rad; /s]
        real(wp), intent(inout) :: effort(:)           !! of the actuators; of those that follow laws what these give
        logical, intent(in) :: follows_laws
        type(linearization), intent(out) :: found
        type(status_type), intent(inout) :: status
        type(sample_arrays) :: arrays
        real(wp), allocatable, target :: direction(:, :), column(:, :), at_t(:), force(:), friction(:)
        integer :: n
        logical :: is_bad

        call refuse_parts(system, law, status)
        if (status%is_ok()) call need_columns(system, law, t, y, status)
        if (.not. status%is_ok()) return
        n = 2*system%model%n_q + system%model%n_actuator
        call lay_out(n + size(system%model%contact))
        associate (recorded => system%record%recorded, out => system%record%recorded%column)
            call run_linear(recorded%linear, arrays, size(column, 2), column, is_bad)
            call follow(system, law, follows_laws, at_t, column, direction, effort, force, status)
            if (.not. status%is_ok()) return
            call settle_friction(system, arrays, n, column, friction, is_bad)
            is_bad = is_bad .or. .not. (all(column(out%alarm, :) <= 1) .and. all(column(out%reach, :) > 0))
            if (is_bad) then
                call refuse_place(status)
                return
            end if
            found%at = column(:out%measure - 1, 1)
            found%column = column(out%change + 1:out%change + out%measure - 1, :n)
        end associate

    contains

        !> Samples that differ in their directions alone: one for each column, and for the friction of each contact.
        subroutine lay_out(n_sample)
            integer, intent(in) :: n_sample
            type(direction_places) :: place
            real(wp) :: ignored
            integer :: k

            place = directions_of(system%model)
            allocate (direction(place%n, n_sample), at_t(2*size(law)), friction(size(system%model%contact)), source=0.0_wp)
            allocate (column(system%record%recorded%column%n, n_sample), source=0.0_wp)
            do k = 1, n
                direction(k, k) = 1
            end do
            do k = 1, size(friction)
                direction(place%friction + k - 1, n + k) = 1
            end do
            do k = 1, size(law)
                if (law(k)%target%kind /= law_none .and. law(k)%target%kind /= law_over) &
                    call evaluate_law(law(k)%target, t, at_t(2*k - 1), at_t(2*k), ignored)
            end do
            force = effort
            associate (samples => system%record%samples)
                call set_block(arrays, in_q, size(q), 1, q)
                call set_block(arrays, in_qd, size(qd), 1, qd)
                call set_block(arrays, in_load, size(samples%load, 1), 1, samples%load)
                call set_block(arrays, in_target, size(at_t), 1, at_t)
                call set_block(arrays, in_effort, size(force), 1, force)
                call set_block(arrays, in_branch, size(samples%branch, 1), 1, samples%branch)
                call set_block(arrays, in_place, size(samples%place, 1), 1, samples%place)
                call set_block(arrays, in_pull, size(samples%pull, 1), 1, samples%pull)
                call set_block(arrays, in_base, size(samples%base, 1), 1, samples%base)
                call set_block(arrays, in_payload, size(samples%payload, 1), 1, samples%payload)
                call set_block(arrays, in_counted, size(samples%counted, 1), 1, samples%counted)
                call set_block(arrays, in_friction, size(friction), 1, friction)
                call set_block(arrays, in_direction, place%n, n_sample, direction)
            end associate
        end subroutine lay_out
    end subroutine linearize_system

    !> Friction that fits the reactions which it changes, by Newton's method, whose matrix is among the columns; and how it changes
    !> along the other directions, which is put on top of their columns.
    subroutine settle_friction(system, arrays, n, column, friction, fails)
        type(forward_system), intent(in) :: system
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: n                       !! directions; those of contacts come behind
        real(wp), intent(inout), contiguous :: column(:, :)
        real(wp), intent(inout) :: friction(:)         !! in the arrays (n_contact) [N s/m]
        logical, intent(out) :: fails
        real(wp), parameter :: enough = 64*epsilon(1.0_wp)
        type(dense_workspace) :: workspace
        real(wp), dimension(size(friction)) :: factor, slope
        real(wp) :: matrix(size(friction), size(friction)), change(size(friction), 0:n), scaled(size(friction), size(friction)), &
                    rcond, error
        integer :: round, k, m

        m = size(friction)
        associate (contact => system%model%contact, out => system%record%recorded%column)
            do round = 1, most_rounds
                call run_linear(system%record%recorded%linear, arrays, n + m, column, fails)
                if (m == 0 .or. fails) return
                associate (press => column(out%press:out%press + m - 1, 1), square => column(out%square:out%square + m - 1, 1), &
                           press_rate => column(out%change + out%press:out%change + out%press + m - 1, :), &
                           square_rate => column(out%change + out%square:out%change + out%square + m - 1, :))
                    factor = friction_of_speed(contact, sqrt(max(square, 0.0_wp)))
                    slope = friction_slope(contact, square)
                    matrix = -spread(factor, 2, m)*press_rate(:, n + 1:)
                    do k = 1, m
                        matrix(k, k) = matrix(k, k) + 1
                    end do
                    change(:, 0) = factor*press - friction
                    change(:, 1:) = spread(factor, 2, n)*press_rate(:, :n) + spread(slope*press, 2, n)*square_rate(:, :n)
                end associate
                call solve_for(0)
                if (fails) return
                friction = friction + change(:, 0)
                if (maxval(abs(change(:, 0))) <= enough*maxval(abs(friction))) exit
            end do
            do k = 1, n
                call solve_for(k)
                if (fails) return
            end do
            fails = round > most_rounds
            associate (rate => column(out%change + 1:2*out%change, :))
                rate(:, :n) = rate(:, :n) + matmul(rate(:, n + 1:), change(:, 1:))
            end associate
        end associate

    contains

        subroutine solve_for(k)
            integer, intent(in) :: k                   !! change

            scaled = matrix
            call solve_dense(workspace, scaled, change(:, k), rcond, error, fails)
        end subroutine solve_for
    end subroutine settle_friction

    !> What laws give at the state, and how it changes along the directions.
    subroutine follow(system, law, follows_laws, at_t, column, direction, effort, force, status)
        type(forward_system), intent(in) :: system
        type(effort_law), intent(in) :: law(:)
        logical, intent(in) :: follows_laws
        real(wp), intent(in) :: at_t(:)          !! values and rates of laws of time (2 n_actuator)
        real(wp), intent(in) :: column(:, :)           !! of the first run
        real(wp), intent(inout) :: direction(:, :)     !! (place in it, direction)
        real(wp), intent(inout) :: effort(:)           !! what drives are told
        real(wp), intent(inout) :: force(:)            !! what they give at joints [N, N m]
        type(status_type), intent(inout) :: status
        real(wp) :: law_rate(size(direction, 2), size(system%model%scene%laws%law))
        type(direction_places) :: place
        type(linear_outputs) :: out
        integer :: i, k

        place = directions_of(system%model)
        out = system%record%recorded%column
        associate (model => system%model, book => system%model%scene%laws, samples => system%record%samples)
            call find_law_rates()
            do i = 1, model%n_load
                do k = 1, 3
                    call add(model%scene%load(i)%force(k), book%scale, place%load + 6*i - 7 + k)
                    call add(model%scene%load(i)%moment(k), book%scale**2, place%load + 6*i - 4 + k)
                end do
            end do
            do i = 1, size(model%scene%spring)
                call add(model%scene%spring(i)%force, book%scale**pull_power(model, model%scene%spring(i)), place%pull + i - 1)
            end do
            do i = 1, model%n_actuator
                if (follows_laws .and. law(i)%kind /= effort_inverse) call follow_law(i)
                force(i) = effort(i)
                if (is_at_motor(law(i)%side)) call turn_motor(i)
                if (.not. status%is_ok()) return
            end do
        end associate

    contains

        subroutine find_law_rates()
            real(wp) :: rate(size(direction, 2), system%record%samples%n_measure)
            integer :: m

            associate (model => system%model, samples => system%record%samples)
                if (size(law_rate, 2) == 0) return
                do m = 1, size(rate, 2)
                    rate(:, m) = column(out%change + out%measure + m - 1, :) &
                                 /model%scene%laws%scale**model%scene%laws%measure(m)%length_power
                end do
                call differentiate_laws(model%scene%laws, samples%measured(:size(rate, 2), 1), samples%law(:, 1), rate, law_rate)
            end associate
        end subroutine find_law_rates

        subroutine add(spec, scale, row)
            type(law_spec), intent(in) :: spec
            real(wp), intent(in) :: scale
            integer, intent(in) :: row

            if (spec%kind == law_over) direction(row, :) = direction(row, :) + scale*law_rate(:, spec%law)
        end subroutine add

        !> What an actuator's own law tells it.
        subroutine follow_law(i)
            integer, intent(in) :: i
            real(wp) :: scale

            associate (row => place%effort + i - 1, from => out%effort + i - 1)
                if (law(i)%kind == effort_over) then
                    scale = system%model%scene%laws%scale**effort_power(system%model, i)
                    effort(i) = scale*system%record%samples%law(law(i)%target%law, 1)
                    call add(law(i)%target, scale, row)
                else if (compares_motion(law(i))) then
                    effort(i) = column(from, 1)
                    direction(row, :) = direction(row, :) + column(out%change + from, :)
                else if (law(i)%kind == effort_constant) then
                    effort(i) = law(i)%value(1)
                else
                    effort(i) = at_t(2*i - 1)
                end if
            end associate
        end subroutine follow_law

        !> From what a motor is told, its torque or voltage, to what it gives at its joint.
        subroutine turn_motor(i)
            integer, intent(in) :: i
            real(wp) :: speed, torque

            associate (motor => system%model%scene%actuator(i)%motor, row => place%effort + i - 1, from => out%driven + i - 1)
                speed = motor%ratio*column(from, 1)
                torque = torque_of_law(motor, law(i)%side, effort(i), speed)
                if (.not. abs(torque) < available_torque(motor, speed, torque)) then
                    call fail(status, status_bad_input, "the motor of actuator "//quoted(system%model%scene%actuator(i)%name) &
                              //" gives all the torque that it has there: no linearization tells what more or less of it does " &
                              //"(expected an effort within its limits)")
                    return
                end if
                if (law(i)%side == side_voltage) direction(row, :) = motor%torque_constant/motor%resistance &
                    *(direction(row, :) - motor%torque_constant*motor%ratio*column(out%change + from, :))
                direction(row, :) = motor%ratio*direction(row, :)
                force(i) = motor%ratio*torque
            end associate
        end subroutine turn_motor
    end subroutine follow

    !> A record that serves the state, with the columns; the state is the first of its samples.
    subroutine need_columns(system, law, t, y, status)
        type(forward_system), intent(inout) :: system
        type(effort_law), intent(in) :: law(:)
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:)                   !! (n)
        type(status_type), intent(inout) :: status
        real(wp) :: rate(size(y))
        logical :: serves

        system%way%n_before_record = 0
        call system%evaluate_alone(t, y, rate, serves)
        serves = system%may_record .and. associated(system%record%recorded)
        if (serves) serves = .not. system%record%samples%is_left(1)
        if (serves) then
            call hold_records()
            if (.not. system%record%recorded%linear%is_made) &
                call make_forward_columns(system%model, system%layout, system%equations%unknown, law, system%shared%poses, &
                                          system%record%recorded)
            serves = system%record%recorded%linear%is_made
            call release_records()
        end if
        if (.not. serves) call refuse_place(status)
    end subroutine need_columns

    subroutine refuse_place(status)
        type(status_type), intent(inout) :: status

        call fail(status, status_bad_input, "the mechanism cannot be linearized there: it is at or very near a dead point, a "// &
                  "change point or the pole of a ball's angles, or friction locks it, or a joint rubs that nothing presses "// &
                  "(expected another state, or other coordinates)")
    end subroutine refuse_place

    !> Parts with states of their own, and those that hold.
    subroutine refuse_parts(system, law, status)
        type(forward_system), intent(in) :: system
        type(effort_law), intent(in) :: law(:)
        type(status_type), intent(inout) :: status
        integer :: i

        associate (scene => system%model%scene)
            if (n_clutch(scene) > 0) call refuse(merge("joint ", "clutch", has_sticking(system%model)), scene%clutch(1)%name, &
                "may hold", "a scene without it")
            if (n_controller(scene) > 0) call refuse("controller", scene%controller(1)%name, &
                "may have states of its own", "a scene without it, to close the loop with the matrices")
            do i = 1, size(law)
                associate (actuator => scene%actuator(i))
                    if (law(i)%side == side_opening) call refuse("actuator", actuator%name, &
                        "is a cylinder whose pressures are states of their own", "one that is told its force")
                    if (has_winding(actuator)) call refuse("actuator", actuator%name, &
                        "has a winding whose current is a state of its own", "a motor without 'inductance'")
                    if (actuator%motor%brake%is_given) call refuse("actuator", actuator%name, &
                        "has a brake, which may hold", "a scene without it")
                end associate
            end do
            if (size(system%equations%lossy) > 0) call refuse("actuator", &
                scene%actuator(system%model%motor(system%equations%lossy(1))%actuator)%name, &
                "loses some of its motor's torque, by the way power flows", "'efficiency' left out")
            if (rests_anywhere(system%way%stops)) call fail(status, status_bad_input, "the mechanism rests at a stop: no "// &
                "linearization tells what it does beside it (expected a state away from stops)")
        end associate

    contains

        subroutine refuse(what, name, why, expected)
            character(len=*), intent(in) :: what, name, why, expected

            if (.not. status%is_ok()) return
            call fail(status, status_bad_input, trim(what)//" "//quoted(name)//" "//why//": a linearization has no part for it "// &
                      "(expected "//expected//")")
        end subroutine refuse
    end subroutine refuse_parts
end module linkdyn_linearization
