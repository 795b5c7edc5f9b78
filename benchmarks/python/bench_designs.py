"""Designs whose geometry varies: milliseconds a design, each a mechanism that has to be assembled anew.

Usage: bench_designs.py [DESIGNS [THREADS]]    (default: 1000 designs, one thread)

Prints a Markdown table. Lengths and places of markers vary at random by one percent; of each design one pose is computed.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import linkdyn

ROOT = Path(__file__).resolve().parents[2]
# what stands in the file, or all lengths that follow from a variable, lest an over-constrained mechanism stop fitting
VARIED = {
    "examples/stewart_mathworks/scene.toml": (
        "frame.markers.B1[0]", "frame.markers.B2[1]", "frame.markers.B4[0]", "link.platform.markers.P1[0]",
        "link.platform.markers.P3[1]",
    ),
    "tests/scenes/planar_platform.toml": ("link.rod1.markers.C[0]", "link.rod2.markers.C[0]", "link.crank1.markers.B[0]"),
    "tests/scenes/rssr.toml": ("link.rod.markers.C[0]", "link.crank.markers.B[0]", "link.rocker.markers.C[0]"),
    "tests/scenes/hexaglide.toml": ("link.platform.markers.S1[0]", "link.platform.markers.S4[1]", "frame.markers.P2.at[1]"),
    "examples/delta/scene.toml": ("variables.R", "variables.r"),
    "examples/tripteron/scene.toml": ("frame.markers.A.at[1]", "frame.markers.A.at[2]", "link.platform.markers.C.at[1]"),
    "examples/agile_eye/scene.toml": ("variables.R", "variables.M", "variables.r"),
}


def measure(scene: linkdyn.Scene, paths: tuple[str, ...], n: int, threads: int) -> float:
    """Seconds of so many designs."""
    axes = [{"parameter": path, "random": {"from": 0.99, "to": 1.01, "n": n, "seed": i}, "as": "factor", "group": "designs"}
            for i, path in enumerate(paths, 1)]
    start = time.perf_counter()
    scene.sweep({"axis": axes, "reduce": ["driving_force"], "moments": False}, threads=threads)
    return time.perf_counter() - start


def main(n: float = 1000, threads: float = 1) -> None:
    """All of them; the least of three, without what a sweep takes before its first design."""
    print("| mechanism | ms a design | designs a second |\n|---|---:|---:|")
    for file, paths in VARIED.items():
        scene = linkdyn.load(ROOT / file)
        first = min(measure(scene, paths, 1, int(threads)) for _ in range(3))
        seconds = (min(measure(scene, paths, int(n), int(threads)) for _ in range(3)) - first) / (n - 1)
        name = Path(file).stem if "scenes/" in file else Path(file).parent.name
        print(f"| `{name}` | {1e3 * seconds:.2f} | {1 / seconds:,.0f} |", flush=True)


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
