!> Kernels of the plan's steps on a block of lanes: fed with where links are and how they move, and what comes of it put there.
module linkdyn_steps_on_lanes
    use linkdyn_block, only: block_lanes, make_space, run_block, run_single, put_lanes, take_lanes
    use linkdyn_led_coordinates, only: given_position, given_rate, given_acceleration, given_column
    use linkdyn_inputs, only: in_q, in_qd, in_qdd, in_quaternion, in_branch, in_number, in_motion
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_type, part_type, orientation_of, link_freedom, gives_attitude
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_same_lanes, only: is_same_on_all
    use linkdyn_scene_program, only: scene_program, program_space
    use linkdyn_step_kernels, only: step_kernels, kernel_space, borrow_kernels, return_kernels, need_kernel, place_numbers_of, &
        rate_numbers_of
    use linkdyn_vec2, only: vec2, rot2
    use linkdyn_vec3, only: vec3, mat3
    implicit none (type, external)
    private
    public :: kernel_use, begin_use, end_use, run_kernel, set_places, set_rates, place_rates

    !> A step's kernels while they are used.
    type :: kernel_use
        integer :: step = 0                              !! of the plan
        type(step_kernels), pointer :: kernels => null()
        type(kernel_space), pointer, private :: space => null()
    end type kernel_use

contains

    subroutine begin_use(model, step, state, use)
        type(model_type), intent(in) :: model
        integer, intent(in) :: step                      !! number in the plan
        type(kinematic_state), intent(in) :: state
        type(kernel_use), intent(out) :: use
        logical :: by_quaternion

        use%step = step
        by_quaternion = .false.
        if (gives_attitude(model, model%step(step))) by_quaternion = state%by_quaternion(model%step(step)%first)
        call borrow_kernels(model, step, by_quaternion, use%kernels, use%space)
        use%space%has_numbers = .false.                  ! those of the last one's model may be there
    end subroutine begin_use

    subroutine end_use(use)
        type(kernel_use), intent(inout) :: use

        call return_kernels(use%kernels, use%space)
    end subroutine end_use

    !> Places of a step's links.
    pure subroutine set_places(model, part, place, state)
        type(model_type), intent(in) :: model
        type(part_type), intent(in) :: part
        real(wp), intent(in) :: place(:, :)              !! (lane, number)
        type(kinematic_state), intent(inout) :: state
        integer :: i, k, o

        do i = 1, size(part%link)
            k = place_numbers_of(model)*(i - 1)
            o = orientation_of(model, part%link(i))
            associate (l => part%link(i))
                if (model%is_planar) then
                    state%plane%position(l) = vec2(place(:, k + 1), place(:, k + 2))
                    if (part%turns(i)) state%plane%rotation(o) = rot2(place(:, k + 3), place(:, k + 4))
                else
                    state%position(l) = vector_at(k)
                    if (part%turns(i)) state%rotation(o) = mat3(vector_at(k + 3), vector_at(k + 6), vector_at(k + 9))
                end if
            end associate
        end do

    contains

        pure function vector_at(k) result(v)
            integer, intent(in) :: k
            type(vec3) :: v

            v = vec3(place(:, k + 1), place(:, k + 2), place(:, k + 3))
        end function vector_at
    end subroutine set_places

    !> Rates of a step's links at a level, on some lanes.
    subroutine set_rates(model, part, level, rate, state, is_set)
        type(model_type), intent(in) :: model
        type(part_type), intent(in) :: part
        integer, intent(in) :: level
        real(wp), intent(in) :: rate(:, :)               !! (lane, row)
        type(kinematic_state), intent(inout) :: state
        logical, intent(in), optional :: is_set(lanes)   !! absent: all
        logical :: here(lanes)
        integer :: i, k, o

        here = .true.
        if (present(is_set)) here = is_set
        do i = 1, size(part%link)
            k = link_freedom(model)*(i - 1)
            o = orientation_of(model, part%link(i))
            associate (l => part%link(i))
                if (model%is_planar) then
                    call set(rate(:, k + 1), state%plane%linear(level, l)%x)
                    call set(rate(:, k + 2), state%plane%linear(level, l)%y)
                    if (part%turns(i)) call set(rate(:, k + 3), state%plane%angular(:, level, o))
                else if (level == level_velocity) then
                    call set_vector(k, state%velocity(l))
                    if (part%turns(i)) call set_vector(k + 3, state%omega(o))
                else
                    call set_vector(k, state%acceleration(level, l))
                    if (part%turns(i)) call set_vector(k + 3, state%alpha(level, o))
                end if
            end associate
        end do

    contains

        pure subroutine set_vector(k, v)
            integer, intent(in) :: k
            type(vec3), intent(inout) :: v

            call set(rate(:, k + 1), v%x)
            call set(rate(:, k + 2), v%y)
            call set(rate(:, k + 3), v%z)
        end subroutine set_vector

        pure subroutine set(found, x)
            real(wp), intent(in) :: found(lanes)
            real(wp), intent(inout) :: x(lanes)

            where (here) x = found
        end subroutine set
    end subroutine set_rates

    !> Run a kernel where the links stand and move.
    subroutine run_kernel(model, use, which, state, found, level, ahead)
        type(model_type), intent(in) :: model
        type(kernel_use), intent(in) :: use
        integer, intent(in) :: which                     !! one of `of_*`
        type(kinematic_state), intent(in) :: state
        real(wp), allocatable, intent(inout) :: found(:, :)    !! (lane, output)
        integer, intent(in), optional :: level           !! of the rates
        real(wp), intent(in), optional :: ahead(lanes)   !! links have gone on with their velocities for so long
        integer :: first

        call need_kernel(model, use%step, which, use%kernels)
        associate (program => use%kernels%program(which), space => use%space, number => model%part(use%step)%number)
            call make_room(sum(program%input%n, mask=program%input%block /= in_number), space%x)
            call make_room(program%program%n_output, found)
            call collect_inputs(model, model%step(use%step), model%part(use%step), program, state, level, ahead, space%x)
            if (is_same_on_all(size(space%x, 2), space%x)) then
                ! a run on its own has the same on all lanes
                if (space%one(which)%lanes == 0) call make_space(program%program, .true., space%one(which)%block)
                space%one(which)%lanes = 1
                call put_numbers(program, number, space%one(which), space%has_numbers(which, 2))
                call run_lanes(program, space%one(which), 1, 1, space%x, found)
                found(2:, :) = spread(found(1, :), 1, lanes - 1)
                return
            end if
            if (space%many(which)%lanes == 0) call make_space(program%program, .false., space%many(which)%block)
            space%many(which)%lanes = block_lanes()
            call put_numbers(program, number, space%many(which), space%has_numbers(which, 1))
            do first = 1, lanes, block_lanes()
                call run_lanes(program, space%many(which), first, min(block_lanes(), lanes - first + 1), space%x, found)
            end do
        end associate
    end subroutine run_kernel

    !> For n numbers on all lanes.
    subroutine make_room(n, x)
        integer, intent(in) :: n
        real(wp), allocatable, intent(inout) :: x(:, :)

        if (allocated(x)) then
            if (size(x, 2) == n) return
            deallocate (x)
        end if
        allocate (x(lanes, n))
    end subroutine make_room

    !> The step's numbers, which all lanes share: they stay in their slots.
    subroutine put_numbers(program, number, space, are_there)
        type(scene_program), intent(in) :: program
        real(wp), intent(in) :: number(:)
        type(program_space), intent(in) :: space
        logical, intent(inout) :: are_there
        integer :: i, k

        if (are_there) return
        are_there = .true.
        do i = 1, size(program%input)
            associate (s => program%input(i))
                if (s%block /= in_number) cycle
                do k = 0, s%n - 1
                    call put_lanes(1, number(s%first + k:s%first + k), s%slot + k, space%block)
                end do
            end associate
        end do
    end subroutine put_numbers

    !> Lanes first, ..., first + n - 1.
    subroutine run_lanes(program, space, first, n, x, found)
        type(scene_program), intent(in) :: program
        type(program_space), intent(in) :: space
        integer, intent(in) :: first, n
        real(wp), intent(in), contiguous :: x(:, :)         !! as `collect_inputs` lists them (lane, number)
        real(wp), intent(inout), contiguous :: found(:, :)  !! (lane, output)
        integer :: i, g, k, slot

        k = 0
        do i = 1, size(program%input)
            if (program%input(i)%block == in_number) cycle
            do slot = program%input(i)%slot, program%input(i)%slot + program%input(i)%n - 1
                k = k + 1
                call put_lanes(n, x(first:first + n - 1, k), slot, space%block)
            end do
        end do
        k = 1
        do g = 1, size(program%program%group_end)
            if (space%lanes == 1) then
                call run_single(program%program, g, space%block)
            else
                call run_block(program%program, g, space%block, n)
            end if
            do k = k, program%program%group_end(g)
                call take_lanes(program%program, space%block, k, n, found(first:first + n - 1, k))
            end do
        end do
    end subroutine run_lanes

    !> What a kernel reads besides the step's numbers, in the order of its inputs.
    subroutine collect_inputs(model, step, part, program, state, level, ahead, x)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(part_type), intent(in) :: part
        type(scene_program), intent(in) :: program
        type(kinematic_state), intent(in) :: state
        integer, intent(in), optional :: level
        real(wp), intent(in), optional :: ahead(lanes)
        real(wp), intent(inout) :: x(:, :)               !! (lane, number)
        integer :: i, k, n

        n = 0
        do i = 1, size(program%input)
            associate (s => program%input(i))
                if (s%block == in_number) cycle
                do k = 0, s%n - 1
                    n = n + 1
                    select case (s%block)
                    case (in_q)
                        x(:, n) = given_position(model, state, part%given(s%first + k), part%joint)
                    case (in_qd)
                        if (level <= level_given) then
                            x(:, n) = given_rate(model, state, part%given(s%first + k), part%joint)
                        else
                            x(:, n) = given_column(model, state, part%given(s%first + k), level, part%joint)
                        end if
                    case (in_qdd)
                        x(:, n) = given_acceleration(model, state, part%given(s%first + k), part%joint)
                    case (in_quaternion)
                        x(:, n) = state%quaternion(:, s%first + k, step%first)
                    case (in_branch)
                        x(:, n) = state%branch(:, step%first)
                    case (in_motion)
                        x(:, n) = motion_number(model, part, state, s%first + k, level, ahead)
                    end select
                end do
            end associate
        end do
    end subroutine collect_inputs

    !> A number of the motion, in the order of `linkdyn_step_kernels`.
    function motion_number(model, part, state, number, level, ahead) result(x)
        type(model_type), intent(in) :: model
        type(part_type), intent(in) :: part
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: number
        integer, intent(in), optional :: level
        real(wp), intent(in), optional :: ahead(lanes)
        real(wp) :: x(lanes)
        integer :: k, n_place, n_rate

        n_place = place_numbers_of(model)
        n_rate = rate_numbers_of(model)
        k = number - 1
        if (k < n_place*size(part%around)) then
            x = place_of_link(model, state, part%around(k/n_place + 1), modulo(k, n_place) + 1, ahead)
            return
        end if
        k = k - n_place*size(part%around)
        if (k < n_rate*size(part%around)) then
            ! accelerations need velocities, too
            x = rate_of_link(model, state, part%around(k/n_rate + 1), modulo(k, n_rate) + 1, &
                             merge(level_velocity, level, level == level_given))
            return
        end if
        k = k - n_rate*size(part%around)
        x = rate_of_link(model, state, part%around(k/n_rate + 1), modulo(k, n_rate) + 1, level_given)
    end function motion_number

    !> Component c of where a link is.
    pure function place_of_link(model, state, l, c, ahead) result(x)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: l, c
        real(wp), intent(in), optional :: ahead(lanes)
        real(wp) :: x(lanes), rate(lanes)
        integer :: o

        o = orientation_of(model, l)
        rate = 0
        if (model%is_planar) then
            associate (r => state%plane%rotation(o), omega => state%plane%angular(:, level_velocity, o))
                select case (c)
                case (1)
                    x = state%plane%position(l)%x
                case (2)
                    x = state%plane%position(l)%y
                case (3)
                    x = r%c
                    if (present(ahead)) rate = -omega*r%s
                case (4)
                    x = r%s
                    if (present(ahead)) rate = omega*r%c
                end select
            end associate
        else
            call pick_place(state%position(l), state%rotation(o), c, x)
            if (present(ahead) .and. c > 3) &
                rate = turning(state%omega(o), axis_of(state%rotation(o), (c - 1)/3), modulo(c - 1, 3) + 1)
        end if
        if (.not. present(ahead)) return
        if (c <= merge(2, 3, model%is_planar)) rate = rate_of_link(model, state, l, c, level_velocity)
        x = x + ahead*rate
    end function place_of_link

    !> Component c of a position and a rotation, the latter axis by axis.
    pure subroutine pick_place(position, r, c, x)
        type(vec3), intent(in) :: position
        type(mat3), intent(in) :: r
        integer, intent(in) :: c
        real(wp), intent(out) :: x(lanes)

        select case (c)
        case (1)
            x = position%x
        case (2)
            x = position%y
        case (3)
            x = position%z
        case (4)
            x = r%x%x
        case (5)
            x = r%x%y
        case (6)
            x = r%x%z
        case (7)
            x = r%y%x
        case (8)
            x = r%y%y
        case (9)
            x = r%y%z
        case (10)
            x = r%z%x
        case (11)
            x = r%z%y
        case (12)
            x = r%z%z
        end select
    end subroutine pick_place

    !> Rates of a link's place: of its origin, then its angular velocity; at level k for a unit rate of coordinate k.
    pure function place_rates(model, state, link, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link, level
        real(wp) :: rate(lanes, link_freedom(model))
        integer :: c

        do c = 1, size(rate, 2)
            rate(:, c) = rate_of_link(model, state, link, c, level)
        end do
    end function place_rates

    !> Component c of how a link moves, world axes.
    pure function rate_of_link(model, state, l, c, level) result(x)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: l, c, level
        real(wp) :: x(lanes)
        integer :: o

        o = orientation_of(model, l)
        if (model%is_planar) then
            select case (c)
            case (1)
                x = state%plane%linear(level, l)%x
            case (2)
                x = state%plane%linear(level, l)%y
            case (3)
                x = state%plane%angular(:, level, o)
            end select
        else if (level == level_velocity) then
            if (c <= 3) x = part(state%velocity(l), c)
            if (c > 3) x = part(state%omega(o), c - 3)
        else
            if (c <= 3) x = part(state%acceleration(level, l), c)
            if (c > 3) x = part(state%alpha(level, o), c - 3)
        end if
    end function rate_of_link

    !> Component c of a x b.
    pure function turning(a, b, c) result(x)
        type(vec3), intent(in) :: a, b
        integer, intent(in) :: c
        real(wp) :: x(lanes)

        select case (c)
        case (1)
            x = a%y*b%z - a%z*b%y
        case (2)
            x = a%z*b%x - a%x*b%z
        case (3)
            x = a%x*b%y - a%y*b%x
        end select
    end function turning

    pure function axis_of(r, k) result(axis)
        type(mat3), intent(in) :: r
        integer, intent(in) :: k
        type(vec3) :: axis

        select case (k)
        case (1)
            axis = r%x
        case (2)
            axis = r%y
        case (3)
            axis = r%z
        end select
    end function axis_of

    pure function part(v, c) result(x)
        type(vec3), intent(in) :: v
        integer, intent(in) :: c
        real(wp) :: x(lanes)

        select case (c)
        case (1)
            x = v%x
        case (2)
            x = v%y
        case (3)
            x = v%z
        end select
    end function part
end module linkdyn_steps_on_lanes
