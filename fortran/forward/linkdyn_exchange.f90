!> Coordinates exchanged for other joint variables, in the course of a forward run.
!>
!> A choice names, for each coordinate of the scene, the joint variable that stands in for it, or 0. The scene of a
!> choice is the user's with these coordinates instead, its links starting where they are at that instant, so that it is
!> planned and assembled as any scene.
!>
!> **Source**: coordinate partitioning: Wehage, Haug, J. Mech. Design 104 (1982) 247.
module linkdyn_exchange
    use linkdyn_coordinate_watch, only: coordinate_watch, grows
    use linkdyn_joint_motion, only: variables_of_relative
    use linkdyn_joint_table, only: is_slide, joint_spherical
    use linkdyn_joint_rates, only: measure_variable
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, link_position, link_rotation
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, orientation_of, scene_size
    use linkdyn_scene, only: scene_type, coordinate_joint, variable_name, frame_link, law_none
    use linkdyn_vec3, only: identity_mat3, zero_vec3
    use linkdyn_whole_turns, only: with_turns
    implicit none (type, external)
    private
    public :: list_choices, exchange_scene, coordinate_now, number_iterated, is_same_place, choice_names

    real(wp), parameter :: near_best = 0.25_wp     !! ratio of a joint to be considered, to the best
    integer, parameter :: most_choices = 12

contains

    !> What may be chosen instead of a choice, best first: hinges and slides on the frame before others, then by speed.
    subroutine list_choices(own, watch, choice, least_ratio, choices)
        type(model_type), intent(in) :: own              !! with the user's coordinates
        type(coordinate_watch), intent(in) :: watch      !! has looked
        integer, intent(in) :: choice(:)                 !! in use (n_q)
        real(wp), intent(in) :: least_ratio              !! of speeds that makes an exchange worth while
        integer, allocatable, intent(out) :: choices(:, :)    !! (n_q, n)
        real(wp) :: merit(size(watch%ratio, 1), size(watch%ratio, 2)), bar
        integer :: best(2), n, v

        merit = abs(watch%ratio)
        bar = max(least_ratio, near_best*maxval(merit))
        where (.not. (merit >= bar .and. merit <= huge(bar))) merit = 0
        ! A joint that does not grow faster with the others will soon be at a dead point of its own.
        if (any(merit > 0 .and. grows(watch%ratio, watch%before))) then
            where (.not. grows(watch%ratio, watch%before)) merit = 0
        end if
        bar = 2*maxval(merit)
        do v = 1, size(merit, 1)
            if (.not. any(own%joint(watch%joint(v))%link == frame_link)) cycle
            where (merit(v, :) > 0) merit(v, :) = merit(v, :) + bar
        end do
        allocate (choices(size(choice), min(most_choices, count(merit > 0))))
        do n = 1, size(choices, 2)
            best = maxloc(merit)
            choices(:, n) = exchanged(own, choice, best(2), best(1))
            merit(best(1), best(2)) = 0
        end do
    end subroutine list_choices

    !> The choice with a joint variable in the place of a coordinate. A coordinate of the user's comes back to its own.
    pure function exchanged(own, choice, k, variable) result(changed)
        type(model_type), intent(in) :: own
        integer, intent(in) :: choice(:), k, variable
        integer :: changed(size(choice))
        integer :: i

        changed = choice
        changed(k) = variable
        do i = 1, size(choice)
            associate (c => own%scene%coordinate(i))
                if (c%kind /= coordinate_joint) cycle
                if (own%joint(c%joint)%first_variable + c%variable /= variable) cycle
                changed(k) = merge(choice(i), 0, i /= k)
                changed(i) = 0
            end associate
        end do
    end function exchanged

    !> The joint of a joint variable, and the variable's number there.
    pure function place_of(model, variable) result(place)
        type(model_type), intent(in) :: model
        integer, intent(in) :: variable
        integer :: place(2)

        place(1) = count(model%joint%first_variable < variable)
        place(2) = variable - model%joint(place(1))%first_variable
    end function place_of

    !> A coordinate of the user's at the position reached, and its rate. Angles count turns, or leave them apart.
    subroutine coordinate_now(own, model, state, k, value, rate, turns, lane)
        type(model_type), intent(in) :: own
        type(model_type), intent(in) :: model            !! in use
        type(kinematic_state), intent(in) :: state       !! of it
        integer, intent(in) :: k
        real(wp), intent(out) :: value, rate
        real(wp), intent(out), optional :: turns         !! which are then not in the value
        integer, intent(in), optional :: lane            !! absent: the first
        real(wp), dimension(lanes) :: values, rates, whole
        integer :: on

        if (model%scene%coordinate(k)%for_joint == 0) then
            call given_coordinate(model, state, k, values, rates, whole)
        else
            associate (c => own%scene%coordinate(k))
                call measure_variable(model, state, c%joint, c%variable, state%counted(:, k), values, rates, whole)
            end associate
        end if
        on = 1
        if (present(lane)) on = lane
        rate = rates(on)
        if (present(turns)) then
            value = values(on)
            turns = whole(on)
        else
            value = with_turns(values(on), whole(on))
        end if
    end subroutine coordinate_now

    !> A coordinate in use, its rate and turns; an angle of an attitude that comes as quaternion is measured.
    subroutine given_coordinate(model, state, k, value, rate, turns)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: k
        real(wp), intent(out), dimension(lanes) :: value, rate, turns
        real(wp), dimension(lanes, 3) :: angles, angle_rates

        associate (c => model%scene%coordinate(k))
            if (c%kind == coordinate_joint) then
                call measure_variable(model, state, c%joint, c%variable, state%counted(:, k), value, rate, turns)
            else
                value = state%q(:, k)
                rate = state%qd(:, k)
                turns = state%turns(:, k)
                if (.not. model%is_planar .and. c%variable > 3) then
                    call attitude_of(model, state, c%link, angles, angle_rates)
                    value = angles(:, c%variable - 3)
                    rate = angle_rates(:, c%variable - 3)
                end if
            end if
        end associate
    end subroutine given_coordinate

    !> Roll, pitch, yaw of a link and their rates.
    subroutine attitude_of(model, state, l, angles, rates)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: l
        real(wp), intent(out) :: angles(lanes, 3), rates(lanes, 3)

        associate (o => orientation_of(model, l))
            call variables_of_relative(joint_spherical, identity_mat3(), state%rotation(o), zero_vec3(), zero_vec3(), &
                                       state%omega(o), angles, rates)
        end associate
    end subroutine attitude_of

    !> The scene of a choice, starting at the position reached; angles without the turns that they have made.
    subroutine exchange_scene(own, choice, model, state, scene)
        type(model_type), intent(in) :: own
        integer, intent(in) :: choice(:)                 !! (n_q)
        type(model_type), intent(in) :: model            !! in use
        type(kinematic_state), intent(in) :: state       !! of it
        type(scene_type), intent(out) :: scene
        real(wp), dimension(lanes) :: value, rate, zero
        real(wp) :: turns
        integer :: k, l, place(2)

        zero = 0
        scene = own%scene
        do k = 1, own%n_q
            associate (c => scene%coordinate(k))
                call coordinate_now(own, model, state, k, c%start_position, c%start_velocity, turns)
                c%has_start = .true.
                if (.not. c%is_driven) c%motion%kind = law_none
                if (choice(k) == 0) cycle
                place = place_of(own, choice(k))
                c%for_joint = c%joint
                c%for_variable = c%variable
                c%joint = place(1)
                c%variable = place(2)
                c%name = name_of(own, choice(k))
                c%unit = merge("m   ", "rad ", is_slide(own%joint(c%joint)%kind, c%variable))
                call measure_variable(model, state, c%joint, c%variable, zero, value, rate)
                c%start_position = value(1)
                c%start_velocity = rate(1)
            end associate
        end do
        do l = 1, own%n_link
            scene%link(l)%has_start = .true.
            scene%link(l)%start = [link_position(model, state, l, 1), angles_of(model, state, l)]
        end do
        ! A branch that the user forced is one of the user's dyads, and of the start.
        scene%joint%branch = 0
        scene%joint%has_start = .false.
    end subroutine exchange_scene

    !> Roll, pitch, yaw of a link on lane 1.
    function angles_of(model, state, l) result(angle)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: l
        real(wp) :: angle(3)
        real(wp), dimension(lanes, 3) :: angles, rates

        if (model%is_planar) then
            associate (r => state%plane%rotation(orientation_of(model, l)))
                angle = [0.0_wp, 0.0_wp, atan2(r%s(1), r%c(1))]
            end associate
        else
            call attitude_of(model, state, l, angles, rates)
            angle = angles(1, :)
        end if
    end function angles_of

    !> Links that are placed by iteration.
    pure integer function number_iterated(model) result(n)
        type(model_type), intent(in) :: model
        integer :: g

        n = 0
        do g = 1, size(model%group)
            n = n + size(model%group(g)%link)
        end do
    end function number_iterated

    !> Do two programs of one mechanism place its links alike, on lane 1? Of links that spin idly that is the line about which they
    !> do.
    pure logical function is_same_place(model, a, b) result(is_same)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: a, b
        real(wp), parameter :: fit = sqrt(epsilon(1.0_wp))
        real(wp) :: off(3), turn(3, 3)
        integer :: l

        is_same = .true.
        do l = 1, model%n_link
            off = link_position(model, a, l, 1) - link_position(model, b, l, 1)
            turn = link_rotation(model, a, l, 1) - link_rotation(model, b, l, 1)
            if (model%link(l)%spin > 0) then
                off = off + matmul(turn, model%link(l)%spin_point)
                turn = spread(matmul(turn, model%link(l)%spin_axis), 2, 3)
            end if
            is_same = is_same .and. all(abs(off) <= fit*scene_size(model)) .and. all(abs(turn) <= fit)
        end do
    end function is_same_place

    !> The coordinates of a choice in words: "angle of J1 and slide of D".
    function choice_names(own, choice) result(text)
        type(model_type), intent(in) :: own
        integer, intent(in) :: choice(:)
        character(len=:), allocatable :: text
        integer :: k

        text = ""
        do k = 1, own%n_q
            associate (c => own%scene%coordinate(k))
                if (c%is_driven) cycle
                if (len(text) > 0) text = text//" and "
                if (choice(k) > 0) then
                    text = text//name_of(own, choice(k))
                else if (c%kind == coordinate_joint .and. c%joint <= own%n_joint) then
                    text = text//name_of(own, own%joint(c%joint)%first_variable + c%variable)
                else
                    text = text//trim(c%name)
                end if
            end associate
        end do
    end function choice_names

    !> "slide of D"
    function name_of(model, variable) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: variable
        character(len=:), allocatable :: text
        integer :: place(2)

        place = place_of(model, variable)
        associate (joint => model%joint(place(1)))
            text = trim(variable_name(place(2), joint%kind))//" of "//trim(joint%name)
        end associate
    end function name_of
end module linkdyn_exchange
