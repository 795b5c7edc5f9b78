!> Working precision: IEEE double. The build picks this file or its real128 twin; nothing else names a kind.
module linkdyn_kinds
    use, intrinsic :: iso_fortran_env, only: real64
    implicit none (type, external)
    private
    public :: wp, wp_name

    integer, parameter :: wp = real64                    !! kind of every real of the engine
    character(len=*), parameter :: wp_name = "real64"    !! for reports
end module linkdyn_kinds
