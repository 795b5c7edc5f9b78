!> Springs with dampers: between two markers, along their line, or at a joint variable; and laws that pull along a measure.
module linkdyn_springs
    use linkdyn_acting, only: acting_type, at_joint_variable, at_place
    use linkdyn_bodies, only: point_position, point_velocity
    use linkdyn_joint_variables, only: variable_near, variable_rate
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type, spring_numbers, spring_point, must_be_positive
    use linkdyn_scene, only: at_stiffness, at_damping, at_rest
    use linkdyn_value, only: value, zero, is_zero, operator(+), operator(-), operator(*), sqrt, reciprocal, square
    use linkdyn_vector, only: vector, zero_vector, operator(-), operator(*), operator(.dot.)
    implicit none (type, external)
    private
    public :: apply_spring, keep_direction, needs_direction, spring_energy, measure_spring_stretch

contains

    !> What one spring of the scene does to its links.
    subroutine apply_spring(mechanism, i, acting)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: i
        type(acting_type), allocatable, intent(out) :: acting(:)    !! one at a joint, two at markers
        type(value) :: length, rate, tension
        type(vector) :: line, pull, on_first
        integer :: side

        associate (spring => mechanism%model%scene%spring(i))
            if (spring%measure > 0) then
                acting = at_place(mechanism, mechanism%model%scene%laws%measure(spring%measure), -mechanism%pull(i))
                return
            end if
            if (needs_direction(mechanism, i)) then
                call measure_spring(mechanism, i, length, rate, line)
                associate (k => spring_numbers(mechanism, i))
                    tension = k(at_stiffness)*(length - k(at_rest)) + k(at_damping)*rate + mechanism%pull(i)
                end associate
                if (spring%joint > 0) then
                    acting = [at_joint_variable(mechanism, spring%joint, spring%variable, -tension)]
                    return
                end if
                call keep_direction(mechanism, i)
                on_first = tension*line
            else
                associate (k => spring_numbers(mechanism, i))
                    on_first = k(at_stiffness)*span_of(mechanism, i)
                end associate
            end if
            allocate (acting(2))
            do side = 1, 2
                pull = on_first
                if (side == 2) pull = -pull
                acting(side)%link = spring%link(side)
                acting(side)%point = spring_point(mechanism, i, side)
                acting(side)%force = pull
                acting(side)%moment = zero_vector()
            end do
        end associate
    end subroutine apply_spring

    !> Between markers, without rest and damping, the force is stiffness times the way from one marker to the other: none where they
    !> coincide.
    logical function needs_direction(mechanism, i)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: k(3)

        needs_direction = .false.
        if (mechanism%model%scene%spring(i)%measure > 0) return
        k = spring_numbers(mechanism, i)
        needs_direction = mechanism%model%scene%spring(i)%joint > 0 .or. .not. (is_zero(k(at_damping)) .and. is_zero(k(at_rest)) &
                                                                               .and. is_zero(mechanism%pull(i)))
    end function needs_direction

    !> Rounding leaves markers uncertain by a few eps of their distances from the origin: where they nearly coincide, half of
    !> the digits of their direction must remain.
    subroutine keep_direction(mechanism, i)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: i
        type(vector) :: point(2), span
        integer :: side

        do side = 1, 2
            point(side) = point_position(mechanism%bodies, mechanism%model%scene%spring(i)%link(side), &
                                         spring_point(mechanism, i, side))
        end do
        span = span_of(mechanism, i)
        call must_be_positive(mechanism, (span.dot.span) - (2*epsilon(1.0_wp))*((point(1).dot.point(1)) + (point(2).dot.point(2))))
    end subroutine keep_direction

    !> Energy stored.
    function spring_energy(mechanism, i) result(energy)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: energy                          !! [J]
        type(value) :: length, rate, k(3)
        type(vector) :: line

        energy = zero()
        if (mechanism%model%scene%spring(i)%measure > 0) return
        call measure_spring(mechanism, i, length, rate, line)
        k = spring_numbers(mechanism, i)
        energy = (0.5_wp*k(at_stiffness))*square(length - k(at_rest))
    end function spring_energy

    !> Measure by how much a spring is longer than at rest, and how fast that grows.
    subroutine measure_spring_stretch(mechanism, i, stretch, rate)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value), intent(out) :: stretch, rate
        type(value) :: k(3), length
        type(vector) :: line

        k = spring_numbers(mechanism, i)
        call measure_spring(mechanism, i, length, rate, line)
        stretch = length - k(at_rest)
    end subroutine measure_spring_stretch

    !> Length or joint variable of a spring, its rate, and between markers the direction from the first to the second.
    subroutine measure_spring(mechanism, i, length, rate, line)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value), intent(out) :: length, rate
        type(vector), intent(out) :: line
        type(vector) :: span, velocity
        type(value) :: k(3)

        associate (spring => mechanism%model%scene%spring(i), bodies => mechanism%bodies)
            if (spring%joint > 0) then
                k = spring_numbers(mechanism, i)
                length = variable_near(mechanism, spring%joint, spring%variable, k(at_rest))
                rate = variable_rate(mechanism, spring%joint, spring%variable)
                line = zero_vector()
                return
            end if
            span = span_of(mechanism, i)
            velocity = point_velocity(bodies, spring%link(2), spring_point(mechanism, i, 2)) &
                       - point_velocity(bodies, spring%link(1), spring_point(mechanism, i, 1))
            length = sqrt(span.dot.span)
            line = reciprocal(length)*span
            rate = line.dot.velocity
        end associate
    end subroutine measure_spring

    !> From the first marker to the second, world axes [m].
    function span_of(mechanism, i) result(span)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(vector) :: span

        associate (link => mechanism%model%scene%spring(i)%link, bodies => mechanism%bodies)
            span = point_position(bodies, link(2), spring_point(mechanism, i, 2)) &
                   - point_position(bodies, link(1), spring_point(mechanism, i, 1))
        end associate
    end function span_of
end module linkdyn_springs
