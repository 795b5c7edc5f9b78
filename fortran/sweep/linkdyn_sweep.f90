!> A sweep on its way: chunks computed by any number of threads (or by other processes), joined in their order.
module linkdyn_sweep
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_clearance, only: have_gaps
    use linkdyn_constants, only: golden
    use linkdyn_dense, only: hold_blas_threads, release_blas_threads
    use linkdyn_equation_kernels, only: found_family, end_family
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, put_file_first, has_limits
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_sweep_chunk, only: reduce_chunk, kept_chunk, ready_design
    use linkdyn_sweep_design, only: sweep_design, open_design, close_design
    use linkdyn_sweep_map, only: sweep_map, make_map, join_part
    use linkdyn_sweep_plan, only: sweep_plan, make_sweep_plan, samples_of_chunk, too_many
    use linkdyn_sweep_quantities, only: quantity_row, make_row
    use linkdyn_sweep_source, only: design_source
    use linkdyn_sweep_spec, only: sweep_spec, quantity_name, quantity_driving_power, quantity_determinant, quantity_swing, &
        quantity_motor_torque, quantity_motor_speed, quantity_motor_power, quantity_motor_current, &
        quantity_torque_margin, &
        quantity_clearance, quantity_force_amplification, quantity_moment_amplification
    use linkdyn_sweep_totals, only: totals_type, totals_shape, bins_type, empty_totals, join_totals, first_bound
    use linkdyn_text, only: quoted
    use linkdyn_threads, only: team_size
    implicit none (type, external)
    private
    public :: sweep_run, start_sweep, compute_chunks, join_chunks, close_designs, finish_sweep

    integer, parameter :: coarse_spots = 64, coarse_length = 64   !! of the pass that sets the histograms' bins
    integer, parameter :: coarse_designs = 16

    type :: sweep_run
        type(scene_type) :: scene                       !! of the file
        type(sweep_spec) :: spec
        type(sweep_plan) :: plan
        type(quantity_row) :: row
        type(totals_shape) :: shape
        type(bins_type) :: bins
        type(sweep_map) :: map
        class(design_source), allocatable :: source
        integer :: solver = 0                           !! one of `solver_*`
        integer, allocatable :: keep(:)                 !! entries kept of every sample
        real(wp) :: length = 0                          !! characteristic, of the first design [m]; 0: not needed
        type(totals_type), allocatable :: total(:)      !! (n_design)
        integer(int64) :: n_done = 0                    !! chunks joined
        type(status_type) :: bad_design                 !! why the first design that is no mechanism is none
        integer(int64) :: first_bad = -1                !! its number, from 0
        type(sweep_design), pointer :: design(:) => null()   !! one a thread
    end type sweep_run

contains

    !> Plan everything, and check that the sweep can be computed.
    subroutine start_sweep(scene, source, solver, run, status)
        type(scene_type), intent(in) :: scene
        class(design_source), intent(in) :: source
        integer, intent(in) :: solver
        type(sweep_run), intent(out) :: run
        type(status_type), intent(inout) :: status
        integer(int64) :: k

        run%scene = scene
        run%spec = scene%sweep
        allocate (run%source, source=source)
        run%solver = solver
        if (.not. run%spec%is_given) then
            call fail(status, status_bad_input, trim(scene%file)//": the scene has no sweep (expected a table [sweep] with axes)")
            return
        end if
        call make_sweep_plan(run%spec, run%plan)
        if (run%plan%n_sample > too_many) then
            call fail(status, status_bad_input, trim(scene%file)//": the sweep has more than 4.5e15 samples "// &
                "(expected fewer: shorter axes, or sampled ones)")
            return
        end if
        call make_row(scene, run%spec, run%row)
        call refuse_lacking(run, status)
        if (.not. status%is_ok()) return
        call make_shape(run)
        allocate (run%design(1))
        associate (design => run%design(1))
            if (run%plan%n_design > 1) then
                call open_design(run%spec, run%plan, run%row, run%source, solver, 0_int64, design)
                if (design%status%is_ok()) then
                    run%source%first = design%model
                    call found_family(design%model, run%source%family)
                end if
                call close_design(design)
            end if
            call ready_design(run%spec, run%plan, run%row, run%source, solver, 0_int64, design)
            if (run%plan%n_design == 1 .and. .not. design%status%is_ok()) then
                status = design%status
                call put_file_first(scene%file, scene, status%message)
                return
            end if
        end associate
        if (run%design(1)%status%is_ok() .and. run%row%place(quantity_clearance) > 0) then
            if (.not. have_gaps(run%design(1)%measures%rod)) &
                call refuse_quantity(run, quantity_clearance, "no pair of legs without a common end (expected two legs, or "// &
                                     "'segments' in its table)", status)
        end if
        if (.not. status%is_ok()) return
        if (run%design(1)%status%is_ok() .and. run%design(1)%measures%wants_map) &
            run%length = run%design(1)%measures%map%length
        call choose_bins(run)
        call make_map(run%spec, run%plan, size(run%row%quantity), run%map)
        allocate (run%total(run%plan%n_design))
        do k = 1, run%plan%n_design
            call empty_totals(run%shape, run%total(k))
        end do
    end subroutine start_sweep

    !> Quantities that are wanted of every sample must be there.
    subroutine refuse_lacking(run, status)
        type(sweep_run), intent(in) :: run
        type(status_type), intent(inout) :: status
        integer, parameter :: amplification(2) = [quantity_force_amplification, quantity_moment_amplification]
        integer, parameter :: of_motors(5) = [quantity_motor_torque, quantity_motor_speed, quantity_motor_power, &
                                            quantity_motor_current, quantity_torque_margin]
        integer :: i

        associate (place => run%row%place)
            do i = 1, size(of_motors)
                if (place(of_motors(i)) == 0) cycle
                if (run%row%quantity(place(of_motors(i)))%n == 0) &
                    call refuse_quantity(run, of_motors(i), "no actuator with the key 'drive'", status)
            end do
            if (place(quantity_motor_current) > 0 .and. status%is_ok()) then
                if (.not. any(run%scene%actuator%motor%torque_constant > 0)) &
                    call refuse_quantity(run, quantity_motor_current, "no 'torque_constant' of a drive", status)
            end if
            if (place(quantity_torque_margin) > 0 .and. status%is_ok()) then
                if (.not. any(has_limits(run%scene%actuator%motor))) &
                    call refuse_quantity(run, quantity_torque_margin, "no limit of a drive", status)
            end if
            if (place(quantity_swing) > 0) then
                if (run%row%quantity(place(quantity_swing))%n == 0) &
                    call refuse_quantity(run, quantity_swing, "no universal or spherical joint", status)
            end if
            do i = 1, size(amplification)
                if (place(amplification(i)) > 0 .and. run%spec%tool_link == 0) call refuse_quantity(run, amplification(i), &
                    "no marker on which unit forces and moments act, [sweep] on", status)
            end do
        end associate
    end subroutine refuse_lacking

    subroutine refuse_quantity(run, id, lack, status)
        type(sweep_run), intent(in) :: run
        integer, intent(in) :: id                       !! of the quantity
        character(len=*), intent(in) :: lack
        type(status_type), intent(inout) :: status

        call fail(status, status_bad_input, trim(run%scene%file)//": the sweep has no "//quoted(quantity_name(id)) &
                  //": there is "//lack)
    end subroutine refuse_quantity

    !> What is reduced, from the wishes.
    subroutine make_shape(run)
        type(sweep_run), intent(inout) :: run
        integer :: i, k

        run%shape%n_entry = run%row%n
        run%shape%n_code = first_bound + size(run%spec%bound)
        run%shape%has_moments = .not. run%spec%extremes_only
        run%shape%n_bin = run%spec%n_bin
        allocate (run%shape%histogram_of(0), run%shape%power(0), run%keep(0))
        do i = 1, size(run%row%quantity)
            associate (quantity => run%row%quantity(i))
                if (run%spec%has_histogram(quantity%id)) run%shape%histogram_of = &
                    [run%shape%histogram_of, (quantity%first + k, k=1, quantity%n)]
                if (quantity%id == quantity_driving_power .and. run%shape%has_moments) &
                    run%shape%power = [(quantity%first + k, k=1, quantity%n)]
                if (quantity%id == quantity_determinant) run%shape%determinant = quantity%first + 1
                if (run%spec%keeps(quantity%id)) run%keep = [run%keep, (quantity%first + k, k=1, quantity%n)]
            end associate
        end do
    end subroutine make_shape

    !> Bins that the scene gives, or the range found at places spread over the sweep.
    subroutine choose_bins(run)
        type(sweep_run), intent(inout) :: run
        type(totals_type) :: found, part
        type(sweep_map) :: no_map
        type(totals_shape) :: shape
        type(kept_chunk) :: kept
        integer, parameter :: nothing(0) = 0
        real(wp) :: margin
        integer(int64) :: first, design, n_design
        integer :: i, n, spot

        n = size(run%shape%histogram_of)
        allocate (run%bins%from(n), run%bins%to(n))
        if (n == 0) return
        shape = run%shape
        shape%histogram_of = nothing
        call empty_totals(shape, found)
        n_design = min(run%plan%n_design, int(coarse_designs, int64))
        do spot = 0, coarse_spots - 1
            if (is_interrupted()) return
            design = (run%plan%n_design*modulo(spot*n_design/coarse_spots, n_design))/n_design
            n = int(min(run%plan%n_pose, int(coarse_length, int64)))
            first = int(modulo(spot*golden, 1.0_wp)*real(run%plan%n_pose - n + 1, wp), int64)
            call ready_design(run%spec, run%plan, run%row, run%source, run%solver, design, run%design(1))
            call reduce_chunk(run%spec, run%plan, run%row, shape, run%bins, no_map, nothing, design*run%plan%n_pose + first, n, &
                run%design(1), part, kept)
            call join_totals(part, 0_int64, found)
        end do
        do i = 1, size(run%shape%histogram_of)
            associate (k => run%shape%histogram_of(i), id => quantity_of(run%row, run%shape%histogram_of(i)))
                run%bins%from(i) = run%spec%bin_from(id)
                run%bins%to(i) = run%spec%bin_to(id)
                if (run%bins%to(i) > run%bins%from(i)) cycle
                run%bins%from(i) = -1
                run%bins%to(i) = 1
                if (found%low_at(k) < 0) cycle
                margin = max(0.1_wp*(found%high(k) - found%low(k)), 1.0e-3_wp*max(abs(found%high(k)), abs(found%low(k))), &
                             tiny(1.0_wp))
                run%bins%from(i) = found%low(k) - margin
                run%bins%to(i) = found%high(k) + margin
            end associate
        end do
    end subroutine choose_bins

    !> The quantity to which an entry of the row belongs.
    pure integer function quantity_of(row, entry) result(id)
        type(quantity_row), intent(in) :: row
        integer, intent(in) :: entry
        integer :: i

        id = 0
        do i = 1, size(row%quantity)
            if (entry > row%quantity(i)%first) id = row%quantity(i)%id
        end do
    end function quantity_of

    !> Compute chunks first, first + stride, ... on some threads. When the process is told to stop none of them can be used.
    subroutine compute_chunks(run, first, stride, threads, part, kept)
        type(sweep_run), intent(inout) :: run
        integer(int64), intent(in) :: first, stride     !! chunks, from 0
        integer, intent(in) :: threads
        type(totals_type), intent(inout) :: part(:)     !! of each chunk
        type(kept_chunk), intent(inout) :: kept(:)      !! likewise
        integer :: worker, next, n_worker

        n_worker = team_size(threads, size(part))
        call provide_designs(run, n_worker)
        next = 1
        call hold_blas_threads()
        !$omp parallel do num_threads(n_worker) schedule(static, 1) default(shared)
        do worker = 1, n_worker
            call work(run%design(worker))
        end do
        !$omp end parallel do
        call release_blas_threads()

    contains

        !> What one thread does: take the next chunk until there is none.
        subroutine work(design)
            type(sweep_design), intent(inout) :: design
            integer(int64) :: number, first_sample
            integer :: k, n

            do
                !$omp atomic capture
                k = next
                next = next + 1
                !$omp end atomic
                if (k > size(part) .or. is_interrupted()) exit
                call samples_of_chunk(run%plan, first + (k - 1)*stride, number, first_sample, n)
                call ready_design(run%spec, run%plan, run%row, run%source, run%solver, number, design)
                if (.not. design%status%is_ok()) call note_bad_design(design)
                call make_keeping(run, n, kept(k))
                call reduce_chunk(run%spec, run%plan, run%row, run%shape, run%bins, run%map, run%keep, first_sample, n, &
                    design, part(k), kept(k))
            end do
        end subroutine work

        subroutine note_bad_design(design)
            type(sweep_design), intent(in) :: design

            !$omp critical (linkdyn_bad_design)
            if (run%first_bad < 0 .or. design%number < run%first_bad) then
                run%first_bad = design%number
                run%bad_design = design%status
            end if
            !$omp end critical (linkdyn_bad_design)
        end subroutine note_bad_design
    end subroutine compute_chunks

    !> Room for what is kept of a chunk, if anything is.
    subroutine make_keeping(run, n, kept)
        type(sweep_run), intent(in) :: run
        integer, intent(in) :: n
        type(kept_chunk), intent(inout) :: kept

        if (.not. any(run%spec%keeps)) return
        kept%n = n
        if (allocated(kept%code)) return
        allocate (kept%code(run%plan%chunk), kept%axis(size(run%plan%axis), run%plan%chunk), &
                  kept%value(size(run%keep), run%plan%chunk))
    end subroutine make_keeping

    !> Scratch for so many threads. A single design is planned once for all of them.
    subroutine provide_designs(run, n)
        type(sweep_run), intent(inout) :: run
        integer, intent(in) :: n
        integer :: i

        if (associated(run%design)) then
            if (size(run%design) >= n) return
            call close_designs(run)
        end if
        allocate (run%design(n))
        if (run%plan%n_design > 1) return
        call ready_design(run%spec, run%plan, run%row, run%source, run%solver, 0_int64, run%design(1))
        do i = 2, n
            call open_design(run%spec, run%plan, run%row, run%source, run%solver, 0_int64, run%design(i), like=run%design(1))
        end do
    end subroutine provide_designs

    !> Add the chunks that follow what has been joined.
    subroutine join_chunks(run, part, kept)
        type(sweep_run), intent(inout) :: run
        type(totals_type), intent(in) :: part(:)        !! in order
        type(kept_chunk), intent(in) :: kept(:)         !! their share of the map
        integer(int64) :: design
        integer :: k

        do k = 1, size(part)
            design = run%n_done/run%plan%n_chunk_design + 1
            call join_totals(part(k), run%plan%n_line, run%total(design))
            call join_part(kept(k)%map, run%map)
            run%n_done = run%n_done + 1
        end do
    end subroutine join_chunks

    !> Give everything back.
    subroutine finish_sweep(run)
        type(sweep_run), intent(inout) :: run

        call close_designs(run)
        if (.not. allocated(run%source)) return
        call end_family(run%source%family)
        call run%source%free()
    end subroutine finish_sweep

    !> Give the designs' scratch back: those that come are planned anew.
    subroutine close_designs(run)
        type(sweep_run), intent(inout) :: run
        integer :: i

        if (.not. associated(run%design)) return
        do i = 1, size(run%design)
            call close_design(run%design(i))
        end do
        deallocate (run%design)
        nullify (run%design)
    end subroutine close_designs
end module linkdyn_sweep
