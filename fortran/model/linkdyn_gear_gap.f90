!> How far wheels are off where a gear wants them, from where the links are.
!>
!> A gear that was let go, as the joints of a loop tie its wheels already (a belt beside a parallelogram), must still fit: the sum
!> of joint variables that it keeps has to be the same everywhere. Angles of poses are known but for whole turns, so the sum is
!> known but for whole multiples of what these add to it.
module linkdyn_gear_gap
    use linkdyn_constants, only: two_pi
    use linkdyn_joint_table, only: joint_revolute, joint_prismatic
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, gear_type
    implicit none (type, external)
    private
    public :: gear_gap, least_turn, sums_all_places

    real(wp), parameter :: no_turn = 1.0e-3_wp     !! part of the largest weight: smaller steps reach every place

contains

    !> What the sum of a gear differs from its total [m].
    pure function gear_gap(model, gear, position, rotation) result(gap)
        type(model_type), intent(in) :: model
        type(gear_type), intent(in) :: gear
        real(wp), intent(in) :: position(:, :)         !! origins of the moving links [m] (3, n_link)
        real(wp), intent(in) :: rotation(:, :, :)      !! their axes (3, 3, n_link)
        real(wp) :: gap
        real(wp) :: weight, turn
        integer :: j

        gap = 0
        if (sums_all_places(model, gear)) return
        gap = -gear%total
        do j = 1, model%n_joint
            associate (joint => model%joint(j))
                if (all(joint%told_kind /= [joint_revolute, joint_prismatic])) cycle
                weight = gear%weight(joint%first_variable + 1)
                if (weight == 0) cycle
                gap = gap + weight*variable_of(j)
            end associate
        end do
        turn = least_turn(model, gear)
        if (turn > 0) gap = gap - anint(gap/(two_pi*turn))*two_pi*turn

    contains

        !> Angle in (-pi, pi], or slide, of a joint.
        pure real(wp) function variable_of(j) result(variable)
            integer, intent(in) :: j
            real(wp) :: frame(3, 3, 2), point(3, 2)
            integer :: side

            associate (joint => model%joint(j))
                do side = 1, 2
                    frame(:, :, side) = joint%told_frame(:, :, side)
                    point(:, side) = joint%point(:, side)
                    associate (l => joint%link(side))
                        if (l == 0) cycle
                        frame(:, :, side) = matmul(rotation(:, :, l), frame(:, :, side))
                        point(:, side) = position(:, l) + matmul(rotation(:, :, l), point(:, side))
                    end associate
                end do
                if (joint%told_kind == joint_prismatic) then
                    variable = dot_product(frame(:, 3, 1), point(:, 2) - point(:, 1))
                else
                    variable = atan2(dot_product(frame(:, 1, 2), frame(:, 2, 1)), dot_product(frame(:, 1, 2), frame(:, 1, 1)))
                end if
            end associate
        end function variable_of
    end function gear_gap

    !> The number of which all that whole turns of the wheels' joints add to the sum is a multiple [m/rad]; 0: nothing turns.
    pure real(wp) function least_turn(model, gear) result(turn)
        type(model_type), intent(in) :: model
        type(gear_type), intent(in) :: gear
        real(wp) :: largest

        call look_at_turns(model, gear, turn, largest)
    end function least_turn

    !> Do whole turns add so many different amounts that every sum is as good?
    pure logical function sums_all_places(model, gear)
        type(model_type), intent(in) :: model
        type(gear_type), intent(in) :: gear
        real(wp) :: turn, largest

        call look_at_turns(model, gear, turn, largest)
        sums_all_places = turn <= no_turn*largest .and. largest > 0
    end function sums_all_places

    pure subroutine look_at_turns(model, gear, turn, largest)
        type(model_type), intent(in) :: model
        type(gear_type), intent(in) :: gear
        real(wp), intent(out) :: turn, largest         !! the largest weight of an angle
        integer :: j

        turn = 0
        largest = 0
        do j = 1, model%n_joint
            associate (joint => model%joint(j))
                if (joint%told_kind /= joint_revolute) cycle
                associate (weight => gear%weight(joint%first_variable + 1))
                    if (weight == 0) cycle
                    largest = max(largest, abs(weight))
                    turn = common_part(turn, abs(weight), no_turn*largest)
                end associate
            end associate
        end do
    end subroutine look_at_turns

    !> The largest number of which both are multiples (Euclid); what is below the least counts as none.
    pure function common_part(a, b, least) result(part)
        real(wp), intent(in) :: a, b, least
        real(wp) :: part
        real(wp) :: smaller, rest

        part = max(a, b)
        smaller = min(a, b)
        do while (smaller > least)
            rest = abs(part - anint(part/smaller)*smaller)
            part = smaller
            smaller = rest
        end do
    end function common_part
end module linkdyn_gear_gap
