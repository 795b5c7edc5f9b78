!> An open scene: its model, and the equations planned for it so far.
!>
!> It does not change once it is open, but for plans that are added, so several threads may use it.
module linkdyn_open_scene
    use, intrinsic :: iso_c_binding, only: c_intptr_t
    use linkdyn_builder, only: build_model
    use linkdyn_force_map, only: typical_length
    use linkdyn_heard_tables, only: heard_table, hearing, list_tables
    use linkdyn_handles, only: held_thing, make_handle, take, give_back
    use linkdyn_inverse, only: shared_places, inverse_options, inverse_solver, prepare_inverse, solver_name, samples_to_come
    use linkdyn_led_mechanism, only: follows_assembly
    use linkdyn_lock, only: hold_lock, release_lock, hold_texts, release_texts
    use linkdyn_model, only: model_type, dyad_names
    use linkdyn_relatives, only: relatives, hold_relatives, family_of, leave_relatives
    use linkdyn_results, only: layout_type, wanted_type, describe_results
    use linkdyn_scene, only: scene_type, load_spec, name_len, put_file_first
    use linkdyn_scene_reader, only: parse_scene, read_scene, check_actuators
    use linkdyn_shared_programs, only: shared_programs, hold_programs, leave_programs
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_suggest, only: suggestion
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: open_scene, open_scene_text, open_scene_file, open_with_loads, take_scene, leave_scene, find_solver, find_placing, &
        layout_of

    !> Equations planned for one solver; absent until they are asked for.
    type :: solver_box
        type(inverse_solver), pointer :: solver => null()
    end type solver_box

    type, extends(held_thing) :: open_scene
        type(model_type) :: model
        type(heard_table), allocatable :: heard(:)                  !! by inverse dynamics along the scene's motions
        type(layout_type) :: layout                                 !! of all results of inverse dynamics
        type(layout_type) :: run_layout                             !! and of forward dynamics
        !> without and with reactions, error estimates, rcond, distance; by solver
        type(solver_box) :: planned(2, 2, 2, 2, size(solver_name))
        type(solver_box) :: placing                                 !! links, without equations
        type(shared_places) :: places                               !! of all of these
        type(shared_programs), pointer :: shared => null()          !! by its forward runs
        logical :: is_variant = .false.                             !! made of another by other values
        type(relatives), pointer :: relatives => null()             !! this, or the one that it was made of, and its other variants
    contains
        procedure :: release => release_scene
    end type open_scene

contains

    !> Read and plan a scene given as text.
    subroutine open_scene_text(text, file, folder, handle, status, original)
        character(len=*), intent(in) :: text
        character(len=*), intent(in) :: file           !! what to call the text in messages
        character(len=*), intent(in) :: folder         !! where its tables lie; blank: the current folder
        integer(c_intptr_t), intent(out) :: handle
        type(status_type), intent(inout) :: status
        type(open_scene), intent(in), optional :: original    !! this one with other values
        type(scene_type) :: scene

        handle = 0
        call hold_texts()
        call parse_scene(text, file, folder, scene, status)
        if (status%is_ok()) call plan_scene(scene, handle, status, original)
        if (.not. status%is_ok()) call put_file_first(file, scene, status%message)
        call release_texts()
    end subroutine open_scene_text

    !> Read and plan a scene file; its tables lie beside it.
    subroutine open_scene_file(file, handle, status)
        character(len=*), intent(in) :: file
        integer(c_intptr_t), intent(out) :: handle
        type(status_type), intent(inout) :: status
        type(scene_type) :: scene

        handle = 0
        call hold_texts()
        call read_scene(file, scene, status)
        if (status%is_ok()) call plan_scene(scene, handle, status)
        if (.not. status%is_ok()) call put_file_first(file, scene, status%message)
        call release_texts()
    end subroutine open_scene_file

    !> A second scene: the first one with loads at more markers.
    subroutine open_with_loads(first, names, handle, status)
        type(open_scene), intent(in) :: first
        character(len=*), intent(in) :: names          !! "link.marker" lines
        integer(c_intptr_t), intent(out) :: handle
        type(status_type), intent(inout) :: status
        type(scene_type) :: scene
        integer :: i, line_end

        handle = 0
        call hold_texts()
        scene = first%model%scene
        i = 1
        do while (i <= len(names) .and. status%is_ok())
            line_end = index(names(i:), new_line("a")) + i - 1
            if (line_end < i) line_end = len(names) + 1
            call add_load(names(i:line_end - 1), scene, status)
            i = line_end + 1
        end do
        if (status%is_ok()) then
            if (first%is_variant) then
                call plan_scene(scene, handle, status, first)
            else
                call plan_scene(scene, handle, status)
            end if
        end if
        call release_texts()
    end subroutine open_with_loads

    !> Use a scene until `leave_scene`. Null: the call has failed.
    subroutine take_scene(handle, scene, status)
        integer(c_intptr_t), intent(in) :: handle
        type(open_scene), pointer, intent(out) :: scene
        type(status_type), intent(inout) :: status
        class(held_thing), pointer :: thing

        nullify (scene)
        call take(handle, "scene", .false., thing, status)
        if (.not. associated(thing)) return
        select type (thing)
        type is (open_scene)
            scene => thing
        class default
            call give_back(handle)
            call fail(status, status_bad_input, "the handle is not that of a scene")
        end select
    end subroutine take_scene

    !> The end of a use; nothing for a scene that could not be taken.
    subroutine leave_scene(handle, scene)
        integer(c_intptr_t), intent(in) :: handle
        type(open_scene), pointer, intent(inout) :: scene

        if (associated(scene)) call give_back(handle)
        nullify (scene)
    end subroutine leave_scene

    !> The equations for a solver, planned when they are first asked for. Of threads that ask at the same time the first one's
    !> plan is kept.
    subroutine find_solver(scene, options, wants_reactions, solver, status)
        type(open_scene), intent(inout), target :: scene
        type(inverse_options), intent(in) :: options
        logical, intent(in) :: wants_reactions
        type(inverse_solver), pointer, intent(out) :: solver
        type(status_type), intent(inout) :: status
        type(inverse_options) :: kept                  !! of a solver that other calls will use
        type(inverse_solver), pointer :: new
        type(solver_box), pointer :: box

        box => scene%placing
        if (options%wants_forces) box => scene%planned( &
            merge(2, 1, wants_reactions), merge(2, 1, options%wants_errors), merge(2, 1, options%wants_rcond), &
            merge(2, 1, options%wants_distance), options%solver)
        call hold_lock()
        solver => box%solver
        call release_lock()
        if (associated(solver)) return
        allocate (new)
        call hold_texts()
        if (options%wants_forces) call check_actuators(scene%model%scene, status)
        kept = options
        kept%n_expected = max(options%n_expected, samples_to_come)
        kept%places => scene%places
        if (status%is_ok() .and. scene%is_variant) call family_of(scene%model, scene%relatives, kept%family)
        if (status%is_ok()) call prepare_inverse(scene%model, kept, wants_reactions, new, status)
        call release_texts()
        call hold_lock()
        if (status%is_ok() .and. .not. associated(box%solver)) then
            box%solver => new
            nullify (new)
        end if
        solver => box%solver
        call release_lock()
        if (.not. associated(new)) return
        call new%free()
        deallocate (new)
    end subroutine find_solver

    !> The programs by which links of large batches are placed, without any equations.
    subroutine find_placing(scene, solver, status)
        type(open_scene), intent(inout), target :: scene
        type(inverse_solver), pointer, intent(out) :: solver
        type(status_type), intent(inout) :: status

        call find_solver(scene, inverse_options(wants_forces=.false.), .false., solver, status)
    end subroutine find_placing

    !> Dimensions and variables of some results.
    function layout_of(model, wanted, has_time, is_forward) result(layout)
        type(model_type), intent(in) :: model
        type(wanted_type), intent(in) :: wanted
        logical, intent(in) :: has_time                !! samples are instants
        logical, intent(in) :: is_forward              !! of a forward run
        type(layout_type) :: layout

        call describe_results(model%scene, wanted, has_time, layout, is_forward=is_forward, dyad=dyad_names(model), &
                              length=typical_length(model), follows_assembly=follows_assembly(model))
    end function layout_of

    !> Plan a scene and keep it.
    subroutine plan_scene(scene, handle, status, original)
        type(scene_type), intent(in) :: scene
        integer(c_intptr_t), intent(inout) :: handle
        type(status_type), intent(inout) :: status
        type(open_scene), intent(in), optional :: original
        type(open_scene), pointer :: new
        type(relatives), pointer :: of_original
        class(held_thing), pointer :: thing
        type(wanted_type) :: all

        allocate (new)
        nullify (of_original)
        if (present(original)) of_original => original%relatives
        new%is_variant = associated(of_original)
        call build_model(scene, new%model, status)
        if (status%is_ok()) then
            call list_tables(new%model%scene, hearing(), new%heard)
            all = wanted_type(growth=.true., bound=.true., rcond=.true., distance=.true., errors=.true.)
            new%layout = layout_of(new%model, all, .true., .false.)
            all%distance = .false.
            new%run_layout = layout_of(new%model, all, .true., .true.)
            call hold_programs(new%shared)
            call hold_relatives(of_original, new%relatives)
            call new%places%prepare(new%model)
            thing => new
            call make_handle(thing, handle, status)
        end if
        if (status%is_ok()) return
        call leave_programs(new%shared)
        call leave_relatives(new%relatives)
        deallocate (new)
    end subroutine plan_scene

    subroutine release_scene(self)
        class(open_scene), intent(inout) :: self

        call free_solvers(size(self%planned), self%planned)
        call free_box(self%placing)
        call self%places%free()
        call leave_programs(self%shared)
        call leave_relatives(self%relatives)
    end subroutine release_scene

    subroutine free_solvers(n, boxes)
        integer, intent(in) :: n
        type(solver_box), intent(inout) :: boxes(n)
        integer :: i

        do i = 1, n
            call free_box(boxes(i))
        end do
    end subroutine free_solvers

    subroutine free_box(box)
        type(solver_box), intent(inout) :: box

        if (.not. associated(box%solver)) return
        call box%solver%free()
        deallocate (box%solver)
    end subroutine free_box

    !> A load of unknown value on the marker "link.marker".
    subroutine add_load(name, scene, status)
        character(len=*), intent(in) :: name
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(load_spec) :: load
        character(len=2*name_len), allocatable :: known(:)
        integer :: i, j

        allocate (known(0))
        do i = 1, size(scene%link)
            do j = 1, size(scene%link(i)%marker)
                known = [character(len=2*name_len) :: known, &
                    trim(scene%link(i)%name)//"."//trim(scene%link(i)%marker(j)%name)]
                if (known(size(known)) /= name) cycle
                load%name = name
                load%link = i
                load%marker = j
                scene%load = [scene%load, load]
                return
            end do
        end do
        call fail(status, status_bad_input, "wrench: no marker "//quoted(name)// &
            " on a moving link (expected ""link.marker"")"//suggestion(name, known))
    end subroutine add_load
end module linkdyn_open_scene
