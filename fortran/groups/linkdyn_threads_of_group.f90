!> Threads of a group closed by iteration: how far its nuts have gone, how fast they go, and how far they are off.
!>
!> A thread's constraint knows nothing of whole turns. The slide does: an angle by the slide, and its rate by the turn, tell
!> whoever goes from place to place whether a nut has stayed on its turn.
module linkdyn_threads_of_group
    use linkdyn_bodies, only: world_axes, omega_of
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type, pair_of
    use linkdyn_value, only: value, reciprocal, operator(*)
    use linkdyn_vector, only: vector, operator(-), operator(.dot.)
    implicit none (type, external)
    private
    public :: group_threads, measure_threads, surely_same_turn

    !> [rad] A nut is predicted on the right turn of its thread if it is off by less: so much that a sixth of a turn is seldom
    !> exceeded, so little that the next turn is five times as far.
    real(wp), parameter :: surely_same_turn = 1.0_wp

    type :: group_threads
        type(value), allocatable :: angle(:)           !! by the slide, with its turns (thread) [rad]
        type(value), allocatable :: rate(:)            !! of it, by the turn (thread)
        type(value), allocatable :: off(:)             !! of the nut, but for whole turns (thread) [rad]
    end type group_threads

contains

    !> Measure the threads of links that are placed; of how those of the group move only the given rates are known.
    subroutine measure_threads(mechanism, joint, link, rate, threads)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint(:), link(:)       !! of the group
        type(value), intent(in) :: rate(:)             !! velocity and angular velocity of each link (row)
        type(group_threads), intent(out) :: threads
        type(marker_pair) :: pair
        type(value), allocatable :: c(:)
        type(vector) :: omega
        integer :: i

        allocate (threads%angle(0), threads%rate(0), threads%off(0))
        do i = 1, size(joint)
            associate (kind => mechanism%kind(joint(i))%is, ends => mechanism%model%joint(joint(i))%link)
                if (.not. kind%is_threaded) cycle
                pair = pair_of(mechanism, joint(i))
                threads%angle = [threads%angle, kind%variables(pair)]
                omega = turning(ends(2)) - turning(ends(1))
                threads%rate = [threads%rate, omega.dot.pair%first%z]
                c = kind%constraints(pair)
                ! the thread's own is the last, a length
                threads%off = [threads%off, reciprocal(kind%pitch)*c(size(c))]
            end associate
        end do

    contains

        function turning(l) result(w)
            integer, intent(in) :: l
            type(vector) :: w
            integer :: k

            k = 6*findloc(link, l, dim=1)
            if (k > 0) then
                w = vector(rate(k - 2), rate(k - 1), rate(k))
            else
                w = omega_of(mechanism%bodies, l, world_axes)
            end if
        end function turning
    end subroutine measure_threads
end module linkdyn_threads_of_group
