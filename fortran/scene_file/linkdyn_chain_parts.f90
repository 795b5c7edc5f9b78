!> The links and joints of one leg of a chain, their markers placed by rule.
!>
!> Axes of a leg's links: z from the base's side to the platform's, of a carriage those of the base link; y along a hinge and the
!> second axis of a universal joint; in a plane x from the base's side to the platform's. Origins: of the last half of a telescope
!> at the platform, of all others at the base's side. At joint variables of zero crank and rod are in one line, and a telescope or
!> rod on a hinge stands most upright.
module linkdyn_chain_parts
    use linkdyn_chain_kinds, only: chain_kind, letter_len, joints_of_leg, is_crank_kind, is_telescope, joint_kind_of, &
        joint_suffix, drive_of, anywhere
    use linkdyn_constants, only: pi
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, joint_spec, marker_spec, frame_link, joint_spherical, joint_cylindrical
    use linkdyn_scene_links, only: new_marker, add_marker
    implicit none (type, external)
    private
    public :: leg_spec, build_leg, add_beside

    real(wp), parameter :: origin(3) = 0, x_axis(3) = [1, 0, 0], y_axis(3) = [0, 1, 0], z_axis(3) = [0, 0, 1]

    !> What the scene says of a leg.
    type :: leg_spec
        character(len=:), allocatable :: name
        integer :: end_link(2) = 0, end_marker(2) = 0  !! markers of the base and of the platform
        real(wp) :: axis(3) = [0, 1, 0]                !! of the joint at the base; of the universal joint on a carriage; base axes
        real(wp) :: top_axis(3) = [0, 1, 0]            !! of the joint at the platform, platform axes
        real(wp) :: rail(3) = [1, 0, 0]                !! of a carriage, base axes
        real(wp) :: zero(3) = [1, 0, 0]                !! where a crank points at angle zero, base axes
        real(wp) :: length(2) = 0                      !! of crank and rod [m]
        real(wp) :: width = 0                          !! between two parallel rods [m]
        integer :: elbow = 0                           !! to which side the rod is turned against the crank; 0: not said
        real(wp) :: start = 0                          !! of the driven variable [m, rad]
        logical :: has_start = .false.
        integer :: line = 0
    end type leg_spec

contains

    !> Markers and joints of a leg. The links have their mass properties.
    subroutine build_leg(kind, leg, first_link, first_joint, scene)
        type(chain_kind), intent(in) :: kind
        type(leg_spec), intent(in) :: leg
        integer, intent(in) :: first_link, first_joint     !! where the leg's own begin
        type(scene_type), intent(inout) :: scene
        character(len=letter_len) :: letters
        real(wp) :: aside
        integer :: k

        letters = letters_in(kind, scene%planar)
        call join(1, joint_suffix(letters, 1), 0, first_link, first_joint, 0.0_wp)
        if (kind%is_parallelogram) then
            do k = 1, 2
                aside = merge(1, -1, k == 1)*leg%width/2
                call join(2, joint_suffix("SSSS", 2*k - 1), first_link, first_link + k, first_joint + 2*k - 1, aside)
                call join(3, joint_suffix("SSSS", 2*k), first_link + k, 0, first_joint + 2*k, aside)
            end do
        else
            call join(2, joint_suffix(letters, 2), first_link, first_link + 1, first_joint + 1, 0.0_wp)
            call join(3, joint_suffix(letters, 3), first_link + 1, 0, first_joint + 2, 0.0_wp)
        end if
        call start_joints(kind, leg, scene%joint(first_joint:first_joint + joints_of_leg(kind) - 1))

    contains

        !> Joint m of the row, between two links of the leg; 0: the base or the platform.
        subroutine join(m, suffix, from, to, index, aside)
            integer, intent(in) :: m, from, to, index
            character(len=*), intent(in) :: suffix
            real(wp), intent(in) :: aside                  !! along the second axis [m]
            type(marker_spec) :: marker
            integer :: side, link(2), place(2)

            link = [from, to]
            do side = 1, 2
                if (link(side) > 0) then
                    marker = marker_in_leg(kind, letters, m, side, leg, scene%planar, aside)
                    marker%name = suffix
                    marker%line = leg%line
                    call add_marker(scene%link(link(side)), marker)
                    place(side) = size(scene%link(link(side))%marker)
                    cycle
                end if
                link(side) = leg%end_link(side)
                place(side) = leg%end_marker(side)
                if (letters(m:m) == "S" .and. .not. kind%is_parallelogram) cycle
                ! legs may share a point and yet differ in their directions: each brings its own marker
                marker = marker_at_end(letters, m, side, leg, scene%planar, aside)
                marker%name = leg%name//"."//suffix
                marker%line = leg%line
                call add_beside(leg%end_marker(side), link(side), marker, scene, place(side))
            end do
            scene%joint(index) = joint_spec(name=leg%name//"."//suffix, kind=joint_kind_of(letters(m:m)), line=leg%line, &
                                            link=link, marker=place)
        end subroutine join
    end subroutine build_leg

    !> One more marker on the base or the platform, placed as seen from another.
    subroutine add_beside(other, link, marker, scene, place)
        integer, intent(in) :: other, link
        type(marker_spec), intent(inout) :: marker
        type(scene_type), intent(inout) :: scene
        integer, intent(out) :: place                      !! among the link's markers

        if (link == frame_link) then
            marker%at = marker%at + scene%frame%marker(other)%at
            call add_marker(scene%frame, marker)
            place = size(scene%frame%marker)
        else
            marker%at = marker%at + scene%link(link)%marker(other)%at
            call add_marker(scene%link(link), marker)
            place = size(scene%link(link)%marker)
        end if
    end subroutine add_beside

    !> A cylinder is what its space makes of it.
    pure function letters_in(kind, planar) result(letters)
        type(chain_kind), intent(in) :: kind
        logical, intent(in) :: planar
        character(len=letter_len) :: letters

        letters = kind%letters
        if (planar .and. kind%space == anywhere) letters = "RPR"
    end function letters_in

    !> The marker of joint m on the link before it (side 1, its far end) or behind it (side 2, its near end).
    pure function marker_in_leg(kind, letters, m, side, leg, planar, aside) result(marker)
        type(chain_kind), intent(in) :: kind
        character(len=*), intent(in) :: letters
        integer, intent(in) :: m, side
        type(leg_spec), intent(in) :: leg
        logical, intent(in) :: planar
        real(wp), intent(in) :: aside
        type(marker_spec) :: marker
        real(wp) :: along(3), at(3)
        logical :: at_elbow

        along = merge(x_axis, z_axis, planar)
        at = 0
        if (side == 1) at = leg%length(m - 1)*along + aside*merge(y_axis, 0*y_axis, m == 2)
        at_elbow = is_crank_kind(kind) .and. m == 2
        select case (letters(m:m))
        case ("P")
            marker = marker_along(at, merge(leg%rail, along, m == 1))
        case ("C")
            marker = marker_along(at, along)
        case ("R")
            marker = marker_along(at, y_axis, along)
            if (planar) then
                marker = marker_along(at, x_axis, x_axis)
            else if (side == 1 .and. m == 2 .and. .not. at_elbow) then
                marker = marker_along(at, leg%axis, upright(leg%axis))
            end if
        case ("U")
            if (at_elbow) then
                marker = marker_along(at, y_axis, along)
            else if (side == 1 .and. m == 2) then
                marker = marker_along(at, leg%axis, -upright(leg%axis))
            else if (m == 3 .and. is_telescope(kind)) then
                marker = marker_along(at, y_axis, along)
            else if (letters == "UPS") then
                marker = marker_along(at, y_axis)
            else
                marker = marker_along(at, y_axis, -along)
            end if
        case default
            marker = marker_along(at, along)
            if (at_elbow) marker = marker_along(at, y_axis, along)
        end select
    end function marker_in_leg

    !> Where a leg hangs on its base or holds its platform, seen from the marker there.
    pure function marker_at_end(letters, m, side, leg, planar, aside) result(marker)
        character(len=*), intent(in) :: letters
        integer, intent(in) :: m, side
        type(leg_spec), intent(in) :: leg
        logical, intent(in) :: planar
        real(wp), intent(in) :: aside
        type(marker_spec) :: marker

        select case (letters(m:m))
        case ("P")
            marker = marker_along(origin, leg%rail)
        case ("R")
            if (planar) then
                marker = marker_along(origin, x_axis, merge(leg%zero, x_axis, side == 1))
            else
                marker = marker_along(origin, leg%axis, leg%zero)
                if (letters(2:2) == "P") marker%x_axis = upright(leg%axis)
            end if
        case ("U")
            if (letters == "UPS") then
                marker = marker_along(origin, leg%axis)
            else if (side == 1) then
                marker = marker_along(origin, leg%axis, -upright(leg%axis))
            else
                marker = marker_along(origin, leg%top_axis, upright(leg%top_axis))
            end if
        case default
            marker = marker_along(aside*leg%top_axis, z_axis)
        end select
    end function marker_at_end

    !> What stands most upright of what is square to an axis: there a leg on universal joints has its zeros.
    pure function upright(axis)
        real(wp), intent(in) :: axis(3)
        real(wp) :: upright(3)

        upright = z_axis - axis(3)*axis
        ! an axis as good as upright itself has nothing of it left
        if (norm2(upright) < 0.1_wp) upright = x_axis - axis(1)*axis
        upright = upright/norm2(upright)
    end function upright

    !> With x as it is given, else as it comes.
    pure function marker_along(at, axis, x) result(marker)
        real(wp), intent(in) :: at(3), axis(3)
        real(wp), intent(in), optional :: x(3)
        type(marker_spec) :: marker

        marker = new_marker("", at, axis, 0)
        if (present(x)) marker%x_axis = x
    end function marker_along

    !> About where the joints are at the start.
    pure subroutine start_joints(kind, leg, joint)
        type(chain_kind), intent(in) :: kind
        type(leg_spec), intent(in) :: leg
        type(joint_spec), intent(inout) :: joint(:)
        integer :: variable

        associate (driven => joint(drive_of(kind)))
            variable = merge(2, 1, driven%kind == joint_cylindrical)
            if (leg%has_start) then
                driven%start(variable) = leg%start
                driven%has_start = .true.
            end if
        end associate
        if (leg%elbow == 0) return
        ! to a side by a right angle about the hinge: angle, angle1, or of a ball yaw
        call turn_elbow(joint(2))
        if (kind%is_parallelogram) call turn_elbow(joint(4))

    contains

        pure subroutine turn_elbow(elbow)
            type(joint_spec), intent(inout) :: elbow

            elbow%has_start = .true.
            elbow%start(merge(3, 1, elbow%kind == joint_spherical)) = leg%elbow*pi/2
        end subroutine turn_elbow
    end subroutine start_joints
end module linkdyn_chain_parts
