!> Recognise a platform that three pairs of parallel rods keep from turning, as that of a Delta robot: led by where a point of it is,
!> or hung on cranks or carriages that are placed already, by their drives, say.
!>
!> Each pair goes from a crank or carriage to the platform. The crank turns about a hinge along which its two balls lie, the carriage
!> slides and does not turn at all: so from ball to ball is the same vector always, as the base sees it. Where it is that of the
!> platform's balls, too, and both rods are equally long, a platform that stands as the base does closes all of it wherever it is.
!>
!> A pair may be one rod between universal joints (RUU): its outer axes, that on the lead and that on the platform, are parallel like
!> both rods, and so are its inner ones, square to it.
module linkdyn_shift_plan
    use linkdyn_joint_table, only: is_pose_part, pose_position
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, step_type, step_rus, side_of, orientation_of
    use linkdyn_rod_plan, only: name_rod_leg
    use linkdyn_scene, only: joint_revolute, joint_prismatic, joint_universal
    implicit none (type, external)
    private
    public :: shift_type, find_shift, find_hung, n_pair

    integer, parameter :: n_pair = 3
    integer, parameter :: n_member = 1 + 3*n_pair              !! platform; of each pair its lead and two rods
    real(wp), parameter :: alignment = 64*epsilon(1.0_wp)      !! how far from exact a given place may be by rounding
    real(wp), parameter :: turned = 0.5_wp                     !! a start beyond is that of another assembly [rad]

    !> The platform and what holds it.
    type :: shift_type
        integer :: platform = 0
        integer :: position = 0                                !! joint: the part of its pose that is given; 0: none is
        integer :: base = 0                                    !! the link against which it does not turn
        integer :: n_rod = 2                                   !! of a pair
        type(step_type) :: leg(2, n_pair)                      !! lead with either of its rods, as a leg (rod, pair)
    end type shift_type

contains

    !> Led by where it is, with its leads; `found` is false if some links make none.
    pure subroutine find_shift(model, member, known, given, shift, found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: member(:)                       !! links to be placed
        logical, intent(in) :: known(0:)                       !! links placed already
        integer, intent(in) :: given(:, :)                     !! coordinate or what some lead that gives a variable; 0: none (3, joint)
        type(shift_type), intent(out) :: shift
        logical, intent(out) :: found
        integer :: i

        found = .false.
        if (size(member) /= n_member) return
        call find_platform(model, member, known, given, shift)
        if (shift%platform == 0) return
        call find_pairs(model, member, [(any(member == i), i=1, model%n_link)], known, given, shift, found)
        if (found) found = count_joints(model, member, known) == 5*n_pair
    end subroutine find_shift

    !> Hung on leads that are known.
    pure subroutine find_hung(model, member, known, given, shift, found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: member(:)                       !! as above
        logical, intent(in) :: known(0:)
        integer, intent(in) :: given(:, :)
        type(shift_type), intent(out) :: shift
        logical, intent(out) :: found
        integer :: i, k

        found = .false.
        shift%n_rod = (size(member) - 1)/n_pair
        if (size(member) /= 1 + shift%n_rod*n_pair .or. all(shift%n_rod /= [1, 2])) return
        do i = 1, size(member)
            if (all([(k == i .or. joint_between(model, member(i), member(k)) > 0, k=1, size(member))])) shift%platform = member(i)
        end do
        if (shift%platform == 0) return
        call find_pairs(model, member, known(1:), known, given, shift, found)
        if (.not. found) return
        found = stands_as_base(model, shift) .and. count_joints(model, member, known) == 2*shift%n_rod*n_pair
    end subroutine find_hung

    !> The three leads, each with its rods.
    pure subroutine find_pairs(model, member, may_lead, known, given, shift, found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: member(:)
        logical, intent(in) :: may_lead(:)                     !! (link)
        logical, intent(in) :: known(0:)
        integer, intent(in) :: given(:, :)
        type(shift_type), intent(inout) :: shift
        logical, intent(out) :: found
        integer :: n, lead, joint(1 + shift%n_rod)

        found = .false.
        n = 0
        do lead = 1, model%n_link
            if (.not. may_lead(lead)) cycle
            joint = joints_of_lead(model, lead, member, known, shift%n_rod)
            if (any(joint == 0)) cycle
            n = n + 1
            if (n > n_pair) return
            if (any(given(:, joint(2:)) > 0) .or. (any(given(:, joint(1)) > 0) .and. .not. known(lead))) return
            call name_pair(model, lead, joint, shift%platform, given, shift%leg(:, n), found)
            if (.not. found) return
            if (shift%position == 0 .and. n == 1) shift%base = base_of(model, shift%leg(1, n))
            found = base_turns_alike(model, shift, shift%leg(1, n))
            if (shift%n_rod == 1) then
                found = found .and. holds_like_a_pair(model, shift%platform, shift%leg(1, n))
            else
                found = found .and. is_parallel(model, shift%platform, shift%leg(:, n))
            end if
            if (.not. found) return
        end do
        found = n == n_pair
    end subroutine find_pairs

    !> The member of whose pose a position is given, and no attitude.
    pure subroutine find_platform(model, member, known, given, shift)
        type(model_type), intent(in) :: model
        integer, intent(in) :: member(:), given(:, :)
        logical, intent(in) :: known(0:)
        type(shift_type), intent(inout) :: shift
        integer :: j

        do j = model%n_joint + 1, size(model%joint)
            associate (joint => model%joint(j))
                if (.not. is_pose_part(joint%kind) .or. all(given(:, j) == 0)) cycle
                if (.not. any(member == joint%link(1) .or. member == joint%link(2))) cycle
                if (shift%position > 0 .or. joint%kind /= pose_position .or. any(given(:, j) == 0) &
                    .or. .not. known(joint%link(1))) then
                    shift%platform = 0
                    return
                end if
                shift%position = j
                shift%platform = joint%link(2)
            end associate
        end do
        if (shift%platform == 0) return
        shift%base = model%joint(shift%position)%link(1)
        if (.not. stands_as_base(model, shift)) shift%platform = 0
    end subroutine find_platform

    !> Does the scene say nothing else of the start?
    pure logical function stands_as_base(model, shift)
        type(model_type), intent(in) :: model
        type(shift_type), intent(in) :: shift

        associate (link => model%scene%link(shift%platform))
            stands_as_base = .not. link%has_start
            if (stands_as_base) return
            ! which is as the world sees it
            stands_as_base = orientation_of(model, shift%base) == 0 .and. all(abs(link%start(4:)) <= turned)
        end associate
    end function stands_as_base

    !> Of a crank or carriage: the joint to a known link, then those of its rods; zero if it is none.
    pure function joints_of_lead(model, lead, member, known, n_rod) result(joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lead, member(:), n_rod
        logical, intent(in) :: known(0:)
        integer :: joint(1 + n_rod)
        integer :: k, n, other

        joint = 0
        n = 1
        do k = model%first_at(lead), model%first_at(lead + 1) - 1
            associate (j => model%joint_at(k))
                other = model%joint(j)%link(3 - side_of(model%joint(j), lead))
                if (known(other) .and. any(model%joint(j)%kind == [joint_revolute, joint_prismatic])) then
                    joint(1) = j
                else if (any(member == other)) then
                    n = n + 1
                    if (n <= size(joint)) joint(n) = j
                end if
            end associate
        end do
        if (n /= size(joint)) joint = 0
    end function joints_of_lead

    !> A lead with its two rods as two legs to the platform.
    pure subroutine name_pair(model, lead, joint, platform, given, leg, found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lead, joint(:), platform, given(:, :)
        type(step_type), intent(inout) :: leg(2)
        logical, intent(out) :: found
        integer :: i

        found = .false.
        do i = 1, size(joint) - 1
            associate (rod => model%joint(joint(1 + i))%link(3 - side_of(model%joint(joint(1 + i)), lead)))
                leg(i)%n_link = 2
                leg(i)%link(:2) = [lead, rod]
                leg(i)%joint(:3) = [joint(1), joint(1 + i), joint_between(model, rod, platform)]
            end associate
            if (leg(i)%joint(3) == 0) return
            if (any(given(:, leg(i)%joint(3)) > 0)) return
            found = size(joint) == 2
            if (.not. found) call name_rod_leg(model, leg(i), found)
            if (.not. found) return
        end do
    end subroutine name_pair

    pure integer function joint_between(model, a, b) result(joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: a, b
        integer :: k

        joint = 0
        do k = model%first_at(a), model%first_at(a + 1) - 1
            if (any(model%joint(model%joint_at(k))%link == b)) joint = model%joint_at(k)
        end do
    end function joint_between

    !> Joints among the members and from these to known links.
    pure integer function count_joints(model, member, known) result(n)
        type(model_type), intent(in) :: model
        integer, intent(in) :: member(:)
        logical, intent(in) :: known(0:)
        logical :: is_here(0:model%n_link)
        integer :: j

        is_here = known
        is_here(member) = .true.
        n = 0
        do j = 1, model%n_joint
            associate (link => model%joint(j)%link)
                if (all(is_here(link)) .and. .not. all(known(link))) n = n + 1
            end associate
        end do
    end function count_joints

    !> Does the link that the lead hangs on turn as the one does that the platform stands as?
    pure logical function base_turns_alike(model, shift, leg)
        type(model_type), intent(in) :: model
        type(shift_type), intent(in) :: shift
        type(step_type), intent(in) :: leg

        associate (base => base_of(model, leg))
            base_turns_alike = base == shift%base
            if (.not. base_turns_alike) base_turns_alike = orientation_of(model, base) == orientation_of(model, shift%base)
        end associate
    end function base_turns_alike

    pure integer function base_of(model, leg) result(base)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: leg

        associate (first => model%joint(leg%joint(1)))
            base = first%link(3 - side_of(first, leg%link(1)))
        end associate
    end function base_of

    !> Does one rod between universal joints do what a pair does?
    pure logical function holds_like_a_pair(model, platform, leg) result(holds)
        type(model_type), intent(in) :: model
        integer, intent(in) :: platform
        type(step_type), intent(in) :: leg
        real(wp) :: rod(3), on_lead(3), on_base(3), inner(3, 2)
        integer :: side

        associate (joint => model%joint, first => model%joint(leg%joint(1)), rod_link => leg%link(2))
            holds = all(joint(leg%joint(2:3))%kind == joint_universal)
            if (.not. holds) return
            rod = joint(leg%joint(3))%point(:, side_of(joint(leg%joint(3)), rod_link)) &
                  - joint(leg%joint(2))%point(:, side_of(joint(leg%joint(2)), rod_link))
            inner(:, 1) = axis_on(2, rod_link)
            inner(:, 2) = axis_on(3, rod_link)
            side = side_of(first, leg%link(1))
            on_lead = matmul(axis_on(2, leg%link(1)), first%frame(:, :, side))
            on_base = matmul(first%frame(:, :, 3 - side), on_lead)
            holds = norm2(rod) > 0 .and. all(abs(matmul(rod, inner)) <= alignment*norm2(rod)) &
                    .and. are_parallel(inner(:, 1), inner(:, 2)) .and. are_parallel(on_base, axis_on(3, platform))
            if (first%kind == joint_revolute) holds = holds .and. all(abs(on_lead(:2)) <= alignment)
        end associate

    contains

        !> Of a universal joint of the leg on one of its links, link axes.
        pure function axis_on(j, link) result(axis)
            integer, intent(in) :: j, link
            real(wp) :: axis(3)

            associate (joint => model%joint(leg%joint(j)))
                axis = joint%frame(:, 3, side_of(joint, link))
            end associate
        end function axis_on

        !> Unit vectors, either way round.
        pure logical function are_parallel(a, b)
            real(wp), intent(in) :: a(3), b(3)

            are_parallel = min(norm2(a - b), norm2(a + b)) <= alignment
        end function are_parallel
    end function holds_like_a_pair

    !> Are both rods of a pair parallel and equally long wherever the platform is, which stands as the base does?
    pure logical function is_parallel(model, platform, leg)
        type(model_type), intent(in) :: model
        integer, intent(in) :: platform
        type(step_type), intent(in) :: leg(2)
        real(wp) :: at_lead(3), at_platform(3), length(2), bound
        integer :: i, side

        at_lead = own_point(2, leg(1)%link(1), 2) - own_point(2, leg(1)%link(1), 1)
        at_platform = own_point(3, platform, 2) - own_point(3, platform, 1)
        do i = 1, 2
            length(i) = norm2(own_point(3, leg(i)%link(2), i) - own_point(2, leg(i)%link(2), i))
        end do
        bound = alignment*maxval([length, abs(own_point(3, platform, 1)), abs(own_point(3, platform, 2))])
        associate (first => model%joint(leg(1)%joint(1)))
            side = side_of(first, leg(1)%link(1))
            at_lead = matmul(at_lead, first%frame(:, :, side))
            is_parallel = norm2(at_platform) > bound .and. abs(length(1) - length(2)) <= bound
            if (leg(1)%kind == step_rus) is_parallel = is_parallel .and. all(abs(at_lead(:2)) <= bound)
            is_parallel = is_parallel .and. all(abs(matmul(first%frame(:, :, 3 - side), at_lead) - at_platform) <= bound)
        end associate

    contains

        !> Of joint j of a leg on one of its links, link axes.
        pure function own_point(j, link, i) result(point)
            integer, intent(in) :: j, link, i
            real(wp) :: point(3)

            associate (joint => model%joint(leg(i)%joint(j)))
                point = joint%point(:, side_of(joint, link))
            end associate
        end function own_point
    end function is_parallel
end module linkdyn_shift_plan
