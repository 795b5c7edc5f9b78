!> Where joints rub: surfaces that the reaction presses together, and their law of friction.
!>
!> A contact has an axis a of its joint, and of the reaction, force F and moment M on the second link about its marker, it feels
!> what its form says: at both ends of a pin or guide of length L the forces (F - (F.a) a)/2 +- M x a/L, at a collar or thread the
!> force along the axis, at a ball F. The sum N of their sizes is what presses. With the relative velocity v along and the relative
!> angular velocity w about what is free, the surface at radius r slides with the speed V = sqrt(v^2 + r^2 w^2), and friction acts
!> on the second link with
!>
!>     force  -c N v,    moment  -c N r^2 w,    c = mu(V) tanh(V/creep)/V
!>
!> which takes the power c N V^2. A cam's roller turns about a pin of the radius r, that slides at r/R of the speed with which the
!> roller passes the cam: its friction is felt where both touch, as r/R of the force there. At rest it is zero, and it is that of
!> Coulomb and Stribeck, but for rounding, from V = 19 creep on.
!>
!> Teeth slide as their wheels turn against each other, w: friction is a couple between these, and what presses is in proportion to
!> the force along the pitch circles, by a number for each direction in which power flows (`linkdyn_mesh_losses`). A worm's thread
!> slides on the teeth of its wheel where their pitch surfaces touch, and what rubs there is a force. A belt or chain takes the same
!> couple from both of its wheels as they turn in their carrier: if it is open a force half way between them, across, where they
!> pass each other.
module linkdyn_contact
    use linkdyn_constants, only: two_pi
    use linkdyn_joint_table, only: joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, joint_spherical, &
        joint_planar, joint_screw, joint_cam, joint_gear, joint_rack, joint_belt
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, friction_spec, clutch_spec
    implicit none (type, external)
    private
    public :: contact_type, list_contacts, is_turning, is_mesh, is_bare, sliding_coefficient, no_speed, &
        lever_of, part_of, holds_contact, slides_along_several, n_part, n_press, pressing, pressing_slope, has_settled, most_rounds
    public :: form_pin, form_collar, form_ball, form_guide, form_bush, form_thread, form_plate, form_drive, form_cam, form_mesh, &
        form_worm, form_belt

    integer, parameter :: form_pin = 1       !! of a hinge, or one of both of a universal joint
    integer, parameter :: form_collar = 2    !! of such a pin: it takes the force along it
    integer, parameter :: form_ball = 3
    integer, parameter :: form_guide = 4     !! of a slide
    integer, parameter :: form_bush = 5      !! turns and slides
    integer, parameter :: form_thread = 6
    integer, parameter :: form_plate = 7     !! on which a planar joint slides and turns
    integer, parameter :: form_drive = 8     !! a gear or screw between motor and joint, on lanes only
                                             !! (`linkdyn_transmission_losses`)

    integer, parameter :: form_cam = 9       !! where a cam is touched; of a roller the pin about which it turns
    integer, parameter :: form_mesh = 10     !! teeth of two wheels, or of a wheel and a rack
    integer, parameter :: form_worm = 11     !! a worm's thread on the teeth of its wheel
    integer, parameter :: form_belt = 12     !! a belt or chain as it runs on and off its wheels

    !> What a contact feels of a reaction: the forces at both ends (3 numbers each), and one along the axis.
    integer, parameter :: n_press = 7

    !> Along so many joint variables at most does a surface slide.
    integer, parameter :: n_part = 3

    !> So often is friction put in again before it is found otherwise.
    integer, parameter :: most_rounds = 25

    type :: contact_type
        integer :: joint = 0
        integer :: form = 0                   !! one of `form_*`
        integer :: side = 1                   !! of the joint's marker whose axis it is
        real(wp) :: coulomb = 0, static = 0   !! coefficients; of a drive those while the motor drives and while the load does
        real(wp) :: stribeck_speed = 0, creep_speed = 0    !! [m/s]
        real(wp) :: radius = 0                !! [m]
        real(wp) :: length = 0                !! between the ends [m]; 0: it has one
        real(wp) :: preload = 0               !! [N]
        real(wp) :: pitch = 0                 !! of a thread [m/rad]
        real(wp) :: slant = 1                 !! force that presses its flanks over that along its axis; of teeth over that along
                                              !! the pitch circles, while the first wheel drives
        real(wp) :: back = 1                  !! the same while the second does
        real(wp) :: pass = 1                  !! of a cam: speed of what rubs over that with which the follower passes it; of a belt
                                              !! that of the belt over that with which its wheels pass each other half way
        integer :: carrier = 0                !! of teeth and belts that may stick: the link in which both wheels turn
        real(wp) :: way(3) = 0                !! along which they slide, or about which their wheels turn against each other, as a
                                              !! force above zero drives the second; carrier axes
        real(wp) :: spin(3, 2) = 0            !! what each wheel's angular velocity in the carrier adds to the speed along that [m]
        real(wp) :: slide_damping = 0         !! [N s/m]
        real(wp) :: turn_damping = 0          !! [N m s]
    end type contact_type

contains

    !> All contacts of a scene.
    pure subroutine list_contacts(scene, contact)
        type(scene_type), intent(in) :: scene
        type(contact_type), allocatable, intent(out) :: contact(:)
        integer :: i

        allocate (contact(0))
        if (.not. allocated(scene%friction)) return
        do i = 1, size(scene%friction)
            contact = [contact, contacts_of(scene, scene%friction(i))]
        end do
    end subroutine list_contacts

    !> One surface, or several: a pin with a collar, the pins of a universal joint.
    pure function contacts_of(scene, friction) result(contact)
        type(scene_type), intent(in) :: scene
        type(friction_spec), intent(in) :: friction
        type(contact_type), allocatable :: contact(:)
        type(contact_type) :: one
        integer :: side

        one = contact_type(joint=friction%joint, coulomb=friction%coulomb, static=friction%static, &
                           stribeck_speed=friction%stribeck_speed, creep_speed=friction%creep_speed, radius=friction%radius, &
                           length=friction%length, preload=friction%preload)
        associate (kind => scene%joint(friction%joint)%kind)
            if (is_turning(kind)) then
                one%turn_damping = friction%viscous
            else
                one%slide_damping = friction%viscous
                one%turn_damping = friction%viscous*friction%radius**2
            end if
            select case (kind)
            case (joint_revolute, joint_universal)
                one%form = form_pin
                contact = [one]
                if (friction%collar > 0) contact = [contact, collar_beside(one, friction%collar)]
                if (kind == joint_revolute) return
                side = size(contact)
                contact = [contact, contact]
                contact(side + 1:)%side = 2
            case (joint_prismatic)
                one%form = form_guide
                one%turn_damping = 0
                contact = [one]
            case (joint_cylindrical)
                one%form = form_bush
                contact = [one]
            case (joint_spherical)
                one%form = form_ball
                contact = [one]
            case (joint_screw)
                one%form = form_thread
                one%pitch = scene%joint(friction%joint)%lead/two_pi
                if (friction%radius > 0) one%slant = sqrt(friction%radius**2 + one%pitch**2)/friction%radius
                contact = [one]
            case (joint_planar)
                one%form = form_plate
                contact = [one]
            case (joint_cam)
                one%form = form_cam
                if (friction%radius > 0) one%pass = friction%radius/scene%joint(friction%joint)%cam%radius
                one%radius = 0
                one%turn_damping = 0
                contact = [one]
            case (joint_gear, joint_rack)
                one%form = form_mesh
                if (scene%joint(friction%joint)%lead_angle /= 0) one%form = form_worm
                contact = [one]
            case (joint_belt)
                one%form = form_belt
                contact = [one]
            case default
                allocate (contact(0))
            end select
        end associate
    end function contacts_of

    pure type(contact_type) function collar_beside(pin, radius) result(collar)
        type(contact_type), intent(in) :: pin
        real(wp), intent(in) :: radius

        collar = pin
        collar%form = form_collar
        collar%radius = radius
        collar%preload = 0
        collar%turn_damping = 0
    end function collar_beside

    !> Does a kind only turn, so that its damping is a moment?
    elemental logical function is_turning(kind)
        integer, intent(in) :: kind

        is_turning = any(kind == [joint_revolute, joint_universal, joint_spherical, joint_screw])
    end function is_turning

    !> Teeth or a belt: what presses is in proportion to the force along the pitch circles.
    elemental logical function is_mesh(contact)
        type(contact_type), intent(in) :: contact

        is_mesh = any(contact%form == [form_mesh, form_worm, form_belt])
    end function is_mesh

    !> Surfaces of a joint that has no variables, teeth, a belt, a cam: what slips is told by the surfaces alone. With a `radius`
    !> wheels turn against each other, without they slide.
    elemental logical function is_bare(contact)
        type(contact_type), intent(in) :: contact

        is_bare = is_mesh(contact) .or. contact%form == form_cam
    end function is_bare

    !> The coefficient of a surface that slides, however slowly.
    pure elemental real(wp) function sliding_coefficient(contact, speed) result(mu)
        type(contact_type), intent(in) :: contact
        real(wp), intent(in) :: speed         !! [m/s]

        mu = contact%coulomb
        if (contact%stribeck_speed > 0) &
            mu = mu + (contact%static - contact%coulomb)*exp(-(speed/contact%stribeck_speed)**2)
    end function sliding_coefficient

    !> Speed of the surface over that of a joint variable along which it slides: `part` 1 is the first of them. Of hinges, guides
    !> and threads there is one; of a joint without variables that is how its surfaces pass each other. The sum of squares over all
    !> of them is the square of the speed of the surface.
    pure elemental real(wp) function lever_of(contact, part) result(lever)
        type(contact_type), intent(in) :: contact
        integer, intent(in) :: part

        lever = hypot(contact%radius, contact%pitch)
        select case (contact%form)
        case (form_guide)
            lever = 1
        case (form_bush)
            if (part == 2) lever = 1
        case (form_plate)
            if (part < 3) lever = 1
        case (form_cam, form_mesh, form_worm, form_belt)
            if (.not. contact%radius > 0) lever = contact%pass
        end select
    end function lever_of

    !> Below this a surface has the way in which it began to slide, or slid before it came to rest [m/s]. Where that may turn it
    !> does so within V/(mu W N), with the response W to forces: the slower, the stiffer.
    pure elemental real(wp) function no_speed(contact)
        type(contact_type), intent(in) :: contact
        real(wp), parameter :: none = 1.0e-9_wp, of_several = 1.0e-3_wp    !! of the creep speed

        no_speed = merge(of_several, none, slides_along_several(contact))*contact%creep_speed
    end function no_speed

    !> Does a surface slide along several joint variables?
    pure elemental logical function slides_along_several(contact)
        type(contact_type), intent(in) :: contact

        slides_along_several = any(contact%form == [form_bush, form_plate, form_ball])
    end function slides_along_several

    !> Which of the joint variables along which a contact slides a clutch holds.
    pure elemental integer function part_of(contact, clutch) result(part)
        type(contact_type), intent(in) :: contact
        type(clutch_spec), intent(in) :: clutch

        part = 1
        if (slides_along_several(contact)) part = clutch%variable(1)
    end function part_of

    !> Is it by the friction of this contact, among others, that a clutch holds? Each pin of a universal joint does so for itself.
    pure elemental logical function holds_contact(clutch, contact)
        type(clutch_spec), intent(in) :: clutch
        type(contact_type), intent(in) :: contact

        holds_contact = clutch%friction > 0 .and. clutch%joint(1) == contact%joint
        if (any(contact%form == [form_pin, form_collar])) holds_contact = holds_contact .and. clutch%variable(1) == contact%side
    end function holds_contact

    !> Has what presses come to rest? By its change in two rounds, relative to the largest force: the next one, which shrinks as
    !> this one did, would change nothing. Near a singular position rounding goes on changing digits that are not known.
    pure elemental logical function has_settled(change, change_before)
        real(wp), intent(in) :: change, change_before
        real(wp), parameter :: enough = 64*epsilon(1.0_wp), noise = 1e-8_wp
        real(wp), parameter :: small = 1e-3_wp     !! larger ones may go to and fro

        has_settled = (change <= small .and. change*min(change/change_before, 1.0_wp) <= enough) &
                      .or. (change <= noise .and. change > 0.5_wp*change_before)
    end function has_settled

    !> The force that presses, from what the contact feels.
    pure real(wp) function pressing(contact, press)
        type(contact_type), intent(in) :: contact
        real(wp), intent(in) :: press(n_press)    !! [N]

        if (contact%form == form_drive) then
            pressing = merge(contact%coulomb, -contact%static, press(7) > 0)*press(7)
        else if (is_mesh(contact)) then
            pressing = merge(contact%slant, -contact%back, press(7) > 0)*press(7)
        else
            pressing = contact%preload + norm2(press(1:3)) + norm2(press(4:6)) + abs(press(7))
        end if
    end function pressing

    !> Change of the pressing force with each of these numbers; none where one is zero.
    pure function pressing_slope(contact, press) result(slope)
        type(contact_type), intent(in) :: contact
        real(wp), intent(in) :: press(n_press)
        real(wp) :: slope(n_press)

        slope(1:3) = press(1:3)/max(norm2(press(1:3)), tiny(1.0_wp))
        slope(4:6) = press(4:6)/max(norm2(press(4:6)), tiny(1.0_wp))
        slope(7) = 0
        if (abs(press(7)) > 0) slope(7) = sign(1.0_wp, press(7))
        if (contact%form == form_drive) slope(7) = merge(contact%coulomb, -contact%static, press(7) > 0)
        if (is_mesh(contact)) slope(7) = slope(7)*merge(contact%slant, contact%back, press(7) > 0)
    end function pressing_slope
end module linkdyn_contact
