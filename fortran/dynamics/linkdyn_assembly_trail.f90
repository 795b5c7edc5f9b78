!> The assembly of every dyad along a motion: which branch it is on at each sample, by continuity.
!>
!> A dyad changes its branch where its transmission angle passes through zero, as a parallelogram does when it is flat.
!> Samples are therefore looked at in their order, `lanes` at a time: velocity tells whether the transmission of a dyad
!> will have changed its sign at the next sample. Where it might, the step is cut into finer ones until either the
!> mechanism is seen to turn back before the dead point or the dead point is reached to within `near_dead`, and passed
!> in the direction of the motion. What is nearer to a dead point than that cannot be told from passing through it.
!>
!> A sample on its own, outside a motion, is on the branch of the start.
module linkdyn_assembly_trail
    use linkdyn_dyad_map, only: transmission_sine
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_rrr, step_rrp, step_rpr
    use linkdyn_planar_pass, only: evaluate_planar
    implicit none (type, external)
    private
    public :: assembly_trail, follow_assembly

    ! The sine of the transmission angle is known to about sqrt(epsilon), its rate loses its digits below 10 times that.
    real(wp), parameter :: untrusted = 7*sqrt(epsilon(1.0_wp))
    real(wp), parameter :: near_dead = 50*untrusted
    real(wp), parameter :: look_ahead = 1.5_wp      !! steps: a dead point at the very end of a step must not be missed
    integer, parameter :: deepest = 12              !! cuts of a step into `lanes` parts

    !> Where the motion stood last.
    type :: assembly_trail
        logical :: has_begun = .false.
        logical :: is_needed = .false.              !! the model has dyads with two branches
        real(wp), allocatable :: q(:)               !! (n_q)
        real(wp), allocatable :: branch(:)          !! (n_dyad)
        logical, allocatable :: has_branches(:)     !! (n_dyad)
        type(kinematic_state) :: state
    end type assembly_trail

contains

    !> Branches at samples that follow each other and those of the last call.
    subroutine follow_assembly(model, q, trail, branch)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        type(assembly_trail), intent(inout) :: trail
        real(wp), intent(out) :: branch(:, :)        !! (n_dyad, n)
        logical :: doubtful(lanes, model%n_dyad)
        integer :: n, i, next, lane

        n = size(q, 2)
        if (.not. trail%has_begun) call begin_trail(model, q(:, 1), trail)
        if (.not. trail%is_needed) then
            branch = spread(model%branch, 2, n)
            return
        end if
        call pass_step(model, trail%q, q(:, 1), 0, trail)
        branch(:, 1) = trail%branch
        i = 1
        do while (i < n)
            do lane = 1, lanes
                next = min(i + lane, n)
                trail%state%q(lane, :) = q(:, min(i + lane - 1, n))
                trail%state%qd(lane, :) = q(:, next) - q(:, min(i + lane - 1, n))
            end do
            call find_doubts(model, trail, doubtful)
            do lane = 1, lanes
                if (i == n) exit
                if (any(doubtful(lane, :))) then
                    call pass_step(model, q(:, i), q(:, i + 1), 0, trail)
                    i = i + 1
                    branch(:, i) = trail%branch
                    exit
                end if
                i = i + 1
                branch(:, i) = trail%branch
            end do
        end do
        trail%q = q(:, n)
    end subroutine follow_assembly

    subroutine begin_trail(model, q, trail)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:)
        type(assembly_trail), intent(inout) :: trail
        integer :: i

        trail%has_begun = .true.
        trail%q = q
        trail%branch = model%branch
        allocate (trail%has_branches(model%n_dyad))
        trail%has_branches = .false.
        do i = 1, size(model%step)
            if (any(model%step(i)%kind == [step_rrr, step_rrp, step_rpr])) trail%has_branches(model%step(i)%first) = .true.
        end do
        trail%is_needed = any(trail%has_branches)
        if (trail%is_needed) call prepare_kinematics(model, 0, trail%state)
    end subroutine begin_trail

    !> Evaluate the block in the state, `qd` being the way to the next sample: will a transmission change its sign?
    subroutine find_doubts(model, trail, doubtful)
        type(model_type), intent(in) :: model
        type(assembly_trail), intent(inout) :: trail
        logical, intent(out) :: doubtful(lanes, model%n_dyad)
        real(wp) :: determinant(lanes)
        integer :: d

        trail%state%qdd = 0
        do d = 1, model%n_dyad
            trail%state%plane%branch(:, d) = trail%branch(d)
        end do
        call evaluate_planar(model, trail%state)
        do d = 1, model%n_dyad
            determinant = trail%state%plane%dyad(d)%determinant
            doubtful(:, d) = trail%has_branches(d) .and. .not. trail%state%unreachable &
                             .and. determinant*(determinant + look_ahead*trail%state%plane%drift(:, d)) < 0 &
                             .and. transmission_sine(trail%state%plane%dyad(d)) > untrusted
        end do
    end subroutine find_doubts

    !> Go from one position to another, in parts.
    recursive subroutine pass_step(model, from, to, depth, trail)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: from(:), to(:)       !! (n_q)
        integer, intent(in) :: depth
        type(assembly_trail), intent(inout) :: trail
        logical :: doubtful(lanes, model%n_dyad), is_near(model%n_dyad)
        real(wp) :: part(model%n_q)
        integer :: done, lane, d

        part = (to - from)/lanes
        if (all(part == 0)) return
        done = 0
        do while (done < lanes)
            do lane = 1, lanes
                trail%state%q(lane, :) = from + (lane - 1)*part
                trail%state%qd(lane, :) = part
            end do
            call find_doubts(model, trail, doubtful)
            do lane = done + 1, lanes
                if (any(doubtful(lane, :))) exit
            end do
            if (lane > lanes) return
            do d = 1, model%n_dyad
                is_near(d) = doubtful(lane, d) .and. depth < deepest
                if (is_near(d)) is_near(d) = sine_at(trail, d, lane) <= near_dead
            end do
            if (any(is_near)) then
                call pass_dead_points(model, from + (lane + 2)*part, is_near, trail)
            else if (depth < deepest) then
                call pass_step(model, from + (lane - 1)*part, from + lane*part, depth + 1, trail)
            end if
            done = lane
        end do
    end subroutine pass_step

    real(wp) function sine_at(trail, dyad, lane) result(sine)
        type(assembly_trail), intent(in) :: trail
        integer, intent(in) :: dyad, lane
        real(wp) :: all_sines(lanes)

        all_sines = transmission_sine(trail%state%plane%dyad(dyad))
        sine = all_sines(lane)
    end function sine_at

    !> Change the branches of the dyads at their dead points, unless their loops cannot close beyond.
    subroutine pass_dead_points(model, beyond, is_near, trail)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: beyond(:)            !! (n_q), a little further on
        logical, intent(in) :: is_near(:)
        type(assembly_trail), intent(inout) :: trail
        integer :: d

        where (is_near) trail%branch = -trail%branch
        do d = 1, model%n_dyad
            trail%state%plane%branch(:, d) = trail%branch(d)
        end do
        trail%state%q = spread(beyond, 1, lanes)
        call evaluate_planar(model, trail%state)
        if (trail%state%unreachable(1)) where (is_near) trail%branch = -trail%branch
    end subroutine pass_dead_points
end module linkdyn_assembly_trail
