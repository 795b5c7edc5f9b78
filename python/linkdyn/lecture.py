"""The lecture's kinematics modules by name: a mechanism is walked joint by joint, one call a link or a pair of links.

Each function takes points with their velocity and acceleration, and gives some. They are computed by the lecture's own closed
forms and linear maps, independent of the engine behind `linkdyn.load`; tests compare both. Arrays broadcast: where a crank has N
angles, every point that follows from it has N positions.

>>> import numpy as np
>>> from linkdyn.lecture import Angle, Point, crank_input, RRR_links
>>> theta = Angle(np.linspace(0.0, 2 * np.pi, 361), 2 * np.pi)                 # 60 rpm
>>> tip = crank_input(Point((0.0, 0.0)), 0.3, theta)
>>> joint = RRR_links(Point((-0.72, -0.21)), tip, 0.5, 0.8, +1)
>>> joint.p.shape
(361, 2)

The coefficient forms ``FD_...`` serve forward dynamics. They give, beside position and velocity, the coefficients of the
accelerations, which are linear in the cranks' angular accelerations: ``X" = sum A_k theta_k" + B``. A crank's
``ddthe`` does not enter them: it is the unknown. The accelerations that they return are those of cranks at constant rates.

What cannot be assembled is NaN, sample by sample; so are the rates and accelerations at a dead point, and so near to one that
the last digits of the position decide about them: where fewer than three digits of the rates are certain.

References
----------
N. Iwatsuki, *Advanced Mechanical Elements*, lecture 3: dynamic analysis of planar/spatial link mechanisms using the
systematic kinematic analysis, Tokyo Institute of Technology, 2023. Slides are cited by their titles; where one carries an
error, the function that is concerned says so.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _engine
from ._arguments import as_count, quoted
from ._listing import only
from .errors import InputError

__all__ = [
    "Angle",
    "Attitude",
    "Coefficients",
    "Point",
    "Slide",
    "crank_input",
    "rrr_links",
    "prr_links",
    "coupler_point",
    "link_angle",
    "fd_crank_input",
    "fd_rrr_links",
    "fd_prr_links",
    "fd_coupler_point",
    "s_crank_input",
    "csp_links",
    "s_coupler_point",
    "fd_s_crank_input",
    "fd_csp_links",
    "fd_s_coupler_point",
    "RRR_links",
    "PRR_links",
    "FD_CRANK_INPUT",
    "FD_RRR_LINKS",
    "FD_PRR_LINKS",
    "FD_COUPLER_POINT",
    "S_CRANK_INPUT",
    "CSP_LINKS",
    "S_COUPLER_POINT",
    "FD_S_CRANK_INPUT",
    "FD_CSP_LINKS",
    "FD_S_COUPLER_POINT",
]
__dir__ = only(__all__)

_api: Any = _engine.linkdyn_f2py_lecture  # called with lists of packed arguments, whose number a type does not say

Floats = NDArray[np.float64]

FIT = 1e-6
"""How exactly a matrix is a rotation: as one written down with seven digits."""
NEAR = np.sqrt(np.finfo(float).eps)
"""Joints so near to each other, beside their distance from the origin, leave half of the digits of the line's angle."""


# ---------------------------------------------------------------- what goes in and out


@dataclass(frozen=True, eq=False)
class Point:
    """The lecture's POINT, in the plane or in space.

    Parameters
    ----------
    p, dp, ddp
        (..., 2) or (..., 3) position [m], velocity [m/s], acceleration [m/s2]; the last two are zero unless given.
    """

    p: Floats
    dp: Floats = 0.0  # type: ignore[assignment]
    ddp: Floats = 0.0  # type: ignore[assignment]

    def __post_init__(self) -> None:
        p = _floats("Point p", self.p)
        if p.ndim == 0 or p.shape[-1] not in (2, 3):
            raise InputError(f"Point p: expected shape (..., 2) or (..., 3), got {p.shape}")
        _set_broadcast(self, p=p, dp=self.dp, ddp=self.ddp)

    @property
    def x(self) -> Floats:
        """Position along x [m]."""
        return self.p[..., 0]

    @property
    def y(self) -> Floats:
        """Position along y [m]."""
        return self.p[..., 1]

    @property
    def ddx(self) -> Floats:
        """Acceleration along x [m/s2]."""
        return self.ddp[..., 0]

    @property
    def ddy(self) -> Floats:
        """Acceleration along y [m/s2]."""
        return self.ddp[..., 1]


@dataclass(frozen=True, eq=False)
class Angle:
    """The lecture's ANGLE: (...) angle [rad], rate [rad/s], angular acceleration [rad/s2]."""

    the: Floats = 0.0  # type: ignore[assignment]
    dthe: Floats = 0.0  # type: ignore[assignment]
    ddthe: Floats = 0.0  # type: ignore[assignment]

    def __post_init__(self) -> None:
        _set_broadcast(self, the=self.the, dthe=self.dthe, ddthe=self.ddthe)


@dataclass(frozen=True, eq=False)
class Slide:
    """The lecture's VARIABLE: (...) slide [m], rate [m/s], acceleration [m/s2]."""

    v: Floats = 0.0  # type: ignore[assignment]
    dv: Floats = 0.0  # type: ignore[assignment]
    ddv: Floats = 0.0  # type: ignore[assignment]

    def __post_init__(self) -> None:
        _set_broadcast(self, v=self.v, dv=self.dv, ddv=self.ddv)


@dataclass(frozen=True, eq=False)
class Attitude:
    """Attitude of a link, or of axes fixed in it.

    Parameters
    ----------
    r
        (..., 3, 3) the lecture's ``[R_.]``, a rotation from the link's axes to world axes; default: parallel to the world's.
    omega, domega
        (..., 3) angular velocity [rad/s] and its derivative [rad/s2], components along the link's axes.
    """

    r: Floats = None  # type: ignore[assignment]
    omega: Floats = 0.0  # type: ignore[assignment]
    domega: Floats = 0.0  # type: ignore[assignment]

    def __post_init__(self) -> None:
        r = np.eye(3) if self.r is None else _floats("Attitude r", self.r)
        if r.shape[-2:] != (3, 3):
            raise InputError(f"Attitude r: expected shape (..., 3, 3), got {r.shape}")
        _require_rotation("Attitude r", r)
        spin = [_floats(f"Attitude {name}", getattr(self, name)) for name in ("omega", "domega")]
        _, omega, domega = _broadcast("Attitude (3,), omega, domega", [np.zeros(3), *spin])
        _set(self, r=r, omega=omega, domega=domega)

    @property
    def dr(self) -> Floats:
        """(..., 3, 3) rate of ``r``."""
        return self.r @ _skew(self.omega)

    @property
    def ddr(self) -> Floats:
        """(..., 3, 3) second derivative of ``r``."""
        spin = _skew(self.omega)
        return self.r @ (_skew(self.domega) + spin @ spin)


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Coefficients of an acceleration: ``sum over k of of[k] theta_k" + rest``.

    Parameters
    ----------
    of
        Of a point (..., n, 2) or (..., n, 3): the lecture's (A_k, C_k) or ``[C_.]``; of an angle or a slide (..., n): E_k;
        of an attitude (..., n, 3): [C_omega.]. n is the number of cranks.
    rest
        (..., 2), (..., 3) or (...): (B, D), F, d; zero unless given.
    """

    of: Floats
    rest: Floats = 0.0  # type: ignore[assignment]

    def __post_init__(self) -> None:
        _set(self, of=_floats("Coefficients of", self.of), rest=_floats("Coefficients rest", self.rest))


def _set(item: Any, **values: Floats) -> None:
    """Fill a frozen item."""
    for name, value in values.items():
        object.__setattr__(item, name, value)


def _set_broadcast(item: Any, **values: ArrayLike) -> None:
    """Fill a frozen item; values, rates and accelerations take one shape."""
    name = type(item).__name__
    arrays = [_floats(f"{name} {key}", value) for key, value in values.items()]
    _set(item, **dict(zip(values, _broadcast(f"{name} {', '.join(values)}", arrays))))


def _floats(name: str, values: ArrayLike) -> Floats:
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise InputError(f"{name}: rows of unequal length") from error
    if array.dtype.kind not in "fiu":
        raise InputError(f"{name}: expected real numbers, got dtype {array.dtype}")
    return array.astype(np.float64, copy=False)


def _broadcast(name: str, arrays: list[Floats]) -> list[Floats]:
    try:
        return list(np.broadcast_arrays(*arrays))
    except ValueError:
        shapes = ", ".join(str(array.shape) for array in arrays)
        raise InputError(f"{name}: shapes {shapes} do not fit together") from None


def _require_rotation(name: str, r: Floats) -> None:
    """Refuse what mirrors, shears or scales; NaN, of what could not be assembled, passes."""
    known = r[np.isfinite(r).all(axis=(-2, -1))]
    apart = np.abs(known @ known.swapaxes(-1, -2) - np.eye(3)).max(initial=0.0)
    if apart > FIT:
        raise InputError(f"{name}: expected a rotation, but its columns are not square and of length 1, by {apart:.2g}")
    if np.any(np.linalg.det(known) < 0):
        raise InputError(f"{name}: expected a rotation, got a reflection")


def _skew(w: Floats) -> Floats:
    """The matrix whose product with v is w x v."""
    zero = np.zeros(w.shape[:-1])
    rows = [[zero, -w[..., 2], w[..., 1]], [w[..., 2], zero, -w[..., 0]], [-w[..., 1], w[..., 0], zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


# ---------------------------------------------------------------- planar modules


def crank_input(j1: Point, length: float, theta: Angle, base: Angle | None = None) -> Point:
    """Tip of a crank: module crank_input (slides "Crank input", ``mp6barpo.cpp``).

    Parameters
    ----------
    j1
        Pivot; it may move.
    length
        Of the crank [m].
    theta
        Angle of the crank, counted from that of its base link.
    base
        Angle of the link that carries the pivot; default: the frame.

    Returns
    -------
    Point
    """
    call = _Call("crank_input", [("j1", j1, 2), ("theta", theta, 0), ("base", Angle() if base is None else base, 0)])
    pivot, turn, carrier = call.packed
    return call.point(_api.api_crank_input(pivot, _length("length", length), turn, carrier))


def rrr_links(j1: Point, j2: Point, length1: float, length2: float, mode: int) -> Point:
    """Joint of two links between two points: module RRR_links (slides "Two adjacent links with three revolute joints").

    Parameters
    ----------
    j1, j2
        The outer joints.
    length1, length2
        Of the link at ``j1``, of the link at ``j2`` [m].
    mode
        +1: the joint lies to the left of the way from ``j1`` to ``j2``; -1: to the right.

    Returns
    -------
    Point

    Notes
    -----
    The slide's tan^-1(DY/DX) must be read as the two-argument arctangent. Here no angle is computed: the factored
    closure keeps its digits near the dead points, where the slide's arc cosine loses them.
    """
    call = _Call("rrr_links", [("j1", j1, 2), ("j2", j2, 2)])
    lengths = _length("length1", length1), _length("length2", length2)
    return call.point(_api.api_rrr_links(*call.packed, *lengths, _mode(mode)))


def prr_links(
    j1: Point, length: float, rail: Point, psi: Angle, xi: float, eta: float, mode: int
) -> tuple[Slide, Point, Point]:
    """A link and a slider on a rail: module PRR_links (slide ``mp6barpo.cpp``).

    Parameters
    ----------
    j1
        Pivot of the link.
    length
        Of the link, from ``j1`` to the joint on the slider [m].
    rail, psi
        A point of the rail and the rail's angle; both may move.
    xi, eta
        The joint in the slider's axes, xi along the rail [m].
    mode
        +1: the joint lies forward of the pivot, along the rail; -1: behind.

    Returns
    -------
    slide
        From ``rail`` to the slider.
    slider
        Origin of the slider's axes.
    joint
        Between link and slider.
    """
    call = _Call("prr_links", [("j1", j1, 2), ("rail", rail, 2), ("psi", psi, 0)])
    pivot, line, turn = call.packed
    place = _number("xi", xi), _number("eta", eta)
    slide, slider, joint = _api.api_prr_links(pivot, _length("length", length), line, turn, *place, _mode(mode))
    return call.slide(slide), call.point(slider), call.point(joint)


def coupler_point(j1: Point, j2: Point, xi: float, eta: float) -> tuple[Point, Angle]:
    """A point of the link through two joints, and the link's angle: module coupler_point.

    Slides "Point on a coupler and posture of coupler".

    Parameters
    ----------
    j1, j2
        Origin of the link's axes, and a point on its xi axis.
    xi, eta
        The point in these axes [m].

    Returns
    -------
    point, angle
    """
    call = _Call("coupler_point", [("j1", j1, 2), ("j2", j2, 2)])
    call.require_line(j1, j2)
    point, angle = _api.api_coupler_point(*call.packed, _number("xi", xi), _number("eta", eta))
    return call.point(point), call.angle(angle)


def link_angle(j1: Point, j2: Point) -> Angle:
    """Angle of the line from one joint of a link to another: module link_angle, in (-pi, pi].

    The slide's tan^-1(DY/DX) must be read as the two-argument arctangent.

    Parameters
    ----------
    j1, j2
        Joints with their velocities and accelerations; the line goes from ``j1`` to ``j2``.

    Returns
    -------
    Angle
        With its rate and acceleration [rad, rad/s, rad/s^2].

    Raises
    ------
    InputError
        The joints are in one place.
    """
    call = _Call("link_angle", [("j1", j1, 2), ("j2", j2, 2)])
    call.require_line(j1, j2)
    return call.angle(_api.api_link_angle(*call.packed))


def fd_crank_input(
    j1: Point,
    length: float,
    theta: Angle,
    base: Angle | None = None,
    *,
    crank: int = 0,
    cranks: int | None = None,
    j1_of: Coefficients | None = None,
    base_of: Coefficients | None = None,
) -> tuple[Point, Coefficients]:
    """Tip of a crank with its coefficients: FD_CRANK_INPUT (slides "Crank input").

    Parameters
    ----------
    j1, length, theta, base
        As for `crank_input`; ``theta.ddthe`` is not used.
    crank, cranks
        Number of this crank, from 0, and how many there are; default: as many as the coefficients given have, or one.
    j1_of, base_of
        Coefficients of the pivot and of the base link's angle; default: they are fixed.

    Returns
    -------
    tip, tip_of
        With the acceleration as by cranks at constant rates, and its coefficients.

    Notes
    -----
    Erratum: in the slide's footer the rate is to be squared, -(theta' + phi')^2, as it is in B_2 and D_2.
    """
    call = _Call(
        "fd_crank_input",
        [("j1", j1, 2), ("theta", theta, 0), ("base", Angle() if base is None else base, 0)],
        [("j1_of", j1_of, 2), ("base_of", base_of, 0)],
        _cranks(cranks, j1_of, base_of),
    )
    pivot, turn, carrier, pivot_of, carrier_of = call.packed
    number = call.crank(crank)
    tip, tip_of = _api.api_fd_crank_input(
        pivot, _length("length", length), turn, carrier, number, pivot_of, carrier_of
    )
    return call.point(tip), call.coefficients(tip_of)


def fd_rrr_links(
    j1: Point,
    j2: Point,
    length1: float,
    length2: float,
    mode: int,
    *,
    j1_of: Coefficients | None = None,
    j2_of: Coefficients | None = None,
) -> tuple[Point, Coefficients]:
    """Joint of two links with its coefficients: FD_RRR_LINKS (slides "Two adjacent links with three revolute joints").

    Parameters
    ----------
    j1, j2, length1, length2, mode
        As for `rrr_links`.
    j1_of, j2_of
        Coefficients of the outer joints; default: fixed.

    Returns
    -------
    joint, joint_of
        With the acceleration as by cranks at constant rates, and its coefficients.

    Notes
    -----
    Errata: P_k and Q carry a minus between their terms; Q lacks DX^3 below its last term, which has
    (DY' DX - DY DX'); S has sin(beta) for sin(theta); the rate (alpha' +- beta') is to be squared in X_B" and Y_B".
    """
    call = _Call("fd_rrr_links", [("j1", j1, 2), ("j2", j2, 2)], [("j1_of", j1_of, 2), ("j2_of", j2_of, 2)])
    first, second, first_of, second_of = call.packed
    lengths = _length("length1", length1), _length("length2", length2)
    joint, joint_of = _api.api_fd_rrr_links(first, second, *lengths, _mode(mode), first_of, second_of)
    return call.point(joint), call.coefficients(joint_of)


def fd_prr_links(
    j1: Point,
    length: float,
    rail: Point,
    psi: Angle,
    xi: float,
    eta: float,
    mode: int,
    *,
    j1_of: Coefficients | None = None,
    rail_of: Coefficients | None = None,
    psi_of: Coefficients | None = None,
) -> tuple[Slide, Point, Point, Coefficients, Coefficients, Coefficients]:
    """A link and a slider with their coefficients: FD_PRR_LINKS.

    The lecture has no slide for it; it follows from the same map as the velocities.

    Parameters
    ----------
    j1, length, rail, psi, xi, eta, mode
        As for `prr_links`.
    j1_of, rail_of, psi_of
        Coefficients of the pivot, of the rail's point and of its angle; default: fixed.

    Returns
    -------
    slide, slider, joint
        With accelerations as by cranks at constant rates.
    slide_of, slider_of, joint_of
        Their coefficients.
    """
    call = _Call(
        "fd_prr_links",
        [("j1", j1, 2), ("rail", rail, 2), ("psi", psi, 0)],
        [("j1_of", j1_of, 2), ("rail_of", rail_of, 2), ("psi_of", psi_of, 0)],
    )
    pivot, line, turn, *given_of = call.packed
    place = _number("xi", xi), _number("eta", eta)
    slide, slider, joint, *of = _api.api_fd_prr_links(
        pivot, _length("length", length), line, turn, *place, _mode(mode), *given_of
    )
    return call.slide(slide), call.point(slider), call.point(joint), call.coefficients(of[0]), call.coefficients(of[1]), call.coefficients(of[2])


def fd_coupler_point(
    j1: Point,
    j2: Point,
    xi: float,
    eta: float,
    *,
    j1_of: Coefficients | None = None,
    j2_of: Coefficients | None = None,
) -> tuple[Point, Angle, Coefficients, Coefficients]:
    """A point of a link and the link's angle with their coefficients: FD_COUPLER_POINT.

    Slides "Point on a coupler and posture of coupler".

    Parameters
    ----------
    j1, j2, xi, eta
        As for `coupler_point`.
    j1_of, j2_of
        Coefficients of the joints; default: fixed.

    Returns
    -------
    point, angle
        With accelerations as by cranks at constant rates.
    point_of, angle_of
        Their coefficients.

    Notes
    -----
    Errata: F_i is divided by the square of the distance of the joints, not by L_1^2; F in B_C and D_C is F_i; the
    line that begins with D_B gives D_C.
    """
    call = _Call("fd_coupler_point", [("j1", j1, 2), ("j2", j2, 2)], [("j1_of", j1_of, 2), ("j2_of", j2_of, 2)])
    call.require_line(j1, j2)
    first, second, first_of, second_of = call.packed
    point, angle, point_of, angle_of = _api.api_fd_coupler_point(
        first, second, _number("xi", xi), _number("eta", eta), first_of, second_of
    )
    return call.point(point), call.angle(angle), call.coefficients(point_of), call.coefficients(angle_of)


# ---------------------------------------------------------------- spatial modules


def s_crank_input(
    joint: Point, frame: Attitude, theta: Angle, b: ArrayLike, r_ab: ArrayLike | None = None
) -> tuple[Point, Attitude]:
    """A point of a crank in space: module S_CRANK_INPUT (slide "Crank input" of the spatial part).

    Parameters
    ----------
    joint, frame
        R and [R_R]: a point on the crank's axis and the joint's axes in the link before; the crank turns about their z.
    theta
        Angle of the crank.
    b
        (3,) from R to B in the crank's axes [R_R][theta] [m].
    r_ab
        (3, 3) axes at B in the crank's axes, as columns; default: the crank's own.

    Returns
    -------
    point, attitude
        B and [R_B].
    """
    call = _Call("s_crank_input", [("joint", joint, 3), ("frame", frame, 9), ("theta", theta, 0)])
    point, attitude = _api.api_s_crank_input(*call.packed, _vector("b", b), _matrix("r_ab", r_ab))
    return call.point(point), call.attitude(attitude)


def csp_links(
    axis_point: Point,
    axis_frame: Attitude,
    slide_point: Point,
    slide_frame: Attitude,
    s_c: ArrayLike,
    s_p: ArrayLike,
    mode: int,
) -> tuple[Point, Attitude, Point, Point]:
    """A coupler on a cylindrical joint and an output on a slide, joined by a spherical joint: module CSP_LINKS.

    Slides "Two adjacent links (CSP chain)".

    Parameters
    ----------
    axis_point, axis_frame
        L_C and [R_LC]: a point on the axis of the cylindrical joint, and axes whose z it is.
    slide_point, slide_frame
        L_P and [R_LP]: a point on the line of the slide, and axes whose y is its direction.
    s_c
        (3,) from C to S in the coupler's axes, z along the axis [m].
    s_p
        (3,) from P to S in the output's axes, which are parallel to [R_LP] [m].
    mode
        The slide's line meets the cylinder on which S lies twice. +1: the farther meeting along the slide; -1: the nearer.

    Returns
    -------
    c, c_frame
        C and [R_C], of the coupler.
    s, p
        S and P.
    """
    bodies = [("axis_point", axis_point, 3), ("axis_frame", axis_frame, 9)]
    bodies += [("slide_point", slide_point, 3), ("slide_frame", slide_frame, 9)]
    call = _Call("csp_links", bodies)
    c, c_frame, s, p = _api.api_csp_links(*call.packed, _vector("s_c", s_c), _vector("s_p", s_p), _mode(mode))
    return call.point(c), call.attitude(c_frame), call.point(s), call.point(p)


def s_coupler_point(
    origin: Point, frame: Attitude, m: ArrayLike, r_mg: ArrayLike | None = None
) -> tuple[Point, Attitude]:
    """A point of a link in space, with axes of its own: module S_COUPLER_POINT (slide "Motion of a coupler link").

    Parameters
    ----------
    origin, frame
        M and [R_M].
    m
        (3,) from M to G in axes [R_M] [m].
    r_mg
        (3, 3) axes at G in axes [R_M], as columns; default: parallel.

    Returns
    -------
    point, attitude
        G and [R_G].
    """
    call = _Call("s_coupler_point", [("origin", origin, 3), ("frame", frame, 9)])
    point, attitude = _api.api_s_coupler_point(*call.packed, _vector("m", m), _matrix("r_mg", r_mg))
    return call.point(point), call.attitude(attitude)


def fd_s_crank_input(
    joint: Point,
    frame: Attitude,
    theta: Angle,
    b: ArrayLike,
    r_ab: ArrayLike | None = None,
    *,
    crank: int = 0,
    cranks: int | None = None,
    joint_of: Coefficients | None = None,
    frame_of: Coefficients | None = None,
) -> tuple[Point, Attitude, Coefficients, Coefficients]:
    """A point of a crank in space with its coefficients: FD_S_CRANK_INPUT.

    Parameters
    ----------
    joint, frame, theta, b, r_ab
        As for `s_crank_input`; ``theta.ddthe`` is not used.
    crank, cranks
        Number of this crank, from 0, and how many there are; default: as many as the coefficients given have, or one.
    joint_of, frame_of
        Coefficients of R and of the angular acceleration of [R_R]; default: fixed.

    Returns
    -------
    point, attitude
        With accelerations as by cranks at constant rates.
    point_of, attitude_of
        Their coefficients.

    Notes
    -----
    Errata: [C_theta] belongs to this crank alone; d_B lacks d_R; [d_RB] lacks [R_AB];
    C_omegaB = [R_AB]^T ([theta]^T C_omegaR + e_z), e_z for this crank alone, and
    d_omegaB = [R_AB]^T ([theta]^T d_omegaR + [theta']^T omega_R).
    """
    call = _Call(
        "fd_s_crank_input",
        [("joint", joint, 3), ("frame", frame, 9), ("theta", theta, 0)],
        [("joint_of", joint_of, 3), ("frame_of", frame_of, 3)],
        _cranks(cranks, joint_of, frame_of),
    )
    start, axes, turn, *given_of = call.packed
    point, attitude, *of = _api.api_fd_s_crank_input(
        start, axes, turn, _vector("b", b), _matrix("r_ab", r_ab), call.crank(crank), *given_of
    )
    return call.point(point), call.attitude(attitude), call.coefficients(of[0]), call.coefficients(of[1])


def fd_csp_links(
    axis_point: Point,
    axis_frame: Attitude,
    slide_point: Point,
    slide_frame: Attitude,
    s_c: ArrayLike,
    s_p: ArrayLike,
    mode: int,
    *,
    axis_point_of: Coefficients | None = None,
    axis_frame_of: Coefficients | None = None,
    slide_point_of: Coefficients | None = None,
    slide_frame_of: Coefficients | None = None,
) -> tuple[Point, Attitude, Point, Point, Coefficients, Coefficients, Coefficients, Coefficients]:
    """The CSP chain with its coefficients: FD_CSP_LINKS. The slides name it and leave its formulas out.

    Parameters
    ----------
    axis_point, axis_frame, slide_point, slide_frame, s_c, s_p, mode
        As for `csp_links`.
    axis_point_of, axis_frame_of, slide_point_of, slide_frame_of
        Coefficients of these; default: fixed.

    Returns
    -------
    c, c_frame, s, p
        With accelerations as by cranks at constant rates.
    c_of, c_frame_of, s_of, p_of
        Their coefficients.
    """
    bodies = [("axis_point", axis_point, 3), ("axis_frame", axis_frame, 9)]
    bodies += [("slide_point", slide_point, 3), ("slide_frame", slide_frame, 9)]
    given = [("axis_point_of", axis_point_of, 3), ("axis_frame_of", axis_frame_of, 3)]
    given += [("slide_point_of", slide_point_of, 3), ("slide_frame_of", slide_frame_of, 3)]
    call = _Call("fd_csp_links", bodies, given)
    fixed = _vector("s_c", s_c), _vector("s_p", s_p), _mode(mode)
    c, c_frame, s, p, *of = _api.api_fd_csp_links(*call.packed[:4], *fixed, *call.packed[4:])
    c_of, c_frame_of, s_of, p_of = map(call.coefficients, of)
    return call.point(c), call.attitude(c_frame), call.point(s), call.point(p), c_of, c_frame_of, s_of, p_of


def fd_s_coupler_point(
    origin: Point,
    frame: Attitude,
    m: ArrayLike,
    r_mg: ArrayLike | None = None,
    *,
    origin_of: Coefficients | None = None,
    frame_of: Coefficients | None = None,
) -> tuple[Point, Attitude, Coefficients, Coefficients]:
    """A point of a link in space with its coefficients: FD_S_COUPLER_POINT. The slide is right as printed.

    Parameters
    ----------
    origin, frame, m, r_mg
        As for `s_coupler_point`.
    origin_of, frame_of
        Coefficients of M and of the angular acceleration of [R_M]; default: fixed.

    Returns
    -------
    point, attitude
        With accelerations as by cranks at constant rates.
    point_of, attitude_of
        Their coefficients.
    """
    call = _Call(
        "fd_s_coupler_point",
        [("origin", origin, 3), ("frame", frame, 9)],
        [("origin_of", origin_of, 3), ("frame_of", frame_of, 3)],
    )
    start, axes, *given_of = call.packed
    point, attitude, *of = _api.api_fd_s_coupler_point(
        start, axes, _vector("m", m), _matrix("r_mg", r_mg), *given_of
    )
    return call.point(point), call.attitude(attitude), call.coefficients(of[0]), call.coefficients(of[1])


RRR_links = rrr_links
PRR_links = prr_links
FD_CRANK_INPUT = fd_crank_input
FD_RRR_LINKS = fd_rrr_links
FD_PRR_LINKS = fd_prr_links
FD_COUPLER_POINT = fd_coupler_point
S_CRANK_INPUT = s_crank_input
CSP_LINKS = csp_links
S_COUPLER_POINT = s_coupler_point
FD_S_CRANK_INPUT = fd_s_crank_input
FD_CSP_LINKS = fd_csp_links
FD_S_COUPLER_POINT = fd_s_coupler_point


# ---------------------------------------------------------------- to the flat layer and back

_KINDS: dict[int, tuple[type, tuple[str, ...], tuple[tuple[int, ...], ...]]] = {
    0: (Angle, ("the", "dthe", "ddthe"), ((), (), ())),
    2: (Point, ("p", "dp", "ddp"), ((2,), (2,), (2,))),
    3: (Point, ("p", "dp", "ddp"), ((3,), (3,), (3,))),
    9: (Attitude, ("r", "omega", "domega"), ((3, 3), (3,), (3,))),
}
"""By kind of argument: its type, its fields, and the shape of each behind the samples."""


class _Call:
    """The arguments of one call, all spread over the same samples and packed for the flat layer.

    Parameters
    ----------
    name
        The function's, for messages.
    items
        Name, value, kind of each point, angle or attitude.
    coefficients
        Name, value (None: fixed) and size (0: a number) of each.
    cranks
        How many there are; default: as the coefficients have it.
    """

    def __init__(
        self,
        name: str,
        items: list[tuple[str, Any, int]],
        coefficients: list[tuple[str, Coefficients | None, int]] | None = None,
        cranks: int | None = None,
    ) -> None:
        self.name = name
        self.cranks = self._count_cranks(coefficients, cranks) if coefficients else 0
        try:
            self._pack(items, coefficients or [])
        except MemoryError:
            raise InputError(f"{name}: more cranks ({self.cranks}) or samples than the memory holds") from None

    def _pack(self, items: list[tuple[str, Any, int]], given: list[tuple[str, Coefficients | None, int]]) -> None:
        """Spread all arguments over the same samples and lay them out as the flat layer reads them."""
        parts: list[tuple[Floats, tuple[int, ...], str]] = []
        for label, item, kind in items:
            parts += self._fields(label, item, kind)
        for label, of, size in given:
            parts += self._columns(label, of, size)
        self.samples = self._spread(parts)
        self.count = int(np.prod(self.samples))
        count = max(1, self.count)  # the flat layer takes one sample at least
        flat = [
            np.broadcast_to(array, self.samples + shape).reshape((count, -1)) if self.count else np.zeros((1, int(np.prod(shape))))
            for array, shape, _ in parts
        ]
        self.packed = [np.concatenate(flat[3 * k : 3 * k + 3], axis=1).T for k in range(len(items))]
        for k, (_, _, size) in enumerate(given):
            rest, by_crank = flat[3 * len(items) + 2 * k :][:2]
            columns = np.concatenate([rest, by_crank], axis=1).reshape((count, self.cranks + 1, max(size, 1)))
            self.packed.append(columns.transpose() if size else columns[..., 0].T)

    def _fields(self, label: str, item: Any, kind: int) -> list[tuple[Floats, tuple[int, ...], str]]:
        expected, names, shapes = _KINDS[kind]
        if not isinstance(item, expected):
            raise InputError(f"{self.name}: {label}: expected {expected.__name__}, got {type(item).__name__}")
        if isinstance(item, Point) and item.p.shape[-1] != kind:
            raise InputError(f"{self.name}: {label}: expected a point of {kind} components, got {item.p.shape[-1]}")
        return [(getattr(item, name), shape, f"{label}.{name}") for name, shape in zip(names, shapes)]

    def _columns(self, label: str, of: Coefficients | None, size: int) -> list[tuple[Floats, tuple[int, ...], str]]:
        tail = (size,) if size else ()
        of = Coefficients(np.zeros((self.cranks, *tail))) if of is None else of
        return [(of.rest, tail, f"{label}.rest"), (of.of, (self.cranks, *tail), f"{label}.of")]

    def _count_cranks(self, given: list[tuple[str, Coefficients | None, int]], cranks: int | None) -> int:
        counts = {} if cranks is None else {"cranks": cranks}
        for label, of, size in given:
            if of is None:
                continue
            if not isinstance(of, Coefficients):
                raise InputError(f"{self.name}: {label}: expected Coefficients, got {type(of).__name__}")
            axis = -2 if size else -1
            if of.of.ndim < -axis or (size and of.of.shape[-1] != size):
                says = f"(..., n, {size})" if size else "(..., n)"
                raise InputError(f"{self.name}: {label}.of: expected shape {says}, got {of.of.shape}")
            counts[label] = of.of.shape[axis]
        if not counts:
            raise InputError(f"{self.name}: no coefficients given (expected those of one argument at least)")
        if len(set(counts.values())) > 1:
            said = ", ".join(f"{label} {count}" for label, count in counts.items())
            raise InputError(f"{self.name}: numbers of cranks differ: {said}")
        return next(iter(counts.values()))

    def _spread(self, parts: list[tuple[Floats, tuple[int, ...], str]]) -> tuple[int, ...]:
        """The shape of the samples that all arguments fit."""
        samples: tuple[int, ...] = ()
        for array, shape, label in parts:
            try:
                full = np.broadcast_shapes(array.shape, shape)
                if full[len(full) - len(shape) :] != shape:
                    raise ValueError
                samples = np.broadcast_shapes(samples, full[: len(full) - len(shape)])
            except ValueError:
                says = "".join(f"{n}, " for n in samples) + ", ".join(map(str, shape))
                raise InputError(f"{self.name}: {label}: shape {array.shape} does not fit ({says})") from None
        return samples

    def crank(self, number: int) -> int:
        """Number of a crank for the flat layer."""
        if as_count(f"{self.name}: crank", number, 0) >= self.cranks:
            raise InputError(f"{self.name}: crank: expected 0 to {self.cranks - 1}, got {number}")
        return number + 1

    def require_line(self, j1: Point, j2: Point) -> None:
        """Two joints of a link that say how it lies."""
        distance = np.linalg.norm(j2.p - j1.p, axis=-1)
        reach = np.linalg.norm(j1.p, axis=-1) + np.linalg.norm(j2.p, axis=-1)
        if np.any(distance <= NEAR * reach):
            raise InputError(f"{self.name}: j1, j2: coincide, so that their line has no angle (expected two joints of a link)")

    def point(self, values: Floats) -> Point:
        return Point(*self._rows(values, 3, (len(values) // 3,)))

    def angle(self, values: Floats) -> Angle:
        return Angle(*self._rows(values, 3, ()))

    def slide(self, values: Floats) -> Slide:
        return Slide(*self._rows(values, 3, ()))

    def attitude(self, values: Floats) -> Attitude:
        rotation, spin = values[:9], values[9:]
        return Attitude(*self._rows(rotation, 1, (3, 3)), *self._rows(spin, 2, (3,)))

    def coefficients(self, values: Floats) -> Coefficients:
        """From (size, cranks + 1, samples) or (cranks + 1, samples)."""
        columns = values.transpose()[: self.count]
        columns = columns.reshape(self.samples + columns.shape[1:])
        axis = len(self.samples)
        return Coefficients(np.delete(columns, 0, axis=axis), np.take(columns, 0, axis=axis))

    def _rows(self, values: Floats, parts: int, shape: tuple[int, ...]) -> list[Floats]:
        return [np.ascontiguousarray(part.T[: self.count]).reshape(self.samples + shape) for part in np.split(values, parts)]


def _number(name: str, value: float) -> float:
    array = _floats(name, value)
    if array.ndim != 0 or not np.isfinite(array):
        raise InputError(f"{name}: expected one finite number, got {quoted(value)}")
    return float(array)


def _length(name: str, value: float) -> float:
    number = _number(name, value)
    if number <= 0:
        raise InputError(f"{name}: expected a length above zero, got {number:g}")
    return number


def _vector(name: str, value: ArrayLike) -> Floats:
    array = _floats(name, value)
    if array.shape != (3,):
        raise InputError(f"{name}: expected shape (3,), got {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"{name}: expected finite numbers, got {array.tolist()}")
    return array


def _matrix(name: str, value: ArrayLike | None) -> Floats:
    array = np.eye(3) if value is None else _floats(name, value)
    if array.shape != (3, 3):
        raise InputError(f"{name}: expected shape (3, 3), got {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"{name}: expected finite numbers")
    _require_rotation(name, array)
    return np.asfortranarray(array)


def _mode(mode: int) -> int:
    if not isinstance(mode, (int, float, np.number)) or mode not in (1, -1):
        raise InputError(f"mode: expected +1 or -1, got {quoted(mode)}")
    return int(mode)


def _cranks(cranks: int | None, *given: Coefficients | None) -> int | None:
    """How many cranks there are, if that is said: by a number, or by nothing but fixed points, which leave this one."""
    if cranks is not None:
        return as_count("cranks", cranks)
    return 1 if all(of is None for of in given) else None
