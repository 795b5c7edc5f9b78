!> Recognise a platform that three pairs of parallel rods keep from turning, as that of a Delta robot: led by where a point of it
!> is, or hung on cranks or carriages that are placed already, by their drives, say.
!>
!> Each pair goes from a crank or carriage to the platform. The crank turns about a hinge along which its two balls lie, the
!> carriage slides and does not turn at all: so from ball to ball is the same vector always, as the base sees it. Where it is that
!> of the platform's balls, too, and both rods are equally long, a platform that stands as the base does closes all of it wherever
!> it is. In which axes the platform is written does not matter: there is an attitude of it, its *stance*, in which all three pairs
!> fit.
!>
!> A pair may be one rod between universal joints (RUU): its outer axes, that on the lead and that on the platform, are parallel
!> like both rods, and so are its inner ones, square to it.
module linkdyn_shift_plan
    use linkdyn_angles, only: angles_of_matrix, matrix_of_angles
    use linkdyn_cross, only: cross
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
        real(wp) :: stance(3, 3) = 0                           !! axes of the platform in those of the base
    end type shift_type

    !> What keeps a pair parallel: from ball to ball, or of a single rod the outer axes.
    type :: width_type
        real(wp) :: of_base(3) = 0, of_platform(3) = 0         !! axes of the base, which sees it so always; of the platform [m, 1]
        real(wp) :: bound = 0                                  !! how far from exact they may be by rounding
    end type width_type

contains

    !> Led by where it is, with its leads; `found` is false if some links make none.
    pure subroutine find_shift(model, member, known, given, shift, found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: member(:)                       !! links to be placed
        logical, intent(in) :: known(0:)                       !! links placed already
        integer, intent(in) :: given(:, :)                     !! coordinate or what some lead that gives a variable; 0: none (3,
                                                               !! joint)
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
        found = count_joints(model, member, known) == 2*shift%n_rod*n_pair
    end subroutine find_hung

    !> The three leads, each with its rods, and how the platform stands on them.
    pure subroutine find_pairs(model, member, may_lead, known, given, shift, found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: member(:)
        logical, intent(in) :: may_lead(:)                     !! (link)
        logical, intent(in) :: known(0:)
        integer, intent(in) :: given(:, :)
        type(shift_type), intent(inout) :: shift
        logical, intent(out) :: found
        type(width_type) :: width(n_pair)
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
            if (shift%n_rod == 1) then
                call see_single_rod(model, shift%platform, shift%leg(1, n), width(n), found)
            else
                call see_pair(model, shift%platform, shift%leg(:, n), width(n), found)
            end if
            found = found .and. base_turns_alike(model, shift, shift%leg(1, n))
            if (.not. found) return
        end do
        found = n == n_pair
        if (found) call find_stance(model, width, shift, found)
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
    end subroutine find_platform

    !> The attitude of the platform, as the base sees it, in which all pairs fit, unless the scene says another one of the start.
    !> Lines without a sense may fit in several: the nearest to the start, or to the base's axes, is taken.
    pure subroutine find_stance(model, width, shift, found)
        type(model_type), intent(in) :: model
        type(width_type), intent(in) :: width(n_pair)
        type(shift_type), intent(inout) :: shift
        logical, intent(out) :: found
        real(wp) :: told(3, 3), stance(3, 3), away, nearest
        logical :: has_start, is_turned(n_pair)
        integer :: i, k

        has_start = model%scene%link(shift%platform)%has_start
        told = matrix_of_angles(merge(model%scene%link(shift%platform)%start(4:), 0.0_wp, has_start))
        if (has_start .and. orientation_of(model, shift%base) /= 0) then
            ! it is as the world sees it
            found = model%scene%link(shift%base)%has_start
            if (.not. found) return
            told = matmul(transpose(matrix_of_angles(model%scene%link(shift%base)%start(4:))), told)
        end if
        nearest = huge(1.0_wp)
        do i = 0, merge(2**n_pair - 1, 0, shift%n_rod == 1)
            is_turned = [(btest(i, k - 1), k=1, n_pair)]
            call fit_widths(width, is_turned, stance, found)
            if (.not. found) cycle
            away = maxval(abs(angles_of_matrix(matmul(transpose(stance), told))))
            if (away >= nearest) cycle
            nearest = away
            shift%stance = stance
        end do
        found = nearest <= merge(turned, huge(1.0_wp)/2, has_start)
    end subroutine find_stance

    !> The rotation that takes what the platform has to what the base has, in some pairs reversed.
    pure subroutine fit_widths(width, is_turned, stance, found)
        type(width_type), intent(in) :: width(n_pair)
        logical, intent(in) :: is_turned(n_pair)
        real(wp), intent(out) :: stance(3, 3)
        logical, intent(out) :: found
        real(wp), parameter :: plain = 4*epsilon(1.0_wp)       !! so near to a whole number an element is that
        real(wp), parameter :: spread_apart = 1.0e-3_wp        !! sine of the least angle between two widths that tell the attitude
        real(wp) :: goal(3, n_pair), own(3, n_pair), sine(n_pair)
        integer :: n, other

        do n = 1, n_pair
            goal(:, n) = merge(-1, 1, is_turned(n))*width(n)%of_base
            own(:, n) = width(n)%of_platform
        end do
        stance = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])
        found = fits()
        if (found) return
        do n = 1, n_pair
            other = 1 + mod(n, n_pair)
            sine(n) = norm2(cross(own(:, n), own(:, other)))/(norm2(own(:, n))*norm2(own(:, other)))
        end do
        n = maxloc(sine, dim=1)
        if (sine(n) < spread_apart) return
        other = 1 + mod(n, n_pair)
        if (.not. norm2(cross(goal(:, n), goal(:, other))) > 0) return
        stance = matmul(axes_along(goal(:, n), goal(:, other)), transpose(axes_along(own(:, n), own(:, other))))
        where (abs(stance - anint(stance)) <= plain) stance = anint(stance)
        found = fits()

    contains

        pure logical function fits()
            integer :: k

            fits = .true.
            do k = 1, n_pair
                fits = fits .and. all(abs(matmul(stance, own(:, k)) - goal(:, k)) <= width(k)%bound)
            end do
        end function fits
    end subroutine fit_widths

    !> Right-handed axes: the first along a, the third square to a and b.
    pure function axes_along(a, b) result(axes)
        real(wp), intent(in) :: a(3), b(3)
        real(wp) :: axes(3, 3)

        axes(:, 1) = a/norm2(a)
        axes(:, 3) = cross(a, b)
        axes(:, 3) = axes(:, 3)/norm2(axes(:, 3))
        axes(:, 2) = cross(axes(:, 3), axes(:, 1))
    end function axes_along

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
        do j = 1, size(model%joint)
            if (is_pose_part(model%joint(j)%kind)) cycle
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

    !> One rod between universal joints that does what a pair does: its outer axes.
    pure subroutine see_single_rod(model, platform, leg, width, holds)
        type(model_type), intent(in) :: model
        integer, intent(in) :: platform
        type(step_type), intent(in) :: leg
        type(width_type), intent(out) :: width
        logical, intent(out) :: holds
        real(wp) :: rod(3), on_lead(3), inner(3, 2)
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
            width = width_type(matmul(first%frame(:, :, 3 - side), on_lead), axis_on(3, platform), alignment)
            holds = norm2(rod) > 0 .and. all(abs(matmul(rod, inner)) <= alignment*norm2(rod)) &
                    .and. are_parallel(inner(:, 1), inner(:, 2))
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
    end subroutine see_single_rod

    !> A pair whose rods are equally long, the same for its lead wherever that is: from one ball of it to the other.
    pure subroutine see_pair(model, platform, leg, width, holds)
        type(model_type), intent(in) :: model
        integer, intent(in) :: platform
        type(step_type), intent(in) :: leg(2)
        type(width_type), intent(out) :: width
        logical, intent(out) :: holds
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
            holds = norm2(at_platform) > bound .and. abs(length(1) - length(2)) <= bound
            if (leg(1)%kind == step_rus) holds = holds .and. all(abs(at_lead(:2)) <= bound)
            width = width_type(matmul(first%frame(:, :, 3 - side), at_lead), at_platform, bound)
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
    end subroutine see_pair
end module linkdyn_shift_plan
