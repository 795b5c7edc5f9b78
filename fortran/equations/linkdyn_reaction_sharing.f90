!> Reactions that the equations leave open, on values: how the joints of an over-constrained mechanism share them.
!>
!> The released mechanism is solved: x0. The joints as the scene has them make equations of the same links, of which whatever
!> balances without a load is a state of self-stress, a column of N. Of all x0 + N z those with the least x C x are taken, as
!> `linkdyn_shared_reactions` does from numbers; there is also what C is.
!> That the joints fit which were let go `linkdyn_fit_watch` sees to.
module linkdyn_reaction_sharing
    use linkdyn_acting, only: acting_type, turned
    use linkdyn_force_system, only: force_unknowns, add_reactions, balance_links, reaction_of
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_joint_kinds, only: make_joint_kind
    use linkdyn_joint_table, only: along_z, along_normal, is_geared, joint_loose, joint_prismatic
    use linkdyn_kinds, only: wp
    use linkdyn_layout, only: sparse_layout
    use linkdyn_least_squares, only: find_least
    use linkdyn_linear_form, only: linear_form, find_linear_form
    use linkdyn_mechanism, only: mechanism_type, begin_mechanism, has_slide, marker_frame, marker_point, pair_of, point_of_action
    use linkdyn_model, only: model_type, arm_type, is_released, scene_size
    use linkdyn_null_states, only: null_states, find_null_states
    use linkdyn_numbers, only: to_frame, to_told_frame
    use linkdyn_record, only: record_type, open_record_of_thread
    use linkdyn_scene, only: share_by_stiffness
    use linkdyn_system, only: system_type, solved
    use linkdyn_value, only: value, zero, is_zero, number_of, operator(+), operator(-), operator(*), operator(/)
    use linkdyn_vector, only: vector, rotation, zero_vector, components, operator(+), operator(-), operator(.dot.), &
        operator(.cross.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: share_reactions

    integer, parameter :: of_force = 1, of_moment = 2
    integer, parameter :: across = 1, along = 2        !! the axis of the joint's marker

    !> An unknown of the joints as the scene has them.
    type :: shared_unknown
        integer :: i = 0                               !! joint, among those that share
        integer :: sort = 0                            !! force or moment
        logical :: is_thrust = .false.                 !! a force along a thread, with a moment
        type(vector) :: direction                      !! of a one of it, in the axes of the joint's reaction
    end type shared_unknown

    !> What the elastic energy, or the sum of squares, is made of.
    type :: energy_parts
        type(value), allocatable :: start(:), state(:, :)    !! (part), (part, state)
        real(wp), allocatable :: weight(:)             !! (part)
        logical, allocatable :: is_tooth(:)            !! (part)
    end type energy_parts

contains

    ! ---------------------------------------------------------------- how they share

    !> What comes to the reactions of the released mechanism, which is solved. What it takes is watched; without pivots that serve
    !> the samples the mechanism is not solved either.
    subroutine share_reactions(mechanism, unknowns, push, system, added)
        type(mechanism_type), intent(inout) :: mechanism
        type(force_unknowns), intent(in) :: unknowns
        type(acting_type), intent(in) :: push(:)       !! what else acts at joints
        type(system_type), intent(inout) :: system
        type(value), intent(out) :: added(:, :)        !! world axes (6, joint) [N, N m]
        type(model_type), target :: model
        type(mechanism_type) :: told
        type(system_type) :: balance
        type(force_unknowns) :: reactions
        type(shared_unknown), allocatable :: list(:)
        type(null_states) :: stress
        type(energy_parts) :: parts
        type(value) :: z(mechanism%model%share%n), pull(mechanism%model%share%n)
        integer :: i, u, k

        added = zero()
        if (.not. mechanism%is_solved) return
        call tell_joints(mechanism, model, told)
        call add_reactions(told, sparse_layout(model), balance, reactions)
        call balance_links(told, sparse_layout(model), [acting_type ::], balance, reactions)
        call find_directions(told, reactions, balance, list)
        call find_null_states(balance, model%share%n, is_tooth(told, list), &
                              merge(1.0_wp, scene_size(model), list%sort == of_force), fits(mechanism), stress)
        mechanism%is_solved = stress%is_found
        if (.not. mechanism%is_solved) return
        mechanism%watched = [mechanism%watched, stress%watched]
        ! what is told as determined is not touched
        do u = 1, size(list)
            if (is_stressed(model, list(u))) cycle
            stress%state(u, :) = zero()
        end do
        call find_parts(told, reactions, list, start_of(mechanism, unknowns, system, reactions, list), stress%state, parts)
        call add_arms(told, unknowns, push, system, reactions, balance, stress%state, parts)
        call add_misfits(told, reactions, balance, stress%state, pull)
        call relax(parts, pull, pack(is_tooth(told, list), stress%is_free), z, mechanism%watched)
        allocate (balance%solution(size(list)), source=zero())
        do u = 1, size(list)
            do k = 1, size(z)
                balance%solution(u) = balance%solution(u) + stress%state(u, k)*z(k)
            end do
        end do
        do i = 1, size(model%share%joint)
            associate (j => model%share%joint(i))
                added(:, j) = reaction_of(told, reactions, balance, j)
            end associate
        end do
    end subroutine share_reactions

    !> The mechanism as it stands, with the joints that share as the scene has them, and no others.
    subroutine tell_joints(mechanism, model, told)
        type(mechanism_type), intent(in) :: mechanism
        type(model_type), target, intent(out) :: model
        type(mechanism_type), intent(out) :: told
        type(value) :: number(size(mechanism%number))
        type(marker_pair) :: pair
        integer :: j, side

        model = mechanism%model
        number = mechanism%number
        do j = 1, model%n_joint
            if (.not. is_released(model%joint(j)) .or. is_geared(model%joint(j)%told_kind)) cycle
            do side = 1, 2
                associate (at => mechanism%at%marker(side, j))
                    number(at + to_frame:at + to_frame + 8) = number(at + to_told_frame:at + to_told_frame + 8)
                end associate
            end do
        end do
        call begin_mechanism(model, number, mechanism%q(:model%n_q), mechanism%qd(:model%n_q), mechanism%qdd(:model%n_q), told)
        told%bodies = mechanism%bodies
        told%own = mechanism%own
        told%slide = mechanism%slide
        told%universal_axis = mechanism%universal_axis
        told%payload = mechanism%payload
        model%n_actuator = 0
        model%joint%cam = 0
        do j = 1, model%n_joint
            associate (joint => model%joint(j))
                if (.not. any(model%share%joint == j)) then
                    joint%kind = joint_loose
                else if (is_released(joint)) then
                    joint%kind = joint%told_kind
                else
                    cycle
                end if
                call make_joint_kind(joint%kind, told%kind(j))
                if (told%kind(j)%is%is_threaded) told%kind(j)%is%pitch = mechanism%told_kind(j)%is%pitch
                if (.not. told%kind(j)%is%slides) then
                    told%slide(j) = vector(value(), value(), value())
                else if (.not. has_slide(told, j)) then
                    ! let go to what has none, as a screw to its thread
                    pair = pair_of(told, j)
                    told%slide(j) = pair%first.unrotate.pair%gap
                end if
            end associate
        end do
    end subroutine tell_joints

    !> At which samples do all joints fit?
    function fits(mechanism) result(do_fit)
        type(mechanism_type), intent(in) :: mechanism
        logical, allocatable :: do_fit(:)              !! (sample)
        type(record_type), pointer :: record
        integer :: k

        record => open_record_of_thread()
        allocate (do_fit(record%n_sample), source=.true.)
        do k = 1, size(mechanism%watched)
            do_fit = do_fit .and. abs(number_of(mechanism%watched(k))) <= 1
        end do
        do k = 1, size(mechanism%positive)
            do_fit = do_fit .and. number_of(mechanism%positive(k)) > 0
        end do
    end function fits

    !> What joint an unknown is of, and how it acts there.
    subroutine find_directions(told, reactions, balance, list)
        type(mechanism_type), intent(in) :: told
        type(force_unknowns), intent(in) :: reactions
        type(system_type), intent(inout) :: balance
        type(shared_unknown), allocatable, intent(out) :: list(:)
        type(linear_form) :: form
        type(value) :: part(3)
        integer :: i, sort, axis, k, first

        first = 0
        allocate (list(balance%n_unknown))
        do i = 1, size(list)
            list(i)%direction = zero_vector()
        end do
        do i = 1, size(told%model%share%joint)
            associate (acting => reactions%reaction(told%model%share%joint(i)))
                do sort = of_force, of_moment
                    part = components(acting%force)
                    if (sort == of_moment) part = components(acting%moment)
                    do axis = 1, 3
                        call find_linear_form(balance%forms, part(axis), form)
                        do k = 1, size(form%unknown)
                            call set(place_of(balance, form%unknown(k)), sort, axis, form%coefficient(k))
                        end do
                    end do
                end do
            end associate
        end do

    contains

        !> A moment that comes with a force is no unknown of its own.
        subroutine set(u, sort, axis, coefficient)
            integer, intent(in) :: u, sort, axis
            type(value), intent(in) :: coefficient

            list(u)%is_thrust = list(u)%sort == of_force .and. sort == of_moment
            if (list(u)%is_thrust) return
            list(u)%i = i
            list(u)%sort = sort
            if (axis == 1) list(u)%direction%x = coefficient
            if (axis == 2) list(u)%direction%y = coefficient
            if (axis == 3) list(u)%direction%z = coefficient
        end subroutine set
    end subroutine find_directions

    pure function is_tooth(told, list) result(is)
        type(mechanism_type), intent(in) :: told
        type(shared_unknown), intent(in) :: list(:)
        logical :: is(size(list))

        is = is_geared(told%model%joint(told%model%share%joint(list%i))%kind)
        if (told%model%scene%redundancy == share_by_stiffness) is = .false.
    end function is_tooth

    !> Is the force, or the moment, of its joint open?
    pure logical function is_stressed(model, unknown)
        type(model_type), intent(in) :: model
        type(shared_unknown), intent(in) :: unknown

        is_stressed = merge(model%share%of_force(unknown%i), model%share%of_moment(unknown%i), unknown%sort == of_force) &
                      .or. is_geared(model%joint(model%share%joint(unknown%i))%told_kind)
    end function is_stressed

    !> The unknowns, as the released mechanism has them.
    function start_of(mechanism, unknowns, system, reactions, list) result(start)
        type(mechanism_type), intent(in) :: mechanism
        type(force_unknowns), intent(in) :: unknowns, reactions
        type(system_type), intent(inout) :: system
        type(shared_unknown), intent(in) :: list(:)
        type(value) :: start(size(list))
        type(vector) :: v
        integer :: u

        do u = 1, size(list)
            associate (j => mechanism%model%share%joint(list(u)%i), along => list(u)%direction)
                associate (from => unknowns%reaction(j))
                    if (list(u)%sort == of_force) then
                        v = turned(mechanism%bodies, from%force, from%turning, reactions%reaction(j)%turning)
                    else
                        v = turned(mechanism%bodies, from%moment, from%turning, reactions%reaction(j)%turning)
                    end if
                end associate
                start(u) = solved(system, v.dot.along)
                ! all others are as long as one
                if (is_geared(mechanism%model%joint(j)%told_kind) .or. mechanism%told_kind(j)%is%moments == along_normal) then
                    if (.not. is_zero(start(u))) start(u) = start(u)/(along.dot.along)
                end if
            end associate
        end do
    end function start_of

    !> What each unknown adds to the sum that is to be the least; where the energy differs along the axis and across it, each of
    !> these directions.
    subroutine find_parts(told, reactions, list, start, state, parts)
        type(mechanism_type), intent(in) :: told
        type(force_unknowns), intent(in) :: reactions
        type(shared_unknown), intent(in) :: list(:)
        type(value), intent(in) :: start(:)            !! (unknown)
        type(value), intent(in) :: state(:, :)         !! (unknown, state)
        type(energy_parts), intent(out) :: parts
        type(vector) :: axis(3)
        integer :: i, sort, k, u

        allocate (parts%start(0), parts%state(0, size(state, 2)), parts%weight(0), parts%is_tooth(0))
        do i = 1, size(told%model%share%joint)
            associate (j => told%model%share%joint(i))
                do sort = of_force, of_moment
                    if (count(list%i == i .and. list%sort == sort) == 3 .and. differs(told%model, j, sort)) then
                        axis = axes_of(told, j, reactions%reaction(j)%turning)
                        do k = 1, 3
                            call add([((axis(k) .dot.list(u)%direction), u=1, size(list))], i, sort, merge(along, across, k == 3))
                        end do
                    else
                        do u = 1, size(list)
                            if (list(u)%i == i .and. list(u)%sort == sort) &
                                call add_one(u, weight_of(told%model, j, sort, direction_of(told, j, sort, list(u))))
                        end do
                    end if
                end do
            end associate
        end do

    contains

        !> A direction, and what of it each unknown is.
        subroutine add(component, i, sort, direction)
            type(value), intent(in) :: component(:)
            integer, intent(in) :: i, sort, direction
            type(value) :: first, row(size(state, 2))
            integer :: u, k

            first = zero()
            row = zero()
            do u = 1, size(list)
                if (list(u)%i /= i .or. list(u)%sort /= sort) cycle
                first = first + component(u)*start(u)
                do k = 1, size(row)
                    row(k) = row(k) + component(u)*state(u, k)
                end do
            end do
            call append_part(parts, first, row, weight_of(told%model, told%model%share%joint(i), sort, direction), .false.)
        end subroutine add

        subroutine add_one(u, weight)
            integer, intent(in) :: u
            real(wp), intent(in) :: weight

            call append_part(parts, start(u), state(u, :), weight, &
                             is_geared(told%model%joint(told%model%share%joint(list(u)%i))%kind))
        end subroutine add_one

    end subroutine find_parts

    subroutine append_part(parts, first, row, weight, is_tooth)
        type(energy_parts), intent(inout) :: parts
        type(value), intent(in) :: first, row(:)
        real(wp), intent(in) :: weight
        logical, intent(in) :: is_tooth
        type(value), allocatable :: longer(:, :)
        integer :: n

        n = size(parts%start)
        allocate (longer(n + 1, size(row)))
        longer(:n, :) = parts%state
        longer(n + 1, :) = row
        call move_alloc(longer, parts%state)
        parts%start = [parts%start, first]
        parts%weight = [parts%weight, weight]
        parts%is_tooth = [parts%is_tooth, is_tooth]
    end subroutine append_part

    !> What the energy of links is made of: arms are bent by all that a joint does.
    subroutine add_arms(told, unknowns, push, system, reactions, balance, state, parts)
        type(mechanism_type), intent(in) :: told
        type(force_unknowns), intent(in) :: unknowns   !! of the released mechanism
        type(acting_type), intent(in) :: push(:)
        type(system_type), intent(inout) :: system, balance
        type(force_unknowns), intent(in) :: reactions  !! of the joints as the scene has them
        type(value), intent(in) :: state(:, :)         !! (unknown, state)
        type(energy_parts), intent(inout) :: parts
        type(linear_form) :: form
        type(value) :: first, row(size(state, 2))
        integer :: a, k, p, u

        do a = 1, size(told%model%arm)
            associate (arm => told%model%arm(a))
                if (.not. any(told%model%share%joint == arm%joint)) cycle
                do k = 1, arm%n
                    first = bent_by(told, arm, k, unknowns%reaction(arm%joint))
                    do p = 1, size(push)
                        if (push(p)%joint == arm%joint) first = first + bent_by(told, arm, k, push(p))
                    end do
                    call find_linear_form(balance%forms, bent_by(told, arm, k, reactions%reaction(arm%joint)), form)
                    row = zero()
                    do u = 1, size(form%unknown)
                        row = row + form%coefficient(u)*state(place_of(balance, form%unknown(u)), :)
                    end do
                    call append_part(parts, solved(system, first), row, arm%weight(k), .false.)
                end do
            end associate
        end do
    end subroutine add_arms

    !> What states of self-stress do along the misfits of joints.
    subroutine add_misfits(told, reactions, balance, state, pull)
        type(mechanism_type), intent(in) :: told
        type(force_unknowns), intent(in) :: reactions  !! of the joints as the scene has them
        type(system_type), intent(inout) :: balance
        type(value), intent(in) :: state(:, :)         !! (unknown, state)
        type(value), intent(out) :: pull(:)            !! (state)
        type(linear_form) :: form
        type(value) :: work, whole(6)
        integer :: i, k, u

        pull = zero()
        do i = 1, size(told%model%share%joint)
            associate (j => told%model%share%joint(i))
                associate (acting => reactions%reaction(j), bodies => told%bodies, misfit => told%model%scene%joint(j)%misfit, &
                           l => told%model%joint(j)%link(1))
                    if (.not. any(abs(misfit) > 0)) cycle
                    associate (axes => told%own(l)%r, turning => bodies%body(l)%turning)
                        whole = [components(axes.unrotate.turned(bodies, acting%force, acting%turning, turning)), &
                                 components(axes.unrotate.turned(bodies, acting%moment, acting%turning, turning))]
                    end associate
                    work = zero()
                    do k = 1, 6
                        work = work + misfit(k)*whole(k)
                    end do
                end associate
            end associate
            call find_linear_form(balance%forms, work, form)
            do u = 1, size(form%unknown)
                pull = pull + form%coefficient(u)*state(place_of(balance, form%unknown(u)), :)
            end do
        end do
    end subroutine add_misfits

    !> A part of the energy of an arm: what of it that is, which acts at its joint.
    function bent_by(mechanism, arm, k, acting) result(part)
        type(mechanism_type), intent(in) :: mechanism
        type(arm_type), intent(in) :: arm
        integer, intent(in) :: k
        type(acting_type), intent(in) :: acting
        type(value) :: part, whole(6)
        type(vector) :: force, moment
        integer :: l, i

        l = mechanism%model%joint(arm%joint)%link(arm%side)
        associate (bodies => mechanism%bodies, axes => mechanism%own(l)%r)
            force = turned(bodies, acting%force, acting%turning, bodies%body(l)%turning)
            moment = turned(bodies, acting%moment, acting%turning, bodies%body(l)%turning)
            if (arm%side == 1) moment = moment + ((point_of_action(mechanism, arm%joint, 1) &
                                                   - marker_point(mechanism, arm%joint, 1)) .cross.force)
            whole = [components(axes.unrotate.force), components(axes.unrotate.moment)]
        end associate
        part = zero()
        do i = 1, 6
            part = part + arm%row(i, k)*whole(i)
        end do
    end function bent_by

    !> Unknowns are made one after the other, but those of other systems between.
    pure integer function place_of(system, number)
        type(system_type), intent(in) :: system
        integer, intent(in) :: number

        place_of = findloc(system%number(:system%n_unknown), number, dim=1)
    end function place_of

    !> The axes of a joint's first marker, in those of a turning.
    function axes_of(told, j, turning) result(axis)
        type(mechanism_type), intent(in) :: told
        integer, intent(in) :: j, turning
        type(vector) :: axis(3)
        type(rotation) :: frame
        integer :: k

        frame = marker_frame(told, j, 1)
        axis = [frame%x, frame%y, frame%z]
        do k = 1, 3
            axis(k) = turned(told%bodies, axis(k), told%bodies%body(told%model%joint(j)%link(1))%turning, turning)
        end do
    end function axes_of

    !> Along the axis of the joint's first marker, or across it, where all three directions are not one.
    pure integer function direction_of(told, j, sort, unknown) result(direction)
        type(mechanism_type), intent(in) :: told
        integer, intent(in) :: j, sort
        type(shared_unknown), intent(in) :: unknown

        direction = across
        associate (kind => told%kind(j)%is, joint => told%model%joint(j))
            if (is_geared(joint%kind)) return
            if (sort == of_force) then
                if (kind%forces == along_z) direction = along
                if (kind%is_threaded .and. unknown%is_thrust) direction = along
            else if (told%model%is_planar .and. joint%kind /= joint_prismatic) then
                direction = along                      ! about the plane's normal
            end if
        end associate
    end function direction_of

    !> Is the joint softer along its axis than across?
    pure logical function differs(model, j, sort)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, sort

        differs = abs(weight_of(model, j, sort, along) - weight_of(model, j, sort, across)) > 0
    end function differs

    !> What a unit of a reaction gives way, up to a common factor.
    pure real(wp) function weight_of(model, j, sort, direction) result(weight)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, sort, direction

        integer :: s

        s = merge(of_force, sort, is_geared(model%joint(j)%kind))    ! teeth, even if they act by moments alone
        if (model%scene%redundancy == share_by_stiffness) then
            associate (stiffness => model%scene%joint(j)%stiffness(2*(s - of_force) + direction))
                weight = 0
                if (stiffness > 0) weight = 1/stiffness
            end associate
        else
            weight = 1
            if (s == of_moment) weight = 1/scene_size(model)**2
        end if
    end function weight_of

    !> How much of each state is taken. Teeth are the first to share by the sum of squares; what does not load them comes after.
    subroutine relax(parts, pull, of_teeth, z, watched)
        type(energy_parts), intent(in) :: parts
        type(value), intent(in) :: pull(:)             !! of misfits (state)
        logical, intent(in) :: of_teeth(:)             !! (state) its free unknown is the force of a tooth
        type(value), intent(out) :: z(:)               !! (state)
        type(value), allocatable, intent(inout) :: watched(:)
        type(value) :: start(size(parts%start)), of_first(count(of_teeth)), of_rest(count(.not. of_teeth))
        integer, allocatable :: first(:), rest(:), tooth(:), other(:)
        integer :: i, k

        first = pack([(k, k=1, size(z))], of_teeth)
        rest = pack([(k, k=1, size(z))], .not. of_teeth)
        tooth = pack([(i, i=1, size(start))], parts%is_tooth)
        other = [(i, i=1, size(start))]
        start = parts%start
        if (size(first) > 0) then
            call find_least(parts%state(tooth, first), parts%weight(tooth), start(tooth), of_first, watched)
            z(first) = of_first
            do k = 1, size(first)
                start = start + parts%state(:, first(k))*of_first(k)
            end do
            other = pack(other, .not. parts%is_tooth)
        end if
        call find_least(parts%state(other, rest), parts%weight(other), start(other), of_rest, watched, pull(rest))
        z(rest) = of_rest
    end subroutine relax
end module linkdyn_reaction_sharing
