!> "Did you mean": the word nearest to a misspelt one.
module linkdyn_suggest
    use linkdyn_text, only: lower_case, quoted
    implicit none (type, external)
    private
    public :: suggestion

    !> What others call a thing, and what it is called here.
    character(len=14), parameter :: called(2, 110) = reshape([character(len=14) :: &
        "hinge", "revolute", "pin", "revolute", "pivot", "revolute", "slide", "prismatic", "slider", "prismatic", &
        "linear", "prismatic", "ball", "spherical", "hooke", "universal", "cardan", "universal", "weld", "fixed", &
        "helical", "screw", "2d", "planar", "plane", "planar", "3d", "spatial", "space", "spatial", &
        "com", "cog", "cg", "cog", "center_of_mass", "cog", "centre_of_mass", "cog", "points", "markers", &
        "sites", "markers", "newton", "N", "joule", "J", "watt", "W", "volt", "V", &
        "ampere", "A", "pascal", "Pa", "henry", "H", "hertz", "Hz", "meter", "m", &
        "metre", "m", "meters", "m", "metres", "m", "inch", "in", "inches", "in", &
        "feet", "ft", "foot", "ft", "gram", "g", "ton", "t", "tonne", "t", &
        "lbs", "lb", "pound", "lb", "sec", "s", "second", "s", "seconds", "s", &
        "hour", "h", "degree", "deg", "degrees", "deg", "grad", "deg", "radian", "rad", &
        "radians", "rad", "revolution", "rev", "revolutions", "rev", "turn", "rev", "turns", "rev", &
        "u", "rev", "umdr", "rev", "minute", "min", "minutes", "min", "hr", "h", &
        "millimeter", "mm", "millimetre", "mm", "millimeters", "mm", "millimetres", "mm", "kilogram", "kg", &
        "kilograms", "kg", "kilo", "kg", "grams", "g", "hp", "W", "ps", "W", &
        "amp", "A", "amps", "A", "volts", "V", "watts", "W", "newtons", "N", &
        "weight", "mass", "torque", "moment", "mu", "coulomb", "gear", "ratio", "gear_ratio", "ratio", &
        "speed", "rate", "velocity", "rate", "ground", "frame", "fixed", "frame", "body", "link", &
        "bodies", "link", "motor", "actuator", "name", "title", "sine", "harmonic", "sinusoidal", "harmonic", &
        "sin", "harmonic", "spline", "table", "rotation", "constant-rate", "coefficient", "coulomb", "friction", "coulomb", &
        "k", "stiffness", "spring_rate", "stiffness", "free_length", "rest", "length", "rest", "i", "ratio", &
        "inertia", "rotor_inertia", "max_torque", "torque_limit", "max_current", "current_limit", "max_power", "power_limit", &
        "until", "to", "end", "to", "p", "kp", "d", "kd", "liter", "litre", "l", "litre"], [2, 110])

contains

    !> "; did you mean 'mass'?" if one of the words is near enough, or the only one that begins so; otherwise nothing.
    pure function suggestion(word, words) result(text)
        character(len=*), intent(in) :: word
        character(len=*), intent(in) :: words(:)
        character(len=:), allocatable :: text
        integer :: i, best, distance, nearest

        text = ""
        best = called_here(word, words)
        if (best > 0) then
            text = "; did you mean "//quoted(words(best))//or_alike(word, words, best)//"?"
            return
        end if
        nearest = 1 + len_trim(word)/4
        do i = 1, size(words)
            if (len_trim(words(i)) == 0) cycle
            if (abs(len_trim(words(i)) - len_trim(word)) > nearest) cycle
            distance = edit_distance(trim(word), trim(words(i)))
            if (distance > nearest .or. distance >= max(len_trim(word), len_trim(words(i)))) cycle
            if (best > 0 .and. distance == nearest) cycle
            best = i
            nearest = distance
        end do
        if (best == 0) best = beginning_with(word, words)
        if (best > 0) text = "; did you mean "//quoted(words(best))//"?"
    end function suggestion

    !> " or 'mPa'": words before the one that was found that differ from it, and from what was written, in the size of letters
    !> alone.
    pure function or_alike(word, words, one) result(text)
        character(len=*), intent(in) :: word
        character(len=*), intent(in) :: words(:)
        integer, intent(in) :: one
        character(len=:), allocatable :: text
        integer :: i, k

        text = ""
        do i = 1, one - 1
            if (lower_case(words(i)) == lower_case(word) .and. all(words(i) /= words([(k, k=1, i - 1), one]))) &
                text = text//" or "//quoted(words(i))
        end do
    end function or_alike

    !> The word for what others call otherwise, or write in letters of another size; 0: none.
    pure integer function called_here(word, words) result(found)
        character(len=*), intent(in) :: word
        character(len=*), intent(in) :: words(:)
        integer :: i

        found = 0
        do i = 1, size(words)
            if (lower_case(words(i)) == lower_case(word)) found = i
        end do
        if (found > 0 .or. len_trim(word) > len(called)) return
        i = findloc(called(1, :), lower_case(word), dim=1)
        if (i > 0) found = findloc(words, called(2, i), dim=1)
    end function called_here

    !> The only word that begins with another, of which there is enough to tell; 0: none.
    pure integer function beginning_with(start, words) result(found)
        character(len=*), intent(in) :: start
        character(len=*), intent(in) :: words(:)
        integer, parameter :: enough = 3
        logical :: begins(size(words))

        found = 0
        if (len_trim(start) < enough) return
        begins = index(words, trim(start)) == 1
        if (count(begins) == 1) found = findloc(begins, .true., dim=1)
    end function beginning_with

    !> Number of letters to insert, drop, replace or swap with a neighbour to come from one word to the other.
    pure integer function edit_distance(a, b)
        character(len=*), intent(in) :: a, b
        integer :: d(-1:len(a), -1:len(b))
        integer :: i, j, cost

        d = len(a) + len(b)
        d(0:, 0) = [(i, i=0, len(a))]
        d(0, 0:) = [(j, j=0, len(b))]
        do j = 1, len(b)
            do i = 1, len(a)
                cost = merge(0, 1, a(i:i) == b(j:j))
                d(i, j) = min(d(i - 1, j) + 1, d(i, j - 1) + 1, d(i - 1, j - 1) + cost)
                if (i > 1 .and. j > 1) then
                    if (a(i:i) == b(j - 1:j - 1) .and. a(i - 1:i - 1) == b(j:j)) &
                        d(i, j) = min(d(i, j), d(i - 2, j - 2) + 1)
                end if
            end do
        end do
        edit_distance = d(len(a), len(b))
    end function edit_distance
end module linkdyn_suggest
