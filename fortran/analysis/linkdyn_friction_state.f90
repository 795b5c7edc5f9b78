!> Friction of a block of lanes: how contacts slide, what presses them, how much they rub. Contacts are those of joints, then drives
!> that lose some of what they transmit.
module linkdyn_friction_state
    use linkdyn_contact, only: contact_type, n_press, n_part, pressing
    use linkdyn_friction_law, only: friction_of_speed, friction_one_way
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: driven_type
    implicit none (type, external)
    private
    public :: friction_state, prepare_friction, find_factors, pressing_forces, knows_slopes, linear_press, &
        rubs_as_pressed

    type :: friction_state
        real(wp), allocatable :: factor(:, :)          !! friction over pressing force and speed (lane, contact) [s/m]
        real(wp), allocatable :: press(:, :, :)        !! what contacts feel (lane, n_press, contact) [N]
        real(wp), allocatable :: amount(:, :)          !! friction over the speed of the surfaces [N s/m]; of drives friction at the
                                                       !! joint variable [N, N m] (lane, contact)
        real(wp), allocatable :: sense(:, :, :)        !! of contacts that may stick: they slide that way, a unit vector over the
                                                       !! joint variables along which they do, its parts as surfaces slide, or hold,
                                                       !! (2, 0, 0); 0: smooth over their speed (lane, n_part, contact)
        real(wp), allocatable :: driven(:, :, :)       !! of that, what drives wheels apart: the force along their pitch circles
                                                       !! (0), and what is felt for each newton of its size (lane, 0:n_press,
                                                       !! model%driven)
        ! ---- what each amount does to what presses, wherever stops and clutches push
        real(wp), allocatable :: slope(:, :, :, :)     !! (lane, n_press, contact, contact)
        real(wp), allocatable :: mesh_slope(:, :, :)   !! and to forces along pitch circles (lane, model%driven, contact)
        logical, allocatable :: has_slope(:, :)        !! is it known? (lane, contact)
    end type friction_state

contains

    subroutine prepare_friction(n, n_driven, friction)
        integer, intent(in) :: n                       !! contacts and drives
        integer, intent(in) :: n_driven                !! of the contacts, those that feel what drives wheels apart
        type(friction_state), intent(out) :: friction

        allocate (friction%slope(lanes, n_press, n, n), source=0.0_wp)
        allocate (friction%driven(lanes, 0:n_press, n_driven), friction%mesh_slope(lanes, n_driven, n), source=0.0_wp)
        allocate (friction%has_slope(lanes, n), source=.false.)
        allocate (friction%factor(lanes, n), friction%press(lanes, n_press, n), friction%amount(lanes, n), &
                  friction%sense(lanes, n_part, n), source=0.0_wp)
    end subroutine prepare_friction

    !> Factors of the joints' contacts, by how fast they slide. One that holds does not rub, one that slides one way rubs as a
    !> surface does that slides, however slowly.
    pure subroutine find_factors(contact, square, friction)
        type(contact_type), intent(in) :: contact(:)
        real(wp), intent(in) :: square(:, :)           !! of the speeds of their surfaces (lane, contact) [m2/s2]
        type(friction_state), intent(inout) :: friction
        real(wp) :: speed
        integer :: i, lane

        do i = 1, size(contact)
            do lane = 1, lanes
                associate (sense => maxval(abs(friction%sense(lane, :, i))), factor => friction%factor(lane, i))
                    speed = sqrt(max(square(lane, i), 0.0_wp))
                    if (sense > 0) then
                        factor = friction_one_way(contact(i), sense, speed)
                    else
                        factor = friction_of_speed(contact(i), speed)
                    end if
                end associate
            end do
        end do
    end subroutine find_factors

    !> Is it known what all that rubs does to what presses?
    pure logical function knows_slopes(friction, n_used)
        type(friction_state), intent(in) :: friction
        integer, intent(in) :: n_used                  !! lanes

        knows_slopes = all(friction%has_slope(:n_used, :) .or. .not. friction%factor(:n_used, :) > 0)
    end function knows_slopes

    !> What contacts feel but for what drives wheels apart: all that is linear in friction.
    pure function linear_press(driven, friction) result(press)
        type(driven_type), intent(in) :: driven(:)     !! of the model
        type(friction_state), intent(in) :: friction
        real(wp) :: press(lanes, n_press, size(friction%press, 3))
        integer :: i, k

        press = friction%press
        do i = 1, size(driven)
            do k = 1, n_press
                associate (p => press(:, k, driven(i)%contact), of => friction%driven)
                    p = p - abs(of(:, 0, i))*of(:, k, i)
                end associate
            end do
        end do
    end function linear_press

    !> The forces that press.
    pure subroutine pressing_forces(contact, friction, force)
        type(contact_type), intent(in) :: contact(:)   !! those of the state
        type(friction_state), intent(in) :: friction
        real(wp), intent(out) :: force(:, :)           !! (lane, contact) [N]
        integer :: i, lane

        do i = 1, size(contact)
            do lane = 1, lanes
                force(lane, i) = pressing(contact(i), friction%press(lane, :, i))
            end do
        end do
    end subroutine pressing_forces

    !> Is friction what presses makes it, but for rounding? What presses by less than a trifle of the forces at work is all
    !> rounding.
    pure logical function rubs_as_pressed(factor, force, amount, at_work)
        real(wp), intent(in) :: factor(:), force(:), amount(:)     !! see `friction_state`, of one lane (contact)
        real(wp), intent(in) :: at_work                !! the largest force about [N, N m]
        real(wp), parameter :: misfit = 1.0e-6_wp, trifle = 1.0e-8_wp

        rubs_as_pressed = all(abs(factor*force - amount) <= misfit*factor*max(maxval(force), trifle*at_work))
    end function rubs_as_pressed
end module linkdyn_friction_state
