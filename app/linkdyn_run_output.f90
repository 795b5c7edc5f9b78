!> Results of a run on their way to a file: netCDF or CSV, chosen once.
module linkdyn_run_output
    use linkdyn_cli, only: command_line
    use linkdyn_csv_writer, only: csv_writer, create_csv, put_csv, close_csv
    use linkdyn_event_log, only: event_log
    use linkdyn_model, only: model_type, shared_reactions
    use linkdyn_netcdf_writer, only: netcdf_writer, attributes_type, create_netcdf, put_netcdf, put_event_table, &
        put_event_sides, note_netcdf, close_netcdf
    use linkdyn_path, only: refuse_inputs
    use linkdyn_results, only: layout_type, block_type, variable_index
    use linkdyn_result_kinds, only: result_assembly
    use linkdyn_roads, only: road_counts
    use linkdyn_code, only: code_in_use
    use linkdyn_scene, only: scene_type, idle_spins, share_name
    use linkdyn_shared_words, only: shared_components, shared_directions
    use linkdyn_status, only: status_type
    use linkdyn_summary, only: summary_type
    use linkdyn_text, only: to_text
    use linkdyn_build, only: version
    implicit none (type, external)
    private
    public :: output_type, open_results, put_results, note_result, note_roads, note_assembly, note_events, close_results
    public :: default_name
    public :: run_attributes
    public :: exit_done, exit_bad_input, exit_samples_failed

    integer, parameter :: exit_done = 0, exit_bad_input = 2, exit_samples_failed = 3

    !> Where results go, if anywhere.
    type :: output_type
        logical :: is_none = .false.                  !! only the summary is wanted
        logical :: is_csv = .false.
        character(len=:), allocatable :: name
        type(netcdf_writer) :: netcdf
        type(csv_writer) :: csv
    end type output_type

    !> What is known at the end of a run only; CSV has no room for it.
    interface note_result
        module procedure note_text, note_number
    end interface note_result

contains

    subroutine open_results(config, model, layout, n_sample, output, status, may_end_early)
        type(command_line), intent(in) :: config
        type(model_type), intent(in) :: model
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: n_sample
        type(output_type), intent(out) :: output
        type(status_type), intent(inout) :: status
        logical, intent(in), optional :: may_end_early    !! fewer samples may come

        output%is_none = config%no_output
        output%is_csv = config%csv
        if (output%is_none) then
            output%name = "not kept"
            return
        end if
        if (allocated(config%output)) then
            output%name = config%output
        else
            output%name = default_name(config%scene)//trim(merge(".csv", ".nc ", config%csv))
        end if
        call refuse_inputs(output%name, model%scene, status, config%states)
        if (.not. status%is_ok()) return
        if (config%csv) then
            call create_csv(output%name, layout, output%csv, status)
            return
        end if
        call create_netcdf(output%name, layout, n_sample, run_attributes(config, model%scene, model), &
            config%deflate, output%netcdf, status, may_end_early)
    end subroutine open_results

    !> What a file says of the run.
    function run_attributes(config, scene, model) result(attributes)
        type(command_line), intent(in) :: config
        type(scene_type), intent(in) :: scene
        type(model_type), intent(in), optional :: model    !! absent: there are several, and nothing is said of their reactions
        type(attributes_type) :: attributes

        attributes%title = trim(scene%title)
        attributes%version = version
        attributes%solver = config%solver
        attributes%scene = ""
        if (allocated(scene%text)) attributes%scene = scene%text
        attributes%idle_spins = idle_spins(scene)
        attributes%shared_reactions = ""
        if (present(model)) then
            attributes%shared_reactions = shared_reactions(model)
            attributes%shared_components = shared_components(model)
            attributes%shared_directions = shared_directions(model)
        end if
        attributes%redundancy = trim(share_name(scene%redundancy))
        attributes%history = timestamp()//" "//command_text()
        attributes%gravity = scene%gravity
    end function run_attributes

    subroutine put_results(layout, block, first, n, output, status)
        type(layout_type), intent(in) :: layout
        type(block_type), intent(in) :: block
        integer, intent(in) :: first, n
        type(output_type), intent(inout) :: output
        type(status_type), intent(inout) :: status

        if (output%is_none) return
        if (output%is_csv) then
            call put_csv(layout, block, first, n, output%csv, status)
        else
            call put_netcdf(layout, block, first, n, output%netcdf, status)
        end if
    end subroutine put_results

    subroutine note_text(name, text, output, status)
        character(len=*), intent(in) :: name, text
        type(output_type), intent(inout) :: output
        type(status_type), intent(inout) :: status

        if (.not. (output%is_none .or. output%is_csv)) call note_netcdf(name, text, output%netcdf, status)
    end subroutine note_text

    subroutine note_number(name, number, output, status)
        character(len=*), intent(in) :: name
        integer, intent(in) :: number
        type(output_type), intent(inout) :: output
        type(status_type), intent(inout) :: status

        if (.not. (output%is_none .or. output%is_csv)) call note_netcdf(name, number, output%netcdf, status)
    end subroutine note_number

    !> How many samples took which road, and what the kernels ran as.
    subroutine note_roads(roads, output, status)
        type(road_counts), intent(in) :: roads
        type(output_type), intent(inout) :: output
        type(status_type), intent(inout) :: status

        call note_result("samples_closed_form", roads%closed, output, status)
        call note_result("samples_iterated", roads%iterated, output, status)
        call note_result("samples_dense", roads%dense, output, status)
        call note_result("machine_code", code_in_use(), output, status)
    end subroutine note_roads

    !> How often the assembly was in question.
    subroutine note_assembly(layout, summary, output, status)
        type(layout_type), intent(in) :: layout
        type(summary_type), intent(in) :: summary
        type(output_type), intent(inout) :: output
        type(status_type), intent(inout) :: status

        if (variable_index(layout, result_assembly) == 0) return
        call note_result("change_points_passed", to_text(summary%n_passed), output, status)
        call note_result("assemblies_found_anew", to_text(summary%anew%n), output, status)
    end subroutine note_assembly

    !> What has happened in a forward run, one thing at least, with the results beside it.
    subroutine note_events(scene, log, layout, block, output, status)
        type(scene_type), intent(in) :: scene
        type(event_log), intent(in) :: log
        type(layout_type), intent(in) :: layout      !! of the results on both sides
        type(block_type), intent(in) :: block        !! two samples an event; not allocated: none
        type(output_type), intent(inout) :: output
        type(status_type), intent(inout) :: status

        if (output%is_none .or. output%is_csv) return
        call put_event_table(scene%event%name, log, output%netcdf, status)
        if (allocated(block%of)) call put_event_sides(layout, log%n, block, output%netcdf, status)
    end subroutine note_events

    subroutine close_results(output, status)
        type(output_type), intent(inout) :: output
        type(status_type), intent(inout) :: status

        if (output%is_none) return
        if (output%is_csv) then
            call close_csv(output%csv, status)
        else
            call close_netcdf(output%netcdf, status)
        end if
    end subroutine close_results

    !> Name of the results: the scene's stem; of its folder when the scene is just called "scene".
    function default_name(scene_file) result(name)
        character(len=*), intent(in) :: scene_file
        character(len=:), allocatable :: name, folder
        character(len=4096) :: here
        integer :: slash, dot

        slash = index(scene_file, "/", back=.true.)
        name = scene_file(slash + 1:)
        dot = index(name, ".", back=.true.)
        if (dot > 1) name = name(:dot - 1)
        if (name /= "scene") return
        if (slash > 1) then
            folder = scene_file(:slash - 1)
        else
            call get_environment_variable("PWD", here)
            folder = trim(here)
        end if
        folder = folder(index(folder, "/", back=.true.) + 1:)
        if (verify(folder, ".") > 0) name = folder
    end function default_name

    !> The command as it was given.
    function command_text() result(text)
        character(len=:), allocatable :: text
        integer :: length

        call get_command(length=length)
        allocate (character(len=length) :: text)
        call get_command(text)
        text = text(index(text(:scan(text//" ", " ")), "/", back=.true.) + 1:)
    end function command_text

    !> Date and time, ISO 8601.
    function timestamp() result(text)
        character(len=:), allocatable :: text
        character(len=8) :: date
        character(len=10) :: time
        character(len=5) :: zone

        call date_and_time(date, time, zone)
        text = date(:4)//"-"//date(5:6)//"-"//date(7:8)//"T"//time(:2)//":"//time(3:4)//":"//time(5:6)// &
            zone(:3)//":"//zone(4:)
    end function timestamp
end module linkdyn_run_output
