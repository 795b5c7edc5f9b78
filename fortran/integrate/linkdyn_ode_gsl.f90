!> GSL's steppers on a lane system: explicit Runge-Kutta methods, step by step, and the multistep method msbdf, which
!> controls its steps itself. One solution is integrated; the lanes serve the Jacobian of msbdf, whose differences are
!> taken side by side.
module linkdyn_ode_gsl
    use, intrinsic :: iso_c_binding, only: c_double, c_int, c_size_t, c_long, c_char, c_ptr, c_funptr, c_null_char, &
        c_null_ptr, c_associated, c_loc, c_funloc, c_f_pointer
    use linkdyn_constants, only: two_pi
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    use linkdyn_one_step, only: one_step_method
    use linkdyn_status, only: status_type, fail, status_internal
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: ode_gsl, runge_kutta_gsl, has_gsl

    logical, parameter :: has_gsl = .true.

    !> What the callbacks need; its address travels through GSL.
    type :: callback_frame
        class(lane_system), pointer :: system => null()
        real(wp), allocatable :: y(:, :), rate(:, :)      !! (lane, n)
        real(wp), allocatable :: base(:)                  !! what GSL's y counts from (n)
        real(wp), allocatable :: sum(:)                   !! of both (n)
        integer :: n_evaluation = 0                       !! blocks evaluated
        integer :: n_before_step = 0                      !! of these, before the step that is taken
    end type callback_frame

    !> An explicit method with an error estimate, by its steps.
    type, extends(one_step_method) :: runge_kutta_gsl
        type(c_ptr), private :: handle = c_null_ptr
        type(callback_frame), pointer, private :: frame => null()
        integer, private :: order = 0
        real(wp), allocatable, private :: error(:)        !! of the step tried last
    contains
        procedure :: start => start_runge_kutta
        procedure :: try_step => try_runge_kutta
        procedure :: propose => propose_runge_kutta
        procedure :: is_of_fortran => is_runge_kutta_of_fortran
        procedure :: release => release_runge_kutta
    end type runge_kutta_gsl

    !> One run of msbdf.
    type :: ode_gsl
        private
        type(c_ptr) :: handle = c_null_ptr
        type(callback_frame), pointer :: frame => null()
    contains
        procedure, public :: start, take_step, reset, release
        procedure, public :: n_rejected, n_evaluation
    end type ode_gsl

    interface
        function linkdyn_gsl_stepper_new(name, n, rates, context) bind(c) result(handle)
            import :: c_char, c_size_t, c_funptr, c_ptr
            character(kind=c_char), intent(in) :: name(*)
            integer(c_size_t), value :: n
            type(c_funptr), value :: rates
            type(c_ptr), value :: context
            type(c_ptr) :: handle
        end function linkdyn_gsl_stepper_new
        function linkdyn_gsl_stepper_order(handle) bind(c) result(order)
            import :: c_ptr, c_int
            type(c_ptr), value :: handle
            integer(c_int) :: order
        end function linkdyn_gsl_stepper_order
        function linkdyn_gsl_stepper_step(handle, t, h, y, error, rate) bind(c) result(code)
            import :: c_ptr, c_double, c_int
            type(c_ptr), value :: handle
            real(c_double), value :: t, h
            real(c_double), intent(inout) :: y(*)
            real(c_double), intent(out) :: error(*)
            real(c_double), intent(in) :: rate(*)
            integer(c_int) :: code
        end function linkdyn_gsl_stepper_step
        subroutine linkdyn_gsl_stepper_free(handle) bind(c)
            import :: c_ptr
            type(c_ptr), value :: handle
        end subroutine linkdyn_gsl_stepper_free
        function linkdyn_gsl_ode_new(n, rates, jacobian, context, first_step, rtol, largest) bind(c) result(handle)
            import :: c_size_t, c_funptr, c_ptr, c_double
            integer(c_size_t), value :: n
            type(c_funptr), value :: rates, jacobian
            type(c_ptr), value :: context
            real(c_double), value :: first_step, rtol
            real(c_double), intent(in) :: largest(*)
            type(c_ptr) :: handle
        end function linkdyn_gsl_ode_new
        function linkdyn_gsl_ode_step(handle, t, t_end, h, y, atol) bind(c) result(code)
            import :: c_ptr, c_double, c_int
            type(c_ptr), value :: handle
            real(c_double), intent(inout) :: t, h, y(*)
            real(c_double), value :: t_end
            real(c_double), intent(in) :: atol(*)
            integer(c_int) :: code
        end function linkdyn_gsl_ode_step
        function linkdyn_gsl_ode_reset(handle) bind(c) result(code)
            import :: c_ptr, c_int
            type(c_ptr), value :: handle
            integer(c_int) :: code
        end function linkdyn_gsl_ode_reset
        function linkdyn_gsl_ode_rejected(handle) bind(c) result(n)
            import :: c_ptr, c_long
            type(c_ptr), value :: handle
            integer(c_long) :: n
        end function linkdyn_gsl_ode_rejected
        subroutine linkdyn_gsl_ode_free(handle) bind(c)
            import :: c_ptr
            type(c_ptr), value :: handle
        end subroutine linkdyn_gsl_ode_free
    end interface

contains

    ! ---------------------------------------------------------------- explicit methods

    !> Prepare a method by its name (rkf45, rk8pd).
    subroutine start_runge_kutta(self, name, system, status)
        class(runge_kutta_gsl), intent(inout) :: self
        character(len=*), intent(in) :: name
        class(lane_system), intent(inout), target :: system   !! must outlive the method
        type(status_type), intent(inout) :: status

        call self%release()
        call make_frame(system, self%frame)
        allocate (self%error(system%n))
        self%handle = linkdyn_gsl_stepper_new(name//c_null_char, int(system%n, c_size_t), c_funloc(rates), c_loc(self%frame))
        if (c_associated(self%handle)) then
            self%order = linkdyn_gsl_stepper_order(self%handle)
        else
            call fail(status, status_internal, "GSL has no stepper "//quoted(name))
        end if
    end subroutine start_runge_kutta

    !> One step of the solution counted from where it starts.
    subroutine try_runge_kutta(self, system, t, step, y, rate, way, error, failed, again)
        class(runge_kutta_gsl), intent(inout) :: self
        class(lane_system), intent(inout) :: system           !! that of the start
        real(wp), intent(in) :: t, step
        real(wp), intent(in) :: y(:), rate(:)
        real(wp), intent(out) :: way(:), error(:)
        logical, intent(out) :: failed
        logical, intent(in) :: again

        self%frame%base = y
        self%frame%n_before_step = self%frame%n_evaluation
        way = 0
        error = 0
        failed = linkdyn_gsl_stepper_step(self%handle, t, step, way, error, rate) /= 0
        self%n_evaluation = self%frame%n_evaluation
        if (.not. again) self%error = error
    end subroutine try_runge_kutta

    !> The error goes as the step to the method's order.
    subroutine propose_runge_kutta(self, step, allowed, is_accepted, next)
        class(runge_kutta_gsl), intent(inout) :: self
        real(wp), intent(in) :: step
        real(wp), intent(in) :: allowed(:)
        logical, intent(in) :: is_accepted
        real(wp), intent(out) :: next
        real(wp), parameter :: safety = 0.9_wp, least = 0.2_wp, largest = 5.0_wp
        real(wp) :: part

        part = maxval(abs(self%error)/allowed)
        next = step*min(merge(largest, safety, is_accepted), &
                        max(least, safety*max(part, tiny(1.0_wp))**(-1/real(self%order, wp))))
    end subroutine propose_runge_kutta

    pure logical function is_runge_kutta_of_fortran(self) result(is_of_fortran)
        class(runge_kutta_gsl), intent(in) :: self

        is_of_fortran = .false.
    end function is_runge_kutta_of_fortran

    subroutine release_runge_kutta(self)
        class(runge_kutta_gsl), intent(inout) :: self

        if (c_associated(self%handle)) call linkdyn_gsl_stepper_free(self%handle)
        self%handle = c_null_ptr
        if (associated(self%frame)) deallocate (self%frame)
        if (allocated(self%error)) deallocate (self%error)
    end subroutine release_runge_kutta

    ! ---------------------------------------------------------------- msbdf

    !> Prepare a run.
    subroutine start(self, system, first_step, rtol, status)
        class(ode_gsl), intent(inout) :: self
        class(lane_system), intent(inout), target :: system   !! must outlive the run
        real(wp), intent(in) :: first_step, rtol
        type(status_type), intent(inout) :: status
        real(wp) :: largest(system%n)

        call self%release()
        call make_frame(system, self%frame)
        largest = huge(1.0_wp)
        if (allocated(system%is_angle)) where (system%is_angle) largest = two_pi
        if (allocated(system%is_book)) where (system%is_book) largest = -1
        self%handle = linkdyn_gsl_ode_new(int(system%n, c_size_t), c_funloc(rates), c_funloc(jacobian), c_loc(self%frame), &
                                          first_step, rtol, largest)
        if (.not. c_associated(self%handle)) call fail(status, status_internal, "no memory for method 'msbdf'")
    end subroutine start

    !> One accepted step towards t_end, never beyond.
    subroutine take_step(self, t, t_end, h, y, atol, ok)
        class(ode_gsl), intent(inout) :: self
        real(wp), intent(inout) :: t
        real(wp), intent(in) :: t_end
        real(wp), intent(inout) :: h                   !! in: to try; out: proposed for the next step
        real(wp), intent(inout) :: y(:)
        real(wp), intent(in) :: atol(:)                !! error allowed, besides the relative one (n)
        logical, intent(out) :: ok                     !! false: no step can be taken; t and y are as before

        self%frame%n_before_step = self%frame%n_evaluation
        ok = linkdyn_gsl_ode_step(self%handle, t, t_end, h, y, atol) == 0
    end subroutine take_step

    !> Forget the history: the right-hand side has a kink here, or y was changed.
    subroutine reset(self)
        class(ode_gsl), intent(inout) :: self
        integer(c_int) :: code

        code = linkdyn_gsl_ode_reset(self%handle)
    end subroutine reset

    subroutine release(self)
        class(ode_gsl), intent(inout) :: self

        if (c_associated(self%handle)) call linkdyn_gsl_ode_free(self%handle)
        self%handle = c_null_ptr
        if (associated(self%frame)) deallocate (self%frame)
    end subroutine release

    integer function n_rejected(self)
        class(ode_gsl), intent(in) :: self

        n_rejected = int(linkdyn_gsl_ode_rejected(self%handle))
    end function n_rejected

    integer function n_evaluation(self)
        class(ode_gsl), intent(in) :: self

        n_evaluation = self%frame%n_evaluation
    end function n_evaluation

    ! ---------------------------------------------------------------- callbacks

    subroutine make_frame(system, frame)
        class(lane_system), intent(inout), target :: system
        type(callback_frame), pointer, intent(out) :: frame

        allocate (frame)
        frame%system => system
        allocate (frame%y(lanes, system%n), frame%rate(lanes, system%n))
        allocate (frame%base(system%n), frame%sum(system%n), source=0.0_wp)
    end subroutine make_frame

    function rates(t, y, rate, context) bind(c) result(code)
        real(c_double), value :: t
        real(c_double), intent(in) :: y(*)
        real(c_double), intent(inout) :: rate(*)
        type(c_ptr), value :: context
        integer(c_int) :: code
        type(callback_frame), pointer :: frame
        logical :: failed

        call c_f_pointer(context, frame)
        code = 1
        if (is_given_up(frame)) return
        associate (n => frame%system%n)
            frame%sum = frame%base + y(:n)
            call frame%system%evaluate_alone(t, frame%sum, rate(:n), failed)
        end associate
        frame%n_evaluation = frame%n_evaluation + 1
        code = merge(1_c_int, 0_c_int, failed)
    end function rates

    !> Is a step that somebody wants to end longer on its way than one is that comes to an end? msbdf tries again within itself.
    logical function is_given_up(frame)
        type(callback_frame), intent(in) :: frame
        integer, parameter :: evaluations_a_step = 4

        is_given_up = .false.
        if (frame%n_evaluation - frame%n_before_step > evaluations_a_step) is_given_up = is_interrupted()
    end function is_given_up

    !> Central differences, two lanes a column; the last pair is the derivative in time.
    function jacobian(t, y, derivative, in_time, context) bind(c) result(code)
        real(c_double), value :: t
        real(c_double), intent(in) :: y(*)
        real(c_double), intent(inout) :: derivative(*)        !! row by row
        real(c_double), intent(inout) :: in_time(*)
        type(c_ptr), value :: context
        integer(c_int) :: code
        type(callback_frame), pointer :: frame
        real(wp) :: step(lanes), instant(lanes), slope
        logical :: failed(lanes)
        integer :: n, item, lane, first, k, n_pair

        call c_f_pointer(context, frame)
        n = frame%system%n
        n_pair = max(1, lanes/2)
        code = 1
        if (is_given_up(frame)) return
        code = 0
        do first = 1, n + 1, n_pair
            call perturb(0)
            if (lanes == 1) call difference_alone()
            if (lanes > 1) then
                call frame%system%evaluate(instant, frame%y, frame%rate, failed)
                frame%n_evaluation = frame%n_evaluation + 1
                if (any(failed)) code = 1
                do lane = 1, 2*n_pair, 2
                    item = first + (lane - 1)/2
                    do k = 1, n
                        slope = (frame%rate(lane, k) - frame%rate(lane + 1, k))/(2*step(lane))
                        call store(item, k, slope)
                    end do
                end do
            end if
        end do

    contains

        !> Item `first + i` goes up on lane 2i + 1 and down on lane 2i + 2; a single lane takes them in turn.
        subroutine perturb(turn)
            integer, intent(in) :: turn                       !! single lane: 0 up, 1 down
            real(wp) :: change
            integer :: l, i

            do l = 1, lanes
                i = first + (l - 1)/2
                frame%y(l, :) = y(:n)
                instant(l) = t
                if (i > n + 1) cycle
                if (i <= n) then
                    step(l) = epsilon(1.0_wp)**(1.0_wp/3)*max(1.0_wp, abs(y(i)))
                else
                    step(l) = epsilon(1.0_wp)**(1.0_wp/3)*max(1.0_wp, abs(t))
                end if
                change = merge(step(l), -step(l), modulo(l + turn, 2) == 1)
                if (i <= n) then
                    frame%y(l, i) = y(i) + change
                else
                    instant(l) = t + change
                end if
            end do
        end subroutine perturb

        subroutine difference_alone()
            real(wp) :: up(n)
            integer :: j

            call frame%system%evaluate(instant, frame%y, frame%rate, failed)
            if (any(failed)) code = 1
            up = frame%rate(1, :)
            call perturb(1)
            call frame%system%evaluate(instant, frame%y, frame%rate, failed)
            if (any(failed)) code = 1
            frame%n_evaluation = frame%n_evaluation + 2
            do j = 1, n
                call store(first, j, (up(j) - frame%rate(1, j))/(2*step(1)))
            end do
        end subroutine difference_alone

        subroutine store(column, row, value)
            integer, intent(in) :: column, row
            real(wp), intent(in) :: value

            if (column <= n) derivative((row - 1)*n + column) = value
            if (column == n + 1) in_time(row) = value
        end subroutine store
    end function jacobian
end module linkdyn_ode_gsl
