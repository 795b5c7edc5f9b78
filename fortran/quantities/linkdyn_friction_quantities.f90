!> Friction of each joint, and the power that it takes.
module linkdyn_friction_quantities
    use linkdyn_acting, only: acting_type, turned
    use linkdyn_friction, only: friction_wrench
    use linkdyn_inputs, only: in_friction
    use linkdyn_trace, only: traced_type
    use linkdyn_value, only: value, zero, operator(+), operator(-)
    use linkdyn_vector, only: components, operator(.dot.)
    implicit none (type, external)
    private
    public :: friction_wrenches, friction_powers

contains

    !> On the second link at its marker, world axes: Fx Fy Fz Mx My Mz, planar Fx Fy Mz, joint after joint.
    function friction_wrenches(traced) result(v)
        type(traced_type), intent(in) :: traced
        type(value), allocatable :: v(:)
        type(value) :: all(6, traced%mechanism%model%n_joint)
        type(acting_type) :: acting
        integer :: i, k

        all = zero()
        associate (model => traced%mechanism%model, bodies => traced%mechanism%bodies)
            do i = 1, size(model%contact)
                acting = wrench(traced, i)
                associate (of_joint => all(:, acting%joint), force => components(turned(bodies, acting%force, acting%turning, 0)), &
                           moment => components(turned(bodies, acting%moment, acting%turning, 0)))
                    do k = 1, 3
                        of_joint(k) = of_joint(k) + force(k)
                        of_joint(3 + k) = of_joint(3 + k) + moment(k)
                    end do
                end associate
            end do
            if (model%is_planar) then
                v = [all([1, 2, 6], :)]
            else
                v = [all]
            end if
        end associate
    end function friction_wrenches

    function friction_powers(traced) result(v)
        type(traced_type), intent(in) :: traced
        type(value), allocatable :: v(:)                   !! (joint) [W]
        type(acting_type) :: acting
        integer :: i

        allocate (v(traced%mechanism%model%n_joint))
        v = zero()
        do i = 1, size(traced%mechanism%model%contact)
            acting = wrench(traced, i)
            associate (motion => traced%contact(i))
                v(acting%joint) = v(acting%joint) - (acting%force.dot.motion%slide) - (acting%moment.dot.motion%turn)
            end associate
        end do
    end function friction_powers

    function wrench(traced, i) result(acting)
        type(traced_type), intent(in) :: traced
        integer, intent(in) :: i
        type(acting_type) :: acting

        acting = friction_wrench(traced%mechanism, i, traced%contact(i), traced%in%of(in_friction)%v(i))
    end function wrench
end module linkdyn_friction_quantities
