!> Constraints of joints and their rates, derived from their values alone.
!>
!> A joint's kind says which values vanish while it holds. Here these are written for two free bodies, whose places and
!> motion are symbols, differentiated twice with respect to time, and only then are the symbols replaced by what is known
!> of the two links. A variable that gears make of those of other joints has their links beside its own. So a closed form, in which
!> a gap is zero by construction, still has its equation of velocities; and with a displacement in place of the velocity the same
!> rate is a row of Newton's method.
module linkdyn_constraint_rates
    use linkdyn_constants, only: two_pi
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_joint_table, only: moment_directions, along_axes, n_along
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type, marker_point, marker_frame, told_marker_frame
    use linkdyn_rates, only: rate_map, set_rate, rate_of
    use linkdyn_record, only: new_unknown
    use linkdyn_substitution, only: substitution, replace, substituted
    use linkdyn_value, only: value, zero, constant, nearest_whole, operator(+), operator(-), operator(*), sin, cos, atan2
    use linkdyn_vector, only: vector, rotation, components, operator(+), operator(-), operator(*), operator(.dot.), &
        operator(.cross.), operator(.rotate.)
    implicit none (type, external)
    private
    public :: body_state, constraint_type, constraints_of_joint, constraints_of_variable
    public :: errors_of, velocities_of, accelerations_of

    !> Place and motion of a body, world axes; symbols of a free one, or what is put in their place.
    type :: body_state
        type(vector) :: position, velocity, acceleration
        type(rotation) :: r
        type(vector) :: omega, alpha
    end type body_state

    !> Values that vanish, and their rates, in the symbols of free bodies: two, and two more for each joint that leads by gears.
    type :: constraint_type
        integer, allocatable :: link(:)
        type(body_state), allocatable :: symbol(:)     !! (as in link)
        type(value), allocatable :: c(:), rate(:), rate2(:)
    end type constraint_type

contains

    !> Those of a joint, but for what its variable says where that is given.
    function constraints_of_joint(mechanism, j, is_given) result(constraint)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j
        logical, intent(in) :: is_given                !! a variable of it is
        type(constraint_type) :: constraint
        type(rate_map) :: rates
        type(marker_pair) :: pair
        type(value), allocatable :: still(:)
        integer :: k

        call add_free_pair(mechanism, j, .false., constraint, rates, pair)
        constraint%c = mechanism%kind(j)%is%constraints(pair)
        if (is_given) constraint%c = constraint%c(:size(constraint%c) - mechanism%kind(j)%is%n_implied())
        still = mechanism%kind(j)%is%standing(pair)
        do k = 1, size(still)
            call set_rate(rates, still(k), zero())
        end do
        call differentiate(constraint, rates)
        if (mechanism%model%is_planar .and. moment_directions(mechanism%model%joint(j)%kind) == along_axes) &
            call turn_in_plane(pair, constraint)
    end function constraints_of_joint

    !> In a plane all that keeps directions together is one angle between the markers, and its rate the difference of two.
    subroutine turn_in_plane(pair, constraint)
        type(marker_pair), intent(in) :: pair
        type(constraint_type), intent(inout) :: constraint
        type(vector) :: sine
        type(value) :: cosine

        associate (a => pair%first, b => pair%second, n => size(constraint%c) - n_along(along_axes), body => constraint%symbol)
            sine = (a%x.cross.b%x) + (a%y.cross.b%y) + (a%z.cross.b%z)
            cosine = (a%x.dot.b%x) + (a%y.dot.b%y) + (a%z.dot.b%z) - constant(1.0_wp)
            constraint%c = [constraint%c(:n), atan2(sine%z, cosine)]
            constraint%rate = [constraint%rate(:n), body(2)%omega%z - body(1)%omega%z]
            constraint%rate2 = [constraint%rate2(:n), body(2)%alpha%z - body(1)%alpha%z]
        end associate
    end subroutine turn_in_plane

    !> Those of a joint variable which is coordinate k, or led by gears as number k. Of an angle's difference full turns do not
    !> count; of joints that lead, those nearest to their starts.
    function constraints_of_variable(mechanism, j, variable, k, leader, weight) result(constraint)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j, variable, k
        integer, intent(in) :: leader(:)               !! joints of the same group that lead it
        type(value), intent(in) :: weight(:)           !! what it takes of their variables (leader)
        type(constraint_type) :: constraint
        type(rate_map) :: rates
        type(marker_pair) :: pair, other
        type(value) :: given
        integer :: i

        call add_free_pair(mechanism, j, .false., constraint, rates, pair)
        call set_rate(rates, mechanism%q(k), mechanism%qd(k))
        call set_rate(rates, mechanism%qd(k), mechanism%qdd(k))
        given = mechanism%q(k)
        do i = 1, size(leader)
            call add_free_pair(mechanism, leader(i), .true., constraint, rates, other)
            given = given + weight(i)*variable_near_start(mechanism, leader(i), other)
        end do
        associate (kind => mechanism%kind(j)%is)
            constraint%c = kind%variable_constraints(pair, variable, given)
            call differentiate(constraint, rates)
            if (kind%wraps(variable)) constraint%c = [atan2(sin(constraint%c(1)), cos(constraint%c(1)))]
        end associate
    end function constraints_of_variable

    !> The variable of a hinge or slide by its markers; of angles that differ by full turns the nearest to that of the start.
    function variable_near_start(mechanism, j, pair) result(q)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j
        type(marker_pair), intent(in) :: pair
        type(value) :: q
        type(value), allocatable :: all(:)

        associate (kind => mechanism%told_kind(j)%is)
            all = kind%variables(pair)
            q = all(1)
            if (kind%wraps(1)) q = q + two_pi*nearest_whole((1/two_pi)*(constant(mechanism%model%scene%joint(j)%start(1)) - q))
        end associate
    end function variable_near_start

    !> The markers of a joint on two more free bodies, and how everything that is fixed in these moves.
    subroutine add_free_pair(mechanism, j, is_told, constraint, rates, pair)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j
        logical, intent(in) :: is_told                 !! in the frames by which its variables are told
        type(constraint_type), intent(inout) :: constraint
        type(rate_map), intent(inout) :: rates
        type(marker_pair), intent(out) :: pair
        type(rotation) :: frame(2)
        type(vector) :: point(2), arm
        type(body_state) :: body(2)
        integer :: side

        do side = 1, 2
            body(side)%position = new_symbol()
            body(side)%velocity = new_symbol()
            body(side)%acceleration = new_symbol()
            body(side)%r = rotation(new_symbol(), new_symbol(), new_symbol())
            body(side)%omega = new_symbol()
            body(side)%alpha = new_symbol()
            call set_vector_rate(rates, body(side)%position, body(side)%velocity)
            call set_vector_rate(rates, body(side)%velocity, body(side)%acceleration)
            call set_vector_rate(rates, body(side)%omega, body(side)%alpha)
            if (is_told) then
                frame(side) = body(side)%r*told_marker_frame(mechanism, j, side)
            else
                frame(side) = body(side)%r*marker_frame(mechanism, j, side)
            end if
            arm = body(side)%r.rotate.marker_point(mechanism, j, side)
            call set_vector_rate(rates, frame(side)%x, body(side)%omega.cross.frame(side)%x)
            call set_vector_rate(rates, frame(side)%y, body(side)%omega.cross.frame(side)%y)
            call set_vector_rate(rates, frame(side)%z, body(side)%omega.cross.frame(side)%z)
            call set_vector_rate(rates, arm, body(side)%omega.cross.arm)
            point(side) = body(side)%position + arm
        end do
        pair = marker_pair(frame(1), frame(2), point(2) - point(1))
        if (allocated(constraint%link)) then
            constraint%link = [constraint%link, mechanism%model%joint(j)%link]
            constraint%symbol = [constraint%symbol, body]
        else
            constraint%link = mechanism%model%joint(j)%link
            constraint%symbol = body
        end if
    end subroutine add_free_pair

    function new_symbol() result(v)
        type(vector) :: v

        v = vector(new_unknown(), new_unknown(), new_unknown())
    end function new_symbol

    subroutine set_vector_rate(rates, v, rate)
        type(rate_map), intent(inout) :: rates
        type(vector), intent(in) :: v, rate

        call set_rate(rates, components(v), components(rate))
    end subroutine set_vector_rate

    subroutine differentiate(constraint, rates)
        type(constraint_type), intent(inout) :: constraint
        type(rate_map), intent(inout) :: rates
        integer :: k

        associate (n => size(constraint%c))
            allocate (constraint%rate(n), constraint%rate2(n))
            do k = 1, n
                constraint%rate(k) = rate_of(rates, constraint%c(k))
                constraint%rate2(k) = rate_of(rates, constraint%rate(k))
            end do
        end associate
    end subroutine differentiate

    ! ---------------------------------------------------------------- for given bodies

    !> Their values: how far they are from being met.
    function errors_of(constraint, body) result(c)
        type(constraint_type), intent(in) :: constraint
        type(body_state), intent(in) :: body(:)         !! (as in link)
        type(value), allocatable :: c(:)
        type(substitution) :: map

        call replace_places(constraint, body, map)
        c = substituted(map, constraint%c)
    end function errors_of

    !> Their rates for velocities, or for small displacements in place of these.
    function velocities_of(constraint, body) result(rate)
        type(constraint_type), intent(in) :: constraint
        type(body_state), intent(in) :: body(:)         !! (as in link)
        type(value), allocatable :: rate(:)
        type(substitution) :: map

        call replace_places(constraint, body, map)
        call replace_velocities(constraint, body, map)
        rate = substituted(map, constraint%rate)
    end function velocities_of

    !> Their second rates.
    function accelerations_of(constraint, body) result(rate2)
        type(constraint_type), intent(in) :: constraint
        type(body_state), intent(in) :: body(:)         !! (as in link)
        type(value), allocatable :: rate2(:)
        type(substitution) :: map
        integer :: side

        call replace_places(constraint, body, map)
        call replace_velocities(constraint, body, map)
        do side = 1, size(body)
            call replace_vector(map, constraint%symbol(side)%acceleration, body(side)%acceleration)
            call replace_vector(map, constraint%symbol(side)%alpha, body(side)%alpha)
        end do
        rate2 = substituted(map, constraint%rate2)
    end function accelerations_of

    subroutine replace_places(constraint, body, map)
        type(constraint_type), intent(in) :: constraint
        type(body_state), intent(in) :: body(:)         !! (as in link)
        type(substitution), intent(inout) :: map
        integer :: side

        do side = 1, size(body)
            associate (symbol => constraint%symbol(side))
                call replace_vector(map, symbol%position, body(side)%position)
                call replace_vector(map, symbol%r%x, body(side)%r%x)
                call replace_vector(map, symbol%r%y, body(side)%r%y)
                call replace_vector(map, symbol%r%z, body(side)%r%z)
            end associate
        end do
    end subroutine replace_places

    subroutine replace_velocities(constraint, body, map)
        type(constraint_type), intent(in) :: constraint
        type(body_state), intent(in) :: body(:)         !! (as in link)
        type(substitution), intent(inout) :: map
        integer :: side

        do side = 1, size(body)
            call replace_vector(map, constraint%symbol(side)%velocity, body(side)%velocity)
            call replace_vector(map, constraint%symbol(side)%omega, body(side)%omega)
        end do
    end subroutine replace_velocities

    subroutine replace_vector(map, old, new)
        type(substitution), intent(inout) :: map
        type(vector), intent(in) :: old, new

        call replace(map, components(old), components(new))
    end subroutine replace_vector
end module linkdyn_constraint_rates
