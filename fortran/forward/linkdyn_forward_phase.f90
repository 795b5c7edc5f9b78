!> A part of a forward run in which the same coordinates are integrated: its model, its equations.
module linkdyn_forward_phase
    use linkdyn_condition, only: make_condition
    use linkdyn_coordinate_watch, only: prepare_watch
    use linkdyn_equation_kernels, only: kernel_family
    use linkdyn_equations, only: build_equations, share_equations, unknown_choice, solver_elimination, solver_lapack
    use linkdyn_exchange, only: coordinate_now, is_same_place
    use linkdyn_forward_record, only: evaluations_before_record
    use linkdyn_forward_state, only: fill_start
    use linkdyn_forward_system, only: forward_system, build_forward_system
    use linkdyn_forward_unknowns, only: choose_unknowns
    use linkdyn_integrator, only: integrator_options
    use linkdyn_inverse, only: inverse_solver
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_shared_programs, only: shared_programs, hold_programs, kernels_of
    use linkdyn_scene, only: n_chamber
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: forward_options, phase_box, plan_phase, enter_phase, release_phase, rates_by_record

    type :: forward_options
        type(integrator_options) :: integrator = integrator_options()
        real(wp) :: t_start = 0                        !! [s]
        integer :: stage_solver = 0                    !! of the right-hand side, which needs no reactions; 0: the fastest
        integer :: solver = solver_elimination         !! of the forces at output instants
        logical :: wants_reactions = .true.
        logical :: wants_rcond = .false.               !! condition number at output instants; solver lapack always has it
        logical :: switches = .true.                   !! a coordinate at its dead point is exchanged for another joint variable
        integer :: threads = 1
        logical :: events_end = .true.                 !! an event whose `do` is "stop" ends the run; false: it is noted
        logical :: sees_events = .false.               !! results are wanted on both sides of what happens, too
        logical :: by_record = .true.                  !! rates by a record of the scene, where it has one; false: by lanes alone
        logical :: listens = .false.                   !! Ctrl-C of the program that called us is a pause, too
        type(shared_programs), pointer :: shared => null()    !! of the model's records, by whoever runs it again; null: nobody does
    end type forward_options

    type :: forward_phase
        integer, allocatable :: choice(:)              !! joint variable that stands in for a coordinate; 0: none does (n_q)
        type(model_type), pointer :: model => null()
        logical :: owns_model = .false.                !! else it is the user's
        logical :: is_refused = .false.                !! it cannot be planned
        type(forward_system), pointer :: system => null()
        type(inverse_solver) :: output                 !! equations at output instants
    end type forward_phase

    type :: phase_box
        type(forward_phase), pointer :: phase => null()
    end type phase_box

contains

    !> Equations of the stages and of the output, for the phase's model.
    subroutine plan_phase(own, options, phase, status)
        type(model_type), intent(in), target :: own    !! with the user's coordinates; must outlive the phase
        type(forward_options), intent(in) :: options
        type(forward_phase), intent(inout) :: phase
        type(status_type), intent(inout) :: status
        type(unknown_choice) :: unknown
        type(kernel_family), pointer :: kernels

        allocate (phase%system)
        if (associated(phase%model, own) .and. associated(options%shared)) &
            call hold_programs(phase%system%shared, options%shared)
        call build_forward_system(phase%model, options%stage_solver, phase%system, status, own)
        call choose_unknowns(phase%model, unknown, status)
        if (status%is_ok()) call build_equations(phase%model, options%solver, options%wants_reactions, &
                                                 phase%output%equations, status, unknown)
        if (status%is_ok()) then
            call kernels_of(phase%model, phase%system%shared, kernels)
            call share_equations(phase%model, kernels, phase%output%equations)
        end if
        if (status%is_ok() .and. options%wants_rcond .and. options%solver /= solver_lapack) then
            allocate (phase%output%condition)
            call make_condition(phase%model, unknown, phase%output%condition)
        end if
        if (.not. status%is_ok()) return
        phase%system%own => own
        phase%system%lanes_are_one = .true.
        phase%system%may_end = options%events_end
        phase%system%may_record = rates_by_record(options)
        ! others stand in for a short time only
        if (.not. associated(phase%model, own)) phase%system%way%n_before_record = evaluations_before_record(phase%model)
        call prepare_watch(phase%model, unknown%acceleration, phase%system%watch)
        phase%system%watch%may_exchange = options%switches
        call phase%system%watch_ends(options%integrator%rtol, options%integrator%atol)
    end subroutine plan_phase

    !> A dense solver asked for by name stays with the lanes.
    pure logical function rates_by_record(options)
        type(forward_options), intent(in) :: options

        rates_by_record = options%by_record .and. (options%stage_solver == 0 .or. options%stage_solver == solver_elimination)
    end function rates_by_record

    !> Bring a phase to where another one stands, by a model planned for that place.
    !>
    !> **Errors**: what the equations refuse. `fits` is false if the links do not come to the same place.
    subroutine enter_phase(own, options, from, y_from, t, model, phase, y, fits, status)
        type(model_type), intent(in), target :: own
        type(forward_options), intent(in) :: options
        type(forward_phase), intent(in) :: from
        real(wp), intent(in) :: y_from(:, :)           !! (lane, n)
        real(wp), intent(in) :: t                      !! [s]
        type(model_type), intent(in) :: model
        type(forward_phase), intent(inout) :: phase
        real(wp), allocatable, intent(out) :: y(:, :)
        logical, intent(out) :: fits
        type(status_type), intent(inout) :: status
        real(wp) :: counted(own%n_q), turns(own%n_q), value, rate
        integer :: k, i

        fits = .false.
        if (.not. phase%owns_model) allocate (phase%model)
        phase%owns_model = .true.
        phase%model = model
        if (.not. associated(phase%system)) call plan_phase(own, options, phase, status)
        if (.not. status%is_ok()) return
        do k = 1, own%n_q
            call coordinate_now(own, from%model, from%system%watch%state, k, counted(k), rate)
            call coordinate_now(own, from%model, from%system%watch%state, k, value, rate, turns(k))
        end do
        associate (start => model%scene%coordinate, system => phase%system)
            system%model => phase%model
            allocate (y(lanes, system%n))
            call fill_start(model, system%layout, spread(start%start_position, 1, lanes), &
                            spread(start%start_velocity, 1, lanes), y, counted)
            system%turns = 0
            do k = 1, own%n_q
                if (phase%choice(k) == 0 .and. system%layout%position(k) > 0) &
                    system%turns(:, system%layout%position(k)) = turns(k)
            end do
            y(:, system%layout%work) = y_from(:, from%system%layout%work)
            do k = 1, size(system%layout%integral)
                call copy(from%system%layout%integral(k), system%layout%integral(k))
                call copy(from%system%layout%slope(k), system%layout%slope(k))
            end do
            do k = 1, size(system%layout%current)
                call copy(from%system%layout%current(k), system%layout%current(k))
                associate (before => from%system%layout%pressure(k), place => system%layout%pressure(k))
                    if (place == 0) cycle
                    do i = 0, n_chamber - 1
                        call copy(before + i, place + i)
                    end do
                end associate
            end do
            call system%take_over(from%system, t, y)
            call system%look_at(spread(t, 1, lanes), y)
            fits = is_same_place(model, system%watch%state, from%system%watch%state)
        end associate

    contains

        !> What a controller, a motor or a cylinder has in y.
        subroutine copy(place_before, place)
            integer, intent(in) :: place_before, place    !! 0: it has none

            if (place > 0) y(:, place) = y_from(:, place_before)
        end subroutine copy
    end subroutine enter_phase

    subroutine release_phase(phase)
        type(forward_phase), intent(inout) :: phase

        call phase%output%free()                       ! whose kernels the system holds
        if (associated(phase%system)) then
            call phase%system%release()
            deallocate (phase%system)
        end if
        if (phase%owns_model) deallocate (phase%model)
    end subroutine release_phase
end module linkdyn_forward_phase
