!> Solutions of the equations of motion for any right-hand sides, and with their transpose: what it takes to say how near they are
!> to being singular.
!>
!> What depends on the pose alone is found once; the rest is a kernel from right-hand sides to unknowns. Its derivatives by these
!> are the solution with the transposed matrix.
module linkdyn_inverse_matrix
    use linkdyn_elimination, only: sparse_row, elimination_type, eliminate, alarm_of_watched
    use linkdyn_equation_programs, only: equation_choice, write_equations
    use linkdyn_force_program, only: out_alarm
    use linkdyn_gradient, only: gradient
    use linkdyn_inputs, only: sample_set, in_unknown, in_transposed, add_inputs
    use linkdyn_kernel, only: find_boundary
    use linkdyn_model, only: model_type
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene_program, only: scene_program, output_list, add_output, make_scene_program
    use linkdyn_system, only: list_rows
    use linkdyn_trace, only: traced_type
    use linkdyn_value, only: value, zero, operator(+), operator(*)
    implicit none (type, external)
    private
    public :: make_inverse_matrix

    integer, parameter :: out_pose = 121       !! what the others take of the pose, as block `in_found`
    integer, parameter :: out_solved = 122     !! solution (n)

contains

    !> Without pivots that serve the samples nothing is made.
    subroutine make_inverse_matrix(model, choice, sample, pose, solve, solve_transposed)
        type(model_type), intent(in) :: model
        type(equation_choice), intent(in) :: choice
        type(sample_set), intent(in) :: sample     !! representative: pivots are chosen by them
        type(scene_program), intent(inout) :: pose, solve, solve_transposed
        type(record_type), target :: record
        type(traced_type) :: traced
        type(sparse_row), allocatable :: row(:)
        type(elimination_type) :: elimination
        type(output_list) :: of_pose, of_solve, of_transposed
        type(value), allocatable :: transposed(:)
        type(value) :: total, alarm
        logical, allocatable :: none_is_last(:)
        integer, allocatable :: boundary(:)
        integer :: i

        call open_record(record, sample%n)
        call write_equations(model, choice, sample, traced)
        associate (n => traced%system%n_unknown, in => traced%in)
            call add_inputs(in_unknown, n, sample, in)
            call add_inputs(in_transposed, n, sample, in)
            allocate (row(traced%system%n_equation))
            call list_rows(traced%system, row)
            if (size(row) == n) then    ! else some equation has no unknowns: the matrix is singular in every pose
                row%right = in%of(in_unknown)%v
                none_is_last = spread(.false., 1, n)
                call eliminate(row, n, none_is_last, elimination)
            end if
            if (elimination%is_complete) then
                total = zero()
                do i = 1, n
                    total = total + elimination%solution(i)*in%of(in_transposed)%v(i)
                end do
                transposed = gradient(total, in%of(in_unknown)%v)
                alarm = alarm_of_watched(elimination%watched)
                call find_boundary(record, [elimination%solution, transposed], &
                                   [in%of(in_unknown)%v, in%of(in_transposed)%v], boundary)
                call add_output(of_pose, out_pose, [(value(boundary(i), 1), i=1, size(boundary))])
                call add_output(of_pose, out_alarm, [alarm])
                call add_output(of_solve, out_solved, elimination%solution)
                call add_output(of_transposed, out_solved, transposed)
                call make_scene_program(record, in, of_pose, pose)
                call make_scene_program(record, in, of_solve, solve, boundary)
                call make_scene_program(record, in, of_transposed, solve_transposed, boundary)
            end if
        end associate
        call close_record(record)
    end subroutine make_inverse_matrix
end module linkdyn_inverse_matrix
