!> The prescribed motion of the frame: a ship, an earthquake table, a turning drum that carries a mechanism.
!>
!> The scene gives the pose of the frame's axes in axes at rest, in which gravity is constant, as laws of time. All motion is seen
!> from the frame; what the mechanism feels of the frame's own are three vectors, in the frame's axes: by how much gravity seems
!> to differ from that of the scene, angular velocity, angular acceleration.
module linkdyn_base_motion
    use linkdyn_kinds, only: wp
    use linkdyn_laws, only: law_instants, most_instants, set_instants, evaluate_at_instants
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: law_spec, law_none, law_constant
    implicit none (type, external)
    private
    public :: n_base, base_size, evaluate_base, evaluate_base_pose, base_is_felt

    !> Numbers of what is felt: gravity [m/s2], angular velocity [rad/s], angular acceleration [rad/s2].
    integer, parameter :: n_base = 9

contains

    !> How many numbers a sample has of the frame's motion: none if the frame rests.
    pure integer function base_size(model)
        type(model_type), intent(in) :: model

        base_size = merge(n_base, 0, model%scene%base%moves)
    end function base_size

    !> Which of the numbers are not zero by rule.
    pure function base_is_felt(model) result(is_felt)
        type(model_type), intent(in) :: model
        logical :: is_felt(n_base)
        logical :: turns(3), is_there(3)               ! roll pitch yaw change, may be other than zero

        is_felt = .false.
        if (.not. model%scene%base%moves) return
        turns = changes(model%scene%base%motion(4:))
        is_there = turns .or. tilts(model%scene%base%motion(4:))
        is_felt(1:2) = .true.
        is_felt(3) = .not. model%is_planar
        ! about x, y, z: see `turning`
        is_felt(4) = turns(1) .or. (turns(2) .and. is_there(3))
        is_felt(5) = turns(2) .or. (turns(1) .and. is_there(3))
        is_felt(6) = turns(3) .or. (turns(1) .and. is_there(2))
        is_felt(7:) = is_felt(4:6)

    contains

        elemental logical function changes(law)
            type(law_spec), intent(in) :: law

            changes = law%kind /= law_none .and. law%kind /= law_constant
        end function changes

        elemental logical function tilts(law)
            type(law_spec), intent(in) :: law

            tilts = law%kind == law_constant .and. law%value(1) /= 0
        end function tilts
    end function base_is_felt

    !> What is felt of the frame's motion at some instants.
    pure subroutine evaluate_base(model, t, base)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(:)                   !! [s] (n)
        real(wp), intent(out) :: base(:, :)            !! (n_base, n)
        real(wp) :: law(6, 3, most_instants)           ! of some instants: a batch may be long
        integer :: first, last, i

        do first = 1, size(t), most_instants
            last = min(size(t), first + most_instants - 1)
            call evaluate_base_pose(model, t(first:last), law(:, :, :last - first + 1))
            do i = first, last
                associate (now => law(:, :, i - first + 1))
                    base(:3, i) = unturned(now(4:, 1), model%gravity - now(:3, 3)) - model%gravity
                    call turning(now(4:, :), base(4:6, i), base(7:9, i))
                end associate
            end do
        end do
    end subroutine evaluate_base

    !> How the frame moves: x y z roll pitch yaw, and their first and second derivatives.
    pure subroutine evaluate_base_pose(model, t, pose)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(:)                   !! [s] (n)
        real(wp), intent(out) :: pose(:, :, :)         !! (6, 3, n) [m, rad]
        type(law_instants) :: instants
        integer :: first, last, k

        pose = 0
        do first = 1, size(t), most_instants
            last = min(size(t), first + most_instants - 1)
            call set_instants(instants, t(first:last))
            do k = 1, 6
                if (model%scene%base%motion(k)%kind == law_none) cycle
                call evaluate_at_instants(model%scene%base%motion(k), instants, pose(k, 1, first:last), &
                                          pose(k, 2, first:last), pose(k, 3, first:last))
            end do
        end do
    end subroutine evaluate_base_pose

    !> A vector from axes at rest into those turned by Rx(roll) Ry(pitch) Rz(yaw).
    pure function unturned(angle, v) result(w)
        real(wp), intent(in) :: angle(3), v(3)
        real(wp) :: w(3)

        associate (c => cos(angle), s => sin(angle))
            w = [v(1), c(1)*v(2) + s(1)*v(3), c(1)*v(3) - s(1)*v(2)]
            w = [c(2)*w(1) - s(2)*w(3), w(2), s(2)*w(1) + c(2)*w(3)]
            w = [c(3)*w(1) + s(3)*w(2), c(3)*w(2) - s(3)*w(1), w(3)]
        end associate
    end function unturned

    !> Angular velocity and acceleration in the turned axes. These being the axes that turn, the second is the derivative of the
    !> first, component by component.
    pure subroutine turning(angle, omega, alpha)
        real(wp), intent(in) :: angle(3, 3)            !! roll pitch yaw; derivatives in the second and third column
        real(wp), intent(out) :: omega(3), alpha(3)
        real(wp) :: cp, sp, cy, sy

        cp = cos(angle(2, 1))
        sp = sin(angle(2, 1))
        cy = cos(angle(3, 1))
        sy = sin(angle(3, 1))
        associate (a => angle(1, 2), b => angle(2, 2), c => angle(3, 2), a2 => angle(1, 3), b2 => angle(2, 3), c2 => angle(3, 3))
            omega = [a*cp*cy + b*sy, b*cy - a*cp*sy, c + a*sp]
            alpha = [a2*cp*cy + b2*sy - a*b*sp*cy - a*c*cp*sy + b*c*cy, &
                     b2*cy - a2*cp*sy + a*b*sp*sy - a*c*cp*cy - b*c*sy, &
                     c2 + a2*sp + a*b*cp]
        end associate
    end subroutine turning
end module linkdyn_base_motion
