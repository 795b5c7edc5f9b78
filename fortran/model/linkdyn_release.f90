!> Over-constrained mechanisms: joints let go of directions that the others hold already.
!>
!> Bennett's loop, Sarrus' linkage, an Agile Eye, a planar four-bar in space move because constraints depend on one another. As
!> many of them can go as are redundant, and the motion stays: a hinge becomes cylindrical, universal or spherical, a slide
!> cylindrical, a universal joint spherical. What then closes the loops and gives one solution for the forces is an ordinary
!> mechanism, of joints of their `kind`; results keep the joints as the scene has them, by their `told_kind`. What the reactions
!> really are is found afterwards (`linkdyn_shared_reactions`): to those of the released mechanism comes a stress that balances
!> itself.
!>
!> *Which directions.* A direction can go if some such self-stress acts along it. Directions are taken one after the other, each
!> the one along which what is left of the self-stress acts most, in the worst of many poses; a hinge may be freed
!> about axes fixed to either of its links, lest the mechanism be singular in a pose where the given one is not.
!>
!> *Gears* (racks, belts) that repeat what other gears say go before joints do: a train without its second planet's mesh is as
!> easily placed as one with a single planet. Which these are, the sums of joint variables tell. A gear beside a loop of joints, a
!> belt between the cranks of a parallelogram, stays if it can: it may carry the mechanism through positions where the joints alone
!> leave open how it goes on.
!>
!> **Source**: self-stress and statical indeterminacy, S. Pellegrino, C. R. Calladine, Int. J. Solids Struct. 22 (1986) 409; which
!> reactions of over-constrained mechanisms are unique, M. Wojtyra, Mech. Mach. Theory 44 (2009) 2265.
module linkdyn_release
    use linkdyn_constants, only: golden, pi
    use linkdyn_constraint_rows, only: loop_type, rows_type, make_loop, close_loop, close_near_start, list_rows, joint_frame, &
        move_bodies, any_turned_over, least_new, of_force, of_moment
    use linkdyn_cross, only: cross
    use linkdyn_gearing, only: find_redundant_gears
    use linkdyn_elastic_links, only: list_arm_parts
    use linkdyn_joint_table, only: is_geared, joint_gear, joint_rack, joint_belt, joint_groove, joint_plate, joint_loose, &
        joint_key, joint_thread
    use linkdyn_kinds, only: wp
    use linkdyn_lock, only: lend_texts, take_texts_back
    use linkdyn_model, only: model_type, arm_type, gear_type
    use linkdyn_null_space, only: find_null_space
    use linkdyn_null_space_plan, only: plan_null_space
    use linkdyn_open_directions, only: open_part_of, whole_part
    use linkdyn_redundancy, only: most_links
    use linkdyn_scene, only: share_by_stiffness, coordinate_joint, joint_revolute, joint_prismatic, joint_cylindrical, &
        joint_universal, joint_spherical, joint_fixed, joint_planar, joint_screw, joint_n_variable
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text, quoted
    implicit none (type, external)
    private
    public :: release_joints, is_released_alike, release_alike, compliances

    integer, parameter :: most_poses = 64, least_poses = 3    !! at which the self-stress is looked at: fewer of large mechanisms,
    integer, parameter :: small = 576                   !! of one with n links this many over their square
    integer, parameter :: few_steps = 60                !! in which poses far off close, or are left out
    real(wp), parameter :: stride = 0.25_wp             !! on the way from the start [rad, scene sizes], of the body that moves most
    real(wp), parameter :: first_stride = 0.02_wp       !! runs begin there: what is beside the start is not leapt over
    integer, parameter :: n_angle = 6                   !! axes across a hinge that are tried, of each of its links
    real(wp), parameter :: acts = 1.0e-3_wp             !! part of a self-stress along a direction that can go
    integer, parameter :: many_moves = 2000             !! times states of self-stress: beyond, the search is shorter
    real(wp), parameter :: nearly = 0.6_wp              !! as strong as the strongest
    real(wp), parameter :: rounding = 1.0e-6_wp         !! of equals the first is taken, however they are rounded

    !> A way for a joint to hold less.
    type :: move_type
        integer :: i = 0                                !! joint of the loop
        integer :: needs = 0                            !! its kind before
        integer :: kind = 0                             !! and after
        integer :: side = 0                             !! of the marker whose axes turn; 0: none do
        real(wp) :: z(3) = 0                            !! its z axis then, in its axes before
        integer :: n = 0                                !! directions that it no longer holds
        integer :: sort(6) = 0
        real(wp) :: direction(3, 6) = 0                 !! in the axes of the marker on `side`, or on the first link
    end type move_type

    !> The mechanism in one pose.
    type :: stressed_pose
        integer :: n_stride = 0                         !! from the first pose, on the way from there; 0: it is elsewhere, or the
                                                        !! first
        real(wp) :: way = 0                             !! from there, of these strides; less than 0 to the other side
        type(loop_type) :: loop
        type(rows_type) :: rows
        integer, allocatable :: first(:)                !! row of each joint; the next one's is behind its last
        real(wp), allocatable :: frame(:, :, :, :)      !! of both markers of each joint, world axes (3, 3, side, joint)
        real(wp), allocatable :: whole(:, :)            !! orthonormal (row, state of self-stress); on the way it goes on from pose
                                                        !! to pose without turning over
    end type stressed_pose

    !> What of its self-stress is left as joints let go.
    type :: left_stress
        real(wp), allocatable :: of(:, :)               !! orthonormal (row, state of self-stress)
    end type left_stress

contains

    !> Let joints go of as many directions as are redundant. Without redundancy, or if no joint can, nothing happens.
    !>
    !> **Errors**: `status_bad_input` if the joints' stiffness does not decide how they share, or phases of gears contradict
    !> each other.
    subroutine release_joints(model, gears_first, is_released, status)
        type(model_type), intent(inout) :: model
        logical, intent(in) :: gears_first              !! no joint lets go where a gear can; else the other way round
        logical, intent(out) :: is_released
        type(status_type), intent(inout) :: status
        type(stressed_pose), allocatable :: pose(:)
        type(move_type), allocatable :: move(:), best(:)
        integer, allocatable :: sure(:)
        logical, allocatable :: is_redundant(:)
        integer :: i
        integer :: lent                                 ! of the lock of texts

        is_released = .false.
        if (model%n_link > most_links) return
        call find_redundant_gears(model, is_redundant, status)
        if (.not. status%is_ok()) return
        model%gear%follows = is_redundant
        lent = lend_texts()
        call search()
        call take_texts_back(lent)
        if (.not. allocated(best)) return
        do i = 1, size(best)
            call make_move(model, pose(1)%loop%joint(best(i)%i), best(i))
        end do
        call note_shares(model, pose)
        model%share%may_gape = size(best) > size(sure)
        call check_arms(model, status)
        if (status%is_ok()) call check_stiffness(model, pose(1), status)
        is_released = .true.

    contains

        !> What can go, if anything is redundant. This takes long and makes no text.
        subroutine search()
            call look_at_poses(model, pose)
            if (size(pose) == 0) return
            if (size(pose(1)%whole, 2) == 0) return
            call list_moves(model, pose(1)%loop, move)
            sure = pack([(i, i=1, size(move))], lets_gear_go(move))
            call choose_on_way(pose, move, sure, gears_first, best)
        end subroutine search

        !> Is it that of a gear whose sum follows from those of the others?
        elemental logical function lets_gear_go(move)
            type(move_type), intent(in) :: move

            lets_gear_go = is_geared(move%needs)
            if (lets_gear_go) lets_gear_go = is_redundant(model%joint(pose(1)%loop%joint(move%i))%gear)
        end function lets_gear_go
    end subroutine release_joints

    !> Does a mechanism that stands as another one does, link by link, let go of what that has let go of? What joints hold follows
    !> from where they are; of stiffness and gears more is asked.
    pure logical function is_released_alike(model, like) result(is_alike)
        type(model_type), intent(in) :: model, like

        is_alike = like%share%n > 0 .and. model%scene%redundancy /= share_by_stiffness .and. size(model%gear) == 0
    end function is_released_alike

    !> Let go of the same.
    subroutine release_alike(like, model)
        type(model_type), intent(in) :: like
        type(model_type), intent(inout) :: model
        integer :: j

        do j = 1, model%n_joint
            if (like%joint(j)%kind == like%joint(j)%told_kind) cycle
            model%joint(j)%kind = like%joint(j)%kind
            model%joint(j)%frame = like%joint(j)%frame
        end do
        model%share = like%share
    end subroutine release_alike

    !> A beam ends at one joint: what two do to one end bends it together, and of joints that share nothing it is not asked.
    subroutine check_arms(model, status)
        type(model_type), intent(in) :: model
        type(status_type), intent(inout) :: status
        integer :: a, b

        do a = 1, size(model%arm)
            do b = 1, a - 1
                if (.not. end_together(model%arm(b), model%arm(a))) cycle
                associate (first => model%arm(b)%joint, second => model%arm(a)%joint, scene => model%scene)
                    if (.not. any(model%share%joint == first .or. model%share%joint == second)) cycle
                    call fail(status, status_bad_input, "redundancy = 'stiffness': link " &
                              //quoted(scene%link(scene%joint(second)%link(model%arm(a)%side))%name) &
                              //" is 'elastic', and joints "//quoted(scene%joint(first)%name)//" and " &
                              //quoted(scene%joint(second)%name)//" hold it at one marker (expected a marker for each, with a " &
                              //"beam of its own, or for both a massless link that a fixed joint welds there)")
                end associate
                return
            end do
        end do

    contains

        pure logical function end_together(one, other)
            type(arm_type), intent(in) :: one, other

            associate (a => model%scene%joint(one%joint), b => model%scene%joint(other%joint))
                end_together = a%link(one%side) == b%link(other%side) .and. a%marker(one%side) == b%marker(other%side) &
                               .and. a%marker(one%side) > 0
            end associate
        end function end_together
    end subroutine check_arms

    !> Is there a stiffness in every state of self-stress?
    subroutine check_stiffness(model, pose, status)
        type(model_type), intent(in) :: model
        type(stressed_pose), intent(in) :: pose
        type(status_type), intent(inout) :: status
        real(wp), allocatable :: soft(:, :), left(:, :), part(:, :), bent(:, :), weight(:)
        real(wp) :: compliance(pose%rows%n)
        integer, allocatable :: arm(:), of_arm(:)
        character(len=:), allocatable :: names
        integer :: i

        compliance = compliances(model, pose%loop, pose%rows)
        soft = pose%whole*spread(sqrt(compliance), 2, size(pose%whole, 2))
        call list_arm_parts(model, pose%loop, pose%rows, part, weight, arm, of_arm)
        bent = spread(sqrt(weight), 2, size(soft, 2))*matmul(part, pose%whole)
        soft = transpose(reshape([transpose(soft), transpose(bent)], [size(soft, 2), size(soft, 1) + size(bent, 1)]))
        soft = soft/max(maxval(abs(soft)), tiny(1.0_wp))
        call find_null_space(soft, sqrt(epsilon(1.0_wp)), left)
        if (size(left, 2) == 0) return
        names = ""
        do i = 1, size(model%share%joint)
            if (i > 1) names = names//", "
            names = names//quoted(model%joint(model%share%joint(i))%name)
        end do
        call fail(status, status_bad_input, "redundancy = 'stiffness': "//to_text(size(left, 2)) &
                  //trim(merge(" way ", " ways", size(left, 2) == 1))//" to share the reactions of joints " &
                  //names//trim(merge(" bends", " bend ", size(left, 2) == 1)) &
                  //" no joint that has a 'stiffness', and no link that is 'elastic' (expected it of more of them, or " &
                  //"'minimum-norm')")
    end subroutine check_stiffness

    !> Self-stresses in poses off the start; none if the first of these cannot be closed. Some follow on the way from there, to
    !> either side: a direction along which the self-stress changes its sign would leave the mechanism singular on the way. The
    !> others are all over the place: those that close as the joints can be built, and have as much self-stress, count. Gears act in
    !> them and do not close; cams neither act nor close, so what they hold besides is not redundant.
    subroutine look_at_poses(model, pose)
        type(model_type), intent(in) :: model
        type(stressed_pose), allocatable, intent(out) :: pose(:)
        type(loop_type) :: loop
        integer, allocatable :: joint(:)
        logical :: is_closed
        integer :: p, i, n

        joint = pack([(i, i=1, model%n_joint)], model%joint(:model%n_joint)%cam == 0)
        call first_pose(model, joint, pose)
        if (size(pose) == 0) return
        if (size(pose(1)%whole, 2) == 0) return
        n = max(least_poses, min(most_poses, small/model%n_link**2))
        call add_way(model, 1, n/2, pose)
        call add_way(model, -1, n/2, pose)
        do p = 1, n - 1
            call make_loop(model, [(i, i=1, model%n_link)], joint, loop, is_closed, p)
            if (is_closed) call close_loop(model, loop, is_closed, most=few_steps)
            if (is_closed) is_closed = .not. any_turned_over(loop)
            if (is_closed) call add_pose(model, loop, pose)
        end do
    end subroutine look_at_poses

    !> A pose near the start; none if it cannot be closed. The mechanism may close in another way there, in which it moves less than
    !> its coordinates say and nothing is redundant: a platform on four legs of a hinge and two universal joints with the platform
    !> tilted. Then it is looked for nearer to the start, and all over the place.
    subroutine first_pose(model, joint, pose)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint(:)
        type(stressed_pose), allocatable, intent(out) :: pose(:)
        type(stressed_pose), allocatable :: other(:)
        type(loop_type) :: loop
        logical :: is_closed
        integer :: i, p

        call close_near_start(model, [(i, i=1, model%n_link)], joint, loop, is_closed)
        call take(pose)
        do p = 1, 2*most_poses
            if (size(pose) > 0) then
                if (moves_enough(pose(1))) return
            else if (p > 2) then
                return                                  ! nothing closes near the start
            end if
            if (p <= 2) then
                call close_near_start(model, [(i, i=1, model%n_link)], joint, loop, is_closed, nearer=0.1_wp**p)
            else
                call make_loop(model, [(i, i=1, model%n_link)], joint, loop, is_closed, p - 2)
                if (is_closed) call close_loop(model, loop, is_closed, most=few_steps)
            end if
            call take(other)
            if (size(other) == 0) cycle
            if (size(pose) == 0) then
                call move_alloc(other, pose)
            else if (moves_enough(other(1))) then
                call move_alloc(other, pose)
            end if
        end do

    contains

        subroutine take(pose)
            type(stressed_pose), allocatable, intent(out) :: pose(:)

            allocate (pose(0))
            if (is_closed) is_closed = .not. any_turned_over(loop)
            if (is_closed) call add_pose(model, loop, pose)
        end subroutine take

        !> Do the joints leave the freedoms that coordinates lead? A cam holds one that no row does.
        logical function moves_enough(here)
            type(stressed_pose), intent(in) :: here

            moves_enough = size(here%rows%row, 1) - here%rows%n + size(here%whole, 2) - (model%n_joint - size(joint)) >= model%n_q
        end function moves_enough
    end subroutine first_pose

    !> Poses on the way from the first on, each the next one's beginning.
    subroutine add_way(model, sense, n, pose)
        type(model_type), intent(in) :: model
        integer, intent(in) :: sense                    !! 1 or -1
        integer, intent(in) :: n                        !! of poses, if it goes on so far
        type(stressed_pose), allocatable, intent(inout) :: pose(:)
        type(loop_type) :: loop
        type(rows_type) :: rows
        real(wp), allocatable :: freedom(:, :), along(:)
        real(wp) :: way, long
        logical :: is_closed
        integer :: i, k

        loop = pose(1)%loop
        way = 0
        do i = 1, n
            call list_rows(model, loop, rows)
            call find_null_space(transpose(rows%row(:, :rows%n)), least_new(loop), freedom)
            if (size(freedom, 2) == 0) return
            if (i == 1) then
                along = sense*matmul(freedom, [(1 + modulo(k*golden, 1.0_wp), k=1, size(freedom, 2))])
            else
                along = matmul(freedom, matmul(along, freedom))
            end if
            if (.not. maxval(abs(along)) > 0) return
            long = merge(first_stride, stride, i == 1 .and. n > 1)
            along = along*(long/maxval(abs(along)))
            call move_bodies(loop, along)
            call close_loop(model, loop, is_closed, most=few_steps)
            if (.not. is_closed) return
            way = way + sense*long
            call add_pose(model, loop, pose, i, way)
        end do
    end subroutine add_way

    !> One more pose, if it has as much self-stress as the first.
    subroutine add_pose(model, loop, pose, n_stride, way)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        type(stressed_pose), allocatable, intent(inout) :: pose(:)
        integer, intent(in), optional :: n_stride       !! on the way
        real(wp), intent(in), optional :: way
        type(stressed_pose) :: here
        integer :: i, side

        here%loop = loop
        if (present(n_stride)) here%n_stride = n_stride
        if (present(way)) here%way = way
        call list_rows(model, here%loop, here%rows)
        call find_null_space(here%rows%row(:, :here%rows%n), least_new(here%loop), here%whole)
        if (size(pose) > 0) then
            if (size(here%whole, 2) /= size(pose(1)%whole, 2)) return
            if (present(way)) call go_on_from(pose(before(way, pose)), here%whole)
        end if
        here%first = [(1 + count(here%rows%joint(:here%rows%n) < i), i=1, size(loop%joint) + 1)]
        allocate (here%frame(3, 3, 2, size(loop%joint)))
        do i = 1, size(loop%joint)
            do side = 1, 2
                here%frame(:, :, side, i) = joint_frame(loop, i, side)
            end do
        end do
        pose = [pose, here]
    end subroutine add_pose

    !> The last of these poses if the way to it leads to the same side, else the first.
    pure integer function before(way, pose)
        real(wp), intent(in) :: way
        type(stressed_pose), intent(in) :: pose(:)

        before = merge(size(pose), 1, pose(size(pose))%way*way > 0)
    end function before

    !> States of self-stress are any that span them all: in one order and sense they go on as they were a little before.
    subroutine go_on_from(pose, whole)
        type(stressed_pose), intent(in) :: pose
        real(wp), intent(inout) :: whole(:, :)          !! (row, state)
        real(wp) :: sense, least

        call mirror_columns(matmul(transpose(whole), pose%whole), sense, least)
        if (sense < 0) whole(:, 1) = -whole(:, 1)
    end subroutine go_on_from

    !> Householder's mirrors, column by column: how much of each there is beside those before it, and the determinant's sign.
    subroutine mirror_columns(matrix, sense, least)
        real(wp), intent(in) :: matrix(:, :)
        real(wp), intent(out) :: sense                  !! 1 or -1, or 0
        real(wp), intent(out) :: least
        real(wp) :: a(size(matrix, 1), size(matrix, 2)), normal(size(matrix, 1)), long
        integer :: k, i

        a = matrix
        sense = 1
        least = huge(least)
        do k = 1, size(a, 2)
            normal(k:) = a(k:, k)
            long = norm2(normal(k:))
            least = min(least, long)
            if (.not. long > 0) then
                sense = 0
                return
            end if
            if (normal(k) < 0) sense = -sense
            normal(k) = normal(k) + sign(long, normal(k))
            do i = k + 1, size(a, 2)
                a(k:, i) = a(k:, i) - normal(k:)*(2*dot_product(normal(k:), a(k:, i))/dot_product(normal(k:), normal(k:)))
            end do
        end do
    end subroutine mirror_columns

    ! ---------------------------------------------------------------- moves

    !> All ways for joints to hold less. Joints whose variables are coordinates stay as they are.
    subroutine list_moves(model, loop, move)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        type(move_type), allocatable, intent(out) :: move(:)
        real(wp), parameter :: x(3) = [1, 0, 0], y(3) = [0, 1, 0], z(3) = [0, 0, 1], none(3, 0) = 0
        real(wp), parameter :: xy(3, 2) = reshape([x, y], [3, 2]), xyz(3, 3) = reshape([x, y, z], [3, 3])
        integer :: i, j

        allocate (move(0))
        do i = 1, size(loop%joint)
            j = loop%joint(i)
            if (model%joint(j)%kind /= model%joint(j)%told_kind .or. is_in_use(model, j)) cycle
            select case (model%joint(j)%kind)
            case (joint_revolute)
                call free_hinge()
            case (joint_prismatic)
                call free_slide()
            case (joint_screw)
                call add(joint_screw, joint_thread, xy, xy)
            case (joint_cylindrical)
                call add(joint_cylindrical, joint_groove, none, xy)
                call add(joint_cylindrical, joint_loose, xy, xy)
                call add(joint_groove, joint_loose, xy, none)
                call add_lines_of_groove()
            case (joint_planar)
                call add(joint_planar, joint_plate, none, xy)
                call add(joint_planar, joint_loose, reshape(z, [3, 1]), xy)
                call add(joint_plate, joint_loose, reshape(z, [3, 1]), none)
            case (joint_universal)
                call free_cross()
            case (joint_spherical)
                call free_ball()
            case (joint_fixed)
                call free_weld()
            case (joint_gear, joint_rack, joint_belt)
                call add(model%joint(j)%kind, joint_loose, reshape(z, [3, 1]), none)    ! the one force of its teeth
            end select
        end do

    contains

        subroutine free_hinge()
            if (model%is_planar) then
                call add_lines()
                call add(joint_revolute, joint_loose, xy, none)
                return
            end if
            call add(joint_revolute, joint_cylindrical, reshape(z, [3, 1]), none)
            call add_forks()
            call add(joint_revolute, joint_spherical, none, xy)
            call add(joint_revolute, joint_groove, reshape(z, [3, 1]), xy)
            call add(joint_revolute, joint_plate, xy, xy)
            call add(joint_revolute, joint_loose, xyz, xy)
            call add(joint_cylindrical, joint_groove, none, xy)
            call add(joint_spherical, joint_groove, reshape(z, [3, 1]), none)
            call add(joint_groove, joint_loose, xy, none)
            call add_lines()
            call add_lines_of_groove()
        end subroutine free_hinge

        subroutine free_slide()
            if (model%is_planar) then
                call add(joint_prismatic, joint_plate, none, reshape(y, [3, 1]), 1, x)
                call add(joint_prismatic, joint_loose, reshape(x, [3, 1]), reshape(y, [3, 1]))
                return
            end if
            call add(joint_prismatic, joint_cylindrical, none, reshape(z, [3, 1]))
            call add(joint_prismatic, joint_groove, none, xyz)
            call add(joint_prismatic, joint_loose, xy, xyz)
            call add(joint_prismatic, joint_key, xy, xy)
            call add(joint_cylindrical, joint_groove, none, xy)
            call add(joint_groove, joint_loose, xy, none)
            call add_lines()
            call add_lines_of_groove()
        end subroutine free_slide

        !> The one moment of a universal joint, across both its axes; then a force: rods side by side under one platform.
        subroutine free_cross()
            call add(joint_universal, joint_spherical, none, reshape(z, [3, 1]))
            call add(joint_spherical, joint_groove, reshape(x, [3, 1]), none, 1, x)
            call add(joint_spherical, joint_groove, reshape(y, [3, 1]), none, 1, y)
            call add(joint_spherical, joint_groove, reshape(z, [3, 1]), none)
        end subroutine free_cross

        subroutine free_ball()
            call add(joint_spherical, joint_groove, reshape(z, [3, 1]), none)
            call add(joint_spherical, joint_plate, xy, none)
            call add(joint_spherical, joint_plate, reshape([y, z], [3, 2]), none, 1, x)
            call add(joint_spherical, joint_plate, reshape([x, z], [3, 2]), none, 1, y)
            call add(joint_spherical, joint_loose, xyz, none)
        end subroutine free_ball

        subroutine free_weld()
            if (model%is_planar) then
                call add(joint_fixed, joint_loose, xy, reshape(z, [3, 1]))
            else
                call add(joint_fixed, joint_revolute, none, reshape(z, [3, 1]))
                call add(joint_fixed, joint_spherical, none, xyz)
                call add(joint_fixed, joint_loose, xyz, xyz)
            end if
        end subroutine free_weld

        !> Add a kind of joint that lets go of forces and moments along these axes of the first marker.
        subroutine add(needs, kind, force, moment, side, axis)
            integer, intent(in) :: needs, kind
            real(wp), intent(in) :: force(:, :), moment(:, :)
            integer, intent(in), optional :: side
            real(wp), intent(in), optional :: axis(3)
            type(move_type) :: one

            one%i = i
            one%needs = needs
            one%kind = kind
            if (present(side)) one%side = side
            if (present(axis)) one%z = axis
            one%n = size(force, 2) + size(moment, 2)
            one%sort(:one%n) = of_moment
            one%sort(:size(force, 2)) = of_force
            one%direction(:, :size(force, 2)) = force
            one%direction(:, size(force, 2) + 1:one%n) = moment
            move = [move, one]
        end subroutine add

        !> A hinge becomes a universal joint, free about an axis across its own that one of its links carries.
        subroutine add_forks()
            real(wp) :: axis(3)
            integer :: side, k

            do side = 1, 2
                do k = 0, n_angle - 1
                    axis = cos(k*pi/n_angle)*x + sin(k*pi/n_angle)*y
                    call add(joint_revolute, joint_universal, none, reshape(axis, [3, 1]), side, axis)
                end do
            end do
        end subroutine add_forks

        !> A pin goes into a slot of the first link; in space it may shift along itself and tilt there, too. Of a slide a point
        !> stays in a plane.
        subroutine add_lines()
            real(wp) :: along(3)
            integer :: k

            do k = 0, n_angle - 1
                along = line(k)
                if (model%is_planar) then
                    call add(joint_revolute, joint_plate, reshape(along, [3, 1]), none, 1, square_to(along))
                else if (model%joint(j)%kind == joint_prismatic) then
                    call add(joint_prismatic, joint_plate, reshape(along, [3, 1]), xyz, 1, square_to(along))
                else
                    call add(joint_revolute, joint_plate, reshape([along, z], [3, 2]), xy, 1, square_to(along))
                end if
            end do
        end subroutine add_lines

        !> What has become a point in a groove becomes one in a plane.
        subroutine add_lines_of_groove()
            integer :: k

            do k = 0, n_angle - 1
                call add(joint_groove, joint_plate, reshape(line(k), [3, 1]), none, 1, square_to(line(k)))
            end do
        end subroutine add_lines_of_groove

        !> Across the joint's axis.
        pure function line(k) result(along)
            integer, intent(in) :: k
            real(wp) :: along(3)

            along = cos(k*pi/n_angle)*x + sin(k*pi/n_angle)*y
        end function line

        pure function square_to(along) result(across)
            real(wp), intent(in) :: along(3)
            real(wp) :: across(3)

            across = [-along(2), along(1), 0.0_wp]
        end function square_to
    end subroutine list_moves

    !> Does a coordinate, a branch or a gear refer to the joint?
    pure logical function is_in_use(model, j)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        integer :: g

        associate (scene => model%scene)
            is_in_use = any(scene%coordinate%kind == coordinate_joint .and. scene%coordinate%joint == j) &
                        .or. scene%joint(j)%branch /= 0
        end associate
        if (joint_n_variable(model%joint(j)%told_kind) /= 1) return
        do g = 1, size(model%gear)
            is_in_use = is_in_use .or. model%gear(g)%weight(model%joint(j)%first_variable + 1) /= 0
        end do
    end function is_in_use

    !> Is a move one to begin with? Of those of a joint that lead to the same kind, the first; the others follow from it.
    pure logical function begins(pose, move, k)
        type(stressed_pose), intent(in) :: pose
        type(move_type), intent(in) :: move(:)
        integer, intent(in) :: k

        begins = pose%loop%kind(move(k)%i) == move(k)%needs .and. &
                 .not. any(move(:k - 1)%i == move(k)%i .and. move(:k - 1)%kind == move(k)%kind &
                            .and. move(:k - 1)%needs == move(k)%needs)
    end function begins

    !> What can go as far on the way as possible without a singular pose. Where anything that could go has one near the start, as
    !> in a train that turns on and on, the way does not count. Nor do those poses all over the place that are the mechanism's own
    !> singular ones, where nothing can go: a spherical four-bar whose points are all one has three axes besides its coordinate's
    !> along which forces can go; where these lie in a plane, at a dead point, they do not span the space, and no other choice would
    !> be better there. Several that are nearly so may leave nothing that can go in all of them: then none of them counts.
    subroutine choose_on_way(pose, move, sure, gears_first, best)
        type(stressed_pose), intent(in) :: pose(:)
        type(move_type), intent(in) :: move(:)
        integer, intent(in) :: sure(:)                  !! moves that are taken in any case
        logical, intent(in) :: gears_first
        type(move_type), allocatable, intent(out) :: best(:)
        type(stressed_pose), allocatable :: near(:)
        logical :: counts(size(pose))
        integer :: p

        counts = .true.
        call go_as_far_as_possible()
        if (allocated(best)) return
        do p = 2, size(pose)
            if (pose(p)%n_stride > 0) cycle
            call choose_release(pose(p:p), move, sure, gears_first, best)
            counts(p) = allocated(best)
        end do
        call go_as_far_as_possible()
        if (allocated(best)) return
        counts(2:) = pose(2:)%n_stride > 0
        call go_as_far_as_possible()

    contains

        subroutine go_as_far_as_possible()
            integer :: way
            logical :: is_clear

            way = maxval(pose%n_stride)
            do
                call take_near(way)
                call choose_release(near, move, sure, gears_first, best, is_clear)
                if (way == 0 .or. is_clear) return
                way = way/2
            end do
        end subroutine go_as_far_as_possible

        !> One by one: gfortran 12 never frees what components of pose([..]) hold.
        subroutine take_near(way)
            integer, intent(in) :: way
            logical :: is_near(size(pose))
            integer :: p, n

            is_near = counts .and. pose%n_stride <= way
            if (allocated(near)) deallocate (near)
            allocate (near(count(is_near)))
            n = 0
            do p = 1, size(pose)
                if (.not. is_near(p)) cycle
                n = n + 1
                near(n) = pose(p)
            end do
        end subroutine take_near
    end subroutine choose_on_way

    !> The best of all beginnings, of those that leave no singular pose on the way if there are such; nothing if none of them leaves
    !> the joints enough in every pose.
    subroutine choose_release(pose, move, sure, gears_first, best, is_clear)
        type(stressed_pose), intent(in) :: pose(:)
        type(move_type), intent(in) :: move(:)
        integer, intent(in) :: sure(:)                  !! moves that are taken in any case
        logical, intent(in) :: gears_first
        type(move_type), allocatable, intent(out) :: best(:)
        logical, intent(out), optional :: is_clear      !! there is one, and none of its poses on the way is singular
        type(move_type), allocatable :: taken(:)
        real(wp) :: score, highest
        logical :: keeps_clear, best_is_clear
        integer :: i, first

        highest = acts
        best_is_clear = .false.
        ! of many moves only the best is one to begin with
        first = merge(0, 1, size(move)*size(pose(1)%whole, 2) > many_moves .or. gears_first)
        do i = first, merge(0, size(move), first == 0)
            if (i > 0) then
                if (.not. begins(pose(1), move, i) .or. any(sure == i)) cycle
            end if
            call choose_moves(pose, move, sure, i, gears_first, taken, score)
            if (score <= merge(highest*(1 + rounding), acts, best_is_clear .or. .not. allocated(best))) cycle
            keeps_clear = .not. leaps_over(pose, taken)
            if (.not. keeps_clear .and. (best_is_clear .or. score <= highest*(1 + rounding))) cycle
            highest = score
            best = taken
            best_is_clear = keeps_clear
        end do
        if (present(is_clear)) is_clear = best_is_clear
    end subroutine choose_release

    !> Is the mechanism, with joints that let go, singular between two poses on the way? There the determinant of all these
    !> directions' parts of the self-stress changes its sign, or touches zero: what is left at both ends is no more than what a
    !> stride may change.
    logical function leaps_over(pose, taken)
        type(stressed_pose), intent(in) :: pose(:)
        type(move_type), intent(in) :: taken(:)
        real(wp) :: sense(size(pose)), least(size(pose))
        integer :: p, from

        leaps_over = .false.
        do p = 1, size(pose)
            if (p > 1 .and. pose(p)%n_stride == 0) cycle
            call mirror_columns(parts_of(pose(p), taken), sense(p), least(p))
            if (p == 1) cycle
            from = before(pose(p)%way, pose(:p - 1))
            leaps_over = sense(p)*sense(from) <= 0 .or. least(p) + least(from) < abs(pose(p)%way - pose(from)%way)
            if (leaps_over) return
        end do
    end function leaps_over

    !> What each state of self-stress has along all directions that go (state, direction).
    function parts_of(pose, taken) result(part)
        type(stressed_pose), intent(in) :: pose
        type(move_type), intent(in) :: taken(:)
        real(wp) :: part(size(pose%whole, 2), sum(taken%n))
        integer :: i, n

        n = 0
        do i = 1, size(taken)
            part(:, n + 1:n + taken(i)%n) = transpose(action_of(pose, pose%whole, taken(i)))
            n = n + taken(i)%n
        end do
    end function parts_of

    !> As many moves as there are states of self-stress: the sure ones, then to one kind at one joint, then the best that are left.
    subroutine choose_moves(pose, move, sure, first, gears_first, taken, score)
        type(stressed_pose), intent(in) :: pose(:)
        type(move_type), intent(in) :: move(:)
        integer, intent(in) :: sure(:)                  !! moves that are taken in any case
        integer, intent(in) :: first                    !! move with which to begin, or another of the joint to the same kind; 0:
                                                        !! any
        logical, intent(in) :: gears_first
        type(move_type), allocatable, intent(out) :: taken(:)
        real(wp), intent(out) :: score                  !! of the worst of them
        type(left_stress) :: left(size(pose))
        integer :: kind(size(pose(1)%loop%kind)), k, i, p
        real(wp) :: one_score

        do p = 1, size(pose)
            left(p)%of = pose(p)%whole
        end do
        kind = pose(1)%loop%kind
        do i = 1, size(sure)
            call take_away(pose, move(sure(i)), left)
            kind(move(sure(i))%i) = move(sure(i))%kind
        end do
        taken = move(sure)
        score = 1
        do while (size(left(1)%of, 2) > 0)
            call find_best(pose, left, move, kind, merge(first, 0, size(taken) == size(sure)), gears_first, k, one_score)
            score = min(score, one_score)
            if (score < acts) return
            call take_away(pose, move(k), left)
            kind(move(k)%i) = move(k)%kind
            taken = [taken, move(k)]
        end do
    end subroutine choose_moves

    !> The move along whose direction most of what is left of the self-stress acts, at the worst of the poses.
    subroutine find_best(pose, left, move, kind, like, gears_first, best, score)
        type(stressed_pose), intent(in) :: pose(:)
        type(left_stress), intent(in) :: left(:)        !! (pose)
        type(move_type), intent(in) :: move(:)
        integer, intent(in) :: kind(:)                  !! of the joints by now
        integer, intent(in) :: like                     !! only moves like this one; 0: any
        logical, intent(in) :: gears_first
        integer, intent(out) :: best
        real(wp), intent(out) :: score
        real(wp) :: strength(size(move)), most
        integer :: k, p

        strength = 0
        do k = 1, size(move)
            if (kind(move(k)%i) /= move(k)%needs) cycle
            if (like > 0) then
                if (move(k)%i /= move(like)%i .or. move(k)%kind /= move(like)%kind) cycle
            end if
            strength(k) = 1
            do p = 1, size(pose)
                strength(k) = min(strength(k), strength_of(pose(p), left(p)%of, move(k)))
                if (strength(k) < acts) exit
            end do
        end do
        if (any((is_geared(move%needs) .eqv. gears_first) .and. strength > acts)) &
            strength = merge(strength, 0.0_wp, is_geared(move%needs) .eqv. gears_first)
        ! what lets more go leaves less to find, and less to compute
        best = 0
        score = 0
        most = maxval(strength)
        if (most < acts) return
        do k = 1, size(move)
            if (strength(k) < nearly*most) cycle
            if (best > 0) then
                if (move(k)%n < move(best)%n .or. &
                    (move(k)%n == move(best)%n .and. strength(k) <= strength(best)*(1 + rounding))) cycle
            end if
            best = k
            score = strength(k)
        end do
    end subroutine find_best

    !> What each state of self-stress left has along the directions that go (direction, state).
    function action_of(pose, left, move) result(action)
        type(stressed_pose), intent(in) :: pose
        real(wp), intent(in) :: left(:, :)              !! (row, state)
        type(move_type), intent(in) :: move
        real(wp) :: action(move%n, size(left, 2))
        real(wp) :: direction(3, move%n)
        integer :: n, k

        action = 0
        if (is_geared(move%needs)) then
            action(1, :) = left(pose%first(move%i), :)
            return
        end if
        if (move%needs == joint_universal) then        ! its one moment is along no axis of either link
            do n = pose%first(move%i), pose%first(move%i + 1) - 1
                if (pose%rows%sort(n) == of_moment) action(1, :) = action(1, :) + left(n, :)
            end do
            return
        end if
        do k = 1, move%n
            direction(:, k) = matmul(pose%frame(:, :, max(move%side, 1), move%i), move%direction(:, k))
        end do
        do n = pose%first(move%i), pose%first(move%i + 1) - 1
            do k = 1, move%n
                if (pose%rows%sort(n) == move%sort(k)) action(k, :) = action(k, :) &
                    + dot_product(direction(:, k), pose%rows%axis(:, n))*left(n, :)
            end do
        end do
    end function action_of

    !> How surely a move takes as many states of self-stress away as it lets directions go: the least singular value, or less.
    function strength_of(pose, left, move) result(strength)
        type(stressed_pose), intent(in) :: pose
        real(wp), intent(in) :: left(:, :)              !! (row, state)
        type(move_type), intent(in) :: move
        real(wp) :: strength
        real(wp) :: action(move%n, size(left, 2))
        integer :: k, i

        strength = 0
        if (move%n > size(left, 2)) return
        action = action_of(pose, left, move)
        strength = 1
        ! Gram and Schmidt: what is left of each direction beside those before it
        do k = 1, move%n
            strength = min(strength, norm2(action(k, :)))
            if (strength < acts) return
            action(k, :) = action(k, :)/norm2(action(k, :))
            do i = k + 1, move%n
                action(i, :) = action(i, :) - dot_product(action(k, :), action(i, :))*action(k, :)
            end do
        end do
    end function strength_of

    !> Keep the states of self-stress that do not act along the directions that go.
    subroutine take_away(pose, move, left)
        type(stressed_pose), intent(in) :: pose(:)
        type(move_type), intent(in) :: move
        type(left_stress), intent(inout) :: left(:)     !! (pose)
        real(wp), allocatable :: action(:, :), kept(:, :)
        integer :: p

        do p = 1, size(pose)
            action = action_of(pose(p), left(p)%of, move)
            call find_null_space(action, 0.0_wp, kept)
            left(p)%of = matmul(left(p)%of, kept)
        end do
    end subroutine take_away

    !> The joint's new kind and frames.
    subroutine make_move(model, j, move)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: j
        type(move_type), intent(in) :: move

        associate (joint => model%joint(j))
            joint%kind = move%kind
            joint%frame = joint%told_frame
            if (move%side > 0) call turn_axis(move%side, move%z)
            if (move%kind == joint_key) then           ! about z neither x nor y turns
                call turn_axis(1, [1.0_wp, 0.0_wp, 0.0_wp])
                call turn_axis(2, [0.0_wp, 1.0_wp, 0.0_wp])
            end if
        end associate

    contains

        !> The marker's z axis goes where this one was, across it.
        subroutine turn_axis(side, axis)
            integer, intent(in) :: side
            real(wp), intent(in) :: axis(3)            !! in the marker's own axes
            real(wp) :: z(3)

            associate (joint => model%joint(j))
                z = matmul(joint%told_frame(:, :, side), axis)
                joint%frame(:, 1, side) = cross(joint%told_frame(:, 3, side), z)
                joint%frame(:, 2, side) = joint%told_frame(:, 3, side)
                joint%frame(:, 3, side) = z
            end associate
        end subroutine turn_axis
    end subroutine make_move

    ! ---------------------------------------------------------------- what is shared

    !> What a unit of each reaction gives way, up to a common factor: forces are in newtons, moments over the mechanism's size.
    function compliances(model, loop, rows) result(c)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        type(rows_type), intent(in) :: rows
        real(wp) :: c(rows%n)
        real(wp) :: stiffness
        integer :: i

        c = 1
        if (model%scene%redundancy /= share_by_stiffness) return
        do i = 1, rows%n
            ! radial, axial; tilt, torsion
            stiffness = model%scene%joint(loop%joint(rows%joint(i)))%stiffness(2*(rows%sort(i) - of_force) + rows%direction(i))
            c(i) = 0
            if (stiffness > 0) c(i) = merge(1.0_wp, loop%size**2, rows%sort(i) == of_force)/stiffness
        end do
    end function compliances

    !> The joints whose reactions the equations do not determine, and the links between them.
    subroutine note_shares(model, pose)
        type(model_type), intent(inout) :: model
        type(stressed_pose), intent(in) :: pose(:)
        logical :: is_stressed(2, model%n_joint), is_between(model%n_link)
        integer :: p, i, j, side

        is_stressed = .false.
        do p = 1, size(pose)
            do i = 1, pose(p)%rows%n
                j = pose(p)%loop%joint(pose(p)%rows%joint(i))
                if (maxval(abs(pose(p)%whole(i, :))) <= least_new(pose(p)%loop)) cycle
                is_stressed(pose(p)%rows%sort(i), j) = .true.
                if (is_geared(model%joint(j)%told_kind)) is_stressed(:, j) = acts_of(model%gear(model%joint(j)%gear))
            end do
        end do
        is_between = .false.
        do j = 1, model%n_joint
            if (.not. any(is_stressed(:, j))) cycle
            do side = 1, 2
                if (model%joint(j)%link(side) > 0) is_between(model%joint(j)%link(side)) = .true.
            end do
            if (.not. is_geared(model%joint(j)%told_kind)) cycle
            side = model%gear(model%joint(j)%gear)%carrier
            if (side > 0) is_between(side) = .true.    ! its attitude is that of the teeth's force
        end do
        model%share%n = size(pose(1)%whole, 2)
        model%share%joint = pack([(j, j=1, model%n_joint)], any(is_stressed, dim=1))
        model%share%link = pack([(i, i=1, model%n_link)], is_between)
        model%share%of_force = is_stressed(of_force, model%share%joint)
        model%share%of_moment = is_stressed(of_moment, model%share%joint)
        call note_directions(model, pose)
        call plan_stress(model, pose)

    contains

        !> Has the reaction of a gear a force, and a moment about the second marker?
        pure function acts_of(gear) result(acts)
            type(gear_type), intent(in) :: gear
            logical :: acts(2)

            acts(of_force) = any(gear%direction /= 0)
            acts(of_moment) = any(gear%couple(:, 2) /= 0)
        end function acts_of
    end subroutine note_shares

    !> Along what the force and the moment of each of these joints are open. Many poses tell what stays so; one that cannot be left
    !> tells of itself alone.
    subroutine note_directions(model, pose)
        type(model_type), intent(inout) :: model
        type(stressed_pose), intent(in) :: pose(:)
        integer, parameter :: several = 3               ! poses
        real(wp) :: stress(6, model%share%n, size(pose)), frame(3, 3, size(pose))
        real(wp) :: rotation(3, 3, 0:model%n_link, size(pose)), nothing
        integer :: i, k, p, sort

        nothing = 0
        do p = 1, size(pose)
            rotation(:, :, :, p) = pose(p)%loop%rotation
            nothing = max(nothing, least_new(pose(p)%loop))
        end do
        allocate (model%share%part(2, size(model%share%joint)))
        do i = 1, size(model%share%joint)
            k = findloc(pose(1)%loop%joint, model%share%joint(i), dim=1)
            do p = 1, size(pose)
                associate (rows => pose(p)%first(k), next => pose(p)%first(k + 1) - 1)
                    stress(:, :, p) = matmul(pose(p)%rows%wrench(:, rows:next), pose(p)%whole(rows:next, :))
                end associate
                frame(:, :, p) = pose(p)%frame(:, :, 1, k)
            end do
            do sort = of_force, of_moment
                if (size(pose) < several .and. model%n_q > 0) then
                    model%share%part(sort, i) = whole_part(model%is_planar, sort == of_moment)
                else
                    model%share%part(sort, i) = open_part_of(stress(3*sort - 2:3*sort, :, :), frame, rotation, &
                                                             model%joint(model%share%joint(i))%link, nothing)
                end if
            end do
        end do
    end subroutine note_directions

    !> How the states of self-stress are found of a pose: from the rows of the joints that share, in the equations of their links.
    subroutine plan_stress(model, pose)
        type(model_type), intent(inout) :: model
        type(stressed_pose), intent(in) :: pose(:)
        real(wp), allocatable :: sample(:, :, :)         ! (equation, unknown, pose)
        logical, allocatable :: pattern(:, :)
        integer, allocatable :: equation(:), unknown(:), joint(:)
        integer :: n, i, k, p

        n = size(pose(1)%loop%column)
        equation = [((n*(model%share%link(i) - 1) + k, k=1, n), i=1, size(model%share%link))]
        joint = pose(1)%loop%joint(pose(1)%rows%joint(:pose(1)%rows%n))
        unknown = pack([(i, i=1, size(joint))], [(any(model%share%joint == joint(i)), i=1, size(joint))])
        allocate (sample(size(equation), size(unknown), size(pose)), pattern(size(equation), size(unknown)))
        do p = 1, size(pose)
            sample(:, :, p) = pose(p)%rows%row(equation, unknown)
        end do
        do i = 1, size(unknown)
            associate (link => model%joint(joint(unknown(i)))%link)
                pattern(:, i) = [((any(link == model%share%link(k)), p=1, n), k=1, size(model%share%link))]
            end associate
        end do
        call plan_null_space(sample, pattern, model%share%n, model%share%stress)
    end subroutine plan_stress
end module linkdyn_release
