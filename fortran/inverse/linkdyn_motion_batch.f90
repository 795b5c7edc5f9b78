!> What the caller of a batch gives: the motion, the loads, and what acts or holds by the side. It stays where the caller has it.
module linkdyn_motion_batch
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: motion_batch

    !> What is not associated is not given.
    type :: motion_batch
        real(wp), pointer, contiguous :: q(:, :) => null()          !! (n_q, n)
        real(wp), pointer, contiguous :: qd(:, :) => null()         !! (n_q, n)
        real(wp), pointer, contiguous :: qdd(:, :) => null()        !! (n_q, n)
        real(wp), pointer, contiguous :: load(:, :, :) => null()    !! (6, n_load, n), or one for all
        real(wp), pointer :: t(:) => null()                         !! instants [s] (n), or one for all; not given: 0
        real(wp), pointer :: quaternion(:, :, :) => null()          !! of attitudes, 0 where angles give them (4, n_attitude, n)
        real(wp), pointer :: given_force(:, :) => null()            !! (n_actuator, n), read where not unknown
        real(wp), pointer :: stop_force(:, :) => null()             !! (n_stop, n) [N, N m]
        real(wp), pointer :: clutch_force(:, :) => null()           !! (n_clutch, n) [N, N m]
        real(wp), pointer :: contact_sense(:, :) => null()          !! of joints that may stick (n_contact, n)
    contains
        procedure :: is_turned
    end type motion_batch

contains

    !> Do attitudes of a sample go by quaternions?
    pure logical function is_turned(self, sample)
        class(motion_batch), intent(in) :: self
        integer, intent(in) :: sample

        is_turned = .false.
        if (associated(self%quaternion)) is_turned = any(self%quaternion(:, :, sample) /= 0)
    end function is_turned
end module linkdyn_motion_batch
