!> Groups closed by iteration, led along straight ways by somebody else's steps: a way a lane, all side by side.
!>
!> Of the coordinates on the way nothing but where the groups' links are is looked at. Where more than that changes on it
!> (branches of closed forms, change points that are to be passed), `linkdyn_led_mechanism` leads the whole mechanism; so it does
!> where links spin about threads, whose whole turns no margin tells.
module linkdyn_led_groups
    use linkdyn_following, only: follower, footing, way_report, follow_way, way_arrived, way_ends
    use linkdyn_group_block, only: group_block, prepare_block, take_sample, tell_sample, lead_links, close_block, find_drift
    use linkdyn_group_motion, only: group_closer
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_newton_group, only: n_shift
    implicit none (type, external)
    private
    public :: lead_places

    integer, parameter :: spare_tries = 30           !! of a way, beside those for its strides
    integer, parameter :: haste = 12                 !! likewise, where lanes go the ways that are not smooth: to a limit of reach
                                                     !! it is about ten

    type, extends(follower) :: led_groups
        type(model_type), pointer :: model => null()
        class(group_closer), pointer :: closer => null()
        integer, allocatable :: lane(:)              !! that has a way (way)
        real(wp), allocatable :: from(:, :), to(:, :)    !! coordinates (way, n_q)
        real(wp), allocatable :: rate(:, :, :)       !! per whole way, where it stands (way, link_freedom, n_link)
        logical, allocatable :: takes(:)             !! scratch (way)
        type(group_block) :: tried                   !! `from`: places where it stands
    contains
        procedure :: try => try_on_way
        procedure :: take => take_on_way
    end type led_groups

contains

    !> Lead the groups of the lanes that go; a lane arrives only if every step could be believed. It is out of reach where the
    !> way has come to a limit of reach, towards which the margin goes as there, and beyond which nothing closes. Of other ways
    !> that do not arrive nothing is said: an alarm of the steps may have ended them.
    subroutine lead_places(model, closer, goes, from, to, branch, place, margin, arrives, longest, least, is_out_of_reach)
        type(model_type), intent(in), target :: model
        class(group_closer), intent(in), target :: closer
        logical, intent(in) :: goes(:)                         !! (lane)
        real(wp), intent(in) :: from(:, :), to(:, :)           !! coordinates (n_q, lane)
        real(wp), intent(in) :: branch(:, :)                   !! (n_branch, lane)
        real(wp), intent(inout) :: place(:, :, :)              !! at the beginning; of a lane that arrives: at the end
                                                               !! (place_size, n_link, lane)
        real(wp), intent(inout) :: margin(:, :)                !! there (n_group, lane)
        logical, intent(out) :: arrives(:)                     !! (lane)
        real(wp), intent(in), optional :: longest(lanes)       !! step, part of a way that is tried in haste; absent: half, and the
                                                               !! whole way has been tried
        real(wp), intent(inout), optional :: least(:, :)       !! smallest size of a margin, of a lane that arrives (n_group, lane)
        logical, intent(out), optional :: is_out_of_reach(:)   !! (lane)
        type(led_groups) :: led
        type(way_report) :: report
        real(wp) :: longest_here(lanes)
        logical :: has_way(lanes)
        integer :: i

        arrives = .false.
        if (present(is_out_of_reach)) is_out_of_reach = .false.
        if (.not. any(goes) .or. any(model%group%n_thread > 0)) return
        led%model => model
        led%closer => closer
        led%lane = pack([(i, i=1, size(goes))], goes)
        led%from = transpose(from(:, led%lane))
        led%to = transpose(to(:, led%lane))
        led%least_margin = model%least_margin(model%n_branch + 1:model%n_branch + size(model%group))
        associate (tried => led%tried)
            call prepare_block(model, size(led%lane), tried)
            tried%only_leads = present(is_out_of_reach)
            tried%way = led%to - led%from
            tried%branch = transpose(branch(:, led%lane))
            do i = 1, size(led%lane)
                call take_sample(model, place(:, :, led%lane(i)), i, tried)
            end do
            tried%from = tried%place
            led%rate = 0*tried%rate
            allocate (led%takes(size(led%lane)))
        end associate
        has_way = .false.
        has_way(led%lane) = .true.
        longest_here = 0.5_wp
        if (present(longest)) longest_here = longest
        call follow_way(led, has_way, longest_here, .false., merge(haste, spare_tries, present(longest)), report)
        do i = 1, size(led%lane)
            associate (lane => led%lane(i))
                arrives(lane) = report%outcome(lane) == way_arrived
                if (present(is_out_of_reach)) is_out_of_reach(lane) = report%outcome(lane) == way_ends .and. report%is_limit(lane)
                if (.not. arrives(lane)) cycle
                call tell_sample(model, size(led%lane), size(place, 1), led%tried%from, i, place(:, :, lane))
                margin(:, lane) = led%tried%margin(i, :)
                if (present(least)) least(:, lane) = report%least(lane, :)
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
        integer :: i, k, g

        associate (tried => self%tried, lane => self%lane)
            do k = 1, size(tried%way, 2)
                tried%at(:, k) = merge(self%to(:, k), self%from(:, k) + part(lane)*tried%way(:, k), part(lane) >= 1)
            end do
            do i = 1, size(self%model%group)
                associate (link => self%model%group(i)%link)
                    do k = 1, size(self%rate, 2)
                        tried%shift(:, k, link) = spread(lead(lane), 2, size(link))*self%rate(:, k, link)
                    end do
                end associate
            end do
            call lead_links(self%model, tried)
            tried%is_closed = goes(lane)
            call close_block(self%model, self%closer, tried)
            if (any(tried%is_closed)) call find_drift(self%model, self%closer, tried)
            found%is_closed = .true.
            found%margin = 1
            found%drift = 0
            do i = 1, size(lane)
                found%is_closed(lane(i)) = tried%is_closed(i)
                found%margin(lane(i), :) = tried%margin(i, :)
                found%drift(lane(i), :) = tried%drift(i, :)
                do g = 1, size(self%model%group)
                    associate (link => self%model%group(g)%link, n => n_shift(self%model))
                        found%speed(lane(i), g) = maxval(abs(tried%rate(i, :, link)))
                        found%shift(lane(i), g) = maxval(abs(tried%place(i, :n, link) - tried%from(i, :n, link))) &
                                                  /self%model%group(g)%size
                    end associate
                end do
            end do
        end associate
    end subroutine try_on_way

    !> Where the mechanism was tried it stands from now on, with its rates there.
    subroutine take_on_way(self, is_taken)
        class(led_groups), intent(inout) :: self
        logical, intent(in) :: is_taken(lanes)
        integer :: g, i, k

        self%takes = is_taken(self%lane)
        associate (tried => self%tried)
            do g = 1, size(self%model%group)
                do i = 1, size(self%model%group(g)%link)
                    associate (l => self%model%group(g)%link(i))
                        do k = 1, size(tried%place, 2)
                            where (self%takes) tried%from(:, k, l) = tried%place(:, k, l)
                        end do
                        do k = 1, size(tried%rate, 2)
                            where (self%takes) self%rate(:, k, l) = tried%rate(:, k, l)
                        end do
                    end associate
                end do
            end do
        end associate
    end subroutine take_on_way
end module linkdyn_led_groups
