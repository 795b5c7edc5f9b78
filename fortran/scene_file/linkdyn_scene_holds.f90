!> What a table [[clutch]] holds together: all variables of a joint, or two markers to each other.
module linkdyn_scene_holds
    use linkdyn_joint_table, only: joint_spherical, variable_name
    use linkdyn_scene, only: scene_type, measure_spec, measure_joint, measure_marker, measure_turn
    use linkdyn_scene_forces, only: force_quantity
    use linkdyn_scene_joints, only: variable_quantity, require_two_links
    use linkdyn_scene_keys, only: scene_place, refuse_value, get_word
    use linkdyn_scene_names, only: find_marker
    use linkdyn_status, only: status_type
    use linkdyn_toml, only: toml_node, toml_array
    use linkdyn_units, only: quantity_type, force, moment, length, angle
    implicit none (type, external)
    private
    public :: held_part, parts_of_joint, read_parts_between

    !> One of what is held.
    type :: held_part
        character(len=7) :: name = ""
        type(measure_spec) :: place
        type(quantity_type) :: of_force, of_place       !! what is measured there
    end type held_part

    !> Which parts are held of two markers: along x, y, z of the first, then about them. In a plane x is the axis of the first, and
    !> z square to the plane.
    type :: hold_type
        character(len=11) :: name                       !! of a joint that holds the same
        logical :: holds(6)
    end type hold_type

    character(len=*), parameter :: axis_name(3) = ["x", "y", "z"]
    logical, parameter :: o = .false., h = .true.
    type(hold_type), parameter :: in_space(*) = [ &
        hold_type("fixed", [h, h, h, h, h, h]), hold_type("spherical", [h, h, h, o, o, o]), &
        hold_type("revolute", [h, h, h, h, h, o]), hold_type("cylindrical", [h, h, o, h, h, o]), &
        hold_type("prismatic", [h, h, o, h, h, h]), hold_type("planar", [o, o, h, h, h, o])]
    type(hold_type), parameter :: in_plane(*) = [ &
        hold_type("fixed", [h, h, o, o, o, h]), hold_type("revolute", [h, h, o, o, o, o]), &
        hold_type("prismatic", [o, h, o, o, o, h])]

contains

    !> The first variables of a joint. A ball turns about the axes of its first marker.
    pure function parts_of_joint(scene, joint, n) result(part)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: joint
        integer, intent(in) :: n                        !! how many
        type(held_part) :: part(n)
        integer :: k

        associate (kind => scene%joint(joint)%kind)
            do k = 1, n
                part(k)%name = variable_name(k, kind)
                if (kind == joint_spherical) part(k)%name = axis_name(k)
                part(k)%place%kind = measure_joint
                part(k)%place%joint = joint
                part(k)%place%variable = k
                part(k)%of_force = force_quantity(kind, k)
                part(k)%of_place = variable_quantity(kind, k)
            end do
        end associate
    end function parts_of_joint

    !> Two markers, as a joint of the key `type` would hold them, wherever they stand.
    subroutine read_parts_between(place, scene, part, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        type(held_part), allocatable, intent(out) :: part(:)
        type(status_type), intent(inout) :: status
        type(measure_spec) :: pair
        type(toml_node) :: between
        integer :: side, choice
        logical :: found

        allocate (part(0))
        between = place%node%get("between")
        if (between%kind() /= toml_array .or. between%count() /= 2) then
            call refuse_value(place, "between", between, "is not a pair (expected two markers, ""link.marker"")", status)
            return
        end if
        do side = 1, 2
            call find_marker(scene, place, "between", between%at(side), pair%link(side), pair%marker(side), status)
        end do
        call require_two_links(place, "between", between, scene, pair%link, status)
        choice = 1
        if (scene%planar) then
            call get_word(place, "type", in_plane%name, choice, status, found)
            if (status%is_ok()) part = parts_between(pair, in_plane(choice)%holds)
        else
            call get_word(place, "type", in_space%name, choice, status, found)
            if (status%is_ok()) part = parts_between(pair, in_space(choice)%holds)
        end if
    end subroutine read_parts_between

    pure function parts_between(pair, holds) result(part)
        type(measure_spec), intent(in) :: pair          !! with links and markers
        logical, intent(in) :: holds(6)
        type(held_part) :: part(count(holds))
        integer :: i, n

        n = 0
        do i = 1, size(holds)
            if (.not. holds(i)) cycle
            n = n + 1
            part(n)%place = pair
            if (i <= 3) then
                part(n)%name = axis_name(i)
                part(n)%place%kind = measure_marker
                part(n)%place%component = i
                part(n)%of_force = force
                part(n)%of_place = length
            else
                part(n)%name = "about_"//axis_name(i - 3)
                part(n)%place%kind = measure_turn
                part(n)%place%component = i - 3
                part(n)%of_force = moment
                part(n)%of_place = angle
            end if
        end do
    end function parts_between
end module linkdyn_scene_holds
