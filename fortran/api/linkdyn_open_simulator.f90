!> A simulator behind a handle.
module linkdyn_open_simulator
    use, intrinsic :: iso_c_binding, only: c_intptr_t
    use linkdyn_handles, only: held_thing, make_handle, take, give_back
    use linkdyn_integrator, only: integrator_options
    use linkdyn_kinds, only: wp
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_model, only: model_type
    use linkdyn_simulator, only: simulator_type
    use linkdyn_status, only: status_type, fail, status_bad_input
    implicit none (type, external)
    private
    public :: open_simulator, start_simulator, set_simulator, take_simulator, leave_simulator

    type, extends(held_thing) :: open_simulator
        type(simulator_type) :: is
    contains
        procedure :: release
    end type open_simulator

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
    subroutine set_simulator(simulator, t, q, qd, status)
        type(open_simulator), intent(inout) :: simulator
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: q(:), qd(:)            !! (n_q)
        type(status_type), intent(inout) :: status

        call hold_texts()
        call simulator%is%set(t, q, qd, status)
        call release_texts()
    end subroutine set_simulator

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
end module linkdyn_open_simulator
