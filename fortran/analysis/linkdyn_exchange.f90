!> Coordinates exchanged for other joint variables of a planar mechanism, in the course of a forward run.
!>
!> A choice names, for each coordinate of the scene, the joint whose variable stands in for it, or 0. The scene of a
!> choice is the user's with these coordinates instead, its links starting where they are at that instant, so that it is
!> planned and assembled as any scene.
!>
!> **Source**: coordinate partitioning: Wehage, Haug, J. Mech. Design 104 (1982) 247.
module linkdyn_exchange
    use linkdyn_coordinate_watch, only: coordinate_watch
    use linkdyn_joint_rates, only: measure_variable
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, link_position
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, orientation_of
    use linkdyn_planar_rates, only: measure_planar_variable
    use linkdyn_scene, only: scene_type, coordinate_spec, coordinate_joint, joint_prismatic, frame_link, law_none
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
        integer :: best(2), n

        merit = abs(watch%ratio)
        bar = max(least_ratio, near_best*maxval(merit))
        where (.not. (merit >= bar .and. merit <= huge(bar))) merit = 0
        bar = 2*maxval(merit)
        do n = 1, own%n_joint
            if (.not. any(own%joint(n)%link == frame_link)) cycle
            where (merit(n, :) > 0) merit(n, :) = merit(n, :) + bar
        end do
        allocate (choices(size(choice), min(most_choices, count(merit > 0))))
        do n = 1, size(choices, 2)
            best = maxloc(merit)
            choices(:, n) = exchanged(own, choice, best(2), best(1))
            merit(best(1), best(2)) = 0
        end do
    end subroutine list_choices

    !> The choice with a joint in the place of a coordinate. A coordinate of the user's comes back to its own place.
    pure function exchanged(own, choice, k, joint) result(changed)
        type(model_type), intent(in) :: own
        integer, intent(in) :: choice(:), k, joint
        integer :: changed(size(choice))
        integer :: i

        changed = choice
        do i = 1, size(choice)
            associate (c => own%scene%coordinate(i))
                if (c%kind /= coordinate_joint .or. c%joint /= joint) cycle
                changed(k) = merge(choice(i), 0, i /= k)
                changed(i) = 0
                return
            end associate
        end do
        changed(k) = joint
    end function exchanged

    !> A coordinate of the user's at the position reached, and its rate, on lane 1. Angles count turns.
    subroutine coordinate_now(own, model, state, k, value, rate)
        type(model_type), intent(in) :: own
        type(model_type), intent(in) :: model            !! in use
        type(kinematic_state), intent(in) :: state       !! of it
        integer, intent(in) :: k
        real(wp), intent(out) :: value, rate
        real(wp), dimension(lanes) :: values, rates

        if (model%scene%coordinate(k)%for_joint == 0) then
            value = state%q(1, k)
            rate = state%qd(1, k)
            return
        end if
        associate (c => own%scene%coordinate(k))
            call measure_variable(model, state, c%joint, c%variable, state%counted(:, k), values, rates)
        end associate
        value = values(1)
        rate = rates(1)
    end subroutine coordinate_now

    !> The scene of a choice, starting at the position reached.
    subroutine exchange_scene(own, choice, model, state, scene)
        type(model_type), intent(in) :: own
        integer, intent(in) :: choice(:)                 !! (n_q)
        type(model_type), intent(in) :: model            !! in use
        type(kinematic_state), intent(in) :: state       !! of it
        type(scene_type), intent(out) :: scene
        real(wp), dimension(lanes) :: value, rate
        integer :: k, l

        scene = own%scene
        do k = 1, own%n_q
            associate (c => scene%coordinate(k))
                call coordinate_now(own, model, state, k, c%start_position, c%start_velocity)
                if (choice(k) > 0) then
                    c%for_joint = c%joint
                    c%for_variable = c%variable
                    c%name = own%joint(choice(k))%name
                    c%unit = merge("m   ", "rad ", own%joint(choice(k))%kind == joint_prismatic)
                    c%joint = choice(k)
                    c%variable = 1
                    call measure_planar_variable(model, state, c%joint, value, rate)
                    c%start_position = value(1)
                    c%start_velocity = rate(1)
                end if
                c%has_start = .true.
                if (.not. c%is_driven) c%motion%kind = law_none
            end associate
        end do
        do l = 1, own%n_link
            scene%link(l)%has_start = .true.
            scene%link(l)%start = 0
            scene%link(l)%start(:3) = link_position(model, state, l, 1)
            associate (r => state%plane%rotation(orientation_of(model, l)))
                scene%link(l)%start(6) = atan2(r%s(1), r%c(1))
            end associate
        end do
        ! A branch that the user forced is one of the user's dyads, and of the start.
        scene%joint%branch = 0
        scene%joint%has_start = .false.
    end subroutine exchange_scene

    !> Links that are placed by iteration.
    pure integer function number_iterated(model) result(n)
        type(model_type), intent(in) :: model
        integer :: g

        n = 0
        do g = 1, size(model%group)
            n = n + size(model%group(g)%link)
        end do
    end function number_iterated

    !> Do two programs of one mechanism place its links alike, on lane 1?
    pure logical function is_same_place(model, a, b) result(is_same)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: a, b
        real(wp), parameter :: fit = sqrt(epsilon(1.0_wp))
        real(wp) :: extent, gap
        integer :: l

        extent = 0
        gap = 0
        do l = 1, model%n_joint
            extent = max(extent, maxval(abs(model%joint(l)%point)))
        end do
        do l = 1, model%n_link
            gap = max(gap, maxval(abs(link_position(model, a, l, 1) - link_position(model, b, l, 1))))
        end do
        is_same = gap <= fit*extent
        do l = 1, model%n_link
            associate (o => orientation_of(model, l))
                is_same = is_same .and. abs(a%plane%rotation(o)%c(1) - b%plane%rotation(o)%c(1)) <= fit &
                          .and. abs(a%plane%rotation(o)%s(1) - b%plane%rotation(o)%s(1)) <= fit
            end associate
        end do
    end function is_same_place

    !> The coordinates of a choice in words: "angle of J1, slide of D".
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
                    text = text//what(choice(k))//trim(own%joint(choice(k))%name)
                else if (c%kind == coordinate_joint) then
                    text = text//what(c%joint)//trim(own%joint(c%joint)%name)
                else
                    text = text//trim(c%name)
                end if
            end associate
        end do

    contains

        function what(joint) result(text)
            integer, intent(in) :: joint
            character(len=:), allocatable :: text

            text = trim(merge("slide", "angle", own%joint(joint)%kind == joint_prismatic))//" of "
        end function what
    end function choice_names
end module linkdyn_exchange
