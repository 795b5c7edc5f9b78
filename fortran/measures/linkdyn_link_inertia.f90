!> Inertia of links, on lanes: what their energy asks for.
module linkdyn_link_inertia
    use linkdyn_model, only: link_type
    use linkdyn_vec3, only: vec3, operator(+), operator(*)
    implicit none (type, external)
    private
    public :: inertia_times

contains

    !> Inertia tensor about the centre of mass times a vector.
    pure function inertia_times(link, v) result(h)
        type(link_type), intent(in) :: link
        type(vec3), intent(in) :: v
        type(vec3) :: h

        associate (i => link%inertia)
            if (link%is_diagonal) then
                h%x = i(1, 1)*v%x
                h%y = i(2, 2)*v%y
                h%z = i(3, 3)*v%z
            else
                h%x = i(1, 1)*v%x + i(1, 2)*v%y + i(1, 3)*v%z
                h%y = i(2, 1)*v%x + i(2, 2)*v%y + i(2, 3)*v%z
                h%z = i(3, 1)*v%x + i(3, 2)*v%y + i(3, 3)*v%z
            end if
        end associate
    end function inertia_times
end module linkdyn_link_inertia
