!> Where the results of inverse dynamics go.
module linkdyn_inverse_results
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_catalogue, only: result_qdd, result_driving_force, result_reaction, result_joint_variable, result_joint_rate, &
        result_power_imbalance, result_transmission_angle, result_kinetic_energy, result_potential_energy, result_closure, &
        result_position, result_rotation, result_driving_position, result_driving_speed, result_friction, result_friction_power, &
        result_transmission_force, result_contact_force, result_pressure_angle, result_strand_force
    use linkdyn_kinds, only: wp
    use linkdyn_roads, only: road_counts
    use linkdyn_samples, only: result_list, add_target
    use linkdyn_status, only: message_len
    implicit none (type, external)
    private
    public :: inverse_results, part_of_results, list_results, clear_measures, make_undefined

    !> Where results go; what is not associated is not computed.
    type :: inverse_results
        real(wp), pointer, contiguous :: driving_force(:, :) => null() !! (n_actuator, n) [N, N m]
        real(wp), pointer, contiguous :: transmission_force(:, :) => null() !! (n_motor, n) what gets to the links [N, N m]
        real(wp), pointer, contiguous :: reaction(:, :, :) => null() !! (n_component, n_joint, n) world axes [N, N m]
        real(wp), pointer, contiguous :: joint_variable(:, :) => null() !! (n_variable, n) [m, rad]
        real(wp), pointer, contiguous :: joint_rate(:, :) => null() !! (n_variable, n)
        real(wp), pointer, contiguous :: driving_position(:, :) => null() !! (n_actuator, n) driven joint variables; coordinates count
                                                                !! turns, other angles are within half a turn [m, rad]
        real(wp), pointer, contiguous :: driving_speed(:, :) => null() !! (n_actuator, n) their rates
        integer, pointer, contiguous :: status(:) => null()     !! (n) one of `sample_*`
        integer, pointer, contiguous :: assembly(:) => null()   !! (n) one of `reached_*`
        real(wp), pointer, contiguous :: rcond(:) => null()     !! (n) NaN where the solver has none
        real(wp), pointer, contiguous :: error(:) => null()     !! (n) NaN where the solver has none
        real(wp), pointer, contiguous :: driving_force_error(:, :) => null() !! (n_actuator, n) estimates [N, N m]
        real(wp), pointer, contiguous :: reaction_error(:, :, :) => null() !! (n_component, n_joint, n) [N, N m]
        real(wp), pointer, contiguous :: singularity_distance(:) => null() !! (n) [m]
        real(wp), pointer, contiguous :: growth(:) => null()    !! (n) reciprocal pivot growth; NaN but for gauss-jordan
        real(wp), pointer, contiguous :: power_imbalance(:) => null() !! (n)
        real(wp), pointer, contiguous :: transmission_angle(:, :) => null() !! (n_dyad, n) [rad]
        real(wp), pointer, contiguous :: contact_force(:, :) => null() !! (n_cam, n) with which follower and curve press [N]
        real(wp), pointer, contiguous :: pressure_angle(:, :) => null() !! (n_cam, n) [rad]
        real(wp), pointer, contiguous :: strand_force(:, :) => null() !! (2 n_belt, n) [N]
        real(wp), pointer, contiguous :: acceleration(:, :) => null() !! (n_q, n) of the coordinates, found or given
        real(wp), pointer, contiguous :: kinetic_energy(:) => null() !! (n) [J]
        real(wp), pointer, contiguous :: potential_energy(:) => null() !! (n) of gravity and springs [J]
        real(wp), pointer, contiguous :: load(:, :, :) => null()    !! loads, with those that follow the state (6, n_load, n) [N, N m]
        real(wp), pointer, contiguous :: closure(:) => null()   !! (n) largest gap of a joint [m, rad]
        real(wp), pointer, contiguous :: friction(:, :, :) => null() !! (n_component, n_joint, n) on the second link [N, N m]
        real(wp), pointer, contiguous :: friction_power(:, :) => null() !! (n_joint, n) that it takes [W]
        real(wp), pointer, contiguous :: position(:, :, :) => null() !! (3, n_link, n) origins [m]
        real(wp), pointer, contiguous :: rotation(:, :, :, :) => null() !! (3, 3, n_link, n) columns: the link's axes
        type(road_counts) :: roads                              !! of the samples
        integer :: lost_sample = 0                              !! the first to which the assembly was not followed; 0: none
        character(len=message_len) :: lost_in_words = ""        !! why
    end type inverse_results

contains

    !> Results of some samples, as if there were no others.
    function part_of_results(whole, first, last) result(part)
        type(inverse_results), intent(in) :: whole
        integer, intent(in) :: first, last             !! samples
        type(inverse_results) :: part

        if (associated(whole%driving_force)) part%driving_force => whole%driving_force(:, first:last)
        if (associated(whole%transmission_force)) part%transmission_force => whole%transmission_force(:, first:last)
        if (associated(whole%reaction)) part%reaction => whole%reaction(:, :, first:last)
        if (associated(whole%joint_variable)) part%joint_variable => whole%joint_variable(:, first:last)
        if (associated(whole%joint_rate)) part%joint_rate => whole%joint_rate(:, first:last)
        if (associated(whole%driving_position)) part%driving_position => whole%driving_position(:, first:last)
        if (associated(whole%driving_speed)) part%driving_speed => whole%driving_speed(:, first:last)
        if (associated(whole%status)) part%status => whole%status(first:last)
        if (associated(whole%assembly)) part%assembly => whole%assembly(first:last)
        if (associated(whole%rcond)) part%rcond => whole%rcond(first:last)
        if (associated(whole%error)) part%error => whole%error(first:last)
        if (associated(whole%driving_force_error)) part%driving_force_error => whole%driving_force_error(:, first:last)
        if (associated(whole%reaction_error)) part%reaction_error => whole%reaction_error(:, :, first:last)
        if (associated(whole%growth)) part%growth => whole%growth(first:last)
        if (associated(whole%power_imbalance)) part%power_imbalance => whole%power_imbalance(first:last)
        if (associated(whole%transmission_angle)) part%transmission_angle => whole%transmission_angle(:, first:last)
        if (associated(whole%contact_force)) part%contact_force => whole%contact_force(:, first:last)
        if (associated(whole%pressure_angle)) part%pressure_angle => whole%pressure_angle(:, first:last)
        if (associated(whole%strand_force)) part%strand_force => whole%strand_force(:, first:last)
        if (associated(whole%acceleration)) part%acceleration => whole%acceleration(:, first:last)
        if (associated(whole%kinetic_energy)) part%kinetic_energy => whole%kinetic_energy(first:last)
        if (associated(whole%potential_energy)) part%potential_energy => whole%potential_energy(first:last)
        if (associated(whole%closure)) part%closure => whole%closure(first:last)
        if (associated(whole%friction)) part%friction => whole%friction(:, :, first:last)
        if (associated(whole%friction_power)) part%friction_power => whole%friction_power(:, first:last)
        if (associated(whole%position)) part%position => whole%position(:, :, first:last)
        if (associated(whole%rotation)) part%rotation => whole%rotation(:, :, :, first:last)
    end function part_of_results

    !> A sample that failed has no forces, nor what follows from them or from a motion that is none.
    subroutine make_undefined(results, sample)
        type(inverse_results), intent(inout) :: results
        integer, intent(in) :: sample
        real(wp) :: nan

        nan = ieee_value(1.0_wp, ieee_quiet_nan)
        if (associated(results%driving_force)) results%driving_force(:, sample) = nan
        if (associated(results%transmission_force)) results%transmission_force(:, sample) = nan
        if (associated(results%reaction)) results%reaction(:, :, sample) = nan
        if (associated(results%friction)) results%friction(:, :, sample) = nan
        if (associated(results%friction_power)) results%friction_power(:, sample) = nan
        if (associated(results%driving_force_error)) results%driving_force_error(:, sample) = nan
        if (associated(results%reaction_error)) results%reaction_error(:, :, sample) = nan
        if (associated(results%joint_variable)) results%joint_variable(:, sample) = nan
        if (associated(results%joint_rate)) results%joint_rate(:, sample) = nan
        if (associated(results%driving_position)) results%driving_position(:, sample) = nan
        if (associated(results%driving_speed)) results%driving_speed(:, sample) = nan
        if (associated(results%power_imbalance)) results%power_imbalance(sample) = nan
        if (associated(results%transmission_angle)) results%transmission_angle(:, sample) = nan
        if (associated(results%contact_force)) results%contact_force(:, sample) = nan
        if (associated(results%pressure_angle)) results%pressure_angle(:, sample) = nan
        if (associated(results%strand_force)) results%strand_force(:, sample) = nan
        if (associated(results%acceleration)) results%acceleration(:, sample) = nan
        if (associated(results%kinetic_energy)) results%kinetic_energy(sample) = nan
        if (associated(results%potential_energy)) results%potential_energy(sample) = nan
        if (associated(results%closure)) results%closure(sample) = nan
    end subroutine make_undefined

    !> The results that a record of the scene can give, with their places.
    subroutine list_results(results, n, list)
        type(inverse_results), intent(in) :: results
        integer, intent(in) :: n                       !! samples
        type(result_list), intent(out) :: list

        list%status => results%status
        if (associated(results%driving_force)) &
            call add_target(list, result_driving_force, size(results%driving_force, 1), n, results%driving_force)
        if (associated(results%transmission_force)) &
            call add_target(list, result_transmission_force, size(results%transmission_force, 1), n, results%transmission_force)
        if (associated(results%reaction)) &
            call add_target(list, result_reaction, size(results%reaction, 1)*size(results%reaction, 2), n, results%reaction)
        if (associated(results%joint_variable)) &
            call add_target(list, result_joint_variable, size(results%joint_variable, 1), n, results%joint_variable)
        if (associated(results%joint_rate)) &
            call add_target(list, result_joint_rate, size(results%joint_rate, 1), n, results%joint_rate)
        if (associated(results%driving_position)) &
            call add_target(list, result_driving_position, size(results%driving_position, 1), n, results%driving_position)
        if (associated(results%driving_speed)) &
            call add_target(list, result_driving_speed, size(results%driving_speed, 1), n, results%driving_speed)
        if (associated(results%power_imbalance)) call add_target(list, result_power_imbalance, 1, n, results%power_imbalance)
        if (associated(results%transmission_angle)) &
            call add_target(list, result_transmission_angle, size(results%transmission_angle, 1), n, results%transmission_angle)
        if (associated(results%acceleration)) &
            call add_target(list, result_qdd, size(results%acceleration, 1), n, results%acceleration)
        if (associated(results%contact_force)) &
            call add_target(list, result_contact_force, size(results%contact_force, 1), n, results%contact_force)
        if (associated(results%pressure_angle)) &
            call add_target(list, result_pressure_angle, size(results%pressure_angle, 1), n, results%pressure_angle)
        if (associated(results%strand_force)) &
            call add_target(list, result_strand_force, size(results%strand_force, 1), n, results%strand_force)
        if (associated(results%kinetic_energy)) call add_target(list, result_kinetic_energy, 1, n, results%kinetic_energy)
        if (associated(results%potential_energy)) call add_target(list, result_potential_energy, 1, n, results%potential_energy)
        if (associated(results%closure)) call add_target(list, result_closure, 1, n, results%closure)
        if (associated(results%position)) &
            call add_target(list, result_position, 3*size(results%position, 2), n, results%position)
        if (associated(results%friction)) &
            call add_target(list, result_friction, size(results%friction, 1)*size(results%friction, 2), n, results%friction)
        if (associated(results%friction_power)) &
            call add_target(list, result_friction_power, size(results%friction_power, 1), n, results%friction_power)
        if (associated(results%rotation)) &
            call add_target(list, result_rotation, 9*size(results%rotation, 3), n, results%rotation)
    end subroutine list_results

    !> The elimination has neither condition numbers nor error bounds of its own.
    subroutine clear_measures(results)
        type(inverse_results), intent(inout) :: results
        real(wp) :: nan

        nan = ieee_value(1.0_wp, ieee_quiet_nan)
        if (associated(results%rcond)) results%rcond = nan
        if (associated(results%error)) results%error = nan
        if (associated(results%growth)) results%growth = nan
    end subroutine clear_measures
end module linkdyn_inverse_results
