!> Where groups closed by iteration were at the stage tried last on each lane.
!>
!> The tangents at the accepted state predict a stage to the square of its distance. In the long steps of extrapolation and of
!> stiff methods that is too far for Newton's iteration to be believed, while the stage before on the same lane is a substep
!> away. Whichever promises the smaller error of the two is led on. Each step of such a chain is judged as one from the accepted
!> state is; the chain ends where that state changes, and a new one begins with each step that is tried, whatever was looked
!> at before.
module linkdyn_stage_places
    use linkdyn_carried_assembly, only: carried_assembly
    use linkdyn_group_stride, only: predict
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, place_size
    implicit none (type, external)
    private
    public :: stage_places, prepare_stage_places, forget_stages, predict_stage, keep_stage

    type :: stage_places
        private
        real(wp), allocatable :: q(:, :)               !! coordinates of the stage (n_q, lane)
        real(wp), allocatable :: place(:, :, :)        !! of the links there (place_size, n_link, lane)
        real(wp), allocatable :: from(:, :, :)         !! likewise, at the accepted state that it was tried from
        logical :: is_there(lanes) = .false.
    end type stage_places

contains

    subroutine prepare_stage_places(model, stage)
        type(model_type), intent(in) :: model
        type(stage_places), intent(out) :: stage

        allocate (stage%q(model%n_q, lanes), stage%place(place_size(model), model%n_link, lanes), source=0.0_wp)
        stage%from = stage%place
    end subroutine prepare_stage_places

    !> The next stages are the first ones.
    pure subroutine forget_stages(stage)
        type(stage_places), intent(inout) :: stage

        stage%is_there = .false.
    end subroutine forget_stages

    !> Where the way to a stage begins, at the accepted state or at the stage before, and where the tangents lead from there.
    pure subroutine predict_stage(model, assembly, stage, lane, q, from, stand, ahead)
        type(model_type), intent(in) :: model
        type(carried_assembly), intent(in) :: assembly !! of the accepted state
        type(stage_places), intent(in) :: stage
        integer, intent(in) :: lane
        real(wp), intent(in) :: q(:)                   !! coordinates of the stage (n_q)
        real(wp), intent(out) :: from(:)               !! likewise, where the way begins
        real(wp), intent(out) :: stand(:, :)           !! places there (place_size, n_link)
        real(wp), intent(out), contiguous :: ahead(:, :)    !! likewise, predicted
        logical :: goes_on

        from = assembly%q(lane, :)
        stand = assembly%place(lane, :, :)
        goes_on = stage%is_there(lane)
        if (goes_on) goes_on = all(stage%from(:, :, lane) == stand)
        ! the same tangents serve: they are those of a place as far away as the stage before
        if (goes_on) goes_on = length(q - stage%q(:, lane))*length(stage%q(:, lane) - from) < length(q - from)**2
        if (goes_on) then
            from = stage%q(:, lane)
            stand = stage%place(:, :, lane)
        end if
        ahead = stand
        call predict(model, assembly%column(lane, :, :, :), q - from, ahead)

    contains

        !> In strides.
        pure real(wp) function length(way)
            real(wp), intent(in) :: way(:)

            length = maxval(abs(way)/model%stride)
        end function length
    end subroutine predict_stage

    !> The next stage on a lane may set out from one that has been closed and believed.
    subroutine keep_stage(assembly, lane, is_believed, q, place, stage)
        type(carried_assembly), intent(in) :: assembly
        integer, intent(in) :: lane
        logical, intent(in) :: is_believed
        real(wp), intent(in) :: q(:)                   !! (n_q)
        real(wp), intent(in) :: place(:)               !! (place_size*n_link)
        type(stage_places), intent(inout) :: stage

        stage%is_there(lane) = is_believed
        if (.not. is_believed) return
        stage%q(:, lane) = q
        stage%place(:, :, lane) = reshape(place, shape(stage%place(:, :, lane)))
        stage%from(:, :, lane) = assembly%place(lane, :, :)
    end subroutine keep_stage
end module linkdyn_stage_places
