!> What laws over the state give at the samples of a batch: loads with them, and the pull of springs. For whoever computes forces by
!> a record, which takes these as inputs, and for whoever wants to see them.
module linkdyn_load_laws
    use linkdyn_assembly_trail, only: sample_assembly, place_sample
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, velocities_only
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_measures, only: find_laws
    use linkdyn_model, only: model_type, has_assemblies
    use linkdyn_scene, only: law_spec, law_over
    use linkdyn_threads, only: team_size
    implicit none (type, external)
    private
    public :: evaluate_load_laws

contains

    !> Loads at all samples, and what springs' own laws pull. Not a number where a law has no value, or a loop does not close.
    subroutine evaluate_load_laws(model, threads, q, qd, t, load, assembly, with_laws, pull)
        type(model_type), intent(in) :: model
        integer, intent(in) :: threads
        real(wp), intent(in) :: q(:, :), qd(:, :)                !! (n_q, n)
        real(wp), intent(in) :: t(:)                             !! [s] (n), or one for all
        real(wp), intent(in) :: load(:, :, :)                    !! what is given beside the laws (6, n_load, n), or one for all
        type(sample_assembly), intent(in) :: assembly            !! of each sample, or one for all; not there: none is needed
        real(wp), intent(out) :: with_laws(:, :, :)              !! (6, n_load, n) [N, N m]
        real(wp), intent(out) :: pull(:, :)                      !! (n_spring, n) [N, N m]
        type(kinematic_state) :: state
        integer :: block, n, n_block, n_thread

        n = size(q, 2)
        n_block = (n + lanes - 1)/lanes
        n_thread = team_size(threads, n_block)
        !$omp parallel num_threads(n_thread) default(shared) private(state)
        call prepare_kinematics(model, 0, state)
        state%n_column = velocities_only
        !$omp do schedule(static)
        do block = 1, n_block
            if (is_interrupted()) cycle
            call run_block(1 + (block - 1)*lanes, min(n, block*lanes), state)
        end do
        !$omp end do
        !$omp end parallel

    contains

        subroutine run_block(first, last, state)
            integer, intent(in) :: first, last
            type(kinematic_state), intent(inout) :: state
            integer :: lane, sample, given, i, k

            do lane = 1, lanes
                sample = min(first + lane - 1, last)
                state%q(lane, :) = q(:, sample)
                state%qd(lane, :) = qd(:, sample)
                state%time(lane) = t(min(sample, size(t)))
                if (has_assemblies(model)) call place_sample(model, assembly, min(sample, size(assembly%status)), lane, state)
            end do
            call evaluate_kinematics(model, state)
            call find_laws(model, state)
            do sample = first, last
                lane = sample - first + 1
                given = min(sample, size(load, 3))
                do i = 1, model%n_load
                    associate (spec => model%scene%load(i))
                        do k = 1, 3
                            with_laws(k, i, sample) = load(k, i, given) + value_of(spec%force(k), state, lane)
                            with_laws(3 + k, i, sample) = load(3 + k, i, given) + value_of(spec%moment(k), state, lane)
                        end do
                    end associate
                end do
                do i = 1, size(model%scene%spring)
                    pull(i, sample) = value_of(model%scene%spring(i)%force, state, lane)
                end do
            end do
        end subroutine run_block

        pure real(wp) function value_of(law, state, lane)
            type(law_spec), intent(in) :: law
            type(kinematic_state), intent(in) :: state
            integer, intent(in) :: lane

            value_of = 0
            if (law%kind == law_over) value_of = state%law(lane, law%law)
        end function value_of
    end subroutine evaluate_load_laws
end module linkdyn_load_laws
