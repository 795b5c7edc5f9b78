!> Equations of a scene's inverse dynamics, planned once for many batches: what is asked, what is made for it, and the threads'
!> scratch.
!>
!> Scratch stays with the solver from one batch to the next, so that a batch of one sample costs little.
module linkdyn_inverse_solver
    use linkdyn_assembly_trail, only: sample_assembly, make_room
    use linkdyn_closing_programs, only: closing_programs
    use linkdyn_condition, only: condition_type, condition_space, make_condition, free_condition, prepare_condition
    use linkdyn_equation_kernels, only: kernel_family
    use linkdyn_equations, only: equations_type, equation_workspace, build_equations, build_no_equations, share_equations, &
        free_equations, prepare_workspace, solver_lapack, solver_elimination, solver_reduced
    use linkdyn_error_probe, only: error_probe, probe_space, make_probe, free_probe, prepare_probe_space
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_results, only: block_measures, prepare_measures
    use linkdyn_lock, only: hold_lock, release_lock
    use linkdyn_model, only: model_type, friction_is_shared, has_assemblies, drives_share
    use linkdyn_recorded_forces, only: record_shelf
    use linkdyn_representatives, only: representative_poses
    use linkdyn_scatter_check, only: second_look, free_look
    use linkdyn_settled_samples, only: known_nodes
    use linkdyn_singularity, only: singularity_space, prepare_singularity
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: shared_places, inverse_options, inverse_solver, thread_space
    public :: prepare_inverse, take_space, return_space

    !> How links are led to their places: whatever is asked of the equations, all solvers of a model do it alike.
    type :: shared_places
        type(closing_programs), pointer :: closing => null()    !! there if the scene has groups closed by iteration
        type(known_nodes), pointer :: nodes => null()           !! beside these: from where they close samples on their own
        type(representative_poses), pointer :: poses => null()
    contains
        procedure :: prepare => prepare_places
        procedure :: free => free_places
    end type shared_places

    type :: inverse_options
        integer :: solver = solver_elimination
        integer :: threads = 1
        logical :: in_order = .false.        !! samples follow each other along a motion
        logical :: wants_forces = .true.     !! false: kinematics alone, without equations; what is wanted then is no force
        integer :: n_expected = 0            !! samples of all batches together, if that is known: it decides what is worth making
        logical :: wants_errors = .false.    !! error estimates of the forces
        logical :: wants_rcond = .false.     !! condition number of the equations; solver lapack always has it
        logical :: wants_distance = .false.  !! distance to the next singular position
        logical :: by_record = .true.        !! elimination by a record of the scene, where it has one; false: by lanes alone
        type(kernel_family), pointer :: family => null()    !! of models that share kernels; null: there is none
        type(shared_places), pointer :: places => null()    !! shared by this model's solvers, which it outlives; null: none are
    end type inverse_options

    !> Scratch of one thread.
    type :: thread_space
        type(equation_workspace) :: workspace
        type(block_measures) :: measures
        real(wp), allocatable :: reaction(:, :, :)              !! (lane, n_component, n_joint)
        real(wp), allocatable :: values(:, :)                   !! of one result (lane, the widest so far)
        type(probe_space) :: probe                              !! if errors are wanted
        type(probe_space) :: doubt                              !! if samples have been looked at again
        type(condition_space) :: condition                      !! if the condition number or the distance is
        type(singularity_space) :: singularity                  !! if the distance is
        type(thread_space), pointer :: next => null()           !! idle as well
    end type thread_space

    !> Scratch that no thread is using: a list, changed by one thread at a time.
    type :: space_pool
        type(thread_space), pointer :: first => null()
    end type space_pool

    !> Equations planned once for many batches of the same kind, also at the same time. Freed by `free`.
    type :: inverse_solver
        type(equations_type) :: equations
        type(error_probe), allocatable :: probe                 !! there if errors are wanted
        type(second_look), pointer :: look => null()            !! there if samples may want one
        type(condition_type), pointer :: condition => null()    !! there if the condition number or the distance is
        logical :: wants_distance = .false.
        integer :: n_expected = 0                               !! samples of all batches together; 0: not known
        logical :: is_one_of_many = .false.                     !! models that share kernels: a record is this one's alone
        type(record_shelf), pointer :: records => null()        !! there if the scene may be recorded
        type(shared_places) :: places                           !! there if it may, or if records close its groups
        logical, private :: owns_places = .false.
        type(sample_assembly) :: at_start                       !! of samples outside a motion; not there: made anew
        type(space_pool), pointer, private :: pool => null()    !! not there: scratch is made for every batch
    contains
        procedure :: is_prepared
        procedure :: free => free_solver
    end type inverse_solver

contains

    !> Plan the equations for the results wanted.
    subroutine prepare_inverse(model, options, wants_reactions, solver, status)
        type(model_type), intent(in) :: model
        type(inverse_options), intent(in) :: options
        logical, intent(in) :: wants_reactions
        type(inverse_solver), intent(out) :: solver
        type(status_type), intent(inout) :: status

        solver%n_expected = options%n_expected
        solver%is_one_of_many = associated(options%family)
        if (options%wants_forces) then
            call build_equations(model, options%solver, wants_reactions, solver%equations, status)
            if (status%is_ok()) call share_equations(model, options%family, solver%equations)
        else
            call build_no_equations(model, solver%equations)
        end if
        ! what stops before it is exact stops alike in similar mechanisms: nothing would tell of it
        if (status%is_ok() .and. options%wants_errors .and. friction_is_shared(model)) &
            call fail(status, status_bad_input, "joint "//quoted(model%joint(model%contact(1)%joint)%name)//": friction comes of " &
                //"reactions that the equations leave open, and has no error estimate (expected no estimates, or no friction)")
        if (status%is_ok() .and. options%wants_errors) then
            allocate (solver%probe)
            call make_probe(model, options%solver, wants_reactions, solver%probe, status)
        end if
        if (options%wants_forces .and. size(model%group) > 0 .and. .not. friction_is_shared(model)) allocate (solver%look)
        solver%wants_distance = options%wants_distance
        if (options%wants_distance) solver%equations%needs_columns = .true.
        if (status%is_ok() .and. (options%wants_distance .or. (options%wants_rcond .and. options%solver /= solver_lapack))) then
            if (drives_share(model)) then
                call fail(status, status_bad_input, "actuator "//quoted(model%scene%actuator(model%n_actuator)%name) &
                          //": there are more actuators than coordinates, which leaves no square matrix, no condition number and " &
                          //"no distance to a singular position")
                return
            end if
            allocate (solver%condition)
            call make_condition(model, solver%equations%unknown, solver%condition)
        end if
        if (.not. status%is_ok()) return
        if (has_assemblies(model)) call make_room(model, 1, solver%at_start)
        allocate (solver%pool)
        if (options%by_record .and. any(options%solver == [solver_elimination, solver_reduced]) .and. .not. (options%wants_errors &
            .or. options%wants_rcond .or. options%wants_distance)) then
            allocate (solver%records)
        end if
        if (.not. options%by_record) return
        solver%owns_places = .not. associated(options%places)
        if (solver%owns_places) then
            call solver%places%prepare(model)
        else
            solver%places = options%places
        end if
    end subroutine prepare_inverse

    !> Room for what is made when it is wanted first.
    subroutine prepare_places(self, model)
        class(shared_places), intent(inout) :: self
        type(model_type), intent(in) :: model

        if (size(model%group) > 0) allocate (self%closing, self%nodes)
        allocate (self%poses)
    end subroutine prepare_places

    !> Nobody may be using them.
    subroutine free_places(self)
        class(shared_places), intent(inout) :: self

        if (associated(self%closing)) then
            call self%closing%free()
            deallocate (self%closing)
        end if
        if (associated(self%nodes)) deallocate (self%nodes)
        if (associated(self%poses)) deallocate (self%poses)
    end subroutine free_places

    pure logical function is_prepared(self)
        class(inverse_solver), intent(in) :: self

        is_prepared = associated(self%pool)
    end function is_prepared

    !> Give the scratch back. No batch may be running.
    subroutine free_solver(self)
        class(inverse_solver), intent(inout) :: self
        type(thread_space), pointer :: space

        call free_equations(self%equations)
        if (allocated(self%probe)) call free_probe(self%probe)
        if (associated(self%look)) then
            call free_look(self%look)
            deallocate (self%look)
        end if
        if (associated(self%condition)) then
            call free_condition(self%condition)
            deallocate (self%condition)
        end if
        if (associated(self%records)) then
            call self%records%free()
            deallocate (self%records)
        end if
        if (self%owns_places) call self%places%free()
        if (.not. associated(self%pool)) return
        do while (associated(self%pool%first))
            space => self%pool%first
            self%pool%first => space%next
            call free_space(space)
        end do
        deallocate (self%pool)
    end subroutine free_solver

    ! ---------------------------------------------------------------- scratch

    !> Idle scratch, or new.
    subroutine take_space(model, solver, space)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        type(thread_space), pointer, intent(out) :: space

        nullify (space)
        if (associated(solver%pool)) then
            call hold_lock()
            space => solver%pool%first
            if (associated(space)) solver%pool%first => space%next
            call release_lock()
        end if
        if (associated(space)) return
        allocate (space)
        call prepare_workspace(model, solver%equations, space%workspace)
        allocate (space%reaction(lanes, model%n_component, model%n_joint))
        allocate (space%values(lanes, 0))
        call prepare_measures(model, space%measures)
        if (allocated(solver%probe)) call prepare_probe_space(solver%probe, space%probe)
        if (associated(solver%condition)) call prepare_condition(solver%condition, space%condition)
        if (solver%wants_distance) then
            call prepare_singularity(model, solver%condition, space%singularity)
        end if
    end subroutine take_space

    subroutine return_space(solver, space)
        type(inverse_solver), intent(in) :: solver
        type(thread_space), pointer, intent(inout) :: space

        if (.not. associated(solver%pool)) then
            call free_space(space)
            return
        end if
        call hold_lock()
        space%next => solver%pool%first
        solver%pool%first => space
        call release_lock()
    end subroutine return_space

    subroutine free_space(space)
        type(thread_space), pointer, intent(inout) :: space

        call space%workspace%free()
        call space%probe%free()
        call space%doubt%free()
        call space%condition%free()
        call space%singularity%free()
        deallocate (space)
    end subroutine free_space
end module linkdyn_inverse_solver
