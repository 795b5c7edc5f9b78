!> An Assur group closed by Newton's method, in a plane or in space: the iteration, which is the same for both.
!>
!> The constraints, their matrix and the rates that follow from it are in `linkdyn_planar_group` and
!> `linkdyn_spatial_group`. With every matrix A go some further right-hand sides, which tell how near A is to being
!> singular: the length of A^-1 v, v any vector, grows as the inverse of the smallest singular value. Its inverse with
!> the sign of the determinant is the group's *margin* (see `linkdyn_following`). Lengths count as parts of the
!> mechanism's size, so that it has no unit.
module linkdyn_newton_group
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_following, only: largest_contraction, untrusted
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_mix, only: counter_uniform
    use linkdyn_model, only: model_type, group_type, step_type, link_freedom, n_probe, scene_size, side_of, is_dyad
    use linkdyn_planar_group, only: put_planar_links, assemble_gaps, assemble_gaps_ahead, move_planar_group, &
        is_planar_length, planar_speed
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_quaternion, only: turned_by
    use linkdyn_scene, only: joint_revolute
    use linkdyn_spatial_group, only: put_spatial_links, assemble_errors, assemble_errors_ahead, refuse_turned_joints, &
        move_spatial_group, is_spatial_length, spatial_speed
    use linkdyn_uncertainty, only: uncertainty_of_motion
    implicit none (type, external)
    private
    public :: prepare_margins, close_group, shifted

    integer, parameter :: most_steps = 30
    ! Newton's method squares the error: after a correction below this, the next error is below rounding.
    real(wp), parameter :: small_step = 1.0e-2_wp*sqrt(epsilon(1.0_wp))
    real(wp), parameter :: largest_turn = 0.5_wp     !! [rad] of a link in one step
    real(wp), parameter :: rounding = 16*epsilon(1.0_wp)    !! of a constraint
    !> Below this a margin is not told from zero: rounding e leaves places uncertain by e/margin, and their tangents by
    !> e/margin^2, which must stay small where two assemblies cross.
    real(wp), parameter :: least_group_margin = 10*untrusted

contains

    !> The vectors v of every group, and the units of its corrections: the mechanism's size for a length, 1 for an angle.
    !> Where the matrix is nearly singular, what counts of v is its part along one direction. Of random numbers that part
    !> is about one, whatever symmetries the mechanism has, and that it should be small for both vectors is unlikely.
    subroutine prepare_margins(model)
        type(model_type), intent(inout) :: model
        logical, allocatable :: is_length(:)
        integer :: g, i, k, n, freedom

        freedom = link_freedom(model)
        model%least_margin = [least_closed_margins(model), (least_group_margin, g=1, size(model%group))]
        do g = 1, size(model%group)
            associate (group => model%group(g))
                n = freedom*size(group%link)
                if (model%is_planar) then
                    is_length = is_planar_length(model, group)
                else
                    is_length = is_spatial_length(model, group)
                end if
                group%row_unit = merge(scene_size(model), 1.0_wp, is_length)
                allocate (group%probe(n, n_probe))
                do k = 1, n_probe
                    group%probe(:, k) = [(2*counter_uniform(0_int64, int(k, int64), int(i, int64)) - 1, i=1, n)]
                    group%probe(:, k) = group%probe(:, k)*sqrt(1/sum(group%probe(:, k)**2))*group%row_unit
                end do
                group%unit = [(merge(scene_size(model), 1.0_wp, modulo(i - 1, freedom) < n_shift(model)), i=1, n)]
            end associate
        end do
    end subroutine prepare_margins

    !> Below which margins of closed forms cannot be told from zero. A dyad far from the origin is closed between places that
    !> round by more of its links' lengths than one beside it, and one that hangs on other dyads has their rounding, too: of a
    !> row of parallelograms all come to their change points at once.
    pure function least_closed_margins(model) result(least)
        type(model_type), intent(in) :: model
        real(wp) :: least(model%n_branch)
        real(wp) :: shortest
        integer :: depth(0:model%n_link)     ! dyads one behind the other, up to a link
        integer :: below, i, k

        least = untrusted
        depth = 0
        do i = 1, size(model%step)
            associate (step => model%step(i))
                below = 0
                do k = 1, count(step%joint > 0)
                    below = max(below, maxval(depth(model%joint(step%joint(k))%link)))
                end do
                depth(step%link(:step%n_link)) = below + merge(1, 0, is_dyad(step%kind))
                if (.not. is_dyad(step%kind)) cycle
                shortest = huge(1.0_wp)
                do k = 1, 2
                    if (has_arm(step, k)) shortest = min(shortest, arm_length(step, k))
                end do
                least(step%first) = untrusted*sqrt(depth(step%link(1))*max(1.0_wp, scene_size(model)/shortest))
            end associate
        end do

    contains

        !> Does a link of the dyad turn between two hinges?
        pure logical function has_arm(step, k)
            type(step_type), intent(in) :: step
            integer, intent(in) :: k

            has_arm = all(model%joint(step%joint([2*k - 1, 2]))%kind == joint_revolute)
        end function has_arm

        pure real(wp) function arm_length(step, k)
            type(step_type), intent(in) :: step
            integer, intent(in) :: k

            associate (outer => model%joint(step%joint(2*k - 1)), inner => model%joint(step%joint(2)), l => step%link(k))
                arm_length = norm2(inner%point(:, side_of(inner, l)) - outer%point(:, side_of(outer, l)))
            end associate
        end function arm_length
    end function least_closed_margins

    !> Of a link's freedoms the first are shifts, the others turns.
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
        logical, dimension(lanes) :: is_done, is_singular, has_no_pivot, is_refused
        integer :: n, step

        associate (group => model%group(g))
            n = size(group%unit)
            ! Lanes that have arrived stay: what a sample gives must not depend on the samples beside it.
            largest = merge(huge(1.0_wp), 0.0_wp, state%group%moves)
            is_done = .not. state%group%moves
            is_refused = .false.
            do step = 1, most_steps
                before = largest
                if (model%is_planar) then
                    call put_planar_links(model, group, state)
                    call assemble_gaps(model, group, state, state%group%matrix(:, :n, :n), state%group%right(:, :n, 1))
                else
                    call put_spatial_links(model, group, state)
                    call assemble_errors(model, group, state, state%group%matrix(:, :n, :n), state%group%right(:, :n, 1))
                end if
                call solve_with_probe(group, state, margin, has_no_pivot)
                where (.not. is_done .or. step == 1)
                    state%group%margin(:, g) = margin
                    is_singular = has_no_pivot
                    noise = rounding_of(model, group, state%group%place)/max(abs(margin), least_group_margin)
                end where
                call correct(model, group, state%group%right(:, :n, 1), .not. is_done, state%group%place, largest)
                if (step > 1) call watch_contraction(before, largest, noise, state%group%contraction)
                if (state%group%is_led) is_refused = .not. state%group%contraction <= largest_contraction
                is_done = is_small(largest, noise) .or. is_refused
                if (all(is_done)) exit
            end do
            state%not_converged = state%not_converged .or. is_refused .or. .not. is_small(largest, noise)
            state%singular = state%singular .or. is_singular
            if (model%is_planar) then
                call put_planar_links(model, group, state)
                call move_planar_group(model, group, state)
            else
                call put_spatial_links(model, group, state)
                call refuse_turned_joints(model, group, state)
                call move_spatial_group(model, group, state)
            end if
            if (state%group%is_led) then
                call measure_drift(model, group, state, state%group%margin(:, g), state%group%drift(:, g))
            else
                state%uncertainty = max(state%uncertainty, uncertainty_of_group(model, group, state, state%group%margin(:, g)))
            end if
        end associate
    end subroutine close_group

    !> Is a correction so small that none need follow?
    elemental logical function is_small(largest, noise)
        real(wp), intent(in) :: largest
        real(wp), intent(in) :: noise        !! what rounding alone makes of it

        is_small = largest <= max(small_step, noise)
    end function is_small

    !> The correction that rounding of the constraints makes at a margin of one.
    pure function rounding_of(model, group, place) result(noise)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: place(:, :, :)           !! (lane, place_size, n_link)
        real(wp) :: noise(lanes)
        integer :: i

        noise = scene_size(model)
        do i = 1, size(group%link)
            noise = max(noise, maxval(abs(place(:, :n_shift(model), group%link(i))), dim=2))
        end do
        noise = rounding*noise/scene_size(model)
    end function rounding_of

    !> Two corrections, one after the other, tell whether the place predicted was near enough.
    elemental subroutine watch_contraction(before, largest, noise, contraction)
        real(wp), intent(in) :: before, largest, noise
        real(wp), intent(inout) :: contraction

        if (is_small(before, noise) .or. is_small(largest, noise)) return
        contraction = max(contraction, largest/before)
    end subroutine watch_contraction

    ! ---------------------------------------------------------------- margin

    !> Solve for the errors in the first right-hand side, and for the probes, which tell the margin.
    subroutine solve_with_probe(group, state, margin, is_singular)
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state
        real(wp), intent(out) :: margin(lanes)
        logical, intent(out) :: is_singular(lanes)
        real(wp), dimension(lanes) :: growth, determinant, square
        integer :: i, k, n

        n = size(group%unit)
        associate (matrix => state%group%matrix, right => state%group%right)
            right(:, :n, 2:1 + n_probe) = spread(group%probe, 1, lanes)
            call solve_gauss_jordan(n, 1 + n_probe, matrix(:, :n, :n), right(:, :n, :1 + n_probe), growth, is_singular, &
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

    !> The margin's rate along the way, from the margin a little further on, where the links' velocities lead. The step is
    !> a small part of the distance to where the margin may vanish at the nearest.
    subroutine measure_drift(model, group, state, margin, drift)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state    !! scratch of the group is lost
        real(wp), intent(in) :: margin(lanes)
        real(wp), intent(out) :: drift(lanes)
        real(wp), parameter :: part = 1.0e-3_wp, longest = 1.0e-4_wp
        real(wp) :: speed(lanes), step(lanes), ahead(lanes)
        logical :: is_singular(lanes)
        integer :: n

        n = size(group%unit)
        associate (matrix => state%group%matrix(:, :n, :n), right => state%group%right(:, :n, 1))
            speed = speed_of(model, group, state, level_velocity)
            step = min(part*abs(margin), longest)/max(speed, tiny(1.0_wp))
            if (model%is_planar) then
                call assemble_gaps_ahead(model, group, step, state, matrix, right)
            else
                call assemble_errors_ahead(model, group, step, state, matrix, right)
            end if
        end associate
        call solve_with_probe(group, state, ahead, is_singular)
        drift = merge((ahead - margin)/step, 0.0_wp, speed > 0 .and. step > 0)
    end subroutine measure_drift

    !> What rounding leaves of the group's motion. Lengths are parts of the mechanism's size, so its links turn on a radius of
    !> about one.
    pure function uncertainty_of_group(model, group, state, margin) result(part)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: margin(lanes)
        real(wp) :: part(lanes)

        part = uncertainty_of_motion(abs(margin), 1.0_wp, &
                                     speed_of(model, group, state, level_velocity), state%group%gap(:, level_velocity), &
                                     speed_of(model, group, state, level_given), state%group%gap(:, level_given))
    end function uncertainty_of_group

    !> The largest of the links' rates of a level, lengths by the mechanism's size.
    pure function speed_of(model, group, state, level) result(speed)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: level
        real(wp) :: speed(lanes)

        if (model%is_planar) then
            speed = planar_speed(model, group, state, level)
        else
            speed = spatial_speed(model, group, state, level)
        end if
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
        real(wp) :: moved(lanes, size(place, 2))
        integer :: n, i, k

        n = link_freedom(model)
        turn = 0
        size_here = 0
        do i = 1, size(correction, 2)
            size_here = max(size_here, abs(correction(:, i))/group%unit(i))
            if (modulo(i - 1, n) >= n_shift(model)) turn = max(turn, abs(correction(:, i)))
        end do
        ! Far off, a step is cut so that no link turns further than its equations hold.
        part = min(1.0_wp, largest_turn/max(turn, tiny(1.0_wp)))
        do i = 1, size(group%link)
            associate (l => group%link(i), d => correction(:, n*(i - 1) + 1:n*i))
                moved = shifted(model, place(:, :, l), -spread(part, 2, n)*d)
                do k = 1, size(moved, 2)
                    where (takes) place(:, k, l) = moved(:, k)
                end do
            end associate
        end do
        where (takes) largest = size_here
        where (.not. largest <= huge(1.0_wp)) largest = huge(1.0_wp)
    end subroutine correct

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
