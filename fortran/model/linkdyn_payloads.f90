!> Masses that links carry, which may change with time: picked up, put down, filled, poured out.
!>
!> What joins or leaves does so with the velocity of its place on the link, so it pushes nothing: a payload of mass m(t) takes
!> the force m(t) a, and no more.
module linkdyn_payloads
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_kinds, only: wp
    use linkdyn_laws, only: law_instants, most_instants, set_instants, evaluate_at_instants
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: payload_changes
    implicit none (type, external)
    private
    public :: take_payloads, evaluate_payloads, payload_is_input

contains

    !> Bodies of a unit mass at the payloads' markers. Links that carry any are not without mass.
    subroutine take_payloads(model)
        type(model_type), intent(inout) :: model
        real(wp) :: tensor(3, 3)
        integer :: i

        allocate (model%payload(size(model%scene%payload)))
        do i = 1, size(model%payload)
            associate (spec => model%scene%payload(i), payload => model%payload(i))
                payload%link = spec%link
                payload%body%name = spec%name
                payload%body%mass = 1
                payload%body%cog = model%scene%link(spec%link)%marker(spec%marker)%at
                associate (e => spec%inertia)
                    tensor = reshape([e(1), e(4), e(6), e(4), e(2), e(5), e(6), e(5), e(3)], [3, 3])
                    payload%body%is_diagonal = all(e(4:6) == 0)
                end associate
                if (any(tensor /= 0)) payload%body%inertia = tensor/spec%mass%value(1)
                model%link(spec%link)%is_massless = .false.
            end associate
        end do
    end subroutine take_payloads

    !> Which payloads a record takes as inputs: those that change.
    pure function payload_is_input(model) result(is_input)
        type(model_type), intent(in) :: model
        logical :: is_input(size(model%payload))

        is_input = payload_changes(model%scene%payload)
    end function payload_is_input

    !> Masses at some instants; not a number where a law falls below zero.
    pure subroutine evaluate_payloads(model, t, mass)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(:)                   !! [s] (n)
        real(wp), intent(out) :: mass(:, :)            !! (n_payload, n) [kg]
        type(law_instants) :: instants
        integer :: first, last, k

        do first = 1, size(t), most_instants
            last = min(size(t), first + most_instants - 1)
            call set_instants(instants, t(first:last))
            do k = 1, size(model%payload)
                call evaluate_at_instants(model%scene%payload(k)%mass, instants, mass(k, first:last))
            end do
        end do
        do k = 1, size(model%payload)
            associate (spec => model%scene%payload(k))
                where (mass(k, :) < 0) mass(k, :) = ieee_value(1.0_wp, ieee_quiet_nan)
                where (t < spec%from .or. t >= spec%until) mass(k, :) = 0
            end associate
        end do
    end subroutine evaluate_payloads
end module linkdyn_payloads
