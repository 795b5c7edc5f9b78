!> Joint angles along a motion count their turns: from sample to sample an angle is taken that differs least.
!>
!> An angle that is a coordinate is what the coordinate is; the others begin within half a turn of zero.
module linkdyn_turns
    use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
    use linkdyn_constants, only: two_pi
    use linkdyn_joint_table, only: wraps
    use linkdyn_joint_rates, only: coordinate_of
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: joint_n_variable
    implicit none (type, external)
    private
    public :: turn_count, count_turns

    !> The joint variables of the last sample that had any.
    type :: turn_count
        real(wp), allocatable :: before(:)             !! (n_variable)
    end type turn_count

contains

    !> Joint variables measured within half a turn, so that their angles count turns.
    subroutine count_turns(model, variable, turns, q)
        type(model_type), intent(in) :: model
        real(wp), intent(inout) :: variable(:, :)      !! (n_variable, n); samples that failed are NaN
        type(turn_count), intent(inout) :: turns
        real(wp), intent(in), optional :: q(:, :)      !! of the model's coordinates (n_q, n); absent: from before
        integer :: i, j, k, v

        if (.not. allocated(turns%before)) allocate (turns%before(size(variable, 1)), source=0.0_wp)
        do j = 1, model%n_joint
            do v = 1, joint_n_variable(model%joint(j)%told_kind)
                if (.not. wraps(model%joint(j)%told_kind, v)) cycle
                k = 0
                if (present(q)) k = coordinate_of(model, j, v)
                associate (value => variable(model%joint(j)%first_variable + v, :), &
                           before => turns%before(model%joint(j)%first_variable + v))
                    do i = 1, size(value)
                        if (.not. ieee_is_finite(value(i))) cycle
                        if (k > 0) before = q(k, i)
                        value(i) = value(i) - two_pi*anint((value(i) - before)/two_pi)
                        before = value(i)
                    end do
                end associate
            end do
        end do
    end subroutine count_turns
end module linkdyn_turns
