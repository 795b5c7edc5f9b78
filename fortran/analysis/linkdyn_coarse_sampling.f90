!> Whether the samples of a motion lie close enough to each other for peaks to be seen.
!>
!> Forces go with angles and accelerations. Where an angle turns by more than 15 degrees from sample to sample a first harmonic of
!> it may be missed by 0.9 %, a fourth one by 13 %. A coordinate that swings, or starts and stops, is as coarse where its
!> accelerations are those of an oscillation through its range which goes through more than that from sample to sample. Screws turn
!> many times on their way, and nothing hangs on how far round they are.
module linkdyn_coarse_sampling
    use linkdyn_constants, only: pi
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, is_length, is_screw
    use linkdyn_text, only: quoted, to_text
    implicit none (type, external)
    private
    public :: coarse_in_words

    real(wp), parameter :: coarse = 15*pi/180          !! of a turn or an oscillation, from sample to sample
    real(wp), parameter :: fine = 5*pi/180             !! that is advised

contains

    !> "'crank' turns by 180 deg from sample to sample, ..."; blank where samples lie close, or tell nothing of that.
    pure function coarse_in_words(model, t, q, qd, qdd) result(text)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(:)                   !! [s] (n)
        real(wp), intent(in), dimension(:, :) :: q, qd, qdd    !! (n_q, n)
        character(len=:), allocatable :: text
        real(wp) :: turn, swing, amplitude, most
        integer :: k, worst
        logical :: turns

        text = ""
        if (size(t) < 2) return
        worst = 0
        most = coarse
        turns = .false.
        do k = 1, model%n_q
            turn = 0
            if (.not. (is_length(model, k) .or. is_screw(model, k))) turn = widest(t, qd(k, :))
            swing = 0
            amplitude = (maxval(q(k, :)) - minval(q(k, :)))/2
            if (amplitude > epsilon(1.0_wp)*maxval(abs(q(k, :)))) swing = widest(t, sqrt(abs(qdd(k, :))/amplitude))
            if (.not. max(turn, swing) > most) cycle
            if (max(turn, swing) > huge(1.0_wp)) cycle
            worst = k
            most = max(turn, swing)
            turns = turn >= swing
        end do
        if (worst == 0) return
        text = quoted(model%scene%coordinate(worst)%name)//trim(merge(" turns by  ", " swings by ", turns))//" " &
               //to_text(nint(most*180/pi))//" deg"
        if (.not. turns) text = text//" of an oscillation"
        text = text//" from sample to sample: peaks between them are not seen (expected "// &
               to_text(ceiling((size(t) - 1)*min(most/fine, 1.0e6_wp/size(t))*(1 - 1.0e-9_wp)) + 1)//" samples)"
    end function coarse_in_words

    !> The most that anything of such a rate goes from one sample to the next: by the rates at both.
    pure real(wp) function widest(t, rate)
        real(wp), intent(in) :: t(:), rate(:)

        widest = maxval((t(2:) - t(:size(t) - 1))*max(abs(rate(2:)), abs(rate(:size(rate) - 1))))
    end function widest
end module linkdyn_coarse_sampling
