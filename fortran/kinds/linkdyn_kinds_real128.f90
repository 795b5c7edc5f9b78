!> Working precision: IEEE quadruple, the reference instrument. Twin of linkdyn_kinds_real64.f90.
module linkdyn_kinds
    use, intrinsic :: iso_fortran_env, only: real128
    implicit none (type, external)
    private
    public :: wp, wp_name

    integer, parameter :: wp = real128                   !! kind of every real of the engine
    character(len=*), parameter :: wp_name = "real128"   !! for reports
end module linkdyn_kinds
