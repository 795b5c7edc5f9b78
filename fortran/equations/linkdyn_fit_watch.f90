!> Do the joints of an over-constrained mechanism fit that let go of what others hold? On values: what is watched beside a record.
!>
!> A joint that was let go gapes where the geometry is not what makes its constraints redundant. In a pose where it fits all the
!> same, it fits there alone if its sides part as the links move: so how they part is watched, too, by its first and second rates.
!> Besides no axis may lie end for end, and gears that were let go for loops of joints keep their sums. Who runs the record looks
!> closer at samples that raise the alarm (`linkdyn_motion_measures`, `linkdyn_released_motion`).
module linkdyn_fit_watch
    use linkdyn_bodies, only: world_axes, omega_of, alpha_of, acceleration_of_origin
    use linkdyn_constants, only: two_pi
    use linkdyn_gear_gap, only: least_turn, sums_all_places
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_joint_table, only: along_axes, along_x_and_y, along_z, along_normal, is_geared, joint_prismatic, joint_revolute
    use linkdyn_joint_variables, only: within_half_a_turn, move_pair, accelerate_pair
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type, must_be_positive, told_pair_of
    use linkdyn_model, only: gear_type, holds_spin, is_released, scene_size, gapes, parts_slowly, parts_gently, stands_still
    use linkdyn_system, only: system_type, solved
    use linkdyn_value, only: value, zero, sqrt, square, nearest_whole, operator(+), operator(-), operator(*), operator(/)
    use linkdyn_vector, only: vector, components, vector_of, operator(-), operator(.dot.), operator(.cross.)
    implicit none (type, external)
    private
    public :: watch_fit, watch_parting

    !> A joint gapes, or parts, no more than this part of what it may: a record that says so agrees with whoever looks closer.
    real(wp), parameter :: surely = 0.5_wp

contains

    !> Watch the joints that were let go, and the axes of all that share. Links are placed.
    subroutine watch_fit(mechanism)
        type(mechanism_type), intent(inout) :: mechanism
        type(marker_pair) :: pair
        integer :: i, g

        associate (model => mechanism%model)
            do i = 1, size(model%share%joint)
                associate (joint => model%joint(model%share%joint(i)), kind => mechanism%told_kind(model%share%joint(i))%is)
                    if (is_geared(joint%told_kind) .or. holds_spin(joint)) cycle
                    pair = told_pair_of(mechanism, model%share%joint(i))
                    if (.not. model%is_planar) call watch_axes(mechanism, pair, kind%moments)
                    if (is_released(joint)) call watch_gaps(mechanism, model%share%joint(i), pair)
                end associate
            end do
            do g = 1, size(model%gear)
                if (is_released(model%joint(model%gear(g)%joint)) .and. .not. model%gear(g)%follows) &
                    call watch_gear(mechanism, model%gear(g))
            end do
        end associate
    end subroutine watch_fit

    !> No axis has come to lie end for end.
    subroutine watch_axes(mechanism, pair, moments)
        type(mechanism_type), intent(inout) :: mechanism
        type(marker_pair), intent(in) :: pair
        integer, intent(in) :: moments                 !! one of `along_*`

        if (all(moments /= [along_x_and_y, along_axes])) return
        call must_be_positive(mechanism, pair%first%z.dot.pair%second%z)
        if (moments == along_axes) call must_be_positive(mechanism, pair%first%x.dot.pair%second%x)
    end subroutine watch_axes

    !> Along the directions that the joint holds, small rotations as those that `linkdyn_constraint_rows` looks at.
    subroutine watch_gaps(mechanism, j, pair)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: j
        type(marker_pair), intent(in) :: pair

        associate (kind => mechanism%kind(j)%is, told => mechanism%told_kind(j)%is, a => pair%first, b => pair%second, &
                   is_planar => mechanism%model%is_planar)
            if (told%forces /= kind%forces) then
                if (any(told%forces == [along_axes, along_x_and_y])) then
                    call watch(a%x.dot.pair%gap, scene_size(mechanism%model))
                    call watch(a%y.dot.pair%gap, scene_size(mechanism%model))
                end if
                if (any(told%forces == [along_axes, along_z])) call watch(a%z.dot.pair%gap, scene_size(mechanism%model))
            end if
            if (told%moments == kind%moments) return
            select case (told%moments)
            case (along_normal)
                call watch(a%z.dot.b%z, 1.0_wp)
            case (along_x_and_y)
                call watch(a%x.dot.b%z, 1.0_wp)
                call watch(a%y.dot.b%z, 1.0_wp)
            case (along_axes)
                call watch((a%z.dot.b%y) - (a%y.dot.b%z), 2.0_wp)
                call watch((a%x.dot.b%z) - (a%z.dot.b%x), 2.0_wp)
                call watch((a%y.dot.b%x) - (a%x.dot.b%y), 2.0_wp)
            end select
        end associate

    contains

        subroutine watch(gap, size)
            type(value), intent(in) :: gap
            real(wp), intent(in) :: size               !! by which it is measured

            mechanism%watched = [mechanism%watched, (1/(surely*gapes*size))*gap]
        end subroutine watch
    end subroutine watch_gaps

    ! ---------------------------------------------------------------- do they stay together?

    !> Watch how the sides of joints part along what these have let go, over how the links move between which reactions are shared.
    !> Links move.
    subroutine watch_parting(mechanism, system)
        type(mechanism_type), intent(inout) :: mechanism
        type(system_type), intent(inout), optional :: system    !! solved: gives accelerations; absent: rates alone are watched
        type(marker_pair) :: pair
        type(vector) :: omega, rate, alpha, rate2
        type(value) :: speed, change, weight
        integer :: i

        call measure_motion(mechanism, speed, change, system)
        ! accelerations are felt with their weight, and rounded by it
        weight = sqrt(length_squared(acceleration_of_origin(mechanism%bodies, 0, world_axes)))
        do i = 1, size(mechanism%model%share%joint)
            associate (j => mechanism%model%share%joint(i))
                associate (joint => mechanism%model%joint(j))
                    if (.not. is_released(joint) .or. is_geared(joint%told_kind)) cycle
                end associate
                pair = told_pair_of(mechanism, j)
                call move_pair(mechanism, j, pair, omega, rate)
                call watch(let_go(mechanism, j, pair, rate, omega), (surely*parts_slowly)*speed)
                if (.not. present(system)) cycle
                call accelerate_pair(mechanism, j, pair, alpha, rate2)
                call watch(solved(system, let_go(mechanism, j, pair, rate2, alpha, omega)), &
                           (surely*parts_gently)*change + (surely*stands_still)*weight)
            end associate
        end do

    contains

        !> Links that stand still part by nothing.
        subroutine watch(part, size)
            type(value), intent(in) :: part(:), size

            mechanism%watched = [mechanism%watched, part/(size + tiny(1.0_wp))]
        end subroutine watch
    end subroutine watch_parting

    !> What of a motion of the second link, as the first one sees it, is along directions that a joint has let go. [m/s] or [m/s2]
    function let_go(mechanism, j, pair, shift, turn, omega) result(part)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j
        type(marker_pair), intent(in) :: pair
        type(vector), intent(in) :: shift, turn
        type(vector), intent(in), optional :: omega    !! of accelerations: with what angular velocity it turns
        type(value), allocatable :: part(:)
        type(value) :: leaning

        allocate (part(0))
        associate (kind => mechanism%kind(j)%is, told => mechanism%told_kind(j)%is, a => pair%first, b => pair%second, &
                   size => scene_size(mechanism%model))
            if (told%forces /= kind%forces) then
                if (any(told%forces == [along_axes, along_x_and_y])) part = [part, a%x.dot.shift, a%y.dot.shift]
                if (any(told%forces == [along_axes, along_z])) part = [part, a%z.dot.shift]
            end if
            if (told%moments == kind%moments) return
            if (told%moments == along_normal) then
                leaning = (b%z.cross.a%z) .dot.turn
                if (present(omega)) leaning = leaning + (a%z.dot.omega)*(b%z.dot.omega)
                part = [part, size*leaning]
            end if
            if (any(told%moments == [along_axes, along_x_and_y])) part = [part, size*(a%x.dot.turn), size*(a%y.dot.turn)]
            if (told%moments == along_axes) part = [part, size*(a%z.dot.turn)]
        end associate
    end function let_go

    !> How fast the links move between which reactions are shared, and how that changes. A turning counts at the mechanism's size.
    subroutine measure_motion(mechanism, speed, change, system)
        type(mechanism_type), intent(in) :: mechanism
        type(value), intent(out) :: speed, change      !! [m/s]; [m/s2], with a system
        type(system_type), intent(inout), optional :: system    !! gives accelerations
        type(value) :: squares
        real(wp) :: size
        integer :: i

        size = scene_size(mechanism%model)
        speed = zero()
        change = zero()
        associate (link => mechanism%model%share%link, bodies => mechanism%bodies)
            do i = 1, ubound(link, 1)
                speed = speed + length_squared(bodies%body(link(i))%velocity) &
                        + size**2*length_squared(omega_of(bodies, link(i), world_axes))
                if (.not. present(system)) cycle
                ! both less gravity
                change = change + length_squared(found(acceleration_of_origin(bodies, link(i), world_axes) &
                                                       - acceleration_of_origin(bodies, 0, world_axes))) &
                         + size**2*length_squared(found(alpha_of(bodies, link(i), world_axes)))
            end do
        end associate
        squares = speed
        speed = sqrt(squares)
        change = sqrt(change) + (1/size)*squares

    contains

        function found(v)
            type(vector), intent(in) :: v
            type(vector) :: found

            found = vector_of(solved(system, components(v)))
        end function found
    end subroutine measure_motion

    function length_squared(v) result(s)
        type(vector), intent(in) :: v
        type(value) :: s

        s = square(v%x) + square(v%y) + square(v%z)
    end function length_squared

    !> The sum of joint variables that a gear keeps, but for whole turns.
    subroutine watch_gear(mechanism, gear)
        type(mechanism_type), intent(inout) :: mechanism
        type(gear_type), intent(in) :: gear
        type(value) :: gap, variable(1)
        real(wp) :: turn
        integer :: j

        if (sums_all_places(mechanism%model, gear)) return
        gap = zero() - gear%total
        do j = 1, mechanism%model%n_joint
            associate (joint => mechanism%model%joint(j))
                if (all(joint%told_kind /= [joint_revolute, joint_prismatic])) cycle
                associate (weight => gear%weight(joint%first_variable + 1))
                    if (.not. abs(weight) > 0) cycle
                    variable = within_half_a_turn(mechanism, j)
                    gap = gap + weight*variable(1)
                end associate
            end associate
        end do
        turn = two_pi*least_turn(mechanism%model, gear)
        if (turn > 0) gap = gap - turn*nearest_whole((1/turn)*gap)
        mechanism%watched = [mechanism%watched, (1/(surely*gapes*scene_size(mechanism%model)))*gap]
    end subroutine watch_gear
end module linkdyn_fit_watch
