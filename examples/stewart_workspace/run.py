#!/usr/bin/env python3
"""Size the legs of the drilling table over its workspace, then ask which platform would need weaker ones.

    python run.py [--out DIR] [--full] [--threads N]

writes workspace.nc (extremes), sheet.html and sheet.pdf (the sizing sheet), pictures of the workspace, of the legs' work against a
motor and screw, and of the design study into DIR, and prints what to buy. Without --full every axis is taken with fewer values:
130 thousand samples instead of 11 million.
"""
from __future__ import annotations

import argparse
import copy
import math
import tomllib
from pathlib import Path

import matplotlib

matplotlib.use("Agg")   # pictures go to files
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import linkdyn
import linkdyn.plot
from linkdyn import Scene

FOLDER = Path(__file__).resolve().parent

# ---- values of each coordinate in smaller sweeps
QUICK = {"x": 5, "y": 5, "z": 5, "roll": 5, "pitch": 5, "yaw": 3}
KEPT = {"x": 7, "y": 7, "z": 5, "roll": 5, "pitch": 5, "yaw": 1}        # whose samples are kept, for force over speed
STUDY = {"x": 5, "y": 5, "z": 3, "roll": 3, "pitch": 3, "yaw": 1}       # of each design

# ---- the drive in mind: servo motor on a ball screw
LEAD, EFFICIENCY = 0.020, 0.9                                   # m per turn; screw and belt together
MOTOR_PEAK = [(0.0, 38.0), (190.0, 38.0), (290.0, 22.0)]        # rad/s, N m
MOTOR_CONTINUOUS = [(0.0, 16.0), (190.0, 14.0), (290.0, 9.0)]

# ---- designs: where the pairs of platform joints lie. Beside each joint, the direction away from the platform's middle and
# the direction away from its neighbour in the pair.
PAIRS = {60: ("P1", "P2"), 180: ("P3", "P4"), 300: ("P5", "P6")}        # deg
RADIUS = ["-0.25 m", "0.35 m", 9]       # added to the distance of a pair from the middle, 1.08 m
SPACING = ["-0.12 m", "0.28 m", 6]      # added to half the distance of its joints, 0.23 m


def thinned(sweep: dict, numbers: dict[str, int]) -> dict:
    """The sweep with so many values of each coordinate; one value: the middle."""
    table = copy.deepcopy(sweep)
    for axis in table["axis"]:
        name = axis.get("coordinate", "").removeprefix("platform.")
        if name in numbers:
            axis["linspace"][2] = numbers[name]
            if numbers[name] == 1:
                del axis["linspace"]
                axis["values"] = [0]
    return table


def design_axes() -> list[dict]:
    """Two axes over the platform's joints: pairs further out, and joints of a pair further apart."""
    paths, outward, apart = [], [], []
    for degrees, pair in PAIRS.items():
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        for joint, side in zip(pair, (-1, 1)):
            paths += [f"link.platform.markers.{joint}[0]", f"link.platform.markers.{joint}[1]"]
            outward += [c, s]
            apart += [-side * s, side * c]
    both = {"parameter": paths, "as": "offset"}
    return [
        both | {"name": "pair radius + [m]", "weights": outward, "linspace": RADIUS},
        both | {"name": "half spacing + [m]", "weights": apart, "linspace": SPACING},
    ]


def design_study(scene: Scene, threads: int) -> xr.Dataset:
    """Peaks of every design over a coarse workspace."""
    table = thinned(tomllib.loads(scene.text)["sweep"], STUDY)
    table["axis"] = design_axes() + table["axis"]
    table["reduce"] = ["driving_force", "driving_position", "condition"]
    for key in ("limit", "histogram", "map"):
        del table[key]
    return scene.sweep(table, threads=threads)


def draw(out: Path, name: str, figure: plt.Figure) -> None:
    figure.savefig(out / name, dpi=110, bbox_inches="tight")
    plt.close(figure)


def verdict(run: xr.Dataset) -> str:
    """What each leg must do, and what the drive in mind can."""
    push, pull = float(run.driving_force_max.max()), float(run.driving_force_min.min())
    low, high = float(run.driving_position_min.min()), float(run.driving_position_max.max())
    speed = float(np.maximum(abs(run.driving_speed_min), run.driving_speed_max).max())
    rms = float(run.driving_force_rms.max())
    turn = LEAD / (2 * math.pi)
    worst = str(run.actuator.values[int(np.argmax(run.driving_force_max.values))])
    thrust = [torque * EFFICIENCY / turn for _, torque in MOTOR_PEAK]
    return "\n".join([
        f"push               {push:8.0f} N    {worst}",
        f"pull               {pull:8.0f} N",
        f"rms over the cases {rms:8.0f} N",
        f"stroke             {1e3 * (high - low):8.0f} mm   from {1e3 * low:.0f} to {1e3 * high:.0f} mm",
        f"speed              {speed:8.3f} m/s",
        f"power              {float(run.driving_power_max.max()):8.0f} W",
        f"motor              {push * turn / EFFICIENCY:8.1f} N m at {speed / turn * 30 / math.pi:.0f} rpm, screw lead {1e3 * LEAD:.0f} mm;"
        f" the one in mind gives {thrust[0]:.0f} N up to {MOTOR_PEAK[1][0] * turn:.2f} m/s",
        f"feasible           {100 * float(run.feasible_fraction):8.1f} %    " + ", ".join(
            f"{name} {100 * int(n) / int(run.samples):.1f} %"
            for name, n in zip(run.outcome.values[1:], run.outcome_count.values[1:]) if n),
    ])


def front_lines(study: xr.Dataset) -> str:
    """The designs that no other beats both in peak force and in workspace."""
    force = study.driving_force_max.max("actuator").values
    volume = study.feasible_volume.values
    lines = ["design   pair radius   half spacing   peak push     workspace   condition"]
    for k in np.argsort(volume):
        if any((force <= force[k]) & (volume > volume[k])) or any((force < force[k]) & (volume >= volume[k])):
            continue
        radius, spacing = study.design_value.values[k]
        lines.append(f"{k:>6} {1e3 * (1.08 + radius):>10.0f} mm {1e3 * (0.23 + spacing):>11.0f} mm {force[k]:>9.0f} N "
                     f"{volume[k]:>10.4f} m3 {float(study.condition_max[k]):>11.2f}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description="Size the legs of the drilling table over its workspace.")
    parser.add_argument("--out", type=Path, default=Path("."), help="folder for results (default: this one)")
    parser.add_argument("--full", action="store_true", help="11 million samples")
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    out = options.out
    out.mkdir(parents=True, exist_ok=True)

    scene = linkdyn.load(FOLDER / "scene.toml")
    table = tomllib.loads(scene.text)["sweep"]
    run = scene.sweep(None if options.full else thinned(table, QUICK), threads=options.threads, progress=options.full)
    run.to_netcdf(out / "workspace.nc")
    samples = scene.sweep(thinned(table, KEPT), keep=["driving_force", "driving_speed"], threads=options.threads)
    study = design_study(scene, options.threads)

    limit, continuous = (linkdyn.plot.screw_limit(curve, LEAD, efficiency=EFFICIENCY) for curve in (MOTOR_PEAK, MOTOR_CONTINUOUS))
    draw(out, "force_slices.png", linkdyn.plot.workspace(run)[0])
    draw(out, "feasible.png", linkdyn.plot.workspace(run, "feasible", kind="3d")[0])
    draw(out, "force_map.png", linkdyn.plot.force_map(samples)[0])
    draw(out, "sizing.png", linkdyn.plot.sizing(samples, limit, continuous)[0])
    draw(out, "histogram.png", linkdyn.plot.histograms(run)[0])
    draw(out, "designs.png", linkdyn.plot.designs(study)[0])
    linkdyn.sheet(run, out / "sheet.html", scene=scene)
    linkdyn.sheet(run, out / "sheet.pdf", scene=scene)

    print(f"{int(run.samples)} samples\n")
    print(verdict(run))
    print(f"\n{study.sizes['design']} designs; on the front:\n")
    print(front_lines(study))
    print(f"\nresults, pictures and sizing sheet: {out}/workspace.nc, sheet.html, sheet.pdf, *.png")


if __name__ == "__main__":
    main()
