!> The assembly of every dyad along a motion: which branch it is on at each sample, by continuity.
!>
!> A dyad changes its branch where its transmission angle passes through zero, as a parallelogram does when it is flat.
!> Samples are therefore looked at in their order, `lanes` at a time: velocity tells whether the transmission of a dyad
!> will have changed its sign at the next sample. Where it might, the step is cut into finer ones until either the
!> mechanism is seen to turn back before the dead point or the dead point is reached to within `near_dead`, and passed
!> in the direction of the motion. What is nearer to a dead point than that cannot be told from passing through it.
!>
!> Groups closed by iteration set out, every `lanes` samples, from the assembly of the sample where they did last.
!>
!> A sample on its own, outside a motion, is on the branch of the start.
module linkdyn_assembly_trail
    use linkdyn_dyad_map, only: transmission_sine
    use linkdyn_group_motion, only: begin_iteration
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: evaluate_kinematics
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_rrr, step_rrp, step_rpr, place_size
    implicit none (type, external)
    private
    public :: assembly_trail, sample_assembly, follow_assembly, make_room, place_sample, keep_lane
    public :: begin_trail, cross_step, untrusted, look_ahead

    ! The sine of the transmission angle is known to about sqrt(epsilon), its rate loses its digits below 10 times that.
    real(wp), parameter :: untrusted = 7*sqrt(epsilon(1.0_wp))
    real(wp), parameter :: near_dead = 50*untrusted
    real(wp), parameter :: look_ahead = 1.5_wp      !! steps: a dead point at the very end of a step must not be missed
    integer, parameter :: deepest = 12              !! cuts of a step into `lanes` parts
    integer, parameter :: most_blocks = 40          !! looked at in one step; a step that needs more has no meaning

    !> On which assembly each of some samples is to be computed.
    type :: sample_assembly
        real(wp), allocatable :: branch(:, :)       !! (n_dyad, n)
        real(wp), allocatable :: q(:, :)            !! coordinates at which groups set out (n_q, n)
        real(wp), allocatable :: place(:, :, :)     !! of their links there (place_size, n_link, n)
        real(wp), allocatable :: counted(:, :)      !! see `kinematic_state`; absent: no coordinate stands in (n_q, n)
    end type sample_assembly

    !> Where the motion stood last.
    type :: assembly_trail
        logical :: has_begun = .false.
        logical :: is_needed = .false.              !! the model has dyads with two branches, or groups
        real(wp), allocatable :: q(:)               !! (n_q)
        real(wp), allocatable :: branch(:)          !! (n_dyad)
        real(wp) :: rest = 0                        !! no dead point is looked for this far ahead, one having just been passed
        real(wp) :: clear = 0                       !! the same, as part of the step under way
        integer :: n_block = 0                      !! looked at in the step under way
        logical, allocatable :: has_branches(:)     !! (n_dyad)
        type(kinematic_state) :: state
    end type assembly_trail

contains

    !> Room for n samples, on the assembly of the start.
    subroutine make_room(model, n, assembly)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n
        type(sample_assembly), intent(out) :: assembly
        integer :: g, i

        assembly%branch = spread(model%branch, 2, n)
        if (size(model%group) == 0) return
        assembly%q = spread(model%start_q, 2, n)
        allocate (assembly%place(place_size(model), model%n_link, n))
        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                assembly%place(:, model%group(g)%link(i), :) = spread(model%group(g)%start(:, i), 2, n)
            end do
        end do
    end subroutine make_room

    !> Put a lane of the state on the assembly of a sample.
    subroutine place_sample(model, assembly, sample, lane, state)
        type(model_type), intent(in) :: model
        type(sample_assembly), intent(in) :: assembly
        integer, intent(in) :: sample, lane
        type(kinematic_state), intent(inout) :: state
        integer :: g, i

        if (model%n_dyad > 0) state%plane%branch(lane, :) = assembly%branch(:, sample)
        if (allocated(assembly%counted)) state%counted(lane, :) = assembly%counted(:, sample)
        if (size(model%group) == 0) return
        state%group%start_q(lane, :) = assembly%q(:, sample)
        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    state%group%start_place(lane, :, l) = assembly%place(:, l, sample)
                end associate
            end do
        end do
    end subroutine place_sample

    !> Where a lane's groups have been closed, for samples i to j.
    subroutine keep_lane(model, state, lane, i, j, assembly)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: lane, i, j
        type(sample_assembly), intent(inout) :: assembly
        integer :: g, k, sample

        do sample = i, j
            assembly%q(:, sample) = state%q(lane, :)
            do g = 1, size(model%group)
                do k = 1, size(model%group(g)%link)
                    associate (l => model%group(g)%link(k))
                        assembly%place(:, l, sample) = state%group%place(lane, :, l)
                    end associate
                end do
            end do
        end do
    end subroutine keep_lane

    !> Assembly at samples that follow each other and those of the last call.
    subroutine follow_assembly(model, q, trail, assembly)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        type(assembly_trail), intent(inout) :: trail
        type(sample_assembly), intent(out) :: assembly
        integer :: n, i

        n = size(q, 2)
        if (.not. trail%has_begun) call begin_trail(model, q(:, 1), trail)
        call make_room(model, n, assembly)
        if (any(trail%has_branches)) call follow_branches(model, q, trail, assembly%branch)
        if (size(model%group) == 0) return
        trail%state%qd = 0
        trail%state%qdd = 0
        do i = 1, n, lanes
            trail%state%q = spread(q(:, i), 1, lanes)
            if (model%n_dyad > 0) trail%state%plane%branch = spread(assembly%branch(:, i), 1, lanes)
            call evaluate_kinematics(model, trail%state)
            associate (state => trail%state, group => trail%state%group)
                ! Where the links cannot be placed, the next samples set out from where they last could.
                if (.not. (state%unreachable(1) .or. state%not_converged(1))) then
                    group%start_place = group%place
                    group%start_q = state%q
                end if
                call begin_iteration(group)
                trail%state%q = group%start_q
            end associate
            call keep_lane(model, trail%state, 1, i, min(n, i + lanes - 1), assembly)
        end do
    end subroutine follow_assembly

    !> Branches of the dyads at samples that follow each other.
    subroutine follow_branches(model, q, trail, branch)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        type(assembly_trail), intent(inout) :: trail
        real(wp), intent(out) :: branch(:, :)        !! (n_dyad, n)
        logical :: doubtful(lanes, model%n_dyad)
        integer :: n, i, next, lane

        n = size(q, 2)
        call go_on(trail%q, q(:, 1))
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
                    call go_on(q(:, i), q(:, i + 1))
                    i = i + 1
                    branch(:, i) = trail%branch
                    exit
                end if
                i = i + 1
                branch(:, i) = trail%branch
            end do
        end do
        trail%q = q(:, n)

    contains

        subroutine go_on(from, to)
            real(wp), intent(in) :: from(:), to(:)
            real(wp) :: branch_there(model%n_dyad), rest

            branch_there = trail%branch
            rest = trail%rest
            call cross_step(model, from, to, trail, branch_there, rest)
            trail%rest = rest
        end subroutine go_on
    end subroutine follow_branches

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
        trail%is_needed = any(trail%has_branches) .or. size(model%group) > 0
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
        call evaluate_kinematics(model, trail%state)
        do d = 1, model%n_dyad
            determinant = trail%state%plane%dyad(d)%determinant
            doubtful(:, d) = trail%has_branches(d) .and. .not. trail%state%unreachable &
                             .and. determinant*(determinant + look_ahead*trail%state%plane%drift(:, d)) < 0 &
                             .and. transmission_sine(trail%state%plane%dyad(d)) > untrusted
        end do
    end subroutine find_doubts

    !> The branches after a step between two positions, from those before it.
    subroutine cross_step(model, from, to, trail, branch, clear)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: from(:), to(:)       !! (n_q)
        type(assembly_trail), intent(inout) :: trail !! its groups set out from `from`
        real(wp), intent(inout) :: branch(:)         !! (n_dyad)
        real(wp), intent(inout) :: clear             !! how far ahead no dead point is looked for, one having just been passed
        real(wp) :: length

        length = norm2(to - from)
        if (length == 0) return
        trail%branch = branch
        trail%clear = clear/length
        trail%n_block = 0
        call pass_part(model, from, to - from, 0.0_wp, 1.0_wp, 0, trail)
        branch = trail%branch
        clear = max(0.0_wp, (trail%clear - 1)*length)
    end subroutine cross_step

    !> Go a part of the way from a position, in smaller parts.
    recursive subroutine pass_part(model, from, way, first, last, depth, trail)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: from(:), way(:)      !! (n_q)
        real(wp), intent(in) :: first, last          !! of the way
        integer, intent(in) :: depth
        type(assembly_trail), intent(inout) :: trail
        logical :: doubtful(lanes, model%n_dyad)
        real(wp) :: part, at(lanes + 1), sine(lanes, model%n_dyad)
        integer :: done, lane, d

        part = (last - first)/lanes
        done = 0
        do while (done < lanes)
            at = [(max(first + (lane - 1)*part, trail%clear), lane=1, lanes + 1)]
            do lane = 1, lanes
                trail%state%q(lane, :) = from + at(lane)*way
                trail%state%qd(lane, :) = (at(lane + 1) - at(lane))*way
            end do
            call find_doubts(model, trail, doubtful)
            trail%n_block = trail%n_block + 1
            do lane = done + 1, lanes
                if (any(doubtful(lane, :))) exit
            end do
            if (lane > lanes .or. depth == deepest .or. trail%n_block > most_blocks) return
            do d = 1, model%n_dyad
                sine(:, d) = transmission_sine(trail%state%plane%dyad(d))
            end do
            if (all(sine(lane, :) <= near_dead .or. .not. doubtful(lane, :))) then
                trail%clear = at(lane) + 3*part
                call pass_dead_points(model, from + trail%clear*way, doubtful(lane, :), trail)
            else
                call pass_part(model, from, way, at(lane), at(lane + 1), depth + 1, trail)
            end if
            done = lane
        end do
    end subroutine pass_part

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
        call evaluate_kinematics(model, trail%state)
        if (trail%state%unreachable(1)) where (is_near) trail%branch = -trail%branch
    end subroutine pass_dead_points
end module linkdyn_assembly_trail
