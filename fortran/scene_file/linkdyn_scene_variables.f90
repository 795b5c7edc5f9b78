!> The table [variables] of a scene file: names for numbers, in any order.
module linkdyn_scene_variables
    use linkdyn_kinds, only: wp
    use linkdyn_expression, only: measured_value, is_reserved, is_unit_name, name_letters
    use linkdyn_scene, only: scene_type, name_len
    use linkdyn_scene_keys, only: scene_place, place_at, refuse, require_table
    use linkdyn_status, only: status_type
    use linkdyn_sweep_spec, only: axis_parameter
    use linkdyn_text, only: quoted, to_text
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: n_dimension, si_unit_text, dimension_text, read_value
    use linkdyn_variables, only: variable_table, variable_entry
    implicit none (type, external)
    private
    public :: read_variables, list_variables, forbid_varied_variables

contains

    !> Names and values, every one found.
    subroutine read_variables(root, variables, status)
        type(scene_place), intent(in) :: root
        type(variable_table), intent(inout) :: variables
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        type(toml_node) :: node
        type(variable_entry), allocatable :: entry(:)
        type(measured_value) :: found
        character(len=:), allocatable :: key, problem
        integer, allocatable :: line(:)
        integer :: i

        allocate (variables%entry(0))
        if (.not. status%is_ok()) return
        node = root%node%get("variables")
        if (.not. node%is_present()) return
        place = place_at(root, node, "variables")
        call require_table(place, "a table of names with numbers, written [variables]", status)
        if (.not. status%is_ok()) return
        allocate (entry(node%count()), line(node%count()))
        do i = 1, size(entry)
            call node%key(i, key, line(i))
            call read_entry(place, key, line(i), entry(i), status)
            if (.not. status%is_ok()) return
        end do
        call variables%set_entries(entry)
        do i = 1, size(entry)
            problem = ""
            call variables%find(trim(entry(i)%name), 0, found, problem)
            if (problem == "") then
                call refuse_lookalike(place, entry(i)%name, found, line(i), status)
                if (.not. status%is_ok()) return
                cycle
            end if
            if (variables%culprit == 0) variables%culprit = i
            place%what = "variable "//quoted(entry(variables%culprit)%name)
            call refuse(place, problem//" (expected a number, a text with its unit, or arithmetic with them)", status, &
                        line(variables%culprit))
            return
        end do
    end subroutine read_variables

    !> A length called m: the unit and the variable would fit the same places.
    subroutine refuse_lookalike(table, name, found, line, status)
        type(scene_place), intent(in) :: table
        character(len=*), intent(in) :: name
        type(measured_value), intent(in) :: found
        integer, intent(in) :: line
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        real(wp) :: unit
        integer :: power(n_dimension)
        character(len=:), allocatable :: problem
        logical :: has_unit

        if (.not. is_unit_name(trim(name))) return
        call read_value("1 "//trim(name), unit, has_unit, power, problem)
        if (any(power /= found%power)) return
        place = table
        place%what = "variable "//quoted(name)
        call refuse(place, "is "//dimension_text(power)//", as the unit of that name is (expected another name)", status, line)
    end subroutine refuse_lookalike

    !> One name with its number or text.
    subroutine read_entry(table, key, line, entry, status)
        type(scene_place), intent(in) :: table
        character(len=*), intent(in) :: key
        integer, intent(in) :: line
        type(variable_entry), intent(out) :: entry
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        type(toml_node) :: node
        character(len=:), allocatable :: text
        real(wp) :: number
        logical :: is_one

        place = table
        place%what = "variable "//quoted(key(:min(len(key), name_len)))
        if (len(key) == 0 .or. len(key) > name_len .or. verify(key, name_letters) > 0 .or. &
            scan(key(:min(1, len(key))), "0123456789") > 0) then
            call refuse(place, "this cannot be the name of a variable (expected 1 to "//to_text(name_len)// &
                " letters, digits and '_', no digit first)", status, line)
            return
        else if (is_reserved(key)) then
            call refuse(place, "this name has a meaning in arithmetic (expected another name)", status, line)
            return
        end if
        entry%name = key
        node = table%node%get(key)
        call node%get_number(number, is_one)
        if (is_one) then
            if (.not. abs(number) <= huge(number)) then
                call refuse(place, "is not a finite number (expected a number, or a text with its unit)", status, line)
            end if
            entry%found%value = number
            entry%is_number = .true.
            return
        end if
        call node%get_text(text, is_one)
        if (.not. is_one) call refuse(place, "is "//node%kind_text()// &
            " (expected a number, a text with its unit, or arithmetic in a text)", status, line)
        entry%text = text
    end subroutine read_entry

    !> Names, values and units, for whoever wants to know them.
    subroutine list_variables(variables, scene)
        type(variable_table), intent(in) :: variables
        type(scene_type), intent(inout) :: scene
        integer :: i

        allocate (scene%variable(size(variables%entry)))
        do i = 1, size(scene%variable)
            associate (entry => variables%entry(i))
                scene%variable(i)%name = entry%name
                scene%variable(i)%value = entry%found%value
                if (entry%found%has_unit) scene%variable(i)%unit = si_unit_text(entry%found%power)
            end associate
        end do
    end subroutine list_variables

    !> What a sweep asks for is read once: it must not depend on a variable that the sweep varies.
    subroutine forbid_varied_variables(place, variables, scene, status)
        type(scene_place), intent(in) :: place
        type(variable_table), intent(in) :: variables  !! forgotten before [sweep] was read
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: table = "variables."
        integer :: i, k

        if (.not. status%is_ok()) return
        do i = 1, size(scene%sweep%axis)
            if (scene%sweep%axis(i)%kind /= axis_parameter) cycle
            do k = 1, size(scene%sweep%axis(i)%parameter)
                associate (path => scene%sweep%axis(i)%parameter(k)%path)
                    if (index(path, table) /= 1) cycle
                    if (.not. variables%is_used(trim(path(len(table) + 1:)))) cycle
                    call refuse(place, "[sweep] varies the variable "//quoted(path(len(table) + 1:))// &
                        " and asks for it in a number of its own, which stays (expected the number itself there)", status, &
                        scene%sweep%axis(i)%line)
                    return
                end associate
            end do
        end do
    end subroutine forbid_varied_variables
end module linkdyn_scene_variables
