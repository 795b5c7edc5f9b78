!> What a loop holds more often than once: the constraint directions that its other joints hold already.
!>
!> Counting says *that* joints over-constrain their links, not in which directions. This closes the loop once
!> (`linkdyn_constraint_rows`) and builds an orthonormal basis of the constraint rows in the order of the joints: a row that lies in
!> the span of those before it is redundant.
module linkdyn_redundancy
    use linkdyn_constraint_rows, only: loop_type, rows_type, close_near_start, list_rows, least_new, of_force, of_moment, &
        across, along
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, holds_spin
    use linkdyn_scene, only: joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, joint_spherical, joint_kind_name
    use linkdyn_text, only: quoted, to_text
    implicit none (type, external)
    private
    public :: redundancy_type, find_redundancy, most_links

    integer, parameter :: most_links = 40               !! of a loop that is looked at: the cost grows with the cube

    !> What was found.
    type :: redundancy_type
        logical :: is_known = .false.                   !! the loop was closed
        integer :: count = 0                            !! redundant directions
        character(len=:), allocatable :: directions     !! "of joint 'D' the force along its axis and ..."
        character(len=:), allocatable :: remedy         !! "make joint 'D' spherical"; empty: no other kind helps
        character(len=:), allocatable :: gap            !! of one that hardly misses: "joint 'D' stays open by 2e-5 m"; empty: it
                                                        !! closes, or is far from that
    end type redundancy_type

contains

    !> Look at the loop that joints make of links.
    function find_redundancy(model, link, joint) result(found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link(:)                  !! whose other ends are the frame
        integer, intent(in) :: joint(:)
        type(redundancy_type) :: found
        type(loop_type) :: loop
        type(rows_type) :: rows
        logical, allocatable :: is_redundant(:)

        found%gap = ""
        if (size(link) > most_links) return
        call close_near_start(model, link, joint, loop, found%is_known)
        if (.not. found%is_known) found%gap = gap_of(model, loop)
        if (.not. found%is_known) return
        call list_rows(model, loop, rows)
        is_redundant = redundant_rows(rows, least_new(loop))
        found%count = count(is_redundant)
        found%directions = words_of(model, loop, rows, is_redundant)
        found%remedy = remedy_of(model, loop, found%count)
    end function find_redundancy

    !> Rows in the span of those before them: Gram and Schmidt, twice.
    pure function redundant_rows(rows, least) result(is_redundant)
        type(rows_type), intent(in) :: rows
        real(wp), intent(in) :: least                   !! part of a row that is new
        logical, allocatable :: is_redundant(:)
        real(wp), allocatable :: basis(:, :), rest(:)
        integer :: i, n, pass

        allocate (is_redundant(rows%n), source=.false.)
        allocate (basis(size(rows%row, 1), rows%n), source=0.0_wp)
        n = 0
        do i = 1, rows%n
            rest = rows%row(:, i)/norm2(rows%row(:, i))
            do pass = 1, 2
                rest = rest - matmul(basis(:, :n), matmul(transpose(basis(:, :n)), rest))
            end do
            is_redundant(i) = norm2(rest) < least
            if (is_redundant(i)) cycle
            n = n + 1
            basis(:, n) = rest/norm2(rest)
        end do
    end function redundant_rows

    ! ---------------------------------------------------------------- words

    !> Where joints that almost fit are open, by the largest gap of what steps have come to.
    function gap_of(model, loop) result(words)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        character(len=:), allocatable :: words
        real(wp), parameter :: hardly_misses = 1.0e-3_wp       ! [rad, scene sizes]
        type(rows_type) :: rows
        integer :: worst

        words = ""
        if (.not. loop%open <= hardly_misses) return
        call list_rows(model, loop, rows, gears=.false.)
        worst = maxloc(abs(rows%residual(:rows%n)), dim=1)
        associate (gap => abs(rows%residual(worst)), name => model%joint(loop%joint(rows%joint(worst)))%name)
            words = "joint "//quoted(name)//" stays open by "
            if (rows%sort(worst) == of_force) then
                words = words//to_text(gap*loop%size)//" m"
            else
                words = words//to_text(gap)//" rad"
            end if
        end associate
    end function gap_of


    !> Redundant directions joint by joint: "of joint 'D' the force along its axis; of joint ...".
    function words_of(model, loop, rows, is_redundant) result(words)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        type(rows_type), intent(in) :: rows
        logical, intent(in) :: is_redundant(:)
        character(len=:), allocatable :: words, held
        integer :: i

        words = ""
        do i = 1, size(loop%joint)
            held = ""
            call tell(of_force, across, "force", " across its axis")
            call tell(of_force, along, "force", " along its axis")
            call tell(of_moment, across, "moment", " across its axis")
            call tell(of_moment, along, "moment", " about its axis")
            if (held == "") cycle
            if (words /= "") words = words//"; "
            words = words//"of joint "//quoted(model%joint(loop%joint(i))%name)//" "//held
        end do

    contains

        subroutine tell(sort, direction, noun, where)
            integer, intent(in) :: sort, direction
            character(len=*), intent(in) :: noun, where
            integer :: n, of_all
            logical :: is_meant(rows%n)

            is_meant = rows%joint(:rows%n) == i .and. rows%sort(:rows%n) == sort .and. rows%direction(:rows%n) == direction
            of_all = count(is_meant)
            n = count(is_meant .and. is_redundant)
            if (n == 0) return
            if (held /= "") held = held//" and "
            if (of_all == 1) then
                held = held//"the "//noun
            else if (n == of_all) then
                held = held//"both "//noun//"s"
            else
                held = held//"one "//noun
            end if
            if (.not. model%is_planar .or. (sort == of_force .and. loop%kind(i) == joint_prismatic)) held = held//where
        end subroutine tell
    end function words_of

    !> Other kinds of joints that hold less, taken while they free redundant directions only: those that free most first, from
    !> the last joint on.
    function remedy_of(model, loop, n_redundant) result(remedy)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        integer, intent(in) :: n_redundant
        character(len=:), allocatable :: remedy
        integer, parameter :: looser(2, 4) = reshape( &
            [joint_revolute, joint_spherical, joint_universal, joint_spherical, &
             joint_revolute, joint_cylindrical, joint_prismatic, joint_cylindrical], [2, 4])   !! a kind, and a looser one
        type(loop_type) :: changed, tried
        integer :: i, k, left, left_then, mobility, mobility_then

        remedy = ""
        if (model%is_planar) return
        changed = loop
        call count_rows(changed, left, mobility)
        do k = 1, size(looser, 2)
            do i = size(loop%joint), 1, -1
                if (left == 0 .or. looser(1, k) /= changed%kind(i) .or. holds_spin(model%joint(loop%joint(i)))) cycle
                tried = changed
                tried%kind(i) = looser(2, k)
                call count_rows(tried, left_then, mobility_then)
                if (mobility_then /= mobility .or. left_then >= left) cycle
                changed = tried
                left = left_then
                if (remedy /= "") remedy = remedy//" and "
                remedy = remedy//"joint "//quoted(model%joint(loop%joint(i))%name)//" "//trim(joint_kind_name(looser(2, k)))
            end do
        end do
        if (left > 0 .or. n_redundant == 0) remedy = ""
        if (remedy /= "") remedy = "make "//remedy

    contains

        subroutine count_rows(loop, n_redundant, mobility)
            type(loop_type), intent(in) :: loop
            integer, intent(out) :: n_redundant, mobility
            type(rows_type) :: rows

            call list_rows(model, loop, rows)
            n_redundant = count(redundant_rows(rows, least_new(loop)))
            mobility = size(rows%row, 1) - rows%n + n_redundant
        end subroutine count_rows
    end function remedy_of
end module linkdyn_redundancy
