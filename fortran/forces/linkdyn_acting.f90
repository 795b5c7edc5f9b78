!> What acts on links: wrenches, each in the axes of some turning, at a joint or at a point of one link.
!>
!> Loads, springs, drives and joint reactions all become this; the balance of a link adds it up without asking what it is.
module linkdyn_acting
    use linkdyn_bodies, only: bodies_type
    use linkdyn_joint_kind, only: axis_of
    use linkdyn_mechanism, only: mechanism_type, told_marker_frame
    use linkdyn_value, only: value, operator(*)
    use linkdyn_vector, only: vector, rotation, zero_vector, operator(*), operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: acting_type, turned, at_joint_variable

    !> A force and a moment. At a joint: on the second link at its marker's point, the opposite on the first.
    type :: acting_type
        integer :: joint = 0                           !! 0: on one link
        integer :: link = 0                            !! that link
        type(vector) :: point                          !! of that link, own axes [m]
        integer :: turning = 0                         !! in whose axes force and moment stand; 0: world axes
        type(vector) :: force, moment                  !! [N, N m]
    end type acting_type

contains

    !> A vector from the axes of one turning to those of another; 0 are the world's.
    function turned(bodies, v, from, to) result(w)
        type(bodies_type), intent(in) :: bodies
        type(vector), intent(in) :: v
        integer, intent(in) :: from, to
        type(vector) :: w

        w = v
        if (from == to) return
        if (from > 0) w = bodies%turning(from)%r.rotate.w
        if (to > 0) w = bodies%turning(to)%r.unrotate.w
    end function turned

    !> A force or torque at a joint variable, positive when it drives the variable up.
    function at_joint_variable(mechanism, joint, variable, effort) result(acting)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint, variable
        type(value), intent(in) :: effort              !! [N, N m]
        type(acting_type) :: acting
        type(rotation) :: frame
        integer :: side

        acting%joint = joint
        associate (link => mechanism%model%joint(joint)%link, kind => mechanism%told_kind(joint)%is)
            side = kind%axis_side(variable)
            ! a hinge's or a slide's axis is fixed in both links: that of a moving one may stand in simpler axes
            if (link(side) == 0 .and. kind%n_variable < 2) side = 3 - side
            frame = told_marker_frame(mechanism, joint, side)
            acting%turning = mechanism%bodies%body(link(side))%turning
            acting%force = zero_vector()
            acting%moment = zero_vector()
            if (kind%is_slide(variable)) then
                acting%force = effort*axis_of(frame, kind%axis(variable))
            else
                acting%moment = effort*axis_of(frame, kind%axis(variable))
            end if
        end associate
    end function at_joint_variable
end module linkdyn_acting
