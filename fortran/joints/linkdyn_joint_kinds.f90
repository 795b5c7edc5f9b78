!> The kinds of joints that there are. A new kind is a module of its own and one line here.
module linkdyn_joint_kinds
    use linkdyn_cylindrical, only: cylindrical
    use linkdyn_joint_kind, only: joint_kind
    use linkdyn_prismatic, only: prismatic
    use linkdyn_revolute, only: revolute
    use linkdyn_spherical, only: spherical
    use linkdyn_universal, only: universal
    implicit none (type, external)
    private
    public :: joint_kind_box, list_joint_kinds, n_kind

    type :: joint_kind_box
        class(joint_kind), allocatable :: is
    end type joint_kind_box

    integer, parameter :: n_kind = 5

contains

    !> All kinds, in the order in which a scene numbers them.
    subroutine list_joint_kinds(kinds)
        type(joint_kind_box), allocatable, intent(out) :: kinds(:)

        allocate (kinds(n_kind))
        allocate (kinds(1)%is, source=revolute())
        allocate (kinds(2)%is, source=prismatic())
        allocate (kinds(3)%is, source=cylindrical())
        allocate (kinds(4)%is, source=universal())
        allocate (kinds(5)%is, source=spherical())
    end subroutine list_joint_kinds
end module linkdyn_joint_kinds
