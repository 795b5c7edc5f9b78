!> Loads: forces and moments on markers, given with time or in a call.
module linkdyn_loads
    use linkdyn_acting, only: acting_type
    use linkdyn_mechanism, only: mechanism_type, load_point
    use linkdyn_scene, only: axes_link
    use linkdyn_value, only: value
    use linkdyn_vector, only: vector_of, operator(.rotate.)
    implicit none (type, external)
    private
    public :: apply_load

contains

    !> One load of the scene with its components Fx Fy Fz Mx My Mz, in the world's axes or the link's, as the scene says.
    function apply_load(mechanism, i, component) result(acting)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value), intent(in) :: component(6)        !! [N, N m]
        type(acting_type) :: acting

        associate (load => mechanism%model%scene%load(i))
            acting%link = load%link
            acting%point = load_point(mechanism, i)
            acting%force = vector_of(component(:3))
            acting%moment = vector_of(component(4:))
            if (load%axes /= axes_link) return
            ! the link may be traced in other axes than those in which the scene has it, and its load
            acting%turning = mechanism%bodies%body(load%link)%turning
            acting%force = mechanism%own(load%link)%r.rotate.acting%force
            acting%moment = mechanism%own(load%link)%r.rotate.acting%moment
        end associate
    end function apply_load
end module linkdyn_loads
