!> Results into a CSV file: one row a sample, one column a number, names with units in the first row. Samples without time
!> have their number, from 0, in its place.
!>
!> Numbers have as many digits as reading them back to the same value takes: 17 at most, in quadruple precision 36.
module linkdyn_csv_writer
    use linkdyn_input, only: put_number, number_length
    use linkdyn_kinds, only: wp
    use linkdyn_output_file, only: output_file, open_output, discard_output, write_text, finish_text
    use linkdyn_result_kinds, only: result_time
    use linkdyn_results, only: layout_type, block_type, variable_type, samples_width, label_of_value, variable_index, &
        dim_sample
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: csv_writer, create_csv, put_csv, close_csv, add_table_rows

    integer, parameter :: buffer_length = 2**20    !! characters written at a time: calls of the system take their time

    !> An open file.
    type :: csv_writer
        private
        type(output_file) :: file
    end type csv_writer

contains

    !> Start a file with its row of names.
    subroutine create_csv(target, layout, writer, status)
        character(len=*), intent(in) :: target
        type(layout_type), intent(in) :: layout
        type(csv_writer), intent(out) :: writer
        type(status_type), intent(inout) :: status   !! input or output error: file and reason

        call open_output(target, .true., writer%file, status)
        call write_text(writer%file, header(layout)//new_line("a"), status)
        if (.not. status%is_ok()) call discard_output(writer%file)
    end subroutine create_csv

    !> Append one block of samples.
    subroutine put_csv(layout, block, first, n, writer, status)
        type(layout_type), intent(in) :: layout
        type(block_type), intent(in) :: block        !! values of every variable of the layout
        integer, intent(in) :: first                 !! number of the block's first sample, from 1
        integer, intent(in) :: n                     !! samples in the block
        type(csv_writer), intent(inout) :: writer
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: buffer
        integer :: i, length, room

        room = longest_row(layout)
        allocate (character(len=max(buffer_length, room)) :: buffer)
        length = 0
        do i = 1, n
            if (length + room > len(buffer)) then
                call write_text(writer%file, buffer(:length), status)
                length = 0
            end if
            if (.not. status%is_ok()) return
            if (variable_index(layout, result_time) == 0) call append(to_text(first + i - 2), buffer, length)
            call add_row(layout, block, i, buffer, length)
        end do
        call write_text(writer%file, buffer(:length), status)
    end subroutine put_csv

    !> Numbers of one sample, with commas between and a line end.
    subroutine add_row(layout, block, sample, buffer, length)
        type(layout_type), intent(in) :: layout
        type(block_type), intent(in) :: block
        integer, intent(in) :: sample
        character(len=*), intent(inout) :: buffer
        integer, intent(inout) :: length             !! characters used
        character(len=number_length) :: number
        integer :: k, j, width, n

        do k = 1, size(layout%variable)
            width = samples_width(layout, layout%variable(k))
            do j = (sample - 1)*width + 1, sample*width
                if (layout%variable(k)%is_integer) then
                    call append(field(trim(layout%variable(k)%flag(block%of(k)%integer(j) + 1))), buffer, length)
                    cycle
                end if
                call put_number(block%of(k)%real(j), number, n)
                call append(number(:n), buffer, length)
            end do
        end do
        buffer(length:length) = new_line("a")        ! in place of the last comma
    end subroutine add_row

    !> Rows of any table, in the same form.
    subroutine add_table_rows(value, is_word, word, buffer, length)
        real(wp), intent(in) :: value(:, :)          !! column, row; of a word its place in the list
        logical, intent(in) :: is_word(:)            !! for each column
        character(len=*), intent(in) :: word(:)
        character(len=*), intent(inout) :: buffer    !! room for numbers, words and commas
        integer, intent(inout) :: length             !! characters used
        character(len=number_length) :: number
        integer :: i, j, n

        do i = 1, size(value, 2)
            do j = 1, size(value, 1)
                if (is_word(j)) then
                    call append(field(trim(word(nint(value(j, i))))), buffer, length)
                else
                    call put_number(value(j, i), number, n)
                    call append(number(:n), buffer, length)
                end if
            end do
            buffer(length:length) = new_line("a")    ! in place of the last comma
        end do
    end subroutine add_table_rows

    subroutine append(text, buffer, length)
        character(len=*), intent(in) :: text
        character(len=*), intent(inout) :: buffer
        integer, intent(inout) :: length

        buffer(length + 1:length + len(text)) = text
        length = length + len(text) + 1
        buffer(length:length) = ","
    end subroutine append

    pure integer function longest_row(layout) result(length)
        type(layout_type), intent(in) :: layout
        integer :: k, width

        length = number_length + 1                       ! the number of a sample
        do k = 1, size(layout%variable)
            if (layout%variable(k)%is_integer) then
                width = 2*len(layout%variable(k)%flag) + 2   ! all quotes, in quotes
            else
                width = number_length
            end if
            length = length + samples_width(layout, layout%variable(k))*(width + 1)
        end do
    end function longest_row

    !> Finish the file and put it in its place. After a failure nothing is left behind.
    subroutine close_csv(writer, status)
        type(csv_writer), intent(inout) :: writer
        type(status_type), intent(inout) :: status

        call finish_text(writer%file, status)
    end subroutine close_csv

    !> "time [s],q platform.x [m],...,reaction leg1.S Fx [N],..."
    function header(layout) result(row)
        type(layout_type), intent(in) :: layout
        character(len=:), allocatable :: row
        integer :: k

        row = ""
        if (variable_index(layout, result_time) == 0) row = ","//trim(layout%dimension(dim_sample)%name)
        do k = 1, size(layout%variable)
            call append_columns(layout, layout%variable(k), row)
        end do
        row = row(2:)
    end function header

    subroutine append_columns(layout, variable, row)
        type(layout_type), intent(in) :: layout
        type(variable_type), intent(in) :: variable
        character(len=:), allocatable, intent(inout) :: row
        integer :: j

        do j = 1, samples_width(layout, variable)
            row = row//","//field(trim(variable%name)//entry_name(layout, variable, j))
        end do
    end subroutine append_columns

    !> " leg1.S Fx [N]" for the place of a value within its sample.
    function entry_name(layout, variable, place) result(text)
        type(layout_type), intent(in) :: layout
        type(variable_type), intent(in) :: variable
        integer, intent(in) :: place
        character(len=:), allocatable :: text

        text = label_of_value(layout, variable, place)
        if (len(text) > 0) text = " "//text
        if (.not. variable%is_integer) text = text//" ["// &
            trim(variable%entry_unit(mod(place - 1, size(variable%entry_unit)) + 1))//"]"
    end function entry_name

    !> A field in quotes where it must be.
    pure function field(text) result(quoted)
        character(len=*), intent(in) :: text
        character(len=:), allocatable :: quoted
        integer :: i

        if (scan(text, '",') == 0) then
            quoted = text
            return
        end if
        quoted = '"'
        do i = 1, len(text)
            if (text(i:i) == '"') quoted = quoted//'"'
            quoted = quoted//text(i:i)
        end do
        quoted = quoted//'"'
    end function field
end module linkdyn_csv_writer
