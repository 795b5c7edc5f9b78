!> Do the stages of a step see what laws do within it?
!>
!> An error estimate knows of the places that a step has looked at. Of a pulse between two of them, a gas force over the crank's
!> angle or a push over time, it knows nothing, and the longer steps are the more they leap over. So the laws are looked at closely
!> along the way of a step: what they depend on is measured at some places of it, laws are evaluated at as many between these as
!> their arguments ask for, and no law may have a peak or a dip that is narrower than the widest gap between stages. Of a law's
!> values v over the step a peak that does not last so long is what v has over its *opening*, the largest function below it made
!> of pieces of that length; a dip, the same of -v. A jump or a kink, which stages on both of its sides see, is neither.
!>
!> **Source**: G. Matheron, Random Sets and Integral Geometry, Wiley 1975 (opening by a structuring element).
module linkdyn_narrow_laws
    use linkdyn_constants, only: two_pi
    use linkdyn_formula, only: node_symbol
    use linkdyn_kinds, only: wp
    use linkdyn_law_values, only: evaluate_laws, law_argument
    use linkdyn_laws, only: evaluate_law
    use linkdyn_scene, only: law_book, law_spec, state_law, law_table, measure_time, measure_joint, measure_attitude, &
        measure_tilt, measure_twist
    implicit none (type, external)
    private
    public :: law_sight, plan_law_sight, find_part_in_sight, find_part_of_splines, has_to_look, well_within
    public :: narrowest, unwrap, travel, refined, part_before_peak, fewest, most, noise

    !> Of a law's range over the step. What the cubic between its ends errs by is a hump over all of the step, 0.3 of it too narrow.
    real(wp), parameter :: much = 0.4_wp
    real(wp), parameter :: well_within = 0.9_wp        !! of what may be gone: a step of just that might be found too long again
    real(wp), parameter :: noise = 1.0e-9_wp           !! of the largest value that a law has had
    real(wp), parameter :: last_digits = 256*epsilon(1.0_wp)   !! of a measure's size, which are rounding
    integer, parameter :: fewest = 64, most = 1024     !! pieces of a step that laws are looked at between
    !> Laws over time are looked at so often in a run, those over angles so often in a turn.
    integer, parameter :: pieces_a_run = 4096, pieces_a_turn = 180

    !> What each law must be looked at by.
    type :: law_sight
        logical :: has_laws = .false.                  !! over the state
        logical :: sees_places = .false.               !! one of them depends on where the mechanism is
        real(wp), allocatable :: piece(:)              !! of a measure, that formulas take; huge: any (measure)
        logical, allocatable :: is_instant(:)          !! a measure is time, and formulas take it (measure)
        real(wp), allocatable :: rows(:)               !! half the width of the narrowest peak that a table can have (law)
        real(wp), allocatable :: largest(:)            !! size of a value so far (law)
        real(wp) :: size = 1                           !! of the mechanism, or how far off it is [m]
        type(law_spec), allocatable :: spline(:)       !! tables over time whose rows do not end steps
    end type law_sight

contains

    !> By what each law has to be looked at: pieces of what formulas take, the narrowest peaks of tables.
    subroutine plan_law_sight(book, over_time, size_of_all, sight)
        type(law_book), intent(in) :: book
        type(law_spec), intent(in) :: over_time(:)     !! laws of the scene
        real(wp), intent(in) :: size_of_all            !! of the mechanism, or how far off it is [m]
        type(law_sight), intent(out) :: sight
        integer :: k

        sight%size = size_of_all
        sight%spline = pack(over_time, is_spline(over_time))
        sight%has_laws = size(book%law) > 0
        allocate (sight%piece(size(book%measure)), sight%rows(size(book%law)), source=huge(1.0_wp))
        allocate (sight%is_instant(size(book%measure)), source=.false.)
        allocate (sight%largest(size(book%law)), source=0.0_wp)
        do k = 1, size(book%law)
            if (book%law(k)%over /= 0) then
                sight%rows(k) = narrowest(book%law(k)%table%time)
                if (book%law(k)%over > 0) call note(book%law(k)%over, .false.)
            else
                call note_symbols(book%law(k))
            end if
        end do

    contains

        subroutine note_symbols(law)
            type(state_law), intent(in) :: law
            integer :: i

            do i = 1, law%formula%n
                associate (node => law%formula%node(i))
                    if (node%op == node_symbol .and. node%a > 0) call note(node%a, .true.)
                end associate
            end do
        end subroutine note_symbols

        subroutine note(measure, by_formula)
            integer, intent(in) :: measure
            logical, intent(in) :: by_formula

            associate (spec => book%measure(measure))
                sight%sees_places = sight%sees_places .or. .not. (spec%kind == measure_time &
                                                                  .or. (spec%kind == measure_joint .and. spec%is_rate))
                if (.not. by_formula .or. spec%is_rate) return
                sight%is_instant(measure) = spec%kind == measure_time
                if (any(spec%kind == [measure_joint, measure_attitude, measure_tilt, measure_twist]) .and. spec%length_power == 0) &
                    sight%piece(measure) = two_pi/pieces_a_turn
            end associate
        end subroutine note
    end subroutine plan_law_sight

    !> Is there anything within steps to be looked at?
    pure logical function has_to_look(sight)
        type(law_sight), intent(in) :: sight

        has_to_look = sight%has_laws .or. size(sight%spline) > 0
    end function has_to_look

    pure elemental logical function is_spline(law)
        type(law_spec), intent(in) :: law

        is_spline = law%kind == law_table .and. allocated(law%curvature)
    end function is_spline

    !> A peak takes a row on either side of its own: half of that.
    pure real(wp) function narrowest(row)
        real(wp), intent(in) :: row(:)

        narrowest = huge(1.0_wp)
        if (size(row) > 2) narrowest = minval(row(3:) - row(:size(row) - 2))/2
    end function narrowest

    !> How much of a step may be gone at once; 1: all of it.
    pure subroutine find_part_in_sight(book, span, speed, measure, gap, sight, part)
        type(law_book), intent(in) :: book
        real(wp), intent(in) :: span                   !! of the run; 0: not known [s]
        real(wp), intent(in) :: speed                  !! of the mechanism, by its size [1/s]
        real(wp), intent(in) :: measure(:, :)          !! at equal distances from the step's beginning to its end (place, measure)
        real(wp), intent(in) :: gap                    !! the widest one between stages, part of the step
        type(law_sight), intent(inout) :: sight
        real(wp), intent(out) :: part
        real(wp) :: followed(size(measure, 1), size(measure, 2)), least(size(book%law)), asked
        real(wp), allocatable :: value(:, :), mode(:)
        integer :: n, k

        part = 1
        if (.not. all(abs(measure) <= huge(1.0_wp))) return    ! whoever needs what has no value there says so
        followed = measure
        do k = 1, size(measure, 2)
            if (book%measure(k)%wraps) call unwrap(followed(:, k))
        end do
        asked = pieces_asked(book, span, sight, followed)
        if (asked > most) then
            part = well_within*most/asked
            return
        end if
        n = max(fewest, ceiling(asked))
        allocate (value(n + 1, size(book%law)), mode(n + 1))
        call evaluate_laws(book, refined(followed, n), value, mode)
        do k = 1, size(book%law)
            call fill_gaps(value(:, k))
            sight%largest(k) = max(sight%largest(k), maxval(abs(value(:, k))))
        end do
        least = noise*sight%largest
        part = part_of_all()
        if (part >= 1) return                          ! as nearly always: how far rounding goes need not be asked
        least = least + rounding_of_laws(book, followed, sizes_of(book, sight%size, speed))
        part = part_of_all()

    contains

        !> Up to where the first peak or dip begins.
        pure real(wp) function part_of_all() result(first)
            integer :: k

            first = 1
            do k = 1, size(least)
                first = min(first, part_before_peak(value(:, k), gap, least(k)), part_before_peak(-value(:, k), gap, least(k)))
            end do
        end function part_of_all
    end subroutine find_part_in_sight

    !> What numbers that measures are found from are of the size of; the measures themselves may be differences of these.
    pure function sizes_of(book, length, speed) result(size_of)
        type(law_book), intent(in) :: book
        real(wp), intent(in) :: length                 !! [m]
        real(wp), intent(in) :: speed                  !! [1/s]
        real(wp) :: size_of(size(book%measure))

        size_of = merge(length, 1.0_wp, book%measure%length_power > 0)*merge(speed, 1.0_wp, book%measure%is_rate)
        where (book%measure%kind == measure_time) size_of = 0
    end function sizes_of

    !> How far rounding of what they take may move laws, each on its own: a law may be the difference of equal numbers, or take what
    !> is always zero. As at most of three places within the step: beside a jump it says nothing.
    pure function rounding_of_laws(book, measure, size_of) result(rounding)
        type(law_book), intent(in) :: book
        real(wp), intent(in) :: measure(:, :)          !! (place, measure)
        real(wp), intent(in) :: size_of(:)             !! (measure)
        real(wp) :: rounding(size(book%law))
        real(wp), dimension(3, size(book%law)) :: value, moved, change
        real(wp) :: at(3, size(measure, 2)), number(3), mode(3)
        integer :: k, m

        at = measure(1 + [1, 2, 3]*(size(measure, 1) - 1)/4, :)
        call evaluate_laws(book, at, value, mode)
        change = 0
        do m = 1, size(measure, 2)
            number = at(:, m)
            at(:, m) = number + last_digits*(abs(number) + size_of(m))
            call evaluate_laws(book, at, moved, mode)
            at(:, m) = number
            change = change + abs(moved - value)
        end do
        do k = 1, size(book%law)
            rounding(k) = 0
            if (all(change(:, k) <= huge(1.0_wp))) &
                rounding(k) = max(min(change(1, k), change(2, k)), min(max(change(1, k), change(2, k)), change(3, k)))
        end do
    end function rounding_of_laws

    !> The same for splines over time.
    pure subroutine find_part_of_splines(t, length, gap, sight, part)
        real(wp), intent(in) :: t, length              !! of the step [s]
        real(wp), intent(in) :: gap                    !! as above
        type(law_sight), intent(in) :: sight
        real(wp), intent(out) :: part
        real(wp), allocatable :: value(:)
        real(wp) :: asked, rate, rate2
        integer :: i, k, n

        part = 1
        do k = 1, size(sight%spline)
            associate (spline => sight%spline(k))
                asked = length/narrowest(spline%time)
                if (asked > most) then
                    part = min(part, well_within*most/asked)
                    cycle
                end if
                n = max(fewest, ceiling(asked))
                allocate (value(n + 1))
                do i = 0, n
                    call evaluate_law(spline, t + (length*i)/n, value(i + 1), rate, rate2)
                end do
                call fill_gaps(value)
                part = min(part, part_before_peak(value, gap, noise*maxval(abs(spline%knot))), &
                           part_before_peak(-value, gap, noise*maxval(abs(spline%knot))))
                deallocate (value)
            end associate
        end do
    end subroutine find_part_of_splines

    !> An angle from place to place, without jumps by a turn.
    pure subroutine unwrap(angle)
        real(wp), intent(inout) :: angle(:)
        integer :: i

        do i = 2, size(angle)
            angle(i) = angle(i) - two_pi*anint((angle(i) - angle(i - 1))/two_pi)
        end do
    end subroutine unwrap

    !> So many that no law changes unseen between two.
    pure real(wp) function pieces_asked(book, span, sight, measure) result(asked)
        type(law_book), intent(in) :: book
        real(wp), intent(in) :: span                   !! of the run; 0: not known [s]
        type(law_sight), intent(in) :: sight
        real(wp), intent(in) :: measure(:, :)          !! (place, measure)
        real(wp) :: value(size(measure, 1), size(book%law)), mode(size(measure, 1))
        integer :: k

        call evaluate_laws(book, measure, value, mode)
        asked = 0
        do k = 1, size(measure, 2)
            asked = max(asked, travel(measure(:, k))/sight%piece(k))
            if (sight%is_instant(k) .and. span > 0) asked = max(asked, travel(measure(:, k))*pieces_a_run/span)
        end do
        do k = 1, size(book%law)
            if (book%law(k)%over /= 0) asked = max(asked, travel(law_argument(book%law(k), measure, value))/sight%rows(k))
        end do
        if (.not. asked <= huge(asked)) asked = 0
    end function pieces_asked

    pure real(wp) function travel(number)
        real(wp), intent(in) :: number(:)

        travel = sum(abs(number(2:) - number(:size(number) - 1)))
    end function travel

    !> The same at the ends of n pieces.
    pure function refined(number, n) result(fine)
        real(wp), intent(in) :: number(:, :)           !! (place, k)
        integer, intent(in) :: n
        real(wp) :: fine(n + 1, size(number, 2)), place
        integer :: i, before

        do i = 0, n
            place = real(i, wp)/n*(size(number, 1) - 1)
            before = min(int(place), size(number, 1) - 2)
            fine(i + 1, :) = number(before + 1, :) + (place - before)*(number(before + 2, :) - number(before + 1, :))
        end do
    end function refined

    !> Where a law has no value it keeps the last one.
    pure subroutine fill_gaps(value)
        real(wp), intent(inout) :: value(:)
        real(wp) :: last
        integer :: i

        i = findloc(abs(value) <= huge(1.0_wp), .true., dim=1)
        last = 0
        if (i > 0) last = value(i)
        do i = 1, size(value)
            if (abs(value(i)) <= huge(1.0_wp)) last = value(i)
            value(i) = last
        end do
    end subroutine fill_gaps

    !> Up to where a peak begins that is too narrow; 1: there is none.
    pure real(wp) function part_before_peak(value, gap, least) result(part)
        real(wp), intent(in) :: value(:)               !! from the step's beginning to its end
        real(wp), intent(in) :: gap                    !! as above
        real(wp), intent(in) :: least                  !! range that says something
        real(wp), parameter :: shortest = 0.05_wp      !! where it begins at once
        real(wp) :: range
        integer :: i

        part = 1
        range = maxval(value) - minval(value)
        if (.not. range > least) return
        i = findloc(value - opened(value, ceiling(gap*(size(value) - 1)) + 1) > much*range, .true., dim=1)
        if (i > 0) part = max(shortest, real(i - 2, wp)/(size(value) - 1))
    end function part_before_peak

    !> The largest function below the values that is made of pieces of so many of them. Beyond its ends the step goes on as it is
    !> there.
    pure function opened(value, width) result(low)
        real(wp), intent(in) :: value(:)
        integer, intent(in) :: width
        real(wp) :: low(size(value)), eroded(size(value) + width - 1)

        eroded = least_of([spread(value(1), 1, width - 1), value, spread(value(size(value)), 1, width - 1)], width)
        low = -least_of(-eroded, width)
    end function opened

    !> The least of each value and the next ones, `width` in all. Blocks of as many are gone through from both of their ends (van
    !> Herk).
    pure function least_of(value, width) result(least)
        real(wp), intent(in) :: value(:)
        integer, intent(in) :: width
        real(wp) :: least(size(value) - width + 1), up_to(size(value)), from(size(value))
        integer :: i, n

        n = size(value)
        do i = 1, n
            up_to(i) = value(i)
            if (modulo(i - 1, width) > 0) up_to(i) = min(value(i), up_to(i - 1))
        end do
        do i = n, 1, -1
            from(i) = value(i)
            if (modulo(i, width) > 0 .and. i < n) from(i) = min(value(i), from(i + 1))
        end do
        least = min(from(:size(least)), up_to(width:))
    end function least_of
end module linkdyn_narrow_laws
