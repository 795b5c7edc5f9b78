!> Motors whose torque is given and whose gear or screw loses some of it.
module linkdyn_lossy_motors
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: side_joint
    implicit none (type, external)
    private
    public :: lossy_motors

contains

    pure function lossy_motors(model, is_given) result(lossy)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_given(:)             !! forces of actuators (n_actuator)
        integer, allocatable :: lossy(:)               !! of `model%motor`
        integer :: i

        allocate (lossy(0))
        do i = 1, size(model%motor)
            associate (spec => model%scene%actuator(model%motor(i)%actuator))
                if (spec%law%side == side_joint .or. .not. is_given(model%motor(i)%actuator)) cycle
                if (spec%motor%efficiency < 1 .or. spec%motor%back_efficiency < 1) lossy = [lossy, i]
            end associate
        end do
    end function lossy_motors
end module linkdyn_lossy_motors
