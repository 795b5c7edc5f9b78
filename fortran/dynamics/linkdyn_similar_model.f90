!> A mechanism similar to a given one, of another size: what the error estimate computes again with.
!>
!> With all lengths, gravity and forces of loads s times as large, moments of loads and inertias s**2 times, the forces are
!> s times and the moments s**2 times those of the model, at the same angles and times. But for rounding: all numbers
!> have other digits, so the data and every operation round differently. Zeros stay zero and equal lengths stay equal,
!> so the similar mechanism has the same equations.
module linkdyn_similar_model
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_joint_motion, only: is_slide
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, link_freedom, is_length
    use linkdyn_scene, only: law_spec
    implicit none (type, external)
    private
    public :: make_similar, coordinate_scale, drive_scale, near_one

contains

    !> The similar model of size `scale`; different numbers `copy` of it differ in the last place of what has no size.
    subroutine make_similar(model, copy, scale, similar)
        type(model_type), intent(in) :: model
        integer, intent(in) :: copy
        real(wp), intent(in) :: scale                !! s
        type(model_type), intent(out) :: similar
        real(wp) :: own_scale
        integer :: i, k, n_length

        similar = model
        similar%gravity = scale*model%gravity
        do i = 1, model%n_link
            similar%link(i)%cog = scale*model%link(i)%cog
            similar%link(i)%inertia = scale**2*model%link(i)%inertia
            do k = 1, size(model%scene%link(i)%marker)
                similar%scene%link(i)%marker(k)%at = scale*model%scene%link(i)%marker(k)%at
            end do
        end do
        do k = 1, size(model%scene%frame%marker)
            similar%scene%frame%marker(k)%at = scale*model%scene%frame%marker(k)%at
        end do
        do i = 1, model%n_joint
            similar%joint(i)%point = scale*model%joint(i)%point
            similar%joint(i)%frame = other_rounding(copy, model%joint(i)%frame)
        end do
        do i = 1, size(model%scene%spring)
            associate (spring => similar%scene%spring(i))
                if (is_angular(model, spring%joint, spring%variable)) then
                    spring%stiffness = scale**2*spring%stiffness
                    spring%damping = scale**2*spring%damping
                else
                    spring%rest = scale*spring%rest
                end if
            end associate
        end do
        do i = 1, model%n_q
            own_scale = coordinate_scale(model, i, scale)
            similar%start_q(i) = own_scale*model%start_q(i)
            similar%stride(i) = own_scale*model%stride(i)
            similar%scene%coordinate(i)%start_position = own_scale*model%scene%coordinate(i)%start_position
            call scale_law(own_scale, similar%scene%coordinate(i)%motion)
        end do
        do i = 1, size(model%group)
            n_length = link_freedom(model) - merge(1, 3, model%is_planar)
            similar%group(i)%start(:n_length, :) = scale*model%group(i)%start(:n_length, :)
        end do
    end subroutine make_similar

    !> What a coordinate is multiplied by: angles stay.
    pure real(wp) function coordinate_scale(model, i, scale)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        real(wp), intent(in) :: scale

        coordinate_scale = merge(scale, 1.0_wp, is_length(model, i))
    end function coordinate_scale

    !> What a driving force is multiplied by; a torque by its square.
    pure real(wp) function drive_scale(model, i, scale)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        real(wp), intent(in) :: scale

        associate (actuator => model%scene%actuator(i))
            drive_scale = merge(scale, scale**2, is_slide(model%joint(actuator%joint)%kind, actuator%variable))
        end associate
    end function drive_scale

    !> Does a spring turn a joint, so that its stiffness is a moment per angle?
    pure logical function is_angular(model, joint, variable)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint, variable       !! 0: a spring between markers

        is_angular = .false.
        if (joint > 0) is_angular = .not. is_slide(model%joint(joint)%kind, variable)
    end function is_angular

    pure subroutine scale_law(scale, law)
        real(wp), intent(in) :: scale
        type(law_spec), intent(inout) :: law

        law%value(:2) = scale*law%value(:2)          ! the others are durations, frequencies, phases
        if (allocated(law%knot)) law%knot = scale*law%knot
        if (allocated(law%curvature)) law%curvature = scale*law%curvature
    end subroutine scale_law

    !> A component of an axis as it may be rounded as well: off by half a unit in the last place to one. Axes along x, y, z
    !> stay what they are, equal components stay equal.
    elemental real(wp) function other_rounding(copy, value) result(other)
        integer, intent(in) :: copy
        real(wp), intent(in) :: value

        other = value
        if (abs(value) /= 1) other = value*near_one([copy, nint(value*2.0_wp**29)])
    end function other_rounding

    !> A factor off 1 by half an epsilon to one, up or down, pseudo-random: the same for the same key.
    pure real(wp) function near_one(key) result(factor)
        integer, intent(in) :: key(:)
        integer(int64), parameter :: modulus = 2147483647_int64, multiplier = 48271_int64    ! Park and Miller's
        integer(int64) :: state
        integer :: i, k
        real(wp) :: amount

        state = 1
        do i = 1, size(key)
            state = modulo(state + key(i), modulus)
            do k = 1, 3
                state = modulo(multiplier*(state + 12345), modulus)
            end do
        end do
        amount = 2*real(state, wp)/real(modulus, wp) - 1    ! -1 ... 1
        factor = 1 + epsilon(1.0_wp)*(sign(0.5_wp, amount) + 0.5_wp*amount)
    end function near_one
end module linkdyn_similar_model
