!> Chains by name: the joints of a leg from base to platform, and the links between them.
!>
!> A new kind of a serial chain is a line of `list_chain_kinds`: the letters of its joints, the names of its links. What its joints'
!> markers are follows from the letters (`linkdyn_chain_parts`). Any other word of joint letters is a kind, too: its legs are drawn
!> by the scene, joint by joint (`linkdyn_chain_words`).
module linkdyn_chain_kinds
    use linkdyn_scene, only: joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, joint_spherical
    implicit none (type, external)
    private
    public :: chain_kind, list_chain_kinds, letter_len, links_of_leg, joints_of_leg, is_crank_kind, is_rail_kind, is_telescope
    public :: joint_kind_of, joint_suffix, drive_of, in_plane, in_space, anywhere, most_letters, is_chain_word, kind_of_word

    integer, parameter :: letter_len = 8, most_letters = letter_len, most_links = 2
    character(len=*), parameter :: letters_in_space = "RPCUS", letters_in_plane = "RP"
    integer, parameter :: in_plane = 1, in_space = 2, anywhere = 3

    type :: chain_kind
        character(len=8) :: name = ""                  !! its word in a scene
        character(len=letter_len) :: letters = ""      !! of its joints, base first
        character(len=8) :: link(most_links) = ""      !! names of its links, base first
        integer :: space = in_space
        logical :: is_parallelogram = .false.          !! its second link and what follows are there twice, side by side
        logical :: is_word = .false.                   !! any row of joints, with a link between each two: `link1`, `link2`, ...
    end type chain_kind

contains

    !> All kinds that there are in a plane or in space, or with `everywhere` all.
    pure function list_chain_kinds() result(kind)
        type(chain_kind), allocatable :: kind(:)

        kind = [chain_kind("UPS", "UPS", ["lower   ", "upper   "]), &
                chain_kind("SPS", "SPS", ["lower   ", "upper   "]), &
                chain_kind("UCU", "UCU", ["lower   ", "upper   "]), &
                chain_kind("UPU", "UPU", ["lower   ", "upper   "]), &
                chain_kind("RPS", "RPS", ["lower   ", "upper   "]), &
                chain_kind("PUS", "PUS", ["carriage", "rod     "]), &
                chain_kind("PSS", "PSS", ["carriage", "rod     "]), &
                chain_kind("PRS", "PRS", ["carriage", "rod     "]), &
                chain_kind("RUS", "RUS", ["crank   ", "rod     "]), &
                chain_kind("RSS", "RSS", ["crank   ", "rod     "]), &
                chain_kind("RRS", "RRS", ["crank   ", "rod     "]), &
                chain_kind("RUU", "RUU", ["crank   ", "rod     "]), &
                chain_kind("R(SS)2", "RSS", ["crank   ", "rod     "], is_parallelogram=.true.), &
                chain_kind("RRR", "RRR", ["crank   ", "rod     "], in_plane), &
                chain_kind("PRR", "PRR", ["carriage", "rod     "], in_plane), &
                chain_kind("RPR", "RPR", ["lower   ", "upper   "], in_plane), &
                chain_kind("cylinder", "SPS", ["barrel  ", "rod     "], anywhere)]
    end function list_chain_kinds

    pure integer function links_of_leg(kind)
        type(chain_kind), intent(in) :: kind

        links_of_leg = joints_of_leg(kind) - 1
        if (kind%is_parallelogram) links_of_leg = 3
    end function links_of_leg

    pure integer function joints_of_leg(kind)
        type(chain_kind), intent(in) :: kind

        joints_of_leg = len_trim(kind%letters)
        if (kind%is_parallelogram) joints_of_leg = 5
    end function joints_of_leg

    !> Do letters name a row of joints that there is in this space?
    pure logical function is_chain_word(letters, planar)
        character(len=*), intent(in) :: letters
        logical, intent(in) :: planar

        is_chain_word = len_trim(letters) >= 2 .and. len_trim(letters) <= most_letters
        if (planar) is_chain_word = is_chain_word .and. verify(trim(letters), letters_in_plane) == 0
        if (.not. planar) is_chain_word = is_chain_word .and. verify(trim(letters), letters_in_space) == 0
    end function is_chain_word

    !> The kind that such a row is.
    pure type(chain_kind) function kind_of_word(letters) result(kind)
        character(len=*), intent(in) :: letters

        kind%name = letters
        kind%letters = letters
        kind%link(1) = "link1"
        kind%space = anywhere
        kind%is_word = .true.
    end function kind_of_word

    !> A crank on the base and a rod.
    pure logical function is_crank_kind(kind)
        type(chain_kind), intent(in) :: kind

        is_crank_kind = kind%link(1) == "crank"
    end function is_crank_kind

    !> A carriage on the base and a rod.
    pure logical function is_rail_kind(kind)
        type(chain_kind), intent(in) :: kind

        is_rail_kind = kind%link(1) == "carriage"
    end function is_rail_kind

    !> Two halves, one sliding in the other.
    pure logical function is_telescope(kind)
        type(chain_kind), intent(in) :: kind

        is_telescope = .not. (is_crank_kind(kind) .or. is_rail_kind(kind) .or. kind%is_word)
    end function is_telescope

    !> What a letter stands for.
    pure integer function joint_kind_of(letter)
        character, intent(in) :: letter

        select case (letter)
        case ("R")
            joint_kind_of = joint_revolute
        case ("P")
            joint_kind_of = joint_prismatic
        case ("C")
            joint_kind_of = joint_cylindrical
        case ("U")
            joint_kind_of = joint_universal
        case default
            joint_kind_of = joint_spherical
        end select
    end function joint_kind_of

    !> The last part of a joint's name: its letter, with a number if the leg has several of them.
    pure function joint_suffix(letters, k) result(suffix)
        character(len=*), intent(in) :: letters
        integer, intent(in) :: k
        character(len=:), allocatable :: suffix
        integer :: i, n, all

        n = 0
        all = 0
        do i = 1, len_trim(letters)
            if (letters(i:i) /= letters(k:k)) cycle
            all = all + 1
            if (i <= k) n = n + 1
        end do
        suffix = letters(k:k)
        if (all > 1) suffix = suffix//achar(iachar("0") + n)
    end function joint_suffix

    !> The joint that is driven: the slide of a telescope, of a word the first hinge or slide that there is, or 0; else that on the
    !> base.
    pure integer function drive_of(kind)
        type(chain_kind), intent(in) :: kind

        drive_of = merge(2, 1, is_telescope(kind))
        if (kind%is_word) drive_of = scan(kind%letters, "RPC")
    end function drive_of
end module linkdyn_chain_kinds
