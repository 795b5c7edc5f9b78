!> Kernels whose links move as they are told, run on a block of lanes: the motion stands in a kinematic state, all else in arrays of
!> lanes.
module linkdyn_equations_on_lanes
    use linkdyn_block, only: block_space, block_lanes, make_space, run_block, run_single, put_lanes, take_lanes
    use linkdyn_inputs, only: n_block, in_motion
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_link_motion, only: motion_number, motion_places, place_motion, of_rotation, of_omega, of_alpha, of_position, &
        of_velocity, of_acceleration, of_slide
    use linkdyn_model, only: model_type
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_scene_program, only: scene_program, program_space, free_scene_program, free_program_space, has_output
    use linkdyn_vec2, only: vec2
    use linkdyn_vec3, only: vec3
    implicit none (type, external)
    private
    public :: lane_numbers, lane_program, lane_space, prepare_lanes, run_on_lanes, first_output, &
        free_lane_program, free_lane_space

    type :: block_of_lanes
        real(wp), allocatable :: x(:, :)               !! (lane, number of the block)
    end type block_of_lanes

    !> Inputs but for the motion.
    type :: lane_numbers
        type(block_of_lanes) :: of(n_block) = block_of_lanes()    !! by `in_*`
    end type lane_numbers

    !> Components of a vector of the motion, or of a rotation.
    type :: motion_vector
        integer :: what = 0, level = 0, of = 0         !! as of `motion_number`
        integer :: input(9) = 0                        !! of each component; 0: it is not read
    end type motion_vector

    !> A kernel, and where its inputs come from. Constant: threads share it.
    type :: lane_program
        type(scene_program) :: program
        type(motion_vector), allocatable, private :: motion(:)
        logical, private :: is_planar = .false.
    end type lane_program

    !> Slots and results of one thread.
    type :: lane_space
        real(wp), allocatable :: found(:, :)           !! (lane, output)
        type(program_space), private :: many, one      !! for blocks, for single samples
    end type lane_space

contains

    !> Look up the inputs of a program that is made.
    subroutine prepare_lanes(model, has_columns, lane)
        type(model_type), intent(in) :: model
        logical, intent(in) :: has_columns             !! as the program was asked for
        type(lane_program), intent(inout) :: lane
        type(motion_places) :: places
        integer, allocatable :: input(:)               ! of each number of the motion; 0: none
        integer :: k, i

        call place_motion(model, has_columns, places)
        allocate (input(size(places%number)), source=0)
        do k = 1, size(lane%program%input)
            associate (segment => lane%program%input(k))
                if (segment%block /= in_motion) cycle
                input(segment%first:segment%first + segment%n - 1) = [(segment%slot + i, i=0, segment%n - 1)]
            end associate
        end do
        lane%motion = gathered(places%number, input)
        lane%is_planar = model%is_planar
    end subroutine prepare_lanes

    !> Numbers as vectors, those that nobody reads left out.
    pure function gathered(number, input) result(vector)
        type(motion_number), intent(in) :: number(:)
        integer, intent(in) :: input(:)
        type(motion_vector), allocatable :: vector(:)
        integer :: i, n

        allocate (vector(size(number)))
        n = 0
        do i = 1, size(number)
            associate (a => number(i))
                if (a%component == 1) then
                    if (n == 0) then
                        n = 1
                    else if (any(vector(n)%input > 0)) then
                        n = n + 1
                    end if
                    vector(n) = motion_vector(a%what, a%level, a%of)
                end if
                vector(n)%input(a%component) = input(i)
            end associate
        end do
        if (n > 0) then
            if (all(vector(n)%input == 0)) n = n - 1
        end if
        vector = vector(:n)
    end function gathered

    subroutine free_lane_program(lane)
        type(lane_program), intent(inout) :: lane

        call free_scene_program(lane%program)
        if (allocated(lane%motion)) deallocate (lane%motion)
    end subroutine free_lane_program

    subroutine free_lane_space(space)
        type(lane_space), intent(inout) :: space

        call free_program_space(space%many)
        call free_program_space(space%one)
        if (allocated(space%found)) deallocate (space%found)
    end subroutine free_lane_space

    !> The first of the outputs of an id, among `found`.
    pure integer function first_output(lane, id) result(first)
        type(lane_program), intent(in) :: lane
        integer, intent(in) :: id

        first = lane%program%first(has_output(lane%program, id))
    end function first_output

    !> All outputs of the lanes used; the others are like the last of these.
    subroutine run_on_lanes(lane, n_used, state, numbers, space, only_blocks)
        type(lane_program), intent(in) :: lane
        integer, intent(in) :: n_used
        type(kinematic_state), intent(in) :: state
        type(lane_numbers), intent(in) :: numbers
        type(lane_space), intent(inout) :: space
        integer, intent(in), optional :: only_blocks(:)    !! the other inputs are those of the run before, of as many lanes
        integer :: first, k

        associate (program => lane%program%program)
            if (.not. allocated(space%found)) allocate (space%found(lanes, program%n_output))
            if (n_used == 1) then
                if (space%one%lanes == 0) call make_space(program, .true., space%one%block)
                space%one%lanes = 1
                call run_some(1, 1, space%one)
            else
                if (space%many%lanes == 0) call make_space(program, .false., space%many%block)
                space%many%lanes = block_lanes()
                do first = 1, n_used, space%many%lanes
                    call run_some(first, min(space%many%lanes, n_used - first + 1), space%many)
                end do
            end if
            if (n_used == lanes) return
            do k = 1, program%n_output
                space%found(n_used + 1:, k) = space%found(n_used, k)
            end do
        end associate

    contains

        !> Lanes from the first on, as many as a block of the program has room for.
        subroutine run_some(first, n, slots)
            integer, intent(in) :: first, n                !! lanes
            type(program_space), intent(inout) :: slots
            logical :: is_loaded
            integer :: k, i, g, output

            is_loaded = .false.
            if (present(only_blocks)) is_loaded = n_used <= slots%lanes
            if (.not. is_loaded) call load_motion(lane, state, first, n, slots%block)
            do k = 1, size(lane%program%input)
                associate (segment => lane%program%input(k))
                    if (segment%block == in_motion) cycle
                    if (is_loaded) then
                        if (all(segment%block /= only_blocks)) cycle
                    end if
                    do i = 0, segment%n - 1
                        call put_lanes(n, numbers%of(segment%block)%x(first, segment%first + i), segment%slot + i, slots%block)
                    end do
                end associate
            end do
            output = 1
            associate (program => lane%program%program)
                do g = 1, size(program%group_end)
                    if (slots%lanes == 1) then
                        call run_single(program, g, slots%block)
                    else
                        call run_block(program, g, slots%block, n)
                    end if
                    do output = output, program%group_end(g)
                        call take_lanes(program, slots%block, output, n, space%found(first, output))
                    end do
                end do
            end associate
        end subroutine run_some
    end subroutine run_on_lanes

    !> Numbers of the motion of n lanes to the inputs that take them.
    subroutine load_motion(lane, state, first, n, space)
        type(lane_program), intent(in) :: lane
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: first, n
        type(block_space), intent(in) :: space
        integer :: i

        do i = 1, size(lane%motion)
            associate (v => lane%motion(i), of => lane%motion(i)%of, level => lane%motion(i)%level, plane => state%plane)
                if (v%what == of_slide) then
                    if (v%input(1) > 0) call put_lanes(n, state%slide(first, 1, of), v%input(1), space)
                    if (v%input(2) > 0) call put_lanes(n, state%slide(first, 2, of), v%input(2), space)
                else if (lane%is_planar) then
                    select case (v%what)
                    case (of_rotation)
                        if (v%input(1) > 0) call put_lanes(n, plane%rotation(of)%c(first), v%input(1), space)
                        if (v%input(2) > 0) call put_lanes(n, plane%rotation(of)%s(first), v%input(2), space)
                    case (of_omega)
                        call put_lanes(n, plane%angular(first, level_velocity, of), v%input(1), space)
                    case (of_alpha)
                        call put_lanes(n, plane%angular(first, level, of), v%input(1), space)
                    case (of_position)
                        call put_flat(plane%position(of), v%input(:2))
                    case (of_velocity)
                        call put_flat(plane%linear(level_velocity, of), v%input(:2))
                    case (of_acceleration)
                        call put_flat(plane%linear(level, of), v%input(:2))
                    end select
                else
                    select case (v%what)
                    case (of_rotation)
                        call put(state%rotation(of)%x, v%input(1:3))
                        call put(state%rotation(of)%y, v%input(4:6))
                        call put(state%rotation(of)%z, v%input(7:9))
                    case (of_omega)
                        call put(state%omega_body(of), v%input(1:3))
                    case (of_alpha)
                        call put(state%alpha_body(level, of), v%input(1:3))
                    case (of_position)
                        call put(state%position(of), v%input(1:3))
                    case (of_velocity)
                        call put(state%velocity(of), v%input(1:3))
                    case (of_acceleration)
                        if (level == level_given) then
                            call put(state%acceleration_body(level, of), v%input(1:3))
                        else
                            call put(state%acceleration(level, of), v%input(1:3))
                        end if
                    end select
                end if
            end associate
        end do

    contains

        subroutine put(v, input)
            type(vec3), intent(in) :: v
            integer, intent(in) :: input(3)

            if (input(1) > 0) call put_lanes(n, v%x(first), input(1), space)
            if (input(2) > 0) call put_lanes(n, v%y(first), input(2), space)
            if (input(3) > 0) call put_lanes(n, v%z(first), input(3), space)
        end subroutine put

        subroutine put_flat(v, input)
            type(vec2), intent(in) :: v
            integer, intent(in) :: input(2)

            if (input(1) > 0) call put_lanes(n, v%x(first), input(1), space)
            if (input(2) > 0) call put_lanes(n, v%y(first), input(2), space)
        end subroutine put_flat
    end subroutine load_motion
end module linkdyn_equations_on_lanes
