!> Newton's iteration of a group of links in generated code, by the rules of `linkdyn_newton_rules`: bounded, from where the links
!> stood at the last call.
module linkdyn_c_iteration
    use linkdyn_c_body, only: c_routine, write_calls, is_handed
    use linkdyn_c_words, only: c_comment, c_number, c_numbers, upper
    use linkdyn_code_kernel, only: controller_kernel
    use linkdyn_following, only: largest_contraction
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: n_probe
    use linkdyn_newton_rules, only: small_step, rounding_at, largest_turn, least_group_margin
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: group_code, write_move, write_settling

    integer, parameter :: most_steps = 8               !! of Newton's method, which squares the error

    !> A group closed by iteration.
    type :: group_code
        type(controller_kernel) :: controller          !! its step
        integer :: first = 0, n = 0                    !! among the links placed so
        real(wp), allocatable :: unit(:)               !! of its corrections (row)
        real(wp) :: size = 1                           !! how far joints of a link are apart [m]
        real(wp) :: sense = 1                          !! sign of the determinant on the start's assembly
    end type group_code

contains

    !> A correction taken from a link's place.
    subroutine write_move(place_size, unit)
        integer, intent(in) :: place_size              !! numbers that place a link
        integer, intent(in) :: unit

        if (place_size == 3) then
            write (unit, "(a)") "/* A link's place, x, y and angle, less a shift and a turn. */", &
                "static void move_back(double *restrict p, const double *restrict by)", &
                "{", &
                "    int i;", &
                "    for (i = 0; i < 3; i++)", &
                "        p[i] -= by[i];", &
                "}", ""
        else
            write (unit, "(a)") "/* A link's place, x, y, z and quaternion, less a shift and a small turn. */", &
                "static void move_back(double *restrict p, const double *restrict by)", &
                "{", &
                "    const double a = -0.5*by[3], b = -0.5*by[4], c = -0.5*by[5]; /* (1, a, b, c) times the quaternion */", &
                "    const double w = p[3] - (a*p[4] + b*p[5] + c*p[6]);", &
                "    const double x = p[4] + (a*p[3] + b*p[6] - c*p[5]);", &
                "    const double y = p[5] + (b*p[3] + c*p[4] - a*p[6]);", &
                "    const double z = p[6] + (c*p[3] + a*p[5] - b*p[4]);", &
                "    const double per_length = 1.0/sqrt(w*w + x*x + y*y + z*z);", &
                "    int i;", &
                "    for (i = 0; i < 3; i++)", &
                "        p[i] -= by[i];", &
                "    p[3] = w*per_length;", &
                "    p[4] = x*per_length;", &
                "    p[5] = y*per_length;", &
                "    p[6] = z*per_length;", &
                "}", ""
        end if
    end subroutine write_move

    !> Newton's iteration of a group, by the rules of `linkdyn_newton_rules`.
    subroutine write_settling(name, g, group, label, place_size, closing, unit)
        character(len=*), intent(in) :: name           !! what identifiers begin with
        integer, intent(in) :: g                       !! number of the group
        type(group_code), intent(in) :: group
        character(len=*), intent(in) :: label(:)       !! of all links placed so
        integer, intent(in) :: place_size              !! numbers that place one
        type(c_routine), intent(in) :: closing         !! its step
        integer, intent(in) :: unit
        integer, parameter :: of_caller = 2            !! what the caller gives, among the pointers of a step
        character(len=:), allocatable :: large, rows, links, freedom, shifts
        integer :: i

        large = upper(name)
        rows = to_text(size(group%unit))
        freedom = to_text(size(group%unit)/group%n)
        shifts = to_text(merge(2, 3, place_size == 3))
        links = ""
        do i = 1, group%n
            links = links//trim(merge(", ", "  ", i > 1))//" "//trim(c_comment(label(group%first + i - 1)))
        end do
        write (unit, "(a)") "/* Places of"//links//", by Newton's method from where they stood.", &
            " * Corrections must shrink at least fourfold: then there is one solution near, this assembly (Kantorovich). */", &
            "static int settle_"//to_text(g)//"(const struct "//name//"_input *in, struct "//name//"_state *state, " &
                //"struct work *work)", &
            "{", &
            "    static const double unit["//rows//"] = {"//c_numbers(group%unit)//"};", &
            "    double largest, before = 0.0, distance, margin, noise;", &
            "    int step, i, k;", &
            ""
        if (.not. is_handed(closing, of_caller)) write (unit, "(a)") "    (void)in; /* links that stand already lead these */"
        write (unit, "(a)") &
            "    for (step = 1; step <= "//to_text(most_steps)//"; step++) {"
        call write_calls(closing, 8, [character(len=6) :: "work", "in", "state", ""], unit)
        write (unit, "(a)") "        if (!(work->alarm <= 1.0))", &
            "            return "//large//"_ALARM;", &
            "        largest = 0.0; /* of the corrections, lengths by the group's size */", &
            "        for (i = 0; i < "//rows//"; i++) {", &
            "            const double size = fabs(work->correction[i])/unit[i];", &
            "            if (!(size <= "//c_number(largest_turn)//"))", &
            "                return "//large//"_NOT_FOLLOWED;", &
            "            if (size > largest)", &
            "                largest = size;", &
            "        }", &
            "        /* Not above zero on another assembly. */", &
            "        margin = "//trim(merge("-", " ", group%sense < 0))//"work->determinant > 0.0 ? sqrt(" &
                //c_number(real(n_probe, wp)/size(group%unit))//"/work->response) : 0.0;", &
            "        distance = "//c_number(group%size)//"; /* [m] */", &
            "        for (i = "//to_text(group%first - 1)//"; i < "//to_text(group%first + group%n - 1)//"; i++)", &
            "            for (k = 0; k < "//shifts//"; k++)", &
            "                if (fabs(state->place[i][k]) > distance)", &
            "                    distance = fabs(state->place[i][k]);", &
            "        noise = "//c_number(rounding_at(1.0_wp, group%size))//"*distance/(margin > " &
                //c_number(least_group_margin)//" ? margin : "//c_number(least_group_margin)//");", &
            "        for (i = 0; i < "//to_text(group%n)//"; i++)", &
            "            move_back(state->place["//to_text(group%first - 1)//" + i], work->correction + "//freedom//"*i);", &
            "        if (largest <= noise || largest <= "//c_number(small_step)//")", &
            "            return margin > "//c_number(least_group_margin)//" ? "//large//"_OK : "//large//"_ALARM;", &
            "        if (step > 1 && largest > "//c_number(largest_contraction)//"*before)", &
            "            return "//large//"_NOT_FOLLOWED;", &
            "        before = largest;", &
            "    }", &
            "    return "//large//"_NOT_FOLLOWED;", &
            "}", ""
    end subroutine write_settling
end module linkdyn_c_iteration
