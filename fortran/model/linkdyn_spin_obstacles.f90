!> What feels the spin of a rod between balls, so that it is not idle: each kind of obstacle in a sentence.
submodule (linkdyn_idle_spin) linkdyn_spin_obstacles
    use linkdyn_model, only: point_on
    use linkdyn_scene, only: axes_link, law_none, law_constant, law_cycloidal, law_polynomial_345, law_table, law_over, law_spec, &
        measure_marker, measure_distance
    use linkdyn_text, only: to_text
    implicit none (type, external)

contains

    module procedure why_spin_matters
        why = why_of_bodies(model, spin)
        if (why == "") why = why_of_loads(model, spin)
        if (why == "") why = why_of_payloads(model, spin)
        if (why == "") why = why_of_friction(model, spin)
        if (why == "") why = why_of_springs(model, spin)
        if (why == "") why = why_of_stops(model, spin)
        if (why == "") why = why_of_clutches(model, spin)
    end procedure why_spin_matters

    !> Bodies that are not round about the line.
    function why_of_bodies(model, spin) result(why)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin
        character(len=:), allocatable :: why
        integer :: i

        why = ""
        do i = 1, size(spin%link)
            associate (link => model%link(spin%link(i)))
                if (is_off_line(model, spin%link(i), link%cog) .and. link%mass > 0) then
                    why = "the centre of mass of "//quoted(link%name)//" is "// &
                          to_text(distance_of(model, spin%link(i), link%cog))//" m off it"
                    return
                end if
                if (.not. is_round(link%inertia, link%spin_axis)) then
                    why = "the moments of inertia of "//quoted(link%name)//" across it are not the same in all directions"
                    return
                end if
            end associate
        end do
    end function why_of_bodies

    !> Loads with a moment, off the line, or across it in a direction that turns.
    function why_of_loads(model, spin) result(why)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin
        character(len=:), allocatable :: why
        integer :: i, k

        why = ""
        do i = 1, size(model%scene%load)
            associate (load => model%scene%load(i))
                if (all(spin%link /= load%link)) cycle
                if (any([(is_there(load%moment(k)), k=1, 3)])) then
                    why = "a load on "//quoted(load%name)//" has a moment"
                else if (load%axes == axes_link .and. .not. is_along(load%force, model%link(load%link)%spin_axis)) then
                    why = "a load on "//quoted(load%name)//" has a force across it that turns with the link"
                else if (is_off_line(model, load%link, model%scene%link(load%link)%marker(load%marker)%at)) then
                    why = "a load on "//quoted(load%name)//" acts off it"
                else
                    cycle
                end if
                return
            end associate
        end do
    end function why_of_loads

    !> Payloads that are no points on the line.
    function why_of_payloads(model, spin) result(why)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin
        character(len=:), allocatable :: why
        integer :: i

        why = ""
        do i = 1, size(model%payload)
            associate (payload => model%payload(i))
                if (all(spin%link /= payload%link)) cycle
                if (.not. is_off_line(model, payload%link, payload%body%cog) .and. all(payload%body%inertia == 0)) cycle
                why = "the payload on "//quoted(payload%body%name)//" is no point on it"
                return
            end associate
        end do
    end function why_of_payloads

    !> Friction in a joint to a link that does not spin as well.
    function why_of_friction(model, spin) result(why)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin
        character(len=:), allocatable :: why
        integer :: i

        why = ""
        do i = 1, size(model%scene%friction)
            associate (joint => model%joint(model%scene%friction(i)%joint))
                if (any(spin%link == joint%link(1)) .eqv. any(spin%link == joint%link(2))) cycle
                why = "friction at joint "//quoted(joint%name)//" holds it back"
                return
            end associate
        end do
    end function why_of_friction

    !> Springs between markers off the line.
    function why_of_springs(model, spin) result(why)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin
        character(len=:), allocatable :: why
        integer :: i, l, side

        why = ""
        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                if (spring%joint > 0 .or. spring%measure > 0) cycle
                do side = 1, 2
                    l = spring%link(side)
                    if (all(spin%link /= l)) cycle
                    if (.not. is_off_line(model, l, model%scene%link(l)%marker(spring%marker(side))%at)) cycle
                    why = "spring "//quoted(spring%name)//" pulls on "//quoted(model%link(l)%name)//" off it"
                    return
                end do
            end associate
        end do
    end function why_of_springs

    !> Stops that push beside the line.
    function why_of_stops(model, spin) result(why)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin
        character(len=:), allocatable :: why
        integer :: i, l

        why = ""
        do i = 1, n_stop(model%scene)
            l = pushed_off_line(model, spin, model%scene%laws%measure(model%scene%stop(i)%measure))
            if (l == frame_link) cycle
            why = "stop "//quoted(model%scene%stop(i)%name)//" pushes "//quoted(model%link(l)%name)//" off it"
            return
        end do
    end function why_of_stops

    !> Clutches that hold points beside the line; wheels and cams are led.
    function why_of_clutches(model, spin) result(why)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin
        character(len=:), allocatable :: why
        integer :: i, l

        why = ""
        do i = 1, n_clutch(model%scene)
            associate (clutch => model%scene%clutch(i))
                if (clutch%is_bare) cycle
                l = pushed_off_line(model, spin, model%scene%laws%measure(clutch%measure(1)))
                if (l == frame_link) cycle
                why = "clutch "//quoted(model%scene%event(clutch%event)%name)//" holds "//quoted(model%link(l)%name)//" off it"
                return
            end associate
        end do
    end function why_of_clutches

    !> A link that spins and that forces along a measure push beside its line; the frame: none.
    integer function pushed_off_line(model, spin, measure) result(link)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin
        type(measure_spec), intent(in) :: measure
        integer :: side

        do side = 1, 2
            link = measure%link(side)
            if (.not. any(measure%kind == [measure_marker, measure_distance]) .or. all(spin%link /= link)) cycle
            if (is_off_line(model, link, point_of(model, link, measure%marker(side)))) return
        end do
        link = frame_link
    end function pushed_off_line

    !> A marker of a link; 0: its origin.
    pure function point_of(model, l, marker) result(point)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l, marker
        real(wp) :: point(3)

        point = 0
        if (marker > 0) point = model%scene%link(l)%marker(marker)%at
    end function point_of

    !> Farther from the link's line than numbers of a scene are rounded?
    pure logical function is_off_line(model, l, point)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l
        real(wp), intent(in) :: point(3)

        is_off_line = distance_of(model, l, point) > exact*size_of(model, l)
    end function is_off_line

    pure real(wp) function distance_of(model, l, point)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l
        real(wp), intent(in) :: point(3)

        distance_of = distance_from(line_type(.true., model%link(l)%spin_point, model%link(l)%spin_axis), point)
    end function distance_of

    !> The largest coordinate of a link's joints, centre of mass or extension [m].
    pure real(wp) function size_of(model, l)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l
        integer :: k

        size_of = maxval(abs(model%link(l)%cog))
        do k = model%first_at(l), model%first_at(l + 1) - 1
            associate (joint => model%joint(model%joint_at(k)))
                size_of = max(size_of, maxval(abs(point_on(joint, l))))
            end associate
        end do
    end function size_of

    !> May a law be other than zero?
    pure logical function is_there(law)
        type(law_spec), intent(in) :: law

        is_there = law%kind /= law_none .and. .not. (law%kind == law_constant .and. .not. abs(law%value(1)) > 0)
    end function is_there

    !> Has a force in link axes the direction of an axis at every instant? Its components then go in proportion.
    pure logical function is_along(force, axis)
        type(law_spec), intent(in) :: force(3)
        real(wp), intent(in) :: axis(3)
        real(wp), allocatable :: part(:, :)        !! what the components are in proportion to their sizes (3, part)
        logical :: there(3)
        integer :: k, first

        there = [(is_there(force(k)), k=1, 3)]
        first = findloc(there, .true., dim=1)
        is_along = all([(.not. there(k) .or. k == first .or. have_one_course(force(k), force(max(first, 1))), k=1, 3)])
        if (first == 0 .or. .not. is_along) return
        allocate (part(3, size(sizes_of(force(first)))), source=0.0_wp)
        do k = 1, 3
            if (there(k)) part(k, :) = sizes_of(force(k))
        end do
        do k = 1, size(part, 2)
            is_along = is_along .and. norm2(part(:, k)) - abs(dot_product(part(:, k), axis)) <= exact*norm2(part(:, k))
        end do
    end function is_along

    !> Do two laws differ in their sizes alone?
    pure logical function have_one_course(a, b) result(same)
        type(law_spec), intent(in) :: a, b

        same = a%kind == b%kind .and. size(sizes_of(a)) == size(sizes_of(b))
        if (.not. same) return
        select case (a%kind)
        case (law_over)
            same = .false.
        case (law_cycloidal, law_polynomial_345, law_table)
            same = all(a%time == b%time) .and. (allocated(a%curvature) .eqv. allocated(b%curvature))
        case default
            same = all(a%value(3:) == b%value(3:))
        end select
    end function have_one_course

    !> The numbers of a law that are the larger the larger it is; of one over the state, which is alone, any.
    pure function sizes_of(law) result(number)
        type(law_spec), intent(in) :: law
        real(wp), allocatable :: number(:)

        select case (law%kind)
        case (law_over)
            number = [1.0_wp]
        case (law_cycloidal, law_polynomial_345, law_table)
            number = law%knot
        case default
            number = law%value(:2)
        end select
    end function sizes_of
end submodule linkdyn_spin_obstacles
