#!/usr/bin/env python3
"""Plan the drilling of five holes: write motion.csv and load.csv from the holes in scene.toml.

For each hole the table goes to the pose that puts the hole upright under the drill, comes up close, feeds upward at
feed per revolution times revolutions, stops at depth, goes down again. Between poses it moves from rest to rest by the
3-4-5 polynomial; feed starts and stops on a cycloidal ramp, so acceleration is continuous everywhere.
Thrust and torque are those of the Tungaloy catalogue (2020-21, p. L068); they grow while the drill's point enters.

    python make_motion.py        # rewrites both files beside it
"""
from __future__ import annotations

import csv
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent

# ---- the process
CUTTING_SPEED = 80.0            # m/min, carbide drill in cast iron
MATERIAL = 1.39                 # Tungaloy's K: cast iron, 280 MPa, 198 HB
POINT_ANGLE = math.radians(140)
HOLES = {                       # drill diameter mm, feed mm per revolution, depth mm
    "hole1": (25.0, 0.35, 45.0),
    "hole2": (20.0, 0.30, 40.0),
    "hole3": (20.0, 0.30, 40.0),
    "hole4": (25.0, 0.35, 45.0),
    "hole5": (16.0, 0.28, 35.0),
}

# ---- the table
REST = np.array([0.0, 0.0, 1.35, 0.0, 0.0, 0.0])   # where the workpiece is put on and taken off
RETRACT = 0.15                  # m between workpiece and drill while the table turns
NEAR = 0.004                    # m between workpiece and drill when feed begins
TOP_SPEED, TOP_ACCELERATION = 0.3, 1.5                                 # m/s, m/s2
TOP_RATE, TOP_RATE_CHANGE = math.radians(30), math.radians(120)        # rad/s, rad/s2
FEED_RAMP = 0.3                 # s to reach and to leave the feed rate
DWELL = 0.2                     # s at depth and between moves
FINE, COARSE = 0.02, 0.1        # s between rows of motion.csv: while accelerating, at constant speed


@dataclass(frozen=True)
class Cut:
    """What one hole asks of the drill; SI units, feed in m per revolution."""

    diameter: float
    feed: float
    depth: float

    @property
    def revolutions(self) -> float:
        """Revolutions per second."""
        return CUTTING_SPEED / 60 / (math.pi * self.diameter)

    @property
    def feed_rate(self) -> float:
        return self.feed * self.revolutions

    @property
    def point(self) -> float:
        """Height of the drill's point."""
        return self.diameter / 2 / math.tan(POINT_ANGLE / 2)

    @property
    def thrust(self) -> float:
        d, f = 1e3 * self.diameter, 1e3 * self.feed
        return 570 * MATERIAL * d * f**0.85

    @property
    def torque(self) -> float:
        d, f = 1e3 * self.diameter, 1e3 * self.feed
        return MATERIAL * d**2 * (0.630 + 16.84 * f) / 100


def table_pose(hole: dict, tip: np.ndarray, gap: float) -> np.ndarray:
    """Pose (x y z roll pitch yaw) with the hole upright under the drill's tip, `gap` below it; no yaw.

    With R = Rx(roll) Ry(pitch) the direction that R turns upright is (-sin p cos r, sin r, cos p cos r).
    """
    a = np.array(hole["axis"]) / np.linalg.norm(hole["axis"])
    roll, pitch = math.asin(a[1]), math.atan2(-a[0], a[2])
    (sr, cr), (sp, cp) = (math.sin(roll), math.cos(roll)), (math.sin(pitch), math.cos(pitch))
    rotation = np.array([[cp, 0, sp], [sr * sp, cr, -sr * cp], [-cr * sp, sr, cr * cp]])
    position = tip - [0, 0, gap] - rotation @ np.array(hole["at"])
    return np.array([*position, roll, pitch, 0.0])


def blend(u: np.ndarray) -> np.ndarray:
    """3-4-5 polynomial from 0 to 1, at rest at both ends."""
    return u**3 * (10 + u * (6 * u - 15))


def cycloid(u: np.ndarray) -> np.ndarray:
    """Cycloidal rise from 0 to 1."""
    return u - np.sin(2 * math.pi * u) / (2 * math.pi)


def ramp_travel(u: np.ndarray) -> np.ndarray:
    """Integral of `cycloid` from 0: travel while the speed rises, 1/2 at u = 1."""
    return u**2 / 2 - (1 - np.cos(2 * math.pi * u)) / (4 * math.pi**2)


class Plan:
    """Rows of both tables, written as time goes on."""

    def __init__(self, start: np.ndarray):
        self.time, self.pose = [0.0], [start]
        self.load: list[dict[str, float]] = [{"t": 0.0}]

    @property
    def now(self) -> float:
        return self.time[-1]

    def follow(self, duration: float, step: float, pose_at) -> None:
        """Add rows up to `duration` from now; pose_at(u) with u from 0 to 1."""
        start = self.now
        count = max(1, math.ceil(duration / step - 1e-9))
        for u in np.arange(1, count + 1) / count:
            self.time.append(start + u * duration)
            self.pose.append(pose_at(u))

    def rest(self, duration: float) -> None:
        pose = self.pose[-1]
        self.follow(duration, FINE, lambda u: pose)

    def move(self, target: np.ndarray) -> None:
        """From rest to rest, in the shortest time that the table's limits of speed and acceleration allow."""
        start = self.pose[-1]
        distance = np.linalg.norm((target - start)[:3])
        angle = np.abs((target - start)[3:]).max()
        peak_speed, peak_acceleration = 1.875, 10 / math.sqrt(3)    # of the 3-4-5 polynomial
        duration = max(peak_speed * distance / TOP_SPEED, peak_speed * angle / TOP_RATE,
                       math.sqrt(peak_acceleration * distance / TOP_ACCELERATION),
                       math.sqrt(peak_acceleration * angle / TOP_RATE_CHANGE))
        duration = math.ceil(duration / FINE) * FINE
        self.follow(duration, FINE, lambda u: start + blend(u) * (target - start))

    def drill(self, name: str, cut: Cut) -> None:
        """Feed upward from `NEAR` below the tip to full depth."""
        start, begin = self.pose[-1], self.now
        ramp = cut.feed_rate * FEED_RAMP / 2            # travel of each ramp
        steady = NEAR + cut.depth - 2 * ramp
        raised = lambda travel: start + travel * np.eye(6)[2]
        self.follow(FEED_RAMP, FINE, lambda u: raised(2 * ramp * ramp_travel(u)))
        self.follow(steady / cut.feed_rate, COARSE, lambda u: raised(ramp + u * steady))
        stop = self.now
        self.follow(FEED_RAMP, FINE, lambda u: raised(ramp + steady + 2 * ramp * (u - ramp_travel(u))))
        entry = begin + FEED_RAMP + (NEAR - ramp) / cut.feed_rate
        self.cut_load(name, cut, entry, stop)

    def cut_load(self, name: str, cut: Cut, entry: float, stop: float) -> None:
        """Thrust grows with the cutting length of the lips, torque with its square; both end with the feed."""
        number = name.removeprefix("hole")

        def knot(time, thrust, torque):
            self.load.append({"t": time, f"Fz{number}": -thrust * cut.thrust, f"Mz{number}": -torque * cut.torque})

        for u in np.linspace(0, 1, 9):
            knot(entry + u * cut.point / cut.feed_rate, u, u**2)
        for u in np.linspace(0, 1, 9):
            speed = max(0.0, 1 - cycloid(u))
            knot(stop + u * FEED_RAMP, speed**0.85, speed)


def plan_holes(scene: dict) -> Plan:
    """The whole cycle: from rest, through all holes, back to rest, up to a whole second."""
    tip = np.array(scene["frame"]["markers"]["spindle"]["at"])
    markers = scene["link"][0]["markers"]
    plan = Plan(REST)
    plan.rest(DWELL)
    for name, (diameter, feed, depth) in HOLES.items():
        cut = Cut(1e-3 * diameter, 1e-3 * feed, 1e-3 * depth)
        plan.move(table_pose(markers[name], tip, RETRACT))
        plan.move(table_pose(markers[name], tip, NEAR))
        plan.drill(name, cut)
        plan.rest(DWELL)
        plan.move(table_pose(markers[name], tip, RETRACT))
    plan.move(REST)
    plan.rest(math.ceil(plan.now + DWELL) - plan.now)
    plan.load.append({"t": plan.now})
    return plan


def write(plan: Plan) -> None:
    with open(FOLDER / "motion.csv", "w", newline="") as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(["t [s]", "x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]", "yaw [rad]"])
        table.writerows([f"{v:.12g}" for v in (t, *pose)] for t, pose in zip(plan.time, plan.pose))
    names = [f"{kind}{name.removeprefix('hole')}" for name in HOLES for kind in ("Fz", "Mz")]
    units = {"F": "N", "M": "N*m"}
    with open(FOLDER / "load.csv", "w", newline="") as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(["t [s]", *(f"{n} [{units[n[0]]}]" for n in names)])
        for row in plan.load:
            table.writerow([f"{row['t']:.12g}", *(f"{row.get(n, 0.0) + 0.0:.9g}" for n in names)])


def main() -> None:
    scene = tomllib.loads((FOLDER / "scene.toml").read_text())
    plan = plan_holes(scene)
    write(plan)
    for name, (diameter, feed, depth) in HOLES.items():
        cut = Cut(1e-3 * diameter, 1e-3 * feed, 1e-3 * depth)
        print(f"{name}: drill {diameter:g} mm, {60 * cut.revolutions:.0f} rpm, feed {6e4 * cut.feed_rate:.0f} mm/min, "
              f"thrust {cut.thrust:.0f} N, torque {cut.torque:.1f} N m")
    print(f"{plan.now:.0f} s in {len(plan.time)} rows")
    if scene["time"]["end"] != round(plan.now):
        raise SystemExit(f"scene.toml: [time] end must be {plan.now:.0f}")


if __name__ == "__main__":
    main()
