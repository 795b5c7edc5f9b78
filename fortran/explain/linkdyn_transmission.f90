!> A look along the scene's motion: the smallest transmission angle of each planar dyad, and where the loops do not close.
module linkdyn_transmission
    use linkdyn_assembly_trail, only: assembly_trail, sample_assembly, follow_assembly, place_sample
    use linkdyn_closed_forms, only: transmission_angles
    use linkdyn_failure, only: lost_in_words
    use linkdyn_group_motion, only: group_closer
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_status, only: message_len
    implicit none (type, external)
    private
    public :: motion_survey, survey_motion

    integer, parameter :: n_instant = 721     !! half a degree of a crank's turn

    type :: motion_survey
        real(wp), allocatable :: angle(:)                   !! smallest of each dyad (n_dyad) [rad]
        real(wp), allocatable :: time(:)                    !! when [s]
        integer :: n_instant = n_instant                    !! looked at
        integer :: n_failed = 0                             !! at which the mechanism cannot be assembled
        real(wp) :: first_failure = 0                       !! when [s]
        character(len=message_len) :: why = ""              !! it cannot
    end type motion_survey

contains

    !> Instants at which the mechanism cannot be assembled do not count; a dyad that never can keeps a huge angle.
    subroutine survey_motion(model, closer, survey)
        type(model_type), intent(in) :: model
        class(group_closer), pointer, intent(in) :: closer  !! makes the groups' steps; null: nobody else
        type(motion_survey), intent(out) :: survey
        type(kinematic_state) :: state
        type(assembly_trail) :: trail
        type(sample_assembly) :: assembly
        real(wp), dimension(model%n_q, n_instant) :: q, qd, qdd
        real(wp) :: load(6, model%n_load, n_instant), t(n_instant), angles(lanes, model%n_dyad)
        logical :: has_failed(lanes)
        integer :: first, lane, sample, d

        allocate (survey%angle(model%n_dyad), source=huge(1.0_wp))
        allocate (survey%time(model%n_dyad), source=0.0_wp)
        associate (range => model%scene%time)
            t = [(range%first + (range%last - range%first)*(real(sample - 1, wp)/(n_instant - 1)), sample=1, n_instant)]
        end associate
        call evaluate_motion(model, t, q, qd, qdd, load)
        call follow_assembly(model, q, trail, assembly, closer=closer)
        call prepare_kinematics(model, 0, state)
        state%qd = 0
        state%qdd = 0
        do first = 1, n_instant, lanes
            do lane = 1, lanes
                sample = min(first + lane - 1, n_instant)
                state%q(lane, :) = q(:, sample)
                call place_sample(model, assembly, sample, lane, state)
            end do
            call evaluate_kinematics(model, state)
            has_failed = state%unreachable .or. state%not_converged .or. state%branch_lost
            do lane = 1, min(lanes, n_instant - first + 1)
                if (.not. has_failed(lane)) cycle
                if (survey%n_failed == 0) survey%first_failure = t(first + lane - 1)
                survey%n_failed = survey%n_failed + 1
            end do
            call transmission_angles(model, state, angles)
            do d = 1, model%n_dyad
                do lane = 1, min(lanes, n_instant - first + 1)
                    if (has_failed(lane) .or. angles(lane, d) >= survey%angle(d)) cycle
                    survey%angle(d) = angles(lane, d)
                    survey%time(d) = t(first + lane - 1)
                end do
            end do
        end do
        if (assembly%lost%sample > 0) survey%why = lost_in_words(model, assembly%lost)
    end subroutine survey_motion
end module linkdyn_transmission
