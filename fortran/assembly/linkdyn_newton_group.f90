!> An Assur group closed by Newton's method, in a plane or in space: the iteration, which is the same for both.
!>
!> The constraints, their matrix and the rates that follow from it are in `linkdyn_group_closing`. With every matrix A go some
!> further right-hand sides, which tell how near A is to being singular: the length of A^-1 v, v any vector, grows as the inverse of
!> the smallest singular value. Its inverse with the sign of the determinant is the group's *margin* (see `linkdyn_following`).
!> Lengths count as parts of the mechanism's size, so that it has no unit.
!>
!> On a way, where velocities are wanted besides, all this may come from a record of the group (`closer`): the same numbers but
!> for rounding. Lanes of which that is not sure are computed here.
module linkdyn_newton_group
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_constants, only: two_pi
    use linkdyn_following, only: largest_contraction, untrusted
    use linkdyn_group_closing, only: put_links, assemble_errors, assemble_ahead, move_loop, look_at_joints, angle_off_threads
    use linkdyn_group_motion, only: size_of_rows
    use linkdyn_joint_table, only: is_threaded, is_slide, n_transmitted, pose_position
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, velocities_only
    use linkdyn_lane_count, only: lanes
    use linkdyn_steps_on_lanes, only: kernel_use, begin_use, end_use, set_rates, place_rates
    use linkdyn_link_place, only: led_on_thread, rate_at, turned_axis
    use linkdyn_hash, only: counter_uniform
    use linkdyn_model, only: model_type, group_type, step_type, link_freedom, n_probe, scene_size, group_size, reach_of, side_of, &
        point_on, step_rus, is_dyad, is_rod_leg
    use linkdyn_newton_rules, only: is_small, watch_contraction, rounding_at, step_ahead, largest_turn, least_group_margin
    use linkdyn_patterned_elimination, only: eliminate_by_pattern
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_quaternion, only: turned_by
    use linkdyn_scene, only: joint_revolute
    use linkdyn_step_part, only: describe_steps
    use linkdyn_threads_of_group, only: surely_same_turn
    use linkdyn_uncertainty, only: uncertainty_of_motion
    use linkdyn_whole_turns, only: nearest_turns
    implicit none (type, external)
    private
    public :: prepare_margins, close_group, led_link, n_shift
    public :: correct, rounding_of, sizes_away, solve_with_probe, most_steps

    integer, parameter :: most_steps = 30

contains

    !> The vectors v of every group, and the units of its corrections: of a length its size, or how far the link's joints are from
    !> the link's origin, which goes so far if the link turns; 1 for an angle. Where the matrix is nearly singular, what counts of v
    !> is its part along one direction. Of random numbers that part is about one, whatever symmetries the mechanism has, and that it
    !> should be small for both vectors is unlikely.
    subroutine prepare_margins(model)
        type(model_type), intent(inout) :: model
        integer :: g, i, k, n, freedom

        freedom = link_freedom(model)
        call describe_steps(model)
        model%least_margin = [least_closed_margins(model), (least_group_margin, g=1, size(model%group))]
        do g = 1, size(model%group)
            associate (group => model%group(g))
                n = freedom*size(group%link)
                group%size = group_size(model, group)
                group%row_unit = merge(group%size, 1.0_wp, is_distance(model, group))
                allocate (group%probe(n, n_probe))
                do k = 1, n_probe
                    group%probe(:, k) = [(2*counter_uniform(0_int64, int(k, int64), int(i, int64)) - 1, i=1, n)]
                    group%probe(:, k) = group%probe(:, k)*sqrt(1/sum(group%probe(:, k)**2))*group%row_unit
                end do
                group%unit = [(1.0_wp, i=1, n)]
                do i = 1, size(group%link)
                    group%unit(freedom*(i - 1) + 1:freedom*(i - 1) + n_shift(model)) = &
                        max(group%size, reach_of(model, group%joint, group%link(i)))
                end do
                call find_thread_axes(model, group)
            end associate
        end do
    end subroutine prepare_margins

    !> About which lines a group's links may spin. Of a link with several threads the first is taken.
    pure subroutine find_thread_axes(model, group)
        type(model_type), intent(in) :: model
        type(group_type), intent(inout) :: group
        integer :: i, j

        group%n_thread = count(is_threaded(model%joint(group%joint)%kind))
        group%thread_axis = reshape([(0.0_wp, i=1, 3*size(group%link))], [3, size(group%link)])
        group%thread_point = group%thread_axis
        do i = size(group%joint), 1, -1
            associate (joint => model%joint(group%joint(i)))
                if (.not. is_threaded(joint%kind)) cycle
                do j = 1, size(group%link)
                    if (all(joint%link /= group%link(j))) cycle
                    group%thread_axis(:, j) = joint%frame(:, 3, side_of(joint, group%link(j)))
                    group%thread_point(:, j) = joint%point(:, side_of(joint, group%link(j)))
                end do
            end associate
        end do
    end subroutine find_thread_axes

    !> Which of a group's constraints are distances, in the order of its joints: what each holds, then what is given of it.
    pure function is_distance(model, group) result(is)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        logical :: is(link_freedom(model)*size(group%link))
        integer :: i, k, row, n(2)

        row = 0
        do i = 1, size(group%joint)
            associate (kind => model%joint(group%joint(i))%kind)
                n = n_transmitted(kind, model%is_planar)
                ! a thread's comes last; a given angle says its slide and its turn
                if (is_threaded(kind)) n = n - [1, 0]
                is(row + 1:row + sum(n)) = [(k <= n(1), k=1, sum(n))]
                row = row + sum(n)
                if (is_threaded(kind)) then
                    if (group%coordinate(1, i) == 0) then
                        is(row + 1) = .true.
                        row = row + 1
                    else
                        is(row + 1:row + 2) = [.true., .false.]
                        row = row + 2
                    end if
                    cycle
                end if
                do k = 1, 3
                    if (group%coordinate(k, i) == 0) cycle
                    row = row + 1
                    is(row) = is_slide(kind, k)
                end do
            end associate
        end do
    end function is_distance

    !> Below which margins of closed forms cannot be told from zero. A dyad far from the origin is closed between places that
    !> round by more of its links' lengths than one beside it, and one that hangs on other dyads has their rounding, too: of a
    !> row of parallelograms all come to their change points at once. So do legs of crank or carriage and rod.
    pure function least_closed_margins(model) result(least)
        type(model_type), intent(in) :: model
        real(wp) :: least(model%n_branch)
        real(wp) :: shortest, farthest
        integer :: depth(0:model%n_link)     ! dyads one behind the other, up to a link
        integer :: below, i, k
        logical :: is_pair

        least = untrusted
        farthest = farthest_marker()
        depth = 0
        do i = 1, size(model%step)
            associate (step => model%step(i))
                below = 0
                do k = 1, count(step%joint > 0)
                    below = max(below, maxval(depth(model%joint(step%joint(k))%link)))
                end do
                is_pair = is_dyad(step%kind) .or. is_rod_leg(step%kind)
                depth(step%link(:step%n_link)) = below + merge(1, 0, is_pair)
                if (.not. is_pair) cycle
                shortest = huge(1.0_wp)
                do k = 1, 2
                    if (has_arm(step, k)) shortest = min(shortest, arm_length(step, k))
                end do
                least(step%first) = untrusted*sqrt(depth(step%link(1))*max(1.0_wp, farthest/shortest))
            end associate
        end do

    contains

        !> The largest coordinate of a joint's marker [m]: on the frame from the world's origin, which is what rounds.
        pure real(wp) function farthest_marker()
            integer :: j

            farthest_marker = scene_size(model)
            do j = 1, model%n_joint
                farthest_marker = max(farthest_marker, maxval(abs(model%joint(j)%point)))
            end do
        end function farthest_marker

        !> Does a link of the dyad turn between two hinges, or is it a crank or rod? One that a slide draws out has no length to
        !> count on.
        pure logical function has_arm(step, k)
            type(step_type), intent(in) :: step
            integer, intent(in) :: k

            has_arm = model%joint(step%joint(2))%kind == joint_revolute &
                      .and. any(model%joint(step%joint(2*k - 1))%kind == [joint_revolute, pose_position]) &
                      .and. any(model%joint(step%joint(2))%link == step%link(k))
            if (is_rod_leg(step%kind)) has_arm = k == 2 .or. step%kind == step_rus
        end function has_arm

        pure real(wp) function arm_length(step, k)
            type(step_type), intent(in) :: step
            integer, intent(in) :: k

            associate (outer => model%joint(step%joint(2*k - 1)), inner => model%joint(step%joint(2)), l => step%link(k))
                arm_length = norm2(point_on(inner, l) - point_on(outer, l))
            end associate
        end function arm_length
    end function least_closed_margins

    !> How many of a link's freedoms are shifts: the first ones; the others are turns.
    pure integer function n_shift(model)
        type(model_type), intent(in) :: model

        n_shift = merge(2, 3, model%is_planar)
    end function n_shift

    !> Positions from where the iteration stands, then all rates; on a way velocities and the margin's drift alone.
    subroutine close_group(model, g, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g                         !! the group's number
        type(kinematic_state), intent(inout) :: state
        real(wp), dimension(lanes) :: largest, before, noise, margin
        real(wp), dimension(lanes, size(model%group(g)%unit)) :: correction, rate, rate_here
        logical, dimension(lanes) :: is_done, is_singular, has_no_pivot, is_refused
        logical, dimension(lanes) :: is_recorded, has_rate    ! correction and velocities
        type(kernel_use) :: use
        integer :: step, k

        call begin_use(model, model%group(g)%step, state, use)
        associate (group => model%group(g))
            ! Lanes that have arrived stay: what a sample gives must not depend on the samples beside it.
            largest = merge(huge(1.0_wp), 0.0_wp, state%group%moves)
            is_done = .not. state%group%moves
            is_refused = .false.
            do step = 1, most_steps
                before = largest
                call find_correction(model, g, use, state, correction, rate_here, margin, has_no_pivot, is_recorded)
                where (.not. is_done .or. step == 1)
                    state%group%margin(:, g) = margin
                    is_singular = has_no_pivot
                    noise = rounding_of(model, group, state%group%place)/max(abs(margin), least_group_margin)
                    has_rate = is_recorded
                end where
                do k = 1, size(rate, 2)
                    where (.not. is_done .or. step == 1) rate(:, k) = rate_here(:, k)
                end do
                ! who records steps has looked at the threads
                if (group%n_thread > 0 .and. step == 1 .and. .not. all(is_recorded)) then
                    where (.not. is_recorded .and. angle_off_threads(model, use, state) > surely_same_turn) &
                        state%group%contraction = huge(1.0_wp)
                end if
                call correct(model, group, correction, .not. is_done, state%group%place, largest)
                if (step > 1) call watch_contraction(before, largest, noise, state%group%contraction)
                if (state%group%is_led) is_refused = .not. state%group%contraction <= largest_contraction
                is_done = is_small(largest, noise) .or. is_refused
                if (all(is_done)) exit
            end do
            state%not_converged = state%not_converged .or. is_refused .or. .not. is_small(largest, noise)
            state%singular = state%singular .or. is_singular
            call put_links(model, group, state)
            call look_at_joints(model, use, state)
            if (.not. all(has_rate)) call move_links(model, group, use, state)
            if (any(has_rate)) call set_rates(model, model%part(use%step), level_velocity, rate, state, has_rate)
            if (state%group%is_led) then
                call measure_drift(model, g, use, state, state%group%margin(:, g), state%group%drift(:, g))
            else
                state%uncertainty = max(state%uncertainty, uncertainty_of_group(model, group, state, state%group%margin(:, g)))
            end if
        end associate
        call end_use(use)
    end subroutine close_group

    !> What Newton's method takes from the places, and the margin there; by a record also the rates of the places.
    subroutine find_correction(model, g, use, state, correction, rate, margin, has_no_pivot, is_recorded)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g
        type(kernel_use), intent(in) :: use
        type(kinematic_state), intent(inout) :: state    !! scratch of the group is lost
        real(wp), intent(out), contiguous :: correction(:, :), rate(:, :)    !! (lane, row)
        real(wp), intent(out) :: margin(lanes)
        logical, intent(out) :: has_no_pivot(lanes)
        logical, intent(out) :: is_recorded(lanes)       !! of the others there is no rate
        real(wp) :: margin_here(lanes)
        logical :: no_pivot_here(lanes)
        integer :: n, k

        is_recorded = .false.
        has_no_pivot = .false.
        if (state%group%is_led .and. associated(state%group%closer)) then
            call state%group%closer%make_steps(g, state%q, state%qd, state%branch, state%group%place, margin, is_recorded, &
                                               correction, rate, only_leads=.true.)
            is_recorded = is_recorded .or. state%group%is_idle
        end if
        if (all(is_recorded)) return
        associate (group => model%group(g))
            n = size(group%unit)
            call put_links(model, group, state)
            call assemble_errors(model, use, state, state%group%matrix, state%group%right(:, :n, 1))
            call solve_with_probe(group, use, state, margin_here, no_pivot_here)
        end associate
        where (.not. is_recorded)
            margin = margin_here
            has_no_pivot = no_pivot_here
        end where
        do k = 1, n
            where (.not. is_recorded) correction(:, k) = state%group%right(:, k, 1)
        end do
    end subroutine find_correction

    !> How the links move, and what their joints were given for it.
    subroutine move_links(model, group, use, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kernel_use), intent(in) :: use
        type(kinematic_state), intent(inout) :: state
        real(wp) :: gap(lanes, size(group%unit), level_velocity:level_given)
        logical :: is_singular(lanes)
        integer :: n, n_column, level

        n = size(group%unit)
        n_column = merge(velocities_only, state%n_column, state%group%is_led)
        call move_loop(model, use, n_column, state, state%group%matrix, state%group%right(:, :n, :), gap, is_singular)
        do level = level_velocity, merge(level_velocity, level_given, n_column < 0)
            state%group%gap(:, level) = size_of_rows(group, gap(:, :, level))
        end do
    end subroutine move_links

    !> The correction that rounding of the constraints makes at a margin of one.
    pure function rounding_of(model, group, place) result(noise)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: place(:, :, :)           !! (lane, place_size, n_link)
        real(wp) :: noise(lanes)

        noise = rounding_at(group%size*sizes_off(model, group, place), group%size)
    end function rounding_of

    !> How far the group's links are from the world's origin, in sizes of the group; one at least.
    pure function sizes_off(model, group, place) result(off)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: place(:, :, :)           !! (lane, place_size, n_link)
        real(wp) :: off(lanes)
        integer :: i

        off = 1
        do i = 1, size(group%link)
            off = max(off, maxval(abs(place(:, :n_shift(model), group%link(i))), dim=2)/group%size)
        end do
    end function sizes_off

    !> The same of one sample.
    pure real(wp) function sizes_away(model, group, place) result(off)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: place(:, :)              !! (place_size, n_link)
        integer :: i

        off = 1
        do i = 1, size(group%link)
            off = max(off, maxval(abs(place(:n_shift(model), group%link(i))))/group%size)
        end do
    end function sizes_away

    ! ---------------------------------------------------------------- margin

    !> Solve for the errors in the first right-hand side, and for the probes, which tell the margin.
    subroutine solve_with_probe(group, use, state, margin, is_singular)
        type(group_type), intent(in) :: group
        type(kernel_use), intent(in) :: use
        type(kinematic_state), intent(inout) :: state
        real(wp), intent(out) :: margin(lanes)
        logical, intent(out) :: is_singular(lanes)
        real(wp), dimension(lanes) :: determinant, square
        integer :: i, k, n

        n = size(group%unit)
        associate (matrix => state%group%matrix, right => state%group%right)
            right(:, :n, 2:1 + n_probe) = spread(group%probe, 1, lanes)
            call eliminate_by_pattern(use%kernels%pattern, 1 + n_probe, matrix, right(:, :n, :1 + n_probe), is_singular, &
                                      determinant)
            square = 0
            do k = 2, 1 + n_probe
                do i = 1, n
                    square = square + (right(:, i, k)/group%unit(i))**2
                end do
            end do
        end associate
        ! A direction of n has the n-th part of a unit vector's square, on average.
        margin = merge(0.0_wp, sign(sqrt(n_probe/(n*square)), determinant), is_singular)
    end subroutine solve_with_probe

    !> The margin's rate along the way, from the margin a little further on, where the links' velocities lead.
    subroutine measure_drift(model, g, use, state, margin, drift)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g
        type(kernel_use), intent(in) :: use
        type(kinematic_state), intent(inout) :: state    !! scratch of the group is lost
        real(wp), intent(in) :: margin(lanes)
        real(wp), intent(out) :: drift(lanes)
        real(wp) :: speed(lanes), step(lanes), ahead(lanes), ahead_here(lanes)
        logical :: is_singular(lanes), is_recorded(lanes)
        integer :: n

        associate (group => model%group(g))
            n = size(group%unit)
            speed = speed_of(model, group, state, level_velocity)
            step = step_ahead(margin, speed)
            call look_ahead_by_record(model, g, step, state, ahead, is_recorded)
            if (associated(state%group%closer)) is_recorded = is_recorded .or. state%group%is_idle
            if (.not. all(is_recorded)) then
                call assemble_ahead(model, use, step, state, state%group%matrix)
                state%group%right(:, :n, 1) = 0
                call solve_with_probe(group, use, state, ahead_here, is_singular)
                where (.not. is_recorded) ahead = ahead_here
            end if
        end associate
        drift = merge((ahead - margin)/step, 0.0_wp, speed > 0 .and. step > 0)
    end subroutine measure_drift

    !> The margin a little further on, where a record is sure of it.
    subroutine look_ahead_by_record(model, g, step, state, ahead, is_recorded)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g
        real(wp), intent(in) :: step(lanes)
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: ahead(lanes)
        logical, intent(out) :: is_recorded(lanes)
        real(wp) :: place(lanes, size(state%group%place, 2), model%n_link)
        integer :: i, h

        is_recorded = .false.
        if (.not. associated(state%group%closer)) return
        place = state%group%place
        do h = 1, g
            do i = 1, size(model%group(h)%link)
                associate (l => model%group(h)%link(i))
                    place(:, :, l) = led_link(model, model%group(h), i, place(:, :, l), &
                                              spread(step, 2, link_freedom(model))*place_rates(model, state, l, level_velocity))
                end associate
            end do
        end do
        call state%group%closer%make_steps(g, state%q + spread(step, 2, model%n_q)*state%qd, state%qd, state%branch, place, ahead, &
                                           is_recorded, only_leads=.true.)
    end subroutine look_ahead_by_record

    !> What rounding leaves of the group's motion. Lengths are parts of its size, so its links turn on a radius of
    !> about one.
    pure function uncertainty_of_group(model, group, state, margin) result(part)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: margin(lanes)
        real(wp) :: part(lanes)

        part = uncertainty_of_motion(abs(margin), 1.0_wp, &
                                     speed_of(model, group, state, level_velocity), state%group%gap(:, level_velocity), &
                                     speed_of(model, group, state, level_given), state%group%gap(:, level_given), &
                                     sizes_off(model, group, state%group%place))
    end function uncertainty_of_group

    !> The largest of the links' rates of a level, lengths by their unit.
    pure function speed_of(model, group, state, level) result(speed)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: level
        real(wp) :: speed(lanes)
        real(wp) :: rate(lanes, link_freedom(model))
        integer :: i, n

        n = n_shift(model)
        speed = 0
        do i = 1, size(group%link)
            rate = place_rates(model, state, group%link(i), level)
            speed = max(speed, sqrt(sum(rate(:, :n)**2, dim=2))/group%unit(link_freedom(model)*(i - 1) + 1), &
                        sqrt(sum(rate(:, n + 1:)**2, dim=2)))
        end do
    end function speed_of

    ! ---------------------------------------------------------------- places

    !> Take the correction; how large it was: the largest turn, or shift as part of the mechanism's size.
    subroutine correct(model, group, correction, takes, place, largest)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: correction(:, :)         !! (lane, row)
        logical, intent(in) :: takes(lanes)
        real(wp), intent(inout) :: place(:, :, :)        !! (lane, place_size, n_link)
        real(wp), intent(inout) :: largest(lanes)
        real(wp), dimension(lanes) :: part, turn, size_here
        real(wp), dimension(lanes, link_freedom(model)) :: counts, bounded
        real(wp) :: moved(lanes, size(place, 2))
        logical :: is_number(lanes)
        integer :: n, i, k

        n = link_freedom(model)
        turn = 0
        size_here = 0
        is_number = .true.                               ! `max` may say anything of what is none
        do i = 1, size(group%link)
            counts = correction(:, n*(i - 1) + 1:n*i)
            bounded = counts
            if (has_thread(group, i)) call take_spin_apart(group, i, place(:, :, group%link(i)), counts, bounded)
            do k = 1, n
                is_number = is_number .and. abs(counts(:, k)) <= huge(1.0_wp)
                size_here = max(size_here, abs(counts(:, k))/group%unit(n*(i - 1) + k))
                if (k > n_shift(model)) turn = max(turn, abs(bounded(:, k)))
            end do
        end do
        ! Far off, a step is cut so that no link turns further than its equations hold.
        part = min(1.0_wp, largest_turn/max(turn, tiny(1.0_wp)))
        do i = 1, size(group%link)
            associate (l => group%link(i), d => correction(:, n*(i - 1) + 1:n*i))
                moved = led_link(model, group, i, place(:, :, l), -spread(part, 2, n)*d)
                do k = 1, size(moved, 2)
                    where (takes) place(:, k, l) = moved(:, k)
                end do
            end associate
        end do
        where (takes) largest = merge(size_here, huge(1.0_wp), is_number)
    end subroutine correct

    !> What of a link's correction counts, and what of that may not be large: a small way along a thread is a large angle about it,
    !> and whole turns change nothing.
    pure subroutine take_spin_apart(group, i, place, counts, bounded)
        type(group_type), intent(in) :: group
        integer, intent(in) :: i                         !! of its links
        real(wp), intent(in) :: place(:, :)              !! (lane, place_size)
        real(wp), intent(inout) :: counts(:, :)          !! the correction; shifts are those of a point on the thread (lane, row)
        real(wp), intent(out) :: bounded(:, :)           !! without the turn about it (lane, row)
        real(wp) :: about(3), angle, here(6)
        integer :: lane

        do lane = 1, lanes
            here = rate_at(place(lane, :), counts(lane, :), group%thread_point(:, i))
            about = turned_axis(place(lane, :), group%thread_axis(:, i))
            angle = dot_product(here(4:), about)
            bounded(lane, :3) = here(:3)
            bounded(lane, 4:) = here(4:) - angle*about
            counts(lane, :3) = here(:3)
            counts(lane, 4:) = here(4:) - two_pi*nearest_turns(angle)*about
        end do
    end subroutine take_spin_apart

    !> May a link of the group spin about a thread?
    pure logical function has_thread(group, i)
        type(group_type), intent(in) :: group
        integer, intent(in) :: i                         !! of its links

        has_thread = any(abs(group%thread_axis(:, i)) > 0)
    end function has_thread

    !> A link of the group where a correction or rates lead: on its thread, if it has one.
    pure function led_link(model, group, i, place, by) result(led)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: i                         !! of its links
        real(wp), intent(in) :: place(:, :)              !! (lane, place_size)
        real(wp), intent(in) :: by(:, :)                 !! (lane, link_freedom)
        real(wp) :: led(lanes, size(place, 2))
        integer :: lane

        if (.not. has_thread(group, i)) then
            led = shifted(model, place, by)
            return
        end if
        do lane = 1, lanes
            led(lane, :) = led_on_thread(place(lane, :), by(lane, :), group%thread_axis(:, i), group%thread_point(:, i))
        end do
    end function led_link

    !> A link's place after a shift and a turn, about x, y, z of the world in space.
    pure function shifted(model, place, by)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: place(:, :)              !! (lane, place_size)
        real(wp), intent(in) :: by(:, :)                 !! (lane, link_freedom)
        real(wp) :: shifted(lanes, size(place, 2))

        if (model%is_planar) then
            shifted = place + by
        else
            shifted(:, :3) = place(:, :3) + by(:, :3)
            shifted(:, 4:) = turned_by(place(:, 4:), by(:, 4:))
        end if
    end function shifted
end module linkdyn_newton_group
