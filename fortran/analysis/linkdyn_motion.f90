!> The scene's own motion: coordinates and loads at given times.
module linkdyn_motion
    use linkdyn_kinds, only: wp
    use linkdyn_laws, only: evaluate_law
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: law_none
    implicit none (type, external)
    private
    public :: evaluate_motion, evaluate_loads, sample_count, sample_times

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

    !> Coordinates with derivatives, and the components of all loads. A coordinate without a law rests at its start.
    pure subroutine evaluate_motion(model, t, q, qd, qdd, load)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(:)             !! [s] (n)
        real(wp), intent(out) :: q(:, :)         !! (n_q, n)
        real(wp), intent(out) :: qd(:, :), qdd(:, :)
        real(wp), intent(out) :: load(:, :, :)   !! (6, n_load, n)
        integer :: i, k

        do i = 1, size(t)
            do k = 1, model%n_q
                associate (coordinate => model%scene%coordinate(k))
                    if (coordinate%motion%kind == law_none) then
                        q(k, i) = coordinate%start_position
                        qd(k, i) = 0
                        qdd(k, i) = 0
                    else
                        call evaluate_law(coordinate%motion, t(i), q(k, i), qd(k, i), qdd(k, i))
                    end if
                end associate
            end do
        end do
        call evaluate_loads(model, t, load)
    end subroutine evaluate_motion

    !> Components of all loads; one without a law is zero.
    pure subroutine evaluate_loads(model, t, load)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(:)             !! [s] (n)
        real(wp), intent(out) :: load(:, :, :)   !! (6, n_load, n)
        real(wp) :: rate, rate2
        integer :: i, j, k

        load = 0
        do i = 1, size(t)
            do j = 1, model%n_load
                do k = 1, 3
                    associate (spec => model%scene%load(j))
                        if (spec%force(k)%kind /= law_none) call evaluate_law(spec%force(k), t(i), load(k, j, i), rate, rate2)
                        if (spec%moment(k)%kind /= law_none) &
                            call evaluate_law(spec%moment(k), t(i), load(3 + k, j, i), rate, rate2)
                    end associate
                end do
            end do
        end do
    end subroutine evaluate_loads
end module linkdyn_motion
