"""Mechanisms led by whatever says where they are: places of markers, angles and strokes within loops, all seen from links that move.

Mechanisms are drawn as they stand at the start, with link axes at random, and coordinates are drawn by lot; forces come from equations of
all links by multipliers (tests/reference/multibody.py).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import pytest
from numpy.typing import NDArray

sys.path[:0] = [str(Path(__file__).resolve().parents[1] / "reference")]

from multibody import ALL, PLANE, Multibody, rotation, sine_of_cross, three  # noqa: E402

pytestmark = pytest.mark.accuracy

Array = NDArray[np.float64]
UP = np.array([0.0, 0, 1])
SUFFICIENT = 1e-9     # of the largest force; conditions up to some thousand, closed to 1e-13


def unit(*vector: float) -> Array:
    values = three(vector)
    return values / np.linalg.norm(values)


class Drawing:
    """Links and joints at places in the world."""

    def __init__(self, planar: bool, rng: np.random.Generator) -> None:
        self.planar, self.rng = planar, rng
        self.poses: dict[str, tuple[Array, Array]] = {"frame": (np.zeros(3), np.eye(3))}
        self.markers: dict[str, dict[str, Any]] = {"frame": {}}
        self.scene: dict[str, Any] = {
            "space": "planar" if planar else "spatial", "gravity": [0.3, -9.81] if planar else [0.3, -0.2, -9.81],
            "frame": {"markers": self.markers["frame"]}, "link": [], "joint": [], "actuator": [], "load": [], "time": {"samples": 9},
        }

    def link(self, name: str, *at: float) -> None:
        size, rng = 2 if self.planar else 3, self.rng
        turn = rng.uniform(-1, 1, 3) * ([0, 0, 2] if self.planar else 1)
        self.poses[name] = three(at), rotation(turn)
        self.markers[name] = {}
        body = rng.normal(0, 0.1, (6, 3))
        tensor = (body**2).sum() * np.eye(3) - body.T @ body
        roll_pitch_yaw = self._angles(rotation(turn))
        self.scene["link"].append({
            "name": name, "mass": rng.uniform(0.5, 4), "cog": list(rng.uniform(-0.1, 0.1, size)), "markers": self.markers[name],
            "inertia": tensor[2, 2] if self.planar else [*np.diag(tensor), tensor[0, 1], tensor[1, 2], tensor[2, 0]],
            "start": {"position": list(at), **({"angle": roll_pitch_yaw[2]} if self.planar else {"angles": roll_pitch_yaw})},
        })

    @staticmethod
    def _angles(turn: Array) -> list[float]:
        return [np.arctan2(-turn[1, 2], turn[2, 2]), np.arcsin(turn[0, 2]), np.arctan2(-turn[0, 1], turn[0, 0])]

    def joint(self, name: str, kind: str, first: str, second: str, at: Any, axis: Any = None, second_axis: Any = None) -> None:
        axes = [axis, axis if second_axis is None else second_axis]
        between = [self.marker(link, name, at, a) for link, a in zip((first, second), axes)]
        self.scene["joint"].append({"name": name, "type": kind, "between": between})

    def marker(self, link: str, name: str, at: Any, axis: Any = None) -> str:
        size = 2 if self.planar else 3
        place, turn = self.poses[link]
        entry = {"at": list((turn.T @ (three(at) - place))[:size])}
        if axis is not None:
            entry["axis"] = list((turn.T @ unit(*axis))[:size])
            if not self.planar:
                entry["x"] = list(turn.T @ sine_of_cross(unit(*axis), np.array([0.61, 0.35, 0.29])))
        self.markers[link][name] = entry
        return f"{link}.{name}"

    def cylinder(self, name: str, first: str, a: Any, second: str, b: Any, ends: tuple[str, str] = ("revolute", "revolute"), hinge: Any = None) -> None:
        """A driven telescope."""
        way = unit(*(three(b) - three(a)))[: 2 if self.planar else 3]
        self.link(f"{name}b", *a)
        self.link(f"{name}r", *b)
        self.joint(f"{name}0", ends[0], first, f"{name}b", a, hinge)
        self.joint(f"{name}1", ends[1], f"{name}r", second, b)
        self.joint(name, "prismatic", f"{name}b", f"{name}r", b, way)
        self.drive(name)

    def drive(self, *joints: str) -> None:
        self.scene["actuator"] += [{"joint": joint} for joint in joints]


# ---------------------------------------------------------------- mechanisms


def excavator(d: Drawing) -> None:
    for name, at in {"boom": (0, 0), "stick": (5, 1.5), "bucket": (6, -1), "rocker": (5.5, 0.1), "tie": (6.1, -0.2)}.items():
        d.link(name, *at)
    for name, links, at in (("B", ("frame", "boom"), (0, 0)), ("S", ("boom", "stick"), (5, 1.5)), ("K", ("stick", "bucket"), (6, -1)),
                            ("H", ("stick", "rocker"), (5.5, 0.1)), ("T", ("rocker", "tie"), (6.1, -0.2)), ("E", ("tie", "bucket"), (6.4, -0.9))):
        d.joint(name, "revolute", *links, at)
    d.cylinder("lift", "frame", (0.5, -0.5), "boom", (2.3, 1.5))
    d.cylinder("crowd", "boom", (2.6, 2.0), "stick", (4.6, 2.1))
    d.cylinder("curl", "stick", (5.4, 1.6), "rocker", (6.1, -0.2))
    d.scene["load"] = [{"on": d.marker("bucket", "tip", (6.5, -2)), "force": [-3e3, 2e3]}]


def valve_gear(d: Drawing) -> None:
    """Walschaerts': crank, crosshead, slotted link with its block, combination lever, reversing hanger."""
    rod_end = 0.3 * np.cos(0.7) + np.sqrt(1.5**2 - (0.3 * np.sin(0.7)) ** 2)
    pin, eccentric = (0.3 * np.cos(0.7), 0.3 * np.sin(0.7)), (0.12 * np.cos(-0.7), 0.12 * np.sin(-0.7))
    for name, at in {"crank": (0, 0), "rod": pin, "cross": (rod_end, 0), "eccentric rod": eccentric, "link": (0.9, 0.5), "block": (0.92, 0.6),
                     "radius rod": (0.92, 0.6), "lever": (1.7, 0.55), "valve": (1.75, 0.6), "union": (rod_end + 0.05, -0.15),
                     "hanger": (1.2, 1.0), "die": (1.2, 0.58)}.items():
        d.link(name.replace(" ", "_"), *at)
    for name, links, at in (
        ("O", "frame crank", (0, 0)), ("A", "crank rod", pin), ("B", "rod cross", (rod_end, 0)), ("E", "crank eccentric_rod", eccentric),
        ("T", "eccentric_rod link", (0.8, 0.2)), ("L", "frame link", (0.9, 0.5)), ("SB", "block radius_rod", (0.92, 0.6)),
        ("RC", "radius_rod lever", (1.7, 0.55)), ("V", "lever valve", (1.75, 0.6)), ("U", "cross union", (rod_end + 0.05, -0.15)),
        ("C", "union lever", (1.65, -0.2)), ("H", "frame hanger", (1.2, 1.0)), ("HB", "hanger die", (1.2, 0.58)),
    ):
        d.joint(name, "revolute", *links.split(), at)
    for name, links, at, way in (("X", "frame cross", (rod_end, 0), (1, 0)), ("SL", "link block", (0.92, 0.6), (0.02, 0.1)),
                                 ("VX", "frame valve", (1.75, 0.6), (1, 0)), ("HS", "radius_rod die", (1.2, 0.58), (0.78, -0.05))):
        d.joint(name, "prismatic", *links.split(), at, way)
    d.drive("O", "H")
    d.scene["load"] = [{"on": "valve.VX", "force": [-50.0, 0]}, {"on": "cross.X", "force": [-500.0, 0]}]


def on_three_legs(d: Drawing, build: Callable[[int, Array, Array], None]) -> None:
    for k in range(3):
        angle = 2 * np.pi * k / 3 + 0.1
        build(k, np.array([np.cos(angle), np.sin(angle), 0]), np.array([-np.sin(angle), np.cos(angle), 0]))
    d.scene["load"] = [{"on": d.marker("top", "tool", (0.1, 0.05, 1.2)), "force": [10.0, 20, -300]}]


def canfield(d: Drawing) -> None:
    d.link("top", 0, 0, 1)

    def leg(k: int, out: Array, along: Array) -> None:
        knee = 0.75 * out + 0.5 * UP
        d.link(f"low{k}", *(0.4 * out))
        d.link(f"high{k}", *knee)
        d.joint(f"A{k}", "revolute", "frame", f"low{k}", 0.4 * out, along)
        d.joint(f"M{k}", "spherical", f"low{k}", f"high{k}", knee)
        d.joint(f"B{k}", "revolute", "top", f"high{k}", 0.4 * out + UP, along)
        d.drive(f"A{k}")

    on_three_legs(d, leg)


def tripod(d: Drawing) -> None:
    d.link("top", 0, 0, 0.9)
    on_three_legs(d, lambda k, out, along: d.cylinder(f"P{k}", "frame", 0.8 * out, "top", 0.5 * out + 0.9 * UP, ("revolute", "spherical"), along))


def wheel(d: Drawing) -> None:
    """On two wishbones, steered by a rack and a tie rod."""
    for name, at in {"low": (0, 0.3, 0.2), "high": (0, 0.35, 0.5), "hub": (0, 0.7, 0.33), "rack": (0.15, 0, 0.3), "tie": (0.15, 0.3, 0.3)}.items():
        d.link(name, *at)
    d.joint("L", "revolute", "frame", "low", (0, 0.3, 0.2), (1, 0.05, 0.02))
    d.joint("U", "revolute", "frame", "high", (0, 0.35, 0.5), (1, -0.06, 0.03))
    d.joint("LS", "spherical", "low", "hub", (0.02, 0.7, 0.17))
    d.joint("US", "spherical", "high", "hub", (-0.02, 0.66, 0.52))
    d.joint("K", "prismatic", "frame", "rack", (0.15, 0, 0.3), (0, 1, 0))
    d.joint("T", "universal", "rack", "tie", (0.15, 0.3, 0.3), (1, 0, 0), (0, 0, 1))
    d.joint("TS", "spherical", "tie", "hub", (0.14, 0.65, 0.28))
    d.drive("K", "L")
    d.scene["load"] = [{"on": "hub.TS", "force": [100.0, 200, 4000]}]


def chain_of_seven(d: Drawing) -> None:
    places, axes = d.rng.uniform(-0.6, 0.6, (7, 3)), d.rng.normal(0, 1, (7, 3))
    names = ["frame", *(f"k{i}" for i in range(1, 7))]
    for name, place in zip(names[1:], places[1:]):
        d.link(name, *place)
    for i in range(7):
        d.joint(f"J{i}", "revolute", names[i], names[(i + 1) % 7], places[i], axes[i])
    d.drive("J0")


def three_sleeves(d: Drawing) -> None:
    """A hinge and three cylindrical joints."""
    places = [(0, 0, 0), (0.5, 0.1, 0.2), (0.9, 0.6, 0.5), (0.2, 0.8, 0.3)]
    names = ["frame", "a", "b", "c"]
    for name, place in zip(names[1:], places[1:]):
        d.link(name, *place)
    for i, axis in enumerate(d.rng.normal(0, 1, (4, 3))):
        d.joint(f"J{i}", "cylindrical" if i else "revolute", names[i], names[(i + 1) % 4], places[i], axis)
    d.drive("J0")


# ---------------------------------------------------------------- leads


def lots(d: Drawing, system: Multibody) -> list[dict[str, Any]]:
    """All that could be a coordinate."""
    found: list[dict[str, Any]] = [{"joint": joint["name"]} for joint in d.scene["joint"] if joint["type"] in ("revolute", "prismatic")]
    found += [{"joint": joint["name"], "variable": v} for joint in d.scene["joint"] if joint["type"] == "cylindrical" for v in ("angle", "slide")]
    parts = PLANE if d.planar else ALL
    places = [name for name in system.markers if not name.startswith("frame.")]
    found += [{"marker": name, "components": [part]} for name in places for part in parts if part in "xyz"]
    found += [{"link": a, "components": [part]} for a in system.links for part in parts]
    return found + [{"link": a, "components": [part], "relative_to": b} for a in system.links for b in system.links if a != b for part in parts]


def led(d: Drawing) -> dict[str, Any]:
    """The scene, led by coordinates that tell its motion well, a tenth of a metre or a radian of it."""
    scene, rng = d.scene, d.rng
    scene["coordinate"] = []
    system = Multibody(scene)
    pose = [d.poses[name] for name in system.links]
    closed = system.rows(system.constraints(), pose)
    freedoms = np.linalg.svd(closed)[2][len(closed) :].T
    choice = lots(d, system)
    while True:
        chosen = [choice[i] for i in rng.choice(len(choice), freedoms.shape[1], replace=False)]
        bodies = [c.get("link", c.get("marker", "").split(".")[0]) for c in chosen if "components" in c]
        if len(set(bodies)) < len(bodies):
            continue
        scene["coordinate"] = chosen
        told = system.rows(system.coordinates(), pose) @ freedoms
        if np.linalg.cond(told) < 40 and np.linalg.svd(told)[1][-1] > 0.03:
            break
    way = freedoms @ rng.normal(0, 1, freedoms.shape[1])
    at = system.values(system.coordinates(), system.moving(pose)).v
    on = system.rows(system.coordinates(), pose) @ way * (0.08 / np.abs(way).max())
    for c, start, step in zip(chosen, at, on):
        law = {"law": "polynomial-345", "from": float(start), "to": float(start + step), "duration": 1.0}
        c["motion"] = law if "joint" in c else {c["components"][0]: law}
    return scene


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("mechanism", [excavator, valve_gear, canfield, tripod, wheel, chain_of_seven, three_sleeves])
def test_led_by_lot(mechanism: Callable[[Drawing], None], seed: int) -> None:
    d = Drawing(mechanism in (excavator, valve_gear), np.random.default_rng(seed))
    mechanism(d)
    scene = led(d)
    run = linkdyn.Scene(scene).inverse()
    system = Multibody(scene)
    pose = [d.poses[name] for name in system.links]
    axes = [0, 1, 5] if d.planar else range(6)
    for k in (0, 2, 4):
        if run.status[k] != 0:
            break                    # the way may lead to a dead point
        forces, reactions, pose = system.inverse(run.q.values[k], run.qd.values[k], run.qdd.values[k], pose)
        np.testing.assert_allclose(run.driving_force[k], forces, rtol=0, atol=SUFFICIENT * np.abs(forces).max())
        told = np.array([reactions[str(joint)][axes] for joint in run.joint.values])
        np.testing.assert_allclose(run.reaction[k], told, rtol=0, atol=SUFFICIENT * np.abs(told).max())
    assert k > 0
