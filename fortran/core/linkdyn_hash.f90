!> Random numbers and hashes as functions of their arguments alone: any part of a stream can be had without the rest,
!> in any order and on any thread.
module linkdyn_hash
    use, intrinsic :: iso_c_binding, only: c_char, c_int64_t
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: counter_bits, counter_uniform, hash_text

    interface
        pure function counter_bits(seed, stream, counter) result(bits) bind(c, name="linkdyn_counter_bits")
            import :: c_int64_t
            integer(c_int64_t), value :: seed, stream, counter
            integer(c_int64_t) :: bits
        end function counter_bits

        pure function c_hash_bytes(hash, bytes, n) result(mixed) bind(c, name="linkdyn_hash_bytes")
            import :: c_int64_t, c_char
            integer(c_int64_t), value :: hash, n
            character(kind=c_char), intent(in) :: bytes(*)
            integer(c_int64_t) :: mixed
        end function c_hash_bytes
    end interface

contains

    !> A number in [0, 1), a multiple of 2**-53.
    pure real(wp) function counter_uniform(seed, stream, counter) result(u)
        integer(int64), intent(in) :: seed, stream, counter

        u = real(shiftr(counter_bits(seed, stream, counter), 11), wp)*2.0_wp**(-53)
    end function counter_uniform

    !> A text mixed into a hash.
    pure integer(int64) function hash_text(hash, text) result(mixed)
        integer(int64), intent(in) :: hash
        character(len=*), intent(in) :: text

        mixed = c_hash_bytes(hash, text, len(text, int64))
    end function hash_text
end module linkdyn_hash
