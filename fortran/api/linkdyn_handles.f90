!> Numbers that stand for scenes, runs and sweeps outside of Fortran.
!>
!> A number is looked up, never followed: one that is invented or was closed is found out. What it stands for can be in use
!> by several threads; if it is closed meanwhile, the last of them releases it.
module linkdyn_handles
    use, intrinsic :: iso_c_binding, only: c_intptr_t
    use linkdyn_lock, only: hold_lock, release_lock, hold_texts, release_texts
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: held_thing, make_handle, take, give_back, close_handle, status_closed

    integer, parameter :: status_closed = 7                    !! beside the engine's codes: the handle stands for nothing
    integer(c_intptr_t), parameter :: most_open = 65535        !! the other bits of a number tell tenants of a place apart

    !> What a handle can stand for.
    type, abstract :: held_thing
    contains
        procedure(release_thing), deferred :: release          !! give back what it holds
    end type held_thing

    abstract interface
        subroutine release_thing(self)
            import :: held_thing
            class(held_thing), intent(inout) :: self
        end subroutine release_thing
    end interface

    !> A place for one thing after the other. The handle is the place and the number of its tenant.
    type :: place_type
        class(held_thing), pointer :: thing => null()          !! null: free
        integer(c_intptr_t) :: tenant = 0
        integer :: n_user = 0                                  !! calls that are using it
        logical :: is_alone = .false.                          !! and one of them alone
        logical :: is_closed = .false.
    end type place_type

    type(place_type), allocatable, save :: places(:)           !! changed under the lock alone

contains

    !> A number for a thing, which belongs to the list from now on.
    subroutine make_handle(thing, handle, status)
        class(held_thing), pointer, intent(in) :: thing
        integer(c_intptr_t), intent(out) :: handle             !! never 0 but where the call fails
        type(status_type), intent(inout) :: status
        type(place_type), allocatable :: longer(:)
        integer(c_intptr_t), parameter :: most_tenants = huge(0_c_intptr_t)/(most_open + 1)
        integer(c_intptr_t) :: i

        handle = 0
        call hold_lock()
        if (.not. allocated(places)) allocate (places(0))
        do i = 1, size(places)
            if (.not. associated(places(i)%thing)) exit
        end do
        if (i > size(places) .and. i <= most_open) then
            allocate (longer(min(2*i, most_open)))
            longer(:i - 1) = places
            call move_alloc(longer, places)
        end if
        if (i <= most_open) then
            places(i)%thing => thing
            places(i)%tenant = 1 + modulo(places(i)%tenant, most_tenants - 1)
            handle = i + (most_open + 1)*places(i)%tenant
        end if
        call release_lock()
        if (handle /= 0) return
        call hold_texts()
        call fail(status, status_bad_input, "more than "//to_text(int(most_open)) &
                  //" scenes and runs are open (expected that they are closed)")
        call release_texts()
    end subroutine make_handle

    !> Use the thing of a handle, until `give_back`. Who wants it alone is refused while others use it, and they are.
    subroutine take(handle, kind, alone, thing, status)
        integer(c_intptr_t), intent(in) :: handle
        character(len=*), intent(in) :: kind                   !! "scene", "run", ...: for messages
        logical, intent(in) :: alone
        class(held_thing), pointer, intent(out) :: thing       !! null: the call has failed
        type(status_type), intent(inout) :: status
        integer(c_intptr_t) :: i
        logical :: is_busy

        nullify (thing)
        is_busy = .false.
        call hold_lock()
        i = place_of(handle)
        if (i > 0) then
            associate (place => places(i))
                is_busy = place%n_user > 0 .and. (alone .or. place%is_alone)
                if (.not. is_busy) then
                    thing => place%thing
                    place%n_user = place%n_user + 1
                    place%is_alone = alone
                end if
            end associate
        end if
        call release_lock()
        if (associated(thing)) return
        call hold_texts()
        if (is_busy) then
            call fail(status, status_bad_input, "this "//kind//" is in use by another thread")
        else
            call refuse(handle, kind, status)
        end if
        call release_texts()
    end subroutine take

    !> The end of a use.
    subroutine give_back(handle)
        integer(c_intptr_t), intent(in) :: handle
        class(held_thing), pointer :: left

        nullify (left)
        call hold_lock()
        associate (place => places(modulo(handle, most_open + 1)))
            place%n_user = place%n_user - 1
            place%is_alone = .false.
            if (place%is_closed) call vacate(place, left)
        end associate
        call release_lock()
        call destroy(left)
    end subroutine give_back

    !> Forget a thing. Calls that are using it end as if nothing had happened.
    subroutine close_handle(handle, kind, status)
        integer(c_intptr_t), intent(in) :: handle
        character(len=*), intent(in) :: kind                   !! for messages
        type(status_type), intent(inout) :: status
        class(held_thing), pointer :: left
        integer(c_intptr_t) :: i

        nullify (left)
        call hold_lock()
        i = place_of(handle)
        if (i > 0) then
            places(i)%is_closed = .true.
            call vacate(places(i), left)
        end if
        call release_lock()
        if (i == 0) call refuse(handle, kind, status)
        call destroy(left)
    end subroutine close_handle

    subroutine refuse(handle, kind, status)
        integer(c_intptr_t), intent(in) :: handle
        character(len=*), intent(in) :: kind
        type(status_type), intent(inout) :: status

        if (handle == 0) then
            call fail(status, status_closed, "the handle of the "//kind//" is null (expected one that was opened)")
        else
            call fail(status, status_closed, "this "//kind//" was closed")
        end if
    end subroutine refuse

    !> Where the thing of an open handle stands; 0: nowhere. Under the lock.
    pure integer(c_intptr_t) function place_of(handle) result(i)
        integer(c_intptr_t), intent(in) :: handle

        i = 0
        if (handle <= most_open .or. .not. allocated(places)) return
        i = modulo(handle, most_open + 1)
        if (i > size(places)) i = 0
        if (i == 0) return
        if (.not. is_held(places(i), handle)) i = 0
    end function place_of

    !> Is the thing in the place the one that the handle stands for?
    pure logical function is_held(place, handle)
        type(place_type), intent(in) :: place
        integer(c_intptr_t), intent(in) :: handle

        is_held = associated(place%thing) .and. .not. place%is_closed .and. place%tenant == handle/(most_open + 1)
    end function is_held

    !> Free the place of a thing that nobody uses any more. Under the lock.
    subroutine vacate(place, left)
        type(place_type), intent(inout) :: place
        class(held_thing), pointer, intent(inout) :: left      !! to be destroyed; null: it is in use

        if (place%n_user > 0) return
        left => place%thing
        nullify (place%thing)
        place%is_closed = .false.
    end subroutine vacate

    subroutine destroy(thing)
        class(held_thing), pointer, intent(inout) :: thing

        if (.not. associated(thing)) return
        call thing%release()
        deallocate (thing)
    end subroutine destroy
end module linkdyn_handles
