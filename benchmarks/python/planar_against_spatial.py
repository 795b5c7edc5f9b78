#!/usr/bin/env python3
"""What the same plane mechanism costs, declared planar and declared spatial.

    python benchmarks/python/planar_against_spatial.py

The spatial twin has joints that do not over-constrain it (a loop has cylindrical and spherical joints where the planar one
has hinges), so that both have the same forces in the plane. Leaves the table `planar` under results/benchmarks.
"""

from __future__ import annotations

import time
import tomllib
from typing import Any

import numpy as np
from numpy.typing import NDArray

import linkdyn
from report import ROOT, save_table

SAMPLES = 100_000
PASSES = 7


def slider_crank() -> tuple[dict[str, Any], dict[str, str]]:
    """The example, and what its joints are in space: R-C-S-P."""
    text = (ROOT / "examples" / "slider_crank" / "scene.toml").read_text()
    return tomllib.loads(text), {"B": "cylindrical", "C": "spherical"}


def arm(n: int) -> tuple[dict[str, Any], dict[str, str]]:
    """An open chain of n links of 0.5 m, all hinges driven."""
    links, joints, coordinates = [], [], []
    for k in range(n):
        links.append(
            {
                "name": f"link{k}",
                "markers": {"near": [0.0, 0.0], "far": [0.5, 0.0]},
                "mass": 2.0,
                "cog": [0.2, 0.01],
                "inertia": 0.05,
            }
        )
        before = "frame.base" if k == 0 else f"link{k - 1}.far"
        joints.append({"name": f"J{k}", "type": "revolute", "between": [before, f"link{k}.near"]})
        motion = {"law": "harmonic", "amplitude": 0.5, "mean": 0.3 * (-1) ** k, "frequency": f"{0.5 + 0.1 * k} Hz"}
        coordinates.append({"joint": f"J{k}", "motion": motion})
    scene = {
        "title": f"Arm of {n} links",
        "space": "planar",
        "gravity": [0.0, -9.81],
        "frame": {"markers": {"base": [0.0, 0.0]}},
        "link": links,
        "joint": joints,
        "coordinate": coordinates,
        "actuator": [{"joint": joint["name"]} for joint in joints],
        "time": {"end": 2.0},
    }
    return scene, {}


def as_spatial(planar: dict[str, Any], kinds: dict[str, str]) -> dict[str, Any]:
    """The same mechanism in the plane z = 0 of space; `kinds` says which joints change their type."""
    types = {joint["name"]: kinds.get(joint["name"], joint["type"]) for joint in planar["joint"]}
    slides = {end for joint in planar["joint"] if types[joint["name"]] == "prismatic" for end in joint["between"]}

    def marker(link: str, name: str, value: Any) -> dict[str, Any]:
        given = value if isinstance(value, dict) else {"at": value}
        along = f"{link}.{name}" in slides
        return {
            "at": [*given["at"], 0.0],
            "axis": [*given.get("axis", [1.0, 0.0]), 0.0] if along else [0.0, 0.0, 1.0],
        }

    def body(name: str, item: dict[str, Any]) -> dict[str, Any]:
        return {"markers": {key: marker(name, key, value) for key, value in item["markers"].items()}}

    links = [
        link | body(link["name"], link) | {"cog": [*link["cog"], 0.0], "inertia": [link["inertia"]] * 3 + [0.0] * 3}
        for link in planar["link"]
    ]
    loads = [load | {"force": [*load["force"], 0.0]} for load in planar.get("load", [])]
    return planar | {
        "space": "spatial",
        "gravity": [*planar["gravity"], 0.0],
        "frame": body("frame", planar["frame"]),
        "link": links,
        "joint": [joint | {"type": types[joint["name"]]} for joint in planar["joint"]],
        "load": loads,
    }


def largest_difference(planar: linkdyn.Scene, spatial: linkdyn.Scene, samples: int) -> float:
    """Of driving forces and of all forces and moments in the plane, relative to the largest of them."""
    t = np.linspace(*_range(planar), samples)
    ours, theirs = planar.inverse(t=t), spatial.inverse(t=t)
    components = ["Fx", "Fy", "Mz"]
    force = theirs.reaction.sel(component=components).values
    # A sphere passes on no moment, a cylinder none about its axis: nor does the hinge in the plane.
    gap = np.abs(ours.reaction.sel(component=components).values - force).max()
    gap = max(gap, np.abs(ours.driving_force.values - theirs.driving_force.values).max())
    return float(gap / np.abs(force).max())


def _range(scene: linkdyn.Scene) -> tuple[float, float]:
    return scene.description["time"]["first"], scene.description["time"]["last"]


def cost(scene: linkdyn.Scene, want: str) -> float:
    """Microseconds a sample: the best of some passes on one thread."""
    motion: list[NDArray[np.float64]] = list(scene.motion(np.linspace(*_range(scene), SAMPLES)))
    scene.solve(*motion, want=want)
    best = np.inf
    for _ in range(PASSES):
        start = time.perf_counter()
        scene.solve(*motion, want=want)
        best = min(best, time.perf_counter() - start)
    return 1e6 * best / SAMPLES


def main() -> None:
    lines = ["| mechanism | links | results | planar us/sample | spatial us/sample | spatial/planar | forces differ by |",
             "|---|---:|---|---:|---:|---:|---:|"]
    for name, (scene, kinds) in {"slider-crank": slider_crank(), "arm": arm(3), "longer arm": arm(10)}.items():
        planar, spatial = linkdyn.Scene(scene), linkdyn.Scene(as_spatial(scene, kinds))
        gap = largest_difference(planar, spatial, 1001)
        for want in ("driving_force,reaction", "driving_force"):
            one, other = cost(planar, want), cost(spatial, want)
            results = "all forces" if "reaction" in want else "driving forces"
            lines.append(f"| {name} | {len(planar.links)} | {results} | {one:.3f} | {other:.3f} | {other / one:.1f} | {gap:.0e} |")
    table = "\n".join(lines)
    print(table)
    save_table("planar", table)


if __name__ == "__main__":
    main()
