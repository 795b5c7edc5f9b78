!> Columns of a table of states that name none: passed over, or meant for one and misspelt?
!>
!> A rate whose column is misspelt would be zero, silently. So what is passed over is known: results of the scene, of which
!> a table may have been made, and words, such as notes.
module linkdyn_stray_columns
    use linkdyn_csv, only: unit_behind
    use linkdyn_kinds, only: wp
    use linkdyn_results, only: describe_results, layout_type, wanted_type, dim_sample
    use linkdyn_scene, only: scene_type, table_spec
    use linkdyn_suggest, only: suggestion
    use linkdyn_units, only: time_span, unit_factor
    implicit none (type, external)
    private
    public :: bracket_remedy, result_words, what_is_meant, word_len

    integer, parameter :: word_len = 20            !! of the names of results

contains

    !> What to write where a column has its unit behind its name, but not in square brackets; empty: nothing.
    pure function bracket_remedy(column, expected) result(remedy)
        character(len=*), intent(in) :: column
        character(len=*), intent(in) :: expected(:)    !! names of the columns that states have
        character(len=:), allocatable :: remedy, unit
        integer :: k

        remedy = ""
        do k = 1, size(expected)
            unit = unit_behind(column, expected(k))
            if (unit /= "") remedy = "the unit belongs in square brackets: '"//trim(expected(k))//" ["//unit//"]'"
        end do
    end function bracket_remedy

    !> The words by which columns of results begin, of inverse dynamics and of forward runs; but not those of states.
    function result_words(scene) result(word)
        type(scene_type), intent(in) :: scene
        character(len=word_len), allocatable :: word(:)
        type(layout_type) :: inverse, forward
        type(wanted_type) :: everything

        everything = wanted_type(growth=.true., bound=.true., rcond=.true., distance=.true., errors=.true.)
        call describe_results(scene, everything, .true., inverse, dyad=["dyad"], follows_assembly=.true.)
        call describe_results(scene, everything, .true., forward, is_forward=.true.)
        word = [character(len=word_len) :: inverse%variable%name, forward%variable%name, inverse%dimension(dim_sample)%name]
        word = pack(word, word /= "q" .and. word /= "qd" .and. word /= "qdd")
    end function result_words

    !> Why a column that names no state must not be passed over; empty: it may.
    pure function what_is_meant(table, i, expected, of_results) result(problem)
        type(table_spec), intent(in) :: table
        integer, intent(in) :: i                       !! column
        character(len=*), intent(in) :: expected(:)    !! names of the columns that states have
        character(len=*), intent(in) :: of_results(:)  !! as `result_words` gives them
        character(len=:), allocatable :: problem, nearest
        integer :: k

        problem = ""
        associate (column => table%column(i))
            if (any(of_results == column(:index(column, " ")))) return
            if (all(table%column /= "time") .and. looks_like_time(column, table%unit(i))) then
                problem = "instants are not called so (expected 'time')"
                return
            end if
            nearest = suggestion(column, pack(expected, [(all(table%column /= expected(k)), k=1, size(expected))]))
            if (nearest == "" .and. all(is_none(table%value(:, i)))) return
            problem = "no state and no result of the scene is called so (expected 'time', 'q NAME', 'qd NAME', 'qdd NAME')"//nearest
        end associate
    end function what_is_meant

    pure logical function looks_like_time(column, unit)
        character(len=*), intent(in) :: column, unit
        real(wp) :: factor
        character(len=:), allocatable :: problem

        call unit_factor(unit, time_span, factor, problem)
        looks_like_time = any(column == ["t   ", "T   ", "Time", "TIME"]) .or. suggestion(column, ["time"]) /= "" &
                          .or. (unit /= "" .and. problem == "")
    end function looks_like_time

    !> A field of words was read as no number.
    pure elemental logical function is_none(value)
        real(wp), intent(in) :: value

        is_none = .not. abs(value) <= huge(value)
    end function is_none
end module linkdyn_stray_columns
