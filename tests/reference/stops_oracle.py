"""Planar linkages with hard stops, integrated here: the reference of test_many_stops.py, which shares no code with the engine.

A linkage is links that turn, each centre of gravity a sum of vectors that turn with links; loops are closed by multipliers. The
state is the angles of the links from the x axis, so that gaps of hinges are linear in it. What contacts do is decided by trying
all sets of them: impulses and changes of velocity, or forces and accelerations, not negative, and one of both zero.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq


@dataclass
class Stop:
    name: str
    row: np.ndarray  # gap = row @ angles - bound
    bound: float
    restitution: float


@dataclass
class Linkage:
    mass: np.ndarray
    inertia: np.ndarray
    lever: np.ndarray  # (link, link, 2): centre of gravity of a link = sum over links of these vectors, turned with them
    loop: np.ndarray  # (n_loop, link, 2): sums that vanish, but for `closed_at`
    closed_at: np.ndarray  # (n_loop, 2)
    stops: list[Stop]
    gravity: float = 9.81


@dataclass
class Course:
    t: np.ndarray
    angle: np.ndarray
    rate: np.ndarray
    events: list[tuple[float, str, str]] = field(default_factory=list)  # instant, stop, kind
    energy_gained: float = 0.0  # the most that an impact has added
    rest_at_end: frozenset[int] = frozenset()
    n_impact: int = 0


def turned(vectors: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], -1), np.stack([-s * x - c * y, c * x - s * y], -1)


def complementary(w: np.ndarray, b: np.ndarray) -> np.ndarray:
    """z >= 0 with w z + b >= 0 and z (w z + b) = 0, by trying all sets."""
    n = len(b)
    size = max(1e-300, np.abs(b).max(initial=0))
    best, least = np.zeros(n), np.inf
    for k in range(n + 1):
        for chosen in itertools.combinations(range(n), k):
            z = np.zeros(n)
            index = list(chosen)
            if index:
                z[index] = np.linalg.lstsq(w[np.ix_(index, index)], -b[index], rcond=1e-12)[0]
            rest = w @ z + b
            scale = np.sqrt(np.maximum(np.diag(w), 1e-300))
            wrong = max(np.max(-z * scale * scale, initial=0), np.max(-rest, initial=0), np.max(np.abs(rest[index]), initial=0)) / size
            if wrong < least - 1e-12:
                best, least = z, wrong
    return best


class Mechanics:
    def __init__(self, linkage: Linkage):
        self.k = linkage
        self.rows = np.array([s.row for s in linkage.stops]).reshape(len(linkage.stops), len(linkage.mass))
        self.bound = np.array([s.bound for s in linkage.stops])
        self.e = np.array([s.restitution for s in linkage.stops])

    def gaps(self, angle: np.ndarray) -> np.ndarray:
        return self.rows @ angle - self.bound

    def equations(self, angle: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Mass matrix, forces, rows of loops, their accelerations at no angular accelerations."""
        at, slope = turned(self.k.lever, angle)
        m = self.k.mass
        matrix = np.einsum("k,kix,kjx->ij", m, slope, slope) + np.diag(self.k.inertia)
        bias = -np.einsum("kjx,j->kx", at, rate**2)
        force = -np.einsum("k,kix,kx->i", m, slope, bias) - self.k.gravity * np.einsum("k,ki->i", m, slope[:, :, 1])
        around, turning = turned(self.k.loop, angle)
        rows = np.concatenate([turning[..., 0], turning[..., 1]])
        drift = -np.concatenate([around[..., 0] @ rate**2, around[..., 1] @ rate**2])
        return matrix, force, rows, drift

    def solve(self, angle: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Free accelerations, and what unit pushes at the stops add to them."""
        matrix, force, rows, drift = self.equations(angle, rate)
        n, c = len(force), len(drift)
        kkt = np.block([[matrix, rows.T], [rows, np.zeros((c, c))]])
        right = np.concatenate([np.column_stack([force, self.rows.T]), np.column_stack([-drift, np.zeros((c, len(self.e)))])])
        solution = np.linalg.solve(kkt, right)[:n]
        return solution[:, 0], solution[:, 1:]

    def held(self, angle: np.ndarray, rate: np.ndarray, rests: list[int]) -> tuple[np.ndarray, np.ndarray]:
        free, response = self.solve(angle, rate)
        if not rests:
            return free, np.zeros(0)
        push = np.linalg.solve((self.rows @ response)[np.ix_(rests, rests)], -(self.rows @ free)[rests])
        return free + response[:, rests] @ push, push

    def energy(self, angle: np.ndarray, rate: np.ndarray) -> float:
        matrix = self.equations(angle, rate)[0]
        height = self.k.mass @ turned(self.k.lever, angle)[0].sum(1)[:, 1]
        return rate @ matrix @ rate / 2 + self.k.gravity * height


def run(linkage: Linkage, angle: np.ndarray, rate: np.ndarray, t_out: np.ndarray, rtol: float = 1e-11, weak: float = 1e-8,
        most_impacts: int = 4000) -> Course:
    m = Mechanics(linkage)
    n = len(angle)
    names = [s.name for s in linkage.stops]
    course = Course(t_out, np.full((len(t_out), n), np.nan), np.full((len(t_out), n), np.nan))
    t, y = float(t_out[0]), np.concatenate([angle, rate])
    rests: list[int] = []
    fastest = np.zeros(len(names))
    touch = 1e-12
    course.angle[0], course.rate[0] = angle, rate

    def closed(y: np.ndarray) -> list[int]:
        gap = m.gaps(y[:n])
        return [i for i in range(len(names)) if abs(gap[i]) < touch or i in rests]

    def settle(t: float, y: np.ndarray) -> np.ndarray:
        """Impacts of what is closed and closing, then who stays."""
        nonlocal rests
        response = m.rows @ m.solve(y[:n], y[n:])[1]
        columns = m.solve(y[:n], y[n:])[1]
        shut = closed(y)
        v = m.rows @ y[n:]
        struck = {i for i in shut if v[i] < 0 and i not in rests}
        before = m.energy(y[:n], y[n:])
        stays = set(rests)
        for turn in range(50):
            size = max(np.abs(fastest).max(initial=0), np.abs(v).max(initial=0))
            if turn > 0 and not any(v[i] < -1e-14 * size for i in shut):
                break
            here = [i for i in shut if v[i] <= 0 or i in stays or turn == 49]
            wanted = np.zeros(len(names))
            for i in here:
                if i in stays and v[i] > -1e-12 * size:
                    continue
                struck.add(i)
                fastest[i] = max(fastest[i], -v[i])
                stays.discard(i)
                if turn == 49 or m.e[i] * -v[i] <= weak * fastest[i]:
                    stays.add(i)
                else:
                    wanted[i] = -m.e[i] * v[i]
            if not here:
                break
            impulse = complementary(response[np.ix_(here, here)], v[here] - wanted[here])
            y = y.copy()
            y[n:] += columns[:, here] @ impulse
            v = m.rows @ y[n:]
        course.energy_gained = max(course.energy_gained, m.energy(y[:n], y[n:]) - before)
        size = max(np.abs(fastest).max(initial=0), 1e-300)
        near = [i for i in stays if abs(v[i]) < 1e-10 * size or v[i] < 0]
        free, response = m.solve(y[:n], y[n:])
        push = complementary((m.rows @ response)[np.ix_(near, near)], (m.rows @ free)[near])
        old = rests
        rests = [i for i, p in zip(near, push) if p > 0]
        for i in sorted(struck):
            course.events.append((t, names[i], "rest" if i in rests else "impact"))
            course.n_impact += 1
        for i in old:
            if i not in rests and i not in struck:
                course.events.append((t, names[i], "release"))
        return y

    gap = m.gaps(y[:n])
    if np.any(gap < -touch):
        raise ValueError("starts beyond a stop")
    if closed(y):
        y = settle(t, y)
    k = 1
    while k < len(t_out) and course.n_impact < most_impacts:
        current = list(rests)

        def rates(_: float, y: np.ndarray) -> np.ndarray:
            return np.concatenate([y[n:], m.held(y[:n], y[n:], current)[0]])

        def guards(y: np.ndarray) -> np.ndarray:
            g = m.gaps(y[:n])
            if current:
                g[current] = m.held(y[:n], y[n:], current)[1]
            return g

        # Short flights: steps that see them.
        free = m.held(y[:n], y[n:], current)[0]
        speed, pull = m.rows @ y[n:], m.rows @ free
        flights = [2 * speed[i] / -pull[i] for i in closed(y) if i not in current and speed[i] > 0 and pull[i] < 0]
        gap = m.gaps(y[:n])
        flights += [3 * gap[i] / -speed[i] for i in range(len(names)) if i not in current and speed[i] < 0 < gap[i]]
        short = min(flights, default=np.inf)
        fresh = set(closed(y)) - set(current)
        solver = DOP853(rates, t, y, t_out[-1], rtol=rtol, atol=rtol / 10, max_step=min(0.02, max(short / 3, 1e-12)))
        steps = 0
        while True:
            steps += 1
            if steps > 12:
                solver.max_step = 0.02
            solver.step()
            assert solver.status != "failed"
            dense = solver.dense_output()
            hit = None
            places = np.linspace(solver.t_old, solver.t, 9)
            values = np.array([guards(dense(x)) for x in places])
            for i in range(len(names)):
                first = 0
                if steps == 1 and i in fresh:
                    first = next((j for j in range(1, 9) if values[j, i] > 0), 9)
                    if first == 9 and values[8, i] < -touch:
                        hit = min(hit or (np.inf, i), (places[1], i))
                for j in range(first + 1, 9):
                    if values[j, i] < 0 <= values[j - 1, i] or (values[j, i] < 0 and j == 1 and steps > 1):
                        a, b = places[j - 1], places[j]
                        root = b if values[j - 1, i] < 0 else brentq(lambda x: guards(dense(x))[i], a, b, xtol=1e-15, rtol=1e-15)
                        if hit is None or root < hit[0]:
                            hit = (root, i)
                        break
            end = hit[0] if hit else solver.t
            while k < len(t_out) and t_out[k] <= end:
                course.angle[k], course.rate[k] = dense(t_out[k])[:n], dense(t_out[k])[n:]
                k += 1
            if hit:
                t, y = hit[0], dense(hit[0])
                if hit[1] in rests:
                    # It leaves; what the others do then is decided anew.
                    rests.remove(hit[1])
                    course.events.append((t, names[hit[1]], "release"))
                    if rests:
                        near = list(rests)
                        free, response = m.solve(y[:n], y[n:])
                        push = complementary((m.rows @ response)[np.ix_(near, near)], (m.rows @ free)[near])
                        rests = [i for i, p in zip(near, push) if p > 0]
                else:
                    y = settle(t, y)
                break
            if solver.status == "finished":
                break
        if not hit:
            break
    course.rest_at_end = frozenset(rests)
    return course


# ---------------------------------------------------------------- random linkages, and their scenes


def stop_tables(rng: np.random.Generator, joints: list[str], start: dict[str, float], n_stop: int, restitution: float | None) -> list[dict]:
    stops = []
    for name in rng.choice(joints, size=min(n_stop, len(joints)), replace=False):
        e = float(rng.choice([0, 0.2, 0.5, 0.7, 0.9])) if restitution is None else restitution
        stop = {"name": f"S{name}", "joint": str(name), "restitution": e}
        sides = rng.choice(["min", "max", "both"])
        if sides != "max":
            stop["min"] = start[name] - float(rng.uniform(0.05, 0.8))
        if sides != "min":
            stop["max"] = start[name] + float(rng.uniform(0.05, 0.8))
        stops.append(stop)
    return stops


def oracle_stops(tables: list[dict], rows: dict[str, np.ndarray], offset: dict[str, float]) -> list[Stop]:
    """A joint's variable is its row of the angles plus an offset."""
    stops = []
    for s in tables:
        for side, sign in (("min", 1), ("max", -1)):
            if side in s:
                row = sign * rows[s["joint"]]
                stops.append(Stop(f"{s['name']}.{side}", row, sign * (s[side] - offset[s["joint"]]), s["restitution"]))
    return stops


def random_chain(seed: int, n: int, n_stop: int, restitution: float | None = None) -> tuple[dict, Linkage, np.ndarray, np.ndarray, np.ndarray]:
    """A pendulum of n links: scene, linkage, start, and the matrix that makes joint variables of angles."""
    rng = np.random.default_rng(seed)
    length, mass = rng.uniform(0.2, 0.6, n), rng.uniform(0.3, 2.0, n)
    cog = np.column_stack([rng.uniform(0.3, 0.9, n) * length, rng.uniform(-0.1, 0.1, n) * length])
    inertia = mass * length**2 * rng.uniform(0.03, 0.15, n)
    q, qd = rng.uniform(-1.5, 1.5, n), rng.uniform(-2, 2, n) * rng.choice([0, 1])
    q[0] += rng.choice([0, np.pi / 2, -np.pi / 2])
    joints = [f"J{i + 1}" for i in range(n)]
    stops = stop_tables(rng, joints, dict(zip(joints, q)), n_stop, restitution)
    markers = [{"P": [0, 0], "Q": [float(x), 0]} for x in length]
    scene = {
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"O": [0, 0]}},
        "link": [{"name": f"L{i + 1}", "markers": markers[i], "mass": float(mass[i]), "cog": cog[i].tolist(), "inertia": float(inertia[i])} for i in range(n)],
        "joint": [{"name": joints[i], "type": "revolute", "between": ["frame.O" if i == 0 else f"L{i}.Q", f"L{i + 1}.P"]} for i in range(n)],
        "coordinate": [{"joint": joints[i], "start": {"position": float(q[i]), "velocity": float(qd[i])}} for i in range(n)],
        "stop": stops,
    }
    to_joints = np.eye(n) - np.eye(n, k=-1)
    lever = np.zeros((n, n, 2))
    for k in range(n):
        lever[k, :k, 0] = length[:k]
        lever[k, k] = cog[k]
    rows = dict(zip(joints, to_joints))
    linkage = Linkage(mass, inertia, lever, np.zeros((0, n, 2)), np.zeros((0, 2)), oracle_stops(stops, rows, dict.fromkeys(joints, 0.0)))
    return scene, linkage, np.cumsum(q), np.cumsum(qd), to_joints


def random_fivebar(seed: int, n_stop: int, restitution: float | None = None) -> tuple[dict, Linkage, np.ndarray, np.ndarray, np.ndarray]:
    """Two cranks on the frame, two rods that meet: two freedoms, stops at the cranks and at the knees."""
    rng = np.random.default_rng(seed)
    length = np.concatenate([rng.uniform(0.2, 0.3, 2), rng.uniform(0.4, 0.5, 2)])  # cranks, rods
    mass = rng.uniform(0.3, 2.0, 4)
    along = rng.uniform(0.3, 0.7, 4) * length
    inertia = mass * length**2 * rng.uniform(0.05, 0.12, 4)
    width = 0.3
    crank = np.array([rng.uniform(1.2, 2.6), rng.uniform(0.5, 1.9)])
    a = np.array([0, 0]) + length[0] * np.array([np.cos(crank[0]), np.sin(crank[0])])
    b = np.array([width, 0]) + length[1] * np.array([np.cos(crank[1]), np.sin(crank[1])])
    d = b - a
    far = np.hypot(*d)
    x = (far**2 + length[2]**2 - length[3]**2) / (2 * far)
    tip = a + (x * d + np.sqrt(length[2]**2 - x**2) * np.array([-d[1], d[0]])) / far
    rod = [np.arctan2(*(tip - a)[::-1]), np.arctan2(*(tip - b)[::-1])]
    phi = np.array([crank[0], crank[1], rod[0], rod[1]])
    start = {"A": phi[0], "B": phi[1], "C": phi[2] - phi[0], "D": phi[3] - phi[1]}
    stops = stop_tables(rng, list(start), start, n_stop, restitution)
    for s in stops:
        for side in ("min", "max"):
            if side in s:
                s[side] = start[s["joint"]] + 0.5 * (s[side] - start[s["joint"]])
    link = [{"name": f"L{i + 1}", "markers": {"P": [0, 0], "Q": [float(length[i]), 0]}, "mass": float(mass[i]), "cog": [float(along[i]), 0],
             "inertia": float(inertia[i])} for i in range(4)]
    between = {"A": ["frame.A", "L1.P"], "B": ["frame.B", "L2.P"], "C": ["L1.Q", "L3.P"], "D": ["L2.Q", "L4.P"], "E": ["L3.Q", "L4.Q"]}
    guess = {"C": start["C"], "D": start["D"]}
    scene = {
        "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"A": [0, 0], "B": [width, 0]}}, "link": link,
        "joint": [{"name": k, "type": "revolute", "between": v} | ({"start": float(guess[k])} if k in guess else {}) for k, v in between.items()],
        "coordinate": [{"joint": k, "start": float(start[k])} for k in "AB"],
        "stop": stops,
    }
    lever = np.zeros((4, 4, 2))
    for i in range(4):
        lever[i, i, 0] = along[i]
    lever[2, 0, 0], lever[3, 1, 0] = length[0], length[1]
    loop = np.zeros((1, 4, 2))
    loop[0, :, 0] = [length[0], -length[1], length[2], -length[3]]
    rows = {"A": np.array([1.0, 0, 0, 0]), "B": np.array([0, 1.0, 0, 0]), "C": np.array([-1.0, 0, 1, 0]), "D": np.array([0, -1.0, 0, 1])}
    linkage = Linkage(mass, inertia, lever, loop, np.array([[width, 0]]), oracle_stops(stops, rows, dict.fromkeys(rows, 0.0)))
    return scene, linkage, phi, np.zeros(4), np.array([rows["A"], rows["B"]])
