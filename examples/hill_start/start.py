#!/usr/bin/env python3
"""Speeds, torques and the heat of the clutch while a car starts on a hill: start.png."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import linkdyn

FOLDER = Path(__file__).resolve().parent
RATIO = 14.0


def main() -> None:
    run = linkdyn.load(FOLDER / "scene.toml").forward()
    t = run.time.values
    engine, axle = run.qd.values.T
    clutch, brake = run.clutch_force.values.T
    power = -(run.clutch_force * run.clutch_slip).values[:, 0]
    heat = np.concatenate([[0], np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(t))])
    upper, middle, lower = plt.subplots(3, 1, figsize=(7.5, 7.2), sharex=True, layout="constrained")[1]
    upper.plot(t, engine, color="tab:blue")
    upper.plot(t, RATIO * axle, color="tab:orange")
    upper.text(0.3, 135, "engine", color="tab:blue")
    upper.text(1.5, 24, "axle × 14", color="tab:orange")
    upper.set_ylabel("speed [rad/s]")
    upper.set_ylim(0, 250)
    middle.plot(t, -RATIO * clutch, color="tab:red")
    middle.plot(t, brake, color="tab:purple")
    middle.text(0.35, 1250, "clutch, at the axle", color="tab:red")
    middle.text(0.0, 560, "handbrake", color="tab:purple")
    middle.set_ylabel("torque [N m]")
    lower.plot(t, heat / 1e3, color="tab:red")
    lower.set_ylabel("heat of the clutch [kJ]")
    lower.set_xlabel("time [s]")
    kinds = run.event_kind.attrs["flag_meanings"].split()
    for name, kind, instant in zip(run.event.values, run.event_kind.values, run.event_time.values):
        if kinds[kind] == "crossing":
            continue
        for axes in (upper, middle, lower):
            axes.axvline(instant, color="0.8", linewidth=0.8, zorder=0)
        upper.text(instant + 0.03, 228, f"{name}: {kinds[kind]}", fontsize=8, color="0.3")
    plt.savefig(FOLDER / "start.png", dpi=90)
    print(f"heat {heat[-1]:.1f} J, energy balance {(run.work[-1] - run.kinetic_energy[-1] + run.kinetic_energy[0]).item() - pull(run):.1f} J")


def pull(run) -> float:
    """Work against the slope [J]."""
    return 1150 * 9.81 * 0.3 * np.sin(np.radians(8)) * float(run.q[-1, 1] - run.q[0, 1])


if __name__ == "__main__":
    main()
