!> Designs of a sweep: the scene file with other numbers. A document is parsed once and kept with the places of these numbers,
!> so that a design takes the same time however long the lists of values in the file are.
module linkdyn_scene_variant
    use linkdyn_kinds, only: wp
    use linkdyn_lock, only: hold_lock, release_lock
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_parameters, only: varied_numbers, find_numbers, vary_numbers
    use linkdyn_scene_reader, only: read_document, root_of
    use linkdyn_scene_include, only: reopen_document
    use linkdyn_status, only: status_type
    use linkdyn_sweep_source, only: design_source
    use linkdyn_sweep_spec, only: axis_parameter
    use linkdyn_toml, only: toml_document, free_toml
    implicit none (type, external)
    private
    public :: variants_of

    !> A document, used by one thread at a time.
    type :: shelf_document
        type(toml_document) :: document
        type(varied_numbers) :: varied
        type(shelf_document), pointer :: next => null()
    end type shelf_document

    !> Documents that no thread is using.
    type :: document_shelf
        type(shelf_document), pointer :: first => null()
    end type document_shelf

    type, extends(design_source) :: scene_variants
        type(scene_type) :: scene                      !! as it stands in the file
        character(len=:), allocatable :: folder        !! where its tables lie
        type(document_shelf), pointer, private :: shelf => null()
    contains
        procedure :: make => make_variant
        procedure :: free => free_variants
    end type scene_variants

contains

    !> The designs of a scene's sweep.
    function variants_of(scene, folder) result(variants)
        type(scene_type), intent(in) :: scene
        character(len=*), intent(in) :: folder
        type(scene_variants) :: variants

        variants%scene = scene
        variants%folder = folder
        allocate (variants%shelf)
    end function variants_of

    !> The scene with the values of one design.
    subroutine make_variant(self, value, scene, status)
        class(scene_variants), intent(in) :: self
        real(wp), intent(in) :: value(:)
        type(scene_type), intent(out) :: scene
        type(status_type), intent(out) :: status
        type(shelf_document), pointer :: taken

        if (.not. any(self%scene%sweep%axis%kind == axis_parameter)) then
            scene = self%scene
            return
        end if
        call take_document(self, taken, status)
        if (.not. status%is_ok()) return
        call vary_numbers(root_of(taken%document, self%scene%source), taken%varied, value)
        call read_document(taken%document, self%scene%source, self%folder, .false., scene, status)
        ! Markers that carry a load only in the sweep got one when [sweep] was read.
        if (status%is_ok()) scene%load = [scene%load, self%scene%load(size(scene%load) + 1:)]
        call hold_lock()
        taken%next => self%shelf%first
        self%shelf%first => taken
        call release_lock()
    end subroutine make_variant

    !> One from the shelf, or a new one.
    subroutine take_document(self, taken, status)
        class(scene_variants), intent(in) :: self
        type(shelf_document), pointer, intent(out) :: taken
        type(status_type), intent(inout) :: status

        call hold_lock()
        taken => self%shelf%first
        if (associated(taken)) self%shelf%first => taken%next
        call release_lock()
        if (associated(taken)) return
        allocate (taken)
        call reopen_document(self%scene%source, self%folder, taken%document, status)
        if (status%is_ok()) then
            call find_numbers(root_of(taken%document, self%scene%source), self%scene%sweep%axis, taken%varied)
        else
            deallocate (taken)
        end if
    end subroutine take_document

    subroutine free_variants(self)
        class(scene_variants), intent(inout) :: self
        type(shelf_document), pointer :: document

        if (.not. associated(self%shelf)) return
        do while (associated(self%shelf%first))
            document => self%shelf%first
            self%shelf%first => document%next
            call free_toml(document%document)
            deallocate (document)
        end do
        deallocate (self%shelf)
    end subroutine free_variants
end module linkdyn_scene_variant
