!> Joint variables that are given: coordinates, and behind these what gears make of them and of joints that are placed already,
!> by one number each.
module linkdyn_led_coordinates
    use linkdyn_constants, only: two_pi
    use linkdyn_joint_rates, only: measure_one_joint, joint_rate
    use linkdyn_joint_table, only: wraps
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, counts_turns, most_turned
    use linkdyn_planar_motion, only: level_velocity, level_given
    implicit none (type, external)
    private
    public :: given_position, given_rate, given_acceleration, given_column, has_lost_turns

contains

    !> Value of a coordinate on all lanes [m, rad].
    function given_position(model, state, c, own) result(q)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: c
        integer, intent(in), optional :: own(:)    !! joints whose part is left out, as they are not placed yet
        real(wp) :: q(lanes), variable(lanes, 3), rate(lanes, 3), near
        integer :: i

        if (c <= model%n_q) then
            q = state%q(:, c)
            return
        end if
        associate (led => model%led(c - model%n_q))
            q = led%offset + led_sum(model, c - model%n_q, state%q)
            do i = 1, size(led%source)
                if (is_among(led%source(i), own)) cycle
                associate (j => led%source(i))
                    call measure_one_joint(model, state, j, variable, rate)
                    near = model%scene%joint(j)%start(1)
                    if (wraps(model%joint(j)%kind, 1)) &
                        variable(:, 1) = variable(:, 1) - two_pi*anint((variable(:, 1) - near)/two_pi)
                    q = q + led%source_weight(i)*variable(:, 1)
                end associate
            end do
        end associate
    end function given_position

    function given_rate(model, state, c, own) result(qd)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: c
        integer, intent(in), optional :: own(:)    !! as above
        real(wp) :: qd(lanes)

        if (c <= model%n_q) then
            qd = state%qd(:, c)
        else
            qd = led_sum(model, c - model%n_q, state%qd) + source_sum(model, state, c - model%n_q, level_velocity, own)
        end if
    end function given_rate

    function given_acceleration(model, state, c, own) result(qdd)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: c
        integer, intent(in), optional :: own(:)    !! as above
        real(wp) :: qdd(lanes)

        if (c <= model%n_q) then
            qdd = state%qdd(:, c)
        else
            qdd = led_sum(model, c - model%n_q, state%qdd) + source_sum(model, state, c - model%n_q, level_given, own)
        end if
    end function given_acceleration

    !> What it is at a unit rate of coordinate k.
    function given_column(model, state, c, k, own) result(part)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: c, k
        integer, intent(in), optional :: own(:)    !! as above
        real(wp) :: part(lanes)

        if (c <= model%n_q) then
            part = merge(1, 0, c == k)
        else
            part = model%led(c - model%n_q)%weight(k) + source_sum(model, state, c - model%n_q, k, own)
        end if
    end function given_column

    !> Is an angle that leads it so far from its start that its turns, which matter, may be others?
    function has_lost_turns(model, state, c) result(is_lost)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: c
        logical :: is_lost(lanes)
        real(wp) :: variable(lanes, 3), rate(lanes, 3)
        integer :: i

        is_lost = .false.
        if (c <= model%n_q) return
        associate (led => model%led(c - model%n_q))
            do i = 1, size(led%source)
                if (.not. counts_turns(model, led, i)) cycle
                call measure_one_joint(model, state, led%source(i), variable, rate)
                variable(:, 1) = variable(:, 1) - model%scene%joint(led%source(i))%start(1)
                is_lost = is_lost .or. abs(variable(:, 1) - two_pi*anint(variable(:, 1)/two_pi)) > most_turned
            end do
        end associate
    end function has_lost_turns

    !> May coordinate k move it?
    pure logical function given_moves(model, c, k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: c, k

        if (c <= model%n_q) then
            given_moves = c == k
        else
            given_moves = model%led(c - model%n_q)%weight(k) /= 0 .or. size(model%led(c - model%n_q)%source) > 0
        end if
    end function given_moves

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

    !> What joints that are placed add to a rate.
    function source_sum(model, state, i, level, own) result(total)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: i, level
        integer, intent(in), optional :: own(:)
        real(wp) :: total(lanes)
        integer :: s

        total = 0
        associate (led => model%led(i))
            do s = 1, size(led%source)
                if (.not. is_among(led%source(s), own)) &
                    total = total + led%source_weight(s)*joint_rate(model, state, led%source(s), 1, level)
            end do
        end associate
    end function source_sum

    pure logical function is_among(joint, own)
        integer, intent(in) :: joint
        integer, intent(in), optional :: own(:)

        is_among = .false.
        if (present(own)) is_among = any(own == joint)
    end function is_among
end module linkdyn_led_coordinates
