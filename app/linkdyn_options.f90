!> The commands and their options: one table of each. The command line is read by them (`linkdyn_cli`) and the help is made of them
!> (`linkdyn_help`); the manual page and the completions of shells are made from that help.
module linkdyn_options
    implicit none (type, external)
    private
    public :: command_none, command_inverse, command_forward, command_sweep, command_study, command_explain, command_generate
    public :: command_version, command_type, command, command_in_python, option_type, option, option_number, is_option_of

    integer, parameter :: command_none = 0
    integer, parameter :: command_inverse = 1
    integer, parameter :: command_forward = 2
    integer, parameter :: command_sweep = 3
    integer, parameter :: command_study = 4
    integer, parameter :: command_explain = 5
    integer, parameter :: command_generate = 6
    integer, parameter :: command_version = 7

    !> A command.
    type :: command_type
        character(len=10) :: name
        character(len=24) :: arguments                !! as the help writes them
        character(len=64) :: summary                  !! in the list of commands
        character(len=400) :: text                    !! a paragraph; of a command in Python: why it is not here
    end type command_type

    !> In the order of `command_*`.
    type(command_type), parameter :: command(*) = [ &
        command_type("inverse", "SCENE [options]", "driving forces and joint reactions along a motion", &
            "Driving forces and joint reactions along the motion that the scene file gives."), &
        command_type("forward", "SCENE [options]", "motion and joint reactions from driving forces", &
            "Motion, joint reactions and energies from the laws of the scene's actuators, from its start on."), &
        command_type("sweep", "SCENE [options]", "peaks over a workspace, load cases and designs", &
            "What the table [sweep] of the scene asks for: extremes with their places, means, histograms and feasibility over " &
            //"all combinations of poses, loads and designs. Memory does not grow with their number."), &
        command_type("study", "SCENE [options]", "time against error of every solver and integrator", &
            "Runs every solver at up to 48 instants of the scene's motion and every integrator, down a ladder of tolerances or " &
            //"steps, from its start on; prints time and error of each and recommends. Errors are taken against the quadruple " &
            //"twin, linkdyn-real128, where it is built (make real128; beside this executable, or where LINKDYN_REAL128 says), " &
            //"else against the most careful result of its own."), &
        command_type("explain", "SCENE [options]", "what is modelled and in which order it is computed", &
            "Says what is modelled: links, joints, equations and unknowns, the order of computation, and what was left out."), &
        command_type("generate", "SCENE [options]", "C code of forces or motion, for controllers", &
            "One file of C99 and its header that compute a kernel of the scene: without memory to allocate, without libraries, " &
            //"in a time that does not vary; for controllers, Simulink, ROS 2 and whatever compiles C.")]

    !> What the Python package has, under the same name.
    type(command_type), parameter :: command_in_python(*) = [ &
        command_type("view", "SCENE|RUN.nc", "an interactive picture", "the page is made by the Python package"), &
        command_type("draw", "SCENE", "a picture of the mechanism", "the picture is made by the Python package"), &
        command_type("balance", "SCENE", "counterweights against shaking forces", "it is computed by the Python package"), &
        command_type("linearize", "SCENE", "poles near a state", "it is computed by the Python package"), &
        command_type("new", "[KIND]", "a scene to start from", "scenes to start from are in the Python package"), &
        command_type("convert", "SCENE|ROBOT", "a scene of MJCF or URDF, MJCF of a scene", &
            "files are read by the Python package"), &
        command_type("assemblies", "SCENE", "ways in which it closes at the start", "the table is made by the Python package")]

    !> An option, of one command or several. What means something else in another command has a row of its own there.
    type :: option_type
        character(len=12) :: name
        character(len=2) :: short                     !! its other name; blank: it has none
        character(len=4) :: value                     !! what it takes, in a word; blank: nothing
        integer :: commands                           !! a sum of those below
        character(len=256) :: text                    !! of the help
    end type option_type

    ! sets of commands: bit `command_*` of a number
    integer, parameter :: inverse = 2**command_inverse, forward = 2**command_forward, sweep = 2**command_sweep
    integer, parameter :: study = 2**command_study, explain = 2**command_explain, generate = 2**command_generate

    !> In the order of the help.
    type(option_type), parameter :: option(*) = [ &
        option_type("--output", "-o", "FILE", inverse + forward, &
            "results: netCDF-4, or a table if its name ends in .csv; default: the scene's name with .nc (or .csv) " &
            //"in this folder"), &
        option_type("--output", "-o", "FILE", sweep, &
            "results; default: the scene's name with _sweep.nc in this folder"), &
        option_type("--output", "-o", "FILE", study, &
            "the table as CSV; default: the scene's name with _study.csv in this folder"), &
        option_type("--output", "-o", "FILE", generate, &
            "the files, with .c and .h behind; identifiers begin with its name; default: the scene's name with _inverse, " &
            //"_forward or _kinematics in this folder"), &
        option_type("--csv", "", "", inverse + forward, &
            "a CSV table instead of netCDF-4"), &
        option_type("--no-output", "", "", inverse, &
            "keep nothing but the summary: for runs of any length"), &
        option_type("--no-output", "", "", forward, &
            "keep nothing but the summary"), &
        option_type("--no-output", "", "", study, &
            "only print it"), &
        option_type("--until", "", "T", forward, &
            "end of the run in s; default: the end of the scene's [time]"), &
        option_type("--until", "", "T", study, &
            "end of the forward runs in s; default: the end of the scene's [time]"), &
        option_type("--samples", "", "N", forward, &
            "instants of output, both ends included; default: the scene's"), &
        option_type("--method", "", "NAME", forward, &
            "rk8pd (default; without GSL: gbs), rkf45, gbs (many digits), seulex or msbdf (stiff scenes), rk4 (fixed step)"), &
        option_type("--step", "", "H", forward, &
            "fixed step, or the first one tried, in s; default 0.001"), &
        option_type("--rtol", "", "R", forward, &
            "relative error allowed in a step; default 1e-9, most 1e-4; rk4 has none"), &
        option_type("--atol", "", "A", forward, &
            "absolute error allowed in a step, in m and rad, and these in a second; default 1e-9, most 1e-4; rk4 has none"), &
        option_type("--lang", "", "NAME", generate, &
            "the language: c"), &
        option_type("--kernel", "", "NAME", generate, &
            "inverse (default: driving forces from q, qd, qdd and loads), forward (qdd from q, qd, loads and driving forces), " &
            //"kinematics (links and joints from q and qd)"), &
        option_type("--matrix", "", "", explain, &
            "write out the equations [A]{F} = b at the first instant, in symbols and in numbers"), &
        option_type("--want", "", "LIST", inverse, &
            "driving_force, reaction, joint_variable, power, checks, friction, motor, or all of these (default); and rcond, " &
            //"singularity_distance, which take longer; with commas between; what is not named is not computed"), &
        option_type("--solver", "", "NAME", inverse, &
            "elimination (default), lapack, gauss-jordan, reduced (gives all but the reactions), or gauss-jordan-plain (for " &
            //"comparison only)"), &
        option_type("--error", "", "", inverse, &
            "also estimate the error of every force: takes up to three times as long"), &
        option_type("--error", "", "", forward, &
            "also estimate the error that the run gathers, of the motion and of every force: takes up to five times as long"), &
        option_type("--no-switch", "", "", forward, &
            "stop where a coordinate comes to its dead point; default: another joint variable is integrated in its place, and " &
            //"the summary says so"), &
        option_type("--want", "", "LIST", forward, &
            "driving_force, reaction, joint_variable, power (with energies), checks, friction, motor, controller, clutch, " &
            //"cylinder, or all of these (default); and rcond, which takes longer; with commas between; what is not named is " &
            //"not computed"), &
        option_type("--want", "", "LIST", generate, &
            "driving_force, reaction, joint_variable, position, velocity (the last two of kinematics only) or all (if none is " &
            //"named: driving_force of inverse, all of kinematics, of forward nothing beside qdd)"), &
        option_type("--states", "", "FILE", inverse, &
            "q, qd, qdd from a CSV file, as written with --csv, instead of the scene's motion: a row a sample; columns as the " &
            //"results have them"), &
        option_type("--keep", "", "LIST", sweep, &
            "keep these quantities of every sample, too (names as in 'reduce', with commas between)"), &
        option_type("--resume", "", "", sweep, &
            "go on where an interrupted run of the same sweep stands"), &
        option_type("--yes", "", "", sweep, &
            "start though it is large or long"), &
        option_type("--checkpoint", "", "S", sweep, &
            "seconds between two checkpoints; default 5"), &
        option_type("--solver", "", "NAME", forward + sweep, &
            "elimination (default), lapack, gauss-jordan, reduced, or gauss-jordan-plain (for comparison only)"), &
        option_type("--threads", "", "N", inverse, &
            "threads to compute with; default 1"), &
        option_type("--threads", "", "N", forward, &
            "threads for the forces at output instants; default 1"), &
        option_type("--threads", "", "N", sweep, &
            "threads to compute with; default 1; the results do not depend on it"), &
        option_type("--code", "", "NAME", inverse + forward + sweep, &
            "machine code of kernels: avx512, avx2, scalar, or interpreter; default: the processor's best; the results do not " &
            //"depend on it"), &
        option_type("--compress", "", "", inverse + forward, &
            "compress the netCDF file"), &
        option_type("--sheet", "", "FILE", inverse + forward, &
            "sheet of drives, bearings, limits and pictures, .html or .pdf; results go beside it as .nc if no --output is " &
            //"given; needs the Python package"), &
        option_type("--sheet", "", "FILE", sweep, &
            "sizing sheet, .html or .pdf; results go beside it as .nc if no --output is given; needs the Python package"), &
        option_type("--quiet", "-q", "", inverse + forward + sweep, &
            "no table and no progress"), &
        option_type("--quiet", "-q", "", study, &
            "only write it"), &
        option_type("--quiet", "-q", "", generate, &
            "do not say what was written"), &
        option_type("--help", "-h", "", inverse + forward + sweep + study + explain + generate, &
            "this text")]

contains

    !> The row of an option in a command, by its long or short name; 0: that command has no such option.
    pure integer function option_number(name, of)
        character(len=*), intent(in) :: name
        integer, intent(in) :: of                     !! one of `command_*`

        option_number = findloc((option%name == name .or. option%short == name) .and. is_option_of(of, option), .true., dim=1)
    end function option_number

    elemental logical function is_option_of(command, option)
        integer, intent(in) :: command                !! one of `command_*`
        type(option_type), intent(in) :: option

        is_option_of = btest(option%commands, command)
    end function is_option_of
end module linkdyn_options
