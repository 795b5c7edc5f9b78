!> What the caller of a batch gives: the motion, the loads, and what acts or holds by the side. It stays where the caller has it.
module linkdyn_motion_batch
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: motion_batch, motion_of

    !> What is not associated is not given.
    type :: motion_batch
        real(wp), pointer, contiguous :: q(:, :) => null()          !! (n_q, n)
        real(wp), pointer, contiguous :: qd(:, :) => null()         !! (n_q, n)
        real(wp), pointer, contiguous :: qdd(:, :) => null()        !! (n_q, n)
        real(wp), pointer, contiguous :: load(:, :, :) => null()    !! (6, n_load, n), or one for all
        real(wp), pointer :: t(:) => null()                         !! instants [s] (n), or one for all; not given: 0
        real(wp), pointer :: quaternion(:, :, :) => null()          !! of attitudes, 0 where angles give them; the others' rates are
                                                                    !! angular velocities (4, n_attitude, n)
        real(wp), pointer :: given_force(:, :) => null()            !! (n_actuator, n), read where not unknown
        real(wp), pointer :: stop_force(:, :) => null()             !! of stops at which something rests (n_stop, n) [N, N m]
        real(wp), pointer :: clutch_force(:, :) => null()           !! (n_clutch, n) [N, N m]
        real(wp), pointer :: contact_sense(:, :, :) => null()       !! of joints that may stick, as of `friction_state`
                                                                    !! (n_part, n_contact, n); not given: 0
    contains
        procedure :: is_turned
        procedure :: part => part_of_motion
    end type motion_batch

contains

    !> The motion and the loads. What else is given is added by the caller.
    function motion_of(q, qd, qdd, load) result(motion)
        real(wp), intent(in), pointer, contiguous :: q(:, :), qd(:, :), qdd(:, :)    !! (n_q, n)
        real(wp), intent(in), pointer, contiguous :: load(:, :, :)  !! (6, n_load, n), or one for all
        type(motion_batch) :: motion

        motion%q(1:, 1:) => q                                       ! a target may count from elsewhere
        motion%qd(1:, 1:) => qd
        motion%qdd(1:, 1:) => qdd
        motion%load(1:, 1:, 1:) => load
    end function motion_of

    !> Do attitudes of a sample go by quaternions?
    pure logical function is_turned(self, sample)
        class(motion_batch), intent(in) :: self
        integer, intent(in) :: sample

        is_turned = .false.
        if (associated(self%quaternion)) is_turned = any(self%quaternion(:, :, sample) /= 0)
    end function is_turned

    !> Some samples, as if there were no others.
    function part_of_motion(whole, first, last) result(part)
        class(motion_batch), intent(in) :: whole
        integer, intent(in) :: first, last                          !! samples
        type(motion_batch) :: part

        part%q => whole%q(:, first:last)
        part%qd => whole%qd(:, first:last)
        part%qdd => whole%qdd(:, first:last)
        part%load => whole%load
        if (size(whole%load, 3) > 1) part%load => whole%load(:, :, first:last)
        part%t => whole%t
        if (associated(whole%t)) then
            if (size(whole%t) > 1) part%t => whole%t(first:last)
        end if
        if (associated(whole%quaternion)) part%quaternion => whole%quaternion(:, :, first:last)
        if (associated(whole%given_force)) part%given_force => whole%given_force(:, first:last)
        if (associated(whole%stop_force)) part%stop_force => whole%stop_force(:, first:last)
        if (associated(whole%clutch_force)) part%clutch_force => whole%clutch_force(:, first:last)
        if (associated(whole%contact_sense)) part%contact_sense => whole%contact_sense(:, :, first:last)
    end function part_of_motion
end module linkdyn_motion_batch
