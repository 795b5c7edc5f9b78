!> The table at the end of a sweep: peaks of every actuator with where they are, the largest joint forces, feasibility.
module linkdyn_sweep_summary
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_columns, only: significant, left, right
    use linkdyn_code, only: code_in_use
    use linkdyn_kinds, only: wp
    use linkdyn_sweep, only: sweep_run
    use linkdyn_sweep_plan, only: axis_values
    use linkdyn_sweep_quantities, only: quantity_type
    use linkdyn_sweep_results, only: code_names
    use linkdyn_sweep_spec, only: quantity_driving_force, quantity_driving_position, quantity_driving_speed, &
        quantity_driving_power, quantity_reaction_force, quantity_reaction_moment, quantity_force_amplification, &
        quantity_moment_amplification, quantity_condition, quantity_determinant, quantity_swing, quantity_clearance
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: print_sweep, sample_text

    integer, parameter :: number_width = 13, sample_width = 14
    integer, parameter :: shown(10) = [quantity_driving_force, quantity_driving_position, quantity_driving_speed, &
        quantity_driving_power, quantity_force_amplification, quantity_moment_amplification, quantity_condition, &
        quantity_determinant, quantity_swing, quantity_clearance]
    character(len=22), parameter :: title(10) = [character(len=22) :: "driving force", "driven variable", "driving speed", &
        "driving power", "force amplification", "moment amplification", "condition", "determinant", "swing", "clearance"]

contains

    subroutine print_sweep(run, solver, threads, processes, seconds, output, unit)
        type(sweep_run), intent(in) :: run
        character(len=*), intent(in) :: solver, output
        integer, intent(in) :: threads, processes, unit
        real(wp), intent(in) :: seconds               !! of this run
        character(len=:), allocatable :: text
        integer :: i

        if (len_trim(run%scene%title) > 0) write (unit, "(a)") trim(run%scene%title)
        text = "  "//sample_text(run%plan%n_sample)//" samples"
        if (run%plan%n_design > 1) text = text//" of "//sample_text(run%plan%n_design)//" designs"
        text = text//", solver "//solver//", "//to_text(threads)//trim(merge(" thread ", " threads", threads == 1))
        if (processes > 1) text = text//" in each of "//to_text(processes)//" processes"
        write (unit, "(a)") text
        do i = 1, size(shown)
            if (run%row%place(shown(i)) > 0) call print_peaks(run, run%row%quantity(run%row%place(shown(i))), title(i), unit)
        end do
        write (unit, "(a)") ""
        if (run%row%place(quantity_reaction_force) > 0) &
            call print_largest(run, run%row%quantity(run%row%place(quantity_reaction_force)), "largest joint force ", unit)
        if (run%row%place(quantity_reaction_moment) > 0) &
            call print_largest(run, run%row%quantity(run%row%place(quantity_reaction_moment)), "largest joint moment", unit)
        call print_outcomes(run, unit)
        if (index(code_in_use(), " ") > 0) write (unit, "(a)") "  machine code     "//code_in_use()
        write (unit, "(a)") "  computing time   "//significant(seconds)//" s"
        write (unit, "(a)") "  results          "//output
    end subroutine print_sweep

    !> Lowest and highest of every entry, over all designs, with the samples where they are.
    subroutine print_peaks(run, quantity, what, unit)
        type(sweep_run), intent(in) :: run
        type(quantity_type), intent(in) :: quantity
        character(len=*), intent(in) :: what
        integer, intent(in) :: unit
        character(len=len(quantity%label) + 16), allocatable :: name(:)
        integer(int64) :: low_at, high_at, worst_at
        real(wp) :: low, high, worst
        integer :: i, width

        allocate (name(quantity%n))
        do i = 1, quantity%n
            name(i) = trim(quantity%label(i))//" ["//trim(quantity%unit(i))//"]"
        end do
        width = max(len_trim(what), maxval(len_trim(name)))
        write (unit, "(a)") ""
        write (unit, "(a)") "  "//left(what, width)//right("lowest", number_width)//right("at sample", sample_width)// &
            right("highest", number_width)//right("at sample", sample_width)
        worst_at = -1
        worst = 0
        do i = 1, quantity%n
            call peaks_of(run, quantity%first + i, low, low_at, high, high_at)
            if (low_at < 0) then
                write (unit, "(a)") "  "//left(name(i), width)//right("none", number_width)
                cycle
            end if
            write (unit, "(a)") "  "//left(name(i), width)//right(significant(low), number_width)// &
                right(sample_text(low_at), sample_width)//right(significant(high), number_width)// &
                right(sample_text(high_at), sample_width)
            if (quantity%id == quantity_clearance) high = 0            ! the narrowest place is the worst
            if (worst_at < 0 .or. abs(low) > worst) worst_at = low_at
            worst = max(worst, abs(low))
            if (abs(high) > worst) worst_at = high_at
            worst = max(worst, abs(high))
        end do
        if (worst_at >= 0 .and. quantity%id /= quantity_driving_position) &
            write (unit, "(a)") trim(merge("  smallest at", "  largest at ", quantity%id == quantity_clearance))// &
            " "//place_text(run, worst_at)
    end subroutine print_peaks

    !> Extremes over all designs.
    subroutine peaks_of(run, k, low, low_at, high, high_at)
        type(sweep_run), intent(in) :: run
        integer, intent(in) :: k
        real(wp), intent(out) :: low, high
        integer(int64), intent(out) :: low_at, high_at
        integer :: d

        low = huge(1.0_wp)
        high = -huge(1.0_wp)
        low_at = -1
        high_at = -1
        do d = 1, size(run%total)
            associate (totals => run%total(d))
                if (totals%low_at(k) >= 0 .and. totals%low(k) < low) low_at = totals%low_at(k)
                if (totals%low_at(k) >= 0) low = min(low, totals%low(k))
                if (totals%high_at(k) >= 0 .and. totals%high(k) > high) high_at = totals%high_at(k)
                if (totals%high_at(k) >= 0) high = max(high, totals%high(k))
            end associate
        end do
    end subroutine peaks_of

    subroutine print_largest(run, quantity, what, unit)
        type(sweep_run), intent(in) :: run
        type(quantity_type), intent(in) :: quantity
        character(len=*), intent(in) :: what
        integer, intent(in) :: unit
        real(wp) :: low, high, largest
        integer(int64) :: low_at, high_at, at
        integer :: i, best

        largest = -1
        best = 0
        do i = 1, quantity%n
            call peaks_of(run, quantity%first + i, low, low_at, high, high_at)
            if (high_at < 0 .or. .not. high > largest) cycle
            largest = high
            best = i
            at = high_at
        end do
        if (best == 0) return
        write (unit, "(a)") "  "//what//right(significant(largest), number_width)//" "//trim(quantity%unit(best))//"  in "// &
            trim(quantity%label(best))//", sample "//sample_text(at)
    end subroutine print_largest

    !> "platform.x = 0.3 m, Fz on platform.tool = -4000 N"
    function place_text(run, sample) result(text)
        type(sweep_run), intent(in) :: run
        integer(int64), intent(in) :: sample
        character(len=:), allocatable :: text
        real(wp) :: value(size(run%plan%axis))
        integer :: i

        value = axis_values(run%plan, sample)
        text = ""
        do i = 1, size(value)
            if (i > 1) text = text//", "
            text = text//trim(run%plan%axis(i)%spec%name)//" = "//significant(value(i))
            if (all(run%plan%axis(i)%spec%unit /= ["1 ", "SI"])) text = text//" "//trim(run%plan%axis(i)%spec%unit)
        end do
    end function place_text

    !> How many samples had which outcome.
    subroutine print_outcomes(run, unit)
        type(sweep_run), intent(in) :: run
        integer, intent(in) :: unit
        integer(int64) :: n(0:run%shape%n_code - 1)
        character(len=128), allocatable :: name(:)
        integer :: d, i

        n = 0
        do d = 1, size(run%total)
            n = n + run%total(d)%n_code
        end do
        allocate (name(0:run%shape%n_code - 1))
        name = code_names(run)
        write (unit, "(a)") "  feasible         "//sample_text(n(0))//" of "//sample_text(run%plan%n_sample)//" samples ("// &
            significant(100*real(n(0), wp)/real(run%plan%n_sample, wp))//" %)"
        do i = 1, size(n) - 1
            if (n(i) > 0) write (unit, "(a)") "    "//left(name(i), max(15, len_trim(name(i)) + 2))//sample_text(n(i))
        end do
        if (run%row%place(quantity_determinant) > 0 .and. run%plan%n_line > 0) then
            if (sum(run%total%n_crossing) > 0) then
                d = findloc(run%total%n_crossing > 0, .true., dim=1)
                write (unit, "(a)") "  singularities    crossed "//sample_text(sum(run%total%n_crossing))// &
                    " times between neighbours, first before sample "//sample_text(run%total(d)%first_crossing)
            else
                write (unit, "(a)") "  singularities    none crossed between neighbours"
            end if
        end if
        if (run%first_bad >= 0) write (unit, "(a)") "  first bad design "//sample_text(run%first_bad)//": "// &
            trim(run%bad_design%message)
    end subroutine print_outcomes

    !> A count as text.
    pure function sample_text(n) result(text)
        integer(int64), intent(in) :: n
        character(len=:), allocatable :: text
        character(len=20) :: buffer

        write (buffer, "(i0)") n
        text = trim(buffer)
    end function sample_text
end module linkdyn_sweep_summary
