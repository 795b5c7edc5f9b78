!> What a forward system remembers of the way that it has come, apart from what it was made of: to go on from there once more.
!>
!> It has no part of programs, equations and workspaces, so a copy may outlive them.
submodule (linkdyn_forward_system) linkdyn_forward_memory
    use linkdyn_group_motion, only: group_closer
    implicit none (type, external)

contains

    !> Copy what it remembers.
    module procedure remember
        memory%wants_rest = self%wants_rest
        memory%turns = self%turns
        memory%n_jump = self%n_jump
        memory%mode = self%mode
        if (self%n_guard > 0) then
            memory%guard_side = self%guard_side
            memory%guard_scale = self%guard_scale
            if (allocated(self%guard_is_fresh)) memory%guard_is_fresh = self%guard_is_fresh
            memory%stops = self%stops
            memory%clutch = self%clutch
            memory%angles = self%angles
        end if
        memory%assembly = self%assembly
        memory%of_motion = self%of_motion%assembly
        memory%control = self%control%state
        memory%motors = self%motors
        memory%energy = self%energy
        memory%bounce = self%bounce
        if (self%watch%is_on) then
            memory%ratio = self%watch%ratio
            memory%ratio_before = self%watch%before
            memory%least_ratio = self%watch%least
        end if
        memory%obstacle = self%obstacle
        memory%final_event = self%final_event
        memory%is_driven_through = self%is_driven_through
        memory%log = self%log
        memory%sight = self%sight
        memory%n_accepted = self%n_accepted
        memory%n_before_record = self%n_before_record
        memory%n_left = self%n_left
        if (allocated(self%given_force)) memory%given_force = self%given_force
    end procedure remember

    !> Remember this instead of what has been since. Programs that were made meanwhile serve no earlier than they did.
    module procedure recall
        self%wants_rest = memory%wants_rest
        self%turns = memory%turns
        self%n_jump = memory%n_jump
        self%mode = memory%mode
        if (self%n_guard > 0) then
            self%guard_side = memory%guard_side
            self%guard_scale = memory%guard_scale
            if (allocated(memory%guard_is_fresh)) self%guard_is_fresh = memory%guard_is_fresh
            self%stops = memory%stops
            self%clutch = memory%clutch
            self%angles = memory%angles
        end if
        call stand_again(memory%assembly, self%assembly)
        call stand_again(memory%of_motion, self%of_motion%assembly)
        self%control%state = memory%control
        self%motors = memory%motors
        self%energy = memory%energy
        self%bounce = memory%bounce
        if (self%watch%is_on) then
            self%watch%ratio = memory%ratio
            self%watch%before = memory%ratio_before
            self%watch%least = memory%least_ratio
        end if
        self%obstacle = memory%obstacle
        self%final_event = memory%final_event
        self%is_driven_through = memory%is_driven_through
        self%log = memory%log
        self%sight = memory%sight
        self%n_accepted = memory%n_accepted
        self%n_before_record = memory%n_before_record
        self%n_left = memory%n_left
        if (allocated(memory%given_force)) self%given_force = memory%given_force
        ! what was evaluated since says nothing
        self%is_by_record = .false.
        self%is_behind = .false.
        self%watch%is_compared = .false.
        self%held%is_measured = .false.
        call self%begin_trial()
    end procedure recall

    !> Who closes the groups there is who closes them now, if somebody did.
    subroutine stand_again(memory, assembly)
        type(carried_assembly), intent(in) :: memory
        type(carried_assembly), intent(inout) :: assembly
        class(group_closer), pointer :: closer

        nullify (closer)
        if (associated(memory%closer)) closer => assembly%closer
        assembly = memory
        assembly%closer => closer
    end subroutine stand_again
end submodule linkdyn_forward_memory
