!> The command line as a typed value, and the help texts.
module linkdyn_cli
    use linkdyn_forward, only: integrator_options, choose_method, method_name
    use linkdyn_inverse, only: inverse_options, choose_solver, solver_name
    use linkdyn_kinds, only: wp
    use linkdyn_results, only: wanted_type, choose_wanted, all_wanted, add_free
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_suggest, only: suggestion
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: command_line, argument_type, read_arguments, parse_arguments, print_help
    public :: command_none, command_inverse, command_forward, command_sweep, command_study, command_explain, command_version

    integer, parameter :: command_none = 0
    integer, parameter :: command_inverse = 1
    integer, parameter :: command_explain = 2
    integer, parameter :: command_version = 3
    integer, parameter :: command_forward = 4
    integer, parameter :: command_sweep = 5
    integer, parameter :: command_study = 6
    character(len=8), parameter :: command_name(5) = [character(len=8) :: "inverse", "forward", "sweep", "study", "explain"]
    character(len=11), parameter :: common_option(10) = [character(len=11) :: &
        "--output", "--no-output", "--csv", "--solver", "--want", "--threads", "--compress", "--quiet", "--help", "-o"]
    character(len=11), parameter :: inverse_option(12) = [character(len=11) :: common_option, "--error", "--states"]
    character(len=11), parameter :: forward_option(18) = [character(len=11) :: common_option, &
        "--error", "--method", "--step", "--rtol", "--atol", "--until", "--samples", "--no-switch"]
    character(len=12), parameter :: sweep_option(12) = [character(len=12) :: "--output", "--solver", "--threads", "--keep", &
        "--sheet", "--resume", "--yes", "--checkpoint", "--quiet", "--help", "-o", "-q"]
    character(len=11), parameter :: study_option(7) = [character(len=11) :: "--output", "--no-output", "--until", "--quiet", &
        "--help", "-o", "-q"]
    character(len=10), parameter :: other_option(2) = [character(len=10) :: "--help", "--matrix"]
    character(len=10), parameter :: global_option(2) = [character(len=10) :: "--help", "--version"]

    !> One word of the command line.
    type :: argument_type
        character(len=:), allocatable :: text
    end type argument_type

    !> What the user asks for.
    type :: command_line
        integer :: command = command_none
        logical :: help = .false.                     !! of the command, or in general
        character(len=:), allocatable :: scene        !! file name
        character(len=:), allocatable :: output       !! file name; not allocated: from the scene's
        logical :: no_output = .false.                !! the summary is all
        logical :: csv = .false.
        logical :: quiet = .false.
        logical :: matrix = .false.                   !! explain: write the equations out
        logical :: error = .false.                    !! inverse: estimate the errors of the forces
        character(len=:), allocatable :: states       !! inverse: file with the motion; not allocated: the scene's laws
        integer :: deflate = 0                        !! compression of netCDF output
        character(len=:), allocatable :: solver       !! its name
        type(inverse_options) :: options
        character(len=:), allocatable :: want         !! not allocated: all that the solver gives and the run keeps
        type(wanted_type) :: wanted
        type(integrator_options) :: integrator
        real(wp) :: until = 0                         !! end of a forward run [s]
        logical :: has_until = .false.
        integer :: n_sample = 0                       !! output instants of a forward run; 0: the scene's
        logical :: switches = .true.                  !! a forward run exchanges coordinates at their dead points
        character(len=:), allocatable :: keep         !! quantities kept of every sample of a sweep
        logical :: resume = .false.
        logical :: yes = .false.                      !! a sweep may be as large as it is
        real(wp) :: checkpoint = 5                    !! seconds between two
    end type command_line

contains

    !> The words after the program's name.
    subroutine read_arguments(arguments)
        type(argument_type), allocatable, intent(out) :: arguments(:)
        integer :: i, length

        allocate (arguments(command_argument_count()))
        do i = 1, size(arguments)
            call get_command_argument(i, length=length)
            allocate (character(len=length) :: arguments(i)%text)
            if (length > 0) call get_command_argument(i, arguments(i)%text)
        end do
    end subroutine read_arguments

    !> Turn words into a command.
    !>
    !> **Errors**: bad input for an unknown command or option, a missing or wrong value.
    subroutine parse_arguments(arguments, config, status)
        type(argument_type), intent(in) :: arguments(:)
        type(command_line), intent(out) :: config
        type(status_type), intent(inout) :: status
        integer :: i

        config%solver = "elimination"
        call choose_solver(config%solver, config%options%solver, status)
        if (size(arguments) == 0) then
            config%help = .true.
            return
        end if
        select case (arguments(1)%text)
        case ("inverse")
            config%command = command_inverse
        case ("forward")
            config%command = command_forward
        case ("sweep")
            config%command = command_sweep
        case ("study")
            config%command = command_study
        case ("explain")
            config%command = command_explain
        case ("--version")
            config%command = command_version
            return
        case ("--help", "-h", "help")
            config%help = .true.
            return
        case default
            if (index(arguments(1)%text, "-") == 1) then
                call refuse(quoted(arguments(1)%text)//": unknown option"//suggestion(arguments(1)%text, global_option), &
                    status)
            else
                call refuse(quoted(arguments(1)%text)//": unknown command (expected inverse, forward, sweep, study or explain)"// &
                    suggestion(arguments(1)%text, command_name), status)
            end if
            return
        end select
        i = 2
        do while (i <= size(arguments) .and. status%is_ok())
            call take_word(arguments, i, config, status)
        end do
        if (.not. status%is_ok() .or. config%help) return
        if (.not. allocated(config%scene)) call refuse("no scene given (expected a file, e.g. scene.toml)", status)
        if (config%no_output .and. (allocated(config%output) .or. config%csv .or. config%deflate > 0)) call refuse( &
            "--no-output: nothing is written (expected no --output, --csv or --compress beside it)", status)
        if (.not. allocated(config%want)) config%wanted = default_wanted(config)
        call add_free(config%options%solver, config%wanted)
        config%wanted%errors = config%error
        config%options%wants_errors = config%error
        config%options%wants_rcond = config%wanted%rcond
        config%options%wants_distance = config%wanted%distance
    contains
        subroutine refuse(message, status)
            character(len=*), intent(in) :: message
            type(status_type), intent(inout) :: status

            call fail(status, status_bad_input, "linkdyn: "//message)
        end subroutine refuse
    end subroutine parse_arguments

    !> What is computed if the user does not say: all that the solver gives; without output, what the summary shows.
    pure function default_wanted(config) result(wanted)
        type(command_line), intent(in) :: config
        type(wanted_type) :: wanted

        wanted = all_wanted(config%options%solver)
        if (config%no_output) wanted = wanted_type(.true., wanted%reaction, .false., .false., .false.)
    end function default_wanted

    !> One option with its value, or the name of the scene.
    subroutine take_word(arguments, i, config, status)
        type(argument_type), intent(in) :: arguments(:)
        integer, intent(inout) :: i                   !! current word; moved past what is taken
        type(command_line), intent(inout) :: config
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: option, value
        integer :: equals

        option = arguments(i)%text
        i = i + 1
        if (index(option, "-") /= 1) then
            if (allocated(config%scene)) then
                call refuse(quoted(option)//": a second scene (expected one)")
            else
                config%scene = option
            end if
            return
        end if
        equals = index(option, "=")
        if (index(option, "--") == 1 .and. equals > 0) then
            value = option(equals + 1:)
            option = option(:equals - 1)
        end if
        if (option == "--help" .or. option == "-h") then
            config%help = .true.
            return
        end if
        if (config%command == command_explain .and. option == "--matrix") then
            config%matrix = .true.
            return
        end if
        if (config%command == command_explain) then
            call refuse(quoted(option)//": unknown option"//suggestion(option, other_option))
            return
        end if
        if (config%command == command_sweep .and. .not. any(sweep_option == option)) then
            call refuse(quoted(option)//": unknown option"//suggestion(option, sweep_option))
            return
        end if
        if (config%command == command_study .and. .not. any(study_option == option)) then
            call refuse(quoted(option)//": unknown option"//suggestion(option, study_option))
            return
        end if
        if (config%command /= command_sweep .and. any(["--resume", "--yes   ", "--keep  "] == option)) then
            call refuse(quoted(option)//": unknown option (expected with linkdyn sweep)")
            return
        end if
        if (config%command == command_sweep .and. option == "--sheet") then
            call refuse("--sheet: the sizing sheet is drawn by the Python package (expected the command linkdyn that it installs)")
            return
        end if
        if (config%command /= command_inverse .and. option == "--states") then
            call refuse(quoted(option)//": unknown option (expected with linkdyn inverse)")
            return
        end if
        if (config%command /= command_forward .and. option == "--no-switch") then
            call refuse(quoted(option)//": unknown option (expected with linkdyn forward)")
            return
        end if
        select case (option)
        case ("--csv", "--no-output", "--quiet", "-q", "--compress", "--resume", "--yes", "--error", "--no-switch")
            if (allocated(value)) then
                call refuse(option//": takes no value")
                return
            end if
            if (option == "--csv") config%csv = .true.
            if (option == "--error") config%error = .true.
            if (option == "--no-output") config%no_output = .true.
            if (option == "--compress") config%deflate = 1
            if (option == "--resume") config%resume = .true.
            if (option == "--yes") config%yes = .true.
            if (option == "--no-switch") config%switches = .false.
            if (option == "--quiet" .or. option == "-q") config%quiet = .true.
        case ("-o", "--output", "--solver", "--want", "--threads", "--method", "--step", "--rtol", "--atol", "--until", &
            "--samples", "--keep", "--checkpoint", "--states")
            if (config%command == command_inverse .and. .not. any(inverse_option == option)) then
                call refuse(quoted(option)//": unknown option"//suggestion(option, inverse_option))
                return
            end if
            if (.not. allocated(value)) then
                if (i > size(arguments)) then
                    call refuse(option//": value missing")
                    return
                end if
                value = arguments(i)%text
                i = i + 1
            end if
            call take_value(option, value)
        case default
            if (config%command == command_forward) then
                call refuse(quoted(option)//": unknown option"//suggestion(option, forward_option))
            else
                call refuse(quoted(option)//": unknown option"//suggestion(option, inverse_option))
            end if
        end select
    contains
        subroutine take_value(option, value)
            character(len=*), intent(in) :: option, value
            type(status_type) :: outcome

            select case (option)
            case ("-o", "--output")
                if (len_trim(value) == 0) call refuse(option//": empty file name")
                config%output = value
            case ("--states")
                if (len_trim(value) == 0) call refuse(option//": empty file name")
                config%states = value
            case ("--solver")
                config%solver = value
                call choose_solver(value, config%options%solver, outcome)
                if (.not. outcome%is_ok()) call refuse("--"//trim(outcome%message)//suggestion(value, solver_name))
            case ("--want")
                config%want = value
                call choose_wanted(value, config%wanted, outcome)
                if (.not. outcome%is_ok()) call refuse("--"//trim(outcome%message))
                if (config%command == command_forward .and. config%wanted%distance) &
                    call refuse("--want: singularity_distance is not a result of forward runs (expected linkdyn inverse)")
            case ("--threads")
                config%options%threads = whole_number(value)
                if (config%options%threads < 1) &
                    call refuse("--threads: "//quoted(value)//" (expected a whole number from 1 on)")
            case ("--method")
                call choose_method(value, config%integrator%method, outcome)
                if (.not. outcome%is_ok()) call refuse("--"//trim(outcome%message)//suggestion(value, method_name))
            case ("--step")
                call take_number(option, value, config%integrator%step)
            case ("--rtol")
                call take_number(option, value, config%integrator%rtol)
            case ("--atol")
                call take_number(option, value, config%integrator%atol)
            case ("--until")
                call take_number(option, value, config%until)
                config%has_until = .true.
            case ("--keep")
                config%keep = value
            case ("--checkpoint")
                call take_number(option, value, config%checkpoint)
                if (config%checkpoint < 0) call refuse(option//": "//quoted(value)//" (expected seconds)")
            case ("--samples")
                config%n_sample = whole_number(value)
                if (config%n_sample < 1) call refuse("--samples: "//quoted(value)//" (expected a whole number from 1 on)")
            end select
        end subroutine take_value

        subroutine take_number(option, text, number)
            character(len=*), intent(in) :: option, text
            real(wp), intent(out) :: number
            integer :: code

            number = 0
            read (text, *, iostat=code) number
            if (code /= 0 .or. verify(text, "0123456789+-.eE") > 0 .or. .not. abs(number) <= huge(1.0_wp)) &
                call refuse(option//": "//quoted(text)//" (expected a number)")
        end subroutine take_number

        subroutine refuse(message)
            character(len=*), intent(in) :: message

            call fail(status, status_bad_input, "linkdyn: "//message)
        end subroutine refuse
    end subroutine take_word

    !> The number, or -1 if the text is none.
    pure integer function whole_number(text)
        character(len=*), intent(in) :: text
        integer :: code

        whole_number = -1
        if (len(text) == 0 .or. len(text) > 9 .or. verify(text, "0123456789") > 0) return
        read (text, *, iostat=code) whole_number
        if (code /= 0) whole_number = -1
    end function whole_number

    !> Help on the command, or in general.
    subroutine print_help(command, unit)
        integer, intent(in) :: command               !! one of `command_*`
        integer, intent(in) :: unit

        select case (command)
        case (command_inverse)
            call print_inverse_help(unit)
        case (command_forward)
            call print_forward_help(unit)
        case (command_sweep)
            call print_sweep_help(unit)
        case (command_study)
            call print_study_help(unit)
        case (command_explain)
            write (unit, "(a)") &
                "linkdyn explain SCENE [--matrix]", &
                "", &
                "Says what is modelled: links, joints, equations and unknowns, the order of computation,", &
                "and what was left out.", &
                "", &
                "  --matrix   write out the equations [A]{F} = b at the first instant, in symbols and in numbers"
        case default
            write (unit, "(a)") &
                "linkdyn: forces and motion of link mechanisms", &
                "", &
                "  linkdyn inverse SCENE [options]   driving forces and joint reactions along a motion", &
                "  linkdyn forward SCENE [options]   motion and joint reactions from driving forces", &
                "  linkdyn sweep SCENE [options]     peaks over a workspace, load cases and designs", &
                "  linkdyn study SCENE [options]     time against error of every solver and integrator", &
                "  linkdyn explain SCENE             what is modelled and in which order it is computed", &
                "", &
                "  linkdyn COMMAND --help            options of a command", &
                "  linkdyn --version", &
                "", &
                "Exit status: 0 done; 2 bad input or a file that cannot be written (one line says which", &
                "and why); 3 done, but some samples failed: they are flagged and NaN in the results."
        end select
    end subroutine print_help

    subroutine print_study_help(unit)
        integer, intent(in) :: unit

        write (unit, "(a)") &
            "linkdyn study SCENE [options]", &
            "", &
            "Runs every solver at up to 48 instants of the scene's motion and every integrator, down a ladder of", &
            "tolerances or steps, from its start on; prints time and error of each and recommends. Errors are", &
            "taken against the quadruple twin, linkdyn-real128, where it is built (make real128; beside this", &
            "executable, or where LINKDYN_REAL128 says), else against the most careful result of its own.", &
            "", &
            "  -o, --output FILE   the table as CSV; default: the scene's name with _study.csv in this folder", &
            "  --no-output         only print it", &
            "  --until T           end of the forward runs in s; default: the end of the scene's [time]", &
            "  -q, --quiet         only write it", &
            "  -h, --help          this text"
    end subroutine print_study_help

    subroutine print_sweep_help(unit)
        integer, intent(in) :: unit

        write (unit, "(a)") &
            "linkdyn sweep SCENE [options]", &
            "", &
            "What the table [sweep] of the scene asks for: extremes with their places, means, histograms and", &
            "feasibility over all combinations of poses, loads and designs. Memory does not grow with their number.", &
            "", &
            "  -o, --output FILE   results; default: the scene's name with _sweep.nc in this folder", &
            "  --keep LIST         keep these quantities of every sample, too (names as in 'reduce', with", &
            "                      commas between)", &
            "  --sheet FILE        sizing sheet, .html or .pdf; results go beside it as .nc if no --output is given;", &
            "                      needs the Python package", &
            "  --threads N         threads to compute with; default 1; the results do not depend on it", &
            "  --resume            go on where an interrupted run of the same sweep stands", &
            "  --yes               start though it is large or long", &
            "  --checkpoint S      seconds between two checkpoints; default 5", &
            "  --solver NAME       elimination (default), lapack, gauss-jordan, reduced,", &
            "                      or gauss-jordan-plain (for comparison only)", &
            "  -q, --quiet         no table and no progress", &
            "  -h, --help          this text"
    end subroutine print_sweep_help

    subroutine print_forward_help(unit)
        integer, intent(in) :: unit

        write (unit, "(a)") &
            "linkdyn forward SCENE [options]", &
            "", &
            "Motion, joint reactions and energies from the laws of the scene's actuators, from its start on.", &
            "", &
            "  -o, --output FILE   results; default: the scene's name with .nc (or .csv) in this folder", &
            "  --csv               a CSV table instead of netCDF-4", &
            "  --until T           end of the run in s; default: the end of the scene's [time]", &
            "  --samples N         instants of output, both ends included; default: the scene's", &
            "  --method NAME       rk8pd (default), rkf45, gbs (many digits), msbdf (stiff scenes), rk4 (fixed step)", &
            "  --step H            fixed step, or the first one tried, in s; default 0.001", &
            "  --rtol R, --atol A  error allowed in a step, relative and absolute; default 1e-9", &
            "  --error             also estimate the error that the run gathers, of the motion and of every force: takes up", &
            "                      to five times as long", &
            "  --no-switch         stop where a coordinate comes to its dead point; default: another joint variable", &
            "                      is integrated in its place, and the summary says so", &
            "  --want LIST         driving_force, reaction, joint_variable, power (with energies), checks,", &
            "                      or all (default), with commas between; the rest is not computed", &
            "  --solver NAME       elimination (default), lapack, gauss-jordan, reduced,", &
            "                      or gauss-jordan-plain (for comparison only)", &
            "  --threads N         threads for the forces at output instants; default 1", &
            "  --compress          compress the netCDF file", &
            "  -q, --quiet         no table and no progress", &
            "  -h, --help          this text"
    end subroutine print_forward_help

    subroutine print_inverse_help(unit)
        integer, intent(in) :: unit

        write (unit, "(a)") &
            "linkdyn inverse SCENE [options]", &
            "", &
            "Driving forces and joint reactions along the motion that the scene file gives.", &
            "", &
            "  -o, --output FILE   results; default: the scene's name with .nc (or .csv) in this folder", &
            "  --csv               a CSV table instead of netCDF-4", &
            "  --no-output         keep nothing but the summary: for runs of any length", &
            "  --want LIST         driving_force, reaction, joint_variable, power, checks, or all of these (default);", &
            "                      and rcond, singularity_distance, which take longer; with commas between;", &
            "                      what is not named is not computed", &
            "  --solver NAME       elimination (default), lapack, gauss-jordan, reduced (gives all but the", &
            "                      reactions), or gauss-jordan-plain (for comparison only)", &
            "  --error             also estimate the error of every force: takes up to three times as long", &
            "  --states FILE       q, qd, qdd from a CSV file, as written with --csv, instead of the", &
            "                      scene's motion: a row a sample; columns as the results have them", &
            "  --threads N         threads to compute with; default 1", &
            "  --compress          compress the netCDF file", &
            "  -q, --quiet         no table and no progress", &
            "  -h, --help          this text"
    end subroutine print_inverse_help
end module linkdyn_cli
