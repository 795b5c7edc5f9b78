!> What a run yields, described once: the netCDF writer, the CSV writer and Python's Dataset are all
!> built from this description, so that they cannot drift apart.
!>
!> A *layout* lists dimensions (with a label and a unit for every entry) and variables (with their
!> dimensions, unit and meaning). A *block* holds the values of one chunk of samples, one flat array a
!> variable, the sample running slowest; *views* give them their shape.
module linkdyn_results
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_result_kinds, only: result_name, result_words, result_name_len, result_words_len, jumps, result_q, result_qd, &
        result_qdd, result_driving_force, result_driving_speed, result_driving_power, result_reaction, &
        result_joint_variable, result_joint_rate, result_status, result_rcond, result_error, result_growth, &
        result_power_imbalance, result_time, result_driving_force_error, result_reaction_error, result_kinetic_energy, &
        result_potential_energy, result_work, result_closure, result_step, result_transmission_angle, result_stand_in, &
        result_singularity_distance, result_assembly, result_q_error, result_qd_error, result_qdd_error, &
        result_joint_rate_error, result_friction, result_friction_power, result_transmission_force, result_motor_torque, &
        result_motor_speed, result_motor_power, result_motor_current, result_transmission_loss, result_torque_margin, &
        result_brake_torque, result_contact_force, result_pressure_angle, result_strand_force, result_controller_target, &
        result_controller_error, result_controller_output, result_controller_limited, result_clutch_force, &
        result_clutch_slip, result_clutch_state, result_cylinder_pressure, result_cylinder_flow
    use linkdyn_assembly_trail, only: reached_name
    use linkdyn_equations, only: solver_gauss_jordan, solver_lapack, solver_reduced
    use linkdyn_joint_table, only: is_slide
    use linkdyn_kinds, only: wp
    use linkdyn_motor_laws, only: available_torque
    use linkdyn_motor_loads, only: motor_torque, transmission_friction
    use linkdyn_scene, only: scene_type, motor_spec, name_len, joint_n_variable, variable_name, coordinate_joint, n_holding, &
        side_joint, has_limits, joint_cam, guide_of, n_controller, n_clutch, n_chamber, side_opening, at_stiffness
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_status_name, sample_ok, sample_undefined
    use linkdyn_text, only: one_of
    implicit none (type, external)
    private
    public :: layout_type, dimension_type, variable_type, block_type, wanted_type
    public :: describe_results, choose_wanted, refuse_absent, all_wanted, add_free, prepare_block, view_values, &
        find_driving_power, flag_unsound
    public :: find_motor_loads, view_motor_loads
    public :: variable_index, samples_width, label_len, layout_of_jumps
    public :: dim_sample, dim_actuator, dim_joint, dim_component, dim_coordinate, dim_variable, dim_dyad, dim_motor, &
        dim_cam, dim_controller, dim_strand, dim_clutch, dim_cylinder, dim_chamber, n_dimension
    public :: estimated, estimate_of, label_of_value
    public :: event_prefix, event_side, beside_words

    integer, parameter :: label_len = name_len + 8   !! a joint's name, a dot and the name of its variable
    integer, parameter :: unit_len = 8
    integer, parameter :: unit_list_len = 24         !! "m/s2, rad/s2"

    ! ---- dimensions
    integer, parameter :: dim_sample = 1
    integer, parameter :: dim_actuator = 2
    integer, parameter :: dim_joint = 3
    integer, parameter :: dim_component = 4
    integer, parameter :: dim_coordinate = 5
    integer, parameter :: dim_variable = 6
    integer, parameter :: dim_dyad = 7
    integer, parameter :: dim_motor = 8
    integer, parameter :: dim_cam = 9
    integer, parameter :: dim_controller = 10
    integer, parameter :: dim_strand = 11
    integer, parameter :: dim_clutch = 12
    integer, parameter :: dim_cylinder = 13
    integer, parameter :: dim_chamber = 14
    integer, parameter :: n_dimension = 14

    ! ---- variables: the numbers of the catalogue
    integer, parameter :: given(4) = [result_time, result_q, result_qd, result_qdd]    !! to inverse dynamics
    ! ---- of what errors are estimated, and what the estimates are
    integer, parameter :: estimated(6) = [result_q, result_qd, result_qdd, result_driving_force, result_reaction, &
                                          result_joint_rate]
    integer, parameter :: estimate_of(6) = [result_q_error, result_qd_error, result_qdd_error, result_driving_force_error, &
                                            result_reaction_error, result_joint_rate_error]

    ! ---- results that jump where something happens in a run, told on both sides of it
    character(len=*), parameter :: event_prefix = "event_"         !! of their names
    character(len=6), parameter :: event_side(2) = [character(len=6) :: "before", "behind"]
    character(len=*), parameter :: beside_words = ", just before and behind the event"    !! behind their meaning

    ! ---- what the user may ask for
    character(len=20), parameter :: wanted_name(13) = [character(len=20) :: &
        "driving_force", "reaction", "joint_variable", "power", "checks", "friction", "motor", "controller", "clutch", &
        "cylinder", "rcond", "singularity_distance", "all"]

    !> Parts of the results that cost time or room, each on its own switch.
    type :: wanted_type
        logical :: driving_force = .true.
        logical :: reaction = .true.
        logical :: joint_variable = .true.   !! with its rate, and the transmission angles
        logical :: power = .true.            !! speed and power of every actuator
        logical :: checks = .true.           !! power_imbalance, and what the solver tells of itself
        logical :: friction = .true.         !! of the joints, and its power, if the scene has some
        logical :: motor = .true.            !! torque, speed and power of motors, if the scene has some
        logical :: controller = .true.       !! target, error and output of controllers, of a forward run of a scene that has some
        logical :: clutch = .true.           !! force, slip and state of clutches, of a forward run of a scene that has some
        logical :: cylinder = .true.         !! pressures and flows of cylinders, of a forward run of a scene whose valves have laws
        logical :: growth = .false.          !! gauss-jordan, of its pivots
        logical :: bound = .false.           !! lapack, of its error
        logical :: rcond = .false.           !! costs as much as everything else together, or more
        logical :: distance = .false.        !! to the next singular position, even more
        logical :: errors = .false.          !! error estimates of the forces that are wanted; of a run of its motion, too
    end type wanted_type

    type(wanted_type), parameter :: nothing_wanted = wanted_type(driving_force=.false., reaction=.false., joint_variable=.false., &
        power=.false., checks=.false., friction=.false., motor=.false., controller=.false., clutch=.false., cylinder=.false.)

    !> One dimension. `label` and `unit` are absent for the samples.
    type :: dimension_type
        character(len=12) :: name = ""
        integer :: size = 0
        character(len=label_len), allocatable :: label(:)
        character(len=unit_len), allocatable :: unit(:)    !! absent where it says nothing (joints)
    end type dimension_type

    !> One variable; dimensions slowest first, as netCDF tools and Python show them.
    type :: variable_type
        integer :: id = 0                                  !! one of `result_*`
        character(len=result_name_len) :: name = ""
        character(len=result_words_len) :: long_name = ""
        character(len=unit_list_len) :: units = ""         !! several where they differ along the last dimension
        character(len=unit_list_len), allocatable :: entry_unit(:)  !! along the last dimension, or a single one
        integer :: n_dim = 1
        integer :: dim(3) = [dim_sample, 0, 0]             !! of `dim_*`
        logical :: is_integer = .false.
        real(wp) :: length = 0                             !! by which angles count [m]; 0: there are none
        character(len=label_len), allocatable :: flag(:)   !! what the integers 0, 1, ... mean
    end type variable_type

    !> Description of a run's results.
    type :: layout_type
        logical :: planar = .false.
        type(dimension_type) :: dimension(n_dimension)
        type(variable_type), allocatable :: variable(:)
        integer, allocatable :: actuator_variable(:)       !! joint variable that each actuator drives
        integer, allocatable :: motor_actuator(:)          !! actuators that have a motor
        type(motor_spec), allocatable :: motor(:)          !! theirs
    end type layout_type

    !> Values of one variable.
    type :: values_type
        real(wp), allocatable :: real(:)                   !! (width of a sample*samples)
        integer, allocatable :: integer(:)
    end type values_type

    !> One chunk of samples: values of every variable of a layout, in its order.
    type :: block_type
        type(values_type), allocatable :: of(:)
    end type block_type

    !> Values of a variable in their shape, the sample last; null if the layout does not have it.
    interface view_values
        module procedure view_integers, view_integers_2, view_reals_1, view_reals_2, view_reals_3
    end interface view_values

contains

    !> The last check of a block: nothing that is not finite stands beside a good outcome, but estimates, which are infinite
    !> where nothing is known. Samples found so are flagged, and their results are NaN like those of any that fails.
    subroutine flag_unsound(layout, n, block)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: n                     !! samples
        type(block_type), intent(inout) :: block
        logical :: is_sound(n)
        integer :: i, k, width, place

        is_sound = .true.
        place = variable_index(layout, result_status)
        do i = 1, size(layout%variable)
            if (layout%variable(i)%is_integer .or. says_of_others(layout%variable(i)%id)) cycle
            width = samples_width(layout, layout%variable(i))
            do k = 1, n
                is_sound(k) = is_sound(k) .and. all(abs(block%of(i)%real((k - 1)*width + 1:k*width)) <= huge(1.0_wp))
            end do
        end do
        is_sound = is_sound .or. block%of(place)%integer(:n) /= sample_ok
        if (all(is_sound)) return
        where (.not. is_sound) block%of(place)%integer(:n) = sample_undefined
        do i = 1, size(layout%variable)
            if (layout%variable(i)%is_integer .or. any(layout%variable(i)%id == given)) cycle
            width = samples_width(layout, layout%variable(i))
            do k = 1, n
                if (.not. is_sound(k)) block%of(i)%real((k - 1)*width + 1:k*width) = ieee_value(1.0_wp, ieee_quiet_nan)
            end do
        end do
    end subroutine flag_unsound

    !> Is the variable one that says how good others are, and may not know?
    pure logical function says_of_others(id)
        integer, intent(in) :: id                    !! one of `result_*`

        says_of_others = any(id == estimate_of) .or. any(id == [result_error, result_growth, result_rcond])
    end function says_of_others

    !> All that a solver gives.
    pure function all_wanted(solver) result(wanted)
        integer, intent(in) :: solver                !! one of `solver_*`
        type(wanted_type) :: wanted

        wanted%reaction = solver /= solver_reduced
        call add_free(solver, wanted)
    end function all_wanted

    !> What a solver finds anyway comes with the checks.
    pure subroutine add_free(solver, wanted)
        integer, intent(in) :: solver
        type(wanted_type), intent(inout) :: wanted

        wanted%growth = wanted%checks .and. solver == solver_gauss_jordan
        wanted%bound = wanted%checks .and. solver == solver_lapack
        wanted%rcond = wanted%rcond .or. wanted%bound
    end subroutine add_free

    !> Read a comma-separated wish list such as "driving_force,reaction".
    subroutine choose_wanted(text, wanted, status)
        character(len=*), intent(in) :: text         !! names of `wanted_name`
        type(wanted_type), intent(out) :: wanted
        type(status_type), intent(inout) :: status   !! bad input if a name is unknown
        integer :: first
        character(len=:), allocatable :: word

        wanted = nothing_wanted
        first = 1
        do while (first <= len(text) + 1)
            call take_word(text, first, word)
            select case (word)
            case ("driving_force")
                wanted%driving_force = .true.
            case ("reaction")
                wanted%reaction = .true.
            case ("joint_variable")
                wanted%joint_variable = .true.
            case ("power")
                wanted%power = .true.
            case ("checks")
                wanted%checks = .true.
            case ("friction")
                wanted%friction = .true.
            case ("motor")
                wanted%motor = .true.
            case ("controller")
                wanted%controller = .true.
            case ("clutch")
                wanted%clutch = .true.
            case ("cylinder")
                wanted%cylinder = .true.
            case ("rcond")
                wanted%rcond = .true.
            case ("singularity_distance")
                wanted%distance = .true.
            case ("all")
                wanted = wanted_type(rcond=wanted%rcond, distance=wanted%distance)
            case default
                call fail(status, status_bad_input, "want: '"//word//"' is not a result (expected "// &
                    one_of(wanted_name)//")")
                return
            end select
        end do
    end subroutine choose_wanted

    !> The next word of a list with commas; the place behind it is beyond the text by two or more after the last.
    subroutine take_word(text, first, word)
        character(len=*), intent(in) :: text
        integer, intent(inout) :: first              !! where it begins; where the next one does
        character(len=:), allocatable, intent(out) :: word
        integer :: comma

        comma = index(text(first:), ",")
        if (comma == 0) comma = len(text) - first + 2
        word = trim(adjustl(text(first:first + comma - 2)))
        first = first + comma
    end subroutine take_word

    !> Results for which the scene has no part are refused where they are asked for by name; `all` leaves them out.
    subroutine refuse_absent(text, scene, status)
        character(len=*), intent(in) :: text         !! the wish list
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status   !! bad input
        character(len=:), allocatable :: word
        integer :: first, n_rubbing

        n_rubbing = 0
        if (allocated(scene%friction)) n_rubbing = size(scene%friction)
        first = 1
        do while (status%is_ok() .and. first <= len(text) + 1)
            call take_word(text, first, word)
            select case (word)
            case ("friction")
                if (n_rubbing == 0) call refuse("no joint of the scene has friction")
            case ("motor")
                if (.not. any(scene%actuator%motor%is_given)) call refuse("no actuator of the scene has a drive")
            case ("controller")
                if (n_controller(scene) == 0) call refuse("the scene has no controller")
            case ("clutch")
                if (n_clutch(scene) == 0) call refuse("the scene has no clutch")
            case ("cylinder")
                if (.not. any(scene%actuator%law%side == side_opening)) &
                    call refuse("no valve of a cylinder has a law or a controller")
            end select
        end do

    contains

        subroutine refuse(why)
            character(len=*), intent(in) :: why

            call fail(status, status_bad_input, "want: '"//word//"': "//why//" (expected results that it has, or 'all' of them)")
        end subroutine refuse
    end subroutine refuse_absent

    !> Dimensions, labels and variables of the results of inverse dynamics, or of forward dynamics.
    subroutine describe_results(scene, wanted, has_time, layout, is_forward, dyad, length, follows_assembly)
        type(scene_type), intent(in) :: scene
        type(wanted_type), intent(in) :: wanted
        logical, intent(in) :: has_time              !! samples are instants of a motion
        type(layout_type), intent(out) :: layout
        logical, intent(in), optional :: is_forward  !! absent: false
        character(len=*), intent(in), optional :: dyad(:)    !! names of the planar dyads; absent: none
        real(wp), intent(in), optional :: length     !! characteristic one [m]
        logical, intent(in), optional :: follows_assembly    !! the mechanism has several; absent: false
        logical :: is_run

        layout%planar = scene%planar
        layout%dimension%name = [character(len=12) :: &
            "sample", "actuator", "joint", "component", "coordinate", "variable", "dyad", "motor", "cam", "controller", &
            "strand", "clutch", "cylinder", "chamber"]
        call describe_joints(scene, layout)
        call describe_actuators(scene, layout)
        if (present(is_forward)) layout%motor%creeps = is_forward &
            .and. scene%actuator(layout%motor_actuator)%law%side /= side_joint
        call describe_components(scene, layout)
        call describe_coordinates(scene, layout)
        allocate (layout%dimension(dim_dyad)%label(0))
        if (present(dyad)) layout%dimension(dim_dyad)%label = dyad
        layout%dimension(dim_dyad)%size = size(layout%dimension(dim_dyad)%label)
        is_run = .false.
        if (present(is_forward)) is_run = is_forward
        call describe_variables(wanted, has_time, is_run, layout, length)
        if (wanted%friction .and. allocated(scene%friction)) then
            if (size(scene%friction) > 0) call describe_friction(layout)
        end if
        if (wanted%motor) call describe_motors(is_run, layout)
        call describe_cams(scene, wanted, layout)
        call describe_belts(scene, wanted, layout)
        if (present(follows_assembly)) then
            if (follows_assembly .and. has_time) call add(layout, result_assembly, "1", flag=reached_name)
        end if
        call describe_controllers(scene, is_run .and. wanted%controller, layout)
        call describe_clutches(scene, is_run .and. wanted%clutch, layout)
        call describe_cylinders(scene, is_run .and. wanted%cylinder, layout)
        if (is_run) call describe_run(wanted, any(scene%coordinate%kind == coordinate_joint), layout)
    end subroutine describe_results

    subroutine describe_actuators(scene, layout)
        type(scene_type), intent(in) :: scene
        type(layout_type), intent(inout) :: layout
        integer :: i, n

        n = size(scene%actuator)
        associate (dimension => layout%dimension(dim_actuator))
            dimension%size = n
            allocate (dimension%label(n), dimension%unit(n), layout%actuator_variable(n))
            do i = 1, n
                dimension%label(i) = scene%actuator(i)%name
                dimension%unit(i) = scene%actuator(i)%unit
                layout%actuator_variable(i) = sum(joint_n_variable(scene%joint(:scene%actuator(i)%joint - 1)%kind)) &
                    + scene%actuator(i)%variable
            end do
        end associate
        layout%motor_actuator = pack([(i, i=1, n)], scene%actuator%motor%is_given)
        layout%motor = scene%actuator(layout%motor_actuator)%motor
        associate (dimension => layout%dimension(dim_motor), of => layout%dimension(dim_actuator))
            dimension%size = size(layout%motor)
            dimension%label = of%label(layout%motor_actuator)
            dimension%unit = of%unit(layout%motor_actuator)
        end associate
    end subroutine describe_actuators

    !> Joints, and the joint variables in the order of the joints: "leg1.P.slide", "leg1.U.angle1", ...
    subroutine describe_joints(scene, layout)
        type(scene_type), intent(in) :: scene
        type(layout_type), intent(inout) :: layout
        integer :: i, k, n

        associate (joint => layout%dimension(dim_joint), variable => layout%dimension(dim_variable))
            joint%size = n_holding(scene)
            variable%size = sum(joint_n_variable(scene%joint(:joint%size)%kind))
            allocate (joint%label(joint%size), variable%label(variable%size), variable%unit(variable%size))
            n = 0
            do i = 1, joint%size
                joint%label(i) = scene%joint(i)%name
                do k = 1, joint_n_variable(scene%joint(i)%kind)
                    n = n + 1
                    variable%label(n) = trim(scene%joint(i)%name)//"."//variable_name(k, scene%joint(i)%kind)
                    variable%unit(n) = merge("m  ", "rad", is_slide(scene%joint(i)%kind, k))
                end do
            end do
        end associate
    end subroutine describe_joints

    subroutine describe_components(scene, layout)
        type(scene_type), intent(in) :: scene
        type(layout_type), intent(inout) :: layout

        associate (dimension => layout%dimension(dim_component))
            if (scene%planar) then
                dimension%label = [character(len=label_len) :: "Fx", "Fy", "Mz"]
                dimension%unit = [character(len=unit_len) :: "N", "N", "N m"]
            else
                dimension%label = [character(len=label_len) :: "Fx", "Fy", "Fz", "Mx", "My", "Mz"]
                dimension%unit = [character(len=unit_len) :: "N", "N", "N", "N m", "N m", "N m"]
            end if
            dimension%size = size(dimension%label)
        end associate
    end subroutine describe_components

    subroutine describe_coordinates(scene, layout)
        type(scene_type), intent(in) :: scene
        type(layout_type), intent(inout) :: layout

        associate (dimension => layout%dimension(dim_coordinate))
            dimension%size = size(scene%coordinate)
            allocate (dimension%label(dimension%size), dimension%unit(dimension%size))
            dimension%label = scene%coordinate%name
            dimension%unit = scene%coordinate%unit
        end associate
    end subroutine describe_coordinates

    !> The list of variables, in the order in which they are stored.
    subroutine describe_variables(wanted, has_time, is_run, layout, length)
        type(wanted_type), intent(in) :: wanted
        logical, intent(in) :: has_time, is_run      !! samples are instants; of a run of forward dynamics
        real(wp), intent(in), optional :: length
        type(layout_type), intent(inout) :: layout

        allocate (layout%variable(0))
        associate (of_actuator => layout%dimension(dim_actuator)%unit, &
            of_component => layout%dimension(dim_component)%unit, &
            of_coordinate => layout%dimension(dim_coordinate)%unit, &
            of_variable => layout%dimension(dim_variable)%unit)
            if (has_time) call add(layout, result_time, "s")
            call add(layout, result_q, of=[dim_coordinate], units=of_coordinate)
            call add(layout, result_qd, of=[dim_coordinate], units=per(of_coordinate, "/s"))
            call add(layout, result_qdd, of=[dim_coordinate], units=per(of_coordinate, "/s2"))
            if (wanted%driving_force) call add(layout, result_driving_force, of=[dim_actuator], units=of_actuator)
            if (wanted%power) then
                call add(layout, result_driving_speed, &
                    of=[dim_actuator], units=per(of_variable(layout%actuator_variable), "/s"))
                call add(layout, result_driving_power, "W", of=[dim_actuator])
            end if
            if (wanted%reaction) call add(layout, result_reaction, of=[dim_joint, dim_component], units=of_component)
            if (wanted%errors .and. wanted%driving_force) call add(layout, result_driving_force_error, &
                of=[dim_actuator], units=of_actuator)
            if (wanted%errors .and. wanted%reaction) call add(layout, result_reaction_error, &
                of=[dim_joint, dim_component], units=of_component)
            if (wanted%joint_variable) then
                call add(layout, result_joint_variable, of=[dim_variable], units=of_variable)
                call add(layout, result_joint_rate, of=[dim_variable], units=per(of_variable, "/s"))
                if (layout%dimension(dim_dyad)%size > 0) call add(layout, result_transmission_angle, "rad", of=[dim_dyad])
            end if
        end associate
        call add(layout, result_status, "1", flag=sample_status_name)
        if (wanted%bound .or. (wanted%errors .and. .not. is_run)) call add(layout, result_error, "1")
        if (wanted%rcond) call add(layout, result_rcond, "1")
        if (wanted%distance) then
            call add(layout, result_singularity_distance, "m")
            if (present(length)) layout%variable(size(layout%variable))%length = length
        end if
        if (wanted%growth) call add(layout, result_growth, "1")
        if (wanted%checks) call add(layout, result_power_imbalance, "1")
    end subroutine describe_variables

    !> What scenes with motors have.
    subroutine describe_motors(is_run, layout)
        logical, intent(in) :: is_run                !! of forward dynamics, in which brakes act
        type(layout_type), intent(inout) :: layout

        call add(layout, result_transmission_force, of=[dim_motor], units=layout%dimension(dim_motor)%unit)
        call add(layout, result_motor_torque, "N m", of=[dim_motor])
        call add(layout, result_motor_speed, "rad/s", of=[dim_motor])
        call add(layout, result_motor_power, "W", of=[dim_motor])
        call add(layout, result_transmission_loss, "W", of=[dim_motor])
        if (any(layout%motor%torque_constant > 0)) &
            call add(layout, result_motor_current, "A", of=[dim_motor])
        if (any(has_limits(layout%motor))) call add(layout, result_torque_margin, "N m", of=[dim_motor])
        if (is_run .and. any(layout%motor%brake%is_given)) &
            call add(layout, result_brake_torque, "N m", of=[dim_motor])
    end subroutine describe_motors

    !> What scenes with cams have; pressure angles, if all followers have a guide.
    subroutine describe_cams(scene, wanted, layout)
        type(scene_type), intent(in) :: scene
        type(wanted_type), intent(in) :: wanted
        type(layout_type), intent(inout) :: layout
        integer :: j

        associate (cam => layout%dimension(dim_cam))
            cam%label = pack(layout%dimension(dim_joint)%label, scene%joint(:n_holding(scene))%kind == joint_cam)
            cam%size = size(cam%label)
            if (cam%size == 0) return
        end associate
        if (wanted%reaction) call add(layout, result_contact_force, "N", of=[dim_cam])
        if (.not. wanted%joint_variable) return
        do j = 1, n_holding(scene)
            if (scene%joint(j)%kind /= joint_cam) cycle
            if (guide_of(scene, j) == 0) return
        end do
        call add(layout, result_pressure_angle, "rad", of=[dim_cam])
    end subroutine describe_cams

    !> What scenes with belts that stretch have.
    subroutine describe_belts(scene, wanted, layout)
        type(scene_type), intent(in) :: scene
        type(wanted_type), intent(in) :: wanted
        type(layout_type), intent(inout) :: layout
        integer :: j, k

        associate (strand => layout%dimension(dim_strand))
            allocate (strand%label(0))
            do j = 1, n_holding(scene)
                if (.not. scene%joint(j)%strand(at_stiffness) > 0) cycle
                strand%label = [character(len=label_len) :: strand%label, &
                                (trim(scene%joint(j)%name)//"."//achar(iachar("0") + k), k=1, 2)]
            end do
            strand%size = size(strand%label)
            if (strand%size == 0) return
        end associate
        if (wanted%reaction) call add(layout, result_strand_force, "N", of=[dim_strand])
    end subroutine describe_belts

    !> What scenes with controllers have.
    subroutine describe_controllers(scene, is_told, layout)
        type(scene_type), intent(in) :: scene
        logical, intent(in) :: is_told               !! what they do
        type(layout_type), intent(inout) :: layout
        integer :: i

        associate (of => layout%dimension(dim_controller))
            of%size = n_controller(scene)
            allocate (of%label(of%size), of%unit(of%size))
            do i = 1, of%size
                of%label(i) = scene%controller(i)%name
                of%unit(i) = scene%controller(i)%unit
            end do
            if (of%size == 0 .or. .not. is_told) return
            call add(layout, result_controller_target, of=[dim_controller], units=of%unit)
            call add(layout, result_controller_error, of=[dim_controller], units=of%unit)
            call add(layout, result_controller_output, of=[dim_controller], units=scene%controller%output_unit)
            call add(layout, result_controller_limited, "1", of=[dim_controller], &
                flag=[character(len=label_len) :: "free", "limited"])
        end associate
    end subroutine describe_controllers

    !> What scenes with clutches have.
    subroutine describe_clutches(scene, is_told, layout)
        type(scene_type), intent(in) :: scene
        logical, intent(in) :: is_told               !! what they do
        type(layout_type), intent(inout) :: layout
        integer :: i

        associate (of => layout%dimension(dim_clutch))
            of%size = n_clutch(scene)
            allocate (of%label(of%size), of%unit(of%size))
            do i = 1, of%size
                of%label(i) = scene%clutch(i)%name
                of%unit(i) = scene%clutch(i)%unit
            end do
            if (of%size == 0 .or. .not. is_told) return
            call add(layout, result_clutch_force, of=[dim_clutch], units=of%unit)
            call add(layout, result_clutch_slip, of=[dim_clutch], units=scene%clutch%slip_unit)
            call add(layout, result_clutch_state, "1", of=[dim_clutch], &
                flag=[character(len=label_len) :: "open", "slips", "holds"])
        end associate
    end subroutine describe_clutches

    !> What scenes with cylinders have whose valves have laws.
    subroutine describe_cylinders(scene, is_told, layout)
        type(scene_type), intent(in) :: scene
        logical, intent(in) :: is_told               !! what they do
        type(layout_type), intent(inout) :: layout

        associate (of => layout%dimension(dim_cylinder), chamber => layout%dimension(dim_chamber))
            of%label = pack(layout%dimension(dim_actuator)%label, scene%actuator%law%side == side_opening)
            of%size = size(of%label)
            chamber%size = n_chamber
            chamber%label = [character(len=label_len) :: "head", "rod"]
            if (of%size == 0 .or. .not. is_told) return
            call add(layout, result_cylinder_pressure, "Pa", of=[dim_cylinder, dim_chamber])
            call add(layout, result_cylinder_flow, "m3/s", of=[dim_cylinder, dim_chamber])
        end associate
    end subroutine describe_cylinders

    !> What scenes with friction have.
    subroutine describe_friction(layout)
        type(layout_type), intent(inout) :: layout

        call add(layout, result_friction, of=[dim_joint, dim_component], units=layout%dimension(dim_component)%unit)
        call add(layout, result_friction_power, "W", of=[dim_joint])
    end subroutine describe_friction

    !> What only a run of forward dynamics has.
    subroutine describe_run(wanted, has_joint_coordinates, layout)
        type(wanted_type), intent(in) :: wanted
        logical, intent(in) :: has_joint_coordinates
        type(layout_type), intent(inout) :: layout

        if (wanted%errors) call describe_run_errors(wanted, layout)
        if (has_joint_coordinates) call add(layout, result_stand_in, "1", &
            of=[dim_coordinate], flag=[character(len=label_len) :: "none", layout%dimension(dim_variable)%label])
        if (wanted%power) then
            call add(layout, result_kinetic_energy, "J")
            call add(layout, result_potential_energy, "J")
            call add(layout, result_work, "J")
        end if
        if (.not. wanted%checks) return
        call add(layout, result_closure, "1")
        call add(layout, result_step, "s")
    end subroutine describe_run

    !> What a run has gathered since its start; that of the forces stands among them.
    subroutine describe_run_errors(wanted, layout)
        type(wanted_type), intent(in) :: wanted
        type(layout_type), intent(inout) :: layout

        associate (unit => layout%dimension(dim_coordinate)%unit)
            call add(layout, result_q_error, of=[dim_coordinate], units=unit)
            call add(layout, result_qd_error, of=[dim_coordinate], units=per(unit, "/s"))
            call add(layout, result_qdd_error, of=[dim_coordinate], units=per(unit, "/s2"))
        end associate
        if (wanted%joint_variable) call add(layout, result_joint_rate_error, of=[dim_variable], &
            units=per(layout%dimension(dim_variable)%unit, "/s"))
    end subroutine describe_run_errors

    !> Of a layout what jumps where something happens in a run.
    pure function layout_of_jumps(layout) result(part)
        type(layout_type), intent(in) :: layout
        type(layout_type) :: part
        integer :: i

        part = layout
        part%variable = layout%variable(pack([(i, i=1, size(layout%variable))], jumps(layout%variable%id)))
    end function layout_of_jumps

    !> Append one variable to the layout. Either one unit, or one for each entry of its last dimension.
    subroutine add(layout, id, unit, of, units, flag)
        type(layout_type), intent(inout) :: layout
        integer, intent(in) :: id                            !! one of `result_*`
        character(len=*), intent(in), optional :: unit       !! of the whole variable
        integer, intent(in), optional :: of(:)               !! dimensions after the sample
        character(len=*), intent(in), optional :: units(:)   !! along the last dimension
        character(len=*), intent(in), optional :: flag(:)    !! what its integers 0, 1, ... mean; absent: it is real
        type(variable_type) :: variable
        integer :: n

        ! A scene without actuators has no driving forces, and netCDF no empty dimensions.
        if (present(of)) then
            if (any(layout%dimension(of)%size == 0)) return
        end if
        variable%id = id
        variable%name = result_name(id)
        variable%long_name = result_words(id)
        if (present(of)) variable%n_dim = 1 + size(of)
        if (present(of)) variable%dim(2:variable%n_dim) = of
        if (present(unit)) then
            n = 1
            if (present(of)) n = layout%dimension(of(size(of)))%size
            variable%units = unit
            variable%entry_unit = spread(variable%units, 1, n)
        else
            variable%entry_unit = units
            variable%units = distinct(variable%entry_unit)
        end if
        variable%is_integer = present(flag)
        if (present(flag)) variable%flag = flag
        layout%variable = [layout%variable, variable]
    end subroutine add

    !> Units of rates.
    pure function per(unit, suffix) result(rate)
        character(len=*), intent(in) :: unit(:)
        character(len=*), intent(in) :: suffix     !! "/s" or "/s2"
        character(len=unit_len) :: rate(size(unit))
        integer :: i

        do i = 1, size(unit)
            rate(i) = trim(unit(i))//suffix
        end do
    end function per

    !> The distinct units in order of appearance: "N, N m".
    pure function distinct(unit) result(text)
        character(len=*), intent(in) :: unit(:)
        character(len=:), allocatable :: text
        integer :: i

        text = ""
        do i = 1, size(unit)
            if (any(unit(:i - 1) == unit(i))) cycle
            if (len(text) > 0) text = text//", "
            text = text//trim(unit(i))
        end do
    end function distinct

    !> Room for the values of some samples.
    subroutine prepare_block(layout, n, block)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: n               !! samples
        type(block_type), intent(out) :: block
        integer :: i

        allocate (block%of(size(layout%variable)))
        do i = 1, size(layout%variable)
            if (layout%variable(i)%is_integer) then
                allocate (block%of(i)%integer(samples_width(layout, layout%variable(i))*n))
            else
                allocate (block%of(i)%real(samples_width(layout, layout%variable(i))*n))
            end if
        end do
    end subroutine prepare_block

    subroutine view_integers(layout, id, n, block, values)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: id              !! one of `result_*`
        integer, intent(in) :: n               !! samples to be seen
        type(block_type), intent(in), target :: block
        integer, pointer, intent(out) :: values(:)     !! (n)
        integer :: place

        nullify (values)
        place = variable_index(layout, id)
        if (place > 0) values(1:n) => block%of(place)%integer
    end subroutine view_integers

    subroutine view_integers_2(layout, id, n, block, values)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: id              !! one of `result_*`
        integer, intent(in) :: n               !! samples to be seen
        type(block_type), intent(in), target :: block
        integer, pointer, intent(out) :: values(:, :)  !! (width, n)
        integer :: place

        nullify (values)
        place = variable_index(layout, id)
        if (place > 0) values(1:samples_width(layout, layout%variable(place)), 1:n) => block%of(place)%integer
    end subroutine view_integers_2

    subroutine view_reals_1(layout, id, n, block, values)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: id              !! one of `result_*`
        integer, intent(in) :: n               !! samples to be seen
        type(block_type), intent(in), target :: block
        real(wp), pointer, intent(out) :: values(:)    !! (n)
        integer :: place

        nullify (values)
        place = variable_index(layout, id)
        if (place > 0) values(1:n) => block%of(place)%real
    end subroutine view_reals_1

    subroutine view_reals_2(layout, id, n, block, values)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: id              !! one of `result_*`
        integer, intent(in) :: n               !! samples to be seen
        type(block_type), intent(in), target :: block
        real(wp), pointer, intent(out) :: values(:, :) !! (width, n)
        integer :: place

        nullify (values)
        place = variable_index(layout, id)
        if (place == 0) return
        values(1:samples_width(layout, layout%variable(place)), 1:n) => block%of(place)%real
    end subroutine view_reals_2

    subroutine view_reals_3(layout, id, n, block, values)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: id              !! one of `result_*`
        integer, intent(in) :: n               !! samples to be seen
        type(block_type), intent(in), target :: block
        real(wp), pointer, intent(out) :: values(:, :, :)  !! (last dimension, first one, n)
        integer :: place

        nullify (values)
        place = variable_index(layout, id)
        if (place == 0) return
        associate (dim => layout%variable(place)%dim)
            values(1:layout%dimension(dim(3))%size, 1:layout%dimension(dim(2))%size, 1:n) => block%of(place)%real
        end associate
    end subroutine view_reals_3

    !> Place of a variable in the layout; 0 if it is not there.
    pure integer function variable_index(layout, id) result(place)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: id              !! one of `result_*`

        do place = size(layout%variable), 1, -1
            if (layout%variable(place)%id == id) return
        end do
    end function variable_index

    !> How many values one sample of a variable has.
    pure integer function samples_width(layout, variable) result(width)
        type(layout_type), intent(in) :: layout
        type(variable_type), intent(in) :: variable

        width = product(layout%dimension(variable%dim(2:variable%n_dim))%size)
    end function samples_width

    !> Names of what value number `item` of a sample belongs to: "J3", "J3 Fx".
    pure function label_of_value(layout, variable, item) result(label)
        type(layout_type), intent(in) :: layout
        type(variable_type), intent(in) :: variable
        integer, intent(in) :: item
        character(len=:), allocatable :: label
        integer :: i, rest, n

        label = ""
        rest = item - 1
        do i = variable%n_dim, 2, -1
            n = layout%dimension(variable%dim(i))%size
            label = trim(layout%dimension(variable%dim(i))%label(1 + modulo(rest, n)))//" "//label
            rest = rest/n
        end do
        label = trim(label)
    end function label_of_value

    !> Speed and power of every actuator from the rates of the joint variables.
    pure subroutine find_driving_power(layout, driving_force, joint_rate, speed, power)
        type(layout_type), intent(in) :: layout
        real(wp), intent(in) :: driving_force(:, :)    !! [N, N m] (n_actuator, n)
        real(wp), intent(in) :: joint_rate(:, :)       !! [m/s, rad/s] (n_variable, n)
        real(wp), intent(out) :: speed(:, :)           !! [m/s, rad/s] (n_actuator, n)
        real(wp), intent(out) :: power(:, :)           !! [W] (n_actuator, n)
        integer :: i, k

        do i = 1, size(speed, 2)
            do k = 1, size(speed, 1)
                speed(k, i) = joint_rate(layout%actuator_variable(k), i)
                power(k, i) = speed(k, i)*driving_force(k, i)
            end do
        end do
    end subroutine find_driving_power

    !> What the motors give, in a block whose driving forces, transmission forces and joint rates are known.
    subroutine view_motor_loads(layout, driving_force, transmission_force, joint_rate, n, block, brake)
        type(layout_type), intent(in) :: layout
        real(wp), pointer, contiguous, intent(in) :: driving_force(:, :)       !! [N, N m] (n_actuator, samples)
        real(wp), pointer, contiguous, intent(in) :: transmission_force(:, :)  !! [N, N m] (n_motor, samples); null: nothing is told
        real(wp), pointer, contiguous, intent(in) :: joint_rate(:, :)          !! [m/s, rad/s] (n_variable, samples)
        integer, intent(in) :: n                       !! samples of the block
        type(block_type), intent(in), target :: block
        real(wp), intent(in), optional :: brake(:, :)  !! what brakes take of the torques [N m] (n_motor, samples); absent: nothing
        real(wp), pointer :: torque(:, :), speed(:, :), power(:, :), loss(:, :), current(:, :), margin(:, :)

        if (.not. associated(transmission_force)) return
        call view_values(layout, result_motor_torque, n, block, torque)
        call view_values(layout, result_motor_speed, n, block, speed)
        call view_values(layout, result_motor_power, n, block, power)
        call view_values(layout, result_transmission_loss, n, block, loss)
        call view_values(layout, result_motor_current, n, block, current)
        call view_values(layout, result_torque_margin, n, block, margin)
        ! what is not viewed is absent there
        call find_motor_loads(layout, driving_force, transmission_force, joint_rate, torque, speed, power, loss, current, margin, &
                              brake)
    end subroutine view_motor_loads

    !> Torque, speed and power of the motors, what is lost behind them, their currents, and what they have at their speeds beyond
    !> their torques.
    pure subroutine find_motor_loads(layout, driving_force, transmission_force, joint_rate, torque, speed, power, loss, current, &
            margin, brake)
        type(layout_type), intent(in) :: layout
        real(wp), intent(in) :: driving_force(:, :)    !! [N, N m] (n_actuator, n)
        real(wp), intent(in) :: transmission_force(:, :)   !! [N, N m] (n_motor, n)
        real(wp), intent(in) :: joint_rate(:, :)       !! [m/s, rad/s] (n_variable, n)
        real(wp), intent(out) :: torque(:, :)          !! [N m] (n_motor, n)
        real(wp), intent(out) :: speed(:, :)           !! [rad/s]
        real(wp), intent(out) :: power(:, :)           !! [W]
        real(wp), intent(out) :: loss(:, :)            !! [W]
        real(wp), intent(out), optional :: current(:, :)   !! [A]
        real(wp), intent(out), optional :: margin(:, :)    !! [N m]
        real(wp), intent(in), optional :: brake(:, :)  !! what brakes take of the torques [N m] (n_motor, n); absent: nothing
        real(wp) :: rate(size(layout%motor))
        integer :: i

        do i = 1, size(torque, 2)
            rate = joint_rate(layout%actuator_variable(layout%motor_actuator), i)
            torque(:, i) = motor_torque(layout%motor, driving_force(layout%motor_actuator, i), transmission_force(:, i), rate)
            if (present(brake)) torque(:, i) = torque(:, i) + brake(:, i)
            speed(:, i) = layout%motor%ratio*rate
            power(:, i) = torque(:, i)*speed(:, i)
            loss(:, i) = transmission_friction(layout%motor, transmission_force(:, i), rate)*rate
            if (present(current)) current(:, i) = torque(:, i)/layout%motor%torque_constant
            if (present(margin)) margin(:, i) = available_torque(layout%motor, speed(:, i), torque(:, i)) - abs(torque(:, i))
        end do
    end subroutine find_motor_loads
end module linkdyn_results
