!> How wrong the forces are, found by computing them again on mechanisms that should have the same.
!>
!> A few mechanisms similar to the model but of other sizes (`linkdyn_similar_model`) go through the same kinematics,
!> assembly and solver at the same states. Their data and every operation round differently, so the forces, brought back
!> to size, scatter as they are uncertain, whatever amplifies the errors on the way: a dead point, a short leg,
!> accelerations that cancel, a nearly singular system, bad pivots. From the scatter of a force follows its error estimate;
!> a floor covers what the last few operations round off. Data are taken to be known to half a unit in the last place.
!>
!> **Source**: J. Vignes, *Math. Comput. Simul.* 35 (1993) 233, for the idea; there the rounding itself is random.
module linkdyn_error_probe
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_positive_inf
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_result_kinds, only: result_reaction
    use linkdyn_equations, only: equations_type, equation_workspace, build_equations, free_equations, prepare_workspace, &
        want_of, solve_block, found_of, share_block, wanted_to_share
    use linkdyn_joint_table, only: is_slide
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_hash, only: counter_uniform
    use linkdyn_model, only: model_type, place_size, scene_size, gives_attitude, attitude_angles
    use linkdyn_scene, only: n_stop, n_clutch
    use linkdyn_similar_model, only: make_similar, coordinate_scale, drive_scale, near_one
    use linkdyn_status, only: status_type, sample_ok
    implicit none (type, external)
    private
    public :: error_probe, probe_space, make_probe, free_probe, prepare_probe_space, estimate_errors

    integer, parameter :: n_copy = 2
    integer, parameter :: itself = n_copy + 1
    real(wp), parameter :: scale_of(n_copy) = [1.3247179572447460_wp, 0.7548776662466927_wp]

    ! An estimate is `safety` times the largest of the differences and of `floor_part` epsilons of the whole force or
    ! moment. docs/accuracy.md shows how the two were found.
    real(wp), parameter :: safety = 20, floor_part = 0.5_wp

    !> Beside where they are found links of groups are no solution, and Newton's method finds them anew, with a rounding of its
    !> own. From where they are it finds nothing to correct: near a change point what agrees to the last bit may be far off.
    real(wp), parameter :: beside = 1.0e-8_wp           !! of the mechanism's size

    !> A similar model, its equations, and what brings inputs to its size and outputs back.
    type :: probe_copy
        type(model_type) :: model
        type(equations_type) :: equations
        real(wp), allocatable :: motion_factor(:, :)    !! of q, qd, qdd (n_q, 3)
        real(wp), allocatable :: load_factor(:, :)      !! (6, n_load)
        real(wp), allocatable :: place_factor(:)        !! of what places a link of a group (place_size)
        real(wp), allocatable :: place_beside(:, :)     !! added to that [m] (place_size, n_link)
        real(wp), allocatable :: drive_back(:)          !! (n_actuator)
        real(wp), allocatable :: reaction_back(:)       !! (n_component)
    end type probe_copy

    !> All copies: constant, shared by all threads.
    type :: error_probe
        type(probe_copy), allocatable :: copy(:)
    end type error_probe

    !> Scratch and results of one thread.
    type :: probe_space
        type(equation_workspace), allocatable :: workspace(:)
        real(wp), allocatable :: reaction(:, :, :, :)       !! of the copies, then of the block itself (lane, n_component, n_joint,
                                                            !! copy)
        ! ---- RESULTS
        real(wp), allocatable :: driving_force_error(:, :)  !! (lane, n_actuator) [N, N m]
        real(wp), allocatable :: reaction_error(:, :, :)    !! (lane, n_component, n_joint) [N, N m]
        real(wp) :: worst(lanes)                            !! largest error, relative to the largest value of its kind
    contains
        procedure :: free => free_probe_space
    end type probe_space

contains

    !> Similar models with their equations.
    subroutine make_probe(model, solver, wants_reactions, probe, status)
        type(model_type), intent(in) :: model
        integer, intent(in) :: solver
        logical, intent(in) :: wants_reactions
        type(error_probe), intent(out) :: probe
        type(status_type), intent(inout) :: status
        integer, parameter :: of_motion = 101, of_load = 102    ! keys
        integer :: i, j, k, n_force

        n_force = model%n_component - merge(1, 3, model%is_planar)
        allocate (probe%copy(n_copy))
        do i = 1, n_copy
            associate (copy => probe%copy(i), scale => scale_of(i))
                call make_similar(model, i, scale, copy%model)
                call build_equations(copy%model, solver, wants_reactions, copy%equations, status)
                if (.not. status%is_ok()) return
                allocate (copy%motion_factor(model%n_q, 3), copy%load_factor(6, model%n_load))
                do k = 1, 3
                    do j = 1, model%n_q
                        copy%motion_factor(j, k) = coordinate_scale(model, j, scale)*near_one([i, of_motion, j, k])
                    end do
                end do
                do k = 1, model%n_load
                    do j = 1, 6
                        copy%load_factor(j, k) = merge(scale, scale**2, j <= 3)*near_one([i, of_load, j, k])
                    end do
                end do
                copy%place_factor = [(merge(scale, 1.0_wp, j <= n_force), j=1, place_size(model))]
                allocate (copy%place_beside(place_size(model), model%n_link), source=0.0_wp)
                do k = 1, model%n_link
                    copy%place_beside(:n_force, k) = beside*scene_size(copy%model) &
                        *[(2*counter_uniform(int(i, int64), int(j, int64), int(k, int64)) - 1, j=1, n_force)]
                end do
                copy%drive_back = [(1/drive_scale(model, j, scale), j=1, model%n_actuator)]
                copy%reaction_back = [(merge(1/scale, 1/scale**2, j <= n_force), j=1, model%n_component)]
            end associate
        end do
    end subroutine make_probe

    !> Nobody may be using it.
    subroutine free_probe(probe)
        type(error_probe), intent(inout) :: probe
        integer :: i

        do i = 1, n_copy
            call free_equations(probe%copy(i)%equations)
        end do
    end subroutine free_probe

    !> Make room for one thread.
    subroutine prepare_probe_space(probe, space)
        type(error_probe), intent(in) :: probe
        type(probe_space), intent(out) :: space
        integer :: i

        allocate (space%workspace(n_copy))
        do i = 1, n_copy
            call prepare_workspace(probe%copy(i)%model, probe%copy(i)%equations, space%workspace(i))
            space%workspace(i)%checks_input = .false.
            space%workspace(i)%checks_accuracy = .false.
        end do
        associate (model => probe%copy(1)%model)
            allocate (space%reaction(lanes, model%n_component, model%n_joint, n_copy + 1), &
                      space%reaction_error(lanes, model%n_component, model%n_joint), &
                      space%driving_force_error(lanes, model%n_actuator))
        end associate
    end subroutine prepare_probe_space

    subroutine free_probe_space(self)
        class(probe_space), intent(inout) :: self
        integer :: i

        if (.not. allocated(self%workspace)) return
        do i = 1, size(self%workspace)
            call self%workspace(i)%free()
        end do
    end subroutine free_probe_space

    !> Error estimates of the block just solved.
    !>
    !> Infinite on a lane on which a copy fails: the state cannot be told from a dead point or a singular position.
    subroutine estimate_errors(model, probe, solved, reaction, wants_reactions, space)
        type(model_type), intent(in) :: model
        type(error_probe), intent(in) :: probe
        type(equation_workspace), intent(in) :: solved
        real(wp), intent(in), contiguous :: reaction(:, :, :)    !! (lane, n_component, n_joint)
        logical, intent(in) :: wants_reactions
        type(probe_space), intent(inout) :: space
        logical :: has_failed(lanes), shares
        integer :: status(lanes), i

        shares = wants_reactions .and. model%share%n > 0
        status = solved%status
        if (wants_reactions) space%reaction(:, :, :, itself) = reaction
        if (shares) call share_block(model, solved, space%reaction(:, :, :, itself), status)
        has_failed = status /= sample_ok
        do i = 1, n_copy
            associate (copy => probe%copy(i), workspace => space%workspace(i))
                call take_inputs(copy, solved, workspace)
                if (wants_reactions) call want_of(workspace, [result_reaction, wanted_to_share(model)])
                call solve_block(copy%model, copy%equations, workspace)
                status = workspace%status
                if (wants_reactions) space%reaction(:, :, :, i) = &
                    reshape(found_of(workspace, result_reaction, size(reaction)/lanes), shape(reaction))
                if (shares) call share_block(copy%model, workspace, space%reaction(:, :, :, i), status)
                has_failed = has_failed .or. status /= sample_ok
            end associate
        end do
        call compare(probe, solved, wants_reactions, has_failed, space)
    end subroutine estimate_errors

    !> Motion and loads of the block at the size of the copy, on the same assembly.
    subroutine take_inputs(copy, solved, workspace)
        type(probe_copy), intent(in) :: copy
        type(equation_workspace), intent(in) :: solved
        type(equation_workspace), intent(inout) :: workspace
        integer :: j, k

        do k = 1, copy%model%n_q
            workspace%state%q(:, k) = solved%state%q(:, k)*copy%motion_factor(k, 1)
            workspace%state%qd(:, k) = solved%state%qd(:, k)*copy%motion_factor(k, 2)
            workspace%state%qdd(:, k) = solved%state%qdd(:, k)*copy%motion_factor(k, 3)
        end do
        call take_pushes(copy%model, solved, workspace)
        workspace%state%time = solved%state%time
        workspace%state%by_quaternion = solved%state%by_quaternion
        do k = 1, size(copy%model%step)
            if (.not. gives_attitude(copy%model, copy%model%step(k))) cycle
            associate (p => copy%model%step(k)%first, angle => attitude_angles(copy%model%step(k)))
                workspace%state%quaternion(:, :, p) = solved%state%quaternion(:, :, p)
                do j = 1, 3
                    workspace%state%quaternion(:, j + 1, p) = solved%state%quaternion(:, j + 1, p)*copy%motion_factor(angle(j), 1)
                end do
            end associate
        end do
        do k = 1, copy%model%n_load
            do j = 1, 6
                workspace%load(:, j, k) = solved%load(:, j, k)*copy%load_factor(j, k)
            end do
        end do
        if (copy%model%n_branch > 0) workspace%state%branch = solved%state%branch
        if (size(copy%model%group) == 0) return
        workspace%state%group%start_q = workspace%state%q
        do k = 1, size(copy%place_factor)
            do j = 1, copy%model%n_link
                workspace%state%group%start_place(:, k, j) = solved%state%group%place(:, k, j)*copy%place_factor(k) &
                                                             + copy%place_beside(k, j)
            end do
        end do
    end subroutine take_inputs

    !> What stops and clutches do, at the size of the copy, and which way joints rub that may stick.
    subroutine take_pushes(model, solved, workspace)
        type(model_type), intent(in) :: model          !! of the copy
        type(equation_workspace), intent(in) :: solved
        type(equation_workspace), intent(inout) :: workspace
        integer :: i

        associate (scale => model%scene%laws%scale)
            do i = 1, n_stop(model%scene)
                associate (stop => model%scene%stop(i))
                    workspace%state%stop_force(:, i) = solved%state%stop_force(:, i) &
                        *scale**merge(1, 2, model%scene%laws%measure(stop%measure)%length_power == 1)
                end associate
            end do
            do i = 1, n_clutch(model%scene)
                workspace%state%clutch_force(:, i) = solved%state%clutch_force(:, i) &
                                                     *scale**merge(1, 2, model%scene%clutch(i)%unit == "N")
            end do
        end associate
        workspace%friction%sense(:, :, :size(model%contact)) = solved%friction%sense(:, :, :size(model%contact))
    end subroutine take_pushes

    !> From forces to estimates.
    subroutine compare(probe, solved, wants_reactions, has_failed, space)
        type(error_probe), intent(in) :: probe
        type(equation_workspace), intent(in) :: solved
        logical, intent(in) :: wants_reactions
        logical, intent(in) :: has_failed(lanes)
        type(probe_space), intent(inout) :: space
        real(wp), dimension(lanes, 2) :: error, value      ! largest of forces, of moments
        integer :: i, j, kind, first, last, n_force

        error = 0
        value = 0
        associate (model => probe%copy(1)%model, one => probe%copy(1), two => probe%copy(2))
            do i = 1, model%n_actuator
                associate (actuator => model%scene%actuator(i))
                    kind = merge(1, 2, is_slide(model%joint(actuator%joint)%told_kind, actuator%variable))
                end associate
                call compare_force(1, solved%driving_force(:, i), space%workspace(1)%driving_force(:, i), &
                                   space%workspace(2)%driving_force(:, i), [one%drive_back(i), two%drive_back(i)], &
                                   space%driving_force_error(:, i), error(:, kind), value(:, kind))
            end do
            if (wants_reactions) then
                n_force = model%n_component - merge(1, 3, model%is_planar)
                do j = 1, model%n_joint
                    do kind = 1, 2
                        first = merge(1, n_force + 1, kind == 1)
                        last = merge(n_force, model%n_component, kind == 1)
                        call compare_force(last - first + 1, space%reaction(:, first:last, j, itself), &
                                           space%reaction(:, first:last, j, 1), space%reaction(:, first:last, j, 2), &
                                           [one%reaction_back(first), two%reaction_back(first)], &
                                           space%reaction_error(:, first:last, j), error(:, kind), value(:, kind))
                    end do
                end do
            end if
        end associate
        space%worst = max(ratio(error(:, 1), value(:, 1)), ratio(error(:, 2), value(:, 2)))
        do i = 1, lanes
            if (.not. has_failed(i)) cycle
            space%driving_force_error(i, :) = ieee_value(1.0_wp, ieee_positive_inf)
            space%reaction_error(i, :, :) = ieee_value(1.0_wp, ieee_positive_inf)
            space%worst(i) = ieee_value(1.0_wp, ieee_positive_inf)
        end do
    end subroutine compare

    !> The components of one force or moment and those of the copies; what is zero in all is zero by its nature.
    !>
    !> Lane by lane, and comparisons where `max` would serve: so all lanes go at once.
    pure subroutine compare_force(n, value, first, second, back, error, largest_error, largest_value)
        integer, intent(in) :: n
        real(wp), intent(in), dimension(lanes, n) :: value, first, second
        real(wp), intent(in) :: back(2)                !! brings the copies back to size
        real(wp), intent(out) :: error(lanes, n)
        real(wp), intent(inout) :: largest_error(lanes), largest_value(lanes)
        real(wp) :: least(lanes), other
        integer :: i, l

        least = 0
        do i = 1, n
            do l = 1, lanes
                least(l) = merge(abs(value(l, i)), least(l), abs(value(l, i)) > least(l))
                error(l, i) = abs(back(1)*first(l, i) - value(l, i))
                other = abs(back(2)*second(l, i) - value(l, i))
                error(l, i) = merge(other, error(l, i), other > error(l, i))
            end do
        end do
        do l = 1, lanes
            largest_value(l) = merge(least(l), largest_value(l), least(l) > largest_value(l))
            least(l) = floor_part*epsilon(1.0_wp)*least(l)
        end do
        do i = 1, n
            do l = 1, lanes
                other = safety*merge(error(l, i), least(l), error(l, i) > least(l))
                error(l, i) = merge(0.0_wp, other, error(l, i) == 0 .and. value(l, i) == 0)
                largest_error(l) = merge(error(l, i), largest_error(l), error(l, i) > largest_error(l))
            end do
        end do
    end subroutine compare_force

    !> Relative size of the largest error; 0 if there is none.
    elemental real(wp) function ratio(error, value)
        real(wp), intent(in) :: error, value

        ratio = error/max(value, tiny(1.0_wp))
    end function ratio
end module linkdyn_error_probe
