!> The kinds of joints that there are. A new kind is a row of the table, a module of its own and a case here.
module linkdyn_joint_kinds
    use linkdyn_cam, only: cam
    use linkdyn_cylindrical, only: cylindrical
    use linkdyn_fixed, only: fixed
    use linkdyn_joint_kind, only: joint_kind
    use linkdyn_joint_table, only: joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, joint_spherical, &
        joint_fixed, joint_planar, joint_screw, joint_gear, joint_rack, joint_belt, joint_cam, pose_position, &
        joint_groove, joint_plate, joint_loose, joint_key, joint_thread
    use linkdyn_pose_parts, only: position_part, attitude_part
    use linkdyn_partial_joints, only: groove, plate, key, loose
    use linkdyn_planar, only: planar
    use linkdyn_prismatic, only: prismatic
    use linkdyn_revolute, only: revolute
    use linkdyn_screw, only: screw, thread
    use linkdyn_spherical, only: spherical
    use linkdyn_universal, only: universal
    use linkdyn_wheels, only: wheels
    implicit none (type, external)
    private
    public :: joint_kind_box, make_joint_kind

    type :: joint_kind_box
        class(joint_kind), allocatable :: is
    end type joint_kind_box

contains

    !> A kind of the table.
    subroutine make_joint_kind(kind, box)
        integer, intent(in) :: kind                    !! one of `joint_*`
        type(joint_kind_box), intent(out) :: box

        select case (kind)
        case (joint_revolute)
            allocate (revolute :: box%is)
        case (joint_prismatic)
            allocate (prismatic :: box%is)
        case (joint_cylindrical)
            allocate (cylindrical :: box%is)
        case (joint_universal)
            allocate (universal :: box%is)
        case (joint_spherical)
            allocate (spherical :: box%is)
        case (joint_fixed)
            allocate (fixed :: box%is)
        case (joint_planar)
            allocate (planar :: box%is)
        case (joint_screw)
            allocate (screw :: box%is)
        case (joint_gear, joint_rack, joint_belt)
            allocate (wheels :: box%is)
        case (pose_position)
            allocate (position_part :: box%is)
        case (joint_groove)
            allocate (groove :: box%is)
        case (joint_plate)
            allocate (plate :: box%is)
        case (joint_thread)
            allocate (thread :: box%is)
        case (joint_key)
            allocate (key :: box%is)
        case (joint_loose)
            allocate (loose :: box%is)
        case (joint_cam)
            allocate (cam :: box%is)
        case default
            allocate (attitude_part :: box%is)
        end select
        call box%is%describe(kind)
    end subroutine make_joint_kind
end module linkdyn_joint_kinds
