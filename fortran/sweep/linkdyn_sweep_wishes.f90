!> What a command or a call adds to the wishes of a scene's sweep.
module linkdyn_sweep_wishes
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_suggest, only: suggestion
    use linkdyn_sweep_spec, only: sweep_spec, quantity_name
    use linkdyn_text, only: quoted, join
    implicit none (type, external)
    private
    public :: choose_kept

contains

    !> Keep these quantities of every sample too: names with commas between.
    subroutine choose_kept(list, spec, status)
        character(len=*), intent(in) :: list
        type(sweep_spec), intent(inout) :: spec
        type(status_type), intent(inout) :: status
        integer :: first, last, id

        first = 1
        do while (first <= len(list) + 1)
            last = first + scan(list(first:)//",", ",") - 2
            id = findloc(quantity_name == list(first:last), .true., dim=1)
            if (id == 0) then
                call fail(status, status_bad_input, "keep: "//quoted(list(first:last))//" is no quantity (expected some of "// &
                    join(quantity_name)//")"//suggestion(list(first:last), quantity_name))
                return
            end if
            spec%keeps(id) = .true.
            spec%wants(id) = .true.
            first = last + 2
        end do
    end subroutine choose_kept
end module linkdyn_sweep_wishes
