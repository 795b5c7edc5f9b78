!> Values that belong to nodes of a record, from one node on: few of many, since records are long, and what is asked of them is near
!> their end. They lie in pages, and these in chapters, of which only those exist that hold a value: to begin costs next to nothing,
!> however long the record is.
module linkdyn_node_values
    use linkdyn_value, only: value, operator(-)
    implicit none (type, external)
    private
    public :: node_values

    integer, parameter :: page_size = 128                   !! nodes
    integer, parameter :: chapter_size = 128                !! pages

    type :: node_values
        integer :: first = huge(1)                          !! the oldest node that has one
        integer, private :: n_page = 0, n_chapter = 0
        integer, allocatable, private :: chapter(:)         !! of the record, from 0; 0: none of its nodes has one
        integer, allocatable, private :: page(:, :)         !! likewise (place in the chapter, chapter), from 0
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
        integer, allocatable :: chapter(:)
        integer :: last

        last = -1
        if (allocated(self%chapter)) last = ubound(self%chapter, 1)
        if (chapter_of(node) <= last) return
        allocate (chapter(0:2*chapter_of(node)), source=0)
        if (last >= 0) chapter(:last) = self%chapter
        call move_alloc(chapter, self%chapter)
    end subroutine make_room

    !> What belongs to the node of a value whose sign may be turned.
    subroutine put(self, v, x)
        class(node_values), intent(inout) :: self
        type(value), intent(in) :: v, x
        integer :: chapter, page

        call self%make_room(v%node)
        associate (number => self%chapter(chapter_of(v%node)))
            if (number == 0) call add_chapter(self, number)
            chapter = number
        end associate
        associate (number => self%page(page_of(v%node), chapter))
            if (number == 0) then
                call add_page(self)
                number = self%n_page
            end if
            page = number
        end associate
        self%of(place_of(v%node), page) = with_sign(x, v%sign)
        self%first = min(self%first, v%node)
    end subroutine put

    subroutine add_chapter(self, number)
        class(node_values), intent(inout) :: self
        integer, intent(out) :: number
        integer, allocatable :: page(:, :)

        if (.not. allocated(self%page)) allocate (self%page(0:chapter_size - 1, 2))
        if (self%n_chapter == size(self%page, 2)) then
            allocate (page(0:chapter_size - 1, 2*self%n_chapter))
            page(:, :self%n_chapter) = self%page
            call move_alloc(page, self%page)
        end if
        self%n_chapter = self%n_chapter + 1
        self%page(:, self%n_chapter) = 0
        number = self%n_chapter
    end subroutine add_chapter

    subroutine add_page(self)
        class(node_values), intent(inout) :: self
        type(value), allocatable :: of(:, :)

        if (.not. allocated(self%of)) allocate (self%of(0:page_size - 1, 2))
        if (self%n_page == size(self%of, 2)) then
            allocate (of(0:page_size - 1, 2*self%n_page))
            of(:, :self%n_page) = self%of
            call move_alloc(of, self%of)
        end if
        self%n_page = self%n_page + 1
    end subroutine add_page

    !> Is there one? Of nodes that there is room for.
    pure logical function has(self, node)
        class(node_values), intent(in) :: self
        integer, intent(in) :: node
        integer :: page

        page = page_with(self, node)
        has = page > 0
        if (has) has = self%of(place_of(node), page)%node > 0
    end function has

    !> What belongs to a value, with its sign.
    function get(self, v) result(x)
        class(node_values), intent(in) :: self
        type(value), intent(in) :: v
        type(value) :: x

        x = with_sign(self%of(place_of(v%node), page_with(self, v%node)), v%sign)
    end function get

    !> The page that holds what belongs to a node; 0: there is none.
    pure integer function page_with(self, node)
        class(node_values), intent(in) :: self
        integer, intent(in) :: node

        page_with = self%chapter(chapter_of(node))
        if (page_with > 0) page_with = self%page(page_of(node), page_with)
    end function page_with

    pure integer function chapter_of(node)
        integer, intent(in) :: node

        chapter_of = node/(page_size*chapter_size)
    end function chapter_of

    !> In its chapter.
    pure integer function page_of(node)
        integer, intent(in) :: node

        page_of = modulo(node/page_size, chapter_size)
    end function page_of

    !> In its page.
    pure integer function place_of(node)
        integer, intent(in) :: node

        place_of = modulo(node, page_size)
    end function place_of

    function with_sign(x, sign) result(y)
        type(value), intent(in) :: x
        integer, intent(in) :: sign
        type(value) :: y

        y = x
        if (sign < 0) y = -x
    end function with_sign
end module linkdyn_node_values
