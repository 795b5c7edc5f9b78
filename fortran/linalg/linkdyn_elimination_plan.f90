!> Elimination planned once, executed many times.
!>
!> The matrix of a mechanism is sparse and its pattern never changes. So the pivots are chosen once, on representative
!> values (fewest operations among those large enough in their column), and every operation that the elimination and
!> the back-substitution would do is recorded as
!>     out = (base - sum of products + sum of products) * scale     or     out = 1/in
!> over numbered values ("slots"). Constants are folded, products with one become sums, and what no wanted unknown
!> depends on is dropped. Where no entry is large enough everywhere, two rows are turned into each other first.
!> `linkdyn_elimination_run` executes the record on lanes.
!>
!> **Source**: Markowitz, Management Science 3 (1957) 255, for the pivot choice; Duff, Erisman, Reid, Direct Methods for
!> Sparse Matrices, 2nd ed. (2017), ch. 5 and 7, for the threshold.
module linkdyn_elimination_plan
    use linkdyn_kinds, only: wp
    use linkdyn_linear_record, only: linear_record
    implicit none (type, external)
    private
    public :: elimination_plan, sparse_system, make_plan, make_factor_plan

    !> The system to be planned.
    type :: sparse_system
        integer :: n = 0                            !! unknowns
        integer, allocatable :: row(:), column(:)   !! of the nonzeros
        integer, allocatable :: slot(:)             !! where a varying value stands; 0: constant
        real(wp), allocatable :: value(:, :)        !! at the representative poses (pose, nonzero)
        integer, allocatable :: right_slot(:)       !! right-hand side (n); 0: zero
        logical, allocatable :: is_wanted(:)        !! unknowns to solve for (n)
    end type sparse_system

    !> The record. Operation t is a reciprocal if `last_minus(t)` is negative.
    type :: elimination_plan
        integer :: n_operation = 0
        integer :: n_slot = 0                       !! all slots: given, constants, results
        integer, allocatable :: base(:), out(:)     !! slots (n_operation)
        integer, allocatable :: scale(:)            !! slot of a final factor; 0: none
        integer, allocatable :: last_minus(:)       !! end of the terms subtracted; -1: reciprocal of base
        integer, allocatable :: last_plus(:)        !! end of the terms added; the next operation's start after it
        integer, allocatable :: left(:), right(:)   !! factors of the terms: slots
        real(wp), allocatable :: alarm(:)           !! 1/limit on the magnitude of the result; 0: not watched
        integer, allocatable :: constant_slot(:)
        real(wp), allocatable :: constant(:)
        integer, allocatable :: solution_slot(:)    !! (n); 0: not wanted
        real(wp), allocatable :: solution_sign(:)   !! the unknown is sign*slot (n)
        ! ---- figures for reports
        integer :: n_nonzero = 0, n_fill = 0
        integer :: n_term = 0, n_scale = 0, n_reciprocal = 0
        logical :: is_complete = .false.            !! false: no acceptable pivot at the representative poses
    end type elimination_plan

    real(wp), parameter :: threshold = 0.05_wp      !! a pivot is at least this fraction of its column, rows scaled
    real(wp), parameter :: threshold_of_pair = 0.3_wp   !! two entries together: their squares are compared later
    real(wp), parameter :: smallest = 1.0e5_wp*epsilon(1.0_wp)  !! a pivot below this, rows scaled, may be pure rounding
    real(wp), parameter :: alarm_factor = 1.0e2_wp  !! multipliers may exceed those at the representative poses by this
    ! Large systems are looked at in a few short columns at a time (Zlatev, SIAM J. Numer. Anal. 17 (1980) 18).
    integer, parameter :: large = 400, most_columns = 6
    integer, parameter :: reciprocal_cost = 8       !! of a division, in multiply-adds

    !> A value known to the planner: a constant, or the result of an operation, or given. References are signed:
    !> -k is the negative of value k.
    type :: node_type
        logical :: is_constant = .false.
        real(wp) :: constant = 0
        integer :: given_slot = 0
        integer :: last_use = 0
        integer :: slot = 0
        real(wp) :: largest = 0                     !! magnitude at the representative poses
    end type node_type

    !> A matrix entry under elimination: base minus the terms collected so far.
    type :: entry_type
        integer :: row = 0, column = 0
        integer :: base = 0                         !! reference; 0: zero (fill)
        integer :: first_term = 0                   !! list of terms
        logical :: is_constant = .true.
        logical :: is_active = .true.
        real(wp), allocatable :: value(:)           !! at the representative poses
    end type entry_type

    !> How many entries of a row or column are active, and how many of these are constant.
    type :: active_count
        integer :: n = 0, n_constant = 0
    end type active_count

    !> A recorded operation before slots are given out.
    type :: operation_type
        integer :: out = 0, base = 0, scale = 0     !! nodes; base 0: zero
        logical :: is_reciprocal = .false., is_watched = .false.
        integer :: n_minus = 0, n_plus = 0
        integer, allocatable :: left(:), right(:)   !! nodes; minus terms first
        logical :: is_needed = .false.
    end type operation_type

    !> A pivot, remembered for the back-substitution.
    type :: pivot_type
        integer :: column = 0, right = 0, inverse = 0   !! references; inverse 0: the row is scaled already
        integer, allocatable :: other(:), factor(:)     !! columns and references of the rest of the row
    end type pivot_type

    !> List of entry numbers, growing.
    type :: list_type
        integer :: n = 0
        integer, allocatable :: item(:)
    end type list_type

    type :: planner_type
        integer :: n = 0, n_pose = 0
        integer :: n_node = 0, n_entry = 0, n_operation = 0, n_term = 0, n_fill = 0
        integer :: one = 0                          !! node of the constant 1
        type(list_type) :: constants                !! nodes of constants
        type(node_type), allocatable :: node(:)
        type(entry_type), allocatable :: entry(:)
        type(operation_type), allocatable :: operation(:)
        integer, allocatable :: term_left(:), term_right(:), term_next(:)
        type(list_type), allocatable :: in_row(:), in_column(:)    !! entries, active and not
        integer, allocatable :: row_count(:), column_count(:)      !! active entries
        integer, allocatable :: right(:)                           !! entry of each row's right-hand side
        logical, allocatable :: row_active(:), column_active(:)
        real(wp), allocatable :: row_scale(:)
        type(pivot_type), allocatable :: pivot(:)
    end type planner_type

contains

    !> Choose the pivots and record the operations.
    !>
    !> Where not all unknowns are wanted there are two ways: to leave the wanted ones for last, which drops the most of
    !> the back-substitution, or to go by cost alone. The cheaper plan is taken.
    subroutine make_plan(system, plan)
        type(sparse_system), intent(in) :: system
        type(elimination_plan), intent(out) :: plan
        type(elimination_plan) :: other

        call plan_in_order(system, system%is_wanted, plan)
        if (all(system%is_wanted)) return
        call plan_in_order(system, spread(.false., 1, system%n), other)
        if (.not. other%is_complete) return
        if (plan%is_complete .and. cost_of(plan) <= cost_of(other)) return
        plan = other
    end subroutine make_plan

    !> Operations of a plan, divisions weighted.
    pure integer function cost_of(plan)
        type(elimination_plan), intent(in) :: plan

        cost_of = plan%n_term + plan%n_scale + reciprocal_cost*plan%n_reciprocal
    end function cost_of

    !> A plan that leaves some unknowns for last.
    subroutine plan_in_order(system, comes_last, plan)
        type(sparse_system), intent(in) :: system
        logical, intent(in) :: comes_last(:)
        type(elimination_plan), intent(out) :: plan
        type(planner_type) :: p
        integer, allocatable :: solution(:)
        integer :: k

        call start(system, p)
        call eliminate_all(p, comes_last, solution)
        if (.not. allocated(solution)) return
        where (.not. system%is_wanted) solution = 0
        call keep_needed(p, pack(solution, solution /= 0))
        call emit(system, p, plan)
        plan%solution_slot = [(merge(p%node(max(1, abs(solution(k))))%slot, 0, solution(k) /= 0), k=1, p%n)]
        plan%solution_sign = merge(sign(1, solution), 0, solution /= 0)
    end subroutine plan_in_order

    !> A plan that serves any right-hand sides: it leaves pivots and multipliers behind, and `solve` says how a
    !> right-hand side becomes the unknowns, all of them, by these. Right-hand sides of the system are not looked at.
    !>
    !> Whatever depends on a right-hand side is linear in it: such operations go to `solve`, the others to the plan.
    subroutine make_factor_plan(system, plan, solve)
        type(sparse_system), intent(in) :: system
        type(elimination_plan), intent(out) :: plan
        type(linear_record), intent(out) :: solve
        type(sparse_system) :: general
        type(planner_type) :: p
        type(list_type) :: kept
        integer, allocatable :: solution(:), value(:)
        integer :: t, k

        general = system
        general%right_slot = [(k, k=1, system%n)]        ! any: they take no slots in the end
        call start(general, p)
        allocate (value(size(p%node)))
        value = 0
        do k = 1, p%n
            value(p%entry(p%right(k))%base) = k
        end do
        call eliminate_all(p, spread(.false., 1, p%n), solution)
        if (.not. allocated(solution)) return

        value = [value, spread(0, 1, p%n_node)]
        solve%n = p%n
        call append(kept, p%one)
        do t = 1, p%n_operation
            associate (operation => p%operation(t))
                if (.not. is_linear()) cycle
                solve%n_step = solve%n_step + 1
                value(operation%out) = p%n + solve%n_step
                call append(kept, operation%scale)
                do k = 1, size(operation%left)
                    call append(kept, merge(operation%right(k), operation%left(k), value(operation%left(k)) > 0))
                end do
            end associate
        end do
        general%right_slot = 0
        call keep_needed(p, pack(kept%item(:kept%n), kept%item(:kept%n) > 0))
        call emit(general, p, plan)
        call write_record()

    contains

        pure logical function is_linear()
            is_linear = any(value(p%operation(t)%left) > 0) .or. any(value(p%operation(t)%right) > 0)
            if (p%operation(t)%base > 0) is_linear = is_linear .or. value(p%operation(t)%base) > 0
        end function is_linear

        subroutine write_record()
            integer :: step, n_term, k

            associate (m => solve%n_step)
                allocate (solve%base(m), solve%scale(m), solve%last_minus(m), solve%last_plus(m))
            end associate
            allocate (solve%coefficient(kept%n), solve%value(kept%n))
            solve%one = p%node(p%one)%slot
            n_term = 0
            do t = 1, p%n_operation
                associate (operation => p%operation(t))
                    if (value(operation%out) == 0) cycle
                    step = value(operation%out) - p%n
                    solve%base(step) = p%n + solve%n_step + 1
                    if (operation%base > 0) solve%base(step) = value(operation%base)
                    solve%scale(step) = 0
                    if (operation%scale > 0) solve%scale(step) = p%node(operation%scale)%slot
                    solve%last_minus(step) = n_term + operation%n_minus
                    do k = 1, size(operation%left)
                        n_term = n_term + 1
                        solve%value(n_term) = max(value(operation%left(k)), value(operation%right(k)))
                        solve%coefficient(n_term) = &
                            p%node(merge(operation%right(k), operation%left(k), value(operation%left(k)) > 0))%slot
                    end do
                    solve%last_plus(step) = n_term
                end associate
            end do
            solve%coefficient = solve%coefficient(:n_term)
            solve%value = solve%value(:n_term)
            solve%solution = value(abs(solution))
            solve%sign = sign(1, solution)
        end subroutine write_record
    end subroutine make_factor_plan

    !> All pivots, then the back-substitution: references of the unknowns, or nothing where no pivot is acceptable.
    subroutine eliminate_all(p, comes_last, solution)
        type(planner_type), intent(inout) :: p
        logical, intent(in) :: comes_last(:)
        integer, allocatable, intent(out) :: solution(:)
        logical :: has_turned
        integer :: k, e

        do k = 1, p%n
            e = best_pivot(p, comes_last)
            if (e == 0) then
                call turn_rows(p, has_turned)
                if (has_turned) e = best_pivot(p, comes_last)
            end if
            if (e == 0) return
            call eliminate(p, e, p%pivot(k))
        end do
        call back_substitute(p, solution)
    end subroutine eliminate_all

    ! ---------------------------------------------------------------- set-up

    subroutine start(system, p)
        type(sparse_system), intent(in) :: system
        type(planner_type), intent(out) :: p
        integer :: k, e, n_nonzero

        p%n = system%n
        p%n_pose = size(system%value, 1)
        n_nonzero = size(system%row)
        allocate (p%node(4*n_nonzero + 64), p%entry(4*n_nonzero + 2*p%n + 64), p%operation(4*n_nonzero + 64))
        allocate (p%term_left(8*n_nonzero + 64), p%term_right(8*n_nonzero + 64), p%term_next(8*n_nonzero + 64))
        allocate (p%in_row(p%n), p%in_column(p%n), p%row_count(p%n), p%column_count(p%n), p%right(p%n), p%pivot(p%n))
        allocate (p%row_active(p%n), p%column_active(p%n), p%row_scale(p%n))
        p%row_count = 0
        p%column_count = 0
        p%row_active = .true.
        p%column_active = .true.
        p%one = constant_node(p, 1.0_wp)
        do k = 1, n_nonzero
            e = new_entry(p, system%row(k), system%column(k))
            p%entry(e)%value = system%value(:, k)
            if (system%slot(k) == 0) then
                p%entry(e)%base = constant_node(p, system%value(1, k))
            else
                p%entry(e)%base = given_node(p, system%slot(k), maxval(abs(system%value(:, k))))
                p%entry(e)%is_constant = .false.
            end if
        end do
        p%n_fill = 0
        p%row_scale = 0
        do e = 1, p%n_entry
            associate (scale => p%row_scale(p%entry(e)%row))
                scale = max(scale, maxval(abs(p%entry(e)%value)))
            end associate
        end do
        where (p%row_scale > 0)
            p%row_scale = 1/p%row_scale
        elsewhere
            p%row_scale = 1
        end where
        do k = 1, p%n
            p%n_entry = p%n_entry + 1
            if (p%n_entry > size(p%entry)) call grow_entries(p)
            p%right(k) = p%n_entry
            p%entry(p%n_entry) = entry_type(row=k)
            allocate (p%entry(p%n_entry)%value(0))
            if (system%right_slot(k) == 0) cycle
            p%entry(p%n_entry)%base = given_node(p, system%right_slot(k), 0.0_wp)
            p%entry(p%n_entry)%is_constant = .false.
        end do
    end subroutine start

    integer function constant_node(p, value) result(k)
        type(planner_type), intent(inout) :: p
        real(wp), intent(in) :: value
        integer :: i

        do i = 1, p%constants%n
            k = p%constants%item(i)
            if (p%node(k)%constant == value) return
        end do
        k = new_node(p)
        call append(p%constants, k)
        p%node(k)%is_constant = .true.
        p%node(k)%constant = value
        p%node(k)%largest = abs(value)
    end function constant_node

    integer function given_node(p, slot, largest) result(k)
        type(planner_type), intent(inout) :: p
        integer, intent(in) :: slot
        real(wp), intent(in) :: largest

        k = new_node(p)
        p%node(k)%given_slot = slot
        p%node(k)%largest = largest
    end function given_node

    integer function new_node(p) result(k)
        type(planner_type), intent(inout) :: p
        type(node_type), allocatable :: bigger(:)

        p%n_node = p%n_node + 1
        if (p%n_node > size(p%node)) then
            allocate (bigger(2*p%n_node))
            bigger(:p%n_node - 1) = p%node
            call move_alloc(bigger, p%node)
        end if
        k = p%n_node
        p%node(k) = node_type()
    end function new_node

    integer function new_entry(p, row, column) result(e)
        type(planner_type), intent(inout) :: p
        integer, intent(in) :: row, column

        p%n_entry = p%n_entry + 1
        if (p%n_entry > size(p%entry)) call grow_entries(p)
        e = p%n_entry
        p%entry(e) = entry_type(row=row, column=column)
        allocate (p%entry(e)%value(p%n_pose))
        p%entry(e)%value = 0
        call append(p%in_row(row), e)
        call append(p%in_column(column), e)
        p%row_count(row) = p%row_count(row) + 1
        p%column_count(column) = p%column_count(column) + 1
        p%n_fill = p%n_fill + 1
    end function new_entry

    subroutine grow_entries(p)
        type(planner_type), intent(inout) :: p
        type(entry_type), allocatable :: bigger(:)

        allocate (bigger(2*size(p%entry)))
        bigger(:size(p%entry)) = p%entry
        call move_alloc(bigger, p%entry)
    end subroutine grow_entries

    subroutine append(list, item)
        type(list_type), intent(inout) :: list
        integer, intent(in) :: item
        integer, allocatable :: bigger(:)

        if (.not. allocated(list%item)) allocate (list%item(8))
        if (list%n == size(list%item)) then
            allocate (bigger(2*list%n))
            bigger(:list%n) = list%item
            call move_alloc(bigger, list%item)
        end if
        list%n = list%n + 1
        list%item(list%n) = item
    end subroutine append

    ! ---------------------------------------------------------------- pivots

    !> The cheapest acceptable pivot; unknowns that come last wait, so that the others' back-substitution can be dropped.
    integer function best_pivot(p, comes_last) result(best)
        type(planner_type), intent(in) :: p
        logical, intent(in) :: comes_last(:)
        logical :: restrict
        logical :: is_measured
        type(active_count) :: in_column
        integer :: pass, c, k, e, cost, best_cost, fewest, n_looked
        real(wp) :: quality, best_quality, largest(p%n_pose)

        best = 0
        do pass = 1, 2
            restrict = pass == 1 .and. any(p%column_active .and. .not. comes_last)
            best_cost = huge(1)
            best_quality = 0
            fewest = minval(p%column_count, mask=p%column_active)
            n_looked = 0
            do c = 1, p%n
                if (.not. p%column_active(c)) cycle
                if (restrict .and. comes_last(c)) cycle
                if (p%n > large) then
                    if (p%column_count(c) > fewest + 2) cycle
                    if (n_looked >= most_columns .and. best > 0) exit
                    n_looked = n_looked + 1
                end if
                in_column = count_active(p, p%in_column(c))
                is_measured = .false.
                do k = 1, p%in_column(c)%n
                    e = p%in_column(c)%item(k)
                    if (.not. p%entry(e)%is_active) cycle
                    cost = pivot_cost(p, e, in_column)
                    if (cost > best_cost) cycle
                    if (.not. is_measured) largest = largest_in_column(p, c)
                    is_measured = .true.
                    quality = pivot_quality(p, e, largest)
                    if (quality < threshold) cycle
                    if (cost == best_cost .and. quality <= best_quality) cycle
                    best = e
                    best_cost = cost
                    best_quality = quality
                end do
            end do
            if (best > 0 .or. .not. restrict) return
        end do
    end function best_pivot

    !> Operations that eliminating with this pivot takes.
    pure integer function pivot_cost(p, e, in_column)
        type(planner_type), intent(in) :: p
        integer, intent(in) :: e
        type(active_count), intent(in) :: in_column        !! its own
        type(active_count) :: left, upper

        left = others(in_column)
        upper = others(count_active(p, p%in_row(p%entry(e)%row)))
        upper%n = upper%n + 1    ! the right-hand side
        ! The last upper%n: the row takes part in the back-substitution.
        if (p%entry(e)%is_constant) then
            pivot_cost = left%n*upper%n - left%n_constant*upper%n_constant + upper%n
        else
            pivot_cost = left%n*upper%n + min(left%n, upper%n) + reciprocal_cost + upper%n
        end if

    contains

        !> Without the pivot.
        pure type(active_count) function others(all)
            type(active_count), intent(in) :: all

            others = active_count(all%n - 1, all%n_constant - merge(1, 0, p%entry(e)%is_constant))
        end function others
    end function pivot_cost

    pure type(active_count) function count_active(p, list) result(found)
        type(planner_type), intent(in) :: p
        type(list_type), intent(in) :: list                !! of a row or column
        integer :: k

        do k = 1, list%n
            associate (entry => p%entry(list%item(k)))
                if (.not. entry%is_active) cycle
                found%n = found%n + 1
                if (entry%is_constant) found%n_constant = found%n_constant + 1
            end associate
        end do
    end function count_active

    !> Largest active entry of a column at each of the representative poses.
    pure function largest_in_column(p, c) result(largest)
        type(planner_type), intent(in) :: p
        integer, intent(in) :: c
        real(wp) :: largest(p%n_pose)
        integer :: k

        largest = 0
        do k = 1, p%in_column(c)%n
            associate (entry => p%entry(p%in_column(c)%item(k)))
                if (entry%is_active) largest = max(largest, p%row_scale(entry%row)*abs(entry%value))
            end associate
        end do
    end function largest_in_column

    !> Smallest ratio, over the representative poses, of the pivot to the largest entry of its column.
    pure real(wp) function pivot_quality(p, e, largest)
        type(planner_type), intent(in) :: p
        integer, intent(in) :: e
        real(wp), intent(in) :: largest(:)                 !! (pose)

        pivot_quality = 0
        associate (scale => p%row_scale(p%entry(e)%row), value => p%entry(e)%value)
            if (any(scale*abs(value) <= smallest)) return
            pivot_quality = minval(scale*abs(value)/largest)
        end associate
    end function pivot_quality

    ! ---------------------------------------------------------------- turned rows

    !> Where every entry of a column vanishes at some pose, turn two rows into each other, so that one of them takes all
    !> that both have in the column: with a and b there, the rows become
    !>     a row1 + b row2        a row2 - b row1
    !> A link that turns all the way round against the axes of its joint leaves such blocks of sines and cosines.
    subroutine turn_rows(p, has_turned)
        type(planner_type), intent(inout) :: p
        logical, intent(out) :: has_turned
        integer :: e1, e2, a, b, e, k, row(2), column
        integer, allocatable :: others(:)

        call best_pair(p, e1, e2)
        has_turned = e1 > 0
        if (.not. has_turned) return
        column = p%entry(e1)%column
        row = [p%entry(e1)%row, p%entry(e2)%row]
        a = settle(p, e1, 0, .false.)
        b = settle(p, e2, 0, .false.)
        others = [active_others(p, p%in_row(row(1)), e1), active_others(p, p%in_row(row(2)), e2)]
        others = p%entry(others)%column
        do k = 1, size(others)
            if (any(others(:k - 1) == others(k))) cycle
            call turn_entries(entry_at(row(1), others(k)), entry_at(row(2), others(k)))
        end do
        call turn_right(p%right(row(1)), p%right(row(2)))
        call start_again(e1)
        call add_term(p, e1, -a, a)
        call add_term(p, e1, -b, b)
        p%entry(e1)%value = p%entry(e1)%value**2 + p%entry(e2)%value**2
        p%entry(e2)%is_active = .false.
        p%row_count(row(2)) = p%row_count(row(2)) - 1
        p%column_count(column) = p%column_count(column) - 1
        call scale_again(row(1))
        call scale_again(row(2))

    contains

        !> An active entry, made if need be.
        integer function entry_at(i, j)
            integer, intent(in) :: i, j

            entry_at = find_entry(p, i, j)
            if (entry_at == 0) entry_at = new_entry(p, i, j)
        end function entry_at

        subroutine turn_entries(first, second)
            integer, intent(in) :: first, second
            real(wp) :: x(p%n_pose), y(p%n_pose)

            x = p%entry(first)%value
            y = p%entry(second)%value
            call turn_right(first, second)
            p%entry(first)%value = p%entry(e1)%value*x + p%entry(e2)%value*y
            p%entry(second)%value = p%entry(e1)%value*y - p%entry(e2)%value*x
        end subroutine turn_entries

        !> The operations alone: a right-hand side has no values here.
        subroutine turn_right(first, second)
            integer, intent(in) :: first, second
            integer :: x, y

            x = settle(p, first, 0, .false.)
            y = settle(p, second, 0, .false.)
            call start_again(first)
            call add_term(p, first, -a, x)
            call add_term(p, first, -b, y)
            call start_again(second)
            call add_term(p, second, -a, y)
            call add_term(p, second, b, x)
        end subroutine turn_right

        subroutine start_again(entry)
            integer, intent(in) :: entry

            p%entry(entry)%base = 0
            p%entry(entry)%first_term = 0
            p%entry(entry)%is_constant = .true.
        end subroutine start_again

        subroutine scale_again(i)
            integer, intent(in) :: i
            real(wp) :: largest
            integer :: m

            largest = 0
            do m = 1, p%in_row(i)%n
                e = p%in_row(i)%item(m)
                if (p%entry(e)%is_active) largest = max(largest, maxval(abs(p%entry(e)%value)))
            end do
            if (largest > 0) p%row_scale(i) = 1/largest
        end subroutine scale_again
    end subroutine turn_rows

    !> Two entries of a column which together are large at every pose; the pair whose rows are shortest. Zero if none.
    pure subroutine best_pair(p, best1, best2)
        type(planner_type), intent(in) :: p
        integer, intent(out) :: best1, best2
        real(wp), parameter :: alike = 16           !! rows of a pair: so far may their scales lie apart
        real(wp) :: largest(p%n_pose), ratio
        integer :: c, i, j, e1, e2, cost, best_cost

        best1 = 0
        best2 = 0
        best_cost = huge(1)
        do c = 1, p%n
            if (.not. p%column_active(c)) cycle
            associate (list => p%in_column(c))
                largest = 0
                do i = 1, list%n
                    if (p%entry(list%item(i))%is_active) largest = max(largest, scaled(list%item(i)))
                end do
                do i = 1, list%n
                    e1 = list%item(i)
                    if (.not. p%entry(e1)%is_active) cycle
                    do j = i + 1, list%n
                        e2 = list%item(j)
                        if (.not. p%entry(e2)%is_active) cycle
                        cost = p%row_count(p%entry(e1)%row) + p%row_count(p%entry(e2)%row)
                        ratio = p%row_scale(p%entry(e1)%row)/p%row_scale(p%entry(e2)%row)
                        if (cost >= best_cost .or. max(ratio, 1/ratio) > alike) cycle
                        if (any(hypot(scaled(e1), scaled(e2)) <= smallest)) cycle
                        if (any(hypot(scaled(e1), scaled(e2)) < threshold_of_pair*largest)) cycle
                        best1 = e1
                        best2 = e2
                        best_cost = cost
                    end do
                end do
            end associate
        end do

    contains

        pure function scaled(e)
            integer, intent(in) :: e
            real(wp) :: scaled(p%n_pose)

            scaled = p%row_scale(p%entry(e)%row)*abs(p%entry(e)%value)
        end function scaled
    end subroutine best_pair

    ! ---------------------------------------------------------------- elimination

    !> Eliminate with pivot entry e: record what it takes, update the rest.
    subroutine eliminate(p, e, pivot)
        type(planner_type), intent(inout) :: p
        integer, intent(in) :: e
        type(pivot_type), intent(out) :: pivot
        integer, allocatable :: left(:), upper(:), left_ref(:), upper_ref(:)
        integer :: row, column, head, inverse, right, i, j
        real(wp) :: inverse_value, pivot_value(p%n_pose), largest
        logical :: fixed_pivot, scale_row

        row = p%entry(e)%row
        column = p%entry(e)%column
        left = active_others(p, p%in_column(column), e)
        upper = active_others(p, p%in_row(row), e)
        pivot_value = p%entry(e)%value
        head = settle(p, e, 0, .false.)
        fixed_pivot = is_fixed(p, head)
        if (fixed_pivot) then
            inverse_value = 1/fixed_value(p, head)
            inverse = 0
            scale_row = .false.
        else
            inverse = reciprocal(p, head, maxval(abs(1/pivot_value)))
            scale_row = size(upper) + 1 <= size(left)
        end if

        allocate (left_ref(size(left)), upper_ref(size(upper)))
        do i = 1, size(left)
            if (fixed_pivot) then
                left_ref(i) = scaled_by_constant(p, settle(p, left(i), 0, .false.), inverse_value)
            else if (scale_row) then
                left_ref(i) = settle(p, left(i), 0, .false.)
            else
                ! A multiplier that happens to vanish at the representative poses may grow to one, rows scaled.
                largest = max(maxval(abs(p%entry(left(i))%value/pivot_value)), &
                              p%row_scale(row)/p%row_scale(p%entry(left(i))%row))
                left_ref(i) = settle(p, left(i), inverse, .true., largest)
            end if
        end do
        largest = 0
        do j = 1, size(upper)
            largest = max(largest, maxval(abs(p%entry(upper(j))%value/pivot_value)))
        end do
        do j = 1, size(upper)
            if (scale_row) then
                upper_ref(j) = settle(p, upper(j), inverse, .true., largest)
            else
                upper_ref(j) = settle(p, upper(j), 0, .false.)
            end if
        end do
        right = settle(p, p%right(row), merge(inverse, 0, scale_row), .false.)

        do i = 1, size(left)
            do j = 1, size(upper)
                call update(p, left(i), upper(j), left_ref(i), upper_ref(j), pivot_value)
            end do
            call add_term(p, p%right(p%entry(left(i))%row), left_ref(i), right)
        end do

        pivot%column = column
        pivot%right = right
        if (fixed_pivot) then
            inverse = constant_node(p, inverse_value)
        else if (scale_row) then
            inverse = 0
        end if
        pivot%inverse = inverse
        pivot%other = p%entry(upper)%column
        pivot%factor = upper_ref
        call retire(p, row, column)
    end subroutine eliminate

    function active_others(p, list, e) result(others)
        type(planner_type), intent(in) :: p
        type(list_type), intent(in) :: list
        integer, intent(in) :: e
        integer, allocatable :: others(:)
        integer :: k

        others = pack(list%item(:list%n), [(p%entry(list%item(k))%is_active .and. list%item(k) /= e, k=1, list%n)])
    end function active_others

    !> Take the pivot's row and column out of play.
    subroutine retire(p, row, column)
        type(planner_type), intent(inout) :: p
        integer, intent(in) :: row, column
        integer :: k, e

        do k = 1, p%in_row(row)%n
            e = p%in_row(row)%item(k)
            if (.not. p%entry(e)%is_active) cycle
            p%entry(e)%is_active = .false.
            p%column_count(p%entry(e)%column) = p%column_count(p%entry(e)%column) - 1
        end do
        do k = 1, p%in_column(column)%n
            e = p%in_column(column)%item(k)
            if (.not. p%entry(e)%is_active) cycle
            p%entry(e)%is_active = .false.
            p%row_count(p%entry(e)%row) = p%row_count(p%entry(e)%row) - 1
        end do
        p%row_active(row) = .false.
        p%column_active(column) = .false.
    end subroutine retire

    !> a(i, j) loses left(i)*upper(j).
    subroutine update(p, left, upper, left_ref, upper_ref, pivot_value)
        type(planner_type), intent(inout) :: p
        integer, intent(in) :: left, upper, left_ref, upper_ref
        real(wp), intent(in) :: pivot_value(:)
        integer :: e

        e = find_entry(p, p%entry(left)%row, p%entry(upper)%column)
        if (e == 0) e = new_entry(p, p%entry(left)%row, p%entry(upper)%column)
        p%entry(e)%value = p%entry(e)%value - p%entry(left)%value*p%entry(upper)%value/pivot_value
        call add_term(p, e, left_ref, upper_ref)
    end subroutine update

    pure integer function find_entry(p, row, column) result(e)
        type(planner_type), intent(in) :: p
        integer, intent(in) :: row, column
        integer :: k

        do k = 1, p%in_row(row)%n
            e = p%in_row(row)%item(k)
            if (p%entry(e)%is_active .and. p%entry(e)%column == column) return
        end do
        e = 0
    end function find_entry

    !> Remember that an entry loses the product of two references.
    subroutine add_term(p, e, left, right)
        type(planner_type), intent(inout) :: p
        integer, intent(in) :: e, left, right
        integer, allocatable :: bigger(:)

        if (is_zero(p, left) .or. is_zero(p, right)) return
        if (p%n_term == size(p%term_left)) then
            allocate (bigger(2*p%n_term))
            bigger(:p%n_term) = p%term_left
            call move_alloc(bigger, p%term_left)
            allocate (bigger(2*p%n_term))
            bigger(:p%n_term) = p%term_right
            call move_alloc(bigger, p%term_right)
            allocate (bigger(2*p%n_term))
            bigger(:p%n_term) = p%term_next
            call move_alloc(bigger, p%term_next)
        end if
        p%n_term = p%n_term + 1
        p%term_left(p%n_term) = left
        p%term_right(p%n_term) = right
        p%term_next(p%n_term) = p%entry(e)%first_term
        p%entry(e)%first_term = p%n_term
        if (.not. (is_fixed(p, left) .and. is_fixed(p, right))) p%entry(e)%is_constant = .false.
    end subroutine add_term

    pure logical function is_fixed(p, ref)
        type(planner_type), intent(in) :: p
        integer, intent(in) :: ref

        is_fixed = ref == 0
        if (ref /= 0) is_fixed = p%node(abs(ref))%is_constant
    end function is_fixed

    pure logical function is_zero(p, ref)
        type(planner_type), intent(in) :: p
        integer, intent(in) :: ref

        is_zero = is_fixed(p, ref)
        if (is_zero) is_zero = fixed_value(p, ref) == 0
    end function is_zero

    pure real(wp) function fixed_value(p, ref)
        type(planner_type), intent(in) :: p
        integer, intent(in) :: ref

        fixed_value = 0
        if (ref /= 0) fixed_value = sign(1, ref)*p%node(abs(ref))%constant
    end function fixed_value

    !> A reference times a constant; +-1 costs nothing.
    integer function scaled_by_constant(p, ref, factor) result(scaled)
        type(planner_type), intent(inout) :: p
        integer, intent(in) :: ref
        real(wp), intent(in) :: factor
        type(operation_type) :: operation

        if (is_fixed(p, ref)) then
            scaled = constant_node(p, fixed_value(p, ref)*factor)
        else if (abs(factor) == 1) then
            scaled = int(sign(1.0_wp, factor))*ref
        else
            operation%base = abs(ref)
            operation%scale = constant_node(p, sign(1, ref)*factor)
            allocate (operation%left(0), operation%right(0))
            scaled = record(p, operation, p%node(abs(ref))%largest*abs(factor))
        end if
    end function scaled_by_constant

    integer function reciprocal(p, ref, largest) result(out)
        type(planner_type), intent(inout) :: p
        integer, intent(in) :: ref
        real(wp), intent(in) :: largest
        type(operation_type) :: operation

        operation%base = abs(ref)
        operation%is_reciprocal = .true.
        operation%is_watched = .true.
        allocate (operation%left(0), operation%right(0))
        out = sign(1, ref)*record(p, operation, largest)
    end function reciprocal

    !> The value of an entry as a reference, recording the operation that collects its terms if there are any.
    integer function settle(p, e, scale, is_watched, largest) result(ref)
        type(planner_type), intent(inout) :: p
        integer, intent(in) :: e                     !! entry
        integer, intent(in) :: scale                 !! reference of a factor; 0: none
        logical, intent(in) :: is_watched
        real(wp), intent(in), optional :: largest    !! magnitude at the representative poses
        type(operation_type) :: operation
        integer, allocatable :: left(:), right(:)
        integer :: k

        allocate (left(0), right(0))
        k = p%entry(e)%first_term
        do while (k /= 0)
            left = [left, p%term_left(k)]
            right = [right, p%term_right(k)]
            k = p%term_next(k)
        end do
        ref = settle_sum(p, p%entry(e)%base, left, right, scale, is_watched, operation)
        if (ref == 0) then
            if (present(largest)) then
                ref = record(p, operation, largest)
            else
                ref = record(p, operation, 0.0_wp)
            end if
        end if
    end function settle

    !> base - sum left*right, times scale: a reference if nothing need be computed, else 0 and the operation to record.
    integer function settle_sum(p, base, left, right, scale, is_watched, operation) result(ref)
        type(planner_type), intent(inout) :: p
        integer, intent(in) :: base, left(:), right(:), scale
        logical, intent(in) :: is_watched
        type(operation_type), intent(out) :: operation
        integer, allocatable :: minus_left(:), minus_right(:), plus_left(:), plus_right(:)
        real(wp) :: fixed
        integer :: k, one_left, one_right

        ref = 0
        fixed = 0
        allocate (minus_left(0), minus_right(0), plus_left(0), plus_right(0))
        do k = 1, size(left)
            one_left = left(k)
            one_right = right(k)
            if (is_zero(p, one_left) .or. is_zero(p, one_right)) cycle
            if (is_fixed(p, one_left) .and. is_fixed(p, one_right)) then
                fixed = fixed - fixed_value(p, one_left)*fixed_value(p, one_right)
                cycle
            end if
            call simplify(p, one_left, one_right)
            if (sign(1, one_left)*sign(1, one_right) > 0) then
                minus_left = [minus_left, abs(one_left)]
                minus_right = [minus_right, abs(one_right)]
            else
                plus_left = [plus_left, abs(one_left)]
                plus_right = [plus_right, abs(one_right)]
            end if
        end do

        if (is_fixed(p, base)) then
            fixed = fixed + fixed_value(p, base)
            if (size(minus_left) + size(plus_left) == 0) then
                if (scale == 0 .or. fixed == 0) then
                    ref = constant_node(p, fixed)
                else
                    ref = scaled_by_constant(p, scale, fixed)
                end if
                return
            end if
            if (fixed /= 0) operation%base = constant_node(p, fixed)
        else if (base < 0) then
            minus_left = [minus_left, p%one]
            minus_right = [minus_right, -base]
            if (fixed /= 0) operation%base = constant_node(p, fixed)
        else
            operation%base = base
            if (fixed /= 0) then
                plus_left = [plus_left, p%one]
                plus_right = [plus_right, constant_node(p, fixed)]
            end if
        end if

        if (scale == 0) then
            if (size(minus_left) + size(plus_left) == 0) then
                ref = base
            else if (operation%base == 0 .and. size(minus_left) == 1 .and. size(plus_left) == 0) then
                if (minus_left(1) == p%one) ref = -minus_right(1)
            else if (operation%base == 0 .and. size(minus_left) == 0 .and. size(plus_left) == 1) then
                if (plus_left(1) == p%one) ref = plus_right(1)
            end if
            if (ref /= 0) return
        else
            operation%scale = abs(scale)
            if (scale < 0) then
                ! The sign of the factor goes to the terms, which trade places; the base becomes a term.
                call exchange(minus_left, plus_left)
                call exchange(minus_right, plus_right)
                if (operation%base /= 0) then
                    minus_left = [minus_left, p%one]
                    minus_right = [minus_right, operation%base]
                    operation%base = 0
                end if
            end if
        end if
        operation%is_watched = is_watched
        operation%n_minus = size(minus_left)
        operation%n_plus = size(plus_left)
        operation%left = [minus_left, plus_left]
        operation%right = [minus_right, plus_right]
    end function settle_sum

    pure subroutine exchange(a, b)
        integer, allocatable, intent(inout) :: a(:), b(:)
        integer, allocatable :: kept(:)

        call move_alloc(a, kept)
        call move_alloc(b, a)
        call move_alloc(kept, b)
    end subroutine exchange

    !> A constant factor comes first and +-1 becomes the node of 1 with its sign.
    subroutine simplify(p, left, right)
        type(planner_type), intent(inout) :: p
        integer, intent(inout) :: left, right
        integer :: kept
        real(wp) :: value

        if (is_fixed(p, right)) then
            kept = left
            left = right
            right = kept
        end if
        if (.not. is_fixed(p, left)) return
        value = fixed_value(p, left)
        left = int(sign(1.0_wp, value))*constant_node(p, abs(value))
    end subroutine simplify

    !> Append an operation; its result is a new node.
    integer function record(p, operation, largest) result(out)
        type(planner_type), intent(inout) :: p
        type(operation_type), intent(in) :: operation
        real(wp), intent(in) :: largest
        type(operation_type), allocatable :: bigger(:)

        if (p%n_operation == size(p%operation)) then
            allocate (bigger(2*p%n_operation))
            bigger(:p%n_operation) = p%operation
            call move_alloc(bigger, p%operation)
        end if
        out = new_node(p)
        p%node(out)%largest = largest
        p%n_operation = p%n_operation + 1
        p%operation(p%n_operation) = operation
        p%operation(p%n_operation)%out = out
    end function record

    ! ---------------------------------------------------------------- back-substitution and clean-up

    subroutine back_substitute(p, solution)
        type(planner_type), intent(inout) :: p
        integer, allocatable, intent(out) :: solution(:)    !! reference of each unknown
        type(operation_type) :: operation
        integer :: k, scale

        allocate (solution(p%n))
        solution = 0
        do k = p%n, 1, -1
            associate (pivot => p%pivot(k))
                scale = pivot%inverse
                if (is_fixed(p, scale)) scale = 0
                solution(pivot%column) = settle_sum(p, pivot%right, pivot%factor, solution(pivot%other), scale, .false., operation)
                if (solution(pivot%column) == 0) solution(pivot%column) = record(p, operation, 0.0_wp)
                if (pivot%inverse /= 0 .and. scale == 0) &
                    solution(pivot%column) = scaled_by_constant(p, solution(pivot%column), fixed_value(p, pivot%inverse))
            end associate
        end do
    end subroutine back_substitute

    !> Mark the operations that some values depend on, and the last use of every node.
    subroutine keep_needed(p, kept)
        type(planner_type), intent(inout) :: p
        integer, intent(in) :: kept(:)               !! references of the values to be there in the end
        integer :: t, k

        p%node(abs(kept))%last_use = huge(1)
        do t = p%n_operation, 1, -1
            associate (operation => p%operation(t))
                operation%is_needed = p%node(operation%out)%last_use > 0
                if (.not. operation%is_needed) cycle
                call use_node(operation%base)
                call use_node(operation%scale)
                do k = 1, size(operation%left)
                    call use_node(operation%left(k))
                    call use_node(operation%right(k))
                end do
            end associate
        end do

    contains

        subroutine use_node(k)
            integer, intent(in) :: k

            if (k == 0) return
            p%node(k)%last_use = max(p%node(k)%last_use, t)
        end subroutine use_node
    end subroutine keep_needed

    !> Give out slots, reusing those whose value is no longer needed, and write the record.
    subroutine emit(system, p, plan)
        type(sparse_system), intent(in) :: system
        type(planner_type), intent(inout) :: p
        type(elimination_plan), intent(inout) :: plan
        type(list_type) :: free
        integer, allocatable :: dies(:), next_death(:)
        integer :: t, k, n, n_constant, zero

        plan%n_slot = max(maxval([0, system%slot]), maxval([0, system%right_slot]))
        zero = constant_node(p, 0.0_wp)
        p%node(zero)%last_use = huge(1)
        n_constant = 0
        do k = 1, p%n_node
            if (p%node(k)%is_constant .and. p%node(k)%last_use > 0) n_constant = n_constant + 1
        end do
        allocate (plan%constant_slot(n_constant), plan%constant(n_constant))
        n_constant = 0
        do k = 1, p%n_node
            if (p%node(k)%is_constant) then
                if (p%node(k)%last_use == 0) cycle
                n_constant = n_constant + 1
                plan%n_slot = plan%n_slot + 1
                p%node(k)%slot = plan%n_slot
                plan%constant_slot(n_constant) = plan%n_slot
                plan%constant(n_constant) = p%node(k)%constant
            else if (p%node(k)%given_slot > 0) then
                p%node(k)%slot = p%node(k)%given_slot
            end if
        end do

        n = count(p%operation(:p%n_operation)%is_needed)
        plan%n_operation = n
        allocate (plan%base(n), plan%out(n), plan%scale(n), plan%last_minus(n), plan%last_plus(n), plan%alarm(n))
        n = 0
        do t = 1, p%n_operation
            if (p%operation(t)%is_needed) n = n + size(p%operation(t)%left)
        end do
        allocate (plan%left(n), plan%right(n))

        ! Results that die at operation t, as lists through the nodes.
        allocate (dies(p%n_operation), next_death(p%n_node))
        dies = 0
        do k = 1, p%n_node
            if (p%node(k)%is_constant .or. p%node(k)%given_slot > 0) cycle
            if (p%node(k)%last_use == 0 .or. p%node(k)%last_use == huge(1)) cycle
            next_death(k) = dies(p%node(k)%last_use)
            dies(p%node(k)%last_use) = k
        end do

        n = 0
        do t = 1, p%n_operation
            associate (operation => p%operation(t))
                if (.not. operation%is_needed) cycle
                n = n + 1
                call write_operation(operation, n)
                k = dies(t)
                do while (k /= 0)
                    call append(free, p%node(k)%slot)
                    k = next_death(k)
                end do
            end associate
        end do

        plan%n_nonzero = size(system%row)
        plan%n_fill = p%n_fill
        plan%n_term = size(plan%left)
        plan%n_scale = count(plan%scale > 0)
        plan%n_reciprocal = count(plan%last_minus < 0)
        plan%is_complete = .true.

    contains

        subroutine write_operation(operation, n)
            type(operation_type), intent(in) :: operation
            integer, intent(in) :: n
            integer :: first, k

            first = 0
            if (n > 1) first = plan%last_plus(n - 1)
            do k = 1, size(operation%left)
                plan%left(first + k) = p%node(operation%left(k))%slot
                plan%right(first + k) = p%node(operation%right(k))%slot
            end do
            plan%last_minus(n) = first + operation%n_minus
            plan%last_plus(n) = first + size(operation%left)
            if (operation%is_reciprocal) plan%last_minus(n) = -1
            plan%base(n) = p%node(merge(operation%base, zero, operation%base > 0))%slot
            plan%scale(n) = 0
            if (operation%scale > 0) plan%scale(n) = p%node(operation%scale)%slot
            plan%alarm(n) = 0
            if (operation%is_watched) plan%alarm(n) = 1/(alarm_factor*max(p%node(operation%out)%largest, tiny(1.0_wp)/alarm_factor))
            ! Slots free since an earlier operation: this one's operands still hold theirs.
            if (free%n > 0) then
                p%node(operation%out)%slot = free%item(free%n)
                free%n = free%n - 1
            else
                plan%n_slot = plan%n_slot + 1
                p%node(operation%out)%slot = plan%n_slot
            end if
            plan%out(n) = p%node(operation%out)%slot
        end subroutine write_operation
    end subroutine emit
end module linkdyn_elimination_plan
