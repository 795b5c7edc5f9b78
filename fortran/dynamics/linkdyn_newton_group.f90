!> An Assur group closed by Newton's method, in a plane or in space: the iteration, which is the same for both.
!>
!> The constraints, their matrix and the rates that follow from it are in `linkdyn_planar_group` and
!> `linkdyn_spatial_group`.
module linkdyn_newton_group
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, group_type, link_freedom
    use linkdyn_planar_group, only: put_planar_links, assemble_gaps, move_planar_group
    use linkdyn_quaternion, only: quaternion_rate
    use linkdyn_spatial_group, only: put_spatial_links, assemble_errors, refuse_turned_joints, move_spatial_group
    use linkdyn_vec3, only: vec3
    implicit none (type, external)
    private
    public :: close_group

    integer, parameter :: most_steps = 30
    ! Newton's method squares the error: after a correction below this, the next error is below rounding.
    real(wp), parameter :: small_step = 1.0e-2_wp*sqrt(epsilon(1.0_wp))
    real(wp), parameter :: largest_turn = 0.5_wp     !! [rad] of a link in one step

contains

    !> Positions from where the iteration stands, then all rates.
    subroutine close_group(model, group, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state
        real(wp) :: largest(lanes), growth(lanes)
        logical :: is_singular(lanes)
        integer :: n, step

        n = link_freedom(model)*size(group%link)
        ! Lanes that have arrived stay: what a sample gives must not depend on the samples beside it.
        largest = merge(huge(1.0_wp), 0.0_wp, state%group%moves)
        associate (matrix => state%group%matrix, right => state%group%right)
            do step = 1, most_steps
                if (model%is_planar) then
                    call put_planar_links(model, group, state)
                    call assemble_gaps(model, group, state, matrix(:, :n, :n), right(:, :n, 1))
                else
                    call put_spatial_links(model, group, state)
                    call assemble_errors(model, group, state, matrix(:, :n, :n), right(:, :n, 1))
                end if
                call solve_gauss_jordan(n, 1, matrix(:, :n, :n), right(:, :n, :1), growth, is_singular)
                call correct(group, merge(2, 3, model%is_planar), right(:, :n, 1), state%group%place, largest)
                if (all(largest <= small_step)) exit
            end do
        end associate
        state%not_converged = state%not_converged .or. .not. largest <= small_step
        state%singular = state%singular .or. is_singular
        if (model%is_planar) then
            call put_planar_links(model, group, state)
            call move_planar_group(model, group, state)
        else
            call put_spatial_links(model, group, state)
            call refuse_turned_joints(model, group, state)
            call move_spatial_group(model, group, state)
        end if
    end subroutine close_group

    !> Take the correction, unless the last one was small; how large it was, relative to the links' distances.
    subroutine correct(group, n_shift, correction, place, largest)
        type(group_type), intent(in) :: group
        integer, intent(in) :: n_shift                   !! of a link's corrections are shifts, the others turns
        real(wp), intent(in) :: correction(:, :)         !! (lane, row)
        real(wp), intent(inout) :: place(:, :, :)        !! (lane, place_size, n_link)
        real(wp), intent(inout) :: largest(lanes)
        real(wp), dimension(lanes) :: part, turn, shift, extent
        real(wp) :: moved(lanes, size(place, 2))
        integer :: n, i, k

        n = size(correction, 2)/size(group%link)
        turn = 0
        shift = 0
        extent = 0
        do i = 1, size(group%link)
            associate (l => group%link(i), d => correction(:, n*(i - 1) + 1:n*i))
                shift = max(shift, maxval(abs(d(:, :n_shift)), dim=2))
                turn = max(turn, maxval(abs(d(:, n_shift + 1:)), dim=2))
                extent = max(extent, maxval(abs(place(:, :n_shift, l)), dim=2))
            end associate
        end do
        ! Far off, a step is cut so that no link turns further than its equations hold.
        part = min(1.0_wp, largest_turn/max(turn, tiny(1.0_wp)))
        do i = 1, size(group%link)
            associate (l => group%link(i), d => correction(:, n*(i - 1) + 1:n*i))
                do k = 1, n_shift
                    moved(:, k) = place(:, k, l) - part*d(:, k)
                end do
                if (n_shift == 2) then
                    moved(:, 3) = place(:, 3, l) - part*d(:, 3)
                else
                    moved(:, 4:) = turned(place(:, 4:, l), vec3(-part*d(:, 4), -part*d(:, 5), -part*d(:, 6)))
                end if
                do k = 1, size(moved, 2)
                    where (.not. largest <= small_step) place(:, k, l) = moved(:, k)
                end do
            end associate
        end do
        where (.not. largest <= small_step) largest = turn + shift/max(extent, tiny(1.0_wp))
        where (.not. largest <= huge(1.0_wp)) largest = huge(1.0_wp)
    end subroutine correct

    !> A unit quaternion after a small turn.
    pure function turned(quaternion, turn) result(new)
        real(wp), intent(in) :: quaternion(lanes, 4)
        type(vec3), intent(in) :: turn        !! world axes [rad]
        real(wp) :: new(lanes, 4)

        new = quaternion + quaternion_rate(quaternion, turn)
        new = new/spread(norm2(new, dim=2), 2, 4)
    end function turned
end module linkdyn_newton_group
