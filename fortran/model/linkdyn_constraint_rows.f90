!> Constraint rows of a mechanism at a pose: how fast the gap of each joint opens along each direction that the joint holds.
!>
!> The transposed rows are the wrenches of the joints on their links, so the same rows tell which constraints depend on others and
!> which reactions balance each other without any load. A loop is closed here by damped Gauss-Newton steps, which take redundant
!> constraints as they come. Its pose is off the start by a little in every joint, so that a start in a special position does not
!> pass for redundancy.
!>
!> **Source**: for the rows, J. Angeles, *Fundamentals of Robotic Mechanical Systems*, 4th ed. (2014), section 10.2; for the
!> damping, N. Yamashita, M. Fukushima, Computing Suppl. 15 (2001) 239: with lambda = |residual|^2 the convergence stays
!> quadratic where the rows are dependent.
module linkdyn_constraint_rows
    use linkdyn_angles, only: matrix_of_angles
    use linkdyn_cross, only: cross
    use linkdyn_damped_step, only: find_damped_step
    use linkdyn_joint_table, only: force_directions, moment_directions, is_threaded, is_geared, along_axes, along_x_and_y, &
        along_z, along_normal
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, joint_type, gear_type, scene_size, gapes
    use linkdyn_scene, only: joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, joint_spherical, joint_planar, &
        joint_screw, joint_n_variable
    implicit none (type, external)
    private
    public :: loop_type, rows_type, make_loop, take_joints, place_carriers, close_loop, close_near_start, list_rows, joint_frame
    public :: joint_point, any_turned_over, move_bodies, least_new, hardly_new
    public :: of_force, of_moment, across, along

    real(wp), parameter :: off_start = 0.1_wp           !! [rad, scene sizes] how far the joints are moved off the start, at most
    real(wp), parameter :: far_off = 2.5_wp
    integer, parameter :: most_steps = 200
    !> The loop may move: without damping the last steps would be undetermined. It slows them by this part of a squared singular
    !> value.
    real(wp), parameter :: least_damping = 1.0e-10_wp
    real(wp), parameter :: is_closed = 1.0e-11_wp       !! [rad, scene sizes]

    !> A row is redundant if less of it than this is new. Exact numbers leave errors of 1e-11 in a closed loop; independent rows of
    !> a mechanism that can be built and is a tenth of a radian off its special positions are not that near to dependent.
    real(wp), parameter :: hardly_new = 1.0e-6_wp

    integer, parameter :: most_held = 6                 !! directions, by a joint
    integer, parameter :: of_force = 1, of_moment = 2
    integer, parameter :: across = 1, along = 2         !! the axis of the joint's marker

    !> Bodies between joints in a pose, lengths in scene sizes. Body 0 is the frame.
    type :: loop_type
        integer, allocatable :: joint(:)                !! of the model
        integer, allocatable :: kind(:)                 !! of these joints
        real(wp), allocatable :: frame(:, :, :, :)      !! of their markers in link axes, columns x, y, z (3, 3, 2, n joints)
        integer, allocatable :: body(:, :)              !! that they connect (2, n joints)
        integer, allocatable :: carrier(:)              !! of a gear: the body in which its wheels turn (n joints)
        real(wp), allocatable :: position(:, :)         !! (3, 0:n bodies)
        real(wp), allocatable :: rotation(:, :, :)      !! (3, 3, 0:n bodies)
        real(wp) :: size = 1                            !! [m]
        integer, allocatable :: column(:)               !! freedoms of a body that count: all six, or those of the plane
        real(wp) :: open = huge(1.0_wp)                 !! what closing has left; huge: it was not tried [rad, scene sizes]
    end type loop_type

    !> Constraint rows of a loop.
    type :: rows_type
        integer :: n = 0
        real(wp), allocatable :: row(:, :)              !! (columns, n)
        real(wp), allocatable :: residual(:)
        integer, allocatable :: joint(:)                !! index in the loop
        integer, allocatable :: sort(:)                 !! force or moment
        integer, allocatable :: direction(:)            !! across or along
        real(wp), allocatable :: axis(:, :)             !! of the force or moment, world axes (3, n)
        real(wp), allocatable :: wrench(:, :)           !! force and moment on the second body at its marker, world axes, for a
                                                        !! unit of this row's reaction [1, scene sizes] (6, n)
    end type rows_type

contains

    !> The loop near the start of the scene: from where its links start, as far as it says so, else from where its joints do.
    subroutine close_near_start(model, link, joint, loop, is_closed, nearer)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link(:), joint(:)
        type(loop_type), intent(out) :: loop
        logical, intent(out) :: is_closed
        real(wp), intent(in), optional :: nearer        !! part of the usual way off the start

        is_closed = .false.
        if (any(model%scene%link(link)%has_start)) then
            call make_loop(model, link, joint, loop, is_closed, by_links=.true., nearer=nearer)
            if (is_closed) call close_loop(model, loop, is_closed)
            if (is_closed) is_closed = .not. any_turned_over(loop)
        end if
        if (is_closed) return
        call make_loop(model, link, joint, loop, is_closed, nearer=nearer)
        if (is_closed) call close_loop(model, loop, is_closed)
    end subroutine close_near_start

    !> Place the bodies one behind the other, each by the first joint that leads to it.
    subroutine make_loop(model, link, joint, loop, is_connected, variant, by_links, nearer)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link(:), joint(:)
        type(loop_type), intent(out) :: loop
        logical, intent(out) :: is_connected
        integer, intent(in), optional :: variant        !! of the ways to be off the start: 0 by a little, 1, 2, ... far off
        logical, intent(in), optional :: by_links       !! links that have a start stand near it
        real(wp), intent(in), optional :: nearer        !! part of the usual way off the start; absent: all of it
        integer :: body(0:model%n_link), i, from, turn
        real(wp) :: off
        logical :: is_placed(0:size(link)), goes_on

        is_connected = .false.
        turn = 0
        if (present(variant)) turn = variant*size(joint)
        off = merge(off_start, far_off, turn == 0)
        if (present(nearer)) off = nearer*off
        body = -1
        body(0) = 0
        body(link) = [(i, i=1, size(link))]
        call take_joints(model, joint, loop)
        allocate (loop%body(2, size(joint)))
        do i = 1, size(joint)
            loop%body(:, i) = body(model%joint(joint(i))%link)
        end do
        call place_carriers(model, body, loop)
        if (any(loop%body < 0)) return                  ! the other end is placed by coordinates
        allocate (loop%position(3, 0:size(link)), loop%rotation(3, 3, 0:size(link)))
        loop%position = 0
        loop%rotation(:, :, 0) = unit_matrix()
        is_placed = .false.
        is_placed(0) = .true.
        if (present(by_links)) call place_at_starts(model, link, off, loop, is_placed(1:))
        do
            goes_on = .false.
            do i = 1, size(joint)
                from = findloc(is_placed(loop%body(:, i)), .true., 1)
                if (from == 0 .or. all(is_placed(loop%body(:, i))) .or. is_geared(model%joint(joint(i))%told_kind)) cycle
                call place_behind(model, loop, i, from, off*spread_out(turn + i))
                is_placed(loop%body(3 - from, i)) = .true.
                goes_on = .true.
            end do
            if (.not. goes_on) exit
        end do
        is_connected = all(is_placed)
    end subroutine make_loop

    !> Links that have a start of their own.
    subroutine place_at_starts(model, link, off, loop, is_placed)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link(:)
        real(wp), intent(in) :: off                     !! [rad, scene sizes] how far off it at most
        type(loop_type), intent(inout) :: loop
        logical, intent(inout) :: is_placed(:)
        real(wp) :: aside(6)
        integer :: b

        do b = 1, size(link)
            associate (spec => model%scene%link(link(b)))
                if (.not. spec%has_start) cycle
                aside = off*[spread_out(2*b), spread_out(2*b + 1)]
                if (model%is_planar) aside(3:5) = 0
                loop%position(:, b) = spec%start(:3)/loop%size + aside(:3)
                loop%rotation(:, :, b) = matmul(turn_by(aside(4:)), matrix_of_angles(spec%start(4:)))
                is_placed(b) = .true.
            end associate
        end do
    end subroutine place_at_starts

    !> The bodies in which the wheels of gears turn.
    subroutine place_carriers(model, body, loop)
        type(model_type), intent(in) :: model
        integer, intent(in) :: body(0:)                 !! of each link
        type(loop_type), intent(inout) :: loop
        integer :: i

        allocate (loop%carrier(size(loop%joint)), source=0)
        do i = 1, size(loop%joint)
            if (is_geared(loop%kind(i))) loop%carrier(i) = body(model%gear(model%joint(loop%joint(i))%gear)%carrier)
        end do
    end subroutine place_carriers

    !> The loop's joints as they close loops, and what all loops of the model have in common.
    subroutine take_joints(model, joint, loop)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint(:)
        type(loop_type), intent(inout) :: loop
        integer :: i

        loop%joint = joint
        loop%kind = model%joint(joint)%kind
        allocate (loop%frame(3, 3, 2, size(joint)))
        do i = 1, size(joint)
            loop%frame(:, :, :, i) = model%joint(joint(i))%frame
        end do
        loop%size = scene_size(model)
        loop%column = [1, 2, 3, 4, 5, 6]
        if (model%is_planar) loop%column = [1, 2, 6]
    end subroutine take_joints

    !> Place the body at the other end of a joint, its variables near their start.
    subroutine place_behind(model, loop, i, from, off)
        type(model_type), intent(in) :: model
        type(loop_type), intent(inout) :: loop
        integer, intent(in) :: i, from                  !! side that is placed
        real(wp), intent(in) :: off(3)                  !! how far off the start [rad, scene sizes]
        real(wp) :: turned(3, 3), shift(3), start(3)
        integer :: known, next, to

        to = 3 - from
        known = loop%body(from, i)
        next = loop%body(to, i)
        associate (joint => model%joint(loop%joint(i)), spec => model%scene%joint(loop%joint(i)))
            start = merge(spec%start, 0.0_wp, spec%has_start)
            shift = 0
            turned = unit_matrix()
            select case (loop%kind(i))
            case (joint_revolute)
                turned = turn_by([0.0_wp, 0.0_wp, start(1) + off(1)])
            case (joint_prismatic)
                ! the slide of a cylindrical joint that holds a spin is its second variable
                shift(3) = start(joint_n_variable(joint%told_kind))/loop%size + off(1)
            case (joint_cylindrical)
                turned = turn_by([0.0_wp, 0.0_wp, start(1) + off(1)])
                shift(3) = start(2)/loop%size + off(2)
            case (joint_universal, joint_spherical)
                turned = turn_by(off)
            case (joint_planar)
                turned = turn_by([0.0_wp, 0.0_wp, start(3) + off(3)])
                shift(:2) = start(:2)/loop%size + off(:2)
            case (joint_screw)
                turned = turn_by([0.0_wp, 0.0_wp, start(1) + off(1)])
                shift(3) = pitch_of(model, loop, i)*(start(1) + off(1))
            end select
            if (from == 2) then
                turned = transpose(turned)
                shift = -matmul(turned, shift)
            end if
            associate (frame => joint_frame(loop, i, from))
                loop%rotation(:, :, next) = matmul(matmul(frame, turned), transpose(loop%frame(:, :, to, i)))
                loop%position(:, next) = joint_point(model, loop, i, from) + matmul(frame, shift) &
                                         - matmul(loop%rotation(:, :, next), joint%point(:, to)/loop%size)
            end associate
        end associate
    end subroutine place_behind

    !> Slide per angle of a screw, in scene sizes.
    pure real(wp) function pitch_of(model, loop, i)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        integer, intent(in) :: i

        pitch_of = model%joint(loop%joint(i))%pitch/loop%size
    end function pitch_of

    !> Three numbers in [-1, 1] without a pattern, the same in every run: multiples of the golden ratio and its kin.
    pure function spread_out(i) result(x)
        integer, intent(in) :: i
        real(wp) :: x(3)

        x = 2*modulo(i*[0.8191725134_wp, 0.6710436067_wp, 0.5497004779_wp], 1.0_wp) - 1
    end function spread_out

    pure function unit_matrix() result(r)
        real(wp) :: r(3, 3)

        r = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])
    end function unit_matrix

    !> The rotation by a rotation vector (Rodrigues).
    pure function turn_by(v) result(r)
        real(wp), intent(in) :: v(3)
        real(wp) :: r(3, 3), k(3, 3), angle

        k = reshape([0.0_wp, v(3), -v(2), -v(3), 0.0_wp, v(1), v(2), -v(1), 0.0_wp], [3, 3])
        angle = norm2(v)
        r = unit_matrix() + k
        if (angle > 0) r = unit_matrix() + sin(angle)/angle*k + 2*(sin(angle/2)/angle)**2*matmul(k, k)
    end function turn_by

    !> A joint's marker in space.
    pure function joint_point(model, loop, i, side) result(point)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        integer, intent(in) :: i, side
        real(wp) :: point(3)

        associate (b => loop%body(side, i))
            point = loop%position(:, b) + matmul(loop%rotation(:, :, b), model%joint(loop%joint(i))%point(:, side)/loop%size)
        end associate
    end function joint_point

    !> Frame of a joint's side in space, columns x, y, z.
    pure function joint_frame(loop, i, side) result(frame)
        type(loop_type), intent(in) :: loop
        integer, intent(in) :: i, side
        real(wp) :: frame(3, 3)

        frame = matmul(loop%rotation(:, :, loop%body(side, i)), loop%frame(:, :, side, i))
    end function joint_frame

    !> Has an axis come to lie end for end?
    pure logical function any_turned_over(loop)
        type(loop_type), intent(in) :: loop
        real(wp) :: first(3, 3), second(3, 3)
        integer :: i

        any_turned_over = .false.
        do i = 1, size(loop%joint)
            first = joint_frame(loop, i, 1)
            second = joint_frame(loop, i, 2)
            select case (moment_directions(loop%kind(i)))
            case (along_x_and_y)
                any_turned_over = any_turned_over .or. dot_product(first(:, 3), second(:, 3)) < 0
            case (along_axes)
                any_turned_over = any_turned_over .or. dot_product(first(:, 3), second(:, 3)) < 0 &
                                  .or. dot_product(first(:, 1), second(:, 1)) < 0
            end select
        end do
    end function any_turned_over

    !> Steps of least squares, damped by the square of what is open. Gears hold no marker and are left out: wheels may stand anyhow.
    !>
    !> A mechanism that moves by its proportions alone does so with exact numbers. With rounded ones, as drawings have them, some of
    !> the loop stays open off the start, and steps do not make it smaller: it is closed as far as its joints may gape.
    subroutine close_loop(model, loop, is_done, most)
        type(model_type), intent(in) :: model
        type(loop_type), intent(inout) :: loop
        logical, intent(out) :: is_done
        integer, intent(in), optional :: most            !! steps
        type(rows_type) :: rows
        real(wp) :: step(size(loop%column)*ubound(loop%position, 2)), largest, before
        logical :: is_found
        integer :: n, n_step

        is_done = .false.
        n_step = most_steps
        if (present(most)) n_step = most
        loop%open = huge(loop%open)
        do n = 1, n_step
            call list_rows(model, loop, rows, gears=.false.)
            if (rows%n == 0) return
            before = loop%open
            loop%open = norm2(rows%residual(:rows%n))
            is_done = loop%open <= is_closed .or. (loop%open <= gapes .and. loop%open > before/2)
            if (is_done) return
            associate (j => rows%row(:, :rows%n), f => rows%residual(:rows%n))
                call find_damped_step(j, f, min(1.0_wp, dot_product(f, f)) + least_damping, step, is_found)
            end associate
            if (.not. is_found) return
            largest = maxval(abs(step))
            if (.not. largest < huge(largest)) return
            call move_bodies(loop, step*min(1.0_wp, 0.3_wp/max(largest, tiny(largest))))
        end do
    end subroutine close_loop

    !> Move all bodies by a small step of each: shifts, then rotation vectors.
    subroutine move_bodies(loop, step)
        type(loop_type), intent(inout) :: loop
        real(wp), intent(in) :: step(:)                 !! its columns, body after body [scene sizes, rad]
        real(wp) :: six(6)
        integer :: b, n

        n = size(loop%column)
        do b = 1, ubound(loop%position, 2)
            six = 0
            six(loop%column) = step(n*(b - 1) + 1:n*b)
            loop%position(:, b) = loop%position(:, b) + six(:3)
            loop%rotation(:, :, b) = matmul(turn_by(six(4:)), loop%rotation(:, :, b))
        end do
    end subroutine move_bodies

    !> What is hardly new of this loop's rows: where rounded numbers leave it open they are off by about as much.
    pure real(wp) function least_new(loop)
        type(loop_type), intent(in) :: loop
        real(wp), parameter :: per_opening = 10

        least_new = max(hardly_new, per_opening*loop%open)
    end function least_new

    ! ---------------------------------------------------------------- rows

    !> What each joint holds, by directions of its first marker, and how far it is from holding it. Gears are never open.
    subroutine list_rows(model, loop, rows, gears)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        type(rows_type), intent(out) :: rows
        logical, intent(in), optional :: gears          !! false: without them
        real(wp), dimension(3, 3) :: first, second
        real(wp), dimension(3) :: point, gap, tilt, twist
        logical :: with_gears
        integer :: i, k

        allocate (rows%row(size(loop%column)*ubound(loop%position, 2), most_held*size(loop%joint)), source=0.0_wp)
        allocate (rows%residual(most_held*size(loop%joint)), source=0.0_wp)
        allocate (rows%joint(most_held*size(loop%joint)), rows%sort(most_held*size(loop%joint)), &
                  rows%direction(most_held*size(loop%joint)), rows%axis(3, most_held*size(loop%joint)), &
                  rows%wrench(6, most_held*size(loop%joint)))
        with_gears = .true.
        if (present(gears)) with_gears = gears
        do i = 1, size(loop%joint)
            if (is_geared(loop%kind(i))) then
                if (with_gears) call add_teeth(model%joint(loop%joint(i)), model%gear(model%joint(loop%joint(i))%gear))
                cycle
            end if
            if (model%joint(loop%joint(i))%belt > 0) cycle    ! it pulls, and holds nothing
            first = joint_frame(loop, i, 1)
            second = joint_frame(loop, i, 2)
            point = joint_point(model, loop, i, 2)
            gap = point - joint_point(model, loop, i, 1)
            do k = 1, 3
                if (holds_force(model, loop%kind(i), k)) call add_row(of_force, first(:, k), dot_product(first(:, k), gap))
            end do
            if (is_threaded(loop%kind(i))) call add_thread()
            ! small rotations: the axis tilts, the frame twists
            tilt = cross(first(:, 3), second(:, 3))
            twist = (cross(first(:, 1), second(:, 1)) + cross(first(:, 2), second(:, 2)) + tilt)/2
            select case (moment_directions(loop%kind(i)))
            case (along_normal)
                tilt = cross(second(:, 3), first(:, 3))
                k = 1
                call add_row(of_moment, tilt, dot_product(first(:, 3), second(:, 3)))
            case (along_axes)
                do k = 1, 3
                    if (holds_moment(model, loop%kind(i), k)) call add_row(of_moment, first(:, k), dot_product(first(:, k), twist))
                end do
            case (along_x_and_y)
                do k = 1, 2
                    if (.not. model%is_planar) call add_row(of_moment, first(:, k), dot_product(first(:, k), tilt))
                end do
            end select
        end do

    contains

        !> One force, with a moment on each wheel, in the carrier's axes.
        subroutine add_teeth(joint, gear)
            type(joint_type), intent(in) :: joint
            type(gear_type), intent(in) :: gear
            real(wp) :: six(6)
            integer :: side, b, n

            rows%n = rows%n + 1
            n = size(loop%column)
            associate (carrier => loop%rotation(:, :, loop%carrier(i)), axis => rows%axis(:, rows%n))
                axis = matmul(carrier, gear%direction)
                do side = 1, 2
                    b = loop%body(side, i)
                    six = [axis, matmul(carrier, gear%couple(:, side))/loop%size]
                    if (side == 2) rows%wrench(:, rows%n) = six
                    if (b == 0) cycle
                    six(4:) = six(4:) + cross(matmul(loop%rotation(:, :, b), joint%point(:, side)/loop%size), axis)
                    rows%row(n*(b - 1) + 1:n*b, rows%n) = rows%row(n*(b - 1) + 1:n*b, rows%n) + (2*side - 3)*six(loop%column)
                end do
            end associate
            rows%joint(rows%n) = i
            rows%sort(rows%n) = of_force
            rows%direction(rows%n) = across
        end subroutine add_teeth

        !> The slide along the axis, less what the angle makes of it but for whole turns.
        subroutine add_thread()
            real(wp) :: ahead

            k = 3
            associate (pitch => pitch_of(model, loop, i))
                ahead = dot_product(first(:, 3), gap)/pitch &
                        - atan2(dot_product(second(:, 1), first(:, 2)), dot_product(second(:, 1), first(:, 1)))
                call add_row(of_force, first(:, 3), pitch*atan2(sin(ahead), cos(ahead)), twist=-pitch)
            end associate
        end subroutine add_thread

        !> The velocity of the second body against the first along an axis, at the joint; or its angular velocity. A twist adds
        !> the angular velocity about the axis, so many times.
        subroutine add_row(sort, axis, residual, twist)
            integer, intent(in) :: sort
            real(wp), intent(in) :: axis(3), residual
            real(wp), intent(in), optional :: twist
            real(wp) :: six(6)
            integer :: side, b, n

            rows%n = rows%n + 1
            n = size(loop%column)
            do side = 1, 2
                b = loop%body(side, i)
                if (b == 0) cycle
                six = [0.0_wp, 0.0_wp, 0.0_wp, axis]
                if (sort == of_force) six = [axis, cross(point - loop%position(:, b), axis)]
                if (present(twist)) six(4:) = six(4:) + twist*axis
                rows%row(n*(b - 1) + 1:n*b, rows%n) = rows%row(n*(b - 1) + 1:n*b, rows%n) + (2*side - 3)*six(loop%column)
            end do
            rows%residual(rows%n) = residual
            rows%joint(rows%n) = i
            rows%sort(rows%n) = sort
            rows%direction(rows%n) = merge(along, across, k == 3)
            rows%axis(:, rows%n) = axis
            rows%wrench(:, rows%n) = [0.0_wp, 0.0_wp, 0.0_wp, axis]
            if (sort == of_force) rows%wrench(:, rows%n) = [axis, 0.0_wp, 0.0_wp, 0.0_wp]
            if (present(twist)) rows%wrench(4:, rows%n) = twist*axis
        end subroutine add_row
    end subroutine list_rows

    !> Does a joint hold a force along axis k of its first marker? In the plane, nothing is held across it.
    pure logical function holds_force(model, kind, k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: kind, k

        select case (force_directions(kind))
        case (along_z)
            holds_force = k == 3
        case (along_x_and_y)
            holds_force = k < 3
        case default
            holds_force = .true.
        end select
        if (model%is_planar) holds_force = merge(k == 1, k < 3, kind == joint_prismatic)
    end function holds_force

    !> Does a joint that turns about no axis hold a moment about axis k of its first marker? In the plane, about the plane's
    !> normal: axis 2 of a slide, else 3.
    pure logical function holds_moment(model, kind, k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: kind, k

        holds_moment = k == merge(2, 3, kind == joint_prismatic) .or. .not. model%is_planar
    end function holds_moment
end module linkdyn_constraint_rows
