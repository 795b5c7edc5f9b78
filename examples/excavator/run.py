"""An excavator's arm over one cycle: cylinders, pins, and how hard its teeth can break out the ground."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import linkdyn

PINS = {"A": (110, 240), "E": (90, 200), "K": (80, 220), "H": (80, 200), "N": (80, 220), "lift.R1": (90, 200), "crowd.R1": (90, 110), "curl.R1": (80, 100)}
"""Diameter and bearing width [mm]."""
CYLINDERS = {"lift.P": "#2166AC", "crowd.P": "#B35806", "curl.P": "#1B7837"}

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("results/excavator"))
folder = parser.parse_args().out
folder.mkdir(parents=True, exist_ok=True)
scene = linkdyn.load(Path(__file__).parent / "scene.toml")
run = scene.inverse(want="all")
assert (run.status == 0).all()

print("cylinder   push [kN]  pull [kN]  pressure [bar]  stroke [m]     flow [litre/min]")
pressures = {}
for name in CYLINDERS:
    force = run.driving_force.sel(actuator=name).values / 1e3
    found = run.linkdyn.cylinder(name)
    pressures[name] = np.maximum(found.head_pressure, found.rod_pressure).values / 1e5
    slide = run.joint_variable.sel(variable=f"{name}.slide").values
    print(f"{name[:-2]:10s}{max(force.max(), 0):10.0f}{-min(force.min(), 0):11.0f}{pressures[name].max():16.0f}"
          f"{slide.min():11.2f} to {slide.max():.2f}{6e4 * float(found.peak_flow):14.0f}")

print("\npin        d x b [mm]  largest [kN]  at t [s]  rms [kN]  pressure [N/mm2]")
forces = {}
for name, (diameter, width) in PINS.items():
    forces[name] = np.hypot(*run.reaction.sel(joint=name).values.T[:2]) / 1e3
    pressure = float(run.linkdyn.plain_bearing(name, diameter=1e-3 * diameter, width=1e-3 * width).peak_pressure) / 1e6
    at = int(forces[name].argmax())
    print(f"{name:10s}{diameter:5d} x {width}{forces[name][at]:14.0f}{float(run.time[at]):10.2f}{np.sqrt(np.mean(forces[name] ** 2)):10.0f}{pressure:18.0f}")

# the teeth push across the bucket, arm held, cylinders one by one at the supply's pressure: forces are linear in the load
bucket = np.radians(np.linspace(-15.0, -115.0, 101))
poses = np.column_stack([np.full_like(bucket, np.radians(1.0)), np.full_like(bucket, np.radians(-80.0)), bucket])
across = poses.sum(axis=1)
one_newton = np.column_stack([-np.sin(across), np.cos(across), np.zeros_like(across)])
empty = scene.inverse(poses, t=0.0).driving_force.values
each = scene.inverse(poses, wrench={"bucket.teeth": one_newton}, t=0.0).driving_force.values - empty
limits = [cylinder["supply"] * np.array([cylinder["head_area"], cylinder["rod_area"]]) for cylinder in scene.description["cylinders"]]
possible = {name: (np.where(each[:, k] > 0, limits[k][0], -limits[k][1]) - empty[:, k]) / each[:, k] / 1e3 for k, name in enumerate(CYLINDERS)}
least = np.min(list(possible.values()), axis=0)
best = int(least.argmax())
print(f"\nat the teeth, arm in front of the machine: {possible['curl.P'].max():.0f} kN by the bucket cylinder alone;"
      f" {least[best]:.0f} kN with the bucket at {np.degrees(bucket[best]):.0f} deg until the first of all three gives way")

figure, axes = plt.subplots(1, 3, figsize=(11.5, 3.6), layout="constrained", width_ratios=(1.3, 1, 0.9))
for name, colour in CYLINDERS.items():
    axes[0].plot(run.time, pressures[name], color=colour, linewidth=1.2)
    beside = {"lift.P": (1.25, 316), "crowd.P": (8.2, 35), "curl.P": (3.5, 290)}[name]
    axes[0].annotate(name[:-2], beside, color=colour, ha="right" if name == "lift.P" else "left")
    at = {"lift.P": 62, "crowd.P": 75, "curl.P": 90}[name]
    axes[1].annotate(name[:-2], (np.degrees(bucket[at]), possible[name][at]), xytext=(0, 6), textcoords="offset points", color=colour, ha="left" if name == "lift.P" else "right")
    axes[1].plot(np.degrees(bucket), possible[name], color=colour, linewidth=1.2)
axes[0].axhline(340.0, color="0.6", linewidth=0.8)
axes[0].annotate("supply", (16.0, 340.0), xytext=(0, 3), textcoords="offset points", color="0.4", ha="right")
axes[0].set(xlabel="time [s]", ylabel="pressure [bar]", ylim=(0, 380), xlim=(0, 16))
axes[1].set(xlabel="angle of the bucket [deg]", ylabel="force at the teeth [kN]", xlim=(-15, -115), ylim=(0, 400))
order = sorted(PINS, key=lambda name: forces[name].max())
axes[2].barh(order, [forces[name].max() for name in order], color="#92C5DE", height=0.65)
for row, name in enumerate(order):
    axes[2].annotate(f"{forces[name].max():.0f}", (forces[name].max(), row), xytext=(3, 0), textcoords="offset points", va="center", fontsize=9)
axes[2].set(xlabel="largest force of pins [kN]")
for axis in axes:
    axis.spines[["top", "right"]].set_visible(False)
figure.savefig(folder / "cycle.png", dpi=90)
