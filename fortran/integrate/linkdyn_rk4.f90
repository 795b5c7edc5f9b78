!> The classical Runge-Kutta method of order 4 at a fixed step, on lanes: the lecture's integrator.
!>
!> What rounding takes from y at a step is added at the next: a million steps round like one.
module linkdyn_rk4
    use linkdyn_exact_sum, only: add_exactly
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    use linkdyn_whole_turns, only: whole_turns, take_off
    implicit none (type, external)
    private
    public :: rk4_workspace, rk4_step

    !> Scratch of a step, and what goes from one to the next.
    type :: rk4_workspace
        real(wp), allocatable :: stage(:, :), rate(:, :), total(:, :)    !! (lane, n)
        real(wp), allocatable :: rest(:, :)      !! to be added to y, less than its last place (lane, n)
    contains
        procedure :: prepare, take_turns_off
    end type rk4_workspace

contains

    subroutine prepare(self, n)
        class(rk4_workspace), intent(inout) :: self
        integer, intent(in) :: n

        if (allocated(self%stage)) deallocate (self%stage, self%rate, self%total, self%rest)
        allocate (self%stage(lanes, n), self%rate(lanes, n), self%total(lanes, n), self%rest(lanes, n))
        self%rest = 0
    end subroutine prepare

    !> Angles go on without the whole turns that they have made.
    subroutine take_turns_off(self, system, y)
        class(rk4_workspace), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(inout) :: y(:, :)             !! (lane, n)
        real(wp) :: turns(lanes, size(y, 2))

        if (.not. allocated(system%is_angle)) return
        turns = merge(whole_turns(y), 0.0_wp, spread(system%is_angle, 1, lanes))
        if (all(turns == 0)) return
        call take_off(turns, y, self%rest)
        call system%note_turns(turns)
    end subroutine take_turns_off

    !> One step. A lane whose right-hand side fails at a stage, or whose result is not finite, keeps its y.
    subroutine rk4_step(system, t, h, y, work, failed)
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t
        real(wp), intent(in) :: h                      !! step
        real(wp), intent(inout) :: y(:, :)             !! (lane, n)
        type(rk4_workspace), intent(inout) :: work
        logical, intent(out) :: failed(lanes)
        real(wp), parameter :: weight(4) = [1.0_wp, 2.0_wp, 2.0_wp, 1.0_wp]
        real(wp), parameter :: part(4) = [0.0_wp, 0.5_wp, 0.5_wp, 1.0_wp]
        real(wp) :: instant(lanes)
        logical :: stage_failed(lanes)
        integer :: i, k

        failed = .false.
        work%total = 0
        work%stage = y
        do i = 1, 4
            if (i > 1) work%stage = y + (part(i)*h)*work%rate
            instant = t + part(i)*h
            call system%evaluate(instant, work%stage, work%rate, stage_failed)
            failed = failed .or. stage_failed
            work%total = work%total + weight(i)*work%rate
        end do
        work%stage = y
        work%total = (h/6)*work%total + work%rest
        work%rest = 0
        call add_exactly(work%total, work%stage, work%rest)
        do k = 1, system%n
            failed = failed .or. .not. abs(work%stage(:, k)) <= huge(1.0_wp)
        end do
        do k = 1, system%n
            where (.not. failed) y(:, k) = work%stage(:, k)
        end do
    end subroutine rk4_step
end module linkdyn_rk4
