!> Where links without a start of their own are at the start: as welds and slides put them against links that have one.
!>
!> Links that are welded are one body, so one start says it for all. A block on a slide, that of a slot above all, to which no scene
!> can give a start, is where the pin that joins it to another link is, if both its neighbours' starts are known.
module linkdyn_spread_starts
    use linkdyn_angles, only: matrix_of_angles, angles_of_matrix
    use linkdyn_joint_table, only: joint_fixed, joint_prismatic, joint_revolute, turns_about_point
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    implicit none (type, external)
    private
    public :: spread_starts

contains

    !> Such links still count as without a start: what is nearest to the start is measured where the scene says it.
    pure subroutine spread_starts(model)
        type(model_type), intent(inout) :: model
        logical :: is_placed(0:model%n_link), goes_on
        integer :: j, from

        is_placed(0) = .true.
        is_placed(1:) = model%scene%link%has_start
        do
            goes_on = .false.
            do j = 1, model%n_joint
                associate (link => model%joint(j)%link)
                    if (is_placed(link(1)) .eqv. is_placed(link(2))) cycle
                    from = merge(1, 2, is_placed(link(1)))
                    if (.not. says_place(model, j, from, is_placed)) cycle
                    call place_against(model, j, from)
                    if (model%joint(j)%kind == joint_prismatic) call slide_along(model, j, from, pin_of(model, j, from, is_placed))
                    is_placed(link(3 - from)) = .true.
                    goes_on = .true.
                end associate
            end do
            if (.not. goes_on) return
        end do
    end subroutine spread_starts

    !> Does a joint say where its other link is? What is welded to the frame is placed without iteration.
    pure logical function says_place(model, j, from, is_placed)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, from                 !! joint, its side that is placed
        logical, intent(in) :: is_placed(0:)

        says_place = .false.
        select case (model%joint(j)%kind)
        case (joint_fixed)
            says_place = model%joint(j)%link(from) /= 0
        case (joint_prismatic)
            says_place = pin_of(model, j, from, is_placed) > 0
        end select
    end function says_place

    !> The joint in whose point a slide's block meets another link that is placed; 0: none.
    pure integer function pin_of(model, j, from, is_placed)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, from
        logical, intent(in) :: is_placed(0:)
        integer :: pin

        pin_of = 0
        do pin = 1, model%n_joint
            associate (joint => model%joint(pin), block => model%joint(j)%link(3 - from))
                if (.not. (joint%kind == joint_revolute .or. turns_about_point(joint%kind))) cycle
                if (any(joint%link == block) .and. (is_placed(joint%link(1)) .or. is_placed(joint%link(2)))) pin_of = pin
            end associate
            if (pin_of > 0) return
        end do
    end function pin_of

    !> Both markers of a joint in one place, their frames parallel.
    pure subroutine place_against(model, j, from)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: j, from
        real(wp) :: r(3, 3), there(3)

        associate (joint => model%joint(j))
            there = place_of(model, j, from)
            r = matmul(joint%frame(:, :, from), transpose(joint%frame(:, :, 3 - from)))
            r = matmul(rotation_of(model, joint%link(from)), r)
            associate (new => model%scene%link(joint%link(3 - from))%start)
                new(:3) = there - matmul(r, joint%point(:, 3 - from))
                new(4:) = angles_of_matrix(r)
            end associate
        end associate
    end subroutine place_against

    !> On along a slide until the block is at its pin.
    pure subroutine slide_along(model, j, from, pin)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: j, from, pin
        real(wp) :: along(3), way
        integer :: block, side

        block = model%joint(j)%link(3 - from)
        side = merge(1, 2, model%joint(pin)%link(1) == block)
        along = matmul(rotation_of(model, model%joint(j)%link(from)), model%joint(j)%frame(:, 3, from))
        way = dot_product(along, place_of(model, pin, 3 - side) - place_of(model, pin, side))
        associate (new => model%scene%link(block)%start)
            new(:3) = new(:3) + way*along
        end associate
    end subroutine slide_along

    !> Place of a joint's marker.
    pure function place_of(model, j, side) result(place)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, side
        real(wp) :: place(3)

        associate (link => model%joint(j)%link(side))
            place = matmul(rotation_of(model, link), model%joint(j)%point(:, side))
            if (link > 0) place = place + model%scene%link(link)%start(:3)
        end associate
    end function place_of

    pure function rotation_of(model, link) result(rotation)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        real(wp) :: rotation(3, 3)

        rotation = matrix_of_angles([0.0_wp, 0.0_wp, 0.0_wp])
        if (link > 0) rotation = matrix_of_angles(model%scene%link(link)%start(4:))
    end function rotation_of
end module linkdyn_spread_starts
