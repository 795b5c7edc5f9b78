!> Newton-Euler: the wrench that a link's motion asks for, in link axes.
module linkdyn_newton_euler
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: link_type
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.cross.)
    implicit none (type, external)
    private
    public :: inertia_wrench, inertia_column, inertia_times

contains

    !> Force and moment about `point` for a given motion: m a_G, and I alpha + omega x I omega + (G - point) x m a_G.
    pure subroutine inertia_wrench(link, point, acceleration, omega, alpha, force, moment)
        type(link_type), intent(in) :: link
        real(wp), intent(in) :: point(3)             !! moment point, link axes [m]
        type(vec3), intent(in) :: acceleration       !! of the origin less gravity, link axes [m/s2]
        type(vec3), intent(in) :: omega, alpha       !! link axes [rad/s, rad/s2]
        type(vec3), intent(out) :: force, moment     !! link axes [N, N m]
        real(wp) :: arm(3)

        ! (v .cross. fixed) has the fixed vector second: alpha x c and omega x (omega x c) read off directly.
        force = link%mass*(acceleration + (alpha.cross.link%cog) + (omega.cross.(omega.cross.link%cog)))
        moment = inertia_times(link, alpha) + (omega.cross.inertia_times(link, omega))
        arm = link%cog - point
        if (any(arm /= 0)) moment = moment - (force.cross.arm)
    end subroutine inertia_wrench

    !> The same for one column: the part linear in a generalized acceleration.
    pure subroutine inertia_column(link, point, acceleration, alpha, force, moment)
        type(link_type), intent(in) :: link
        real(wp), intent(in) :: point(3)
        type(vec3), intent(in) :: acceleration, alpha
        type(vec3), intent(out) :: force, moment
        real(wp) :: arm(3)

        force = link%mass*(acceleration + (alpha.cross.link%cog))
        moment = inertia_times(link, alpha)
        arm = link%cog - point
        if (any(arm /= 0)) moment = moment - (force.cross.arm)
    end subroutine inertia_column

    !> Inertia tensor about the centre of mass times a vector.
    pure function inertia_times(link, v) result(h)
        type(link_type), intent(in) :: link
        type(vec3), intent(in) :: v
        type(vec3) :: h

        associate (i => link%inertia)
            if (link%is_diagonal) then
                h%x = i(1, 1)*v%x
                h%y = i(2, 2)*v%y
                h%z = i(3, 3)*v%z
            else
                h%x = i(1, 1)*v%x + i(1, 2)*v%y + i(1, 3)*v%z
                h%y = i(2, 1)*v%x + i(2, 2)*v%y + i(2, 3)*v%z
                h%z = i(3, 1)*v%x + i(3, 2)*v%y + i(3, 3)*v%z
            end if
        end associate
    end function inertia_times
end module linkdyn_newton_euler
