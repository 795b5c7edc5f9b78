!> linkdyn_vec3: the operators on lanes against the formulas written out for one lane.
module test_vec3
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_pose, only: rpy_rotation, rotate_rpy
    use linkdyn_test_numbers, only: random_stream, random_vec3, largest_vec3, eps
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), operator(.unrotate.), vec3_of, zero_vec3, identity_mat3, same_lanes, unit, component, &
        lane_of, mat3_lane
    implicit none (type, external)
    private
    public :: collect_vec3

contains

    subroutine collect_vec3(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("sums and multiples", test_linear), &
            new_test("dot and cross products", test_products), &
            new_test("products with a fixed vector", test_fixed), &
            new_test("rotation and back", test_rotation), &
            new_test("product of rotations", test_matrix_product), &
            new_test("constants and parts", test_parts)]
    end subroutine collect_vec3

    subroutine test_linear(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(vec3) :: a, b
        real(wp) :: s(lanes)
        integer :: l

        a = random_vec3(stream)
        b = random_vec3(stream)
        s = stream%vector(lanes)
        do l = 1, lanes
            call check_close(error, lane_of(a + b, l), lane_of(a, l) + lane_of(b, l), 0.0_wp, "a + b")
            call check_close(error, lane_of(a - b, l), lane_of(a, l) - lane_of(b, l), 0.0_wp, "a - b")
            call check_close(error, lane_of(-a, l), -lane_of(a, l), 0.0_wp, "-a")
            call check_close(error, lane_of(s*a, l), s(l)*lane_of(a, l), 0.0_wp, "lanes times vector")
            call check_close(error, lane_of(2.5_wp*a, l), 2.5_wp*lane_of(a, l), 0.0_wp, "number times vector")
        end do
    end subroutine test_linear

    subroutine test_products(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(vec3) :: a, b, c
        real(wp) :: dot(lanes), x(3), y(3)
        integer :: l

        a = random_vec3(stream)
        b = random_vec3(stream)
        dot = a.dot.b
        c = a.cross.b
        do l = 1, lanes
            x = lane_of(a, l)
            y = lane_of(b, l)
            ! Three products below one, a few roundings each.
            call check_close(error, dot(l), x(1)*y(1) + x(2)*y(2) + x(3)*y(3), 4*eps, "a . b")
            call check_close(error, lane_of(c, l), [x(2)*y(3) - x(3)*y(2), x(3)*y(1) - x(1)*y(3), x(1)*y(2) - x(2)*y(1)], &
                             4*eps, "a x b")
        end do
    end subroutine test_products

    subroutine test_fixed(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(vec3) :: a
        type(mat3) :: r
        real(wp) :: b(3), difference(lanes)

        a = random_vec3(stream)
        b = stream%vector(3)
        r = random_rotation(stream)
        difference = (a.dot.b) - (a.dot.vec3_of(b))
        call check(error, maxval(abs(difference)) <= 4*eps, "dot product with a fixed vector")
        call check(error, largest_vec3((a.cross.b) - (a.cross.vec3_of(b))) <= 4*eps, "cross product with a fixed vector")
        call check(error, largest_vec3((r.rotate.b) - (r.rotate.vec3_of(b))) <= 4*eps, "rotation of a fixed vector")
        call check(error, maxval(abs(a.dot.b)) > 0, "the vectors are not zero")
    end subroutine test_fixed

    subroutine test_rotation(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(vec3) :: v, turned
        type(mat3) :: r
        integer :: l

        v = random_vec3(stream)
        r = random_rotation(stream)
        turned = r.rotate.v
        call check(error, largest_vec3((r.unrotate.turned) - v) <= 20*eps, "unrotate undoes rotate")
        call check(error, largest_vec3(turned - v) > 0.01_wp, "the rotation turns")
        do l = 1, lanes
            call check_close(error, lane_of(turned, l), matmul(mat3_lane(r, l), lane_of(v, l)), 8*eps, "R v")
            call check_close(error, lane_of(r.unrotate.v, l), matmul(transpose(mat3_lane(r, l)), lane_of(v, l)), 8*eps, "R^T v")
        end do
    end subroutine test_rotation

    subroutine test_matrix_product(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(mat3) :: a, b
        integer :: l

        a = random_rotation(stream)
        b = random_rotation(stream)
        do l = 1, lanes
            call check_close(error, mat3_lane(a*b, l), matmul(mat3_lane(a, l), mat3_lane(b, l)), 8*eps, "A B")
        end do
    end subroutine test_matrix_product

    subroutine test_parts(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(vec3) :: v, direction
        real(wp) :: m(3, 3), got(lanes)
        integer :: l, k

        v = random_vec3(stream)
        direction = unit(v)
        m = reshape(stream%vector(9), [3, 3])
        call check(error, largest_vec3(zero_vec3()) <= 0, "zero")
        call check(error, largest_vec3((identity_mat3() .rotate.v) - v) <= 0, "identity")
        call check(error, largest_vec3(v.cross.direction) <= 4*eps, "unit keeps the direction")
        do l = 1, lanes
            call check_close(error, norm2(lane_of(direction, l)), 1.0_wp, 4*eps, "unit has length one")
            call check_close(error, mat3_lane(same_lanes(m), l), m, 0.0_wp, "one matrix on all lanes")
        end do
        do k = 1, 3
            got = component(v, k)
            call check_close(error, got, [(dot_unit(lane_of(v, l), k), l=1, lanes)], 0.0_wp, "component")
        end do
    end subroutine test_parts

    pure real(wp) function dot_unit(v, k)
        real(wp), intent(in) :: v(3)
        integer, intent(in) :: k

        dot_unit = v(k)
    end function dot_unit

    function random_rotation(stream) result(r)
        type(random_stream), intent(inout) :: stream
        type(mat3) :: r
        type(rpy_rotation) :: turn

        call rotate_rpy(3*stream%vector(lanes), stream%vector(lanes), 3*stream%vector(lanes), turn)
        r = turn%r
    end function random_rotation
end module test_vec3
