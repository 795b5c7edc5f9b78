!> The tables [[friction]] of a scene file.
module linkdyn_scene_friction
    use linkdyn_contact, only: is_turning
    use linkdyn_joint_table, only: joint_fixed, joint_cam, joint_planar, joint_cylindrical, joint_gear, is_geared
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, friction_spec, joint_revolute, joint_universal, joint_prismatic, &
        joint_spherical, joint_kind_name, follower_roller
    use linkdyn_scene_keys, only: scene_place, line_text, refuse, refuse_value, refuse_missing, allow_keys, get_quantity, get_flag
    use linkdyn_scene_clutches, only: add_sticking
    use linkdyn_scene_laws, only: require_positive, table_shelf
    use linkdyn_scene_names, only: find_joint
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: quantity_type, plain_number, length, force, speed, damping, angular_damping
    implicit none (type, external)
    private
    public :: read_frictions, read_size, usual_creep_speed

    integer, parameter :: key_len = 14
    real(wp), parameter :: usual_creep_speed = 1e-3_wp    !! of surfaces [m/s]

contains

    !> Friction in joints.
    subroutine read_frictions(root, shelf, scene, status)
        type(scene_place), intent(in) :: root
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        integer :: i

        call list_repeated(root, "friction", scene%planar, .false., tables, status)
        if (.not. status%is_ok()) return
        allocate (scene%friction(size(tables%table)))
        do i = 1, size(tables%table)
            place = repeated_at(root, tables, i, "friction")
            call read_friction(place, scene, scene%friction(i), status)
            if (.not. status%is_ok()) return
            call refuse_double(place, scene, i, status)
            if (status%is_ok() .and. scene%friction(i)%sticks) call add_sticking(place, scene%friction(i), i, shelf, scene, status)
        end do
    end subroutine read_frictions

    subroutine read_friction(place, scene, friction, status)
        type(scene_place), intent(inout) :: place
        type(scene_type), intent(in) :: scene
        type(friction_spec), intent(inout) :: friction
        type(status_type), intent(inout) :: status
        type(quantity_type) :: viscosity
        logical :: has_coulomb, has_static, has_speed, has_viscous, has_length, has_preload, found

        friction%line = place%line
        call find_joint(scene, place, friction%joint, status)
        if (.not. status%is_ok()) return
        associate (joint => scene%joint(friction%joint))
            place%what = "friction at joint "//quoted(joint%name)
            if (is_geared(joint%kind)) then
                call read_mesh(place, joint%kind, friction, status)
                return
            end if
            if (joint%kind == joint_fixed) call refuse_value(place, "joint", place%node%get("joint"), &
                "is a fixed joint, in which nothing rubs (expected one that turns or slides)", status)
            call allow_keys(place, [character(len=key_len) :: "joint", "coulomb", "static", "stribeck_speed", "creep_speed", &
                "viscous", "radius", "length", "collar", "preload", "sticking", "efficiency"], status)
            call refuse_foreign_keys(place, joint%kind, scene%planar, status)
            call read_coefficients(place, friction, has_coulomb, has_static, has_speed, status)
            viscosity = damping
            if (is_turning(joint%kind)) viscosity = angular_damping
            call read_size(place, "viscous", viscosity, friction%viscous, has_viscous, status)
            call read_size(place, "radius", length, friction%radius, found, status)
            call read_size(place, "length", length, friction%length, has_length, status)
            if (has_length) call require_positive(place, "length", friction%length, "m", status)
            call read_size(place, "collar", length, friction%collar, found, status)
            call read_size(place, "preload", force, friction%preload, has_preload, status)
            call get_flag(place, "sticking", friction%sticks, status)
            if (.not. status%is_ok()) return
            if (.not. (has_coulomb .or. has_viscous)) then
                call refuse(place, "missing key 'coulomb' or 'viscous' (expected at least one)", status)
            else if (has_preload .and. .not. has_coulomb) then
                call refuse_missing(place, "coulomb", "the coefficient of friction under the preload", status)
            else if (joint%kind == joint_cam .and. joint%cam%follower == follower_roller .and. .not. friction%radius > 0) then
                call refuse_missing(place, "radius", "of the pin about which the roller turns, for example '4 mm'", status)
            else if (joint%kind == joint_cam .and. joint%cam%follower /= follower_roller .and. friction%radius > 0) then
                call refuse_value(place, "radius", place%node%get("radius"), &
                    "has no meaning here: the follower is not a roller", status)
            else if (has_coulomb .and. needs_radius(joint%kind) .and. .not. friction%radius > 0) then
                call refuse_missing(place, "radius", "of the sliding surface, for example '12 mm'", status)
            else if (friction%sticks .and. .not. has_coulomb) then
                call refuse_missing(place, "coulomb", "the coefficient of static friction", status)
            else if (friction%sticks .and. joint%kind == joint_cam .and. .not. scene%planar &
                     .and. joint%cam%follower /= follower_roller) then
                call refuse_value(place, "sticking", place%node%get("sticking"), "is for cams under a roller: in space what "// &
                    "else follows one slides across its curve, too (expected a roller, or a planar scene)", status)
            end if
            if (.not. has_coulomb) call refuse_what_presses(place, joint%kind, status)
        end associate
    end subroutine read_friction

    !> Viscous friction does not depend on what presses: keys that tell how would be ignored beside it alone.
    subroutine refuse_what_presses(place, kind, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: kind
        type(status_type), intent(inout) :: status
        character(len=key_len), parameter :: key(4) = [character(len=key_len) :: "length", "collar", "creep_speed", "radius"]
        type(toml_node) :: node
        integer :: i

        do i = 1, size(key) - merge(1, 0, slides_at_radius(kind))
            if (.not. status%is_ok()) return
            node = place%node%get(trim(key(i)))
            if (node%is_present()) call refuse_value(place, trim(key(i)), node, "has no meaning without 'coulomb': "// &
                "viscous friction does not depend on the normal force (expected 'coulomb' beside it)", status)
        end do
    end subroutine refuse_what_presses

    !> Surfaces whose speed, by which viscous friction goes, has the radius in it.
    pure logical function slides_at_radius(kind)
        integer, intent(in) :: kind

        slides_at_radius = any(kind == [joint_cylindrical, joint_planar, joint_cam])
    end function slides_at_radius

    !> What teeth and belts lose: by their efficiency, or by how teeth rub.
    subroutine read_mesh(place, kind, friction, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: kind
        type(friction_spec), intent(inout) :: friction
        type(status_type), intent(inout) :: status
        logical :: has_coulomb, has_static, has_speed, has_efficiency

        call allow_keys(place, [character(len=key_len) :: "joint", "efficiency", "coulomb", "static", "stribeck_speed", &
                                "creep_speed", "sticking"], status)
        call read_coefficients(place, friction, has_coulomb, has_static, has_speed, status)
        call read_size(place, "efficiency", plain_number, friction%efficiency, has_efficiency, status)
        call get_flag(place, "sticking", friction%sticks, status)
        if (.not. status%is_ok()) return
        if (has_efficiency .and. has_coulomb) then
            call refuse_value(place, "efficiency", place%node%get("efficiency"), &
                              "says what 'coulomb' says (expected one of both)", status)
        else if (has_efficiency .and. .not. (friction%efficiency > 0 .and. friction%efficiency <= 1)) then
            call refuse_value(place, "efficiency", place%node%get("efficiency"), "= "//to_text(friction%efficiency)// &
                              " (expected above 0 to 1)", status)
        else if (has_efficiency) then
            friction%coulomb = 1                       ! of what is lost
            friction%static = 1
        else if (.not. has_coulomb .and. kind /= joint_gear) then
            call refuse_missing(place, "efficiency", "output over input power, for example '97 %'", status)
        else if (.not. has_coulomb) then
            call refuse(place, "missing key 'efficiency' or 'coulomb' (expected one of both)", status)
        else if (kind /= joint_gear) then
            call refuse_value(place, "coulomb", place%node%get("coulomb"), "needs teeth, whose number a "// &
                              trim(joint_kind_name(kind))//" does not tell (expected 'efficiency')", status)
        end if
    end subroutine read_mesh

    !> What a kind of joint has not.
    subroutine refuse_foreign_keys(place, kind, planar, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: kind
        logical, intent(in) :: planar
        type(status_type), intent(inout) :: status

        if (.not. any(kind == [joint_revolute, joint_universal]) .or. planar) call refuse_key("collar", "no pin with a collar")
        if (any(kind == [joint_spherical, joint_planar, joint_cam])) &
            call refuse_key("length", "no two ends that could bear a moment")
        if (kind == joint_revolute .and. planar) call refuse_key("length", "no tilting moment in a plane")
        if (kind == joint_prismatic .and. planar) call refuse_key("radius", "no moment about its axis in a plane")
        call refuse_key("efficiency", "no teeth")

    contains

        subroutine refuse_key(key, why)
            character(len=*), intent(in) :: key, why
            type(toml_node) :: node

            if (.not. status%is_ok()) return
            node = place%node%get(key)
            if (node%is_present()) call refuse_value(place, key, node, "has no meaning here: a "// &
                trim(joint_kind_name(kind))//" joint has "//why, status)
        end subroutine refuse_key
    end subroutine refuse_foreign_keys

    !> A slide rubs wherever it is pressed; what turns needs a lever.
    pure elemental logical function needs_radius(kind)
        integer, intent(in) :: kind

        needs_radius = all(kind /= [joint_prismatic, joint_planar, joint_cam])
    end function needs_radius

    !> The coefficients, over the speed of the surfaces.
    subroutine read_coefficients(place, friction, has_coulomb, has_static, has_speed, status)
        type(scene_place), intent(in) :: place
        type(friction_spec), intent(inout) :: friction
        logical, intent(out) :: has_coulomb, has_static, has_speed
        type(status_type), intent(inout) :: status
        logical :: has_creep

        call read_size(place, "coulomb", plain_number, friction%coulomb, has_coulomb, status)
        call read_size(place, "static", plain_number, friction%static, has_static, status)
        call read_size(place, "stribeck_speed", speed, friction%stribeck_speed, has_speed, status)
        friction%creep_speed = usual_creep_speed
        call read_size(place, "creep_speed", speed, friction%creep_speed, has_creep, status)
        if (has_creep) call require_positive(place, "creep_speed", friction%creep_speed, "m/s", status)
        if (has_speed) call require_positive(place, "stribeck_speed", friction%stribeck_speed, "m/s", status)
        if (.not. has_static) friction%static = friction%coulomb
        if (.not. status%is_ok()) return
        if (has_static .and. .not. has_coulomb) then
            call refuse_missing(place, "coulomb", "the coefficient at high sliding speed", status)
        else if (has_static .and. .not. has_speed) then
            call refuse_missing(place, "stribeck_speed", &
                "the speed over which 'static' falls to 'coulomb', for example '20 mm/s'", status)
        else if (has_speed .and. .not. has_static) then
            call refuse_missing(place, "static", "the coefficient at the onset of sliding", status)
        else if (friction%static < friction%coulomb) then
            call refuse_value(place, "static", place%node%get("static"), "= "//to_text(friction%static)// &
                " (expected at least 'coulomb', "//to_text(friction%coulomb)//")", status)
        end if
    end subroutine read_coefficients

    !> A quantity of zero or more.
    subroutine read_size(place, key, quantity, value, found, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(quantity_type), intent(in) :: quantity
        real(wp), intent(inout) :: value               !! stays if the key is not there
        logical, intent(out) :: found
        type(status_type), intent(inout) :: status
        character(len=len(quantity%unit)) :: unit

        found = .false.
        if (.not. status%is_ok()) return
        call get_quantity(place, key, quantity, value, status, found)
        if (.not. (status%is_ok() .and. found)) return
        if (value >= 0) return
        unit = quantity%unit
        if (unit == "1") unit = ""
        call refuse_value(place, key, place%node%get(key), "= "//trim(to_text(value)//" "//unit) &
                          //" (expected zero or more)", status)
    end subroutine read_size

    subroutine refuse_double(place, scene, i, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: i
        type(status_type), intent(inout) :: status
        integer :: k

        do k = 1, i - 1
            if (scene%friction(k)%joint /= scene%friction(i)%joint) cycle
            call refuse(place, "this joint has friction already on "//line_text(place, scene%friction(k)%line, place%line)// &
                " (expected one table for each joint)", status)
            return
        end do
    end subroutine refuse_double
end module linkdyn_scene_friction
