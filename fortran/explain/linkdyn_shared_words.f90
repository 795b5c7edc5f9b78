!> Reactions that the equations leave open, in words: which joints', and along which directions. What is not named is determined.
module linkdyn_shared_words
    use linkdyn_cross, only: cross
    use linkdyn_joint_table, only: is_geared, n_transmitted
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, open_part_type, friction_is_shared, axes_of_world, axes_of_joint
    use linkdyn_open_directions, only: axes_along
    use linkdyn_text, only: to_text, quoted
    implicit none (type, external)
    private
    public :: shares_in_words, shared_components, shared_directions

    character(len=*), parameter :: sort_name(2) = ["force ", "moment"], axis_name(3) = ["x", "y", "z"]

contains

    !> "forces along z and moments of joints J1, J2": joints alike together, the first ones by name.
    function shares_in_words(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text
        integer, parameter :: most_named = 6, most_told = 4
        integer, allocatable :: alike(:)
        logical :: is_told(size(model%share%joint))
        integer :: i, j, n

        text = ""
        is_told = .false.
        n = 0
        do i = 1, size(is_told)
            if (is_told(i)) cycle
            alike = pack([(j, j=1, size(is_told))], [(in_words(model, j) == in_words(model, i), j=1, size(is_told))])
            is_told(alike) = .true.
            n = n + 1
            if (n > most_told) cycle
            if (n > 1) text = text//"; "
            text = text//in_words(model, i)//" of "//trim(merge("joint ", "joints", size(alike) == 1))
            do j = 1, min(size(alike), most_named)
                if (j > 1) text = text//","
                text = text//" "//trim(model%joint(model%share%joint(alike(j)))%name)
            end do
            if (size(alike) > most_named) text = text//" and "//to_text(size(alike) - most_named)//" more"
        end do
        if (n > most_told) text = text//"; and those of others"
        if (friction_is_shared(model)) text = text//", and what friction there makes of all others"
    end function shares_in_words

    !> "J1.force.z J1.moment.x", by world axes, as results have their components; "all" where friction comes of them.
    function shared_components(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text
        integer :: i, sort, k

        text = ""
        if (model%share%n == 0) return
        do i = 1, size(model%share%joint)
            do sort = 1, 2
                do k = 1, 3
                    if (model%share%part(sort, i)%world(k)) text = text//" "//part_name(model, sort, i)//"."//axis_name(k)
                end do
            end do
        end do
        text = text(2:)
        if (friction_is_shared(model)) text = "all"
    end function shared_components

    !> "J1.force along z; J1.moment across the axis".
    function shared_directions(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text
        integer :: i, sort

        text = ""
        if (model%share%n == 0) return
        do i = 1, size(model%share%joint)
            do sort = 1, 2
                associate (part => model%share%part(sort, i))
                    if (part%n > 0) text = text//"; "//part_name(model, sort, i)//directions(model, part, sort)
                end associate
            end do
        end do
        text = text(3:)
    end function shared_directions

    !> "J1.force"
    function part_name(model, sort, i) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: sort, i
        character(len=:), allocatable :: text

        text = trim(model%joint(model%share%joint(i))%name)//"."//trim(sort_name(sort))
    end function part_name

    !> "forces along z and moments"
    function in_words(model, i) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        character(len=:), allocatable :: text

        associate (part => model%share%part(:, i))
            if (part(1)%n == 0) then
                text = words_of(2)
            else if (part(2)%n == 0) then
                text = words_of(1)
            else if (words_of(1) == "forces" .and. words_of(2) /= "moments") then
                text = words_of(1)//", "//words_of(2)    ! whose directions are not the forces'
            else
                text = words_of(1)//" and "//words_of(2)
            end if
        end associate

    contains

        !> Without directions where all is open that the joint holds.
        function words_of(sort) result(text)
            integer, intent(in) :: sort
            character(len=:), allocatable :: text
            integer :: held(2)

            text = trim(sort_name(sort))//"s"
            associate (kind => model%joint(model%share%joint(i))%told_kind, part => model%share%part(sort, i))
                held = n_transmitted(kind, model%is_planar)
                if (part%n_at_once < held(sort) .and. .not. is_geared(kind)) text = text//directions(model, part, sort)
            end associate
        end function words_of
    end function in_words

    !> Nothing, if all directions are open; " along z", of the world; " along x and y of 'rod'", " across (0.6, 0.8, 0) of 'rod'",
    !> by link axes; " across the axis" of the joint; " in 2 directions that turn".
    function directions(model, part, sort) result(text)
        type(model_type), intent(in) :: model
        type(open_part_type), intent(in) :: part
        integer, intent(in) :: sort
        character(len=:), allocatable :: text
        integer :: all

        all = 3
        if (model%is_planar) all = merge(2, 1, sort == 1)
        text = ""
        if (part%n < all) then
            text = " "//stays(model, part)
        else if (part%n_at_once < all) then
            text = " in "//to_text(part%n_at_once)// &
                   trim(merge(" direction that turns", " directions that turn", part%n_at_once == 1))
        end if
    end function directions

    !> Where open directions lie that stay in some axes.
    function stays(model, part) result(text)
        type(model_type), intent(in) :: model
        type(open_part_type), intent(in) :: part
        character(len=:), allocatable :: text
        real(wp) :: v(3)
        logical :: along(3)
        integer :: k

        along = axes_along(part)
        if (part%axes == axes_of_joint) then
            text = trim(merge("along the axis ", "across the axis", along(3)))
            return
        end if
        if (any(along)) then
            text = ""
            do k = 1, 3
                if (along(k)) text = text//" and "//axis_name(k)
            end do
            text = "along "//text(6:)
        else
            v = part%direction(:, 1)
            if (part%n == 2) v = cross(v, part%direction(:, 2))
            k = maxloc(abs(v), dim=1)
            v = sign(1.0_wp, v(k))*v
            text = trim(merge("along ", "across", part%n == 1))//" ("//to_text(v(1))//", "//to_text(v(2))//", "//to_text(v(3))//")"
        end if
        if (part%axes /= axes_of_world) text = text//" of "//quoted(model%link(part%link)%name)
    end function stays
end module linkdyn_shared_words
