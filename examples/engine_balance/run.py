"""A counterweight for the crank, what loads the crank pin, its bearing's life, the flywheel."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import numpy as np

import linkdyn

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("results/engine_balance"))
folder = parser.parse_args().out
folder.mkdir(parents=True, exist_ok=True)
scene = linkdyn.load(Path(__file__).parent / "scene.toml")

found = scene.balance(["crank"], "harmonics", [1])
print(found.counterweights.to_string(), end="\n\n")
print(found.figures.round(1).to_string(), end="\n\n")
found.plot().savefig(folder / "balance.png", dpi=80)

balanced = found.with_counterweights({"crank": 0.06})
run = balanced.inverse()
causes = run.linkdyn.contributions(scene=balanced).reaction.sel(joint="B", component="Fx")
worst = int(np.abs(run.reaction.sel(joint="B", component="Fx").values).argmax())
print(f"Fx in the crank pin at {360 * run.time.values[worst] / 0.01:.0f} deg: " +
      ", ".join(f"{name} {float(value) / 1e3:.2f} kN" for name, value in zip(causes.cause.values, causes.isel(sample=worst))))
size = np.linalg.norm(run.reaction.sel(joint="B", component=["Fx", "Fy"]), axis=1)
life = run.linkdyn.bearing_life("B", scene=balanced, capacity=45e3, exponent=10 / 3)
wheel = run.linkdyn.flywheel(0.02)
print(f"crank pin: {size.max() / 1e3:.2f} kN, equivalent load {float(life.equivalent_load) / 1e3:.2f} kN, life {float(life.life_hours):.0f} h")
print(f"crankshaft: {-float(wheel.mean_torque):.1f} N m in the mean, flywheel {float(wheel.inertia):.4f} kg m^2 for 2 %")
