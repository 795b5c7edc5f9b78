!> From the number of a sample to the values of all axes: groups of axes that advance together, combined to a product
!> with the last group running fastest; designs, which need a model each, run slowest.
module linkdyn_sweep_plan
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    use linkdyn_sampling, only: sobol_directions, sobol_point, latin_point, random_point
    use linkdyn_hash, only: counter_bits
    use linkdyn_sweep_spec, only: sweep_spec, axis_spec, axis_coordinate, axis_parameter, axis_time, sampling_linspace, &
        sampling_values, sampling_sobol, sampling_latin
    implicit none (type, external)
    private
    public :: sweep_plan, make_sweep_plan, axis_columns, axis_values, samples_of_chunk
    public :: too_many, longest_table

    integer(int64), parameter :: too_many = 2_int64**52    !! samples: beyond, numbers are no longer exact as reals
    integer(int64), parameter :: longest_table = 65536     !! values of an axis kept instead of computed again
    integer(int64), parameter :: long_run = 8              !! samples at one place that are filled at once, a vector or more

    !> Axes that advance together.
    type :: group_type
        integer, allocatable :: axis(:)
        integer(int64) :: n = 1
    end type group_type

    !> One axis with what its values are computed from.
    type :: axis_type
        type(axis_spec) :: spec
        integer(int64), allocatable :: direction(:)        !! of a Sobol sequence
        integer(int64) :: shift = 0
        real(wp), allocatable :: table(:)                  !! values, if they are few
    end type axis_type

    type :: sweep_plan
        type(axis_type), allocatable :: axis(:)
        type(group_type), allocatable :: group(:)          !! slowest first
        integer :: n_design_group = 0
        integer(int64) :: n_sample = 1                     !! in all
        integer(int64) :: n_design = 1
        integer(int64) :: n_pose = 1                       !! samples of one design
        integer(int64) :: n_line = 0                       !! samples in a line along the fastest axis that moves links;
                                                           !! 0: there is none, or its samples have no order
        integer(int64) :: n_load_case = 1                  !! samples that follow each other at one pose: the fastest axes move no
                                                           !! link
        integer(int64) :: chunk = 1                        !! samples in a chunk
        integer(int64) :: n_chunk_design = 1
        integer(int64) :: n_chunk = 1                      !! in all
    end type sweep_plan

contains

    subroutine make_sweep_plan(spec, plan)
        type(sweep_spec), intent(in) :: spec
        type(sweep_plan), intent(out) :: plan
        integer :: i, g, n, pass
        integer(int64) :: j

        allocate (plan%axis(size(spec%axis)), plan%group(spec%n_group))
        do i = 1, size(spec%axis)
            plan%axis(i)%spec = spec%axis(i)
            associate (axis => plan%axis(i))
                if (axis%spec%sampling == sampling_sobol) then
                    axis%direction = sobol_directions(axis%spec%dimension)
                    if (axis%spec%is_shifted) axis%shift = counter_bits(axis%spec%seed, int(axis%spec%dimension, int64), 0_int64)
                end if
                if (axis%spec%n <= longest_table) axis%table = [(axis_value(axis, j), j=0, axis%spec%n - 1)]
            end associate
        end do
        n = 0
        do pass = 1, 2
            do g = 1, spec%n_group
                i = findloc(spec%axis%group, g, dim=1)
                if ((spec%axis(i)%kind == axis_parameter) .neqv. pass == 1) cycle
                n = n + 1
                plan%group(n)%axis = pack([(i, i=1, size(spec%axis))], spec%axis%group == g)
                plan%group(n)%n = spec%axis(plan%group(n)%axis(1))%n
            end do
            if (pass == 1) plan%n_design_group = n
        end do
        ! Capped, so that a product beyond all bounds can be refused.
        do i = 1, n
            if (i <= plan%n_design_group) plan%n_design = capped(plan%n_design, plan%group(i)%n)
            if (i > plan%n_design_group) plan%n_pose = capped(plan%n_pose, plan%group(i)%n)
        end do
        plan%n_sample = capped(plan%n_design, plan%n_pose)
        call measure_lines(plan)
        plan%chunk = spec%chunk
        plan%n_chunk_design = (plan%n_pose - 1)/plan%chunk + 1
        plan%n_chunk = capped(plan%n_design, plan%n_chunk_design)
    end subroutine make_sweep_plan

    !> Loads and rates change nothing in the pose, so lines are counted from the fastest group that does.
    pure subroutine measure_lines(plan)
        type(sweep_plan), intent(inout) :: plan
        integer :: g, i

        plan%n_load_case = 1
        plan%n_line = 0
        do g = size(plan%group), plan%n_design_group + 1, -1
            do i = 1, size(plan%group(g)%axis)
                associate (spec => plan%axis(plan%group(g)%axis(i))%spec)
                    if (spec%kind /= axis_coordinate .and. spec%kind /= axis_time) cycle
                    if (spec%sampling == sampling_linspace .or. spec%sampling == sampling_values) &
                        plan%n_line = capped(plan%n_load_case, plan%group(g)%n)
                    return
                end associate
            end do
            plan%n_load_case = capped(plan%n_load_case, plan%group(g)%n)
        end do
    end subroutine measure_lines

    pure integer(int64) function capped(a, b)
        integer(int64), intent(in) :: a, b

        capped = too_many + 1
        if (a <= too_many/b) capped = a*b
    end function capped

    !> Which samples a chunk holds; chunks do not reach from one design into the next.
    pure subroutine samples_of_chunk(plan, chunk, design, first, n)
        type(sweep_plan), intent(in) :: plan
        integer(int64), intent(in) :: chunk                !! from 0
        integer(int64), intent(out) :: design              !! from 0
        integer(int64), intent(out) :: first               !! sample, from 0
        integer, intent(out) :: n
        integer(int64) :: pose

        design = chunk/plan%n_chunk_design
        pose = (chunk - design*plan%n_chunk_design)*plan%chunk
        first = design*plan%n_pose + pose
        n = int(min(plan%chunk, plan%n_pose - pose))
    end subroutine samples_of_chunk

    !> Values of all axes at samples that follow each other, and the place of each sample along every group.
    pure subroutine axis_columns(plan, first, n, place, value)
        type(sweep_plan), intent(in) :: plan
        integer(int64), intent(in) :: first                !! sample, from 0
        integer, intent(in) :: n                           !! samples
        integer(int64), contiguous, intent(inout) :: place(:, :)   !! from 0 (sample, group)
        real(wp), contiguous, intent(inout) :: value(:, :)         !! (sample, axis)
        integer(int64) :: run
        integer :: g, i, s

        run = 1                                            ! samples at one place of the group
        do g = size(plan%group), 1, -1
            if (run >= long_run) then
                call stay_along(plan%group(g), plan%axis, run, first, n, place(:, g), value)
            else
                call walk_along(plan%group(g)%n, run, first, place(:n, g))
                do i = 1, size(plan%group(g)%axis)
                    associate (axis => plan%axis(plan%group(g)%axis(i)), column => value(:, plan%group(g)%axis(i)))
                        if (allocated(axis%table)) then
                            column(:n) = axis%table(place(:n, g) + 1)
                        else
                            do s = 1, n
                                column(s) = axis_value(axis, place(s, g))
                            end do
                        end if
                    end associate
                end do
            end if
            run = run*plan%group(g)%n
        end do
    end subroutine axis_columns

    !> Places of samples along a group of n values that stays at each for a run of samples.
    pure subroutine walk_along(n, run, first, place)
        integer(int64), intent(in) :: n, run
        integer(int64), intent(in) :: first                !! sample, from 0
        integer(int64), contiguous, intent(inout) :: place(:)      !! from 0 (sample)
        integer(int64) :: here, left
        integer :: s

        here = modulo(first/run, n)
        left = run - modulo(first, run)                    ! samples until the next place
        do s = 1, size(place)
            place(s) = here
            left = left - 1
            if (left > 0) cycle
            left = run
            here = merge(0_int64, here + 1, here + 1 == n)
        end do
    end subroutine walk_along

    !> The same of long runs, with the values of the group's axes, each found and filled in once a run.
    pure subroutine stay_along(group, axes, run, first, n_sample, place, value)
        type(group_type), intent(in) :: group
        type(axis_type), intent(in) :: axes(:)
        integer(int64), intent(in) :: run
        integer(int64), intent(in) :: first                !! sample, from 0
        integer, intent(in) :: n_sample
        integer(int64), contiguous, intent(inout) :: place(:)      !! from 0 (sample)
        real(wp), contiguous, intent(inout) :: value(:, :)         !! (sample, axis)
        integer(int64) :: here, left
        integer :: i, s, last

        here = modulo(first/run, group%n)
        left = run - modulo(first, run)                    ! samples until the next place
        last = 0
        do while (last < n_sample)
            s = last + 1
            last = int(min(int(n_sample, int64), last + left))
            place(s:last) = here
            do i = 1, size(group%axis)
                associate (axis => axes(group%axis(i)))
                    if (allocated(axis%table)) then
                        value(s:last, group%axis(i)) = axis%table(here + 1)
                    else
                        value(s:last, group%axis(i)) = axis_value(axis, here)
                    end if
                end associate
            end do
            left = run
            here = merge(0_int64, here + 1, here + 1 == group%n)
        end do
    end subroutine stay_along

    !> Values of all axes at a sample.
    pure function axis_values(plan, sample) result(value)
        type(sweep_plan), intent(in) :: plan
        integer(int64), intent(in) :: sample               !! from 0
        real(wp) :: value(size(plan%axis))
        integer(int64) :: place(1, size(plan%group))
        real(wp) :: column(1, size(plan%axis))

        call axis_columns(plan, sample, 1, place, column)
        value = column(1, :)
    end function axis_values

    !> One value of an axis.
    pure real(wp) function axis_value(axis, number) result(value)
        type(axis_type), intent(in) :: axis
        integer(int64), intent(in) :: number               !! from 0
        real(wp) :: share

        associate (spec => axis%spec)
            select case (spec%sampling)
            case (sampling_values)
                value = spec%value(number + 1)
                return
            case (sampling_linspace)
                share = 0
                if (spec%n > 1) share = real(number, wp)/real(spec%n - 1, wp)
                value = spec%from + (spec%to - spec%from)*share
                if (number > 0 .and. number == spec%n - 1) value = spec%to
                return
            case (sampling_sobol)
                share = sobol_point(axis%direction, number, axis%shift)
            case (sampling_latin)
                share = latin_point(spec%seed, spec%dimension, spec%n, number)
            case default
                share = random_point(spec%seed, spec%dimension, number)
            end select
            value = spec%from + (spec%to - spec%from)*share
        end associate
    end function axis_value
end module linkdyn_sweep_plan
