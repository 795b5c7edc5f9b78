#!/usr/bin/env python3
"""Hold the pole upright by a linear-quadratic regulator that samples at 100 Hz.

    python balance.py [--out FOLDER]

The linear model is found by stepping the mechanism itself: its answer to small departures over one sampling interval is the matrix of the
sampled system, with the force held in between. The regulator follows from the discrete Riccati equation.
"""
from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import linkdyn

EVERY = 0.01                                    # sampling interval [s]
STATE_WEIGHT = np.diag([20.0, 200.0, 1.0, 10.0])    # of x, angle and their rates
FORCE_WEIGHT = np.array([[0.1]])


def linearize(simulator: linkdyn.Simulator, small: float = 1e-5) -> tuple[np.ndarray, np.ndarray]:
    """A and B of x[k+1] = A x[k] + B u[k] about the upright pole at rest, by central differences."""
    columns = []
    for k in range(5):
        ends = []
        for sign in (1.0, -1.0):
            x = np.zeros(5)
            x[k] = sign * small
            simulator.reset(x[:2], x[2:4])
            simulator.step(EVERY, x[4:])
            ends.append(np.concatenate([simulator.q, simulator.qd]))
        columns.append((ends[0] - ends[1]) / (2.0 * small))
    answer = np.array(columns).T
    return answer[:, :4], answer[:, 4:]


def regulator(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Gain of the force -K x that costs least, by iterating the Riccati equation until it stands still."""
    p = STATE_WEIGHT
    for _ in range(100_000):
        gain = np.linalg.solve(FORCE_WEIGHT + b.T @ p @ b, b.T @ p @ a)
        further = STATE_WEIGHT + a.T @ p @ (a - b @ gain)
        if np.abs(further - p).max() < 1e-12 * np.abs(p).max():
            break
        p = further
    return gain


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/cart_pole"))
    out = parser.parse_args().out
    scene = linkdyn.load(Path(__file__).with_name("scene.toml"))
    simulator = scene.simulator()
    gain = regulator(*linearize(simulator))
    simulator.reset()
    run = simulator.run(lambda s: -gain @ np.concatenate([s.q, s.qd]), t_end=4.0, every=EVERY)
    print("gains      " + "  ".join(f"{value:.3f}" for value in gain[0]))
    print(f"largest    {np.abs(run.driving_force).max().item():.2f} N, {1e3 * np.abs(run.q.sel(coordinate='rail')).max().item():.0f} mm along the rail")
    print(f"at the end {1e3 * run.q.values[-1, 0]:.1f} mm, {np.degrees(run.q.values[-1, 1]):.2f} deg")
    draw(run, out)


def draw(run, out: Path) -> None:
    """Angle, place and force over time."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(3, 1, figsize=(7.2, 5.4), sharex=True, layout="constrained")
    axes[0].plot(run.time, np.degrees(run.q.sel(coordinate="pin")), linewidth=1.2)
    axes[1].plot(run.time, run.q.sel(coordinate="rail"), linewidth=1.2)
    axes[2].step(run.time, run.driving_force[:, 0], where="post", linewidth=1.2)
    for axis, label in zip(axes, ("angle [deg]", "place [m]", "force [N]")):
        axis.set_ylabel(label)
        axis.grid(alpha=0.25)
        axis.spines[["top", "right"]].set_visible(False)
    axes[-1].set(xlabel="time [s]", xlim=(0.0, float(run.time[-1])))
    figure.align_ylabels()
    figure.suptitle("Pole on a cart, balanced at 100 Hz", fontsize=11)
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "balance.png", dpi=90)


if __name__ == "__main__":
    main()
