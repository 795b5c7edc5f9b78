!> Do the stages of a step see the lifts of cams within it?
!>
!> A cam that turns evenly while its follower rests asks for no short steps, and no stage of a long one may come upon the next
!> lift. So the outline is looked at along the way of a step, as laws are (`linkdyn_narrow_laws`): how far it is from the marker's
!> point, over the direction in which it is touched, may have no peak or dip that is narrower than the widest gap between stages.
module linkdyn_narrow_cams
    use linkdyn_constants, only: two_pi
    use linkdyn_curve, only: curve_type, curve_point, point_at
    use linkdyn_kinds, only: wp
    use linkdyn_narrow_laws, only: narrowest, unwrap, travel, refined, part_before_peak, fewest, most, well_within, noise
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: follower_flat
    implicit none (type, external)
    private
    public :: cam_sight, plan_cam_sight, find_part_of_cams

    integer, parameter :: most_pieces = 4096           !! of a turn

    !> An outline as its follower goes along it.
    type :: cam_sight
        integer :: joint = 0
        real(wp), allocatable :: direction(:)          !! increasing, the last a turn ahead of the first [rad]
        real(wp), allocatable :: distance(:)           !! from the marker's point, of a flat face's line [m]
        real(wp) :: piece = 0                          !! half the width of the narrowest lift that it can have [rad]
    end type cam_sight

contains

    subroutine plan_cam_sight(model, sight)
        type(model_type), intent(in) :: model
        type(cam_sight), allocatable, intent(out) :: sight(:)
        integer :: j

        allocate (sight(model%n_cam))
        do j = 1, model%n_joint
            if (model%joint(j)%cam == 0) cycle
            associate (cam => model%scene%joint(j)%cam, of => sight(model%joint(j)%cam))
                of%joint = j
                call follow_outline(cam%curve, cam%follower == follower_flat, of)
            end associate
        end do
    end subroutine plan_cam_sight

    !> Directions and distances at the knots. Where the outline turns back, it goes on from where it was.
    pure subroutine follow_outline(curve, is_flat, sight)
        type(curve_type), intent(in) :: curve
        logical, intent(in) :: is_flat
        type(cam_sight), intent(inout) :: sight
        type(curve_point) :: point
        real(wp) :: towards(2)
        integer :: i, n

        n = size(curve%knot, 2)
        allocate (sight%direction(n + 1), sight%distance(n + 1))
        do i = 1, n
            point = point_at(curve, i, 0.0_wp)
            towards = merge(point%normal, point%at, is_flat)
            sight%direction(i) = atan2(towards(2), towards(1))
            sight%distance(i) = merge(dot_product(point%at, point%normal), norm2(point%at), is_flat)
        end do
        call unwrap(sight%direction(:n))
        do i = 2, n
            sight%direction(i) = max(sight%direction(i), sight%direction(i - 1))
        end do
        sight%direction(n + 1) = max(sight%direction(1) + two_pi, sight%direction(n))
        sight%distance(n + 1) = sight%distance(1)
        sight%piece = max(narrowest([sight%direction, sight%direction(2) + two_pi]), two_pi/most_pieces)
    end subroutine follow_outline

    !> How much of a step may be gone at once; 1: all of it.
    pure subroutine find_part_of_cams(sight, direction, gap, part)
        type(cam_sight), intent(in) :: sight(:)
        real(wp), intent(in) :: direction(:, :)        !! in which each is touched, at equal distances along the step (place, cam)
        real(wp), intent(in) :: gap                    !! the widest one between stages, part of the step
        real(wp), intent(out) :: part
        real(wp) :: followed(size(direction, 1)), asked
        real(wp), allocatable :: fine(:, :), value(:)
        integer :: k, i, n

        part = 1
        do k = 1, size(sight)
            followed = direction(:, k)
            if (.not. all(abs(followed) <= huge(1.0_wp))) cycle    ! whoever needs what cannot be closed says so
            call unwrap(followed)
            asked = travel(followed)/sight(k)%piece
            if (asked > most) then
                part = min(part, well_within*most/asked)
                cycle
            end if
            n = max(fewest, ceiling(asked))
            fine = refined(reshape(followed, [size(followed), 1]), n)
            value = [(distance_at(sight(k), fine(i, 1)), i=1, n + 1)]
            part = min(part, part_before_peak(value, gap, noise*maxval(sight(k)%distance)), &
                       part_before_peak(-value, gap, noise*maxval(sight(k)%distance)))
        end do
    end subroutine find_part_of_cams

    !> Distance of an outline in a direction, from knot to knot in a straight line.
    pure real(wp) function distance_at(sight, direction) result(distance)
        type(cam_sight), intent(in) :: sight
        real(wp), intent(in) :: direction              !! [rad]
        real(wp) :: at, part
        integer :: low, high, middle

        at = sight%direction(1) + modulo(direction - sight%direction(1), two_pi)
        low = 1
        high = size(sight%direction)
        do while (high - low > 1)
            middle = (low + high)/2
            if (sight%direction(middle) <= at) then
                low = middle
            else
                high = middle
            end if
        end do
        part = (at - sight%direction(low))/max(sight%direction(high) - sight%direction(low), tiny(1.0_wp))
        distance = sight%distance(low) + max(0.0_wp, min(1.0_wp, part))*(sight%distance(high) - sight%distance(low))
    end function distance_at
end module linkdyn_narrow_cams
