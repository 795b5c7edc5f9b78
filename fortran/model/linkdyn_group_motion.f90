!> Groups closed by Newton's method on one block of lanes: where the iteration stands, and from where it sets out.
!>
!> A link's place is x, y and angle in a plane; in space x, y, z and a unit quaternion w, x, y, z.
module linkdyn_group_motion
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, group_type, place_size, link_freedom, n_probe
    implicit none (type, external)
    private
    public :: group_motion, group_closer, prepare_groups, size_of_rows

    !> Newton's steps on a way, made by someone else. One procedure only: the modules of the lanes are compiled as one file, and
    !> gfortran does not order several procedures of a type in it as it does elsewhere, where the type is extended.
    type, abstract :: group_closer
        integer :: samples_at_once = 1                       !! that take the time of one
    contains
        procedure(make_steps), deferred :: make_steps
    end type group_closer

    abstract interface
        !> What a group needs where its links stand, for some samples side by side: a column has one number of all of them. What is
        !> not asked for costs less.
        subroutine make_steps(self, g, q, qd, branch, place, margin, is_sure, correction, rate, thread, corrected, extent, &
                              only_leads)
            import :: group_closer, wp
            class(group_closer), intent(in) :: self
            integer, intent(in) :: g                         !! number of the group
            real(wp), intent(in), contiguous, target :: q(:, :), qd(:, :)     !! (sample, n_q)
            real(wp), intent(in), contiguous, target :: branch(:, :)          !! (sample, n_branch)
            real(wp), intent(in), contiguous, target :: place(:, :, :)        !! (sample, place_size, n_link)
            real(wp), intent(out) :: margin(:)               !! (sample)
            logical, intent(out) :: is_sure(:)               !! false: rounding may have grown, or a nut is off its thread (sample)
            !> To be taken from the places; their rates (sample, row)
            real(wp), intent(out), contiguous, target, optional :: correction(:, :), rate(:, :)
            !> Angles of the group's threads by their slides, then their rates (sample, 2 n_thread) [rad]
            real(wp), intent(out), contiguous, target, optional :: thread(:, :)
            !> Places of the group's links with the correction taken (sample, place_size times link)
            real(wp), intent(out), contiguous, target, optional :: corrected(:, :)
            !> How large the correction is, the same without turns about threads, how far from the origin, how fast the links
            !> move (sample, 4), as `linkdyn_corrected_links` has them
            real(wp), intent(out), contiguous, target, optional :: extent(:, :)
            !> Steps of a way, each mended by the next: rounding may grow by more before they are not sure; absent: false
            logical, intent(in), optional :: only_leads
        end subroutine make_steps
    end interface

    type :: group_motion
        real(wp), allocatable :: place(:, :, :)          !! where the iteration stands           (lane, place_size, n_link)
        real(wp), allocatable :: start_place(:, :, :)    !! the assembly from which it sets out
        real(wp), allocatable :: start_q(:, :)           !! coordinates there                    (lane, n_q)
        logical :: moves(lanes) = .true.                 !! false: the iteration has arrived
        logical :: is_idle(lanes) = .false.              !! on a way: nobody asks for what is found
        logical :: is_led = .false.                      !! on a way: a step must be predicted, no accelerations are wanted
        real(wp), allocatable :: contraction(:)          !! of the corrections, the worst of all groups (lane)
        real(wp), allocatable :: margin(:, :)            !! smallest singular value, about, of the constraints with lengths by
                                                         !! the mechanism's size; the sign tells assemblies apart (lane, n_group)
        real(wp), allocatable :: drift(:, :)             !! its rate, on a way                   (lane, n_group)
        class(group_closer), pointer :: closer => null() !! of steps on a way; null: none
        real(wp) :: gap(lanes, -1:0) = 0                 !! size of what a group's motion was found from: velocity, acceleration
        real(wp), allocatable :: matrix(:, :, :), right(:, :, :)    !! (lane, row, column)
    end type group_motion

contains

    !> Make room; the iteration will set out from the assembly at the scene's start.
    subroutine prepare_groups(model, n_column, motion)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n_column
        type(group_motion), intent(out) :: motion
        integer :: g, i, k, n

        n = 0
        do g = 1, size(model%group)
            n = max(n, link_freedom(model)*size(model%group(g)%link))
        end do
        allocate (motion%matrix(lanes, n, n), motion%right(lanes, n, max(n_column, n_probe) + 1))
        allocate (motion%start_place(lanes, place_size(model), model%n_link))
        allocate (motion%contraction(lanes), motion%margin(lanes, size(model%group)), motion%drift(lanes, size(model%group)))
        motion%contraction = 0
        motion%margin = 1
        motion%drift = 0
        motion%start_q = spread(model%start_q, 1, lanes)
        motion%start_place = 0
        do g = 1, size(model%group)
            associate (group => model%group(g))
                do i = 1, size(group%link)
                    do k = 1, place_size(model)
                        motion%start_place(:, k, group%link(i)) = group%start(k, i)
                    end do
                end do
            end associate
        end do
        motion%place = motion%start_place
    end subroutine prepare_groups

    !> Length of a group's right-hand sides, distances as parts of the mechanism's size.
    pure function size_of_rows(group, right) result(length)
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: right(:, :)              !! (lane, row)
        real(wp) :: length(lanes)
        integer :: i

        length = 0
        do i = 1, size(right, 2)
            length = length + (right(:, i)/group%row_unit(i))**2
        end do
        length = sqrt(length)
    end function size_of_rows
end module linkdyn_group_motion
