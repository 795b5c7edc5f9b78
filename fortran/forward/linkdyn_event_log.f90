!> What has happened in forward runs: guards that crossed zero, contacts with end stops, clutches.
module linkdyn_event_log
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: event_log, event_entry, add_entry, kind_name
    public :: kind_crossing, kind_end, kind_contact, kind_release, kind_impact, kind_rest
    public :: kind_close, kind_open, kind_stick, kind_slip

    integer, parameter :: kind_crossing = 0        !! an event of the scene
    integer, parameter :: kind_end = 1             !! one that ends the run
    integer, parameter :: kind_contact = 2         !! with a stop that gives way
    integer, parameter :: kind_release = 3         !! from any stop
    integer, parameter :: kind_impact = 4          !! on a stop that throws back
    integer, parameter :: kind_rest = 5            !! the same, and there the joint variable stays
    integer, parameter :: kind_close = 6           !! of a clutch, by an impulse if it has no capacity
    integer, parameter :: kind_open = 7            !! of a clutch
    integer, parameter :: kind_stick = 8           !! a clutch has no slip any more and holds
    integer, parameter :: kind_slip = 9            !! it holds no more
    character(len=8), parameter :: kind_name(0:9) = [character(len=8) :: "crossing", "end", "contact", "release", "impact", &
        "rest", "close", "open", "stick", "slip"]

    type :: event_entry
        integer :: lane = 1                        !! of the run among those side by side
        real(wp) :: t = 0                          !! [s]
        integer :: event = 0                       !! of the scene
        integer :: kind = kind_crossing
        integer :: direction = 0                   !! +1: the guard crossed upwards, -1: downwards
        real(wp) :: impulse = 0                    !! of the stop [N s, N m s]
        real(wp) :: loss = 0                       !! of energy, of all impacts at the instant, told with the first [J]
        integer :: beside = 0                      !! instant whose results on both sides are its; 0: none are kept
        real(wp), allocatable :: q(:)              !! coordinates (n_q)
        real(wp), allocatable :: qd(:), qd_after(:)    !! their rates, before and behind the instant (n_q)
    end type event_entry

    type :: event_log
        integer :: n = 0
        type(event_entry), allocatable :: entry(:)
    end type event_log

contains

    subroutine add_entry(log, entry)
        type(event_log), intent(inout) :: log
        type(event_entry), intent(in) :: entry
        type(event_entry), allocatable :: longer(:)

        if (.not. allocated(log%entry)) allocate (log%entry(16))
        if (log%n == size(log%entry)) then
            allocate (longer(2*log%n))
            longer(:log%n) = log%entry
            call move_alloc(longer, log%entry)
        end if
        log%n = log%n + 1
        log%entry(log%n) = entry
    end subroutine add_entry
end module linkdyn_event_log
