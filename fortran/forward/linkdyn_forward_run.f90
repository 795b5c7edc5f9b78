!> A run of forward dynamics under way: where it has got to, and what it holds.
module linkdyn_forward_run
    use linkdyn_coordinate_watch, only: dead_coordinate
    use linkdyn_forward_kinks, only: kink_list
    use linkdyn_forward_phase, only: forward_options, phase_box, release_phase
    use linkdyn_forward_system, only: forward_system
    use linkdyn_heard_tables, only: heard_table
    use linkdyn_integrator, only: integrator_type
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_status, only: sample_ok
    use linkdyn_turns, only: turn_count
    implicit none (type, external)
    private
    public :: forward_run, passed_now, finish_forward

    !> A run under way.
    type :: forward_run
        type(model_type), pointer :: own => null()     !! with the user's coordinates
        type(model_type), pointer :: model => null()   !! with those integrated now
        type(forward_system), pointer :: system => null()
        type(integrator_type) :: integrator
        type(forward_options) :: options
        type(phase_box), allocatable :: known(:)       !! phases planned so far, or refused; none: a member of an ensemble
        integer :: phase = 1                           !! of them the one under way
        integer, allocatable :: later_phase(:)         !! phases entered since the start
        real(wp), allocatable :: entered_at(:)         !! [s]
        integer :: step_entered = -1                   !! steps done when the phase was entered
        integer :: n_exchanged = 0                     !! coordinates since the last step
        integer :: dead_coordinate = 0                 !! that the run has stopped at; 0: none
        real(wp), allocatable :: y(:, :)               !! reached by the steps (lane, n)
        real(wp), allocatable :: output(:, :)          !! at the instant of output (lane, n)
        type(turn_count) :: turns                      !! of the samples given
        integer :: n_crossed = 0                       !! change points passed before the last sample computed
        integer :: n_passed = 0                        !! before the last sample given, or where the run has stopped
        type(kink_list) :: kinks
        type(heard_table), allocatable :: heard(:)     !! tables beyond whose ends there is no run; none: a member of an ensemble
        logical :: has_stopped = .false.
        logical :: is_over = .false.                   !! an event has ended it, of which the last sample tells
        real(wp) :: good_until = 0                     !! [s]
        real(wp) :: t_given = -huge(1.0_wp)            !! instant of the last sample given [s]
        logical :: outputs_wait = .false.              !! states of output are not evaluated yet
        logical :: wants_outputs = .false.             !! they have to be: the phase is about to change
        character(len=256) :: reason = ""              !! why it stopped
        integer :: beyond = sample_ok                  !! status of the samples behind that; `sample_ok`: what each of them tells
    end type forward_run

contains

    !> Change points passed up to the sample computed last, or, where the run cannot go on to it, up to where it has stopped.
    pure integer function passed_now(run) result(n)
        type(forward_run), intent(in) :: run

        n = run%n_crossed
        if (run%has_stopped .and. .not. run%is_over) n = max(n, run%system%way%assembly%n_crossed(1))
    end function passed_now

    !> Release what the run holds.
    subroutine finish_forward(run)
        type(forward_run), intent(inout) :: run
        integer :: i

        call run%integrator%finish()
        if (allocated(run%known)) then
            do i = 1, size(run%known)
                call release_phase(run%known(i)%phase)
                deallocate (run%known(i)%phase)
            end do
            deallocate (run%known)
        else if (associated(run%system)) then
            call run%system%release()
            deallocate (run%system)
        end if
        nullify (run%system)
    end subroutine finish_forward
end module linkdyn_forward_run
