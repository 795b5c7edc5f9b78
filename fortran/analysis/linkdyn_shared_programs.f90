!> What is traced of a mechanism that is set going, for all who set it going: made by the first who needs it, freed when the last
!> one has left. Who holds it may come and go on any thread.
module linkdyn_shared_programs
    use linkdyn_equation_kernels, only: kernel_family, found_for_one, end_family
    use linkdyn_equation_programs, only: make_drive_program
    use linkdyn_equations_on_lanes, only: lane_program, prepare_lanes, free_lane_program
    use linkdyn_holders, only: holder_count
    use linkdyn_lock, only: hold_records, release_records
    use linkdyn_model, only: model_type
    use linkdyn_recorded_rates, only: recorded_rates, free_rates
    use linkdyn_representatives, only: representative_poses
    implicit none (type, external)
    private
    public :: shared_programs, hold_programs, leave_programs, kernels_of, drives_of, make_drive_kernel, free_drive_kernel

    type :: shared_programs
        type(recorded_rates), pointer :: rates => null()       !! null: nobody has needed them yet
        type(recorded_rates), pointer :: of_motion => null()   !! for the forces that the scene's motion asks for; null: the same
        logical :: agrees = .false.                            !! the rates are there, and are those that lanes find
        logical :: sees = .false.                              !! and so is what is seen of the ends of steps
        logical :: steps_agree = .false.                       !! whole steps are there, too, and lead to where their stages do
        type(representative_poses) :: poses                    !! of the mechanism
        type(kernel_family), pointer, private :: kernels => null()     !! of equations that lanes solve
        type(lane_program), pointer, private :: drives => null()       !! of laws that compare a joint's motion with another
        type(holder_count), private :: holders
    end type shared_programs

contains

    !> Hold programs: those of somebody else, or none yet.
    subroutine hold_programs(mine, of_another)
        type(shared_programs), pointer, intent(inout) :: mine     !! null before
        type(shared_programs), pointer, intent(in), optional :: of_another

        if (present(of_another)) mine => of_another
        if (.not. associated(mine)) allocate (mine)
        call mine%holders%come()
    end subroutine hold_programs

    !> Kernels of the equations of the one mechanism that all who hold these programs run; null: nobody shares any.
    subroutine kernels_of(model, mine, kernels)
        type(model_type), intent(in) :: model
        type(shared_programs), pointer, intent(in) :: mine
        type(kernel_family), pointer, intent(out) :: kernels

        nullify (kernels)
        if (.not. associated(mine)) return
        call hold_records()
        if (.not. associated(mine%kernels)) call found_for_one(model, mine%kernels)
        kernels => mine%kernels
        call release_records()
    end subroutine kernels_of

    !> The shared kernel of drive laws; null if nobody shares.
    subroutine drives_of(model, mine, drives)
        type(model_type), intent(in) :: model
        type(shared_programs), pointer, intent(in) :: mine
        type(lane_program), pointer, intent(out) :: drives

        nullify (drives)
        if (.not. associated(mine)) return
        call hold_records()
        if (.not. associated(mine%drives)) call make_drive_kernel(model, mine%drives)
        drives => mine%drives
        call release_records()
    end subroutine drives_of

    !> Make the kernel of laws that compare a joint's motion with another one.
    subroutine make_drive_kernel(model, drives)
        type(model_type), intent(in) :: model
        type(lane_program), pointer, intent(out) :: drives

        allocate (drives)
        call hold_records()
        call make_drive_program(model, drives%program)
        call release_records()
        call prepare_lanes(model, .false., drives)
    end subroutine make_drive_kernel

    subroutine free_drive_kernel(drives)
        type(lane_program), pointer, intent(inout) :: drives

        if (.not. associated(drives)) return
        call free_lane_program(drives)
        deallocate (drives)
    end subroutine free_drive_kernel

    !> The end of a use; nothing for whoever holds none.
    subroutine leave_programs(mine)
        type(shared_programs), pointer, intent(inout) :: mine
        logical :: is_last

        if (.not. associated(mine)) return
        call mine%holders%go(is_last)
        if (is_last) then
            call free(mine%rates)
            call free(mine%of_motion)
            call end_family(mine%kernels)
            call free_drive_kernel(mine%drives)
            deallocate (mine)
        end if
        nullify (mine)

    contains

        subroutine free(recorded)
            type(recorded_rates), pointer, intent(inout) :: recorded

            if (.not. associated(recorded)) return
            call free_rates(recorded)
            deallocate (recorded)
        end subroutine free
    end subroutine leave_programs
end module linkdyn_shared_programs
