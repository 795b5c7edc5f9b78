!> What teeth lose: how far from the pitch point they touch in the mean, and what presses them, by an efficiency or by their
!> geometry.
!>
!> The force of teeth is the same on both wheels. Friction moves its line off the pitch point: that force F goes on along the pitch
!> circles, and a couple m stands between the wheels, against their angular velocity w to each other, and takes m w. With the
!> curvatures c1, c2 of the pitch circles (of bevel wheels those of their back cones; below zero of a ring, zero of a rack) and
!> their speed v, w = (c1 + c2) v. So the first wheel takes F v + m c1 v and the second gives F v - m c2 v, which makes m of an
!> efficiency, for each direction of power.
!>
!> A worm's thread slides along itself. What presses its flank is N = F/(cos(lead angle) cos(pressure angle)), and with the angle of
!> friction rho, tan rho = mu/cos(pressure angle), it has the efficiency tan(lead angle)/tan(lead angle + rho); driven by its wheel
!> tan(lead angle - rho)/tan(lead angle).
!>
!> A belt or chain brakes both of its wheels with the same couple m: the first takes F v + m c1 v and the second gives F v - m c2 v.
module linkdyn_mesh_losses
    use linkdyn_constants, only: pi
    use linkdyn_contact, only: contact_type, is_mesh, form_worm, form_belt
    use linkdyn_cross, only: cross
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, gear_type
    use linkdyn_scene, only: joint_spec, joint_kind_name
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text, quoted
    implicit none (type, external)
    private
    public :: shape_meshes, worm_friction_angle

    real(wp), parameter :: usual_pressure_angle = pi/9

contains

    !> Fill in `radius`, `slant` and `back` of the contacts that are teeth or belts, and along what they slide where they may stick.
    subroutine shape_meshes(model, status)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        integer :: i, k

        do i = 1, size(model%contact)
            if (.not. is_mesh(model%contact(i))) cycle
            associate (j => model%contact(i)%joint)
                k = findloc(model%scene%friction%joint, j, dim=1)
                if (model%contact(i)%form == form_worm) then
                    call shape_worm(model%scene%friction(k)%efficiency, model%scene%joint(j), model%contact(i))
                else if (model%contact(i)%form == form_belt) then
                    call shape_belt(model, j, model%scene%friction(k)%efficiency, model%contact(i), status)
                else if (model%scene%friction(k)%efficiency > 0) then
                    call shape_by_efficiency(model%scene%friction(k)%efficiency, model%gear(model%joint(j)%gear), &
                                             model%scene%joint(j), model%contact(i), status)
                else
                    call shape_by_teeth(model%gear(model%joint(j)%gear), model%scene%joint(j), model%contact(i), status)
                end if
                if (model%scene%friction(k)%sticks .and. status%is_ok()) call find_way(wheels_of(model, j), model%contact(i))
            end associate
        end do
    end subroutine shape_meshes

    pure type(gear_type) function wheels_of(model, j) result(gear)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j                       !! joint

        if (model%joint(j)%gear > 0) then
            gear = model%gear(model%joint(j)%gear)
        else
            gear = model%belt(model%joint(j)%belt)%gear
        end if
    end function wheels_of

    !> While pitch circles go round wheels turn against each other; a worm's thread slides on its wheel, and the wheels of an open
    !> belt pass each other half way between their axes.
    pure subroutine find_way(gear, contact)
        type(gear_type), intent(in) :: gear
        type(contact_type), intent(inout) :: contact   !! the rest of it is known
        real(wp) :: sense(2), arm(3, 2), way(3)
        integer :: side

        sense = [-1, 1]
        do side = 1, 2
            arm(:, side) = gear%pitch - gear%marker(:, side)
        end do
        if (contact%form == form_belt) then
            if (.not. contact%radius > 0) sense = 1
            arm = spread((gear%marker(:, 1) - gear%marker(:, 2))/2, 2, 2)
        end if
        way = 0
        do side = 1, 2
            if (contact%radius > 0) then
                way = way + sense(side)*gear%spin(:, side)
            else
                way = way + sense(side)*cross(gear%spin(:, side), arm(:, side))
            end if
        end do
        contact%carrier = gear%carrier
        contact%way = way/norm2(way)
        do side = 1, 2
            contact%spin(:, side) = sense(side)*contact%way
            if (.not. contact%radius > 0) contact%spin(:, side) = cross(arm(:, side), contact%spin(:, side))
        end do
    end subroutine find_way

    !> The speed is that of the belt. Wheels of an open one pass each other half way with (c1 + c2) of it times half their distance.
    subroutine shape_belt(model, j, efficiency, contact, status)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j                       !! joint
        real(wp), intent(in) :: efficiency
        type(contact_type), intent(inout) :: contact
        type(status_type), intent(inout) :: status
        type(gear_type) :: gear

        gear = wheels_of(model, j)
        call shape_by_efficiency(efficiency, gear, model%scene%joint(j), contact, status)
        if (model%scene%joint(j)%is_turned_over) return
        contact%pass = 2*contact%radius/gear%distance
        contact%radius = 0
    end subroutine shape_belt

    !> What presses a worm's flank, or what rubs there, over the force along the pitch circle of its wheel.
    pure subroutine shape_worm(efficiency, spec, contact)
        real(wp), intent(in) :: efficiency             !! while the worm drives; 0: none is told
        type(joint_spec), intent(in) :: spec
        type(contact_type), intent(inout) :: contact
        real(wp) :: across

        if (efficiency > 0) then
            contact%slant = tan(atan(tan(abs(spec%lead_angle))/efficiency) - abs(spec%lead_angle))
        else
            across = spec%flank(1)
            if (.not. across > 0) across = usual_pressure_angle
            contact%slant = 1/cos(across)
        end if
        contact%slant = contact%slant/cos(spec%lead_angle)
        contact%back = contact%slant
    end subroutine shape_worm

    !> The angle of friction of a worm's thread with a coefficient of its contact [rad].
    pure real(wp) function worm_friction_angle(contact, spec, coefficient) result(rho)
        type(contact_type), intent(in) :: contact
        type(joint_spec), intent(in) :: spec
        real(wp), intent(in) :: coefficient

        rho = atan(coefficient*contact%slant*cos(spec%lead_angle))
    end function worm_friction_angle

    !> The surfaces' speed is that of the pitch circles, and what presses is what is lost over it.
    subroutine shape_by_efficiency(efficiency, gear, spec, contact, status)
        real(wp), intent(in) :: efficiency
        type(gear_type), intent(in) :: gear
        type(joint_spec), intent(in) :: spec
        type(contact_type), intent(inout) :: contact
        type(status_type), intent(inout) :: status
        real(wp) :: least

        associate (c => gear%curvature)
            least = -minval(c)/maxval(c)
            if (efficiency <= least) then
                call refuse(spec, "efficiency = "//to_text(efficiency)//", which sliding of teeth cannot account for: both "// &
                            "wheels hardly turn against each other (expected more than "//to_text(least)// &
                            ", the ratio of the teeth)", status)
                return
            end if
            contact%radius = 1/sum(c)
            contact%slant = (1 - efficiency)*sum(c)/(c(2) + efficiency*c(1))
            contact%back = (1 - efficiency)*sum(c)/(c(1) + efficiency*c(2))
        end associate
    end subroutine shape_by_efficiency

    !> Involute teeth as high as their module: where they slide they are off the pitch point by x of the base pitch along the line
    !> of action, from -reach(1) to reach(2). The force goes through one pair there, or is shared by several in equal parts.
    subroutine shape_by_teeth(gear, spec, contact, status)
        type(gear_type), intent(in) :: gear
        type(joint_spec), intent(in) :: spec           !! a gear with teeth
        type(contact_type), intent(inout) :: contact
        type(status_type), intent(inout) :: status
        real(wp) :: height, across, lean, base_pitch, reach(2)
        integer :: side

        lean = spec%flank(2)
        across = spec%flank(1)
        if (.not. across > 0) across = usual_pressure_angle
        contact%slant = 1/(cos(across)*cos(lean))
        contact%back = contact%slant
        across = atan(tan(across)/cos(lean))
        height = 2*gear%radius(1)/spec%wheel(1)
        base_pitch = pi*height*cos(across)
        do side = 1, 2
            ! not beyond the point where the other wheel's flank begins, on its base circle
            reach(side) = tip_reach(gear%curvature(side), height*cos(lean), across)
            associate (other => gear%curvature(3 - side))
                if (other > 0) reach(side) = min(reach(side), sin(across)/other)
            end associate
        end do
        reach = reach/base_pitch
        if (sum(reach) < 1) then
            call refuse(spec, "its teeth lose contact before the next pair meets: contact ratio "//to_text(sum(reach))// &
                        " (expected 1 or more, of teeth as high as their module; or 'efficiency')", status)
            return
        end if
        contact%radius = base_pitch*mean_distance(reach)
    end subroutine shape_by_teeth

    !> From the pitch point along the line of action to the tip circle of a wheel.
    pure real(wp) function tip_reach(curvature, height, across) result(reach)
        real(wp), intent(in) :: curvature              !! of the pitch circle [1/m]
        real(wp), intent(in) :: height                 !! of the teeth over it [m]
        real(wp), intent(in) :: across                 !! pressure angle
        real(wp) :: radius

        if (curvature == 0) then
            reach = height/sin(across)
            return
        end if
        radius = 1/curvature                           ! of a ring below zero, whose teeth reach inwards
        reach = sign(sqrt(max((radius + height)**2 - (radius*cos(across))**2, 0.0_wp)), radius) - radius*sin(across)
    end function tip_reach

    !> The mean of |x| over the pairs that are in touch at a time, each with the same part of the force, over all times.
    pure real(wp) function mean_distance(reach) result(mean)
        real(wp), intent(in) :: reach(2)               !! over the base pitch
        real(wp) :: x, next
        integer :: n_pair, k

        mean = 0
        x = -reach(1)
        do
            ! up to where a pair comes or goes, or the pitch point
            next = reach(2)
            do k = 0, int(sum(reach))
                if (reach(2) - k > x) next = min(next, reach(2) - k)
                if (k - reach(1) > x) next = min(next, k - reach(1))
            end do
            if (x < 0) next = min(next, 0.0_wp)
            n_pair = 1 + floor(reach(2) - (x + next)/2) + floor((x + next)/2 + reach(1))
            mean = mean + abs(next**2 - x**2)/(2*n_pair)
            if (.not. next < reach(2)) exit
            x = next
        end do
    end function mean_distance

    subroutine refuse(spec, why, status)
        type(joint_spec), intent(in) :: spec
        character(len=*), intent(in) :: why
        type(status_type), intent(inout) :: status

        if (status%is_ok()) call fail(status, status_bad_input, &
            "friction at "//trim(joint_kind_name(spec%kind))//" "//quoted(spec%name)//": "//why)
    end subroutine refuse
end module linkdyn_mesh_losses
