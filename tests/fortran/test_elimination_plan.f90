!> Elimination plan and its execution: planned on some values, run on others, against the dense solver.
module test_elimination_plan
    use linkdyn_condition_estimate, only: estimate_space, prepare_estimate, estimate_inverse_norm
    use linkdyn_elimination_plan, only: elimination_plan, sparse_system, make_plan, make_factor_plan
    use linkdyn_elimination_run, only: run_plan, load_constants
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_linear_record, only: linear_record, solve_recorded, transposed
    use linkdyn_slots, only: slot_store, make_slots
    use linkdyn_test_numbers, only: random_stream, eps, condition_number, dense_solution
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: collect_elimination_plan

    integer, parameter :: n_pose = 8    !! representative poses

    !> A system with its values on the lanes.
    type :: lane_system
        type(sparse_system) :: sparse
        real(wp), allocatable :: matrix(:, :, :)    !! (lane, n, n)
        real(wp), allocatable :: right(:, :)        !! (lane, n)
    end type lane_system

contains

    subroutine collect_elimination_plan(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("random systems", test_random), &
            new_test("wanted unknowns only", test_wanted), &
            new_test("right-hand sides that are zero", test_zero_right), &
            new_test("constants are folded", test_constants), &
            new_test("any right-hand side, also transposed", test_factors), &
            new_test("norm of the inverse", test_inverse_norm), &
            new_test("zero diagonal", test_zero_diagonal), &
            new_test("bad pivots on one lane", test_alarm), &
            new_test("a value that is not a number", test_nan), &
            new_test("rows turned into each other", test_turned), &
            new_test("structurally singular", test_singular), &
            new_test("singular for all values", test_dependent)]
    end subroutine collect_elimination_plan

    !> A random sparse system: a varying permuted diagonal that dominates, other entries 1, -1, another constant or
    !> varying. Values on the lanes and on the representative poses differ.
    subroutine make_system(stream, n, fill, system)
        type(random_stream), intent(inout) :: stream
        integer, intent(in) :: n
        real(wp), intent(in) :: fill    !! share of nonzeros off the permuted diagonal
        type(lane_system), intent(out) :: system
        logical :: is_nonzero(n, n)
        integer :: permutation(n), i, j, k, n_entry, n_slot, kept
        real(wp) :: fixed, kind

        permutation = [(i, i=1, n)]
        do i = n, 2, -1
            j = 1 + int(i*(0.5_wp*(stream%next() + 1)))
            j = min(max(j, 1), i)
            kept = permutation(i)
            permutation(i) = permutation(j)
            permutation(j) = kept
        end do
        is_nonzero = .false.
        do j = 1, n
            do i = 1, n
                is_nonzero(i, j) = i == permutation(j) .or. 0.5_wp*(stream%next() + 1) < fill
            end do
        end do
        n_entry = count(is_nonzero)
        allocate (system%sparse%row(n_entry), system%sparse%column(n_entry), system%sparse%slot(n_entry))
        allocate (system%sparse%value(n_pose, n_entry), system%sparse%right_slot(n), system%sparse%is_wanted(n))
        allocate (system%matrix(lanes, n, n), system%right(lanes, n))
        system%sparse%n = n
        system%sparse%is_wanted = .true.
        system%matrix = 0
        n_entry = 0
        n_slot = 0
        do j = 1, n
            do i = 1, n
                if (.not. is_nonzero(i, j)) cycle
                n_entry = n_entry + 1
                system%sparse%row(n_entry) = i
                system%sparse%column(n_entry) = j
                system%sparse%slot(n_entry) = 0
                kind = stream%next()
                if (i == permutation(j)) then
                    ! Dominant with a sign of its own, so that the same pivots serve all values.
                    n_slot = n_slot + 1
                    system%sparse%slot(n_entry) = n_slot
                    fixed = sign(4.0_wp, stream%next())
                    system%sparse%value(:, n_entry) = fixed*(1 + 0.3_wp*stream%vector(n_pose))
                    system%matrix(:, i, j) = fixed*(1 + 0.3_wp*stream%vector(lanes))
                else if (kind < -0.3_wp) then
                    n_slot = n_slot + 1
                    system%sparse%slot(n_entry) = n_slot
                    system%sparse%value(:, n_entry) = stream%vector(n_pose)
                    system%matrix(:, i, j) = stream%vector(lanes)
                else
                    fixed = sign(1.0_wp, stream%next())
                    if (kind > 0.6_wp) fixed = stream%next()
                    system%sparse%value(:, n_entry) = fixed
                    system%matrix(:, i, j) = fixed
                end if
            end do
        end do
        do k = 1, n
            n_slot = n_slot + 1
            system%sparse%right_slot(k) = n_slot
            system%right(:, k) = stream%vector(lanes)
        end do
    end subroutine make_system

    !> Two unknowns in turning axes, [c s; -s c] at angles all the way round, so that neither c nor s may be a pivot; two
    !> more unknowns hang on the first.
    subroutine make_turned(stream, system)
        type(random_stream), intent(inout) :: stream
        type(lane_system), intent(out) :: system
        integer, parameter :: n = 4
        real(wp) :: angle(n_pose), other(lanes)
        real(wp), parameter :: turn = 6.28318530717958647692528676655900577_wp
        integer :: i

        angle = [(turn*i/n_pose, i=1, n_pose)]
        other = turn*stream%vector(lanes)
        system%sparse%n = n
        allocate (system%sparse%is_wanted(n), system%right(lanes, n), system%matrix(lanes, n, n))
        allocate (system%sparse%row(0), system%sparse%column(0), system%sparse%slot(0), system%sparse%value(n_pose, 0))
        system%sparse%is_wanted = .true.
        system%matrix = 0
        call add(1, 1, cos(angle), cos(other))
        call add(1, 2, sin(angle), sin(other))
        call add(2, 1, -sin(angle), -sin(other))
        call add(2, 2, cos(angle), cos(other))
        ! Too small at some of the angles, as those above.
        call add(3, 1, 0.5_wp*cos(2*angle), 0.5_wp*cos(2*other))
        call add(3, 3, 1 + 0.3_wp*sin(angle), 1 + 0.3_wp*sin(other))
        call add(4, 1, sin(3*angle), sin(3*other))
        call add(4, 3, sin(angle), sin(other))
        call add(4, 4, spread(3.0_wp, 1, n_pose), spread(3.0_wp, 1, lanes))
        system%sparse%right_slot = [(size(system%sparse%row) + i, i=1, n)]
        do i = 1, n
            system%right(:, i) = stream%vector(lanes)
        end do

    contains

        subroutine add(row, column, value, on_lanes)
            integer, intent(in) :: row, column
            real(wp), intent(in) :: value(n_pose), on_lanes(lanes)

            associate (sparse => system%sparse)
                sparse%row = [sparse%row, row]
                sparse%column = [sparse%column, column]
                sparse%slot = [sparse%slot, size(sparse%row)]
                sparse%value = reshape([sparse%value, value], [n_pose, size(sparse%row)])
            end associate
            system%matrix(:, row, column) = on_lanes
        end subroutine add
    end subroutine make_turned

    subroutine test_turned(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 4
        type(lane_system) :: system
        type(elimination_plan) :: plan
        type(random_stream) :: stream
        real(wp) :: x(lanes, n), alarm(lanes), want(n)
        integer :: l

        call make_turned(stream, system)
        call make_plan(system%sparse, plan)
        call check(error, plan%is_complete, "a plan is found")
        if (.not. plan%is_complete) return
        call run(plan, system, x, alarm)
        call check(error, all(alarm <= 1), "no alarm")
        do l = 1, lanes
            want = dense_solution(system%matrix(l, :, :), system%right(l, :))
            call check_close(error, x(l, :), want, 16*eps*condition_number(system%matrix(l, :, :))*maxval(abs(want)), "solution")
        end do
    end subroutine test_turned

    !> Pivots and multipliers serve any right-hand side, forwards and transposed, also where rows were turned or the plan
    !> has folded constants, and several right-hand sides one after the other.
    subroutine test_factors(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(lane_system) :: system
        integer, parameter :: sizes(5) = [1, 2, 6, 13, 24]
        integer :: i, repeat

        call make_turned(stream, system)
        call compare_factors("turned rows")
        do i = 1, size(sizes)
            do repeat = 1, 5
                call make_system(stream, sizes(i), min(0.5_wp, 2.0_wp/sizes(i)), system)
                if (repeat == 5) call fix_values(system)
                call compare_factors("n = "//to_text(sizes(i)))
            end do
        end do

    contains

        subroutine compare_factors(what)
            character(len=*), intent(in) :: what
            type(elimination_plan) :: plan
            type(linear_record) :: solve, back
            type(slot_store) :: slot
            real(wp), allocatable :: work(:, :)
            real(wp) :: alarm(lanes), x(lanes, system%sparse%n), want(system%sparse%n), tol
            integer :: l, k

            system%sparse%right_slot = 0                  ! they must not matter
            call make_factor_plan(system%sparse, plan, solve)
            call check(error, plan%is_complete, what//": complete")
            if (.not. plan%is_complete) return
            call make_slots(plan%n_slot, slot)
            call load_constants(plan, slot%value)
            call fill_slots(system, slot%value)
            call run_plan(plan, slot%value, alarm)
            call check(error, all(alarm <= 1), what//": no alarm")
            back = transposed(solve)
            allocate (work(lanes, back%n + back%n_step + 1))
            do k = 1, 4
                system%right = reshape(stream%vector(lanes*solve%n), [lanes, solve%n])
                x = system%right
                if (modulo(k, 2) == 1) call solve_recorded(solve, slot%value, work, x)
                if (modulo(k, 2) == 0) call solve_recorded(back, slot%value, work, x)
                do l = 1, lanes, 3
                    associate (a => system%matrix(l, :, :))
                        if (modulo(k, 2) == 1) want = dense_solution(a, system%right(l, :))
                        if (modulo(k, 2) == 0) want = dense_solution(transpose(a), system%right(l, :))
                        tol = rounding(solve%n, alarm(l))*condition_number(a)*maxval(abs(want))
                    end associate
                    call check_close(error, x(l, :), want, tol, what//": solution "//to_text(k))
                end do
            end do
            call slot%free()
        end subroutine compare_factors
    end subroutine test_factors

    !> All values constant.
    subroutine fix_values(system)
        type(lane_system), intent(inout) :: system
        integer :: k

        system%sparse%slot = 0
        do k = 1, size(system%sparse%row)
            associate (i => system%sparse%row(k), j => system%sparse%column(k))
                system%sparse%value(:, k) = system%sparse%value(1, k)
                system%matrix(:, i, j) = system%sparse%value(1, k)
            end associate
        end do
    end subroutine fix_values

    !> Never above the true norm of the scaled inverse (its rounding aside), never more than a factor 3 below; a lane's estimate
    !> does not depend on its neighbours.
    subroutine test_inverse_norm(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(lane_system) :: system
        type(elimination_plan) :: plan
        type(linear_record) :: solve, back
        type(slot_store) :: slot
        type(estimate_space) :: space
        real(wp), allocatable :: left(:, :), right(:, :)
        real(wp) :: alarm(lanes), norm(lanes), again(lanes), want
        integer, parameter :: sizes(4) = [1, 3, 10, 20]
        integer :: i, l, repeat

        do i = 1, size(sizes)
            do repeat = 1, 10
                call make_system(stream, sizes(i), min(0.5_wp, 2.0_wp/sizes(i)), system)
                system%sparse%right_slot = 0
                call make_factor_plan(system%sparse, plan, solve)
                back = transposed(solve)
                call prepare_estimate(solve, back, space)
                left = 10**(2*reshape(stream%vector(lanes*sizes(i)), [lanes, sizes(i)]))
                right = 10**(2*reshape(stream%vector(lanes*sizes(i)), [lanes, sizes(i)]))
                call make_slots(plan%n_slot, slot)
                call load_constants(plan, slot%value)
                call fill_slots(system, slot%value)
                call run_plan(plan, slot%value, alarm)
                call estimate_inverse_norm(solve, back, slot%value, left, right, space, norm)
                do l = 1, lanes, 3
                    want = inverse_norm(system%matrix(l, :, :), left(l, :), right(l, :))
                    call check(error, norm(l) < want*(1 + 1.0e-6_wp), "not above")
                    call check(error, norm(l) > want/3, "not far below: "//to_text(norm(l)/want))
                end do
                ! Everything one lane on.
                slot%value = cshift(slot%value, 1, dim=1)
                call estimate_inverse_norm(solve, back, slot%value, cshift(left, 1, dim=1), cshift(right, 1, dim=1), space, again)
                call check(error, all(abs(again - cshift(norm, 1)) <= 0), "lanes apart")
                call slot%free()
                call space%free()
            end do
        end do
    end subroutine test_inverse_norm

    !> 1-norm of diag(left) A^-1 diag(right), column by column.
    real(wp) function inverse_norm(a, left, right) result(norm)
        real(wp), intent(in) :: a(:, :), left(:), right(:)
        real(wp) :: unit_vector(size(left))
        integer :: k

        norm = 0
        do k = 1, size(left)
            unit_vector = 0
            unit_vector(k) = right(k)
            norm = max(norm, sum(abs(left*dense_solution(a, unit_vector))))
        end do
    end function inverse_norm

    !> Run the plan on the lanes' values; unknowns that are not wanted come out zero.
    subroutine run(plan, system, x, alarm)
        type(elimination_plan), intent(in) :: plan
        type(lane_system), intent(in) :: system
        real(wp), intent(out) :: x(:, :)
        real(wp), intent(out) :: alarm(lanes)
        type(slot_store) :: slot
        integer :: k

        call make_slots(plan%n_slot, slot)
        ! Twice, as a workspace is used again: the first run must not spoil the constants.
        call load_constants(plan, slot%value)
        do k = 1, 2
            call fill_slots(system, slot%value)
            call run_plan(plan, slot%value, alarm)
        end do
        x = 0
        do k = 1, system%sparse%n
            if (plan%solution_slot(k) > 0) x(:, k) = plan%solution_sign(k)*slot%value(:, plan%solution_slot(k))
        end do
        call slot%free()
    end subroutine run

    subroutine fill_slots(system, value)
        type(lane_system), intent(in) :: system
        real(wp), intent(inout) :: value(:, :)
        integer :: k

        associate (sparse => system%sparse)
            do k = 1, size(sparse%row)
                if (sparse%slot(k) > 0) value(:, sparse%slot(k)) = system%matrix(:, sparse%row(k), sparse%column(k))
            end do
            do k = 1, sparse%n
                if (sparse%right_slot(k) > 0) value(:, sparse%right_slot(k)) = system%right(:, k)
            end do
        end associate
    end subroutine fill_slots

    !> Every wanted unknown against the dense solver.
    subroutine compare(error, system, plan, what)
        type(test_error), intent(inout) :: error
        type(lane_system), intent(in) :: system
        type(elimination_plan), intent(in) :: plan
        character(len=*), intent(in) :: what
        real(wp) :: x(lanes, system%sparse%n), alarm(lanes), want(system%sparse%n)
        integer :: l

        call check(error, plan%is_complete, what//": complete")
        if (.not. plan%is_complete) return
        call run(plan, system, x, alarm)
        call check(error, all(alarm <= 1), what//": no alarm")
        do l = 1, lanes, 5       ! a few are enough: the arithmetic is the same on all
            want = dense_solution(system%matrix(l, :, :), system%right(l, :))
            where (.not. system%sparse%is_wanted) want = 0
            call check_close(error, x(l, :), want, rounding(system%sparse%n, alarm(l)) &
                             *condition_number(system%matrix(l, :, :))*maxval(abs(want)), what//", lane "//to_text(l))
        end do
        associate (sparse => system%sparse)
            call check(error, plan%n_nonzero == size(sparse%row), what//": nonzeros counted")
            call check(error, plan%n_fill >= 0 .and. plan%n_fill <= sparse%n**2 - plan%n_nonzero, what//": fill")
            call check(error, plan%n_operation >= 0 .and. plan%n_scale >= 0 .and. plan%n_reciprocal >= 0, what//": counts")
            call check(error, plan%n_term == size(plan%left) .and. plan%n_slot >= maxval([0, sparse%slot]), what//": sizes")
        end associate
    end subroutine compare

    !> Relative error of an elimination, in units of the condition number: an epsilon for each of n steps, times the growth
    !> of the elements. A pivot of a twentieth of its column multiplies by 20; two such in a row are granted, and the alarm
    !> says by how many hundreds the multipliers exceed those. A wrong plan errs by the size of the solution.
    pure real(wp) function rounding(n, alarm)
        integer, intent(in) :: n
        real(wp), intent(in) :: alarm

        rounding = n*20**2*(1 + 100*alarm)*eps
    end function rounding

    subroutine test_random(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(lane_system) :: system
        type(elimination_plan) :: plan
        integer, parameter :: sizes(6) = [1, 5, 6, 12, 30, 60]
        integer :: i, repeat

        do i = 1, size(sizes)
            do repeat = 1, merge(2, 10, sizes(i) > 20)
                call make_system(stream, sizes(i), min(0.5_wp, 2.0_wp/sizes(i)), system)
                call make_plan(system%sparse, plan)
                call compare(error, system, plan, "n = "//to_text(sizes(i)))
            end do
        end do
    end subroutine test_random

    !> A subset of the unknowns has the same numbers and costs no more.
    subroutine test_wanted(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(lane_system) :: system
        type(elimination_plan) :: plan, plan_of_all
        integer :: repeat, k

        do repeat = 1, 5
            call make_system(stream, 20, 0.1_wp, system)
            call make_plan(system%sparse, plan_of_all)
            system%sparse%is_wanted = [(modulo(k, 7) == 3, k=1, 20)]
            call make_plan(system%sparse, plan)
            call compare(error, system, plan, "wanted")
            call check(error, all((plan%solution_slot > 0) .eqv. system%sparse%is_wanted), "these and no others")
            call check(error, plan%n_operation < plan_of_all%n_operation, "with fewer operations")
        end do
    end subroutine test_wanted

    !> Zero by rule: no slot, and fewer operations. All zero: the solution is zero.
    subroutine test_zero_right(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(lane_system) :: system
        type(elimination_plan) :: plan, full
        real(wp) :: x(lanes, 15), alarm(lanes)
        integer :: repeat

        do repeat = 1, 5
            call make_system(stream, 15, 0.15_wp, system)
            call make_plan(system%sparse, full)
            system%sparse%right_slot(:12) = 0
            system%right(:, :12) = 0
            call make_plan(system%sparse, plan)
            call compare(error, system, plan, "zero by rule")
            call check(error, plan%n_term < full%n_term, "with fewer terms")
        end do
        system%sparse%right_slot = 0
        system%right = 0
        call make_plan(system%sparse, plan)
        call run(plan, system, x, alarm)
        call check(error, maxval(abs(x)) <= 0, "nothing right, nothing left")
        call check(error, plan%n_operation == 0, "without any operation")
    end subroutine test_zero_right

    !> A matrix of constants alone: no division is left, and a permutation of +-1 needs no operation at all.
    subroutine test_constants(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(lane_system) :: system
        type(elimination_plan) :: plan
        integer, parameter :: n = 9
        integer :: k, repeat

        do repeat = 1, 5
            call make_system(stream, n, 0.2_wp, system)
            call fix_values(system)
            call make_plan(system%sparse, plan)
            call compare(error, system, plan, "constants")
            call check(error, plan%n_reciprocal == 0, "no division")
        end do

        call make_system(stream, n, 0.0_wp, system)
        system%sparse%slot = 0
        do k = 1, n
            associate (i => system%sparse%row(k), j => system%sparse%column(k))
                system%sparse%value(:, k) = merge(1, -1, modulo(k, 2) == 0)
                system%matrix(:, i, j) = merge(1, -1, modulo(k, 2) == 0)
            end associate
        end do
        call make_plan(system%sparse, plan)
        call compare(error, system, plan, "permutation")
        call check(error, plan%n_operation == 0, "a permutation costs nothing")
    end subroutine test_constants

    !> Saddle point: the planner must step aside from the zero block.
    subroutine test_zero_diagonal(error)
        type(test_error), intent(inout) :: error
        type(lane_system) :: system
        type(random_stream) :: stream
        type(elimination_plan) :: plan
        integer, parameter :: n = 3, row(6) = [1, 1, 2, 2, 3, 3], column(6) = [2, 3, 1, 3, 1, 2]
        integer :: k

        call make_system(stream, n, 0.0_wp, system)
        system%sparse%row = row
        system%sparse%column = column
        system%sparse%slot = [1, 0, 2, 3, 0, 4]
        system%sparse%right_slot = [5, 6, 7]
        deallocate (system%sparse%value)
        allocate (system%sparse%value(n_pose, 6))
        system%matrix = 0
        do k = 1, 6
            system%sparse%value(:, k) = 1
            if (system%sparse%slot(k) > 0) system%sparse%value(:, k) = 2 + 0.3_wp*stream%vector(n_pose)
            system%matrix(:, row(k), column(k)) = 1
            if (system%sparse%slot(k) > 0) system%matrix(:, row(k), column(k)) = 2 + 0.3_wp*stream%vector(lanes)
        end do
        call make_plan(system%sparse, plan)
        call compare(error, system, plan, "zero diagonal")
    end subroutine test_zero_diagonal

    !> Two unknowns whose order the plan has fixed: on one lane the pivot (nearly) vanishes though the matrix is regular.
    subroutine test_alarm(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(lane_system) :: system
        type(elimination_plan) :: plan
        real(wp), parameter :: small(2) = [0.0_wp, 1.0e-9_wp]
        real(wp) :: x(lanes, 2), alarm(lanes), want(2)
        integer :: bad, l, k

        do k = 1, 2
            call make_system(stream, 2, 0.0_wp, system)
            system%sparse%row = [1, 2, 1, 2]
            system%sparse%column = [1, 1, 2, 2]
            system%sparse%slot = [1, 2, 3, 4]
            system%sparse%right_slot = [5, 6]
            system%sparse%value = spread([3.0_wp, 1.0_wp, 1.0_wp, 4.0_wp], 1, n_pose)
            do l = 1, lanes
                system%matrix(l, :, :) = reshape([3.0_wp, 1.0_wp, 1.0_wp, 4.0_wp], [2, 2]) &
                                         + 0.1_wp*reshape(stream%vector(4), [2, 2])
            end do
            bad = max(1, lanes - 1)
            system%matrix(bad, 1, 1) = small(k)
            system%matrix(bad, 2, 2) = small(k)
            call make_plan(system%sparse, plan)
            call run(plan, system, x, alarm)
            call check(error, .not. alarm(bad) <= 1, "alarm on the bad lane")
            call check(error, count(alarm <= 1) == lanes - 1, "and on no other")
            do l = 1, lanes
                if (l == bad) cycle
                want = dense_solution(system%matrix(l, :, :), system%right(l, :))
                call check_close(error, x(l, :), want, 100*eps*maxval(abs(want)), "neighbours")
            end do
        end do
    end subroutine test_alarm

    !> A lane that is not a number says so: by the alarm or by its solution; its neighbours keep every bit.
    subroutine test_nan(error)
        use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_is_nan
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(lane_system) :: system
        type(elimination_plan) :: plan
        real(wp) :: good(lanes, 12), x(lanes, 12), alarm(lanes)
        integer :: l

        call make_system(stream, 12, 0.2_wp, system)
        call make_plan(system%sparse, plan)
        call run(plan, system, good, alarm)
        system%right(lanes, :) = ieee_value(1.0_wp, ieee_quiet_nan)
        call run(plan, system, x, alarm)
        call check(error, any(ieee_is_nan(x(lanes, :))), "no numbers")
        do l = 1, lanes - 1
            call check_close(error, x(l, :), good(l, :), 0.0_wp, "neighbours")
        end do
    end subroutine test_nan

    subroutine test_singular(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(lane_system) :: system
        type(elimination_plan) :: plan
        integer, parameter :: n = 8
        integer :: n_entry

        ! An empty column.
        call make_system(stream, n, 0.3_wp, system)
        n_entry = count(system%sparse%column /= 3)
        call keep(system%sparse%column /= 3)
        call make_plan(system%sparse, plan)
        call check(error, .not. plan%is_complete, "empty column")

        ! Two columns that meet one row only: no column is empty, but two unknowns share an equation.
        call make_system(stream, n, 0.3_wp, system)
        n_entry = count(system%sparse%column > 2 .or. system%sparse%row == 1)
        call keep(system%sparse%column > 2 .or. system%sparse%row == 1)
        call make_plan(system%sparse, plan)
        call check(error, .not. plan%is_complete, "two unknowns in one equation")

    contains

        subroutine keep(mask)
            logical, intent(in) :: mask(:)
            real(wp), allocatable :: value(:, :)
            integer :: k

            allocate (value(n_pose, n_entry))
            do k = 1, n_pose
                value(k, :) = pack(system%sparse%value(k, :), mask)
            end do
            call move_alloc(value, system%sparse%value)
            system%sparse%slot = pack(system%sparse%slot, mask)
            system%sparse%row = pack(system%sparse%row, mask)
            system%sparse%column = pack(system%sparse%column, mask)
        end subroutine keep
    end subroutine test_singular

    !> Regular by pattern, but one column is the sum of two others whatever the values: what is left of a pivot is
    !> rounding, and to divide by it would pass for a solution.
    subroutine test_dependent(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(lane_system) :: system
        type(elimination_plan) :: plan
        integer, parameter :: n = 5
        real(wp) :: x(lanes, n), alarm(lanes), value(n_pose, n, n)
        integer :: i, j, k

        call make_system(stream, n, 0.0_wp, system)
        system%sparse%row = [((i, i=1, n), j=1, n)]
        system%sparse%column = [((j, i=1, n), j=1, n)]
        system%sparse%slot = [(k, k=1, n*n)]
        system%sparse%right_slot = [(n*n + k, k=1, n)]
        value = reshape(stream%vector(size(value)), shape(value))
        value(:, :, 2) = value(:, :, 1) + value(:, :, 4)
        deallocate (system%sparse%value)
        allocate (system%sparse%value(n_pose, n*n))
        system%sparse%value = reshape(value, [n_pose, n*n])
        system%matrix = reshape(stream%vector(size(system%matrix)), shape(system%matrix))
        system%matrix(:, :, 2) = system%matrix(:, :, 1) + system%matrix(:, :, 4)
        call make_plan(system%sparse, plan)
        if (.not. plan%is_complete) return
        call run(plan, system, x, alarm)
        call check(error, .not. any(alarm <= 1), "no plan, or an alarm on every lane")
    end subroutine test_dependent
end module test_elimination_plan
