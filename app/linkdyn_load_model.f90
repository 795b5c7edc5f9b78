!> A scene file as the model that all commands begin with.
module linkdyn_load_model
    use linkdyn_builder, only: build_model
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: scene_type, put_file_first
    use linkdyn_scene_reader, only: read_scene, check_actuators
    use linkdyn_status, only: status_type
    use linkdyn_terminal, only: show_stage
    implicit none (type, external)
    private
    public :: load_model

contains

    !> Read and plan a scene; messages start with the file's name.
    subroutine load_model(file, is_inverse, model, status)
        character(len=*), intent(in) :: file
        logical, intent(in) :: is_inverse             !! every coordinate needs its actuator
        type(model_type), intent(out) :: model
        type(status_type), intent(inout) :: status
        type(scene_type) :: scene

        call show_stage("reading and planning")
        call read_scene(file, scene, status)
        if (status%is_ok() .and. is_inverse) call check_actuators(scene, status)
        if (status%is_ok()) call build_model(scene, model, status)
        if (.not. status%is_ok()) call put_file_first(file, scene, status%message)
    end subroutine load_model
end module linkdyn_load_model
