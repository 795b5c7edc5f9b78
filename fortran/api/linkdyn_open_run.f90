!> A forward run under way, with a model of its own: the scene may be closed.
!>
!> Its state is told without the engine's own variables: instant, coordinates with their rates, and joint variables, which say
!> on which assembly the mechanism is. A run set to a state is a new one that starts there.
module linkdyn_open_run
    use, intrinsic :: iso_c_binding, only: c_intptr_t
    use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
    use linkdyn_builder, only: build_model
    use linkdyn_forward, only: forward_options
    use linkdyn_handles, only: held_thing, make_handle, take, give_back
    use linkdyn_heard_tables, only: refuse_short_tables
    use linkdyn_joint_table, only: wraps
    use linkdyn_kinds, only: wp
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_model, only: model_type, repeats
    use linkdyn_results, only: block_type, wanted_type, prepare_block, variable_index
    use linkdyn_result_kinds, only: result_q, result_qd, result_joint_variable, result_status
    use linkdyn_roads, only: road_counts
    use linkdyn_scene, only: scene_type, joint_n_variable
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_ok, sample_status_name
    use linkdyn_text, only: to_text, quoted
    use linkdyn_forward_errors, only: watched_run, start_watched, advance_watched, finish_watched
    use linkdyn_written_numbers, only: is_at
    implicit none (type, external)
    private
    public :: open_run, start_run, take_run, leave_run, go_to_instant, read_state, set_state, status_stopped, status_no_result

    ! ---- beside the engine's codes
    integer, parameter :: status_stopped = 9       !! the run has ended before the instant, for the reason told
    integer, parameter :: status_no_result = 10    !! nothing can be told of this instant; the run goes on

    type, extends(held_thing) :: open_run
        type(model_type), pointer :: own => null()     !! of the scene
        type(model_type), pointer :: model => null()   !! the same, from another start
        type(watched_run), pointer :: watched => null()
        type(forward_options) :: options
        type(wanted_type) :: wanted
        real(wp) :: t = 0                          !! instant that the block tells of [s]
        type(block_type) :: block                  !! results at that instant; not there before `go_to_instant`
    contains
        procedure :: release => release_run
    end type open_run

contains

    !> Start a run of a scene's model.
    subroutine start_run(model, options, wanted, handle, status)
        type(model_type), intent(in) :: model
        type(forward_options), intent(in) :: options
        type(wanted_type), intent(in) :: wanted
        integer(c_intptr_t), intent(out) :: handle
        type(status_type), intent(inout) :: status
        type(open_run), pointer :: new
        class(held_thing), pointer :: thing

        handle = 0
        allocate (new)
        allocate (new%own)
        new%own = model
        new%model => new%own
        new%options = options
        new%wanted = wanted
        call begin(new, status)
        nullify (new%options%shared)               ! a state that the run is set to later is another start
        thing => new
        if (status%is_ok()) call make_handle(thing, handle, status)
        if (status%is_ok()) return
        call new%release()
        deallocate (new)
    end subroutine start_run

    subroutine begin(run, status)
        type(open_run), intent(inout) :: run
        type(status_type), intent(inout) :: status

        allocate (run%watched)
        run%t = run%options%t_start
        call hold_texts()
        call start_watched(run%model, run%options, run%wanted, run%watched, status)
        call release_texts()
    end subroutine begin

    !> Use a run alone until `leave_run`. Null: the call has failed.
    subroutine take_run(handle, run, status)
        integer(c_intptr_t), intent(in) :: handle
        type(open_run), pointer, intent(out) :: run
        type(status_type), intent(inout) :: status
        class(held_thing), pointer :: thing

        nullify (run)
        call take(handle, "run", .true., thing, status)
        if (.not. associated(thing)) return
        select type (thing)
        type is (open_run)
            run => thing
        class default
            call give_back(handle)
            call fail(status, status_bad_input, "the handle is not that of a run")
        end select
    end subroutine take_run

    !> The end of a use; nothing for a run that could not be taken.
    subroutine leave_run(handle, run)
        integer(c_intptr_t), intent(in) :: handle
        type(open_run), pointer, intent(inout) :: run

        if (associated(run)) call give_back(handle)
        nullify (run)
    end subroutine leave_run

    !> Integrate to an instant; its results are in the block.
    !>
    !> **Errors**: `status_bad_input` for an instant before that of the run or one that a table has no rows for, `status_stopped`,
    !> `status_no_result`.
    subroutine go_to_instant(run, t, status)
        type(open_run), intent(inout) :: run
        real(wp), intent(in) :: t                  !! [s]
        type(status_type), intent(inout) :: status
        type(road_counts) :: ignored
        integer :: n_done

        if (.not. ieee_is_finite(t) .or. .not. t >= run%t) then
            call hold_texts()
            call fail(status, status_bad_input, "t = "//to_text(t)//" s (expected an instant from "//to_text(run%t)//" s on)")
            call release_texts()
            return
        end if
        call refuse_short_tables(run%watched%run%heard, run%t, t, "run", status)
        if (.not. status%is_ok()) return
        if (.not. (allocated(run%block%of) .and. t <= run%t)) then
            call prepare_block(run%watched%layout, 1, run%block)
            call advance_watched(run%watched, [t], run%block, ignored, n_done)
            run%t = t
        end if
        associate (sample_status => run%block%of(variable_index(run%watched%layout, result_status))%integer(1))
            if (run%watched%run%has_stopped) then
                call fail(status, status_stopped, trim(run%watched%run%reason))
            else if (sample_status /= sample_ok) then
                call hold_texts()
                call fail(status, status_no_result, "no results at t = "//to_text(t)//" s: " &
                          //trim(sample_status_name(sample_status)))
                call release_texts()
            end if
        end associate
    end subroutine go_to_instant

    !> Where the mechanism is.
    subroutine read_state(run, t, q, qd, joint_variable, status)
        type(open_run), intent(inout) :: run
        real(wp), intent(out) :: t                 !! [s]
        real(wp), intent(inout) :: q(:), qd(:)     !! (n_q) [m, rad] and rates
        real(wp), intent(inout) :: joint_variable(:)    !! (n_variable) [m, rad]
        type(status_type), intent(inout) :: status

        t = run%t
        call go_to_instant(run, run%t, status)
        if (.not. status%is_ok()) return
        associate (layout => run%watched%layout, of => run%block%of)
            q = of(variable_index(layout, result_q))%real
            qd = of(variable_index(layout, result_qd))%real
            joint_variable = of(variable_index(layout, result_joint_variable))%real
        end associate
    end subroutine read_state

    !> Put the mechanism somewhere else: on the assembly that the joint variables tell, or without them on that of the scene's
    !> start, led straight there. If that fails the run stays as it is.
    subroutine set_state(run, t, q, qd, status, joint_variable)
        type(open_run), intent(inout) :: run
        real(wp), intent(in) :: t                  !! [s]
        real(wp), intent(in) :: q(:), qd(:)        !! (n_q)
        type(status_type), intent(inout) :: status
        real(wp), intent(in), optional :: joint_variable(:)    !! (n_variable)
        type(open_run) :: new

        new%options = run%options
        new%wanted = run%wanted
        new%options%t_start = t
        new%options%integrator%span = max(0.0_wp, run%options%t_start + run%options%integrator%span - t)
        allocate (new%model)
        if (present(joint_variable)) then
            call hold_texts()
            call build_model(scene_at(run%own, q, qd, joint_variable), new%model, status)
            call release_texts()
        else
            new%model = run%own
            call put_coordinates(q, qd, new%model%scene)
        end if
        if (status%is_ok()) call begin(new, status)
        if (status%is_ok()) call go_to_instant(new, t, status)
        call hold_texts()
        if (status%is_ok()) call compare_state(new, q, qd, status, joint_variable)
        call release_texts()
        if (status%is_ok()) then
            call replace_run(new, run)
        else
            call end_run(new)
        end if
    end subroutine set_state

    !> A scene whose start is at a state.
    function scene_at(model, q, qd, joint_variable) result(scene)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:), qd(:), joint_variable(:)
        type(scene_type) :: scene
        integer :: j

        scene = model%scene
        call put_coordinates(q, qd, scene)
        scene%link%has_start = .false.
        scene%joint%branch = 0                     ! a branch that was forced is that of the start
        scene%joint%has_start = .true.
        do j = 1, model%n_joint
            associate (n => joint_n_variable(model%joint(j)%told_kind), first => model%joint(j)%first_variable)
                scene%joint(j)%start(:n) = joint_variable(first + 1:first + n)
            end associate
        end do
    end function scene_at

    subroutine put_coordinates(q, qd, scene)
        real(wp), intent(in) :: q(:), qd(:)
        type(scene_type), intent(inout) :: scene

        scene%coordinate%start_position = q
        scene%coordinate%start_velocity = qd
        scene%coordinate%has_start = .true.
    end subroutine put_coordinates

    !> Is the mechanism where it was to be? A driven coordinate is where its motion is, and no assembly may have the joint
    !> variables wanted.
    subroutine compare_state(run, q, qd, status, joint_variable)
        type(open_run), intent(inout) :: run
        real(wp), intent(in) :: q(:), qd(:)
        type(status_type), intent(inout) :: status
        real(wp), intent(in), optional :: joint_variable(:)
        real(wp) :: t, found_q(size(q)), found_qd(size(qd)), found(run%model%n_variable)
        integer :: j, k, v

        call read_state(run, t, found_q, found_qd, found, status)
        if (.not. status%is_ok()) return
        do k = 1, size(q)
            associate (c => run%model%scene%coordinate(k))
                if (.not. c%is_driven) cycle
                if (is_at(q(k), found_q(k), .not. repeats(run%model, k)) .and. is_at(qd(k), found_qd(k), .true.)) cycle
                call fail(status, status_bad_input, "coordinate "//quoted(c%name)//" is driven: at t = "//to_text(t) &
                          //" s it is at "//place_in_words(found_q(k), found_qd(k), c%unit)//", not at " &
                          //place_in_words(q(k), qd(k), c%unit))
            end associate
        end do
        if (.not. present(joint_variable)) return
        do j = 1, run%model%n_joint
            do v = 1, joint_n_variable(run%model%joint(j)%told_kind)
                k = run%model%joint(j)%first_variable + v
                if (is_at(joint_variable(k), found(k), .not. wraps(run%model%joint(j)%kind, v))) cycle
                call fail(status, status_bad_input, "joint "//quoted(run%model%joint(j)%name)//": no assembly at these " &
                          //"coordinates has it at "//to_text(joint_variable(k))//" (expected joint variables of one position; " &
                          //"the nearest has "//to_text(found(k))//")")
            end do
        end do
    end subroutine compare_state

    !> "0.5 rad with 2 rad/s"
    function place_in_words(q, qd, unit) result(text)
        real(wp), intent(in) :: q, qd
        character(len=*), intent(in) :: unit
        character(len=:), allocatable :: text

        text = to_text(q)//" "//trim(unit)//" with "//to_text(qd)//" "//trim(unit)//"/s"
    end function place_in_words

    !> What one run holds is exchanged for what another one does.
    subroutine replace_run(new, run)
        type(open_run), intent(inout) :: new, run

        call end_run(run)
        run%model => new%model
        run%watched => new%watched
        run%options = new%options
        run%t = new%t
        call move_alloc(new%block%of, run%block%of)
    end subroutine replace_run

    !> Give back all but the scene's model.
    subroutine end_run(run)
        type(open_run), intent(inout) :: run

        if (associated(run%watched)) then
            call finish_watched(run%watched)
            deallocate (run%watched)
        end if
        if (associated(run%model) .and. .not. associated(run%model, run%own)) deallocate (run%model)
    end subroutine end_run

    subroutine release_run(self)
        class(open_run), intent(inout) :: self

        call end_run(self)
        if (associated(self%own)) deallocate (self%own)
    end subroutine release_run
end module linkdyn_open_run
