!> What generated code takes and gives: arrays, whose entries have the names of a scene.
module linkdyn_code_fields
    use linkdyn_c_words, only: c_distinct
    use linkdyn_kinds, only: wp
    use linkdyn_results, only: label_len
    implicit none (type, external)
    private
    public :: name_list, field_type, list_of_names, without_names, field, in_c_order, field_size
    public :: of_coordinates, of_actuators, of_joints, of_components, of_variables, of_links, of_loads, of_placed, of_axes
    public :: of_place, n_list
    public :: note_len

    ! ---- what an index of an array counts
    integer, parameter :: of_coordinates = 1
    integer, parameter :: of_actuators = 2
    integer, parameter :: of_joints = 3
    integer, parameter :: of_components = 4
    integer, parameter :: of_variables = 5
    integer, parameter :: of_links = 6
    integer, parameter :: of_loads = 7
    integer, parameter :: of_placed = 8                !! links in groups closed by iteration
    integer, parameter :: of_axes = 9                  !! x, y, z: no names
    integer, parameter :: of_place = 10                !! numbers that place a link: no names
    integer, parameter :: n_list = 10

    integer, parameter :: note_len = 128

    !> Names that an enum gives to the values of an index.
    type :: name_list
        character(len=16) :: what = ""                 !! "coordinate"; blank: there are no names, only a number
        integer :: n = 0
        character(len=label_len), allocatable :: label(:)      !! as the scene has them
        character(len=label_len + 12), allocatable :: word(:)  !! as C may have them, all different
        character(len=note_len), allocatable :: note(:)        !! unit and whatever else a comment says
    end type name_list

    !> A member of a struct.
    type :: field_type
        character(len=20) :: name = ""
        character(len=note_len) :: meaning = ""        !! with its unit
        integer :: id = 0                              !! of inputs `in_*`, of outputs `result_*`
        integer, allocatable :: of(:)                  !! what its indices count, slowest first
        integer, allocatable :: place(:)               !! number of each entry, slowest index first, in its block or result
        real(wp), allocatable :: start(:)              !! of inputs, likewise
    end type field_type

contains

    function list_of_names(what, label, note) result(list)
        character(len=*), intent(in) :: what
        character(len=*), intent(in) :: label(:), note(:)
        type(name_list) :: list

        list%what = what
        list%n = size(label)
        list%label = label
        list%note = note
        list%word = c_distinct(list%label)
    end function list_of_names

    !> An index whose values are counted: only comments say what they are.
    function without_names(label) result(list)
        character(len=*), intent(in) :: label(:)
        type(name_list) :: list

        list%n = size(label)
        list%label = label
    end function without_names

    !> An array whose entries stand in a block, or result, as they stand in C.
    function field(name, meaning, id, of, list) result(new)
        character(len=*), intent(in) :: name, meaning
        integer, intent(in) :: id, of(:)
        type(name_list), intent(in) :: list(:)
        type(field_type) :: new
        integer :: i

        new%name = name
        new%meaning = meaning
        new%id = id
        new%of = of
        new%place = [(i, i=1, product(list(of)%n))]
        allocate (new%start(size(new%place)))
        new%start = 0
    end function field

    pure integer function field_size(one)
        type(field_type), intent(in) :: one

        field_size = size(one%place)
    end function field_size

    !> The entry i of a field as C writes it: "[2][0]".
    function in_c_order(one, list, i) result(text)
        type(field_type), intent(in) :: one
        type(name_list), intent(in) :: list(:)
        integer, intent(in) :: i
        character(len=:), allocatable :: text
        character(len=12) :: number
        integer :: rest, k, n

        text = ""
        rest = i - 1
        do k = size(one%of), 1, -1
            n = list(one%of(k))%n
            write (number, "(i0)") modulo(rest, n)
            text = "["//trim(number)//"]"//text
            rest = rest/n
        end do
    end function in_c_order
end module linkdyn_code_fields
