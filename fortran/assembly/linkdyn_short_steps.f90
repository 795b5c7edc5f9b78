!> Steps along a motion that are so short against the margin that nothing can lie between: groups closed by iteration, at a
!> block of samples one after the other.
!>
!> Let B be the constraints' matrix, lengths by the mechanism's size, and s its smallest singular value, which the margin is about.
!> When each link shifts and turns by up to d, a row of B changes by up to d times a number of about one, and two links stand in
!> it; with up to n joints at a link, B changes by up to d sqrt(2 n) (Schur's test). By Weyl's inequality
!>
!> - s does not vanish within d < s/sqrt(2 n) of a place, and
!> - within this distance the constraints have no second solution: the mean of B between two of them were singular.
!>
!> So where the links' speed leads no farther than a quarter of this, and they have come no farther, the assembly that is found
!> at one end of a step is the one that leads from the other along the straight way, and no margin vanishes between. Neither the
!> margin's rate is asked then, nor whether rates explain where links have gone: both are for longer steps.
!>
!> **Source**: G. W. Stewart, J.-G. Sun, Matrix Perturbation Theory, Academic Press 1990, chapter IV.
module linkdyn_short_steps
    use linkdyn_group_block, only: group_block
    use linkdyn_joint_table, only: joint_revolute, joint_prismatic, joint_cylindrical, joint_planar, joint_screw, joint_gear, &
        joint_rack, joint_belt, joint_cam
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, group_type, is_length
    implicit none (type, external)
    private
    public :: short_part, moves_shortly, are_short

    real(wp), parameter :: of_distance = 0.25_wp    !! to where the constraints may become singular

contains

    !> How far links may get in a short step, part of the margin; 0: there are joints whose constraints may bend more sharply.
    pure real(wp) function short_part(model) result(part)
        type(model_type), intent(in) :: model
        integer :: g, n

        n = 0
        part = 0
        do g = 1, size(model%group)
            if (bends_sharply(model, model%group(g))) return
            n = max(n, most_joints(model, model%group(g)))
        end do
        if (n > 0) part = of_distance/sqrt(2.0_wp*n)
    end function short_part

    !> Wheels, cams and threads multiply motion, and angles about more than one axis have poles.
    pure logical function bends_sharply(model, group)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer :: i, k

        bends_sharply = group%n_thread > 0 .or. any(group%coordinate > model%n_q)
        if (bends_sharply) return
        do i = 1, size(group%joint)
            associate (kind => model%joint(group%joint(i))%kind)
                bends_sharply = bends_sharply .or. any(kind == [joint_screw, joint_gear, joint_rack, joint_belt, joint_cam])
                if (any(kind == [joint_revolute, joint_prismatic, joint_cylindrical, joint_planar])) cycle
                do k = 1, size(group%coordinate, 1)
                    if (group%coordinate(k, i) == 0) cycle
                    bends_sharply = bends_sharply .or. .not. is_length(model, group%coordinate(k, i))
                end do
            end associate
        end do
    end function bends_sharply

    !> At one of the group's links.
    pure integer function most_joints(model, group) result(most)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer :: i, k, n

        most = 0
        do i = 1, size(group%link)
            n = 0
            do k = 1, size(group%joint)
                if (any(model%joint(group%joint(k))%link == group%link(i))) n = n + 1
            end do
            most = max(most, n)
        end do
    end function most_joints

    !> Would the links' speeds lead to the next samples by short steps with something to spare?
    pure logical function moves_shortly(part, block)
        real(wp), intent(in) :: part                           !! `short_part`
        type(group_block), intent(in) :: block

        moves_shortly = part > 0
        if (moves_shortly) moves_shortly = all(block%is_closed) .and. all(2*block%speed <= part*abs(block%margin))
    end function moves_shortly

    !> Are the steps to all samples short, each from the one before, along whose way the speeds are?
    pure logical function are_short(model, part, place, margin, block)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: part                           !! `short_part`
        real(wp), intent(in), contiguous :: place(:, :)        !! before the first (place_size, n_link)
        real(wp), intent(in) :: margin(:)                      !! there (n_group)
        type(group_block), intent(in) :: block
        real(wp), dimension(size(block%is_closed)) :: reach, square
        integer :: g, i

        are_short = all(block%is_closed)
        if (.not. are_short) return
        do g = 1, size(model%group)
            associate (here => block%margin(:, g), n => size(reach), whole => model%group(g)%size)
                are_short = all(sign(1.0_wp, margin(g))*here > model%least_margin(model%n_branch + g))
                if (.not. are_short) return
                reach(1) = part*min(abs(margin(g)), abs(here(1)))
                reach(2:) = part*min(abs(here(:n - 1)), abs(here(2:)))
                square = 0
                do i = 1, size(model%group(g)%link)
                    associate (l => model%group(g)%link(i))
                        call measure_steps(1, 1, n, size(place, 1), whole, place(:, l), block%place(1, 1, l), square)
                        if (n > 1) call measure_steps(n - 1, n, n, size(place, 1), whole, block%place(1, 1, l), &
                                                      block%place(2, 1, l), square(2:))
                    end associate
                end do
                are_short = all(square <= reach**2 .and. block%speed(:, g) <= reach)
                if (.not. are_short) return
            end associate
        end do
    end function are_short

    !> The squares of how far a link has come on some steps, where that is more than others have: shifts by the group's size, or
    !> turns. A turn by an angle moves the unit quaternion by 2 sin(angle/4), about twice of which make the angle where it is small.
    pure subroutine measure_steps(n, n_from, n_to, n_place, whole, from, to, square)
        integer, intent(in) :: n                               !! steps
        integer, intent(in) :: n_from, n_to                    !! from one number of a sample to its next
        integer, intent(in) :: n_place                         !! numbers of a place
        real(wp), intent(in) :: whole                          !! the group's size
        real(wp), intent(in) :: from(n_from, *), to(n_to, *)   !! places
        real(wp), intent(inout) :: square(n)
        real(wp), parameter :: of_turn = 2.01_wp**2
        real(wp) :: of_shift
        integer :: s

        of_shift = 1/whole**2
        if (n_place == 3) then
            do s = 1, n
                square(s) = max(square(s), of_shift*((to(s, 1) - from(s, 1))**2 + (to(s, 2) - from(s, 2))**2), &
                                (to(s, 3) - from(s, 3))**2)
            end do
        else
            do s = 1, n
                square(s) = max(square(s), &
                                of_shift*((to(s, 1) - from(s, 1))**2 + (to(s, 2) - from(s, 2))**2 + (to(s, 3) - from(s, 3))**2), &
                                of_turn*((to(s, 4) - from(s, 4))**2 + (to(s, 5) - from(s, 5))**2 + (to(s, 6) - from(s, 6))**2 &
                                         + (to(s, 7) - from(s, 7))**2))
            end do
        end if
    end subroutine measure_steps
end module linkdyn_short_steps
