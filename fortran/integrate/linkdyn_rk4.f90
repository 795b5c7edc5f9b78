!> The classical Runge-Kutta method of order 4 at a fixed step, on lanes: the lecture's integrator.
!>
!> What rounding takes from y at a step is added at the next: a million steps round like one.
module linkdyn_rk4
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_crossings, only: step_taken
    use linkdyn_exact_sum, only: add_all_exactly
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_sizes, only: find_sizes
    use linkdyn_lane_system, only: lane_system, whole_steps
    use linkdyn_whole_turns, only: whole_turns, take_off, may_have_turns
    implicit none (type, external)
    private
    public :: rk4_workspace, rk4_step, rk4_steps, rk4_taken, note_rk4_start, watch_step

    !> Scratch of a step, and what goes from one to the next.
    type :: rk4_workspace
        real(wp), allocatable :: stage(:, :), rate(:, :), total(:, :)    !! (lane, n)
        real(wp), allocatable :: begin(:, :)     !! where the step begins (lane, n)
        real(wp), allocatable :: first(:, :)     !! rates there (lane, n)
        real(wp), allocatable :: rest(:, :)      !! to be added to y, less than its last place (lane, n)
        type(whole_steps) :: steps               !! that the system has taken by itself
    contains
        procedure :: prepare, watch_length, take_turns_off
    end type rk4_workspace

    !> A step that was taken: each lane its own.
    type, extends(step_taken) :: rk4_taken
        type(rk4_workspace), private :: work
        real(wp), allocatable, private :: rest(:, :)      !! of y where it begins (lane, n)
    contains
        procedure :: retake => retake_rk4
    end type rk4_taken

contains

    !> Note where a step begins. The step tells the rates there.
    subroutine note_rk4_start(system, t, h, y, work, taken)
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t(lanes), h(lanes)
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        type(rk4_workspace), intent(in) :: work
        type(rk4_taken), intent(inout) :: taken

        taken%t = t
        taken%length = h
        taken%y = y
        taken%rest = work%rest
        if (.not. allocated(taken%rate)) allocate (taken%rate(lanes, system%n), taken%rate_end(lanes, system%n))
        call taken%work%prepare(system%n)
    end subroutine note_rk4_start

    subroutine retake_rk4(self, system, share, y)
        class(rk4_taken), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: share(lanes)
        real(wp), intent(out) :: y(:, :)
        logical :: failed(lanes)
        integer :: k

        if (all(share >= 1)) then
            y = self%y_end
            return
        end if
        y = self%y
        self%work%rest = self%rest
        call rk4_step(system, self%t, share*self%length, y, self%work, failed)
        do k = 1, size(y, 2)
            where (share >= 1)
                y(:, k) = self%y_end(:, k)
            elsewhere (failed)
                y(:, k) = ieee_value(1.0_wp, ieee_quiet_nan)
            end where
        end do
    end subroutine retake_rk4

    subroutine prepare(self, n)
        class(rk4_workspace), intent(inout) :: self
        integer, intent(in) :: n

        if (allocated(self%stage)) deallocate (self%stage, self%rate, self%total, self%begin, self%first, self%rest)
        allocate (self%stage(lanes, n), self%rate(lanes, n), self%total(lanes, n), self%begin(lanes, n), self%first(lanes, n), &
                  self%rest(lanes, n))
        self%rest = 0
    end subroutine prepare

    !> Whether steps are short enough is asked from a solution on.
    subroutine watch_length(self, system, y)
        class(rk4_workspace), intent(inout) :: self
        class(lane_system), intent(in) :: system
        real(wp), intent(in) :: y(:, :)                !! (lane, n)

        call self%steps%watch%start(y, system%family, system%is_result)
    end subroutine watch_length

    !> Angles go on without the whole turns that they have made.
    subroutine take_turns_off(self, system, y)
        class(rk4_workspace), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(inout) :: y(:, :)             !! (lane, n)
        real(wp), allocatable :: turns(:, :)
        integer :: k, n_turned

        if (.not. allocated(system%is_angle)) return
        n_turned = 0
        do k = 1, size(y, 2)
            if (system%is_angle(k)) n_turned = n_turned + count(may_have_turns(y(:, k)))
        end do
        if (n_turned == 0) return
        turns = merge(whole_turns(y), 0.0_wp, spread(system%is_angle, 1, lanes))
        if (all(turns == 0)) return
        call take_off(turns, y, self%rest)
        call self%steps%watch%take_turns_off(turns)
        call system%note_turns(turns)
    end subroutine take_turns_off

    !> Equal steps: as many at once as the system can take by itself, or one, stage by stage on the lanes where it cannot. All but
    !> the last have been accepted, and none has failed. `work%steps` tells how many, and whether the last has been accepted, too,
    !> and which lanes go no further since the steps that led there were too long.
    subroutine rk4_steps(system, t, h, n_most, y, work, failed)
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, h
        integer, intent(in) :: n_most
        real(wp), intent(inout), contiguous :: y(:, :) !! (lane, n)
        type(rk4_workspace), intent(inout) :: work     !! `begin` is where the last of them began
        logical, intent(out) :: failed(lanes)          !! at the last one: there y is where it began
        real(wp) :: instant(lanes), length(lanes)
        integer :: k

        work%steps%is_accepted = .false.
        call system%take_whole_steps(t, h, n_most, y, work%begin, work%rest, work%steps)
        failed = .false.
        if (work%steps%n > 0) return
        instant = t
        length = h
        call rk4_step(system, instant, length, y, work, failed)
        work%steps%n = 1
        call watch_step(work, .not. system%is_idle, length, y, failed)
        associate (is_sure => work%steps%is_sure)
            if (.not. any(is_sure)) return
            is_sure = is_sure .and. .not. work%steps%watch%is_too_long
            failed = failed .and. .not. is_sure
            do k = 1, system%n
                y(:, k) = merge(work%steps%y(:, k), y(:, k), is_sure)
                work%rest(:, k) = merge(work%steps%rest(:, k), work%rest(:, k), is_sure)
            end do
        end associate
    end subroutine rk4_steps

    !> A step has been taken from stage to stage. Where those before it are seen to have been too long y stays where it began.
    subroutine watch_step(work, goes, length, y, failed)
        type(rk4_workspace), intent(inout) :: work
        logical, intent(in) :: goes(lanes)             !! others do not count
        real(wp), intent(in) :: length(lanes)
        real(wp), intent(inout) :: y(:, :)             !! where it has led (lane, n)
        logical, intent(inout) :: failed(lanes)
        logical :: is_known(lanes)
        integer :: k

        is_known = goes .and. .not. failed
        associate (watch => work%steps%watch)
            call watch%judge(is_known, work%begin, work%first)
            call watch%keep(merge(length, 0.0_wp, is_known), work%rate)
            if (.not. any(watch%is_too_long .and. goes)) return
            do k = 1, size(y, 2)
                y(:, k) = merge(work%begin(:, k), y(:, k), watch%is_too_long)
            end do
            failed = failed .or. watch%is_too_long
        end associate
    end subroutine watch_step

    !> One step. A lane whose right-hand side fails at a stage, or whose result is not finite, keeps its y.
    subroutine rk4_step(system, t, h, y, work, failed)
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: h(lanes)               !! step
        real(wp), intent(inout), contiguous :: y(:, :) !! (lane, n)
        type(rk4_workspace), intent(inout) :: work     !! `begin` is where y was
        logical, intent(out) :: failed(lanes)
        real(wp), parameter :: weight(4) = [1.0_wp, 2.0_wp, 2.0_wp, 1.0_wp]
        real(wp), parameter :: part(4) = [0.0_wp, 0.5_wp, 0.5_wp, 1.0_wp]
        real(wp), parameter :: rounding = 4*epsilon(1.0_wp)    !! of instants, part of them
        real(wp) :: instant(lanes)
        logical :: stage_failed(lanes)
        integer :: i

        work%begin = y
        call system%evaluate(t, y, work%first, failed)
        if (all(failed)) return                        ! which is what has been evaluated last: it tells why
        do i = 2, 4
            if (i == 2) then
                call go_ahead(system%n, part(i)*h, work%begin, work%first, work%stage)
            else
                call go_ahead(system%n, part(i)*h, work%begin, work%rate, work%stage)
            end if
            instant = t + part(i)*h
            ! what begins where the step ends is not part of it
            if (i == 4) instant = max(t, instant - rounding*abs(instant))
            call system%evaluate(instant, work%stage, work%rate, stage_failed)
            failed = failed .or. stage_failed
            if (all(failed)) return
            if (i == 2) then
                call add_two(system%n, weight(i), work%first, work%rate, work%total)
            else
                call add_weighted(system%n, weight(i), work%rate, work%total)
            end if
        end do
        call finish(system%n, h, work%begin, work%total, work%rest, y, failed)
    end subroutine rk4_step

    !> To a stage.
    pure subroutine go_ahead(n, h, y, rate, stage)
        integer, intent(in) :: n
        real(wp), intent(in) :: h(lanes), y(lanes, n), rate(lanes, n)
        real(wp), intent(inout) :: stage(lanes, n)
        integer :: k

        do k = 1, n
            stage(:, k) = y(:, k) + h*rate(:, k)
        end do
    end subroutine go_ahead

    !> Rates at the beginning and at the second stage.
    pure subroutine add_two(n, weight, first, rate, total)
        integer, intent(in) :: n
        real(wp), intent(in) :: weight, first(lanes, n), rate(lanes, n)
        real(wp), intent(inout) :: total(lanes, n)

        total = first + weight*rate
    end subroutine add_two

    pure subroutine add_weighted(n, weight, rate, total)
        integer, intent(in) :: n
        real(wp), intent(in) :: weight, rate(lanes, n)
        real(wp), intent(inout) :: total(lanes, n)

        total = total + weight*rate
    end subroutine add_weighted

    !> To the end of a step.
    pure subroutine finish(n, h, begin, total, rest, y, failed)
        integer, intent(in) :: n
        real(wp), intent(in) :: h(lanes)
        real(wp), intent(in) :: begin(lanes, n)
        real(wp), intent(inout) :: total(lanes, n)     !! six times the mean rate
        real(wp), intent(inout) :: rest(lanes, n)      !! to be added to y, less than its last place
        real(wp), intent(inout) :: y(lanes, n)
        logical, intent(inout) :: failed(lanes)
        real(wp) :: sizes(lanes)
        integer :: k

        do k = 1, n
            total(:, k) = (h/6)*total(:, k) + rest(:, k)
        end do
        call add_all_exactly(lanes*n, total, y, rest)
        call find_sizes(n, y, sizes)
        failed = failed .or. .not. sizes <= huge(1.0_wp)
        if (.not. any(failed)) return
        do k = 1, n
            y(:, k) = merge(begin(:, k), y(:, k), failed)
        end do
    end subroutine finish
end module linkdyn_rk4
