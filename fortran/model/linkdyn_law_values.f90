!> Values of laws over the state, given what they depend on.
module linkdyn_law_values
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_formula, only: evaluate_formula, differentiate_formula
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: law_book, state_law, measure_time
    use linkdyn_table, only: table_place, find_places, evaluate_table, lies_within
    implicit none (type, external)
    private
    public :: evaluate_laws, differentiate_laws, law_argument, is_outside, rows_over_time

contains

    !> All laws at all samples. One that has no value there is not a number: a table beyond its rows, a division by zero.
    pure subroutine evaluate_laws(book, measure, value, mode)
        type(law_book), intent(in) :: book
        real(wp), intent(in) :: measure(:, :)      !! (n, measure)
        real(wp), intent(out) :: value(:, :)       !! (n, law)
        real(wp), intent(out) :: mode(:)           !! (n) on one side of all jumps it stays the same
        real(wp) :: argument(size(value, 1)), found(size(value, 1))
        integer :: k

        mode = 0
        do k = 1, size(book%law)
            if (book%law(k)%over /= 0) then
                argument = law_argument(book%law(k), measure, value)
                call look_up(book%law(k), argument, found)
            else
                call evaluate_formula(book%law(k)%formula, measure, value, found, mode)
            end if
            value(:, k) = found
        end do
    end subroutine evaluate_laws

    !> How all laws change at one sample, on several ways on which their measures change.
    pure subroutine differentiate_laws(book, measure, value, measure_rate, rate)
        type(law_book), intent(in) :: book
        real(wp), intent(in) :: measure(:)         !! (measure)
        real(wp), intent(in) :: value(:)           !! (law), as evaluated there
        real(wp), intent(in) :: measure_rate(:, :) !! (way, measure)
        real(wp), intent(out) :: rate(:, :)        !! (way, law)
        real(wp) :: of_formula(size(rate, 1))
        real(wp), dimension(1) :: at, found, slope
        integer :: k

        rate = 0
        do k = 1, size(book%law)
            associate (law => book%law(k), over => book%law(k)%over)
                if (over == 0) then
                    call differentiate_formula(law%formula, measure, value, measure_rate, rate, of_formula)
                    rate(:, k) = of_formula
                    cycle
                end if
                at = law_argument(law, reshape(measure, [1, size(measure)]), reshape(value, [1, size(value)]))
                call look_up(law, at, found, slope)
                if (over > 0) rate(:, k) = slope(1)*measure_rate(:, over)
                if (over < 0) rate(:, k) = slope(1)*rate(:, -over)
            end associate
        end do
    end subroutine differentiate_laws

    !> What the table of a law is read at.
    pure function law_argument(law, measure, value) result(argument)
        type(state_law), intent(in) :: law         !! one with a table
        real(wp), intent(in) :: measure(:, :)      !! (n, measure)
        real(wp), intent(in) :: value(:, :)        !! (n, law): laws before this one
        real(wp) :: argument(size(value, 1))

        if (law%over > 0) then
            argument = measure(:, law%over)
        else
            argument = value(:, -law%over)
        end if
    end function law_argument

    !> Has a table no row for an argument?
    pure elemental logical function is_outside(law, argument)
        type(state_law), intent(in) :: law
        real(wp), intent(in) :: argument

        associate (knot => law%table%time)
            is_outside = .not. (law%period > 0 .or. lies_within(knot(1), knot(size(knot)), argument))
        end associate
    end function is_outside

    !> Instants in between two at which tables over time have rows: kinks of theirs, but for splines. Of those that begin anew the
    !> rows of all their periods, if these can be counted.
    pure function rows_over_time(book, first, last) result(row)
        type(law_book), intent(in) :: book
        real(wp), intent(in) :: first, last        !! [s]
        real(wp), allocatable :: row(:)
        real(wp), parameter :: most_periods = 1.0e4_wp
        real(wp) :: begin
        integer :: k, i

        allocate (row(0))
        do k = 1, size(book%law)
            associate (law => book%law(k))
                if (law%over <= 0) cycle
                if (book%measure(law%over)%kind /= measure_time .or. allocated(law%table%curvature)) cycle
                if (.not. law%period > 0) then
                    row = [row, law%table%time]
                else if (last - first <= most_periods*law%period) then
                    begin = law%period*floor((first - law%table%time(1))/law%period)
                    row = [row, (begin + i*law%period + law%table%time, i=0, ceiling((last - first)/law%period))]
                end if
            end associate
        end do
        row = pack(row, row > first .and. row < last)
    end function rows_over_time

    pure subroutine look_up(law, argument, value, slope)
        type(state_law), intent(in) :: law
        real(wp), intent(in) :: argument(:)        !! (n)
        real(wp), intent(out) :: value(:)          !! (n)
        real(wp), intent(out), optional :: slope(:)    !! (n)
        type(table_place) :: place(size(argument))
        real(wp) :: at(size(argument)), bend(size(argument))
        logical :: is_lost(size(argument))
        integer :: near

        at = argument
        if (law%period > 0) at = law%table%time(1) + modulo(argument - law%table%time(1), law%period)
        is_lost = is_outside(law, argument) .or. .not. abs(argument) <= huge(1.0_wp)
        where (is_lost) at = law%table%time(1)
        near = 1
        call find_places(law%table%time, at, near, place)
        if (present(slope)) then
            call evaluate_table(law%table, place, value, slope, bend)
        else
            call evaluate_table(law%table, place, value)
        end if
        where (is_lost) value = ieee_value(1.0_wp, ieee_quiet_nan)
    end subroutine look_up
end module linkdyn_law_values
