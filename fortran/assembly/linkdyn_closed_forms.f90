!> How closed forms close, on a block of lanes: transmission angles, margins, certainty. Their links are placed.
module linkdyn_closed_forms
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_steps_on_lanes, only: kernel_use, begin_use, end_use, run_kernel
    use linkdyn_model, only: model_type, step_type, step_csp, step_hung, is_dyad, has_rod
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_step_kernels, only: of_ways, of_margins, of_quality
    use linkdyn_uncertainty, only: uncertainty_of_motion, largest_uncertainty
    implicit none (type, external)
    private
    public :: see_dyad, transmission_angles, closed_margin, flag_closed_forms

contains

    !> How the inner joint of a dyad moves with either link.
    subroutine see_dyad(model, step, state, determinant, product, lengths)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(in) :: state
        real(wp), dimension(lanes), intent(out) :: determinant, product, lengths    !! cross and dot product; of the lengths
        real(wp), allocatable :: found(:, :)

        call find(model, step, of_ways, state, level_velocity, found)
        determinant = found(:, 1)
        product = found(:, 2)
        lengths = found(:, 3)
    end subroutine see_dyad

    !> Transmission angles of all dyads, 0 (a dead point) to pi/2 (best): between the two ways. Of hinged links it is the angle
    !> between the links, folded into the first quadrant.
    subroutine transmission_angles(model, state, angle)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: angle(:, :)             !! (lane, n_dyad) [rad]
        real(wp), dimension(lanes) :: determinant, product, lengths
        integer :: i

        do i = 1, size(model%step)
            if (.not. is_dyad(model%step(i)%kind)) cycle
            call see_dyad(model, model%step(i), state, determinant, product, lengths)
            angle(:, model%step(i)%first) = atan2(abs(determinant), abs(product))
        end do
    end subroutine transmission_angles

    !> Margin of a closed form with two ways to close, and how fast it changes with the velocities.
    subroutine closed_margin(model, step, state, margin, drift)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: margin(lanes), drift(lanes)
        real(wp), allocatable :: found(:, :)

        call find(model, step, of_margins, state, level_velocity, found)
        margin = found(:, 1)
        drift = found(:, 2)
    end subroutine closed_margin

    !> Lanes on which closed forms leave too little of the motion.
    subroutine flag_closed_forms(model, state, is_uncertain)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        logical, intent(out) :: is_uncertain(lanes)
        !> Of the sine, down to which nothing is uncertain, whatever the motion: no gap exceeds twice the speed, and none of the
        !> three parts the `whole`; so it is below 8 eps/s^4. Twice that leaves room for rounding.
        real(wp), parameter :: least_square = sqrt(16*epsilon(1.0_wp)/largest_uncertainty)
        real(wp), dimension(lanes) :: determinant, product, lengths
        real(wp), allocatable :: q(:, :)
        integer :: i

        is_uncertain = .false.
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (is_dyad(step%kind)) then
                    call see_dyad(model, step, state, determinant, product, lengths)
                    if (all(determinant**2 > least_square*lengths**2)) cycle
                else if (.not. (any(step%kind == [step_csp, step_hung]) .or. has_rod(step%kind))) then
                    cycle
                end if
                call find(model, step, of_quality, state, level_given, q)
                is_uncertain = is_uncertain .or. uncertainty_of_motion(q(:, 1), q(:, 2), q(:, 3), q(:, 4), q(:, 5), q(:, 6)) &
                               > largest_uncertainty
            end associate
        end do
    end subroutine flag_closed_forms

    subroutine find(model, step, which, state, level, found)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        integer, intent(in) :: which                     !! one of `of_*`
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: level
        real(wp), allocatable, intent(inout) :: found(:, :)    !! (lane, number)
        type(kernel_use) :: use

        call begin_use(model, step%number, state, use)
        call run_kernel(model, use, which, state, found, level)
        call end_use(use)
    end subroutine find
end module linkdyn_closed_forms
