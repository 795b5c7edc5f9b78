!> How far one coordinate can go while the others stay: where the loops of a mechanism close.
module linkdyn_reach
    use linkdyn_constants, only: two_pi
    use linkdyn_following, only: way_report, way_arrived, way_at_singularity
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: lead_mechanism
    use linkdyn_model, only: model_type, is_length, is_screw, stride_part
    implicit none (type, external)
    private
    public :: find_reach

contains

    !> The range of coordinate k about a place where the mechanism is assembled.
    subroutine find_reach(model, k, q, branch, place, lowest, highest, is_limited)
        type(model_type), intent(in) :: model
        integer, intent(in) :: k
        real(wp), intent(in) :: q(:)                   !! (n_q)
        real(wp), intent(in) :: branch(:)              !! (n_branch)
        real(wp), intent(in) :: place(:, :)            !! of the groups' links (place_size, n_link)
        real(wp), intent(out) :: lowest, highest       !! [m, rad]
        logical, intent(out) :: is_limited             !! false: an angle goes all the way round, a slide or nut farther than the mechanism is long
        real(wp), parameter :: longest = 10            !! sizes of the mechanism
        type(kinematic_state) :: state
        type(way_report) :: report
        real(wp) :: from(lanes, model%n_q), span
        logical :: goes(lanes)

        call prepare_kinematics(model, 0, state)
        if (model%n_branch > 0) state%branch = spread(branch, 1, lanes)
        if (size(model%group) > 0) state%group%place = spread(place, 1, lanes)
        span = two_pi
        if (is_length(model, k) .or. is_screw(model, k)) span = longest/stride_part*model%stride(k)
        from = spread(q, 1, lanes)
        state%q = from
        state%q(1, k) = q(k) - span
        state%q(2:, k) = q(k) + span
        goes = .true.
        call lead_mechanism(model, goes, from, .true., state, report)
        lowest = q(k) - span*report%reached(1)
        highest = q(k) + span*report%reached(lanes)
        is_limited = .not. (arrives(1) .and. arrives(lanes))

    contains

        pure logical function arrives(lane)
            integer, intent(in) :: lane

            arrives = any(report%outcome(lane) == [way_arrived, way_at_singularity])
        end function arrives
    end subroutine find_reach
end module linkdyn_reach
