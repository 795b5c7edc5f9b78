!> How the equations are written down: choices that change no force, but how many entries vary, and what the matrix looks like.
module linkdyn_layout
    use linkdyn_joint_table, only: n_transmitted
    use linkdyn_model, only: model_type, step_ups, side_of
    implicit none (type, external)
    private
    public :: layout_type, sparse_layout, lecture_layout, about_origin, about_cog

    integer, parameter :: about_origin = 0, about_cog = -1

    type :: layout_type
        logical, allocatable :: in_own_axes(:)         !! (link) its equations; else in world axes
        integer, allocatable :: moment_joint(:)        !! (link) moments about its marker of this joint, or `about_*`
        integer, allocatable :: unknown_side(:)        !! (joint) 1 or 2: in the axes of that link; 0: world axes
    end type layout_type

contains

    !> Few entries that vary: legs in their own axes, everything else in world axes; moments about the joint with the most
    !> unknown forces, which then have no arm.
    function sparse_layout(model) result(layout)
        type(model_type), intent(in) :: model
        type(layout_type) :: layout
        integer :: i, k, l, j, most, n(2)

        layout = world_layout(model, about_origin)
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (step%kind /= step_ups) cycle
                layout%in_own_axes(step%link(:2)) = .true.
                do k = 1, 3
                    associate (joint => model%joint(step%joint(k)))
                        if (joint%kind /= model%joint(joint%told)%kind) cycle    ! it joins hinges
                        layout%unknown_side(joint%told) = side_of(joint, step%link(1 + k/3))
                    end associate
                end do
            end associate
        end do
        do l = 1, model%n_link
            most = 0
            do i = model%first_at(l), model%first_at(l + 1) - 1
                j = model%joint_at(i)
                if (j > model%n_joint) cycle           ! it is carried over from another link
                n = n_transmitted(model%joint(j)%kind, model%is_planar)
                if (n(1) <= most) cycle
                most = n(1)
                layout%moment_joint(l) = j
            end do
        end do
    end function sparse_layout

    !> As on the slides: world axes, moments about the centres of mass.
    pure function lecture_layout(model) result(layout)
        type(model_type), intent(in) :: model
        type(layout_type) :: layout

        layout = world_layout(model, about_cog)
    end function lecture_layout

    pure function world_layout(model, about) result(layout)
        type(model_type), intent(in) :: model
        integer, intent(in) :: about
        type(layout_type) :: layout
        integer :: i

        layout%in_own_axes = [(.false., i=1, model%n_link)]
        layout%moment_joint = [(about, i=1, model%n_link)]
        layout%unknown_side = [(0, i=1, model%n_joint)]
    end function world_layout
end module linkdyn_layout
