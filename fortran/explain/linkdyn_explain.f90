!> What linkdyn makes of a scene, in words: links, equations, unknowns, order of computation, what is left out.
module linkdyn_explain
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_failure, only: reach_in_words
    use linkdyn_equations, only: equations_type, build_equations, free_equations, solver_elimination
    use linkdyn_result_kinds, only: result_driving_force, result_reaction
    use linkdyn_equation_kernels, only: answer_kernels, need_matrix, need_solving
    use linkdyn_explain_record, only: explain_record, in_words
    use linkdyn_constants, only: pi
    use linkdyn_contact, only: form_worm
    use linkdyn_closing_programs, only: closing_programs
    use linkdyn_choice, only: has_choice, choice_in_words, sharing_in_words
    use linkdyn_gearing, only: led_name
    use linkdyn_group_motion, only: group_closer
    use linkdyn_joint_table, only: n_transmitted, is_pose_part
    use linkdyn_kinds, only: wp
    use linkdyn_led_mechanism, only: follows_assembly
    use linkdyn_mesh_losses, only: worm_friction_angle
    use linkdyn_model, only: model_type, step_type, step_pose, step_joint, step_parts, step_ups, step_csp, step_rus, step_pus, &
        step_rod, step_hung, step_between, step_gimbal, step_rrr, step_rrp, step_group, step_name, n_hung_rod, base_of_hung, &
        is_dyad, is_length, is_screw, &
        place_size, side_of, turns_in_two, beyond_leg, holds_spin, is_released, drives_share
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_motor_loads, only: is_self_locking
    use linkdyn_planner, only: mobility_of, joint_constraints
    use linkdyn_scene, only: share_by_least_norm, share_name, joint_revolute, joint_prismatic, joint_universal, &
        joint_spherical, joint_kind_name, variable_name, &
        joint_n_variable, payload_changes, motor_spec, actuator_spec, controller_spec, n_controller, is_sampled, side_joint, &
        side_voltage, side_opening, feed_none, feed_gravity, feed_inverse, law_none
    use linkdyn_reach, only: find_reach
    use linkdyn_representatives, only: representative_poses, make_closer
    use linkdyn_shared_words, only: shares_in_words
    use linkdyn_status, only: status_type
    use linkdyn_sweep_spec, only: sampling_name, sampling_values, quantity_name
    use linkdyn_text, only: to_text
    use linkdyn_transmission, only: motion_survey, survey_motion
    implicit none (type, external)
    private
    public :: explain_model

contains

    !> Write the report of `linkdyn explain`.
    subroutine explain_model(model, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: unit    !! open for formatted writing

        type(closing_programs), target :: closing
        class(group_closer), pointer :: closer
        type(representative_poses) :: poses

        nullify (closer)
        if (size(model%group) > 0) then
            call make_closer(model, reshape(model%start_q, [model%n_q, 1]), poses, closing)
            if (closing%is_usable) closer => closing
        end if
        call explain_scene(model, unit)
        call explain_links(model, unit)
        call explain_motion(model, unit)
        call explain_spins(model, unit)
        call explain_redundancy(model, unit)
        call explain_unknowns(model, unit)
        call explain_order(model, closer, unit)
        call explain_reach(model, unit)
        call explain_equations(model, poses, unit)
        if (n_controller(model%scene) > 0) call explain_controllers(model, unit)
        if (model%scene%sweep%is_given) call explain_sweep(model, unit)
        call explain_left_out(model, unit)
        call closing%free()
    end subroutine explain_model

    subroutine explain_scene(model, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: unit

        write (unit, "(a)") trim(model%scene%title)
        write (unit, "(2x,a)") counted(model%n_link, "moving link")//", "//counted(model%n_joint, "joint")//", mobility " &
            //to_text(mobility_of(model))//", "//counted(model%n_q, "coordinate")//", "//counted(model%n_actuator, "actuator")
        if (all(model%gravity == 0)) then
            write (unit, "(2x,a)") "gravity: none"
        else
            write (unit, "(2x,a)") "gravity: ["//to_text(model%gravity(1))//", "//to_text(model%gravity(2))//", " &
                //to_text(model%gravity(3))//"] m/s2"
        end if
        if (model%scene%base%moves) &
            write (unit, "(2x,a)") "the frame moves: motion and results are as seen from it, in its axes"
    end subroutine explain_scene

    subroutine explain_links(model, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: unit
        integer :: i

        write (unit, "(/,a)") "Links"
        do i = 1, model%n_link
            associate (link => model%link(i))
                if (link%is_massless) then
                    write (unit, "(2x,a24,a)") adjustl(link%name), "massless"
                else
                    write (unit, "(2x,a24,a)") adjustl(link%name), to_text(link%mass)//" kg"
                end if
            end associate
        end do
        do i = 1, size(model%payload)
            associate (spec => model%scene%payload(i))
                if (payload_changes(spec)) then
                    write (unit, "(2x,a24,a)") adjustl(spec%name), "payload, changes with time"
                else
                    write (unit, "(2x,a24,a)") adjustl(spec%name), "payload, "//to_text(spec%mass%value(1))//" kg"
                end if
            end associate
        end do
    end subroutine explain_links

    !> Where the laws of motion lead, and how fast: an angle in degrees that was meant in radians, or a time, is seen here.
    subroutine explain_motion(model, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: unit
        integer, parameter :: n = 721                           ! half a degree of a crank's turn
        real(wp), dimension(model%n_q, n) :: q, qd, qdd
        real(wp) :: load(6, model%n_load, n), t(n)
        integer :: k, sample

        if (all(model%scene%coordinate%motion%kind == law_none)) return
        associate (range => model%scene%time)
            t = [(range%first + (range%last - range%first)*(real(sample - 1, wp)/(n - 1)), sample=1, n)]
            write (unit, "(/,a)") "Motion from "//to_text(range%first)//" to "//to_text(range%last)//" s"
        end associate
        call evaluate_motion(model, t, q, qd, qdd, load)
        do k = 1, model%n_q
            write (unit, "(2x,a24,a)") adjustl(model%scene%coordinate(k)%name), way_in_words(k)
        end do

    contains
        !> "0 to 90 deg, at most 360 deg/s and 2261.95 deg/s2"
        function way_in_words(k) result(text)
            integer, intent(in) :: k
            character(len=:), allocatable :: text, name
            real(wp) :: factor

            factor = merge(1.0_wp, 180/pi, is_length(model, k))
            name = trim(merge("m  ", "deg", is_length(model, k)))
            if (maxval(q(k, :)) > minval(q(k, :))) then
                text = in_short(factor*minval(q(k, :)))//" to "//in_short(factor*maxval(q(k, :)))//" "//name//", at most " &
                    //in_short(factor*maxval(abs(qd(k, :))))//" "//name//"/s and "//in_short(factor*maxval(abs(qdd(k, :)))) &
                    //" "//name//"/s2"
            else
                text = "stays at "//in_short(factor*q(k, 1))//" "//name
            end if
        end function way_in_words
    end subroutine explain_motion

    !> Five digits.
    function in_short(number) result(text)
        real(wp), intent(in) :: number
        character(len=:), allocatable :: text
        real(wp) :: unit_digit

        unit_digit = 0
        if (abs(number) > tiny(number)) unit_digit = 10.0_wp**(floor(log10(abs(number))) - 4)
        text = to_text(number)
        if (unit_digit > 0) text = to_text(anint(number/unit_digit)*unit_digit)
    end function in_short

    !> Links that may spin while nothing else moves.
    subroutine explain_spins(model, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: unit
        integer :: i

        if (size(model%scene%hold) == 0) return
        write (unit, "(/,a)") "Idle spins, held: forces and all other motion do not depend on them"
        do i = 1, size(model%scene%hold)
            associate (hold => model%scene%hold(i))
                write (unit, "(2x,a)") hold%links//" about the line through its joints, held at joint " &
                    //trim(model%joint(hold%joint)%name)
            end associate
        end do
    end subroutine explain_spins

    !> Directions that are held more often than once.
    subroutine explain_redundancy(model, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: unit
        character(len=:), allocatable :: how
        integer :: j

        if (model%share%n == 0) return
        write (unit, "(/,a)") "Redundant constraints: "//to_text(model%share%n)//", let go while the motion is found"
        do j = 1, model%n_joint
            if (.not. is_released(model%joint(j))) cycle
            how = "closes the loop as "//trim(joint_kind_name(model%joint(j)%kind))
            if (model%joint(j)%gear > 0) how = "its wheels are coupled without it"
            write (unit, "(2x,a24,a)") adjustl(model%joint(j)%name), trim(joint_kind_name(model%joint(j)%told_kind))//", "//how
        end do
        write (unit, "(2x,a)") "not determined by the equations: "//shares_in_words(model)
        write (unit, "(2x,a)") "redundancy = """//trim(share_name(model%scene%redundancy))//""": of these the "// &
            trim(merge("least sum of squares", "least elastic energy", model%scene%redundancy == share_by_least_norm))
        how = ""
        do j = 1, size(model%scene%link)
            if (allocated(model%scene%link(j)%arm)) how = how//", "//trim(model%scene%link(j)%name)
        end do
        if (how /= "") write (unit, "(2x,a)") "links that give way: "//how(3:)
    end subroutine explain_redundancy

    subroutine explain_unknowns(model, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: unit
        character(len=:), allocatable :: what
        integer :: j, n, carried(2)

        write (unit, "(/,a)") "Unknowns of inverse dynamics"
        n = model%n_actuator
        do j = 1, model%n_joint
            associate (joint => model%joint(j))
                n = n + joint_constraints(model, joint%kind)
                carried = n_transmitted(joint%kind, model%is_planar)
                what = counted(carried(1), "force")
                if (carried(2) > 0 .and. joint%told_kind /= joint_spherical) &
                    what = what//", "//counted(carried(2) - merge(1, 0, holds_spin(joint)), "moment")
                if (holds_spin(joint)) what = what//", an idle spin held by no moment"
                if (joint%belt > 0) what = "none: its strands pull as far as they are stretched"
                if (any(model%contact%joint == j)) what = what//", friction"//worm_in_words(model, j)
                write (unit, "(2x,a24,a,1x,a)") adjustl(joint%name), joint_kind_name(joint%told_kind), what
            end associate
        end do
        do j = 1, model%n_actuator
            associate (spec => model%scene%actuator(j))
                write (unit, "(2x,a24,a12,a)") adjustl(spec%name), "actuator    ", &
                    trim(merge("force ", "torque", spec%unit == "N"))//" on its "// &
                    trim(variable_name(spec%variable, model%joint(spec%joint)%kind))//motor_in_words(spec%motor) &
                    //cylinder_in_words(spec)
            end associate
        end do
        write (unit, "(2x,a)") to_text(n)//" unknowns in "//to_text(model%n_row)//" equations of motion"
        if (drives_share(model)) write (unit, "(2x,a)") sharing_in_words(model)
    end subroutine explain_unknowns

    !> What part of the power a worm that rubs lets through, fast; whether its wheel can drive it.
    function worm_in_words(model, j) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j                       !! joint with friction
        character(len=:), allocatable :: text
        real(wp) :: lead, slides, rests
        integer :: k

        text = ""
        k = findloc(model%contact%joint, j, dim=1)
        if (model%contact(k)%form /= form_worm) return
        associate (contact => model%contact(k), spec => model%scene%joint(j))
            lead = abs(spec%lead_angle)
            slides = worm_friction_angle(contact, spec, contact%coulomb)
            rests = worm_friction_angle(contact, spec, contact%static)
        end associate
        text = " (efficiency "//to_text(max(tan(lead)/tan(lead + slides), 0.0_wp))
        if (slides < lead) text = text//", driven by its wheel "//to_text(tan(lead - slides)/tan(lead))
        if (slides < lead .and. rests >= lead) text = text//", self-locking at rest"
        if (slides >= lead) text = text//", self-locking: its wheel cannot drive it"
        text = text//")"
    end function worm_in_words

    !> What stands behind an actuator.
    function motor_in_words(motor) result(text)
        type(motor_spec), intent(in) :: motor
        character(len=:), allocatable :: text

        text = ""
        if (.not. motor%is_given) return
        text = ", motor behind ratio "//to_text(motor%ratio)
        if (is_self_locking(motor)) text = text//", self-locking: the load cannot drive it"
        if (motor%brake%is_given) text = text//", with a brake"
    end function motor_in_words

    !> A cylinder, and whether its pressures are states.
    function cylinder_in_words(actuator) result(text)
        type(actuator_spec), intent(in) :: actuator
        character(len=:), allocatable :: text

        text = ""
        if (.not. actuator%cylinder%is_given) return
        text = ", a "//trim(merge("pneumatic", "hydraulic", actuator%cylinder%has_gas))//" cylinder"
        if (actuator%law%side == side_opening) text = text//", whose pressures are states of forward runs"
    end function cylinder_in_words

    pure function counted(n, what) result(text)
        integer, intent(in) :: n
        character(len=*), intent(in) :: what
        character(len=:), allocatable :: text

        text = to_text(n)//" "//what
        if (n /= 1) text = text//"s"
    end function counted

    subroutine explain_order(model, closer, unit)
        type(model_type), intent(in) :: model
        class(group_closer), pointer, intent(in) :: closer    !! makes the groups' steps; null: nobody else
        integer, intent(in) :: unit
        type(motion_survey) :: survey
        logical :: moves
        integer :: i

        moves = follows_assembly(model) .and. model%scene%time%last > model%scene%time%first
        if (moves) call survey_motion(model, closer, survey)
        write (unit, "(/,a)") "Order of computation"
        do i = 1, size(model%step)
            if (is_dyad(model%step(i)%kind)) call explain_coupler_points(model, i, unit)
            write (unit, "(2x,i4,a)") i, ". "//step_in_words(model, model%step(i))
            if (has_choice(model, model%step(i))) &
                write (unit, "(8x,a)") "assembly at the start: "//choice_in_words(model, model%step(i))
            if (is_dyad(model%step(i)%kind) .and. moves) call explain_transmission(model%step(i)%first)
        end do
        if (survey%n_failed > 0) write (unit, "(2x,a)") "not to be assembled at "//to_text(survey%n_failed)//" of " &
            //to_text(survey%n_instant)//" instants along the motion, first at t = "//to_text(survey%first_failure)//" s: " &
            //trim(survey%why)

    contains

        subroutine explain_transmission(d)
            integer, intent(in) :: d

            if (survey%angle(d) > pi) return           ! it could not be assembled at all
            write (unit, "(8x,a)") "transmission angle down to "//to_text(anint(survey%angle(d)*1800/pi)/10)//" deg, at t = " &
                //in_short(survey%time(d))//" s"
        end subroutine explain_transmission
    end subroutine explain_order

    !> How far each coordinate can go from the start while the others stay, if a loop that it moves may end its way.
    subroutine explain_reach(model, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: unit
        real(wp) :: place(place_size(model), model%n_link)
        character(len=:), allocatable :: words
        integer, allocatable :: which(:)
        real(wp), dimension(model%n_q) :: lowest, highest
        logical :: has_title, is_limited(model%n_q)
        integer :: g, i, k

        if (.not. follows_assembly(model)) return
        place = 0
        do g = 1, size(model%group)
            place(:, model%group(g)%link) = model%group(g)%start
        end do
        has_title = .false.
        which = pack([(k, k=1, model%n_q)], [(moves_loop(model, k), k=1, model%n_q)])
        call find_reach(model, which, model%start_q, model%branch, place, lowest(:size(which)), highest(:size(which)), &
                        is_limited(:size(which)))
        do i = 1, size(which)
            k = which(i)
            if (is_limited(i) .and. .not. lowest(i) < highest(i)) then
                words = "does not close at the start"
            else if (is_limited(i)) then
                words = "closes "//reach_in_words(model, k, lowest(i), highest(i))
            else if (is_length(model, k) .or. is_screw(model, k)) then
                words = trim(model%scene%coordinate(k)%name)//" may move farther than the mechanism is long"
            else
                words = trim(model%scene%coordinate(k)%name)//" goes all the way round"
            end if
            if (.not. has_title .and. model%n_q > 1) write (unit, "(/,a)") "Reach from the start, the other coordinates at rest"
            if (.not. has_title .and. model%n_q == 1) write (unit, "(/,a)") "Reach from the start"
            has_title = .true.
            write (unit, "(2x,a)") words
        end do
    end subroutine explain_reach

    !> Does a coordinate move links that close in more ways than one?
    pure logical function moves_loop(model, k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: k
        integer :: i

        moves_loop = .false.
        do i = 1, size(model%step)
            if (model%step(i)%kind == step_group) then
                moves_loop = moves_loop .or. any(model%moves(k, model%group(model%step(i)%first)%link))
            else if (model%step(i)%has_branches) then
                moves_loop = moves_loop .or. any(model%moves(k, model%step(i)%link(:model%step(i)%n_link)))
            end if
        end do
    end function moves_loop

    !> Points of coupled links from which a dyad sets out.
    subroutine explain_coupler_points(model, i, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i, unit
        integer :: side, known, k

        do side = 1, 2
            associate (joint => model%joint(model%step(i)%joint(2*side - 1)))
                known = joint%link(3 - side_of(joint, model%step(i)%link(side)))
                do k = 1, i - 1
                    if (.not. is_dyad(model%step(k)%kind) .or. all(model%step(k)%link(:model%step(k)%n_link) /= known)) cycle
                    write (unit, "(8x,a)") "coupler_point: "//trim(joint%name)//" on "//trim(model%link(known)%name)
                end do
            end associate
        end do
    end subroutine explain_coupler_points

    !> What a step places, and by what: "rod by revolute joint B from coordinate crank".
    function step_in_words(model, step) result(text)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        character(len=:), allocatable :: text
        integer :: i

        select case (step%kind)
        case (step_pose)
            text = "pose of "//trim(model%link(step%link(1))%name)//" from its "//trim(merge("three", "six  ", model%is_planar)) &
                   //" coordinates"
        case (step_joint)
            text = ""
            if (model%is_planar .and. model%joint(step%joint(1))%kind == joint_revolute) text = "crank_input: "
            text = text//trim(model%link(step%link(1))%name)//" by "//trim(joint_kind_name(model%joint(step%joint(1))%kind)) &
                   //" joint "//trim(model%joint(step%joint(1))%name)
            do i = 1, joint_n_variable(model%joint(step%joint(1))%kind)
                text = text//trim(merge(" from coordinate", ",               ", i == 1)) &
                       //" "//led_name(model, step%coordinate(i))
            end do
        case (step_parts)
            text = "pose of "//trim(model%link(step%link(1))%name)//" from " &
                   //trim(merge("three", "six  ", count(step%coordinate > 0) == 3))//" coordinates, seen from " &
                   //name_of(model, model%joint(step%joint(1))%link(1))
            if (.not. model%is_planar .and. step%joint(2) == 0) text = text//", which it does not turn against"
        case (step_ups)
            text = trim(merge("UCU", "UPS", turns_in_two(model, step)))//" leg " &
                   //trim(model%link(step%link(1))%name)//", "//trim(model%link(step%link(2))%name) &
                   //" between "//name_of(model, beyond_leg(model, step, 1))//" and " &
                   //name_of(model, beyond_leg(model, step, 2))//": closed form"
        case (step_csp)
            text = "CSP group "//trim(model%link(step%link(1))%name)//", "//trim(model%link(step%link(2))%name) &
                   //": closed form"
        case (step_rus, step_pus)
            text = letters_of_leg()//" leg "//trim(model%link(step%link(1))%name)//", "//trim(model%link(step%link(2))%name) &
                   //" between "//name_of(model, sum(model%joint(step%joint(1))%link) - step%link(1))//" and " &
                   //name_of(model, sum(model%joint(step%joint(3))%link) - step%link(2))//": closed form"
        case (step_rod)
            text = "rod "//trim(model%link(step%link(1))%name)//" between " &
                   //name_of(model, sum(model%joint(step%joint(1))%link) - step%link(1))//" and " &
                   //name_of(model, sum(model%joint(step%joint(2))%link) - step%link(1))//": closed form"
        case (step_between, step_gimbal)
            i = merge(2, 3, step%kind == step_between)
            text = trim(model%link(step%link(1))%name)//" between " &
                   //name_of(model, sum(model%joint(step%joint(1))%link) - step%link(1))//" and " &
                   //name_of(model, far_link(model, step))//" by joints "//trim(model%joint(step%joint(1))%name)//" and " &
                   //trim(model%joint(step%joint(i))%name)//": closed form"
        case (step_hung)
            text = "platform "//trim(model%link(step%link(1))%name)//" on rods at"
            do i = 2, 2*n_hung_rod, 2
                text = text//" "//trim(model%joint(step%joint(i))%name)
            end do
            text = text//", which does not turn against "//name_of(model, base_of_hung(model, step))//": closed form"
        case (step_group)
            text = "Assur group of "//to_text(size(model%group(step%first)%link))//" links:"
            do i = 1, size(model%group(step%first)%link)
                text = text//" "//trim(model%link(model%group(step%first)%link(i))%name)
            end do
            text = text//": Newton's method"
        case default
            text = dyad_in_words(model, step)
        end select

    contains

        !> "RUS", "PSS": its joints as the scene has them.
        function letters_of_leg() result(letters)
            character(len=3) :: letters
            integer :: i

            do i = 1, 3
                select case (model%joint(step%joint(i))%told_kind)
                case (joint_revolute)
                    letters(i:i) = "R"
                case (joint_prismatic)
                    letters(i:i) = "P"
                case (joint_universal)
                    letters(i:i) = "U"
                case (joint_spherical)
                    letters(i:i) = "S"
                case default
                    letters(i:i) = "C"
                end select
            end do
        end function letters_of_leg
    end function step_in_words

    !> The link at the far end of the joints of a link between.
    pure integer function far_link(model, step) result(link)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        integer :: k

        link = step%link(1)
        do k = 2, count(step%joint > 0)
            link = sum(model%joint(step%joint(k))%link) - link
        end do
    end function far_link

    !> The lecture's module where it has one.
    function dyad_in_words(model, step) result(text)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        character(len=:), allocatable :: text
        integer :: i

        select case (step%kind)
        case (step_rrr)
            text = "RRR_links: "
        case (step_rrp)
            text = "PRR_links: "
        case default
            text = trim(step_name(step%kind))//": "
        end select
        text = text//trim(model%link(step%link(1))%name)
        do i = 2, step%n_link
            text = text//", "//trim(model%link(step%link(i))%name)
        end do
        text = text//" by joints"
        do i = 1, 3
            if (is_pose_part(model%joint(step%joint(i))%kind)) then
                text = text//" (point from coordinates "//led_name(model, step%coordinate(i + 2))//" "// &
                       led_name(model, step%coordinate(i + 3))//")"
            else
                text = text//" "//trim(model%joint(step%joint(i))%name)
            end if
        end do
        do i = 4, step%n_link + 1
            text = text//", "//trim(model%joint(step%joint(i))%name)//" from coordinate "//led_name(model, step%coordinate(i - 3))
        end do
    end function dyad_in_words

    function name_of(model, link) result(name)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        character(len=:), allocatable :: name

        name = "frame"
        if (link > 0) name = trim(model%link(link)%name)
    end function name_of

    !> The equations of motion as the elimination takes them, and what it takes; then the records of the scene.
    subroutine explain_equations(model, poses, unit)
        type(model_type), intent(in) :: model
        type(representative_poses), intent(inout) :: poses
        integer, intent(in) :: unit
        type(equations_type) :: equations
        type(answer_kernels), pointer :: answers
        type(status_type) :: status

        write (unit, "(/,a)") "Elimination"
        call build_equations(model, solver_elimination, .true., equations, status)
        if (.not. status%is_ok()) then
            write (unit, "(2x,a)") trim(status%message)
            return
        end if
        associate (kernels => equations%kernels)
            call need_matrix(model, kernels)
            call need_solving(model, [result_driving_force, result_reaction], kernels, answers)
            write (unit, "(2x,a)") "nonzeros "//to_text(size(kernels%form%row))//", of these varying " &
                //to_text(count(kernels%form%output > 0))
            if (answers%solving%program%is_made) then
                write (unit, "(2x,a)") "all unknowns: "//in_words(answers%solving%program%kernel)//new_line("a") &
                    //"  pivots watched: "//to_text(answers%n_watched)
            else
                write (unit, "(2x,a)") "no pivots good enough at the representative poses; every sample goes to the dense solver"
            end if
        end associate
        write (unit, "(2x,a,i0,a)") "dense elimination would take about ", nint(2*real(model%n_row, wp)**3/3, int64), &
            " flops a pose"
        call free_equations(equations)
        call explain_record(model, poses, unit)
    end subroutine explain_equations

    !> What drives actuators in forward runs.
    subroutine explain_controllers(model, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: unit
        integer :: i

        write (unit, "(/,a)") "Controllers, in forward runs"
        do i = 1, n_controller(model%scene)
            associate (spec => model%scene%controller(i))
                write (unit, "(2x,a24,a)") adjustl(spec%name), parts_in_words(spec)//" ["//trim(spec%output_unit)//" over " &
                    //trim(spec%unit)//"] at "//trim(model%scene%actuator(spec%actuator)%name)//side_in_words(spec) &
                    //sampling_in_words(spec)//limits_in_words(spec)//feed_in_words(spec)
            end associate
        end do
    end subroutine explain_controllers

    !> "PID"
    pure function parts_in_words(spec) result(text)
        type(controller_spec), intent(in) :: spec
        character(len=:), allocatable :: text

        text = ""
        if (abs(spec%kp) > 0) text = text//"P"
        if (abs(spec%ki) > 0) text = text//"I"
        if (abs(spec%kd) > 0) text = text//"D"
    end function parts_in_words

    pure function side_in_words(spec) result(text)
        type(controller_spec), intent(in) :: spec
        character(len=:), allocatable :: text

        text = ", its motor"
        if (spec%side == side_joint) text = ""
        if (spec%side == side_voltage) text = text//"'s terminals"
        if (spec%side == side_opening) text = ", its valve"
    end function side_in_words

    pure function sampling_in_words(spec) result(text)
        type(controller_spec), intent(in) :: spec
        character(len=:), allocatable :: text

        text = ", continuous"
        if (is_sampled(spec)) text = ", a sample every "//to_text(spec%period)//" s"
        if (spec%delay > 0) text = text//", "//to_text(spec%delay)//" s late"
    end function sampling_in_words

    pure function limits_in_words(spec) result(text)
        type(controller_spec), intent(in) :: spec
        character(len=:), allocatable :: text

        text = ""
        if (spec%low > -huge(1.0_wp)) text = text//", at least "//to_text(spec%low)//" "//trim(spec%output_unit)
        if (spec%high < huge(1.0_wp)) text = text//", at most "//to_text(spec%high)//" "//trim(spec%output_unit)
    end function limits_in_words

    pure function feed_in_words(spec) result(text)
        type(controller_spec), intent(in) :: spec
        character(len=:), allocatable :: text

        select case (spec%feed)
        case (feed_none)
            text = ""
        case (feed_gravity)
            text = ", gravity ahead"
        case (feed_inverse)
            text = ", inverse dynamics ahead"
        case default
            text = ", a law ahead"
        end select
    end function feed_in_words

    !> What `linkdyn sweep` goes through; axes of one group advance together.
    subroutine explain_sweep(model, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: unit
        character(len=:), allocatable :: text
        integer(int64) :: n_sample
        integer :: i, first, width

        write (unit, "(/,a)") "Sweep"
        n_sample = 1
        associate (axis => model%scene%sweep%axis, wants => model%scene%sweep%wants)
            width = maxval(len_trim(axis%name)) + 2
            do i = 1, size(axis)
                first = findloc(axis%group, axis(i)%group, dim=1)
                if (first == i) then
                    n_sample = n_sample*axis(i)%n
                    text = number(axis(i)%n)//" values"
                    if (axis(i)%sampling /= sampling_values) text = text//", "//trim(sampling_name(axis(i)%sampling))
                else
                    text = "together with "//trim(axis(first)%name)
                end if
                write (unit, "(2x,a)") axis(i)%name(:width)//text
            end do
            text = ""
            do i = 1, size(wants)
                if (wants(i)) text = text//" "//trim(quantity_name(i))
            end do
        end associate
        write (unit, "(2x,a)") number(n_sample)//" samples; of each:"//text

    contains

        function number(n)
            integer(int64), intent(in) :: n
            character(len=:), allocatable :: number
            character(len=20) :: digits

            write (digits, "(i0)") n
            number = trim(digits)
        end function number
    end subroutine explain_sweep

    subroutine explain_left_out(model, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: unit
        integer :: i
        logical :: nothing

        write (unit, "(/,a)") "Left out"
        nothing = .not. model%is_planar
        if (model%is_planar) write (unit, "(2x,a)") "motion, forces and moments out of the plane"
        do i = 1, model%n_link
            if (.not. model%link(i)%is_massless) cycle
            write (unit, "(2x,a)") "inertia of massless link "//trim(model%link(i)%name)
            nothing = .false.
        end do
        do i = 1, model%n_link
            if (model%is_planar .or. model%link(i)%is_massless .or. .not. model%link(i)%is_diagonal) cycle
            write (unit, "(2x,a)") "products of inertia of "//trim(model%link(i)%name)//" (zero)"
            nothing = .false.
        end do
        if (nothing) write (unit, "(2x,a)") "nothing"
    end subroutine explain_left_out
end module linkdyn_explain
