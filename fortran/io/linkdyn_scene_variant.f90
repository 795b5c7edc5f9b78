!> Designs of a sweep: the scene file read again with other numbers.
module linkdyn_scene_variant
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: parse_scene
    use linkdyn_status, only: status_type
    use linkdyn_sweep_source, only: design_source
    use linkdyn_sweep_spec, only: axis_parameter
    implicit none (type, external)
    private
    public :: scene_variants

    type, extends(design_source) :: scene_variants
        type(scene_type) :: scene                      !! as it stands in the file
        character(len=:), allocatable :: folder        !! where its tables lie
    contains
        procedure :: make => make_variant
    end type scene_variants

contains

    !> The scene with the values of one design.
    subroutine make_variant(self, value, scene, status)
        class(scene_variants), intent(in) :: self
        real(wp), intent(in) :: value(:)
        type(scene_type), intent(out) :: scene
        type(status_type), intent(out) :: status

        if (any(self%scene%sweep%axis%kind == axis_parameter)) then
            call parse_scene(self%scene%text, trim(self%scene%file), self%folder, scene, status, self%scene%sweep%axis, value)
        else
            scene = self%scene
        end if
    end subroutine make_variant
end module linkdyn_scene_variant
