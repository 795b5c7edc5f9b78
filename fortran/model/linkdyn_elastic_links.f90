!> Links that give way: an elastic arm from where a link's mass, loads and springs act to each of its joints.
!>
!> The elastic energy of an arm is half a sum of squares, weight times (row . wrench)^2: the wrench of all that the joint does to
!> the link, about the link's marker, link axes. Of a beam with the force F and the moment M at its end, e along it, y and z across,
!>
!>     (e.F)^2 L/EA + (e.M)^2 L/GJ + (z.M + L/2 y.F)^2 L/EIz + (y.F)^2 (L^3/12EIz + L/GA)
!>                                 + (y.M - L/2 z.F)^2 L/EIy + (z.F)^2 (L^3/12EIy + L/GA)
!>
!> **Source**: S. Timoshenko, *Strength of Materials*, part I (1930), chapter XI, for the energy of bending.
module linkdyn_elastic_links
    use linkdyn_constraint_rows, only: loop_type, rows_type, joint_point
    use linkdyn_cross, only: cross
    use linkdyn_joint_table, only: is_geared, joint_cam
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, arm_type
    use linkdyn_scene, only: link_spec, arm_spec, joint_spec
    use linkdyn_status, only: status_type, status_bad_input, fail
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: take_arms, wrench_on_arm, list_arm_parts, misfit_of

    real(wp), parameter :: rounding = 1.0e-12_wp        !! what is left of a compliance that is in others already
    real(wp), parameter :: hardly_across = 1.0e-6_wp    !! of a unit vector, that a section's y must stand off the beam

contains

    !> The arms of the scene's links to the markers that joints hold.
    !>
    !> **Errors**: `status_bad_input` if a section lies along its beam.
    subroutine take_arms(model, status)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        type(arm_type) :: arm
        integer :: j, side

        allocate (model%arm(0))
        do j = 1, model%n_joint
            associate (joint => model%scene%joint(j))
                if (is_geared(joint%kind) .or. joint%kind == joint_cam) cycle
                do side = 1, 2
                    if (joint%link(side) == 0) cycle
                    arm = arm_type(joint=j, side=side)
                    call take_arm(model%scene%link(joint%link(side)), joint%marker(side), model%joint(j)%point(:, side), arm, &
                                  status)
                    if (.not. status%is_ok()) return
                    if (arm%n > 0) model%arm = [model%arm, arm]
                end do
            end associate
        end do
    end subroutine take_arms

    !> What the link says of a marker by name counts before what it says of all.
    subroutine take_arm(link, marker, point, arm, status)
        type(link_spec), intent(in) :: link
        integer, intent(in) :: marker
        real(wp), intent(in) :: point(3)               !! of the marker, link axes [m]
        type(arm_type), intent(inout) :: arm
        type(status_type), intent(inout) :: status
        integer :: k

        if (.not. allocated(link%arm)) return
        k = findloc(link%arm%marker, marker, dim=1)
        if (marker == 0) k = 0
        if (k == 0) k = findloc(link%arm%marker, 0, dim=1)
        if (k == 0) return
        if (link%arm(k)%is_beam) then
            call take_beam(link, link%arm(k), point - merge(link%cog, link%arm(k)%from, link%arm(k)%from_cog), arm, status)
        else
            call take_compliance(link%arm(k)%compliance, arm)
        end if
    end subroutine take_arm

    !> How a beam gives way to what acts at its end: stretched, twisted, bent both ways and sheared (Timoshenko).
    subroutine take_beam(link, spec, way, arm, status)
        type(link_spec), intent(in) :: link
        type(arm_spec), intent(in) :: spec
        real(wp), intent(in) :: way(3)                 !! from one end of the beam to the other, link axes [m]
        type(arm_type), intent(inout) :: arm
        type(status_type), intent(inout) :: status
        real(wp), parameter :: none(3) = 0
        real(wp), dimension(3) :: e, y, z
        real(wp) :: l, shear

        l = norm2(way)
        if (.not. l > 0) return
        e = way/l
        y = spec%y
        if (.not. norm2(y) > 0) y = any_across(e)
        y = y - dot_product(y, e)*e
        if (norm2(y) < hardly_across) then
            call fail(status, status_bad_input, "link "//quoted(link%name)//", elastic: key 'y' lies along the beam (expected a " &
                      //"direction across it)")
            return
        end if
        y = y/norm2(y)
        z = cross(e, y)
        shear = over(l, spec%beam(2))
        call add_part(arm, e, none, over(l, spec%beam(1)))
        call add_part(arm, none, e, over(l, spec%beam(3)))
        call add_part(arm, l/2*y, z, over(l, spec%beam(5)))
        call add_part(arm, y, none, over(l**3/12, spec%beam(5)) + shear)
        call add_part(arm, -l/2*z, y, over(l, spec%beam(4)))
        call add_part(arm, z, none, over(l**3/12, spec%beam(4)) + shear)

    contains

        !> What is rigid does not give way.
        pure real(wp) function over(a, stiffness)
            real(wp), intent(in) :: a, stiffness

            over = 0
            if (stiffness > 0) over = a/stiffness
        end function over
    end subroutine take_beam

    !> A direction across another one.
    pure function any_across(e) result(y)
        real(wp), intent(in) :: e(3)
        real(wp) :: y(3)

        y = 0
        y(minloc(abs(e), dim=1)) = 1
    end function any_across

    !> Squares of which the compliance is the sum: columns of its factors L D L^T. It has been looked at.
    subroutine take_compliance(compliance, arm)
        real(wp), intent(in) :: compliance(6, 6)
        type(arm_type), intent(inout) :: arm
        real(wp) :: left(6, 6), column(6)
        integer :: k

        left = compliance
        do k = 1, 6
            if (.not. left(k, k) > rounding*compliance(k, k)) cycle
            column = left(:, k)/left(k, k)
            call add_part(arm, column(:3), column(4:), left(k, k))
            left = left - left(k, k)*spread(column, 2, 6)*spread(column, 1, 6)
            left(k, :) = 0
            left(:, k) = 0
        end do
    end subroutine take_compliance

    pure subroutine add_part(arm, of_force, of_moment, weight)
        type(arm_type), intent(inout) :: arm
        real(wp), intent(in) :: of_force(3), of_moment(3)
        real(wp), intent(in) :: weight

        if (.not. weight > 0) return
        arm%n = arm%n + 1
        arm%row(:, arm%n) = [of_force, of_moment]
        arm%weight(arm%n) = weight
    end subroutine add_part

    !> What a wrench on the second body of a joint, at its marker, does to the body of an arm: about its own marker, its axes. The
    !> opposite on the first one is not turned round: energies do not ask.
    pure function wrench_on_arm(model, loop, i, side, wrench) result(own)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        integer, intent(in) :: i                       !! joint of the loop
        integer, intent(in) :: side
        real(wp), intent(in) :: wrench(6)              !! world axes [N, N m]
        real(wp) :: own(6), moment(3)

        moment = wrench(4:)
        if (side == 1) moment = moment + loop%size*cross(joint_point(model, loop, i, 2) - joint_point(model, loop, i, 1), &
                                                         wrench(:3))
        associate (axes => loop%rotation(:, :, loop%body(side, i)))
            own = [matmul(wrench(:3), axes), matmul(moment, axes)]
        end associate
    end function wrench_on_arm

    !> What a reaction does along the misfit of its joint, once that is pushed together.
    pure real(wp) function misfit_of(joint, axes, wrench) result(work)
        type(joint_spec), intent(in) :: joint
        real(wp), intent(in) :: axes(3, 3)             !! of its first link
        real(wp), intent(in) :: wrench(6)              !! on its second link at its marker, world axes [N, N m]

        work = dot_product(joint%misfit, [matmul(wrench(:3), axes), matmul(wrench(4:), axes)])
    end function misfit_of

    !> The parts of the arms' energy that reactions of the loop have, rows of constraints in newtons, moments over the size.
    pure subroutine list_arm_parts(model, loop, rows, part, weight, arm, of_arm)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        type(rows_type), intent(in) :: rows
        real(wp), allocatable, intent(out) :: part(:, :)     !! of each row in it (part, row)
        real(wp), allocatable, intent(out) :: weight(:)      !! (part)
        integer, allocatable, intent(out) :: arm(:)          !! of the model (part)
        integer, allocatable, intent(out) :: of_arm(:)       !! which of its parts that is (part)
        real(wp) :: wrench(6)
        integer :: a, i, k, n, r

        n = 0
        do a = 1, size(model%arm)
            if (any(loop%joint == model%arm(a)%joint)) n = n + model%arm(a)%n
        end do
        allocate (part(n, rows%n), weight(n), source=0.0_wp)
        allocate (arm(n), of_arm(n), source=0)
        n = 0
        do a = 1, size(model%arm)
            i = findloc(loop%joint, model%arm(a)%joint, dim=1)
            if (i == 0) cycle
            do k = 1, model%arm(a)%n
                arm(n + k) = a
                of_arm(n + k) = k
                weight(n + k) = model%arm(a)%weight(k)
            end do
            do r = 1, rows%n
                if (rows%joint(r) /= i) cycle
                wrench = [rows%wrench(:3, r), loop%size*rows%wrench(4:, r)]
                wrench = wrench_on_arm(model, loop, i, model%arm(a)%side, wrench)
                do k = 1, model%arm(a)%n
                    part(n + k, r) = dot_product(model%arm(a)%row(:, k), wrench)
                end do
            end do
            n = n + model%arm(a)%n
        end do
    end subroutine list_arm_parts
end module linkdyn_elastic_links
