!> The program that measures what laws depend on: from coordinates and their rates to joint variables, places and velocities of
!> markers, stretches of springs, how fast motors turn, and where cylinders are. The laws are evaluated outside of it, and their
!> values go into the next program.
module linkdyn_measure_program
    use linkdyn_inputs, only: trace_request, sample_set
    use linkdyn_joint_variables, only: one_variable, variable_rate
    use linkdyn_mechanism, only: mechanism_type
    use linkdyn_model, only: model_type
    use linkdyn_place_variables, only: place_value, place_rate
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene, only: measure_spec, measure_joint, measure_marker, measure_spring, measure_distance, measure_attitude, &
        measure_tilt, measure_twist, least_openness, loses_itself_at_pole, side_joint, side_opening
    use linkdyn_scene_program, only: scene_program, output_list, add_output, make_scene_program
    use linkdyn_springs, only: measure_spring_stretch
    use linkdyn_trace, only: traced_type, trace_motion
    use linkdyn_value, only: value, zero, cos, reciprocal, select, operator(-)
    implicit none (type, external)
    private
    public :: make_measure_program, measured, out_measures

    !> All that the program gives: the measures of the scene's law book, then the rates of the joint variables that actuators drive
    !> (n_actuator; zero where a law gives the driving force itself), and the joint variables of cylinders with a valve
    !> (n_actuator; zero of others).
    integer, parameter :: out_measures = 104

contains

    !> Trace the motion of a scene and compile its measures.
    subroutine make_measure_program(model, request, sample, program)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        type(sample_set), intent(in) :: sample     !! representative
        type(scene_program), intent(inout) :: program
        type(record_type), target :: record
        type(traced_type) :: traced
        type(output_list) :: list
        type(value), allocatable :: measure(:), driven(:), place(:)
        integer :: k

        call open_record(record, sample%n)
        call trace_motion(model, request, sample, traced, merged=.false.)
        allocate (measure(size(model%scene%laws%measure)))
        do k = 1, size(measure)
            measure(k) = measured(traced%mechanism, model%scene%laws%measure(k))
        end do
        allocate (driven(model%n_actuator), place(model%n_actuator))
        do k = 1, size(driven)
            driven(k) = zero()
            place(k) = zero()
            associate (actuator => model%scene%actuator(k))
                if (actuator%law%side /= side_joint) &
                    driven(k) = variable_rate(traced%mechanism, actuator%joint, actuator%variable)
                if (actuator%law%side == side_opening) &
                    place(k) = one_variable(traced%mechanism, actuator%joint, actuator%variable)
            end associate
        end do
        call add_output(list, out_measures, [measure, driven, place])
        call make_scene_program(record, traced%in, list, program)
        call close_record(record)
    end subroutine make_measure_program

    !> One measure; the instant is not known here.
    function measured(mechanism, spec) result(number)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        type(value) :: number
        type(value) :: found(2)

        number = zero()
        select case (spec%kind)
        case (measure_joint, measure_marker, measure_distance, measure_attitude, measure_tilt, measure_twist)
            if (spec%is_rate) then
                number = place_rate(mechanism, spec)
            else
                number = place_value(mechanism, spec)
            end if
            if (loses_itself_at_pole(mechanism%model%scene, spec)) number = away_from_pole(mechanism, spec%joint, number)
        case (measure_spring)
            call measure_spring_stretch(mechanism, spec%spring, found(1), found(2))
            number = found(merge(2, 1, spec%is_rate))
        end select
    end function measured

    !> A number that a ball does not tell at its pole: not finite there.
    function away_from_pole(mechanism, ball, number) result(told)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: ball
        type(value), intent(in) :: number
        type(value) :: told
        type(value) :: cosine
        integer, parameter :: pitch = 2

        cosine = cos(one_variable(mechanism, ball, pitch))
        cosine = select(cosine - least_openness, cosine, zero())
        told = select(cosine, number, reciprocal(cosine))
    end function away_from_pole
end module linkdyn_measure_program
