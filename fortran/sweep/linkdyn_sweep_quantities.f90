!> The scalars of one sample that a sweep reduces, in one row: which quantities, how many entries each, of what unit.
module linkdyn_sweep_quantities
    use linkdyn_joint_table, only: turns_about_point
    use linkdyn_result_kinds, only: result_words, result_words_len, result_driving_force, result_driving_position, &
        result_driving_speed, result_driving_power, result_reaction, result_joint_variable, result_joint_rate, &
        result_motor_torque, result_motor_speed, result_motor_power, result_motor_current, result_torque_margin, &
        result_contact_force, result_pressure_angle
    use linkdyn_results, only: layout_type, wanted_type, describe_results, label_len, dim_actuator, dim_joint, &
        dim_component, dim_variable, dim_motor, dim_cam
    use linkdyn_scene, only: scene_type
    use linkdyn_sweep_spec, only: sweep_spec, n_quantity, quantity_name, needs_forces, quantity_driving_force, &
        quantity_driving_position, quantity_driving_speed, quantity_driving_power, quantity_reaction, &
        quantity_reaction_force, quantity_reaction_moment, quantity_joint_variable, quantity_joint_rate, &
        quantity_force_amplification, quantity_moment_amplification, quantity_condition, quantity_determinant, &
        quantity_swing, quantity_clearance, quantity_motor_torque, quantity_motor_speed, quantity_motor_power, &
        quantity_motor_current, quantity_torque_margin, quantity_contact_force, quantity_pressure_angle
    implicit none (type, external)
    private
    public :: quantity_type, quantity_row, describe_quantity, make_row

    integer, parameter :: unit_len = 8

    !> One quantity: its dimensions and the labels and units of its entries.
    type :: quantity_type
        integer :: id = 0
        integer :: first = 0                              !! its entries are first + 1, ... of the row
        integer :: n = 0
        integer :: n_dim = 0                              !! 0: a scalar
        character(len=12) :: dim(2) = ""                  !! names, slowest first
        integer :: size(2) = 1
        character(len=2*label_len), allocatable :: label(:)  !! (n) "leg1.P", "leg1.S Fx"
        character(len=unit_len), allocatable :: unit(:)   !! (n)
        character(len=result_words_len) :: long_name = ""
    end type quantity_type

    !> All quantities of a sweep.
    type :: quantity_row
        type(quantity_type), allocatable :: quantity(:)
        integer :: n = 0                                  !! entries in all
        integer :: n_early = 0                            !! the first so many need no forces
        integer :: place(n_quantity) = 0                  !! of a quantity in the list; 0: it is not there
    end type quantity_row

contains

    !> Labels and units of one quantity.
    subroutine describe_quantity(scene, id, quantity)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: id                         !! one of `quantity_*`
        type(quantity_type), intent(out) :: quantity
        type(layout_type) :: layout
        integer :: i, k

        call describe_results(scene, wanted_type(), .false., layout)
        quantity%id = id
        associate (actuator => layout%dimension(dim_actuator), joint => layout%dimension(dim_joint), &
                   component => layout%dimension(dim_component), variable => layout%dimension(dim_variable), &
                   motor => layout%dimension(dim_motor))
            select case (id)
            case (quantity_driving_force)
                call take("actuator", actuator%label, actuator%unit)
                quantity%long_name = result_words(result_driving_force)
            case (quantity_driving_position)
                call take("actuator", actuator%label, variable%unit(layout%actuator_variable))
                quantity%long_name = result_words(result_driving_position)
            case (quantity_driving_speed)
                call take("actuator", actuator%label, per_second(variable%unit(layout%actuator_variable)))
                quantity%long_name = result_words(result_driving_speed)
            case (quantity_driving_power)
                call take("actuator", actuator%label, spread("W       ", 1, actuator%size))
                quantity%long_name = result_words(result_driving_power)
            case (quantity_reaction)
                quantity%n_dim = 2
                quantity%dim = [character(len=12) :: "joint", "component"]
                quantity%size = [joint%size, component%size]
                allocate (quantity%label(joint%size*component%size), quantity%unit(joint%size*component%size))
                do k = 1, joint%size
                    do i = 1, component%size
                        quantity%label((k - 1)*component%size + i) = trim(joint%label(k))//" "//component%label(i)
                        quantity%unit((k - 1)*component%size + i) = component%unit(i)
                    end do
                end do
                quantity%long_name = result_words(result_reaction)
            case (quantity_reaction_force)
                call take("joint", joint%label, spread("N       ", 1, joint%size))
                quantity%long_name = "magnitude of the force in the joint"
            case (quantity_reaction_moment)
                call take("joint", joint%label, spread("N m     ", 1, joint%size))
                quantity%long_name = "magnitude of the moment in the joint"
            case (quantity_joint_variable)
                call take("variable", variable%label, variable%unit)
                quantity%long_name = result_words(result_joint_variable)
            case (quantity_joint_rate)
                call take("variable", variable%label, per_second(variable%unit))
                quantity%long_name = result_words(result_joint_rate)
            case (quantity_force_amplification)
                call take("actuator", actuator%label, ratio(actuator%unit, "N"))
                quantity%long_name = "largest driving force over all unit forces on the tool"
            case (quantity_moment_amplification)
                call take("actuator", actuator%label, ratio(actuator%unit, "N m"))
                quantity%long_name = "largest driving force over all unit moments on the tool"
            case (quantity_condition)
                call take_scalar("1")
                quantity%long_name = "condition number of the Jacobian, lengths over the characteristic length"
            case (quantity_determinant)
                call take_scalar("1")
                quantity%long_name = "determinant of the Jacobian, lengths over the characteristic length"
            case (quantity_swing)
                call take("swing_joint", pack(joint%label, can_swing(scene)), spread("rad     ", 1, count(can_swing(scene))))
                quantity%long_name = "angle of the leg from its neutral direction"
            case (quantity_motor_torque)
                call take("motor", motor%label, spread("N m     ", 1, motor%size))
                quantity%long_name = result_words(result_motor_torque)
            case (quantity_motor_speed)
                call take("motor", motor%label, spread("rad/s   ", 1, motor%size))
                quantity%long_name = result_words(result_motor_speed)
            case (quantity_motor_power)
                call take("motor", motor%label, spread("W       ", 1, motor%size))
                quantity%long_name = result_words(result_motor_power)
            case (quantity_motor_current)
                call take("motor", motor%label, spread("A       ", 1, motor%size))
                quantity%long_name = result_words(result_motor_current)
            case (quantity_torque_margin)
                call take("motor", motor%label, spread("N m     ", 1, motor%size))
                quantity%long_name = result_words(result_torque_margin)
            case (quantity_contact_force)
                call take("cam", layout%dimension(dim_cam)%label, spread("N       ", 1, layout%dimension(dim_cam)%size))
                quantity%long_name = result_words(result_contact_force)
            case (quantity_pressure_angle)
                call take("cam", layout%dimension(dim_cam)%label, spread("rad     ", 1, layout%dimension(dim_cam)%size))
                quantity%long_name = result_words(result_pressure_angle)
            case (quantity_clearance)
                call take_scalar("m")
                quantity%long_name = "smallest gap between legs"
            end select
        end associate
        quantity%n = size(quantity%label)

    contains

        subroutine take(dim, label, unit)
            character(len=*), intent(in) :: dim, label(:), unit(:)

            quantity%n_dim = 1
            quantity%dim(1) = dim
            quantity%size(1) = size(label)
            allocate (quantity%label(size(label)), quantity%unit(size(label)))
            quantity%label = label
            quantity%unit = unit
        end subroutine take

        subroutine take_scalar(unit)
            character(len=*), intent(in) :: unit

            allocate (quantity%label(1), quantity%unit(1))
            quantity%label = quantity_name(id)
            quantity%unit = unit
        end subroutine take_scalar
    end subroutine describe_quantity

    !> Joints that swing: universal and spherical ones.
    pure function can_swing(scene) result(can)
        type(scene_type), intent(in) :: scene
        logical :: can(size(scene%joint))

        can = turns_about_point(scene%joint%kind)
    end function can_swing

    !> The row of a sweep: what needs no forces first, so that a pose out of bounds is known early.
    subroutine make_row(scene, spec, row)
        type(scene_type), intent(in) :: scene
        type(sweep_spec), intent(in) :: spec
        type(quantity_row), intent(out) :: row
        integer :: id, pass, n

        allocate (row%quantity(count(spec%wants)))
        n = 0
        do pass = 1, 2
            do id = 1, n_quantity
                if (.not. spec%wants(id) .or. (needs_forces(id) .neqv. pass == 2)) cycle
                n = n + 1
                call describe_quantity(scene, id, row%quantity(n))
                row%quantity(n)%first = row%n
                row%n = row%n + row%quantity(n)%n
                row%place(id) = n
            end do
            if (pass == 1) row%n_early = row%n
        end do
    end subroutine make_row

    pure function per_second(unit) result(rate)
        character(len=*), intent(in) :: unit(:)
        character(len=unit_len) :: rate(size(unit))
        integer :: i

        do i = 1, size(unit)
            rate(i) = trim(unit(i))//"/s"
        end do
    end function per_second

    !> Unit of a driving force per unit load.
    pure function ratio(unit, load) result(quotient)
        character(len=*), intent(in) :: unit(:), load
        character(len=unit_len) :: quotient(size(unit))
        integer :: i

        do i = 1, size(unit)
            quotient(i) = "1"
            if (unit(i) == "N" .and. load == "N m") quotient(i) = "1/m"
            if (unit(i) == "N m" .and. load == "N") quotient(i) = "m"
        end do
    end function ratio
end module linkdyn_sweep_quantities
