!> A parsed TOML document and its nodes, over the C view of toml++.
module linkdyn_toml
    use, intrinsic :: iso_c_binding, only: c_ptr, c_null_ptr, c_int, c_int64_t, c_double, c_char, c_associated
    use linkdyn_input, only: is_utf16, take_text
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: toml_document, toml_node, parse_toml, free_toml
    public :: toml_absent, toml_string, toml_integer, toml_float, toml_boolean, toml_table, toml_array, toml_date

    integer, parameter :: toml_absent = 0, toml_string = 1, toml_integer = 2, toml_float = 3
    integer, parameter :: toml_boolean = 4, toml_table = 5, toml_array = 6, toml_date = 7

    !> Owns the tree: free it with `free_toml`; its nodes are gone with it.
    type :: toml_document
        type(c_ptr) :: handle = c_null_ptr
    contains
        procedure :: root => document_root
        procedure :: take_out
        procedure :: move_files
        procedure :: join => join_document
        procedure :: as_text
    end type toml_document

    !> A value, an array or a table; or nothing, for what was not there.
    type :: toml_node
        type(c_ptr) :: handle = c_null_ptr
    contains
        procedure :: is_present
        procedure :: is_number
        procedure :: is_same_as
        procedure :: kind => node_kind
        procedure :: kind_text
        procedure :: line => node_line
        procedure :: count => node_count
        procedure :: at => node_at
        procedure :: get => node_get
        procedure :: key => node_key
        procedure :: get_number
        procedure :: get_integer
        procedure :: get_flag
        procedure :: get_text
        procedure :: put => node_put
        procedure :: put_text => node_put_text
        procedure :: put_at => node_put_at
        procedure :: put_text_at => node_put_text_at
    end type toml_node

    interface
        function c_parse(text, text_len, before, message, message_len, line, column) &
            bind(c, name="linkdyn_toml_parse") result(handle)
            import :: c_ptr, c_char, c_int, c_int64_t
            character(kind=c_char), intent(in) :: text(*)
            integer(c_int64_t), value :: text_len
            integer(c_int), value :: before
            character(kind=c_char), intent(out) :: message(*)
            integer(c_int), value :: message_len
            integer(c_int), intent(out) :: line, column
            type(c_ptr) :: handle
        end function c_parse

        subroutine c_free(handle) bind(c, name="linkdyn_toml_free")
            import :: c_ptr
            type(c_ptr), value :: handle
        end subroutine c_free

        subroutine c_take_out(document, key, key_len) bind(c, name="linkdyn_toml_take_out")
            import :: c_ptr, c_char, c_int
            type(c_ptr), value :: document
            character(kind=c_char), intent(in) :: key(*)
            integer(c_int), value :: key_len
        end subroutine c_take_out

        integer(c_int) function c_move_files(document, folder, folder_len) bind(c, name="linkdyn_toml_move_files")
            import :: c_ptr, c_char, c_int
            type(c_ptr), value :: document
            character(kind=c_char), intent(in) :: folder(*)
            integer(c_int), value :: folder_len
        end function c_move_files

        integer(c_int) function c_join(document, other, key, key_len, first_line, second_line) &
            bind(c, name="linkdyn_toml_join")
            import :: c_ptr, c_char, c_int
            type(c_ptr), value :: document, other
            character(kind=c_char), intent(inout) :: key(*)
            integer(c_int), value :: key_len
            integer(c_int), intent(out) :: first_line, second_line
        end function c_join

        integer(c_int) function c_write(document, text, text_len) bind(c, name="linkdyn_toml_write")
            import :: c_ptr, c_int, c_int64_t
            type(c_ptr), value :: document
            type(c_ptr), intent(out) :: text
            integer(c_int64_t), intent(out) :: text_len
        end function c_write

        function c_root(document) bind(c, name="linkdyn_toml_root") result(node)
            import :: c_ptr
            type(c_ptr), value :: document
            type(c_ptr) :: node
        end function c_root

        integer(c_int) function c_kind_of(node) bind(c, name="linkdyn_toml_kind_of")
            import :: c_ptr, c_int
            type(c_ptr), value :: node
        end function c_kind_of

        integer(c_int) function c_line(node) bind(c, name="linkdyn_toml_line")
            import :: c_ptr, c_int
            type(c_ptr), value :: node
        end function c_line

        integer(c_int64_t) function c_size(node) bind(c, name="linkdyn_toml_size")
            import :: c_ptr, c_int64_t
            type(c_ptr), value :: node
        end function c_size

        function c_at(node, index) bind(c, name="linkdyn_toml_at") result(item)
            import :: c_ptr, c_int64_t
            type(c_ptr), value :: node
            integer(c_int64_t), value :: index
            type(c_ptr) :: item
        end function c_at

        function c_get(node, key, key_len) bind(c, name="linkdyn_toml_get") result(item)
            import :: c_ptr, c_char, c_int
            type(c_ptr), value :: node
            character(kind=c_char), intent(in) :: key(*)
            integer(c_int), value :: key_len
            type(c_ptr) :: item
        end function c_get

        integer(c_int) function c_key(node, index, key, key_len, line) bind(c, name="linkdyn_toml_key")
            import :: c_ptr, c_char, c_int, c_int64_t
            type(c_ptr), value :: node
            integer(c_int64_t), value :: index
            character(kind=c_char), intent(inout) :: key(*)
            integer(c_int), value :: key_len
            integer(c_int), intent(out) :: line
        end function c_key

        integer(c_int) function c_get_double(node, value) bind(c, name="linkdyn_toml_double")
            import :: c_ptr, c_int, c_double
            type(c_ptr), value :: node
            real(c_double), intent(inout) :: value
        end function c_get_double

        integer(c_int) function c_get_int64(node, value) bind(c, name="linkdyn_toml_int64")
            import :: c_ptr, c_int, c_int64_t
            type(c_ptr), value :: node
            integer(c_int64_t), intent(inout) :: value
        end function c_get_int64

        integer(c_int) function c_get_bool(node, value) bind(c, name="linkdyn_toml_bool")
            import :: c_ptr, c_int
            type(c_ptr), value :: node
            integer(c_int), intent(inout) :: value
        end function c_get_bool

        integer(c_int) function c_put(node, key, key_len, value) bind(c, name="linkdyn_toml_put")
            import :: c_ptr, c_char, c_int, c_double
            type(c_ptr), value :: node
            character(kind=c_char), intent(in) :: key(*)
            integer(c_int), value :: key_len
            real(c_double), value :: value
        end function c_put

        integer(c_int) function c_put_text(node, key, key_len, text, text_len) bind(c, name="linkdyn_toml_put_text")
            import :: c_ptr, c_char, c_int, c_int64_t
            type(c_ptr), value :: node
            character(kind=c_char), intent(in) :: key(*)
            integer(c_int), value :: key_len
            character(kind=c_char), intent(in) :: text(*)
            integer(c_int64_t), value :: text_len
        end function c_put_text

        integer(c_int) function c_put_at(node, index, value) bind(c, name="linkdyn_toml_put_at")
            import :: c_ptr, c_int, c_int64_t, c_double
            type(c_ptr), value :: node
            integer(c_int64_t), value :: index
            real(c_double), value :: value
        end function c_put_at

        integer(c_int) function c_put_text_at(node, index, text, text_len) bind(c, name="linkdyn_toml_put_text_at")
            import :: c_ptr, c_char, c_int, c_int64_t
            type(c_ptr), value :: node
            integer(c_int64_t), value :: index
            character(kind=c_char), intent(in) :: text(*)
            integer(c_int64_t), value :: text_len
        end function c_put_text_at

        integer(c_int64_t) function c_get_text(node, text, text_len) bind(c, name="linkdyn_toml_text")
            import :: c_ptr, c_char, c_int64_t
            type(c_ptr), value :: node
            character(kind=c_char), intent(inout) :: text(*)
            integer(c_int64_t), value :: text_len
        end function c_get_text
    end interface

contains

    !> Parse a text. On failure the document's handle is null and `message` says why.
    subroutine parse_toml(text, before, document, message, line)
        character(len=*), intent(in) :: text
        integer, intent(in) :: before                          !! lines of nodes count on from here: 0, or lines of other files
        type(toml_document), intent(out) :: document
        character(len=:), allocatable, intent(out) :: message  !! empty if all is well
        integer, intent(out) :: line                           !! of the error; 0 if unknown
        character(len=256) :: buffer
        integer(c_int) :: c_row, c_column
        character(len=12) :: column

        buffer = ""
        document%handle = c_parse(text, int(len(text), c_int64_t), int(before, c_int), buffer, int(len(buffer), c_int), c_row, &
                                  c_column)
        line = int(c_row)
        message = ""
        if (c_associated(document%handle)) return
        write (column, "(i0)") c_column
        message = trim(buffer)//" (column "//trim(column)//")"
        if (index(buffer, "utf-8") > 0) then
            message = message//other_encoding(text)
        else
            message = message//forgotten(text, line, int(c_column))
        end if
    end subroutine parse_toml

    !> How a text that is not UTF-8 may have been saved, as the end of a message.
    pure function other_encoding(text) result(hint)
        character(len=*), intent(in) :: text
        character(len=:), allocatable :: hint

        hint = "; save the text as UTF-8"
        if (is_utf16(text)) hint = "; this is UTF-16, save the text as UTF-8"
    end function other_encoding

    !> What those who do not know TOML forget, as the end of a message: quotes, the second one, too, and that decimals have a point.
    pure function forgotten(text, line, column) result(hint)
        character(len=*), intent(in) :: text
        integer, intent(in) :: line, column                    !! of the error; 0 if unknown
        character(len=:), allocatable :: hint
        character(len=*), parameter :: digits = "0123456789", lower = "abcdefghijklmnopqrstuvwxyz", &
            letters = lower//"ABCDEFGHIJKLMNOPQRSTUVWXYZ"
        integer :: start, at, last, i

        hint = ""
        if (line < 1 .or. column < 2) return
        start = 0                                              ! the letter before the line
        do i = 2, line
            start = start + index(text(start + 1:), new_line("a"))
        end do
        at = start + column
        if (at > len(text)) return
        if (index(text(at:), achar(226)//achar(128)) == 1) hint = "; quotes are straight: """    ! as word processors set them
        if (scan(text(at:at), achar(10)//achar(13)) > 0 .and. mod(count([(text(i:i) == """", i=start + 1, at - 1)]), 2) == 1) &
            hint = "; a text ends with a quote on its line"
        last = len_trim(text(start + 1:at - 1))
        if (last == 0) return
        if (scan(text(start + last:start + last), digits) > 0) then
            if (text(at:at) == "," .and. scan(text(at + 1:min(at + 1, len(text))), digits) > 0) hint = "; decimals have a point"
            if (scan(text(at:at), letters) > 0) hint = "; a number with its unit stands in quotes"
        else if (scan(text(start + last:start + last), "=[,") > 0 .and. scan(text(at:at), letters) > 0) then
            hint = "; text stands in quotes"
        end if
    end function forgotten

    !> Give the memory of a document back.
    subroutine free_toml(document)
        type(toml_document), intent(inout) :: document

        if (c_associated(document%handle)) call c_free(document%handle)
        document%handle = c_null_ptr
    end subroutine free_toml

    !> One key at the top less.
    subroutine take_out(self, key)
        class(toml_document), intent(in) :: self
        character(len=*), intent(in) :: key

        call c_take_out(self%handle, key, int(len(key), c_int))
    end subroutine take_out

    !> Names of tables and meshes with a folder in front.
    subroutine move_files(self, folder)
        class(toml_document), intent(in) :: self
        character(len=*), intent(in) :: folder             !! with its last slash
        integer(c_int) :: done

        done = c_move_files(self%handle, folder, int(len(folder), c_int))
    end subroutine move_files

    !> Move all of another document into this one.
    subroutine join_document(self, other, key, line)
        class(toml_document), intent(in) :: self
        type(toml_document), intent(in) :: other
        character(len=:), allocatable, intent(out) :: key      !! that is in both and should not; empty if all is well
        integer, intent(out) :: line(2)                        !! where
        character(len=256) :: buffer
        integer(c_int) :: row(2)

        key = ""
        buffer = ""
        if (c_join(self%handle, other%handle, buffer, int(len(buffer), c_int), row(1), row(2)) == 0) key = trim(buffer)
        line = int(row)
    end subroutine join_document

    !> The document written anew.
    function as_text(self) result(text)
        class(toml_document), intent(in) :: self
        character(len=:), allocatable :: text
        type(c_ptr) :: data
        integer(c_int64_t) :: n

        if (c_write(self%handle, data, n) == 0) n = 0
        call take_text(data, n, text)
    end function as_text

    type(toml_node) function document_root(self) result(node)
        class(toml_document), intent(in) :: self

        node%handle = c_root(self%handle)
    end function document_root

    logical function is_present(self)
        class(toml_node), intent(in) :: self

        is_present = c_associated(self%handle)
    end function is_present

    !> True if both are one node of a document.
    logical function is_same_as(self, other)
        class(toml_node), intent(in) :: self
        type(toml_node), intent(in) :: other

        is_same_as = c_associated(self%handle, other%handle)
    end function is_same_as

    !> True for a float or an integer.
    logical function is_number(self)
        class(toml_node), intent(in) :: self

        is_number = self%kind() == toml_float .or. self%kind() == toml_integer
    end function is_number

    !> One of the `toml_*` constants.
    integer function node_kind(self) result(kind)
        class(toml_node), intent(in) :: self

        kind = int(c_kind_of(self%handle))
    end function node_kind

    !> What a node is, for messages.
    function kind_text(self) result(text)
        class(toml_node), intent(in) :: self
        character(len=:), allocatable :: text

        select case (self%kind())
        case (toml_string)
            text = "a string"
        case (toml_integer)
            text = "an integer"
        case (toml_float)
            text = "a number"
        case (toml_boolean)
            text = "true or false"
        case (toml_table)
            text = "a table"
        case (toml_array)
            text = "a list"
        case (toml_date)
            text = "a date or time"
        case default
            text = "nothing"
        end select
    end function kind_text

    !> Line in the document; 0 if the node is absent.
    integer function node_line(self) result(line)
        class(toml_node), intent(in) :: self

        line = int(c_line(self%handle))
    end function node_line

    !> Number of items of a list or of keys of a table; 0 for anything else.
    integer function node_count(self) result(n)
        class(toml_node), intent(in) :: self

        n = int(c_size(self%handle))
    end function node_count

    !> Item i of a list, from 1.
    type(toml_node) function node_at(self, i) result(item)
        class(toml_node), intent(in) :: self
        integer, intent(in) :: i

        item%handle = c_at(self%handle, int(i - 1, c_int64_t))
    end function node_at

    !> Value of a key of a table; absent if there is none. Trailing blanks of `key` do not count.
    type(toml_node) function node_get(self, key) result(item)
        class(toml_node), intent(in) :: self
        character(len=*), intent(in) :: key

        item%handle = c_get(self%handle, key, int(len_trim(key), c_int))
    end function node_get

    !> Key i of a table, from 1, in the order of the document, with its line.
    subroutine node_key(self, i, key, line)
        class(toml_node), intent(in) :: self
        integer, intent(in) :: i
        character(len=:), allocatable, intent(out) :: key
        integer, intent(out) :: line
        character(len=1024) :: buffer
        integer(c_int) :: n, c_row

        n = c_key(self%handle, int(i - 1, c_int64_t), buffer, int(len(buffer), c_int), c_row)
        key = buffer(:max(0, min(int(n), len(buffer))))
        line = int(c_row)
    end subroutine node_key

    subroutine get_number(self, value, is_one)
        class(toml_node), intent(in) :: self
        real(wp), intent(out) :: value
        logical, intent(out) :: is_one         !! the node is a number
        real(c_double) :: c_value

        c_value = 0
        is_one = c_get_double(self%handle, c_value) == 1
        value = real(c_value, wp)
    end subroutine get_number

    subroutine get_integer(self, value, is_one)
        class(toml_node), intent(in) :: self
        integer, intent(out) :: value
        logical, intent(out) :: is_one         !! the node is an integer of the default range
        integer(c_int64_t) :: c_value

        c_value = 0
        is_one = c_get_int64(self%handle, c_value) == 1
        if (is_one) is_one = abs(c_value) <= huge(value)
        value = 0
        if (is_one) value = int(c_value)
    end subroutine get_integer

    subroutine get_flag(self, value, is_one)
        class(toml_node), intent(in) :: self
        logical, intent(out) :: value
        logical, intent(out) :: is_one         !! the node is true or false
        integer(c_int) :: c_value

        c_value = 0
        is_one = c_get_bool(self%handle, c_value) == 1
        value = c_value == 1
    end subroutine get_flag

    subroutine get_text(self, value, is_one)
        class(toml_node), intent(in) :: self
        character(len=:), allocatable, intent(out) :: value
        logical, intent(out) :: is_one         !! the node is a string
        character(len=1) :: nothing(0)
        integer(c_int64_t) :: n

        n = c_get_text(self%handle, nothing, 0_c_int64_t)
        is_one = n >= 0
        allocate (character(len=max(0, int(n))) :: value)
        if (n > 0) n = c_get_text(self%handle, value, n)
    end subroutine get_text

    !> Another number in place of the value of a key, which must be there.
    subroutine node_put(self, key, value)
        class(toml_node), intent(in) :: self
        character(len=*), intent(in) :: key
        real(wp), intent(in) :: value
        integer(c_int) :: done

        done = c_put(self%handle, key, int(len_trim(key), c_int), real(value, c_double))
    end subroutine node_put

    !> A text in place of the value of a key, which must be there.
    subroutine node_put_text(self, key, text)
        class(toml_node), intent(in) :: self
        character(len=*), intent(in) :: key, text
        integer(c_int) :: done

        done = c_put_text(self%handle, key, int(len_trim(key), c_int), text, int(len(text), c_int64_t))
    end subroutine node_put_text

    !> Another number in place of item i of a list, from 1, which must be there.
    subroutine node_put_at(self, i, value)
        class(toml_node), intent(in) :: self
        integer, intent(in) :: i
        real(wp), intent(in) :: value
        integer(c_int) :: done

        done = c_put_at(self%handle, int(i - 1, c_int64_t), real(value, c_double))
    end subroutine node_put_at

    !> A text in place of item i of a list, from 1, which must be there.
    subroutine node_put_text_at(self, i, text)
        class(toml_node), intent(in) :: self
        integer, intent(in) :: i
        character(len=*), intent(in) :: text
        integer(c_int) :: done

        done = c_put_text_at(self%handle, int(i - 1, c_int64_t), text, int(len(text), c_int64_t))
    end subroutine node_put_text_at
end module linkdyn_toml
