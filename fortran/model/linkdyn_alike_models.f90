!> Which models differ in their numbers alone: kernels that take these for inputs serve all of them.
!>
!> What `linkdyn_numbers` lists may vary. Whatever else equations of motion are traced from is in the key: what the mechanism is
!> made of, and numbers that kernels hold as constants (of surfaces that rub, payloads, markers that measures look at, curves of
!> cams), bit by bit: designs that vary one of those are not alike. Reactions that are shared among joints, and springs that may
!> lose their direction, are alike to none: of these somebody asks by kernels that are the model's own.
module linkdyn_alike_models
    use linkdyn_base_motion, only: base_is_felt
    use linkdyn_joint_table, only: joint_cam
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_numbers, only: number_places, place_numbers, collect_numbers, to_frame, of_marker, of_stance
    use linkdyn_payloads, only: payload_is_input
    use linkdyn_scene, only: scene_type, law_over, pulls_in_line, n_stop, n_clutch, marker_at, marker_axes_at
    use linkdyn_step_part, only: letters_of, bits_of, curve_text
    use linkdyn_text, only: listed
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

        key = ""
        allocate (varying(0))
        if (.not. may_be_alike(model)) return
        call find_pattern(model, pattern, varying)
        key = mechanism_text(model)//forces_text(model)//surfaces_text(model)//payloads_text(model)//measures_text(model%scene) &
              //" "//pattern
    end subroutine describe_alike

    pure logical function may_be_alike(model)
        type(model_type), intent(in) :: model

        may_be_alike = model%share%n == 0 .and. .not. model%share%may_gape .and. .not. any(pulls_in_line(model%scene%spring))
    end function may_be_alike

    ! ---------------------------------------------------------------- what a model is

    !> Links, joints, coordinates, and in which order they are placed.
    function mechanism_text(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text
        integer :: i

        text = listed([merge(2, 3, model%is_planar), model%n_joint, model%n_attitude, model%n_branch, model%link%orientation])
        do i = 1, size(model%joint)
            text = text//joint_text(model, i)
        end do
        do i = 1, model%n_q
            associate (c => model%scene%coordinate(i))
                text = text//" q"//listed([c%kind, c%joint, c%variable, c%link, c%for_joint, c%for_variable])
            end associate
        end do
        do i = 1, size(model%led)
            associate (led => model%led(i))
                text = text//" led"//listed([led%joint, led%variable, led%source])
            end associate
        end do
        do i = 1, size(model%step)
            associate (step => model%step(i))
                text = text//" step"//listed([step%kind, step%link, step%joint, step%coordinate, step%first, step%branch, &
                                              step%turn, step%far_turn, merge(1, 0, [step%from_second, &
                                              step%base_moves, step%has_branches])])
            end associate
        end do
        if (model%scene%base%moves) text = text//" base"//listed(merge(1, 0, base_is_felt(model)))
    end function mechanism_text

    function joint_text(model, i) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        character(len=:), allocatable :: text

        associate (joint => model%joint(i))
            text = " joint"//listed([joint%kind, joint%told_kind, joint%link, joint%attitude, joint%gear, joint%belt, joint%cam])
            if (joint%gear > 0) then
                associate (gear => model%gear(joint%gear))
                    text = text//" gear"//listed([gear%carrier, merge(1, 0, gear%follows), gear%carries])
                end associate
            end if
            if (joint%belt > 0) text = text//" belt"//listed([model%belt(joint%belt)%gear%carrier, model%belt(joint%belt)%joint])
            if (joint%kind == joint_cam) text = text//" cam"//curve_text(model%scene%joint(joint%told)%cam)
        end associate
    end function joint_text

    !> Drives, loads, springs, clutches, stops.
    function forces_text(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text
        integer :: i

        text = ""
        do i = 1, model%n_actuator
            associate (actuator => model%scene%actuator(i))
                text = text//" actuator"//listed([actuator%joint, actuator%variable, actuator%law%kind]) &
                       //bits_of([actuator%share, actuator%preload])
            end associate
        end do
        text = text//" motors"//listed([model%motor%actuator])
        do i = 1, model%n_load
            associate (load => model%scene%load(i))
                text = text//" load"//listed([load%link, load%axes])
            end associate
        end do
        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                text = text//" spring"//listed([spring%joint, spring%variable, spring%link, spring%measure, &
                                                merge(1, 0, spring%force%kind == law_over)])
            end associate
        end do
        do i = 1, n_clutch(model%scene)
            associate (clutch => model%scene%clutch(i))
                text = text//" clutch"//listed([clutch%n_side, clutch%measure, clutch%friction, clutch%lead]) &
                       //bits_of([clutch%ratio])
            end associate
        end do
        do i = 1, n_stop(model%scene)
            associate (stop => model%scene%stop(i))
                text = text//" stop"//listed([stop%measure, stop%side, merge(1, 0, stop%is_hard)])
            end associate
        end do
    end function forces_text

    ! ---------------------------------------------------------------- numbers that kernels hold

    !> Where joints rub. Coefficients of friction come in from outside.
    function surfaces_text(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text
        integer :: i

        text = ""
        do i = 1, size(model%contact)
            associate (c => model%contact(i))
                text = text//" contact"//listed([c%joint, c%form, c%side]) &
                       //bits_of([c%creep_speed, c%radius, c%length, c%preload, c%pitch, c%slant, c%back, c%pass, &
                                c%way, c%spin(:, 1), c%spin(:, 2), c%slide_damping, c%turn_damping])
            end associate
        end do
    end function surfaces_text

    function payloads_text(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text
        logical :: is_input(size(model%payload))
        integer :: i

        text = ""
        is_input = payload_is_input(model)
        do i = 1, size(model%payload)
            associate (payload => model%payload(i))
                text = text//" payload"//listed([payload%link])//bits_of([payload%body%cog, [payload%body%inertia]])
                if (.not. is_input(i)) text = text//bits_of([model%scene%payload(i)%mass%value(1)])
            end associate
        end do
    end function payloads_text

    !> Forces act along measures.
    function measures_text(scene) result(text)
        type(scene_type), intent(in) :: scene
        character(len=:), allocatable :: text
        integer :: i, side

        text = ""
        do i = 1, size(scene%laws%measure)
            associate (spec => scene%laws%measure(i))
                text = text//" measure"//listed([spec%kind, spec%joint, spec%variable, spec%link, spec%marker, spec%component, &
                                                 spec%spring, spec%stop, merge(1, 0, spec%is_rate)])
                do side = 1, 2
                    if (spec%marker(side) > 0) text = text//bits_of([marker_at(scene, spec%link(side), spec%marker(side)), &
                                                                     marker_axes_at(scene, spec%link(side), spec%marker(side))])
                end do
            end associate
        end do
    end function measures_text

    !> What is zero, and axes along others, fold: they belong to what the model is. A letter for each number.
    subroutine find_pattern(model, pattern, varying)
        type(model_type), intent(in) :: model
        character(len=:), allocatable, intent(out) :: pattern
        integer, allocatable, intent(out) :: varying(:)
        type(number_places) :: at
        real(wp), allocatable :: number(:)
        logical, allocatable :: varies(:)
        integer :: i, side, k, last

        call place_numbers(model, at)
        allocate (number(at%n))
        call collect_numbers(model, at, number)
        varies = number /= 0
        do i = 1, size(model%joint)
            do side = 1, 2
                k = at%marker(side, i) + to_frame
                last = at%marker(side, i) + of_marker - 1
                varies(k:last) = varies(k:last) .and. abs(number(k:last)) /= 1
            end do
        end do
        do i = 1, size(model%step)
            k = at%stance(i)
            last = k + of_stance - 1
            if (k > 0) varies(k:last) = varies(k:last) .and. abs(number(k:last)) /= 1
        end do
        pattern = letters_of(number, varies)
        varying = pack([(k, k=1, at%n)], varies)
    end subroutine find_pattern
end module linkdyn_alike_models
