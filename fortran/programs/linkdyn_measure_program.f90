!> The program that measures what laws depend on: from coordinates and their rates to joint variables, places and velocities of
!> markers, stretches of springs, and how fast motors turn. The laws are evaluated outside of it, and their values go into the next
!> program.
module linkdyn_measure_program
    use linkdyn_bodies, only: point_position, point_velocity
    use linkdyn_inputs, only: trace_request, sample_set
    use linkdyn_joint_variables, only: variable_near, variable_rate
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type, in_own_axes
    use linkdyn_model, only: model_type
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene, only: measure_spec, measure_joint, measure_marker, measure_spring, frame_link, side_joint
    use linkdyn_scene_program, only: scene_program, output_list, add_output, make_scene_program
    use linkdyn_springs, only: measure_spring_stretch
    use linkdyn_trace, only: traced_type, trace_motion
    use linkdyn_value, only: value, constant, zero
    use linkdyn_vector, only: vector, vector_of, components
    implicit none (type, external)
    private
    public :: make_measure_program, out_measures

    !> All that the program gives: the measures of the scene's law book, then the rates of the joint variables that actuators drive
    !> (n_actuator; zero where no law is about the motor).
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
        type(value), allocatable :: measure(:), driven(:)
        integer :: k

        call open_record(record, sample%n)
        call trace_motion(model, request, sample, traced, merged=.false.)
        allocate (measure(size(model%scene%laws%measure)))
        do k = 1, size(measure)
            measure(k) = measured(traced%mechanism, model%scene%laws%measure(k))
        end do
        allocate (driven(model%n_actuator))
        do k = 1, size(driven)
            driven(k) = zero()
            associate (actuator => model%scene%actuator(k))
                if (actuator%drive%side /= side_joint) &
                    driven(k) = variable_rate(traced%mechanism, actuator%joint, actuator%variable)
            end associate
        end do
        call add_output(list, out_measures, [measure, driven])
        call make_scene_program(record, traced%in, list, program)
        call close_record(record)
    end subroutine make_measure_program

    !> One measure; the instant is not known here.
    function measured(mechanism, spec) result(number)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        type(value) :: number
        type(value) :: found(2), component(3)
        type(vector) :: point
        integer :: k

        number = zero()
        select case (spec%kind)
        case (measure_joint)
            if (spec%is_rate) then
                number = variable_rate(mechanism, spec%joint, spec%variable)
            else
                number = variable_near(mechanism, spec%joint, spec%variable, constant(spec%near))
            end if
        case (measure_marker)
            point = in_own_axes(mechanism, spec%link, vector_of([(constant(at(mechanism%model, spec, k)), k=1, 3)]))
            if (spec%is_rate) then
                component = components(point_velocity(mechanism%bodies, spec%link, point))
            else
                component = components(point_position(mechanism%bodies, spec%link, point))
            end if
            number = component(spec%component)
        case (measure_spring)
            call measure_spring_stretch(mechanism, spec%spring, found(1), found(2))
            number = found(merge(2, 1, spec%is_rate))
        end select
    end function measured

    !> Where the marker of a measure is on its link.
    pure real(wp) function at(model, spec, k)
        type(model_type), intent(in) :: model
        type(measure_spec), intent(in) :: spec
        integer, intent(in) :: k                   !! 1 2 3: x y z

        at = 0
        if (spec%marker == 0) return
        if (spec%link == frame_link) then
            at = model%scene%frame%marker(spec%marker)%at(k)
        else
            at = model%scene%link(spec%link)%marker(spec%marker)%at(k)
        end if
    end function at
end module linkdyn_measure_program
