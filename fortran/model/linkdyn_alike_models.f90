!> Which models differ in their numbers alone: kernels that take these for inputs serve all of them.
!>
!> Told are models whose physics `linkdyn_numbers` lists whole. What rubs, is geared, driven behind a gearbox or by laws over the state,
!> carried, or shared among joints has numbers of its own beside that list: such models are alike to none, nor are those with springs
!> that may lose their direction, of which somebody asks by kernels without such inputs.
module linkdyn_alike_models
    use linkdyn_joint_table, only: joint_cam
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_numbers, only: number_places, place_numbers, collect_numbers
    use linkdyn_scene, only: law_over, pulls_in_line, n_stop, n_clutch
    use linkdyn_step_part, only: listed, letters_of
    implicit none (type, external)
    private
    public :: describe_alike

contains

    !> A key that models have in common which differ in the numbers alone that vary; empty: nothing is alike.
    subroutine describe_alike(model, key, varying)
        type(model_type), intent(in) :: model
        character(len=:), allocatable, intent(out) :: key
        integer, allocatable, intent(out) :: varying(:)    !! places in the list of numbers
        character(len=:), allocatable :: pattern
        integer :: i

        key = ""
        allocate (varying(0))
        if (.not. is_listed(model)) return
        call find_pattern(model, pattern, varying)
        key = listed([merge(2, 3, model%is_planar), model%n_joint, model%n_attitude, model%n_branch, model%link%orientation])
        do i = 1, size(model%joint)
            associate (joint => model%joint(i))
                key = key//" joint"//listed([joint%kind, joint%told_kind, joint%link, joint%attitude])
            end associate
        end do
        do i = 1, model%n_q
            associate (c => model%scene%coordinate(i))
                key = key//" q"//listed([c%kind, c%joint, c%variable, c%link, c%for_joint, c%for_variable])
            end associate
        end do
        do i = 1, model%n_actuator
            associate (actuator => model%scene%actuator(i))
                key = key//" actuator"//listed([actuator%joint, actuator%variable, actuator%drive%kind])
            end associate
        end do
        do i = 1, model%n_load
            associate (load => model%scene%load(i))
                key = key//" load"//listed([load%link, load%axes])
            end associate
        end do
        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                key = key//" spring"//listed([spring%joint, spring%variable, spring%link])
            end associate
        end do
        do i = 1, size(model%step)
            associate (step => model%step(i))
                key = key//" step"//listed([step%kind, step%link, step%joint, step%coordinate, step%first, step%branch, step%turn, &
                                            merge(1, 0, [step%from_second, step%base_moves, step%has_branches])])
            end associate
        end do
        key = key//" "//pattern
    end subroutine describe_alike

    !> Are all numbers that equations of motion ask for in the list?
    pure logical function is_listed(model)
        type(model_type), intent(in) :: model

        associate (scene => model%scene)
            is_listed = size(model%contact) + size(model%gear) + size(model%belt) + size(model%led) + size(model%loose) &
                        + size(model%payload) + size(model%motor) + n_stop(scene) + n_clutch(scene) + size(scene%laws%law) == 0 &
                        .and. model%share%n == 0 .and. .not. (model%share%may_gape .or. scene%base%moves) &
                        .and. all(model%link%spin == 0) .and. all(model%joint%kind /= joint_cam) &
                        .and. all(scene%spring%force%kind /= law_over .and. .not. pulls_in_line(scene%spring))
        end associate
    end function is_listed

    !> What is zero, and axes along others, fold: they belong to what the model is. A letter for each number.
    subroutine find_pattern(model, pattern, varying)
        type(model_type), intent(in) :: model
        character(len=:), allocatable, intent(out) :: pattern
        integer, allocatable, intent(out) :: varying(:)
        type(number_places) :: at
        real(wp), allocatable :: number(:)
        logical, allocatable :: varies(:)
        integer :: i, side, k

        call place_numbers(model, at)
        allocate (number(at%n))
        call collect_numbers(model, at, number)
        varies = number /= 0
        do i = 1, size(model%joint)
            do side = 1, 2
                k = at%marker(side, i) + 3
                varies(k:k + 17) = varies(k:k + 17) .and. abs(number(k:k + 17)) /= 1
            end do
        end do
        pattern = letters_of(number, varies)
        varying = pack([(k, k=1, at%n)], varies)
    end subroutine find_pattern
end module linkdyn_alike_models
