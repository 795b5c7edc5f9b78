!> Joint variables of one joint that slip along one surface: they rest and break loose together, and friction is against the way
!> they slip as a whole.
!>
!> Their slips s count as the surface slides, l s with the levers l of `linkdyn_contact`: |l s| is its speed, and friction f at the
!> joint variables is within |f/l| <= mu N. What begins to slip from rest begins along the unit vector d that it keeps: with the
!> accelerations a of l s without friction, and the response W to f/l,
!>
!>     a - c W d = r d,    |d| = 1,    r > 0
!>
!> Where there is no such d, |W^-1 a| <= c, it is held. At the limit r = 0 that is the way against the force that held it.
module linkdyn_slip_parts
    use linkdyn_cholesky, only: solve_cholesky
    use linkdyn_contact_forces, only: solve_held
    use linkdyn_contact, only: holds_contact, lever_of, no_speed, part_of, slides_along_several
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: scene_type, n_clutch, n_stop
    implicit none (type, external)
    private
    public :: goes_with_others, slip_levers, still_speeds, slip_speeds, slip_senses, with_lead, find_way_loose, &
        list_held, solve_together

contains

    !> Does a clutch hold one of several joint variables that slip as one?
    pure function goes_with_others(scene) result(is_part)
        type(scene_type), intent(in) :: scene
        logical :: is_part(n_clutch(scene))
        integer :: i

        do i = 1, size(is_part)
            is_part(i) = count(scene%clutch%lead == scene%clutch(i)%lead) > 1
        end do
    end function goes_with_others

    !> Speed of the surface over the slip of each clutch; of one that goes alone 1.
    pure function slip_levers(model) result(lever)
        type(model_type), intent(in) :: model
        real(wp) :: lever(n_clutch(model%scene))
        logical :: is_part(size(lever))
        integer :: i, k

        lever = 1
        if (size(lever) == 0) return
        is_part = goes_with_others(model%scene)
        do i = 1, size(lever)
            if (.not. is_part(i)) cycle
            associate (clutch => model%scene%clutch(i))
                do k = 1, size(model%contact)
                    associate (contact => model%contact(k))
                        if (holds_contact(clutch, contact)) lever(i) = lever_of(contact, part_of(contact, clutch))
                    end associate
                end do
            end associate
        end do
    end function slip_levers

    !> Below these speeds a surface that slides along several joint variables has come to rest, if it slides no more the way it did;
    !> of clutches that go alone 0.
    pure function still_speeds(model) result(speed)
        type(model_type), intent(in) :: model
        real(wp) :: speed(n_clutch(model%scene))
        integer :: i, k

        speed = 0
        do i = 1, size(speed)
            do k = 1, size(model%contact)
                associate (contact => model%contact(k))
                    if (.not. slides_along_several(contact)) cycle
                    if (holds_contact(model%scene%clutch(i), contact)) speed(i) = no_speed(contact)
                end associate
            end do
        end do
    end function still_speeds

    !> How fast each clutch slips; of those that go together how fast the surface slides, of each the same.
    pure function slip_speeds(model, slip) result(speed)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: slip(:, :)             !! (lane, n_clutch)
        real(wp) :: speed(lanes, size(slip, 2)), lever(size(slip, 2))
        integer :: i, k

        speed = abs(slip)
        lever = slip_levers(model)
        associate (lead => model%scene%clutch%lead)
            do i = 1, size(slip, 2)
                if (count(lead == lead(i)) == 1) cycle
                speed(:, i) = 0
                do k = 1, size(slip, 2)
                    if (lead(k) == lead(i)) speed(:, i) = speed(:, i) + (lever(k)*slip(:, k))**2
                end do
                speed(:, i) = sqrt(speed(:, i))
            end do
        end associate
    end function slip_speeds

    !> Which way each slips: +1 or -1, of those that go together a unit vector. What has no slip goes up.
    pure function slip_senses(model, slip) result(sense)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: slip(:, :)             !! (lane, n_clutch)
        real(wp), dimension(lanes, size(slip, 2)) :: sense, speed
        real(wp) :: lever(size(slip, 2))
        integer :: i

        speed = slip_speeds(model, slip)
        lever = slip_levers(model)
        associate (lead => model%scene%clutch%lead)
            do i = 1, size(slip, 2)
                if (count(lead == lead(i)) == 1) then
                    sense(:, i) = sign(1.0_wp, slip(:, i))
                else
                    sense(:, i) = merge(lever(i)*slip(:, i)/max(speed(:, i), tiny(1.0_wp)), merge(1.0_wp, 0.0_wp, lead(i) == i), &
                                        speed(:, i) > 0)
                end if
            end do
        end associate
    end function slip_senses

    !> What is true of a clutch's lead is so of the clutch.
    pure function with_lead(scene, is_so) result(is_so_too)
        type(scene_type), intent(in) :: scene
        logical, intent(in) :: is_so(:, :)             !! (lane, n_clutch)
        logical :: is_so_too(lanes, size(is_so, 2))
        integer :: i

        do i = 1, size(is_so, 2)
            is_so_too(:, i) = is_so(:, scene%clutch(i)%lead)
        end do
    end function with_lead

    !> List all that stops and clutches hold: what goes together, and the levers.
    pure subroutine list_held(model, lead, lever)
        type(model_type), intent(in) :: model
        integer, intent(out) :: lead(:)                !! the same of all that go together; below zero: stops, which go alone
                                                       !! (n_held)
        real(wp), intent(out) :: lever(:)              !! speed of the surface over each rate; of what goes alone 1 (n_held)
        integer :: i, n

        n = n_stop(model%scene)
        do i = 1, n
            lead(i) = -i
            lever(i) = 1
        end do
        do i = 1, n_clutch(model%scene)
            lead(n + i) = model%scene%clutch(i)%lead
        end do
        lever(n + 1:) = slip_levers(model)
    end subroutine list_held

    !> Pushes that give these changes. Where the joint variables of a surface depend on each other, as those of a ball in a loop do,
    !> what holds it is the least of all that does so: along the ways that it can slide.
    pure function solve_together(lead, lever, response, wanted) result(push)
        integer, intent(in) :: lead(:)
        real(wp), intent(in) :: lever(:)
        real(wp), intent(in) :: response(:, :)         !! (of, by)
        real(wp), intent(in) :: wanted(:)
        real(wp) :: push(size(wanted))
        real(wp), parameter :: rigid = 1.0e-10_wp      !! of the surface's largest response: it cannot slide that way
        real(wp) :: ways(size(wanted), size(wanted)), largest
        real(wp), allocatable :: own(:, :), way(:)
        integer, allocatable :: part(:)
        integer :: i, k, n, longest

        if (all([(count(lead == lead(i)) == 1, i=1, size(lead))])) then
            push = solve_held(response, wanted)
            return
        end if
        ways = 0
        n = 0
        do i = 1, size(lead)
            if (any(lead(:i - 1) == lead(i))) cycle
            part = pack([(k, k=1, size(lead))], lead == lead(i))
            own = response(part, part)
            do k = 1, size(part)
                own(:, k) = lever(part)*own(:, k)*lever(part(k))
            end do
            largest = maxval(abs(own))
            do k = 1, size(part)
                longest = maxloc(norm2(own, dim=1), dim=1)
                if (size(part) > 1 .and. norm2(own(:, longest)) <= rigid*largest) exit
                way = own(:, longest)/max(norm2(own(:, longest)), tiny(1.0_wp))
                if (size(part) == 1) way = [1.0_wp]
                n = n + 1
                ways(part, n) = lever(part)*way
                own = own - spread(way, 2, size(part))*spread(matmul(way, own), 1, size(part))
            end do
        end do
        push = matmul(ways(:, :n), solve_held(matmul(transpose(ways(:, :n)), matmul(response, ways(:, :n))), &
                                              matmul(wanted, ways(:, :n))))
    end function solve_together

    !> The way in which a surface begins to slide from rest. Where others hold it, too, nothing moves it any way.
    pure subroutine find_way_loose(alone, response, capacity, moves, way, is_held)
        real(wp), intent(in) :: alone(:, :)            !! W if nothing else held
        real(wp), intent(in) :: response(:, :)         !! W
        real(wp), intent(in) :: capacity               !! c
        real(wp), intent(in) :: moves(:)               !! a - c W d as it slides now
        real(wp), intent(inout) :: way(:)              !! d; stays if it is held
        logical, intent(out) :: is_held
        real(wp), parameter :: rigid = 1.0e-10_wp      !! of the response alone: that is none
        real(wp) :: apart(size(way))
        integer, parameter :: most_halvings = 60
        real(wp), parameter :: least = 1.0e-15_wp      !! of |a|
        real(wp) :: low, high, middle, found(size(way))
        integer :: turn

        is_held = .false.
        if (maxval(abs(response)) <= rigid*maxval(abs(alone))) return
        apart = moves + capacity*matmul(response, way)
        low = least*norm2(apart)
        high = norm2(apart)
        found = with_rate(low)
        is_held = .not. norm2(found) > 1
        if (is_held) return
        do turn = 1, most_halvings
            middle = (low + high)/2
            found = with_rate(middle)
            if (norm2(found) > 1) then
                low = middle
            else
                high = middle
            end if
        end do
        if (norm2(found) > 0) way = found/norm2(found)

    contains

        !> (r + c W)^-1 a: the longer, the less r is.
        pure function with_rate(rate) result(x)
            real(wp), intent(in) :: rate
            real(wp) :: x(size(apart))
            real(wp) :: matrix(lanes, size(apart), size(apart)), right(lanes, size(apart))
            logical :: is_singular(lanes)
            integer :: i

            matrix = spread(capacity*(response + transpose(response))/2, 1, lanes)
            right = spread(apart, 1, lanes)
            do i = 1, size(apart)
                matrix(:, i, i) = matrix(:, i, i) + rate
            end do
            call solve_cholesky(size(apart), matrix, right, is_singular)
            x = right(1, :)
        end function with_rate
    end subroutine find_way_loose
end module linkdyn_slip_parts
