!> The spring, belt or drive whose motion is the fastest, by name: what makes the steps of a run as short as they are.
!>
!> A unit force of the part alone, no other spring or drive acting, accelerates the mechanism by M^-1 a, where a is how the
!> part's length changes with the coordinates. By a.M^-1 a, the mass that it moves, inverted, and its stiffness k or damping
!> d its motion has the rate sqrt(k a.M^-1 a) or d a.M^-1 a.
module linkdyn_stiffest_part
    use linkdyn_belt_measures, only: measure_stretch
    use linkdyn_cylinder_laws, only: oil_stiffness
    use linkdyn_forward_system, only: forward_system, build_forward_system
    use linkdyn_joint_rates, only: actuator_rates, measure_variable
    use linkdyn_kinds, only: wp
    use linkdyn_measures, only: measure_spring_length
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: effort_law, effort_constant, effort_spring_damper, effort_dc_motor, effort_pd, effort_inverse, &
        controller_spec, measure_joint, is_at_motor, side_voltage, side_opening, is_sampled, n_chamber, at_stiffness, at_damping
    use linkdyn_status, only: status_type
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: find_stiffest

contains

    !> Name and rate of the stiffest part at a state; blank and 0 if there is none.
    subroutine find_stiffest(model, t, y, name, rate)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:)                   !! as a run of the model has it
        character(len=:), allocatable, intent(out) :: name    !! "spring 'S'"
        real(wp), intent(out) :: rate                  !! [rad/s]
        type(model_type), target :: bare
        type(forward_system) :: system
        type(status_type) :: status
        real(wp) :: of_part, stiffness, damping, gain, place(lanes), ignored(lanes)
        integer :: i

        name = ""
        rate = 0
        bare = model
        bare%contact = bare%contact(:0)
        bare%scene%spring%stiffness = 0
        bare%scene%spring%damping = 0
        bare%scene%base%moves = .false.
        do i = 1, size(bare%belt)
            bare%belt(i)%strand = [tiny(1.0_wp), 0.0_wp, 0.0_wp]
        end do
        do i = 1, bare%n_actuator
            if (bare%scene%actuator(i)%law%kind /= effort_inverse) bare%scene%actuator(i)%law = effort_law(kind=effort_constant)
        end do
        bare%scene%controller = bare%scene%controller(:0)
        call build_forward_system(bare, 0, system, status)
        if (.not. status%is_ok()) return
        call system%begin(t, spread(y, 1, lanes))
        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                if (spring%measure > 0) cycle
                of_part = rate_of(spring%stiffness, spring%damping, mobility_at_spring(bare, system, t, y, i))
                if (of_part > rate) name = "spring "//quoted(spring%name)
                rate = max(rate, of_part)
            end associate
        end do
        do i = 1, size(model%belt)
            associate (k => model%belt(i)%strand)
                of_part = rate_of(2*k(at_stiffness), 2*k(at_damping), mobility_at_belt(bare, system, t, y, i))
                if (of_part > rate) name = "belt "//quoted(model%joint(model%belt(i)%gear%joint)%name)
                rate = max(rate, of_part)
            end associate
        end do
        do i = 1, model%n_actuator
            associate (actuator => model%scene%actuator(i))
                call find_slopes(actuator%law, stiffness, damping)
                of_part = rate_of(stiffness, damping, mobility_at_drive(bare, system, t, y, i))
                if (of_part > rate) name = "actuator "//quoted(actuator%name)
                rate = max(rate, of_part)
            end associate
        end do
        do i = 1, model%n_actuator
            associate (actuator => model%scene%actuator(i))
                if (actuator%law%side /= side_opening) cycle
                of_part = mobility_at_drive(bare, system, t, y, i)
                call measure_variable(bare, system%workspace%state, actuator%joint, actuator%variable, spread(0.0_wp, 1, lanes), &
                                      place, ignored)
                ! air gives way the less the higher the pressure is
                of_part = rate_of(oil_stiffness(actuator%cylinder, spread(actuator%cylinder%supply, 1, n_chamber), place(1)), &
                                  0.0_wp, of_part)
                if (of_part > rate) name = "the oil of actuator "//quoted(actuator%name)
                rate = max(rate, of_part)
            end associate
        end do
        do i = 1, size(model%scene%controller)
            associate (controller => model%scene%controller(i))
                if (.not. watches_its_actuator(model, controller)) cycle
                gain = 1
                if (is_at_motor(controller%side)) gain = model%scene%actuator(controller%actuator)%motor%ratio
                of_part = rate_of(gain*controller%kp, gain*controller%kd, &
                                  mobility_at_drive(bare, system, t, y, controller%actuator))
                if (of_part > rate) name = "controller "//quoted(controller%name)
                rate = max(rate, of_part)
            end associate
        end do
        call system%release()
    end subroutine find_stiffest

    !> Does a continuous controller put out forces or torques by where its own actuator's variable is, without a filter?
    pure logical function watches_its_actuator(model, controller) result(watches)
        type(model_type), intent(in) :: model
        type(controller_spec), intent(in) :: controller

        associate (actuator => model%scene%actuator(controller%actuator), &
                   measure => model%scene%laws%measure(controller%measure))
            watches = .not. is_sampled(controller) .and. controller%filter <= 0 &
                      .and. all(controller%side /= [side_voltage, side_opening]) &
                      .and. measure%kind == measure_joint .and. .not. measure%is_rate &
                      .and. measure%joint == actuator%joint .and. measure%variable == actuator%variable
        end associate
    end function watches_its_actuator

    pure real(wp) function rate_of(stiffness, damping, mobility) result(rate)
        real(wp), intent(in) :: stiffness, damping, mobility

        rate = 0
        if (.not. (mobility > 0 .and. mobility <= huge(mobility))) return
        rate = max(sqrt(max(stiffness, 0.0_wp))*sqrt(mobility), damping*mobility)
    end function rate_of

    !> How the force of a drive changes with its position and its speed.
    pure subroutine find_slopes(drive, stiffness, damping)
        type(effort_law), intent(in) :: drive
        real(wp), intent(out) :: stiffness, damping
        real(wp) :: coupling

        stiffness = 0
        damping = 0
        associate (value => drive%value)
            select case (drive%kind)
            case (effort_spring_damper, effort_pd)
                stiffness = value(1)
                damping = value(2)
            case (effort_dc_motor)
                coupling = value(1)*value(2)*value(3)/value(6)
                stiffness = coupling*value(5)
                damping = coupling*value(1)*value(4)
            end select
        end associate
    end subroutine find_slopes

    !> a.M^-1 a of a spring: of unit stiffness and rest -1 it has the tension T = length + 1, which makes the acceleration
    !> -T M^-1 a; at that velocity it shortens at the rate T a.M^-1 a.
    real(wp) function mobility_at_spring(bare, system, t, y, i) result(mobility)
        type(model_type), intent(inout) :: bare
        type(forward_system), intent(inout) :: system
        real(wp), intent(in) :: t, y(:)
        integer, intent(in) :: i
        real(wp), dimension(lanes) :: length, rate
        real(wp) :: acceleration(bare%n_q)

        acceleration = acceleration_at(system, t, y)
        associate (spring => bare%scene%spring(i))
            spring%stiffness = 1
            spring%rest = -1
            call system%renew()
            acceleration = acceleration_at(system, t, y) - acceleration
            call move(system, t, y, acceleration)
            call measure_spring_length(bare, spring, system%workspace%state, length, rate)
            mobility = -rate(1)/(length(1) - spring%rest)
            spring%stiffness = 0
            call system%renew()
        end associate
    end function mobility_at_spring

    !> The same of a belt: how fast it shortens at the acceleration that a unit of T1 - T2 makes.
    real(wp) function mobility_at_belt(bare, system, t, y, i) result(mobility)
        type(model_type), intent(inout) :: bare
        type(forward_system), intent(inout) :: system
        real(wp), intent(in) :: t, y(:)
        integer, intent(in) :: i
        real(wp), dimension(lanes) :: stretch, rate
        real(wp) :: acceleration(bare%n_q), total

        acceleration = acceleration_at(system, t, y)
        associate (belt => bare%belt(i))
            total = belt%gear%total
            call measure_stretch(bare, i, system%workspace%state, stretch, rate)
            belt%gear%total = total - stretch(1) + 0.5_wp
            belt%strand = [1.0_wp, 0.0_wp, 1.0_wp]
            call system%renew()
            acceleration = acceleration_at(system, t, y) - acceleration
            belt%gear%total = total
            belt%strand = [tiny(1.0_wp), 0.0_wp, 0.0_wp]
            call system%renew()
        end associate
        call move(system, t, y, acceleration)
        call measure_stretch(bare, i, system%workspace%state, stretch, rate)
        mobility = -rate(1)
    end function mobility_at_belt

    !> The same of a drive: its speed at the acceleration that a unit force makes.
    real(wp) function mobility_at_drive(bare, system, t, y, i) result(mobility)
        type(model_type), intent(inout) :: bare
        type(forward_system), intent(inout) :: system
        real(wp), intent(in) :: t, y(:)
        integer, intent(in) :: i
        real(wp) :: acceleration(bare%n_q), speed(lanes, bare%n_actuator)

        mobility = 0
        associate (drive => bare%scene%actuator(i)%law)
            if (drive%kind /= effort_constant) return
            acceleration = acceleration_at(system, t, y)
            drive%value(1) = 1
            acceleration = acceleration_at(system, t, y) - acceleration
            call move(system, t, y, acceleration)
            call actuator_rates(bare, system%workspace%state, speed)
            drive%value(1) = 0
        end associate
        mobility = speed(1, i)
    end function mobility_at_drive

    !> Accelerations of the coordinates from rest, of a free pose those of velocity and angular velocity.
    function acceleration_at(system, t, y) result(acceleration)
        type(forward_system), intent(inout) :: system
        real(wp), intent(in) :: t, y(:)
        real(wp) :: acceleration(system%model%n_q)

        acceleration = 0
        call move(system, t, y, acceleration)
        acceleration = system%workspace%acceleration(1, :)
    end function acceleration_at

    !> The mechanism at the same position with other velocities.
    subroutine move(system, t, y, velocity)
        type(forward_system), intent(inout) :: system
        real(wp), intent(in) :: t, y(:)
        real(wp), intent(in) :: velocity(:)            !! (n_q)
        real(wp) :: moving(size(y)), rate(size(y))
        logical :: has_failed
        integer :: k

        moving = y
        do k = 1, size(velocity)
            if (system%layout%rate(k) > 0) moving(system%layout%rate(k)) = velocity(k)
        end do
        call system%evaluate_alone(t, moving, rate, has_failed)
    end subroutine move
end module linkdyn_stiffest_part
