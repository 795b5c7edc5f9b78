!> Joint variables of placed and moving links.
module linkdyn_joint_variables
    use linkdyn_bodies, only: world_axes, omega_of, alpha_of, point_velocity, point_acceleration, acceleration_field, field_times
    use linkdyn_constants, only: pi
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_mechanism, only: mechanism_type, has_slide, told_pair_of, marker_point
    use linkdyn_scene, only: coordinate_joint
    use linkdyn_value, only: value, nearest_whole, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector, components, operator(-), operator(.cross.)
    implicit none (type, external)
    private
    public :: joint_rates, one_variable, variable_near, variable_rate, variable_acceleration, move_pair, accelerate_pair
    public :: within_half_a_turn

contains

    !> All variables of a joint; angles in (-pi, pi], but where they are coordinates as these count.
    function joint_variables(mechanism, j) result(q)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j
        type(value), allocatable :: q(:)
        type(value) :: slide(3)
        logical :: is_told
        integer :: k, c

        q = mechanism%told_kind(j)%is%variables(told_pair_of(mechanism, j))
        ! what is left of a joint that lets go slides along axes of its own
        is_told = has_slide(mechanism, j) .and. mechanism%model%joint(j)%kind == mechanism%model%joint(j)%told_kind
        do k = 1, size(q)
            c = coordinate_of_variable(mechanism, j, k)
            if (c > 0) q(k) = mechanism%q(c)
            if (.not. (mechanism%told_kind(j)%is%is_slide(k) .and. is_told)) cycle
            slide = components(mechanism%slide(j))
            q(k) = slide(mechanism%told_kind(j)%is%axis(k))
        end do
    end function joint_variables

    !> One of them.
    function one_variable(mechanism, j, variable) result(q)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j, variable
        type(value) :: q
        type(value), allocatable :: all(:)

        all = joint_variables(mechanism, j)
        q = all(variable)
    end function one_variable

    !> The same, all angles in (-pi, pi].
    function within_half_a_turn(mechanism, j) result(q)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j
        type(value), allocatable :: q(:)
        integer :: k

        q = joint_variables(mechanism, j)
        do k = 1, size(q)
            if (.not. mechanism%told_kind(j)%is%wraps(k)) cycle
            if (coordinate_of_variable(mechanism, j, k) > 0) q(k) = q(k) - (2*pi)*nearest_whole((1/(2*pi))*q(k))
        end do
    end function within_half_a_turn

    !> Their rates.
    function joint_rates(mechanism, j) result(qd)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j
        type(value), allocatable :: qd(:)
        type(marker_pair) :: pair
        type(vector) :: omega, gap_rate
        integer :: k, c

        pair = told_pair_of(mechanism, j)
        call move_pair(mechanism, j, pair, omega, gap_rate)
        qd = mechanism%told_kind(j)%is%rates(pair, omega, gap_rate)
        do k = 1, size(qd)
            c = coordinate_of_variable(mechanism, j, k)
            if (c > 0) qd(k) = mechanism%qd(c)
        end do
    end function joint_rates

    !> How the second link moves as the first one sees it, at the second's marker; world axes.
    subroutine move_pair(mechanism, j, pair, omega, gap_rate)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j
        type(marker_pair), intent(in) :: pair
        type(vector), intent(out) :: omega, gap_rate       !! [rad/s], [m/s]

        associate (link => mechanism%model%joint(j)%link, bodies => mechanism%bodies)
            omega = omega_of(bodies, link(2), world_axes) - omega_of(bodies, link(1), world_axes)
            gap_rate = point_velocity(bodies, link(2), marker_point(mechanism, j, 2)) &
                       - point_velocity(bodies, link(1), marker_point(mechanism, j, 1)) &
                       - (omega_of(bodies, link(1), world_axes) .cross.pair%gap)
        end associate
    end subroutine move_pair

    !> The same of accelerations.
    subroutine accelerate_pair(mechanism, j, pair, alpha, gap_acceleration)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j
        type(marker_pair), intent(in) :: pair
        type(vector), intent(out) :: alpha, gap_acceleration    !! [rad/s2], [m/s2]
        type(vector) :: omega, gap_rate, of_first

        call move_pair(mechanism, j, pair, omega, gap_rate)
        associate (link => mechanism%model%joint(j)%link, bodies => mechanism%bodies)
            of_first = omega_of(bodies, link(1), world_axes)
            alpha = alpha_of(bodies, link(2), world_axes) - alpha_of(bodies, link(1), world_axes) - (of_first.cross.omega)
            gap_acceleration = felt_acceleration(mechanism, j, pair) - (of_first.cross.gap_rate) - (of_first.cross.gap_rate)
        end associate
    end subroutine accelerate_pair

    !> How the second marker's point accelerates against the first link, which is felt there: without what Coriolis adds.
    function felt_acceleration(mechanism, j, pair) result(acceleration)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j
        type(marker_pair), intent(in) :: pair
        type(vector) :: acceleration                   !! [m/s2]

        associate (link => mechanism%model%joint(j)%link, bodies => mechanism%bodies)
            acceleration = point_acceleration(bodies, link(2), marker_point(mechanism, j, 2), world_axes) &
                           - point_acceleration(bodies, link(1), marker_point(mechanism, j, 1), world_axes) &
                           - field_times(acceleration_field(bodies, link(1), world_axes), pair%gap)
        end associate
    end function felt_acceleration

    !> One variable; an angle that is no coordinate, or one that stands in for another variable, is the one nearest to `target` of
    !> those that differ by full turns. Of an angle that a coordinate stands in for the turns are known.
    function variable_near(mechanism, j, variable, target) result(q)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j, variable
        type(value), intent(in) :: target
        type(value) :: q, near
        integer :: k

        q = one_variable(mechanism, j, variable)
        k = coordinate_of_variable(mechanism, j, variable)
        if (k > 0) then
            if (mechanism%model%scene%coordinate(k)%for_joint == 0) return
        end if
        if (.not. mechanism%told_kind(j)%is%wraps(variable)) return
        near = target
        k = stand_in_of_variable(mechanism, j, variable)
        if (k > 0) near = mechanism%counted(k)
        q = q + (2*pi)*nearest_whole((1/(2*pi))*(near - q))
    end function variable_near

    function variable_rate(mechanism, j, variable) result(qd)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j, variable
        type(value) :: qd
        type(value), allocatable :: all(:)

        all = joint_rates(mechanism, j)
        qd = all(variable)
    end function variable_rate

    !> Acceleration of a variable of a joint with one axis, which stands still in both links.
    function variable_acceleration(mechanism, j, variable) result(qdd)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j, variable
        type(value) :: qdd
        type(value), allocatable :: all(:)
        type(marker_pair) :: pair
        type(vector) :: alpha, gap_acceleration
        integer :: c

        c = coordinate_of_variable(mechanism, j, variable)
        if (c > 0) then
            qdd = mechanism%qdd(c)
            return
        end if
        pair = told_pair_of(mechanism, j)
        associate (link => mechanism%model%joint(j)%link, bodies => mechanism%bodies)
            alpha = alpha_of(bodies, link(2), world_axes) - alpha_of(bodies, link(1), world_axes)
            gap_acceleration = felt_acceleration(mechanism, j, pair)    ! what Coriolis adds is square to the axis
        end associate
        all = mechanism%told_kind(j)%is%rates(pair, alpha, gap_acceleration)
        qdd = all(variable)
    end function variable_acceleration

    !> The coordinate that a joint variable is; 0: none, or one that says nothing, as where a quaternion gives a ball joint's
    !> attitude.
    pure integer function coordinate_of_variable(mechanism, j, variable) result(k)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j, variable

        k = 0
        if (allocated(mechanism%quaternion) .and. mechanism%model%joint(j)%attitude > 0) return
        associate (coordinate => mechanism%model%scene%coordinate)
            do k = 1, size(coordinate)
                if (coordinate(k)%kind == coordinate_joint .and. coordinate(k)%joint == j &
                    .and. coordinate(k)%variable == variable) return
            end do
        end associate
        k = 0
    end function coordinate_of_variable

    !> The coordinate that stands in for a joint variable; 0: none.
    pure integer function stand_in_of_variable(mechanism, j, variable) result(k)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j, variable

        associate (coordinate => mechanism%model%scene%coordinate)
            do k = 1, size(coordinate)
                if (coordinate(k)%for_joint == j .and. coordinate(k)%for_variable == variable) return
            end do
        end associate
        k = 0
    end function stand_in_of_variable
end module linkdyn_joint_variables
