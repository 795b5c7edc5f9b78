!> All laws of a scene over time: of motions, drives, clutches, controllers, payloads, the frame, and loads.
module linkdyn_time_laws
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: law_spec, n_clutch, n_controller
    implicit none (type, external)
    private
    public :: laws_over_time

contains

    pure function laws_over_time(model) result(law)
        type(model_type), intent(in) :: model
        type(law_spec), allocatable :: law(:)
        integer :: i, k

        associate (scene => model%scene)
            law = [(scene%coordinate(i)%motion, i=1, model%n_q), (scene%actuator(i)%drive%target, i=1, model%n_actuator)]
            do i = 1, n_clutch(scene)
                law = [law, scene%clutch(i)%capacity]
            end do
            do i = 1, n_controller(scene)
                law = [law, scene%controller(i)%target, scene%controller(i)%feed_law]
            end do
            do i = 1, size(scene%payload)
                law = [law, scene%payload(i)%mass]
            end do
            law = [law, scene%base%motion]
            do i = 1, model%n_load
                law = [law, (scene%load(i)%force(k), scene%load(i)%moment(k), k=1, 3)]
            end do
        end associate
    end function laws_over_time
end module linkdyn_time_laws
