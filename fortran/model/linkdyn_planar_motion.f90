!> Motion of the links of a planar mechanism on one block of lanes: what `kinematic_state` keeps for planar scenes.
!>
!> Everything is in world axes. Velocities and columns of accelerations obey the same linear maps, so they stand in one
!> row of levels: -1 the velocity, 0 the acceleration that the coordinates' motion gives, k what a unit acceleration of
!> coordinate k adds. Only level 0 has centripetal and Coriolis parts.
module linkdyn_planar_motion
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_vec2, only: vec2, rot2, zero_vec2, identity_rot2
    implicit none (type, external)
    private
    public :: planar_motion, prepare_planar_motion, level_velocity, level_given

    integer, parameter :: level_velocity = -1, level_given = 0

    type :: planar_motion
        type(rot2), allocatable :: rotation(:)           !! link axes to world               (0:n_orientation)
        type(vec2), allocatable :: position(:)           !! origin [m]                       (0:n_link)
        real(wp), allocatable :: angular(:, :, :)        !! (lane, -1:n_column, 0:n_orientation)
        type(vec2), allocatable :: linear(:, :)          !! of the origin                    (-1:n_column, 0:n_link)
    end type planar_motion

contains

    subroutine prepare_planar_motion(model, n_column, motion)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n_column
        type(planar_motion), intent(out) :: motion
        integer :: i, k

        associate (n_o => model%n_orientation, n_link => model%n_link)
            allocate (motion%rotation(0:n_o), motion%position(0:n_link), motion%angular(lanes, -1:n_column, 0:n_o), &
                      motion%linear(-1:n_column, 0:n_link))
            motion%angular = 0
            do i = 0, n_o
                motion%rotation(i) = identity_rot2()
            end do
            do i = 0, n_link
                motion%position(i) = zero_vec2()
                do k = -1, n_column
                    motion%linear(k, i) = zero_vec2()
                end do
            end do
        end associate
    end subroutine prepare_planar_motion
end module linkdyn_planar_motion
