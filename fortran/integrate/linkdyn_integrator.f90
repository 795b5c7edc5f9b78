!> One door to all integrators: advance a lane system from instant to instant, each hit exactly.
module linkdyn_integrator
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_gbs, only: gbs_method
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    use linkdyn_ode_gsl, only: ode_gsl
    use linkdyn_rk4, only: rk4_workspace, rk4_step
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text, quoted
    implicit none (type, external)
    private
    public :: integrator_type, integrator_options, method_rk4, method_rkf45, method_rk8pd, method_msbdf, method_gbs
    public :: method_name, choose_method, check_options

    integer, parameter :: method_rk4 = 1       !! order 4, fixed step; all lanes
    integer, parameter :: method_rkf45 = 2     !! order 4(5), adaptive
    integer, parameter :: method_rk8pd = 3     !! order 8(9), adaptive
    integer, parameter :: method_msbdf = 4     !! implicit, for stiff systems
    integer, parameter :: method_gbs = 5       !! extrapolation, order and step adaptive, columns on lanes
    character(len=5), parameter :: method_name(5) = [character(len=5) :: "rk4", "rkf45", "rk8pd", "msbdf", "gbs"]

    type :: integrator_options
        integer :: method = method_rk8pd
        real(wp) :: step = 1.0e-3_wp           !! fixed step (no longer than this); first step tried by the adaptive ones
        real(wp) :: rtol = 1.0e-9_wp           !! local error allowed, relative to y
        real(wp) :: atol = 1.0e-9_wp           !! and absolute
    end type integrator_options

    !> A run under way, and its statistics.
    type :: integrator_type
        type(integrator_options) :: options
        real(wp) :: t = 0                      !! reached
        real(wp) :: next_step = 0              !! proposed
        logical :: failed(lanes) = .false.     !! stopped for good
        real(wp) :: good_until(lanes) = 0      !! instant of the last good y
        integer :: n_step = 0                  !! accepted
        integer :: n_rejected = 0
        integer :: n_evaluation = 0            !! right-hand sides (blocks)
        integer :: n_short = 0                 !! steps in a row that were very short
        logical :: has_shrunk = .false.        !! stopped since its steps shrank to nothing
        logical :: is_paused = .false.         !! `advance` came back before its end: call it again
        integer(int64) :: pause_at = huge(1_int64)    !! count of the system clock
        real(wp) :: last_step = 0, shortest_step = huge(1.0_wp), longest_step = 0
        integer, private :: rejected_before = 0, evaluated_before = 0    !! by the systems exchanged
        integer(int64), private :: i_step = 0, n_span = 0    !! rk4: steps done, and in all, of the span under way
        real(wp), private :: span_start = 0
        type(rk4_workspace), private :: work
        type(ode_gsl), private :: gsl
        type(gbs_method), private :: gbs
    contains
        procedure :: start, advance, reset, exchange_system, finish
    end type integrator_type

contains

    !> The method of a name.
    subroutine choose_method(text, method, status)
        character(len=*), intent(in) :: text
        integer, intent(out) :: method
        type(status_type), intent(inout) :: status

        do method = 1, size(method_name)
            if (text == method_name(method)) return
        end do
        method = method_rk8pd
        call fail(status, status_bad_input, "method "//quoted(text)//" is not known (expected rk4, rkf45, rk8pd, msbdf or gbs)")
    end subroutine choose_method

    !> Refuse what no integrator can work with.
    subroutine check_options(options, status)
        type(integrator_options), intent(in) :: options
        type(status_type), intent(inout) :: status

        if (.not. (options%step > 0 .and. options%step <= huge(1.0_wp))) then
            call fail(status, status_bad_input, "step = "//to_text(options%step)//" (expected a positive time in s)")
        else if (.not. (options%rtol > 0 .and. options%rtol < 1)) then
            call fail(status, status_bad_input, "rtol = "//to_text(options%rtol)//" (expected a number between 0 and 1)")
        else if (.not. (options%atol > 0 .and. options%atol <= huge(1.0_wp))) then
            call fail(status, status_bad_input, "atol = "//to_text(options%atol)//" (expected a positive number)")
        end if
    end subroutine check_options

    !> Begin at t. The adaptive methods integrate lane 1 and copy it to the others.
    subroutine start(self, options, system, t, status)
        class(integrator_type), intent(inout) :: self
        type(integrator_options), intent(in) :: options
        class(lane_system), intent(inout), target :: system     !! must outlive the run
        real(wp), intent(in) :: t
        type(status_type), intent(inout) :: status

        call check_options(options, status)
        if (.not. status%is_ok()) return
        self%options = options
        self%t = t
        self%good_until = t
        self%next_step = options%step
        call prepare_method(self, system, status)
    end subroutine start

    subroutine prepare_method(self, system, status)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout), target :: system
        type(status_type), intent(inout) :: status

        associate (options => self%options)
            if (options%method == method_rk4) then
                call self%work%prepare(system%n)
            else if (options%method == method_gbs) then
                call self%gbs%start(system%n, options%rtol, options%atol)
            else
                call self%gsl%start(trim(method_name(options%method)), system, self%next_step, options%rtol, options%atol, status)
            end if
        end associate
    end subroutine prepare_method

    !> Go on with another system from the last good instant, where the old one may have failed. Equal steps stay those
    !> that they were.
    subroutine exchange_system(self, system, status)
        class(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout), target :: system     !! must outlive the run
        type(status_type), intent(inout) :: status

        call count_work(self)
        self%rejected_before = self%n_rejected
        self%evaluated_before = self%n_evaluation
        if (all(self%failed)) then
            if (self%options%method == method_rk4) self%i_step = self%i_step - 1
            self%t = self%good_until(1)
        end if
        self%failed = .false.
        self%has_shrunk = .false.
        self%n_short = 0
        if (.not. (self%next_step > 0 .and. self%next_step <= huge(1.0_wp))) self%next_step = self%options%step
        call prepare_method(self, system, status)
    end subroutine exchange_system

    !> Rejected steps and right-hand sides, which the adaptive methods count themselves.
    subroutine count_work(self)
        type(integrator_type), intent(inout) :: self

        select case (self%options%method)
        case (method_rk4)
        case (method_gbs)
            self%n_rejected = self%rejected_before + self%gbs%n_rejected
            self%n_evaluation = self%evaluated_before + self%gbs%n_evaluation
        case default
            self%n_rejected = self%rejected_before + self%gsl%n_rejected()
            self%n_evaluation = self%evaluated_before + self%gsl%n_evaluation()
        end select
    end subroutine count_work

    !> Go on to t_end exactly. A lane that cannot keeps its last good y. Where the clock says so, or the system wants a
    !> rest, the way there is interrupted between two steps; that changes nothing in the result.
    subroutine advance(self, system, t_end, y)
        class(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t_end
        real(wp), intent(inout) :: y(:, :)                      !! (lane, n)

        self%is_paused = .false.
        if (all(self%failed) .or. t_end <= self%t) return
        if (self%options%method == method_rk4) then
            call advance_rk4(self, system, t_end, y)
        else
            call advance_adaptive(self, system, t_end, y)
        end if
    end subroutine advance

    !> Equal steps no longer than the one asked for.
    subroutine advance_rk4(self, system, t_end, y)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t_end
        real(wp), intent(inout) :: y(:, :)
        real(wp), parameter :: slack = 1.0e-6_wp    !! of a step: a span that is a whole number of steps but for rounding
        real(wp) :: h, kept(lanes, system%n)
        logical :: failed(lanes)
        integer :: k

        if (self%i_step == self%n_span) then
            self%span_start = self%t
            if ((t_end - self%t)/self%options%step > 1/epsilon(h)) then
                self%failed = .true.            ! the clock would stand still
                return
            end if
            self%n_span = max(1_int64, ceiling((t_end - self%t)/self%options%step - slack, int64))
            self%i_step = 0
        end if
        h = (t_end - self%span_start)/self%n_span
        do while (self%i_step < self%n_span)
            if (must_pause(self)) return
            kept = y
            call rk4_step(system, self%t, h, y, self%work, failed)
            self%n_evaluation = self%n_evaluation + 4
            do k = 1, system%n
                where (self%failed) y(:, k) = kept(:, k)
            end do
            self%failed = self%failed .or. failed
            self%i_step = self%i_step + 1
            self%t = self%span_start + self%i_step*h
            if (self%i_step == self%n_span) self%t = t_end
            where (.not. self%failed) self%good_until = self%t
            if (all(self%failed)) return
            call system%accept(spread(self%t, 1, lanes), y, .not. self%failed)
            call note_step(self, h)
            if (system%wants_rest) return
        end do
    end subroutine advance_rk4

    subroutine advance_adaptive(self, system, t_end, y)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t_end
        real(wp), intent(inout) :: y(:, :)
        real(wp), parameter :: short = 1.0e-5_wp        !! step, of the longest so far
        integer, parameter :: most_short = 200          !! in a row
        real(wp) :: h, t_before, solution(size(y, 2))
        logical :: ok
        integer :: k

        solution = y(1, :)
        do while (self%t < t_end)
            if (must_pause(self)) exit
            h = self%next_step
            t_before = self%t
            if (self%options%method == method_gbs) then
                call self%gbs%take_step(system, self%t, t_end, h, solution, ok)
            else
                call self%gsl%take_step(self%t, t_end, h, solution, ok)
            end if
            ! Steps that shrink without end lead nowhere: at a singular position, say.
            self%n_short = merge(self%n_short + 1, 0, self%t < t_end .and. self%t - t_before < short*self%longest_step)
            if (ok .and. self%n_short > most_short) then
                self%has_shrunk = .true.
                ok = .false.
            end if
            if (.not. ok .or. .not. all(abs(solution) <= huge(1.0_wp)) .or. self%t <= t_before) then
                self%failed = .true.
                exit
            end if
            do k = 1, size(solution)
                y(:, k) = solution(k)
            end do
            call system%accept(spread(self%t, 1, lanes), y, .not. self%failed)
            self%good_until = self%t
            call note_step(self, self%t - t_before)
            ! A step cut short by t_end says nothing against the longer one proposed before.
            if (self%t >= t_end .and. self%last_step < self%next_step) h = max(h, self%next_step)
            self%next_step = h
            if (system%wants_rest) exit
        end do
        call count_work(self)
    end subroutine advance_adaptive

    !> Has the caller's time run out?
    logical function must_pause(self)
        type(integrator_type), intent(inout) :: self
        integer(int64) :: now

        if (self%pause_at < huge(now)) then
            call system_clock(now)
            self%is_paused = now >= self%pause_at
        end if
        must_pause = self%is_paused
    end function must_pause

    subroutine note_step(self, h)
        type(integrator_type), intent(inout) :: self
        real(wp), intent(in) :: h

        self%n_step = self%n_step + 1
        self%last_step = h
        self%shortest_step = min(self%shortest_step, h)
        self%longest_step = max(self%longest_step, h)
    end subroutine note_step

    !> The right-hand side has a kink at the instant reached.
    subroutine reset(self)
        class(integrator_type), intent(inout) :: self

        select case (self%options%method)
        case (method_rk4)
        case (method_gbs)
            call self%gbs%reset()
        case default
            call self%gsl%reset()
        end select
    end subroutine reset

    subroutine finish(self)
        class(integrator_type), intent(inout) :: self

        call self%gsl%release()
    end subroutine finish
end module linkdyn_integrator
