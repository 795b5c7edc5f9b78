!> How far errors of the steps have carried off what clutches hold.
module linkdyn_held_places
    use linkdyn_angles, only: matrix_of_angles
    use linkdyn_joint_table, only: joint_spherical
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_measures, only: find_kept
    use linkdyn_model, only: model_type
    use linkdyn_place_motion, only: standing_of
    use linkdyn_scene, only: measure_turn, n_clutch
    implicit none (type, external)
    private
    public :: carried_off

contains

    !> From where each clutch was caught to where it is. What places are rounded by is nothing.
    function carried_off(model, state, about, kept) result(off)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: about(:, :)            !! as of `find_kept`
        real(wp), intent(in) :: kept(:, :)             !! what was found there (lane, n_clutch) [m, rad]
        real(wp) :: off(lanes, n_clutch(model%scene))  !! [m, rad]
        real(wp), parameter :: many = 64               !! roundings that a joint variable takes through the loops
        real(wp) :: here(lanes, size(off, 2))
        integer :: i

        call find_kept(model, state, about, here)
        do i = 1, size(off, 2)
            associate (clutch => model%scene%clutch(i), rounding => many*spacing(max(1.0_wp, abs(kept(:, i)))))
                if (clutch%is_bare) then               ! of surfaces no place tells how far they have slipped
                    off(:, i) = 0
                else if (turns_as_ball(model, i)) then
                    if (clutch%variable(1) == 1) off(:, i:i + 2) = turned_off(here(:, i:i + 2), kept(:, i:i + 2))
                else if (model%scene%laws%measure(clutch%measure(1))%kind == measure_turn) then
                    off(:, i) = turned_from(model, state, i, kept)
                else
                    off(:, i) = here(:, i) - kept(:, i)
                    off(:, i) = sign(max(abs(off(:, i)) - rounding, 0.0_wp), off(:, i))
                end if
            end associate
        end do
    end function carried_off

    !> Does a joint turn as a ball? Its angles tell how it is turned, not how far: that is about the axes of its first marker, all
    !> three at once.
    pure logical function turns_as_ball(model, i)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                       !! clutch

        turns_as_ball = .false.
        associate (joint => model%scene%clutch(i)%joint(1))
            if (joint > 0) turns_as_ball = model%joint(joint)%told_kind == joint_spherical
        end associate
    end function turns_as_ball

    !> Small rotation from one attitude to another, both told by three angles: a small turn about the axes that these are told in.
    pure function turned_off(angle, kept) result(turn)
        real(wp), intent(in), dimension(:, :) :: angle, kept   !! (lane, 3) [rad]
        real(wp) :: turn(lanes, 3), r(3, 3)
        integer :: lane

        do lane = 1, lanes
            r = matmul(matrix_of_angles(angle(lane, :)), transpose(matrix_of_angles(kept(lane, :))))
            turn(lane, :) = [r(3, 2) - r(2, 3), r(1, 3) - r(3, 1), r(2, 1) - r(1, 2)]/2
        end do
    end function turned_off

    !> The same of two markers about one axis of the first, however far they turn about others that are not held: these, if there
    !> are any, are its z. About x and y it is that z which leans, and where it was does not hang on the yaw, which is not kept
    !> then.
    function turned_from(model, state, i, kept) result(turn)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: i                       !! clutch
        real(wp), intent(in) :: kept(:, :)             !! (lane, n_clutch) [rad]
        real(wp) :: turn(lanes)
        real(wp), dimension(lanes, 3) :: angle, was
        real(wp) :: r(3, 3)
        integer :: lane, k

        associate (clutch => model%scene%clutch, measure => model%scene%laws%measure)
            was = 0
            do k = 1, size(clutch)
                if (clutch(k)%event /= clutch(i)%event) cycle
                if (measure(clutch(k)%measure(1))%kind /= measure_turn) cycle
                was(:, measure(clutch(k)%measure(1))%component) = kept(:, k)
            end do
            angle = standing_of(model, state, measure(clutch(i)%measure(1)))
            do lane = 1, lanes
                r = matmul(transpose(matrix_of_angles(angle(lane, :))), matrix_of_angles(was(lane, :)))
                select case (measure(clutch(i)%measure(1))%component)
                case (1)
                    turn(lane) = -r(2, 3)
                case (2)
                    turn(lane) = r(1, 3)
                case default
                    turn(lane) = (r(2, 1) - r(1, 2))/2
                end select
            end do
        end associate
    end function turned_from
end module linkdyn_held_places
