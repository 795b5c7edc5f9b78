!> A scene in several files: `include = "legs.toml"`, or a list of names.
!>
!> Tables of an included file are merged with the scene's, arrays of tables appended to them; names of files, in it and in what
!> it includes, start at its own folder. Every file is read once; where a scene is opened again its files are not.
module linkdyn_scene_include
    use linkdyn_input, only: read_file_text, folder_of, path_in_folder
    use linkdyn_path, only: is_inside, is_same_file
    use linkdyn_scene, only: path_len, source_spec, source_shelf
    use linkdyn_scene_keys, only: scene_place, refuse, refuse_value, line_text, place_text
    use linkdyn_status, only: status_type, status_bad_input, fail
    use linkdyn_text, only: quoted, to_text
    use linkdyn_toml, only: toml_document, toml_node, toml_string, toml_array, parse_toml, free_toml
    implicit none (type, external)
    private
    public :: open_document, reopen_document, scene_key

    integer, parameter :: most_files = 100          !! of a scene: more than anybody writes, few enough to be read at once
    integer, parameter :: deepest = 16              !! files that include one another

    !> What may stand at the top of a scene.
    character(len=13), parameter :: scene_key(*) = [character(len=13) :: "title", "space", "gravity", "change_points", &
        "redundancy", "frame", "link", "joint", "coordinate", "actuator", "load", "chain", "spring", "time", "sweep", "variables", &
        "include", "measures", "laws", "payload", "event", "stop", "friction", "controller", "clutch"]

    !> What reading goes by.
    type :: reading_type
        type(source_shelf) :: shelf                 !! files in the order of reading
        character(len=:), allocatable :: folder     !! of the scene
        logical :: is_again = .false.               !! the texts are there already
        integer :: n = 0                            !! files read so far
    end type reading_type

contains

    !> The text as a document, with all that it includes; to be freed by `free_toml`.
    subroutine open_document(text, file, folder, document, source, status)
        character(len=*), intent(in) :: text
        character(len=*), intent(in) :: file            !! what to call the text in messages
        character(len=*), intent(in) :: folder          !! where names of files start; blank: the current folder
        type(toml_document), intent(out) :: document
        type(source_spec), allocatable, intent(out) :: source(:)
        type(status_type), intent(inout) :: status
        type(reading_type), target :: reading

        reading%folder = trim(folder)
        allocate (reading%shelf%item(0))
        call add_source(reading, file, text)
        call read_part(reading, "", 1, document, status)
        call move_alloc(reading%shelf%item, source)
    end subroutine open_document

    !> The same document from files that were read before.
    subroutine reopen_document(source, folder, document, status)
        type(source_spec), intent(in) :: source(:)
        character(len=*), intent(in) :: folder
        type(toml_document), intent(out) :: document
        type(status_type), intent(inout) :: status
        type(reading_type), target :: reading

        reading%folder = trim(folder)
        reading%shelf%item = source
        reading%is_again = .true.
        reading%n = 1
        call read_part(reading, "", 1, document, status)
    end subroutine reopen_document

    subroutine add_source(reading, file, text)
        type(reading_type), intent(inout), target :: reading
        character(len=*), intent(in) :: file, text
        type(source_spec), allocatable :: longer(:)
        type(source_spec) :: new
        integer :: i

        new%file = file
        new%text = text
        associate (source => reading%shelf%item)
            if (size(source) > 0) new%lines_before = source(size(source))%lines_before + count_lines(source(size(source))%text)
        end associate
        allocate (longer(size(reading%shelf%item) + 1))
        do i = 1, size(reading%shelf%item)
            longer(i) = reading%shelf%item(i)
        end do
        longer(size(longer)) = new
        call move_alloc(longer, reading%shelf%item)
        reading%n = size(reading%shelf%item)
    end subroutine add_source

    !> Does a file begin as those of netCDF do, of either kind?
    pure logical function holds_results(text)
        character(len=*), intent(in) :: text

        holds_results = index(text, "CDF") == 1 .or. index(text, "HDF") == 2
    end function holds_results

    !> The file read last, with all that it includes.
    recursive subroutine read_part(reading, folder, depth, document, status)
        type(reading_type), intent(inout), target :: reading
        character(len=*), intent(in) :: folder          !! of this file, from the scene's
        integer, intent(in) :: depth
        type(toml_document), intent(out) :: document
        type(status_type), intent(inout) :: status
        type(scene_place) :: root
        type(toml_node) :: list
        character(len=:), allocatable :: message, name
        logical :: is_text, is_foreign
        integer :: line, i, own

        own = reading%n
        root%sources => reading%shelf
        associate (source => reading%shelf%item(own))
            root%file = source%file
            is_foreign = .false.
            if (own > 1) is_foreign = .not. is_inside(trim(source%file), reading%folder)
            call parse_toml(source%text, source%lines_before, document, message, line)
        end associate
        if (message /= "") then
            if (holds_results(reading%shelf%item(own)%text)) message = "but netCDF or HDF5, as results are (expected a scene)"
            if (is_foreign) message = "of a file outside the scene's folder nothing is shown"
            if (line > 0) line = line + reading%shelf%item(own)%lines_before
            call refuse(root, "this is not TOML: "//message, status, line)
            return
        end if
        root%node = document%root()
        if (is_foreign) call refuse_foreign(root, status)
        if (own > 1) call document%move_files(folder)
        list = root%node%get("include")
        if (.not. list%is_present() .or. .not. status%is_ok()) return
        select case (list%kind())
        case (toml_string)
            call list%get_text(name, is_text)
            call include_file(reading, root, list, name, folder, depth, document, status)
        case (toml_array)
            do i = 1, list%count()
                call get_name(root, list, i, name, status)
                call include_file(reading, root, list, name, folder, depth, document, status)
            end do
        case default
            call refuse_value(root, "include", list, "is "//list%kind_text()// &
                " (expected the name of a file, or a list of names)", status)
        end select
        call document%take_out("include")
    end subroutine read_part

    !> A name in a list of them.
    subroutine get_name(root, list, i, name, status)
        type(scene_place), intent(in) :: root
        type(toml_node), intent(in) :: list
        integer, intent(in) :: i
        character(len=:), allocatable, intent(out) :: name
        type(status_type), intent(inout) :: status
        type(toml_node) :: item
        logical :: is_text

        item = list%at(i)
        call item%get_text(name, is_text)
        if (.not. is_text .and. status%is_ok()) call refuse_value(root, "include", item, "holds "//item%kind_text()// &
            " (expected names of files)", status)
    end subroutine get_name

    !> Read one file and join it.
    recursive subroutine include_file(reading, root, node, name, folder, depth, document, status)
        type(reading_type), intent(inout), target :: reading
        type(scene_place), intent(in) :: root           !! of the file that includes
        type(toml_node), intent(in) :: node
        character(len=*), intent(in) :: name            !! as it stands there
        character(len=*), intent(in) :: folder          !! of that file, from the scene's
        integer, intent(in) :: depth
        type(toml_document), intent(in) :: document
        type(status_type), intent(inout) :: status
        type(toml_document) :: part
        type(scene_place) :: place
        character(len=:), allocatable :: below, key
        integer :: line(2)

        if (.not. status%is_ok()) return
        below = path_in_folder(folder, name)
        call take_file(reading, root, node, below, depth, status)
        if (.not. status%is_ok()) return
        call read_part(reading, folder_of(below), depth + 1, part, status)
        if (status%is_ok()) then
            call document%join(part, key, line)
            if (key /= "") then
                place%file = root%file
                place%sources => reading%shelf
                call refuse(place, "key "//quoted(key)//" is there already, on "//line_text(place, line(1), line(2))// &
                            " (expected it in one of the files)", status, line(2))
            end if
        end if
        call free_toml(part)
    end subroutine include_file

    !> The text of a file, which must be a new one.
    subroutine take_file(reading, root, node, below, depth, status)
        type(reading_type), intent(inout), target :: reading
        type(scene_place), intent(in) :: root
        type(toml_node), intent(in) :: node
        character(len=*), intent(in) :: below           !! its name from the scene's folder
        integer, intent(in) :: depth
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: path, text
        integer :: i

        if (reading%is_again) then
            reading%n = reading%n + 1
            return
        end if
        path = path_in_folder(reading%folder, below)
        if (len(below) == 0) then
            call refuse_value(root, "include", node, "is empty (expected the name of a file)", status)
        else if (len(path) > path_len) then
            call refuse_value(root, "include", node, "= "//quoted(below(:24)//"...")//" is longer than "//to_text(path_len)// &
                " letters (expected the name of a file)", status)
        else if (depth >= deepest) then
            call refuse_value(root, "include", node, "= "//quoted(below)//" is one too deep (expected at most "// &
                to_text(deepest)//" files that include one another)", status)
        else if (reading%n >= most_files) then
            call refuse_value(root, "include", node, "= "//quoted(below)//" is one too many (expected at most "// &
                to_text(most_files)//" files)", status)
        end if
        if (.not. status%is_ok()) return
        do i = 1, reading%n
            if (.not. is_same_file(path, trim(reading%shelf%item(i)%file))) cycle
            call refuse_value(root, "include", node, "= "//quoted(below)//" is part of the scene already"// &
                trim(merge(", as the file itself", "                    ", i == 1))//" (expected each file once)", status)
            return
        end do
        call read_file_text(path, place_text(root, node%line())//": include "//quoted(path), text, status)
        if (status%is_ok()) call add_source(reading, path, text)
    end subroutine take_file

    !> Refuse a file outside the scene's folder that holds anything else but parts of a scene, and tell nothing of it.
    subroutine refuse_foreign(root, status)
        type(scene_place), intent(in) :: root
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: key
        integer :: i, line

        do i = 1, root%node%count()
            call root%node%key(i, key, line)
            if (any(scene_key == key)) cycle
            call fail(status, status_bad_input, trim(root%file)//": this file outside the scene's folder holds other things "// &
                "than parts of a scene (expected links, joints, variables ..)")
            return
        end do
    end subroutine refuse_foreign

    pure integer function count_lines(text) result(n)
        character(len=*), intent(in) :: text
        integer :: i

        n = 1
        do i = 1, len(text)
            if (text(i:i) == new_line("a")) n = n + 1
        end do
    end function count_lines
end module linkdyn_scene_include
