!> From a scene to a model: constants in the form the engine wants, the plan, and the assembly at the start.
module linkdyn_builder
    use linkdyn_alike_starts, only: stand_alike
    use linkdyn_code, only: check_code
    use linkdyn_constants, only: two_pi
    use linkdyn_contact, only: list_contacts
    use linkdyn_gear_fit, only: gears_fit, settle_phases
    use linkdyn_gearing, only: lay_gears, plan_gears, refuse_uncounted_belts, list_driven_apart
    use linkdyn_idle_spin, only: idle_spin, find_idle_spins, refuse_eccentric, refuse_unheld, hold_spins
    use linkdyn_joint_table, only: moment_directions, along_axes, joint_rack, joint_cam, joint_loose
    use linkdyn_kinds, only: wp
    use linkdyn_elastic_links, only: take_arms
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_laws, only: have_same_course
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_mesh_losses, only: shape_meshes
    use linkdyn_motion_measures, only: released_fit
    use linkdyn_payloads, only: take_payloads
    use linkdyn_model, only: model_type, take_motors, list_joints_of_links, link_type, joint_type, leg_type, step_type, &
        by_nothing, by_markers, by_fit, step_ups, step_csp, step_hung, step_group, is_dyad, is_rod_leg, orientation_of
    use linkdyn_newton_group, only: prepare_margins
    use linkdyn_planar_start, only: assemble_start
    use linkdyn_planner, only: plan_steps
    use linkdyn_preloads, only: refuse_idle_preloads
    use linkdyn_release, only: release_joints, is_released_alike, release_alike
    use linkdyn_scene, only: share_refused, scene_type, link_spec, marker_spec, marker_frame, hold_spec, law_spec, &
        joint_n_variable, joint_prismatic, frame_link, n_holding, at_stiffness
    use linkdyn_spin_axes, only: choose_holds
    use linkdyn_spatial_start, only: assemble_in_space
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: quoted
    use linkdyn_vec3, only: mat3_lane
    use linkdyn_spread_starts, only: spread_starts
    use linkdyn_welded_links, only: forget_carried_joints
    use linkdyn_strides, only: choose_strides
    implicit none (type, external)
    private
    public :: build_model

contains

    !> Check and plan the scene.
    !>
    !> **Errors**: `status_bad_input` with the links and joints concerned when the mechanism cannot be computed.
    subroutine build_model(scene, model, status, closed_forms, like)
        type(scene_type), intent(in) :: scene
        type(model_type), intent(out) :: model
        type(status_type), intent(out) :: status
        logical, intent(in), optional :: closed_forms    !! false: all links are placed by Newton's method, to compare with
        type(model_type), intent(in), optional :: like   !! of another scene: where that stands alike, its assembly is taken
        type(scene_type) :: with_holds
        type(model_type) :: at_start
        logical :: is_known

        call check_code(status)
        if (.not. status%is_ok()) return
        is_known = .false.
        if (present(like)) is_known = stand_alike(scene, like%scene)
        if (is_known) then
            call copy_scene(scene, with_holds)
            with_holds%hold = like%scene%hold
            call plan_scene(with_holds, model, status, closed_forms, like, holds_alike=.true.)
        else
            call plan_scene(scene, model, status, closed_forms)
        end if
        if (status%is_ok() .and. model%share%n > 0) call choose_fitting_branches(scene, model, closed_forms)
        if (status%is_ok()) call settle_phases(model, status)
        if (status%is_ok()) call refuse_shared_work(model, status)
        call refuse_idle_preloads(model, status)
        if (.not. status%is_ok() .or. allocated(scene%hold) .or. is_known) return
        if (size(model%scene%hold) == 0) return
        ! Now it is known how the links stand at the start: idle spins are held by directions that suit.
        call copy_scene(scene, with_holds)
        with_holds%hold = holds_at_start(model)
        call copy_model(model, at_start)
        call plan_scene(with_holds, model, status, closed_forms, at_start)
        if (status%is_ok()) call settle_phases(model, status)
    end subroutine build_model

    !> Drives that share the work are found before any reaction is, and friction comes of reactions.
    subroutine refuse_shared_work(model, status)
        type(model_type), intent(in) :: model
        type(status_type), intent(inout) :: status

        if (size(model%contact) == 0) return
        if (model%n_actuator <= model%n_q .or. model%scene%redundancy == share_refused) return
        call fail(status, status_bad_input, "friction at joint "//quoted(model%joint(model%contact(1)%joint)%name) &
                  //" and more actuators than coordinates: how these share the work is not known then " &
                  //"(expected as many actuators as coordinates)")
    end subroutine refuse_shared_work

    !> Choose branches that let all loops close: in an over-constrained mechanism not every way to close one does. Where nothing
    !> else chooses, such a way is taken that does; if there is none, the model stays as it is.
    subroutine choose_fitting_branches(scene, model, closed_forms)
        type(scene_type), intent(in) :: scene
        type(model_type), intent(inout) :: model
        logical, intent(in), optional :: closed_forms
        integer, parameter :: most = 6                   !! loops that are tried both ways
        type(scene_type) :: turned
        type(model_type) :: trial
        type(status_type) :: status
        integer, allocatable :: open(:)
        integer :: way, i, k

        if (joints_fit(model)) return
        open = pack([(i, i=1, size(model%step))], is_open(model%step))
        open = open(:min(most, size(open)))
        do way = 1, 2**size(open) - 1
            call copy_scene(scene, turned)
            do k = 1, size(open)
                associate (step => model%step(open(k)))
                    turned%joint(model%joint(step%joint(2))%told)%branch = nint(model%branch(step%first)) &
                                                                           *merge(-1, 1, btest(way, k - 1))
                end associate
            end do
            status = status_type()
            call plan_scene(turned, trial, status, closed_forms)
            if (.not. status%is_ok()) cycle
            if (.not. joints_fit(trial)) cycle
            call copy_model(trial, model)
            model%chosen_by(model%step(open)%first) = by_fit
            return
        end do

    contains

        !> A closed form of which nothing says how it closes?
        elemental logical function is_open(step)
            type(step_type), intent(in) :: step

            is_open = step%has_branches
            if (is_open) is_open = model%chosen_by(step%first) == by_nothing .or. model%chosen_by(step%first) == by_markers
        end function is_open
    end subroutine choose_fitting_branches

    !> Do joints fit at the start that were released?
    logical function joints_fit(model)
        type(model_type), intent(in) :: model
        type(kinematic_state) :: state
        logical :: fit(lanes)
        integer :: j

        call prepare_kinematics(model, 0, state)
        state%q = spread(model%start_q, 1, lanes)
        call evaluate_kinematics(model, state)
        fit = released_fit(model, [(j, j=1, model%n_joint)], state)
        joints_fit = fit(1) .and. .not. (state%not_converged(1) .or. state%singular(1) .or. state%unreachable(1))
        if (joints_fit) joints_fit = gears_fit(model)
    end function joints_fit

    !> The directions by which idle spins are best held.
    function holds_at_start(model) result(hold)
        type(model_type), intent(in) :: model
        type(hold_spec), allocatable :: hold(:)
        type(model_type) :: loose
        type(idle_spin), allocatable :: spin(:)
        type(kinematic_state) :: state
        real(wp) :: stand(3, 3, 0:model%n_link)
        integer :: l

        hold = model%scene%hold
        call prepare_kinematics(model, 0, state)
        state%q = spread(model%start_q, 1, lanes)
        call evaluate_kinematics(model, state)
        if (state%not_converged(1) .or. state%singular(1) .or. state%unreachable(1)) return
        do l = 0, model%n_link
            stand(:, :, l) = mat3_lane(state%rotation(orientation_of(model, l)), 1)
        end do
        call copy_model(model, loose)
        call forget_carried_joints(loose)
        loose%joint%kind = loose%joint%told_kind
        call find_idle_spins(loose, spin)
        call choose_holds(loose, spin, hold, stand)
    end function holds_at_start

    !> Constants, plan and assembly.
    subroutine plan_scene(scene, model, status, closed_forms, like, holds_alike)
        type(scene_type), intent(in) :: scene
        type(model_type), intent(out) :: model
        type(status_type), intent(inout) :: status
        logical, intent(in), optional :: closed_forms
        type(model_type), intent(in), optional :: like   !! a model that stands as this one will
        logical, intent(in), optional :: holds_alike     !! its idle spins are held as this one's are, too; absent: false
        integer :: i, n_belt

        n_belt = 0
        call copy_scene(scene, model%scene)
        if (.not. allocated(model%scene%spring)) allocate (model%scene%spring(0))
        if (.not. allocated(model%scene%payload)) allocate (model%scene%payload(0))
        if (.not. allocated(model%scene%friction)) allocate (model%scene%friction(0))
        if (.not. allocated(model%scene%laws%measure)) allocate (model%scene%laws%measure(0))
        if (.not. allocated(model%scene%laws%law)) allocate (model%scene%laws%law(0))
        if (.not. allocated(model%scene%controller)) allocate (model%scene%controller(0))
        model%is_planar = scene%planar
        model%n_link = size(scene%link)
        model%n_joint = n_holding(scene)
        model%n_q = size(scene%coordinate)
        model%n_actuator = size(scene%actuator)
        model%n_load = size(scene%load)
        model%n_component = merge(3, 6, scene%planar)
        model%n_row = merge(3, 6, scene%planar)*model%n_link
        model%gravity = scene%gravity
        if (model%n_link == 0) then
            call fail(status, status_bad_input, "the scene has no moving link (expected at least one [[link]])")
            return
        end if
        allocate (model%link(model%n_link), model%joint(size(scene%joint)))
        do i = 1, model%n_link
            call take_link(scene%link(i), model%link(i))
        end do
        do i = 1, size(model%joint)
            call take_joint(scene, i, model%joint(i))
            model%joint(i)%first_variable = model%n_variable
            if (i <= model%n_joint) model%n_variable = model%n_variable + joint_n_variable(model%joint(i)%kind)
            if (scene%joint(i)%strand(at_stiffness) > 0) then
                n_belt = n_belt + 1
                model%joint(i)%belt = n_belt
            end if
            if (model%joint(i)%kind /= joint_cam) cycle
            model%n_cam = model%n_cam + 1
            model%joint(i)%cam = model%n_cam
            model%joint(i)%reach = maxval(norm2(scene%joint(i)%cam%curve%knot, dim=1))
        end do
        call take_payloads(model)
        call take_motors(model)
        call take_arms(model, status)
        call list_contacts(model%scene, model%contact)
        call spread_starts(model)
        call number_courses(model%scene)
        call list_joints_of_links(model)
        call settle_spins(model, status)
        call plan_links(model, status, closed_forms, like, holds_alike)
        if (status%is_ok()) call refuse_uncounted_belts(model, status)
        if (status%is_ok()) call list_driven_apart(model, status)
        if (status%is_ok()) call shape_meshes(model, status)
        if (status%is_ok()) call refuse_idle_branches(model, status)
        if (status%is_ok()) call list_legs(model)
        if (status%is_ok()) call choose_strides(model)
        if (status%is_ok()) call prepare_margins(model)
        call assemble_start(model, status, like)
        call assemble_in_space(model, status, like)
    end subroutine plan_scene

    !> The links of the UPS legs.
    pure subroutine list_legs(model)
        type(model_type), intent(inout) :: model
        integer :: i

        allocate (model%leg(model%n_leg))
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (step%kind == step_ups) model%leg(step%first) = leg_type(lower=step%link(1), upper=step%link(2))
            end associate
        end do
    end subroutine list_legs

    !> The plan; of over-constrained mechanisms with joints that let go of what others hold.
    subroutine plan_links(model, status, closed_forms, like, holds_alike)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        logical, intent(in), optional :: closed_forms
        type(model_type), intent(in), optional :: like   !! a model that stands as this one will
        logical, intent(in), optional :: holds_alike     !! see `plan_scene`
        type(model_type) :: laid, unplanned
        type(status_type) :: again
        logical :: is_freed
        integer :: way

        if (status%is_ok()) call lay_gears(model, status)
        if (.not. status%is_ok()) return
        if (present(like) .and. present(holds_alike)) then
            if (holds_alike .and. is_released_alike(model, like)) then
                call release_alike(like, model)
                call plan(model, status)
                return
            end if
        end if
        call copy_model(model, laid)
        call plan(model, status, briefly=model%scene%redundancy /= share_refused)
        if (status%is_ok() .or. model%scene%redundancy == share_refused) return
        ! without joints that let go the gears beside them may do
        do way = 1, merge(2, 1, size(laid%gear) > 0)
            call copy_model(laid, unplanned)
            again = status_type()
            call release_joints(unplanned, way == 2, is_freed, again)
            if (.not. again%is_ok()) status = again
            if (way == 1 .and. again%is_ok() .and. .not. is_freed) call refuse_in_words()
            if (.not. (is_freed .and. again%is_ok())) return
            call copy_model(unplanned, model)
            call plan(model, again)
            if (way == 1 .or. again%is_ok()) status = again
            if (again%is_ok()) return
        end do

    contains

        subroutine plan(model, status, briefly)
            type(model_type), intent(inout) :: model
            type(status_type), intent(inout) :: status
            logical, intent(in), optional :: briefly    !! see `plan_steps`

            call share_orientations(model)
            call plan_gears(model, status)
            call plan_steps(model, status, closed_forms, briefly=briefly)
        end subroutine plan

        !> No joint can let go: why the plan has failed is wanted after all.
        subroutine refuse_in_words()
            call copy_model(laid, model)
            status = status_type()
            call plan(model, status)
        end subroutine refuse_in_words
    end subroutine plan_links

    !> Balls that hold idle spins: those that the scene brings along, else any.
    subroutine settle_spins(model, status)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        type(idle_spin), allocatable :: spin(:)

        call find_idle_spins(model, spin)
        call refuse_eccentric(model, spin, status)
        if (.not. allocated(model%scene%hold)) call choose_holds(model, spin, model%scene%hold)
        call refuse_unheld(model, spin, model%scene%hold, status)
        call hold_spins(model, model%scene%hold)
    end subroutine settle_spins

    !> Laws that do the same in the same time get the same number: one look at the time serves them all.
    subroutine number_courses(scene)
        type(scene_type), intent(inout), target :: scene
        type :: law_pointer
            type(law_spec), pointer :: law
        end type law_pointer
        type(law_pointer), allocatable :: found(:)     ! the first law of each number
        integer :: n_found, i, k

        allocate (found(size(scene%coordinate) + size(scene%actuator) + size(scene%base%motion) + size(scene%payload) &
                        + 6*size(scene%load)))
        n_found = 0
        do i = 1, size(scene%coordinate)
            call number_course(scene%coordinate(i)%motion)
        end do
        do i = 1, size(scene%actuator)
            call number_course(scene%actuator(i)%law%target)
        end do
        do i = 1, size(scene%base%motion)
            call number_course(scene%base%motion(i))
        end do
        do i = 1, size(scene%payload)
            call number_course(scene%payload(i)%mass)
        end do
        do i = 1, size(scene%load)
            do k = 1, 3
                call number_course(scene%load(i)%force(k))
                call number_course(scene%load(i)%moment(k))
            end do
        end do

    contains

        subroutine number_course(law)
            type(law_spec), intent(inout), target :: law
            integer :: j

            if (.not. have_same_course(law, law)) return
            do j = 1, n_found
                if (have_same_course(found(j)%law, law)) exit
            end do
            law%course = j
            if (j <= n_found) return
            n_found = j
            found(n_found)%law => law
        end subroutine number_course
    end subroutine number_courses

    !> A `branch` where there is none to be chosen.
    subroutine refuse_idle_branches(model, status)
        type(model_type), intent(in) :: model
        type(status_type), intent(inout) :: status
        logical :: is_meant(size(model%joint)), is_iterated(size(model%joint)), is_of_leg(size(model%joint))
        integer :: i, j

        is_meant = .false.
        is_iterated = .false.
        is_of_leg = .false.
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (is_dyad(step%kind)) is_meant(told(step%joint(:step%n_link + 1))) = .true.
                if (any(step%kind == [step_csp, step_hung]) .or. is_rod_leg(step%kind)) &
                    is_meant(told(step%joint(2))) = .true.
                if (step%kind == step_group) is_iterated(told(model%group(step%first)%joint)) = .true.
                if (step%kind == step_ups .and. step%branch /= 0) is_of_leg(told(step%joint(:3))) = .true.
            end associate
        end do
        do j = 1, model%n_joint
            associate (spec => model%scene%joint(j))
                if (spec%branch == 0 .or. is_meant(j)) cycle
                if (is_iterated(j)) then
                    call fail(status, status_bad_input, "joint "//quoted(spec%name)//": 'branch' has no meaning here: its links " &
                              //"are closed by iteration (expected 'start' of joints or links near the assembly wanted)")
                else if (is_of_leg(j)) then
                    call fail(status, status_bad_input, "joint "//quoted(spec%name)//": 'branch' has no meaning here: its links " &
                              //"are a leg (expected 'start' of joints or links near the way wanted)")
                else
                    call fail(status, status_bad_input, "joint "//quoted(spec%name)//": 'branch' has no meaning here: its links " &
                              //"close in one way only")
                end if
            end associate
        end do

    contains

        elemental integer function told(j)
            integer, intent(in) :: j

            told = model%joint(j)%told
        end function told
    end subroutine refuse_idle_branches

    subroutine take_link(spec, link)
        type(link_spec), intent(in) :: spec
        type(link_type), intent(out) :: link

        link%name = spec%name
        link%mass = spec%mass
        link%cog = spec%cog
        associate (i => spec%inertia)
            link%inertia = reshape([i(1), i(4), i(6), i(4), i(2), i(5), i(6), i(5), i(3)], [3, 3])
            link%is_diagonal = all(i(4:6) == 0)
            link%is_massless = spec%mass == 0 .and. all(i == 0)
        end associate
    end subroutine take_link

    !> A joint as the engine has it: its markers as points and frames on both links. In a plane frames lie as the plane wants them.
    subroutine take_joint(scene, index, joint)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: index
        type(joint_type), intent(out) :: joint
        type(marker_spec) :: marker
        integer :: side

        associate (spec => scene%joint(index))
            joint%name = spec%name
            joint%kind = spec%kind
            if (spec%strand(at_stiffness) > 0) joint%kind = joint_loose        ! it pulls, and holds nothing
            joint%told_kind = spec%kind
            joint%told = index
            joint%link = spec%link
            joint%pitch = spec%lead/two_pi
            joint%start = spec%start
            joint%has_start = spec%has_start
            do side = 1, 2
                if (spec%marker(side) == 0) then
                    marker = marker_spec()
                else if (spec%link(side) == frame_link) then
                    marker = scene%frame%marker(spec%marker(side))
                else
                    marker = scene%link(spec%link(side))%marker(spec%marker(side))
                end if
                if (scene%planar) &
                    call lay_in_plane(spec%kind == joint_prismatic &
                                      .or. (any(spec%kind == [joint_rack, joint_cam]) .and. side == 2), marker)
                call take_marker(marker, joint%point(:, side), joint%frame(:, :, side))
                joint%told_frame(:, :, side) = joint%frame(:, :, side)
            end do
        end associate
    end subroutine take_joint

    !> A planar marker as one in space: a revolute joint turns about z, a slide lies in the plane.
    subroutine lay_in_plane(slides, marker)
        logical, intent(in) :: slides
        type(marker_spec), intent(inout) :: marker

        if (slides) then
            marker%x_axis = [-marker%axis(2), marker%axis(1), 0.0_wp]
        else
            marker%axis = [0.0_wp, 0.0_wp, 1.0_wp]
        end if
    end subroutine lay_in_plane

    !> A marker's point and its frame.
    subroutine take_marker(marker, point, frame)
        type(marker_spec), intent(in) :: marker
        real(wp), intent(out) :: point(3), frame(3, 3)

        point = marker%at
        frame = marker_frame(marker)
    end subroutine take_marker

    !> Links that do not turn against each other and have parallel axes have one orientation; the frame's is 0.
    subroutine share_orientations(model)
        type(model_type), intent(inout) :: model
        integer :: group(0:model%n_link), i, j, from, to

        group = [(i, i=0, model%n_link)]
        do j = 1, model%n_joint
            associate (joint => model%joint(j))
                if (moment_directions(joint%kind) /= along_axes .or. any(joint%frame(:, :, 1) /= joint%frame(:, :, 2))) cycle
                to = min(group(joint%link(1)), group(joint%link(2)))
                from = max(group(joint%link(1)), group(joint%link(2)))
                where (group == from) group = to
            end associate
        end do
        do i = 1, model%n_link
            if (group(i) == i) then
                model%n_orientation = model%n_orientation + 1
                model%link(i)%orientation = model%n_orientation
            else if (group(i) == 0) then
                model%link(i)%orientation = 0
            else
                model%link(i)%orientation = model%link(group(i))%orientation
            end if
        end do
    end subroutine share_orientations

    !> The compiler writes a copy out in place, component by component, thousands of instructions each time: here it stands once.
    subroutine copy_model(from, to)
        type(model_type), intent(in) :: from
        type(model_type), intent(inout) :: to

        to = from
    end subroutine copy_model

    !> Copy a scene, once in the object code as well.
    subroutine copy_scene(from, to)
        type(scene_type), intent(in) :: from
        type(scene_type), intent(inout) :: to

        to = from
    end subroutine copy_scene
end module linkdyn_builder
