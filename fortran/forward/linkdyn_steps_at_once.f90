!> Whole steps by a record of the scene, on a block of lanes: the columns that it takes and gives.
module linkdyn_steps_at_once
    use linkdyn_carried_assembly, only: carried_assembly
    use linkdyn_forward_record, only: forward_record
    use linkdyn_inputs, only: n_block, in_q, in_qd, in_quaternion, in_step
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_recorded_rates, only: wire_steps, run_steps_on_lanes
    use linkdyn_scene_program, only: column_list, input_wiring
    use linkdyn_state_wires, only: columns_of_states
    use linkdyn_step_length, only: length_watch
    use linkdyn_step_program, only: step_inputs, step_outputs, inputs_of_step
    implicit none (type, external)
    private
    public :: steps_at_once, use_steps_at_once, set_out, try_step, judge_length, keep_length, take_step, tell_end

    integer, parameter :: n_kept = 3                   !! the state accepted last, that where the next step begins, what is tried

    type :: steps_at_once
        logical :: is_usable = .false.
        integer :: before = 1, here = 2, tried = 3     !! where these are:
        real(wp), allocatable :: found(:, :, :)        !! as `step_inputs` and `step_outputs` tell (lane, value, n_kept)
        logical :: is_left(lanes) = .false.            !! what has been tried is not to be believed
        type(step_inputs) :: at
        type(step_outputs) :: out
        integer :: n = 0                               !! numbers of a state
        type(input_wiring), private :: wiring
        logical, private :: is_first = .false.         !! nothing has been tried since `set_out`
    end type steps_at_once

contains

    !> Use the steps of a scene's record from now on.
    subroutine use_steps_at_once(model, n, record, steps)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n                       !! numbers of a state
        type(forward_record), intent(in) :: record
        type(steps_at_once), intent(out) :: steps
        type(column_list) :: column(n_block)
        integer :: i

        steps%n = n
        steps%at = inputs_of_step(record%recorded%model, n)
        steps%out = record%recorded%step
        column = columns_of_states(model, record%wires)
        call shift(column(in_q)%of)
        call shift(column(in_qd)%of)
        call shift(column(in_quaternion)%of)
        column(in_step)%of = [(i, i=1, steps%at%n)]
        call wire_steps(record%recorded, column, steps%wiring)
        allocate (steps%found(lanes, steps%out%n, n_kept), source=0.0_wp)
        steps%is_usable = .true.

    contains

        !> States begin at a place of their own.
        subroutine shift(of)
            integer, intent(inout) :: of(:)

            where (of > 0) of = of + steps%at%y - 1
        end subroutine shift
    end subroutine use_steps_at_once

    !> Begin where an accepted state is.
    subroutine set_out(length, y, rest, assembly, steps)
        real(wp), intent(in) :: length                 !! of the steps [s]
        real(wp), intent(in), contiguous :: y(:, :), rest(:, :)    !! (lane, n)
        type(carried_assembly), intent(in) :: assembly !! there
        type(steps_at_once), intent(inout) :: steps

        steps%is_first = .true.
        associate (x => steps%found(:, :, steps%here), at => steps%at, n_branch => steps%at%drift - steps%at%margin)
            x(:, at%length) = length
            x(:, at%ahead) = 0
            x(:, at%y:at%rest - 1) = y
            x(:, at%rest:at%n) = rest
            if (.not. assembly%is_needed) return
            x(:, at%from:at%margin - 1) = assembly%q
            x(:, at%margin:at%drift - 1) = assembly%margin(:, :n_branch)
            x(:, at%drift:at%y - 1) = assembly%drift(:, :n_branch)
        end associate
    end subroutine set_out

    !> Try the step that begins there.
    subroutine try_step(record, steps)
        type(forward_record), intent(inout) :: record
        type(steps_at_once), intent(inout) :: steps

        call run_steps_on_lanes(record%recorded, steps%wiring, steps%is_first, steps%found(:, :, steps%here), record%samples, &
                                steps%found(:, :, steps%tried), steps%is_left)
        steps%is_first = .false.
    end subroutine try_step

    !> Was the step before it short enough?
    pure subroutine judge_length(goes, steps, watch)
        logical, intent(in) :: goes(lanes)
        type(steps_at_once), intent(in) :: steps
        type(length_watch), intent(inout) :: watch

        associate (y => steps%at%y, first => steps%out%first, n => steps%n)
            call watch%judge(goes, steps%found(:, y:y + n - 1, steps%here), steps%found(:, first:first + n - 1, steps%tried))
        end associate
    end subroutine judge_length

    !> The step is to be judged with the next one.
    pure subroutine keep_length(goes, length, steps, watch)
        logical, intent(in) :: goes(lanes)
        real(wp), intent(in) :: length                 !! [s]
        type(steps_at_once), intent(in) :: steps
        type(length_watch), intent(inout) :: watch

        associate (last => steps%out%last)
            call watch%keep(merge(length, 0.0_wp, goes), steps%found(:, last:last + steps%n - 1, steps%tried))
        end associate
    end subroutine keep_length

    !> Take it: the next one begins where it ends. The state where it has begun is then the one accepted last.
    pure subroutine take_step(steps)
        type(steps_at_once), intent(inout) :: steps
        integer :: oldest

        oldest = steps%before
        steps%before = steps%here
        steps%here = steps%tried
        steps%tried = oldest
    end subroutine take_step

    !> Where the steps taken have led, of the lanes that go, and where the last one has begun; others stay.
    pure subroutine tell_end(goes, steps, y, begin, rest)
        logical, intent(in) :: goes(lanes)
        type(steps_at_once), intent(in) :: steps
        real(wp), intent(inout) :: y(:, :), rest(:, :) !! (lane, n)
        real(wp), intent(inout) :: begin(:, :)         !! (lane, n)
        integer :: k

        do k = 1, steps%n
            associate (now => steps%found(:, :, steps%here), at => steps%at)
                begin(:, k) = merge(steps%found(:, at%y + k - 1, steps%before), y(:, k), goes)
                y(:, k) = merge(now(:, at%y + k - 1), y(:, k), goes)
                rest(:, k) = merge(now(:, at%rest + k - 1), rest(:, k), goes)
            end associate
        end do
    end subroutine tell_end
end module linkdyn_steps_at_once
