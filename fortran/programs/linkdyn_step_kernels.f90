!> The steps of a plan as kernels that hold no numbers: steps that differ in these alone, of one scene or of many, share them.
!>
!> Links behind joints whose variables are known, legs and dyads have formulas for where they are and how they move. Of CSP groups
!> formulas tell where they are, of groups closed by iteration nothing does; how these move follows from what their joints ask of
!> them, linear equations, of which the kernels tell the entries: whoever runs them solves them with pivots of his own.
!>
!> A kernel is traced when it is wanted first, and serves all threads from then on. Those that nobody has used for long make room
!> for others.
module linkdyn_step_kernels
    use linkdyn_attitude, only: rotation_in_plane
    use linkdyn_bodies, only: world_axes, set_vector, point_position, point_velocity, point_acceleration, omega_of, alpha_of
    use linkdyn_certainty, only: closing_quality
    use linkdyn_dyad_motion, only: move_dyad
    use linkdyn_dyads, only: find_ways
    use linkdyn_elimination, only: sparse_row
    use linkdyn_elimination_pattern, only: elimination_pattern, find_pattern
    use linkdyn_equation_programs, only: matrix_form, list_entries
    use linkdyn_group_rates, only: group_constraints, list_constraints, make_velocities_unknown, make_accelerations_unknown, &
        require_rates, require_second_rates
    use linkdyn_inputs, only: sample_set, input_blocks, add_block, in_q, in_qd, in_qdd, in_quaternion, in_branch, in_number, &
        in_motion
    use linkdyn_joint_kind, only: marker_pair, axis_of
    use linkdyn_joint_table, only: n_slide, slide_axis, moment_directions, along_x_and_y, along_axes, is_threaded
    use linkdyn_kinds, only: wp
    use linkdyn_led_variables, only: complete_led
    use linkdyn_lock, only: hold_lock, release_lock, hold_records, release_records, hold_texts, release_texts
    use linkdyn_margins, only: assembly_margins
    use linkdyn_mechanism, only: mechanism_type, begin_mechanism, pair_of, scene_point_of_origin, scene_rotation
    use linkdyn_model, only: model_type, step_group, is_dyad
    use linkdyn_placing, only: place_links, closes_loop, list_step_constraints
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene_program, only: scene_program, program_space, output_list, add_output, make_scene_program, &
        free_scene_program, free_program_space
    use linkdyn_step_part, only: step_part, take_step
    use linkdyn_system, only: system_type, list_rows
    use linkdyn_value, only: value, zero, one, operator(+), operator(-), operator(*), sqrt, reciprocal, sin, cos, atan2
    use linkdyn_vector, only: vector, rotation, components, operator(.dot.), operator(.cross.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: step_kernels, kernel_space, borrow_kernels, return_kernels, need_kernel
    public :: place_numbers_of, rate_numbers_of
    public :: of_errors, of_velocities, of_accelerations, of_looks, of_places, of_ways, of_margins, of_quality, &
        of_way

    ! ---- the kernels
    integer, parameter :: of_places = 1        !! of the step's links; slides of its joints; what is negative where loops cannot
                                               !! close
    integer, parameter :: of_velocities = 2    !! of the links; of loops: rates of the constraints while the links rest, less what
                                               !! is given
    integer, parameter :: of_accelerations = 3 !! likewise
    integer, parameter :: of_errors = 4        !! of loops: entries of the matrix, then errors of the constraints
    integer, parameter :: of_looks = 5         !! of groups: slides, axes that must not be turned end for end, threads
    integer, parameter :: of_ways = 6          !! of a dyad: determinant of its ways, product, product of the lengths
    integer, parameter :: of_margins = 7       !! of a closed form with two ways to close: margin and its rate
    integer, parameter :: of_quality = 8       !! of dyads and CSP groups: see `linkdyn_certainty`
    integer, parameter :: of_way = 9           !! of a dyad: places, velocities and margins at once
    integer, parameter :: n_kernel = 9

    integer, parameter :: most_kept = 512      !! steps that are different but for their numbers

    !> Slots of one thread.
    type :: kernel_space
        type(program_space) :: many(n_kernel), one(n_kernel)     !! for blocks, for single samples
        logical :: has_numbers(n_kernel, 2) = .false.            !! those of the step are in the slots (kernel, many or one)
        real(wp), allocatable :: x(:, :)                         !! what else a kernel reads (lane, number)
        type(kernel_space), pointer, private :: next => null()
    end type kernel_space

    type :: step_kernels
        type(scene_program) :: program(n_kernel)
        type(matrix_form) :: form                      !! of `of_errors`
        type(elimination_pattern) :: pattern           !! likewise
        integer :: n_slide = 0, n_closing = 0          !! what `of_places` gives after the places
        integer :: n_facing = 0, n_thread = 0          !! what `of_looks` gives after the slides; of a thread the angle that it is
                                                       !! off by
        character(len=:), allocatable, private :: key
        logical, private :: by_quaternion = .false.
        integer, private :: n_user = 0
        type(kernel_space), pointer, private :: idle => null()
        type(step_kernels), pointer, private :: next => null()
    end type step_kernels

    type(step_kernels), pointer :: kept => null()     ! those borrowed last come first
    integer :: n_kept = 0

contains

    ! ---------------------------------------------------------------- who uses them

    !> Kernels of a step, and slots for one thread.
    subroutine borrow_kernels(model, i, by_quaternion, kernels, space)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                       !! step of the plan
        logical, intent(in) :: by_quaternion           !! the attitude that it is given comes so
        type(step_kernels), pointer, intent(out) :: kernels
        type(kernel_space), pointer, intent(out) :: space
        type(step_kernels), pointer :: before

        nullify (before)
        call hold_lock()
        kernels => kept
        do while (associated(kernels))
            if ((kernels%by_quaternion .eqv. by_quaternion) .and. kernels%key == model%part(i)%key) exit
            before => kernels
            kernels => kernels%next
        end do
        if (.not. associated(kernels)) then
            allocate (kernels)
            kernels%key = model%part(i)%key
            kernels%by_quaternion = by_quaternion
            kernels%next => kept
            kept => kernels
            n_kept = n_kept + 1
        else if (associated(before)) then
            before%next => kernels%next
            kernels%next => kept
            kept => kernels
        end if
        kernels%n_user = kernels%n_user + 1
        space => kernels%idle
        if (associated(space)) kernels%idle => space%next
        call release_lock()
        if (n_kept > most_kept) call drop_last()
        if (.not. associated(space)) allocate (space)
    end subroutine borrow_kernels

    subroutine return_kernels(kernels, space)
        type(step_kernels), pointer, intent(inout) :: kernels
        type(kernel_space), pointer, intent(inout) :: space

        call hold_lock()
        space%next => kernels%idle
        kernels%idle => space
        kernels%n_user = kernels%n_user - 1
        call release_lock()
        nullify (kernels, space)
    end subroutine return_kernels

    !> The one that was borrowed least recently, if nobody has it.
    subroutine drop_last()
        type(step_kernels), pointer :: last, before
        type(kernel_space), pointer :: space
        integer :: k

        call hold_lock()
        nullify (before)
        last => kept
        do while (associated(last%next))
            before => last
            last => last%next
        end do
        if (last%n_user > 0 .or. .not. associated(before)) then
            call release_lock()
            return
        end if
        nullify (before%next)
        n_kept = n_kept - 1
        call release_lock()
        do while (associated(last%idle))
            space => last%idle
            last%idle => space%next
            do k = 1, n_kernel
                call free_program_space(space%many(k))
                call free_program_space(space%one(k))
            end do
            deallocate (space)
        end do
        do k = 1, n_kernel
            call free_scene_program(last%program(k))
        end do
        deallocate (last)
    end subroutine drop_last

    !> Make a kernel unless it is there.
    subroutine need_kernel(model, i, which, kernels)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                       !! step of the plan
        integer, intent(in) :: which                   !! one of `of_*`
        type(step_kernels), pointer, intent(in) :: kernels

        if (kernels%program(which)%is_made) return
        call hold_records()
        call hold_texts()
        if (.not. kernels%program(which)%is_made) call make_kernel(model, i, which, kernels)
        call release_texts()
        call release_records()
    end subroutine need_kernel

    !> On its own, since a step's part is large: whoever finds the kernel made has none to clear.
    subroutine make_kernel(model, i, which, kernels)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i, which
        type(step_kernels), pointer, intent(in) :: kernels
        type(step_part), target :: part
        logical :: is_loop

        call take_step(model, i, part)
        is_loop = closes_loop(model%step(i)) .and. .not. is_dyad(model%step(i)%kind)
        select case (which)
        case (of_places)
            call make_places(part, kernels)
        case (of_errors)
            call make_closing(part, kernels)
        case (of_velocities)
            if (is_loop) call make_closing(part, kernels)
            if (.not. is_loop) call make_motion(part, kernels)
        case (of_accelerations)
            if (is_loop) call make_second_rates(part, kernels)
            if (.not. is_loop) call make_motion(part, kernels)
        case (of_looks)
            call make_looks(part, kernels)
        case (of_ways)
            call make_ways(part, kernels)
        case (of_margins)
            call make_margins(part, kernels)
        case (of_quality)
            call make_quality(part, kernels)
        case (of_way)
            call make_way(part, kernels)
        end select
    end subroutine make_kernel

    !> How many numbers say where a link is: x, y, cosine and sine, or x y z and the axes.
    pure integer function place_numbers_of(model)
        type(model_type), intent(in) :: model

        place_numbers_of = merge(4, 12, model%is_planar)
    end function place_numbers_of

    !> How many say how it moves: x, y and angle, or x y z and about x y z, world axes.
    pure integer function rate_numbers_of(model)
        type(model_type), intent(in) :: model

        rate_numbers_of = merge(3, 6, model%is_planar)
    end function rate_numbers_of

    ! ---------------------------------------------------------------- traces

    !> Inputs, and a mechanism of which the links around the step are placed and move. Numbers of the motion: places of all links,
    !> then velocities, then accelerations.
    subroutine begin_step(part, by_quaternion, in, mechanism, is_placed)
        type(step_part), intent(in), target :: part
        logical, intent(in) :: by_quaternion
        type(input_blocks), intent(inout) :: in
        type(mechanism_type), intent(inout) :: mechanism
        logical, intent(in), optional :: is_placed     !! the step's own links will be told, too; absent: false
        type(sample_set) :: none
        integer :: i, n

        associate (model => part%model)
            n = model%n_link*(place_numbers_of(model) + 2*rate_numbers_of(model))
            call add_block(in_number, part%varies, none, in, part%number)
            call add_block(in_q, spread(.true., 1, model%n_q), none, in)
            call add_block(in_qd, spread(.true., 1, model%n_q), none, in)
            call add_block(in_qdd, spread(.true., 1, model%n_q), none, in)
            call add_block(in_quaternion, spread(by_quaternion, 1, 4*model%n_attitude), none, in)
            call add_block(in_branch, spread(.true., 1, model%n_branch), none, in)
            call add_block(in_motion, spread(.true., 1, n), none, in)
            call begin_mechanism(model, in%of(in_number)%v, in%of(in_q)%v, in%of(in_qd)%v, in%of(in_qdd)%v, mechanism, is_placed)
            if (by_quaternion) mechanism%quaternion = reshape(in%of(in_quaternion)%v, [4, model%n_attitude])
            mechanism%keeps_at_limits = .true.
            do i = part%n_own + 1, model%n_link
                call put_link(model, i, in%of(in_motion)%v, mechanism)
                call move_link(model, i, in%of(in_motion)%v, mechanism)
                call accelerate_link(model, i, in%of(in_motion)%v, mechanism)
            end do
        end associate
    end subroutine begin_step

    !> The same, and the step's own links, where they are placed already.
    subroutine begin_placed(part, in, mechanism)
        type(step_part), intent(in), target :: part
        type(input_blocks), intent(inout) :: in
        type(mechanism_type), intent(inout) :: mechanism
        integer :: i

        call begin_step(part, .false., in, mechanism, is_placed=.true.)
        do i = 1, part%n_own
            call put_link(part%model, i, in%of(in_motion)%v, mechanism)
        end do
    end subroutine begin_placed

    !> The same, moving at some levels.
    subroutine begin_moving(part, in, mechanism, accelerates)
        type(step_part), intent(in), target :: part
        type(input_blocks), intent(inout) :: in
        type(mechanism_type), intent(inout) :: mechanism
        logical, intent(in) :: accelerates
        integer :: i

        call begin_placed(part, in, mechanism)
        do i = 1, part%n_own
            call move_link(part%model, i, in%of(in_motion)%v, mechanism)
            if (accelerates) call accelerate_link(part%model, i, in%of(in_motion)%v, mechanism)
        end do
    end subroutine begin_moving

    !> What the joints of a loop ask. Its links are placed and do not move yet.
    subroutine list_loop(part, mechanism, constraints)
        type(step_part), intent(in) :: part
        type(mechanism_type), intent(inout) :: mechanism
        type(group_constraints), intent(out) :: constraints

        if (part%model%step(1)%kind /= step_group) then
            call list_step_constraints(mechanism, part%model%step(1), constraints)
            return
        end if
        associate (group => part%model%group(1))
            call complete_led(mechanism, pack(group%coordinate, group%coordinate > 0), group%joint)
            call list_constraints(mechanism, group%link, group%joint, group%coordinate, constraints)
        end associate
    end subroutine list_loop

    subroutine put_link(model, i, motion, mechanism)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        type(value), intent(in) :: motion(:)
        type(mechanism_type), intent(inout) :: mechanism
        integer :: k

        k = place_numbers_of(model)*(i - 1)
        associate (body => mechanism%bodies%body(i))
            if (model%is_planar) then
                body%position = vector(motion(k + 1), motion(k + 2), zero())
                if (body%turning > 0) mechanism%bodies%turning(body%turning)%r = rotation_in_plane(motion(k + 3), motion(k + 4))
            else
                body%position = vector(motion(k + 1), motion(k + 2), motion(k + 3))
                if (body%turning > 0) mechanism%bodies%turning(body%turning)%r = &
                    rotation(vector(motion(k + 4), motion(k + 5), motion(k + 6)), &
                             vector(motion(k + 7), motion(k + 8), motion(k + 9)), &
                             vector(motion(k + 10), motion(k + 11), motion(k + 12)))
            end if
        end associate
    end subroutine put_link

    subroutine move_link(model, i, motion, mechanism)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        type(value), intent(in) :: motion(:)
        type(mechanism_type), intent(inout) :: mechanism
        type(vector) :: rate(2)

        rate = rates_at(model, motion, place_numbers_of(model)*model%n_link + rate_numbers_of(model)*(i - 1))
        associate (body => mechanism%bodies%body(i))
            body%velocity = rate(1)
            if (body%turning > 0) call set_vector(mechanism%bodies%turning(body%turning)%omega, world_axes, rate(2))
        end associate
    end subroutine move_link

    subroutine accelerate_link(model, i, motion, mechanism)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        type(value), intent(in) :: motion(:)
        type(mechanism_type), intent(inout) :: mechanism
        type(vector) :: rate(2)

        rate = rates_at(model, motion, (place_numbers_of(model) + rate_numbers_of(model))*model%n_link &
                        + rate_numbers_of(model)*(i - 1))
        associate (body => mechanism%bodies%body(i))
            call set_vector(body%acceleration, world_axes, rate(1))
            if (body%turning > 0) call set_vector(mechanism%bodies%turning(body%turning)%alpha, world_axes, rate(2))
        end associate
    end subroutine accelerate_link

    !> Rates of an origin, and of turning.
    function rates_at(model, motion, k) result(rate)
        type(model_type), intent(in) :: model
        type(value), intent(in) :: motion(:)
        integer, intent(in) :: k
        type(vector) :: rate(2)

        if (model%is_planar) then
            rate(1) = vector(motion(k + 1), motion(k + 2), zero())
            rate(2) = vector(zero(), zero(), motion(k + 3))
        else
            rate(1) = vector(motion(k + 1), motion(k + 2), motion(k + 3))
            rate(2) = vector(motion(k + 4), motion(k + 5), motion(k + 6))
        end if
    end function rates_at

    ! ---------------------------------------------------------------- closed forms

    !> Where the links are, in the axes in which the scene has them.
    subroutine make_places(part, kernels)
        type(step_part), intent(in), target :: part
        type(step_kernels), intent(inout) :: kernels
        type(record_type), target :: record
        type(input_blocks) :: in
        type(mechanism_type) :: mechanism
        type(output_list) :: out

        call open_record(record, 0)
        call place_step(part, kernels%by_quaternion, in, mechanism)
        call add_places(part, mechanism, kernels, out)
        call make_scene_program(record, in, out, kernels%program(of_places))
        call close_record(record)
    end subroutine make_places

    !> What `of_places` gives.
    subroutine add_places(part, mechanism, kernels, out)
        type(step_part), intent(in) :: part
        type(mechanism_type), intent(inout) :: mechanism
        type(step_kernels), intent(inout) :: kernels
        type(output_list), intent(inout) :: out
        type(rotation) :: r
        type(vector) :: p
        type(value), allocatable :: place(:), slide(:)
        integer :: i

        allocate (place(0))
        do i = 1, part%n_own
            p = point_position(mechanism%bodies, i, scene_point_of_origin(mechanism, i))
            r = scene_rotation(mechanism, i)
            if (part%model%is_planar) then
                place = [place, p%x, p%y, r%x%x, r%x%y]
            else
                place = [place, components(p), components(r%x), components(r%y), components(r%z)]
            end if
        end do
        slide = slides_of(part, mechanism)
        kernels%n_slide = size(slide)
        kernels%n_closing = size(mechanism%closes)
        call add_output(out, of_places, [place, slide, mechanism%closes])
    end subroutine add_places

    subroutine place_step(part, by_quaternion, in, mechanism)
        type(step_part), intent(in), target :: part
        logical, intent(in) :: by_quaternion
        type(input_blocks), intent(inout) :: in
        type(mechanism_type), intent(inout) :: mechanism
        type(value) :: branch

        call begin_step(part, by_quaternion, in, mechanism)
        branch = one()
        if (part%model%n_branch > 0) branch = in%of(in_branch)%v(1)
        call place_links(mechanism, part%model%step(1), branch)
    end subroutine place_step

    !> How far joints are slid, as they list it.
    function slides_of(part, mechanism) result(slide)
        type(step_part), intent(in) :: part
        type(mechanism_type), intent(in) :: mechanism
        type(value), allocatable :: slide(:)
        type(marker_pair) :: pair
        type(value) :: c(3)
        integer :: i, k

        allocate (slide(0))
        do i = 1, part%model%n_joint
            pair = pair_of(mechanism, i)
            c = components(pair%first.unrotate.pair%gap)
            do k = 1, n_slide(part%model%joint(i)%kind)
                slide = [slide, c(slide_axis(k, part%model%joint(i)%kind))]
            end do
        end do
    end function slides_of

    !> How links move whose formulas say it.
    subroutine make_motion(part, kernels)
        type(step_part), intent(in), target :: part
        type(step_kernels), intent(inout) :: kernels
        type(record_type), target :: record
        type(input_blocks) :: in
        type(mechanism_type) :: mechanism
        type(output_list) :: out, out2

        call open_record(record, 0)
        call place_step(part, kernels%by_quaternion, in, mechanism)
        if (is_dyad(part%model%step(1)%kind)) call move_dyad(mechanism, part%model%step(1))
        call add_output(out, of_velocities, velocities_of(part, mechanism))
        call make_scene_program(record, in, out, kernels%program(of_velocities))
        call add_output(out2, of_accelerations, accelerations_of(part, mechanism))
        call make_scene_program(record, in, out2, kernels%program(of_accelerations))
        call close_record(record)
    end subroutine make_motion

    !> All that is asked of a dyad on a way: what `of_places`, `of_velocities` and `of_margins` give, one after the other.
    subroutine make_way(part, kernels)
        type(step_part), intent(in), target :: part
        type(step_kernels), intent(inout) :: kernels
        type(record_type), target :: record
        type(input_blocks) :: in
        type(mechanism_type) :: mechanism
        type(value) :: margin(1), drift(1)
        type(output_list) :: out

        call open_record(record, 0)
        call place_step(part, .false., in, mechanism)
        call move_dyad(mechanism, part%model%step(1))
        call assembly_margins(mechanism, margin, drift)
        call add_places(part, mechanism, kernels, out)
        call add_output(out, of_velocities, velocities_of(part, mechanism))
        call add_output(out, of_margins, [margin, drift])
        call make_scene_program(record, in, out, kernels%program(of_way))
        call close_record(record)
    end subroutine make_way

    function velocities_of(part, mechanism) result(velocity)
        type(step_part), intent(in) :: part
        type(mechanism_type), intent(in) :: mechanism
        type(value), allocatable :: velocity(:)
        integer :: i

        allocate (velocity(0))
        do i = 1, part%n_own
            velocity = [velocity, rates_of(part%model, &
                                           point_velocity(mechanism%bodies, i, scene_point_of_origin(mechanism, i)), &
                                           omega_of(mechanism%bodies, i, world_axes))]
        end do
    end function velocities_of

    function accelerations_of(part, mechanism) result(acceleration)
        type(step_part), intent(in) :: part
        type(mechanism_type), intent(in) :: mechanism
        type(value), allocatable :: acceleration(:)
        integer :: i

        allocate (acceleration(0))
        do i = 1, part%n_own
            acceleration = [acceleration, rates_of(part%model, &
                                                   point_acceleration(mechanism%bodies, i, scene_point_of_origin(mechanism, i), &
                                                                      world_axes), &
                                                   alpha_of(mechanism%bodies, i, world_axes))]
        end do
    end function accelerations_of

    !> As `rate_numbers_of` counts them.
    function rates_of(model, linear, angular) result(rate)
        type(model_type), intent(in) :: model
        type(vector), intent(in) :: linear, angular
        type(value), allocatable :: rate(:)

        if (model%is_planar) then
            rate = [linear%x, linear%y, angular%z]
        else
            rate = [components(linear), components(angular)]
        end if
    end function rates_of

    ! ---------------------------------------------------------------- how closed forms close

    subroutine make_ways(part, kernels)
        type(step_part), intent(in), target :: part
        type(step_kernels), intent(inout) :: kernels
        type(record_type), target :: record
        type(input_blocks) :: in
        type(mechanism_type) :: mechanism
        type(vector) :: normal
        type(output_list) :: out

        call open_record(record, 0)
        call begin_placed(part, in, mechanism)
        call find_ways(mechanism, part%model%step(1))
        associate (way => mechanism%ways(:, 1))
            normal = way(1) .cross.way(2)
            call add_output(out, of_ways, [normal%z, way(1) .dot.way(2), sqrt((way(1) .dot.way(1))*(way(2) .dot.way(2)))])
        end associate
        call make_scene_program(record, in, out, kernels%program(of_ways))
        call close_record(record)
    end subroutine make_ways

    subroutine make_margins(part, kernels)
        type(step_part), intent(in), target :: part
        type(step_kernels), intent(inout) :: kernels
        type(record_type), target :: record
        type(input_blocks) :: in
        type(mechanism_type) :: mechanism
        type(value) :: margin(1), drift(1)
        type(output_list) :: out

        call open_record(record, 0)
        call begin_moving(part, in, mechanism, .false.)
        if (is_dyad(part%model%step(1)%kind)) call find_ways(mechanism, part%model%step(1))
        call assembly_margins(mechanism, margin, drift)
        call add_output(out, of_margins, [margin, drift])
        call make_scene_program(record, in, out, kernels%program(of_margins))
        call close_record(record)
    end subroutine make_margins

    subroutine make_quality(part, kernels)
        type(step_part), intent(in), target :: part
        type(step_kernels), intent(inout) :: kernels
        type(record_type), target :: record
        type(input_blocks) :: in
        type(mechanism_type) :: mechanism
        type(output_list) :: out

        call open_record(record, 0)
        call begin_moving(part, in, mechanism, .true.)
        if (is_dyad(part%model%step(1)%kind)) call find_ways(mechanism, part%model%step(1))
        call add_output(out, of_quality, closing_quality(mechanism, part%model%step(1)))
        call make_scene_program(record, in, out, kernels%program(of_quality))
        call close_record(record)
    end subroutine make_quality

    ! ---------------------------------------------------------------- loops

    !> Errors with the matrix, and what velocities need beside it.
    subroutine make_closing(part, kernels)
        type(step_part), intent(in), target :: part
        type(step_kernels), intent(inout) :: kernels
        type(record_type), target :: record
        type(input_blocks) :: in
        type(mechanism_type) :: mechanism
        type(group_constraints) :: constraints
        type(system_type) :: system
        type(sparse_row), allocatable :: row(:)
        type(value), allocatable :: error(:)
        type(output_list) :: out

        call open_record(record, 0)
        call begin_placed(part, in, mechanism)
        call list_loop(part, mechanism, constraints)
        call make_velocities_unknown(mechanism, constraints, system)
        call require_rates(mechanism, constraints, system, error)
        allocate (row(system%n_equation))
        call list_rows(system, row)
        call list_entries(row, system%n_unknown, 0, .false., kernels%form, out)
        call find_pattern(kernels%form%n, kernels%form%row, kernels%form%column, kernels%pattern)
        call add_output(out, of_errors, error)
        call make_scene_program(record, in, out, kernels%program(of_errors))
        call make_rest(record, in, row, kernels%program(of_velocities))
        call close_record(record)
    end subroutine make_closing

    subroutine make_second_rates(part, kernels)
        type(step_part), intent(in), target :: part
        type(step_kernels), intent(inout) :: kernels
        type(record_type), target :: record
        type(input_blocks) :: in
        type(mechanism_type) :: mechanism
        type(group_constraints) :: constraints
        type(system_type) :: system
        type(sparse_row), allocatable :: row(:)
        integer :: i

        call open_record(record, 0)
        call begin_placed(part, in, mechanism)
        call list_loop(part, mechanism, constraints)
        do i = 1, part%n_own
            call move_link(part%model, i, in%of(in_motion)%v, mechanism)
        end do
        call make_accelerations_unknown(mechanism, constraints, system)
        call require_second_rates(mechanism, constraints, system)
        allocate (row(system%n_equation))
        call list_rows(system, row)
        call make_rest(record, in, row, kernels%program(of_accelerations))
        call close_record(record)
    end subroutine make_second_rates

    !> Right-hand sides, those that are always zero, too.
    subroutine make_rest(record, in, row, program)
        type(record_type), intent(in) :: record
        type(input_blocks), intent(in) :: in
        type(sparse_row), intent(in) :: row(:)
        type(scene_program), intent(inout) :: program
        type(output_list) :: out
        integer :: i

        call add_output(out, of_velocities, [(row(i)%right, i=1, size(row))])
        call make_scene_program(record, in, out, program)
    end subroutine make_rest

    !> How far joints are slid, whether axes look the same way, and how far nuts are off their threads.
    subroutine make_looks(part, kernels)
        type(step_part), intent(in), target :: part
        type(step_kernels), intent(inout) :: kernels
        type(record_type), target :: record
        type(input_blocks) :: in
        type(mechanism_type) :: mechanism
        type(marker_pair) :: pair
        type(value), allocatable :: slide(:), facing(:), thread(:)
        type(value) :: c(3), angle
        type(output_list) :: out
        integer :: i

        call open_record(record, 0)
        call begin_placed(part, in, mechanism)
        slide = slides_of(part, mechanism)
        allocate (facing(0), thread(0))
        do i = 1, part%model%n_joint
            associate (kind => part%model%joint(i)%kind)
                pair = pair_of(mechanism, i)
                if (any(moment_directions(kind) == [along_x_and_y, along_axes]) .and. .not. part%model%is_planar) then
                    facing = [facing, axis_of(pair%first, 3) .dot.axis_of(pair%second, 3)]
                    if (moment_directions(kind) == along_axes) &
                        facing = [facing, axis_of(pair%first, 1) .dot.axis_of(pair%second, 1)]
                end if
                if (.not. is_threaded(kind)) cycle
                ! what the slide makes of the angle, less the angle; but for whole turns
                c = components(pair%first.unrotate.pair%gap)
                angle = c(3)*reciprocal(mechanism%kind(i)%is%pitch) &
                        - atan2(axis_of(pair%second, 1) .dot.axis_of(pair%first, 2), &
                                axis_of(pair%second, 1) .dot.axis_of(pair%first, 1))
                thread = [thread, atan2(sin(angle), cos(angle))]
            end associate
        end do
        kernels%n_slide = size(slide)
        kernels%n_facing = size(facing)
        kernels%n_thread = size(thread)
        call add_output(out, of_looks, [slide, facing, thread])
        call make_scene_program(record, in, out, kernels%program(of_looks))
        call close_record(record)
    end subroutine make_looks
end module linkdyn_step_kernels
