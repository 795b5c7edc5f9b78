!> What the actuators do in forward dynamics, on lanes: driving forces from time and from the motion of their joints.
module linkdyn_evaluated_drives
    use linkdyn_effort_laws, only: compares_motion
    use linkdyn_drives, only: law_on_lanes, effort_scale
    use linkdyn_equation_programs, only: out_drives
    use linkdyn_given_numbers, only: prepare_numbers, take_coordinates
    use linkdyn_inputs, only: in_target
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_equations_on_lanes, only: lane_numbers, lane_program, lane_space, run_on_lanes, first_output, free_lane_space
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: effort_constant, effort_table, effort_dc_motor, effort_pd, effort_over
    use linkdyn_shared_programs, only: shared_programs, drives_of, free_drive_kernel, make_drive_kernel
    implicit none (type, external)
    private
    public :: evaluated_drives, evaluate_drives, leave_drives, free_drives

    !> Laws of drives of one run: the kernel of those that compare a joint's motion with a law, made when it is wanted first, by all
    !> runs that share programs together.
    type :: evaluated_drives
        type(lane_program), pointer, private :: lane => null()
        logical, private :: is_own = .false.
        type(lane_space), private :: space
        type(lane_numbers), private :: numbers
    end type evaluated_drives

contains

    !> What the laws of some actuators give, of every law but `inverse`: driving forces, or what is told by `side`. Laws over the
    !> state have their values there.
    subroutine evaluate_drives(model, is_wanted, t, n_used, state, shared, drives, force)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_wanted(:)           !! (n_actuator)
        real(wp), intent(in) :: t(lanes)              !! [s]
        integer, intent(in) :: n_used                 !! lanes
        type(kinematic_state), intent(in) :: state    !! positions and velocities are up to date
        type(shared_programs), pointer, intent(in) :: shared    !! of the model; null: nobody shares any
        type(evaluated_drives), intent(inout) :: drives
        real(wp), intent(inout) :: force(:, :)        !! those wanted (lane, n_actuator) [N, N m]
        real(wp) :: target(lanes, 2, model%n_actuator), rate2(lanes)
        integer :: i

        target = 0
        do i = 1, model%n_actuator
            associate (drive => model%scene%actuator(i)%law)
                if (is_wanted(i) .and. any(drive%kind == [effort_table, effort_dc_motor, effort_pd])) &
                    call law_on_lanes(drive%target, t, target(:, 1, i), target(:, 2, i), rate2)
            end associate
        end do
        if (any(is_wanted .and. compares_motion(model%scene%actuator%law))) &
            call compare_motion(model, target, n_used, state, shared, drives)
        do i = 1, model%n_actuator
            if (.not. is_wanted(i)) cycle
            associate (drive => model%scene%actuator(i)%law)
                force(:, i) = 0
                if (compares_motion(drive)) then
                    force(:, i) = drives%space%found(:, first_output(drives%lane, out_drives) + i - 1)
                else if (drive%kind == effort_constant) then
                    force(:, i) = drive%value(1)
                else if (drive%kind == effort_table) then
                    force(:, i) = target(:, 1, i)
                else if (drive%kind == effort_over) then
                    force(:, i) = state%law(:, drive%target%law)*effort_scale(model, i)
                end if
            end associate
        end do
    end subroutine evaluate_drives

    subroutine compare_motion(model, target, n_used, state, shared, drives)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: target(:, :, :)       !! (lane, 2, n_actuator)
        integer, intent(in) :: n_used
        type(kinematic_state), intent(in) :: state
        type(shared_programs), pointer, intent(in) :: shared
        type(evaluated_drives), intent(inout) :: drives

        if (.not. associated(drives%lane)) then
            call drives_of(model, shared, drives%lane)
            drives%is_own = .not. associated(drives%lane)
            if (drives%is_own) call make_drive_kernel(model, drives%lane)
            call prepare_numbers(model, .false., drives%numbers)
        end if
        call take_coordinates(model, state, drives%numbers)
        drives%numbers%of(in_target)%x = reshape(target, [lanes, 2*model%n_actuator])
        call run_on_lanes(drives%lane, n_used, state, drives%numbers, drives%space)
    end subroutine compare_motion

    !> Before shared programs are left: a kernel of its own stays.
    subroutine leave_drives(drives)
        type(evaluated_drives), intent(inout) :: drives

        if (.not. drives%is_own) call free_drives(drives)
    end subroutine leave_drives

    subroutine free_drives(drives)
        type(evaluated_drives), intent(inout) :: drives

        call free_lane_space(drives%space)
        if (drives%is_own) call free_drive_kernel(drives%lane)
        nullify (drives%lane)
        drives%is_own = .false.
        drives%numbers = lane_numbers()
    end subroutine free_drives
end module linkdyn_evaluated_drives
