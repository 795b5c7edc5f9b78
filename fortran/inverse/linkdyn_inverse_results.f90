!> Where the results of inverse dynamics go: a table by their numbers in the catalogue. Who computes them, keeps them or hands them
!> on walks through the table; what one of them is need not be said again.
module linkdyn_inverse_results
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_catalogue, only: needs_equations
    use linkdyn_result_kinds, only: n_results, result_qdd, result_driving_force, result_reaction, result_joint_variable, &
        result_joint_rate, result_power_imbalance, result_transmission_angle, result_kinetic_energy, &
        result_potential_energy, result_closure, result_position, result_rotation, result_driving_position, &
        result_driving_speed, result_friction, result_friction_power, result_transmission_force, result_contact_force, &
        result_pressure_angle, result_strand_force, result_rcond, result_error, result_growth, result_driving_force_error, &
        result_reaction_error, result_singularity_distance
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_roads, only: road_counts
    use linkdyn_samples, only: result_list, result_target, add_target
    use linkdyn_scene, only: guide_of
    use linkdyn_status, only: message_len
    implicit none (type, external)
    private
    public :: inverse_results, result_width, is_of_inverse, may_be_infinite
    public :: wanted_ids, part_of_results, list_results, forces_beside, clear_measures, make_undefined

    ! ---- results of inverse dynamics, all of real numbers
    !> A record of the scene gives these.
    integer, parameter :: by_record(20) = [ &
        result_driving_force, result_transmission_force, result_reaction, result_joint_variable, result_joint_rate, &
        result_driving_position, result_driving_speed, result_power_imbalance, result_transmission_angle, result_qdd, &
        result_contact_force, result_pressure_angle, result_strand_force, result_kinetic_energy, result_potential_energy, &
        result_closure, result_position, result_friction, result_friction_power, result_rotation]
    !> What solvers tell of themselves; unknown is NaN.
    integer, parameter :: of_solvers(3) = [result_rcond, result_error, result_growth]
    !> Estimates; unknown is infinite.
    integer, parameter :: estimates(2) = [result_driving_force_error, result_reaction_error]
    integer, parameter :: of_inverse(*) = [by_record, of_solvers, estimates, result_singularity_distance]

    !> Where results go; what has no place is not computed.
    type :: inverse_results
        type(result_target) :: of(n_results)                        !! each (values of a sample, n), by `result_*`
        integer, pointer, contiguous :: status(:) => null()         !! (n) one of `sample_*`
        integer, pointer, contiguous :: assembly(:) => null()       !! (n) one of `reached_*`
        real(wp), pointer, contiguous :: load(:, :, :) => null()    !! loads, with those that follow the state (6, n_load, n) [N, N
                                                                    !! m]
        type(road_counts) :: roads                                  !! of the samples
        integer :: lost_sample = 0                                  !! the first to which the assembly was not followed; 0: none
        character(len=message_len) :: lost_in_words = ""            !! why
    contains
        procedure :: wants => wants_result
        procedure :: at => result_at
        procedure :: add => add_room
        procedure :: free => free_rooms
        procedure, private :: put_1, put_2, put_3, put_4
        generic :: put => put_1, put_2, put_3, put_4
    end type inverse_results

contains

    ! ---------------------------------------------------------------- places

    !> Is there a place for a result?
    elemental logical function wants_result(self, id)
        class(inverse_results), intent(in) :: self
        integer, intent(in) :: id                      !! one of `result_*`

        wants_result = associated(self%of(id)%x)
    end function wants_result

    !> Values of a result that has a place.
    pure function result_at(self, id, sample) result(values)
        class(inverse_results), intent(in) :: self
        integer, intent(in) :: id                      !! one of `result_*`
        integer, intent(in) :: sample
        real(wp) :: values(size(self%of(id)%x, 1))

        values = self%of(id)%x(:, sample)
    end function result_at

    !> Values of a sample, as the engine gives them; 0: the scene has none.
    pure integer function result_width(model, id) result(width)
        type(model_type), intent(in) :: model
        integer, intent(in) :: id                      !! one of `result_*`

        select case (id)
        case (result_driving_force, result_driving_force_error, result_driving_position, result_driving_speed)
            width = model%n_actuator
        case (result_reaction, result_reaction_error)
            width = model%n_component*model%n_joint
        case (result_joint_variable, result_joint_rate)
            width = model%n_variable
        case (result_qdd)
            width = model%n_q
        case (result_transmission_force)
            width = size(model%motor)
        case (result_friction)
            width = merge(model%n_component*model%n_joint, 0, size(model%contact) > 0)
        case (result_friction_power)
            width = merge(model%n_joint, 0, size(model%contact) > 0)
        case (result_transmission_angle)
            width = model%n_dyad
        case (result_contact_force)
            width = model%n_cam
        case (result_pressure_angle)
            width = merge(model%n_cam, 0, has_guides(model))
        case (result_strand_force)
            width = 2*size(model%belt)
        case (result_position)
            width = 3*model%n_link
        case (result_rotation)
            width = 9*model%n_link
        case default
            width = 1
        end select
    end function result_width

    !> Is every follower of a cam guided?
    pure logical function has_guides(model)
        type(model_type), intent(in) :: model
        integer :: j

        has_guides = .true.
        do j = 1, model%n_joint
            if (model%joint(j)%cam > 0) has_guides = has_guides .and. guide_of(model%scene, j) > 0
        end do
    end function has_guides

    !> Room of its own for a result, if it has no place yet: given back by `free`.
    subroutine add_room(self, model, id, n)
        class(inverse_results), intent(inout) :: self
        type(model_type), intent(in) :: model
        integer, intent(in) :: id                      !! one of `result_*`
        integer, intent(in) :: n                       !! samples

        if (associated(self%of(id)%x)) return
        allocate (self%of(id)%x(result_width(model, id), n))
        self%of(id)%is_own = .true.
    end subroutine add_room

    !> Give back what `add` has made; all places are forgotten.
    subroutine free_rooms(self)
        class(inverse_results), intent(inout) :: self
        integer :: id

        do id = 1, n_results
            if (self%of(id)%is_own) deallocate (self%of(id)%x)
            nullify (self%of(id)%x)
            self%of(id)%is_own = .false.
        end do
    end subroutine free_rooms

    !> Let a result go into an array of the caller's, the sample last: it must be a target, and stay.
    subroutine put_1(self, id, x)
        class(inverse_results), intent(inout) :: self
        integer, intent(in) :: id                      !! one of `result_*`
        real(wp), intent(in), target, contiguous :: x(:)

        self%of(id)%x(1:1, 1:size(x)) => x
    end subroutine put_1

    subroutine put_2(self, id, x)
        class(inverse_results), intent(inout) :: self
        integer, intent(in) :: id
        real(wp), intent(in), target, contiguous :: x(:, :)

        self%of(id)%x => x
    end subroutine put_2

    subroutine put_3(self, id, x)
        class(inverse_results), intent(inout) :: self
        integer, intent(in) :: id
        real(wp), intent(in), target, contiguous :: x(:, :, :)

        self%of(id)%x(1:size(x, 1)*size(x, 2), 1:size(x, 3)) => x
    end subroutine put_3

    subroutine put_4(self, id, x)
        class(inverse_results), intent(inout) :: self
        integer, intent(in) :: id
        real(wp), intent(in), target, contiguous :: x(:, :, :, :)

        self%of(id)%x(1:size(x, 1)*size(x, 2)*size(x, 3), 1:size(x, 4)) => x
    end subroutine put_4

    ! ---------------------------------------------------------------- all of them

    !> Does inverse dynamics give a result itself?
    pure logical function is_of_inverse(id)
        integer, intent(in) :: id                      !! one of `result_*`

        is_of_inverse = any(of_inverse == id)
    end function is_of_inverse

    !> The results that have places, those of a record first.
    pure function wanted_ids(results) result(id)
        type(inverse_results), intent(in) :: results
        integer, allocatable :: id(:)                  !! `result_*`

        id = pack(of_inverse, results%wants(of_inverse))
    end function wanted_ids

    !> Results of some samples, as if there were no others.
    function part_of_results(whole, first, last) result(part)
        type(inverse_results), intent(in) :: whole
        integer, intent(in) :: first, last             !! samples
        type(inverse_results) :: part
        integer :: i

        do i = 1, size(of_inverse)
            associate (id => of_inverse(i))
                if (whole%wants(id)) part%of(id)%x => whole%of(id)%x(:, first:last)
            end associate
        end do
        if (associated(whole%status)) part%status => whole%status(first:last)
        if (associated(whole%assembly)) part%assembly => whole%assembly(first:last)
    end function part_of_results

    !> A sample that failed has no forces, nor what follows from them or from a motion that is none. Where its links stand, and what
    !> is known of the solution, is told all the same.
    subroutine make_undefined(results, sample)
        type(inverse_results), intent(inout) :: results
        integer, intent(in) :: sample
        real(wp) :: nan
        integer :: i

        nan = ieee_value(1.0_wp, ieee_quiet_nan)
        do i = 1, size(of_inverse)
            associate (id => of_inverse(i))
                if (.not. results%wants(id) .or. stays(id)) cycle
                results%of(id)%x(:, sample) = nan
            end associate
        end do
    end subroutine make_undefined

    pure logical function stays(id)
        integer, intent(in) :: id                      !! one of `result_*`

        stays = any(id == [of_solvers, result_singularity_distance, result_position, result_rotation])
    end function stays

    !> May a sample that is well have a result that is no finite number?
    pure logical function may_be_infinite(id)
        integer, intent(in) :: id                      !! one of `result_*`

        may_be_infinite = any(id == [of_solvers, estimates, result_singularity_distance])
    end function may_be_infinite

    !> The results that a record of the scene can give, with their places.
    subroutine list_results(results, n, list)
        type(inverse_results), intent(in) :: results
        integer, intent(in) :: n                       !! samples
        type(result_list), intent(out) :: list
        integer :: i

        list%status => results%status
        do i = 1, size(by_record)
            associate (id => by_record(i))
                if (results%wants(id)) call add_target(list, id, size(results%of(id)%x, 1), n, results%of(id)%x)
            end associate
        end do
    end subroutine list_results

    !> What is asked of the forces beside driving forces and accelerations.
    pure function forces_beside(results) result(wanted)
        type(inverse_results), intent(in) :: results
        integer, allocatable :: wanted(:)              !! `result_*`

        wanted = wanted_ids(results)
        wanted = pack(wanted, needs_equations(wanted) .and. .not. is_unknown(wanted))

    contains

        !> Such unknowns the equations tell anyway.
        elemental logical function is_unknown(id)
            integer, intent(in) :: id

            is_unknown = any(id == [result_qdd, result_driving_force, result_transmission_force])
        end function is_unknown
    end function forces_beside

    !> The elimination has neither condition numbers nor error bounds of its own.
    subroutine clear_measures(results)
        type(inverse_results), intent(inout) :: results
        integer :: i

        do i = 1, size(of_solvers)
            if (results%wants(of_solvers(i))) results%of(of_solvers(i))%x = ieee_value(1.0_wp, ieee_quiet_nan)
        end do
    end subroutine clear_measures
end module linkdyn_inverse_results
