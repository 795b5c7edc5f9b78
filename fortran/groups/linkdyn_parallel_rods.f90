!> How surely three pairs of parallel rods hold the attitude of a platform that only shifts, as that of a Delta robot does.
!>
!> Both rods of a pair lie along n. From one end to the other the pair is as wide as w at the platform, and at the crank or
!> carriage, which cannot turn w. A turn omega of the platform would make rods of other lengths of them, by n . (omega x w) =
!> omega . (w x n): with the directions m = w x n of the three pairs,
!>
!>     margin = m1 . (m2 x m3)     of unit vectors m
!>
!> is zero where a turn about some axis is held by no pair: all rods parallel, say. One rod between universal joints, their outer
!> axes along u, lets the platform turn about u and about its inner axes, along u x n: it holds it about m = u x (u x n).
!> docs/theory.md has more of it.
module linkdyn_parallel_rods
    use linkdyn_bodies, only: world_axes, omega_of, point_position, point_velocity, rotation_of
    use linkdyn_mechanism, only: mechanism_type, marker_point, marker_frame, must_be_positive, least_square
    use linkdyn_model, only: step_type, rod_of, side_of
    use linkdyn_value, only: value, operator(+), operator(-), operator(*), sqrt, square, reciprocal
    use linkdyn_vector, only: vector, rotation, operator(-), operator(+), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.)
    implicit none (type, external)
    private
    public :: must_hold, margin_of_hold

    integer, parameter :: n_pair = 3

    !> One pair of parallel rods.
    type :: pair_type
        type(vector) :: m                                  !! of unit length
        type(vector) :: m_rate                             !! [1/s]
    end type pair_type

contains

    !> The pairs hold the attitude, and not hardly. On either side of where they do not the platform only shifts: it is the same
    !> assembly.
    subroutine must_hold(mechanism, step)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(value) :: margin, drift

        call margin_of_hold(mechanism, step, margin, drift)
        call must_be_positive(mechanism, square(margin) - least_square)
    end subroutine must_hold

    !> Margin and its rate. Joints of the step: of each pair, that of its own rod first, both ends of one rod, then the other rod's
    !> end at the platform, if there is another one.
    subroutine margin_of_hold(mechanism, step, margin, drift)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(out) :: margin, drift
        type(pair_type) :: pair(n_pair)
        integer :: k, n

        n = count(step%joint > 0)/n_pair
        do k = 1, n_pair
            call look_at_pair(mechanism, step%joint(n*(k - 1) + 1:n*k), platform_of(mechanism, step), pair(k))
        end do
        margin = pair(1)%m.dot.(pair(2)%m.cross.pair(3)%m)
        drift = (pair(1)%m_rate.dot.(pair(2)%m.cross.pair(3)%m)) + (pair(2)%m_rate.dot.(pair(3)%m.cross.pair(1)%m)) &
                + (pair(3)%m_rate.dot.(pair(1)%m.cross.pair(2)%m))
    end subroutine margin_of_hold

    !> The direction m about which a pair of rods holds the attitude of its platform, of unit length, and its rate.
    subroutine look_at_pair(mechanism, joint, platform, pair)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint(:)                    !! inner and outer joint of a rod, outer joint of the other
        integer, intent(in) :: platform
        type(pair_type), intent(out) :: pair
        type(vector) :: rod, rod_rate, width, width_rate, m, m_rate
        type(rotation) :: frame
        type(value) :: per_length
        integer :: inner_side, lead

        associate (bodies => mechanism%bodies, model_joint => mechanism%model%joint)
            associate (outer => model_joint(joint(2)), inner => model_joint(joint(1)))
                inner_side = merge(2, 1, any(outer%link == inner%link(1)))
                lead = inner%link(inner_side)
            end associate
            if (size(joint) == 3) then
                width = on_platform(2) - on_platform(3)
            else
                frame = marker_frame(mechanism, joint(2), side_of(model_joint(joint(2)), platform))
                width = rotation_of(bodies, platform) .rotate.frame%z
            end if
            rod = on_platform(2) - point_position(bodies, lead, marker_point(mechanism, joint(1), inner_side))
            rod_rate = point_velocity(bodies, platform, own_point(2)) &
                       - point_velocity(bodies, lead, marker_point(mechanism, joint(1), inner_side))
            width_rate = omega_of(bodies, platform, world_axes) .cross.width
        end associate
        m = width.cross.rod
        m_rate = (width_rate.cross.rod) + (width.cross.rod_rate)
        if (size(joint) == 2) then
            m_rate = (width_rate.cross.m) + (width.cross.m_rate)
            m = width.cross.m
        end if
        per_length = reciprocal(sqrt(m.dot.m))
        pair%m = per_length*m
        pair%m_rate = per_length*m_rate
        pair%m_rate = pair%m_rate - (pair%m.dot.pair%m_rate)*pair%m

    contains

        function own_point(i) result(point)
            integer, intent(in) :: i
            type(vector) :: point

            point = marker_point(mechanism, joint(i), side_of(mechanism%model%joint(joint(i)), platform))
        end function own_point

        function on_platform(i) result(place)
            integer, intent(in) :: i
            type(vector) :: place

            place = point_position(mechanism%bodies, platform, own_point(i))
        end function on_platform
    end subroutine look_at_pair

    pure integer function platform_of(mechanism, step) result(platform)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step

        associate (outer => mechanism%model%joint(step%joint(2)))
            platform = outer%link(3 - side_of(outer, rod_of(step)))
        end associate
    end function platform_of
end module linkdyn_parallel_rods
