!> Formulas of a scene: arithmetic on measures and on other laws, kept as a small program and evaluated for many samples at once.
!>
!> Each node is one operation on nodes before it; the last one is the value. What has no value, a root of a negative number or a
!> division by zero, is not a number, and stays so through every operation.
module linkdyn_formula
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: formula_type, formula_node, add_node, evaluate_formula, differentiate_formula
    public :: node_number, node_symbol, node_add, node_subtract, node_multiply, node_divide, node_negate, node_power, &
              node_whole_power, node_sqrt, node_sin, node_cos, node_tan, node_asin, node_acos, node_atan2, node_abs, node_min, &
              node_max, node_sign, node_step, node_exp, node_log, node_tanh, node_if

    integer, parameter :: node_number = 1, node_symbol = 2, node_add = 3, node_subtract = 4, node_multiply = 5, node_divide = 6
    integer, parameter :: node_negate = 7, node_power = 8, node_whole_power = 9, node_sqrt = 10, node_sin = 11, node_cos = 12
    integer, parameter :: node_tan = 13, node_asin = 14, node_acos = 15, node_atan2 = 16, node_abs = 17, node_min = 18
    integer, parameter :: node_max = 19
    integer, parameter :: node_sign = 20           !! -1, 0 or 1
    integer, parameter :: node_step = 21           !! 1 above zero, else 0
    integer, parameter :: node_exp = 22, node_log = 23, node_tanh = 24
    integer, parameter :: node_if = 25             !! the second where the first is above zero, else the third

    type :: formula_node
        integer :: op = 0
        integer :: a = 0, b = 0, c = 0             !! nodes; the symbol (see `evaluate_formula`), a whole exponent in `b`
        real(wp) :: number = 0
    end type formula_node

    type :: formula_type
        type(formula_node), allocatable :: node(:)
        integer :: n = 0                           !! nodes so far
    end type formula_type

contains

    !> One more node; its number is `formula%n`.
    pure subroutine add_node(formula, node)
        type(formula_type), intent(inout) :: formula
        type(formula_node), intent(in) :: node
        type(formula_node), allocatable :: longer(:)

        if (.not. allocated(formula%node)) allocate (formula%node(8))
        if (formula%n == size(formula%node)) then
            allocate (longer(2*formula%n))
            longer(:formula%n) = formula%node
            call move_alloc(longer, formula%node)
        end if
        formula%n = formula%n + 1
        formula%node(formula%n) = node
    end subroutine add_node

    !> The formula at all samples. Symbols above zero are measures, those below zero laws.
    pure subroutine evaluate_formula(formula, measure, law, value, mode)
        type(formula_type), intent(in) :: formula
        real(wp), intent(in) :: measure(:, :)      !! (n, measure)
        real(wp), intent(in) :: law(:, :)          !! (n, law), those that the formula takes are there
        real(wp), intent(out) :: value(:)          !! (n)
        real(wp), intent(inout) :: mode(:)         !! (n) another number on the other side of a jump: each goes on from the last
                                                   !! one's
        real(wp) :: v(size(value), formula%n)

        call evaluate_nodes(formula, measure, law, v, mode)
        value = v(:, formula%n)
    end subroutine evaluate_formula

    !> All its nodes at all samples.
    pure subroutine evaluate_nodes(formula, measure, law, v, mode)
        type(formula_type), intent(in) :: formula
        real(wp), intent(in) :: measure(:, :), law(:, :)   !! as above
        real(wp), intent(out) :: v(:, :)           !! (n, node)
        real(wp), intent(inout) :: mode(:)
        real(wp) :: nan
        integer :: i

        nan = ieee_value(1.0_wp, ieee_quiet_nan)
        do i = 1, formula%n
            associate (node => formula%node(i), a => formula%node(i)%a, b => formula%node(i)%b, c => formula%node(i)%c)
                select case (node%op)
                case (node_number)
                    v(:, i) = node%number
                case (node_symbol)
                    if (a > 0) v(:, i) = measure(:, a)
                    if (a < 0) v(:, i) = law(:, -a)
                case (node_add)
                    v(:, i) = v(:, a) + v(:, b)
                case (node_subtract)
                    v(:, i) = v(:, a) - v(:, b)
                case (node_multiply)
                    v(:, i) = v(:, a)*v(:, b)
                case (node_divide)
                    v(:, i) = v(:, a)/v(:, b)
                case (node_negate)
                    v(:, i) = -v(:, a)
                case (node_power)
                    v(:, i) = merge(v(:, a)**v(:, b), nan, v(:, a) > 0 .or. (.not. abs(v(:, a)) > 0 .and. v(:, b) > 0))
                case (node_whole_power)
                    v(:, i) = v(:, a)**b
                case (node_sqrt)
                    v(:, i) = merge(sqrt(max(v(:, a), 0.0_wp)), nan, v(:, a) >= 0)
                case (node_sin)
                    v(:, i) = sin(v(:, a))
                case (node_cos)
                    v(:, i) = cos(v(:, a))
                case (node_tan)
                    v(:, i) = tan(v(:, a))
                case (node_asin)
                    v(:, i) = merge(asin(min(1.0_wp, max(-1.0_wp, v(:, a)))), nan, abs(v(:, a)) <= 1)
                case (node_acos)
                    v(:, i) = merge(acos(min(1.0_wp, max(-1.0_wp, v(:, a)))), nan, abs(v(:, a)) <= 1)
                case (node_atan2)
                    v(:, i) = merge(atan2(v(:, a), v(:, b)), nan, abs(v(:, a)) + abs(v(:, b)) > 0)
                case (node_abs)
                    v(:, i) = abs(v(:, a))
                case (node_min)
                    v(:, i) = merge(min(v(:, a), v(:, b)), nan, v(:, a) == v(:, a) .and. v(:, b) == v(:, b))
                case (node_max)
                    v(:, i) = merge(max(v(:, a), v(:, b)), nan, v(:, a) == v(:, a) .and. v(:, b) == v(:, b))
                case (node_sign)
                    v(:, i) = merge(merge(1.0_wp, 0.0_wp, v(:, a) > 0), merge(-1.0_wp, v(:, a), v(:, a) < 0), v(:, a) > 0)
                case (node_step)
                    v(:, i) = merge(1.0_wp, merge(0.0_wp, v(:, a), v(:, a) <= 0), v(:, a) > 0)
                case (node_exp)
                    v(:, i) = exp(v(:, a))
                case (node_log)
                    v(:, i) = merge(log(max(v(:, a), tiny(1.0_wp))), nan, v(:, a) > 0)
                case (node_tanh)
                    v(:, i) = tanh(v(:, a))
                case (node_if)
                    v(:, i) = merge(v(:, b), merge(v(:, c), nan, v(:, a) <= 0), v(:, a) > 0)
                end select
            end associate
            select case (formula%node(i)%op)
            case (node_sign, node_step)
                mode = 3*mode + v(:, i)
            case (node_if)
                mode = 3*mode + merge(1.0_wp, 0.0_wp, v(:, formula%node(i)%a) > 0)
            end select
        end do
    end subroutine evaluate_nodes

    !> How a formula changes at one sample, on several ways on which what it takes changes. At a jump or kink it is the side that it
    !> is evaluated on that counts.
    pure subroutine differentiate_formula(formula, measure, law, measure_rate, law_rate, rate)
        type(formula_type), intent(in) :: formula
        real(wp), intent(in) :: measure(:), law(:)
        real(wp), intent(in) :: measure_rate(:, :), law_rate(:, :)     !! (way, measure), (way, law)
        real(wp), intent(out) :: rate(:)           !! (way)
        real(wp) :: v(1, formula%n), of(size(rate), formula%n), mode(1)
        integer :: i

        mode = 0
        call evaluate_nodes(formula, reshape(measure, [1, size(measure)]), reshape(law, [1, size(law)]), v, mode)
        do i = 1, formula%n
            associate (node => formula%node(i), a => formula%node(i)%a, b => formula%node(i)%b, c => formula%node(i)%c, &
                       x => v(1, :), y => v(1, i))
                select case (node%op)
                case (node_symbol)
                    if (a > 0) of(:, i) = measure_rate(:, a)
                    if (a < 0) of(:, i) = law_rate(:, -a)
                case (node_add)
                    of(:, i) = of(:, a) + of(:, b)
                case (node_subtract)
                    of(:, i) = of(:, a) - of(:, b)
                case (node_multiply)
                    of(:, i) = of(:, a)*x(b) + x(a)*of(:, b)
                case (node_divide)
                    of(:, i) = (of(:, a) - y*of(:, b))/x(b)
                case (node_negate)
                    of(:, i) = -of(:, a)
                case (node_power)
                    of(:, i) = x(b)*x(a)**(x(b) - 1)*of(:, a)
                    if (x(a) > 0) of(:, i) = of(:, i) + y*log(x(a))*of(:, b)
                case (node_whole_power)
                    of(:, i) = 0
                    if (b /= 0) of(:, i) = b*x(a)**(b - 1)*of(:, a)
                case (node_sqrt)
                    of(:, i) = of(:, a)/(2*y)
                case (node_sin)
                    of(:, i) = cos(x(a))*of(:, a)
                case (node_cos)
                    of(:, i) = -sin(x(a))*of(:, a)
                case (node_tan)
                    of(:, i) = (1 + y**2)*of(:, a)
                case (node_asin)
                    of(:, i) = of(:, a)/sqrt(1 - x(a)**2)
                case (node_acos)
                    of(:, i) = -of(:, a)/sqrt(1 - x(a)**2)
                case (node_atan2)
                    of(:, i) = (x(b)*of(:, a) - x(a)*of(:, b))/(x(a)**2 + x(b)**2)
                case (node_abs)
                    of(:, i) = sign(1.0_wp, x(a))*of(:, a)
                case (node_min)
                    of(:, i) = merge(of(:, a), of(:, b), x(a) <= x(b))
                case (node_max)
                    of(:, i) = merge(of(:, a), of(:, b), x(a) >= x(b))
                case (node_exp)
                    of(:, i) = y*of(:, a)
                case (node_log)
                    of(:, i) = of(:, a)/x(a)
                case (node_tanh)
                    of(:, i) = (1 - y**2)*of(:, a)
                case (node_if)
                    of(:, i) = merge(of(:, b), of(:, c), x(a) > 0)
                case default                       ! numbers, and steps
                    of(:, i) = 0
                end select
            end associate
        end do
        rate = of(:, formula%n)
    end subroutine differentiate_formula
end module linkdyn_formula
