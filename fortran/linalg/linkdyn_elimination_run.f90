!> Execute an elimination plan on a block of lanes: the tight loop under every large sweep.
module linkdyn_elimination_run
    use linkdyn_elimination_plan, only: elimination_plan
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: run_plan, load_constants

contains

    !> Put the plan's constants into their slots, once a workspace.
    pure subroutine load_constants(plan, slot)
        type(elimination_plan), intent(in) :: plan
        real(wp), intent(inout) :: slot(lanes, *)
        integer :: k

        do k = 1, size(plan%constant)
            slot(:, plan%constant_slot(k)) = plan%constant(k)
        end do
    end subroutine load_constants

    !> Run the record. `alarm` above one on a lane, or NaN, says that multipliers or inverse pivots there are far larger
    !> than at the representative poses: the fixed pivots are not to be trusted on it.
    !>
    !> **Cost**: 2 n_term + n_scale flops and n_reciprocal divisions a lane; two vector loads a term.
    pure subroutine run_plan(plan, slot, alarm)
        type(elimination_plan), intent(in) :: plan
        real(wp), intent(inout) :: slot(lanes, *)
        real(wp), intent(out) :: alarm(lanes)
        real(wp) :: sum(lanes)
        integer :: t, k, term

        alarm = 0
        term = 0
        do t = 1, plan%n_operation
            sum = slot(:, plan%base(t))
            if (plan%last_minus(t) < 0) then
                sum = 1/sum
            else
                do k = term + 1, plan%last_minus(t)
                    sum = sum - slot(:, plan%left(k))*slot(:, plan%right(k))
                end do
                do k = plan%last_minus(t) + 1, plan%last_plus(t)
                    sum = sum + slot(:, plan%left(k))*slot(:, plan%right(k))
                end do
                if (plan%scale(t) > 0) sum = sum*slot(:, plan%scale(t))
            end if
            term = plan%last_plus(t)
            slot(:, plan%out(t)) = sum
            ! A sum and not a maximum: it passes NaN on. Of squares: thousands of harmless terms stay below one.
            if (plan%alarm(t) > 0) alarm = alarm + (sum*plan%alarm(t))**2
        end do
    end subroutine run_plan
end module linkdyn_elimination_run
