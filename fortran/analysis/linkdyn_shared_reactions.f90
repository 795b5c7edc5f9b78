!> Reactions of over-constrained mechanisms: how joints share what the equations of motion leave open.
!>
!> The released mechanism (`linkdyn_release`) gives reactions that balance. To them come states of self-stress, reactions that
!> balance without any load: x = x0 + N z. What has no part in N is determined, and stays as it is to the last digit. Of the rest
!> the reactions with the least x C x are taken: C the joints' compliances, by which this is the elastic energy (Menabrea,
!> Castigliano), or one for all, by which it is the sum of squares of forces and of moments over the mechanism's size.
!>
!> So it is for samples of the lanes; a record shares by itself (`linkdyn_reaction_sharing`).
!>
!> The same look at the joints tells whether they fit at all: constraints that are redundant in theory gape if the geometry is not
!> what makes them so. Such a sample is `unreachable`.
module linkdyn_shared_reactions
    use linkdyn_constraint_rows, only: loop_type, rows_type, take_joints, place_carriers, list_rows, any_turned_over, &
        hardly_new
    use linkdyn_dense, only: dense_workspace, solve_dense, hold_blas_threads, release_blas_threads
    use linkdyn_elastic_links, only: list_arm_parts, wrench_on_arm, misfit_of
    use linkdyn_gear_fit, only: gears_go_along
    use linkdyn_joint_table, only: is_geared
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, holds_spin, gapes
    use linkdyn_null_space, only: find_null_space
    use linkdyn_null_space_plan, only: find_null_space_by_plan
    use linkdyn_release, only: compliances
    use linkdyn_scene, only: share_by_stiffness
    use linkdyn_status, only: sample_ok, sample_unreachable, sample_singular
    use linkdyn_threads, only: team_size
    implicit none (type, external)
    private
    public :: share_reactions

    integer, parameter :: few = 64                      !! samples that a thread takes at a time

    !> Squares that make the elastic energy of links.
    type :: arm_energy
        real(wp), allocatable :: part(:, :)             !! of a unit of each row (part, row)
        real(wp), allocatable :: weight(:)              !! (part)
        real(wp), allocatable :: start(:)               !! before anything is shared (part)
        real(wp), allocatable :: misfit(:)              !! of joints: what a unit of each row takes of the energy [m] (row)
    end type arm_energy

contains

    !> Share the reactions of some samples of a batch, and flag those whose joints gape.
    subroutine share_reactions(model, threads, position, rotation, status, sample, reaction, push)
        type(model_type), intent(in) :: model
        integer, intent(in) :: threads                  !! at most
        real(wp), intent(in) :: position(:, :, :)       !! origins of the links [m] (3, n_link, n)
        real(wp), intent(in) :: rotation(:, :, :, :)    !! their axes (3, 3, n_link, n)
        integer, intent(inout) :: status(:)             !! (n)
        integer, intent(in) :: sample(:)                !! which of the batch these are (n)
        real(wp), intent(inout), optional :: reaction(:, :, :)    !! of the batch, world axes [N, N m] (n_component, n_joint, all)
        real(wp), intent(in), optional :: push(:, :, :)    !! what else joints do, for links that give way (n_component, n_joint, n)
        integer :: first

        call hold_blas_threads()
        !$omp parallel do num_threads(team_size(threads, 1 + size(status)/few)) default(shared) private(first) schedule(static)
        do first = 1, size(status), few
            call share_some(first, min(first + few - 1, size(status)))
        end do
        !$omp end parallel do
        call release_blas_threads()

    contains

        !> With scratch of its own.
        subroutine share_some(first, last)
            integer, intent(in) :: first, last          !! samples
            type(loop_type) :: loop
            type(dense_workspace) :: workspace
            integer :: i

            call take_shared_joints(model, loop)
            do i = first, last
                if (status(i) /= sample_ok) cycle
                if (.not. gears_go_along(model, position(:, :, i), rotation(:, :, :, i))) then
                    status(i) = sample_unreachable
                    cycle
                end if
                loop%position(:, 1:) = position(:, model%share%link, i)/loop%size
                loop%rotation(:, :, 1:) = rotation(:, :, model%share%link, i)
                if (present(push)) then
                    call share_sample(model, loop, workspace, status(i), reaction(:, :, sample(i)), push(:, :, i))
                else if (present(reaction)) then
                    call share_sample(model, loop, workspace, status(i), reaction(:, :, sample(i)))
                else
                    call share_sample(model, loop, workspace, status(i))
                end if
            end do
        end subroutine share_some
    end subroutine share_reactions

    !> The joints that share reactions, as the scene has them, between their links.
    subroutine take_shared_joints(model, loop)
        type(model_type), intent(in) :: model
        type(loop_type), intent(out) :: loop
        integer :: body(0:model%n_link), i, n

        n = size(model%share%link)
        body = 0
        body(model%share%link) = [(i, i=1, n)]
        call take_joints(model, model%share%joint, loop)
        allocate (loop%body(2, size(loop%joint)))
        do i = 1, size(loop%joint)
            associate (joint => model%joint(loop%joint(i)))
                loop%body(:, i) = body(joint%link)
                if (holds_spin(joint)) cycle
                loop%kind(i) = joint%told_kind
                loop%frame(:, :, :, i) = joint%told_frame
            end associate
        end do
        call place_carriers(model, body, loop)
        allocate (loop%position(3, 0:n), loop%rotation(3, 3, 0:n))
        loop%position(:, 0) = 0
        loop%rotation(:, :, 0) = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])
    end subroutine take_shared_joints

    !> Reactions of the joints as they are: those of the released ones with the self-stress that has least energy. Joints that gape
    !> share nothing.
    subroutine share_sample(model, loop, workspace, status, reaction, push)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        type(dense_workspace), intent(inout) :: workspace
        integer, intent(inout) :: status
        real(wp), intent(inout), optional :: reaction(:, :)    !! (n_component, n_joint)
        real(wp), intent(in), optional :: push(:, :)           !! what else joints do (n_component, n_joint)
        type(rows_type) :: rows
        type(arm_energy) :: arms
        real(wp), allocatable :: stress(:, :), open(:)
        real(wp) :: wrench(6)
        logical :: is_singular
        integer :: i

        call list_rows(model, loop, rows)
        if (maxval(abs(rows%residual(:rows%n))) > gapes .or. any_turned_over(loop)) then
            status = sample_unreachable
            return
        end if
        if (.not. present(reaction)) return
        call find_stress(model, rows%row(:, :rows%n), stress)
        if (size(stress, 2) /= model%share%n) then
            status = sample_singular
            return
        end if
        open = parts_of(loop, rows, reaction)
        if (present(push)) then
            call load_arms(model, loop, rows, reaction + push, arms)
        else
            call load_arms(model, loop, rows, reaction, arms)
        end if
        call relax(model, loop, rows, stress, arms, workspace, open, is_singular)
        if (is_singular) then
            status = sample_singular
            return
        end if
        do i = 1, rows%n
            wrench = [rows%wrench(:3, i), loop%size*rows%wrench(4:, i)]
            associate (r => reaction(:, loop%joint(rows%joint(i))))
                r = r + open(i)*wrench(loop%column)
            end associate
        end do
    end subroutine share_sample

    !> The elastic energy of the links: its parts by reactions, and what they are before states of self-stress come to these.
    subroutine load_arms(model, loop, rows, wrench, arms)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        type(rows_type), intent(in) :: rows
        real(wp), intent(in) :: wrench(:, :)            !! that each joint has on its second link (n_component, n_joint)
        type(arm_energy), intent(out) :: arms
        integer, allocatable :: arm(:), of_arm(:)
        real(wp) :: whole(6)
        integer :: p

        call list_arm_parts(model, loop, rows, arms%part, arms%weight, arm, of_arm)
        allocate (arms%start(size(arm)), arms%misfit(rows%n))
        do p = 1, rows%n
            associate (i => rows%joint(p))
                arms%misfit(p) = misfit_of(model%scene%joint(loop%joint(i)), loop%rotation(:, :, loop%body(1, i)), &
                                           [rows%wrench(:3, p), loop%size*rows%wrench(4:, p)])
            end associate
        end do
        do p = 1, size(arm)
            associate (a => model%arm(arm(p)))
                whole = 0
                whole(loop%column) = wrench(:, a%joint)
                whole = wrench_on_arm(model, loop, findloc(loop%joint, a%joint, dim=1), a%side, whole)
                arms%start(p) = dot_product(a%row(:, of_arm(p)), whole)
            end associate
        end do
    end subroutine load_arms

    !> What states of self-stress add to reactions, so that the elastic energy, or the sum of squares, is the least. Teeth are the
    !> first to share by the sum of squares: equal planets then take equal parts, whatever their weights do to their pins.
    subroutine relax(model, loop, rows, stress, arms, workspace, open, is_singular)
        type(model_type), intent(in) :: model
        type(loop_type), intent(in) :: loop
        type(rows_type), intent(in) :: rows
        real(wp), intent(in) :: stress(:, :)            !! (row, state)
        type(arm_energy), intent(in) :: arms            !! none by the sum of squares
        type(dense_workspace), intent(inout) :: workspace
        real(wp), intent(inout) :: open(:)              !! parts of the reactions; then what is added to them (row)
        logical, intent(out) :: is_singular
        real(wp), allocatable :: added(:), of_teeth(:, :), first(:, :), rest(:, :)
        integer, allocatable :: tooth(:)
        integer :: i

        allocate (added(size(open)), source=0.0_wp)
        is_singular = .false.
        tooth = pack([(i, i=1, rows%n)], is_geared(loop%kind(rows%joint(:rows%n))))
        if (size(tooth) == 0 .or. model%scene%redundancy == share_by_stiffness) then
            call take_least(stress, compliances(model, loop, rows), arms)
        else
            ! states that load teeth, square to those that do not
            of_teeth = stress(tooth, :)
            call find_null_space(of_teeth, hardly_new, rest)
            call find_null_space(transpose(rest), 0.0_wp, first)
            call take_least(matmul(stress, first), merge(1.0_wp, 0.0_wp, is_geared(loop%kind(rows%joint(:rows%n)))))
            call take_least(matmul(stress, rest), compliances(model, loop, rows))
        end if
        open = added

    contains

        subroutine take_least(state, compliance, arms)
            real(wp), intent(in) :: state(:, :)         !! (row, state)
            real(wp), intent(in) :: compliance(:)
            type(arm_energy), intent(in), optional :: arms
            real(wp), allocatable :: bent(:, :)         ! (part, state)
            real(wp) :: soft(size(state, 1), size(state, 2)), rcond, error_bound
            real(wp), allocatable :: energy(:, :), part(:)

            if (is_singular .or. size(state, 2) == 0) return
            soft = state*spread(compliance, 2, size(state, 2))
            energy = matmul(transpose(state), soft)
            part = -matmul(transpose(soft), open + added)
            if (present(arms)) then
                bent = matmul(arms%part, state)
                energy = energy + matmul(transpose(bent), spread(arms%weight, 2, size(state, 2))*bent)
                part = part - matmul(arms%weight*arms%start, bent) + matmul(arms%misfit, state)
            end if
            call solve_dense(workspace, energy, part, rcond, error_bound, is_singular)
            if (.not. is_singular) added = added + matmul(state, part)
        end subroutine take_least
    end subroutine relax

    !> Orthonormal states of self-stress.
    subroutine find_stress(model, row, stress)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: row(:, :)               !! of the joints that share (column, row)
        real(wp), allocatable, intent(out) :: stress(:, :)    !! (row, state)
        real(wp) :: left(size(row, 1), size(row, 2))
        logical :: is_sure

        left = row
        allocate (stress(size(row, 2), model%share%n))
        call find_null_space_by_plan(model%share%stress, left, stress, is_sure)
        if (.not. is_sure) call find_null_space(row, hardly_new, stress)
    end subroutine find_stress

    !> The reactions along the directions that the joints hold: forces [N], moments over the mechanism's size.
    function parts_of(loop, rows, reaction) result(part)
        type(loop_type), intent(in) :: loop
        type(rows_type), intent(in) :: rows
        real(wp), intent(in) :: reaction(:, :)          !! (n_component, n_joint)
        real(wp) :: part(rows%n), r(6)
        integer :: i

        do i = 1, rows%n
            r = 0
            r(loop%column) = reaction(:, loop%joint(rows%joint(i)))
            r(4:) = r(4:)/loop%size
            associate (wrench => rows%wrench(:, i))
                part(i) = dot_product(wrench, r)/dot_product(wrench, wrench)
            end associate
        end do
    end function parts_of
end module linkdyn_shared_reactions
