!> Laws, outlines of cams and margins of the assembly along the way of a step that is to be accepted: what its stages may have leapt
!> over.
submodule (linkdyn_forward_system) linkdyn_forward_laws
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_cam_contact, only: angle_on_cam
    use linkdyn_narrow_cams, only: find_part_of_cams
    use linkdyn_constants, only: pi
    use linkdyn_step_ends, only: see_way
    use linkdyn_forward_record, only: place_states, place_touches, close_states, apply_record_laws
    use linkdyn_narrow_laws, only: find_part_in_sight, find_part_of_splines, well_within
    use linkdyn_laws, only: evaluate_law
    use linkdyn_led_mechanism, only: measure_margins, n_map
    use linkdyn_margins_within, only: find_part_of_margins
    use linkdyn_measures, only: find_measures
    use linkdyn_model, only: is_length
    implicit none (type, external)

    !> Coordinates that turn farther between two places are not followed by them.
    real(wp), parameter :: farthest_turn = pi          !! within a step
    !> Strides of a coordinate, and change of a margin at its rate where the step begins, within which its ends tell of the
    !> assembly.
    real(wp), parameter :: near_strides = 4, near_change = 0.5_wp

contains

    module procedure part_in_sight
        real(wp) :: measure(lanes, size(self%model%scene%laws%measure)), way(lanes, self%n), instant(lanes), share
        real(wp) :: direction(lanes, self%model%n_cam), of_cams, gone(self%model%n_q), turned
        integer :: lane, k
        logical :: looks_at_laws

        part = 1
        if (.not. self%may_leap) return
        call find_part_of_splines(t, length, gap, self%way%sight, part)
        looks_at_laws = self%way%sight%has_laws .or. self%model%n_cam > 0
        if (part < 1 .or. .not. (looks_at_laws .or. self%way%assembly%is_needed)) return
        gone = ways_gone(self, t, length, y, y_end)
        if (self%way%sight%sees_places .or. self%model%n_cam > 0) then
            turned = maxval(gone, mask=[(.not. is_length(self%model, k), k=1, size(gone))])
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
        if (self%way%assembly%is_needed) call look_at_margins(self, instant, way, gone, length, part)
        if (part < 1 .or. .not. looks_at_laws) return
        if (self%way%sight%has_laws) then
            call measure_states(self, instant, way, measure)
            call find_part_in_sight(self%model%scene%laws, self%span, speed_by_size(self, rate, rate_end), measure, gap, &
                                    self%way%sight, part)
        end if
        if (self%model%n_cam == 0) return
        call look_at_cams(self, instant, way, direction)
        call find_part_of_cams(self%of_cams, direction, gap, of_cams)
        part = min(part, of_cams)
    end procedure part_in_sight

    !> How much of a step may be gone at once for the assembly's sake: where it is short, or margins change little, its ends tell
    !> all. Long steps, of which the cubic through their ends may tell little, are believed if the record was in no doubt at any of
    !> their stages: beyond a change point it would be, for the most part of the way to the next.
    subroutine look_at_margins(self, t, y, gone, length, part)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! of places from the step's beginning to its end [s]
        real(wp), intent(in) :: y(:, :)                !! there (lane, n)
        real(wp), intent(in) :: gone(:)                !! by coordinates in the step (n_q)
        real(wp), intent(in) :: length                 !! of the step [s]
        real(wp), intent(inout) :: part
        real(wp), dimension(lanes, n_map(self%model)) :: margin, drift

        if (all(gone <= near_strides*self%model%stride) .and. all(abs(length*self%way%assembly%drift(1, :)) <= near_change)) return
        if (self%looks%is_usable .and. size(self%model%group) == 0) then
            call see_way(self%model, self%layout, t, y, self%turns, self%way%assembly, self%looks)
            associate (seen => self%looks%of_lanes, out => self%looks%record%recorded%look, n => self%model%n_branch)
                if (seen%counts) call find_part_of_margins(self%model%least_margin, seen%value(:, out%margin:out%margin + n - 1), &
                                                           seen%value(:, out%drift:out%drift + n - 1), n, length, part)
                if (seen%counts .or. self%way%n_left == 0) return
            end associate
        end if
        call self%look_closely(t, y)
        call measure_margins(self%model, self%look, margin, drift)
        associate (look => self%look)
            where (spread(look%way_status /= sample_ok .or. look%unreachable .or. look%not_converged, 2, size(margin, 2)))
                margin = ieee_value(0.0_wp, ieee_quiet_nan)
                drift = margin
            end where
        end associate
        call find_part_of_margins(self%model%least_margin, margin, drift, self%model%n_branch, length, part)
    end subroutine look_at_margins

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

    !> How far a step takes coordinates, integrated or driven.
    function ways_gone(self, t, length, y, y_end) result(gone)
        class(forward_system), intent(in) :: self
        real(wp), intent(in) :: t, length              !! of the step [s]
        real(wp), intent(in) :: y(:), y_end(:)         !! at its ends (n)
        real(wp) :: gone(self%model%n_q)
        real(wp) :: place(2), ignored(2)
        integer :: k

        gone = 0
        do k = 1, self%model%n_q
            associate (p => self%layout%position(k), motion => self%model%scene%coordinate(k)%motion)
                if (p > 0) then
                    gone(k) = abs(y_end(p) - y(p))
                else if (self%layout%rate(k) == 0) then
                    call evaluate_law(motion, t, place(1), ignored(1), ignored(2))
                    call evaluate_law(motion, t + length, place(2), ignored(1), ignored(2))
                    gone(k) = abs(place(2) - place(1))
                end if
            end associate
        end do
    end function ways_gone

    !> The fastest coordinate at a step's ends, by the mechanism's size [1/s].
    pure real(wp) function speed_by_size(self, rate, rate_end) result(speed)
        class(forward_system), intent(in) :: self
        real(wp), intent(in), dimension(:) :: rate, rate_end       !! (n)
        real(wp) :: of_coordinate
        integer :: k

        speed = 0
        do k = 1, self%model%n_q
            associate (p => self%layout%position(k))
                if (p == 0) cycle
                of_coordinate = max(abs(rate(p)), abs(rate_end(p)))
                if (is_length(self%model, k)) of_coordinate = of_coordinate/self%way%sight%size
                speed = max(speed, of_coordinate)
            end associate
        end do
    end function speed_by_size

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
            call place_states(self%model, self%layout, self%way%assembly, lanes, t, y, self%turns, self%by_inverse, self%record)
            if (n_stop(self%model%scene) > 0) call place_touches(self%model, lanes, self%touches(), self%record)
            call close_states(self%model, self%way%assembly, lanes, self%record)
            serves = .not. any(samples%is_left)
            if (.not. serves) return
            call apply_record_laws(lanes, self%record)
            measure = transpose(samples%measured(:samples%n_measure, :))
        end associate
    end subroutine measure_by_record
end submodule linkdyn_forward_laws
