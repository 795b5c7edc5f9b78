!> At which ball an idle spin is held, and by what directions.
!>
!> A direction of the link beyond the ball is kept square to one of the spinning link. It fails where the line of the spinning
!> link comes to lie along it, so it should stay far from that line in all the motion. The axis of a hinge about which the link
!> beyond turns is such a direction if it is far from the line at the start, whichever way the hinge is turned. Of a link that
!> hardly turns, the frame or a platform, one square to the line at the start is as good. A cylindrical joint holds for good, but
!> what it has as a variable of its own is lost: it does so where a ball is wanted for another spin.
module linkdyn_spin_axes
    use linkdyn_cross, only: cross
    use linkdyn_idle_spin, only: idle_spin, square_to
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, side_of
    use linkdyn_scene, only: hold_spec, joint_revolute, joint_cylindrical, frame_link
    implicit none (type, external)
    private
    public :: choose_holds

    !> What a direction square to the line is worth, against the sine between the line and a hinge's axis: the frame does not turn,
    !> a platform turns by less than a right angle, a crank all the way round.
    real(wp), parameter :: worth_in_frame = 0.9_wp, worth_in_platform = 0.8_wp, worth_in_crank = 0.2_wp
    real(wp), parameter :: worth_of_collar = -1, tried = -2    !! less than that of any ball
    !> No symmetry of a mechanism has its line just there: for as long as nobody knows where the links are.
    real(wp), parameter :: odd_direction(3) = [0.48_wp, 0.64_wp, 0.6_wp]

contains

    !> A ball for each spin, or a collar, none twice. Spins that none is left for stay unsettled.
    subroutine choose_holds(model, spin, hold, stand)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin(:)
        type(hold_spec), allocatable, intent(out) :: hold(:)
        real(wp), intent(in), optional :: stand(:, :, 0:)  !! rotations of the links at the start (3, 3, 0:n_link)
        integer :: holder(model%n_joint)                   !! spin that a ball holds; 0: none
        logical :: is_tried(model%n_joint), is_settled
        real(wp) :: worth
        integer :: i, j, n

        holder = 0
        do i = 1, size(spin)
            is_tried = .false.
            is_settled = finds_ball(i)
        end do
        allocate (hold(count(holder > 0)))
        n = 0
        do j = 1, model%n_joint
            if (holder(j) == 0) cycle
            n = n + 1
            call consider(model, spin(holder(j)), j, hold(n), worth, stand)
        end do

    contains

        !> Find a ball by augmenting paths: the best that is free, or whose holder finds another.
        recursive logical function finds_ball(i) result(found)
            integer, intent(in) :: i
            type(hold_spec) :: candidate
            integer :: joint(size(spin(i)%ball) + size(spin(i)%collar))
            real(wp) :: worth(size(joint))
            integer :: n, k

            joint = [spin(i)%ball, spin(i)%collar]
            do k = 1, size(worth)
                call consider(model, spin(i), joint(k), candidate, worth(k), stand)
            end do
            found = .false.
            do n = 1, size(worth)
                k = maxloc(worth, 1)
                worth(k) = tried
                associate (ball => joint(k))
                    if (is_tried(ball)) cycle
                    is_tried(ball) = .true.
                    if (holder(ball) == 0) then
                        found = .true.
                    else
                        found = finds_ball(holder(ball))
                    end if
                    if (.not. found) cycle
                    holder(ball) = i
                    return
                end associate
            end do
        end function finds_ball
    end subroutine choose_holds

    !> What a ball can do for a spin.
    subroutine consider(model, spin, ball, hold, worth, stand)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin
        integer, intent(in) :: ball
        type(hold_spec), intent(out) :: hold
        real(wp), intent(out) :: worth
        real(wp), intent(in), optional :: stand(:, :, 0:)
        real(wp) :: line(3), axis(3)
        integer :: own, beyond, i

        hold%joint = ball
        hold%links = trim(model%link(spin%link(1))%name)
        do i = 2, size(spin%link)
            hold%links = hold%links//"+"//trim(model%link(spin%link(i))%name)
        end do
        hold%side = merge(1, 2, any(spin%link == model%joint(ball)%link(1)))
        if (model%joint(ball)%kind == joint_cylindrical) then
            worth = worth_of_collar
            return
        end if
        own = model%joint(ball)%link(hold%side)
        beyond = model%joint(ball)%link(3 - hold%side)
        hold%axis(:, hold%side) = square_to(model%link(own)%spin_axis)
        worth = 0
        axis = odd_direction
        if (present(stand)) then
            line = matmul(transpose(stand(:, :, beyond)), matmul(stand(:, :, own), model%link(own)%spin_axis))
            axis = square_to(line)
            worth = worth_in_frame
            if (beyond /= frame_link) call look_beyond()
        end if
        hold%axis(:, 3 - hold%side) = axis

    contains

        !> Hinges of the link beyond, or its own line if it is a rod, too.
        subroutine look_beyond()
            integer :: i

            worth = worth_in_crank
            if (model%link(beyond)%spin > 0) call compare(model%link(beyond)%spin_axis)
            associate (joint => model%joint(model%joint_at(model%first_at(beyond):model%first_at(beyond + 1) - 1)))
                if (model%link(beyond)%spin == 0 .and. .not. any(is_hinge(joint%kind))) worth = worth_in_platform
                do i = 1, size(joint)
                    if (is_hinge(joint(i)%kind)) call compare(joint(i)%frame(:, 3, side_of(joint(i), beyond)))
                end do
            end associate
        end subroutine look_beyond

        subroutine compare(direction)
            real(wp), intent(in) :: direction(3)
            real(wp) :: sine

            sine = norm2(cross(direction, line))
            if (sine <= worth) return
            worth = sine
            axis = direction
        end subroutine compare
    end subroutine consider

    elemental logical function is_hinge(kind)
        integer, intent(in) :: kind

        is_hinge = kind == joint_revolute .or. kind == joint_cylindrical
    end function is_hinge
end module linkdyn_spin_axes
