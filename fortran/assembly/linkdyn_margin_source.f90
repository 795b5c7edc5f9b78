!> Whoever knows, at many places at once, how far a mechanism's closed forms are from where assemblies meet.
module linkdyn_margin_source
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: margin_source

    type, abstract :: margin_source
    contains
        procedure(find_margins), deferred :: find
    end type margin_source

    abstract interface
        !> Margins at some places, and their rates for ways from there.
        subroutine find_margins(self, at, way, branch, place, margin, drift, is_closed)
            import :: margin_source, wp
            class(margin_source), intent(in) :: self
            real(wp), intent(in), contiguous, target :: at(:, :), way(:, :)           !! (n_q, n)
            real(wp), intent(in), contiguous, target :: branch(:)                     !! on which assembly (n_branch)
            real(wp), intent(in), contiguous, target :: place(:, :, :)                !! of groups' links (place_size, n_link, n or
                                                                                      !! 0)
            real(wp), intent(out), contiguous, target :: margin(:, :), drift(:, :)    !! (n_branch, n)
            logical, intent(out) :: is_closed(:)                                      !! (n)
        end subroutine find_margins
    end interface
end module linkdyn_margin_source
