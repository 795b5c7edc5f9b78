!> A simulator behind a handle.
module linkdyn_open_simulator
    use, intrinsic :: iso_c_binding, only: c_intptr_t
    use linkdyn_handles, only: held_thing, make_handle, take, give_back
    use linkdyn_integrator, only: integrator_options
    use linkdyn_kinds, only: wp
    use linkdyn_linearization, only: linearization
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_model, only: model_type
    use linkdyn_simulator, only: simulator_type, simulator_state
    use linkdyn_status, only: status_type, fail, status_bad_input
    implicit none (type, external)
    private
    public :: open_simulator, start_simulator, set_simulator, take_simulator, leave_simulator
    public :: keep_simulator, put_simulator_back, linearize_simulator

    type, extends(held_thing) :: open_simulator
        type(simulator_type) :: is
    contains
        procedure :: release
    end type open_simulator

    !> A state that a simulator has kept.
    type, extends(held_thing) :: kept_state
        integer(c_intptr_t) :: simulator = 0           !! whose it is
        type(simulator_state) :: is
    contains
        procedure :: release => release_state
    end type kept_state

contains

    !> A simulator of a scene's model, at its start.
    subroutine start_simulator(model, options, t, handle, status)
        type(model_type), intent(in) :: model
        type(integrator_options), intent(in) :: options
        real(wp), intent(in) :: t                      !! [s]
        integer(c_intptr_t), intent(out) :: handle
        type(status_type), intent(inout) :: status
        type(open_simulator), pointer :: new
        class(held_thing), pointer :: thing

        handle = 0
        allocate (new)
        call hold_texts()
        call new%is%open(model, options, t, status)
        call release_texts()
        thing => new
        if (status%is_ok()) call make_handle(thing, handle, status)
        if (status%is_ok()) return
        call new%release()
        deallocate (new)
    end subroutine start_simulator

    !> Put the mechanism somewhere else.
    subroutine set_simulator(simulator, t, q, qd, status, pressure)
        type(open_simulator), intent(inout) :: simulator
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: q(:), qd(:)            !! (n_q)
        type(status_type), intent(inout) :: status
        real(wp), intent(in), optional :: pressure(:, :)   !! (chamber, cylinder) [Pa]; absent: as a run would begin

        call hold_texts()
        call simulator%is%set(t, q, qd, status, pressure)
        call release_texts()
    end subroutine set_simulator

    !> Columns of a linearization where it stands.
    subroutine linearize_simulator(simulator, effort, follows_laws, found, status)
        type(open_simulator), intent(inout) :: simulator
        real(wp), intent(inout) :: effort(:)           !! (n_actuator) see `linkdyn_simulator`
        logical, intent(in) :: follows_laws
        type(linearization), intent(out) :: found
        type(status_type), intent(inout) :: status

        call hold_texts()
        call simulator%is%linearize(effort, follows_laws, found, status)
        call release_texts()
    end subroutine linearize_simulator

    !> Keep the state of a simulator.
    subroutine keep_simulator(handle, simulator, state_handle, status)
        integer(c_intptr_t), intent(in) :: handle      !! of the simulator
        type(open_simulator), intent(in) :: simulator
        integer(c_intptr_t), intent(out) :: state_handle       !! to be closed by whoever calls
        type(status_type), intent(inout) :: status
        type(kept_state), pointer :: new
        class(held_thing), pointer :: thing

        state_handle = 0
        allocate (new)
        new%simulator = handle
        call simulator%is%keep(new%is, status)
        thing => new
        if (status%is_ok()) call make_handle(thing, state_handle, status)
        if (.not. status%is_ok()) deallocate (new)
    end subroutine keep_simulator

    !> Put a simulator back to a state of its own.
    subroutine put_simulator_back(handle, simulator, state_handle, status)
        integer(c_intptr_t), intent(in) :: handle
        type(open_simulator), intent(inout) :: simulator
        integer(c_intptr_t), intent(in) :: state_handle
        type(status_type), intent(inout) :: status
        class(held_thing), pointer :: thing

        call take(state_handle, "state", .false., thing, status)
        if (.not. associated(thing)) return
        select type (thing)
        type is (kept_state)
            if (thing%simulator == handle) then
                call simulator%is%put_back(thing%is, status)
            else
                call fail(status, status_bad_input, "the state is another simulator's (expected one of this simulator)")
            end if
        class default
            call fail(status, status_bad_input, "the handle is not that of a simulator's state")
        end select
        call give_back(state_handle)
    end subroutine put_simulator_back

    !> Use a simulator alone until `leave_simulator`. Null: the call has failed.
    subroutine take_simulator(handle, simulator, status)
        integer(c_intptr_t), intent(in) :: handle
        type(open_simulator), pointer, intent(out) :: simulator
        type(status_type), intent(inout) :: status
        class(held_thing), pointer :: thing

        nullify (simulator)
        call take(handle, "simulator", .true., thing, status)
        if (.not. associated(thing)) return
        select type (thing)
        type is (open_simulator)
            simulator => thing
        class default
            call give_back(handle)
            call fail(status, status_bad_input, "the handle is not that of a simulator")
        end select
    end subroutine take_simulator

    subroutine leave_simulator(handle, simulator)
        integer(c_intptr_t), intent(in) :: handle
        type(open_simulator), pointer, intent(inout) :: simulator

        if (associated(simulator)) call give_back(handle)
        nullify (simulator)
    end subroutine leave_simulator

    subroutine release(self)
        class(open_simulator), intent(inout) :: self

        call self%is%close()
    end subroutine release

    !> It holds nothing but memory, which goes with it.
    subroutine release_state(self)
        class(kept_state), intent(inout) :: self
    end subroutine release_state
end module linkdyn_open_simulator
