!> Mechanisms taken apart by counting: which links can be placed together, and in what order.
!>
!> A link has `freedom` freedoms (3 planar, 6 spatial). A tie (a joint, or a coordinate given at it) removes some of
!> those of its two links, a gear's one of those of all that it hangs on. Every constraint is charged to one of its links; if
!> every link can be charged exactly its freedoms, the links that charge each other in a circle form the smallest groups that
!> can be placed at once: one link is a step of an open chain, more are an Assur group. If not, the counting names the links
!> and ties at fault.
!>
!> **Source**: Dulmage, Mendelsohn, Canad. J. Math. 10 (1958) 517, for the decomposition; Tarjan, SIAM J. Comput. 1 (1972)
!> 146, for the circles.
module linkdyn_assur_groups
    implicit none (type, external)
    private
    public :: tie_type, grouping_type, find_groups, groups_of_links, most_tied

    integer, parameter :: most_tied = 12     !! links of a tie

    !> Constraints between links, two of a joint. Link 0 stands for every link that is known beforehand, and for none.
    type :: tie_type
        integer :: link(most_tied) = 0       !! each once
        integer :: n_constraint = 0
    end type tie_type

    !> The links in groups, in the order in which they can be placed; or what prevents it.
    type :: grouping_type
        integer :: n_group = 0
        integer, allocatable :: first(:)     !! group g: member(first(g):first(g+1)-1)
        integer, allocatable :: member(:)    !! links
        integer :: excess = 0                !! constraints too many among the links and ties at fault
        integer :: failed_tie = 0            !! the first that found no freedom left
        integer :: lack = 0                  !! constraints too few
        logical, allocatable :: link_at_fault(:), tie_at_fault(:)
    end type grouping_type

    !> Who is charged with what.
    type :: ledger_type
        integer :: freedom = 0
        integer, allocatable :: charged(:)             !! constraints charged to a link
        integer, allocatable :: share(:, :)            !! constraints of a tie charged to its links (most_tied, n_tie)
        integer, allocatable :: first(:), tie(:)       !! ties of link l: tie(first(l):first(l+1)-1)
    end type ledger_type

    !> Search for circles.
    type :: circle_search
        integer :: n_seen = 0, n_open = 0
        integer, allocatable :: number(:), low(:), open(:)
        logical, allocatable :: is_open(:)
    end type circle_search

contains

    !> The group of each link, from 0 on; 0: it is known before all of them, as the frame is.
    pure function groups_of_links(grouping, n_link) result(group)
        type(grouping_type), intent(in) :: grouping
        integer, intent(in) :: n_link
        integer :: group(0:n_link)
        integer :: g

        group = 0
        do g = 1, grouping%n_group
            group(grouping%member(grouping%first(g):grouping%first(g + 1) - 1)) = g
        end do
    end function groups_of_links

    subroutine find_groups(freedom, is_known, n_joint, tie, grouping)
        integer, intent(in) :: freedom           !! of a link
        logical, intent(in) :: is_known(:)       !! placed beforehand (n_link); their ties name link 0 instead
        integer, intent(in) :: n_joint           !! the first ties are joints, the others coordinates
        type(tie_type), intent(in) :: tie(:)
        type(grouping_type), intent(out) :: grouping
        type(ledger_type) :: ledger
        integer :: t, n, n_link

        n_link = size(is_known)
        allocate (grouping%first(n_link + 1), grouping%member(n_link))
        allocate (grouping%link_at_fault(n_link), grouping%tie_at_fault(size(tie)))
        grouping%link_at_fault = .false.
        grouping%tie_at_fault = .false.
        call open_ledger(n_link, freedom, tie, ledger)
        do t = 1, size(tie)
            do n = 1, tie(t)%n_constraint
                if (is_charged(ledger, tie, t, grouping%link_at_fault)) cycle
                call blame_excess(ledger, tie(:merge(n_joint, size(tie), t <= n_joint)), t, grouping)
                return
            end do
        end do
        call blame_lack(ledger, tie, is_known, grouping)
        if (grouping%lack == 0) call order_groups(ledger, tie, is_known, grouping)
    end subroutine find_groups

    !> Nobody is charged yet; lists of the ties of each link, one behind the other.
    subroutine open_ledger(n_link, freedom, tie, ledger)
        integer, intent(in) :: n_link, freedom
        type(tie_type), intent(in) :: tie(:)
        type(ledger_type), intent(out) :: ledger
        integer :: place(0:n_link), t, side, l

        ledger%freedom = freedom
        allocate (ledger%charged(n_link), ledger%share(most_tied, size(tie)), ledger%first(n_link + 1))
        ledger%charged = 0
        ledger%share = 0
        place = 0
        do t = 1, size(tie)
            do side = 1, most_tied
                l = tie(t)%link(side)
                place(l) = place(l) + 1
            end do
        end do
        ledger%first(1) = 1
        do l = 1, n_link
            ledger%first(l + 1) = ledger%first(l) + place(l)
        end do
        allocate (ledger%tie(ledger%first(n_link + 1) - 1))
        place(1:) = ledger%first(:n_link)
        do t = 1, size(tie)
            do side = 1, most_tied
                l = tie(t)%link(side)
                if (l == 0) cycle
                ledger%tie(place(l)) = t
                place(l) = place(l) + 1
            end do
        end do
    end subroutine open_ledger

    !> Charge one more constraint of a tie, moving earlier charges if need be.
    logical function is_charged(ledger, tie, t, visited)
        type(ledger_type), intent(inout) :: ledger
        type(tie_type), intent(in) :: tie(:)
        integer, intent(in) :: t
        logical, intent(out) :: visited(:)     !! links that were asked
        integer :: side

        visited = .false.
        do side = 1, most_tied
            is_charged = has_room(ledger, tie, tie(t)%link(side), visited)
            if (.not. is_charged) cycle
            call charge(ledger, t, side, tie(t)%link(side), 1)
            return
        end do
    end function is_charged

    subroutine charge(ledger, t, side, link, n)
        type(ledger_type), intent(inout) :: ledger
        integer, intent(in) :: t, side, link, n

        ledger%share(side, t) = ledger%share(side, t) + n
        ledger%charged(link) = ledger%charged(link) + n
    end subroutine charge

    !> Can the link take one more, if others may take one of its own? Makes the room if so.
    recursive logical function has_room(ledger, tie, link, visited) result(room)
        type(ledger_type), intent(inout) :: ledger
        type(tie_type), intent(in) :: tie(:)
        integer, intent(in) :: link
        logical, intent(inout) :: visited(:)
        integer :: k, t, side, other

        room = .false.
        if (link == 0) return
        if (visited(link)) return
        visited(link) = .true.
        room = ledger%charged(link) < ledger%freedom
        if (room) return
        do k = ledger%first(link), ledger%first(link + 1) - 1
            t = ledger%tie(k)
            side = findloc(tie(t)%link, link, dim=1)
            if (ledger%share(side, t) == 0) cycle
            do other = 1, most_tied
                if (other == side) cycle
                room = has_room(ledger, tie, tie(t)%link(other), visited)
                if (.not. room) cycle
                call charge(ledger, t, side, link, -1)
                call charge(ledger, t, other, tie(t)%link(other), 1)
                return
            end do
        end do
    end function has_room

    !> The links asked in vain, and the ties that hold nothing else.
    subroutine blame_excess(ledger, tie, failed, grouping)
        type(ledger_type), intent(in) :: ledger
        type(tie_type), intent(in) :: tie(:)
        integer, intent(in) :: failed
        type(grouping_type), intent(inout) :: grouping
        integer :: t, n

        grouping%failed_tie = failed
        n = 0
        do t = 1, size(tie)
            grouping%tie_at_fault(t) = is_within(tie(t)%link) &
                                       .and. (any(tie(t)%link > 0) .or. t == failed)
            if (grouping%tie_at_fault(t)) n = n + tie(t)%n_constraint
        end do
        grouping%excess = n - ledger%freedom*count(grouping%link_at_fault)

    contains

        pure logical function is_within(link)
            integer, intent(in) :: link(:)
            integer :: i

            is_within = .true.
            do i = 1, size(link)
                if (link(i) > 0) is_within = is_within .and. grouping%link_at_fault(link(i))
            end do
        end function is_within
    end subroutine blame_excess

    !> Links with freedoms left, and those whose constraints could as well be charged to them.
    subroutine blame_lack(ledger, tie, is_known, grouping)
        type(ledger_type), intent(in) :: ledger
        type(tie_type), intent(in) :: tie(:)
        logical, intent(in) :: is_known(:)
        type(grouping_type), intent(inout) :: grouping
        integer :: l

        grouping%link_at_fault = .false.
        do l = 1, size(is_known)
            if (is_known(l) .or. ledger%charged(l) == ledger%freedom) cycle
            grouping%lack = grouping%lack + ledger%freedom - ledger%charged(l)
            call spread_lack(ledger, tie, l, grouping%link_at_fault)
        end do
    end subroutine blame_lack

    recursive subroutine spread_lack(ledger, tie, link, at_fault)
        type(ledger_type), intent(in) :: ledger
        type(tie_type), intent(in) :: tie(:)
        integer, intent(in) :: link
        logical, intent(inout) :: at_fault(:)
        integer :: k, t, side

        if (link == 0) return
        if (at_fault(link)) return
        at_fault(link) = .true.
        do k = ledger%first(link), ledger%first(link + 1) - 1
            t = ledger%tie(k)
            do side = 1, most_tied
                if (ledger%share(side, t) > 0 .and. tie(t)%link(side) /= link) &
                    call spread_lack(ledger, tie, tie(t)%link(side), at_fault)
            end do
        end do
    end subroutine spread_lack

    ! ---------------------------------------------------------------- order

    subroutine order_groups(ledger, tie, is_known, grouping)
        type(ledger_type), intent(in) :: ledger
        type(tie_type), intent(in) :: tie(:)
        logical, intent(in) :: is_known(:)
        type(grouping_type), intent(inout) :: grouping
        type(circle_search) :: search
        integer :: l, n_link

        n_link = size(is_known)
        allocate (search%number(n_link), search%low(n_link), search%open(n_link), search%is_open(n_link))
        search%number = 0
        search%is_open = .false.
        grouping%first(1) = 1
        do l = 1, n_link
            if (.not. is_known(l) .and. search%number(l) == 0) call visit(ledger, tie, l, search, grouping)
        end do
    end subroutine order_groups

    !> Tarjan's search: a link waits for those on the other side of the constraints charged to it, so groups come out
    !> with what they rest on before them.
    recursive subroutine visit(ledger, tie, link, search, grouping)
        type(ledger_type), intent(in) :: ledger
        type(tie_type), intent(in) :: tie(:)
        integer, intent(in) :: link
        type(circle_search), intent(inout) :: search
        type(grouping_type), intent(inout) :: grouping
        integer :: k, t, side, other

        search%n_seen = search%n_seen + 1
        search%number(link) = search%n_seen
        search%low(link) = search%n_seen
        search%n_open = search%n_open + 1
        search%open(search%n_open) = link
        search%is_open(link) = .true.
        do k = ledger%first(link), ledger%first(link + 1) - 1
            t = ledger%tie(k)
            if (ledger%share(findloc(tie(t)%link, link, dim=1), t) == 0) cycle
            do side = 1, most_tied
                other = tie(t)%link(side)
                if (other == 0 .or. other == link) cycle
                if (search%number(other) == 0) then
                    call visit(ledger, tie, other, search, grouping)
                    search%low(link) = min(search%low(link), search%low(other))
                else if (search%is_open(other)) then
                    search%low(link) = min(search%low(link), search%number(other))
                end if
            end do
        end do
        if (search%low(link) == search%number(link)) call close_group(link, search, grouping)
    end subroutine visit

    subroutine close_group(root, search, grouping)
        integer, intent(in) :: root
        type(circle_search), intent(inout) :: search
        type(grouping_type), intent(inout) :: grouping
        integer :: link, n

        grouping%n_group = grouping%n_group + 1
        n = grouping%first(grouping%n_group)
        do
            link = search%open(search%n_open)
            search%n_open = search%n_open - 1
            search%is_open(link) = .false.
            grouping%member(n) = link
            n = n + 1
            if (link == root) exit
        end do
        grouping%first(grouping%n_group + 1) = n
    end subroutine close_group
end module linkdyn_assur_groups
