!> The results that there are: of each its number, its name and what it means.
module linkdyn_result_kinds
    implicit none (type, external)
    private
    public :: result_name, result_words, jumps, is_made_of_forces, n_results, result_name_len, result_words_len

    integer, parameter, public :: result_time = 1
    integer, parameter, public :: result_q = 2
    integer, parameter, public :: result_qd = 3
    integer, parameter, public :: result_qdd = 4
    integer, parameter, public :: result_driving_force = 5
    integer, parameter, public :: result_driving_speed = 6
    integer, parameter, public :: result_driving_power = 7
    integer, parameter, public :: result_reaction = 8
    integer, parameter, public :: result_joint_variable = 9
    integer, parameter, public :: result_joint_rate = 10
    integer, parameter, public :: result_status = 11
    integer, parameter, public :: result_rcond = 12
    integer, parameter, public :: result_error = 13
    integer, parameter, public :: result_growth = 14
    integer, parameter, public :: result_power_imbalance = 15
    ! ---- of forward dynamics
    integer, parameter, public :: result_kinetic_energy = 16
    integer, parameter, public :: result_potential_energy = 17
    integer, parameter, public :: result_work = 18
    integer, parameter, public :: result_closure = 19
    integer, parameter, public :: result_step = 20
    ! ---- estimates of errors, on demand
    integer, parameter, public :: result_driving_force_error = 21
    integer, parameter, public :: result_reaction_error = 22
    integer, parameter, public :: result_transmission_angle = 23    ! of planar dyads
    integer, parameter, public :: result_stand_in = 24              ! of a forward run, as the estimates that follow
    integer, parameter, public :: result_q_error = 25
    integer, parameter, public :: result_qd_error = 26
    integer, parameter, public :: result_qdd_error = 27
    integer, parameter, public :: result_joint_rate_error = 28
    ! ---- of inverse dynamics
    integer, parameter, public :: result_singularity_distance = 29  ! on demand
    integer, parameter, public :: result_assembly = 30              ! along a motion, where a mechanism has several
    ! ---- of the record alone
    integer, parameter, public :: result_position = 31
    integer, parameter, public :: result_rotation = 32
    integer, parameter, public :: result_margin = 33                ! of groups in closed form
    integer, parameter, public :: result_margin_rate = 34
    integer, parameter, public :: result_velocity = 35
    integer, parameter, public :: result_angular_velocity = 36
    integer, parameter, public :: result_driving_position = 37      ! coordinates count turns, this does not
    integer, parameter, public :: result_joint_push = 38
    ! ---- of scenes with friction
    integer, parameter, public :: result_friction = 39
    integer, parameter, public :: result_friction_power = 40
    ! ---- of drives with a motor: these follow from the transmitted and the driving force (`linkdyn_motor_loads`)
    integer, parameter, public :: result_transmission_force = 41
    integer, parameter, public :: result_motor_torque = 42
    integer, parameter, public :: result_motor_speed = 43
    integer, parameter, public :: result_motor_power = 44
    integer, parameter, public :: result_motor_current = 45
    integer, parameter, public :: result_transmission_loss = 46
    integer, parameter, public :: result_torque_margin = 47
    integer, parameter, public :: result_brake_torque = 48
    ! ---- of cams
    integer, parameter, public :: result_contact_force = 49
    integer, parameter, public :: result_pressure_angle = 50
    ! ---- of belts that stretch
    integer, parameter, public :: result_strand_force = 51
    ! ---- of controllers, clutches and cylinders, in forward dynamics
    integer, parameter, public :: result_controller_target = 52
    integer, parameter, public :: result_controller_error = 53
    integer, parameter, public :: result_controller_output = 54
    integer, parameter, public :: result_controller_limited = 55
    integer, parameter, public :: result_clutch_force = 56
    integer, parameter, public :: result_clutch_slip = 57
    integer, parameter, public :: result_clutch_state = 58
    integer, parameter, public :: result_cylinder_pressure = 59
    integer, parameter, public :: result_cylinder_flow = 60
    integer, parameter :: n_results = 60

    integer, parameter :: result_name_len = 20
    integer, parameter :: result_words_len = 128

    type :: result_kind
        integer :: id = 0                                !! one of `result_*`
        character(len=result_name_len) :: name = ""      !! in files, in Python and in generated code
        character(len=result_words_len) :: words = ""            !! as `long_name`
    end type result_kind

    type(result_kind), parameter :: kinds(n_results) = [ &
        result_kind(result_time, "time", "time"), &
        result_kind(result_q, "q", "generalized coordinates"), &
        result_kind(result_qd, "qd", "first time derivative of the generalized coordinates"), &
        result_kind(result_qdd, "qdd", "second time derivative of the generalized coordinates"), &
        result_kind(result_driving_force, "driving_force", &
            "driving force or torque, positive in the direction of increasing joint variable"), &
        result_kind(result_driving_speed, "driving_speed", "rate of the driven joint variable"), &
        result_kind(result_driving_power, "driving_power", "mechanical power delivered by the actuator"), &
        result_kind(result_reaction, "reaction", &
            "wrench of the first link of the joint on the second, at the joint point, world axes"), &
        result_kind(result_joint_variable, "joint_variable", "joint variables"), &
        result_kind(result_joint_rate, "joint_rate", "rates of the joint variables"), &
        result_kind(result_status, "status", "outcome of the sample"), &
        result_kind(result_rcond, "rcond", &
            "reciprocal condition number (1-norm) of the equations, rows and columns divided by their largest entries"), &
        result_kind(result_error, "error", "relative error bound or estimate of the forces"), &
        result_kind(result_growth, "growth", "reciprocal pivot growth of the solver gauss-jordan"), &
        result_kind(result_power_imbalance, "power_imbalance", &
            "driving and external power less rate of change of energy, relative to the largest powers of the forces"), &
        result_kind(result_kinetic_energy, "kinetic_energy", "kinetic energy of all links"), &
        result_kind(result_potential_energy, "potential_energy", &
            "potential energy of gravity, zero at the origin, and of springs"), &
        result_kind(result_work, "work", "work of the driving forces since the start"), &
        result_kind(result_closure, "closure", "largest closure error of a joint (m, rad)"), &
        result_kind(result_step, "step", "last step of the integrator"), &
        result_kind(result_driving_force_error, "driving_force_error", &
            "estimated error of the driving force, infinite where unknown"), &
        result_kind(result_reaction_error, "reaction_error", &
            "estimated error of the reaction, infinite where unknown"), &
        result_kind(result_transmission_angle, "transmission_angle", &
            "transmission angle of the dyad, 0 at its dead points to pi/2"), &
        result_kind(result_stand_in, "stand_in", &
            "joint variable integrated in the place of the coordinate, which was near its dead point"), &
        result_kind(result_q_error, "q_error", "estimated error of the generalized coordinates"), &
        result_kind(result_qd_error, "qd_error", "estimated error of their first time derivative"), &
        result_kind(result_qdd_error, "qdd_error", "estimated error of their second time derivative"), &
        result_kind(result_joint_rate_error, "joint_rate_error", "estimated error of the rates of the joint variables"), &
        result_kind(result_singularity_distance, "singularity_distance", &
            "distance in the coordinates to the nearest singular position, first order; angles times `length` [m]"), &
        result_kind(result_assembly, "assembly", "how the assembly of the sample was found"), &
        result_kind(result_position, "position", "origins of the links, world axes"), &
        result_kind(result_rotation, "rotation", "from link axes to world axes"), &
        result_kind(result_margin, "margin", "how far a group is from where its assemblies meet"), &
        result_kind(result_margin_rate, "margin_rate", "rate of that margin"), &
        result_kind(result_velocity, "velocity", "of the links' origins, world axes"), &
        result_kind(result_angular_velocity, "angular_velocity", "of the links, world axes"), &
        result_kind(result_driving_position, "driving_position", "driven joint variable"), &
        result_kind(result_joint_push, "joint_push", "what acts at joints beside reactions"), &
        result_kind(result_friction, "friction", &
            "wrench of friction of the first link of the joint on the second, at the joint point, world axes"), &
        result_kind(result_friction_power, "friction_power", "power dissipated by friction in the joint"), &
        result_kind(result_transmission_force, "transmission_force", &
            "driving force transmitted to the links, rotor inertia deducted"), &
        result_kind(result_motor_torque, "motor_torque", "torque of the motor"), &
        result_kind(result_motor_speed, "motor_speed", "speed of the motor"), &
        result_kind(result_motor_power, "motor_power", "power of the motor at its shaft"), &
        result_kind(result_motor_current, "motor_current", "current of the motor"), &
        result_kind(result_transmission_loss, "transmission_loss", "power lost in the transmission"), &
        result_kind(result_torque_margin, "torque_margin", &
            "available less required motor torque at this speed; negative: overloaded"), &
        result_kind(result_brake_torque, "brake_torque", "brake torque"), &
        result_kind(result_contact_force, "contact_force", &
            "normal contact force; negative: the follower would lift off"), &
        result_kind(result_pressure_angle, "pressure_angle", &
            "pressure angle: between the contact normal and the follower's motion in its guide, 0 to pi/2"), &
        result_kind(result_strand_force, "strand_force", "tension of a belt strand; zero: slack"), &
        result_kind(result_controller_target, "controller_target", "setpoint at the latest controller sample"), &
        result_kind(result_controller_error, "controller_error", "control error at the latest controller sample"), &
        result_kind(result_controller_output, "controller_output", "output of the controller in effect"), &
        result_kind(result_controller_limited, "controller_limited", "whether the output is saturated"), &
        result_kind(result_clutch_force, "clutch_force", &
            "force or torque of the clutch, positive in the direction of increasing slip"), &
        result_kind(result_clutch_slip, "clutch_slip", "slip rate of the clutch"), &
        result_kind(result_clutch_state, "clutch_state", "state of the clutch"), &
        result_kind(result_cylinder_pressure, "cylinder_pressure", "gauge pressure in the chamber"), &
        result_kind(result_cylinder_flow, "cylinder_flow", "flow through the valve into the chamber")]

contains

    !> As files and Python call it.
    elemental function result_name(id) result(name)
        integer, intent(in) :: id                        !! one of `result_*`
        character(len=result_name_len) :: name

        name = kinds(place_of(id))%name
    end function result_name

    !> What it means.
    elemental function result_words(id) result(words)
        integer, intent(in) :: id                        !! one of `result_*`
        character(len=result_words_len) :: words

        words = kinds(place_of(id))%words
    end function result_words

    !> Does it jump where something happens in a run, so that it is told on both sides of that? The others go on there, are told
    !> of the state that the instant has, or of samples alone.
    elemental logical function jumps(id)
        integer, intent(in) :: id                        !! one of `result_*`

        jumps = is_made_of_forces(id) .or. any(id == [result_qdd, result_driving_speed, result_joint_rate, result_status, &
            result_power_imbalance, result_kinetic_energy, result_motor_speed, result_clutch_slip, result_clutch_state])
    end function jumps

    !> Is it a force, or does it come of some?
    elemental logical function is_made_of_forces(id) result(is)
        integer, intent(in) :: id                        !! one of `result_*`

        is = any(id == [result_driving_force, result_driving_power, result_reaction, result_friction, result_friction_power, &
            result_transmission_force, result_motor_torque, result_motor_power, result_motor_current, &
            result_transmission_loss, result_torque_margin, result_brake_torque, result_contact_force, result_strand_force, &
            result_controller_output, result_clutch_force, result_cylinder_flow])
    end function is_made_of_forces

    elemental integer function place_of(id) result(place)
        integer, intent(in) :: id

        do place = 1, n_results - 1
            if (kinds(place)%id == id) return
        end do
    end function place_of
end module linkdyn_result_kinds
