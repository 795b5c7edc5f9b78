!> Values that belong to nodes of a record, from one node on: few of many, since records are long, and what is asked of them is near
!> their end. They lie in pages, of which only those exist that hold a value.
module linkdyn_node_values
    use linkdyn_value, only: value, operator(-)
    implicit none (type, external)
    private
    public :: node_values

    integer, parameter :: page_size = 128

    type :: node_values
        integer :: first = huge(1)                          !! the oldest node that has one
        integer, private :: n_page = 0
        integer, allocatable, private :: page(:)            !! (node/page_size), from 0; 0: none of its nodes has one
        type(value), allocatable, private :: of(:, :)       !! (place in the page, page), from 0; node 0: none yet
    contains
        procedure :: make_room
        procedure :: put
        procedure :: has
        procedure :: get
    end type node_values

contains

    !> All nodes up to one may be asked for their values from now on.
    subroutine make_room(self, node)
        class(node_values), intent(inout) :: self
        integer, intent(in) :: node
        integer, allocatable :: page(:)
        integer :: last

        last = -1
        if (allocated(self%page)) last = ubound(self%page, 1)
        if (node/page_size <= last) return
        allocate (page(0:2*(node/page_size)), source=0)
        if (last >= 0) page(:last) = self%page
        call move_alloc(page, self%page)
    end subroutine make_room

    !> What belongs to the node of a value whose sign may be turned.
    subroutine put(self, v, x)
        class(node_values), intent(inout) :: self
        type(value), intent(in) :: v, x

        call self%make_room(v%node)
        if (self%page(v%node/page_size) == 0) call add_page(self, v%node/page_size)
        self%of(modulo(v%node, page_size), self%page(v%node/page_size)) = with_sign(x, v%sign)
        self%first = min(self%first, v%node)
    end subroutine put

    subroutine add_page(self, number)
        type(node_values), intent(inout) :: self
        integer, intent(in) :: number
        type(value), allocatable :: of(:, :)

        if (.not. allocated(self%of)) allocate (self%of(0:page_size - 1, 2))
        if (self%n_page == size(self%of, 2)) then
            allocate (of(0:page_size - 1, 2*self%n_page))
            of(:, :self%n_page) = self%of
            call move_alloc(of, self%of)
        end if
        self%n_page = self%n_page + 1
        self%page(number) = self%n_page
    end subroutine add_page

    !> Is there one? Of nodes that there is room for.
    pure logical function has(self, node)
        class(node_values), intent(in) :: self
        integer, intent(in) :: node
        integer :: page

        page = self%page(node/page_size)
        has = page > 0
        if (has) has = self%of(modulo(node, page_size), page)%node > 0
    end function has

    !> What belongs to a value, with its sign.
    function get(self, v) result(x)
        class(node_values), intent(in) :: self
        type(value), intent(in) :: v
        type(value) :: x

        x = with_sign(self%of(modulo(v%node, page_size), self%page(v%node/page_size)), v%sign)
    end function get

    function with_sign(x, sign) result(y)
        type(value), intent(in) :: x
        integer, intent(in) :: sign
        type(value) :: y

        y = x
        if (sign < 0) y = -x
    end function with_sign
end module linkdyn_node_values
