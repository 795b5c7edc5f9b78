!> Laws, and outlines of cams, along the way of a step that is to be accepted: what its stages may have leapt over.
submodule (linkdyn_forward_system) linkdyn_forward_laws
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_cam_contact, only: angle_on_cam
    use linkdyn_cam_sight, only: find_part_of_cams
    use linkdyn_constants, only: pi
    use linkdyn_forward_record, only: place_states, place_touches, close_states, apply_record_laws
    use linkdyn_law_sight, only: find_part_in_sight, find_part_of_splines, well_within
    use linkdyn_laws, only: evaluate_law
    use linkdyn_measures, only: find_measures
    use linkdyn_model, only: is_length
    implicit none (type, external)

    !> Coordinates that turn farther between two places are not followed by them.
    real(wp), parameter :: farthest_turn = pi          !! within a step

contains

    module procedure part_in_sight
        real(wp) :: measure(lanes, size(self%model%scene%laws%measure)), way(lanes, self%n), instant(lanes), share, turned
        real(wp) :: direction(lanes, self%model%n_cam), of_cams
        integer :: lane

        part = 1
        if (.not. self%may_leap) return
        call find_part_of_splines(t, length, gap, self%sight, part)
        if (part < 1 .or. .not. (self%sight%has_laws .or. self%model%n_cam > 0)) return
        if (self%sight%sees_places .or. self%model%n_cam > 0) then
            turned = farthest_turned(self, t, length, y, y_end)
            if (turned > farthest_turn) then
                part = well_within*farthest_turn/turned
                return
            end if
        end if
        do lane = 1, lanes
            share = real(lane - 1, wp)/(lanes - 1)
            instant(lane) = t + share*length
            way(lane, :) = between(share, y, length*rate, y_end, length*rate_end)
        end do
        if (self%sight%has_laws) then
            call measure_states(self, instant, way, measure)
            call find_part_in_sight(self%model%scene%laws, self%span, measure, gap, self%sight, part)
        end if
        if (self%model%n_cam == 0) return
        call look_at_cams(self, instant, way, direction)
        call find_part_of_cams(self%of_cams, direction, gap, of_cams)
        part = min(part, of_cams)
    end procedure part_in_sight

    !> In which directions cams are touched; NaN where they cannot be closed.
    subroutine look_at_cams(self, t, y, direction)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(out) :: direction(:, :)       !! (lane, cam)
        integer :: k

        call self%look_closely(t, y)
        associate (look => self%look)
            do k = 1, self%model%n_cam
                direction(:, k) = angle_on_cam(self%model, look, self%of_cams(k)%joint)
                where (look%not_converged .or. look%singular .or. look%unreachable) &
                    direction(:, k) = ieee_value(0.0_wp, ieee_quiet_nan)
            end do
        end associate
    end subroutine look_at_cams

    !> The angle by which a step turns a coordinate farthest, integrated or driven.
    real(wp) function farthest_turned(self, t, length, y, y_end) result(turned)
        class(forward_system), intent(in) :: self
        real(wp), intent(in) :: t, length              !! of the step [s]
        real(wp), intent(in) :: y(:), y_end(:)         !! at its ends (n)
        real(wp) :: angle(2), ignored(2)
        integer :: k

        turned = 0
        do k = 1, self%model%n_q
            if (is_length(self%model, k)) cycle
            associate (p => self%layout%position(k), motion => self%model%scene%coordinate(k)%motion)
                if (p > 0) then
                    turned = max(turned, abs(y_end(p) - y(p)))
                else if (self%layout%rate(k) == 0) then
                    call evaluate_law(motion, t, angle(1), ignored(1), ignored(2))
                    call evaluate_law(motion, t + length, angle(2), ignored(1), ignored(2))
                    turned = max(turned, abs(angle(2) - angle(1)))
                end if
            end associate
        end do
    end function farthest_turned

    !> The cubic that meets solution and rates at both ends of a step.
    pure elemental real(wp) function between(share, y, way, y_end, way_end)
        real(wp), intent(in) :: share
        real(wp), intent(in) :: y, way                 !! at its beginning; rate times length
        real(wp), intent(in) :: y_end, way_end

        between = y + share*(way + share*((3*(y_end - y) - 2*way - way_end) + share*(way + way_end - 2*(y_end - y))))
    end function between

    !> What laws depend on, by the record if that serves all of the states.
    subroutine measure_states(self, t, y, measure)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(out) :: measure(:, :)         !! (lane, measure)
        logical :: serves

        serves = .false.
        if (self%has_record_now(t(1))) call measure_by_record(self, t, y, measure, serves)
        if (serves) return
        call self%look_closely(t, y)
        call find_measures(self%model, self%look, measure)
    end subroutine measure_states

    subroutine measure_by_record(self, t, y, measure, serves)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(inout) :: measure(:, :)       !! (lane, measure)
        logical, intent(out) :: serves

        self%is_by_record = .false.                    ! whose samples are others now
        associate (samples => self%record%samples)
            call place_states(self%model, self%layout, self%assembly, lanes, t, y, self%turns, self%by_inverse, self%record)
            if (n_stop(self%model%scene) > 0) call place_touches(self%model, lanes, self%touches(), self%record)
            call close_states(self%model, self%assembly, lanes, self%record)
            serves = .not. any(samples%is_left)
            if (.not. serves) return
            call apply_record_laws(lanes, self%record)
            measure = transpose(samples%measured(:samples%n_measure, :))
        end associate
    end subroutine measure_by_record
end submodule linkdyn_forward_laws
