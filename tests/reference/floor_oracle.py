"""A double pendulum whose tip meets a floor, integrated here: the reference of test_place_stops.py, which shares no code with the engine.

The state is the angles of both links from the x axis and their rates. The floor throws the tip back, or holds it, without friction,
until it would have to pull.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp


@dataclass
class Pendulum:
    length: np.ndarray  # of both links [m]
    middle: np.ndarray  # from a link's hinge to its centre of gravity [m]
    mass: np.ndarray
    inertia: np.ndarray
    floor: float  # height that the tip does not go below [m]
    restitution: float
    gravity: float = 9.81

    def equations(self, angle: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mass matrix and right-hand side."""
        (m1, m2), (c1, c2), (j1, j2), l1 = self.mass, self.middle, self.inertia, self.length[0]
        between = m2 * l1 * c2
        turn = angle[0] - angle[1]
        matrix = np.array([[j1 + m1 * c1**2 + m2 * l1**2, between * np.cos(turn)], [between * np.cos(turn), j2 + m2 * c2**2]])
        weight = -self.gravity * np.cos(angle) * np.array([m1 * c1 + m2 * l1, m2 * c2])
        return matrix, weight + between * np.sin(turn) * np.array([-(rate[1] ** 2), rate[0] ** 2])

    def height(self, angle: np.ndarray) -> float:
        return float(self.length @ np.sin(angle) - self.floor)

    def row(self, angle: np.ndarray) -> np.ndarray:
        return self.length * np.cos(angle)

    def push(self, angle: np.ndarray, rate: np.ndarray) -> float:
        """Of the floor, while the tip stays on it."""
        matrix, right = self.equations(angle, rate)
        row = self.row(angle)
        free = row @ np.linalg.solve(matrix, right) - self.length @ (np.sin(angle) * rate**2)
        return float(-free / (row @ np.linalg.solve(matrix, row)))


def run(pendulum: Pendulum, angle: np.ndarray, rate: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, list[tuple[float, str, float, float]]]:
    """Angles at the instants t; instant, kind, impulse and energy lost of every impact and release."""
    state, now, rests = np.concatenate([angle, rate]), float(t[0]), False
    told: list[tuple[float, str, float, float]] = []
    out = np.full((len(t), 2), np.nan)
    while True:

        def rates(_: float, y: np.ndarray) -> np.ndarray:
            matrix, right = pendulum.equations(y[:2], y[2:])
            if rests:
                right = right + pendulum.push(y[:2], y[2:]) * pendulum.row(y[:2])
            return np.concatenate([y[2:], np.linalg.solve(matrix, right)])

        def guard(at: float, y: np.ndarray) -> float:
            if rests:
                return pendulum.push(y[:2], y[2:])
            return pendulum.height(y[:2]) + (1e-9 if at == now else 0)

        guard.terminal, guard.direction = True, -1
        part = solve_ivp(rates, (now, t[-1]), state, "DOP853", rtol=1e-12, atol=1e-13, dense_output=True, events=guard)
        here = (t >= now) & (t <= part.t[-1])
        out[here] = part.sol(t[here])[:2].T
        if part.status != 1:
            return out, told
        now, state = float(part.t_events[0][-1]), part.y_events[0][-1].copy()
        if rests:
            told.append((now, "release", 0.0, 0.0))
            rests = False
            continue
        matrix, _ = pendulum.equations(state[:2], state[2:])
        row = pendulum.row(state[:2])
        ease = row @ np.linalg.solve(matrix, row)
        speed = row @ state[2:]
        impulse = -(1 + pendulum.restitution) * speed / ease
        state[2:] += impulse * np.linalg.solve(matrix, row)
        told.append((now, "impact" if pendulum.restitution else "rest", impulse, (1 - pendulum.restitution**2) * speed**2 / 2 / ease))
        rests = pendulum.restitution == 0 and pendulum.push(state[:2], state[2:]) > 0
