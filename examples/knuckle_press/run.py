"""What friction in its pins costs a knuckle-joint press: efficiency and driving torque against the coefficient."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import linkdyn

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("results/knuckle_press"))
folder = parser.parse_args().out
folder.mkdir(parents=True, exist_ok=True)
scene = linkdyn.load(Path(__file__).parent / "scene.toml")

coefficients = np.array([0.0, 0.02, 0.05, 0.08, 0.1, 0.12, 0.15])
efficiency, torque, lost = [], [], []
for mu in coefficients:
    run = scene.with_({"variables.mu": mu}).inverse()
    assert (run.status == 0).all()
    put_in = float(run.driving_power.sum("actuator").integrate("time"))
    lost.append(run.friction_power.integrate("time").values)
    efficiency.append(1 - lost[-1].sum() / put_in)
    torque.append(float(np.abs(run.driving_force).max()))
print("  mu   efficiency   peak torque [kN m]")
for mu, part, peak in zip(coefficients, efficiency, torque):
    print(f"{mu:5.2f} {100 * part:9.1f} % {peak / 1e3:14.2f}")
run = scene.inverse()
order = np.argsort(lost[4])[::-1]
print("\nof one stroke at mu = 0.1, J: " + ", ".join(f"{run.joint.values[k]} {lost[4][k]:.0f}" for k in order))

figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
axes[0].plot(coefficients, 100 * np.array(efficiency), marker="o", color="#2166AC")
axes[0].set(xlabel="coefficient of friction", ylabel="efficiency [%]", ylim=(0, 105), xlim=(0, None))
for mu, colour in ((0.0, "#4D4D4D"), (0.05, "#4393C3"), (0.1, "#B2182B")):
    run = scene.with_({"variables.mu": mu}).inverse(want="driving_force")
    axes[1].plot(run.time, run.driving_force[:, 0] / 1e3, color=colour)
    at = int(np.abs(run.driving_force.values[:, 0]).argmax())
    axes[1].annotate(f"mu = {mu:g}", (float(run.time[at]), float(run.driving_force[at, 0]) / 1e3), xytext=(-10, 0),
                     textcoords="offset points", color=colour, va="center", ha="right")
axes[1].set(xlabel="time [s]", ylabel="torque of the crank [kN m]")
for axis in axes:
    axis.spines[["top", "right"]].set_visible(False)
figure.savefig(folder / "efficiency.png", dpi=90)
