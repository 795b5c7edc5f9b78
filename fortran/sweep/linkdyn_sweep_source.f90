!> Where the scenes of a sweep's designs come from: only the reader of scene files knows.
module linkdyn_sweep_source
    use linkdyn_equation_kernels, only: kernel_family
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: scene_type
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: design_source

    type, abstract :: design_source
        type(kernel_family), pointer :: family => null()   !! of the designs; null: each has kernels of its own
        type(model_type), allocatable :: first             !! design: others that stand as it does take its assembly
    contains
        procedure(make_scene), deferred :: make
        procedure(free_source), deferred :: free
    end type design_source

    abstract interface
        !> The scene with the values of one design. Several threads may call this.
        subroutine make_scene(self, value, scene, status)
            import :: design_source, wp, scene_type, status_type
            class(design_source), intent(in) :: self
            real(wp), intent(in) :: value(:)               !! of all axes of the sweep
            type(scene_type), intent(out) :: scene
            type(status_type), intent(out) :: status
        end subroutine make_scene

        !> Give back what is kept from one design to the next.
        subroutine free_source(self)
            import :: design_source
            class(design_source), intent(inout) :: self
        end subroutine free_source
    end interface
end module linkdyn_sweep_source
