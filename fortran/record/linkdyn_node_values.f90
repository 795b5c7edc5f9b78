!> Values that belong to nodes of a record, from one node on: records are long, and what is asked of them is near their end.
module linkdyn_node_values
    use linkdyn_value, only: value, operator(-)
    implicit none (type, external)
    private
    public :: node_values

    type :: node_values
        integer :: first = huge(1)                          !! the oldest node that has one
        type(value), allocatable, private :: of(:)          !! (node - first + 1); node 0: none yet
    contains
        procedure :: make_room
        procedure :: put
        procedure :: has
        procedure :: get
    end type node_values

contains

    !> All nodes up to one may have a value from now on.
    subroutine make_room(self, node)
        class(node_values), intent(inout) :: self
        integer, intent(in) :: node
        type(value), allocatable :: of(:)
        integer :: first, last

        if (.not. allocated(self%of)) then
            self%first = node
            allocate (self%of(0))
        end if
        last = self%first + size(self%of) - 1
        if (node >= self%first .and. node <= last) return
        first = min(self%first, node)
        allocate (of(2*(max(last, node) - first + 1)))
        of(self%first - first + 1:self%first - first + size(self%of)) = self%of
        call move_alloc(of, self%of)
        self%first = first
    end subroutine make_room

    !> What belongs to the node of a value whose sign may be turned.
    subroutine put(self, v, x)
        class(node_values), intent(inout) :: self
        type(value), intent(in) :: v, x

        call self%make_room(v%node)
        self%of(v%node - self%first + 1) = with_sign(x, v%sign)
    end subroutine put

    !> Is there one? Of nodes that there is room for.
    pure logical function has(self, node)
        class(node_values), intent(in) :: self
        integer, intent(in) :: node

        has = self%of(node - self%first + 1)%node > 0
    end function has

    !> What belongs to a value, with its sign.
    function get(self, v) result(x)
        class(node_values), intent(in) :: self
        type(value), intent(in) :: v
        type(value) :: x

        x = with_sign(self%of(v%node - self%first + 1), v%sign)
    end function get

    function with_sign(x, sign) result(y)
        type(value), intent(in) :: x
        integer, intent(in) :: sign
        type(value) :: y

        y = x
        if (sign < 0) y = -x
    end function with_sign
end module linkdyn_node_values
