!> The command line as a typed value.
module linkdyn_cli
    use linkdyn_forward, only: integrator_options, choose_method, method_name, method_rk4
    use linkdyn_generate, only: code_wish, choose_language, choose_kernel, choose_code_results, kernel_name
    use linkdyn_input, only: parse_number
    use linkdyn_code, only: choose_code, code_name
    use linkdyn_inverse, only: inverse_options, choose_solver, solver_name
    use linkdyn_kinds, only: wp
    use linkdyn_options, only: command_none, command_forward, command_sweep, command_study, command_generate, command_version, &
        command, command_in_python, option, option_number, is_option_of
    use linkdyn_results, only: wanted_type, choose_wanted, all_wanted, add_free
    use linkdyn_status, only: status_type, fail, status_bad_input, status_internal
    use linkdyn_suggest, only: suggestion
    use linkdyn_text, only: one_of, quoted
    use linkdyn_threads, only: team_size
    implicit none (type, external)
    private
    public :: command_line, argument_type, read_arguments, parse_arguments

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
        type(code_wish) :: code                       !! of generated code
        logical, private :: was_given(size(option)) = .false.
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
        call take_command(arguments(1)%text)
        if (.not. status%is_ok() .or. any(config%command == [command_none, command_version])) return
        i = 2
        do while (i <= size(arguments) .and. status%is_ok())
            call take_word(arguments, i, config, status)
        end do
        if (.not. status%is_ok() .or. config%help) return
        if (.not. allocated(config%scene)) call refuse("no scene given (expected a file, e.g. scene.toml)")
        call heed_ending()
        call refuse_contradictions()
        if (config%command == command_generate) then
            call take_code_results()
        else
            call settle_results()
        end if

    contains

        !> A command, or an option in place of one.
        subroutine take_command(word)
            character(len=*), intent(in) :: word

            select case (word)
            case ("--version")
                config%command = command_version
                if (size(arguments) > 1) call refuse(quoted(arguments(2)%text)//": unexpected argument (expected --version alone)")
                return
            case ("--help", "-h", "help")
                config%help = .true.
                return
            end select
            config%command = findloc(command%name == word, .true., dim=1)
            if (config%command /= command_none) return
            if (any(command_in_python%name == word)) then
                call refuse(word//": "//trim(command_in_python(findloc(command_in_python%name == word, .true., dim=1))%text) &
                            //" (expected the command linkdyn that it installs)")
            else if (index(word, "-") == 1) then
                call refuse(quoted(word)//": unknown option"//suggestion(word, global_option))
            else
                call refuse(quoted(word)//": unknown command (expected "//one_of([command%name, command_in_python%name])//")" &
                            //suggestion(word, [command%name, command_in_python%name]))
            end if
        end subroutine take_command

        !> Options that cannot both be meant.
        subroutine refuse_contradictions()
            if (config%no_output .and. (allocated(config%output) .or. config%csv .or. config%deflate > 0)) &
                call refuse("--no-output: nothing is written (expected no --output, --csv or --compress beside it)")
            if (config%csv .and. config%deflate > 0) &
                call refuse("--compress: only netCDF files are compressed (expected no --csv beside it)")
            if (config%integrator%method == method_rk4 .and. (is_given(config, "--rtol") .or. is_given(config, "--atol"))) &
                call refuse("--rtol, --atol: method rk4 has a fixed step and no tolerance (expected --step)")
        end subroutine refuse_contradictions

        !> What is computed, where nothing or not all is named.
        subroutine settle_results()
            if (.not. allocated(config%want)) config%wanted = default_wanted(config)
            call add_free(config%options%solver, config%wanted)
            config%wanted%errors = config%error
            config%options%wants_errors = config%error
            config%options%wants_rcond = config%wanted%rcond
            config%options%wants_distance = config%wanted%distance
        end subroutine settle_results

        !> A table is asked for by the ending of its name, too; with that of the other kind it would be taken for one.
        subroutine heed_ending()
            character(len=*), parameter :: foreign_ending(*) = &
                [character(len=8) :: ".xlsx", ".xls", ".ods", ".mat", ".json", ".html", ".pdf", ".png", ".parquet"]
            character(len=*), parameter :: not_written = ": files of this kind are not written (expected "
            integer :: dot

            if (.not. allocated(config%output) .or. config%command == command_generate) return
            dot = index(config%output, ".", back=.true.)
            if (dot == 0) return
            associate (ending => config%output(dot:))
                select case (config%command)
                case (command_sweep)
                    if (any(ending == foreign_ending) .or. ending == ".csv") &
                        call refuse(quoted(config%output)//not_written//".nc)")
                    return
                case (command_study)
                    if (any(ending == foreign_ending) .or. ending == ".nc") &
                        call refuse(quoted(config%output)//not_written//".csv)")
                    return
                end select
            end associate
            if (config%output(dot:) == ".parquet") &
                call refuse(quoted(config%output)//not_written//".nc; in Python, run.linkdyn.to_parquet)")
            if (any(config%output(dot:) == foreign_ending)) &
                call refuse(quoted(config%output)//not_written//".nc, or .csv for a spreadsheet)")
            if (config%output(dot:) == ".csv") config%csv = .true.
            if (config%output(dot:) == ".nc" .and. config%csv) &
                call refuse("--csv: "//quoted(config%output)//" has the ending of netCDF (expected .csv)")
        end subroutine heed_ending

        !> Which results there are depends on the kernel, which may be named later.
        subroutine take_code_results()
            type(status_type) :: outcome

            if (.not. allocated(config%want)) config%want = ""
            call choose_code_results(config%want, config%code, outcome)
            if (.not. outcome%is_ok()) call refuse("--"//trim(outcome%message))
        end subroutine take_code_results

        subroutine refuse(message)
            character(len=*), intent(in) :: message

            call fail(status, status_bad_input, "linkdyn: "//message)
        end subroutine refuse
    end subroutine parse_arguments

    !> What is computed if the user does not say: all that the solver gives; without output, what the summary shows.
    pure function default_wanted(config) result(wanted)
        type(command_line), intent(in) :: config
        type(wanted_type) :: wanted

        wanted = all_wanted(config%options%solver)
        if (config%no_output) wanted = wanted_type(reaction=wanted%reaction, joint_variable=.false., power=.false., &
                                                   checks=.false., friction=.false.)
    end function default_wanted

    !> One option with its value, or the name of the scene.
    subroutine take_word(arguments, i, config, status)
        type(argument_type), intent(in) :: arguments(:)
        integer, intent(inout) :: i                   !! current word; moved past what is taken
        type(command_line), intent(inout) :: config
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: word, value
        integer :: equals, k

        word = arguments(i)%text
        i = i + 1
        if (index(word, "-") /= 1) then
            if (allocated(config%scene)) then
                call refuse(quoted(word)//": a second scene (expected one)")
            else if (word == "") then
                call refuse("the scene has no name (expected a file, e.g. scene.toml)")
            else
                config%scene = word
            end if
            return
        end if
        equals = index(word, "=")
        if (index(word, "--") == 1 .and. equals > 0) then
            value = word(equals + 1:)
            word = word(:equals - 1)
        end if
        k = option_number(word, config%command)
        call check_option(word, k)
        if (.not. status%is_ok()) return
        config%was_given(k) = .true.
        if (option(k)%value == "") then
            if (allocated(value)) then
                call refuse(word//": takes no value")
            else
                call take_flag(trim(option(k)%name))
            end if
            return
        end if
        if (.not. allocated(value)) then
            value = "--"
            if (i <= size(arguments)) value = arguments(i)%text
            if (index(value, "--") == 1) then
                call refuse(word//": value missing (a value that starts with '--' is given as "//trim(option(k)%name)//"=VALUE)")
                return
            end if
            i = i + 1
        end if
        call take_value(trim(option(k)%name), value)

    contains

        !> Refuse what this command does not know, by name where another one does, and what was said before.
        subroutine check_option(word, k)
            character(len=*), intent(in) :: word
            integer, intent(in) :: k
            integer :: c

            associate (this => config%command)
                if (k > 0) then
                    if (config%was_given(k)) call refuse(word//": given twice (expected once)")
                    return
                end if
                c = findloc([(option_number(word, c) > 0, c=1, size(command))], .true., dim=1)
                if (c > 0) then
                    call refuse(quoted(word)//": unknown option of linkdyn "//trim(command(this)%name) &
                                //" (expected with linkdyn "//trim(command(c)%name)//")")
                else
                    call refuse(quoted(word)//": unknown option" &
                                //suggestion(word, pack(option%name, is_option_of(this, option))) &
                                //" (linkdyn "//trim(command(this)%name)//" --help lists the options)")
                end if
            end associate
        end subroutine check_option

        subroutine take_flag(name)
            character(len=*), intent(in) :: name

            select case (name)
            case ("--help")
                config%help = .true.
            case ("--csv")
                config%csv = .true.
            case ("--error")
                config%error = .true.
            case ("--no-output")
                config%no_output = .true.
            case ("--compress")
                config%deflate = 1
            case ("--resume")
                config%resume = .true.
            case ("--yes")
                config%yes = .true.
            case ("--no-switch")
                config%switches = .false.
            case ("--matrix")
                config%matrix = .true.
            case ("--quiet")
                config%quiet = .true.
            case default
                call miss(name)
            end select
        end subroutine take_flag

        subroutine take_value(name, value)
            character(len=*), intent(in) :: name, value
            type(status_type) :: outcome

            select case (name)
            case ("--output")
                if (len_trim(value) == 0) call refuse(name//": empty file name")
                config%output = value
            case ("--sheet")
                call refuse("--sheet: the sheet is drawn by the Python package (expected the command linkdyn that it " &
                            //"installs)")
            case ("--states")
                if (len_trim(value) == 0) call refuse(name//": empty file name")
                config%states = value
            case ("--solver")
                config%solver = value
                call choose_solver(value, config%options%solver, outcome)
                if (.not. outcome%is_ok()) call refuse("--"//trim(outcome%message)//suggestion(value, solver_name))
            case ("--code")
                call choose_code(value, outcome)
                if (.not. outcome%is_ok()) call refuse("--"//trim(outcome%message)//suggestion(value, code_name))
            case ("--want")
                config%want = value
                if (config%command == command_generate) then
                    if (len_trim(value) == 0) call refuse(name//": empty list")
                    return
                end if
                call choose_wanted(value, config%wanted, outcome)
                if (.not. outcome%is_ok()) call refuse("--"//trim(outcome%message))
                if (config%command == command_forward .and. config%wanted%distance) &
                    call refuse("--want: singularity_distance is not a result of forward runs (expected linkdyn inverse)")
            case ("--lang")
                call choose_language(value, outcome)
                if (.not. outcome%is_ok()) call refuse("--"//trim(outcome%message))
            case ("--kernel")
                call choose_kernel(value, config%code%kernel, outcome)
                if (.not. outcome%is_ok()) call refuse("--"//trim(outcome%message)//suggestion(value, kernel_name))
            case ("--threads")
                config%options%threads = whole_number(value)
                if (config%options%threads < 1) &
                    call refuse("--threads: "//quoted(value)//" (expected a whole number from 1 to 999999999)")
                config%options%threads = team_size(config%options%threads, config%options%threads)
            case ("--method")
                call choose_method(value, config%integrator%method, outcome)
                if (.not. outcome%is_ok()) call refuse("--"//trim(outcome%message)//suggestion(value, method_name))
            case ("--step")
                call take_number(name, value, config%integrator%step)
            case ("--rtol")
                call take_number(name, value, config%integrator%rtol)
            case ("--atol")
                call take_number(name, value, config%integrator%atol)
            case ("--until")
                call take_number(name, value, config%until)
                config%has_until = .true.
            case ("--keep")
                config%keep = value
            case ("--checkpoint")
                call take_number(name, value, config%checkpoint)
                if (config%checkpoint < 0) call refuse(name//": "//quoted(value)//" (expected seconds)")
            case ("--samples")
                config%n_sample = whole_number(value)
                if (config%n_sample < 2) call refuse("--samples: "//quoted(value)// &
                    " (expected a whole number from 2, both ends, to 999999999)")
            case default
                call miss(name)
            end select
        end subroutine take_value

        !> The table of options has it, and nothing is done about it.
        subroutine miss(name)
            character(len=*), intent(in) :: name

            call fail(status, status_internal, "linkdyn: "//name//": not taken in, a defect of linkdyn")
        end subroutine miss

        subroutine take_number(name, text, number)
            character(len=*), intent(in) :: name, text
            real(wp), intent(out) :: number
            integer :: n_used

            call parse_number(text, number, n_used)
            if (n_used == 0 .or. n_used < len(text) .or. .not. abs(number) <= huge(1.0_wp)) &
                call refuse(name//": "//quoted(text)//" (expected a number)")
        end subroutine take_number

        subroutine refuse(message)
            character(len=*), intent(in) :: message

            call fail(status, status_bad_input, "linkdyn: "//message)
        end subroutine refuse
    end subroutine take_word

    pure logical function is_given(config, name)
        type(command_line), intent(in) :: config
        character(len=*), intent(in) :: name

        is_given = config%was_given(option_number(name, config%command))
    end function is_given

    !> The number, or -1 if the text is none.
    pure integer function whole_number(text)
        character(len=*), intent(in) :: text
        integer :: code

        whole_number = -1
        if (len(text) == 0 .or. len(text) > 9 .or. verify(text, "0123456789") > 0) return
        read (text, *, iostat=code) whole_number
        if (code /= 0) whole_number = -1
    end function whole_number
end module linkdyn_cli
