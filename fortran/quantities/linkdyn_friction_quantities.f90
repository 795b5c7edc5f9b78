!> Friction of each joint, and the power that it takes.
module linkdyn_friction_quantities
    use linkdyn_acting, only: acting_type, sums_at_joints
    use linkdyn_friction, only: friction_wrench, holding_wrench
    use linkdyn_inputs, only: in_friction, in_clutch
    use linkdyn_scene, only: n_clutch
    use linkdyn_trace, only: traced_type
    use linkdyn_value, only: value, zero, operator(-)
    use linkdyn_vector, only: operator(.dot.)
    implicit none (type, external)
    private
    public :: friction_wrenches, friction_powers

contains

    !> Also what holds joints that stick. On the second link at its marker, world axes: Fx Fy Fz Mx My Mz, planar Fx Fy Mz, joint
    !> after joint.
    function friction_wrenches(traced) result(v)
        type(traced_type), intent(in) :: traced
        type(value), allocatable :: v(:)
        type(acting_type), allocatable :: rubs(:)
        integer :: i

        allocate (rubs(0))
        associate (model => traced%mechanism%model)
            do i = 1, size(model%contact)
                rubs = [rubs, wrench(traced, i)]
            end do
            do i = 1, n_clutch(model%scene)
                associate (clutch => model%scene%clutch(i))
                    if (clutch%friction > 0) &
                        rubs = [rubs, holding_wrench(traced%mechanism, clutch%joint(1), clutch%variable(1), &
                                                     traced%in%of(in_clutch)%v(i))]
                end associate
            end do
        end associate
        v = sums_at_joints(traced%mechanism, rubs)
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
