!> How far coordinates go in one stride of a way: a tenth of a radian, or of the mechanism's size.
!>
!> Turns of a thread are small ways, many of which make one of that size. So a screw's angle goes as many radians as take its nut
!> so far, and that of a hinge likewise whose link turns in nothing but threads about the same axis: a spindle in its bearing.
module linkdyn_strides
    use linkdyn_gearing, only: is_on_axis
    use linkdyn_joint_table, only: is_threaded
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, is_length, is_screw, scene_size, stride_part
    use linkdyn_scene, only: coordinate_joint, joint_revolute
    implicit none (type, external)
    private
    public :: choose_strides

contains

    subroutine choose_strides(model)
        type(model_type), intent(inout) :: model
        real(wp) :: length, pitch
        integer :: k

        length = scene_size(model)
        allocate (model%stride(model%n_q))
        do k = 1, model%n_q
            model%stride(k) = stride_part*merge(length, 1.0_wp, is_length(model, k))
            pitch = pitch_of(model, k)
            if (pitch > 0) model%stride(k) = stride_part*length/pitch
        end do
    end subroutine choose_strides

    !> How far a nut goes per angle of a coordinate that moves nothing else [m/rad]; 0: it is no such coordinate.
    pure real(wp) function pitch_of(model, k) result(pitch)
        type(model_type), intent(in) :: model
        integer, intent(in) :: k
        integer :: side

        pitch = 0
        if (model%scene%coordinate(k)%kind /= coordinate_joint) return
        associate (j => model%scene%coordinate(k)%joint)
            if (is_screw(model, k)) then
                pitch = abs(model%joint(j)%pitch)
            else if (model%joint(j)%told_kind == joint_revolute) then
                do side = 1, 2
                    if (model%joint(j)%link(side) > 0 .and. pitch <= 0) pitch = pitch_of_spindle(model, j, side)
                end do
            end if
        end associate
    end function pitch_of

    !> The coarsest thread of a hinge's link, if all its other joints are threads on the hinge's axis; else 0.
    pure real(wp) function pitch_of_spindle(model, hinge, side) result(pitch)
        type(model_type), intent(in) :: model
        integer, intent(in) :: hinge, side
        integer :: j, other

        pitch = 0
        associate (link => model%joint(hinge)%link(side), point => model%joint(hinge)%point(:, side), &
                   axis => model%joint(hinge)%frame(:, 3, side))
            do j = 1, model%n_joint
                other = findloc(model%joint(j)%link, link, dim=1)
                if (j == hinge .or. other == 0) cycle
                pitch = max(pitch, abs(model%joint(j)%pitch))
                if (is_threaded(model%joint(j)%kind)) then
                    if (is_on_axis(model, j, other, point, axis)) cycle
                end if
                pitch = 0
                return
            end do
        end associate
    end function pitch_of_spindle
end module linkdyn_strides
