"""A boom on its cylinder: pressures while the valve opens and shuts, and what shutting it more slowly saves."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import linkdyn

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("results/loader_crane"))
folder = parser.parse_args().out
folder.mkdir(parents=True, exist_ok=True)
scene = linkdyn.load(Path(__file__).parent / "scene.toml")
instants = np.linspace(0.0, 7.0, 1401)

print("valve shuts in   highest pressure   tip bounces by   load swings by")
runs = {}
for closing in (0.1, 0.4, 1.0):
    run = runs[closing] = scene.with_({"variables.closing": f"{closing} s"}).forward(t=instants)
    assert (run.status == 0).all()
    after = instants > 3.5 + closing
    boom, hook = run.q.values[after].T
    head, rod = run.cylinder_pressure.values[instants > 3.5, 0].T / 1e5
    print(f"{closing:11.1f} s {head.max():12.0f} bar {1e3 * 4.5 * np.ptp(boom):15.0f} mm {np.degrees(np.ptp(boom + hook)):13.1f} deg")

run = runs[0.1]
speed = run.joint_rate.sel(variable="ram.P.slide").values
lifting = (instants > 2.0) & (instants < 3.5)
head, rod = run.cylinder_pressure.values[:, 0].T
flow = 40e-3 / 60 * 0.5 * np.sqrt((190e5 - head) / 35e5)
print(f"\nlifting: rod at {1e3 * speed[lifting].mean():.1f} mm/s, by the orifice formula {1e3 * flow[lifting].mean() / (np.pi / 4 * 0.08**2):.1f} mm/s")

figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
BLUE, RED, GREY = "#2166AC", "#B2182B", "0.45"
axes[0].plot(instants, head / 1e5, color=BLUE)
axes[0].plot(instants, rod / 1e5, color=RED)
axes[0].annotate("head", (2.4, np.interp(2.4, instants, head) / 1e5), xytext=(0, 6), textcoords="offset points", color=BLUE)
axes[0].annotate("rod", (2.4, np.interp(2.4, instants, rod) / 1e5), xytext=(0, 6), textcoords="offset points", color=RED)
axes[0].set(xlabel="time [s]", ylabel="pressure [bar]", ylim=(0, None))
for closing, colour, height in ((1.0, GREY, 88), (0.1, BLUE, 150)):
    axes[1].plot(instants, 1e3 * runs[closing].joint_rate.sel(variable="ram.P.slide").values, color=colour, linewidth=1.1)
    axes[1].annotate(f"shut in {closing:g} s", (4.3, height), color=colour)
axes[1].set(xlabel="time [s]", ylabel="speed of the rod [mm/s]")
for axis in axes:
    axis.spines[["top", "right"]].set_visible(False)
    axis.axhline(0, color="0.8", linewidth=0.8, zorder=0)
figure.savefig(folder / "pressures.png", dpi=90)
