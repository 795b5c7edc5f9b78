!> Motions that go on beyond where a mechanism can be closed, and come back: what a sample there costs, counted in ways gone.
module test_dead_ends
    use linkdyn_assembly_trail, only: assembly_trail, sample_assembly, follow_assembly
    use linkdyn_builder, only: build_model
    use linkdyn_constants, only: pi
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type, sample_ok
    use linkdyn_testing, only: test_error, unit_test, new_test, check
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: collect_dead_ends

contains

    subroutine collect_dead_ends(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("groups driven beyond their reach and back", test_groups), &
                 new_test("samples beyond both ends of what can be reached", test_both_sides), &
                 new_test("a wheel that no way is patient enough for", test_patience)]
    end subroutine collect_dead_ends

    !> A coordinate goes out of reach on either side and comes back, the others rest. Every sample comes out as it does to one
    !> who goes to it straight from the last good one, and few of the ways are gone: those that no other one has shown to be in
    !> vain are the first of each stretch, and those that end next to where the assembly does.
    subroutine test_groups(error)
        type(test_error), intent(inout) :: error
        character(len=*), parameter :: name(*) = [character(len=17) :: "boom_by_stroke", "scissor_by_stroke", "excavator", "rsur"]
        real(wp), parameter :: reach(size(name)) = [3.0_wp, 1.5_wp, 2.0_wp, 2.5_wp]    ! [m, rad] of the coordinate
        integer, parameter :: n = 1000
        integer, parameter :: apart = 50                ! samples out of reach that somebody goes to straight: each takes long
        type(scene_type) :: scene
        type(status_type) :: status
        type(model_type) :: model
        type(assembly_trail) :: trail, last, straight, fresh
        type(sample_assembly) :: assembly, alone
        real(wp), allocatable :: q(:, :)
        integer :: i, sample, n_lost, n_stretch

        do i = 1, size(name)
            call read_scene("tests/scenes/"//trim(name(i))//".toml", scene, status)
            ! also of those that would close by formulas, with their cylinders inside
            if (status%is_ok()) call build_model(scene, model, status, closed_forms=.false.)
            call check(error, status%is_ok(), trim(name(i))//": "//trim(status%message))
            if (allocated(error%message)) return
            q = spread(model%start_q, 2, n)
            q(1, :) = q(1, :) + reach(i)*sin([(3*pi*sample/n, sample=1, n)])
            trail = fresh
            call follow_assembly(model, q, trail, assembly)
            n_lost = count(assembly%status /= sample_ok)
            n_stretch = count(assembly%status(2:) /= sample_ok .and. assembly%status(:n - 1) == sample_ok)
            call check(error, n_lost > n/4, trim(name(i))//": is driven out of reach")
            call check(error, trail%n_way <= 3*lanes*(n_stretch + 1), trim(name(i))//": "//to_text(trail%n_way) &
                       //" ways for "//to_text(n_lost)//" samples out of reach")
            last = fresh
            do sample = 1, n
                if (assembly%status(sample) /= sample_ok .and. modulo(sample, apart) > 0) cycle
                straight = last
                call follow_assembly(model, q(:, sample:sample), straight, alone)
                call check(error, alone%status(1) == assembly%status(sample), trim(name(i))//": status of sample "//to_text(sample))
                if (alone%status(1) == sample_ok) last = straight
            end do
        end do
    end subroutine test_groups

    !> A stroke that is asked for far beyond what the cylinder has, and far below, by turns: both ends are remembered.
    subroutine test_both_sides(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 1000
        real(wp), parameter :: reach = 1.5_wp           ! [m]
        type(scene_type) :: scene
        type(status_type) :: status
        type(model_type) :: model
        type(assembly_trail) :: trail
        type(sample_assembly) :: assembly
        real(wp) :: q(1, n)
        integer :: sample

        call read_scene("tests/scenes/scissor_by_stroke.toml", scene, status)
        if (status%is_ok()) call build_model(scene, model, status, closed_forms=.false.)
        call check(error, status%is_ok(), trim(status%message))
        if (allocated(error%message)) return
        q(1, :) = model%start_q(1) + reach*[((-1)**sample*(1 + 0.1_wp*sample/n), sample=1, n)]
        call follow_assembly(model, q, trail, assembly)
        call check(error, all(assembly%status /= sample_ok), "no sample is reached")
        call check(error, trail%n_way <= 3*lanes, to_text(trail%n_way)//" ways")
    end subroutine test_both_sides

    !> A crank whose wheel turns another one 3e10 times as fast: no way gets anywhere, and few are gone for nothing.
    subroutine test_patience(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 720
        type(scene_type) :: scene
        type(status_type) :: status
        type(model_type) :: model
        type(assembly_trail) :: trail
        type(sample_assembly) :: assembly
        real(wp) :: q(1, n)
        integer :: sample

        call read_scene("examples/geared_fivebar/scene.toml", scene, status)
        if (status%is_ok()) then
            associate (gear => scene%joint(findloc(scene%joint%name == "wheels", .true., dim=1)))
                gear%wheel(1) = 1.0e12_wp
            end associate
            call build_model(scene, model, status)
        end if
        call check(error, status%is_ok(), trim(status%message))
        if (allocated(error%message)) return
        q(1, :) = model%start_q(1) + [(2*pi*sample/n, sample=1, n)]
        call follow_assembly(model, q, trail, assembly)
        call check(error, count(assembly%status == sample_ok) < n, "some samples are not reached")
        call check(error, trail%n_way <= 3*lanes, to_text(trail%n_way)//" ways")
    end subroutine test_patience
end module test_dead_ends
