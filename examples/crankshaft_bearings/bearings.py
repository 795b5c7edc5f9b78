"""Draws bearings.png: what the three main bearings carry, round the clock, and how that hangs on the middle one's place."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import linkdyn

FOLDER = Path(__file__).resolve().parent
MAIN = ["A", "B", "C"]
WIDTHS = [3.5, 1.8, 1.2]
"""Of lines: those of the outer bearings nearly coincide."""


def loads(scene: linkdyn.Scene, out_of_line: float) -> np.ndarray:
    """(N, 3, 2) forces across the shaft on its journals, x and z [N]."""
    run = scene.with_({"variables.out_of_line": out_of_line}).inverse(want="reaction")
    return run.reaction.sel(joint=MAIN, component=["Fx", "Fz"]).values


def main() -> None:
    scene = linkdyn.load(FOLDER / "scene.toml")
    places = np.linspace(-0.06e-3, 0.06e-3, 13)
    peaks = np.array([np.linalg.norm(loads(scene, place), axis=2).max(axis=0) for place in places])
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 4.4), layout="constrained")
    for k, name in enumerate(MAIN):
        for place, style in ((0.0, ":"), (0.02e-3, "-")):
            force = loads(scene, place)[:, k] / 1e3
            left.plot(force[:, 0], force[:, 1], style, color=f"C{k}", linewidth=WIDTHS[k], label=name if style == "-" else None)
        right.plot(1e3 * places, peaks[:, k] / 1e3, color=f"C{k}", linewidth=WIDTHS[k], label=name)
    left.set(xlabel="across [kN]", ylabel="up [kN]", title="force on the journals; dotted: bearings in line")
    left.set_aspect("equal", adjustable="datalim")
    right.set(xlabel="middle bearing too low by [mm]", ylabel="largest load [kN]", ylim=(0, None))
    for axes in (left, right):
        axes.legend(frameon=False)
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(FOLDER / "bearings.png", dpi=80)
    stiffness = (loads(scene, 0.01e-3) - loads(scene, 0.0))[:, 1, 1] / 0.01e-3
    print(f"a middle bearing 0.01 mm lower carries {-0.01e-3 * stiffness.mean():.0f} N less ({stiffness.min() / 1e6:.2f} to {stiffness.max() / 1e6:.2f} N/um)")
    for place in (0.0, 0.02e-3):
        largest = ", ".join(f"{name} {value:.0f} N" for name, value in zip(MAIN, np.linalg.norm(loads(scene, place), axis=2).max(axis=0)))
        print(f"{1e3 * place:.2f} mm too low: at most {largest}")


if __name__ == "__main__":
    main()
