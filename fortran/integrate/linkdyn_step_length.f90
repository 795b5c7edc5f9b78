!> Are equal steps short enough for what goes on in them? A watch on the steps of a method that is told how long they are.
!>
!> The last stage of the classical method has rates k4 at a state beside the end of the step, where the next one begins with
!> the rates k5: with k5 in place of k4 the step is one of order 3. This embedded pair costs nothing, since k5 is needed anyway.
!> k5 - k4 is how the rates change with the state alone, not with the time. Of a motion exp(z t/h) it is z^3/12 of the rates, and
!> h/6 times that z^4/72 of the solution: of a vibration in ten steps 2 % and 0.2 %, in six 10 % and 1.7 %.
!>
!> A motor's current, oil, or friction that holds has a rate beyond what the method is stable for (2.8/h): it never settles
!> then, and its error is as large as it is itself, step after step. A transient that is over in a few steps is wrong as long as
!> it lasts, but leads where it has to, and so does a kink within a step: neither says anything against the step.
module linkdyn_step_length
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_way_gone, only: family_alone, family_rate, beside_others
    implicit none (type, external)
    private
    public :: length_watch

    type :: length_watch
        logical :: is_too_long(lanes) = .false.          !! for good
        integer :: component(lanes) = 0                  !! of y that has said so
        real(wp), allocatable, private :: origin(:, :)   !! where the solution began, without the turns left out (lane, n)
        real(wp), allocatable, private :: gone(:, :)     !! how far it has come from there (lane, n)
        real(wp), allocatable, private :: fastest(:, :)  !! largest rates of late (lane, n)
        real(wp), allocatable, private :: last(:, :)     !! at the last stage of the step that led here (lane, n)
        real(wp), private :: length(lanes) = 0           !! of this step; 0: none is known
        integer, private :: n_wild(lanes) = 0            !! steps whose errors were gross, weighed against those whose were not
        integer, allocatable, private :: family(:)       !! of each component, one of `family_*` (n)
        logical, allocatable, private :: is_result(:)    !! components that no rate depends on: they follow the others (n)
    contains
        procedure :: start, keep, judge, forget, take_turns_off
    end type length_watch

contains

    subroutine start(self, y, family, is_result)
        class(length_watch), intent(inout) :: self
        real(wp), intent(in) :: y(:, :)                  !! (lane, n)
        integer, intent(in), optional :: family(:)       !! absent: all alone (n)
        logical, intent(in), optional :: is_result(:)    !! absent: none (n)
        integer :: k

        self%origin = y
        self%gone = 0*y
        self%fastest = self%gone
        self%last = self%gone
        self%family = [(family_alone, k=1, size(y, 2))]
        if (present(family)) self%family = family
        self%is_result = [(.false., k=1, size(y, 2))]
        if (present(is_result)) self%is_result = is_result
        self%length = 0
        self%n_wild = 0
        self%is_too_long = .false.
        self%component = 0
    end subroutine start

    !> A step has been taken; these are the rates at its last stage.
    pure subroutine keep(self, length, last)
        class(length_watch), intent(inout) :: self
        real(wp), intent(in) :: length(lanes)            !! of the step; 0 of lanes that have taken none
        real(wp), intent(in), contiguous :: last(:, :)   !! (lane, n)
        integer :: k

        if (.not. allocated(self%last)) return
        self%length = length
        do k = 1, size(self%last, 2)
            self%last(:, k) = last(:, k)
        end do
    end subroutine keep

    !> The rates where that step has led, from which the next one sets out: the step is judged, once. Lanes that do not go on
    !> have no part in it.
    pure subroutine judge(self, goes, y, rate)
        class(length_watch), intent(inout) :: self
        logical, intent(in) :: goes(lanes)
        real(wp), intent(in), contiguous :: y(:, :), rate(:, :)    !! there (lane, n)
        real(wp), parameter :: memory = 0.99_wp          !! of the rates from step to step
        real(wp), dimension(lanes, family_alone:family_rate) :: way, pace
        real(wp) :: worst(lanes)
        integer :: k

        if (.not. allocated(self%last)) return
        way = 0
        pace = 0
        do k = 1, size(self%last, 2)
            if (self%is_result(k)) cycle
            associate (gone => self%gone(:, k), fastest => self%fastest(:, k), f => self%family(k))
                gone = max(gone, abs(y(:, k) - self%origin(:, k)))
                fastest = max(memory*fastest, abs(rate(:, k)))
                if (f == family_alone) cycle
                way(:, f) = max(way(:, f), beside_others*gone)
                pace(:, f) = max(pace(:, f), beside_others*fastest)
            end associate
        end do
        worst = 0
        do k = 1, size(self%last, 2)
            if (.not. self%is_result(k)) worst = max(worst, excess(self, k, y(:, k), rate(:, k), way, pace))
        end do
        ! most steps are good ones after good ones
        if (any(worst > 0) .or. any(self%n_wild > 0)) call count_wild(self, goes, y, rate, way, pace)
        self%length = 0
    end subroutine judge

    !> By how much a component's error of the step is more than gross; 0 or less: it is not.
    pure function excess(self, k, y, rate, way, pace)
        type(length_watch), intent(in) :: self
        integer, intent(in) :: k
        real(wp), intent(in) :: y(lanes), rate(lanes)
        real(wp), intent(in), dimension(lanes, family_alone:family_rate) :: way, pace    !! of each family's fastest
        real(wp) :: excess(lanes), change(lanes), error(lanes)
        real(wp), parameter :: gross = 2.0e-3_wp         !! error of a step, part of the way gone: of a vibration in ten steps
        real(wp), parameter :: wild = 0.1_wp             !! likewise of the rates: a vibration in six steps
        real(wp), parameter :: least = 1.0e-6_wp         !! an error that nobody heeds

        associate (f => self%family(k))
            change = abs(rate - self%last(:, k))
            error = self%length/6*change
            excess = max(change - wild*max(self%fastest(:, k), pace(:, f)), error - gross*max(self%gone(:, k), way(:, f)))
            excess = min(excess, error - least*max(1.0_wp, abs(y)))
        end associate
    end function excess

    !> The step's errors were gross, or those of one not long before.
    pure subroutine count_wild(self, goes, y, rate, way, pace)
        class(length_watch), intent(inout) :: self
        logical, intent(in) :: goes(lanes)
        real(wp), intent(in), contiguous :: y(:, :), rate(:, :)    !! (lane, n)
        real(wp), intent(in), dimension(lanes, family_alone:family_rate) :: way, pace
        integer, parameter :: many = 5                   !! such steps: a rate of 2.3/h has so many before it has settled
        integer, parameter :: rarely = 8                 !! one of so many is none; what a limit sends back comes oftener
        logical :: is_wild(lanes), is_gross(lanes)
        integer :: k

        is_wild = .false.
        do k = 1, size(self%last, 2)
            if (self%is_result(k)) cycle
            is_gross = excess(self, k, y(:, k), rate(:, k), way, pace) > 0
            is_wild = is_wild .or. is_gross
            where (is_gross .and. .not. self%is_too_long) self%component = k
        end do
        self%n_wild = max(0, self%n_wild + merge(merge(rarely - 1, -1, is_wild), 0, self%length > 0 .and. goes))
        self%is_too_long = self%is_too_long .or. self%n_wild > (many - 1)*(rarely - 1)
    end subroutine count_wild

    !> The rates jump where that step has led, or y does.
    pure subroutine forget(self, where_so)
        class(length_watch), intent(inout) :: self
        logical, intent(in) :: where_so(lanes)

        where (where_so) self%length = 0
    end subroutine forget

    !> Angles have lost whole turns.
    pure subroutine take_turns_off(self, turns)
        class(length_watch), intent(inout) :: self
        real(wp), intent(in) :: turns(:, :)              !! (lane, n)

        if (allocated(self%origin)) self%origin = self%origin - turns
    end subroutine take_turns_off
end module linkdyn_step_length
