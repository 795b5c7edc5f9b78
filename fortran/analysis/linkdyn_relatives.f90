!> Scenes made of one another by other values, as in a loop over designs: they share kernels, made for the first of them that needs
!> some, with numbers for inputs. Who holds them may come and go on any thread; they end with the last one.
module linkdyn_relatives
    use linkdyn_equation_kernels, only: kernel_family, find_family, end_family
    use linkdyn_holders, only: holder_count
    use linkdyn_lock, only: hold_records, release_records
    use linkdyn_model, only: model_type
    implicit none (type, external)
    private
    public :: relatives, hold_relatives, family_of, leave_relatives

    type :: relatives
        type(kernel_family), pointer, private :: first => null()    !! a list: a scene may be made of another by more than numbers
        type(holder_count), private :: holders
    end type relatives

contains

    !> Hold the relatives of somebody else; null: become the first of some.
    subroutine hold_relatives(of_another, mine)
        type(relatives), pointer, intent(in) :: of_another
        type(relatives), pointer, intent(out) :: mine

        mine => of_another
        if (.not. associated(mine)) allocate (mine)
        call mine%holders%come()
    end subroutine hold_relatives

    !> Those whose kernels serve a model too; null: it needs its own.
    subroutine family_of(model, mine, family)
        type(model_type), intent(in) :: model
        type(relatives), intent(inout) :: mine
        type(kernel_family), pointer, intent(out) :: family

        call hold_records()
        call find_family(model, mine%first, family)
        call release_records()
    end subroutine family_of

    !> The end of a use; nothing for whoever holds none. Nobody who holds them may be using kernels of theirs.
    subroutine leave_relatives(mine)
        type(relatives), pointer, intent(inout) :: mine
        type(kernel_family), pointer :: family
        logical :: is_last

        if (.not. associated(mine)) return
        call mine%holders%go(is_last)
        if (is_last) then
            do while (associated(mine%first))
                family => mine%first
                mine%first => family%next
                call end_family(family)
            end do
            deallocate (mine)
        end if
        nullify (mine)
    end subroutine leave_relatives
end module linkdyn_relatives
