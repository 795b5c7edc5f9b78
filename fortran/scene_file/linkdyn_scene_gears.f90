!> What gears, racks and belts have of their own in a scene file.
module linkdyn_scene_gears
    use linkdyn_constants, only: pi
    use linkdyn_joint_table, only: is_geared
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: joint_spec, joint_gear, joint_rack, joint_belt, joint_kind_name, at_stiffness, at_damping, &
        at_pretension
    use linkdyn_scene_keys, only: scene_place, place_at, require_table, allow_keys, refuse_missing, refuse_value, get_vector, &
        get_quantity, get_word
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: plain_number, length, angle, stiffness, damping, force
    implicit none (type, external)
    private
    public :: read_wheels, gear_key

    real(wp), parameter :: largest_ratio = 1.0e6_wp        !! of two wheels: more than any train of gears has
    character(len=14), parameter :: gear_key(*) = [character(len=14) :: "teeth", "radii", "mesh", "run", "phase", "strands", &
                                                   "pressure_angle", "helix_angle", "lead_angle"]
    character(len=10), parameter :: strand_key(3) = [character(len=10) :: "stiffness", "damping", "pretension"]
    character(len=8), parameter :: mesh_name(2) = [character(len=8) :: "external", "internal"]
    character(len=7), parameter :: run_name(2) = [character(len=7) :: "open", "crossed"]

contains

    !> Teeth or radii, how both run into each other, and where they stand. Keys of other kinds are refused.
    subroutine read_wheels(place, planar, joint, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(joint_spec), intent(inout) :: joint
        type(status_type), intent(inout) :: status
        integer :: way, k
        logical :: found

        do k = 1, size(gear_key)
            if (.not. has_key(joint%kind, gear_key(k))) call refuse_key(place, trim(gear_key(k)), joint, status)
        end do
        if (.not. status%is_ok() .or. .not. is_geared(joint%kind)) return
        way = 1
        select case (joint%kind)
        case (joint_gear)
            call get_vector(place, "teeth", plain_number, joint%wheel, status)
            call require_positive("teeth")
            call get_word(place, "mesh", mesh_name, way, status, found)
        case (joint_belt)
            call get_vector(place, "radii", length, joint%wheel, status)
            call require_positive("radii")
            call get_word(place, "run", run_name, way, status, found)
        end select
        joint%is_turned_over = way == 2
        if (joint%kind /= joint_belt) call read_flanks(place, planar, joint, status)
        call read_worm(place, planar, joint, status)
        call read_strands(place, joint, status)
        if (joint%kind == joint_rack) then
            call get_quantity(place, "phase", length, joint%phase, status, joint%has_phase)
        else
            call get_quantity(place, "phase", angle, joint%phase, status, joint%has_phase)
        end if

    contains

        subroutine require_positive(key)
            character(len=*), intent(in) :: key
            integer :: i

            do i = 1, 2
                if (.not. status%is_ok()) return
                if (joint%wheel(i) > 0) cycle
                if (key == "teeth") then
                    call refuse_value(place, key, place%node%get(key), "has "//to_text(joint%wheel(i))// &
                        " (expected positive numbers; mesh = 'internal' where one wheel is inside the other)", status)
                else
                    call refuse_value(place, key, place%node%get(key), "has "//to_text(joint%wheel(i))// &
                        " m (expected positive lengths; run = 'crossed' where the wheels turn against each other)", status)
                end if
            end do
            if (.not. maxval(joint%wheel) > largest_ratio*minval(joint%wheel)) return
            call refuse_value(place, key, place%node%get(key), "has a ratio of " &
                //to_text(maxval(joint%wheel)/minval(joint%wheel))//" (expected at most "//to_text(largest_ratio)//")", status)
        end subroutine require_positive
    end subroutine read_wheels

    !> How teeth lean: by the pressure angle, across them, and along the axis by the helix angle.
    subroutine read_flanks(place, planar, joint, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(joint_spec), intent(inout) :: joint
        type(status_type), intent(inout) :: status
        character(len=14), parameter :: key(2) = gear_key(7:8)
        real(wp), parameter :: degree = pi/180, least(2) = [0.0_wp, -60*degree], most(2) = [45*degree, 60*degree]
        logical :: found
        integer :: k

        do k = 1, 2
            call get_quantity(place, trim(key(k)), angle, joint%flank(k), status, found)
            if (.not. status%is_ok()) return
            if (joint%flank(k) < least(k) .or. joint%flank(k) > most(k)) call refuse_value(place, trim(key(k)), &
                place%node%get(trim(key(k))), "is "//to_text(joint%flank(k)/degree)//" deg (expected "// &
                to_text(least(k)/degree)//" to "//to_text(most(k)/degree)//" deg)", status)
        end do
        if (planar .and. joint%flank(2) /= 0) call refuse_value(place, trim(key(2)), place%node%get(trim(key(2))), &
            "pushes wheels along their axes (expected a spatial scene, or no helix_angle)", status)
    end subroutine read_flanks

    !> The lead angle of a worm, which drives a wheel across its axis.
    subroutine read_worm(place, planar, joint, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(joint_spec), intent(inout) :: joint
        type(status_type), intent(inout) :: status
        real(wp), parameter :: degree = pi/180, most = 60*degree
        logical :: found

        call get_quantity(place, "lead_angle", angle, joint%lead_angle, status, found)
        if (.not. (status%is_ok() .and. found)) return
        if (planar) then
            call refuse("is of a worm, across whose axis its wheel turns (expected a spatial scene)")
        else if (.not. (abs(joint%lead_angle) > 0 .and. abs(joint%lead_angle) <= most)) then
            call refuse("is "//to_text(joint%lead_angle/degree)//" deg (expected up to 60 deg, below zero of a left-handed worm)")
        else if (joint%is_turned_over) then
            call refuse("is of a worm, which is not inside its wheel (expected no mesh = 'internal')")
        else if (joint%flank(2) /= 0) then
            call refuse("is of a worm, of which it says how its thread goes round (expected no helix_angle)")
        end if

    contains

        subroutine refuse(why)
            character(len=*), intent(in) :: why

            call refuse_value(place, "lead_angle", place%node%get("lead_angle"), why, status)
        end subroutine refuse
    end subroutine read_worm

    !> The strands of a belt that stretches.
    subroutine read_strands(place, joint, status)
        type(scene_place), intent(in) :: place
        type(joint_spec), intent(inout) :: joint
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: expected = "{ stiffness = '2e5 N/m', damping = .., pretension = '400 N' }"
        type(toml_node) :: node
        type(scene_place) :: inner
        logical :: found(3)
        integer :: k

        if (.not. status%is_ok()) return
        node = place%node%get("strands")
        if (.not. node%is_present()) return
        inner = place_at(place, node, trim(place%what)//", strands")
        call require_table(inner, "a table, "//expected, status)
        call allow_keys(inner, strand_key, status)
        call get_quantity(inner, "stiffness", stiffness, joint%strand(at_stiffness), status, found(1))
        call get_quantity(inner, "damping", damping, joint%strand(at_damping), status, found(2))
        call get_quantity(inner, "pretension", force, joint%strand(at_pretension), status, found(3))
        if (.not. status%is_ok()) return
        if (.not. found(1)) then
            call refuse_missing(inner, "stiffness", "of one strand, its force over what it is longer, for example '2e5 N/m'", &
                                status)
        else if (.not. found(3)) then
            call refuse_missing(inner, "pretension", "the force in each strand at rest, for example '400 N'", status)
        else if (.not. joint%strand(at_stiffness) > 0) then
            call refuse_value(inner, "stiffness", inner%node%get("stiffness"), "= "//to_text(joint%strand(at_stiffness))// &
                " N/m (expected more than zero; a belt that does not stretch has no strands)", status)
        end if
        do k = 2, 3
            if (status%is_ok() .and. joint%strand(k) < 0) call refuse_value(inner, trim(strand_key(k)), &
                inner%node%get(trim(strand_key(k))), "= "//to_text(joint%strand(k))//" is negative (expected zero or more)", status)
        end do
        node = place%node%get("stiffness")
        if (status%is_ok() .and. node%is_present()) call refuse_value(place, "stiffness", node, "has no meaning here: it shares " &
            //"reactions, and those of strands are known", status)
    end subroutine read_strands

    pure logical function has_key(kind, key)
        integer, intent(in) :: kind
        character(len=*), intent(in) :: key

        select case (key)
        case ("phase")
            has_key = is_geared(kind)
        case ("teeth", "mesh", "helix_angle", "lead_angle")
            has_key = kind == joint_gear
        case ("pressure_angle")
            has_key = kind == joint_gear .or. kind == joint_rack
        case default
            has_key = kind == joint_belt
        end select
    end function has_key

    subroutine refuse_key(place, key, joint, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(joint_spec), intent(in) :: joint
        type(status_type), intent(inout) :: status
        type(toml_node) :: node

        if (.not. status%is_ok()) return
        node = place%node%get(key)
        if (node%is_present()) call refuse_value(place, key, node, "has no meaning here: the joint is a "// &
            trim(joint_kind_name(joint%kind))//" joint", status)
    end subroutine refuse_key
end module linkdyn_scene_gears
