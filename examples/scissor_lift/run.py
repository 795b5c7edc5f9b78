"""A scissor lift: where its cylinder should stand, and what a payload off the middle does to hinges and rollers."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import linkdyn

BUILT = 0.18                                     # what a cylinder is longer, drawn in, than its stroke [m]
FEET = np.linspace(0.05, 0.95, 19)               # from the fixed hinge [m]
SEATS = np.linspace(0.3, 0.8, 21)                # parts of the arm, from the lower roller
BLUE, RED, GREY = "#2166AC", "#B2182B", "0.45"

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("results/scissor_lift"))
folder = parser.parse_args().out
folder.mkdir(parents=True, exist_ok=True)
scene = linkdyn.load(Path(__file__).parent / "scene.toml")


def lift(**variables: float | str) -> linkdyn.Scene:
    return scene.with_({f"variables.{name}": value for name, value in variables.items()})


def cylinder_of(foot: float, seat: float) -> tuple[np.ndarray, np.ndarray]:
    """Force [kN] and length [m] along the way up."""
    run = lift(foot=f"{foot} m", seat=seat).inverse(want="driving_force,joint_variable")
    assert (run.status == 0).all()
    return run.driving_force.values[:, 0] / 1e3, run.joint_variable.sel(variable="ram.P.slide").values


run = scene.inverse(want="all")
height = run.linkdyn.marker("platform.H").position.values[:, 1]
print("foot [m]  seat     force [kN]         length [m]     short by [mm]   bore at 160 bar [mm]")
courses = {}
for foot, seat in ((0.25, 0.62), (0.4, 0.62), (0.6, 0.62), (0.25, 0.52)):
    courses[foot, seat] = force, length = cylinder_of(foot, seat)
    short = length.max() - length.min() + BUILT - length.min()
    bore = np.sqrt(np.abs(force).max() * 1e3 / 160e5 * 4 / np.pi)
    print(f"{foot:6.2f}{seat:8.2f}{force.min():9.1f} to {force.max():5.1f}{length.min():10.2f} to {length.max():.2f}{1e3 * max(short, 0):14.0f}{1e3 * bore:19.0f}")

print("\npayload at      A      M      B      H      T   of the arms, the largest [kN]")
for place in (0.1, 0.5, 0.9):
    reaction = lift(place=place).inverse(want="reaction").reaction
    largest = [np.hypot(*reaction.sel(joint=name).values.T[:2]).max() / 1e3 for name in "AMBHT"]
    print(f"{2 * place:8.1f} m" + "".join(f"{value:7.1f}" for value in largest))

peaks, shorts = np.empty((len(SEATS), len(FEET))), np.empty((len(SEATS), len(FEET)))
for i, seat in enumerate(SEATS):
    for k, foot in enumerate(FEET):
        force, length = cylinder_of(foot, seat)
        peaks[i, k], shorts[i, k] = np.abs(force).max(), length.max() + BUILT - 2 * length.min()

fits = np.where(shorts <= 0, peaks, np.inf)
i, k = np.unravel_index(fits.argmin(), fits.shape)
print(f"\nleast force of a cylinder that fits: {fits[i, k]:.1f} kN, foot {FEET[k]:.2f} m, seat {SEATS[i]:.3f}")

figure, axes = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
for (foot, seat), colour in zip(courses, (BLUE, "0.3", RED, "#B35806")):
    force = courses[foot, seat][0]
    axes[0].plot(height, force, color=colour)
    axes[0].annotate(f"foot {foot:g} m, seat {seat:g}", (height[60], force[60]), xytext=(0, 4), textcoords="offset points", color=colour, fontsize=9)
axes[0].set(xlabel="height of the platform [m]", ylabel="force of the cylinder [kN]", ylim=(0, None))
levels = axes[1].contour(FEET, SEATS, peaks, [30, 35, 40, 50, 70, 100], colors="#4393C3", linewidths=1)
axes[1].clabel(levels, fmt="%g kN", fontsize=8)
axes[1].contourf(FEET, SEATS, shorts, [0, 10], colors="0.85", alpha=0.8)
axes[1].annotate("drawn in it would be\nshorter than built", (0.93, 0.73), ha="right", color=GREY)
axes[1].plot(*next(iter(courses)), "o", color=BLUE)
axes[1].set(xlabel="foot from the fixed hinge [m]", ylabel="seat on the arm, as a part of it")
for axis in axes:
    axis.spines[["top", "right"]].set_visible(False)
figure.savefig(folder / "cylinder.png", dpi=90)
