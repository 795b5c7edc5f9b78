!> Joints of type "slot": the pin of one link slides in a straight slot of another, and turns there.
!>
!> A slot is read as what a designer would write without it: a massless block, a slide that has the joint's name, from the slot to
!> the block, and a hinge NAME.pin, in space a ball, from the block to the pin. So a pin in a slot closes as a dyad does, has a
!> slide for a variable, and may be driven, rub and stop there as any slide.
module linkdyn_scene_slots
    use linkdyn_joint_table, only: n_joint_kind
    use linkdyn_scene, only: scene_type, joint_spec, marker_spec, joint_kind_name, joint_prismatic, joint_revolute, &
        joint_spherical, name_len
    use linkdyn_scene_keys, only: scene_place, require_name, text_of, get_name
    use linkdyn_scene_links, only: new_marker, add_marker
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: joint_word, slot_word, count_slots, make_blocks, split_slot

    character(len=*), parameter :: slot_name = "slot", block_suffix = ".block", pin_suffix = ".pin"
    real(wp), parameter :: along(3) = [1, 0, 0]    !! the slot, in the block's axes
    real(wp), parameter :: across(3) = [0, 1, 0]
    integer, parameter :: slot_word = n_joint_kind + 1
    !> What `type` of a joint may say: the kinds of the table, then a slot.
    character(len=11), parameter :: joint_word(slot_word) = [character(len=11) :: joint_kind_name(:n_joint_kind), slot_name]

contains

    !> How many joints are slots: so many blocks and hinges come with them.
    integer function count_slots(root, planar, status) result(n)
        type(scene_place), intent(in) :: root
        logical, intent(in) :: planar
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        integer :: i

        n = 0
        call list_repeated(root, "joint", planar, .false., tables, status)
        if (.not. status%is_ok()) return
        do i = 1, size(tables%table)
            if (is_slot(repeated_at(root, tables, i, "joint"))) n = n + 1
        end do
    end function count_slots

    logical function is_slot(place)
        type(scene_place), intent(in) :: place
        character(len=:), allocatable :: text
        logical :: is_text

        is_slot = .false.
        call text_of(place, place%node%get("type"), text, is_text)
        if (is_text) is_slot = text == slot_name
    end function is_slot

    !> The blocks, before anybody looks for links by name.
    subroutine make_blocks(root, first_link, scene, status)
        type(scene_place), intent(in) :: root
        integer, intent(in) :: first_link              !! first free place in the scene's list
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        character(len=name_len) :: name
        type(marker_spec) :: pin, ball
        integer :: i, next

        if (.not. status%is_ok()) return
        call list_repeated(root, "joint", scene%planar, .false., tables, status)
        next = first_link
        do i = 1, size(tables%table)
            place = repeated_at(root, tables, i, "joint")
            if (.not. is_slot(place)) cycle
            call get_name(place, "name", name, status)
            if (status%is_ok()) call require_name(place, trim(name)//block_suffix, place%line, status)
            if (.not. status%is_ok()) return
            associate (block => scene%link(next))
                block%name = trim(name)//block_suffix
                block%line = place%line
                pin = new_marker("pin", [0.0_wp, 0.0_wp, 0.0_wp], along, place%line)
                pin%x_axis = merge(along, across, scene%planar)
                call add_marker(block, pin)
                if (.not. scene%planar) then
                    ! its angles have their pole where the pin's axis lies along the slot
                    ball = new_marker("ball", [0.0_wp, 0.0_wp, 0.0_wp], across, place%line)
                    ball%x_axis = along
                    call add_marker(block, ball)
                end if
            end associate
            next = next + 1
        end do
    end subroutine make_blocks

    !> What was read between slot and pin becomes the slide; the hinge, in space a ball, comes with it.
    subroutine split_slot(block, planar, slide, pin)
        integer, intent(in) :: block                   !! its link
        logical, intent(in) :: planar
        type(joint_spec), intent(inout) :: slide
        type(joint_spec), intent(out) :: pin

        slide%kind = joint_prismatic
        pin = joint_spec(name=trim(slide%name)//pin_suffix, kind=merge(joint_revolute, joint_spherical, planar), &
                         link=[block, slide%link(2)], marker=[merge(1, 2, planar), slide%marker(2)], line=slide%line)
        slide%link(2) = block
        slide%marker(2) = 1
    end subroutine split_slot
end module linkdyn_scene_slots
