!> Joint variables that are given: coordinates, and behind these what gears make of them, by one number each.
module linkdyn_given
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    implicit none (type, external)
    private
    public :: given_position, given_rate, given_acceleration, given_column, giving_coordinates

contains

    !> Its value on all lanes [m, rad].
    pure function given_position(model, state, c) result(q)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: c
        real(wp) :: q(lanes)

        if (c <= model%n_q) then
            q = state%q(:, c)
        else
            q = model%led(c - model%n_q)%offset + led_sum(model, c - model%n_q, state%q)
        end if
    end function given_position

    pure function given_rate(model, state, c) result(qd)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: c
        real(wp) :: qd(lanes)

        if (c <= model%n_q) then
            qd = state%qd(:, c)
        else
            qd = led_sum(model, c - model%n_q, state%qd)
        end if
    end function given_rate

    pure function given_acceleration(model, state, c) result(qdd)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: c
        real(wp) :: qdd(lanes)

        if (c <= model%n_q) then
            qdd = state%qdd(:, c)
        else
            qdd = led_sum(model, c - model%n_q, state%qdd)
        end if
    end function given_acceleration

    !> What it is at a unit rate of coordinate k.
    pure real(wp) function given_column(model, c, k) result(part)
        type(model_type), intent(in) :: model
        integer, intent(in) :: c, k

        if (c <= model%n_q) then
            part = merge(1, 0, c == k)
        else
            part = model%led(c - model%n_q)%weight(k)
        end if
    end function given_column

    !> The coordinates that move it.
    pure function giving_coordinates(model, c) result(coordinate)
        type(model_type), intent(in) :: model
        integer, intent(in) :: c
        integer, allocatable :: coordinate(:)
        integer :: k

        if (c <= model%n_q) then
            coordinate = [c]
        else
            coordinate = pack([(k, k=1, model%n_q)], model%led(c - model%n_q)%weight /= 0)
        end if
    end function giving_coordinates

    pure function led_sum(model, i, values) result(total)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        real(wp), intent(in) :: values(:, :)       !! (lane, n_q)
        real(wp) :: total(lanes)
        integer :: k

        total = 0
        do k = 1, model%n_q
            if (model%led(i)%weight(k) /= 0) total = total + model%led(i)%weight(k)*values(:, k)
        end do
    end function led_sum
end module linkdyn_given
