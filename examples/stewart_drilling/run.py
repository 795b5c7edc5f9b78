#!/usr/bin/env python3
"""Compute every force of the drilling worktable and say what its legs and joints must be built for.

    python run.py [--out DIR]

writes forces.nc (everything, netCDF), forces.png, reactions.png and scene.png into DIR, and prints a table.
"""
from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")   # pictures go to files
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import linkdyn
import linkdyn.plot

FOLDER = Path(__file__).resolve().parent


def leg_table(run: xr.Dataset) -> str:
    """What each actuator must do: push and pull with their instants, stroke, speed, power."""
    head = (f"{'actuator':<9} {'push':>7} {'at':>6}  {'pull':>7} {'at':>6}  {'rms':>7}  {'shortest':>8} {'longest':>8}  "
            f"{'speed':>6}  {'power':>6}\n"
            f"{'':<9} {'N':>7} {'s':>6}  {'N':>7} {'s':>6}  {'N':>7}  {'m':>8} {'m':>8}  {'m/s':>6}  {'W':>6}")
    lines = [head]
    for name in run.actuator.values:
        force = run.driving_force.sel(actuator=name)
        length = run.joint_variable.sel(variable=f"{name}.slide")
        push, pull = peak(force.values, run.time.values), peak(-force.values, run.time.values)
        speed = float(np.abs(run.driving_speed.sel(actuator=name)).max())
        power = float(np.abs(run.driving_power.sel(actuator=name)).max())
        rms = float(np.sqrt((force**2).mean()))
        lines.append(f"{name:<9} {push} {pull} {rms:>7.0f}  {float(length.min()):>8.3f} {float(length.max()):>8.3f}  "
                     f"{speed:>6.3f}  {power:>6.0f}")
    return "\n".join(lines)


def peak(force: np.ndarray, time: np.ndarray) -> str:
    """Largest positive value and its instant, dashes if there is none."""
    at = np.argmax(force)
    return f"{force[at]:>7.0f} {time[at]:>6.2f} " if force[at] > 0 else f"{'-':>7} {'-':>6} "


def reaction_lines(run: xr.Dataset) -> str:
    """The largest force and moment in each kind of joint, in which joint and when."""
    lines = []
    for kind, word in (("U", "universal"), ("P", "slide"), ("S", "spherical")):
        joints = [j for j in run.joint.values if str(j).endswith(f".{kind}")]
        part = run.reaction.sel(joint=joints)
        for what, components, unit in (("force", ["Fx", "Fy", "Fz"], "N"), ("moment", ["Mx", "My", "Mz"], "N m")):
            size = np.sqrt((part.sel(component=components) ** 2).sum("component"))
            size = size.transpose("sample", "joint").values
            sample, joint = np.unravel_index(np.argmax(size), size.shape)
            if size[sample, joint] > 0:
                lines.append(f"largest {what + ' in a ' + word + ' joint':<34} {size[sample, joint]:>7.4g} {unit:<3} "
                             f"{joints[joint]} at {float(run.time[sample]):.2f} s")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description="Forces of the drilling worktable.")
    parser.add_argument("--out", type=Path, default=Path("."), help="folder for results (default: this one)")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)

    scene = linkdyn.load(FOLDER / "scene.toml")
    run = scene.inverse()
    run.to_netcdf(out / "forces.nc")
    pictures = {"forces.png": lambda: linkdyn.plot.driving_forces(run),
                "reactions.png": lambda: linkdyn.plot.reactions(run),
                "scene.png": lambda: linkdyn.plot.scene3d(scene)}
    for name, draw in pictures.items():
        draw()
        plt.gcf().savefig(out / name, dpi=120, bbox_inches="tight")
        plt.close("all")

    print(f"{run.sizes['sample']} instants, {float(run.time[-1]):.0f} s\n")
    print(leg_table(run))
    print()
    print(reaction_lines(run))
    print(f"\npower balance closed to {float(np.abs(run.power_imbalance).max()):.1e} of the powers involved")
    print(f"results and pictures: {out}/forces.nc, {', '.join(pictures)}")


if __name__ == "__main__":
    main()
