!> The planned mechanism: constant after `build_model`, read by every algorithm, shared by all threads.
module linkdyn_model
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, name_len
    implicit none (type, external)
    private
    public :: model_type, link_type, joint_type, step_type
    public :: step_pose, step_joint, step_ups, step_csp, step_name

    ! ---- steps of the kinematic program, in the order in which the planner looks for them
    integer, parameter :: step_pose = 1      !! a link whose pose is given by coordinates
    integer, parameter :: step_joint = 2     !! open chain: a link behind a joint whose variables are coordinates
    integer, parameter :: step_ups = 3       !! Assur group: UPS leg between two known links
    integer, parameter :: step_csp = 4       !! Assur group: CSP between two known links
    character(len=24), parameter :: step_name(4) = [character(len=24) :: "pose", "open chain", "UPS leg", "CSP group"]

    !> Constants of a moving link.
    type :: link_type
        character(len=name_len) :: name = ""
        real(wp) :: mass = 0                  !! [kg]
        real(wp) :: cog(3) = 0                !! link axes [m]
        real(wp) :: inertia(3, 3) = 0         !! about the cog, link axes [kg m2]
        logical :: is_massless = .false.      !! no inertia at all: nothing to compute
        logical :: is_diagonal = .true.       !! no products of inertia
        integer :: orientation = 0            !! index of the rotation it shares with links that slide on it
        logical :: needs_world = .false.      !! its angular rates in world axes are read by a later step
    end type link_type

    !> Constants of a joint.
    type :: joint_type
        character(len=name_len) :: name = ""
        integer :: kind = 0
        integer :: link(2) = 0                !! 0 is the frame
        real(wp) :: point(3, 2) = 0           !! markers in link axes [m]
        real(wp) :: frame(3, 3, 2) = 0        !! marker frames in link axes, columns x, y, z
        integer :: first_variable = 0         !! its variables are first_variable + 1, ...
        integer :: leg = 0                    !! the leg whose length is its slide
    end type joint_type

    !> One step of the kinematic program.
    type :: step_type
        integer :: kind = 0
        integer :: n_link = 0
        integer :: link(2) = 0                !! links that the step determines
        integer :: joint(3) = 0               !! joints that it uses
        integer :: coordinate(6) = 0          !! coordinates that it uses, in the order of the components
        integer :: first = 0                  !! index of its own state in the workspace (poses, legs)
        logical :: from_second = .false.      !! an open-chain joint walked from its second link to its first
        logical :: base_moves = .false.       !! the base link of a leg moves
    end type step_type

    !> A mechanism ready to be computed.
    type :: model_type
        type(scene_type) :: scene
        integer :: n_link = 0                 !! moving links
        integer :: n_joint = 0
        integer :: n_q = 0                    !! generalized coordinates
        integer :: n_actuator = 0
        integer :: n_load = 0
        integer :: n_variable = 0             !! joint variables
        integer :: n_orientation = 0
        integer :: n_pose = 0                 !! links whose pose is given by coordinates
        integer :: n_leg = 0
        integer :: n_row = 0                  !! equations: 3 a planar, 6 a spatial link
        integer :: n_component = 0            !! of a reaction: 3 planar, 6 spatial
        real(wp) :: gravity(3) = 0
        type(link_type), allocatable :: link(:)
        type(joint_type), allocatable :: joint(:)
        type(step_type), allocatable :: step(:)
        logical, allocatable :: moves(:, :)   !! (n_q, n_link): the coordinate moves the link
    end type model_type
end module linkdyn_model
