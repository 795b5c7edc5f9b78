!> Where a straight way in the space of the coordinates came to its end. Any longer way from the same place in the same
!> direction leads through there, and ends there too: no need to go it. Where patience ended a longer way has hardly more.
module linkdyn_dead_end
    use linkdyn_following, only: way_arrived, way_ends, way_forks, way_too_long
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: dead_end, is_end

    type :: dead_end
        integer :: outcome = way_arrived             !! one of `way_*`; arrived: no end is known
        integer :: n_crossed = 0                     !! change points on the way
        real(wp), allocatable :: way(:)              !! that was gone (n_q)
        real(wp) :: reached = 0                      !! part of it at which it ended
        ! ---- what stood there
        real(wp), allocatable :: branch(:)           !! (n_branch)
        real(wp), allocatable :: place(:, :)         !! of the groups' links (place_size, n_link)
        real(wp), allocatable :: margin(:)           !! (n_group)
    contains
        procedure :: note, lies_before
    end type dead_end

contains

    !> Is the outcome of a way that was gone an end, of the assembly or of patience?
    pure logical function is_end(outcome)
        integer, intent(in) :: outcome               !! one of `way_*`

        is_end = any(outcome == [way_ends, way_forks, way_too_long])
    end function is_end

    !> Remember how a way came to its end.
    pure subroutine note(self, way, outcome, reached, n_crossed)
        class(dead_end), intent(inout) :: self
        real(wp), intent(in) :: way(:)               !! (n_q)
        integer, intent(in) :: outcome               !! one of `way_*`
        real(wp), intent(in) :: reached              !! part of the way
        integer, intent(in) :: n_crossed

        self%way = way
        self%outcome = outcome
        self%reached = reached
        self%n_crossed = n_crossed
    end subroutine note

    !> Does another way from the same place lead through the end known?
    !>
    !> Not if it ends so near to it that either might come first: the end is where a margin falls below what can be told, and
    !> that is some 1e-10 of a stride before it vanishes.
    pure logical function lies_before(self, way, size_of, stride)
        class(dead_end), intent(in) :: self
        real(wp), intent(in) :: way(:)               !! (n_q)
        real(wp), intent(in) :: size_of(:)           !! of the coordinates that it is the difference of: what rounds (n_q)
        real(wp), intent(in) :: stride(:)            !! longest steps of a way (n_q)
        real(wp), parameter :: near = 1.0e-3_wp      !! strides
        real(wp), parameter :: roundings = 4         !! of two coordinates, and of two ways from them
        real(wp) :: share

        lies_before = .false.
        if (self%outcome == way_arrived) return
        share = dot_product(way/stride, self%way/stride)/dot_product(self%way/stride, self%way/stride)
        if (.not. share*maxval(abs(self%way)/stride) > self%reached*maxval(abs(self%way)/stride) + near) return
        lies_before = all(abs(way - share*self%way) <= roundings*(1 + share)*epsilon(1.0_wp)*size_of)
    end function lies_before
end module linkdyn_dead_end
