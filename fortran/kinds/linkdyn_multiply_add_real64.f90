!> a b + c with one rounding. Twin of linkdyn_multiply_add_real128.f90.
module linkdyn_multiply_add
    use, intrinsic :: iso_c_binding, only: c_double
    implicit none (type, external)
    private
    public :: multiply_add

    interface
        pure function multiply_add(a, b, c) bind(c, name="fma") result(r)
            import :: c_double
            real(c_double), intent(in), value :: a, b, c
            real(c_double) :: r
        end function multiply_add
    end interface
end module linkdyn_multiply_add
