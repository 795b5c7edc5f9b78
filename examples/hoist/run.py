"""A hoist under its motor: what the motor gives beside what it has, and what holds the platform when it is off."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import linkdyn

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("results/hoist"))
folder = parser.parse_args().out
folder.mkdir(parents=True, exist_ok=True)
scene = linkdyn.load(Path(__file__).parent / "scene.toml")
run = scene.forward(want="all")
assert (run.status == 0).all()
time = run.time.values
speed, torque, current, brake = (run[name].values[:, 0] for name in ("motor_speed", "motor_torque", "motor_current", "brake_torque"))
height = run.q.values[:, 0]
print(f"highest current {current.max():.0f} A, at full speed {current[200]:.1f} A, {speed.max() * 30 / np.pi:.0f} rpm")
print(f"stops at {height[-1]:.3f} m, {float(run.event_time[0]):.2f} s")

print("\nmotor off at 3 m                         after 1 s")
still = {"coordinate.rail.start": {"position": 3.0}, "actuator.drum.law": {"type": "constant", "value": 0.0, "at": "motor"}}
worm = {"efficiency": 0.45, "back_efficiency": -0.1}
cases = {
    "brake": {"actuator.drum.drive.brake": {"torque": 90.0}},
    "no brake": {"actuator.drum.drive.brake": {"torque": 90.0, "begins": "off"}},
    "no brake, worm gear of efficiency 0.45": {"actuator.drum.drive.brake": {"torque": 90.0, "begins": "off"}, **{f"actuator.drum.drive.{key}": value for key, value in worm.items()}},
}
for name, change in cases.items():
    left = scene.with_(still | change).forward(t=[0.0, 1.0], method="seulex")
    print(f"{name:40s} {1e3 * (left.q.values[-1, 0] - 3):8.1f} mm, {1e3 * left.qd.values[-1, 0]:8.2f} mm/s")

figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
BLUE, RED, GREY = "#2166AC", "#B2182B", "0.45"
rpm = speed * 30 / np.pi
grid = np.linspace(0, 2400, 241)
limit = np.minimum(96, np.interp(grid, [0, 1200, 2400], [110, 110, 55]))
axes[0].plot(grid, limit, color=RED)
axes[0].plot(rpm, torque, color=BLUE)
axes[0].annotate("80 A", (600, 96), xytext=(0, 4), textcoords="offset points", color=RED, ha="center")
axes[0].annotate("motor's curve", (2000, 74), xytext=(0, 6), textcoords="offset points", color=RED)
axes[0].annotate("start", (700, 96), xytext=(0, -12), textcoords="offset points", color=BLUE, ha="center")
axes[0].annotate("lifting", (rpm[200], torque[200]), xytext=(6, -3), textcoords="offset points", color=BLUE)
axes[0].annotate("slowing down", (900, float(torque[(time > 3.8) & (time < 4.6)].min())), xytext=(0, -12), textcoords="offset points", color=BLUE, ha="center")
axes[0].set(xlim=(0, 2500), xlabel="speed of the motor [rpm]", ylabel="torque [N m]")
for values, name, colour, place in ((current, "current [A]", BLUE, 1.0), (brake, "brake [N m]", RED, 6.4), (100 * run.qd.values[:, 0], "speed [cm/s]", GREY, 2.6)):
    axes[1].plot(time, values, color=colour)
    at = int(np.searchsorted(time, place))
    axes[1].annotate(name, (time[at], values[at]), xytext=(0, 5), textcoords="offset points", color=colour)
axes[1].set(xlabel="time [s]")
for axis in axes:
    axis.spines[["top", "right"]].set_visible(False)
    axis.axhline(0, color="0.8", linewidth=0.8, zorder=0)
figure.savefig(folder / "start.png", dpi=90)
