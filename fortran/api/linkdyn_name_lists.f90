!> Names and units of what a scene consists of and of what can be computed of it, by the words that stand for these lists.
module linkdyn_name_lists
    use linkdyn_given_attitudes, only: attitude_name
    use linkdyn_inverse_call, only: n_room, room_id, room_width
    use linkdyn_open_scene, only: open_scene
    use linkdyn_results, only: layout_type, label_len, samples_width, dim_actuator, dim_joint, dim_component, &
        dim_coordinate, dim_variable, dim_dyad, dim_motor, dim_cam, dim_controller, dim_strand, dim_clutch, dim_cylinder, &
        dim_chamber
    use linkdyn_result_kinds, only: result_name, result_status
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_suggest, only: suggestion
    use linkdyn_text, only: quoted, join
    implicit none (type, external)
    private
    public :: name_list, list_names, find_result, find_room, result_width

    character(len=10), parameter :: list_name(18) = [character(len=10) :: "link", "joint", "coordinate", "attitude", "actuator", &
        "load", "variable", "component", "dyad", "motor", "cam", "controller", "strand", "clutch", "cylinder", "chamber", &
        "result", "run_result"]

    type :: name_list
        character(len=2*label_len), allocatable :: name(:)
        character(len=8), allocatable :: unit(:)       !! not there where it says nothing
    end type name_list

contains

    !> **Errors**: `status_bad_input` for a word that stands for no list.
    subroutine list_names(scene, what, list, status)
        type(open_scene), intent(in) :: scene
        character(len=*), intent(in) :: what
        type(name_list), intent(out) :: list
        type(status_type), intent(inout) :: status
        integer :: i

        select case (what)
        case ("link")
            list%name = scene%model%link%name
        case ("attitude")
            list%name = [(attitude_name(scene%model, i), i=1, scene%model%n_attitude)]
        case ("load")
            list%name = scene%model%scene%load%name
        case ("joint")
            call take_dimension(dim_joint)
        case ("coordinate")
            call take_dimension(dim_coordinate)
        case ("actuator")
            call take_dimension(dim_actuator)
        case ("variable")
            call take_dimension(dim_variable)
        case ("component")
            call take_dimension(dim_component)
        case ("dyad")
            call take_dimension(dim_dyad)
        case ("motor")
            call take_dimension(dim_motor)
        case ("cam")
            call take_dimension(dim_cam)
        case ("controller")
            call take_dimension(dim_controller)
        case ("strand")
            call take_dimension(dim_strand)
        case ("clutch")
            call take_dimension(dim_clutch)
        case ("cylinder")
            call take_dimension(dim_cylinder)
        case ("chamber")
            call take_dimension(dim_chamber)
        case ("result")
            list%name = pack(result_name(room_id), has_room(scene))
        case ("run_result")
            list%name = pack(scene%run_layout%variable%name, scene%run_layout%variable%id /= result_status)
        case default
            call fail(status, status_bad_input, "there is no list "//quoted(what)//" (expected one of "//join(list_name)//")" &
                      //suggestion(what, list_name))
        end select

    contains

        subroutine take_dimension(i)
            integer, intent(in) :: i

            list%name = scene%layout%dimension(i)%label
            if (allocated(scene%layout%dimension(i)%unit)) list%unit = scene%layout%dimension(i)%unit
        end subroutine take_dimension
    end subroutine list_names

    !> Results of inverse dynamics that the scene has.
    pure function has_room(scene) result(has)
        type(open_scene), intent(in) :: scene
        logical :: has(n_room)
        integer :: i

        has = [(room_width(scene%model, room_id(i)) > 0, i=1, n_room)]
    end function has_room

    !> The room of a result of inverse dynamics.
    subroutine find_room(scene, name, room, status)
        type(open_scene), intent(in) :: scene
        character(len=*), intent(in) :: name
        integer, intent(out) :: room
        type(status_type), intent(inout) :: status

        do room = 1, n_room
            if (result_name(room_id(room)) == name .and. room_width(scene%model, room_id(room)) > 0) return
        end do
        call refuse(name, pack(result_name(room_id), has_room(scene)), status)
    end subroutine find_room

    !> The variable of a result of a run.
    subroutine find_result(layout, name, place, status)
        type(layout_type), intent(in) :: layout
        character(len=*), intent(in) :: name
        integer, intent(out) :: place
        type(status_type), intent(inout) :: status

        do place = 1, size(layout%variable)
            if (layout%variable(place)%name == name) return
        end do
        call refuse(name, layout%variable%name, status)
    end subroutine find_result

    !> Numbers that a result of either kind has in a sample.
    subroutine result_width(scene, name, width, status)
        type(open_scene), intent(in) :: scene
        character(len=*), intent(in) :: name
        integer, intent(out) :: width
        type(status_type), intent(inout) :: status
        type(status_type) :: no_room
        integer :: place

        width = 0
        call find_room(scene, name, place, no_room)
        if (no_room%is_ok()) then
            width = room_width(scene%model, room_id(place))
            return
        end if
        call find_result(scene%run_layout, name, place, status)
        if (status%is_ok()) width = samples_width(scene%run_layout, scene%run_layout%variable(place))
    end subroutine result_width

    subroutine refuse(name, known, status)
        character(len=*), intent(in) :: name, known(:)
        type(status_type), intent(inout) :: status

        call fail(status, status_bad_input, "there is no result "//quoted(name)//" here (expected one of "//join(known)//")" &
                  //suggestion(name, known))
    end subroutine refuse
end module linkdyn_name_lists
