!> A coordinate that the joints hold fast, or make follow others: four parallel hinges in a loop of seven let none of the three
!> others turn.
!>
!> Counting takes such a mechanism for one that its coordinates lead, and with them given no start ever closes. Here the joints
!> alone are closed, without coordinates (`linkdyn_constraint_rows`), and it is asked how the motions that they leave move each.
module linkdyn_locked_coordinate
    use linkdyn_constraint_rows, only: loop_type, rows_type, close_near_start, list_rows, least_new
    use linkdyn_cross, only: cross
    use linkdyn_joint_table, only: variable_axis, is_slide
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, joint_type
    use linkdyn_null_space, only: find_null_space
    use linkdyn_redundancy, only: most_links
    use linkdyn_scene, only: coordinate_joint, coordinate_spec, joint_universal, joint_spherical, pose_attitude
    implicit none (type, external)
    private
    public :: find_locked

    real(wp), parameter :: out_of_plane(3) = [0, 0, 1]

contains

    !> The first coordinate that cannot move by itself; 0: none is known to be so.
    subroutine find_locked(model, locked, follows)
        type(model_type), intent(in) :: model
        integer, intent(out) :: locked
        logical, intent(out) :: follows                 !! it moves as those before it do
        type(loop_type) :: loop
        type(rows_type) :: rows
        real(wp), allocatable :: motion(:, :)           !! that the joints leave (columns of the loop, motion)
        real(wp), allocatable :: own(:), basis(:, :)
        logical :: is_closed
        integer :: i, pass

        locked = 0
        follows = .false.
        if (model%n_link > most_links) return
        call close_near_start(model, [(i, i=1, model%n_link)], [(i, i=1, model%n_joint)], loop, is_closed)
        if (.not. is_closed) return
        call list_rows(model, loop, rows)
        call find_null_space(transpose(rows%row(:, :rows%n)), least_new(loop), motion)
        allocate (basis(size(motion, 2), model%n_q))
        do i = 1, model%n_q
            own = rates(model, model%scene%coordinate(i), loop, motion)
            follows = norm2(own) > least_new(loop)
            if (follows) own = own/norm2(own)
            do pass = 1, 2
                own = own - matmul(basis(:, :i - 1), matmul(transpose(basis(:, :i - 1)), own))
            end do
            if (norm2(own) <= least_new(loop)) locked = i
            if (locked > 0) return
            basis(:, i) = own/norm2(own)
        end do
        follows = .false.
    end subroutine find_locked

    !> How fast a coordinate moves in each motion; of a whole pose, angular velocities along the frame's axes stand for its angles.
    pure function rates(model, coordinate, loop, motion) result(rate)
        type(model_type), intent(in) :: model
        type(coordinate_spec), intent(in) :: coordinate
        type(loop_type), intent(in) :: loop
        real(wp), intent(in) :: motion(:, :)
        real(wp) :: rate(size(motion, 2)), six(6)
        integer :: k

        do k = 1, size(motion, 2)
            if (coordinate%kind == coordinate_joint) then
                rate(k) = variable_rate(model, model%joint(coordinate%joint), coordinate%variable, loop, motion(:, k))
            else
                six = twist_at(loop, coordinate%link, loop%position(:, coordinate%link), motion(:, k))
                rate(k) = six(coordinate%variable)
            end if
        end do
    end function rates

    !> Rate of a joint variable, or of a part of a pose, from the velocity of the second marker as the first link sees it.
    pure real(wp) function variable_rate(model, joint, variable, loop, motion) result(rate)
        type(model_type), intent(in) :: model
        type(joint_type), intent(in) :: joint
        integer, intent(in) :: variable
        type(loop_type), intent(in) :: loop
        real(wp), intent(in) :: motion(:)
        real(wp) :: frame(3, 3, 2), place(3), twist(6), axis(3, 3)
        integer :: side

        do side = 1, 2
            frame(:, :, side) = matmul(loop%rotation(:, :, joint%link(side)), joint%frame(:, :, side))
        end do
        associate (first => joint%link(1), second => joint%link(2))
            place = loop%position(:, second) + matmul(loop%rotation(:, :, second), joint%point(:, 2)/loop%size)
            twist = twist_at(loop, second, place, motion) - twist_at(loop, first, place, motion)
        end associate
        if (is_slide(joint%kind, variable)) then
            rate = dot_product(frame(:, variable_axis(variable, joint%kind), 1), twist(:3))
        else if (model%is_planar) then
            rate = dot_product(out_of_plane, twist(4:))
        else if (joint%kind == joint_spherical .or. joint%kind == pose_attitude) then
            ! about the first marker's x, the second's z, and what is square to both
            axis(:, 1) = frame(:, 1, 1)
            axis(:, 3) = frame(:, 3, 2)
            axis(:, 2) = cross(axis(:, 3), axis(:, 1))
            rate = share_of(axis, variable, twist(4:))
        else
            side = merge(2, 1, joint%kind == joint_universal .and. variable == 2)
            rate = dot_product(frame(:, 3, side), twist(4:))
        end if
    end function variable_rate

    !> How much of a vector goes along one of three axes, the rest along the two others.
    pure real(wp) function share_of(axis, k, vector) result(share)
        real(wp), intent(in) :: axis(3, 3), vector(3)
        integer, intent(in) :: k
        real(wp) :: across(3)

        across = cross(axis(:, modulo(k, 3) + 1), axis(:, modulo(k + 1, 3) + 1))
        share = dot_product(across, vector)/dot_product(across, axis(:, k))
    end function share_of

    !> Velocity of the point of a body that is at a place, and the body's angular velocity.
    pure function twist_at(loop, body, place, motion) result(twist)
        type(loop_type), intent(in) :: loop
        integer, intent(in) :: body
        real(wp), intent(in) :: place(3), motion(:)
        real(wp) :: twist(6)
        integer :: n

        twist = 0
        if (body == 0) return
        n = size(loop%column)
        twist(loop%column) = motion(n*(body - 1) + 1:n*body)
        twist(:3) = twist(:3) + cross(twist(4:), place - loop%position(:, body))
    end function twist_at
end module linkdyn_locked_coordinate
