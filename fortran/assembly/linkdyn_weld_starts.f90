!> Where welded links are at the start: of links that are one body, one start says it for all.
module linkdyn_weld_starts
    use linkdyn_angles, only: matrix_of_angles
    use linkdyn_joint_table, only: joint_fixed
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    implicit none (type, external)
    private
    public :: spread_weld_starts

contains

    !> Links without a start of their own begin where welds put them against links that have one. They still count as without:
    !> what is nearest to the start is measured where the scene says it.
    pure subroutine spread_weld_starts(model)
        type(model_type), intent(inout) :: model
        logical :: is_placed(0:model%n_link), goes_on
        integer :: j, from

        is_placed(0) = .false.                         ! links on the frame are placed without iteration
        is_placed(1:) = model%scene%link%has_start
        do
            goes_on = .false.
            do j = 1, model%n_joint
                associate (link => model%joint(j)%link)
                    if (model%joint(j)%kind /= joint_fixed .or. any(link == 0)) cycle
                    if (is_placed(link(1)) .eqv. is_placed(link(2))) cycle
                    from = merge(1, 2, is_placed(link(1)))
                    call place_welded(model, j, from)
                    is_placed(link(3 - from)) = .true.
                    goes_on = .true.
                end associate
            end do
            if (.not. goes_on) return
        end do
    end subroutine spread_weld_starts

    pure subroutine place_welded(model, j, from)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: j, from                 !! weld, its side that is placed
        real(wp) :: known(3, 3), r(3, 3)

        associate (joint => model%joint(j), link => model%scene%link)
            associate (start => link(joint%link(from))%start, new => link(joint%link(3 - from))%start)
                known = matrix_of_angles(start(4:))
                r = matmul(matmul(known, joint%frame(:, :, from)), transpose(joint%frame(:, :, 3 - from)))
                new(:3) = start(:3) + matmul(known, joint%point(:, from)) - matmul(r, joint%point(:, 3 - from))
                new(4:) = [atan2(-r(2, 3), r(3, 3)), atan2(r(1, 3), norm2(r(2:, 3))), atan2(-r(1, 2), r(1, 1))]
            end associate
        end associate
    end subroutine place_welded
end module linkdyn_weld_starts
