!> A step of the plan as a mechanism of its own: the links that it places, those that they hang on, and the joints between them,
!> numbered anew.
!>
!> Links of the step come first, then those around it, whose motion is known; the frame is the frame. What the step is given by
!> coordinates, or by gears, are coordinates of its own. Two parts with the same `key` differ in their numbers alone: kernels of
!> the one, which take these for inputs, serve the other.
module linkdyn_step_part
    use linkdyn_joint_table, only: joint_cam
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, step_type, group_type, led_type, step_group, step_joint, step_parts, step_ups, is_dyad, &
        gives_attitude, leads_within, orientation_of, turns_in_two
    use linkdyn_numbers, only: number_places, place_numbers, collect_numbers, to_frame, of_marker, of_stance
    use linkdyn_scene, only: cam_spec, coordinate_joint, coordinate_pose
    use linkdyn_text, only: listed
    implicit none (type, external)
    private
    public :: step_part, take_step, describe_steps, describe_step, letters_of, bits_of, curve_text

    type :: step_part
        type(model_type) :: model                      !! of the part
        integer :: n_own = 0                           !! links that it places: its first ones
        integer, allocatable :: link(:)                !! in the whole mechanism (link of the part)
        integer, allocatable :: joint(:)               !! likewise (joint of the part)
        integer, allocatable :: given(:)               !! what its coordinates are there: coordinates, and beyond the last what
                                                       !! gears lead; of what joints of the part lead themselves the rest
                                                       !! (coordinate)
        real(wp), allocatable :: number(:)             !! as `linkdyn_numbers` lists them
        logical, allocatable :: varies(:)              !! it is no part of the key
        character(len=:), allocatable :: key
    end type step_part

contains

    !> What of each step its kernels take: to be said anew when numbers of the model change.
    subroutine describe_steps(model)
        type(model_type), intent(inout) :: model
        integer :: i

        if (allocated(model%part)) deallocate (model%part)
        allocate (model%part(size(model%step)))
        do i = 1, size(model%step)
            call describe_step(model, i)
        end do
    end subroutine describe_steps

    !> Describe one step again after its numbers have changed.
    subroutine describe_step(model, i)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: i                       !! step of the plan
        type(step_part) :: part

        call take_step(model, i, part)
        model%step(i)%number = i
        if (model%step(i)%kind == step_group) model%group(model%step(i)%first)%step = i
        associate (of => model%part(i))
            of%key = part%key
            of%link = part%link(:part%n_own)
            of%around = part%link
            of%turns = own_turns(model, part)
            of%joint = part%joint
            of%given = part%given
            of%number = part%number
        end associate
    end subroutine describe_step

    !> Links of the part whose orientation is their own: no other's that comes before them, or is known.
    pure function own_turns(model, part) result(turns)
        type(model_type), intent(in) :: model
        type(step_part), intent(in) :: part
        logical :: turns(part%n_own)
        integer :: i, k, o

        do i = 1, part%n_own
            o = orientation_of(model, part%link(i))
            turns(i) = o > 0
            do k = 1, size(part%link)
                if (k < i .or. k > part%n_own) turns(i) = turns(i) .and. orientation_of(model, part%link(k)) /= o
            end do
        end do
    end function own_turns

    !> Step i of the plan.
    subroutine take_step(model, i, part)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        type(step_part), intent(out) :: part
        type(step_type) :: own
        integer :: k, n

        own = model%step(i)
        if (own%kind == step_group) then
            call take_group(model, model%group(own%first), part)
        else
            call begin_part(model, own%link(:own%n_link), pack(own%joint, own%joint > 0), turns_as_one(model, own), part)
            call give(model, pack(own%coordinate, own%coordinate > 0), part)
            own%link(:own%n_link) = [(k, k=1, own%n_link)]
            own%joint = [(merge(k, 0, own%joint(k) > 0), k=1, size(own%joint))]
            n = 0
            do k = 1, size(own%coordinate)
                if (own%coordinate(k) == 0) cycle
                n = n + 1
                own%coordinate(k) = n
                part%model%scene%coordinate(n)%kind = coordinate_pose
                if (own%kind == step_joint) call lead_joint(part, n, 1, k)
                if (own%kind == step_parts) call lead_joint(part, n, 1 + (k - 1)/3, 1 + mod(k - 1, 3))
                if (is_dyad(own%kind) .and. k <= 2) call lead_joint(part, n, 3 + k, 1)
                if (is_dyad(own%kind) .and. k > 2) call lead_joint(part, n, 1 + 2*((k - 3)/2), 1 + mod(k - 3, 2))
            end do
            part%model%n_dyad = merge(1, 0, is_dyad(own%kind))
            part%model%n_branch = merge(1, 0, own%has_margin)
            part%model%n_attitude = merge(1, 0, gives_attitude(model, model%step(i)))    ! own joints have numbers of their own
        end if
        own%first = merge(1, 0, own%first > 0)
        own%number = 1
        part%model%step = [own]
        call end_part(part)
        part%key = part%key//" step"//listed([own%kind, own%first, own%coordinate, own%branch, own%turn, own%far_turn, &
                                              merge([1, 1, 1, 1], 0, [own%has_branches, own%has_margin, own%from_second, &
                                                                      own%base_moves])])
    end subroutine take_step

    !> Halves of a leg that slide on each other.
    pure logical function turns_as_one(model, step)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step

        turns_as_one = step%kind == step_ups
        if (turns_as_one) turns_as_one = .not. turns_in_two(model, step)
    end function turns_as_one

    subroutine take_group(model, group, part)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(step_part), intent(inout) :: part
        type(group_type) :: own
        integer :: i, k

        call begin_part(model, group%link, group%joint, .false., part)
        call give(model, distinct(pack(group%coordinate, group%coordinate > 0)), part)
        own%link = [(i, i=1, size(group%link))]
        own%joint = [(i, i=1, size(group%joint))]
        own%coordinate = group%coordinate
        do i = 1, size(group%joint)
            do k = 1, 3
                if (group%coordinate(k, i) == 0) cycle
                own%coordinate(k, i) = findloc(part%given, group%coordinate(k, i), dim=1)
                call lead_joint(part, own%coordinate(k, i), i, k)
            end do
        end do
        own%turns = [(.true., i=1, size(group%link))]
        call lead_by_own(model, part, own)
        part%model%group = [own]
    end subroutine take_group

    ! ---------------------------------------------------------------- the links and joints

    !> A small model of the links that a step places and of their neighbours, which stand already; its numbers are filled in later.
    subroutine begin_part(model, link, joint, turn_as_one, part)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link(:), joint(:)       !! that are placed; between these and known ones
        logical, intent(in) :: turn_as_one             !! the links placed share one turning; else each turns alone, those that
                                                       !! slide on each other, too
        type(step_part), intent(inout) :: part
        integer :: i, side, o

        part%n_own = size(link)
        part%link = link
        part%joint = joint
        do i = 1, size(joint)
            do side = 1, 2
                associate (l => model%joint(joint(i))%link(side))
                    if (l > 0 .and. all(part%link /= l)) part%link = [part%link, l]
                end associate
            end do
        end do
        associate (m => part%model)
            m%is_planar = model%is_planar
            m%n_link = size(part%link)
            m%n_joint = size(joint)
            m%link = model%link(part%link)
            m%joint = model%joint(joint)
            o = 0
            do i = 1, m%n_link
                if (.not. turn_as_one .or. i == 1 .or. i > part%n_own) o = o + 1
                m%link(i)%orientation = o
                if (i > part%n_own .and. model%link(part%link(i))%orientation == 0) then
                    o = o - 1
                    m%link(i)%orientation = 0          ! it turns as the frame does, not at all
                end if
            end do
            m%n_orientation = o
            do i = 1, m%n_joint
                do side = 1, 2
                    associate (l => m%joint(i)%link(side))
                        if (l > 0) l = findloc(part%link, l, dim=1)
                    end associate
                end do
                m%joint(i)%told = i
                m%joint(i)%gear = 0
                m%joint(i)%belt = 0
            end do
            allocate (m%step(0), m%payload(0), &
                      m%gear(0), m%belt(0), m%motor(0), m%contact(0), m%loose(0), m%group(0), m%leg(0), m%led(0))
            allocate (m%scene%spring(0), m%scene%payload(0), m%scene%actuator(0), m%scene%load(0))
            m%scene%joint = model%scene%joint(model%joint(joint)%told)
        end associate
    end subroutine begin_part

    !> What is given becomes the part's coordinates.
    subroutine give(model, given, part)
        type(model_type), intent(in) :: model
        integer, intent(in) :: given(:)
        type(step_part), intent(inout) :: part
        integer :: k

        part%given = given
        part%model%n_q = size(given)
        allocate (part%model%scene%coordinate(size(given)))
        do k = 1, size(given)
            if (given(k) > model%n_q) cycle
            associate (c => part%model%scene%coordinate(k), whole => model%scene%coordinate(given(k)))
                c%kind = whole%kind
                c%variable = whole%variable
                if (whole%kind == coordinate_joint) c%joint = findloc(part%joint, whole%joint, dim=1)
            end associate
        end do
    end subroutine give

    !> Coordinate k of the part is a joint's variable.
    pure subroutine lead_joint(part, k, joint, variable)
        type(step_part), intent(inout) :: part
        integer, intent(in) :: k, joint, variable

        associate (c => part%model%scene%coordinate(k))
            c%kind = coordinate_joint
            c%joint = joint
            c%variable = variable
        end associate
    end subroutine lead_joint

    !> Variables that joints of the group lead themselves, by gears: what else is in them is a coordinate of the part.
    subroutine lead_by_own(model, part, group)
        type(model_type), intent(in) :: model
        type(step_part), intent(inout) :: part
        type(group_type), intent(inout) :: group
        type(led_type) :: own
        integer, allocatable :: inside(:)
        integer :: k, s

        do k = 1, size(part%given)
            if (part%given(k) <= model%n_q) cycle
            associate (led => model%led(part%given(k) - model%n_q))
                inside = pack([(s, s=1, size(led%source))], leads_within(led, part%joint))
                if (size(inside) == 0) cycle
                own%joint = findloc(part%joint, led%joint, dim=1)
                own%variable = led%variable
                own%offset = 0
                own%weight = [(merge(1.0_wp, 0.0_wp, s == k), s=1, size(part%given))]
                own%source = [(findloc(part%joint, led%source(inside(s)), dim=1), s=1, size(inside))]
                own%source_weight = led%source_weight(inside)
                part%model%led = [part%model%led, own]
                where (group%coordinate == k) group%coordinate = size(part%given) + size(part%model%led)
                ! a led variable is no coordinate
                part%model%scene%coordinate(k)%kind = coordinate_pose
                part%model%scene%coordinate(k)%joint = 0
            end associate
        end do
    end subroutine lead_by_own

    !> Each once, in the order in which they come first.
    pure function distinct(list) result(short)
        integer, intent(in) :: list(:)
        integer, allocatable :: short(:)
        integer :: i

        allocate (short(0))
        do i = 1, size(list)
            if (all(short /= list(i))) short = [short, list(i)]
        end do
    end function distinct

    ! ---------------------------------------------------------------- numbers and key

    !> Numbers, and which of them vary: what is zero, and axes along others, fold; they belong to what the part is.
    subroutine end_part(part)
        type(step_part), intent(inout) :: part
        type(number_places) :: at
        integer :: i, side, k, last

        call place_numbers(part%model, at)
        allocate (part%number(at%n), part%varies(at%n))
        call collect_numbers(part%model, at, part%number)
        part%varies = .false.
        part%key = listed([merge(2, 3, part%model%is_planar), part%n_own, part%model%link%orientation])
        do i = 1, part%model%n_joint
            associate (joint => part%model%joint(i))
                part%key = part%key//" joint"//listed([joint%kind, joint%told_kind, joint%link])
                do side = 1, 2
                    k = at%marker(side, i)
                    last = k + of_marker - 1
                    part%varies(k:last) = part%number(k:last) /= 0
                    k = k + to_frame
                    part%varies(k:last) = part%varies(k:last) .and. abs(part%number(k:last)) /= 1
                end do
                if (at%pitch(i) > 0) part%varies(at%pitch(i)) = .true.
                ! a curve is part of the kernel
                if (joint%kind == joint_cam) part%key = part%key//" cam"//curve_text(part%model%scene%joint(i)%cam)
            end associate
        end do
        do i = 1, size(part%model%step)
            k = at%stance(i)
            last = k + of_stance - 1
            if (k > 0) part%varies(k:last) = part%number(k:last) /= 0 .and. abs(part%number(k:last)) /= 1
        end do
        do i = 1, part%model%n_q
            associate (c => part%model%scene%coordinate(i))
                part%key = part%key//" q"//listed([c%kind, c%joint, c%variable])
            end associate
        end do
        do i = 1, size(part%model%group)
            part%key = part%key//" group"//listed([part%model%group(i)%coordinate])
        end do
        do i = 1, size(part%model%led)
            associate (led => part%model%led(i))
                k = at%led(i) + part%model%n_q
                part%varies(k + 1:k + size(led%source)) = .true.
                part%key = part%key//" led"//listed([led%joint, led%variable, led%source])
                ! where turns count they count from the starts
                part%key = part%key//bits_of(part%model%scene%joint(led%source)%start(1))
            end associate
        end do
        part%key = part%key//letters_of(part%number, part%varies)
    end subroutine end_part

    !> What each number is for a key: one that varies, zero, or of which sign.
    pure function letters_of(number, varies) result(letters)
        real(wp), intent(in) :: number(:)
        logical, intent(in) :: varies(:)
        character(len=size(number)) :: letters
        integer :: k

        letters = repeat("0", size(number))
        do k = 1, size(number)
            if (number(k) > 0) letters(k:k) = "+"
            if (number(k) < 0) letters(k:k) = "-"
            if (varies(k)) letters(k:k) = "x"
        end do
    end function letters_of

    !> Numbers as they are.
    pure function bits_of(numbers) result(bits)
        real(wp), intent(in) :: numbers(:)
        character(len=size(numbers)*storage_size(numbers)/8) :: bits

        bits = transfer(numbers, bits)
    end function bits_of

    !> A cam's curve and its follower.
    pure function curve_text(cam) result(text)
        type(cam_spec), intent(in) :: cam
        character(len=:), allocatable :: text

        text = listed([cam%follower, cam%side, merge(1, 0, [cam%is_path, cam%curve%is_polar, cam%is_barrel])]) &
               //bits_of([cam%radius, cam%ground, cam%curve%u, [cam%curve%knot], [cam%curve%value], [cam%curve%second]])
    end function curve_text
end module linkdyn_step_part
