!> Generated code as text: the header, with what a user needs to know, and the source.
module linkdyn_c_files
    use linkdyn_build, only: version
    use linkdyn_c_body, only: c_value, c_pointer, c_routine, make_routine, write_routine, write_calls, uses_operation, &
        take_curves
    use linkdyn_c_curves, only: write_curves
    use linkdyn_c_iteration, only: group_code, write_move, write_settling
    use linkdyn_c_words, only: c_comment, c_number, c_numbers, upper
    use linkdyn_code_fields, only: name_list, field_type, in_c_order, field_size, n_list, of_place, of_placed, note_len
    use linkdyn_closing_programs, only: out_correction, out_response, out_determinant, out_closing_alarm
    use linkdyn_code_kernel, only: controller_kernel
    use linkdyn_force_program, only: out_alarm, out_reach
    use linkdyn_inputs, only: in_branch
    use linkdyn_kinds, only: wp
    use linkdyn_piecewise, only: piecewise_curve
    use linkdyn_schedule, only: op_multiply_add, op_multiply_subtract, op_subtract_product
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: controller_code, write_header, write_source

    !> All that is written.
    type :: controller_code
        character(len=:), allocatable :: file          !! name without ending
        character(len=:), allocatable :: prefix        !! what identifiers begin with
        character(len=:), allocatable :: title         !! of the scene
        character(len=:), allocatable :: kernel        !! in words
        type(name_list) :: list(n_list)
        type(field_type), allocatable :: input(:), output(:)
        type(field_type), allocatable :: state(:)      !! places of links in groups closed by iteration; none: there are none
        type(group_code), allocatable :: group(:)
        type(controller_kernel) :: controller
        real(wp), allocatable :: stride(:)             !! of coordinates through which groups can be followed (n_q) [m, rad]
        real(wp), allocatable :: branch(:)             !! of the closed forms, +1 or -1
        character(len=note_len), allocatable :: branch_at(:)   !! where they close
    end type controller_code

contains

    ! ---------------------------------------------------------------- the header

    !> The structs and functions that a caller sees, with what each number means.
    subroutine write_header(code, unit)
        type(controller_code), intent(in) :: code
        integer, intent(in) :: unit                    !! open for formatted writing
        character(len=:), allocatable :: name, large
        integer :: i

        name = code%prefix
        large = upper(name)
        write (unit, "(a)") "/* "//title_of(code), &
            " *", &
            " * Fill a struct "//name//"_input ("//name//"_start is the scene at its start) and call "//name//"_evaluate.", &
            " * SI units and radians. No memory is allocated and no data is kept: threads may call at once.", &
            " *"
        if (has_state(code)) write (unit, "(a)") &
            " * Loops are closed by iteration from where they stood at the last call: begin with "//name//"_assembly, the links'", &
            " * places at the scene's start, come from there in small steps, and keep one such struct for each mechanism.", &
            " *"
        write (unit, "(a)") &
            " * Written by linkdyn "//version//"; changes are lost when it is written again. */", &
            "#ifndef "//large//"_H", &
            "#define "//large//"_H", &
            "", &
            "#ifdef __cplusplus", &
            "extern ""C"" {", &
            "#endif", &
            ""
        do i = 1, n_list
            if (is_used(code, i)) call write_list(code, i, unit)
        end do
        call write_struct(code, name//"_input", code%input, unit)
        call write_struct(code, name//"_output", code%output, unit)
        if (has_state(code)) call write_struct(code, name//"_state", code%state, unit)
        write (unit, "(a)") "/* What a call found. But for "//large//"_OK the output stays as it was. */", &
            "enum "//name//"_status {", &
            "    "//large//"_OK = 0,", &
            "    "//large//"_NOT_A_NUMBER = 1, /* an input is NaN or infinite */", &
            "    "//large//"_OUT_OF_REACH = 2, /* a loop cannot be closed, or hardly */", &
            "    "//large//"_ALARM = 3, /* too near a singular position: digits may be lost */", &
            "    "//large//"_OVERFLOW = 4"//trim(merge(", ", "  ", has_state(code)))//" /* a result is not finite */"
        if (has_state(code)) write (unit, "(a)") &
            "    "//large//"_NOT_FOLLOWED = 5 /* not reached from the last call's places: too long a step, or a dead end */"
        write (unit, "(a)") "};", &
            "", &
            "/* The scene at its start: at rest, with the loads of its first instant. */", &
            "extern const struct "//name//"_input "//name//"_start;"
        if (has_state(code)) write (unit, "(a)") "extern const struct "//name//"_state "//name//"_assembly;"
        write (unit, "(a)") "", &
            "/* "//capital(code%kernel)//". Returns one of enum "//name//"_status. */", &
            "int "//name//"_evaluate("//parameters(code)//");", &
            "", &
            "#ifdef __cplusplus", &
            "}", &
            "#endif", &
            "", &
            "#endif"
    end subroutine write_header

    logical function has_state(code)
        type(controller_code), intent(in) :: code

        has_state = size(code%state) > 0
    end function has_state

    function parameters(code) result(text)
        type(controller_code), intent(in) :: code
        character(len=:), allocatable :: text

        text = "const struct "//code%prefix//"_input *in, "
        if (has_state(code)) text = text//"struct "//code%prefix//"_state *state, "
        text = text//"struct "//code%prefix//"_output *out"
    end function parameters

    function title_of(code) result(text)
        type(controller_code), intent(in) :: code
        character(len=:), allocatable :: text

        text = capital(code%kernel)
        if (len_trim(code%title) > 0) text = text//" of """//c_comment(code%title)//""""
        text = text//"."
    end function title_of

    function capital(text) result(line)
        character(len=*), intent(in) :: text
        character(len=len(text)) :: line

        line = upper(text(1:1))//text(2:)
    end function capital

    !> Does an array count by this list?
    logical function is_used(code, i)
        type(controller_code), intent(in) :: code
        integer, intent(in) :: i
        integer :: k

        is_used = .false.
        if (code%list(i)%what == "") return
        do k = 1, size(code%input)
            is_used = is_used .or. any(code%input(k)%of == i)
        end do
        do k = 1, size(code%output)
            is_used = is_used .or. any(code%output(k)%of == i)
        end do
        do k = 1, size(code%state)
            is_used = is_used .or. any(code%state(k)%of == i)
        end do
    end function is_used

    subroutine write_list(code, i, unit)
        type(controller_code), intent(in) :: code
        integer, intent(in) :: i, unit
        character(len=:), allocatable :: before
        integer :: k

        before = upper(code%prefix)
        associate (list => code%list(i))
            write (unit, "(a)") "enum "//code%prefix//"_"//trim(list%what)//" {"
            do k = 1, list%n
                write (unit, "(a)") "    "//before//"_"//upper(trim(list%what))//"_"//trim(list%word(k))//" = "//to_text(k - 1) &
                    //", /* "//trim(c_comment(trim(list%label(k))//" "//list%note(k)))//" */"
            end do
            write (unit, "(a)") "    "//before//"_N_"//upper(trim(list%what))//" = "//to_text(list%n), "};", ""
        end associate
    end subroutine write_list

    subroutine write_struct(code, name, member, unit)
        type(controller_code), intent(in) :: code
        character(len=*), intent(in) :: name
        type(field_type), intent(in) :: member(:)
        integer, intent(in) :: unit
        character(len=:), allocatable :: extent
        integer :: i, k

        write (unit, "(a)") "struct "//name//" {"
        do i = 1, size(member)
            extent = ""
            do k = 1, size(member(i)%of)
                if (code%list(member(i)%of(k))%what == "") then
                    extent = extent//"["//to_text(code%list(member(i)%of(k))%n)//"]"
                else
                    extent = extent//"["//upper(code%prefix)//"_N_"//upper(trim(code%list(member(i)%of(k))%what))//"]"
                end if
            end do
            write (unit, "(a)") "    double "//trim(member(i)%name)//extent//"; /* "//trim(member(i)%meaning)//" */"
        end do
        write (unit, "(a)") "};", ""
    end subroutine write_struct

    ! ---------------------------------------------------------------- the source

    !> What is traced, each part as a routine of its own, and the function of the header that calls them.
    subroutine write_source(code, unit)
        type(controller_code), intent(in) :: code
        integer, intent(in) :: unit                    !! open for formatted writing
        type(c_routine) :: routine, closing(size(code%group))
        type(piecewise_curve), allocatable :: curve(:)
        integer :: g

        call wire(code, "compute", code%controller, routine)
        allocate (curve(0))
        call take_curves(routine, curve)
        do g = 1, size(code%group)
            call wire(code, "step_"//to_text(g), code%group(g)%controller, closing(g))
            call take_curves(closing(g), curve)
        end do
        call write_opening(code, routine, closing, unit)
        call write_work(code, routine, closing, unit)
        call write_start(code, code%prefix//"_input", code%prefix//"_start", code%input, unit)
        if (has_state(code)) call write_start(code, code%prefix//"_state", code%prefix//"_assembly", code%state, unit)
        call write_curves(curve, unit)
        if (has_state(code)) call write_move(code%list(of_place)%n, unit)
        do g = 1, size(code%group)
            call write_routine(closing(g), unit)
            call write_settling(code%prefix, g, code%group(g), code%list(of_placed)%label, code%list(of_place)%n, &
                                closing(g), unit)
        end do
        call write_routine(routine, unit)
        call write_evaluate(code, routine, unit)
    end subroutine write_source

    !> What it is, and what it asks of the compiler.
    subroutine write_opening(code, routine, closing, unit)
        type(controller_code), intent(in) :: code
        type(c_routine), intent(in) :: routine, closing(:)
        integer, intent(in) :: unit
        character(len=:), allocatable :: large
        integer :: g, n_operation

        large = upper(code%prefix)
        n_operation = size(routine%line%of)
        do g = 1, size(closing)
            n_operation = n_operation + size(closing(g)%line%of)
        end do
        write (unit, "(a)") "/* "//title_of(code), &
            " *", &
            " * "//to_text(n_operation)//" operations, traced from the scene. Written by linkdyn "//version &
            //"; changes are lost when it is written again. */", &
            "#include """//code%file//".h""", &
            "", &
            "#include <math.h>", &
            ""
        if (uses_operation(routine, [op_multiply_add, op_multiply_subtract, op_subtract_product])) write (unit, "(a)") &
            "/* a b + c, rounded once where the processor has an instruction for it and the compiler may use it: math.h", &
            " * then says FP_FAST_FMA (gcc on x86-64: -mfma). "//large//"_FMA, defined as 1 or 0, decides otherwise. */", &
            "#ifndef "//large//"_FMA", &
            "#ifdef FP_FAST_FMA", &
            "#define "//large//"_FMA 1", &
            "#else", &
            "#define "//large//"_FMA 0", &
            "#endif", &
            "#endif", &
            "#if "//large//"_FMA", &
            "#define multiply_add(a, b, c) fma((a), (b), (c))", &
            "#else", &
            "#define multiply_add(a, b, c) ((a)*(b) + (c))", &
            "#endif", &
            ""
        write (unit, "(a)") "#ifdef __FAST_MATH__", &
            "#error ""with -ffast-math results that are NaN or infinite would go unnoticed""", &
            "#endif", &
            ""
    end subroutine write_opening

    !> What routines leave for each other.
    subroutine write_work(code, routine, closing, unit)
        type(controller_code), intent(in) :: code
        type(c_routine), intent(in) :: routine, closing(:)
        integer, intent(in) :: unit
        integer :: g, n_place, most_rows

        n_place = routine%line%n_place
        most_rows = 0
        do g = 1, size(closing)
            n_place = max(n_place, closing(g)%line%n_place)
            most_rows = max(most_rows, size(code%group(g)%unit))
        end do
        write (unit, "(a)") &
            "struct work {", &
            "    double alarm; /* beyond one, rounding may have grown */", &
            "    double reach; /* not above zero: a loop does not close */"
        if (has_state(code)) write (unit, "(a)") &
            "    double correction["//to_text(most_rows)//"]; /* of the places of a group's links [m, rad] */", &
            "    double response; /* tells how near the group is to a singular position */", &
            "    double determinant; /* its sign tells assemblies apart */"
        if (n_place > 0) write (unit, "(a)") &
            "    double w["//to_text(n_place)//"]; /* what one part finds for others */"
        write (unit, "(a)") "};", ""
    end subroutine write_work

    !> The function that is called: loops are closed, all is computed, and what cannot be trusted is told apart.
    subroutine write_evaluate(code, routine, unit)
        type(controller_code), intent(in) :: code
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: unit
        character(len=:), allocatable :: name, large
        integer :: g

        name = code%prefix
        large = upper(name)
        write (unit, "(a)") "static int all_finite(const double *x, int n)", &
            "{", &
            "    int i;", &
            "    for (i = 0; i < n; i++)", &
            "        if (!isfinite(x[i]))", &
            "            return 0;", &
            "    return 1;", &
            "}", &
            ""
        write (unit, "(a)") &
            "int "//name//"_evaluate("//parameters(code)//")", &
            "{", &
            "    struct work work;", &
            "    struct "//name//"_output found;"
        if (has_state(code)) write (unit, "(a)") &
            "    struct "//name//"_state here = *state;", &
            "    static const double longest_step["//to_text(size(code%stride))//"] = {"//c_numbers(code%stride)//"};", &
            "    int status, i;"
        call write_check(code%input, "in->", large//"_NOT_A_NUMBER", unit)
        call write_check(code%state, "here.", large//"_NOT_A_NUMBER", unit)
        if (has_state(code)) write (unit, "(a)") &
            "    for (i = 0; i < "//to_text(size(code%stride))//"; i++) {", &
            "        if (!(fabs(in->q[i] - here.q[i]) <= longest_step[i]))", &
            "            return "//large//"_NOT_FOLLOWED;", &
            "        here.q[i] = in->q[i];", &
            "    }"
        do g = 1, size(code%group)
            write (unit, "(a)") "    status = settle_"//to_text(g)//"(in, &here, &work);", &
                "    if (status != "//large//"_OK)", &
                "        return status;"
        end do
        call write_calls(routine, 4, [character(len=6) :: "&work", "in", "&here", "&found"], unit)
        write (unit, "(a)") "    /* Written so that what is no number counts as an alarm. */", &
            "    if (!(work.reach > 0.0))", &
            "        return "//large//"_OUT_OF_REACH;", &
            "    if (!(work.alarm <= 1.0))", &
            "        return "//large//"_ALARM;"
        call write_check(code%output, "found.", large//"_OVERFLOW", unit)
        if (has_state(code)) write (unit, "(a)") "    *state = here;"
        write (unit, "(a)") "    *out = found;", &
            "    return "//large//"_OK;", &
            "}"
    end subroutine write_evaluate

    !> What the kernel's inputs and outputs are in C.
    subroutine wire(code, routine_name, controller, routine)
        type(controller_code), intent(in) :: code
        character(len=*), intent(in) :: routine_name
        type(controller_kernel), intent(in) :: controller
        type(c_routine), intent(out) :: routine
        type(c_value), allocatable :: input(:), output(:)      ! too many for a stack, some of them
        type(c_pointer) :: pointer(4)
        character(len=:), allocatable :: name, item
        integer :: k

        allocate (input(controller%kernel%n_input), output(controller%kernel%n_output))
        name = code%prefix
        pointer(1) = c_pointer("struct work *restrict work", "work->")
        pointer(2) = c_pointer("const struct "//name//"_input *restrict in", "in->")
        pointer(3) = c_pointer("const struct "//name//"_state *restrict state", "state->")
        pointer(4) = c_pointer("struct "//name//"_output *restrict out", "out->")
        do k = 1, size(input)
            associate (block => controller%block(k), place => controller%place(k))
                if (block == in_branch) then
                    input(k)%is = c_number(code%branch(place))
                    input(k)%local = "assembly"//to_text(place - 1)
                    input(k)%comment = c_comment(trim(code%branch_at(place))//": of two assemblies that of the start")
                end if
            end associate
        end do
        call find_entries(code, code%input, controller%block, controller%place, "in->", input)
        call find_entries(code, code%state, controller%block, controller%place, "state->", input)
        call find_entries(code, code%output, controller%id, controller%item, "out->", output)
        do k = 1, size(output)
            item = to_text(controller%item(k) - 1)
            select case (controller%id(k))
            case (out_alarm, out_closing_alarm)
                output(k) = c_value(is="work->alarm", comment="alarm")
            case (out_reach)
                output(k) = c_value(is="work->reach", comment="reach")
            case (out_correction)
                output(k) = c_value(is="work->correction["//item//"]", comment="correction "//item)
            case (out_response)
                output(k) = c_value(is="work->response", comment="response to probes")
            case (out_determinant)
                output(k) = c_value(is="work->determinant", comment="determinant")
            end select
        end do
        call make_routine(routine_name, controller%kernel, input, output, pointer, routine)
    end subroutine wire

    !> Numbers of blocks, or results, as entries of a struct's arrays.
    subroutine find_entries(code, member, id, place, begin, entry)
        type(controller_code), intent(in) :: code
        type(field_type), intent(in) :: member(:)
        integer, intent(in) :: id(:), place(:)         !! (entry)
        character(len=*), intent(in) :: begin          !! `in->`
        type(c_value), intent(inout) :: entry(:)
        integer, allocatable :: at(:)
        integer :: i, k

        do i = 1, size(member)
            associate (one => member(i))
                allocate (at(0:maxval(one%place)))
                at = 0
                at(one%place) = [(k, k=1, field_size(one))]
                do k = 1, size(entry)
                    if (id(k) /= one%id .or. place(k) > ubound(at, 1)) cycle
                    if (at(place(k)) == 0) cycle
                    entry(k)%is = begin//trim(one%name)//in_c_order(one, code%list, at(place(k)))
                    entry(k)%local = local_name(trim(one%name)//in_c_order(one, code%list, at(place(k))))
                    entry(k)%comment = trim(one%name)//": "//label_of(one, code%list, at(place(k)))
                end do
                deallocate (at)
            end associate
        end do
    end subroutine find_entries

    !> "load[1][2]" as a name, "load_1_2".
    pure function local_name(text) result(name)
        character(len=*), intent(in) :: text
        character(len=:), allocatable :: name
        integer :: i

        name = ""
        do i = 1, len(text)
            if (text(i:i) == "[") name = name//"_"
            if (scan(text(i:i), "[]") == 0) name = name//text(i:i)
        end do
    end function local_name

    !> Names of an entry: "J1 Fx [N]".
    function label_of(one, list, i) result(text)
        type(field_type), intent(in) :: one
        type(name_list), intent(in) :: list(:)
        integer, intent(in) :: i
        character(len=:), allocatable :: text
        integer :: rest, k, at

        text = ""
        rest = i - 1
        do k = size(one%of), 1, -1
            at = 1 + modulo(rest, list(one%of(k))%n)
            rest = rest/list(one%of(k))%n
            text = trim(list(one%of(k))%label(at))//" "//text
        end do
        text = c_comment(text)
    end function label_of

    !> Members of a struct at the scene's start.
    subroutine write_start(code, struct, name, member, unit)
        type(controller_code), intent(in) :: code
        character(len=*), intent(in) :: struct, name
        type(field_type), intent(in) :: member(:)
        integer, intent(in) :: unit
        character(len=:), allocatable :: line
        integer :: i, k, d, inner

        write (unit, "(a)") "const struct "//struct//" "//name//" = {"
        do i = 1, size(member)
            associate (one => member(i))
                line = "    ."//trim(one%name)//" = {"
                inner = field_size(one)
                if (size(one%of) > 1) inner = code%list(one%of(2))%n
                do k = 1, field_size(one)
                    d = modulo(k - 1, inner)
                    if (size(one%of) > 1 .and. d == 0) line = line//"{"
                    line = line//c_number(one%start(k))
                    if (size(one%of) > 1 .and. d == inner - 1) line = line//"}"
                    if (k < field_size(one)) line = line//", "
                end do
                write (unit, "(a)") line//"}"//trim(merge(",", " ", i < size(member)))
            end associate
        end do
        write (unit, "(a)") "};", ""
    end subroutine write_start

    !> All numbers of a struct must be finite.
    subroutine write_check(member, begin, otherwise, unit)
        type(field_type), intent(in) :: member(:)
        character(len=*), intent(in) :: begin, otherwise
        integer, intent(in) :: unit
        character(len=:), allocatable :: line
        integer :: i

        do i = 1, size(member)
            line = "all_finite((const double *)"//begin//trim(member(i)%name)//", "//to_text(field_size(member(i)))//")"
            if (i == 1) then
                line = "    if (!("//line
            else
                line = "          && "//line
            end if
            if (i == size(member)) line = line//"))"
            write (unit, "(a)") line
        end do
        if (size(member) > 0) write (unit, "(a)") "        return "//otherwise//";"
    end subroutine write_check
end module linkdyn_c_files
