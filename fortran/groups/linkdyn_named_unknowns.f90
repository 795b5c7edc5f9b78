!> What many unknowns stand in becomes an unknown itself: the equations of a leg, say, then have a few of them instead of all that
!> move what it hangs on.
module linkdyn_named_unknowns
    use linkdyn_system, only: system_type, unknown, require
    use linkdyn_value, only: value, operator(-)
    use linkdyn_vector, only: vector
    implicit none (type, external)
    private
    public :: named, named_vector

contains

    function named(equations, a) result(b)
        type(system_type), intent(inout) :: equations
        type(value), intent(in) :: a
        type(value) :: b

        b = unknown(equations)
        call require(equations, b - a)
    end function named

    function named_vector(equations, a) result(b)
        type(system_type), intent(inout) :: equations
        type(vector), intent(in) :: a
        type(vector) :: b

        b = vector(named(equations, a%x), named(equations, a%y), named(equations, a%z))
    end function named_vector
end module linkdyn_named_unknowns
