!> The assembly of a group at the start, found by many attempts side by side on the lanes.
!>
!> Where something has a start, attempts around that come first: links with a starting position at or near it, others hung on
!> them by joints. Of the rest the first sets out from the starting positions of the links, the second from links strung along
!> the joints with the joints' starting variables, but those that have a starting position there and legs between such point to
!> where they end (`linkdyn_pointed_links`). With threads the third sets out from the starting positions as the links that are
!> placed have taken them along (`linkdyn_drawn_links`). The others set out from variables at random. Each is
!> closed by Newton's method; of the assemblies found the one nearest to what the scene says of the start is taken
!> (`linkdyn_start_distance`). Where none closes, a Delta led by its tool whose elbows nobody has described, there are more rounds
!> of attempts. The outcome depends on the scene alone.
module linkdyn_group_start
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_constants, only: pi
    use linkdyn_cross, only: cross
    use linkdyn_drawn_links, only: hang_as_drawn
    use linkdyn_led_coordinates, only: given_position
    use linkdyn_joint_motion, only: relative_motion, relative_by_variables, first_by_variables, turn_frame, turn_frame_back
    use linkdyn_joint_table, only: is_slide, is_threaded, is_pose_part, turns_about_point, joint_prismatic
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: clear_flags, run_step
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_lock, only: lend_texts, take_texts_back
    use linkdyn_hash, only: counter_uniform
    use linkdyn_model, only: model_type, group_type, step_type, orientation_of, side_of, place_size, scene_size
    use linkdyn_motion_measures, only: released_fit
    use linkdyn_newton_attempts, only: close_attempts, look_at_place
    use linkdyn_pointed_links, only: point_links
    use linkdyn_quaternion, only: quaternion_of_rpy, quaternion_of_rotation, rotation_of_quaternion, turned_vector
    use linkdyn_scene, only: joint_n_variable, coordinate_joint, pose_position, frame_link
    use linkdyn_start_distance, only: start_distance, measure_distance, is_nearer, has_start
    use linkdyn_vec2, only: vec2, rot2, rot2_by_angle, rot2_of_directions, operator(+), operator(-), operator(*), operator(.rotate.)
    use linkdyn_vec3, only: mat3, vec3, vec3_of, operator(+), operator(-), operator(.rotate.)
    implicit none (type, external)
    private
    public :: find_group_start, find_every_start, take_group_start, is_alike

    integer, parameter :: n_attempt = 64
    integer, parameter :: n_near = 64            !! a round around what has a start; all are numbered up to 0
    integer, parameter :: n_hopeful = 8          !! rounds of so many attempts, as long as none closes
    real(wp), parameter :: exact = 1.0e-12_wp    !! distance that is none

    !> What attempts have come to.
    type :: found_assemblies
        integer :: n = 0
        logical :: apart_by_lines = .false.                !! only those are listed whose joints lie on other lines
        real(wp), allocatable :: place(:, :, :)            !! of each (place_size, n_link, assembly)
        real(wp), allocatable :: distance(:, :)            !! of each: given, others (2, assembly)
        real(wp), allocatable :: nearest(:, :)             !! of the nearest; while there is none, where the first attempt that
                                                           !! closes what is not let go has come to
        logical :: any_closed = .false.                    !! has one?
        real(wp) :: given = huge(1.0_wp)                   !! how far that is: see `start_distance`
        real(wp) :: others = huge(1.0_wp)
    end type found_assemblies

contains

    !> Leave the group closed on every lane of the state; flagged `not_converged` if no attempt succeeds.
    subroutine find_group_start(model, step, passed_over, state, n_found)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        integer, intent(in) :: passed_over                 !! nearer ones that will not do
        type(kinematic_state), intent(inout) :: state      !! the steps before have been run, all lanes alike
        integer, intent(out) :: n_found                    !! assemblies among which there was the choice; 0: not looked for
        type(found_assemblies) :: found
        real(wp) :: start(place_size(model), model%n_link, n_attempt)
        logical :: is_known
        integer :: round, closing

        ! Nothing is nearer than what the scene describes in full.
        is_known = all(model%scene%link(model%group(step%first)%link)%has_start)
        if (is_known) then
            call list_attempts(model, model%group(step%first), 1, state, start(:, :, :1))
            call make_attempts(model, step%first, start(:, :, :1), state, found)
            is_known = found%given <= exact
        end if
        if (.not. is_known) then
            found = found_assemblies()
            ! threads that are a turn on leave links nearly where they are: nearness does not tell what is meant
            if (model%group(step%first)%n_thread == 0 .and. has_start(model, model%group(step%first)%link, &
                                                                      model%group(step%first)%joint)) &
                call look_near(model, step%first, state, found)
            closing = n_hopeful
            do round = 1, 2*n_hopeful
                call list_attempts(model, model%group(step%first), 1 + (round - 1)*n_attempt, state, start)
                call make_attempts(model, step%first, start, state, found)
                if (found%any_closed) closing = min(closing, round)
                ! what has come once may not be the nearest: as many rounds again
                if (round == 1 .and. found%any_closed) exit
                if (round >= merge(2*closing, n_hopeful, found%any_closed)) exit
            end do
        end if
        n_found = merge(0, found%n, is_known)
        ! What is let go may hold links that are placed later, or fit with another branch of the steps before: who has placed all
        ! will see.
        if (passed_over > 0) call pass_over(found, passed_over)
        if (found%any_closed) then
            state%group%place = spread(found%nearest, 1, lanes)
            call clear_flags(state)
            call run_step(model, step, state)
        else
            state%not_converged = .true.
        end if
    end subroutine find_group_start

    !> Attempts around what has a start, as long as they come nearer to it.
    subroutine look_near(model, g, state, found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g                           !! the group's number
        type(kinematic_state), intent(inout) :: state
        type(found_assemblies), intent(inout) :: found
        integer, parameter :: patience = 3, most_rounds = 12
        real(wp) :: start(place_size(model), model%n_link, n_near), before
        integer :: round, last_nearer

        last_nearer = 1
        do round = 1, most_rounds
            before = found%given
            call list_attempts(model, model%group(g), 1 - round*n_near, state, start)
            call make_attempts(model, g, start, state, found)
            if (found%given < before) last_nearer = round
            if (found%given <= exact .or. round - last_nearer == patience) exit
        end do
    end subroutine look_near

    !> The nearest of those that are left when so many nearer ones are not.
    pure subroutine pass_over(found, passed_over)
        type(found_assemblies), intent(inout) :: found
        integer, intent(in) :: passed_over
        logical :: is_left(found%n)
        type(start_distance) :: distance
        integer :: turn, i, best

        is_left = .true.
        do turn = 0, min(passed_over, found%n - 1)
            best = 0
            found%given = huge(1.0_wp)
            found%others = huge(1.0_wp)
            do i = 1, found%n
                if (.not. is_left(i)) cycle
                distance%given = found%distance(1, i)
                distance%others = found%distance(2, i)
                if (best > 0 .and. .not. is_nearer(distance, 1, found%given, found%others)) cycle
                best = i
                found%given = found%distance(1, i)
                found%others = found%distance(2, i)
            end do
            is_left(best) = .false.
            found%nearest = found%place(:, :, best)
        end do
    end subroutine pass_over

    !> All assemblies of a group: attempts go on until those that found none number several times those before. Assemblies that
    !> differ by links turned about their own lines alone, as legs are between a universal joint and a ball, count as one.
    subroutine find_every_start(model, step, state, place, is_exhausted)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state      !! the steps before have been run, all lanes alike
        real(wp), allocatable, intent(out) :: place(:, :, :)    !! of the links of each (place_size, n_link, assembly)
        logical, intent(out) :: is_exhausted               !! nothing new has come for long
        integer, parameter :: patience = 8, most_rounds = 256
        type(found_assemblies) :: found
        real(wp) :: start(place_size(model), model%n_link, n_attempt)
        integer :: round, last_new, n_before

        found%apart_by_lines = .true.
        last_new = 1
        do round = 1, most_rounds
            n_before = found%n
            call list_attempts(model, model%group(step%first), 1 + (round - 1)*n_attempt, state, start)
            call make_attempts(model, step%first, start, state, found)
            if (found%n > n_before) last_new = round
            is_exhausted = round >= patience*last_new
            if (is_exhausted) exit
        end do
        place = found%place(:, :, :found%n)
    end subroutine find_every_start

    !> Lead attempts as far as they go, and look at where they come to.
    subroutine make_attempts(model, g, start, state, found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g                           !! the group's number
        real(wp), intent(in) :: start(:, :, :)             !! (place_size, n_link, attempt)
        type(kinematic_state), intent(inout) :: state
        type(found_assemblies), intent(inout) :: found     !! and what others have come to
        real(wp) :: place(size(start, 1), size(start, 2), size(start, 3))
        logical :: has_arrived(size(start, 3))
        integer :: first, last
        integer :: lent                                 ! of the lock of texts

        lent = lend_texts()
        if (.not. allocated(found%place)) then
            found%place = start(:, :, :0)
            allocate (found%distance(2, 0))
        end if
        place = start
        call close_attempts(model, g, place, state, has_arrived)
        if (any(has_arrived) .and. .not. found%any_closed) found%nearest = place(:, :, findloc(has_arrived, .true., dim=1))
        found%any_closed = found%any_closed .or. any(has_arrived)
        do first = 1, size(place, 3), lanes
            last = min(first + lanes - 1, size(place, 3))
            if (any(has_arrived(first:last))) &
                call note_assemblies(model, g, place(:, :, first:last), has_arrived(first:last), state, found)
        end do
        call take_texts_back(lent)
    end subroutine make_attempts

    !> Where links are at first, attempt by attempt.
    subroutine list_attempts(model, group, first_attempt, state, place)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: first_attempt
        type(kinematic_state), intent(inout) :: state
        real(wp), intent(out) :: place(:, :, :)            !! (place_size, n_link, attempt)
        integer :: first, lane

        do first = 1, size(place, 3), lanes
            call string_links(model, group, first_attempt + first - 1, state)
            do lane = 1, min(lanes, size(place, 3) - first + 1)
                associate (attempt => first_attempt + first + lane - 2)
                    if (any(attempt == [1, 2])) call put_as_given(model, group, lane, attempt == 1, state)
                    if (attempt == 2 .and. .not. model%is_planar) call point_links(model, group, lane, state)
                    if (attempt == 3 .and. group%n_thread > 0) call hang_as_drawn(model, group, lane, state)
                end associate
                place(:, :, first + lane - 1) = state%group%place(lane, :, :)
            end do
        end do
    end subroutine list_attempts

    !> Note the attempts that have arrived somewhere, at most as many as there are lanes: assemblies that are new, and the nearest
    !> so far.
    subroutine note_assemblies(model, g, place, has_arrived, state, found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g                           !! the group's number
        real(wp), intent(in), contiguous :: place(:, :, :) !! (place_size, n_link, attempt)
        logical, intent(in) :: has_arrived(:)              !! (attempt)
        type(kinematic_state), intent(inout) :: state
        type(found_assemblies), intent(inout) :: found
        type(start_distance) :: distance
        logical :: fits(lanes)
        integer :: lane

        associate (group => model%group(g))
            do lane = 1, lanes
                ! lanes to spare repeat the last attempt
                state%group%place(lane, :, :) = place(:, :, min(lane, size(place, 3)))
            end do
            call clear_flags(state)
            call look_at_place(model, g, state)
            fits = .not. state%not_converged .and. released_fit(model, group%joint, state)
            distance = measure_distance(model, group%link, group%joint, state, .false.)
            do lane = 1, size(place, 3)
                if (.not. (has_arrived(lane) .and. fits(lane))) cycle
                if (is_new(model, group, place(:, :, lane), found)) &
                    call add(place(:, :, lane), [distance%given(lane), distance%others(lane)])
                if (.not. is_nearer(distance, lane, found%given, found%others)) cycle
                ! the first attempt that comes there has the spins that are nearest to what is said of them
                if (found%given < huge(1.0_wp)) then
                    if (is_same(model, group, place(:, :, lane), found%nearest)) cycle
                end if
                found%given = distance%given(lane)
                found%others = distance%others(lane)
                found%nearest = place(:, :, lane)
            end do
        end associate

    contains

        subroutine add(new, apart)
            real(wp), intent(in) :: new(:, :), apart(2)
            real(wp), allocatable :: more(:, :, :), farther(:, :)

            if (found%n == size(found%place, 3)) then
                allocate (more(size(new, 1), size(new, 2), 2*found%n + 4), farther(2, 2*found%n + 4))
                more(:, :, :found%n) = found%place
                farther(:, :found%n) = found%distance
                call move_alloc(more, found%place)
                call move_alloc(farther, found%distance)
            end if
            found%n = found%n + 1
            found%place(:, :, found%n) = new
            found%distance(:, found%n) = apart
        end subroutine add
    end subroutine note_assemblies

    !> As `find_group_start`, by the places that were found for a model that stands likewise; nothing, if it has none, or these do
    !> not close here.
    subroutine take_group_start(model, step, like, state, n_found, is_known)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(model_type), intent(in) :: like
        type(kinematic_state), intent(inout) :: state
        integer, intent(out) :: n_found
        logical, intent(out) :: is_known
        real(wp) :: place(place_size(model), model%n_link)
        integer :: g, i

        n_found = 0
        associate (group => model%group(step%first))
            do i = 1, size(group%link)
                is_known = .false.
                do g = 1, size(like%group)
                    associate (other => like%group(g))
                        if (all(other%link /= group%link(i))) cycle
                        place(:, group%link(i)) = other%start(:, findloc(other%link, group%link(i), dim=1))
                        n_found = max(n_found, other%n_found)
                        is_known = .true.
                    end associate
                end do
                if (.not. is_known) return
            end do
            state%group%place = spread(place, 1, lanes)
            call clear_flags(state)
            call run_step(model, step, state)
            is_known = .not. (state%not_converged(1) .or. state%singular(1))
            if (is_known) is_known = is_same(model, group, state%group%place(1, :, :), place)
        end associate
    end subroutine take_group_start

    !> Is an assembly none of those found?
    pure logical function is_new(model, group, place, found)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: place(:, :)            !! (place_size, n_link)
        type(found_assemblies), intent(in) :: found
        integer :: i

        is_new = .true.
        do i = 1, found%n
            if (found%apart_by_lines) then
                is_new = .not. is_alike(model, group, place, found%place(:, :, i))
            else
                is_new = .not. is_same(model, group, place, found%place(:, :, i))
            end if
            if (.not. is_new) return
        end do
    end function is_new

    !> Do all joints lie on the same lines, whichever way round, and at the same points? So do those of the same assembly, and of
    !> one whose legs are turned about themselves.
    pure logical function is_alike(model, group, a, b)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in), contiguous :: a(:, :), b(:, :)    !! (place_size, n_link)
        real(wp), parameter :: fit = 1.0e-6_wp
        real(wp) :: apart(3)
        integer :: i, k, l

        is_alike = is_same(model, group, a, b)
        if (is_alike .or. model%is_planar) return
        is_alike = .true.
        do i = 1, size(group%link)
            l = group%link(i)
            do k = model%first_at(l), model%first_at(l + 1) - 1
                associate (joint => model%joint(model%joint_at(k)), side => side_of(model%joint(model%joint_at(k)), l))
                    apart = a(:3, l) + turned_vector(a(4:, l), joint%point(:, side)) &
                            - b(:3, l) - turned_vector(b(4:, l), joint%point(:, side))
                    is_alike = is_alike .and. all(abs(apart) <= fit*scene_size(model))
                    if (turns_about_point(joint%told_kind)) cycle
                    apart = cross(turned_vector(a(4:, l), joint%frame(:, 3, side)), &
                                  turned_vector(b(4:, l), joint%frame(:, 3, side)))
                    is_alike = is_alike .and. all(abs(apart) <= fit)
                end associate
            end do
            if (.not. is_alike) return
        end do
    end function is_alike

    !> Do two attempts leave the group's links in the same places? (Contiguous, since gfortran 12 hands on parts of a strided array
    !> that has another name as if it were.)
    pure logical function is_same(model, group, a, b)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in), contiguous :: a(:, :), b(:, :)    !! (place_size, n_link)
        real(wp), parameter :: fit = 1.0e-6_wp
        integer :: i

        is_same = .true.
        do i = 1, size(group%link)
            associate (u => a(:, group%link(i)), v => b(:, group%link(i)), link => model%link(group%link(i)))
                if (model%is_planar) then
                    is_same = is_same .and. are_near(u(:2), v(:2)) .and. 1 - cos(u(3) - v(3)) <= fit**2
                else if (link%spin > 0) then
                    ! however it has spun, its line is one
                    is_same = is_same .and. are_near(u(:3) + turned_vector(u(4:), link%spin_point), &
                                                     v(:3) + turned_vector(v(4:), link%spin_point)) &
                              .and. all(abs(turned_vector(u(4:), link%spin_axis) - turned_vector(v(4:), link%spin_axis)) <= fit)
                else
                    ! A quaternion and its opposite are one attitude.
                    is_same = is_same .and. are_near(u(:3), v(:3)) .and. 1 - abs(dot_product(u(4:), v(4:))) <= fit**2
                end if
            end associate
        end do

    contains

        pure logical function are_near(p, r)
            real(wp), intent(in) :: p(:), r(:)             !! [m]

            are_near = all(abs(p - r) <= fit*scene_size(model))
        end function are_near
    end function is_same

    !> Links at their starting positions; those without one stay, or are where their markers are written.
    subroutine put_as_given(model, group, lane, as_written, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: lane
        logical, intent(in) :: as_written
        type(kinematic_state), intent(inout) :: state
        real(wp) :: quaternion(lanes, 4)
        integer :: i

        do i = 1, size(group%link)
            associate (start => model%scene%link(group%link(i))%start, place => state%group%place(lane, :, group%link(i)))
                if (.not. (as_written .or. model%scene%link(group%link(i))%has_start)) cycle
                if (model%is_planar) then
                    place = start([1, 2, 6])
                else
                    quaternion = quaternion_of_rpy(spread(start(4), 1, lanes), spread(start(5), 1, lanes), &
                                                   spread(start(6), 1, lanes))
                    place = [start(:3), quaternion(1, :)]
                end if
            end associate
        end do
    end subroutine put_as_given

    ! ---------------------------------------------------------------- links along joints

    !> Attempts `first`, `first + 1`, ...: each link of the group placed through one of its joints. Near attempts begin with
    !> the links that have a starting position, and place others by joints that leave them few ways.
    subroutine string_links(model, group, first, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: first
        type(kinematic_state), intent(inout) :: state
        logical :: is_placed(0:model%n_link)
        integer :: i, round

        is_placed = .true.
        is_placed(group%link) = .false.
        state%group%place = 0
        if (.not. model%is_planar) state%group%place(:, 4, :) = 1
        if (first <= 0) then
            do i = 1, size(group%link)
                if (.not. model%scene%link(group%link(i))%has_start) cycle
                call put_near_start(model, group, group%link(i), first, state)
                is_placed(group%link(i)) = .true.
            end do
        end if
        do round = 1, size(group%link)
            if (first <= 0) then
                i = leaving_fewest_ways()
                if (i > 0) call hang_by(i)
            else
                do i = 1, size(group%joint)
                    call hang_by(i)
                end do
            end if
        end do
        do i = 1, size(group%link)
            if (is_led(model, group%link(i))) call put_led_link(model, group, group%link(i), first, state)
        end do

    contains

        !> The link on one side of joint i of the group from the one on the other side, if only that is placed.
        subroutine hang_by(i)
            integer, intent(in) :: i
            integer :: from

            if (.not. places_another(i)) return
            associate (j => group%joint(i), link => model%joint(group%joint(i))%link)
                from = merge(1, 2, is_placed(link(1)))
                if (model%is_planar) then
                    call hang_in_plane(model, group, j, link(3 - from), variables(i), state)
                else
                    call hang_link(model, group, j, from, variables(i), state)
                end if
                is_placed(link(3 - from)) = .true.
            end associate
        end subroutine hang_by

        pure logical function places_another(i)
            integer, intent(in) :: i

            associate (joint => model%joint(group%joint(i)))
                places_another = .not. (is_pose_part(joint%kind) .or. joint%cam > 0) &
                                 .and. (is_placed(joint%link(1)) .neqv. is_placed(joint%link(2)))
            end associate
        end function places_another

        !> The joint that leaves the next link fewest variables of which nothing is said; 0: none places another.
        pure integer function leaving_fewest_ways() result(best)
            integer :: i, v, n, fewest

            best = 0
            fewest = huge(1)
            do i = 1, size(group%joint)
                if (.not. places_another(i)) cycle
                associate (joint => model%joint(group%joint(i)))
                    n = 0
                    do v = 1, joint_n_variable(joint%told_kind)
                        if (.not. (joint%has_start .or. is_given(group%coordinate(v, i)))) n = n + 1
                    end do
                end associate
                if (n >= fewest) cycle
                fewest = n
                best = i
            end do
        end function leaving_fewest_ways

        !> Variables of joint i of the group: given by a coordinate, else its start, and beyond the second attempt some other, at
        !> first near the start, then anywhere. In near attempts anywhere where nothing is said of them.
        function variables(i) result(q)
            integer, intent(in) :: i
            real(wp) :: q(lanes, 3), reach, far
            integer :: v, lane, attempt

            q = 0
            associate (joint => model%joint(group%joint(i)))
                do v = 1, joint_n_variable(joint%told_kind)
                    if (is_given(group%coordinate(v, i))) then
                        q(:, v) = given_position(model, state, group%coordinate(v, i))
                        cycle
                    end if
                    reach = merge(scene_size(model), pi, is_slide(joint%told_kind, v))
                    if (is_threaded(joint%told_kind)) reach = scene_size(model)/abs(joint%pitch)
                    do lane = 1, lanes
                        attempt = first + lane - 1
                        far = how_far(attempt)
                        if (attempt <= 0 .and. attempt /= 1 - n_near .and. .not. joint%has_start) far = 1
                        q(lane, v) = joint%start(v) + reach*far &
                                     *(2*counter_uniform(int(group%joint(i), int64), int(v, int64), int(attempt, int64)) - 1)
                    end do
                end do
            end associate
        end function variables

        !> Is a joint variable given: by a coordinate, or by gears from joints that are placed before the group?
        pure logical function is_given(c)
            integer, intent(in) :: c
            integer :: s

            is_given = c > 0
            if (c <= model%n_q) return
            associate (source => model%led(c - model%n_q)%source)
                do s = 1, size(source)
                    is_given = is_given .and. all(group%joint /= source(s))
                end do
            end associate
        end function is_given
    end subroutine string_links

    !> Do coordinates lead the link, seen from the frame, by a part of its pose?
    pure logical function is_led(model, link)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        integer :: j

        is_led = .false.
        do j = model%n_joint + 1, size(model%joint)
            if (.not. is_pose_part(model%joint(j)%kind)) cycle
            is_led = is_led .or. all(model%joint(j)%link == [frame_link, link])
        end do
    end function is_led

    !> How far attempts go from the start, as a part of all that there is.
    pure real(wp) function how_far(attempt) result(far)
        integer, intent(in) :: attempt
        real(wp), parameter :: nearly = 0.3_wp             !! the farthest of the near ones

        far = 0
        if (attempt <= 0) far = nearly*real(modulo(attempt - 1, n_near), wp)/n_near
        if (attempt > 2) far = min(1.0_wp, 2*real(attempt, wp)/n_attempt)
    end function how_far

    !> The link's starting pose, and other ones, the farther from it the farther the attempts go.
    pure function poses_about_start(model, link, first) result(pose)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link, first
        real(wp) :: pose(lanes, 6)
        integer :: k, lane

        do k = 1, 6
            do lane = 1, lanes
                associate (attempt => first + lane - 1)
                    pose(lane, k) = model%scene%link(link)%start(k) + merge(scene_size(model), pi, k <= 3)*how_far(attempt) &
                                    *(2*counter_uniform(int(link, int64), int(k, int64), int(attempt, int64)) - 1)
                end associate
            end do
        end do
    end function poses_about_start

    !> A link with a starting position there, or near there.
    subroutine put_near_start(model, group, link, first, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: link, first
        type(kinematic_state), intent(inout) :: state
        real(wp) :: none(lanes)

        none = 0
        call put_in_pose(model, group, link, poses_about_start(model, link, first), vec3(none, none, none), state)
    end subroutine put_near_start

    !> Such a link where its coordinates say, the rest of its pose as `start` says, from the third attempt on some other.
    subroutine put_led_link(model, group, link, first, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: link, first
        type(kinematic_state), intent(inout) :: state
        real(wp) :: pose(lanes, 6)
        type(vec3) :: point
        integer :: j, k

        pose = poses_about_start(model, link, first)
        point = vec3(0*pose(:, 1), 0*pose(:, 1), 0*pose(:, 1))
        do j = model%n_joint + 1, size(model%joint)
            if (any(model%joint(j)%link /= [frame_link, link]) .or. .not. is_pose_part(model%joint(j)%kind)) cycle
            if (model%joint(j)%kind == pose_position) point = vec3_of(model%joint(j)%point(:, 2))
            do k = 1, model%n_q
                associate (c => model%scene%coordinate(k))
                    if (c%kind /= coordinate_joint .or. c%joint /= model%joint(j)%told) cycle
                    pose(:, c%variable + merge(0, 3, model%joint(j)%kind == pose_position)) = state%q(:, k)
                end associate
            end do
        end do
        call put_in_pose(model, group, link, pose, point, state)
    end subroutine put_led_link

    !> A link in a pose of one of its points. One that has the orientation of another link, or of the frame, stands as that does.
    subroutine put_in_pose(model, group, link, pose, point, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: link
        real(wp), intent(in) :: pose(lanes, 6)             !! position, roll, pitch, yaw
        type(vec3), intent(in) :: point                    !! of the link
        type(kinematic_state), intent(inout) :: state
        real(wp) :: quaternion(lanes, 4), yaw(lanes)
        type(vec3) :: arm
        logical :: turns

        turns = group%turns(findloc(group%link, link, dim=1))
        yaw = pose(:, 6)
        if (model%is_planar) then
            quaternion = quaternion_of_rpy(0*yaw, 0*yaw, yaw)
        else
            quaternion = quaternion_of_rpy(pose(:, 4), pose(:, 5), yaw)
        end if
        if (.not. turns) then
            if (model%is_planar) then
                associate (r => state%plane%rotation(orientation_of(model, link)))
                    yaw = atan2(r%s, r%c)
                end associate
            else
                quaternion = quaternion_of_rotation(state%rotation(orientation_of(model, link)))
            end if
        end if
        ! what is given is the place of the point, the start that of the origin: near enough for a start
        arm = rotation_of_quaternion(quaternion).rotate.point
        associate (place => state%group%place(:, :, link), o => orientation_of(model, link))
            state%group%place(:, 1, link) = pose(:, 1) - arm%x
            state%group%place(:, 2, link) = pose(:, 2) - arm%y
            if (model%is_planar) then
                state%group%place(:, 3, link) = yaw
                state%plane%position(link) = vec2(place(:, 1), place(:, 2))
                if (turns) state%plane%rotation(o) = rot2_by_angle(yaw)
            else
                state%group%place(:, 3, link) = pose(:, 3) - arm%z
                state%group%place(:, 4:7, link) = quaternion
                state%position(link) = vec3(place(:, 1), place(:, 2), place(:, 3))
                if (turns) state%rotation(o) = rotation_of_quaternion(quaternion)
            end if
        end associate
    end subroutine put_in_pose

    !> A link by a joint from one that is placed, in a plane.
    subroutine hang_in_plane(model, group, j, link, variable, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: j, link
        real(wp), intent(in) :: variable(lanes, 3)
        type(kinematic_state), intent(inout) :: state

        real(wp) :: sense
        type(vec2) :: u, hold
        type(rot2) :: turned
        integer :: from, known

        associate (joint => model%joint(j), plane => state%plane)
            from = 3 - side_of(joint, link)
            known = joint%link(from)
            sense = merge(1.0_wp, -1.0_wp, from == 1)
            turned = plane%rotation(orientation_of(model, link))
            associate (r => plane%rotation(orientation_of(model, known)), turns => group%turns(findloc(group%link, link, dim=1)))
                hold = r.rotate.joint%point(:2, from)
                if (joint%kind == joint_prismatic) then
                    u = r.rotate.joint%frame(:2, 3, from)
                    hold = hold + sense*variable(:, 1)*u
                    if (turns) turned = rot2_of_directions(joint%frame(:2, 3, 3 - from), u)
                else if (turns) then
                    turned = rot2_by_angle(sense*variable(:, 1))
                    turned = rot2_of_directions(joint%frame(:2, 1, 3 - from), r.rotate.(turned.rotate.joint%frame(:2, 1, from)))
                end if
            end associate
            plane%rotation(orientation_of(model, link)) = turned
            plane%position(link) = plane%position(known) + hold - (turned.rotate.joint%point(:2, 3 - from))
        end associate
        associate (p => state%plane%position(link), r => state%plane%rotation(orientation_of(model, link)), &
                   place => state%group%place)
            place(:, 1, link) = p%x
            place(:, 2, link) = p%y
            place(:, 3, link) = atan2(r%s, r%c)
        end associate
    end subroutine hang_in_plane

    !> The link on the other side of a joint, from the link at side `from`.
    subroutine hang_link(model, group, j, from, variable, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: j, from
        real(wp), intent(in) :: variable(lanes, 3)
        type(kinematic_state), intent(inout) :: state
        type(relative_motion) :: motion
        type(mat3) :: frame, r
        type(vec3) :: slide, origin
        real(wp) :: zero(lanes, 3)
        integer :: known, link, o

        associate (joint => model%joint(j))
            known = joint%link(from)
            link = joint%link(3 - from)
            o = orientation_of(model, link)
            frame = turn_frame(state%rotation(orientation_of(model, known)), joint%told_frame(:, :, from))
            if (from == 1) then
                zero = 0
                call relative_by_variables(joint%told_kind, frame, variable, zero, zero, motion, joint%pitch)
                slide = motion%slide
            else
                call first_by_variables(joint%told_kind, frame, variable, motion%frame, slide, joint%pitch)
                slide = -slide
            end if
            r = state%rotation(o)
            if (group%turns(findloc(group%link, link, dim=1))) r = turn_frame_back(motion%frame, joint%told_frame(:, :, 3 - from))
            state%rotation(o) = r
            origin = state%position(known) + (state%rotation(orientation_of(model, known)).rotate.joint%point(:, from)) &
                     + slide - (r.rotate.joint%point(:, 3 - from))
            state%position(link) = origin
            associate (place => state%group%place)
                place(:, 1, link) = origin%x
                place(:, 2, link) = origin%y
                place(:, 3, link) = origin%z
                place(:, 4:, link) = quaternion_of_rotation(r)
            end associate
        end associate
    end subroutine hang_link
end module linkdyn_group_start
