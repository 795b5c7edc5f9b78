!> What file names stand for once links are followed.
module linkdyn_path
    use, intrinsic :: iso_c_binding, only: c_char, c_int
    use linkdyn_scene, only: scene_type
    use linkdyn_status, only: status_type, fail, status_bad_input, status_io_error
    implicit none (type, external)
    private
    public :: path_missing, path_file, path_other
    public :: resolve_path, path_exists, is_inside, is_same_file, refuse_inputs

    integer, parameter :: path_missing = 0, path_file = 1, path_directory = 2, path_other = 3, path_failed = 4 ! linkdyn_path.h
    integer, parameter :: longest_path = 4095

    interface
        function linkdyn_resolve(path, path_len, resolved, resolved_len, reason, reason_len) result(kind) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
            character(kind=c_char), intent(inout) :: resolved(*)
            integer(c_int), value :: resolved_len
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: kind
        end function linkdyn_resolve

        function linkdyn_path_exists(path, path_len) result(answer) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
            integer(c_int) :: answer
        end function linkdyn_path_exists

        function linkdyn_is_same_file(one, one_len, other, other_len) result(answer) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: one(*), other(*)
            integer(c_int), value :: one_len, other_len
            integer(c_int) :: answer
        end function linkdyn_is_same_file

        function linkdyn_is_inside(file, file_len, folder, folder_len) result(answer) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: file(*), folder(*)
            integer(c_int), value :: file_len, folder_len
            integer(c_int) :: answer
        end function linkdyn_is_inside
    end interface

contains

    !> The name behind all links of a file to be written, which need not be there, and what it stands for.
    subroutine resolve_path(path, resolved, kind, status)
        character(len=*), intent(in) :: path
        character(len=:), allocatable, intent(out) :: resolved
        integer, intent(out) :: kind                   !! one of `path_*`
        type(status_type), intent(inout) :: status
        character(len=longest_path) :: buffer
        character(len=128) :: reason

        buffer = path
        kind = int(linkdyn_resolve(path, len_trim(path), buffer, len(buffer), reason, len(reason)))
        resolved = trim(buffer)
        if (kind == path_failed) call fail(status, status_io_error, trim(path)//": cannot be written: "//trim(reason))
        if (kind == path_directory) call fail(status, status_io_error, &
            trim(path)//": cannot be written: is a folder (expected a file name)")
    end subroutine resolve_path

    logical function path_exists(path)
        character(len=*), intent(in) :: path

        path_exists = linkdyn_path_exists(path, len_trim(path)) /= 0
    end function path_exists

    !> True if a file lies in a folder (blank: the current one) or below it, links followed.
    logical function is_inside(file, folder)
        character(len=*), intent(in) :: file, folder

        is_inside = linkdyn_is_inside(file, len_trim(file), folder, len_trim(folder)) /= 0
    end function is_inside

    !> True if two names stand for one file that is there.
    logical function is_same_file(one, other)
        character(len=*), intent(in) :: one, other

        is_same_file = linkdyn_is_same_file(one, len_trim(one), other, len_trim(other)) /= 0
    end function is_same_file

    !> Nothing that a run writes may be a file that it reads, by whatever name.
    subroutine refuse_inputs(output, scene, status, states)
        character(len=*), intent(in) :: output
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status
        character(len=*), intent(in), optional :: states     !! file of --states
        integer :: i

        call refuse(scene%file, "is the scene file")
        do i = 1, size(scene%table_file)
            call refuse(scene%table_file(i), "is a table of the scene")
        end do
        do i = 2, size(scene%source)
            call refuse(scene%source(i)%file, "is included by the scene")
        end do
        if (present(states)) call refuse(states, "is the file of --states")

    contains

        subroutine refuse(input, what)
            character(len=*), intent(in) :: input, what

            if (is_same_file(output, input)) call fail(status, status_bad_input, &
                trim(output)//": cannot be written: "//what//" (expected another file, --output FILE)")
        end subroutine refuse
    end subroutine refuse_inputs
end module linkdyn_path
