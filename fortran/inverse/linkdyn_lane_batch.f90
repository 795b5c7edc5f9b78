!> Samples of a batch on lanes: those that no record does.
!>
!> Samples are independent. They are taken in blocks of `lanes`, blocks are shared out to threads, and a block's arithmetic does not
!> depend on which thread runs it, so the results do not either. A sample that fails is NaN.
module linkdyn_lane_batch
    use linkdyn_assembly_trail, only: sample_assembly, place_sample
    use linkdyn_result_kinds, only: result_reaction, result_joint_push, result_qdd, result_rcond, &
        result_singularity_distance, result_transmission_angle, result_driving_force_error, result_reaction_error
    use linkdyn_closed_forms, only: transmission_angles
    use linkdyn_condition, only: eliminate_block, find_rcond
    use linkdyn_dense, only: hold_blas_threads, release_blas_threads
    use linkdyn_equations, only: equation_workspace, want_of, solve_block, found_of, wanted_to_share
    use linkdyn_error_probe, only: probe_space, prepare_probe_space, estimate_errors
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_inverse_results, only: inverse_results, wanted_ids, forces_beside, make_undefined, may_be_infinite
    use linkdyn_inverse_solver, only: inverse_solver, thread_space, take_space, return_space
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: link_position, link_rotation
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_results, only: block_measures, measure_block, values_of_block, tell_accelerations
    use linkdyn_model, only: model_type, has_assemblies
    use linkdyn_motion_batch, only: motion_batch
    use linkdyn_scatter_check, only: need_look, surely_certain
    use linkdyn_shared_reactions, only: share_reactions
    use linkdyn_singularity, only: find_singularity_distance
    use linkdyn_status, only: sample_ok, sample_undefined, sample_locked
    use linkdyn_threads, only: team_size
    implicit none (type, external)
    private
    public :: lane_batch, run_on_lanes

    integer, parameter :: largest_share = 8    !! blocks that a thread takes at a time: their work outweighs the taking

    !> Where links are at the samples done: for who shares reactions afterwards.
    type :: noted_places
        real(wp), allocatable :: position(:, :, :)              !! (3, n_link, sample)
        real(wp), allocatable :: rotation(:, :, :, :)           !! (3, 3, n_link, sample)
        integer, allocatable :: status(:)                       !! `sample_*` (sample)
        real(wp), allocatable :: push(:, :, :)                  !! what acts at joints beside reactions; there if links give way
                                                                !! (n_component, n_joint, sample)
    end type noted_places

    type :: lane_batch
        type(motion_batch) :: motion
        integer :: threads = 1                                  !! at most
        type(sample_assembly), pointer :: stand => null()       !! where samples are looked for
        logical :: has_own_stand = .false.                      !! each sample; false: all set out from the first
        type(model_type), pointer :: own => null()              !! for whose coordinates the model's stand in; null: there is none
        logical :: shares = .false.                             !! reactions that the equations leave open
        integer :: n = 0                                        !! samples to be done
        integer, allocatable :: sample(:)                       !! which these are; absent: all
        ! ---- what is found beside results
        integer :: n_dense = 0                                  !! samples that the planned elimination handed to the dense solver
        integer, allocatable :: holding(:)                      !! contact that holds a sample fast; 0: none (all samples)
        ! ---- while it runs
        integer, allocatable, private :: wanted(:)              !! of the forces: `result_*`
        integer, allocatable, private :: told(:)                !! all results that are wanted: `result_*`
        type(noted_places), private :: noted
    contains
        procedure, private :: sample_at
    end type lane_batch

contains

    !> The samples of a batch, in blocks shared out to threads.
    subroutine run_on_lanes(model, solver, batch, results)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        type(lane_batch), intent(inout) :: batch
        type(inverse_results), intent(inout) :: results
        type(thread_space), pointer :: space
        integer :: n_block, n_thread, share, block, n_dense

        if (batch%n == 0) return
        call plan_results(model, results, batch)
        n_dense = 0
        n_block = (batch%n + lanes - 1)/lanes
        n_thread = team_size(batch%threads, n_block)
        share = max(1, min(largest_share, n_block/(2*n_thread)))
        call hold_blas_threads()
        !$omp parallel num_threads(n_thread) default(shared) private(space)
        call take_space(model, solver, space)
        !$omp do schedule(dynamic, share) reduction(+:n_dense)
        do block = 1, n_block
            if (is_interrupted()) cycle
            call run_block(model, solver, (block - 1)*lanes, batch, results, space)
            n_dense = n_dense + count(space%workspace%fell_back(:min(lanes, batch%n - (block - 1)*lanes)))
        end do
        !$omp end do
        call return_space(solver, space)
        !$omp end parallel
        call release_blas_threads()
        batch%n_dense = batch%n_dense + n_dense
        if (batch%shares .and. .not. is_interrupted()) call share_noted(model, batch, results)
    end subroutine run_on_lanes

    !> What is told of samples, and what is asked of the equations for it.
    subroutine plan_results(model, results, batch)
        type(model_type), intent(in) :: model
        type(inverse_results), intent(in) :: results
        type(lane_batch), intent(inout) :: batch
        type(noted_places) :: nothing

        batch%told = wanted_ids(results)
        batch%wanted = forces_beside(results)
        batch%noted = nothing
        if (.not. batch%shares) return
        associate (noted => batch%noted, n => batch%n, n_link => model%n_link)
            allocate (noted%position(3, n_link, n), noted%rotation(3, 3, n_link, n), noted%status(n))
            if (.not. results%wants(result_reaction)) return
            batch%wanted = [batch%wanted, wanted_to_share(model)]
            if (size(model%arm) > 0) allocate (noted%push(model%n_component, model%n_joint, n))
        end associate
    end subroutine plan_results

    !> Number of a sample by its place among those to be done.
    pure integer function sample_at(self, place)
        class(lane_batch), intent(in) :: self
        integer, intent(in) :: place

        sample_at = place
        if (allocated(self%sample)) sample_at = self%sample(place)
    end function sample_at

    ! ---------------------------------------------------------------- one block

    !> One block from samples to samples.
    subroutine run_block(model, solver, before, batch, results, space)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        integer, intent(in) :: before                   !! places before the block's
        type(lane_batch), intent(inout) :: batch
        type(inverse_results), intent(inout) :: results
        type(thread_space), intent(inout) :: space

        associate (workspace => space%workspace)
            workspace%state%time = 0
            call gather(model, before, batch, workspace)
            workspace%fell_back = .false.
            call want_of(workspace, batch%wanted)
            call solve_block(model, solver%equations, workspace)
            if (any(workspace%is_doubtful)) call look_again(model, solver, before, batch, results, space)
            call take_reactions(results, workspace, space%reaction)
            if (allocated(solver%probe)) then
                call estimate_errors(model, solver%probe, workspace, space%reaction, results%wants(result_reaction), space%probe)
                workspace%error = space%probe%worst
            end if
            if (associated(solver%condition)) then
                call eliminate_block(solver%condition, workspace%state, workspace%numbers, space%condition)
                if (results%wants(result_rcond)) &
                    call find_rcond(solver%condition, workspace%state, space%condition, workspace%rcond)
                if (results%wants(result_singularity_distance)) call find_singularity_distance( &
                    model, solver%condition, workspace%state, space%condition, space%singularity, space%measures%distance)
            end if
            call measure_block(model, results, workspace%state, space%measures)
            if (results%wants(result_qdd)) &
                call tell_accelerations(model, solver%equations, associated(batch%own), workspace)
        end associate
        call scatter(model, before, space, batch, results)
    end subroutine run_block

    !> Samples into lanes; lanes beyond the last sample repeat it.
    subroutine gather(model, before, batch, workspace)
        type(model_type), intent(in) :: model
        integer, intent(in) :: before                   !! places before the block's
        type(lane_batch), intent(in) :: batch
        type(equation_workspace), intent(inout) :: workspace
        integer :: lane, sample
        logical :: has_stand

        has_stand = has_assemblies(model) .or. associated(batch%own)
        associate (motion => batch%motion, state => workspace%state)
            state%by_quaternion = .false.
            if (associated(motion%quaternion)) &
                state%by_quaternion = any(motion%quaternion(:, :, batch%sample_at(before + 1)) /= 0, dim=1)
            do lane = 1, lanes
                sample = batch%sample_at(min(before + lane, batch%n))
                state%q(lane, :) = motion%q(:, sample)
                state%qd(lane, :) = motion%qd(:, sample)
                state%qdd(lane, :) = motion%qdd(:, sample)
                if (associated(motion%t)) state%time(lane) = motion%t(min(sample, size(motion%t)))
                if (associated(motion%stop_force)) state%stop_force(lane, :) = motion%stop_force(:, sample)
                if (associated(motion%clutch_force)) state%clutch_force(lane, :) = motion%clutch_force(:, sample)
                if (associated(motion%contact_sense) .and. size(model%contact) > 0) &
                    workspace%friction%sense(lane, :, :size(model%contact)) = motion%contact_sense(:, :, sample)
                if (model%n_load > 0) workspace%load(lane, :, :) = motion%load(:, :, min(sample, size(motion%load, 3)))
                if (associated(motion%quaternion)) state%quaternion(lane, :, :) = motion%quaternion(:, :, sample)
                if (associated(motion%given_force)) workspace%driving_force(lane, :) = motion%given_force(:, sample)
                if (has_stand) call place_sample(model, batch%stand, merge(sample, 1, batch%has_own_stand), lane, state)
            end do
        end associate
    end subroutine gather

    !> Lanes that are doubtful are taken where their forces hardly scatter.
    subroutine look_again(model, solver, before, batch, results, space)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        integer, intent(in) :: before                   !! places before the block's
        type(lane_batch), intent(in) :: batch
        type(inverse_results), intent(in) :: results
        type(thread_space), intent(inout) :: space
        integer :: flagged(lanes)
        logical :: is_doubtful(lanes)

        if (associated(batch%motion%given_force) .or. .not. associated(solver%look)) return
        call need_look(model, solver%equations%solver, solver%equations%wants_reactions, solver%look)
        if (.not. solver%look%is_usable) return
        associate (workspace => space%workspace, doubt => space%doubt)
            if (.not. allocated(doubt%workspace)) call prepare_probe_space(solver%look%probe, doubt)
            flagged = workspace%status
            is_doubtful = workspace%is_doubtful
            workspace%checks_accuracy = .false.
            call gather(model, before, batch, workspace)
            workspace%fell_back = .false.
            call solve_block(model, solver%equations, workspace)
            workspace%checks_accuracy = .true.
            call take_reactions(results, workspace, space%reaction)
            call estimate_errors(model, solver%look%probe, workspace, space%reaction, results%wants(result_reaction), doubt)
            where (.not. (is_doubtful .and. doubt%worst <= surely_certain)) workspace%status = flagged
        end associate
    end subroutine look_again

    !> For estimates and samples alike, if they are wanted.
    subroutine take_reactions(results, workspace, reaction)
        type(inverse_results), intent(in) :: results
        type(equation_workspace), intent(in) :: workspace
        real(wp), intent(inout) :: reaction(:, :, :)    !! (lane, n_component, n_joint)

        if (results%wants(result_reaction)) &
            reaction = reshape(found_of(workspace, result_reaction, size(reaction)/lanes), shape(reaction))
    end subroutine take_reactions

    !> Lanes into samples; failed ones become NaN. The last check: nothing that is not finite stands beside a good outcome.
    subroutine scatter(model, before, space, batch, results)
        type(model_type), intent(in) :: model
        integer, intent(in) :: before                   !! places before the block's
        type(thread_space), intent(inout) :: space
        type(lane_batch), intent(inout) :: batch
        type(inverse_results), intent(inout) :: results
        real(wp) :: total(lanes)
        integer :: n_here, i, sample, outcome(lanes)

        n_here = min(lanes, batch%n - before)
        total = 0
        do i = 1, size(batch%told)
            associate (id => batch%told(i), width => size(results%of(batch%told(i))%x, 1))
                if (size(space%values, 2) < width) call widen(space, width)
                associate (values => space%values(:, :width))
                    call find_values(model, id, batch%own, space%workspace, space%measures, space%reaction, space%probe, values)
                    if (.not. may_be_infinite(id)) total = total + sum(abs(values), dim=2)
                    call put_lanes(batch, before, n_here, values, results%of(id)%x)
                end associate
            end associate
        end do
        outcome = space%workspace%status
        where (outcome == sample_ok .and. .not. total <= huge(1.0_wp)) outcome = sample_undefined
        do i = 1, n_here
            sample = batch%sample_at(before + i)
            if (associated(results%status)) results%status(sample) = outcome(i)
            if (outcome(i) == sample_locked) batch%holding(sample) = space%workspace%state%holding(i)
            if (outcome(i) /= sample_ok) call make_undefined(results, sample)
        end do
        if (batch%shares) call note_places(model, before, n_here, space%workspace, outcome, batch%noted)
    end subroutine scatter

    !> Room for the values of a wider result.
    subroutine widen(space, width)
        type(thread_space), intent(inout) :: space
        integer, intent(in) :: width

        deallocate (space%values)
        allocate (space%values(lanes, width))
    end subroutine widen

    !> One result of a block.
    subroutine find_values(model, id, own, workspace, measures, reaction, probe, values)
        type(model_type), intent(in) :: model
        integer, intent(in) :: id                       !! one of `result_*`
        type(model_type), pointer, intent(in) :: own    !! whose dyads transmission angles are of; null: the model's
        type(equation_workspace), intent(in) :: workspace
        type(block_measures), intent(in) :: measures
        real(wp), intent(in) :: reaction(:, :, :)       !! (lane, n_component, n_joint)
        type(probe_space), intent(in) :: probe
        real(wp), intent(out) :: values(:, :)           !! (lane, values of a sample)

        select case (id)
        case (result_reaction)
            values = reshape(reaction, shape(values))
        case (result_driving_force_error)
            values = probe%driving_force_error
        case (result_reaction_error)
            values = reshape(probe%reaction_error, shape(values))
        case (result_transmission_angle)
            if (associated(own)) then
                call transmission_angles(own, workspace%state, values)
            else
                call transmission_angles(model, workspace%state, values)
            end if
        case default
            call values_of_block(model, id, workspace, measures, values)
        end select
    end subroutine find_values

    !> The values of one result to their samples.
    subroutine put_lanes(batch, before, n_here, values, to)
        type(lane_batch), intent(in) :: batch
        integer, intent(in) :: before, n_here           !! places before the block's, and these
        real(wp), intent(in) :: values(:, :)            !! (lane, values of a sample)
        real(wp), intent(inout), contiguous :: to(:, :) !! (values of a sample, sample)
        integer :: lane

        do lane = 1, n_here
            to(:, batch%sample_at(before + lane)) = values(lane, :)
        end do
    end subroutine put_lanes

    ! ---------------------------------------------------------------- reactions that the equations leave open

    !> Where the links of a block are, for who shares reactions afterwards.
    subroutine note_places(model, before, n_here, workspace, outcome, noted)
        type(model_type), intent(in) :: model
        integer, intent(in) :: before, n_here           !! places before the block's, and these
        type(equation_workspace), intent(in) :: workspace
        integer, intent(in) :: outcome(:)               !! `sample_*` (lane)
        type(noted_places), intent(inout) :: noted
        real(wp), allocatable :: push(:, :)
        integer :: lane, l

        if (allocated(noted%push)) push = found_of(workspace, result_joint_push, model%n_component*model%n_joint)
        do lane = 1, n_here
            noted%status(before + lane) = outcome(lane)
            do l = 1, model%n_link
                noted%position(:, l, before + lane) = link_position(model, workspace%state, l, lane)
                noted%rotation(:, :, l, before + lane) = link_rotation(model, workspace%state, l, lane)
            end do
            if (allocated(noted%push)) noted%push(:, :, before + lane) = &
                reshape(push(lane, :), [model%n_component, model%n_joint])
        end do
    end subroutine note_places

    !> What the equations leave open, and whether the joints fit that were released: by where the lanes have found the links.
    subroutine share_noted(model, batch, results)
        type(model_type), intent(in) :: model
        type(lane_batch), intent(inout) :: batch
        type(inverse_results), intent(inout) :: results
        real(wp), pointer, contiguous :: reaction(:, :, :)
        integer, allocatable :: which(:)
        integer :: place

        which = [(batch%sample_at(place), place=1, batch%n)]
        associate (noted => batch%noted)
            if (results%wants(result_reaction)) then
                reaction(1:model%n_component, 1:model%n_joint, 1:size(batch%motion%q, 2)) => results%of(result_reaction)%x
                call share_reactions(model, batch%threads, noted%position, noted%rotation, noted%status, which, reaction, &
                                     noted%push)
            else
                call share_reactions(model, batch%threads, noted%position, noted%rotation, noted%status, which)
            end if
            do place = 1, batch%n
                if (noted%status(place) == sample_ok) cycle
                if (associated(results%status)) results%status(which(place)) = noted%status(place)
                call make_undefined(results, which(place))
            end do
        end associate
    end subroutine share_noted
end module linkdyn_lane_batch
