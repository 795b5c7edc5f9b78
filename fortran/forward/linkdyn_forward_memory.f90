!> What a forward system remembers of the way that it has come, apart from what it was made of: to go on from there once more.
!>
!> It has no part of programs, equations and workspaces, so a copy may outlive them.
submodule (linkdyn_forward_system) linkdyn_forward_memory
    use linkdyn_group_motion, only: group_closer
    implicit none (type, external)

contains

    !> Copy what it remembers.
    module procedure remember
        memory%lane_way = self%lane_way
        memory%way = self%way
        memory%of_motion = self%of_motion%assembly
        memory%controllers = self%control%state
        memory%ratios = self%watch%coordinate_ratios
    end procedure remember

    !> Remember this instead of what has been since. Programs that were made meanwhile serve no earlier than they did.
    module procedure recall
        class(group_closer), pointer :: closer

        self%lane_way = memory%lane_way
        closer => closer_of(self%way%assembly, memory%way%assembly)
        self%way = memory%way
        self%way%assembly%closer => closer
        closer => closer_of(self%of_motion%assembly, memory%of_motion)
        self%of_motion%assembly = memory%of_motion
        self%of_motion%assembly%closer => closer
        self%control%state = memory%controllers
        self%watch%coordinate_ratios = memory%ratios
        ! what was evaluated since says nothing
        self%is_by_record = .false.
        self%is_behind = .false.
        self%watch%is_compared = .false.
        self%held%is_measured = .false.
        call self%begin_trial()
    end procedure recall

    !> Who closes the groups there is who closes them now, if somebody did then.
    function closer_of(now, then) result(closer)
        type(carried_assembly), intent(in) :: now, then
        class(group_closer), pointer :: closer

        nullify (closer)
        if (associated(then%closer)) closer => now%closer
    end function closer_of
end submodule linkdyn_forward_memory
