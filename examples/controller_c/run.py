"""Generate a hexapod's inverse dynamics in C, build it into a loop of 1 kHz, and run that along the scene's motion."""

from __future__ import annotations

import argparse
import subprocess
from pathlib import Path

import linkdyn
import numpy as np

HERE = Path(__file__).resolve().parent
OPTIONS = ("-std=c99", "-O2", "-march=native", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")


def write_motion(scene: linkdyn.Scene, path: Path, seconds: float) -> None:
    """A row a millisecond: t, q, qd, qdd and the driving forces that linkdyn finds."""
    t = np.arange(0.0, seconds, 1e-3)
    run = scene.inverse(t=t, want="driving_force")
    np.savetxt(path, np.column_stack([t, run.q, run.qd, run.qdd, run.driving_force]), fmt="%.17g")


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--out", type=Path, default=Path("results/controller_c"), help="folder of code and program")
    arguments.add_argument("--seconds", type=float, default=2.0, help="of the motion; the loop takes as long")
    given = arguments.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)

    scene = linkdyn.load(HERE.parent / "stewart_tsai" / "scene.toml")
    _, source = scene.generate("inverse", name="hexapod").write(given.out)
    motion, program = given.out / "motion.txt", given.out / "controller"
    write_motion(scene, motion, given.seconds)
    subprocess.run(["cc", *OPTIONS, f"-I{given.out}", HERE / "main.c", source, "-lm", "-o", program], check=True)
    subprocess.run([program.resolve(), motion], check=True)


if __name__ == "__main__":
    main()
