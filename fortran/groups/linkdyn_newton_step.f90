!> Newton's step of a group closed by iteration: correction of the links' places, their velocities, and what tells the margin,
!> from the constraints of the joints alone and by one elimination.
!>
!> Errors, what the known links' velocities do, and the probes are right-hand sides of the same matrix. They go through the
!> elimination as one, each with a symbol of its own for a factor, and are told apart in the solution.
module linkdyn_newton_step
    use linkdyn_group_rates, only: group_constraints, make_velocities_unknown, require_rates
    use linkdyn_kinds, only: wp
    use linkdyn_linear_form, only: linear_form, linear_forms, find_linear_form
    use linkdyn_mechanism, only: mechanism_type
    use linkdyn_record, only: new_unknown
    use linkdyn_system, only: system_type, solve
    use linkdyn_value, only: value, zero, constant, operator(+), operator(-), operator(*)
    implicit none (type, external)
    private
    public :: newton_step, trace_newton_step

    type :: newton_step
        type(value), allocatable :: correction(:)      !! A^-1 errors: shift and turn of each link (row)
        type(value), allocatable :: rate(:)            !! velocity and angular velocity of each link (row)
        type(value), allocatable :: response(:, :)     !! A^-1 v of each probe v (row, probe)
        type(value) :: determinant                     !! of A; its sign, or the opposite at every sample
        type(value), allocatable :: watched(:)         !! magnitudes that must stay below one
        logical :: is_solved = .false.
    end type newton_step

contains

    !> Trace Newton's step of a group whose links are placed, and all before it placed and moving.
    subroutine trace_newton_step(mechanism, constraints, probe, step)
        type(mechanism_type), intent(inout) :: mechanism
        type(group_constraints), intent(in) :: constraints
        real(wp), intent(in) :: probe(:, :)            !! (row, probe)
        type(newton_step), intent(out) :: step
        type(system_type) :: system
        type(value) :: factor(size(probe, 2) + 1), zeros(size(probe, 1))
        type(value), allocatable :: error(:)
        integer :: i, k

        call make_velocities_unknown(mechanism, constraints, system)
        call require_rates(mechanism, constraints, system, error)
        ! not square: the probes do not belong to these equations
        if (size(error) /= size(zeros) .or. system%n_unknown /= size(zeros)) return
        do k = 1, size(factor)
            factor(k) = new_unknown()
        end do
        do i = 1, size(error)
            associate (rest => system%equation(i)%rest)
                rest = factor(1)*rest - error(i)
                do k = 1, size(probe, 2)
                    rest = rest - factor(k + 1)*constant(probe(i, k))
                end do
            end associate
        end do
        call solve(system)
        if (.not. system%is_solved) return
        zeros = zero()
        step%correction = zeros
        step%rate = zeros
        allocate (step%response(size(error), size(probe, 2)))
        call tell_apart()
        step%determinant = system%determinant
        step%watched = system%watched
        step%is_solved = .true.

    contains

        subroutine tell_apart()
            type(linear_forms) :: forms
            type(linear_form) :: form
            integer :: j

            forms%first = factor(1)%node
            do j = 1, size(error)
                call find_linear_form(forms, system%solution(j), form)
                step%correction(j) = form%rest
                step%rate(j) = part_of(form, 1)
                do k = 1, size(probe, 2)
                    step%response(j, k) = part_of(form, k + 1)
                end do
            end do
        end subroutine tell_apart

        !> What a factor stands before.
        function part_of(form, k) result(v)
            type(linear_form), intent(in) :: form
            integer, intent(in) :: k
            type(value) :: v
            type(linear_form) :: own
            type(linear_forms) :: forms
            integer :: at

            forms%first = factor(1)%node
            call find_linear_form(forms, factor(k), own)
            at = findloc(form%unknown, own%unknown(1), dim=1)
            v = zero()
            if (at > 0) v = form%coefficient(at)
        end function part_of
    end subroutine trace_newton_step
end module linkdyn_newton_step
