!> Recognise the CSP group: cylindrical joint to a coupler, spherical joint to an output, prismatic joint back.
module linkdyn_csp_plan
    use linkdyn_model, only: model_type, step_type, step_csp
    use linkdyn_scene, only: joint_prismatic, joint_cylindrical, joint_spherical
    implicit none (type, external)
    private
    public :: find_csp

contains

    !> The first group between known links; `found` is false if there is none.
    subroutine find_csp(model, known, step, found)
        type(model_type), intent(in) :: model
        logical, intent(in) :: known(0:)         !! links placed already
        type(step_type), intent(out) :: step
        logical, intent(out) :: found
        integer :: c, s, p, coupler, output

        found = .false.
        do c = 1, size(model%joint)
            coupler = unknown_end(c, joint_cylindrical)
            if (coupler < 0) cycle
            do s = 1, size(model%joint)
                if (model%joint(s)%kind /= joint_spherical .or. .not. any(model%joint(s)%link == coupler)) cycle
                output = sum(model%joint(s)%link) - coupler
                if (known(output)) cycle
                do p = 1, size(model%joint)
                    if (unknown_end(p, joint_prismatic) /= output) cycle
                    step = step_type(kind=step_csp, n_link=2)
                    step%link(:2) = [coupler, output]
                    step%joint(:3) = [c, s, p]
                    found = .true.
                    return
                end do
            end do
        end do

    contains

        !> The link not placed yet at a joint of this kind whose other link is; -1 if it is no such joint.
        pure integer function unknown_end(j, kind) result(link)
            integer, intent(in) :: j, kind

            link = -1
            associate (joint => model%joint(j))
                if (joint%kind /= kind .or. (known(joint%link(1)) .eqv. known(joint%link(2)))) return
                link = joint%link(merge(2, 1, known(joint%link(1))))
            end associate
        end function unknown_end
    end subroutine find_csp
end module linkdyn_csp_plan
