!> The scene's own motion: coordinates and loads at given times.
module linkdyn_motion
    use linkdyn_angles, only: is_near_pole
    use linkdyn_given_attitudes, only: take_attitudes
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_laws, only: law_instants, most_instants, set_instants, evaluate_at_instants, motion_at_instants
    use linkdyn_model, only: model_type, gives_attitude, attitude_angles
    use linkdyn_scene, only: law_spec, law_none, law_constant, law_over
    use linkdyn_table, only: table_place, find_places, attitude_at
    implicit none (type, external)
    private
    public :: evaluate_motion, evaluate_loads, loads_are_constant, is_constant, lane_loads, sample_count, sample_times

contains

    !> Number of instants of the run.
    pure integer function sample_count(model)
        type(model_type), intent(in) :: model

        sample_count = max(1, model%scene%time%n_sample)
    end function sample_count

    !> Some instants of the run, which includes both ends.
    pure subroutine sample_times(model, first, t)
        type(model_type), intent(in) :: model
        integer, intent(in) :: first             !! number of the first one, from 1
        real(wp), intent(out) :: t(:)            !! [s] (n)
        integer :: i, n

        n = sample_count(model)
        associate (time => model%scene%time)
            do i = 1, size(t)
                t(i) = time%first
                if (n > 1) t(i) = time%first + (time%last - time%first)*(real(first - 2 + i, wp)/real(n - 1, wp))
            end do
        end associate
    end subroutine sample_times

    !> Coordinates with derivatives, and the components of all loads.
    !>
    !> Where tables of quaternions lead an attitude near its pole, the rates of its angles are not numbers. Who can go by the
    !> attitude itself asks for it, and gets them as well as they are known.
    pure subroutine evaluate_motion(model, t, q, qd, qdd, load, attitude)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(:)             !! [s] (n)
        real(wp), intent(out) :: q(:, :)         !! (n_q, n)
        real(wp), intent(out) :: qd(:, :), qdd(:, :)
        real(wp), intent(out) :: load(:, :, :)   !! (6, n_load, n)
        real(wp), intent(out), optional :: attitude(:, :, :)    !! of samples that have to go by it, of others 0
                                                                !! (attitude_size, n_attitude, n)
        type(law_instants) :: instants
        integer :: first, last, k

        do first = 1, size(t), most_instants
            last = min(size(t), first + most_instants - 1)
            call set_instants(instants, t(first:last))
            do k = 1, model%n_q
                call motion_at_instants(model%scene%coordinate(k), instants, q(k, first:last), qd(k, first:last), &
                                        qdd(k, first:last))
            end do
        end do
        call evaluate_loads(model, t, load)
        if (.not. present(attitude)) return
        attitude = 0
        if (any(model%scene%coordinate%motion%angle > 0)) call pass_poles(model, t, q, qd, qdd, attitude)
    end subroutine evaluate_motion

    !> Instants at which an attitude that a table of quaternions tells is near its pole.
    pure subroutine pass_poles(model, t, q, qd, qdd, attitude)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(:)
        real(wp), intent(inout) :: q(:, :), qd(:, :), qdd(:, :), attitude(:, :, :)
        real(wp) :: angle(3)
        type(table_place) :: place(1)
        integer :: i, s, near, c(3)

        near = 1
        do s = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(s))) cycle
            c = attitude_angles(model%step(s))
            associate (law => model%scene%coordinate(c(1))%motion, first => model%step(s)%first)
                if (law%angle == 0) cycle
                do i = 1, size(t)
                    if (.not. is_near_pole(q(c, i))) cycle
                    call find_places(law%time, t(i:i), near, place)
                    call attitude_at(law, place(1), attitude(:4, first, i), attitude(5:7, first, i), attitude(8:10, first, i))
                    angle = q(c, i)                      ! with its turns
                    call take_attitudes(model, attitude(:, :, i:i), q(:, i:i), qd(:, i:i), qdd(:, i:i))
                    q(c, i) = angle
                end do
            end associate
        end do
    end subroutine pass_poles

    !> Components of all loads; one without a law is zero.
    pure subroutine evaluate_loads(model, t, load)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(:)             !! [s] (n)
        real(wp), intent(out) :: load(:, :, :)   !! (6, n_load, n)
        type(law_instants) :: instants
        integer :: first, last, i, j, k

        do first = 1, size(t), most_instants
            last = min(size(t), first + most_instants - 1)
            call set_instants(instants, t(first:last))
            do j = 1, model%n_load
                associate (spec => model%scene%load(j))
                    do k = 1, 3
                        load(k, j, first) = constant_value(spec%force(k))
                        load(3 + k, j, first) = constant_value(spec%moment(k))
                    end do
                end associate
            end do
            do i = first + 1, last
                load(:, :, i) = load(:, :, first)
            end do
            do j = 1, model%n_load
                associate (spec => model%scene%load(j))
                    do k = 1, 3
                        if (.not. is_constant(spec%force(k))) &
                            call evaluate_at_instants(spec%force(k), instants, load(k, j, first:last))
                        if (.not. is_constant(spec%moment(k))) &
                            call evaluate_at_instants(spec%moment(k), instants, load(3 + k, j, first:last))
                    end do
                end associate
            end do
        end do
    end subroutine evaluate_loads

    !> Loads of the scene at the instants of the lanes.
    subroutine lane_loads(model, t, load)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(inout) :: load(:, :, :)       !! (lane, 6, n_load)
        real(wp) :: now(6, model%n_load, 1)
        integer :: lane

        if (model%n_load == 0) return
        do lane = 1, lanes
            if (lane == 1) then
                call evaluate_loads(model, t(1:1), now)
            else if (t(lane) /= t(lane - 1)) then
                call evaluate_loads(model, t(lane:lane), now)
            end if
            load(lane, :, :) = now(:, :, 1)
        end do
    end subroutine lane_loads

    !> Do no loads change with time?
    pure logical function loads_are_constant(model)
        type(model_type), intent(in) :: model
        integer :: j, k

        loads_are_constant = .true.
        do j = 1, model%n_load
            associate (spec => model%scene%load(j))
                do k = 1, 3
                    loads_are_constant = loads_are_constant .and. is_constant(spec%force(k)) .and. is_constant(spec%moment(k))
                end do
            end associate
        end do
    end function loads_are_constant

    pure elemental logical function is_constant(law)
        type(law_spec), intent(in) :: law

        is_constant = law%kind == law_none .or. law%kind == law_constant .or. law%kind == law_over
    end function is_constant

    !> Zero for a law that is not constant; of one over the state time gives nothing.
    pure real(wp) function constant_value(law)
        type(law_spec), intent(in) :: law

        constant_value = 0
        if (law%kind == law_constant) constant_value = law%value(1)
    end function constant_value
end module linkdyn_motion
