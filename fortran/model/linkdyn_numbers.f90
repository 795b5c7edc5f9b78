!> All numbers of a scene that physics computes with, in one list: what a sweep or a user may vary without planning again.
module linkdyn_numbers
    use linkdyn_joint_table, only: is_threaded
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, gear_type, only_shifts
    use linkdyn_scene, only: marker_at
    implicit none (type, external)
    private
    public :: number_places, place_numbers, collect_numbers, numbers_of

    public :: of_marker, of_drive, of_stance
    public :: to_cog, to_inertia, to_frame, to_told_frame, to_couple, to_push, to_pitch_point, to_line, to_lever, to_strand, &
        to_total, to_weight, to_spring_point

    ! How many numbers a thing has, and how far behind its first ones the others are.
    !> A link: mass, cog (3), inertia (6: Ixx Iyy Izz Ixy Iyz Izx).
    integer, parameter :: to_cog = 1, to_inertia = 4, of_link = 10
    !> A marker of a joint: point (3), frame (9: axes x, y, z), frame by which variables are told (9).
    integer, parameter :: to_frame = 3, to_told_frame = 12, of_marker = 21
    !> A gear: direction (3), couples of both sides (6), push (3), pitch point (3).
    integer, parameter :: to_couple(2) = [3, 6], to_push = 9, to_pitch_point = 12, of_gear = 15
    !> A belt that stretches: direction and couples as of a gear; line, lever (6), a strand (3), total, weights (one a joint).
    integer, parameter :: to_line = 9, to_lever = 12, to_strand = 15, to_total = 18, to_weight = 19
    !> A spring: stiffness, damping, rest, points (6).
    integer, parameter :: to_spring_point(2) = [3, 6], of_spring = 9
    integer, parameter :: of_drive = 8         !! as `effort_law` lists them
    integer, parameter :: of_stance = 9        !! axes x, y, z

    !> Where the numbers of each thing begin in the list.
    type :: number_places
        integer :: n = 0
        integer :: gravity = 1
        integer, allocatable :: link(:)
        integer, allocatable :: marker(:, :)   !! (2, joint)
        integer, allocatable :: pitch(:)       !! (joint) slide per angle of a screw; 0: the joint is none
        integer, allocatable :: gear(:)
        integer, allocatable :: belt(:)
        integer, allocatable :: led(:)         !! offset, weights of the coordinates from +1, then of other joints
        integer, allocatable :: load(:)        !! point
        integer, allocatable :: spring(:)
        integer, allocatable :: drive(:)
        integer, allocatable :: motor(:)       !! inertia of the rotor at the joint variable
        integer, allocatable :: stance(:)      !! (step) of a link that only shifts; 0: it is none
    end type number_places

contains

    !> Where each part's numbers stand in the list of all numbers of a model.
    pure subroutine place_numbers(model, at)
        type(model_type), intent(in) :: model
        type(number_places), intent(out) :: at
        integer :: i

        at%n = 3
        at%link = [(at%n + 1 + of_link*(i - 1), i=1, model%n_link)]
        at%n = at%n + of_link*model%n_link
        at%marker = reshape([(at%n + 1 + of_marker*(i - 1), i=1, 2*size(model%joint))], [2, size(model%joint)])
        at%n = at%n + 2*of_marker*size(model%joint)
        at%pitch = [(0, i=1, size(model%joint))]
        do i = 1, size(model%joint)
            if (.not. is_threaded(model%joint(i)%kind)) cycle
            at%n = at%n + 1
            at%pitch(i) = at%n
        end do
        at%gear = [(at%n + 1 + of_gear*(i - 1), i=1, size(model%gear))]
        at%n = at%n + of_gear*size(model%gear)
        allocate (at%belt(size(model%belt)))
        do i = 1, size(model%belt)
            at%belt(i) = at%n + 1
            at%n = at%n + to_weight + size(model%belt(i)%joint)
        end do
        allocate (at%led(size(model%led)))
        do i = 1, size(model%led)
            at%led(i) = at%n + 1
            at%n = at%n + 1 + model%n_q + size(model%led(i)%source)
        end do
        at%load = [(at%n + 1 + 3*(i - 1), i=1, model%n_load)]
        at%n = at%n + 3*model%n_load
        at%spring = [(at%n + 1 + of_spring*(i - 1), i=1, size(model%scene%spring))]
        at%n = at%n + of_spring*size(model%scene%spring)
        at%drive = [(at%n + 1 + of_drive*(i - 1), i=1, model%n_actuator)]
        at%n = at%n + of_drive*model%n_actuator
        at%motor = [(at%n + i, i=1, size(model%motor))]
        at%n = at%n + size(model%motor)
        at%stance = [(0, i=1, size(model%step))]
        do i = 1, size(model%step)
            if (.not. only_shifts(model%step(i))) cycle
            at%stance(i) = at%n + 1
            at%n = at%n + of_stance
        end do
    end subroutine place_numbers

    !> The whole list.
    pure function numbers_of(model) result(number)
        type(model_type), intent(in) :: model
        real(wp), allocatable :: number(:)
        type(number_places) :: at

        call place_numbers(model, at)
        allocate (number(at%n))
        call collect_numbers(model, at, number)
    end function numbers_of

    !> Put each number of a model at its place in the list.
    pure subroutine collect_numbers(model, at, number)
        type(model_type), intent(in) :: model
        type(number_places), intent(in) :: at
        real(wp), intent(out) :: number(:)     !! (at%n)
        integer :: i, side, k

        number(at%gravity:at%gravity + 2) = model%gravity
        do i = 1, model%n_link
            associate (l => model%link(i), k => at%link(i))
                number(k) = l%mass
                number(k + to_cog:k + to_cog + 2) = l%cog
                number(k + to_inertia:k + to_inertia + 5) = [ &
                    l%inertia(1, 1), l%inertia(2, 2), l%inertia(3, 3), l%inertia(1, 2), l%inertia(2, 3), l%inertia(3, 1)]
            end associate
        end do
        do i = 1, size(model%joint)
            do side = 1, 2
                k = at%marker(side, i)
                number(k:k + 2) = model%joint(i)%point(:, side)
                number(k + to_frame:k + to_frame + 8) = reshape(model%joint(i)%frame(:, :, side), [9])
                number(k + to_told_frame:k + to_told_frame + 8) = reshape(model%joint(i)%told_frame(:, :, side), [9])
            end do
            if (at%pitch(i) > 0) number(at%pitch(i)) = model%joint(i)%pitch
        end do
        do i = 1, size(model%gear)
            k = at%gear(i)
            call collect_wheels(model%gear(i), k, number)
            number(k + to_push:k + to_push + 2) = model%gear(i)%push
            number(k + to_pitch_point:k + to_pitch_point + 2) = model%gear(i)%pitch
        end do
        do i = 1, size(model%belt)
            associate (belt => model%belt(i), k => at%belt(i))
                call collect_wheels(belt%gear, k, number)
                number(k + to_line:k + to_line + 2) = belt%line
                number(k + to_lever:k + to_lever + 2) = belt%lever
                number(k + to_strand:k + to_strand + 2) = belt%strand
                number(k + to_total) = belt%gear%total
                number(k + to_weight:k + to_weight + size(belt%joint) - 1) = belt%weight
            end associate
        end do
        do i = 1, size(model%led)
            number(at%led(i)) = model%led(i)%offset
            k = at%led(i) + model%n_q
            number(at%led(i) + 1:k) = model%led(i)%weight
            number(k + 1:k + size(model%led(i)%source)) = model%led(i)%source_weight
        end do
        do i = 1, model%n_load
            number(at%load(i):at%load(i) + 2) = marker_at(model%scene, model%scene%load(i)%link, model%scene%load(i)%marker)
        end do
        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                k = at%spring(i)
                number(k:k + 2) = [spring%stiffness, spring%damping, spring%rest]
                number(k + to_spring_point(1):k + of_spring - 1) = 0
                if (spring%joint > 0 .or. spring%measure > 0) cycle
                do side = 1, 2
                    number(k + to_spring_point(side):k + to_spring_point(side) + 2) = &
                        marker_at(model%scene, spring%link(side), spring%marker(side))
                end do
            end associate
        end do
        do i = 1, model%n_actuator
            number(at%drive(i):at%drive(i) + of_drive - 1) = model%scene%actuator(i)%law%value
        end do
        number(at%motor) = model%motor%inertia
        do i = 1, size(model%step)
            if (at%stance(i) > 0) number(at%stance(i):at%stance(i) + of_stance - 1) = reshape(model%step(i)%stance, [of_stance])
        end do
    end subroutine collect_numbers

    !> What gears and belts have in common.
    pure subroutine collect_wheels(gear, k, number)
        type(gear_type), intent(in) :: gear
        integer, intent(in) :: k                !! where the numbers of the pair begin
        real(wp), intent(inout) :: number(:)
        integer :: side

        number(k:k + 2) = gear%direction
        do side = 1, 2
            number(k + to_couple(side):k + to_couple(side) + 2) = gear%couple(:, side)
        end do
    end subroutine collect_wheels
end module linkdyn_numbers
