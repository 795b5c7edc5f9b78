!> All laws of a scene, and whose they are: of motions, drives, clutches, controllers, payloads, the frame, loads, springs, and
!> events.
module linkdyn_time_laws
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, law_spec, switch_spec, name_len, n_clutch, n_controller, n_event
    implicit none (type, external)
    private
    public :: owned_law, list_laws, laws_over_time
    public :: part_motion, part_drive, part_clutch, part_controller, part_payload, part_frame, part_load, part_event

    integer, parameter :: part_motion = 1, part_drive = 2, part_clutch = 3, part_controller = 4, part_payload = 5, part_frame = 6
    integer, parameter :: part_load = 7, part_spring = 8, part_event = 9

    type :: owned_law
        type(law_spec), pointer :: law => null()       !! of an event none: its formula is its own
        integer :: part = 0                            !! one of `part_*`
        integer :: number = 0                          !! of the coordinate, the actuator, ...
        integer :: line = 0                            !! of the scene file
        character(len=2*name_len + 32) :: owner = ""     !! "load on 'platform.tool'"
        real(wp) :: from = -huge(1.0_wp)               !! it has a say from this instant
        real(wp) :: until = huge(1.0_wp)               !! until this one [s]
    end type owned_law

contains

    !> They stay the scene's, for as long as it is.
    subroutine list_laws(scene, list)
        type(scene_type), intent(in), target :: scene
        type(owned_law), allocatable, intent(out) :: list(:)
        integer :: i, k, n

        allocate (list(size(scene%coordinate) + size(scene%actuator) + n_clutch(scene) + 2*n_controller(scene) &
                       + size(scene%payload) + size(scene%base%motion) + 6*size(scene%load) + size(scene%spring) + n_event(scene)))
        n = 0
        do i = 1, size(scene%coordinate)
            associate (c => scene%coordinate(i))
                call add(c%motion, part_motion, "coordinate", c%name, "", c%line)
            end associate
        end do
        do i = 1, size(scene%actuator)
            associate (a => scene%actuator(i))
                call add(a%law%target, part_drive, "actuator", a%name, "", a%line)
            end associate
        end do
        do i = 1, n_clutch(scene)
            associate (clutch => scene%clutch(i))
                call add(clutch%capacity, part_clutch, "clutch", clutch%name, ", capacity", clutch%line)
                call find_span(clutch, list(n)%from, list(n)%until)
            end associate
        end do
        do i = 1, n_controller(scene)
            associate (controller => scene%controller(i))
                call add(controller%target, part_controller, "controller", controller%name, ", target", controller%line)
                call add(controller%feed_law, part_controller, "controller", controller%name, ", feed_forward", &
                         controller%line)
            end associate
        end do
        do i = 1, size(scene%payload)
            associate (payload => scene%payload(i))
                call add(payload%mass, part_payload, "payload on", payload%name, "", payload%line)
                list(n)%from = payload%from
                list(n)%until = payload%until
            end associate
        end do
        do i = 1, size(scene%base%motion)
            call add(scene%base%motion(i), part_frame, "motion of the frame", "", "", scene%base%line)
        end do
        do i = 1, size(scene%load)
            associate (load => scene%load(i))
                do k = 1, 3
                    call add(load%force(k), part_load, "load on", load%name, "", load%line)
                    call add(load%moment(k), part_load, "load on", load%name, "", load%line)
                end do
            end associate
        end do
        do i = 1, size(scene%spring)
            associate (spring => scene%spring(i))
                call add(spring%force, part_spring, "spring", spring%name, "", spring%line)
            end associate
        end do
        do i = 1, n_event(scene)
            associate (event => scene%event(i))
                call add(null(), part_event, "event", event%name, "", event%line)
            end associate
        end do

    contains

        subroutine add(law, part, kind, name, key, line)
            type(law_spec), pointer, intent(in) :: law
            integer, intent(in) :: part, line
            character(len=*), intent(in) :: kind, name, key    !! of the owner; blank: it has none

            n = n + 1
            list(n)%law => law
            list(n)%part = part
            list(n)%number = i
            list(n)%owner = kind
            if (name /= "") list(n)%owner = kind//" '"//trim(name)//"'"//key
            list(n)%line = line
        end subroutine add
    end subroutine list_laws

    !> When something may be on, as far as instants tell. An event may bring it on, or off, at any time.
    pure subroutine find_span(switch, from, until)
        class(switch_spec), intent(in) :: switch
        real(wp), intent(inout) :: from, until         !! [s]

        if (.not. switch%begins_on .and. switch%from < huge(1.0_wp) .and. switch%from_event == 0) from = switch%from
        if (switch%from_event == 0 .and. switch%until < huge(1.0_wp) &
            .and. (.not. switch%from < huge(1.0_wp) .or. switch%from < switch%until)) until = switch%until
    end subroutine find_span

    !> The laws alone, those over time among them, which is all that whoever leads steps looks at.
    function laws_over_time(scene) result(law)
        type(scene_type), intent(in), target :: scene
        type(law_spec), allocatable :: law(:)
        type(owned_law), allocatable :: list(:)
        integer :: i

        call list_laws(scene, list)
        law = [(list(i)%law, i=1, count(list%part /= part_event))]     ! these are last
    end function laws_over_time
end module linkdyn_time_laws
