!> Attitudes that a caller knows as quaternions, with angular velocity and acceleration, as coordinates of the scene.
!>
!> Where none of a sample's attitudes is near its pole the angles' rates tell the same motion, and the sample is computed as any
!> other. Else all attitudes of the sample go by their quaternions.
module linkdyn_given_attitudes
    use linkdyn_angles, only: angles_of_matrix, matrix_of_angles, matrix_of_quaternion, quaternion_of_matrix, find_rotation_fault, &
        spin_of_angles, angles_by_spin, is_near_pole
    use linkdyn_constants, only: pi
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, gives_attitude, attitude_angles, has_assemblies
    use linkdyn_scene, only: name_len
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text, quoted
    implicit none (type, external)
    private
    public :: attitude_name, attitudes_of_matrices, take_attitudes, turn_by_quaternion, refuse_way_past_pole

    integer, parameter, public :: attitude_size = 10    !! w x y z, angular velocity, angular acceleration
    integer, parameter, public :: rotation_size = 15    !! matrix row by row, angular velocity, angular acceleration

contains

    !> The link of a pose, or the ball joint, whose attitude this is.
    pure function attitude_name(model, attitude) result(name)
        type(model_type), intent(in) :: model
        integer, intent(in) :: attitude                !! number of it
        character(len=name_len) :: name
        integer :: s, c(3)

        name = ""
        do s = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(s))) cycle
            if (model%step(s)%first /= attitude) cycle
            c = attitude_angles(model%step(s))
            name = model%scene%coordinate(c(1))%name
            name = name(:index(name, ".", back=.true.) - 1)
        end do
    end function attitude_name

    !> Attitudes with rotation matrices as those with the quaternions of the nearest rotations.
    !>
    !> **Errors**: bad input for a matrix that is no rotation, with its sample.
    subroutine attitudes_of_matrices(model, rotation, attitude, status)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: rotation(:, :, :)      !! (rotation_size, n_attitude, n); matrix 0: by its angles
        real(wp), intent(out) :: attitude(:, :, :)     !! (attitude_size, n_attitude, n)
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: fault
        real(wp) :: r(3, 3)
        integer :: i, k

        attitude(:4, :, :) = 0
        attitude(5:, :, :) = rotation(10:, :, :)
        do i = 1, size(rotation, 3)
            do k = 1, size(rotation, 2)
                if (all(rotation(:9, k, i) == 0)) cycle
                r = transpose(reshape(rotation(:9, k, i), [3, 3]))
                call find_rotation_fault(r, fault)
                if (fault /= "") then
                    call fail(status, status_bad_input, "sample "//to_text(i - 1)//" (the first is 0): the rotation of " &
                              //quoted(trim(attitude_name(model, k)))//" "//fault)
                    return
                end if
                attitude(:4, k, i) = quaternion_of_matrix(r)
            end do
        end do
    end subroutine attitudes_of_matrices

    !> Attitudes in, their quaternions of any length; angles and their rates out, which near a pole are as large as need be. What is
    !> left in the attitudes is of samples that have to go by them.
    pure subroutine take_attitudes(model, attitude, q, qd, qdd)
        type(model_type), intent(in) :: model
        real(wp), intent(inout) :: attitude(:, :, :)   !! (attitude_size, n_attitude, n); 0: by its angles
        real(wp), intent(inout) :: q(:, :), qd(:, :), qdd(:, :)    !! (n_q, n)
        real(wp), dimension(3) :: angle, rate, rate2
        logical :: is_near
        integer :: i, s, c(3)

        do i = 1, size(attitude, 3)
            is_near = .false.
            do s = 1, size(model%step)
                if (.not. gives_attitude(model, model%step(s))) cycle
                c = attitude_angles(model%step(s))
                associate (its => attitude(:, model%step(s)%first, i))
                    if (all(its(:4) == 0)) cycle
                    its(:4) = its(:4)/norm2(its(:4))
                    angle = angles_of_matrix(matrix_of_quaternion(its(:4)))
                    if (has_assemblies(model)) angle = nearest_angles(angle, model%start_q(c))
                    call angles_by_spin(angle, its(5:7), its(8:10), rate, rate2)
                    q(c, i) = angle
                    qd(c, i) = rate
                    qdd(c, i) = rate2
                    is_near = is_near .or. is_near_pole(angle)
                end associate
            end do
            if (is_near) then
                call complete(model, q(:, i), qd(:, i), qdd(:, i), attitude(:, :, i))
            else
                attitude(:, :, i) = 0
            end if
        end do
    end subroutine take_attitudes

    !> The angles of the same attitude to which the way from the start is shortest: mechanisms that are assembled in several ways
    !> are led along it. Half a turn more of roll and yaw and pitch beyond a right angle are the same attitude, and so are whole
    !> turns. At pitch p a way of (r, y) is sqrt(r^2 + y^2 + 2 r y sin(p)) long: near a pole roll and yaw count together.
    pure function nearest_angles(angle, start) result(nearest)
        real(wp), intent(in) :: angle(3), start(3)     !! [rad]
        real(wp) :: nearest(3)
        real(wp) :: same(3), way(3), length, shortest
        integer :: i, j

        nearest = angle
        shortest = huge(1.0_wp)
        do i = -3, 3
            do j = -3 + modulo(i + 1, 2), 3, 2         ! half turns of both, or whole ones of both
                same = angle + [i*pi, 0.0_wp, j*pi]
                if (modulo(i, 2) == 1) same(2) = pi - angle(2)
                way = same - start
                length = way(1)**2 + way(2)**2 + way(3)**2 + 2*way(1)*way(3)*sin((same(2) + start(2))/2)
                if (.not. length < shortest) cycle
                shortest = length
                nearest = same
            end do
        end do
    end function nearest_angles

    !> Where one attitude of a sample has to go by its quaternion, so do those that are known by angles.
    pure subroutine complete(model, q, qd, qdd, attitude)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:), qd(:), qdd(:)    !! (n_q)
        real(wp), intent(inout) :: attitude(:, :)      !! (attitude_size, n_attitude)
        integer :: s, c(3)

        do s = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(s))) cycle
            c = attitude_angles(model%step(s))
            associate (its => attitude(:, model%step(s)%first))
                if (any(its(:4) /= 0)) cycle
                its(:4) = quaternion_of_matrix(matrix_of_angles(q(c)))
                call spin_of_angles(q(c), qd(c), qdd(c), its(5:7), its(8:10))
            end associate
        end do
    end subroutine complete

    !> Motion as `run_prepared` takes it: with angular velocities and accelerations in the places of the angles' rates, where
    !> attitudes go by quaternions.
    subroutine turn_by_quaternion(model, attitude, qd, qdd, spin, spin_rate, quaternion)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: attitude(:, :, :)      !! (attitude_size, n_attitude, n)
        real(wp), intent(in) :: qd(:, :), qdd(:, :)    !! (n_q, n)
        real(wp), allocatable, intent(out) :: spin(:, :), spin_rate(:, :), quaternion(:, :, :)
        integer :: i, s, c(3)

        spin = qd
        spin_rate = qdd
        quaternion = attitude(:4, :, :)
        do i = 1, size(attitude, 3)
            do s = 1, size(model%step)
                if (.not. gives_attitude(model, model%step(s))) cycle
                associate (its => attitude(:, model%step(s)%first, i))
                    if (all(its(:4) == 0)) cycle
                    c = attitude_angles(model%step(s))
                    spin(c, i) = its(5:7)
                    spin_rate(c, i) = its(8:10)
                end associate
            end do
        end do
    end subroutine turn_by_quaternion

    !> An assembly is followed along the angles' way from sample to sample, which past a pole is not the mechanism's.
    subroutine refuse_way_past_pole(model, attitude, t, status)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: attitude(:, :, :)      !! (attitude_size, n_attitude, n); 0: by its angles
        real(wp), intent(in) :: t(:)                   !! [s] (n)
        type(status_type), intent(inout) :: status
        integer :: i

        if (.not. status%is_ok() .or. .not. has_assemblies(model)) return
        do i = 1, size(t)
            if (all(attitude(:4, :, i) == 0)) cycle
            call fail(status, status_bad_input, "t = "//to_text(t(i))//" s: the attitude of "//quoted(leading_name())// &
                " is within 3 degrees of its pole, pitch 90 deg, where the assembly of loops is not followed along a motion "// &
                "(expected axes of the link in which the motion stays away from there, or samples one by one)")
            return
        end do

    contains

        !> Name of the first link that quaternions lead.
        function leading_name() result(name)
            character(len=:), allocatable :: name
            integer :: s

            name = ""
            do s = 1, size(model%step)
                if (.not. gives_attitude(model, model%step(s))) cycle
                if (.not. any(attitude(:4, model%step(s)%first, i) /= 0)) cycle
                name = trim(model%scene%link(model%step(s)%link(1))%name)
                return
            end do
        end function leading_name
    end subroutine refuse_way_past_pole
end module linkdyn_given_attitudes
