!> `linkdyn generate`: a kernel of a scene as a C file and its header.
module linkdyn_generate
    use linkdyn_c_files, only: controller_code, write_header, write_source
    use linkdyn_c_words, only: c_identifier
    use linkdyn_result_kinds, only: result_driving_force, result_reaction, result_joint_variable, result_joint_rate, &
        result_qdd, result_position, result_rotation, result_velocity, result_angular_velocity
    use linkdyn_code_fields, only: name_list, field_type, list_of_names, without_names, field, field_size, note_len, n_list, &
        of_coordinates, of_actuators, of_joints, of_components, of_variables, of_links, of_loads, of_placed, of_axes, of_place
    use linkdyn_closing_programs, only: out_determinant
    use linkdyn_code_kernel, only: controller_kernel, make_controller_kernel, make_closing_kernel, run_kernel
    use linkdyn_effort_laws, only: follows_target, is_given
    use linkdyn_equations, only: unknown_choice, equations_type, build_equations, build_no_equations, free_equations, &
        solver_elimination
    use linkdyn_forward_unknowns, only: choose_unknowns
    use linkdyn_inputs, only: trace_request, sample_set, in_q, in_qd, in_qdd, in_load, in_target, in_effort, in_branch, in_place
    use linkdyn_inverse, only: look_for_record
    use linkdyn_kernel_check, only: compare_kernel, kernel_differs, kernel_unsure
    use linkdyn_kinds, only: wp
    use linkdyn_laws, only: evaluate_law
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_model, only: model_type, place_size
    use linkdyn_payloads, only: payload_is_input
    use linkdyn_motion, only: evaluate_loads
    use linkdyn_newton_group, only: prepare_margins
    use linkdyn_recorded_forces, only: prepare_forces
    use linkdyn_representatives, only: representative_poses, need_poses
    use linkdyn_results, only: layout_type, wanted_type, describe_results, label_len, dim_coordinate, dim_actuator, &
        dim_joint, dim_component, dim_variable
    use linkdyn_scene, only: scene_type, axes_link, effort_inverse, law_none, side_joint, n_stop, n_clutch, has_hard_stops
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: quoted, join
    implicit none (type, external)
    private
    public :: code_wish, choose_language, choose_kernel, choose_code_results, generate_code
    public :: kernel_name, kernel_inverse, kernel_forward, kernel_kinematics

    integer, parameter :: kernel_inverse = 1
    integer, parameter :: kernel_forward = 2
    integer, parameter :: kernel_kinematics = 3
    character(len=10), parameter :: kernel_name(3) = [character(len=10) :: "inverse", "forward", "kinematics"]
    character(len=32), parameter :: kernel_text(3) = [character(len=32) :: "inverse dynamics", "forward dynamics", "kinematics"]

    !> What results a user may name, and of which kernels, in the order of `kernel_name`.
    character(len=14), parameter :: result_name(5) = [character(len=14) :: "driving_force", "reaction", "joint_variable", &
                                                      "position", "velocity"]
    logical, parameter :: T = .true., F = .false.
    logical, parameter :: is_of(3, 5) = reshape([T, T, F, T, T, F, T, T, T, F, F, T, F, F, T], [3, 5])

    integer, parameter :: of_no_kernel = -1            !! id of a field that none reads

    !> What is wanted of generated code.
    type :: code_wish
        integer :: kernel = kernel_inverse             !! `kernel_*`
        logical :: has(size(result_name)) = .false.    !! results beside the accelerations of forward dynamics; none: the usual ones
    end type code_wish

contains

    !> **Errors**: bad input for a language that nothing is written in.
    subroutine choose_language(name, status)
        character(len=*), intent(in) :: name
        type(status_type), intent(inout) :: status

        if (name /= "c") call fail(status, status_bad_input, "lang: "//quoted(name) &
                                   //" is not a language of generated code (expected c)")
    end subroutine choose_language

    !> **Errors**: bad input for an unknown name.
    subroutine choose_kernel(name, kernel, status)
        character(len=*), intent(in) :: name
        integer, intent(out) :: kernel                 !! `kernel_*`
        type(status_type), intent(inout) :: status

        kernel = findloc(kernel_name, name, dim=1)
        if (kernel == 0 .or. len(name) > len(kernel_name)) call fail(status, status_bad_input, "kernel: "//quoted(name) &
            //" is not a kernel (expected one of "//join(kernel_name)//")")
    end subroutine choose_kernel

    !> A list such as "driving_force,reaction"; blank: what the kernel is usually for.
    !>
    !> **Errors**: bad input for a name that the kernel does not know.
    subroutine choose_code_results(want, wish, status)
        character(len=*), intent(in) :: want           !! names with commas between, or all
        type(code_wish), intent(inout) :: wish
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: word
        integer :: first, comma, k

        wish%has = .false.
        if (len_trim(want) == 0) then
            select case (wish%kernel)
            case (kernel_inverse)
                wish%has = result_name == "driving_force"
            case (kernel_kinematics)
                wish%has = is_of(wish%kernel, :)
            end select
            return
        end if
        first = 1
        do while (first <= len(want) + 1)
            comma = index(want(first:), ",")
            if (comma == 0) comma = len(want) - first + 2
            word = trim(adjustl(want(first:first + comma - 2)))
            first = first + comma
            k = findloc(result_name, word, dim=1)
            if (word == "all") then
                wish%has = wish%has .or. is_of(wish%kernel, :)
                cycle
            end if
            if (k > 0) then
                wish%has(k) = .true.
                if (is_of(wish%kernel, k)) cycle
            end if
            call fail(status, status_bad_input, "want: "//quoted(word)//" is not a result of the kernel " &
                //trim(kernel_name(wish%kernel))//" (expected "//join(pack(result_name, is_of(wish%kernel, :)))//" or 'all')")
            return
        end do
    end subroutine choose_code_results

    !> Write header and source.
    !>
    !> **Errors**: bad input for a scene from which the kernel cannot be made.
    subroutine generate_code(model, wish, name, header, source, status)
        type(model_type), intent(in) :: model
        type(code_wish), intent(in) :: wish
        character(len=*), intent(in) :: name           !! of the files, without ending; what identifiers begin with
        integer, intent(in) :: header, source          !! units, open for formatted writing
        type(status_type), intent(inout) :: status
        type(controller_code) :: code
        type(unknown_choice) :: unknown
        integer :: law

        law = acting_law(model%scene, wish%kernel)
        if (law > 0) call fail(status, status_bad_input, "no code can be generated: "//trim(model%scene%laws%law(law)%name)// &
            " follows the state of the mechanism (expected forces of time, or the kernel kinematics)")
        if (model%scene%base%moves .and. wish%kernel /= kernel_kinematics) call fail(status, status_bad_input, &
            "no code can be generated: the frame of the scene moves (expected a frame at rest, or the kernel kinematics)")
        if (any(payload_is_input(model)) .and. wish%kernel /= kernel_kinematics) call fail(status, status_bad_input, &
            "no code can be generated: the mass of the payload on "//trim(model%scene%payload(findloc(payload_is_input(model), &
            .true., dim=1))%name)//" changes with time (expected one that is always there, or the kernel kinematics)")
        if (has_hard_stops(model%scene) .and. wish%kernel == kernel_forward) call fail(status, status_bad_input, &
            "no code can be generated: stop "//quoted(model%scene%stop(findloc(model%scene%stop%is_hard, .true., dim=1))%name)// &
            " has impacts (expected a scene without stops, or another kernel)")
        if (n_clutch(model%scene) > 0 .and. wish%kernel == kernel_forward) call fail(status, status_bad_input, &
            "no code can be generated: clutch "//quoted(model%scene%clutch(1)%name)//" comes to rest and breaks loose "// &
            "(expected a scene without clutches, or another kernel)")
        if (size(model%contact) > 0 .and. wish%kernel /= kernel_kinematics) call fail(status, status_bad_input, &
            "no code can be generated: friction at joint '"//trim(model%joint(model%contact(1)%joint)%name)//"' needs an "// &
            "iteration (expected a scene without friction, or the kernel kinematics)")
        call hold_texts()
        call name_files(name, code, status)
        code%title = model%scene%title
        code%kernel = trim(kernel_text(wish%kernel))
        call make_lists(model, code%list)
        call list_outputs(wish, code%list, code%output)
        call release_texts()
        ! not while texts are held: whoever makes a record waits for these, and this waits for him
        if (status%is_ok()) call check_equations(model, wish, code%output%id, unknown, status)
        call hold_texts()
        if (status%is_ok()) call trace_kernels(model, wish, unknown, code, status)
        if (status%is_ok()) then
            call write_header(code, header)
            call write_source(code, source)
        end if
        call release_texts()
    end subroutine generate_code

    !> The first law over the state that a kernel would have to follow; 0: none. Inverse dynamics does without those of
    !> actuators, whose forces it finds, and those of events and controllers: they act in forward runs alone.
    pure integer function acting_law(scene, kernel) result(law)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: kernel                  !! `kernel_*`
        integer, allocatable :: of_force(:)
        integer :: i

        law = 0
        if (kernel == kernel_kinematics .or. size(scene%laws%law) == 0) return
        law = 1
        if (kernel == kernel_forward .or. n_stop(scene) + n_clutch(scene) > 0) return
        of_force = [(scene%load(i)%force%law, scene%load(i)%moment%law, i=1, size(scene%load)), scene%spring%force%law]
        law = 0
        i = findloc(of_force > 0, .true., dim=1)
        if (i > 0) law = of_force(i)
    end function acting_law

    !> The kernels, and what goes into them.
    subroutine trace_kernels(model, wish, unknown, code, status)
        type(model_type), intent(in) :: model
        type(code_wish), intent(in) :: wish
        type(unknown_choice), intent(in) :: unknown
        type(controller_code), intent(inout) :: code
        type(status_type), intent(inout) :: status
        type(model_type), target :: own
        type(trace_request) :: request
        type(sample_set) :: sample
        type(representative_poses) :: poses
        logical :: is_planned

        call need_poses(model, spread(model%start_q, 2, 1), poses)
        call prepare_forces(model, poses%q, poses%stand, own, request, sample, is_planned, poses%assembly%place)
        if (size(poses%q, 2) == 0) then
            call refuse("at no position near its start or motion can it be assembled", status)
        else if (.not. is_planned) then
            call refuse("its record cannot be planned as the scene is", status)
        end if
        if (.not. status%is_ok()) return
        if (own%is_planar) request%has_load(3:5, :) = .false.
        if (wish%kernel == kernel_kinematics) deallocate (request%has_load)
        if (wish%kernel == kernel_forward) then
            request%drive_is_unknown = unknown%drive
            request%acceleration_is_unknown = unknown%acceleration
        end if
        call list_inputs(own, wish, unknown, code%list, code%input)
        call make_controller_kernel(own, request, code%output%id, sample, code%controller)
        if (.not. code%controller%is_made) call refuse("its equations have no pivots that serve near its start and motion " &
            //"(expected no more constraints than it needs)", status)
        if (status%is_ok()) call check_kernel(model, own, wish, request, poses, sample, unknown, code%controller, status)
        call name_assemblies(own, code)
        call add_groups(model, own, sample, code, status)
    end subroutine trace_kernels

    !> What the code would find must be what the engine finds.
    subroutine check_kernel(model, own, wish, request, poses, sample, unknown, controller, status)
        type(model_type), intent(in) :: model, own     !! the scene's, and the same planned for records
        type(code_wish), intent(in) :: wish
        type(trace_request), intent(in) :: request
        type(representative_poses), intent(in) :: poses
        type(sample_set), intent(in) :: sample         !! these
        type(unknown_choice), intent(in) :: unknown
        type(controller_kernel), intent(in) :: controller
        type(status_type), intent(inout) :: status
        type(controller_kernel) :: drives
        type(equations_type) :: equations
        integer :: verdict

        select case (wish%kernel)
        case (kernel_inverse)
            call build_equations(model, solver_elimination, .true., equations, status)
        case (kernel_forward)
            call build_equations(model, solver_elimination, .true., equations, status, unknown)
            call make_controller_kernel(own, request, [result_qdd, result_driving_force], sample, drives)
        case (kernel_kinematics)
            call build_no_equations(model, equations)
        end select
        if (status%is_ok()) then
            call compare_kernel(model, equations, poses%assembly, sample, controller, drives, verdict)
            if (verdict == kernel_differs) call refuse_what_differs(status)
            if (verdict == kernel_unsure) call refuse("its results could not be compared with the engine's at any of the poses "// &
                "tried, as happens near dead points and with threads whose lead is small beside the mechanism", status)
        end if
        call free_equations(equations)
    end subroutine check_kernel

    subroutine refuse_what_differs(status)
        type(status_type), intent(inout) :: status

        call refuse("its results differ from the engine's at most of the poses tried, which is a fault of linkdyn "// &
                    "(expected another kernel; please report the scene)", status)
    end subroutine refuse_what_differs

    !> Newton's steps of groups closed by iteration, and where their links are at the start.
    subroutine add_groups(model, own, sample, code, status)
        type(model_type), intent(in) :: model
        type(model_type), intent(inout) :: own         !! the same, planned for records; its groups are links of groups there
        type(sample_set), intent(in) :: sample
        type(controller_code), intent(inout) :: code
        type(status_type), intent(inout) :: status
        type(sample_set) :: start
        type(field_type) :: place, last
        real(wp), allocatable :: found(:)
        real(wp) :: at_start(place_size(own), own%n_link)
        integer, allocatable :: link(:)
        integer :: g, i, k

        allocate (code%state(0), code%group(size(own%group)))
        if (size(own%group) == 0 .or. .not. status%is_ok()) return
        call prepare_margins(own)
        at_start = 0
        do g = 1, size(model%group)
            at_start(:, model%group(g)%link) = model%group(g)%start
        end do
        start%n = 1
        start%of(in_q)%x = reshape(own%start_q, [own%n_q, 1])
        start%of(in_branch)%x = reshape(own%branch, [own%n_branch, 1])
        start%of(in_place)%x = reshape(at_start, [size(at_start), 1])
        link = [integer ::]
        do g = 1, size(own%group)
            associate (group => code%group(g))
                call make_closing_kernel(own, g, sample, group%controller)
                if (.not. group%controller%is_made) then
                    call refuse("links "//join(own%link(own%group(g)%link)%name)//" are placed by iteration, and no step of it " &
                                //"can be recorded (expected as many constraints as they have freedoms)", status)
                    return
                end if
                group%first = size(link) + 1
                group%n = size(own%group(g)%link)
                group%unit = own%group(g)%unit
                group%size = own%group(g)%size
                call run_kernel(group%controller, start, 1, found)
                group%sense = sign(1.0_wp, found(findloc(group%controller%id, out_determinant, dim=1)))
            end associate
            link = [link, own%group(g)%link]
        end do
        code%list(of_placed) = list_of_names("placed", [(code%list(of_links)%label(link(i)), i=1, size(link))], &
                                             [(" ", i=1, size(link))])
        if (own%is_planar) then
            code%list(of_place) = without_names([character(len=5) :: "x", "y", "angle"])
        else
            code%list(of_place) = without_names([character(len=2) :: "x", "y", "z", "qw", "qx", "qy", "qz"])
        end if
        place = field("place", "of links in loops closed by iteration: "//trim(merge("x, y, angle [m, rad]              ", &
                      "x, y, z [m], quaternion w, x, y, z", own%is_planar)), in_place, [of_placed, of_place], code%list)
        place%place = [((place_size(own)*(link(i) - 1) + k, k=1, place_size(own)), i=1, size(link))]
        place%start = [(at_start(:, link(i)), i=1, size(link))]
        last = field("q", "coordinates at the last call [m, rad]", of_no_kernel, [of_coordinates], code%list)
        last%start = own%start_q
        code%state = [place, last]
        code%stride = own%stride
    end subroutine add_groups

    !> Which of its ways each closed form takes, and where it closes.
    subroutine name_assemblies(model, code)
        type(model_type), intent(in) :: model
        type(controller_code), intent(inout) :: code
        integer :: i

        code%branch = model%branch
        allocate (code%branch_at(model%n_branch))
        code%branch_at = ""
        do i = 1, size(model%step)
            if (model%step(i)%has_margin) code%branch_at(model%step(i)%first) = model%joint(model%step(i)%joint(2))%name
        end do
    end subroutine name_assemblies

    subroutine refuse(why, status)
        character(len=*), intent(in) :: why
        type(status_type), intent(inout) :: status

        call fail(status, status_bad_input, "no code can be generated: "//why)
    end subroutine refuse

    !> The name of the files; what identifiers begin with is a letter and as C has it.
    subroutine name_files(name, code, status)
        character(len=*), intent(in) :: name
        type(controller_code), intent(inout) :: code
        type(status_type), intent(inout) :: status

        if (len_trim(name) == 0 .or. scan(name, "/\""?") > 0) call fail(status, status_bad_input, "name: "//quoted(name) &
            //" is not a name of files that C includes (expected one without folder, ending, "" \ and ?)")
        code%file = name
        code%prefix = c_identifier(name)
        if (scan(code%prefix(1:1), "_0123456789") > 0) code%prefix = "scene_"//code%prefix
    end subroutine name_files

    !> The engine must be able to compute it, too; of inverse dynamics, by a record that it relies on itself.
    subroutine check_equations(model, wish, wanted, unknown, status)
        type(model_type), intent(in) :: model
        type(code_wish), intent(in) :: wish
        integer, intent(in) :: wanted(:)               !! `result_*`
        type(unknown_choice), intent(out) :: unknown
        type(status_type), intent(inout) :: status
        type(equations_type) :: equations
        logical :: is_there, is_uncertain, is_refuted
        integer, allocatable :: link(:)
        integer :: g

        select case (wish%kernel)
        case (kernel_inverse)
            call look_for_record(model, wanted, is_there, is_uncertain, is_refuted, status)
            if (is_there .or. .not. status%is_ok()) return
            link = [(model%group(g)%link, g=1, size(model%group))]
            if (is_uncertain) call refuse("at all poses tried links "//join(model%link(link)%name)//" are placed with too few " &
                //"digits for its forces to be compared with the engine's, as happens with threads whose lead is small " &
                //"beside the mechanism (expected the kernel forward or kinematics)", status)
            if (is_refuted) call refuse_what_differs(status)
            if (.not. (is_uncertain .or. is_refuted)) call refuse("the scene has no record (linkdyn explain shows what it has)", &
                                                                  status)
        case (kernel_forward)
            call choose_unknowns(model, unknown, status)
            if (status%is_ok() .and. .not. any(unknown%acceleration)) &
                call refuse("nothing is free to move: all coordinates are driven", status)
            if (status%is_ok()) call build_equations(model, solver_elimination, .true., equations, status, unknown)
            call free_equations(equations)
        end select
    end subroutine check_equations

    ! ---------------------------------------------------------------- names

    !> Names of what the arrays of the code run over.
    subroutine make_lists(model, list)
        type(model_type), intent(in) :: model
        type(name_list), intent(out) :: list(n_list)
        type(layout_type) :: layout
        character(len=note_len) :: note(model%n_load)
        character(len=label_len) :: name(max(model%n_load, model%n_link))
        integer :: i

        call describe_results(model%scene, wanted_type(), .false., layout)
        call take(of_coordinates, "coordinate", dim_coordinate)
        call take(of_actuators, "actuator", dim_actuator)
        call take(of_joints, "joint", dim_joint)
        call take(of_components, "component", dim_component)
        call take(of_variables, "variable", dim_variable)
        name(:model%n_link) = model%link%name
        list(of_links) = list_of_names("link", name(:model%n_link), [(" ", i=1, model%n_link)])
        do i = 1, model%n_load
            name(i) = model%scene%load(i)%name
            note(i) = merge("in link axes ", "in world axes", model%scene%load(i)%axes == axes_link)
        end do
        list(of_loads) = list_of_names("load", name(:model%n_load), note)
        list(of_axes) = without_names([character(len=1) :: "x", "y", "z"])

    contains

        subroutine take(i, what, dim)
            integer, intent(in) :: i, dim
            character(len=*), intent(in) :: what

            associate (dimension => layout%dimension(dim))
                if (allocated(dimension%unit)) then
                    list(i) = list_of_names(what, dimension%label, in_brackets(dimension%unit))
                else
                    list(i) = list_of_names(what, dimension%label, [(" ", i=1, dimension%size)])
                end if
            end associate
        end subroutine take

        elemental function in_brackets(unit) result(note)
            character(len=*), intent(in) :: unit
            character(len=note_len) :: note

            note = "["//trim(unit)//"]"
        end function in_brackets
    end subroutine make_lists

    ! ---------------------------------------------------------------- what goes in and out

    !> What the code computes: as much as is wished for, and as there is.
    subroutine list_outputs(wish, list, output)
        type(code_wish), intent(in) :: wish
        type(name_list), intent(in) :: list(:)
        type(field_type), allocatable, intent(out) :: output(:)
        integer :: l, r, c

        allocate (output(0))
        if (wish%kernel == kernel_forward) call add(field("qdd", "accelerations of the coordinates [m/s2, rad/s2]", result_qdd, &
                                                          [of_coordinates], list))
        if (has("driving_force")) call add(field("driving_force", &
            "driving forces and torques, positive in the direction of increasing joint variable [N, N m]", result_driving_force, &
            [of_actuators], list))
        if (has("reaction")) call add(field("reaction", &
            "wrench of the joint's first link on its second, at the joint point, world axes [N, N m]", result_reaction, &
            [of_joints, of_components], list))
        if (has("joint_variable")) then
            call add(field("joint_variable", "joint variables, angles within half a turn [m, rad]", result_joint_variable, &
                           [of_variables], list))
            call add(field("joint_rate", "their rates [m/s, rad/s]", result_joint_rate, [of_variables], list))
        end if
        if (has("position")) then
            call add(field("position", "origins of the links, world axes [m]", result_position, [of_links, of_axes], list))
            call add(field("rotation", "from link axes to world axes", result_rotation, [of_links, of_axes, of_axes], list))
            ! results have columns one after the other
            output(size(output))%place = [(((9*(l - 1) + 3*(c - 1) + r, c=1, 3), r=1, 3), l=1, list(of_links)%n)]
        end if
        if (has("velocity")) then
            call add(field("velocity", "of the links' origins, world axes [m/s]", result_velocity, [of_links, of_axes], list))
            call add(field("angular_velocity", "of the links, world axes [rad/s]", result_angular_velocity, [of_links, of_axes], &
                           list))
        end if

    contains

        logical function has(name)
            character(len=*), intent(in) :: name

            has = wish%has(findloc(result_name, name, dim=1))
        end function has

        subroutine add(new)
            type(field_type), intent(in) :: new

            if (field_size(new) > 0) output = [output, new]
        end subroutine add
    end subroutine list_outputs

    !> What the caller gives at each call: the motion as far as the kernel takes it for known, then loads and drives.
    subroutine list_inputs(model, wish, unknown, list, input)
        type(model_type), intent(in) :: model
        type(code_wish), intent(in) :: wish
        type(unknown_choice), intent(in) :: unknown
        type(name_list), intent(in) :: list(:)
        type(field_type), allocatable, intent(out) :: input(:)
        type(field_type) :: new
        logical :: is_known(model%n_actuator)

        allocate (input(0))
        new = field("q", "coordinates [m, rad]", in_q, [of_coordinates], list)
        new%start = model%start_q
        call add(new)
        call add(field("qd", "their rates [m/s, rad/s]", in_qd, [of_coordinates], list))
        select case (wish%kernel)
        case (kernel_inverse)
            call add(field("qdd", "their accelerations [m/s2, rad/s2]", in_qdd, [of_coordinates], list))
        case (kernel_forward)
            if (.not. all(unknown%acceleration)) call add(field("qdd", &
                "accelerations [m/s2, rad/s2], read of coordinates that are driven", in_qdd, [of_coordinates], list))
        end select
        if (wish%kernel /= kernel_kinematics) call add(loads_of(model, list))
        if (wish%kernel /= kernel_forward) return
        associate (drive => model%scene%actuator%law)
            is_known = .not. unknown%drive
            if (any(is_known .and. is_given(drive))) call add_drives("driving_force", &
                "driving forces and torques [N, N m], read of actuators without a law of their motion", in_effort, 1, 1)
            if (any(is_known .and. follows_target(drive))) then
                call add_drives("target", "positions that motors and controllers follow [m, rad]", in_target, 2, 1)
                call add_drives("target_rate", "their rates [m/s, rad/s]", in_target, 2, 2)
            end if
        end associate

    contains

        subroutine add(new)
            type(field_type), intent(in) :: new

            if (field_size(new) > 0) input = [input, new]
        end subroutine add

        !> One number of each actuator.
        subroutine add_drives(name, meaning, block, width, item)
            character(len=*), intent(in) :: name, meaning
            integer, intent(in) :: block               !! `in_*`
            integer, intent(in) :: width, item         !! numbers of an actuator there, and which of them
            type(field_type) :: new
            real(wp) :: of_law(3)
            integer :: i

            new = field(name, meaning, block, [of_actuators], list)
            new%place = width*(new%place - 1) + item
            do i = 1, model%n_actuator
                associate (drive => model%scene%actuator(i)%law)
                    if (drive%kind == effort_inverse .or. drive%target%kind == law_none .or. drive%side /= side_joint) cycle
                    if (is_given(drive) .neqv. block == in_effort) cycle
                    call evaluate_law(drive%target, model%scene%time%first, of_law(1), of_law(2), of_law(3))
                    new%start(i) = of_law(item)
                end associate
            end do
            call add(new)
        end subroutine add_drives
    end subroutine list_inputs

    !> Loads as results have components: in a plane two forces and a moment.
    function loads_of(model, list) result(new)
        type(model_type), intent(in) :: model
        type(name_list), intent(in) :: list(:)
        type(field_type) :: new
        real(wp) :: load(6, model%n_load, 1)
        integer, allocatable :: component(:)
        integer :: i, k

        component = [(k, k=1, 6)]
        if (model%is_planar) component = [1, 2, 6]
        new = field("load", "forces and moments at the loads' markers [N, N m]", in_load, [of_loads, of_components], list)
        call evaluate_loads(model, [model%scene%time%first], load)
        new%place = [((6*(i - 1) + component(k), k=1, size(component)), i=1, model%n_load)]
        new%start = [((load(component(k), i, 1), k=1, size(component)), i=1, model%n_load)]
    end function loads_of
end module linkdyn_generate
