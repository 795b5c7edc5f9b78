!> Is a coordinate coming to its dead point, and which joint variable could take its place?
!>
!> At a dead point of a coordinate the mechanism moves on while the coordinate stands still: the rates that a unit rate of
!> the coordinate gives to other joint variables grow without bound. They are compared as speeds: a slide has its own, an
!> angle that of the pins that it moves. The ratio of two such speeds has no size and no unit, and it is near one where
!> both coordinates are good, but for how the mechanism is built: a short crank may move a slide far. What tells a dead
!> point is therefore that a ratio grows, to ten times what it was at best.
!>
!> At a change point rates stay finite, though the dyad's map is singular there: it is no dead point of the coordinate.
module linkdyn_coordinate_watch
    use linkdyn_joint_table, only: is_slide, is_pose_part, has_one_axis
    use linkdyn_joint_rates, only: joint_rate
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_csp, side_of, point_on, scene_size, has_assemblies, is_released
    use linkdyn_scene, only: coordinate_joint, joint_n_variable, frame_link
    implicit none (type, external)
    private
    public :: coordinate_watch, prepare_watch, compare_rates, take_rates, note_rates, forget_rates, grows
    public :: coordinate_ratios
    public :: is_near_dead_point, is_well_past, dead_coordinate, largest_growth

    ! Of ratios, to what they were at best.
    real(wp), parameter :: largest_growth = 10      !! that a coordinate in use may have
    real(wp), parameter :: jump = 1.5               !! in one step, of a ratio that ends beyond that
    real(wp), parameter :: dead_growth = 1000       !! beyond it the coordinate says too little of the motion
    real(wp), parameter :: good_growth = 3          !! no dead point is near
    real(wp), parameter :: best_ratio = 1, worst_ratio = 10    !! at best, of what is counted as good

    !> How fast joint variables are beside coordinates, at the accepted states so far. They are numbered as in the results.
    type :: coordinate_ratios
        real(wp), allocatable :: ratio(:, :)        !! speed of a variable over that of a coordinate alone (n_variable, n_q)
        real(wp), allocatable :: before(:, :)       !! the same one step before; 0: not known (n_variable, n_q)
        real(wp), allocatable :: least(:)           !! smallest of the largest ratios of a coordinate so far (n_q)
    end type coordinate_ratios

    type, extends(coordinate_ratios) :: coordinate_watch
        logical :: is_on = .false.
        logical :: may_exchange = .true.            !! false: it is only seen whether a coordinate is at its dead point
        integer, allocatable :: joint(:)            !! of a variable (n_variable)
        integer, allocatable :: place(:)            !! of a variable among those of its joint (n_variable)
        logical, allocatable :: is_candidate(:)     !! the variable may become a coordinate (n_variable)
        real(wp), allocatable :: arm(:)             !! what makes a rate a speed: 1 for a slide [m] (n_variable)
        integer, allocatable :: variable(:)         !! that is a coordinate which may be exchanged; 0 (n_q)
        logical :: is_compared = .false.            !! ratios at the state evaluated last are known, accepted or not:
        real(wp), allocatable :: ratio_tried(:, :)  !! these (n_variable, n_q)
        type(kinematic_state) :: state              !! at the position looked at
    end type coordinate_watch

contains

    !> Which coordinates may reach dead points, and which joint variables may be integrated in their place.
    subroutine prepare_watch(model, is_free, watch)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_free(:)           !! coordinates that are not driven (n_q)
        type(coordinate_watch), intent(out) :: watch
        integer :: j, k, v

        allocate (watch%joint(model%n_variable), watch%place(model%n_variable), watch%is_candidate(model%n_variable), &
                  watch%arm(model%n_variable), watch%variable(model%n_q))
        allocate (watch%ratio(model%n_variable, model%n_q), watch%before(model%n_variable, model%n_q), &
                  watch%least(model%n_q))
        watch%ratio = 0
        call forget_rates(watch)
        do j = 1, model%n_joint
            associate (joint => model%joint(j))
                do k = 1, joint_n_variable(joint%told_kind)
                    v = joint%first_variable + k
                    watch%joint(v) = j
                    watch%place(v) = k
                    watch%is_candidate(v) = has_one_axis(joint%kind) .and. .not. is_released(joint) &
                                            .and. .not. any([on_leg(joint%link(1)), on_leg(joint%link(2))])
                    ! an idle spin leads nothing
                    if (.not. is_slide(joint%kind, k) .and. any([spins(joint%link(1)), spins(joint%link(2))])) &
                        watch%is_candidate(v) = .false.
                end do
            end associate
        end do
        watch%variable = 0
        do k = 1, model%n_q
            associate (c => model%scene%coordinate(k))
                if (c%kind /= coordinate_joint) cycle
                if (is_pose_part(model%joint(c%joint)%kind)) cycle
                v = model%joint(c%joint)%first_variable + c%variable
                if (is_free(k) .and. has_one_axis(model%joint(c%joint)%kind)) watch%variable(k) = v
                watch%is_candidate(v) = .false.
            end associate
        end do
        call find_arms(model, watch)
        watch%is_on = any(watch%variable > 0) .and. (has_assemblies(model) .or. any(model%step%kind == step_csp))
        if (watch%is_on) call prepare_kinematics(model, model%n_q, watch%state)

    contains

        pure logical function on_leg(link)
            integer, intent(in) :: link

            on_leg = any(model%leg%lower == link .or. model%leg%upper == link) .and. link /= frame_link
        end function on_leg

        pure logical function spins(link)
            integer, intent(in) :: link

            spins = .false.
            if (link /= frame_link) spins = model%link(link)%spin > 0
        end function spins
    end subroutine prepare_watch

    !> Find for each hinge how far from its axis the pins that it moves are, on the smaller of its moving links; if it moves none,
    !> the centres of mass.
    subroutine find_arms(model, watch)
        type(model_type), intent(in) :: model
        type(coordinate_watch), intent(inout) :: watch
        integer :: v

        do v = 1, model%n_variable
            associate (j => watch%joint(v), arm => watch%arm(v))
                arm = smaller_reach(model, j, .false.)
                if (arm == 0) arm = smaller_reach(model, j, .true.)
                if (arm == 0) arm = scene_size(model)
                if (is_slide(model%joint(j)%kind, watch%place(v))) arm = 1
            end associate
        end do
    end subroutine find_arms

    !> Smaller reach of the two links of a joint; 0 if neither reaches anywhere: what lies on an axis, but for rounding, does not.
    pure real(wp) function smaller_reach(model, j, of_mass) result(arm)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        logical, intent(in) :: of_mass
        real(wp), parameter :: on_axis = sqrt(epsilon(1.0_wp))     !! part of the mechanism's size
        real(wp) :: reach
        integer :: side

        arm = 0
        do side = 1, 2
            reach = reach_of(model, j, side, of_mass)
            if (reach > on_axis*scene_size(model) .and. (arm == 0 .or. reach < arm)) arm = reach
        end do
    end function smaller_reach

    !> Largest distance of a moving link's other joints from the axis of one, or of its centre of mass.
    pure real(wp) function reach_of(model, j, side, of_mass) result(reach)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, side                  !! joint; which of its links
        logical, intent(in) :: of_mass
        integer :: i

        reach = 0
        associate (link => model%joint(j)%link(side))
            if (link == frame_link) return
            if (of_mass) reach = off_axis(model%link(link)%cog)
            do i = model%first_at(link), model%first_at(link + 1) - 1
                if (of_mass) exit
                associate (other => model%joint(model%joint_at(i)))
                    ! a cam moves its follower by its outline
                    reach = max(reach, off_axis(point_on(other, link)) &
                                       + merge(other%reach, 0.0_wp, other%cam > 0 .and. side_of(other, link) == 1))
                end associate
            end do
        end associate

    contains

        pure real(wp) function off_axis(point)
            real(wp), intent(in) :: point(3)
            real(wp) :: way(3)

            associate (axis => model%joint(j)%frame(:, 3, side))
                way = point - model%joint(j)%point(:, side)
                off_axis = norm2(way - dot_product(way, axis)*axis)
            end associate
        end function off_axis
    end function reach_of

    !> Speeds of all joint variables for a unit speed of each coordinate, on lane 1 of a state whose columns are up to date.
    subroutine compare_rates(model, state, watch)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(coordinate_watch), intent(inout) :: watch
        real(wp) :: rate(lanes)
        integer :: v, k

        watch%ratio = 0
        if (state%unreachable(1) .or. state%singular(1) .or. state%not_converged(1)) return
        do k = 1, model%n_q
            if (watch%variable(k) == 0) cycle
            do v = 1, model%n_variable
                if (.not. watch%is_candidate(v)) cycle
                rate = joint_rate(model, state, watch%joint(v), watch%place(v), k)
                watch%ratio(v, k) = rate(1)*watch%arm(v)/watch%arm(watch%variable(k))
            end do
        end do
    end subroutine compare_rates

    !> The same where somebody else has found the rates: of candidates, by coordinates that may be exchanged.
    pure subroutine take_rates(rate, watch)
        real(wp), intent(in) :: rate(:)             !! one coordinate after the other
        type(coordinate_watch), intent(inout) :: watch
        integer :: i, v, k

        watch%ratio = 0
        i = 0
        do k = 1, size(watch%variable)
            if (watch%variable(k) == 0) cycle
            do v = 1, size(watch%joint)
                if (.not. watch%is_candidate(v)) cycle
                i = i + 1
                watch%ratio(v, k) = rate(i)*watch%arm(v)/watch%arm(watch%variable(k))
            end do
        end do
    end subroutine take_rates

    !> Ratios compared before are not those of the way ahead.
    pure subroutine forget_rates(watch)
        type(coordinate_watch), intent(inout) :: watch

        watch%before = 0
        watch%least = worst_ratio
    end subroutine forget_rates

    !> The ratios at hand are those of an accepted state; the next ones come later.
    pure subroutine note_rates(watch)
        type(coordinate_watch), intent(inout) :: watch

        watch%least = min(watch%least, maxval(abs(watch%ratio), dim=1))
        watch%before = watch%ratio
    end subroutine note_rates

    !> Is a ratio larger than one step before, or nothing known of that?
    pure elemental logical function grows(now, before)
        real(wp), intent(in) :: now, before

        grows = abs(now) > abs(before)
    end function grows

    !> What counts as good for a coordinate: the best so far, within bounds.
    pure function good_ratios(watch) result(good)
        type(coordinate_watch), intent(in) :: watch
        real(wp) :: good(size(watch%least))

        good = max(best_ratio, min(watch%least, worst_ratio))
    end function good_ratios

    !> The coordinate that is at its dead point, for all that it can be used; 0: none.
    pure integer function dead_coordinate(watch, has_failed) result(k)
        type(coordinate_watch), intent(in) :: watch
        logical, intent(in) :: has_failed           !! the run cannot go on: near is enough
        real(wp) :: good(size(watch%least))

        good = good_ratios(watch)
        do k = size(watch%variable), 1, -1
            if (any(abs(watch%ratio(:, k)) > merge(good_growth, dead_growth, has_failed)*good(k))) return
        end do
    end function dead_coordinate

    !> Has the ratio of any joint to a coordinate grown by much, or will it, before some more steps are done?
    pure logical function is_near_dead_point(watch) result(is_near)
        type(coordinate_watch), intent(in) :: watch
        real(wp) :: good(size(watch%least))
        integer :: v, k

        good = good_ratios(watch)
        is_near = .false.
        do k = 1, size(watch%variable)
            do v = 1, size(watch%joint)
                associate (now => watch%ratio(v, k), before => watch%before(v, k))
                    is_near = is_near .or. (grows(now, before) .and. abs(now) > largest_growth*good(k))
                end associate
            end do
        end do
    end function is_near_dead_point

    !> Is a state so far past where a coordinate should be exchanged, seen from the accepted one, that the coordinate has said
    !> too little of the step? Errors of the coordinate are errors of the motion times the ratio.
    pure logical function is_well_past(watch, accepted)
        type(coordinate_watch), intent(in) :: watch
        real(wp), intent(in) :: accepted(:, :)      !! ratios there (n_variable, n_q)
        real(wp) :: bound(size(watch%least))

        bound = jump*max(largest_growth*good_ratios(watch), maxval(abs(accepted), dim=1))
        is_well_past = any(maxval(abs(watch%ratio), dim=1) > bound)
    end function is_well_past
end module linkdyn_coordinate_watch
