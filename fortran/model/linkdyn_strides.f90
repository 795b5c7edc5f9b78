!> How far coordinates go in one stride of a way: a tenth of a radian, or of the mechanism's size.
!>
!> Turns of a thread are small ways, many of which make one of that size. So a screw's angle goes as many radians as take its nut
!> so far, and that of a hinge likewise whose link turns in nothing but threads about the same axis: a spindle in its bearing; or
!> that gears tie to one, a motor's or a handwheel's.
module linkdyn_strides
    use linkdyn_gearing, only: is_on_axis
    use linkdyn_joint_table, only: is_geared, is_threaded, joint_n_variable
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, gear_type, is_length, is_screw, scene_size, stride_part
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

        pitch = 0
        if (model%scene%coordinate(k)%kind /= coordinate_joint) return
        associate (joint => model%joint(model%scene%coordinate(k)%joint))
            if (is_screw(model, k)) then
                pitch = abs(joint%pitch)
            else if (joint%told_kind == joint_revolute) then
                pitch = pitch_of_hinges(model, k)
            end if
        end associate
    end function pitch_of

    !> The coarsest thread, by the coordinate's angle, of the hinges that it turns: its own, and those behind gears. Zero if one of
    !> them turns more than a spindle or a wheel.
    pure real(wp) function pitch_of_hinges(model, k) result(pitch)
        type(model_type), intent(in) :: model
        integer, intent(in) :: k
        real(wp) :: way
        integer :: i

        pitch = 0
        associate (own => model%scene%coordinate(k)%joint)
            call find_way(model, own, way)
            pitch = max(0.0_wp, way)
            do i = 1, size(model%led)
                associate (led => model%led(i))
                    if (led%joint == own .or. led%weight(k) == 0 .or. way < 0) cycle
                    call find_way(model, led%joint, way)
                    pitch = max(pitch, abs(led%weight(k))*way)
                end associate
            end do
        end associate
        if (way < 0) pitch = 0
    end function pitch_of_hinges

    !> How far an angle of a hinge takes a nut on one of its links.
    pure subroutine find_way(model, hinge, way)
        type(model_type), intent(in) :: model
        integer, intent(in) :: hinge
        real(wp), intent(out) :: way                           !! [m/rad]; below zero: it moves other links
        integer :: side

        way = -1
        if (model%joint(hinge)%told_kind /= joint_revolute) return
        do side = 1, 2
            if (model%joint(hinge)%link(side) > 0 .and. way < 0) way = way_of_spindle(model, hinge, side)
        end do
    end subroutine find_way

    !> Way by the coarsest thread, if all other joints of the hinge's link are threads on the hinge's axis, or gears that tie given
    !> angles; else below zero.
    pure real(wp) function way_of_spindle(model, hinge, side) result(way)
        type(model_type), intent(in) :: model
        integer, intent(in) :: hinge, side
        integer :: j, other

        way = 0
        associate (link => model%joint(hinge)%link(side), point => model%joint(hinge)%point(:, side), &
                   axis => model%joint(hinge)%frame(:, 3, side))
            do j = 1, model%n_joint
                other = findloc(model%joint(j)%link, link, dim=1)
                if (j == hinge .or. other == 0) cycle
                if (is_geared(model%joint(j)%kind)) then
                    if (ties_given_angles(model, model%gear(model%joint(j)%gear))) cycle
                else if (is_threaded(model%joint(j)%kind)) then
                    way = max(way, abs(model%joint(j)%pitch))
                    if (is_on_axis(model, j, other, point, axis)) cycle
                end if
                way = -1
                return
            end do
        end associate
    end function way_of_spindle

    !> Are all variables of a gear those of coordinates, or what gears alone make of them?
    pure logical function ties_given_angles(model, gear) result(ties)
        type(model_type), intent(in) :: model
        type(gear_type), intent(in) :: gear
        integer :: j, n

        ties = .true.
        do j = 1, model%n_joint
            n = joint_n_variable(model%joint(j)%told_kind)
            associate (first => model%joint(j)%first_variable)
                if (any(gear%weight(first + 1:first + n) /= 0)) ties = ties .and. is_given(model, j)
            end associate
        end do
    end function ties_given_angles

    pure logical function is_given(model, j)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        integer :: i

        is_given = any(model%scene%coordinate%kind == coordinate_joint .and. model%scene%coordinate%joint == j)
        do i = 1, size(model%led)
            if (model%led(i)%joint == j) is_given = size(model%led(i)%source) == 0
        end do
    end function is_given
end module linkdyn_strides
