!> a b + c. Twin of linkdyn_multiply_add_real64.f90; here the product is rounded, too.
module linkdyn_multiply_add
    use, intrinsic :: iso_fortran_env, only: real128
    implicit none (type, external)
    private
    public :: multiply_add

contains

    pure function multiply_add(a, b, c) result(r)
        real(real128), intent(in), value :: a, b, c
        real(real128) :: r

        r = a*b + c
    end function multiply_add
end module linkdyn_multiply_add
