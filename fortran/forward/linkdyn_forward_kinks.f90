!> Instants known beforehand at which the rates of a run are others than before: a law changes its formula, a payload is picked up,
!> brakes and clutches come on or off, a controller takes a sample.
!>
!> Whoever leads steps, a forward run or a simulator, ends one at each of them (`next_kink`) and draws its consequences there
!> (`pass_kink`). No step leads over one: its error estimate might not see it.
module linkdyn_forward_kinks
    use linkdyn_forward_system, only: forward_system
    use linkdyn_integrator, only: integrator_type
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_law_values, only: rows_over_time
    use linkdyn_laws, only: law_kinks
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: law_spec, n_clutch
    use linkdyn_time_laws, only: laws_over_time
    implicit none (type, external)
    private
    public :: kink_list, collect_kinks, next_kink, pass_kink, is_there_by

    type :: kink_list
        real(wp), allocatable, private :: ahead(:)     !! increasing [s]
        real(wp) :: passed = -huge(1.0_wp)             !! the last one, or instant of a controller [s]
    end type kink_list

contains

    ! ---------------------------------------------------------------- on the way

    !> The next instant at which a law changes its formula, or a controller does something; huge: none.
    pure real(wp) function next_kink(kinks, system) result(kink)
        type(kink_list), intent(in) :: kinks
        type(forward_system), intent(in) :: system

        kink = system%next_control()
        if (size(kinks%ahead) > 0) kink = min(kink, kinks%ahead(1))
    end function next_kink

    !> Is a kink to be passed before an instant is reached? What rounding puts behind the instant is at it.
    elemental logical function is_there_by(kink, t) result(is_there)
        real(wp), intent(in) :: kink, t                !! [s]

        is_there = .not. kink > t + 4*spacing(t)
    end function is_there_by

    !> The integrator has got to a kink: what changes there changes.
    subroutine pass_kink(kinks, system, integrator, y, kink)
        type(kink_list), intent(inout) :: kinks
        type(forward_system), intent(inout) :: system
        type(integrator_type), intent(inout) :: integrator
        real(wp), intent(inout) :: y(:, :)             !! there (lane, n)
        real(wp), intent(in) :: kink                   !! [s]
        logical :: is_changed

        is_changed = .false.
        if (.not. all(integrator%failed)) then
            call system%control_now(kink, y)
            call system%switch_now(kink, y, is_changed)
        end if
        if (is_changed) then
            call integrator%go_on_from(system, y)
            call system%show_side(spread(kink, 1, lanes), y, is_behind=.true.)
        end if
        where (system%way%is_driven_through) integrator%failed = .true.
        call integrator%reset()
        kinks%passed = kink
        kinks%ahead = pack(kinks%ahead, .not. is_there_by(kinks%ahead, kink))
    end subroutine pass_kink

    ! ---------------------------------------------------------------- collected beforehand

    !> Instants after the start at which any law of the scene changes its formula. Of tables over time that begin anew,
    !> those up to the end of the run.
    subroutine collect_kinks(model, t_start, t_end, kinks)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t_start, t_end         !! [s]
        type(kink_list), intent(out) :: kinks
        real(wp), allocatable :: kink(:)
        type(law_spec), allocatable :: law(:)
        integer :: i

        allocate (kink(0))
        law = laws_over_time(model%scene)
        do i = 1, size(law)
            call add_kinks(law(i), kink)
        end do
        associate (row => rows_over_time(model%scene%laws, t_start, t_end))
            do i = 1, size(row)
                call add_kink(row(i), kink)
            end do
        end associate
        do i = 1, model%n_actuator
            associate (brake => model%scene%actuator(i)%motor%brake)
                call add_span(brake%from, brake%until, kink)
            end associate
        end do
        do i = 1, n_clutch(model%scene)
            call add_span(model%scene%clutch(i)%from, model%scene%clutch(i)%until, kink)
        end do
        do i = 1, size(model%scene%payload)
            call add_span(model%scene%payload(i)%from, model%scene%payload(i)%until, kink)
        end do
        kinks%ahead = pack(kink, kink > t_start)
    end subroutine collect_kinks

    !> Merge the kinks of a law into a sorted list without doubles.
    subroutine add_kinks(law, kink)
        type(law_spec), intent(in) :: law
        real(wp), allocatable, intent(inout) :: kink(:)
        real(wp), allocatable :: new(:)
        integer :: i

        call law_kinks(law, new)
        do i = 1, size(new)
            call add_kink(new(i), kink)
        end do
    end subroutine add_kinks

    !> Ends of what is there from one instant until another, if it has ends.
    subroutine add_span(from, until, kink)
        real(wp), intent(in) :: from, until            !! [s]
        real(wp), allocatable, intent(inout) :: kink(:)

        if (abs(from) < huge(1.0_wp)) call add_kink(from, kink)
        if (abs(until) < huge(1.0_wp)) call add_kink(until, kink)
    end subroutine add_span

    subroutine add_kink(instant, kink)
        real(wp), intent(in) :: instant
        real(wp), allocatable, intent(inout) :: kink(:)

        if (any(kink == instant)) return
        kink = [pack(kink, kink < instant), instant, pack(kink, kink > instant)]
    end subroutine add_kink
end module linkdyn_forward_kinks
