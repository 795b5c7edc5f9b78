!> Results of inverse dynamics straight into a block of a layout.
module linkdyn_block_results
    use linkdyn_inverse_results, only: inverse_results, is_of_inverse
    use linkdyn_results, only: layout_type, block_type, samples_width
    use linkdyn_result_kinds, only: result_status, result_assembly
    implicit none (type, external)
    private
    public :: put_into_block

contains

    !> Let results go where the block keeps them: all of the layout that inverse dynamics gives.
    subroutine put_into_block(layout, n, block, except, results)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: n                      !! samples
        type(block_type), intent(in), target :: block
        integer, intent(in) :: except(:)              !! `result_*` that the layout has from elsewhere
        type(inverse_results), intent(inout) :: results
        integer :: i

        do i = 1, size(layout%variable)
            associate (id => layout%variable(i)%id, width => samples_width(layout, layout%variable(i)))
                if (id == result_status) results%status => block%of(i)%integer(:n)
                if (id == result_assembly) results%assembly => block%of(i)%integer(:n)
                if (.not. is_of_inverse(id) .or. any(except == id)) cycle
                results%of(id)%x(1:width, 1:n) => block%of(i)%real
            end associate
        end do
    end subroutine put_into_block
end module linkdyn_block_results
