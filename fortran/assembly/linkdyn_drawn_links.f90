!> Links of a group that stand to links placed before as their starting positions do.
!>
!> A link that is placed has moved from its starting position to where the coordinates hold it at the start. What hangs on it by a
!> joint moves along, through threads first: a nut left behind would be on another turn, and Newton's method, which knows of turns
!> only which is the nearest, would keep it there.
module linkdyn_drawn_links
    use linkdyn_angles, only: matrix_of_angles
    use linkdyn_joint_table, only: is_threaded, is_pose_part
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, group_type, orientation_of
    use linkdyn_quaternion, only: quaternion_of_rotation
    use linkdyn_scene, only: frame_link
    use linkdyn_vec3, only: mat3, vec3_of, lane_of, mat3_lane
    implicit none (type, external)
    private
    public :: hang_as_drawn

    !> How a link has moved from its starting position: x there is now `shift` + `turn` x.
    type :: moved_type
        real(wp) :: turn(3, 3) = 0, shift(3) = 0
    end type moved_type

contains

    !> Links of a group on a lane. Those without a starting position, and what hangs on them alone, stay where they are.
    subroutine hang_as_drawn(model, group, lane, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: lane
        type(kinematic_state), intent(inout) :: state      !! the steps before have been run
        type(moved_type) :: moved(0:model%n_link)
        logical :: is_there(0:model%n_link)                ! stands as it should; it has a starting position
        integer :: j, l

        is_there = [.true., model%scene%link(:model%n_link)%has_start]
        is_there(group%link) = .false.
        do l = 0, model%n_link
            if (is_there(l)) moved(l) = motion_of_placed(model, l, lane, state)
        end do
        do
            j = next_joint(model, group, is_there)
            if (j == 0) return
            associate (link => model%joint(j)%link)
                l = merge(link(2), link(1), is_there(link(1)))
                moved(l) = moved(sum(link) - l)
                is_there(l) = .true.
                call move_from_start(model, l, moved(l), state%group%place(lane, :, l))
            end associate
        end do
    end subroutine hang_as_drawn

    !> The joint by which another link of the group is to hang on one that is there, a thread if there is one; 0: no joint is left.
    pure integer function next_joint(model, group, is_there) result(next)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        logical, intent(in) :: is_there(0:)
        integer :: i

        next = 0
        do i = 1, size(group%joint)
            associate (joint => model%joint(group%joint(i)))
                if (is_pose_part(joint%kind) .or. joint%cam > 0) cycle
                if (is_there(joint%link(1)) .eqv. is_there(joint%link(2))) cycle
                if (.not. has_start(merge(joint%link(2), joint%link(1), is_there(joint%link(1))))) cycle
                if (next == 0) next = group%joint(i)
                if (.not. is_threaded(joint%kind)) cycle
                next = group%joint(i)
                return
            end associate
        end do

    contains

        pure logical function has_start(l)
            integer, intent(in) :: l

            has_start = any(group%link == l)
            if (has_start) has_start = model%scene%link(l)%has_start
        end function has_start
    end function next_joint

    !> How the steps before have moved a link.
    pure function motion_of_placed(model, l, lane, state) result(moved)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l, lane
        type(kinematic_state), intent(in) :: state
        type(moved_type) :: moved

        moved%turn = mat3_lane(state%rotation(orientation_of(model, l)), lane)
        moved%shift = lane_of(state%position(l), lane)
        if (l == frame_link) return
        associate (start => model%scene%link(l)%start)
            moved%turn = matmul(moved%turn, transpose(matrix_of_angles(start(4:))))
            moved%shift = moved%shift - matmul(moved%turn, start(:3))
        end associate
    end function motion_of_placed

    pure subroutine move_from_start(model, l, moved, place)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l
        type(moved_type), intent(in) :: moved
        real(wp), intent(out) :: place(:)                  !! (7)
        real(wp) :: turn(3, 3), quaternion(lanes, 4)

        associate (start => model%scene%link(l)%start)
            turn = matmul(moved%turn, matrix_of_angles(start(4:)))
            quaternion = quaternion_of_rotation(mat3(vec3_of(turn(:, 1)), vec3_of(turn(:, 2)), vec3_of(turn(:, 3))))
            place(:3) = moved%shift + matmul(moved%turn, start(:3))
            place(4:) = quaternion(1, :)
        end associate
    end subroutine move_from_start
end module linkdyn_drawn_links
