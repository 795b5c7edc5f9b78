!> Which road the samples of a run took: how their links were placed, and whether their equations went as planned.
module linkdyn_roads
    implicit none (type, external)
    private
    public :: road_counts, operator(+)

    !> Samples by road. Each is placed in one of two ways; the dense solver may take over in either.
    type :: road_counts
        integer :: closed = 0        !! all links placed in closed form
        integer :: iterated = 0      !! some group of links closed by iteration
        integer :: dense = 0         !! handed by the planned elimination to the dense solver
    end type road_counts

    interface operator(+)
        module procedure add
    end interface operator(+)

contains

    pure type(road_counts) function add(a, b) result(c)
        type(road_counts), intent(in) :: a, b

        c = road_counts(a%closed + b%closed, a%iterated + b%iterated, a%dense + b%dense)
    end function add
end module linkdyn_roads
