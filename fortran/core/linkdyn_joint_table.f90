!> The kinds of joints in one table: what each is called, leaves free and transmits. Whoever wants to know it asks here.
!>
!> A joint holds two markers together, each with a frame whose z lies along its axis. What the table cannot say, how the
!> markers stand at given joint variables and the reverse, is said once for each engine: `linkdyn_joint_motion` and the files
!> of `joints/`.
module linkdyn_joint_table
    implicit none (type, external)
    private
    public :: joint_groove, joint_plate, joint_loose, joint_key, joint_thread, is_partial
    public :: joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, joint_spherical, joint_fixed, &
        joint_planar, joint_screw, joint_gear, joint_rack, joint_belt, joint_cam, pose_position, pose_attitude
    public :: n_joint_kind, joint_kind_name, joint_n_variable, variable_name, variable_is_slide, joint_in_plane
    public :: along_nothing, along_normal, along_x_and_y, along_axes, along_z, force_directions, moment_directions
    public :: is_threaded, is_geared, has_one_axis, turns_about_point
    public :: variable_axis, most_slides, slide_axis, n_slide, n_along, n_transmitted, is_slide, wraps, goes_round, is_pose_part

    integer, parameter :: joint_revolute = 1     !! angle about the axis
    integer, parameter :: joint_prismatic = 2    !! slide along the axis
    integer, parameter :: joint_cylindrical = 3  !! angle about, slide along the axis
    integer, parameter :: joint_universal = 4    !! angle about the first link's axis, then the second's
    integer, parameter :: joint_spherical = 5    !! three angles
    integer, parameter :: joint_fixed = 6        !! nothing
    integer, parameter :: joint_planar = 7       !! slides along x and y of the first marker, angle about the common z
    integer, parameter :: joint_screw = 8        !! angle about the axis, the slide along it in proportion
    integer, parameter :: joint_gear = 9         !! two wheels that mesh
    integer, parameter :: joint_rack = 10        !! a wheel and a rack
    integer, parameter :: joint_belt = 11        !! two wheels with a belt or chain round both
    integer, parameter :: joint_cam = 12         !! a point, roller or straight face on a curve (see `linkdyn_curve`)
    integer, parameter :: n_joint_kind = 12      !! that a scene may name

    ! ---- where a link is, seen from another: variables that hold nothing, by which coordinates can lead it
    integer, parameter :: pose_position = 13     !! of a point, along the axes of the first link
    integer, parameter :: pose_attitude = 14     !! three angles

    ! ---- what is left of a joint that lets go of what others hold (see `linkdyn_release`); their axes are the first marker's
    integer, parameter :: joint_groove = 15      !! a point on a line
    integer, parameter :: joint_plate = 16       !! a point in a plane, in the plane on a line
    integer, parameter :: joint_loose = 17       !! nothing
    integer, parameter :: joint_key = 18         !! no turning about one axis; z axes of both markers lie across it, square to each
                                                 !! other
    integer, parameter :: joint_thread = 19      !! of a screw, whose axes others hold
    integer, parameter :: n_kind = 19

    ! ---- directions of the forces or moments that a joint transmits
    integer, parameter :: along_nothing = 0    !! none
    integer, parameter :: along_normal = 1     !! one, square to both markers' axes
    integer, parameter :: along_x_and_y = 2    !! two, square to the markers' common axis
    integer, parameter :: along_axes = 3       !! all three, in whatever axes suit
    integer, parameter :: along_z = 4          !! one, the markers' common axis
    integer, parameter :: n_along(0:4) = [0, 1, 2, 3, 1]   !! how many these are

    integer, parameter :: variable_len = 7
    integer, parameter :: most_variables = 3
    integer, parameter :: most_slides = 2

    !> What there is to know of a kind.
    type :: kind_row
        integer :: id = 0                                            !! one of `joint_*`, `pose_*`
        character(len=11) :: name = ""                               !! in scenes
        integer :: n_variable = 0
        character(len=variable_len) :: variable(most_variables) = ""
        integer :: slide_axis(most_slides) = 0                       !! of the first marker, along which the second moves; 0: no
                                                                     !! more
        integer :: force = along_nothing, moment = along_nothing     !! directions transmitted, of `along_*`
        logical :: is_in_plane = .false.                             !! exists in planar scenes
    end type kind_row

    character(len=variable_len), parameter, dimension(most_variables) :: no_variable = "", &
        one_angle = [character(len=variable_len) :: "angle", "", ""], &
        one_slide = [character(len=variable_len) :: "slide", "", ""], &
        angle_and_slide = [character(len=variable_len) :: "angle", "slide", ""], &
        two_angles = [character(len=variable_len) :: "angle1", "angle2", ""], &
        in_a_plane = [character(len=variable_len) :: "x", "y", "angle"], &
        a_place = [character(len=variable_len) :: "x", "y", "z"], &
        three_angles = [character(len=variable_len) :: "roll", "pitch", "yaw"]
    type(kind_row), parameter :: kinds(n_kind) = [ &
        kind_row(joint_revolute, "revolute", 1, one_angle, [0, 0], along_axes, along_x_and_y, .true.), &
        kind_row(joint_prismatic, "prismatic", 1, one_slide, [3, 0], along_x_and_y, along_axes, .true.), &
        kind_row(joint_cylindrical, "cylindrical", 2, angle_and_slide, [3, 0], along_x_and_y, along_x_and_y, .false.), &
        kind_row(joint_universal, "universal", 2, two_angles, [0, 0], along_axes, along_normal, .false.), &
        kind_row(joint_spherical, "spherical", 3, three_angles, [0, 0], along_axes, along_nothing, .false.), &
        kind_row(joint_fixed, "fixed", 0, no_variable, [0, 0], along_axes, along_axes, .true.), &
        kind_row(joint_planar, "planar", 3, in_a_plane, [1, 2], along_z, along_x_and_y, .false.), &
        kind_row(joint_screw, "screw", 1, one_angle, [3, 0], along_x_and_y, along_x_and_y, .false.), &
        kind_row(joint_gear, "gear", 0, no_variable, [0, 0], along_nothing, along_nothing, .true.), &
        kind_row(joint_rack, "rack", 0, no_variable, [0, 0], along_nothing, along_nothing, .true.), &
        kind_row(joint_belt, "belt", 0, no_variable, [0, 0], along_nothing, along_nothing, .true.), &
        kind_row(joint_cam, "cam", 0, no_variable, [0, 0], along_nothing, along_nothing, .true.), &
        kind_row(pose_position, "position", 3, a_place, [0, 0], along_nothing, along_nothing, .false.), &
        kind_row(pose_attitude, "attitude", 3, three_angles, [0, 0], along_nothing, along_nothing, .false.), &
        kind_row(joint_groove, "groove", 0, no_variable, [0, 0], along_x_and_y, along_nothing, .false.), &
        kind_row(joint_plate, "plate", 0, no_variable, [0, 0], along_z, along_nothing, .false.), &
        kind_row(joint_loose, "nothing", 0, no_variable, [0, 0], along_nothing, along_nothing, .false.), &
        kind_row(joint_key, "key", 0, no_variable, [0, 0], along_nothing, along_normal, .false.), &
        kind_row(joint_thread, "thread", 0, no_variable, [0, 0], along_nothing, along_nothing, .false.)]

    ! ---- its columns, by the number of the kind
    integer :: i
    character(len=11), parameter :: joint_kind_name(n_kind) = [(kinds(i)%name, i=1, n_kind)]    ! flang 19 folds no kinds%name
    integer, parameter :: joint_n_variable(n_kind) = kinds%n_variable
    character(len=variable_len), parameter :: variable_name(most_variables, n_kind) = reshape( &
        [(kinds(i)%variable(1), i=1, n_kind), (kinds(i)%variable(2), i=1, n_kind), (kinds(i)%variable(3), i=1, n_kind)], &
        [most_variables, n_kind], order=[2, 1])
    integer, parameter :: slide_axis(most_slides, n_kind) = &
        reshape([kinds%slide_axis(1), kinds%slide_axis(2)], [most_slides, n_kind], order=[2, 1])
    integer, parameter :: force_directions(n_kind) = kinds%force
    integer, parameter :: moment_directions(n_kind) = kinds%moment
    logical, parameter :: joint_in_plane(n_joint_kind) = kinds(:n_joint_kind)%is_in_plane

    logical, parameter :: variable_is_slide(most_variables, n_kind) = &                      !! else an angle
        variable_name == "slide" .or. variable_name == "x" .or. variable_name == "y" .or. variable_name == "z"
    !> About or along which axis of its marker a variable moves the second link: of the first, but for a universal joint's second.
    !> Of three angles these are the axes in which turning is told, not those that the angles go about.
    integer, parameter :: variable_axis(most_variables, n_kind) = &
        merge(1, merge(2, 3, variable_name == "y" .or. variable_name == "pitch"), variable_name == "x" .or. variable_name == "roll")
    !> Its variables turn or slide along one axis, square to which all is held.
    logical, parameter :: has_one_axis(n_kind) = kinds%n_variable > 0 &
        .and. (kinds%force == along_axes .or. kinds%force == along_x_and_y) &
        .and. (kinds%moment == along_axes .or. kinds%moment == along_x_and_y)
    !> Holds a point and lets it turn about more than one axis.
    logical, parameter :: turns_about_point(n_kind) = kinds%force == along_axes &
        .and. (kinds%moment == along_normal .or. kinds%moment == along_nothing)
    !> A thread ties slide and angle: besides the directions above it transmits a force along the axis, and with it a moment.
    logical, parameter :: is_threaded(n_kind) = joint_kind_name == "screw" .or. joint_kind_name == "thread"
    !> Holds no marker, but ties the angles of two wheels that other joints hold (see `linkdyn_gearing`): it transmits one force,
    !> with a moment on each of both links.
    logical, parameter :: is_geared(n_kind) = &
        joint_kind_name == "gear" .or. joint_kind_name == "rack" .or. joint_kind_name == "belt"

contains

    !> Is the joint variable a slide, not an angle?
    elemental logical function is_slide(kind, variable)
        integer, intent(in) :: kind, variable

        is_slide = variable_is_slide(variable, kind)
    end function is_slide

    !> Is the joint variable an angle that looks the same after a whole turn? Not that of a screw, which has gone on by its lead.
    elemental logical function wraps(kind, variable)
        integer, intent(in) :: kind, variable

        wraps = .not. (variable_is_slide(variable, kind) .or. is_threaded(kind))
    end function wraps

    !> Does the joint variable go round, so that it may come to whole turns? Of three angles the middle one stays within a right
    !> angle to either side.
    elemental logical function goes_round(kind, variable)
        integer, intent(in) :: kind, variable
        integer, parameter :: middle = 2
        logical :: has_three

        has_three = kind == joint_spherical .or. kind == pose_attitude
        goes_round = wraps(kind, variable) .and. .not. (has_three .and. variable == middle)
    end function goes_round

    !> In how many directions the second marker moves away from the first.
    elemental integer function n_slide(kind)
        integer, intent(in) :: kind

        n_slide = count(slide_axis(:, kind) > 0)
    end function n_slide

    !> Is it a part of a pose, which holds nothing?
    elemental logical function is_pose_part(kind)
        integer, intent(in) :: kind

        is_pose_part = kind == pose_position .or. kind == pose_attitude
    end function is_pose_part

    !> Is it what is left of a joint of another kind?
    elemental logical function is_partial(kind)
        integer, intent(in) :: kind

        is_partial = kind > pose_attitude
    end function is_partial

    !> How many forces and how many moments a kind transmits: as many as it takes freedoms away. The force of a cam is along the
    !> normal where it is touched, which the table does not know.
    pure function n_transmitted(kind, is_planar) result(n)
        integer, intent(in) :: kind
        logical, intent(in) :: is_planar           !! those that act in a plane
        integer :: n(2)

        n = [n_along(force_directions(kind)) + merge(1, 0, is_threaded(kind)), n_along(moment_directions(kind))]
        if (is_geared(kind) .or. kind == joint_cam) then
            n = [1, 0]
        else if (is_planar .and. .not. is_partial(kind)) then
            n = max(n - [1, 2], 0)
        end if
    end function n_transmitted
end module linkdyn_joint_table
