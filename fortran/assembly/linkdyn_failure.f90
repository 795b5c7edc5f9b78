!> Where a mechanism cannot be computed, in words: the links and joints concerned, and how far a coordinate can go.
module linkdyn_failure
    use linkdyn_assembly_trail, only: lost_way
    use linkdyn_cam_contact, only: marker_place
    use linkdyn_constants, only: pi
    use linkdyn_joint_table, only: is_pose_part
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: run_step, clear_flags
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_law_values, only: law_argument
    use linkdyn_measures, only: find_laws, find_measures, spring_without_direction
    use linkdyn_model, only: model_type, step_type, joint_type, step_group, step_rrr, is_dyad, is_length, side_of, point_on, &
        by_nothing
    use linkdyn_payloads, only: evaluate_payloads
    use linkdyn_reach, only: find_reach
    use linkdyn_status, only: sample_unreachable, sample_singular, sample_not_converged, sample_branch_lost, sample_undefined, &
        sample_locked
    use linkdyn_text, only: to_text, join, quoted
    use linkdyn_vec3, only: vec3
    implicit none (type, external)
    private
    public :: failure_at, lock_in_words, lost_in_words, map_in_words, meeting_in_words, reach_in_words, end_in_words

contains

    !> "links 'coupler', 'follower' cannot be closed at joint 'J3'" for a lane of a state evaluated before.
    function failure_at(model, state, status, lane) result(text)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state    !! its positions are computed anew
        integer, intent(in) :: status                    !! of the sample
        integer, intent(in) :: lane
        character(len=:), allocatable :: text
        integer :: i

        i = failing_step(model, state, lane)
        if (status == sample_locked .and. state%holding(lane) > 0) then
            text = lock_in_words(model, state%holding(lane))
        else if (i > 0) then
            text = links_of(model, model%step(i))
            if (state%branch_lost(lane)) then
                text = text//" depend through gears on an angle of a loop that is half a turn from its start: which turn " &
                       //"it is cannot be told"
                return
            end if
            select case (status)
            case (sample_singular)
                text = text//" at a dead point: their rates are not determined"
            case (sample_not_converged)
                text = text//" cannot be closed: Newton's method does not converge"
            case default
                text = text//" cannot be closed"
            end select
        else if (status == sample_undefined .and. spring_without_direction(model, state, lane) > 0) then
            text = "spring "//quoted(model%scene%spring(spring_without_direction(model, state, lane))%name) &
                   //" has no direction, its ends coincide"
        else if (status == sample_undefined .and. law_without_value(model, state, lane) > 0) then
            text = trouble_of_law(model, state, lane, law_without_value(model, state, lane))
        else if (status == sample_undefined .and. payload_below_zero(model, state, lane) > 0) then
            text = "payload on "//quoted(model%scene%payload(payload_below_zero(model, state, lane))%name) &
                   //" has a mass below zero"
        else if (status == sample_undefined) then
            text = "a force overflows"
        else if (status == sample_singular) then
            text = "the equations of motion are singular"
        else if (status == sample_unreachable) then
            text = "the motion is not finite"
        else if (state%way_status(lane) == sample_not_converged) then
            text = "it is too far from the scene's start to follow the assembly to there"
        else
            text = "the mechanism cannot be computed"
        end if
    end function failure_at

    !> Which joint holds the mechanism fast.
    function lock_in_words(model, contact) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: contact                   !! that is pressed most; beyond the contacts: a motor
        character(len=:), allocatable :: text

        if (contact > size(model%contact)) then
            associate (motor => model%motor(contact - size(model%contact)))
                text = "actuator "//quoted(model%scene%actuator(motor%actuator)%name)//" jams: what its transmission loses " &
                       //"grows with the force that it takes to stop its load, without end (expected more 'rotor_inertia', " &
                       //"or a higher 'back_efficiency')"
            end associate
            return
        end if
        text = "joint "//quoted(model%joint(model%contact(contact)%joint)%name) &
               //" locks: its friction grows with the forces that it takes to overcome it, without end"
    end function lock_in_words

    !> The first payload whose law of its mass has no value at the instant of a lane; 0: there is none.
    integer function payload_below_zero(model, state, lane) result(k)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: lane
        real(wp) :: mass(size(model%scene%payload), 1)

        call evaluate_payloads(model, [state%time(lane)], mass)
        do k = 1, size(mass, 1)
            if (.not. mass(k, 1) >= 0) return
        end do
        k = 0
    end function payload_below_zero

    !> The first law over the state that has no value on a lane; 0: there is none.
    integer function law_without_value(model, state, lane) result(k)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        integer, intent(in) :: lane

        call find_laws(model, state)
        do k = 1, size(state%law, 2)
            if (.not. abs(state%law(lane, k)) <= huge(1.0_wp)) return
        end do
        k = 0
    end function law_without_value

    function trouble_of_law(model, state, lane, k) result(text)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state       !! with its laws
        integer, intent(in) :: lane, k
        character(len=:), allocatable :: text
        real(wp) :: measure(lanes, size(model%scene%laws%measure)), argument(lanes)

        associate (law => model%scene%laws%law(k))
            text = trim(law%name)//" has no value"
            if (law%over == 0) then
                text = text//": a division by zero, a root or power of a negative number"
                return
            end if
            call find_measures(model, state, measure)
            argument = law_argument(law, measure, state%law)
            text = text//": "//trim(law%over_name)//" = "//to_text(argument(lane))//" "//trim(law%over_unit) &
                   //" is outside its table, "//to_text(law%table%time(1))//" to "//to_text(law%table%time(size(law%table%time))) &
                   //" "//trim(law%over_unit)
        end associate
    end function trouble_of_law

    !> The first step that fails; 0 if none does.
    integer function failing_step(model, state, lane) result(i)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        integer, intent(in) :: lane

        call clear_flags(state)
        do i = 1, size(model%step)
            call run_step(model, model%step(i), state)
            if (state%unreachable(lane) .or. state%singular(lane)) return
            if (state%not_converged(lane) .or. state%branch_lost(lane)) return
        end do
        i = 0
    end function failing_step

    function links_of(model, step) result(text)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        character(len=:), allocatable :: text

        if (step%kind == step_group) then
            text = "links "//join(model%link(model%group(step%first)%link)%name)
        else
            text = "links "//join(model%link(pack(step%link, step%link > 0))%name)
        end if
    end function links_of

    !> The links of a map that tells assemblies apart (`linkdyn_led_mechanism`); blank for none.
    function map_in_words(model, map) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: map
        character(len=:), allocatable :: text
        integer :: i

        text = ""
        i = step_of_map(model, map)
        if (i > 0) text = links_of(model, model%step(i))
    end function map_in_words

    pure integer function step_of_map(model, map) result(i)
        type(model_type), intent(in) :: model
        integer, intent(in) :: map

        do i = size(model%step), 1, -1
            associate (step => model%step(i))
                if ((is_dyad(step%kind) .or. step%has_margin) .and. step%first == map) return
                if (step%kind == step_group .and. model%n_branch + step%first == map) return
            end associate
        end do
    end function step_of_map

    ! ---------------------------------------------------------------- ways

    !> Why the assembly was not followed to a sample.
    function lost_in_words(model, lost) result(text)
        type(model_type), intent(in) :: model
        type(lost_way), intent(in) :: lost
        character(len=:), allocatable :: text
        integer :: i

        i = failing_step_of(model, lost)
        text = "the loops"
        if (i > 0) text = links_of(model, model%step(i))
        select case (lost%status)
        case (sample_branch_lost)
            text = text//" are at a change point at "//place_in_words(model, lost)//meeting_in_words(model)
        case (sample_singular)
            text = text//" are at a dead point or change point: their rates are not determined"
        case (sample_not_converged)
            text = text//" cannot be followed beyond "//place_in_words(model, lost)//" within the step limit"
        case default
            if (all(lost%from == lost%to)) then
                text = text//" cannot be closed at the start"//span_in_words(model, lost, i)//choice_in_words(model)
                return
            end if
            text = text//" cannot be closed beyond "//place_in_words(model, lost)//range_in_words(model, lost, i)
        end select
    end function lost_in_words

    !> "links 'coupler', 'rocker' cannot be closed beyond J1 = 67.1 deg; they close from J1 = -67.1 deg to 67.1 deg" of a way that
    !> ends.
    function end_in_words(model, lost) result(text)
        type(model_type), intent(in) :: model
        type(lost_way), intent(in) :: lost
        character(len=:), allocatable :: text
        integer :: i, k

        i = failing_step_of(model, lost)
        text = "the loops"
        if (i > 0) text = links_of(model, model%step(i))
        text = text//" cannot be closed beyond "
        if (count(lost%from /= lost%to) /= 1) then
            text = text//"there"
            return
        end if
        k = findloc(lost%from /= lost%to, .true., dim=1)
        text = text//end_of_way(model, lost, k)//range_in_words(model, lost, i)
    end function end_in_words

    !> ": joints 'A' and 'B' are 0.3 m apart, the links reach from 0.1 m to 0.2 m" of two links with hinges.
    function span_in_words(model, lost, i) result(text)
        type(model_type), intent(in) :: model
        type(lost_way), intent(in) :: lost
        integer, intent(in) :: i                         !! step that fails; 0: not known
        character(len=:), allocatable :: text
        type(kinematic_state) :: state
        type(vec3) :: hinge(2)
        real(wp) :: reach(2), apart
        integer :: k, side

        text = ""
        if (i == 0) return
        if (model%step(i)%kind /= step_rrr .or. any(model%step(:i - 1)%kind == step_group)) return
        if (any(is_pose_part(model%joint(model%step(i)%joint([1, 3]))%kind))) return      ! the point is where the coordinates say
        call prepare_kinematics(model, 0, state)
        state%q = spread(lost%to, 1, lanes)
        state%branch = spread(lost%branch, 1, lanes)
        do k = 1, i - 1
            call run_step(model, model%step(k), state)
        end do
        associate (step => model%step(i))
            do k = 1, 2
                side = side_of(model%joint(step%joint(2*k - 1)), step%link(k))
                hinge(k) = marker_place(model, state, step%joint(2*k - 1), 3 - side)
                reach(k) = arm_of(step, k)
            end do
            if (any(reach < 0)) return
            apart = hypot(hinge(1)%x(1) - hinge(2)%x(1), hinge(1)%y(1) - hinge(2)%y(1))
            text = ": joints "//quoted(model%joint(step%joint(1))%name)//" and "//quoted(model%joint(step%joint(3))%name) &
                   //" are "//to_text(apart)//" m apart, the links reach from "//to_text(abs(reach(1) - reach(2)))//" m to " &
                   //to_text(sum(reach))//" m"
        end associate

    contains

        !> From the outer to the inner hinge of a half of the dyad, whose slide, if it has one, a coordinate draws out; below zero
        !> if gears do.
        pure real(wp) function arm_of(step, k) result(length)
            type(step_type), intent(in) :: step
            integer, intent(in) :: k
            real(wp) :: arm(2)
            integer :: i, side, tip

            associate (outer => model%joint(step%joint(2*k - 1)), inner => model%joint(step%joint(2)), link => step%link(k))
                length = -1
                if (any(inner%link == link)) then
                    length = norm2(point_on(inner, link) - point_on(outer, link))
                    return
                end if
                i = findloc([(any(model%joint(step%joint(3 + i))%link == link), i=1, step%n_link - 2)], .true., dim=1)
                if (step%coordinate(i) > model%n_q) return
                tip = step%link(2 + i)
                associate (slide => model%joint(step%joint(3 + i)))
                    side = side_of(slide, link)
                    ! along and across the slide, as its frames see it
                    arm = in_slide(slide, side, slide%point(:, side) - point_on(outer, link)) &
                          + in_slide(slide, 3 - side, point_on(inner, tip) - slide%point(:, 3 - side))
                    arm(1) = arm(1) + lost%to(step%coordinate(i))*merge(1, -1, side == 1)
                end associate
                length = norm2(arm)
            end associate
        end function arm_of

        pure function in_slide(slide, side, v) result(w)
            type(joint_type), intent(in) :: slide
            integer, intent(in) :: side
            real(wp), intent(in) :: v(3)
            real(wp) :: w(2)

            associate (u => slide%frame(:, 3, side))
                w = [dot_product(u, v), u(1)*v(2) - u(2)*v(1)]
            end associate
        end function in_slide
    end function span_in_words

    !> What may be at fault where loops do not close at the start: how others do that stand before them.
    function choice_in_words(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text

        text = ""
        if (size(model%chosen_by) + size(model%group) < 2) return
        if (any(model%chosen_by == by_nothing) .or. any(model%group%chosen_by == by_nothing)) &
            text = "; nothing says how the loops before them close (linkdyn assemblies lists what does)"
    end function choice_in_words

    !> What a change point is, and why it is not passed.
    function meeting_in_words(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text

        text = ": two assemblies meet"
        if (model%scene%passes_change_points) then
            text = text//" that cannot be told apart"
        else
            text = text//" (change_points = ""stop"")"
        end if
    end function meeting_in_words

    !> The closed form that cannot be closed at the end of the way, else what was at fault on the way; 0: none in particular.
    integer function failing_step_of(model, lost) result(i)
        type(model_type), intent(in) :: model
        type(lost_way), intent(in) :: lost
        type(kinematic_state) :: state

        call prepare_kinematics(model, 0, state)
        state%q = spread(lost%to, 1, lanes)
        if (model%n_branch > 0) state%branch = spread(lost%branch, 1, lanes)
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (step%kind == step_group) exit
                call run_step(model, step, state)
                if (state%unreachable(1)) return
            end associate
        end do
        i = step_of_map(model, lost%map)
    end function failing_step_of

    !> Where a way ended: the coordinate that changes on it, and how far before the sample, or how much of the way.
    function place_in_words(model, lost) result(text)
        type(model_type), intent(in) :: model
        type(lost_way), intent(in) :: lost
        character(len=:), allocatable :: text
        integer :: k

        k = findloc(lost%from /= lost%to, .true., dim=1)
        if (k > 0 .and. count(lost%from /= lost%to) == 1) then
            text = end_of_way(model, lost, k)//", " &
                   //with_unit(model, k, abs((1 - lost%reached)*(lost%to(k) - lost%from(k))))//" before the sample"
        else if (k > 0) then
            text = to_text(nint(100*lost%reached))//" % of the way from the sample before"
        else
            text = "the start"
        end if
    end function place_in_words

    !> "131.2 deg", "0.25 m"
    function with_unit(model, k, value) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: k                         !! coordinate
        real(wp), intent(in) :: value
        character(len=:), allocatable :: text

        if (is_length(model, k)) then
            text = to_text(value)//" m"
        else
            text = to_text(value*180/pi)//" deg"
        end if
    end function with_unit

    !> "J1 = 67.1 deg" where a way ended on which one coordinate changes.
    function end_of_way(model, lost, k) result(text)
        type(model_type), intent(in) :: model
        type(lost_way), intent(in) :: lost
        integer, intent(in) :: k                         !! coordinate
        character(len=:), allocatable :: text

        text = trim(model%scene%coordinate(k)%name)//" = " &
               //with_unit(model, k, lost%from(k) + lost%reached*(lost%to(k) - lost%from(k)))
    end function end_of_way

    !> "; they close from A = -131.2 deg to 131.2 deg", if one coordinate alone moves the links.
    function range_in_words(model, lost, i) result(text)
        type(model_type), intent(in) :: model
        type(lost_way), intent(in) :: lost
        integer, intent(in) :: i                         !! step that fails; 0: not known
        character(len=:), allocatable :: text
        real(wp), parameter :: seen = 1.0e-3_wp          !! of a stride, the least range that is told
        real(wp) :: lowest(1), highest(1)
        logical :: is_limited(1)
        integer :: k, link

        text = ""
        if (i == 0) return
        if (model%step(i)%kind == step_group) then
            link = model%group(model%step(i)%first)%link(1)
        else
            link = model%step(i)%link(1)
        end if
        if (count(model%moves(:, link)) /= 1) return
        k = findloc(model%moves(:, link), .true., dim=1)
        if (lost%reached > 0) then
            call find_reach(model, [k], lost%from, lost%branch, lost%place, lowest, highest, is_limited)
            ! From the very end no way may lead back.
            if (is_limited(1) .and. highest(1) - lowest(1) > seen*model%stride(k)) &
                text = "; they close "//reach_in_words(model, k, lowest(1), highest(1))
        end if
    end function range_in_words

    !> "from A = -131.2 deg to 131.2 deg"
    function reach_in_words(model, k, lowest, highest) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: k                         !! coordinate
        real(wp), intent(in) :: lowest, highest
        character(len=:), allocatable :: text

        text = "from "//trim(model%scene%coordinate(k)%name)//" = "//with_unit(model, k, lowest)//" to " &
               //with_unit(model, k, highest)
    end function reach_in_words
end module linkdyn_failure
