!> Curves in pieces as tables in C, and the look-ups of `linkdyn_piecewise` in them: bounded searches that keep nothing.
module linkdyn_c_curves
    use linkdyn_c_words, only: c_number, c_numbers
    use linkdyn_kinds, only: wp
    use linkdyn_piecewise, only: piecewise_curve, most_steps, nearly
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: find_curve, write_curves

contains

    !> The number of a curve among those that are written; it is put there if it is none of them.
    subroutine find_curve(curve, shelf, number)
        type(piecewise_curve), intent(in) :: curve
        type(piecewise_curve), allocatable, intent(inout) :: shelf(:)
        integer, intent(out) :: number
        type(piecewise_curve), allocatable :: longer(:)

        do number = 1, size(shelf)
            if (are_same(shelf(number), curve)) return
        end do
        allocate (longer(number))
        longer(:number - 1) = shelf
        longer(number) = curve
        call move_alloc(longer, shelf)
    end subroutine find_curve

    pure logical function are_same(a, b)
        type(piecewise_curve), intent(in) :: a, b

        are_same = (a%is_polar .eqv. b%is_polar) .and. size(a%c) == size(b%c)
        if (are_same) are_same = all(a%c == b%c) .and. all(a%knot == b%knot)
    end function are_same

    !> Tables, and functions that look up in them.
    subroutine write_curves(shelf, unit)
        type(piecewise_curve), intent(in) :: shelf(:)
        integer, intent(in) :: unit
        integer :: k

        if (size(shelf) == 0) return
        write (unit, "(a)") "/* A closed curve in pieces: cubics of the part of the way through a piece,", &
            " * x and y or radius and angle. */", &
            "struct curve {", &
            "    int n; /* pieces */", &
            "    int is_polar;", &
            "    const double (*c)[8]; /* four coefficients of each component */", &
            "    const double (*knot)[2]; /* points at which pieces begin */", &
            "    const double (*axis)[2]; /* and their directions, if it is polar */", &
            "};", ""
        do k = 1, size(shelf)
            call write_curve(shelf(k), to_text(k), unit)
        end do
        call write_look_ups(unit)
    end subroutine write_curves

    subroutine write_curve(curve, number, unit)
        type(piecewise_curve), intent(in) :: curve
        character(len=*), intent(in) :: number
        integer, intent(in) :: unit
        character(len=:), allocatable :: axis
        integer :: n

        n = size(curve%knot, 2)
        axis = "0"
        call write_rows("piece_"//number, reshape(reshape(curve%c, [4, 2, n], order=[1, 3, 2]), [8, n]))
        call write_rows("knot_"//number, curve%knot)
        if (curve%is_polar) then
            call write_rows("axis_"//number, curve%axis)
            axis = "axis_"//number
        end if
        write (unit, "(a)") "static const struct curve curve_"//number//" = {"//to_text(n)//", " &
            //trim(merge("1", "0", curve%is_polar))//", piece_"//number//", knot_"//number//", "//axis//"};", ""

    contains

        subroutine write_rows(name, row)
            character(len=*), intent(in) :: name
            real(wp), intent(in) :: row(:, :)
            integer :: i

            write (unit, "(a)") "static const double "//name//"["//to_text(n)//"]["//to_text(size(row, 1))//"] = {"
            do i = 1, n
                write (unit, "(a)") "    {"//c_numbers(row(:, i))//"}"//trim(merge(",", " ", i < n))
            end do
            write (unit, "(a)") "};"
        end subroutine write_rows
    end subroutine write_curve

    !> The look-ups, each a function in C.
    subroutine write_look_ups(unit)
        integer, intent(in) :: unit

        write (unit, "(a)") "/* A cubic, or a derivative of it. */", &
            "static double cubic(const double *c, int order, double t)", &
            "{", &
            "    if (order == 0)", &
            "        return c[0] + t*(c[1] + t*(c[2] + t*c[3]));", &
            "    if (order == 1)", &
            "        return c[1] + t*(2.0*c[2] + t*(3.0*c[3]));", &
            "    if (order == 2)", &
            "        return 2.0*c[2] + t*(6.0*c[3]);", &
            "    return 6.0*c[3] + 0.0*t; /* no number stays none */", &
            "}", "", &
            "/* A component, or a derivative by the place: the number of a piece and the part of the way through it. */", &
            "static double along(const struct curve *curve, int component, int order, double place)", &
            "{", &
            "    const double within = place > 0.0 ? place : 0.0;", &
            "    const int i = (int)(within < curve->n - 1 ? within : curve->n - 1);", &
            "    return cubic(curve->c[i] + 4*component, order, place - i);", &
            "}", "", &
            "/* What vanishes at the best place, and how it grows with the part of piece i. */", &
            "static void look(const struct curve *curve, int is_nearest, int i, double part, double a, double b,", &
            "                 double *slope, double *growth)", &
            "{", &
            "    const double *c = curve->c[i];", &
            "    const double u = cubic(c, 0, part), u1 = cubic(c, 1, part), u2 = cubic(c, 2, part);", &
            "    double x = u, y, x1 = u1, y1, x2, y2, p = a, q = b;", &
            "    if (curve->is_polar) {", &
            "        const double v = c[5], cosine = cos(v*part), sine = sin(v*part);", &
            "        const double *axis = curve->axis[i];", &
            "        const double r = axis[0]*a + axis[1]*b, s = axis[0]*b - axis[1]*a;", &
            "        p = cosine*r + sine*s;", &
            "        q = cosine*s - sine*r;", &
            "        y = 0.0;", &
            "        y1 = u*v;", &
            "        x2 = u2 - u*v*v;", &
            "        y2 = 2.0*u1*v;", &
            "    } else {", &
            "        y = cubic(c + 4, 0, part);", &
            "        y1 = cubic(c + 4, 1, part);", &
            "        x2 = u2;", &
            "        y2 = cubic(c + 4, 2, part);", &
            "    }", &
            "    if (is_nearest) {", &
            "        *slope = (x - p)*x1 + (y - q)*y1;", &
            "        *growth = (x1*x1 + y1*y1) + ((x - p)*x2 + (y - q)*y2);", &
            "    } else {", &
            "        *slope = -(x1*p + y1*q);", &
            "        *growth = -(x2*p + y2*q);", &
            "    }", &
            "}", ""
        write (unit, "(a)") "/* The place nearest to the point (a, b), or farthest in that direction: from the best knot by", &
            " * Newton's method between bounds. */", &
            "static double best_place(const struct curve *curve, int is_nearest, double a, double b)", &
            "{", &
            "    double best = 0.0, low = 0.0, high = 1.0, part = 0.0, slope, growth;", &
            "    int i = 0, k, step;", &
            "    for (k = 0; k < curve->n; k++) {", &
            "        const double x = curve->knot[k][0], y = curve->knot[k][1];", &
            "        const double far = is_nearest ? (x - a)*(x - a) + (y - b)*(y - b) : -(x*a + y*b);", &
            "        if (k > 0 && !(far < best))", &
            "            continue;", &
            "        best = far;", &
            "        i = k;", &
            "    }", &
            "    look(curve, is_nearest, i, 0.0, a, b, &slope, &growth);", &
            "    if (slope > 0.0) {", &
            "        i = (i + curve->n - 1) % curve->n;", &
            "        part = 1.0;", &
            "    }", &
            "    for (step = 1; step <= "//to_text(most_steps)//"; step++) {", &
            "        double next, move;", &
            "        int is_sound;", &
            "        look(curve, is_nearest, i, part, a, b, &slope, &growth);", &
            "        if (slope > 0.0)", &
            "            high = part;", &
            "        else", &
            "            low = part;", &
            "        next = part - slope/growth;", &
            "        is_sound = growth > 0.0 && next >= low && next <= high;", &
            "        if (!is_sound)", &
            "            next = (low + high)*0.5;", &
            "        move = fabs(next - part);", &
            "        part = next;", &
            "        if (move <= "//c_number(epsilon(1.0_wp))//" || (is_sound && move <= "//c_number(nearly)//"))", &
            "            break;", &
            "    }", &
            "    return i + part;", &
            "}", ""
    end subroutine write_look_ups
end module linkdyn_c_curves
