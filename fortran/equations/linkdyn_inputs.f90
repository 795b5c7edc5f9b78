!> What a kernel of a scene takes: blocks of numbers, each a column of an array for every sample.
!>
!> What a request leaves out (loads that are not there, rates of a mechanism at rest, numbers that do not vary) is a
!> constant, and folds away.
module linkdyn_inputs
    use linkdyn_base_motion, only: base_is_felt
    use linkdyn_contact, only: n_part, part_of, holds_contact
    use linkdyn_effort_laws, only: follows_target, is_given
    use linkdyn_kinds, only: wp
    use linkdyn_link_motion, only: motion_places, place_motion
    use linkdyn_model, only: model_type, place_size, counts_for_another, friction_is_shared
    use linkdyn_numbers, only: number_places, place_numbers, collect_numbers
    use linkdyn_payloads, only: payload_is_input
    use linkdyn_record, only: new_input
    use linkdyn_scene, only: law_over, n_stop, n_clutch
    use linkdyn_value, only: value, constant, zero
    implicit none (type, external)
    private
    public :: trace_request, sample_set, input_blocks, make_inputs, n_block
    public :: in_q, in_quaternion, in_qd, in_qdd, in_load, in_target, in_effort, in_branch, in_place, in_number
    public :: in_found, in_pull, in_base, in_payload, in_friction, in_counted
    public :: in_motion, in_stop, in_clutch, in_sense, in_unknown, in_transposed, in_shared, in_step, in_direction, add_inputs, &
        add_block

    ! ---- the blocks
    integer, parameter :: in_q = 1              !! coordinates (n_q) [m, rad]
    integer, parameter :: in_quaternion = 2     !! of links whose attitude is integrated by one (4 n_attitude)
    integer, parameter :: in_qd = 3             !! (n_q)
    integer, parameter :: in_qdd = 4            !! (n_q)
    integer, parameter :: in_load = 5           !! (6 n_load) [N, N m]
    integer, parameter :: in_target = 6         !! of the drives' laws: value and rate (2 n_actuator)
    integer, parameter :: in_effort = 7         !! driving forces that are given (n_actuator) [N, N m]
    integer, parameter :: in_branch = 8         !! +1 or -1 (n_branch)
    integer, parameter :: in_place = 9          !! of links placed by iteration: x, y, angle, or x y z and quaternion (place_size
                                                !! n_link)
    integer, parameter :: in_number = 10        !! numbers of the scene that vary
    integer, parameter :: in_found = 11         !! what another program of the same record has found
    integer, parameter :: in_pull = 12          !! of springs' own laws over the state (n_spring) [N, N m]
    integer, parameter :: in_base = 13          !! what is felt of the frame's motion (n_base), see `linkdyn_base_motion`
    integer, parameter :: in_payload = 14       !! masses that links carry (n_payload) [kg]
    integer, parameter :: in_friction = 15      !! of contacts, over the speed of their surfaces (n_contact) [N s/m]
    integer, parameter :: in_counted = 16       !! angles that coordinates stand in for, as they count turns (n_q) [rad]
    ! ---- of equations whose motion is given
    integer, parameter :: in_motion = 17        !! how links stand and move, as `linkdyn_link_motion` lists it
    integer, parameter :: in_stop = 18          !! pushes of hard stops, away from these (n_stop) [N, N m]
    integer, parameter :: in_clutch = 19        !! forces of clutches, at their first variable (n_clutch) [N, N m]
    integer, parameter :: in_sense = 20         !! of contacts that may stick: they slide that way, a unit vector over the joint
                                                !! variables of each, or hold, 2; 0: smooth (n_part n_contact)
    integer, parameter :: in_unknown = 21       !! unknowns of the equations, once somebody has found them (n_unknown)
    integer, parameter :: in_transposed = 22    !! right-hand sides of the transposed equations (n_unknown)
    integer, parameter :: in_shared = 23        !! what joints share of reactions that the equations leave open, world axes (6
                                                !! n_joint)
    integer, parameter :: in_step = 24          !! of a whole step of an integrator, beside the state, as `step_inputs` tells
    integer, parameter :: in_direction = 25     !! in which a state and what acts change, as `linkdyn_linear_program` tells
    integer, parameter :: n_block = 25

    !> What is wanted of a trace.
    type :: trace_request
        logical :: at_rest = .false.                       !! positions alone
        logical :: has_friction = .false.                  !! joints rub, and whoever runs the kernel knows how much
        logical :: by_work = .false.                       !! equations are those of virtual work
        logical :: by_quaternion = .false.                 !! poses are given by position and quaternion
        logical :: motion_is_given = .false.               !! nothing is placed: whoever runs the kernel knows how links move; and
                                                           !! he gives all driving forces that are not unknown, stops and clutches
                                                           !! push
        logical :: efforts_are_given = .false.             !! driving forces that are not unknown are inputs, whatever their laws
        logical :: has_columns = .false.                   !! of a motion that is given: how it changes with the coordinates
        logical, allocatable :: has_load(:, :)             !! (6, load); absent: none
        logical, allocatable :: drive_is_unknown(:)        !! (actuator); absent: all are
        logical, allocatable :: acceleration_is_unknown(:) !! (coordinate); absent: none is
        integer, allocatable :: varying(:)                 !! numbers of the scene that are inputs; absent: none
    end type trace_request

    type :: block_numbers
        real(wp), allocatable :: x(:, :)                   !! (number, sample)
    end type block_numbers

    !> Numbers of all blocks at representative samples.
    type :: sample_set
        integer :: n = 0
        type(block_numbers) :: of(n_block) = block_numbers()
    end type sample_set

    !> Which numbers of a block are inputs, and where they begin.
    type :: block_places
        integer :: first = 1                               !! among the inputs of the kernel
        integer, allocatable :: which(:)                   !! in the block
        type(value), allocatable :: v(:)                   !! all of the block, inputs and constants
    end type block_places

    type :: input_blocks
        type(block_places) :: of(n_block)
        integer :: n = 0                                   !! inputs in all
    end type input_blocks

contains

    !> Make the inputs that a request asks for.
    subroutine make_inputs(model, request, sample, blocks)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        type(sample_set), intent(in) :: sample
        type(input_blocks), intent(out) :: blocks
        type(number_places) :: at
        type(motion_places) :: motion
        real(wp), allocatable :: number(:)
        logical :: is_input(place_size(model), model%n_link)
        integer :: k, i

        call place_numbers(model, at)
        allocate (number(at%n))
        call collect_numbers(model, at, number)
        call add(in_q, [(.true., k=1, model%n_q)])
        call add(in_quaternion, [(request%by_quaternion, k=1, 4*model%n_attitude)])
        call add(in_qd, [(.not. request%at_rest, k=1, model%n_q)])
        call add(in_qdd, [(.not. request%at_rest .and. (request%motion_is_given .or. .not. is_unknown(k)), k=1, model%n_q)])
        call add(in_load, [((has_load(i, k), i=1, 6), k=1, model%n_load)])
        call add(in_target, [((follows_target(model%scene%actuator(k)%law) .and. is_known(k), i=1, 2), k=1, model%n_actuator)])
        call add(in_effort, [(is_known(k) .and. (request%motion_is_given .or. request%efforts_are_given &
                                                  .or. is_given(model%scene%actuator(k)%law)), k=1, model%n_actuator)])
        call add(in_branch, [(any(model%step%has_margin .and. model%step%first == k) .and. .not. request%motion_is_given, &
                              k=1, model%n_branch)])
        call add(in_pull, [(model%scene%spring(k)%force%kind == law_over, k=1, size(model%scene%spring))])
        call add(in_base, base_is_felt(model))
        call add(in_payload, payload_is_input(model), model%scene%payload%mass%value(1))
        call add(in_friction, [(request%has_friction, k=1, size(model%contact))])
        call add(in_counted, [(counts_for_another(model, k), k=1, model%n_q)])
        is_input = .false.
        do k = 1, merge(0, size(model%group), request%motion_is_given)
            is_input(:, model%group(k)%link) = .true.
        end do
        call add(in_place, [is_input])
        call add(in_number, [(varies(k), k=1, at%n)], number)
        if (.not. request%motion_is_given) allocate (motion%number(0))
        if (request%motion_is_given) call place_motion(model, request%has_columns, motion)
        call add(in_motion, [(.true., k=1, size(motion%number))])
        call add(in_stop, [(request%motion_is_given .and. model%scene%stop(k)%is_hard, k=1, n_stop(model%scene))])
        call add(in_clutch, [(request%motion_is_given, k=1, n_clutch(model%scene))])
        call add(in_shared, [(request%motion_is_given .and. request%has_friction .and. friction_is_shared(model), &
                              k=1, 6*model%n_joint)])
        call add(in_sense, [((knows_senses() .and. may_stick(model, k, i), i=1, n_part), k=1, size(model%contact))])

    contains

        !> Is it known which way joints slide that may stick? Runs know it; where motion comes from elsewhere it may be told.
        logical function knows_senses()
            integer :: k

            knows_senses = request%motion_is_given .or. any([(is_unknown(k), k=1, model%n_q)])
        end function knows_senses

        logical function is_unknown(k)
            integer, intent(in) :: k

            is_unknown = .false.
            if (allocated(request%acceleration_is_unknown)) is_unknown = request%acceleration_is_unknown(k)
        end function is_unknown

        logical function is_known(k)
            integer, intent(in) :: k

            is_known = .false.
            if (allocated(request%drive_is_unknown)) is_known = .not. request%drive_is_unknown(k)
        end function is_known

        logical function has_load(i, k)
            integer, intent(in) :: i, k

            has_load = .false.
            if (allocated(request%has_load)) has_load = request%has_load(i, k)
        end function has_load

        logical function varies(k)
            integer, intent(in) :: k

            varies = .false.
            if (allocated(request%varying)) varies = any(request%varying == k)
        end function varies

        subroutine add(block, is_input, number)
            integer, intent(in) :: block
            logical, intent(in) :: is_input(:)
            real(wp), intent(in), optional :: number(:)    !! of what is no input; absent: zero

            call add_block(block, is_input, sample, blocks, number)
        end subroutine add
    end subroutine make_inputs

    !> Further inputs, which no request asks for.
    subroutine add_inputs(block, n, sample, blocks)
        integer, intent(in) :: block                       !! `in_unknown`, `in_transposed`, `in_step` or
                                                           !! `in_direction`
        integer, intent(in) :: n
        type(sample_set), intent(in) :: sample
        type(input_blocks), intent(inout) :: blocks

        call add_block(block, spread(.true., 1, n), sample, blocks)
    end subroutine add_inputs

    !> Is a contact one that may be held along this one of the joint variables along which it slides?
    pure logical function may_stick(model, i, part)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i, part
        integer :: k

        may_stick = .false.
        do k = 1, n_clutch(model%scene)
            associate (clutch => model%scene%clutch(k), contact => model%contact(i))
                may_stick = may_stick .or. (holds_contact(clutch, contact) .and. part_of(contact, clutch) == part)
            end associate
        end do
    end function may_stick

    !> Inputs for some numbers of a block; the others are constants.
    subroutine add_block(block, is_input, sample, blocks, number)
        integer, intent(in) :: block
        logical, intent(in) :: is_input(:)
        type(sample_set), intent(in) :: sample
        type(input_blocks), intent(inout) :: blocks
        real(wp), intent(in), optional :: number(:)
        integer :: k

        associate (b => blocks%of(block))
            b%first = blocks%n + 1
            b%which = pack([(k, k=1, size(is_input))], is_input)
            allocate (b%v(size(is_input)))
            do k = 1, size(is_input)
                if (is_input(k)) then
                    blocks%n = blocks%n + 1
                    b%v(k) = new_input(numbers_at(k))
                else if (present(number)) then
                    b%v(k) = constant(number(k))
                else
                    b%v(k) = zero()
                end if
            end do
        end associate

    contains

        function numbers_at(k) result(x)
            integer, intent(in) :: k
            real(wp) :: x(sample%n)

            x = 0
            if (allocated(sample%of(block)%x)) x = sample%of(block)%x(k, :)
        end function numbers_at
    end subroutine add_block
end module linkdyn_inputs
