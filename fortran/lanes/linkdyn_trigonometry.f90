!> Sine and cosine on lanes, together: one argument reduction serves both.
module linkdyn_trigonometry
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: sine_cosine

contains

    pure subroutine sine_cosine(angle, sine, cosine)
        real(wp), intent(in) :: angle(lanes)    !! [rad]
        real(wp), intent(out) :: sine(lanes), cosine(lanes)
        integer :: lane

        ! In one loop body, so that the compiler calls the library's sincos once instead of sin and cos.
        do lane = 1, lanes
            sine(lane) = sin(angle(lane))
            cosine(lane) = cos(angle(lane))
        end do
    end subroutine sine_cosine
end module linkdyn_trigonometry
