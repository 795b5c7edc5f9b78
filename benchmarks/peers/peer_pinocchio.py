"""Pinocchio: accelerations by its constrained dynamics; it has no integrator for loops, so Runge-Kutta in Python goes round it."""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

import hexapod
from work import Mechanism, more_steps, say, series, timed

JOINTS = {f"{kind}{axis}": getattr(pin, f"JointModel{kind}{axis.upper()}") for kind in "PR" for axis in "xyz"}
Rates = Callable[[float, np.ndarray], np.ndarray]


def compile_model(mechanism: Mechanism) -> pin.Model:
    model = pin.Model()
    model.gravity = pin.Motion(np.array(mechanism.gravity), np.zeros(3))
    for i, link in enumerate(mechanism.links):
        place = pin.SE3(np.eye(3), np.array(link.at))
        joint = model.addJoint(link.parent + 1, JOINTS[link.joint](), place, f"joint{i}")
        if link.mass:
            inertia = pin.Inertia(link.mass, np.array(link.cog), np.reshape(link.inertia, (3, 3)))
            model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    return model


def make_rates(mechanism: Mechanism) -> Rates:
    """Right-hand side of y = (q, v)."""
    model = compile_model(mechanism)
    data, settings = model.createData(), pin.ProximalSettings(1e-14, 1e-10, 10)
    loops = pin.StdVec_RigidConstraintModel()
    for loop in mechanism.loops:
        first, second = (pin.SE3(np.eye(3), np.array(point)) for point in loop.points)
        loops.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, loop.links[0] + 1, first, loop.links[1] + 1, second,
                                              pin.LOCAL))
    of_loops = pin.StdVec_RigidConstraintData()
    for loop in loops:
        of_loops.append(loop.createData())
    pin.initConstraintDynamics(model, data, loops, of_loops)
    n = model.nv
    constant = np.array([link.force + link.stiffness * link.rest for link in mechanism.links])
    stiffness = np.array([link.stiffness for link in mechanism.links])
    damping = np.array([link.damping for link in mechanism.links])

    def add_spring(q: np.ndarray, force: np.ndarray) -> None:
        """Of links that hang on the ground by a hinge about z, as that of Andrews' squeezer."""
        for spring in mechanism.springs:
            origin, angle = np.array(mechanism.links[spring.link].at), q[spring.link]
            c, s = np.cos(angle), np.sin(angle)
            x, y = spring.point[0] * c - spring.point[1] * s, spring.point[0] * s + spring.point[1] * c
            dx, dy = origin[0] + x - spring.ground[0], origin[1] + y - spring.ground[1]
            length = np.hypot(dx, dy)
            force[spring.link] -= spring.stiffness * (1.0 - spring.rest / length) * (x * dy - y * dx)

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        q, v = y[:n], y[n:]
        force = constant - stiffness * q - damping * v
        if mechanism.springs:
            add_spring(q, force)
        return np.concatenate([v, pin.constraintDynamics(model, data, q, v, force, loops, of_loops, settings)])

    return rates


def runge_kutta(rates: Rates, y: np.ndarray, end: float, steps: int) -> np.ndarray:
    h = end / steps
    for _ in range(steps):
        k1 = rates(0.0, y)
        k2 = rates(0.0, y + 0.5 * h * k1)
        k3 = rates(0.0, y + 0.5 * h * k2)
        k4 = rates(0.0, y + h * k3)
        y = y + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return y


def forward(mechanism: Mechanism) -> dict:
    rates = make_rates(mechanism)
    start = np.concatenate([mechanism.start, np.zeros(len(mechanism.links))])
    kept = [*mechanism.coordinates, *(len(mechanism.links) + i for i in mechanism.coordinates)]

    def fixed(steps: int) -> np.ndarray:
        return runge_kutta(rates, start, mechanism.end, steps)[kept]

    def dop853(tolerance: float) -> np.ndarray:
        return solve_ivp(rates, (0.0, mechanism.end), start, "DOP853", rtol=tolerance, atol=tolerance).y[kept, -1]

    def thousand() -> None:
        for _ in range(1000):
            rates(0.0, start)

    tolerances = [10.0**-digits for digits in range(4, 14)]
    return {"stage": timed(thousand)[0] * 1e3, "rows": series(fixed, more_steps(50), "RK4") + series(dop853, tolerances, "DOP853")}


def inverse(mechanism: Mechanism, samples: str) -> dict:
    model = compile_model(mechanism)
    data = model.createData()

    def tree(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        found = np.empty_like(q)
        for i in range(len(q)):
            found[i] = pin.rnea(model, data, q[i], qd[i], qdd[i])
        return found

    return hexapod.measure(mechanism, samples, tree)


mechanism = Mechanism.read(sys.argv[2])
version = f"Pinocchio {pin.__version__}"
say(version=version, **(inverse(mechanism, sys.argv[3]) if sys.argv[1] == "inverse" else forward(mechanism)))
