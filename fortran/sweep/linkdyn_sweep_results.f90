!> The results of a sweep, described once for netCDF files and Python: docs/sweep.md lists them.
module linkdyn_sweep_results
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_code, only: code_in_use
    use linkdyn_dataset, only: dataset_type, sample_variable, find_dimension, add_dimension, &
        add_reals, add_integers, add_texts, add_attribute, text_len
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_sweep, only: sweep_run
    use linkdyn_sweep_chunk, only: ready_design, look_at_samples
    use linkdyn_sweep_design, only: sweep_design, close_design
    use linkdyn_sweep_map, only: is_least
    use linkdyn_sweep_plan, only: axis_values
    use linkdyn_sweep_quantities, only: quantity_type
    use linkdyn_sweep_spec, only: axis_coordinate, axis_parameter, quantity_name, quantity_force_amplification, &
        quantity_moment_amplification, quantity_determinant, sampling_name
    use linkdyn_sweep_totals, only: fixed_outcome, first_bound
    implicit none (type, external)
    private
    public :: sweep_dataset, kept_variables, code_names

    integer, parameter :: code_len = 128

contains

    !> Everything but the kept samples.
    subroutine sweep_dataset(run, dataset)
        type(sweep_run), intent(in) :: run
        type(dataset_type), intent(out) :: dataset
        character(len=:), allocatable :: by_design
        integer :: i

        by_design = ""
        if (has_designs(run)) by_design = "design "
        call add_dimension(dataset, "axis", size(run%plan%axis))
        call add_axes(run, dataset)
        if (has_designs(run)) call add_designs(run, dataset)
        call add_counts(run, by_design, dataset)
        if (size(run%spec%bound) > 0) call add_bounds(run, dataset)
        do i = 1, size(run%row%quantity)
            call add_quantity(run, run%row%quantity(i), by_design, dataset)
        end do
        if (size(run%shape%power) > 0) call add_regeneration(run, by_design, dataset)
        if (run%row%place(quantity_force_amplification) > 0) call add_directions(run, &
            run%row%quantity(run%row%place(quantity_force_amplification)), 0, "force", by_design, dataset)
        if (run%row%place(quantity_moment_amplification) > 0) call add_directions(run, &
            run%row%quantity(run%row%place(quantity_moment_amplification)), 3, "moment", by_design, dataset)
        if (run%map%is_wanted) call add_map(run, by_design, dataset)
        call add_attribute(dataset, "chunk", value=[real(run%plan%chunk, wp)])
        call add_attribute(dataset, "lanes", value=[real(lanes, wp)])
        call add_attribute(dataset, "machine_code", text=code_in_use())
        if (run%spec%tool_link > 0) call add_attribute(dataset, "tool", text=trim(run%spec%tool))
        if (run%length > 0) call add_attribute(dataset, "characteristic_length", value=[run%length])
    end subroutine sweep_dataset

    !> The variables of a kept sample, in the order of its values: outcome, axes, quantities.
    subroutine kept_variables(run, dataset, variable)
        type(sweep_run), intent(in) :: run
        type(dataset_type), intent(in) :: dataset
        type(sample_variable), allocatable, intent(out) :: variable(:)
        integer :: i, k, n

        allocate (variable(2 + count(run%spec%keeps)))
        variable(1)%name = "sample_outcome"
        variable(1)%long_name = "outcome of the sample: number, from 0, along the dimension outcome"
        variable(1)%units = "1"
        variable(1)%is_integer = .true.
        allocate (variable(1)%dim(0))
        variable(2)%name = "sample_axis"
        variable(2)%long_name = "values of the axes"
        variable(2)%coordinates = "axis_unit"
        variable(2)%dim = [find_dimension(dataset, "axis")]
        variable(2)%width = size(run%plan%axis)
        n = 2
        do i = 1, size(run%row%quantity)
            associate (quantity => run%row%quantity(i))
                if (.not. run%spec%keeps(quantity%id)) cycle
                n = n + 1
                variable(n)%name = quantity_name(quantity%id)
                variable(n)%long_name = quantity%long_name
                allocate (variable(n)%dim(quantity%n_dim))
                do k = 1, quantity%n_dim
                    variable(n)%dim(k) = find_dimension(dataset, trim(quantity%dim(k)))
                end do
                variable(n)%width = quantity%n
                if (all(quantity%unit == quantity%unit(1))) then
                    variable(n)%units = quantity%unit(1)
                else
                    variable(n)%coordinates = trim(variable(n)%name)//"_unit"
                end if
            end associate
        end do
    end subroutine kept_variables

    pure logical function has_designs(run)
        type(sweep_run), intent(in) :: run

        has_designs = run%plan%n_design_group > 0
    end function has_designs

    !> What was swept.
    subroutine add_axes(run, dataset)
        type(sweep_run), intent(in) :: run
        type(dataset_type), intent(inout) :: dataset
        integer :: i
        real(wp) :: low(size(run%plan%axis)), high(size(run%plan%axis))

        associate (axis => run%plan%axis%spec)
            do i = 1, size(axis)
                low(i) = min(axis(i)%from, axis(i)%to)
                high(i) = max(axis(i)%from, axis(i)%to)
                if (.not. allocated(axis(i)%value)) cycle
                low(i) = minval(axis(i)%value)
                high(i) = maxval(axis(i)%value)
            end do
            call add_texts(dataset, "axis", "axis", axis%name)
            call add_texts(dataset, "axis_unit", "axis", axis%unit)
            call add_texts(dataset, "axis_sampling", "axis", sampling_name(axis%sampling))
            call add_integers(dataset, "axis_size", "axis", axis%n, "values of the axis")
            call add_integers(dataset, "axis_group", "axis", int(axis%group, int64), "axes of one group advance together")
            call add_reals(dataset, "axis_low", "axis", low, "lower end of the axis", "", "axis_unit")
            call add_reals(dataset, "axis_high", "axis", high, "upper end of the axis", "", "axis_unit")
        end associate
    end subroutine add_axes

    subroutine add_designs(run, dataset)
        type(sweep_run), intent(in) :: run
        type(dataset_type), intent(inout) :: dataset
        integer, allocatable :: parameter(:)
        real(wp), allocatable :: value(:)
        integer(int64) :: d
        integer :: i

        parameter = pack([(i, i=1, size(run%plan%axis))], run%plan%axis%spec%kind == axis_parameter)
        call add_dimension(dataset, "design", int(run%plan%n_design))
        call add_dimension(dataset, "parameter", size(parameter))
        call add_texts(dataset, "parameter", "parameter", run%plan%axis(parameter)%spec%name)
        call add_texts(dataset, "parameter_unit", "parameter", run%plan%axis(parameter)%spec%unit)
        allocate (value(size(parameter)*int(run%plan%n_design)))
        do d = 0, run%plan%n_design - 1
            value(d*size(parameter) + 1:(d + 1)*size(parameter)) = pick(axis_values(run%plan, d*run%plan%n_pose), parameter)
        end do
        call add_reals(dataset, "design_value", "design parameter", value, "values of the parameters", "", "parameter_unit")
    end subroutine add_designs

    pure function pick(values, which) result(picked)
        real(wp), intent(in) :: values(:)
        integer, intent(in) :: which(:)
        real(wp) :: picked(size(which))

        picked = values(which)
    end function pick

    !> Names of the outcomes of a sample: feasible, what failed, which bound was not kept.
    function code_names(run) result(name)
        type(sweep_run), intent(in) :: run
        character(len=code_len), allocatable :: name(:)
        integer :: i

        allocate (name(0:run%shape%n_code - 1))
        name(:first_bound - 1) = fixed_outcome
        do i = 1, size(run%spec%bound)
            name(first_bound + i - 1) = run%spec%bound(i)%name
        end do
    end function code_names

    !> How many samples, how many of them feasible, why the others are not.
    subroutine add_counts(run, by_design, dataset)
        type(sweep_run), intent(in) :: run
        character(len=*), intent(in) :: by_design
        type(dataset_type), intent(inout) :: dataset
        integer(int64), allocatable :: n_code(:)
        integer :: d
        real(wp) :: volume
        integer :: i

        call add_dimension(dataset, "outcome", run%shape%n_code)
        call add_texts(dataset, "outcome", "outcome", code_names(run))
        allocate (n_code(run%shape%n_code*size(run%total)))
        do d = 1, size(run%total)
            n_code((d - 1)*run%shape%n_code + 1:d*run%shape%n_code) = run%total(d)%n_code
        end do
        call add_integers(dataset, "samples", by_design, run%total%n_sample, "samples")
        call add_integers(dataset, "samples_reduced", by_design, run%total%n_reduced, &
            "samples that entered the reductions: those within all constraints, limits or not")
        call add_integers(dataset, "outcome_count", by_design//"outcome", n_code, "samples by outcome")
        call add_reals(dataset, "feasible_fraction", by_design, [(real(run%total(d)%n_code(0), wp) &
            /real(max(run%total(d)%n_sample, 1_int64), wp), d=1, size(run%total))], "share of feasible samples", "1")
        volume = 1
        d = 0
        do i = 1, size(run%plan%axis)
            associate (axis => run%plan%axis(i)%spec)
                if (axis%kind /= axis_coordinate .or. axis%unit /= "m" .or. allocated(axis%value)) cycle
                volume = volume*abs(axis%to - axis%from)
                d = d + 1
            end associate
        end do
        if (d > 0) then
            call add_reals(dataset, "swept_volume", "", [volume], "product of the ranges of the coordinates that are lengths", &
                merge("m ", merge("m2", "m3", d == 2), d == 1))
            call add_reals(dataset, "feasible_volume", by_design, [(volume*run%total(i)%n_code(0) &
                /real(max(run%total(i)%n_sample, 1_int64), wp), i=1, size(run%total))], &
                "feasible share of the swept volume", merge("m ", merge("m2", "m3", d == 2), d == 1))
        end if
        if (run%row%place(quantity_determinant) == 0 .or. run%plan%n_line == 0) return
        call add_integers(dataset, "sign_changes", by_design, run%total%n_crossing, &
            "changes of the determinant's sign from one sample to the next along the fastest axis that moves links")
        call add_integers(dataset, "sign_change_sample", by_design, run%total%first_crossing, &
            "sample behind the first change of sign, from 0; -1: none")
    end subroutine add_counts

    !> Constraints and limits as the scene gives them: what results are measured against.
    subroutine add_bounds(run, dataset)
        type(sweep_run), intent(in) :: run
        type(dataset_type), intent(inout) :: dataset
        character(len=text_len) :: at(size(run%spec%bound))
        character(len=code_len) :: unit(size(run%spec%bound))
        real(wp) :: low(size(run%spec%bound)), high(size(run%spec%bound))
        integer :: i, k

        do i = 1, size(run%spec%bound)
            at(i) = ""
            associate (bound => run%spec%bound(i), quantity => run%row%quantity(run%row%place(run%spec%bound(i)%quantity)))
                do k = 1, merge(0, size(bound%entry), size(bound%entry) == quantity%n)
                    at(i) = trim(at(i))//", "//quantity%label(bound%entry(k))
                end do
                at(i) = at(i)(3:)
                unit(i) = quantity%unit(bound%entry(1))
                low(i) = merge(bound%low, nan(), bound%low > -huge(1.0_wp))
                high(i) = merge(bound%high, nan(), bound%high < huge(1.0_wp))
            end associate
        end do
        call add_dimension(dataset, "bound", size(run%spec%bound))
        call add_texts(dataset, "bound", "bound", run%spec%bound%name)
        call add_texts(dataset, "bound_of", "bound", quantity_name(run%spec%bound%quantity))
        call add_texts(dataset, "bound_at", "bound", at)
        call add_texts(dataset, "bound_unit", "bound", unit)
        call add_integers(dataset, "bound_is_limit", "bound", merge(1_int64, 0_int64, run%spec%bound%is_limit), &
            "1: a limit, poses beyond it are reduced; 0: a constraint, they are not")
        call add_reals(dataset, "bound_min", "bound", low, "smallest value allowed, NaN: open", "", "bound_unit")
        call add_reals(dataset, "bound_max", "bound", high, "largest value allowed, NaN: open", "", "bound_unit")
    end subroutine add_bounds

    !> Extremes with their places, moments, histogram of one quantity.
    subroutine add_quantity(run, quantity, by_design, dataset)
        type(sweep_run), intent(in) :: run
        type(quantity_type), intent(in) :: quantity
        character(len=*), intent(in) :: by_design
        type(dataset_type), intent(inout) :: dataset
        character(len=:), allocatable :: dims, name, units, companions, meaning
        real(wp), allocatable :: low(:), high(:), mean(:), rms(:), low_axis(:), high_axis(:)
        integer(int64), allocatable :: low_at(:), high_at(:)
        real(wp) :: n
        integer :: d, i, k, total

        name = trim(quantity_name(quantity%id))
        meaning = trim(quantity%long_name)
        call add_labels(quantity, name, dataset, dims, units, companions)
        dims = by_design//dims
        total = quantity%n*size(run%total)
        allocate (low(total), high(total), mean(total), rms(total), low_at(total), high_at(total), &
                  low_axis(0), high_axis(0))
        i = 0
        do d = 1, size(run%total)
            associate (totals => run%total(d))
                n = real(totals%n_reduced, wp)
                do k = quantity%first + 1, quantity%first + quantity%n
                    i = i + 1
                    low(i) = totals%low(k)
                    high(i) = totals%high(k)
                    low_at(i) = totals%low_at(k)
                    high_at(i) = totals%high_at(k)
                    if (low_at(i) < 0) low(i) = nan()
                    if (high_at(i) < 0) high(i) = nan()
                    if (.not. run%shape%has_moments) cycle
                    mean(i) = nan()
                    rms(i) = nan()
                    if (.not. n > 0) cycle
                    mean(i) = (totals%sum(k) + totals%sum_rest(k))/n
                    rms(i) = sqrt((totals%square(k) + totals%square_rest(k))/n)
                end do
            end associate
        end do
        low_axis = values_at(run, low_at)
        high_axis = values_at(run, high_at)
        call add_reals(dataset, name//"_min", dims, low, "smallest "//meaning, units, companions)
        call add_reals(dataset, name//"_max", dims, high, "largest "//meaning, units, companions)
        call add_integers(dataset, name//"_min_sample", dims, low_at, "sample of the smallest, from 0; -1: none")
        call add_integers(dataset, name//"_max_sample", dims, high_at, "sample of the largest, from 0; -1: none")
        call add_reals(dataset, name//"_min_at", dims//" axis", low_axis, "values of the axes at the smallest", "", "axis_unit")
        call add_reals(dataset, name//"_max_at", dims//" axis", high_axis, "values of the axes at the largest", "", "axis_unit")
        if (run%shape%has_moments) then
            call add_reals(dataset, name//"_mean", dims, mean, "mean "//meaning, units, companions)
            call add_reals(dataset, name//"_rms", dims, rms, "root mean square of "//meaning, units, companions)
        end if
        if (run%spec%has_histogram(quantity%id)) call add_histogram(run, quantity, name, by_design, dataset)
    end subroutine add_quantity

    !> Dimensions of a quantity with their labels and units.
    subroutine add_labels(quantity, name, dataset, dims, units, companions)
        type(quantity_type), intent(in) :: quantity
        character(len=*), intent(in) :: name
        type(dataset_type), intent(inout) :: dataset
        character(len=:), allocatable, intent(out) :: dims, units, companions
        integer :: i, n_before

        dims = ""
        units = ""
        companions = ""
        do i = 1, quantity%n_dim
            n_before = size(dataset%dimension)
            call add_dimension(dataset, trim(quantity%dim(i)), quantity%size(i))
            dims = dims//trim(quantity%dim(i))//" "
            if (size(dataset%dimension) == n_before) cycle
            call add_texts(dataset, trim(quantity%dim(i)), trim(quantity%dim(i)), labels_of(quantity, i))
        end do
        dims = trim(dims)
        if (quantity%n == 0) return
        units = trim(quantity%unit(1))
        if (all(quantity%unit == quantity%unit(1))) return
        ! Units that differ stand beside the entries.
        units = ""
        companions = name//"_unit"
        if (quantity%n_dim == 2) then
            call add_texts(dataset, companions, trim(quantity%dim(2)), quantity%unit(:quantity%size(2)))
        else
            call add_texts(dataset, companions, dims, quantity%unit)
        end if
    end subroutine add_labels

    !> Labels of one dimension: those of a second one stand behind a blank.
    pure function labels_of(quantity, dim) result(label)
        type(quantity_type), intent(in) :: quantity
        integer, intent(in) :: dim
        character(len=len(quantity%label)) :: label(quantity%size(dim))
        integer :: i

        do i = 1, size(label)
            if (quantity%n_dim == 1) then
                label(i) = quantity%label(i)
            else if (dim == 1) then
                label(i) = quantity%label((i - 1)*quantity%size(2) + 1)
                label(i) = label(i)(:index(trim(label(i)), " ", back=.true.) - 1)
            else
                label(i) = quantity%label(i)
                label(i) = label(i)(index(trim(label(i)), " ", back=.true.) + 1:)
            end if
        end do
    end function labels_of

    !> Values of all axes at some samples; NaN where there is none.
    function values_at(run, sample) result(value)
        type(sweep_run), intent(in) :: run
        integer(int64), intent(in) :: sample(:)
        real(wp), allocatable :: value(:)
        integer :: i, n

        n = size(run%plan%axis)
        allocate (value(n*size(sample)))
        value = nan()
        do i = 1, size(sample)
            if (sample(i) >= 0) value((i - 1)*n + 1:i*n) = axis_values(run%plan, sample(i))
        end do
    end function values_at

    subroutine add_histogram(run, quantity, name, by_design, dataset)
        type(sweep_run), intent(in) :: run
        type(quantity_type), intent(in) :: quantity
        character(len=*), intent(in) :: name, by_design
        type(dataset_type), intent(inout) :: dataset
        real(wp), allocatable :: edge(:)
        integer(int64), allocatable :: n(:), outside(:)
        character(len=:), allocatable :: dims, units
        integer :: i, k, d, first

        first = findloc(run%shape%histogram_of, quantity%first + 1, dim=1) - 1
        call add_dimension(dataset, "bin", run%spec%n_bin)
        call add_dimension(dataset, "bin_edge", run%spec%n_bin + 1)
        call add_dimension(dataset, "side", 2)
        allocate (edge(0), n(0), outside(0))
        do k = first + 1, first + quantity%n
            edge = [edge, (run%bins%from(k) + (run%bins%to(k) - run%bins%from(k))*(real(i, wp)/run%spec%n_bin), &
                i=0, run%spec%n_bin)]
        end do
        do d = 1, size(run%total)
            do k = first + 1, first + quantity%n
                associate (h => run%total(d)%histogram(:, k))
                    n = [n, h(2:run%spec%n_bin + 1)]
                    outside = [outside, h(1), h(run%spec%n_bin + 2)]
                end associate
            end do
        end do
        dims = ""
        do i = 1, quantity%n_dim
            dims = dims//trim(quantity%dim(i))//" "
        end do
        units = trim(quantity%unit(1))
        if (any(quantity%unit /= units)) units = ""
        call add_reals(dataset, name//"_bin_edge", dims//"bin_edge", edge, "edges of the bins, "// &
            trim(merge("as given                ", "from a first coarse pass", run%spec%bin_to(quantity%id) > &
            run%spec%bin_from(quantity%id))), units)
        call add_integers(dataset, name//"_histogram", by_design//dims//"bin", n, "samples in each bin")
        call add_integers(dataset, name//"_outside", by_design//dims//"side", outside, "samples below the bins and above them")
    end subroutine add_histogram

    !> The worst of every quantity in each cell, and the share of feasible samples. Dimensions bear the names of the axes.
    subroutine add_map(run, by_design, dataset)
        type(sweep_run), intent(in) :: run
        character(len=*), intent(in) :: by_design
        type(dataset_type), intent(inout) :: dataset
        character(len=:), allocatable :: dims, units
        real(wp), allocatable :: worst(:)
        integer :: i, k

        dims = by_design
        do i = 1, size(run%map%axis)
            associate (axis => run%plan%axis(run%map%axis(i)))
                call add_dimension(dataset, map_name(axis%spec%name), int(axis%spec%n))
                dims = dims//map_name(axis%spec%name)//" "
                call add_reals(dataset, map_name(axis%spec%name), map_name(axis%spec%name), axis%table, &
                    trim(axis%spec%name), trim(axis%spec%unit))
            end associate
        end do
        call add_reals(dataset, "map_feasible_fraction", dims, real(run%map%n_feasible, wp) &
            /(real(run%plan%n_pose, wp)/real(run%map%n_cell, wp)), "share of feasible samples in the cell", "1")
        do i = 1, size(run%row%quantity)
            associate (quantity => run%row%quantity(i))
                worst = run%map%worst(i, :)
                do k = 1, size(worst)
                    if (worst(k) < -0.5_wp*huge(1.0_wp)) worst(k) = nan()
                end do
                if (is_least(quantity%id)) worst = -worst
                units = trim(quantity%unit(1))
                if (any(quantity%unit /= quantity%unit(1))) units = ""
                call add_reals(dataset, "map_"//trim(quantity_name(quantity%id)), dims, worst, trim(merge("least  ", &
                    "largest", is_least(quantity%id)))//" magnitude in the cell: "//trim(quantity%long_name), units)
            end associate
        end do
    end subroutine add_map

    !> The name of an axis as that of a dimension: in one word.
    pure function map_name(name) result(word)
        character(len=*), intent(in) :: name
        character(len=len_trim(name)) :: word
        integer :: i

        word = name
        do i = 1, len(word)
            if (scan(word(i:i), " /") > 0) word(i:i) = "_"
        end do
    end function map_name

    !> How much of the power that goes through an actuator comes back.
    subroutine add_regeneration(run, by_design, dataset)
        type(sweep_run), intent(in) :: run
        character(len=*), intent(in) :: by_design
        type(dataset_type), intent(inout) :: dataset
        real(wp), allocatable :: share(:)
        real(wp) :: gain, total, back
        integer :: d, i, k

        allocate (share(size(run%shape%power)*size(run%total)))
        k = 0
        do d = 1, size(run%total)
            associate (totals => run%total(d))
                do i = 1, size(run%shape%power)
                    gain = totals%gain(i) + totals%gain_rest(i)
                    total = totals%sum(run%shape%power(i)) + totals%sum_rest(run%shape%power(i))
                    back = gain - total
                    k = k + 1
                    share(k) = 0
                    if (gain + back > 0) share(k) = back/(gain + back)
                end do
            end associate
        end do
        call add_reals(dataset, "regenerative_share", by_design//"actuator", share, &
            "power that comes back over all power that passes, either way", "1")
    end subroutine add_regeneration

    !> The worst load: direction of the unit wrench at the largest amplification, by a second look at that sample.
    subroutine add_directions(run, quantity, first_component, what, by_design, dataset)
        type(sweep_run), intent(in) :: run
        type(quantity_type), intent(in) :: quantity
        integer, intent(in) :: first_component             !! 0: force, 3: moment
        character(len=*), intent(in) :: what, by_design
        type(dataset_type), intent(inout) :: dataset
        type(sweep_design) :: design
        real(wp), allocatable :: direction(:)
        real(wp) :: row(3)
        integer(int64) :: sample
        integer :: d, k, place

        call add_dimension(dataset, "direction", 3)
        if (first_component == 0 .or. run%row%place(quantity_force_amplification) == 0) &
            call add_texts(dataset, "direction", "direction", ["x", "y", "z"])
        allocate (direction(3*quantity%n*size(run%total)))
        place = 0
        do d = 1, size(run%total)
            do k = 1, quantity%n
                sample = run%total(d)%high_at(quantity%first + k)
                row = nan()
                if (sample >= 0) then
                    call ready_design(run%spec, run%plan, run%row, run%source, run%solver, sample/run%plan%n_pose, design)
                    call look_at_samples(run%spec, run%plan, run%row, sample, 1, design)
                    row = design%measures%force(1, k, first_component + 1:first_component + 3)
                    row = row/norm2(row)
                end if
                direction(place + 1:place + 3) = row
                place = place + 3
            end do
        end do
        call close_design(design)
        call add_reals(dataset, what//"_amplification_direction", by_design//"actuator direction", direction, &
            "unit "//what//" on the tool that asks the largest driving force, world axes; its opposite asks the opposite", "1")
    end subroutine add_directions

    real(wp) function nan()
        nan = ieee_value(1.0_wp, ieee_quiet_nan)
    end function nan
end module linkdyn_sweep_results
