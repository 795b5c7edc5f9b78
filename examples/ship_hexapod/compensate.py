#!/usr/bin/env python3
"""The motion that holds the platform still: the ship's, taken back. Then the legs' forces with it, locked at sea, and in harbour.

    python examples/ship_hexapod/compensate.py
"""
from __future__ import annotations

import tomllib
from pathlib import Path

import matplotlib

matplotlib.use("Agg")   # pictures go to files
import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

import linkdyn

FOLDER = Path(__file__).resolve().parent
HELD = np.array([0.0, 0.0, 10.6])       # where the platform stays, axes at rest [m]
STEP = 0.1                              # of the table [s]


def write_table() -> None:
    """As the ship sees it, the held platform stands at R^T (HELD - X) and has the rotation R^T, with R and X those of the ship."""
    t = np.arange(0.0, 40.0 + STEP / 2, STEP)
    content = tomllib.loads((FOLDER / "scene.toml").read_text())
    content["coordinate"] = [{"link": "platform", "motion": {"z": HELD[2]}}]
    pose = linkdyn.Scene(content).frame_motion(t)[0]
    turned = Rotation.from_euler("XYZ", pose[:, 3:]).inv()
    rows = np.column_stack([t, turned.apply(HELD - pose[:, :3]), turned.as_euler("XYZ")])
    np.savetxt(FOLDER / "platform.csv", rows, delimiter=",", header="t,x,y,z,roll,pitch,yaw", comments="", fmt="%.12g")


def main() -> None:
    write_table()
    held = linkdyn.load(FOLDER / "scene.toml")
    locked = held.with_({"coordinate.platform.motion": {"z": HELD[2]}})
    harbour = locked.with_({"frame.motion": None})
    figure, axes = plt.subplots(3, 1, sharex=True, sharey=True, figsize=(8, 7), layout="constrained")
    for axis, (name, scene) in zip(axes, {"held still by the legs": held, "legs locked, at sea": locked, "legs locked, in harbour": harbour}.items()):
        run = scene.inverse(t=held.times())
        axis.plot(run.time, run.driving_force / 1e3, label=run.actuator.values)
        axis.set(title=name, ylabel="driving forces [kN]")
        print(f"{name:26s} {run.driving_force.values.min() / 1e3:8.2f} to {run.driving_force.values.max() / 1e3:6.2f} kN")
    axes[0].legend(ncols=6, fontsize="small", loc="upper center")
    axes[0].set_ylim(-5, 45)
    axes[-1].set_xlabel("time [s]")
    figure.savefig(FOLDER / "compared.png", dpi=80)


if __name__ == "__main__":
    main()
