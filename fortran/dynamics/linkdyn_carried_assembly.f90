!> The assembly carried along a run of forward dynamics, on every lane: that of the last state accepted.
!>
!> An integrator tries positions ahead of the accepted one, in no fixed order, and may reject them. All of them are
!> computed on the branches of the accepted state, unless a dyad may have passed a dead point on the way; then the way
!> from the accepted position is followed in finer steps. Groups closed by iteration set out from the accepted position.
module linkdyn_carried_assembly
    use linkdyn_assembly_trail, only: assembly_trail, sample_assembly, begin_trail, cross_step, keep_lane, untrusted, look_ahead
    use linkdyn_dyad_map, only: transmission_sine
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: evaluate_kinematics
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, has_assemblies
    implicit none (type, external)
    private
    public :: carried_assembly, begin_assembly, evaluate_on_assembly, accept_assembly, keep_evaluated

    type :: carried_assembly
        logical :: is_needed = .false.                 !! the model has more than one assembly
        real(wp) :: t(lanes) = 0                       !! accepted [s]
        real(wp), allocatable :: q(:, :)               !! there                          (lane, n_q)
        real(wp), allocatable :: branch(:, :)          !!                                (lane, n_dyad)
        real(wp), allocatable :: determinant(:, :)     !! of the dyads' maps             (lane, n_dyad)
        real(wp), allocatable :: drift(:, :)           !! its rate; 0 where untrusted    (lane, n_dyad)
        real(wp) :: clear(lanes) = 0                   !! no dead point is looked for this far ahead
        real(wp) :: clear_tried(lanes) = 0             !! the same at the state tried last
        real(wp), allocatable :: place(:, :, :)        !! of the groups' links           (lane, place_size, n_link)
        type(kinematic_state) :: state                 !! scratch: positions and velocities of the state to be accepted
        type(assembly_trail), private :: trail         !! scratch: ways in fine steps
    end type carried_assembly

contains

    !> Begin on the assembly of the scene's start.
    subroutine begin_assembly(model, t, assembly)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t                      !! [s]
        type(carried_assembly), intent(out) :: assembly

        if (.not. has_assemblies(model)) return
        call begin_trail(model, model%start_q, assembly%trail)
        assembly%is_needed = assembly%trail%is_needed
        if (.not. assembly%is_needed) return
        assembly%t = t
        assembly%q = spread(model%start_q, 1, lanes)
        assembly%branch = spread(model%branch, 1, lanes)
        assembly%determinant = 0*assembly%branch
        assembly%drift = assembly%determinant
        call prepare_kinematics(model, 0, assembly%state)
        if (size(model%group) == 0) return
        assembly%place = assembly%state%group%start_place
    end subroutine begin_assembly

    !> Kinematics of a state tried, on the assembly that leads there.
    subroutine evaluate_on_assembly(model, t, assembly, state)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! [s]
        type(carried_assembly), intent(inout) :: assembly
        type(kinematic_state), intent(inout) :: state
        logical :: doubtful(lanes)
        real(wp) :: branch(lanes, model%n_dyad)

        if (model%n_dyad > 0) state%plane%branch = assembly%branch
        if (size(model%group) > 0) then
            state%group%start_q = assembly%q
            state%group%start_place = assembly%place
        end if
        call evaluate_kinematics(model, state)
        assembly%clear_tried = 0
        doubtful = may_have_passed(assembly, t, state)
        if (.not. any(doubtful)) return
        branch = assembly%branch
        assembly%clear_tried = merge(assembly%clear, 0.0_wp, doubtful)
        call follow_ways(model, doubtful, assembly, state%q, branch)
        if (all(branch == assembly%branch)) return
        state%plane%branch = branch
        call evaluate_kinematics(model, state)
    end subroutine evaluate_on_assembly

    !> May a dyad have passed a dead point since the accepted state? Its map's determinant, led on by its rate from the
    !> accepted state, or back from the one tried, would have changed its sign.
    function may_have_passed(assembly, t, state) result(doubtful)
        type(carried_assembly), intent(in) :: assembly
        real(wp), intent(in) :: t(lanes)
        type(kinematic_state), intent(in) :: state
        logical :: doubtful(lanes)
        real(wp) :: ahead(lanes)
        integer :: d

        ! On the wrong branch the loops behind the dyad may not close.
        doubtful = state%unreachable .and. any(assembly%trail%has_branches)
        ahead = look_ahead*(t - assembly%t)
        do d = 1, size(assembly%branch, 2)
            if (.not. assembly%trail%has_branches(d)) cycle
            associate (before => assembly%determinant(:, d), now => state%plane%dyad(d)%determinant)
                doubtful = doubtful .or. before*(before + ahead*assembly%drift(:, d)) < 0 &
                           .or. now*(now - ahead*state%plane%drift(:, d)) < 0
            end associate
        end do
    end function may_have_passed

    !> Branches at the positions tried, lane by lane, along the straight way from the accepted ones.
    subroutine follow_ways(model, doubtful, assembly, q, branch)
        type(model_type), intent(in) :: model
        logical, intent(in) :: doubtful(lanes)
        type(carried_assembly), intent(inout) :: assembly
        real(wp), intent(in) :: q(:, :)                !! (lane, n_q)
        real(wp), intent(inout) :: branch(:, :)        !! (lane, n_dyad)
        integer :: lane

        do lane = 1, lanes
            if (.not. doubtful(lane)) cycle
            if (lane > 1) then
                ! A run on its own has the same state on every lane.
                if (doubtful(lane - 1) .and. all(q(lane, :) == q(lane - 1, :)) &
                    .and. all(assembly%q(lane, :) == assembly%q(lane - 1, :)) &
                    .and. all(assembly%branch(lane, :) == assembly%branch(lane - 1, :))) then
                    branch(lane, :) = branch(lane - 1, :)
                    assembly%clear_tried(lane) = assembly%clear_tried(lane - 1)
                    cycle
                end if
            end if
            if (size(model%group) > 0) then
                associate (group => assembly%trail%state%group)
                    group%start_q = spread(assembly%q(lane, :), 1, lanes)
                    group%start_place = spread(assembly%place(lane, :, :), 1, lanes)
                end associate
            end if
            call cross_step(model, assembly%q(lane, :), q(lane, :), assembly%trail, branch(lane, :), &
                            assembly%clear_tried(lane))
        end do
    end subroutine follow_ways

    !> Go on to a new accepted state: `assembly%state` holds its coordinates and rates.
    subroutine accept_assembly(model, t, is_accepted, assembly)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! [s]
        logical, intent(in) :: is_accepted(lanes)      !! other lanes stay where they are
        type(carried_assembly), intent(inout) :: assembly
        logical :: stays(lanes)
        integer :: d, k, l

        call evaluate_on_assembly(model, t, assembly, assembly%state)
        associate (state => assembly%state)
            stays = .not. is_accepted .or. state%unreachable .or. state%not_converged
            where (.not. stays)
                assembly%t = t
                assembly%clear = assembly%clear_tried
            end where
            do k = 1, model%n_q
                where (.not. stays) assembly%q(:, k) = state%q(:, k)
            end do
            do d = 1, model%n_dyad
                where (.not. stays)
                    assembly%branch(:, d) = state%plane%branch(:, d)
                    assembly%determinant(:, d) = state%plane%dyad(d)%determinant
                    assembly%drift(:, d) = merge(state%plane%drift(:, d), 0.0_wp, &
                                                 transmission_sine(state%plane%dyad(d)) > untrusted)
                end where
            end do
            if (size(model%group) == 0) return
            do l = 1, model%n_link
                do k = 1, size(assembly%place, 2)
                    where (.not. stays) assembly%place(:, k, l) = state%group%place(:, k, l)
                end do
            end do
        end associate
    end subroutine accept_assembly

    !> The assembly of lane 1 of a state evaluated, for a sample.
    subroutine keep_evaluated(model, state, sample, samples)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: sample
        type(sample_assembly), intent(inout) :: samples

        if (model%n_dyad > 0 .and. allocated(samples%branch)) samples%branch(:, sample) = state%plane%branch(1, :)
        if (size(model%group) > 0) call keep_lane(model, state, 1, sample, sample, samples)
    end subroutine keep_evaluated
end module linkdyn_carried_assembly
