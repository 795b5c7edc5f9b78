!> Which scenes say the same of how links stand at the start: then an assembly that was found for the one is that of the other.
!>
!> Scenes that differ in masses, loads, springs, drives, friction or laws do, those that differ in a length do not.
module linkdyn_alike_starts
    use linkdyn_joint_table, only: joint_cam
    use linkdyn_laws, only: start_of_coordinate
    use linkdyn_scene, only: scene_type, link_spec, joint_spec, coordinate_spec, marker_spec, at_stiffness
    use linkdyn_step_part, only: curve_text
    implicit none (type, external)
    private
    public :: stand_alike

contains

    pure logical function stand_alike(a, b)
        type(scene_type), intent(in) :: a, b
        integer :: i

        stand_alike = (a%planar .eqv. b%planar) .and. a%redundancy == b%redundancy .and. size(a%link) == size(b%link) &
                      .and. size(a%joint) == size(b%joint) .and. size(a%coordinate) == size(b%coordinate)
        if (stand_alike) stand_alike = have_same_markers(a%frame, b%frame)
        do i = 1, size(a%link)
            if (stand_alike) stand_alike = are_same_links(a%link(i), b%link(i))
        end do
        do i = 1, size(a%joint)
            if (stand_alike) stand_alike = are_same_joints(a%joint(i), b%joint(i))
        end do
        do i = 1, size(a%coordinate)
            if (stand_alike) stand_alike = are_same_coordinates(a%coordinate(i), b%coordinate(i)) &
                .and. start_of_coordinate(a, i) == start_of_coordinate(b, i)
        end do
    end function stand_alike

    pure logical function are_same_links(a, b)
        type(link_spec), intent(in) :: a, b

        are_same_links = (a%has_start .eqv. b%has_start) .and. have_same_markers(a, b)
        if (a%has_start) are_same_links = are_same_links .and. all(a%start == b%start)
    end function are_same_links

    pure logical function have_same_markers(a, b)
        type(link_spec), intent(in) :: a, b
        integer :: i

        have_same_markers = size(a%marker) == size(b%marker)
        if (.not. have_same_markers) return
        do i = 1, size(a%marker)
            have_same_markers = have_same_markers .and. are_same_markers(a%marker(i), b%marker(i))
        end do
    end function have_same_markers

    pure logical function are_same_markers(a, b)
        type(marker_spec), intent(in) :: a, b

        are_same_markers = all(a%at == b%at) .and. all(a%axis == b%axis) .and. all(a%x_axis == b%x_axis) &
                           .and. (a%has_axis .eqv. b%has_axis) .and. (a%has_x .eqv. b%has_x)
    end function are_same_markers

    pure logical function are_same_joints(a, b)
        type(joint_spec), intent(in) :: a, b

        are_same_joints = a%kind == b%kind .and. all(a%link == b%link) .and. all(a%marker == b%marker) &
                          .and. all(a%start == b%start) .and. (a%has_start .eqv. b%has_start) .and. a%branch == b%branch &
                          .and. a%lead == b%lead .and. all(a%wheel == b%wheel) .and. a%phase == b%phase &
                          .and. (a%is_turned_over .eqv. b%is_turned_over) .and. (a%has_phase .eqv. b%has_phase) &
                          .and. (a%strand(at_stiffness) > 0 .eqv. b%strand(at_stiffness) > 0) .and. a%lead_angle == b%lead_angle
        if (are_same_joints .and. a%kind == joint_cam) are_same_joints = curve_text(a%cam) == curve_text(b%cam)
    end function are_same_joints

    pure logical function are_same_coordinates(a, b)
        type(coordinate_spec), intent(in) :: a, b

        are_same_coordinates = a%kind == b%kind .and. a%joint == b%joint .and. a%variable == b%variable .and. a%link == b%link
    end function are_same_coordinates
end module linkdyn_alike_starts
