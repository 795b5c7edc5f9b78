!> How a straight link turns whose ends move, and which a universal joint at one of them keeps from spinning.
!>
!> Axes of the link: z along the line from its lower to its upper end, y = unit(z x u), the second axis of the universal joint;
!> the first axis is u = (m, 0, c) in them, k = c/m. docs/theory.md derives the formulas.
module linkdyn_line_turning
    use linkdyn_kinds, only: wp
    use linkdyn_value, only: value, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector
    implicit none (type, external)
    private
    public :: turning_of_line, turning_of_line_2

contains

    !> Angular velocity, axes of the link.
    function turning_of_line(per_length, k, v, b) result(w)
        type(value), intent(in) :: per_length          !! of the line between both ends [1/m]
        type(value), intent(in) :: k
        type(vector), intent(in) :: v                  !! velocity of the upper end against the lower [m/s]
        type(vector), intent(in) :: b                  !! of the link that holds the first axis [rad/s]
        type(vector) :: w

        w%x = -(per_length*v%y)
        w%y = per_length*v%x
        w%z = b%z + k*(w%x - b%x)
    end function turning_of_line

    !> Angular acceleration.
    function turning_of_line_2(per_length, k, rate, w, a, b, beta) result(alpha)
        type(value), intent(in) :: per_length, k
        type(value), intent(in) :: rate                !! at which the line becomes longer [m/s]
        type(vector), intent(in) :: w                  !! of the link [rad/s]
        type(vector), intent(in) :: a                  !! acceleration of the upper end against the lower [m/s2]
        type(vector), intent(in) :: b, beta            !! of the link that holds the first axis [rad/s, rad/s2]
        type(vector) :: alpha
        type(value) :: twice_rate

        twice_rate = 2.0_wp*rate
        alpha%x = w%z*w%y - per_length*(a%y + twice_rate*w%x)
        alpha%y = per_length*(a%x - twice_rate*w%y) - w%z*w%x
        alpha%z = beta%z + k*(alpha%x - beta%x) - b%y*((w%x - b%x) + k*(w%z - b%z)) + (k*w%z + w%x)*(w%y - b%y)
    end function turning_of_line_2
end module linkdyn_line_turning
