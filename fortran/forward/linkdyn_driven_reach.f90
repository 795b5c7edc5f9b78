!> Does the motion of driven coordinates lead out of the mechanism's reach? No step goes there, however short it is, and what else
!> is to be said of forces and energy where a run ends so is beside the point.
module linkdyn_driven_reach
    use linkdyn_assembly_trail, only: lost_way
    use linkdyn_failure, only: end_in_words
    use linkdyn_following, only: way_report, way_ends
    use linkdyn_forward_run, only: forward_run
    use linkdyn_integrator, only: method_rk4
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_laws, only: evaluate_law
    use linkdyn_led_mechanism, only: lead_mechanism
    use linkdyn_status, only: sample_unreachable
    use linkdyn_text, only: join
    implicit none (type, external)
    private
    public :: driven_out_in_words

contains

    !> "the motion of 'J1' leads out of reach: links 'coupler', 'rocker' cannot be closed beyond J1 = 67.1 deg"; blank if it does
    !> not a little ahead of where the run has come to, while coordinates that are free stay.
    function driven_out_in_words(run) result(text)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable :: text
        type(kinematic_state) :: state
        type(way_report) :: report
        type(lost_way) :: lost
        real(wp) :: rate, acceleration
        integer :: k

        text = ""
        associate (model => run%model, here => run%system%way%assembly, is_driven => run%system%layout%rate == 0)
            if (.not. (any(is_driven) .and. here%is_needed)) return
            lost%from = here%q(1, :)
            lost%to = lost%from
            lost%branch = here%branch(1, :)
            if (size(model%group) > 0) lost%place = here%place(1, :, :)
            do k = 1, model%n_q
                if (is_driven(k)) call evaluate_law(model%scene%coordinate(k)%motion, here%t(1) + look_ahead(run), lost%to(k), &
                                                    rate, acceleration)
            end do
            call prepare_kinematics(model, 0, state)
            state%q = spread(lost%to, 1, lanes)
            if (model%n_branch > 0) state%branch = spread(lost%branch, 1, lanes)
            if (size(model%group) > 0) state%group%place = spread(lost%place, 1, lanes)
            call lead_mechanism(model, spread(.true., 1, lanes), spread(lost%from, 1, lanes), .true., state, report)
            if (report%outcome(1) /= way_ends) return
            lost%status = sample_unreachable
            lost%map = report%map(1)
            lost%reached = report%reached(1)
            text = "the motion of "//join(pack(model%scene%coordinate%name, lost%from /= lost%to))//" leads out of reach: " &
                   //end_in_words(model, lost)
        end associate
    end function driven_out_in_words

    !> How far the steps may have stayed behind the end.
    pure real(wp) function look_ahead(run) result(ahead)
        type(forward_run), intent(in) :: run
        real(wp), parameter :: steps = 5, part_of_run = 1.0e-3_wp

        associate (integrator => run%integrator)
            ahead = integrator%last_step
            if (integrator%options%method == method_rk4) ahead = integrator%options%step
            ahead = max(steps*ahead, part_of_run*abs(run%good_until - run%options%t_start))
        end associate
    end function look_ahead
end module linkdyn_driven_reach
