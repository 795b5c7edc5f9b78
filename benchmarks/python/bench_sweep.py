"""Memory of sweeps of growing size, and the same sweep on one and two threads.

Usage: bench_sweep.py [LARGEST]    (samples; default 1e7)

Prints a Markdown table. The rate against bare inverse dynamics is measured by the Fortran program bench_sweep.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import tomli_w

from linkdyn.cli import executable

SCENE = Path(__file__).resolve().parents[2] / "examples" / "stewart_tsai" / "scene.toml"


def sweep(n_sample: int) -> dict:
    """Extremes of the driving forces over about so many poses."""
    scene = tomllib.loads(SCENE.read_text())
    scene["sweep"] = {"reduce": ["driving_force"], "moments": False, "axis": [
        {"coordinate": "platform.x", "linspace": [-1.6, -1.4, 10]},
        {"coordinate": "platform.y", "linspace": [-0.1, 0.1, 10]},
        {"coordinate": "platform.z", "linspace": [0.9, 1.1, 10]},
        {"coordinate": "platform.yaw", "linspace": [-0.1, 0.1, max(1, n_sample // 1000)]},
    ]}
    return scene


def measure(file: Path, threads: int) -> tuple[float, float]:
    """Seconds, and the largest resident memory in MB."""
    start = time.perf_counter()
    process = subprocess.Popen(
        [executable(), "sweep", file, "-o", file.with_suffix(".nc"), "-q", "--threads", str(threads)]
    )
    _, status, usage = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status) != 0:
        sys.exit("the sweep failed")
    return time.perf_counter() - start, usage.ru_maxrss / 1024


def main(largest: float = 1e7) -> None:
    """All sizes up to the largest, a hundred times each the one before."""
    print("| samples | threads | s | us/sample | memory, MB |\n|---:|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as folder:
        n = int(largest)
        sizes = [size for size in (n // 10000, n // 100, n) if size >= 1000]
        for size in sizes:
            file = Path(folder) / "scene.toml"
            file.write_text(tomli_w.dumps(sweep(size)))
            for threads in (1, 2):
                seconds, memory = measure(file, threads)
                print(f"| {size:.0e} | {threads} | {seconds:.2f} | {1e6 * seconds / size:.3f} | {memory:.1f} |")


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
