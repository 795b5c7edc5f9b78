!> Where a straight way in the space of the coordinates came to its end. Any longer way from the same place in the same
!> direction leads through there, and ends there too: no need to go it. Where patience ended a longer way has hardly more.
!>
!> The last few directions are remembered: a motion that swings to and fro beyond an assembly's ends comes back to each of them.
module linkdyn_dead_end
    use linkdyn_following, only: way_arrived, way_ends, way_forks, way_too_long
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: dead_ends, is_end

    integer, parameter :: n_kept = 4

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
        procedure :: lies_before, runs_along
    end type dead_end

    !> Ends of ways from one place, in directions of their own.
    type :: dead_ends
        type(dead_end) :: kept(n_kept)
        integer :: newest = 0                        !! number of the last one; 0: none is known
    contains
        procedure :: note, that_lies_before, forget
    end type dead_ends

contains

    !> Is the outcome of a way that was gone an end, of the assembly or of patience?
    pure logical function is_end(outcome)
        integer, intent(in) :: outcome               !! one of `way_*`

        is_end = any(outcome == [way_ends, way_forks, way_too_long])
    end function is_end

    !> Remember how a way came to its end, in place of one in the same direction or of the oldest. The newest is this one then.
    pure subroutine note(self, way, size_of, stride, outcome, reached, n_crossed)
        class(dead_ends), intent(inout) :: self
        real(wp), intent(in) :: way(:)               !! (n_q)
        real(wp), intent(in) :: size_of(:)           !! as of `lies_before`
        real(wp), intent(in) :: stride(:)            !! likewise
        integer, intent(in) :: outcome               !! one of `way_*`
        real(wp), intent(in) :: reached              !! part of the way
        integer, intent(in) :: n_crossed
        integer :: i

        do i = 1, n_kept
            if (self%kept(i)%runs_along(way, size_of, stride)) exit
        end do
        if (i > n_kept) i = modulo(self%newest, n_kept) + 1
        self%newest = i
        self%kept(i)%way = way
        self%kept(i)%outcome = outcome
        self%kept(i)%reached = reached
        self%kept(i)%n_crossed = n_crossed
    end subroutine note

    pure subroutine forget(self)
        class(dead_ends), intent(inout) :: self

        self%newest = 0
        self%kept%outcome = way_arrived
    end subroutine forget

    !> The end through which another way from the same place leads; 0: none that is known.
    pure integer function that_lies_before(self, way, size_of, stride) result(i)
        class(dead_ends), intent(in) :: self
        real(wp), intent(in) :: way(:)               !! (n_q)
        real(wp), intent(in) :: size_of(:)           !! as of `lies_before`
        real(wp), intent(in) :: stride(:)            !! likewise

        do i = n_kept, 1, -1
            if (self%kept(i)%lies_before(way, size_of, stride)) return
        end do
    end function that_lies_before

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
        real(wp) :: length                           !! of the way known, in strides

        lies_before = .false.
        if (self%outcome == way_arrived) return
        length = maxval(abs(self%way)/stride)
        if (.not. share_of(self, way, stride)*length > self%reached*length + near) return
        lies_before = self%runs_along(way, size_of, stride)
    end function lies_before

    !> Does another way from the same place run in the same direction?
    pure logical function runs_along(self, way, size_of, stride)
        class(dead_end), intent(in) :: self
        real(wp), intent(in) :: way(:)               !! (n_q)
        real(wp), intent(in) :: size_of(:)           !! as of `lies_before`
        real(wp), intent(in) :: stride(:)            !! likewise
        real(wp), parameter :: roundings = 4         !! of two coordinates, and of two ways from them
        real(wp) :: share

        runs_along = .false.
        if (self%outcome == way_arrived) return
        share = share_of(self, way, stride)
        if (.not. share > 0) return
        runs_along = all(abs(way - share*self%way) <= roundings*(1 + share)*epsilon(1.0_wp)*size_of)
    end function runs_along

    !> How often another way goes along the one known.
    pure real(wp) function share_of(known, way, stride) result(share)
        type(dead_end), intent(in) :: known
        real(wp), intent(in) :: way(:), stride(:)    !! (n_q)

        share = dot_product(way/stride, known%way/stride)/dot_product(known%way/stride, known%way/stride)
    end function share_of
end module linkdyn_dead_end
