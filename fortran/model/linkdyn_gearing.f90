!> Gears, racks and belts: what their geometry makes of the joint variables, and which variables the coordinates then give.
!>
!> Two wheels turn (or a rack slides) in one link, their carrier. Seen from it both axes stand still, so the wheels' speeds are
!> in a fixed proportion, and a sum of joint variables with constant weights stays what it is:
!>
!>     c1 S1 + c2 S2 = c2 phase          S: variable of a wheel against the carrier, the sum of the joints' on the way
!>
!> The force between the wheels has directions and moments that are fixed in the carrier; c1 and c2 are its power for unit rates, so
!> it never does work. A *rack* is a wheel whose variable is a slide; a *worm* a wheel whose teeth go round it. All this is found
!> from joints and markers alone, at no particular pose. Where the sums determine joint variables from coordinates, these are given
!> like coordinates (`led_type`), and trains, planetary ones too, stay open chains.
module linkdyn_gearing
    use linkdyn_cross, only: cross
    use linkdyn_joint_table, only: joint_revolute, joint_prismatic, joint_fixed, joint_rack, joint_belt, is_geared, &
        joint_kind_name, joint_n_variable, is_pose_part
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, gear_type, driven_type, belt_type, led_type, loose_type, scene_size
    use linkdyn_scene, only: coordinate_joint
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text, quoted
    implicit none (type, external)
    private
    public :: is_on_axis, lay_gears, plan_gears, refuse_uncounted_belts, list_driven_apart, find_redundant_gears, lead_by_loose, &
        forget_loose, led_name

    real(wp), parameter :: alignment = 1.0e-9_wp   !! how far two axes that are one may be apart, by the mechanism's size
    real(wp), parameter :: negligible = 1.0e-12_wp !! part of a sum's largest weight that is rounding
    real(wp), parameter :: fitting = 1.0e-6_wp     !! how far from the teeth's the markers' ratio may be

    !> Links in which a wheel turns, or a rack slides, and nothing else: the ways to them.
    type :: axis_ways
        logical, allocatable :: is_reached(:)      !! (0:n_link)
        integer, allocatable :: joint(:)           !! the last joint of the way from the wheel (0:n_link)
        integer, allocatable :: before(:)          !! the link before that (0:n_link)
        real(wp), allocatable :: sense(:)          !! what a unit of that joint's variable adds (0:n_link)
        real(wp), allocatable :: point(:, :)       !! the wheel's marker, in that link's axes (3, 0:n_link)
        real(wp), allocatable :: axis(:, :)        !! and its axis (3, 0:n_link)
    end type axis_ways

    !> A wheel or rack seen from the carrier.
    type :: wheel_type
        real(wp) :: point(3) = 0, axis(3) = 0
    end type wheel_type

contains

    !> Fill `model%gear`: geometry, from the joints as the scene has them.
    subroutine lay_gears(model, status)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        integer :: j, n

        allocate (model%gear(count(is_geared(model%joint%kind))))
        n = 0
        do j = 1, model%n_joint
            if (.not. (status%is_ok() .and. is_geared(model%joint(j)%kind))) cycle
            n = n + 1
            model%joint(j)%gear = n
            call plan_gear(model, j, model%gear(n), status)
        end do
        call lay_belts(model, status)
    end subroutine lay_gears

    !> Fill `model%belt`: those that stretch hold nothing, and pull as springs do.
    subroutine lay_belts(model, status)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        integer :: j, k, n

        allocate (model%belt(count(model%joint(:model%n_joint)%belt > 0)))
        do j = 1, model%n_joint
            n = model%joint(j)%belt
            if (n == 0 .or. .not. status%is_ok()) cycle
            associate (belt => model%belt(n))
                belt%strand = model%scene%joint(j)%strand
                call plan_gear(model, j, belt%gear, status, belt)
                if (.not. status%is_ok()) cycle
                belt%joint = pack([(k, k=1, model%n_joint)], [(turns_wheel(k), k=1, model%n_joint)])
                belt%weight = belt%gear%weight(model%joint(belt%joint)%first_variable + 1)
            end associate
        end do

    contains

        pure logical function turns_wheel(k)
            integer, intent(in) :: k

            turns_wheel = joint_n_variable(model%joint(k)%kind) > 0
            if (turns_wheel) turns_wheel = model%belt(n)%gear%weight(model%joint(k)%first_variable + 1) /= 0
        end function turns_wheel
    end subroutine lay_belts

    !> How far a belt is stretched is known only of wheels whose turns are counted.
    subroutine refuse_uncounted_belts(model, status)
        type(model_type), intent(in) :: model
        type(status_type), intent(inout) :: status
        integer :: i, k, j

        do i = 1, size(model%belt)
            do k = 1, size(model%belt(i)%joint)
                j = model%belt(i)%joint(k)
                if (any(model%scene%coordinate%kind == coordinate_joint .and. model%scene%coordinate%joint == j)) cycle
                if (any(model%led%joint == j)) cycle
                if (status%is_ok()) call fail(status, status_bad_input, "belt " &
                    //quoted(model%joint(model%belt(i)%gear%joint)%name)//" stretches, and the turns of joint " &
                    //quoted(model%joint(j)%name)//" are not counted (expected a coordinate there, or gears between it and one)")
            end do
        end do
    end subroutine refuse_uncounted_belts

    !> What drives wheels apart is known once their force is: it is added to what bearings carry, and to what presses there.
    subroutine list_driven_apart(model, status)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        integer :: g, i, k, n, turn

        if (allocated(model%driven)) deallocate (model%driven)
        do turn = 1, 2
            n = 0
            do g = 1, size(model%gear)
                do i = 1, size(model%gear(g)%carries)
                    do k = 1, size(model%contact)
                        if (abs(model%gear(g)%carries(i)) /= model%contact(k)%joint) cycle
                        n = n + 1
                        if (turn == 2) model%driven(n) = driven_type(k, g, real(sign(1, model%gear(g)%carries(i)), wp))
                    end do
                end do
            end do
            if (turn == 1) allocate (model%driven(n))
        end do
        if (model%share%n > 0) call refuse_sharing_apart(model, status)
    end subroutine list_driven_apart

    !> Who of several bearings takes what drives wheels apart is not found.
    subroutine refuse_sharing_apart(model, status)
        type(model_type), intent(in) :: model
        type(status_type), intent(inout) :: status
        integer :: g

        do g = 1, size(model%gear)
            associate (gear => model%gear(g))
                if (size(gear%carries) == 0 .or. .not. status%is_ok()) cycle
                call fail(status, status_bad_input, what(model, gear%joint)//" "// &
                    quoted(model%joint(gear%joint)%name)//": pressure_angle where reactions are shared: "// &
                    "who of several bearings takes the force that drives the wheels apart is not found (expected joints that "// &
                    "hold each direction once, or no pressure_angle)")
            end associate
        end do
    end subroutine refuse_sharing_apart

    !> Fill `model%led` and `model%loose`: what gears make of the coordinates.
    subroutine plan_gears(model, status)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status

        allocate (model%led(0), model%loose(0))
        if (status%is_ok() .and. size(model%gear) > 0) call lead_by_gears(model, status)
    end subroutine plan_gears

    !> Gears whose sums follow from those of gears before them, as a second planet's do.
    !>
    !> **Errors**: `status_bad_input` if phases contradict each other.
    subroutine find_redundant_gears(model, is_redundant, status)
        type(model_type), intent(in) :: model
        logical, allocatable, intent(out) :: is_redundant(:)    !! (gear)
        type(status_type), intent(inout) :: status
        real(wp) :: row(0:model%n_variable, size(model%gear))
        integer :: pivot(size(model%gear)), k, g, n

        allocate (is_redundant(size(model%gear)), source=.false.)
        n = 0
        do g = 1, size(model%gear)
            n = n + 1
            row(:, n) = [model%gear(g)%total, model%gear(g)%weight]/maxval(abs(model%gear(g)%weight))
            do k = 1, n - 1
                row(:, n) = row(:, n) - row(pivot(k), n)*row(:, k)
                row(pivot(k), n) = 0
            end do
            is_redundant(g) = all(abs(row(1:, n)) <= negligible)
            if (is_redundant(g)) then
                if (abs(row(0, n)) > fitting .and. status%is_ok()) call fail(status, status_bad_input, &
                    what(model, model%gear(g)%joint)//" "//quoted(model%joint(model%gear(g)%joint)%name) &
                    //": its phase does not fit those of the other gears between its wheels (expected phase = " &
                    //to_text(model%scene%joint(model%gear(g)%joint)%phase - row(0, n)/unit_of_phase(g)) &
                    //trim(merge(" rad", " m  ", model%joint(model%gear(g)%joint)%told_kind /= joint_rack))//")")
                n = n - 1
                cycle
            end if
            pivot(n) = maxloc(abs(row(1:, n)), dim=1)
            row(:, n) = row(:, n)/row(pivot(n), n)
        end do

    contains

        !> What a unit of its phase adds to the sum.
        pure real(wp) function unit_of_phase(g) result(unit)
            integer, intent(in) :: g

            associate (gear => model%gear(g))
                unit = gear%second/maxval(abs(gear%weight))
            end associate
        end function unit_of_phase
    end subroutine find_redundant_gears

    ! ---------------------------------------------------------------- geometry

    !> One of them.
    subroutine plan_gear(model, j, gear, status, belt)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        type(gear_type), intent(inout) :: gear
        type(status_type), intent(inout) :: status
        type(belt_type), intent(inout), optional :: belt       !! whose strands stretch
        type(axis_ways) :: ways(2)
        type(wheel_type) :: wheel(2)
        real(wp) :: power(2)
        integer :: side

        associate (joint => model%joint(j))
            gear%joint = j
            call find_ways(model, j, 1, joint_revolute, ways(1))
            call find_ways(model, j, 2, merge(joint_prismatic, joint_revolute, joint%kind == joint_rack), ways(2))
            gear%carrier = common_link(ways, joint%link)
            if (gear%carrier < 0) then
                call fail(status, status_bad_input, what(model, j)//" "//quoted(joint%name)//": there is no link in which " &
                          //motion_of(1)//" and "//motion_of(2)//" (expected revolute joints on the axes of the wheels' markers" &
                          //trim(merge(", prismatic ones along the rack's", "                                 ", &
                                       joint%kind == joint_rack))//", in one carrier)")
                return
            end if
            do side = 1, 2
                wheel(side)%point = ways(side)%point(:, gear%carrier)
                wheel(side)%axis = ways(side)%axis(:, gear%carrier)
            end do
            select case (joint%told_kind)
            case (joint_rack)
                call lay_rack(model, wheel, gear, status)
            case (joint_belt)
                call lay_belt(model, wheel, gear, status)
            case default
                call lay_teeth(model, wheel, gear, status)
            end select
            if (.not. status%is_ok()) return
            if (present(belt)) call lay_strands(wheel, belt)
            call lean_teeth(model, wheel, gear, status)
            allocate (gear%carries(0))
            if (any(gear%push /= 0)) gear%carries = [held_by(model, ways(1), gear%carrier, 1), &
                                                     held_by(model, ways(2), gear%carrier, -1)]
            power(1) = -dot_product(gear%couple(:, 1), wheel(1)%axis)
            power(2) = dot_product(gear%couple(:, 2), wheel(2)%axis)
            if (joint%kind == joint_rack) power(2) = dot_product(gear%direction, wheel(2)%axis)
            allocate (gear%weight(model%n_variable), gear%pace(model%n_variable, 2), source=0.0_wp)
            do side = 1, 2
                call add_way(model, ways(side), gear%carrier, power(side), gear%weight)
                call add_way(model, ways(side), gear%carrier, (2*side - 3)*power(side), gear%pace(:, side))
                gear%marker(:, side) = wheel(side)%point
                if (side == 1 .or. joint%kind /= joint_rack) gear%spin(:, side) = (2*side - 3)*wheel(side)%axis/power(side)
            end do
            if (joint%told_kind /= joint_belt .and. .not. is_worm(model, j)) gear%curvature = curvatures(gear%spin)
            gear%second = power(2)
            gear%total = power(2)*model%scene%joint(j)%phase
        end associate

    contains

        function motion_of(side) result(text)
            integer, intent(in) :: side
            character(len=:), allocatable :: text

            associate (link => model%joint(j)%link(side))
                text = "the frame"
                if (link > 0) text = quoted(model%link(link)%name)
                if (side == 2 .and. model%joint(j)%kind == joint_rack) then
                    text = text//" slides"
                else
                    text = text//" turns"
                end if
            end associate
        end function motion_of
    end subroutine plan_gear

    !> Curvatures of wheels whose pitch circles go round with unit speed: the part that each has in the angular velocity of the one
    !> against the other.
    pure function curvatures(spin) result(c)
        real(wp), intent(in) :: spin(3, 2)         !! their angular velocities [1/m]
        real(wp) :: c(2)
        real(wp) :: along(3)

        along = spin(:, 2) - spin(:, 1)
        along = along/norm2(along)
        c = [-dot_product(along, spin(:, 1)), dot_product(along, spin(:, 2))]
    end function curvatures

    pure logical function is_worm(model, j)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j

        is_worm = model%scene%joint(j)%lead_angle /= 0
    end function is_worm

    !> "gear", "rack", "belt".
    function what(model, j) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        character(len=:), allocatable :: text

        text = trim(joint_kind_name(model%joint(j)%told_kind))
    end function what

    !> From the link of one of the joint's markers through joints on its axis (or slides along it), and welds. Of several bearings
    !> of a shaft, or rails of a carriage, one that is a coordinate is taken: its turns are given.
    subroutine find_ways(model, j, side, passes, ways)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, side
        integer, intent(in) :: passes              !! kind of joint through which the axis stands still
        type(axis_ways), intent(out) :: ways
        logical :: leads(model%n_joint)
        integer :: k, from, x, y

        allocate (ways%is_reached(0:model%n_link), ways%joint(0:model%n_link), ways%before(0:model%n_link), &
                  ways%sense(0:model%n_link), ways%point(3, 0:model%n_link), ways%axis(3, 0:model%n_link))
        ways%is_reached = .false.
        ways%joint = 0
        x = model%joint(j)%link(side)
        ways%is_reached(x) = .true.
        ways%point(:, x) = model%joint(j)%point(:, side)
        ways%axis(:, x) = model%joint(j)%frame(:, 3, side)
        leads = [(any(model%scene%coordinate%kind == coordinate_joint .and. model%scene%coordinate%joint == k), &
                  k=1, model%n_joint)]
        do
            k = findloc([(goes_on(k) .and. leads(k), k=1, model%n_joint)], .true., dim=1)
            if (k == 0) k = findloc([(goes_on(k), k=1, model%n_joint)], .true., dim=1)
            if (k == 0) exit
            associate (joint => model%joint(k))
                from = merge(1, 2, ways%is_reached(joint%link(1)))
                x = joint%link(from)
                y = joint%link(3 - from)
                ways%is_reached(y) = .true.
                ways%joint(y) = k
                ways%before(y) = x
                ways%sense(y) = 0
                if (joint%kind /= joint_fixed) &
                    ways%sense(y) = merge(1, -1, from == 2)*sign(1.0_wp, dot_product(joint%frame(:, 3, from), ways%axis(:, x)))
                ways%axis(:, y) = through(joint%frame, ways%axis(:, x))
                ways%point(:, y) = joint%point(:, 3 - from) + through(joint%frame, ways%point(:, x) - joint%point(:, from))
            end associate
        end do

    contains

        !> Does a joint lead from a link that is reached to one that is not, and the axis stands still in it?
        pure logical function goes_on(k)
            integer, intent(in) :: k
            integer :: near

            associate (joint => model%joint(k))
                goes_on = any(joint%kind == [passes, joint_fixed])
                if (goes_on) goes_on = ways%is_reached(joint%link(1)) .neqv. ways%is_reached(joint%link(2))
                if (.not. goes_on .or. joint%kind == joint_fixed) return
                near = merge(1, 2, ways%is_reached(joint%link(1)))
                goes_on = is_on_axis(model, k, near, ways%point(:, joint%link(near)), ways%axis(:, joint%link(near)))
            end associate
        end function goes_on

        !> A direction from the one link's axes to the other's, where the joint's variable is zero.
        pure function through(frame, v) result(w)
            real(wp), intent(in) :: frame(3, 3, 2), v(3)
            real(wp) :: w(3)

            w = matmul(frame(:, :, 3 - from), matmul(transpose(frame(:, :, from)), v))
        end function through
    end subroutine find_ways

    !> Does a joint turn about the axis through a point of one of its links, or slide along its direction?
    pure logical function is_on_axis(model, k, side, point, axis)
        type(model_type), intent(in) :: model
        integer, intent(in) :: k, side
        real(wp), intent(in) :: point(3), axis(3)  !! in that link's axes

        associate (joint => model%joint(k))
            is_on_axis = norm2(cross(joint%frame(:, 3, side), axis)) <= alignment
            if (joint%kind == joint_prismatic) return
            is_on_axis = is_on_axis .and. norm2(cross(point - joint%point(:, side), axis)) <= alignment*scene_size(model)
        end associate
    end function is_on_axis

    !> The link that holds both axes; -1: none does.
    pure integer function common_link(ways, wheel)
        type(axis_ways), intent(in) :: ways(2)
        integer, intent(in) :: wheel(2)
        integer :: l

        do l = 0, ubound(ways(1)%is_reached, 1)
            common_link = l
            if (ways(1)%is_reached(l) .and. ways(2)%is_reached(l) .and. all(wheel /= l)) return
        end do
        common_link = -1
    end function common_link

    !> Weights of the joint variables on the way from the carrier to a wheel.
    subroutine add_way(model, ways, carrier, power, weight)
        type(model_type), intent(in) :: model
        type(axis_ways), intent(in) :: ways
        integer, intent(in) :: carrier
        real(wp), intent(in) :: power
        real(wp), intent(inout) :: weight(:)
        integer :: l

        l = carrier
        do while (ways%joint(l) > 0)
            associate (joint => model%joint(ways%joint(l)))
                if (joint%kind /= joint_fixed) &
                    weight(joint%first_variable + 1) = weight(joint%first_variable + 1) + power*ways%sense(l)
            end associate
            l = ways%before(l)
        end do
    end subroutine add_way

    !> Teeth: a unit force on the second wheel at the pitch point, across the plane of both axes.
    subroutine lay_teeth(model, wheel, gear, status)
        type(model_type), intent(in) :: model
        type(wheel_type), intent(in) :: wheel(2)
        type(gear_type), intent(inout) :: gear
        type(status_type), intent(inout) :: status
        real(wp) :: apart(3), pitch(3), radius(2), ratio(2), distance
        integer :: side

        associate (joint => model%joint(gear%joint), spec => model%scene%joint(gear%joint), z => wheel(1)%axis)
            apart = wheel(2)%point - wheel(1)%point
            gear%direction = cross(wheel(1)%axis, wheel(2)%axis)
            if (is_worm(model, gear%joint)) then
                call lay_worm()
                if (.not. status%is_ok()) return
            else if (norm2(gear%direction) > alignment) then
                call lay_cones()
                if (.not. status%is_ok()) return
            else
                apart = apart - dot_product(apart, z)*z
                distance = norm2(apart)
                ratio = spec%wheel*merge([1, -1], [1, 1], spec%is_turned_over .and. spec%wheel(2) >= spec%wheel(1))
                if (spec%is_turned_over .and. spec%wheel(2) < spec%wheel(1)) ratio = spec%wheel*[-1, 1]
                if (distance <= alignment*scene_size(model)) then
                    call fail(status, status_bad_input, "gear "//quoted(joint%name)//": its wheels have one axis " &
                              //"(expected axes apart)")
                    return
                else if (sum(ratio) == 0) then
                    call fail(status, status_bad_input, "gear "//quoted(joint%name)//": teeth = ["//to_text(spec%wheel(1))//", " &
                              //to_text(spec%wheel(2))//"], one wheel inside the other (expected different numbers)")
                    return
                end if
                gear%direction = cross(z, apart)/distance
                pitch = wheel(1)%point + ratio(1)/sum(ratio)*apart
            end if
            do side = 1, 2
                gear%couple(:, side) = cross(pitch - wheel(side)%point, gear%direction)
                gear%radius(side) = norm2(cross(pitch - wheel(side)%point, wheel(side)%axis))
            end do
            gear%pitch = pitch
        end associate

    contains

        !> A worm: the force on its wheel is square to the worm's thread, and of size 1 along the wheel's pitch circle. Radii follow
        !> from the distance of the axes and from how steep the thread is.
        subroutine lay_worm()
            real(wp) :: towards(3)

            associate (spec => model%scene%joint(gear%joint), z => wheel(1)%axis)
                if (abs(dot_product(z, wheel(2)%axis)) > alignment) then
                    call refuse("are not square to each other (expected right angles, or no lead_angle)")
                    return
                end if
                towards = cross(z, wheel(2)%axis)
                distance = dot_product(apart, towards)
                if (abs(distance) <= alignment*scene_size(model)) then
                    call refuse("meet (expected a distance, from which the pitch radii follow, or no lead_angle)")
                    return
                end if
                towards = sign(1.0_wp, distance)*towards
                pitch = wheel(1)%point + dot_product(apart, z)*z &
                        + abs(distance)/(1 + spec%wheel(2)/spec%wheel(1)*tan(abs(spec%lead_angle)))*towards
                gear%direction = z - tan(spec%lead_angle)*cross(z, towards)
            end associate
        end subroutine lay_worm

        subroutine refuse(why)
            character(len=*), intent(in) :: why

            call fail(status, status_bad_input, &
                      "gear "//quoted(model%joint(gear%joint)%name)//": the axes of worm and wheel "//why)
        end subroutine refuse

        !> Bevel gears: the pitch point is where the planes of both markers across the axes meet in the plane of the axes.
        subroutine lay_cones()
            real(wp) :: m(3)

            m = gear%direction/norm2(gear%direction)
            gear%direction = m
            associate (name => model%joint(gear%joint)%name, spec => model%scene%joint(gear%joint))
                if (abs(dot_product(apart, m)) > alignment*scene_size(model)) then
                    call fail(status, status_bad_input, "gear "//quoted(name)//": the axes of its wheels neither are parallel " &
                              //"nor meet (expected spur or bevel gears, or the lead_angle of a worm)")
                    return
                end if
                radius(1) = dot_product(apart, wheel(2)%axis)/dot_product(cross(m, wheel(1)%axis), wheel(2)%axis)
                pitch = wheel(1)%point + radius(1)*cross(m, wheel(1)%axis)
                radius(2) = dot_product(pitch - wheel(2)%point, cross(m, wheel(2)%axis))
                if (spec%is_turned_over) then
                    call fail(status, status_bad_input, "gear "//quoted(name)//": mesh = 'internal' has no meaning here: it is a " &
                              //"bevel gear")
                else if (abs(abs(radius(1))*spec%wheel(2) - abs(radius(2))*spec%wheel(1)) &
                         > fitting*abs(radius(1))*spec%wheel(2)) then
                    call fail(status, status_bad_input, "gear "//quoted(name)//": bevel wheels at these markers have the radii " &
                              //to_text(abs(radius(1)))//" and "//to_text(abs(radius(2)))//" m, which do not fit teeth = [" &
                              //to_text(spec%wheel(1))//", "//to_text(spec%wheel(2))//"] (expected both markers in the planes " &
                              //"of the pitch circles, which touch)")
                end if
            end associate
        end subroutine lay_cones
    end subroutine lay_teeth

    !> What pressure and helix angle add: a force along the axes in proportion to that of the pitch circles, and one that drives the
    !> wheels off each other in proportion to its size. Neither has power.
    subroutine lean_teeth(model, wheel, gear, status)
        type(model_type), intent(in) :: model
        type(wheel_type), intent(in) :: wheel(2)
        type(gear_type), intent(inout) :: gear
        type(status_type), intent(inout) :: status
        real(wp) :: apart(3), way_round
        integer :: side

        associate (spec => model%scene%joint(gear%joint), z => wheel(1)%axis)
            if (all(spec%flank == 0)) return
            if (model%joint(gear%joint)%told_kind == joint_rack) then
                apart = gear%pitch - wheel(1)%point
            else if (is_worm(model, gear%joint)) then
                apart = cross(z, wheel(2)%axis)
                apart = sign(1.0_wp, dot_product(wheel(2)%point - wheel(1)%point, apart))*apart
            else if (norm2(cross(z, wheel(2)%axis)) > alignment) then
                if (spec%flank(2) /= 0) call fail(status, status_bad_input, "gear " &
                    //quoted(model%joint(gear%joint)%name)//": helix_angle has no meaning between axes that meet (expected " &
                    //"straight bevel teeth)")
                ! square to the teeth, which go along the line from the cones' tip to the pitch point
                apart = cross(gear%direction, gear%pitch - tip_of_cones())
                apart = sign(1.0_wp, dot_product(apart, off_the_smaller()))*apart
            else
                apart = off_the_smaller() - dot_product(off_the_smaller(), z)*z
            end if
            gear%push = tan(spec%flank(1))/cos(spec%flank(2) + spec%lead_angle)*apart/norm2(apart)   ! one of both is zero
            if (spec%flank(2) == 0) return
            ! a right-handed helix leads along z as it goes round z, on whichever side of its wheel the teeth meet
            way_round = sign(1.0_wp, dot_product(z, cross(gear%pitch - wheel(1)%point, gear%direction)))
            gear%direction = gear%direction - way_round*tan(spec%flank(2))*z
            do side = 1, 2
                gear%couple(:, side) = cross(gear%pitch - wheel(side)%point, gear%direction)
            end do
        end associate

    contains

        !> From the pitch point, the way that the second wheel is driven: into the smaller wheel, whose teeth point away from its
        !> axis, or off it. Those of the larger one may point inwards: a ring, or a bevel wheel with a cone beyond a right angle.
        pure function off_the_smaller() result(way)
            real(wp) :: way(3)

            associate (teeth => model%scene%joint(gear%joint)%wheel)
                if (teeth(2) < teeth(1)) then
                    way = wheel(2)%point - gear%pitch
                else
                    way = gear%pitch - wheel(1)%point
                end if
            end associate
        end function off_the_smaller

        !> Where both axes meet.
        pure function tip_of_cones() result(tip)
            real(wp) :: tip(3)
            real(wp) :: normal(3)

            normal = cross(wheel(1)%axis, wheel(2)%axis)
            tip = wheel(1)%point + wheel(1)%axis &
                  *(dot_product(cross(wheel(2)%point - wheel(1)%point, wheel(2)%axis), normal)/dot_product(normal, normal))
        end function tip_of_cones
    end subroutine lean_teeth

    !> Joints on the way from the carrier to a wheel: by sign, what a force on the first (1) or second wheel (-1) adds to what they
    !> do to their second link, if it is counted on the second wheel.
    function held_by(model, ways, carrier, side) result(joint)
        type(model_type), intent(in) :: model
        type(axis_ways), intent(in) :: ways
        integer, intent(in) :: carrier, side
        integer, allocatable :: joint(:)
        integer :: l

        allocate (joint(0))
        l = carrier
        do while (ways%joint(l) > 0)
            ! the joint holds the wheel against it: on the wheel's side it does the opposite
            joint = [joint, side*merge(1, -1, model%joint(ways%joint(l))%link(2) == ways%before(l))*ways%joint(l)]
            l = ways%before(l)
        end do
    end function held_by

    !> A rack: a unit force along it, on the line through its marker.
    subroutine lay_rack(model, wheel, gear, status)
        type(model_type), intent(in) :: model
        type(wheel_type), intent(in) :: wheel(2)
        type(gear_type), intent(inout) :: gear
        type(status_type), intent(inout) :: status
        real(wp) :: radius(3)

        associate (u => wheel(2)%axis, z => wheel(1)%axis, name => model%joint(gear%joint)%name)
            radius = wheel(2)%point - wheel(1)%point
            radius = radius - dot_product(radius, u)*u - dot_product(radius, z)*z
            if (abs(dot_product(u, z)) > alignment) then
                call fail(status, status_bad_input, "rack "//quoted(name)//": it slides along the wheel's axis in part " &
                          //"(expected square to it)")
            else if (norm2(radius) <= alignment*scene_size(model)) then
                call fail(status, status_bad_input, "rack "//quoted(name)//": the line through its marker meets the wheel's axis " &
                          //"(expected at a distance, the wheel's radius)")
            end if
            gear%direction = u
            gear%radius(1) = norm2(radius)
            gear%pitch = wheel(1)%point + radius
            gear%couple(:, 1) = cross(radius, u)
            gear%couple(:, 2) = cross(wheel(1)%point + radius - wheel(2)%point, u)
        end associate
    end subroutine lay_rack

    !> A belt: its tension on the one side less that on the other, each on both sides half of it more or less than in the mean.
    subroutine lay_belt(model, wheel, gear, status)
        type(model_type), intent(in) :: model
        type(wheel_type), intent(in) :: wheel(2)
        type(gear_type), intent(inout) :: gear
        type(status_type), intent(inout) :: status
        real(wp) :: apart(3), distance, first

        associate (z => wheel(1)%axis, spec => model%scene%joint(gear%joint))
            apart = wheel(2)%point - wheel(1)%point
            apart = apart - dot_product(apart, z)*z
            distance = norm2(apart)
            first = merge(-1, 1, spec%is_turned_over)*spec%wheel(1)
            if (norm2(cross(z, wheel(2)%axis)) > alignment) then
                call fail(status, status_bad_input, "belt "//quoted(model%joint(gear%joint)%name)//": the axes of its wheels are " &
                          //"not parallel (expected parallel)")
                return
            else if (distance <= abs(first - spec%wheel(2))) then
                call fail(status, status_bad_input, "belt "//quoted(model%joint(gear%joint)%name)//": its wheels are " &
                          //to_text(distance)//" m apart (expected more than the "//trim(merge("sum       ", "difference", &
                          spec%is_turned_over))//" of their radii, "//to_text(abs(first - spec%wheel(2)))//" m)")
                return
            end if
            gear%radius = spec%wheel
            gear%curvature = 1/spec%wheel
            gear%distance = distance
            gear%pitch = (wheel(1)%point + wheel(2)%point)/2
            gear%couple(:, 1) = first*z
            gear%couple(:, 2) = spec%wheel(2)*z
            ! what the moments on both wheels leave is taken by their distance
            gear%direction = (first - spec%wheel(2))/distance**2*cross(z, apart)
            if (any(abs(wheel(2)%point - wheel(1)%point - apart) > alignment*scene_size(model))) &
                gear%couple(:, 2) = gear%couple(:, 2) &
                                    + cross(wheel(1)%point + apart - wheel(2)%point, gear%direction)
        end associate
    end subroutine lay_belt

    !> What both strands together do: they draw the wheels towards each other.
    pure subroutine lay_strands(wheel, belt)
        type(wheel_type), intent(in) :: wheel(2)
        type(belt_type), intent(inout) :: belt
        real(wp) :: apart(3)

        apart = wheel(2)%point - wheel(1)%point
        apart = apart - dot_product(apart, wheel(1)%axis)*wheel(1)%axis
        belt%line = -sqrt(1 - sum(belt%gear%direction**2))*apart/norm2(apart)
        belt%lever = cross(wheel(1)%point + apart - wheel(2)%point, belt%line)
    end subroutine lay_strands

    ! ---------------------------------------------------------------- what follows from the coordinates

    !> Joint variables that the coordinates give by way of gears.
    subroutine lead_by_gears(model, status)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        real(wp) :: row(model%n_variable, size(model%gear)), right(0:model%n_q, size(model%gear)), scale
        integer :: pivot(size(model%gear)), given(model%n_variable), g, i, k, n

        given = 0
        do k = 1, model%n_q
            associate (c => model%scene%coordinate(k))
                if (c%kind /= coordinate_joint) cycle
                if (.not. is_pose_part(model%joint(c%joint)%kind)) given(model%joint(c%joint)%first_variable + c%variable) = k
            end associate
        end do
        ! Each sum in the variables that are not given, on the right (0) what it is and what coordinates (k) take of it.
        n = 0
        do g = 1, size(model%gear)
            if (.not. is_geared(model%joint(model%gear(g)%joint)%kind)) cycle    ! let go: others do what it does
            n = n + 1
            scale = maxval(abs(model%gear(g)%weight))
            row(:, n) = model%gear(g)%weight/scale
            right(:, n) = 0
            right(0, n) = model%gear(g)%total/scale
            do i = 1, model%n_variable
                if (given(i) == 0) cycle
                right(given(i), n) = -row(i, n)
                row(i, n) = 0
            end do
            do i = 1, n - 1
                call take_off(i, n)
            end do
            if (all(abs(row(:, n)) <= negligible)) then
                call refuse_excess(g, right(1:, n))
                return
            end if
            pivot(n) = maxloc(abs(row(:, n)), dim=1)
            scale = row(pivot(n), n)
            row(:, n) = row(:, n)/scale
            right(:, n) = right(:, n)/scale
            do i = 1, n - 1
                call take_off(n, i)
            end do
        end do
        do i = 1, n
            if (count(abs(row(:, i)) > negligible) > 1) cycle
            call append_led(model, joint_of(model, pivot(i)), right(0, i), right(1:, i), [integer ::], [real(wp) ::])
        end do
        if (size(model%led) < n) call keep_loose(model, given)

    contains

        !> The pivot of row i out of row k.
        subroutine take_off(i, k)
            integer, intent(in) :: i, k
            real(wp) :: part

            part = row(pivot(i), k)
            if (part == 0) return
            row(:, k) = row(:, k) - part*row(:, i)
            right(:, k) = right(:, k) - part*right(:, i)
            row(pivot(i), k) = 0
        end subroutine take_off

        subroutine refuse_excess(g, of_coordinates)
            integer, intent(in) :: g
            real(wp), intent(in) :: of_coordinates(:)
            character(len=:), allocatable :: name

            name = what(model, model%gear(g)%joint)//" "//quoted(model%joint(model%gear(g)%joint)%name)
            if (count(abs(of_coordinates) > negligible) == 1) then
                call fail(status, status_bad_input, name//" locks coordinate " &
                          //quoted(model%scene%coordinate(maxloc(abs(of_coordinates), dim=1))%name) &
                          //": the other gears between its wheels have another ratio (expected one gear less, or a ratio that " &
                          //"fits)")
            else if (any(abs(of_coordinates) > negligible)) then
                call fail(status, status_bad_input, name//" ties coordinate " &
                          //quoted(model%scene%coordinate(maxloc(abs(of_coordinates), dim=1))%name) &
                          //" to the others (expected one coordinate less)")
            else
                call fail(status, status_bad_input, name//": the other gears tie its wheels already, and how they share the load " &
                          //"is not determined (expected redundancy = 'minimum-norm' or 'stiffness', or one gear less)")
            end if
        end subroutine refuse_excess
    end subroutine lead_by_gears

    !> Sums in which variables are left that neither coordinates nor gears give: as the gears have them, not mixed with each other,
    !> so that whole ratios stay whole.
    subroutine keep_loose(model, given)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: given(:)            !! coordinate that a variable is; 0: none (n_variable)
        type(loose_type) :: loose(size(model%gear))
        real(wp) :: row(model%n_variable), reduced(model%n_variable, size(model%gear)), rest(model%n_variable), scale
        integer :: led(model%n_variable), pivot(size(model%gear)), g, i, n

        led = 0
        do i = 1, size(model%led)
            led(model%joint(model%led(i)%joint)%first_variable + model%led(i)%variable) = i
        end do
        n = 0
        do g = 1, size(model%gear)
            if (.not. is_geared(model%joint(model%gear(g)%joint)%kind)) cycle
            scale = maxval(abs(model%gear(g)%weight))
            row = model%gear(g)%weight/scale
            rest = merge(row, 0.0_wp, given == 0 .and. led == 0)
            do i = 1, n
                rest = rest - rest(pivot(i))*reduced(:, i)
            end do
            if (all(abs(rest) <= negligible)) cycle
            n = n + 1
            pivot(n) = maxloc(abs(rest), dim=1)
            reduced(:, n) = rest/rest(pivot(n))
            loose(n)%gear = g
            loose(n)%total = model%gear(g)%total/scale
            allocate (loose(n)%weight(model%n_q), source=0.0_wp)
            do i = 1, model%n_variable
                if (given(i) > 0) then
                    loose(n)%weight(given(i)) = loose(n)%weight(given(i)) - row(i)
                else if (led(i) > 0) then
                    loose(n)%total = loose(n)%total - row(i)*model%led(led(i))%offset
                    loose(n)%weight = loose(n)%weight - row(i)*model%led(led(i))%weight
                end if
            end do
            associate (variable => pack([(i, i=1, model%n_variable)], row /= 0 .and. given == 0 .and. led == 0))
                loose(n)%joint = [(joint_of(model, variable(i)), i=1, size(variable))]
                loose(n)%part = row(variable)
            end associate
        end do
        model%loose = loose(:n)
    end subroutine keep_loose

    !> The joint that has a variable.
    pure integer function joint_of(model, variable)
        type(model_type), intent(in) :: model
        integer, intent(in) :: variable
        integer :: j

        joint_of = 0
        do j = 1, model%n_joint
            if (joint_n_variable(model%joint(j)%kind) > 0 .and. model%joint(j)%first_variable < variable) joint_of = j
        end do
    end function joint_of

    !> The variable of one of a sum's joints, from those of the others, whose links are placed.
    subroutine lead_by_loose(model, i, joint)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: i                   !! number of the sum
        integer, intent(in) :: joint
        real(wp) :: part

        associate (loose => model%loose(i))
            part = loose%part(findloc(loose%joint, joint, dim=1))
            call append_led(model, joint, loose%total/part, loose%weight/part, pack(loose%joint, loose%joint /= joint), &
                            -pack(loose%part, loose%joint /= joint)/part)
        end associate
    end subroutine lead_by_loose

    !> Variables that an earlier plan has found from those of other joints.
    subroutine forget_loose(model)
        type(model_type), intent(inout) :: model
        type(led_type), allocatable :: kept(:)
        integer :: n

        n = 0
        do while (n < size(model%led))
            if (size(model%led(n + 1)%source) > 0) exit
            n = n + 1
        end do
        allocate (kept(n))
        kept = model%led(:n)
        call move_alloc(kept, model%led)
    end subroutine forget_loose

    subroutine append_led(model, joint, offset, weight, source, source_weight)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: joint, source(:)
        real(wp), intent(in) :: offset, weight(:), source_weight(:)
        type(led_type), allocatable :: longer(:)

        allocate (longer(size(model%led) + 1))
        longer(:size(model%led)) = model%led
        associate (new => longer(size(longer)))
            new%joint = joint
            new%variable = 1
            new%offset = offset
            new%weight = weight
            new%source = source
            new%source_weight = source_weight
        end associate
        call move_alloc(longer, model%led)
    end subroutine append_led

    !> What a joint variable that is given is called: a coordinate, or a variable that gears give.
    function led_name(model, c) result(name)
        type(model_type), intent(in) :: model
        integer, intent(in) :: c                   !! number of a coordinate, or beyond these of what is led
        character(len=:), allocatable :: name
        integer :: k

        if (c <= model%n_q) then
            name = trim(model%scene%coordinate(c)%name)
            return
        end if
        name = ""
        do k = 1, model%n_q
            if (model%led(c - model%n_q)%weight(k) /= 0) call add(model%scene%coordinate(k)%name)
        end do
        do k = 1, size(model%led(c - model%n_q)%source)
            call add(model%joint(model%led(c - model%n_q)%source(k))%name)
        end do
        name = name//" by gears"

    contains

        subroutine add(one)
            character(len=*), intent(in) :: one

            if (name /= "") name = name//" and "
            name = name//trim(one)
        end subroutine add
    end function led_name
end module linkdyn_gearing
