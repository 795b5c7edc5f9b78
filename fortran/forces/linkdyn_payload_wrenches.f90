!> Payloads: masses carried by links, with the inertia and the weight of what they are at the instant.
module linkdyn_payload_wrenches
    use linkdyn_acting, only: acting_type
    use linkdyn_bodies, only: own_axes
    use linkdyn_inertia_wrench, only: inertia_wrench, mass_properties
    use linkdyn_mechanism, only: mechanism_type, payload_properties
    use linkdyn_vector, only: vector, operator(-)
    implicit none (type, external)
    private
    public :: payload_wrench

contains

    !> What a payload's inertia and weight do to the link that carries it. Accelerations may still be unknown.
    function payload_wrench(mechanism, i) result(acting)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i                       !! payload
        type(acting_type) :: acting
        type(mass_properties) :: p
        type(vector) :: force, moment

        p = payload_properties(mechanism, i)
        acting%link = mechanism%model%payload(i)%link
        acting%turning = mechanism%bodies%body(acting%link)%turning
        acting%point = p%cog
        call inertia_wrench(mechanism%bodies, acting%link, p, p%cog, own_axes, force, moment)
        acting%force = -force
        acting%moment = -moment
    end function payload_wrench
end module linkdyn_payload_wrenches
