"""Which lead suits the ball screw of a toggle clamp: torque to accelerate, torque to clamp, speed."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import linkdyn

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("results/toggle_clamp"))
folder = parser.parse_args().out
folder.mkdir(parents=True, exist_ok=True)
scene = linkdyn.load(Path(__file__).parent / "scene.toml")

leads = np.array([10, 16, 20, 25, 32, 40, 50, 63])
rows = []
for lead in leads:
    run = scene.with_({"variables.lead": lead / 1000}).inverse()
    assert (run.status == 0).all()
    torque, time = run.motor_torque.values[:, 0], run.time.values
    clamping = (time > 0.8) & (time < 1.6)
    motor = run.linkdyn.motor("nut")
    rows.append([np.abs(torque[~clamping]).max(), np.abs(torque[clamping]).max(), float(motor.rms_torque), float(motor.peak_speed) * 30 / np.pi])
moving, pressing, rms, speed = np.array(rows).T
print("lead [mm]   moving   clamping   rms [N m]   speed [rpm]")
for values in zip(leads, moving, pressing, rms, speed):
    print("{:9d} {:8.1f} {:10.1f} {:11.1f} {:13.0f}".format(*values))

figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.4), layout="constrained")
for values, name, colour in ((moving, "moving", "#2166AC"), (pressing, "clamping", "#B2182B")):
    axes[0].plot(leads, values, marker="o", color=colour)
    axes[0].annotate(name, (leads[-1], values[-1]), xytext=(6, 0), textcoords="offset points", color=colour, va="center")
axes[0].set(xlabel="lead [mm]", ylabel="largest motor torque [N m]", ylim=(0, None), xlim=(0, 78))
run = scene.inverse()
rotor = (run.driving_force - run.transmission_force.values)[:, 0]
for values, name, colour, at, shift in ((run.transmission_force[:, 0], "links", "#2166AC", 62, (8, 4)), (rotor, "rotor", "#E08214", 24, (4, -22))):
    axes[1].plot(run.time[:161], values[:161], color=colour)
    axes[1].annotate(name, (float(run.time[at]), float(values[at])), xytext=shift, textcoords="offset points", color=colour)
axes[1].set(xlabel="time [s]", ylabel="force at the nut [N]")
for axis in axes:
    axis.spines[["top", "right"]].set_visible(False)
figure.savefig(folder / "lead.png", dpi=90)
