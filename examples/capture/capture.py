#!/usr/bin/env python3
"""How all turn while a satellite is captured, what the hold and the brakes take, and momentum by hand: capture.png."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import linkdyn

FOLDER = Path(__file__).resolve().parent
COLOURS = {"servicer": "tab:blue", "upper arm": "tab:green", "forearm": "tab:olive", "client": "tab:red"}


def main() -> None:
    scene = linkdyn.load(FOLDER / "scene.toml")
    run = scene.forward()
    t = run.time.values
    rate = dict(zip(run.coordinate.values, run.qd.values.T))
    base = rate["servicer.yaw"]
    turning = {"servicer": base, "upper arm": base + rate["shoulder"], "forearm": base + rate["shoulder"] + rate["elbow"], "client": rate["client.yaw"]}
    upper, lower = plt.subplots(2, 1, figsize=(7.5, 5.8), sharex=True, layout="constrained")[1]
    for name, values in turning.items():
        upper.plot(t, values, color=COLOURS[name])
    for name, colour, x, y in (
        ("client", "tab:red", 1.05, 0.46), ("servicer and arm", "0.3", 1.05, 0.02), ("client and forearm", "tab:red", 1.9, 0.16),
        ("upper arm", "tab:green", 1.53, 0.11), ("servicer", "tab:blue", 2.0, -0.08), ("all", "0.3", 2.8, 0.09),
    ):  # fmt: skip
        upper.text(x, y, name, color=colour)
    upper.set_ylabel("turning [rad/s]")
    for part, colour in (("shoulder_brake", "tab:blue"), ("elbow_brake", "tab:green"), ("grasp.about_z", "tab:red")):
        lower.plot(t, run.clutch_force.sel(clutch=part), color=colour, label=part)
    lower.set_ylabel("moment [N m]")
    lower.set_xlabel("time [s]")
    lower.legend(loc="lower right", frameon=False)
    lower.set_xlim(1, 3.5)
    for axes in (upper, lower):
        for instant in np.unique(run.event_time.values):
            axes.axvline(instant, color="0.8", linewidth=0.8, zorder=0)
    plt.savefig(FOLDER / "capture.png", dpi=90)
    before, behind = momentum(scene, run, 0), momentum(scene, run, -1)
    print(f"turning at the end {rate['client.yaw'][-1]:.6f} rad/s; momentum {before} before, {behind} behind")


def momentum(scene: linkdyn.Scene, run, k: int) -> np.ndarray:
    """Linear [kg m/s] and angular momentum about the origin [kg m2/s], link by link."""
    here = dict(zip(run.coordinate.values, run.qd.values[k]))
    q = dict(zip(run.coordinate.values, run.q.values[k]))

    def along(angle: float, length: float) -> np.ndarray:
        return length * np.array([np.cos(angle), np.sin(angle)])

    def carried(omega: float, arm: np.ndarray) -> np.ndarray:
        return omega * np.array([-arm[1], arm[0]])

    angle = q["servicer.yaw"] + np.cumsum([0, q["shoulder"], q["elbow"]])
    omega = here["servicer.yaw"] + np.cumsum([0, here["shoulder"], here["elbow"]])
    middle, speed = np.array([q["servicer.x"], q["servicer.y"]]), np.array([here["servicer.x"], here["servicer.y"]])
    shoulder, elbow = along(angle[0], 0.6), along(angle[1], 0.8)
    bodies = [
        (400, 90, middle, speed, omega[0]),
        (12, 0.8, middle + shoulder + along(angle[1], 0.35), speed + carried(omega[0], shoulder) + carried(omega[1], along(angle[1], 0.35)), omega[1]),
        (9, 0.5, middle + shoulder + elbow + along(angle[2], 0.3),
         speed + carried(omega[0], shoulder) + carried(omega[1], elbow) + carried(omega[2], along(angle[2], 0.3)), omega[2]),
        (250, 70, np.array([q["client.x"], q["client.y"]]), np.array([here["client.x"], here["client.y"]]), here["client.yaw"]),
    ]  # fmt: skip
    linear = sum(m * v for m, _, _, v, _ in bodies)
    return np.array([*linear, sum(m * (c[0] * v[1] - c[1] * v[0]) + i * w for m, i, c, v, w in bodies)])


if __name__ == "__main__":
    main()
