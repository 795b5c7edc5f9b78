!> What a forward run keeps of the way that it has come, beside its state: all that decides how it goes on from there, and nothing
!> that can be made anew. It is copied as a whole by who wants to go on from there once more (`linkdyn_forward_memory`).
module linkdyn_forward_way
    use linkdyn_bounce_watch, only: bounce_watch
    use linkdyn_carried_assembly, only: carried_assembly
    use linkdyn_clutch_states, only: clutch_states
    use linkdyn_energy_check, only: energy_check
    use linkdyn_event_log, only: event_log
    use linkdyn_followed_angles, only: followed_angles
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_narrow_laws, only: law_sight
    use linkdyn_motor_states, only: motor_states
    use linkdyn_status, only: sample_ok
    use linkdyn_stop_states, only: stop_states
    implicit none (type, external)
    private
    public :: forward_way

    type :: forward_way
        type(carried_assembly) :: assembly
        integer :: obstacle(lanes) = sample_ok         !! what rates failed of first since the last accepted state
        ! ---- forces of actuators
        real(wp), allocatable :: given_force(:)        !! in place of drives, by whoever steps the system (n_actuator); absent:
                                                       !! nobody gives any
        type(motor_states) :: motors
        ! ---- events, end stops, clutches
        type(stop_states) :: stops
        type(clutch_states) :: clutch
        type(followed_angles) :: angles                !! that events look at
        type(event_log) :: log
        integer :: final_event(lanes) = 0              !! that ended the run; 0: none
        logical :: is_driven_through(lanes) = .false.  !! it is a stop that cannot hold: what strikes it is driven,
        logical :: is_jammed(lanes) = .false.          !! or jams: for what transmissions lose nothing gives way
        ! ---- what becomes of steps
        type(energy_check) :: energy
        type(bounce_watch) :: bounce                   !! on coordinates that are no state
        type(law_sight) :: sight                       !! what laws do within steps
        integer :: n_accepted = 0                      !! steps so far
        ! ---- the record
        integer :: n_before_record = 0                 !! evaluations on lanes before it is made
        integer :: n_left = 0                          !! those that it left to lanes since the last accepted state
    end type forward_way
end module linkdyn_forward_way
