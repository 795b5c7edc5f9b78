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

    !> The ranges of some coordinates about a place where the mechanism is assembled: two ways each, side by side.
    subroutine find_reach(model, which, q, branch, place, lowest, highest, is_limited)
        type(model_type), intent(in) :: model
        integer, intent(in) :: which(:)                !! coordinates
        real(wp), intent(in) :: q(:)                   !! (n_q)
        real(wp), intent(in) :: branch(:)              !! (n_branch)
        real(wp), intent(in) :: place(:, :)            !! of the groups' links (place_size, n_link)
        real(wp), intent(out) :: lowest(:), highest(:) !! (size(which)) [m, rad]
        !> False: an angle goes all the way round, a slide or nut farther than the mechanism is long (size(which))
        logical, intent(out) :: is_limited(:)
        real(wp), parameter :: longest = 10            !! sizes of the mechanism
        type(kinematic_state) :: state
        type(way_report) :: report
        real(wp) :: from(lanes, model%n_q), span(size(which)), reached(2*size(which))    ! way down, way up
        logical :: goes(lanes), arrives(2*size(which))
        integer :: first, lane, i

        span = [(merge(longest/stride_part*model%stride(which(i)), two_pi, &
                       is_length(model, which(i)) .or. is_screw(model, which(i))), i=1, size(which))]
        from = spread(q, 1, lanes)
        do first = 1, size(reached), lanes
            call prepare_kinematics(model, 0, state)
            if (model%n_branch > 0) state%branch = spread(branch, 1, lanes)
            if (size(model%group) > 0) state%group%place = spread(place, 1, lanes)
            state%q = from
            goes = [(first + lane <= size(reached), lane=0, lanes - 1)]
            do lane = 1, count(goes)
                i = (first + lane)/2
                state%q(lane, which(i)) = q(which(i)) + merge(-span(i), span(i), modulo(first + lane, 2) == 0)
            end do
            call lead_mechanism(model, goes, from, .true., state, report)
            do lane = 1, count(goes)
                reached(first + lane - 1) = report%reached(lane)
                arrives(first + lane - 1) = any(report%outcome(lane) == [way_arrived, way_at_singularity])
            end do
        end do
        lowest = q(which) - span*reached(1::2)
        highest = q(which) + span*reached(2::2)
        is_limited = .not. (arrives(1::2) .and. arrives(2::2))
    end subroutine find_reach
end module linkdyn_reach
