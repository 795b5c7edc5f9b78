!> Results into a netCDF-4 file, chunk by chunk of samples.
!>
!> The file describes itself: every variable has its unit and meaning, every dimension its labels,
!> and the scene is kept as an attribute. Uncompressed variables lie contiguously, compressed ones
!> in chunks of about 1 MiB that whole blocks of samples fill.
module linkdyn_netcdf_writer
    use, intrinsic :: iso_fortran_env, only: real64
    use linkdyn_event_log, only: event_log, kind_name
    use linkdyn_kinds, only: wp
    use linkdyn_output_file, only: output_file, open_output, commit_output, discard_output, writing_failed
    use linkdyn_results, only: layout_type, block_type, variable_type, samples_width, variable_index, dim_sample, &
        n_dimension, event_prefix, event_side, beside_words
    use linkdyn_result_kinds, only: result_time
    use linkdyn_status, only: status_type
    use netcdf, only: nf90_create, nf90_inq_dimid, nf90_def_dim, nf90_def_var, nf90_def_var_deflate, nf90_def_var_fill, &
        nf90_put_att, nf90_put_var, nf90_close, nf90_strerror, nf90_netcdf4, nf90_clobber, nf90_char, nf90_double, &
        nf90_int, nf90_global, nf90_noerr, nf90_unlimited
    implicit none (type, external)
    private
    public :: netcdf_writer, attributes_type, create_netcdf, put_netcdf, put_event_table, put_event_sides, note_netcdf, &
        close_netcdf
    public :: open_netcdf, abandon_netcdf, put_attributes, put_strings, check, chunk_length

    integer, parameter :: chunk_values = 131072   !! values in a compressed chunk at most: 1 MiB
    integer, parameter :: longest_chunk = 16384   !! samples in a chunk at most

    !> What is said of the run as a whole.
    type :: attributes_type
        character(len=:), allocatable :: title
        character(len=:), allocatable :: version
        character(len=:), allocatable :: solver
        character(len=:), allocatable :: scene     !! text of the scene file
        character(len=:), allocatable :: idle_spins    !! links whose idle spins are settled; empty: there are none
        character(len=:), allocatable :: shared_reactions  !! that the equations leave open; empty: none
        character(len=:), allocatable :: shared_components, shared_directions   !! of these
        character(len=:), allocatable :: redundancy    !! how these were found
        character(len=:), allocatable :: history   !! when and by which command
        real(wp) :: gravity(3) = 0                 !! [m/s2]
    end type attributes_type

    !> An open file.
    type :: netcdf_writer
        type(output_file), private :: file
        integer :: id = 0                          !! of the netCDF library
        integer, allocatable, private :: variable_id(:)     !! in the order of the layout
        logical, private :: is_open = .false.
        logical, private :: grows = .false.        !! the number of samples is not known beforehand
    end type netcdf_writer

    !> A further attribute of the file, known at its end only.
    interface note_netcdf
        module procedure note_text, note_number
    end interface note_netcdf

contains

    !> Start a file: dimensions, labels, attributes; no values yet.
    subroutine create_netcdf(target, layout, n_sample, attributes, deflate, writer, status, may_end_early)
        character(len=*), intent(in) :: target
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: n_sample              !! 0: unknown, the file grows
        type(attributes_type), intent(in) :: attributes
        integer, intent(in) :: deflate               !! compression 0 (none) to 9
        type(netcdf_writer), intent(out) :: writer
        type(status_type), intent(inout) :: status   !! input or output error: file and reason
        logical, intent(in), optional :: may_end_early    !! the file may get fewer samples
        integer :: dimension_id(n_dimension), i

        call open_netcdf(target, writer, status)
        if (.not. status%is_ok()) return
        writer%grows = n_sample == 0
        if (present(may_end_early)) writer%grows = writer%grows .or. may_end_early
        call check(nf90_def_dim(writer%id, trim(layout%dimension(dim_sample)%name), &
            merge(nf90_unlimited, n_sample, writer%grows), dimension_id(dim_sample)), writer, status)
        do i = dim_sample + 1, n_dimension
            if (.not. any_uses(layout, i)) cycle
            call check(nf90_def_dim(writer%id, trim(layout%dimension(i)%name), layout%dimension(i)%size, &
                dimension_id(i)), writer, status)
        end do
        allocate (writer%variable_id(size(layout%variable)))
        do i = 1, size(layout%variable)
            call define_variable(layout, layout%variable(i), n_sample, dimension_id, deflate, writer, &
                writer%variable_id(i), status)
        end do
        call put_attributes(layout%planar, attributes, writer, status)
        call put_labels(layout, dimension_id, writer, status)
        if (.not. status%is_ok()) call abandon_netcdf(writer)
    end subroutine create_netcdf

    !> An empty file.
    subroutine open_netcdf(target, writer, status)
        character(len=*), intent(in) :: target
        type(netcdf_writer), intent(inout) :: writer
        type(status_type), intent(inout) :: status

        call open_output(target, .false., writer%file, status)
        if (.not. status%is_ok()) return
        call check(nf90_create(trim(writer%file%part), ior(nf90_netcdf4, nf90_clobber), writer%id), writer, status)
        if (.not. status%is_ok()) then
            call abandon_netcdf(writer)
            return
        end if
        writer%is_open = .true.
    end subroutine open_netcdf

    !> Store one block of samples.
    subroutine put_netcdf(layout, block, first, n, writer, status)
        type(layout_type), intent(in) :: layout
        type(block_type), intent(in) :: block        !! values of every variable of the layout
        integer, intent(in) :: first                 !! number of the block's first sample, from 1
        integer, intent(in) :: n                     !! samples in the block
        type(netcdf_writer), intent(inout) :: writer
        type(status_type), intent(inout) :: status
        integer :: i, k, n_dim, start(3), count(3), code

        if (.not. status%is_ok()) return
        do i = 1, size(layout%variable)
            associate (variable => layout%variable(i))
                n_dim = variable%n_dim
                start(:n_dim) = 1
                start(n_dim) = first
                count(:n_dim) = [(layout%dimension(variable%dim(k))%size, k=n_dim, 2, -1), n]
                if (variable%is_integer) then
                    code = nf90_put_var(writer%id, writer%variable_id(i), block%of(i)%integer(:product(count(:n_dim))), &
                        start(:n_dim), count(:n_dim))
                else
                    code = nf90_put_var(writer%id, writer%variable_id(i), &
                        real(block%of(i)%real(:product(count(:n_dim))), real64), &
                        start(:n_dim), count(:n_dim))
                end if
            end associate
            call check(code, writer, status)
            if (.not. status%is_ok()) return
        end do
    end subroutine put_netcdf

    !> What has happened in the run, a row each: known at its end only. The names of kinds are those of the log.
    subroutine put_event_table(name, log, writer, status)
        character(len=*), intent(in) :: name(:)      !! of the scene's events
        type(event_log), intent(in) :: log           !! with one entry at least
        type(netcdf_writer), intent(inout) :: writer
        type(status_type), intent(inout) :: status
        real(real64), allocatable :: table(:, :)
        character(len=len(name)), allocatable :: names(:)
        integer :: event, coordinate, i

        if (.not. status%is_ok()) return
        call check(nf90_def_dim(writer%id, "event", log%n, event), writer, status)
        call check(nf90_inq_dimid(writer%id, "coordinate", coordinate), writer, status)
        associate (entry => log%entry(:log%n))
            names = name([(entry(i)%event, i=1, log%n)])
            call put_strings("event", names, event, writer, status)
            call put_numbers("event_time", "instant of the event", "s", [(real(entry(i)%t, real64), i=1, log%n)])
            call put_whole("event_kind", "what happened", [(entry(i)%kind, i=1, log%n)])
            call put_whole("event_direction", "1: the number crossed zero upwards, -1: downwards", &
                           [(entry(i)%direction, i=1, log%n)])
            call put_numbers("event_impulse", "impulse of the stop or clutch", "N s or N m s", &
                             [(real(entry(i)%impulse, real64), i=1, log%n)])
            call put_numbers("event_loss", "energy lost in the impact, or by closing the clutch", "J", &
                             [(real(entry(i)%loss, real64), i=1, log%n)])
            allocate (table(size(entry(1)%q), log%n))
            do i = 1, log%n
                table(:, i) = real(entry(i)%q, real64)
            end do
            call put_table("event_q", "generalized coordinate at the event", "m or rad")
            do i = 1, log%n
                table(:, i) = real(entry(i)%qd, real64)
            end do
            call put_table("event_qd", "its rate before", "m/s or rad/s")
            do i = 1, log%n
                table(:, i) = real(entry(i)%qd_after, real64)
            end do
            call put_table("event_qd_after", "its rate behind", "m/s or rad/s")
        end associate

    contains

        subroutine put_numbers(variable, long_name, units, values)
            character(len=*), intent(in) :: variable, long_name, units
            real(real64), intent(in) :: values(:)
            integer :: id

            if (.not. status%is_ok()) return
            call check(nf90_def_var(writer%id, variable, nf90_double, [event], id), writer, status)
            call describe(id, long_name, units)
            call check(nf90_put_var(writer%id, id, values), writer, status)
        end subroutine put_numbers

        subroutine put_whole(variable, long_name, values)
            character(len=*), intent(in) :: variable, long_name
            integer, intent(in) :: values(:)
            integer :: id

            if (.not. status%is_ok()) return
            call check(nf90_def_var(writer%id, variable, nf90_int, [event], id), writer, status)
            call describe(id, long_name, "")
            if (variable == "event_kind") call put_flags(writer, id, kind_name, status)
            call check(nf90_put_var(writer%id, id, values), writer, status)
        end subroutine put_whole

        subroutine put_table(variable, long_name, units)
            character(len=*), intent(in) :: variable, long_name, units
            integer :: id

            if (.not. status%is_ok()) return
            call check(nf90_def_var(writer%id, variable, nf90_double, [coordinate, event], id), writer, status)
            call describe(id, long_name, units)
            call check(nf90_put_var(writer%id, id, table), writer, status)
        end subroutine put_table

        subroutine describe(id, long_name, units)
            integer, intent(in) :: id
            character(len=*), intent(in) :: long_name, units

            call check(nf90_put_att(writer%id, id, "long_name", long_name), writer, status)
            if (units /= "") call check(nf90_put_att(writer%id, id, "units", units), writer, status)
        end subroutine describe
    end subroutine put_event_table

    !> Results on both sides of what has happened: of each variable that jumps, behind the table of events.
    subroutine put_event_sides(layout, n, block, writer, status)
        type(layout_type), intent(in) :: layout      !! of these
        integer, intent(in) :: n                     !! events
        type(block_type), intent(in) :: block        !! two samples an event, before and behind
        type(netcdf_writer), intent(in) :: writer
        type(status_type), intent(inout) :: status
        integer :: i, k, id, side, dims(4), counts(4), n_dim

        if (.not. status%is_ok()) return
        call check(nf90_def_dim(writer%id, "side", size(event_side), side), writer, status)
        call put_strings("side", event_side, side, writer, status)
        do i = 1, size(layout%variable)
            associate (variable => layout%variable(i))
                n_dim = variable%n_dim + 1
                do k = 2, variable%n_dim
                    associate (dimension => layout%dimension(variable%dim(variable%n_dim + 2 - k)))
                        call check(nf90_inq_dimid(writer%id, trim(dimension%name), dims(k - 1)), writer, status)
                        counts(k - 1) = dimension%size
                    end associate
                end do
                dims(n_dim - 1) = side
                counts(n_dim - 1) = size(event_side)
                call check(nf90_inq_dimid(writer%id, "event", dims(n_dim)), writer, status)
                counts(n_dim) = n
                if (.not. status%is_ok()) return
                call check(nf90_def_var(writer%id, event_prefix//trim(variable%name), &
                                        merge(nf90_int, nf90_double, variable%is_integer), dims(:n_dim), id), writer, status)
                if (.not. status%is_ok()) return
                call check(nf90_put_att(writer%id, id, "long_name", trim(variable%long_name)//beside_words), writer, status)
                call check(nf90_put_att(writer%id, id, "units", trim(variable%units)), writer, status)
                if (variable%is_integer) then
                    call put_flags(writer, id, variable%flag, status)
                    call check(nf90_put_var(writer%id, id, block%of(i)%integer, spread(1, 1, n_dim), counts(:n_dim)), writer, &
                               status)
                else
                    call check(nf90_put_var(writer%id, id, real(block%of(i)%real, real64), spread(1, 1, n_dim), &
                                            counts(:n_dim)), writer, status)
                end if
            end associate
        end do
    end subroutine put_event_sides

    subroutine note_text(name, text, writer, status)
        character(len=*), intent(in) :: name, text
        type(netcdf_writer), intent(inout) :: writer
        type(status_type), intent(inout) :: status

        if (.not. status%is_ok()) return
        call check(nf90_put_att(writer%id, nf90_global, name, text), writer, status)
    end subroutine note_text

    subroutine note_number(name, number, writer, status)
        character(len=*), intent(in) :: name
        integer, intent(in) :: number
        type(netcdf_writer), intent(inout) :: writer
        type(status_type), intent(inout) :: status

        if (.not. status%is_ok()) return
        call check(nf90_put_att(writer%id, nf90_global, name, number), writer, status)
    end subroutine note_number

    !> Finish the file and put it in its place. After a failure nothing is left behind.
    subroutine close_netcdf(writer, status)
        type(netcdf_writer), intent(inout) :: writer
        type(status_type), intent(inout) :: status

        if (writer%is_open .and. status%is_ok()) then
            call check(nf90_close(writer%id), writer, status)
            writer%is_open = .false.
        end if
        if (status%is_ok()) then
            call commit_output(writer%file, status)
        else
            call abandon_netcdf(writer)
        end if
    end subroutine close_netcdf

    !> Give up: nothing is left behind.
    subroutine abandon_netcdf(writer)
        type(netcdf_writer), intent(inout) :: writer

        call discard_output(writer%file)
        writer%is_open = .false.
    end subroutine abandon_netcdf

    subroutine define_variable(layout, variable, n_sample, dimension_id, deflate, writer, id, status)
        type(layout_type), intent(in) :: layout
        type(variable_type), intent(in) :: variable
        integer, intent(in) :: n_sample, dimension_id(:), deflate
        type(netcdf_writer), intent(inout) :: writer
        integer, intent(out) :: id
        type(status_type), intent(inout) :: status
        integer :: dims(variable%n_dim), chunk(variable%n_dim), kind, no_fill

        if (.not. status%is_ok()) return
        dims = dimension_id(variable%dim(variable%n_dim:1:-1))
        kind = merge(nf90_int, nf90_double, variable%is_integer)
        if (deflate == 0 .and. .not. writer%grows) then
            call check(nf90_def_var(writer%id, trim(variable%name), kind, dims, id, contiguous=.true.), writer, status)
        else
            chunk = layout%dimension(variable%dim(variable%n_dim:1:-1))%size
            chunk(variable%n_dim) = chunk_length(samples_width(layout, variable), n_sample)
            call check(nf90_def_var(writer%id, trim(variable%name), kind, dims, id, chunksizes=chunk), writer, status)
            if (deflate > 0) call check(nf90_def_var_deflate(writer%id, id, 1, 1, deflate), writer, status)
        end if
        if (.not. status%is_ok()) return
        no_fill = 1                                 ! every value is written: no need to fill the file first
        call check(nf90_def_var_fill(writer%id, id, no_fill, 0), writer, status)
        call check(nf90_put_att(writer%id, id, "long_name", trim(variable%long_name)), writer, status)
        call check(nf90_put_att(writer%id, id, "units", trim(variable%units)), writer, status)
        if (variable%length > 0) &
            call check(nf90_put_att(writer%id, id, "length", real(variable%length, real64)), writer, status)
        if (len(companions(layout, variable)) > 0) &
            call check(nf90_put_att(writer%id, id, "coordinates", companions(layout, variable)), writer, status)
        if (variable%is_integer) call put_flags(writer, id, variable%flag, status)
    end subroutine define_variable

    !> Variables that say more about the entries of this one (CF's `coordinates`): the time, the units.
    pure function companions(layout, variable) result(names)
        type(layout_type), intent(in) :: layout
        type(variable_type), intent(in) :: variable
        character(len=:), allocatable :: names
        integer :: k

        names = ""
        if (variable%id == result_time) return
        if (variable_index(layout, result_time) > 0) names = " time"
        do k = 2, variable%n_dim
            associate (dimension => layout%dimension(variable%dim(k)))
                if (allocated(dimension%unit)) names = names//" "//trim(dimension%name)//"_unit"
            end associate
        end do
        names = names(2:)
    end function companions

    !> Samples in a compressed chunk: a power of two, so that blocks of samples fill whole chunks.
    pure integer function chunk_length(width, n_sample) result(length)
        integer, intent(in) :: width, n_sample

        length = longest_chunk
        do while (length > 1 .and. (length*width > chunk_values .or. (n_sample > 0 .and. length/2 >= n_sample)))
            length = length/2
        end do
        if (n_sample > 0) length = min(length, n_sample)
    end function chunk_length

    !> What the integers of a variable mean. CF parts the meanings by blanks.
    subroutine put_flags(writer, id, flag, status)
        type(netcdf_writer), intent(in) :: writer
        integer, intent(in) :: id
        character(len=*), intent(in) :: flag(:)
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: meanings
        integer :: i, k

        meanings = ""
        do i = 1, size(flag)
            meanings = meanings//" "
            do k = 1, len_trim(flag(i))
                meanings = meanings//merge("_", flag(i)(k:k), flag(i)(k:k) == " ")
            end do
        end do
        call check(nf90_put_att(writer%id, id, "flag_values", [(i, i=0, size(flag) - 1)]), writer, status)
        call check(nf90_put_att(writer%id, id, "flag_meanings", meanings(2:)), writer, status)
    end subroutine put_flags

    !> What is said of the run as a whole.
    subroutine put_attributes(planar, attributes, writer, status)
        logical, intent(in) :: planar
        type(attributes_type), intent(in) :: attributes
        type(netcdf_writer), intent(in) :: writer
        type(status_type), intent(inout) :: status

        call put_text("title", attributes%title)
        call put_text("linkdyn_version", attributes%version)
        call put_text("space", trim(merge("planar ", "spatial", planar)))
        call put_text("solver", attributes%solver)
        call check(nf90_put_att(writer%id, nf90_global, "gravity", &
            real(attributes%gravity(:merge(2, 3, planar)), real64)), writer, status)
        if (attributes%idle_spins /= "") call put_text("idle_spins", attributes%idle_spins)
        if (attributes%shared_reactions /= "") then
            call put_text("shared_reactions", attributes%shared_reactions)
            call put_text("shared_components", attributes%shared_components)
            call put_text("shared_directions", attributes%shared_directions)
            call put_text("redundancy", attributes%redundancy)
        end if
        call put_text("scene", attributes%scene)
        call put_text("history", attributes%history)
    contains
        subroutine put_text(name, text)
            character(len=*), intent(in) :: name, text

            call check(nf90_put_att(writer%id, nf90_global, name, text), writer, status)
        end subroutine put_text
    end subroutine put_attributes

    !> Labels and units of the dimensions that the variables use.
    subroutine put_labels(layout, dimension_id, writer, status)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: dimension_id(:)
        type(netcdf_writer), intent(in) :: writer
        type(status_type), intent(inout) :: status
        integer :: i

        do i = dim_sample + 1, n_dimension
            if (.not. any_uses(layout, i) .or. .not. status%is_ok()) cycle
            associate (dimension => layout%dimension(i))
                call put_strings(trim(dimension%name), dimension%label, dimension_id(i), writer, status)
                if (allocated(dimension%unit)) call put_strings(trim(dimension%name)//"_unit", &
                    dimension%unit, dimension_id(i), writer, status)
            end associate
        end do
    end subroutine put_labels

    !> One row of names. Ended by zeros, not blanks, and marked as UTF-8: xarray then shows plain strings.
    subroutine put_strings(name, strings, dimension_id, writer, status)
        character(len=*), intent(in) :: name, strings(:)
        integer, intent(in) :: dimension_id
        type(netcdf_writer), intent(in) :: writer
        type(status_type), intent(inout) :: status
        character(len=max(1, maxval(len_trim(strings)))) :: padded(size(strings))
        integer :: i, length_id, id

        do i = 1, size(strings)
            padded(i) = trim(strings(i))//repeat(achar(0), len(padded) - len_trim(strings(i)))
        end do
        if (.not. status%is_ok()) return
        call check(nf90_def_dim(writer%id, name//"_length", len(padded), length_id), writer, status)
        call check(nf90_def_var(writer%id, name, nf90_char, [length_id, dimension_id], id), writer, status)
        call check(nf90_put_att(writer%id, id, "_Encoding", "utf-8"), writer, status)
        if (.not. status%is_ok()) return
        call check(nf90_put_var(writer%id, id, padded), writer, status)
    end subroutine put_strings

    pure logical function any_uses(layout, dimension)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: dimension
        integer :: i

        any_uses = .false.
        do i = 1, size(layout%variable)
            associate (variable => layout%variable(i))
                any_uses = any_uses .or. any(variable%dim(:variable%n_dim) == dimension)
            end associate
        end do
    end function any_uses

    !> Turn a netCDF code into a status.
    subroutine check(code, writer, status)
        integer, intent(in) :: code
        type(netcdf_writer), intent(in) :: writer
        type(status_type), intent(inout) :: status

        if (code == nf90_noerr .or. .not. status%is_ok()) return
        call writing_failed(writer%file, nf90_strerror(code), status)
    end subroutine check
end module linkdyn_netcdf_writer
