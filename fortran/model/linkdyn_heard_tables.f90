!> Tables that a computation is sure to hear, and whether they reach as far as it goes.
!>
!> A table says nothing beyond its rows. What would be asked there is known beforehand, if it is an instant: so it is refused before
!> anything is computed.
module linkdyn_heard_tables
    use linkdyn_formula, only: formula_type, node_symbol, node_add, node_subtract, node_multiply, node_divide, node_power, &
        node_atan2, node_min, node_max
    use linkdyn_kinds, only: wp
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_scene, only: scene_type, law_book, name_len, law_table, law_over, measure_time
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_table, only: lies_within
    use linkdyn_text, only: to_text
    use linkdyn_time_laws, only: owned_law, list_laws, part_motion, part_drive, part_clutch, part_controller, part_event
    implicit none (type, external)
    private
    public :: hearing, heard_table, list_tables, find_short_table, short_in_words, table_in_words
    public :: refuse_short_tables, refuse_instants

    !> Who hears what, beside payloads, the frame, loads and springs, which have a say always. As it stands: inverse dynamics.
    type :: hearing
        logical :: motions = .true.                    !! of all coordinates; false: of driven ones
        logical :: starts = .false.                    !! where the motion of a coordinate begins, if nothing else is said of its
                                                       !! start
        logical :: drives = .false.                    !! laws of actuators
        logical :: controls = .false.                  !! controllers, clutches and events
    end type hearing

    !> A table, whose it is, and what it covers.
    type :: heard_table
        character(len=2*name_len + 32) :: owner = ""   !! "load on 'platform.tool'"
        character(len=2*name_len) :: law = ""          !! "law 'gas'"; blank: it is the owner's own
        integer :: line = 0                            !! of the owner in the scene file
        integer :: measure = 0                         !! of the law book, that it is entered with; 0: the instant
        integer :: number = 0                          !! of the law book; 0: a law of time
        real(wp) :: first = 0, last = 0                !! rows at its ends
        real(wp) :: from = -huge(1.0_wp)               !! it has a say from this instant
        real(wp) :: until = huge(1.0_wp)               !! until this one [s]
        logical :: at_start = .false.                  !! it is heard there alone
    end type heard_table

contains

    !> Those that begin anew after a period have no ends, and are none of them.
    subroutine list_tables(scene, hearer, list)
        type(scene_type), intent(in), target :: scene
        type(hearing), intent(in) :: hearer
        type(heard_table), allocatable, intent(out) :: list(:)
        type(owned_law), allocatable :: own(:)
        logical :: used(size(scene%laws%law))
        type(heard_table) :: table
        integer :: i, k

        allocate (list(0))
        call list_laws(scene, own)
        do i = 1, size(own)
            if (.not. hears(scene, hearer, own(i))) cycle
            table = heard_table()
            table%owner = own(i)%owner
            table%line = own(i)%line
            table%from = own(i)%from
            table%until = own(i)%until
            if (own(i)%part == part_motion .and. .not. hearer%motions) &
                table%at_start = .not. scene%coordinate(own(i)%number)%is_driven
            used = .false.
            if (own(i)%part == part_event) then
                call note_symbols(scene%event(own(i)%number)%formula, used)
            else if (own(i)%law%kind == law_table) then
                table%first = own(i)%law%time(1)
                table%last = own(i)%law%time(size(own(i)%law%time))
                list = [list, table]
            else if (own(i)%law%kind == law_over) then
                used(own(i)%law%law) = .true.
            end if
            call note_laws_taken(scene%laws, used)
            do k = 1, size(used)
                associate (law => scene%laws%law(k))
                    if (.not. used(k) .or. law%over <= 0 .or. law%period > 0) cycle
                    table%law = ""
                    if (index(law%name, "law '") == 1) table%law = law%name
                    table%number = k
                    table%measure = law%over
                    if (scene%laws%measure(law%over)%kind == measure_time) table%measure = 0
                    table%first = law%table%time(1)
                    table%last = law%table%time(size(law%table%time))
                    list = [list, table]
                end associate
            end do
        end do
    end subroutine list_tables

    pure logical function hears(scene, hearer, own)
        type(scene_type), intent(in) :: scene
        type(hearing), intent(in) :: hearer
        type(owned_law), intent(in) :: own

        select case (own%part)
        case (part_motion)
            associate (c => scene%coordinate(own%number))
                hears = hearer%motions .or. c%is_driven .or. (hearer%starts .and. .not. c%has_start)
            end associate
        case (part_drive)
            hears = hearer%drives
        case (part_clutch, part_controller, part_event)
            hears = hearer%controls
        case default
            hears = .true.
        end select
    end function hears

    !> Laws that those used take, whatever the state: each stands behind those that it takes.
    pure subroutine note_laws_taken(book, used)
        type(law_book), intent(in) :: book
        logical, intent(inout) :: used(:)
        integer :: k

        do k = size(used), 1, -1
            if (.not. used(k)) cycle
            associate (law => book%law(k))
                if (law%over < 0) used(-law%over) = .true.
                if (law%over == 0) call note_symbols(law%formula, used)
            end associate
        end do
    end subroutine note_laws_taken

    !> Laws in a formula. What an `if` chooses between is not always heard: it is not among them.
    pure subroutine note_symbols(formula, used)
        type(formula_type), intent(in) :: formula
        logical, intent(inout) :: used(:)
        integer, parameter :: with_two(8) = [node_add, node_subtract, node_multiply, node_divide, node_power, node_atan2, &
                                             node_min, node_max]
        logical :: counts(formula%n)
        integer :: i

        counts = .false.
        if (formula%n > 0) counts(formula%n) = .true.
        do i = formula%n, 1, -1
            if (.not. counts(i)) cycle
            associate (node => formula%node(i))
                if (node%op == node_symbol) then
                    if (node%a < 0) used(-node%a) = .true.
                    cycle
                end if
                if (node%a > 0) counts(node%a) = .true.
                if (any(with_two == node%op)) counts(node%b) = .true.
            end associate
        end do
    end subroutine note_symbols

    !> The first table over time that does not reach from one instant to another; 0: all do.
    pure integer function find_short_table(list, first, last) result(short)
        type(heard_table), intent(in) :: list(:)
        real(wp), intent(in) :: first, last            !! [s]
        integer :: i
        real(wp) :: low, high

        short = 0
        do i = 1, size(list)
            if (list(i)%measure /= 0) cycle
            low = max(first, list(i)%from)
            high = min(last, list(i)%until)
            if (list(i)%at_start) high = min(high, first)
            if (low > high .or. all(lies_within(list(i)%first, list(i)%last, [low, high]))) cycle
            short = i
            return
        end do
    end function find_short_table

    !> "its table covers 0 s to 1 s (expected 0 s to 2 s, the time of the run)"
    pure function short_in_words(table, first, last, asker) result(text)
        type(heard_table), intent(in) :: table
        real(wp), intent(in) :: first, last            !! [s]
        character(len=*), intent(in) :: asker          !! whose instants these are: "run"
        character(len=:), allocatable :: text

        text = table_in_words(table)//" covers "//to_text(table%first)//" s to "//to_text(table%last)//" s (expected " &
               //to_text(first)//" s to "//to_text(last)//" s, the time of the "//asker//")"
    end function short_in_words

    pure function table_in_words(table) result(text)
        type(heard_table), intent(in) :: table
        character(len=:), allocatable :: text

        text = "its table"
        if (table%law /= "") text = "the table of "//trim(table%law)
    end function table_in_words

    !> **Errors**: `status_bad_input` where a table over time does not reach from one instant to another.
    subroutine refuse_short_tables(list, first, last, asker, status)
        type(heard_table), intent(in) :: list(:)
        real(wp), intent(in) :: first, last            !! [s]
        character(len=*), intent(in) :: asker          !! whose instants these are: "run", "step"
        type(status_type), intent(inout) :: status
        integer :: short

        if (.not. status%is_ok()) return
        short = find_short_table(list, first, last)
        if (short == 0) return
        call hold_texts()
        call fail(status, status_bad_input, trim(list(short)%owner)//": "//short_in_words(list(short), first, last, asker))
        call release_texts()
    end subroutine refuse_short_tables

    !> The same of inverse dynamics at some instants, by who asks once.
    subroutine refuse_instants(scene, t, motions, status)
        type(scene_type), intent(in), target :: scene
        real(wp), intent(in) :: t(:)                   !! [s]
        logical, intent(in) :: motions                 !! those of the scene are heard
        type(status_type), intent(inout) :: status
        type(heard_table), allocatable :: list(:)

        if (.not. status%is_ok() .or. size(t) == 0) return
        call list_tables(scene, hearing(motions=motions), list)
        call refuse_short_tables(list, minval(t), maxval(t), "samples", status)
    end subroutine refuse_instants
end module linkdyn_heard_tables
