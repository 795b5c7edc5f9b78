!> Batches by the record of their scene: whether one is worth while, found or made, believed, run.
!>
!> A solver keeps one record for each choice of results, where nothing but results of the catalogue is asked for. It runs straight
!> from and into the caller's arrays; samples at which it raises its alarm are left to the lanes. A motion is followed by a record
!> of its own, of the margins, which `follow_assembly` knows as a `margin_source`.
submodule (linkdyn_inverse) linkdyn_inverse_records
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_agreement, only: agreement, are_alike
    use linkdyn_assembly_trail, only: judges_like_lanes
    use linkdyn_base_motion, only: base_size, evaluate_base
    use linkdyn_result_kinds, only: result_driving_force, result_power_imbalance, result_position, result_rotation
    use linkdyn_constants, only: golden, least_accuracy
    use linkdyn_equations, only: build_given_equations, free_equations
    use linkdyn_inputs, only: in_q, in_qd, in_qdd, in_load, in_branch, in_place, in_pull, in_base, in_payload
    use linkdyn_inverse_results, only: list_results, clear_measures
    use linkdyn_lock, only: hold_records, release_records
    use linkdyn_model, only: scene_size
    use linkdyn_newton_group, only: sizes_away
    use linkdyn_payloads, only: evaluate_payloads
    use linkdyn_recorded_forces, only: record_forces, run_recorded
    use linkdyn_recorded_margins, only: of_margins
    use linkdyn_representatives, only: need_poses, make_closer, few_links, is_worth_own_record
    use linkdyn_samples, only: sample_arrays, result_list, set_block
    use linkdyn_status, only: sample_singular, sample_ok
    use linkdyn_uncertainty, only: is_surely_certain
    implicit none (type, external)

contains

    module procedure place_by_record
        type(recorded_forces), pointer :: recorded
        type(recorded_margins), target :: by_record
        class(margin_source), pointer :: margins
        class(group_closer), pointer :: closer
        real(wp), target :: load(6, model%n_load, 1)
        real(wp), allocatable, target :: at_rest(:, :)
        type(motion_batch) :: motion
        integer :: n, i, n_left

        n = size(q, 2)
        nullify (recorded, margins, closer)
        if (associated(solver%places%closing) .and. max(n, solver%n_expected) >= worth_closing) &
            call need_closer(model, solver, q, closer)
        if (associated(solver%records)) then
            call need_record(model, solver, results, q, recorded)
            if (present(trail)) call need_margins(model, solver, q, by_record%record)
            if (associated(by_record%record)) margins => by_record
        end if
        if (has_assemblies(model)) then
            if (present(trail)) then
                call follow_assembly(model, q, trail, assembly, margins, closer)
            else if (associated(closer)) then
                call settle_samples(model, 1, q, assembly, closer, solver%places%nodes)
            else
                call make_room(model, n, assembly)
            end if
        end if
        if (associated(recorded)) then
            load = 0
            allocate (at_rest(size(q, 1), n), source=0.0_wp)
            motion%q => q
            motion%qd => at_rest
            motion%qdd => at_rest
            motion%load => load
            call run_by_record(model, recorded, 1, motion, assembly, results, n_left, left)
            if (n_left == 0) allocate (left(0))
        else
            left = [(i, i=1, n)]
        end if
    end procedure place_by_record

    !> A record takes some milliseconds to make, and as much for every further thirty links or so: of large mechanisms it is made
    !> for batches that take lanes as long, which are as large for 60 links as for 600, and serves from then on. Groups closed by
    !> iteration have to be led to its representative poses, each from the start.
    pure logical function is_worth_recording(model, solver, n, is_there)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        integer, intent(in) :: n                               !! samples of this batch and those to come
        logical, intent(in) :: is_there                        !! it has been made for a batch before
        integer, parameter :: worth_writing = 4000, worth_leading = 128
        integer, parameter :: worth_tracing = 2000             !! virtual work, whose equations the lanes write in a part of that
                                                               !! time

        if (solver%is_one_of_many) then
            is_worth_recording = is_worth_own_record(model, int(max(n, solver%records%n_asked), int64))
            return
        end if
        is_worth_recording = (model%n_link <= few_links .or. is_there .or. n >= worth_writing) &
                             .and. (size(model%group) == 0 .or. n >= worth_leading) &
                             .and. (solver%equations%solver /= solver_reduced .or. n >= worth_tracing)
    end function is_worth_recording

    module procedure need_record
        type(result_list) :: list

        call list_results(results, 0, list)
        nullify (recorded)
        if (list%n > 0) call find_or_make(model, solver, list%id(:list%n), q, .false., recorded)
    end procedure need_record

    module procedure need_margins
        integer, parameter :: many = 200                       !! samples: their lanes' time is about that of a trace

        nullify (recorded)
        if (model%n_branch > 0 .and. size(q, 2) >= many) &
            call find_or_make(model, solver, of_margins, q, .false., recorded)
    end procedure need_margins

    !> The record for some results, if the batch, or the caller, finds it worth while.
    recursive subroutine find_or_make(model, solver, wanted, q, is_worth, recorded)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        integer, intent(in) :: wanted(:)                       !! `result_*` of the catalogue
        real(wp), intent(in) :: q(:, :)                        !! (n_q, n)
        logical, intent(in) :: is_worth                        !! whatever the batch
        type(recorded_forces), pointer, intent(out) :: recorded
        logical :: is_asked

        call hold_records()
        recorded => solver%records%find(wanted)
        solver%records%n_asked = min(solver%records%n_asked, huge(1) - size(q, 2)) + size(q, 2)
        is_asked = is_worth
        if (.not. is_worth) &
            is_asked = is_worth_recording(model, solver, max(size(q, 2), solver%n_expected), associated(recorded))
        if (is_asked .and. .not. associated(recorded)) call make_record(model, solver, wanted, q, recorded)
        call release_records()
        if (.not. is_asked) nullify (recorded)
        if (associated(recorded)) then
            if (.not. recorded%is_usable) nullify (recorded)
        end if
    end subroutine find_or_make

    module procedure look_for_record
        type(inverse_solver) :: solver
        type(recorded_forces), pointer :: recorded

        is_there = .false.
        is_uncertain = .false.
        is_refuted = .false.
        call prepare_inverse(model, inverse_options(solver=solver_elimination), any(wanted == result_reaction), solver, status)
        if (.not. status%is_ok()) return
        call find_or_make(model, solver, wanted, spread(model%start_q, 2, 1), .true., recorded)
        is_there = associated(recorded)
        if (.not. is_there .and. size(model%group) > 0 .and. allocated(solver%places%poses%q)) &
            is_uncertain = all(status_for_record(model, solver%places%poses%assembly) /= sample_ok)
        recorded => solver%records%find(wanted)
        if (associated(recorded)) is_refuted = recorded%is_refuted .and. .not. is_uncertain
        call solver%free()
    end procedure look_for_record

    module procedure need_closer

        nullify (closer)
        call hold_records()
        if (.not. solver%places%closing%is_tried) call make_closer(model, q, solver%places%poses, solver%places%closing)
        call release_records()
        if (solver%places%closing%is_usable) closer => solver%places%closing
    end procedure need_closer

    recursive subroutine make_record(model, solver, wanted, q, recorded)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        integer, intent(in) :: wanted(:)                       !! `result_*` of the catalogue
        real(wp), intent(in) :: q(:, :)                        !! (n_q, n)
        type(recorded_forces), pointer, intent(out) :: recorded
        type(recorded_margins) :: margins

        recorded => solver%records%add()
        associate (poses => solver%places%poses)
            call need_poses(model, q, poses)
            call hold_texts()
            call record_forces(model, wanted, poses%q, poses%stand, recorded, poses%assembly%place, &
                               solver%equations%solver == solver_reduced)
            call release_texts()
            if (.not. recorded%is_usable) return
            if (any(wanted == of_margins(1))) then
                margins%record => recorded
                recorded%is_usable = judges_like_lanes(model, margins, poses%q)
            else
                recorded%is_usable = agrees_with_lanes(model, solver, recorded, poses%q, poses%assembly)
                recorded%is_refuted = .not. recorded%is_usable
            end if
        end associate
    end subroutine make_record

    !> Does the record find what the lanes find? Asked once for each record, at representative poses in motion: a difference
    !> would be a defect, and the lanes are believed. Equations have both the same, so it is the motion that is looked at: by the
    !> balance of power, which no link is left out of. Where friction or states of self-stress come in forces are compared one by
    !> one, and places where nothing else is wanted.
    recursive logical function agrees_with_lanes(model, solver, recorded, pose, assembly) result(agrees)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        type(recorded_forces), intent(in) :: recorded
        real(wp), intent(in), contiguous, target :: pose(:, :) !! (n_q, pose)
        type(sample_assembly), intent(in) :: assembly          !! there
        type(inverse_solver) :: by_lanes
        type(inverse_results) :: found(2), balance
        real(wp), allocatable, target :: qd(:, :), qdd(:, :), load(:, :, :), t(:)
        type(motion_batch) :: motion
        integer, allocatable :: left(:)
        type(agreement) :: of_both
        integer, parameter :: told(4) = [result_position, result_rotation, result_driving_force, result_reaction]    ! and compared
        integer :: i, k, n, n_left
        logical :: by_power, by_places

        n = size(pose, 2)
        qd = reshape([(modulo(k*golden, 1.0_wp) - 0.5_wp, k=1, size(pose))], shape(pose))
        qdd = reshape([(modulo(k*golden + 0.3_wp, 1.0_wp) - 0.5_wp, k=1, size(pose))], shape(pose))
        allocate (load(6, model%n_load, n))
        load = reshape([(modulo(k*golden + 0.7_wp, 1.0_wp) - 0.5_wp, k=1, size(load))], shape(load))
        associate (time => model%scene%time)
            t = [(time%first + modulo(k*golden, 1.0_wp)*(time%last - time%first), k=1, n)]
        end associate
        agrees = .true.
        by_places = any(recorded%wanted == result_position)
        if (.not. any(by_places .or. recorded%wanted == result_driving_force .or. recorded%wanted == result_reaction)) return
        do i = 1, 2
            allocate (found(i)%status(n))
            do k = 1, size(told)
                if (any(recorded%wanted == told(k))) call found(i)%add(model, told(k), n)
            end do
        end do
        motion = motion_of(pose, qd, qdd, load)
        motion%t => t
        call run_by_record(model, recorded, 1, motion, assembly, found(2), n_left, left)
        by_power = size(model%contact) == 0 .and. model%share%n == 0 .and. found(2)%wants(result_driving_force)
        if (by_power) then
            allocate (balance%status(n))
            call balance%add(model, result_power_imbalance, n)
            call build_given_equations(model, by_lanes%equations)
            motion%given_force => found(2)%of(result_driving_force)%x
            call run_prepared(model, by_lanes, 1, motion, balance, known=assembly)
            call free_equations(by_lanes%equations)
            found(1)%status = balance%status
        else
            by_lanes%equations = solver%equations
            call run_prepared(model, by_lanes, 1, motion, found(1), known=assembly)
        end if
        do i = 1, n
            if (found(1)%status(i) /= sample_ok) cycle
            if (n_left > 0) then
                if (any(left == i)) cycle
            end if
            if (by_power) then
                call of_both%note(abs(balance%of(result_power_imbalance)%x(1, i)) <= least_accuracy)
            else if (by_places) then
                call of_both%note(are_alike(place_of(found(1), i), place_of(found(2), i)))
            else
                call of_both%note(has_same_forces(i))
            end if
        end do
        agrees = of_both%is_reached()
        do i = 1, 2
            deallocate (found(i)%status)
            call found(i)%free()
        end do
        if (by_power) deallocate (balance%status)
        call balance%free()

    contains

        logical function has_same_forces(i)
            integer, intent(in) :: i                           !! sample

            has_same_forces = has_same(result_driving_force, i)
            if (has_same_forces) has_same_forces = has_same(result_reaction, i)
        end function has_same_forces

        logical function has_same(id, i)
            integer, intent(in) :: id                          !! one of `result_*`
            integer, intent(in) :: i                           !! sample

            has_same = .true.
            if (found(1)%wants(id)) has_same = are_alike(found(1)%of(id)%x(:, i), found(2)%of(id)%x(:, i))
        end function has_same

        !> Places of all links, lengths by the mechanism's size.
        function place_of(results, i) result(place)
            type(inverse_results), intent(in) :: results
            integer, intent(in) :: i                           !! sample
            real(wp), allocatable :: place(:)

            place = [results%of(result_position)%x(:, i)/scene_size(model), results%of(result_rotation)%x(:, i)]
        end function place_of
    end function agrees_with_lanes

    module procedure run_by_record
        real(wp), allocatable, target :: with_laws(:, :, :), pull(:, :), base(:, :), payload(:, :)
        real(wp), target :: at_zero(1)
        real(wp), pointer :: t(:)
        type(sample_arrays) :: arrays
        type(result_list) :: list
        integer :: n

        n = size(motion%q, 2)
        call set_block(arrays, in_q, size(motion%q, 1), n, motion%q)
        call set_block(arrays, in_qd, size(motion%q, 1), n, motion%qd)
        call set_block(arrays, in_qdd, size(motion%q, 1), n, motion%qdd)
        at_zero = 0
        t => at_zero
        if (associated(motion%t)) t => motion%t
        if (size(model%scene%laws%law) > 0) then
            allocate (with_laws(6, model%n_load, n), pull(size(model%scene%spring), n))
            call evaluate_load_laws(model, threads, motion%q, motion%qd, t, motion%load, assembly, with_laws, pull)
            call set_block(arrays, in_load, 6*model%n_load, n, with_laws)
            call set_block(arrays, in_pull, size(pull, 1), n, pull)
        else
            call set_block(arrays, in_load, 6*size(motion%load, 2), size(motion%load, 3), motion%load)
        end if
        if (model%scene%base%moves) then
            allocate (base(base_size(model), size(t)))
            call evaluate_base(model, t, base)
            call set_block(arrays, in_base, size(base, 1), size(base, 2), base)
        end if
        if (size(model%payload) > 0) then
            allocate (payload(size(model%payload), size(t)))
            call evaluate_payloads(model, t, payload)
            call set_block(arrays, in_payload, size(payload, 1), size(payload, 2), payload)
        end if
        call list_results(results, n, list)
        call clear_measures(results)
        if (recorded%needs_branches) &
            call set_block(arrays, in_branch, size(assembly%branch, 1), size(assembly%branch, 2), assembly%branch)
        if (recorded%needs_places) then
            call set_block(arrays, in_place, size(assembly%place, 1)*model%n_link, n, assembly%place(:, :, 1:))
            call run_recorded(recorded, threads, n, arrays, status_for_record(model, assembly), list, n_left, left)
        else if (recorded%needs_branches) then
            call run_recorded(recorded, threads, n, arrays, assembly%status, list, n_left, left)
        else
            call run_recorded(recorded, threads, n, arrays, [sample_ok], list, n_left, left)
        end if
    end procedure run_by_record

    !> Samples at which a group is too near to a singular position for its motion to be surely certain are for the lanes, which
    !> look closer.
    pure function status_for_record(model, assembly) result(status)
        type(model_type), intent(in) :: model
        type(sample_assembly), intent(in) :: assembly
        integer :: status(size(assembly%status))               !! one of `sample_*`
        integer :: g, i

        status = assembly%status
        do i = 1, size(status)
            if (status(i) /= sample_ok) cycle
            do g = 1, size(model%group)
                associate (off => sizes_away(model, model%group(g), assembly%place(:, 1:, i)))
                    if (.not. is_surely_certain(assembly%margin(g, i), size(model%group(g)%unit), off)) status(i) = sample_singular
                end associate
            end do
        end do
    end function status_for_record
end submodule linkdyn_inverse_records
