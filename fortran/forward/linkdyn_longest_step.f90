!> What equal steps are too long for, by name, and how long they may be.
module linkdyn_longest_step
    use linkdyn_forward_state, only: state_layout
    use linkdyn_forward_system, only: forward_system
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: n_chamber
    use linkdyn_stiffest_part, only: find_stiffest
    use linkdyn_text, only: quoted, to_text
    implicit none (type, external)
    private
    public :: too_long_steps_in_words

contains

    !> "steps of 0.001 s are too long for the current of actuator 'hoist' (expected steps of 5e-5 s, or a method that chooses them)"
    function too_long_steps_in_words(system, lane, component, t, length, y) result(text)
        type(forward_system), intent(inout) :: system
        integer, intent(in) :: lane
        integer, intent(in) :: component               !! of y, whose steps have erred
        real(wp), intent(in) :: t, length              !! [s], of the steps
        real(wp), intent(in) :: y(:, :)                !! there (lane, n)
        character(len=:), allocatable :: text
        real(wp), parameter :: certain = 0.5_wp        !! of a step over the fastest time: errors are some 1e-4 then
        real(wp), parameter :: less = 10               !! where the state does not tell it
        real(wp) :: rate, shorter

        rate = largest_rate(system, lane, t, length, y)
        shorter = length/less
        if (rate*length > certain) shorter = certain/rate
        text = "steps of "//to_text(length)//" s are too long for " &
               //part_in_words(system, component, t, length, y(lane, :))//" (expected steps of "//to_text(one_digit(shorter)) &
               //" s, or a method that chooses them)"
    end function too_long_steps_in_words

    !> Not above a number, in one digit.
    elemental real(wp) function one_digit(x) result(rounded)
        real(wp), intent(in) :: x                      !! above zero
        real(wp) :: unit

        unit = 10.0_wp**floor(log10(x))
        rounded = max(1, floor(x/unit))*unit
    end function one_digit

    !> What a component of y belongs to.
    function part_in_words(system, component, t, length, y) result(text)
        type(forward_system), intent(in) :: system
        integer, intent(in) :: component
        real(wp), intent(in) :: t, length              !! [s]
        real(wp), intent(in) :: y(:)                   !! (n)
        character(len=:), allocatable :: text, stiffest
        real(wp) :: rate

        associate (layout => system%layout, model => system%model)
            text = drive_in_words(model, layout, component)
            if (text /= "") return
            call find_stiffest(model, t, y, stiffest, rate)
            if (rate*length > 1) then
                text = stiffest
            else if (any([layout%position, layout%rate] == component)) then
                text = "what moves coordinate "//quoted(model%scene%coordinate(modulo( &
                    findloc([layout%position, layout%rate], component, dim=1) - 1, model%n_q) + 1)%name)
            else
                text = "what moves the mechanism"
            end if
        end associate
    end function part_in_words

    !> A controller, motor or cylinder; blank if the component is none of these.
    function drive_in_words(model, layout, component) result(text)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        integer, intent(in) :: component
        character(len=:), allocatable :: text
        integer :: i

        text = ""
        do i = 1, size(layout%integral)
            if (any([layout%integral(i), layout%slope(i)] == component)) &
                text = "controller "//quoted(model%scene%controller(i)%name)
        end do
        do i = 1, model%n_actuator
            associate (name => model%scene%actuator(i)%name, pressure => layout%pressure(i))
                if (layout%current(i) == component) text = "the current of actuator "//quoted(name)
                if (pressure > 0 .and. component >= pressure .and. component < pressure + n_chamber) &
                    text = "the oil of actuator "//quoted(name)
            end associate
        end do
    end function drive_in_words

    !> The largest rate of a motion by the slopes of f, at states about a lane's to which steps may lead: friction that holds has it
    !> near rest alone, a limit where it is reached, and steps that are too long leap over both.
    real(wp) function largest_rate(system, lane, t, length, y) result(largest)
        type(forward_system), intent(inout) :: system
        integer, intent(in) :: lane
        real(wp), intent(in) :: t, length              !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        integer, parameter :: n_place = 8, n_before = 2, n_behind = 4  !! places a step, steps
        real(wp), parameter :: nudge = 1.0e-7_wp
        real(wp), dimension(lanes, size(y, 2)) :: ahead, there, before, behind
        real(wp) :: instant(lanes), step(lanes), slope(size(y, 2), size(y, 2))
        logical, dimension(lanes) :: was_idle, failed
        integer :: i, k

        largest = 0
        instant = t
        was_idle = system%is_idle
        system%is_idle = .false.
        call system%evaluate(instant, y, ahead, failed)
        if (failed(lane)) ahead = 0
        do i = -n_before*n_place, n_behind*n_place
            there = y + (i*length/n_place)*ahead
            do k = 1, size(y, 2)
                associate (x => there(:, k))
                    step = nudge*max(1.0_wp, abs(x))
                    x = x - step
                    call system%evaluate(instant, there, before, failed)
                    x = x + 2*step
                    call system%evaluate(instant, there, behind, failed)
                    x = x - step
                end associate
                slope(:, k) = (behind(lane, :) - before(lane, :))/(2*step(lane))
            end do
            largest = max(largest, spectral_radius(slope))
        end do
        system%is_idle = was_idle
    end function largest_rate

    !> The largest size of an eigenvalue, by high powers of the matrix; 0 where these are no numbers.
    pure real(wp) function spectral_radius(matrix) result(radius)
        real(wp), intent(in) :: matrix(:, :)
        integer, parameter :: n_square = 7             !! to the power of 2^7
        real(wp) :: power(size(matrix, 1), size(matrix, 1)), scale, logarithm
        integer :: i

        power = matrix
        logarithm = 0
        do i = 0, n_square
            scale = maxval(abs(power))
            radius = 0
            if (.not. (scale > 0 .and. scale <= huge(scale))) return
            power = power/scale
            logarithm = 2*logarithm + log(scale)
            power = matmul(power, power)
        end do
        scale = maxval(abs(power))
        if (scale > 0) radius = exp((2*logarithm + log(scale))/2.0_wp**(n_square + 1))
    end function spectral_radius
end module linkdyn_longest_step
