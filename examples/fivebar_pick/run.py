"""A pick-and-place robot under its controllers: how far the gripper is off its path, with what they know and how fast they are."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import linkdyn

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("results/fivebar_pick"))
folder = parser.parse_args().out
folder.mkdir(parents=True, exist_ok=True)
scene = linkdyn.load(Path(__file__).parent / "scene.toml")
time = scene.times()
wanted, _, _ = scene.motion(time)

both = lambda **keys: {f"controller.{arm}.{key}": value for arm in "AE" for key, value in keys.items()}  # noqa: E731
cases = {
    "PD": both(ki=None, feed_forward=None),
    "PID": both(feed_forward=None),
    "PD, gravity ahead": both(ki=None, feed_forward="gravity"),
    "PID, inverse dynamics ahead": {},
    "the same, delay of 4 samples": both(delay_samples=4),
    "the same, 250 Hz": both(rate="250 Hz"),
    "the same, gears without losses": {f"actuator.{arm}.drive.efficiency": 1.0 for arm in "AE"},
    "the same, continuous": both(rate=None, delay_samples=None, resolution=None),
    "continuous, gears without losses": both(rate=None, delay_samples=None, resolution=None) | {f"actuator.{arm}.drive.efficiency": 1.0 for arm in "AE"},
}
runs = {}
print("                                  off the path [mm]     torque [N m]")
print("                                   largest   at rest   largest")
for name, change in cases.items():
    runs[name] = run = scene.with_(change).forward(t=time, method="gbs", want="controller,motor,driving_force", rtol=1e-8, atol=1e-10)
    off = 1e3 * np.hypot(*(run.q.values - wanted).T)
    at_rest = off[(time > 0.36) & (time < 0.38)].max()
    print(f"{name:33s}{off.max():9.3f}{at_rest:10.3f}{np.abs(run.motor_torque.values).max():10.2f}")
    assert run.attrs["stopped"] == "" and not run.controller_limited.any()

BLUE, RED, GREY = "#2166AC", "#B2182B", "0.45"
figure, axes = plt.subplots(1, 3, figsize=(11.0, 3.2), layout="constrained", width_ratios=(1.5, 1, 1))
shown = (("PD", RED), ("PID, inverse dynamics ahead", BLUE))
axes[0].plot(*(1e3 * wanted).T, color=GREY, linewidth=3, alpha=0.5)
for name, colour in shown:
    axes[0].plot(*(1e3 * runs[name].q.values).T, color=colour, linewidth=1)
    off = 1e3 * np.hypot(*(runs[name].q.values - wanted).T)
    axes[1].semilogy(time, np.maximum(off, 1e-3), color=colour)
    axes[1].annotate(name.replace(", ", ",\n"), (0.3, 13) if name == "PD" else (0.08, 0.0035), color=colour, fontsize=9)
axes[0].set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
axes[0].annotate("gripper", (0, -402), xytext=(0, 8), textcoords="offset points", color=GREY, ha="center", fontsize=9)
axes[1].set(xlabel="time [s]", ylabel="off the path [mm]", ylim=(1e-3, 30))
run = runs["PID, inverse dynamics ahead"]
near = (time >= 0.100) & (time <= 0.130)
axes[2].plot(1e3 * time[near], run.controller_output.values[near, 1], color=BLUE, drawstyle="steps-post")
axes[2].plot(1e3 * time[near], runs["the same, continuous"].controller_output.values[near, 1], color=GREY)
axes[2].annotate("sampled", (1e3 * time[near][5], run.controller_output.values[near, 1][5]), xytext=(30, 8), textcoords="offset points", color=BLUE, fontsize=9, ha="center")
axes[2].annotate("continuous", (1e3 * time[near][20], runs["the same, continuous"].controller_output.values[near, 1][20]), xytext=(-34, -22), textcoords="offset points", color=GREY, fontsize=9, ha="center")
axes[2].set(xlabel="time [ms]", ylabel="output of E [N m]")
for axis in axes:
    axis.spines[["top", "right"]].set_visible(False)
figure.savefig(folder / "controllers.png", dpi=90)
