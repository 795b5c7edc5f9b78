!> Where the numbers of a state go among the inputs of a record, and from where its rates come back: lists, made once, in place of
!> questions that every state would ask again.
module linkdyn_state_wires
    use linkdyn_forward_state, only: state_layout
    use linkdyn_inputs, only: n_block, in_q, in_qd, in_quaternion
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_rate_program, only: rate_outputs
    use linkdyn_scene_program, only: column_list
    use linkdyn_whole_turns, only: with_turns
    implicit none (type, external)
    private
    public :: state_wires, lay_wires, columns_of_states, carry, carry_with_turns, rates_of_states

    type :: wire
        integer :: from = 0, to = 0
    end type wire

    type :: state_wires
        type(wire), allocatable :: q(:), qd(:)         !! from y to coordinates and their rates
        type(wire), allocatable :: quaternion(:)       !! to attitudes
        type(wire), allocatable :: counted(:)          !! to angles that coordinates stand in for, with their turns
        type(wire), allocatable, private :: of_places(:)       !! from y to the rates of its places: speeds are in it
        type(wire), allocatable, private :: found(:)           !! from what the record finds to rates of y
    end type state_wires

contains

    !> Where each number of the state goes among the record's inputs, and where each of its rates comes from.
    subroutine lay_wires(model, layout, out, wires)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(rate_outputs), intent(in) :: out
        type(state_wires), intent(out) :: wires
        integer :: k, p, i

        allocate (wires%q(0), wires%qd(0), wires%quaternion(0), wires%counted(0), wires%of_places(0), wires%found(0))
        do k = 1, model%n_q
            if (layout%rate(k) == 0) cycle
            call lay(layout%rate(k), k, wires%qd)
            call lay(out%acceleration + k - 1, layout%rate(k), wires%found)
            if (layout%counted(k) > 0) call lay(out%counted + k - 1, layout%counted(k), wires%found)
            ! of an attitude by its quaternion it is none
            if (layout%position(k) == 0) cycle
            call lay(layout%position(k), k, wires%q)
            call lay(layout%rate(k), layout%position(k), wires%of_places)
        end do
        do k = 1, model%n_q
            if (layout%counted(k) > 0) call lay(layout%counted(k), k, wires%counted)
        end do
        do p = 1, model%n_attitude
            if (layout%quaternion(p) == 0) cycle
            do i = 0, 3
                call lay(layout%quaternion(p) + i, 4*p - 3 + i, wires%quaternion)
                call lay(out%quaternion + 4*p - 4 + i, layout%quaternion(p) + i, wires%found)
            end do
        end do
        call lay(out%work, layout%work, wires%found)
        call lay(out%supplied, layout%supplied, wires%found)

    contains

        subroutine lay(from, to, list)
            integer, intent(in) :: from, to
            type(wire), allocatable, intent(inout) :: list(:)

            if (from > 0 .and. to > 0) list = [list, wire(from, to)]
        end subroutine lay
    end subroutine lay_wires

    !> For programs that take their inputs from states themselves.
    pure function columns_of_states(model, wires) result(column)
        type(model_type), intent(in) :: model
        type(state_wires), intent(in) :: wires
        type(column_list) :: column(n_block)

        call list(wires%q, model%n_q, column(in_q)%of)
        call list(wires%qd, model%n_q, column(in_qd)%of)
        call list(wires%quaternion, 4*model%n_attitude, column(in_quaternion)%of)

    contains

        pure subroutine list(wires, n, of)
            type(wire), intent(in) :: wires(:)
            integer, intent(in) :: n
            integer, allocatable, intent(out) :: of(:)

            allocate (of(n), source=0)
            of(wires%to) = wires%from
        end subroutine list
    end function columns_of_states

    !> Numbers of the first n states along wires.
    pure subroutine carry(wires, n, y, to)
        type(wire), intent(in) :: wires(:)
        integer, intent(in) :: n
        real(wp), intent(in), contiguous :: y(:, :)    !! (lane, n)
        real(wp), intent(inout), contiguous :: to(:, :)        !! (number, lane)
        integer :: i, lane, from, into

        do i = 1, size(wires)
            from = wires(i)%from
            into = wires(i)%to
            do lane = 1, n
                to(into, lane) = y(lane, from)
            end do
        end do
    end subroutine carry

    !> Angles with the turns that are not in y.
    pure subroutine carry_with_turns(wires, n, y, turns, to)
        type(wire), intent(in) :: wires(:)
        integer, intent(in) :: n
        real(wp), intent(in) :: y(:, :), turns(:, :)   !! (lane, n)
        real(wp), intent(inout) :: to(:, :)            !! (number, lane)
        integer :: i

        do i = 1, size(wires)
            to(wires(i)%to, :n) = with_turns(y(:n, wires(i)%from), turns(:n, wires(i)%from))
        end do
    end subroutine carry_with_turns

    !> dy/dt of the first n states, as far as the record finds it.
    pure subroutine rates_of_states(wires, n, stride, y, room, found, rate)
        type(state_wires), intent(in) :: wires
        integer, intent(in) :: n
        integer, intent(in) :: stride                  !! of y and its rates
        real(wp), intent(in) :: y(stride, *)           !! (lane, n)
        integer, intent(in) :: room                    !! lanes of what has been found
        real(wp), intent(in) :: found(room, *)         !! as `rate_outputs` tells (lane, number)
        real(wp), intent(inout) :: rate(stride, *)     !! (lane, n)

        call copy(wires%of_places, n, stride, y, stride, rate)
        call copy(wires%found, n, room, found, stride, rate)
    end subroutine rates_of_states

    !> Columns of the first n lanes along wires.
    pure subroutine copy(wires, n, room, x, stride, to)
        type(wire), intent(in) :: wires(:)
        integer, intent(in) :: n
        integer, intent(in) :: room, stride            !! from one column to the next
        real(wp), intent(in) :: x(room, *)             !! (lane, number)
        real(wp), intent(inout) :: to(stride, *)       !! (lane, number)
        integer :: i, lane, from, into

        do i = 1, size(wires)
            from = wires(i)%from
            into = wires(i)%to
            do lane = 1, n
                to(lane, into) = x(lane, from)
            end do
        end do
    end subroutine copy
end module linkdyn_state_wires
