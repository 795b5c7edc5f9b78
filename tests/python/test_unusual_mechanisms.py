"""Mechanisms that no other test has, inverse and forward, against a program in maximal coordinates.

That program knows six coordinates of every body and how far each joint is open; all derivatives of these gaps are differences. It shares neither loops nor dyads, closed
forms, reductions or records with what it judges, only the places of the links, of which it sees whether they close.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import linkdyn
import numpy as np
import pytest
from scipy.optimize import least_squares

pytestmark = pytest.mark.accuracy

Array = np.ndarray
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


# ---------------------------------------------------------------- bodies and gaps


def unit(v: Any) -> Array:
    return np.asarray(v, dtype=float) / np.linalg.norm(v)


def skew(v: Array) -> Array:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def turned(v: Array) -> Array:
    """The rotation by a rotation vector."""
    angle, k = np.linalg.norm(v), skew(v)
    return np.eye(3) + np.sinc(angle / np.pi) * k + np.sinc(angle / 2 / np.pi) ** 2 / 2 * k @ k


def across(z: Array) -> tuple[Array, Array]:
    x = unit(np.cross(z, np.eye(3)[np.argmin(np.abs(z))]))
    return x, np.cross(z, x)


class Bodies:
    """Newton's and Euler's equations of all links of a drawn scene with Lagrange's multipliers of its joints' gaps."""

    def __init__(self, scene: dict[str, Any]) -> None:
        self.scene, self.planar = scene, scene["space"] == "planar"
        self.names = [link["name"] for link in scene["link"]]
        self.lead = [c["joint"] for c in scene["coordinate"]]
        self.gravity = np.array([*scene["gravity"], 0.0][:3])
        self.ends = {joint["name"]: [self.marker(end) for end in joint["between"]] for joint in scene["joint"]}

    def marker(self, name: str) -> tuple[int, Array, Array]:
        link, marker = name.split(".")
        spec = (self.scene["frame"] if link == "frame" else self.scene["link"][self.names.index(link)])["markers"][marker]
        axis = spec.get("axis", X if self.planar else Z)
        return -1 if link == "frame" else self.names.index(link), np.array([*spec["at"], 0.0][:3]), unit([*axis, 0.0][:3])

    @staticmethod
    def seen(place: Array, turn: Array, marker: tuple[int, Array, Array]) -> tuple[Array, Array, Array]:
        """Point, axis and rotation of a marker's link."""
        link, at, axis = marker
        return (at, axis, np.eye(3)) if link < 0 else (place[link] + turn[link] @ at, turn[link] @ axis, turn[link])

    def gaps(self, place: Array, turn: Array) -> Array:
        """How far the joints are open."""
        out: list[float] = []
        for joint in self.scene["joint"]:
            (p, z, r), (q, other, s) = (self.seen(place, turn, end) for end in self.ends[joint["name"]])
            x, y = (r @ v for v in across(self.ends[joint["name"]][0][2]))
            d, kind = q - p, joint["type"]
            if self.planar:
                normal = np.array([-z[1], z[0], 0.0])
                out += {"revolute": [d[0], d[1]], "slot": [normal @ d], "prismatic": [normal @ d, np.cross(z, other)[2]], "fixed": [d[0], d[1], np.cross(z, other)[2]]}[kind]
                continue
            lean = [x @ other, y @ other]
            # drawn with all axes of the world: a slide's links stay parallel
            out += {"revolute": [*d, *lean], "spherical": [*d], "universal": [*d, z @ other], "cylindrical": [x @ d, y @ d, *lean], "planar": [z @ d, *lean],
                    "prismatic": [x @ d, y @ d, *lean, x @ s @ r.T @ y], "slot": [x @ d, y @ d]}[kind]
        return np.array(out)

    def variables(self, place: Array, turn: Array) -> Callable[[Array, Array], Array]:
        """The coordinates, angles counted from here."""
        kind = {joint["name"]: joint["type"] for joint in self.scene["joint"]}
        start = {name: [self.seen(place, turn, end)[2] for end in self.ends[name]] for name in self.lead}

        def values(place: Array, turn: Array) -> Array:
            out = []
            for name in self.lead:
                (p, z, r), (q, _, s) = (self.seen(place, turn, end) for end in self.ends[name])
                if kind[name] == "prismatic":
                    out.append(z @ (q - p))
                    continue
                x, y = across(np.array(Z) if self.planar else self.ends[name][0][2])
                way = s @ start[name][1].T @ start[name][0] @ x
                out.append(np.arctan2(way @ r @ y, way @ r @ x))
            return np.array(out)

        return values

    def moved(self, place: Array, turn: Array, by: Array) -> tuple[Array, Array]:
        by = by.reshape(-1, 6)
        return place + by[:, :3], np.array([turned(v) @ r for v, r in zip(by[:, 3:], turn, strict=True)])

    def rows(self, what: Callable[[Array, Array], Array], place: Array, turn: Array) -> Array:
        """Derivatives along the velocities of all bodies."""
        h, columns = 1e-6, []
        for e in h * np.eye(6 * len(self.names)):
            at = [what(*self.moved(place, turn, k * e)) for k in (-2, -1, 1, 2)]
            columns.append((8 * (at[2] - at[1]) - at[3] + at[0]) / (12 * h))
        return np.array(columns).T

    def drift(self, what: Callable[[Array, Array], Array], place: Array, turn: Array, v: Array) -> Array:
        """Second derivatives where all bodies go on as they do."""
        h = 1e-4
        at = [what(*self.moved(place, turn, k * h * v)) for k in (-2, -1, 0, 1, 2)]
        return (-at[0] + 16 * at[1] - 30 * at[2] + 16 * at[3] - at[4]) / (12 * h * h)

    def mass_and_force(self, turn: Array, v: Array) -> tuple[Array, Array]:
        n = len(self.names)
        mass, force = np.zeros((6 * n, 6 * n)), np.zeros(6 * n)
        for b, (link, r, w) in enumerate(zip(self.scene["link"], turn, v.reshape(-1, 6)[:, 3:], strict=True)):
            m, c = link["mass"], r @ [*link["cog"], 0.0][:3]
            if self.planar:
                tensor = np.diag([0.0, 0.0, link["inertia"]])
            else:
                xx, yy, zz, xy, yz, zx = link["inertia"]
                tensor = r @ np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]) @ r.T
            one, two = slice(6 * b, 6 * b + 3), slice(6 * b + 3, 6 * b + 6)
            mass[one, one], mass[one, two], mass[two, one], mass[two, two] = m * np.eye(3), -m * skew(c), m * skew(c), tensor - m * skew(c) @ skew(c)
            bent = np.cross(w, np.cross(w, c))
            force[one] = m * (self.gravity - bent)
            force[two] = m * np.cross(c, self.gravity - bent) - np.cross(w, tensor @ w)
        return mass, force

    def equations(self, place: Array, turn: Array, qd: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Rows of joints and coordinates, with minus their drift; mass matrix and forces."""
        values = self.variables(place, turn)
        joints, lead = self.rows(self.gaps, place, turn), self.rows(values, place, turn)
        if self.planar:
            joints = np.vstack([joints, np.eye(joints.shape[1])[[6 * b + k for b in range(len(self.names)) for k in (2, 3, 4)]]])
        v = np.linalg.lstsq(np.vstack([joints, lead]), np.concatenate([np.zeros(len(joints)), qd]), rcond=1e-13)[0]
        still = np.zeros(len(joints))
        drift = self.drift(self.gaps, place, turn, v)
        still[:len(drift)] = -drift
        return joints, lead, still, -self.drift(values, place, turn, v), *self.mass_and_force(turn, v)

    def drives(self, place: Array, turn: Array, qd: Array, qdd: Array) -> Array:
        joints, lead, still, rest, mass, force = self.equations(place, turn, qd)
        all_rows = np.vstack([joints, lead])
        acceleration = np.linalg.lstsq(all_rows, np.concatenate([still, qdd + rest]), rcond=1e-13)[0]
        return np.linalg.lstsq(all_rows.T, mass @ acceleration - force, rcond=1e-13)[0][len(joints):]

    def accelerations(self, place: Array, turn: Array, qd: Array) -> Array:
        joints, lead, still, rest, mass, force = self.equations(place, turn, qd)
        whole = np.block([[mass, joints.T], [joints, np.zeros((len(joints), len(joints)))]])
        return lead @ np.linalg.lstsq(whole, np.concatenate([force, still]), rcond=1e-12)[0][:len(force)] - rest


# ---------------------------------------------------------------- mechanisms, drawn in world axes


def drawn(space: str, joints: list[tuple], lead: list[tuple[str, float]]) -> dict[str, Any]:
    """Joints (name, type, first link, second, point, axis or both axes); links of any form, all with the world's axes as they are drawn."""
    names = list(dict.fromkeys(link for joint in joints for link in joint[2:4] if link != "frame"))
    markers: dict[str, dict[str, Any]] = {name: {} for name in ("frame", *names)}
    for name, _, first, second, point, *axis in joints:
        axes = axis[0] if axis and isinstance(axis[0][0], tuple) else axis * 2
        for end, link in enumerate((first, second)):
            markers[link][name] = {"at": list(map(float, point))} | ({"axis": list(map(float, axes[end]))} if axes else {})
    rng, links = np.random.default_rng(len(names) + 10 * len(joints)), []
    for name in names:
        points = np.array([marker["at"] for marker in markers[name].values()])
        form = rng.standard_normal((3, 3))
        form = 0.003 * form @ form.T + 0.01 * np.eye(3)
        tensor = np.trace(form) * np.eye(3) - form
        links.append({"name": name, "mass": 0.5 + rng.random(), "cog": (points.mean(0) + 0.02 * rng.standard_normal(points.shape[1])).tolist(), "markers": markers[name],
                      "inertia": tensor[2, 2] if space == "planar" else [*np.diag(tensor), tensor[0, 1], tensor[1, 2], tensor[2, 0]]})
    motion = [{"law": "harmonic", "amplitude": amplitude, "frequency": 3.0 + k, "phase": 0.7 * k, "mean": -amplitude * np.sin(0.7 * k)} for k, (_, amplitude) in enumerate(lead)]
    return {"space": space, "gravity": [0.5, -9.81] if space == "planar" else [0.7, -0.4, -9.81], "frame": {"markers": markers["frame"]}, "link": links,
            "joint": [{"name": name, "type": kind, "between": [f"{first}.{name}", f"{second}.{name}"]} for name, kind, first, second, *_ in joints],
            "coordinate": [{"joint": name, "motion": law} for (name, _), law in zip(lead, motion, strict=True)], "actuator": [{"joint": name} for name, _ in lead],
            "time": {"end": 2.0, "samples": 5}}  # fmt: skip


R, P, C, S, U, PLANE = "revolute", "prismatic", "cylindrical", "spherical", "universal", "planar"


def three_legs(base: list[tuple[float, ...]], legs: Callable[[int, float, float], list[tuple]]) -> list[tuple]:
    return [joint for k, (x, y) in enumerate(base) for joint in legs(k, x, y)]


STARS = [(np.cos(2.1 * k + 0.1), np.sin(2.1 * k + 0.1)) for k in range(3)]
TIPS = [(0.3, 0.3), (0.5, 0.3), (0.25, 0.5)]
MECHANISMS: dict[str, dict[str, Any]] = {
    "stephenson_3": drawn("planar", [("A", R, "frame", "crank", (0, 0)), ("B", R, "crank", "coupler", (0.1, 0.05)), ("C", R, "coupler", "rocker", (0.4, 0.3)), ("D", R, "rocker", "frame", (0.45, 0)),
        ("E", R, "coupler", "rod", (0.3, 0.1)), ("F", R, "rod", "arm", (0.7, 0.3)), ("H", R, "arm", "frame", (0.8, 0))], [("A", 0.8)]),
    "stephenson_2": drawn("planar", [("A", R, "frame", "crank", (0, 0)), ("B", R, "crank", "coupler", (0.1, 0.3)), ("C", R, "coupler", "plate", (0.4, 0.35)), ("D", R, "plate", "frame", (0.5, 0)),
        ("E", R, "coupler", "rod", (0.3, 0.5)), ("F", R, "rod", "third", (0.7, 0.4)), ("H", R, "third", "plate", (0.6, 0.2))], [("A", 0.1)]),
    "peaucellier": drawn("planar", [("O", R, "frame", "l1", (0, 0)), ("O2", R, "frame", "l2", (0, 0)), ("Q", R, "frame", "c", (0.15, 0)), ("B", R, "c", "r1", (0.3, 0)), ("B2", R, "c", "r2", (0.3, 0)),
        ("C", R, "l1", "r1", (0.4, 0.15)), ("D", R, "l2", "r2", (0.4, -0.15)), ("C2", R, "l1", "r3", (0.4, 0.15)), ("D2", R, "l2", "r4", (0.4, -0.15)), ("E", R, "r3", "r4", (0.5, 0))], [("Q", 0.4)]),
    "hart_inversor": drawn("planar", [("A", R, "frame", "k", (0, 0)), ("P1", R, "k", "b1", (0.12, 0.1)), ("B", R, "b1", "b2", (0.02, 0.2)), ("C", R, "b2", "b3", (0.3, 0.05)),
        ("D", R, "b3", "b4", (0.2, 0.22)), ("E", R, "b4", "b1", (0.25, 0.02)), ("F", R, "b2", "frame", (0.17, 0.12))], [("A", 0.2)]),
    "jansen_leg": drawn("planar", [("A", R, "frame", "m", (0.38, 0.078)), ("B", R, "m", "j", (0.5, 0.16)), ("B2", R, "m", "k", (0.5, 0.16)), ("C", R, "j", "bde", (0.06, 0.42)), ("O", R, "bde", "frame", (0, 0)),
        ("D", R, "bde", "f", (-0.38, 0.1)), ("E", R, "f", "ghi", (-0.3, -0.27)), ("F", R, "ghi", "c", (0.03, -0.39)), ("O2", R, "c", "frame", (0, 0)), ("F2", R, "k", "c", (0.03, -0.39))], [("A", 0.5)]),
    "klann_leg": drawn("planar", [("A", R, "frame", "crank", (0, 0)), ("B", R, "crank", "con", (0.11, 0.02)), ("C", R, "con", "rock", (0.25, 0.13)), ("D", R, "rock", "frame", (0.27, -0.1)),
        ("E", R, "con", "leg", (0.45, 0.3)), ("F", R, "leg", "upper", (0.38, 0.45)), ("H", R, "upper", "frame", (0.1, 0.5))], [("A", 0.15)]),
    "trammel": drawn("planar", [("X", P, "frame", "s1", (0.3, 0), (1, 0)), ("Y", P, "frame", "s2", (0, 0.4), (0, 1)), ("A", R, "s1", "bar", (0.3, 0)), ("B", R, "s2", "bar", (0, 0.4))], [("X", 0.1)]),
    "oldham": drawn("planar", [("A", R, "frame", "h1", (0, 0)), ("S1", P, "h1", "mid", (0.05, 0.02), (1, 0.2)), ("S2", P, "mid", "h2", (0.05, 0.1), (-0.3, 1)), ("B", R, "h2", "frame", (0.08, 0.03))], [("A", 1.5)]),
    "triad_by_its_last_lever": drawn("planar", [("A", R, "frame", "crank", (0, 0)), ("B", R, "crank", "plate", (0.1, 0.1)), ("C", R, "plate", "r1", (0.4, 0.3)), ("D", R, "r1", "frame", (0.6, 0.05)), ("E", R, "plate", "r2", (0.35, -0.1)),
        ("F", R, "r2", "s", (0.55, -0.3)), ("S", P, "frame", "s", (0.55, -0.3), (1, 0.3)), ("K", R, "plate", "ex", (0.2, 0.25)), ("L", R, "ex", "lever", (0.1, 0.5)), ("N", R, "lever", "frame", (0.4, 0.6))], [("N", 0.05)]),
    "3_rpr": drawn("planar", three_legs([(0, 0), (0.8, 0), (0.4, 0.8)], lambda k, x, y: [(f"A{k}", R, "frame", f"u{k}", (x, y)),
        (f"S{k}", P, f"u{k}", f"v{k}", ((x + TIPS[k][0]) / 2, (y + TIPS[k][1]) / 2), (TIPS[k][0] - x, TIPS[k][1] - y)), (f"B{k}", R, f"v{k}", "plate", TIPS[k])]), [("S0", 0.02), ("S1", 0.02), ("S2", 0.02)]),
    "twin_slot_lever": drawn("planar", [("A", R, "frame", "c", (0, 0)), ("S", "slot", "lever", "c", (0.1, 0.2), (0.3, 1)), ("L", R, "frame", "lever", (0.05, -0.3)), ("S2", "slot", "lever", "ram", (0.2, 0.5), (0.3, 1)),
        ("P", P, "frame", "ram", (0.2, 0.5), (1, 0.1))], [("A", 0.5)]),
    "weld_in_a_loop": drawn("planar", [("A", R, "frame", "c", (0, 0)), ("B", R, "c", "k", (0.1, 0.2)), ("W", "fixed", "k", "k2", (0.2, 0.25)), ("C", R, "k2", "r", (0.5, 0.3)), ("D", R, "r", "frame", (0.45, 0))], [("A", 0.4)]),
    "rccc": drawn("spatial", [("A", R, "frame", "c", (0, 0, 0), Z), ("B", C, "c", "k", (0.2, 0.05, 0.03), (0.3, 0.2, 1)), ("C", C, "k", "r", (0.4, 0.4, 0.1), (0.5, -0.3, 0.8)), ("D", C, "r", "frame", (0.7, 0.1, 0), (-0.2, 0.4, 1))], [("A", 0.1)]),
    "rrsc": drawn("spatial", [("A", R, "frame", "c", (0, 0, 0), Z), ("B", R, "c", "k", (0.2, 0, 0.1), (0.2, 1, 0.1)), ("S", S, "k", "r", (0.3, 0.35, 0.3)), ("C", C, "r", "frame", (0.6, 0.2, 0), (0.1, 0.3, 1))], [("A", 0.1)]),
    "tracta": drawn("spatial", [("A", R, "frame", "in", (0, 0, 0), X), ("U1", R, "in", "f1", (0.1, 0, 0), Z), ("T", PLANE, "f1", "f2", (0.15, 0.02, 0), (0, 1, 0.1)), ("U2", R, "f2", "out", (0.22, 0.03, 0.01), (0.1, 0.2, 1)),
        ("B", R, "out", "frame", (0.3, 0.1, 0.02), (1, 0.5, 0.1))], [("A", 0.6)]),
    "hooke_shaft_with_spline": drawn("spatial", [("A", R, "frame", "in", (0, 0, 0), X), ("U1", U, "in", "mid1", (0.1, 0, 0), (Z, (0.2, 1, 0))), ("C", P, "mid1", "mid2", (0.2, 0.05, 0.02), (1, 0.5, 0.2)),
        ("U2", U, "mid2", "out", (0.3, 0.1, 0.04), ((-0.5, 1, 0), Z)), ("B", R, "out", "frame", (0.4, 0.12, 0.05), (1, 0.2, 0))], [("A", 1.0)]),
    "double_cardan": drawn("spatial", [("A", R, "frame", "in", (0, 0, 0), X), ("U1", U, "in", "mid", (0.1, 0, 0), (Z, Y)), ("U2", U, "mid", "out", (0.2, 0.03, 0), (Y, Z)), ("C", C, "out", "frame", (0.4, 0.12, 0), (1, 0.5, 0))], [("A", 0.8)]),
    "wobble_plate": drawn("spatial", [("A", R, "frame", "z", (0, 0, 0), X), ("W", R, "z", "plate", (0.1, 0, 0), (1, 0.3, 0)), ("S", S, "plate", "rod", (0.1, 0.02, 0.2)), ("S2", U, "rod", "piston", (0.4, 0.03, 0.22), (Y, Z)),
        ("Pi", P, "piston", "frame", (0.4, 0.03, 0.22), X)], [("A", 0.7), ("W", 0.1)]),
    "3_rrs": drawn("spatial", three_legs(STARS, lambda k, c, s: [(f"A{k}", R, "frame", f"c{k}", (0.4 * c, 0.4 * s, 0), (-s, c, 0)), (f"B{k}", R, f"c{k}", f"r{k}", (0.55 * c, 0.55 * s, 0.15), (-s, c, 0)),
        (f"S{k}", S, f"r{k}", "top", (0.25 * c, 0.25 * s, 0.5))]), [("A0", 0.2), ("A1", 0.25), ("A2", 0.15)]),
    "two_loops_two_leads": drawn("spatial", [("A", R, "frame", "c", (0, 0, 0), Z), ("B", U, "c", "k", (0.2, 0.1, 0), (Z, (1, 0.2, 0))), ("C", S, "k", "p", (0.4, 0.3, 0.2)), ("D", C, "p", "frame", (0.5, 0.2, 0.1), (0.3, 0.1, 1)),
        ("E", R, "p", "q", (0.45, 0.4, 0.1), (1, 0, 0.2)), ("F", C, "q", "w", (0.6, 0.5, 0.2), (0.2, 1, 0.1)), ("H", S, "w", "frame", (0.8, 0.3, 0))], [("A", 0.2), ("E", 0.1)]),
    "rsur_by_a_slide": drawn("spatial", [("A", P, "frame", "c", (0, 0, 0), (1, 0.2, 0.1)), ("S", S, "c", "k", (0.05, 0.15, 0.1)), ("U", U, "k", "r", (0.4, 0.3, 0.2), (Z, (1, 0.3, 0))), ("D", R, "r", "frame", (0.6, 0.1, 0), (0, 0.3, 1))], [("A", 0.05)]),
    "six_bar_in_space": drawn("spatial", [("A", R, "frame", "c", (0, 0, 0), Z), ("B", U, "c", "k", (0.2, 0.1, 0), (Z, (1, 0.2, 0))), ("C", S, "k", "p", (0.4, 0.3, 0.2)), ("D", R, "p", "frame", (0.5, 0.2, 0.1), (0.3, 0.1, 1)),
        ("E", U, "p", "q", (0.45, 0.4, 0.1), ((1, 0, 0.2), Y)), ("F", S, "q", "w", (0.6, 0.5, 0.2)), ("H", R, "w", "frame", (0.8, 0.3, 0), (0, 0.2, 1))], [("H", 0.03)]),
    "cardan_shaft_that_steers": drawn("spatial", [("A", R, "frame", "in", (0, 0, 0), X), ("U1", U, "in", "mid", (0.1, 0, 0), (Z, Y)), ("K", R, "frame", "arm", (0.2, 0, 0), Z), ("C", C, "arm", "out", (0.4, 0, 0), X),
        ("U2", U, "mid", "out", (0.3, 0, 0), (Y, Z))], [("A", 1.5), ("K", 0.4)]),
    "swash_plate_pump": drawn("spatial", [("A", R, "frame", "drum", (0, 0, 0), X), *three_legs(STARS, lambda k, c, s: [(f"T{k}", PLANE, "frame", f"shoe{k}", (-0.03 * c, 0.1 * c, 0.1 * s), (1, 0.3, 0)),
        (f"U{k}", U, f"shoe{k}", f"piston{k}", (-0.03 * c, 0.1 * c, 0.1 * s), ((0.3, -1, 0), Z)), (f"P{k}", P, "drum", f"piston{k}", (0.15, 0.1 * c, 0.1 * s), X)])], [("A", 1.5)]),
    "wobble_plate_with_three_pistons": drawn("spatial", [("A", R, "frame", "shaft", (0, 0, 0), X), ("W", R, "shaft", "plate", (0, 0, 0), (1, 0.3, 0)), ("H", P, "frame", "guide", (0, 0, -0.12), X), ("V", P, "guide", "shoe", (0, 0, -0.12), Z),
        ("G", S, "plate", "shoe", (0, 0, -0.12)), *three_legs(STARS, lambda k, c, s: [(f"S{k}", S, "plate", f"rod{k}", (-0.03 * c, 0.1 * c, 0.1 * s)), (f"U{k}", U, f"rod{k}", f"piston{k}", (0.25, 0.1 * c, 0.1 * s), (Y, Z)),
        (f"P{k}", P, "frame", f"piston{k}", (0.25, 0.1 * c, 0.1 * s), X)])], [("A", 1.5)]),
    "ball_in_a_groove": drawn("spatial", [("A", R, "frame", "c", (0, 0, 0), Z), ("S", "slot", "arm", "c", (0.2, 0.1, 0.05), (0.3, 1, 0.2)), ("B", U, "frame", "arm", (0.3, -0.4, 0), (X, (0, 0.1, 1)))], [("A", 0.3)]),
}  # fmt: skip


def ring(lengths: list[float], twists: list[float], offsets: list[float]) -> dict[str, Any]:
    """A loop of hinges by Denavit's and Hartenberg's parameters, which moves against all counting, drawn where it closes with its first angle at 40 degrees."""
    n = len(lengths)

    def walk(angles: Array) -> tuple[list[tuple[Array, Array]], Array, Array]:
        p, r, axes = np.zeros(3), np.eye(3), []
        for a, twist, d, angle in zip(lengths, twists, offsets, angles, strict=True):
            axes.append((p, r[:, 2]))
            r = r @ turned(angle * np.array(Z))
            p = p + d * r[:, 2] + a * r[:, 0]
            r = r @ turned(twist * np.array(X))
        return axes, p, r

    def open_by(others: Array) -> Array:
        _, p, r = walk(np.array([0.7, *others]))
        return np.concatenate([p, (r - np.eye(3)).ravel()])

    starts = [np.zeros(n - 1), *(np.random.default_rng(k).uniform(-3, 3, n - 1) for k in range(1, 50))]
    found = next(x.x for x in (least_squares(open_by, start, xtol=1e-15, ftol=1e-15, gtol=1e-15) for start in starts) if np.abs(x.fun).max() < 1e-13)
    axes, links = walk(np.array([0.7, *found]))[0], [*(f"l{k}" for k in range(n - 1)), "frame"]
    return drawn("spatial", [(f"J{k}", R, links[k - 1], links[k], tuple(point), tuple(axis)) for k, (point, axis) in enumerate(axes)], [("J0", 0.2)])


ALPHA, BETA, GAMMA, RIGHT = *np.radians([40.0, 70.0, 25.0]), np.pi / 2
A, B, G = (0.2 / np.sin(ALPHA) * np.sin(angle) for angle in (ALPHA, BETA, GAMMA))
MECHANISMS |= {
    "goldberg_5r": ring([A + G, B, A, G, B], [ALPHA + GAMMA, BETA, ALPHA, GAMMA, BETA], [0.0] * 5),     # two loops of Bennett's in one
    "schatz": ring([0, 0.3, 0.3, 0.3, 0, 0.3 * 3**0.5], [RIGHT] * 5 + [0.0], [-0.1, 0, 0, 0, 0, 0.1]),
    "altmann": ring([0.2, 0.3, 0] * 2, [RIGHT] * 6, [0.0] * 6),
    "bricard_trihedral": ring([0.3, 0.25, 0.3, 0.35, 0.4, (0.3**2 - 0.25**2 + 0.3**2 - 0.35**2 + 0.4**2) ** 0.5], [RIGHT, 3 * RIGHT] * 3, [0.0] * 6),
}


def places(scene: linkdyn.Scene, bodies: Bodies, **given: Any) -> tuple[Array, Array]:
    poses = scene.poses(**given)
    order = [list(scene.links).index(name) for name in bodies.names]       # of a slot the massless block is no body
    return poses.position[:, order], poses.rotation[:, order]


@pytest.mark.parametrize("name", MECHANISMS)
def test_inverse(name: str) -> None:
    """Joints close, and drives are those of the equations of all bodies."""
    bodies, scene = Bodies(MECHANISMS[name]), linkdyn.Scene(MECHANISMS[name])
    run = scene.inverse()
    place, turn = places(scene, bodies)
    assert (run.status == 0).all()
    found = []
    for i in range(len(place)):
        assert np.abs(bodies.gaps(place[i], turn[i])).max() < 1e-13
        found.append(bodies.drives(place[i], turn[i], run.qd.values[i], run.qdd.values[i]))
    # differences of second order are good for some 1e-8 of what they are taken from
    np.testing.assert_allclose(run.driving_force, found, rtol=1e-6, atol=1e-7 * np.abs(found).max())


@pytest.mark.parametrize("name", MECHANISMS)
def test_forward(name: str) -> None:
    """Let go with a push it keeps its energy, its joints close, and it accelerates as all bodies do."""
    data = copy.deepcopy(MECHANISMS[name]) | {"actuator": []}
    for coordinate in data["coordinate"]:
        del coordinate["motion"]
    data["coordinate"][0]["start"] = {"position": 0.0, "velocity": 0.2}
    bodies, scene = Bodies(data), linkdyn.Scene(data)
    run = scene.forward(t=np.linspace(0, 0.2, 3), rtol=1e-10, atol=1e-11, want="all")
    assert (run.status == 0).all() and run.attrs["stopped"] == ""
    place, turn = places(scene, bodies, joint_variable=run.joint_variable.values)
    found = []
    for i in range(len(place)):
        assert np.abs(bodies.gaps(place[i], turn[i])).max() < 1e-12
        found.append(bodies.accelerations(place[i], turn[i], run.qd.values[i]))
    np.testing.assert_allclose(run.qdd, found, rtol=1e-6, atol=1e-7 * np.abs(found).max())
    energy = run.kinetic_energy.values + run.potential_energy.values
    assert np.ptp(energy) < 1e-8 * (np.abs(run.kinetic_energy.values).max() + np.ptp(run.potential_energy.values))
