#!/usr/bin/env python3
"""The rocker's angle, its bounces, and where the energy goes: bounces.png."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import linkdyn

FOLDER = Path(__file__).resolve().parent
MARKS = {"impact": ("o", "tab:red"), "rest": ("s", "tab:purple"), "release": ("^", "tab:green"), "crossing": ("x", "black")}


def main() -> None:
    run = linkdyn.load(FOLDER / "scene.toml").forward(rtol=1e-10, atol=1e-10)
    kinds = np.array(run.event_kind.attrs["flag_meanings"].split())[run.event_kind.values]
    angle = np.degrees(run.joint_variable.sel(variable="D.angle"))
    upper, lower = plt.subplots(2, 1, figsize=(7.5, 5.6), sharex=True, layout="constrained")[1]
    upper.plot(run.time, angle, color="tab:blue")
    at = {"half_shut": 55.0, "bumper.min": 25.0}
    for kind, (mark, colour) in MARKS.items():
        chosen = kinds == kind
        upper.plot(run.event_time[chosen], [at[name] for name in run.event.values[chosen]], mark, color=colour, label=kind, markersize=5)
    upper.set_ylabel("angle of the rocker [deg]")
    upper.legend(loc="upper right", ncols=4, frameon=False)
    upper.set_ylim(18, 82)
    lost = np.cumsum(run.event_loss)
    energy = run.kinetic_energy + run.potential_energy
    lower.plot(run.time, energy - energy[0], color="tab:blue", label="energy of the links, since the start")
    lower.step(np.concatenate([[0], run.event_time, [run.time[-1]]]), -np.concatenate([[0], lost, [lost[-1]]]), where="post",
               color="tab:red", linestyle="--", label="lost in the impacts so far")
    lower.set_xlabel("time [s]")
    lower.set_ylabel("energy [J]")
    lower.legend(loc="lower left", frameon=False)
    plt.savefig(FOLDER / "bounces.png", dpi=90)


if __name__ == "__main__":
    main()
