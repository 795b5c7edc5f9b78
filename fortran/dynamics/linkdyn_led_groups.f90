!> Groups closed by iteration, led along straight ways by somebody else's steps: a way a lane, all side by side.
!>
!> Of the coordinates on the way nothing but where the groups' links are is looked at. Where more than that changes on it
!> (branches of closed forms, change points that are to be passed), `linkdyn_led_mechanism` leads the whole mechanism; so it does
!> where links spin about threads, whose whole turns no margin tells.
module linkdyn_led_groups
    use linkdyn_following, only: follower, footing, way_report, follow_way, way_arrived
    use linkdyn_group_motion, only: group_closer
    use linkdyn_group_stride, only: group_stride, close_from, predict
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    implicit none (type, external)
    private
    public :: lead_places

    integer, parameter :: spare_tries = 30           !! of a way, beside those for its strides

    type, extends(follower) :: led_groups
        type(model_type), pointer :: model => null()
        class(group_closer), pointer :: closer => null()
        integer, allocatable :: lane(:)              !! that has a way (way)
        real(wp), allocatable :: from(:, :)          !! coordinates (n_q, way)
        real(wp), allocatable :: way(:, :)           !! likewise, to its end
        real(wp), allocatable :: branch(:, :)        !! of the closed forms (n_branch, way)
        real(wp), allocatable :: place(:, :, :)      !! of the links there (place_size, n_link, way)
        real(wp), allocatable :: rate(:, :, :)       !! per whole way (link_freedom, n_link, way)
        type(group_stride) :: tried
    contains
        procedure :: try => try_on_way
        procedure :: take => take_on_way
    end type led_groups

contains

    !> Lead the groups of the lanes that go; a lane arrives only if every step could be believed.
    subroutine lead_places(model, closer, goes, from, to, branch, place, margin, arrives)
        type(model_type), intent(in), target :: model
        class(group_closer), intent(in), target :: closer
        logical, intent(in) :: goes(:)                         !! (lane)
        real(wp), intent(in) :: from(:, :), to(:, :)           !! coordinates (n_q, lane)
        real(wp), intent(in) :: branch(:, :)                   !! (n_branch, lane)
        real(wp), intent(inout) :: place(:, :, :)              !! at the beginning; of a lane that arrives: at the end
                                                               !! (place_size, n_link, lane)
        real(wp), intent(inout) :: margin(:, :)                !! there (n_group, lane)
        logical, intent(out) :: arrives(:)                     !! (lane)
        real(wp), parameter :: longest(lanes) = 0.5_wp         !! step: the whole way has been tried
        type(led_groups) :: led
        type(way_report) :: report
        logical :: has_way(lanes)
        integer :: i

        arrives = .false.
        if (.not. any(goes) .or. any(model%group%n_thread > 0)) return
        led%model => model
        led%closer => closer
        led%lane = pack([(i, i=1, size(goes))], goes)
        led%from = from(:, led%lane)
        led%way = to(:, led%lane) - led%from
        led%branch = branch(:, led%lane)
        led%place = place(:, :, led%lane)
        led%least_margin = model%least_margin(model%n_branch + 1:model%n_branch + size(model%group))
        has_way = .false.
        has_way(led%lane) = .true.
        call follow_way(led, has_way, longest, .false., spare_tries, report)
        do i = 1, size(led%lane)
            associate (lane => led%lane(i))
                arrives(lane) = report%outcome(lane) == way_arrived
                if (.not. arrives(lane)) cycle
                place(:, :, lane) = led%place(:, :, i)
                margin(:, lane) = led%tried%margin(:, i)
            end associate
        end do
    end subroutine lead_places

    !> Closed at a part of the way, from where the tangent leads.
    subroutine try_on_way(self, goes, part, lead, is_crossing, found)
        class(led_groups), intent(inout) :: self
        logical, intent(in) :: goes(lanes)
        real(wp), intent(in) :: part(lanes), lead(lanes)
        logical, intent(in) :: is_crossing(:, :)
        type(footing), intent(inout) :: found
        real(wp) :: ahead(size(self%place, 1), size(self%place, 2), size(self%lane)), q(size(self%way, 1), size(self%lane))
        integer :: i

        ahead = self%place
        do i = 1, size(self%lane)
            associate (lane => self%lane(i))
                q(:, i) = self%from(:, i) + part(lane)*self%way(:, i)
                if (allocated(self%rate)) &
                    call predict(self%model, self%rate(:, :, i:i), [lead(lane)], ahead(:, :, i))
            end associate
        end do
        call close_from(self%model, self%closer, q, self%way, self%branch, ahead, self%tried)
        found%is_closed = .true.
        found%margin = 1
        found%drift = 0
        do i = 1, size(self%lane)
            associate (lane => self%lane(i))
                found%is_closed(lane) = self%tried%is_closed(i) .and. .not. any(is_crossing(lane, :))
                found%margin(lane, :) = self%tried%margin(:, i)
                found%drift(lane, :) = self%tried%drift(:, i)
            end associate
        end do
    end subroutine try_on_way

    !> Where the mechanism was tried it stands from now on, with its rates there.
    subroutine take_on_way(self, is_taken)
        class(led_groups), intent(inout) :: self
        logical, intent(in) :: is_taken(lanes)
        integer :: i

        if (.not. allocated(self%rate)) allocate (self%rate, mold=self%tried%rate)
        do i = 1, size(self%lane)
            if (.not. is_taken(self%lane(i))) cycle
            self%place(:, :, i) = self%tried%place(:, :, i)
            self%rate(:, :, i) = self%tried%rate(:, :, i)
        end do
    end subroutine take_on_way
end module linkdyn_led_groups
