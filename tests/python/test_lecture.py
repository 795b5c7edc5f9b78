"""The lecture's modules by other roads: the general engine, the slides' formulas with their errata, differences."""

from __future__ import annotations

from pathlib import Path

import mpmath
import numpy as np
import pytest

import linkdyn
from linkdyn import InputError
from linkdyn.lecture import (
    CSP_LINKS,
    FD_COUPLER_POINT,
    FD_CRANK_INPUT,
    FD_CSP_LINKS,
    FD_PRR_LINKS,
    FD_RRR_LINKS,
    FD_S_COUPLER_POINT,
    FD_S_CRANK_INPUT,
    PRR_links,
    RRR_links,
    S_COUPLER_POINT,
    S_CRANK_INPUT,
    Angle,
    Attitude,
    Coefficients,
    Point,
    coupler_point,
    crank_input,
    link_angle,
)

ROOT = Path(__file__).resolve().parents[2]
EPS = np.finfo(float).eps

RNG = np.random.default_rng(4)
N = 37  # not a multiple of any number of lanes


def some(*shape: int) -> np.ndarray:
    return RNG.uniform(-1.0, 1.0, shape)


def moving(x: float, y: float) -> Point:
    """N points near (x, y), each with its velocity and acceleration."""
    return Point(np.array([x, y]) + 0.1 * some(N, 2), some(N, 2), some(N, 2))


def accelerated(of: Coefficients, theta2: np.ndarray) -> np.ndarray:
    return np.einsum("nkd,nk->nd", of.of, theta2) + of.rest


# ---------------------------------------------------------------- planar


def test_rrr_coefficients_are_the_slides_with_errata_corrected() -> None:
    """P_k, Q, R_k, S, H_k, K and the angles alpha, beta, as the slides have them."""
    j1, j2 = moving(0.0, 0.0), moving(0.9, 0.3)
    of1, of2 = (Coefficients(some(N, 3, 2), some(N, 2)) for _ in range(2))
    length1, length2 = 0.8, 0.7
    for mode in (1, -1):
        joint, of = FD_RRR_LINKS(j1, j2, length1, length2, mode, j1_of=of1, j2_of=of2)
        d, dd = (j2.p - j1.p).T, (j2.dp - j1.dp).T
        length = np.hypot(*d)
        rate = (d * dd).sum(axis=0) / length
        alpha = np.arctan2(d[1], d[0])
        dalpha = (d[0] * dd[1] - d[1] * dd[0]) / length**2
        beta = np.arccos((length1**2 + length**2 - length2**2) / (2 * length1 * length))
        numerator = length1**2 - length2**2 - length**2
        dbeta = numerator * rate / (2 * length1 * length**2 * np.sin(beta))
        a, c = np.moveaxis(of2.of - of1.of, -1, 0)
        b, e = (of2.rest - of1.rest).T
        h = (d[0] * a.T + d[1] * c.T) / length
        k = (length * (d[0] * b + d[1] * e) + length * (dd**2).sum(axis=0) - rate * (d * dd).sum(axis=0)) / length**2
        p = (d[0] * c.T - d[1] * a.T) / length**2
        q = (d[0] * e - d[1] * b) / length**2 - 2 * rate * dalpha / length
        r = numerator * h / (2 * length1 * length**2 * np.sin(beta))
        s = numerator * k / (2 * length1 * length**2 * np.sin(beta)) + rate * (
            (length**2 - length1**2 + length2**2) * length * dbeta * np.cos(beta)
            + 2 * (length2**2 - length1**2) * rate * np.sin(beta)
        ) / (2 * length1 * length**3 * np.sin(beta) ** 2)
        angle, speed = alpha + mode * beta, dalpha + mode * dbeta
        columns = length1 * np.stack([-(p + mode * r) * np.sin(angle), (p + mode * r) * np.cos(angle)])
        rest = length1 * np.stack(
            [
                -(q + mode * s) * np.sin(angle) - speed**2 * np.cos(angle),
                (q + mode * s) * np.cos(angle) - speed**2 * np.sin(angle),
            ]
        )
        # The slides' angles lose digits by 1/sin(beta)^3 in the second derivatives.
        tolerance = 1e3 * EPS / np.sin(beta).min() ** 3
        assert np.allclose(joint.p, j1.p + length1 * np.stack([np.cos(angle), np.sin(angle)], axis=-1), 0, tolerance)
        assert np.allclose(of.of - of1.of, columns.transpose(2, 1, 0), 0, tolerance)
        assert np.allclose(of.rest - of1.rest, rest.T, 0, tolerance * np.abs(rest).max())


def test_crank_and_coupler_coefficients_are_the_slides() -> None:
    j1, j2 = moving(0.0, 0.0), moving(0.9, 0.3)
    theta, base = Angle(some(N), some(N)), Angle(some(N), some(N))
    of1, of2 = (Coefficients(some(N, 2, 2), some(N, 2)) for _ in range(2))
    base_of = Coefficients(some(N, 2), some(N))
    _, tip_of = FD_CRANK_INPUT(j1, 0.6, theta, base, crank=1, j1_of=of1, base_of=base_of)
    s, c = np.sin(theta.the + base.the), np.cos(theta.the + base.the)
    e = base_of.of + [0.0, 1.0]
    rate2 = (theta.dthe + base.dthe) ** 2
    assert np.allclose(tip_of.of[..., 0], -0.6 * e * s[:, None] + of1.of[..., 0], 0, 16 * EPS)
    assert np.allclose(tip_of.of[..., 1], 0.6 * e * c[:, None] + of1.of[..., 1], 0, 16 * EPS)
    assert np.allclose(tip_of.rest[:, 0], -0.6 * (base_of.rest * s + rate2 * c) + of1.rest[:, 0], 0, 16 * EPS)
    assert np.allclose(tip_of.rest[:, 1], 0.6 * (base_of.rest * c - rate2 * s) + of1.rest[:, 1], 0, 16 * EPS)

    point, angle, point_of, angle_of = FD_COUPLER_POINT(j1, j2, 0.3, 0.2, j1_of=of1, j2_of=of2)
    d = (j2.p - j1.p).T
    square = (d**2).sum(axis=0)
    phi = np.arctan2(d[1], d[0])
    a, c = np.moveaxis(of2.of - of1.of, -1, 0)
    b, e = (of2.rest - of1.rest).T
    e_i = ((d[0] * c.T - d[1] * a.T) / square).T
    f_i = (d[0] * e - d[1] * b) / square
    x, y = 0.3 * np.cos(phi) - 0.2 * np.sin(phi), 0.3 * np.sin(phi) + 0.2 * np.cos(phi)
    assert np.allclose(angle.the, phi, 0, 4 * EPS)
    assert np.allclose(angle_of.of, e_i, 0, 32 * EPS) and np.allclose(angle_of.rest, f_i, 0, 32 * EPS)
    assert np.allclose(point_of.of, np.stack([-y[:, None] * e_i, x[:, None] * e_i], -1) + of1.of, 0, 32 * EPS)
    rest = np.stack([-y * f_i - x * angle.dthe**2, x * f_i - y * angle.dthe**2], -1) + of1.rest
    assert np.allclose(point_of.rest, rest, 0, 64 * EPS)
    assert np.allclose(point.p - j1.p, np.stack([x, y], -1), 0, 8 * EPS)


def test_prr_coefficients_sum_up() -> None:
    """The affine map: any accelerations of the cranks give what the plain module gives for the sums."""
    j1, rail, psi = moving(0.0, 0.0), moving(0.5, 0.2), Angle(some(N), some(N))
    of1, of_rail, of_psi = Coefficients(some(N, 2, 2), some(N, 2)), Coefficients(some(N, 2, 2)), Coefficients(some(N, 2))
    theta2 = some(N, 2)
    *motion, slide_of, slider_of, joint_of = FD_PRR_LINKS(
        j1, 1.5, rail, psi, 0.1, -0.2, 1, j1_of=of1, rail_of=of_rail, psi_of=of_psi
    )
    psi2 = np.einsum("nk,nk->n", of_psi.of, theta2)
    slide, slider, joint = PRR_links(
        Point(j1.p, j1.dp, accelerated(of1, theta2)),
        1.5,
        Point(rail.p, rail.dp, accelerated(of_rail, theta2)),
        Angle(psi.the, psi.dthe, psi2),
        0.1,
        -0.2,
        1,
    )
    assert np.allclose(accelerated(slider_of, theta2), slider.ddp, 0, 1e3 * EPS)
    assert np.allclose(accelerated(joint_of, theta2), joint.ddp, 0, 1e3 * EPS)
    assert np.allclose(np.einsum("nk,nk->n", slide_of.of, theta2) + slide_of.rest, slide.ddv, 0, 1e3 * EPS)
    assert np.allclose(motion[2].dp, joint.dp, 0, 16 * EPS)
    assert np.allclose(np.linalg.norm(joint.p - j1.p, axis=-1), 1.5, 0, 8 * EPS)


@pytest.mark.parametrize("mode", [1, -1])
def test_mode(mode: int) -> None:
    joint = RRR_links(Point((0.0, 0.0)), Point((1.0, 0.0)), 0.8, 0.8, mode)
    assert joint.p.shape == (2,) and np.allclose(joint.p, [0.5, mode * np.sqrt(0.39)], 0, 4 * EPS)
    slide, _, joint = PRR_links(Point((0.2, 0.6)), 1.0, Point((0.0, 0.0)), Angle(0.0), 0.0, 0.0, mode)
    assert np.allclose(joint.p, [0.2 + mode * 0.8, 0.0], 0, 4 * EPS) and np.isclose(slide.v, joint.x, 0, 4 * EPS)


def test_out_of_reach_is_nan_and_its_neighbours_are_not() -> None:
    far = Point(np.array([[1.0, 0.0], [2.5, 0.0], [1.0, 0.1]]))
    joint = RRR_links(Point((0.0, 0.0)), far, 1.0, 1.0, 1)
    assert np.isnan(joint.p[1]).all() and np.isfinite(joint.p[[0, 2]]).all()


@pytest.mark.parametrize("file", ["scene.toml", "scene_inclined.toml"])
def test_sixbar_agrees_with_the_engine(file: str) -> None:
    """Positions, velocities and accelerations of the lecture's six-bar, module by module."""
    scene = linkdyn.load(ROOT / "examples" / "sixbar_slider" / file)
    inclined = "inclined" in file
    theta = Angle(np.linspace(0.0, 2 * np.pi, N), 2 * np.pi)
    j3, psi, rail = Point((-0.72, -0.21)), Angle(0.2 * inclined), Point((0.0, 0.05 if inclined else 0.1))
    j1 = crank_input(Point((0.0, 0.0)), 0.3, theta)
    j2 = RRR_links(j3, j1, 0.5, 0.8, 1)
    j4, phi1 = coupler_point(j2, j1, 0.4, 0.3)
    slide, j6, j5 = PRR_links(j4, 0.8, rail, psi, 0.06, 0.02, 1)
    poses = scene.poses(theta.the[:, None])
    links = [link["name"] for link in scene.description["links"][1:]]  # the frame does not move
    for name, point in {"coupler": j2, "rod": j5, "slider": j6}.items():
        got = poses.position[:, links.index(name), :2]
        assert np.allclose(got, point.p, 0, 32 * EPS), name
    run = scene.inverse(q=theta.the[:, None], qd=np.full((N, 1), 2 * np.pi), qdd=np.zeros((N, 1)), want="all")
    assert np.allclose(run.joint_rate.sel(variable="J6.slide"), slide.dv, 0, 1e3 * EPS)
    rotation = poses.rotation[:, links.index("coupler")]
    assert np.allclose(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]), phi1.the, 0, 64 * EPS)
    assert np.allclose(link_angle(j2, j1).ddthe, phi1.ddthe, 0, 0)


# ---------------------------------------------------------------- spatial


def rcsp(theta: Angle) -> dict[str, Point | Attitude]:
    """The lecture's R-C-S-P four-bar as in examples/rcsp_start."""
    c, s = np.cos(np.radians(120.0)), np.sin(np.radians(120.0))
    axis = np.array([[s, 0.0, c], [0.0, 1.0, 0.0], [-c, 0.0, s]])  # z: 30 degrees from vertical
    rail = np.array([[s, c, 0.0], [-c, s, 0.0], [0.0, 0.0, 1.0]])
    l_c, frame = S_CRANK_INPUT(Point((0.01, 0.0, 0.0)), Attitude(), theta, (0.1, 0.0, 0.11), axis)
    l_p = Point((0.4 * c, 0.4 * s, 0.11))
    cylinder, coupler, ball, slider = CSP_LINKS(l_c, frame, l_p, Attitude(rail), (0.6, 0, 0), (0, 0.3, 0), 1)
    cog, _ = S_COUPLER_POINT(cylinder, coupler, (0.3467, 0.0, 0.0))
    return {"axis": frame, "C": cylinder, "coupler": coupler, "S": ball, "P": slider, "cog": cog}


def test_rcsp_agrees_with_the_engine() -> None:
    scene = linkdyn.load(ROOT / "examples" / "rcsp_start" / "scene.toml")
    q, qd, qdd = scene.motion(np.linspace(0.0, 2.0, N))
    got = rcsp(Angle(q[:, 0], qd[:, 0], qdd[:, 0]))
    poses = scene.poses(q)
    links = [link["name"] for link in scene.description["links"][1:]]  # the frame does not move
    assert np.allclose(poses.position[:, links.index("coupler")], got["C"].p, 0, 64 * EPS)
    assert np.allclose(poses.position[:, links.index("output")], got["P"].p, 0, 64 * EPS)
    run = scene.inverse(q=q, qd=qd, qdd=qdd, want="all")
    slope = np.array([-0.5, np.sqrt(0.75), 0.0])
    assert np.allclose(run.joint_rate.sel(variable="P.slide"), got["P"].dp @ slope, 0, 1e3 * EPS)
    # What the slider's inertia asks of S and P along the slide: the force in S.
    force = run.reaction.sel(joint="S", component=["Fx", "Fy", "Fz"]).values @ slope
    assert np.allclose(force, 2.147 * got["P"].ddp @ slope, 0, 1e-11)


def test_spatial_crank_coefficients_are_the_slides_with_errata_corrected() -> None:
    frame = Attitude(rotations(N), some(N, 3))
    joint = Point(some(N, 3), some(N, 3))
    theta = Angle(some(N), some(N))
    of, turn_of = (Coefficients(some(N, 2, 3), some(N, 3)) for _ in range(2))
    b, r_ab = some(3), rotations(1)[0]
    point, attitude, point_of, attitude_of = FD_S_CRANK_INPUT(
        joint, frame, theta, b, r_ab, crank=1, joint_of=of, frame_of=turn_of
    )
    c, s = np.cos(theta.the), np.sin(theta.the)
    zero, one = np.zeros(N), np.ones(N)
    turn = matrices([[c, -s, zero], [s, c, zero], [zero, zero, one]])
    c_theta = matrices([[-s, -c, zero], [c, -s, zero], [zero, zero, zero]])
    d_theta = -theta.dthe[:, None, None] ** 2 * matrices([[c, -s, zero], [s, c, zero], [zero, zero, zero]])
    turn_rate = theta.dthe[:, None, None] * c_theta
    for k in range(2):
        c_rr = frame.r @ skew(turn_of.of[:, k])
        arm = c_rr @ turn + (k == 1) * frame.r @ c_theta
        assert np.allclose(point_of.of[:, k], arm @ b + of.of[:, k], 0, 64 * EPS)
        assert np.allclose(attitude.r @ skew(attitude_of.of[:, k]), arm @ r_ab, 0, 64 * EPS)
        omega = (turn.transpose(0, 2, 1) @ turn_of.of[:, k, :, None])[..., 0] + (k == 1) * np.array([0.0, 0.0, 1.0])
        assert np.allclose(attitude_of.of[:, k], omega @ r_ab, 0, 64 * EPS)
    spin = skew(frame.omega)
    d_rr = frame.r @ (skew(turn_of.rest) + spin @ spin)
    arm = d_rr @ turn + 2 * frame.dr @ turn_rate + frame.r @ d_theta
    assert np.allclose(point_of.rest, arm @ b + of.rest, 0, 256 * EPS)
    rest = turn.transpose(0, 2, 1) @ turn_of.rest[..., None] + turn_rate.transpose(0, 2, 1) @ frame.omega[..., None]
    assert np.allclose(attitude_of.rest, rest[..., 0] @ r_ab, 0, 256 * EPS)
    assert np.allclose(Attitude(attitude.r, attitude.omega, attitude_of.rest).ddr, arm @ r_ab, 0, 256 * EPS)


def test_csp_coefficients_are_the_errata_formulas() -> None:
    """S and C on a moving axis, the slide's direction fixed, as derived for the errata."""
    frame, l_c = Attitude(rotations(N), some(N, 3)), Point(0.2 * some(N, 3), some(N, 3))
    slope = np.array([0.6, 0.0, 0.8])
    rail = Attitude(np.array([[0.0, 0.6, -0.8], [1.0, 0.0, 0.0], [0.0, 0.8, 0.6]]) * [1, 1, -1])
    of, turn_of = (Coefficients(some(N, 2, 3), some(N, 3)) for _ in range(2))
    radius = 3.0
    c, coupler, s, p, c_of, _, s_of, p_of = FD_CSP_LINKS(
        l_c, frame, Point((0.1, 0.2, 0.3)), rail, (radius, 0, 0), (0, 0.3, 0), 1, axis_point_of=of, axis_frame_of=turn_of
    )
    u, du = frame.r[..., 2], frame.dr[..., 2]
    w = s.p - l_c.p
    sigma = (w * u).sum(-1, keepdims=True)
    n = w - sigma * u
    assert np.allclose(np.linalg.norm(n, axis=-1), radius, 0, 64 * EPS)
    ny = n @ slope[:, None]
    rate = (n * (l_c.dp + sigma * du)).sum(-1, keepdims=True) / ny
    dw = rate * slope - l_c.dp
    dsigma = (dw * u).sum(-1, keepdims=True) + (w * du).sum(-1, keepdims=True)
    e = rate * slope - l_c.dp - sigma * du
    tolerance = 1e4 * EPS / np.abs(ny).min() ** 3
    assert np.allclose(s.dp, rate * slope, 0, tolerance)
    spin = skew(frame.omega)
    for k in range(2):
        ddu = (frame.r @ skew(turn_of.of[:, k]))[..., 2]
        column = (n * (of.of[:, k] + sigma * ddu)).sum(-1, keepdims=True) / ny
        assert np.allclose(s_of.of[:, k], column * slope, 0, tolerance * np.abs(column).max())
        assert np.allclose(p_of.of[:, k], s_of.of[:, k], 0, 16 * EPS * np.abs(column).max())
    ddu = (frame.r @ (skew(turn_of.rest) + spin @ spin))[..., 2]
    gap = (n * (of.rest + dsigma * du + sigma * ddu)).sum(-1, keepdims=True) - (e * e).sum(-1, keepdims=True)
    rest = (gap + dsigma * (dsigma - (w * du).sum(-1, keepdims=True))) / ny
    assert np.allclose(s_of.rest, rest * slope, 0, tolerance * np.abs(rest).max())
    assert np.allclose(c.p, l_c.p + sigma * u, 0, 64 * EPS)
    assert np.allclose(coupler.r[..., 0], n / radius, 0, 64 * EPS)


def test_spatial_coupler_point_coefficients() -> None:
    frame, origin = Attitude(rotations(N), some(N, 3)), Point(some(N, 3), some(N, 3))
    of, turn_of = (Coefficients(some(N, 2, 3), some(N, 3)) for _ in range(2))
    m, r_mg = some(3), rotations(1)[0]
    _, attitude, point_of, attitude_of = FD_S_COUPLER_POINT(origin, frame, m, r_mg, origin_of=of, frame_of=turn_of)
    for k in range(2):
        assert np.allclose(point_of.of[:, k], of.of[:, k] + frame.r @ skew(turn_of.of[:, k]) @ m, 0, 32 * EPS)
        assert np.allclose(attitude_of.of[:, k], turn_of.of[:, k] @ r_mg, 0, 32 * EPS)
    spin = skew(frame.omega)
    assert np.allclose(point_of.rest, of.rest + frame.r @ (skew(turn_of.rest) + spin @ spin) @ m, 0, 64 * EPS)
    assert np.allclose(attitude.omega, frame.omega @ r_mg, 0, 32 * EPS)


def rotations(n: int) -> np.ndarray:
    q, r = np.linalg.qr(some(n, 3, 3))
    q *= np.sign(np.linalg.det(q))[:, None, None]
    return q


def matrices(rows: list[list[np.ndarray]]) -> np.ndarray:
    return np.array(rows).transpose(2, 0, 1)


def skew(w: np.ndarray) -> np.ndarray:
    x, y, z = w.T
    zero = np.zeros_like(x)
    return matrices([[zero, -z, y], [z, zero, -x], [-y, x, zero]])


# ---------------------------------------------------------------- messages


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Point((1.0, 2.0, 3.0, 4.0)), "Point p: expected shape"),
        (lambda: Point((1.0, 2.0), (1.0, 2.0, 3.0)), "do not fit together"),
        (lambda: Point((1.0, 2.0j)), "expected real numbers"),
        (lambda: crank_input((0.0, 0.0), 1.0, Angle()), "j1: expected Point, got tuple"),
        (lambda: crank_input(Point((0.0, 0.0, 0.0)), 1.0, Angle()), "expected a point of 2 components, got 3"),
        (lambda: crank_input(Point((0.0, 0.0)), float("nan"), Angle()), "length: expected one finite number"),
        (lambda: crank_input(Point(some(3, 2)), 1.0, Angle(some(4))), "theta.the: shape"),
        (lambda: RRR_links(Point((0.0, 0.0)), Point((1.0, 0.0)), 1.0, 1.0, 0), "mode: expected \\+1 or -1"),
        (lambda: FD_RRR_LINKS(Point((0.0, 0.0)), Point((1.0, 0.0)), 1.0, 1.0, 1), "no coefficients given"),
        (
            lambda: FD_RRR_LINKS(
                Point((0.0, 0.0)),
                Point((1.0, 0.0)),
                1.0,
                1.0,
                1,
                j1_of=Coefficients(np.zeros((1, 2))),
                j2_of=Coefficients(np.zeros((2, 2))),
            ),
            "numbers of cranks differ: j1_of 1, j2_of 2",
        ),
        (
            lambda: FD_RRR_LINKS(
                Point((0.0, 0.0)), Point((1.0, 0.0)), 1.0, 1.0, 1, j1_of=Coefficients(np.zeros((1, 3)))
            ),
            "j1_of.of: expected shape",
        ),
        (lambda: FD_CRANK_INPUT(Point((0.0, 0.0)), 1.0, Angle(), crank=1), "crank: expected 0 to 0, got 1"),
        (lambda: S_CRANK_INPUT(Point((0.0, 0.0)), Attitude(), Angle(), (1.0, 0.0, 0.0)), "point of 3 components"),
        (lambda: S_CRANK_INPUT(Point((0.0, 0.0, 0.0)), Attitude(), Angle(), (1.0, 0.0)), "b: expected shape \\(3,\\)"),
        (lambda: Attitude(np.eye(2)), "Attitude r: expected shape"),
    ],
)
def test_messages(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()


# ---------------------------------------------------------------- what is no number, and what is none any more

NOT_ROTATIONS = [np.diag([1.0, 1.0, -1.0]), 2 * np.eye(3), np.eye(3) + np.eye(3, k=1), np.zeros((3, 3)), -np.eye(3)]


@pytest.mark.parametrize("r", NOT_ROTATIONS, ids=["mirror", "scale", "shear", "zero", "point reflection"])
def test_attitudes_are_rotations(r):
    with pytest.raises(InputError, match="Attitude r: expected a rotation"):
        Attitude(r)
    with pytest.raises(InputError, match="Attitude r"):
        Attitude(np.stack([np.eye(3), r]))
    origin = Point((0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="r_ab: expected a rotation"):
        S_CRANK_INPUT(origin, Attitude(), Angle(0.8), [0.1, 0.0, 0.0], r)
    with pytest.raises(InputError, match="r_mg: expected a rotation"):
        S_COUPLER_POINT(origin, Attitude(), [0.1, 0.0, 0.0], r)


def test_a_rotation_written_with_seven_digits_will_do():
    c, s = 0.8660254, 0.5
    written = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
    np.testing.assert_array_equal(Attitude(written).r, written)


@pytest.mark.parametrize("length", [-0.5, 0.0])
def test_lengths_are_positive(length):
    a, b, theta = Point((-0.72, -0.21)), Point((0.26, 0.15)), Angle(0.3)
    for name, call in {
        "length1": lambda: RRR_links(a, b, length, 0.8, 1),
        "length2": lambda: RRR_links(a, b, 0.5, length, 1),
        "length": lambda: PRR_links(a, length, b, theta, 0.0, 0.0, 1),
    }.items():
        with pytest.raises(InputError, match=f"{name}: expected a length above zero"):
            call()
    with pytest.raises(InputError, match="length: expected a length above zero"):
        crank_input(a, length, theta)


def test_a_line_needs_two_points():
    """Joints that coincide, exactly or but for rounding, lie in no direction."""
    a = Point(np.array([[0.1, 0.2], [0.3, 0.4]]))
    for b in (a, Point(a.p + np.array([0.0, 1e-17])), Point(a.p + np.array([[1.0, 0.0], [0.0, 0.0]]))):
        for call in (lambda: link_angle(a, b), lambda: coupler_point(a, b, 0.1, 0.0), lambda: FD_COUPLER_POINT(
            a, b, 0.1, 0.0, j1_of=Coefficients(np.zeros((1, 2))))):
            with pytest.raises(InputError, match="j1, j2: coincide"):
                call()


@pytest.mark.parametrize("mode", [0, 2, 1.5, np.array([1, -1]), [1], "1", None])
def test_mode_is_one_of_two(mode):
    with pytest.raises(InputError, match="mode: expected"):
        RRR_links(Point((0.0, 0.0)), Point((1.0, 0.0)), 1.0, 1.0, mode)


STRETCHES = [10.0**-k for k in range(17)]
"""Angles [rad] from a dead point."""


def close_to(got: np.ndarray, want: mpmath.matrix, rel: float) -> bool:
    return all(abs(float(g) - w) <= rel * max(map(abs, want)) for g, w in zip(got, want))


@pytest.mark.parametrize("is_stretched", [True, False], ids=["stretched", "folded"])
@pytest.mark.parametrize("shift", [0.0, 1e4])
def test_rrr_near_its_dead_points(shift, is_stretched):
    """In 60 digits: velocities are right to three digits, or NaN; and they are there as long as the position tells them.

    The second joint moves square to the stretched links but for a part that grows with the angle from the dead point, so the
    velocities stay of the size of one.
    """
    n_known = 0
    for angle in STRETCHES:
        with mpmath.workdps(60):
            gamma = mpmath.mpf(angle)
            end = mpmath.mpf(0.8) * mpmath.matrix([mpmath.cos(gamma), mpmath.sin(gamma)]) * (1 if is_stretched else -1)
            j1, j2 = (shift, shift), [float(0.5 + end[0] + shift), float(end[1] + shift)]
            rate, d = [0.3, 1.0], [mpmath.mpf(j2[k]) - mpmath.mpf(j1[k]) for k in range(2)]
            want = velocity_of_joint(d, rate, mpmath.mpf(0.5), mpmath.mpf(0.8), -1 if is_stretched else 1)
        got = RRR_links(Point(j1), Point(j2, rate), 0.5, 0.8, -1 if is_stretched else 1)
        if np.isnan(got.dp).any():
            assert np.isnan(got.ddp).all()
            continue
        assert want is not None and close_to(got.dp, want, 1e-3), angle
        n_known += 1
    # an angle leaves its square in the distance of the joints: half of the digits of the positions, three of them kept
    assert n_known >= (6 if shift == 0 else 4)
    at_it = RRR_links(Point((0.0, 0.0)), Point((1.3, 0.0), (0.0, 1.0)), 0.5, 0.8, 1)
    assert np.isfinite(at_it.p).all() and np.isnan(at_it.dp).all() and np.isnan(at_it.ddp).all()


def velocity_of_joint(d: list, rate: list, length1, length2, mode: int) -> mpmath.matrix | None:
    """Of the joint of two links, from the law of cosines; None: out of reach."""
    square = d[0] ** 2 + d[1] ** 2
    along = (length1**2 - length2**2 + square) / (2 * square)
    height2 = length1**2 / square - along**2
    if height2 <= 0:
        return None
    across = mode * mpmath.sqrt(height2)
    arm1 = mpmath.matrix([along * d[0] - across * d[1], along * d[1] + across * d[0]])
    arm2 = mpmath.matrix([arm1[0] - d[0], arm1[1] - d[1]])
    # v = w1 x arm1 = rate + w2 x arm2
    turn = mpmath.lu_solve(mpmath.matrix([[-arm1[1], arm2[1]], [arm1[0], -arm2[0]]]), mpmath.matrix([mpmath.mpf(r) for r in rate]))
    return mpmath.matrix([-turn[0] * arm1[1], turn[0] * arm1[0]])


@pytest.mark.parametrize("shift", [0.0, 1e4])
def test_prr_near_its_dead_points(shift):
    """The rail moves across the crank's circle until it touches it."""
    n_known = 0
    for angle in STRETCHES:
        height = float(mpmath.mpf(0.7) * mpmath.cos(angle))
        rail = Point((shift, shift + height), (0.2, 1.0))
        slide, _, joint = PRR_links(Point((shift, shift)), 0.7, rail, Angle(0.0), 0.0, 0.0, 1)
        if np.isnan(joint.dp).any():
            assert np.isnan(slide.dv)
            continue
        with mpmath.workdps(60):
            y = mpmath.mpf(shift + height) - mpmath.mpf(shift)
            x = mpmath.sqrt(mpmath.mpf(0.7) ** 2 - y**2)
            want = mpmath.matrix([-y / x, mpmath.mpf(1)])
        assert close_to(joint.dp, want, 1e-3), angle
        n_known += 1
    assert n_known >= (6 if shift == 0 else 4)


def test_csp_near_its_dead_points():
    """The slide's line moves across the cylinder until it touches it."""
    n_known = 0
    for angle in STRETCHES:
        height = float(mpmath.mpf(0.7) * mpmath.cos(angle))
        slide_point = Point((height, 0.0, 0.0), (1.0, 0.0, 0.0))
        c, _, s, _ = CSP_LINKS(Point((0.0, 0.0, 0.0)), Attitude(), slide_point, Attitude(), (0.7, 0.0, 0.0), (0.0, 0.0, 0.0), 1)
        if np.isnan(s.dp).any():
            continue
        with mpmath.workdps(60):
            x = mpmath.mpf(height)
            want = mpmath.matrix([mpmath.mpf(1), -x / mpmath.sqrt(mpmath.mpf(0.7) ** 2 - x**2), mpmath.mpf(0)])
        assert close_to(s.dp, want, 1e-3), angle
        n_known += 1
    assert n_known >= 6


def test_more_cranks_than_the_memory_holds(monkeypatch):
    def no_memory(*_, **_named):
        raise MemoryError

    monkeypatch.setattr("linkdyn.lecture.np.concatenate", no_memory)
    with pytest.raises(InputError, match=r"fd_crank_input: more cranks \(3\) or samples than the memory holds"):
        FD_CRANK_INPUT(Point((0.0, 0.0)), 1.0, Angle(), crank=0, cranks=3)
