#!/usr/bin/env python3
"""Draw the pictures that the READMEs of the examples show: scene.png, forces.png, reactions.png, hodograph.png, polar.png and
motion.gif beside each scene, motion_NAME.gif of scene_NAME.toml. Other pictures are drawn by programs of the examples.

Scenes in which nothing is given a motion, and those named below, run forward; states.png and energies.png come with them,
and strobe.png for some.

    python examples/draw_pictures.py [EXAMPLE ...]
"""
from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")   # pictures go to files
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from PIL import Image

import linkdyn
import linkdyn.plot

FOLDER = Path(__file__).resolve().parent
COLOURS = 256   # a palette is enough, and a third of the size
FRAMES = 36     # of a moving picture: enough, and small files
FEWER = {"thread_guide": 24}                        # large faces that turn
PANELS = {"forces": linkdyn.plot.driving_forces, "reactions": linkdyn.plot.reactions, "hodograph": linkdyn.plot.hodograph, "polar": linkdyn.plot.polar}
# Run forward although a motion is given: of one coordinate, followed by controllers, or to be found again.
FORWARD = {"double_wishbone", "fivebar_pick", "fourbar_start", "rcsp_start"}
# A second scene of the folder, which runs forward.
BESIDE = {"andrews": "scene_forward.toml", "four_stroke": "scene.toml", "slider_crank": "scene_forward.toml"}
STROBES = {                                         # instants of the stroboscopic picture: first, last, how many
    "andrews": (0.0, 0.03, 40),
    "fivebar_motors": (0.0, 0.6, 31),
    "fourbar_constant_torque": (2.0, 4.6, 27),
    "fourbar_start": (0.0, 6.2, 32),
    "n_fourbar": (0.0, 0.97, 24),
}


def save(file: Path) -> None:
    plt.gcf().savefig(file, dpi=80, bbox_inches="tight")
    plt.close("all")
    Image.open(file).convert("RGB").quantize(COLOURS).save(file, optimize=True)


def strobe(scene: linkdyn.Scene, instants: np.ndarray) -> None:
    """A planar mechanism at many instants of its forward run, the later the brighter."""
    start = scene.times()[0]
    grid = instants if instants[0] == start else np.concatenate([[start], instants])
    q = scene.forward(t=grid, want="driving_force").q.values[-len(instants):]
    poses = scene.poses(q, in_order=True)
    jointed = {(link, marker) for joint in scene.description["joints"] for link, marker in zip(joint["links"], joint["markers"])}
    figure, axis = plt.subplots(figsize=(8.0, 5.5), layout="constrained")
    colours = plt.get_cmap("plasma")(np.linspace(0.0, 0.92, len(instants)))
    for position, rotation, colour in zip(poses.position, poses.rotation, colours):
        for k, link in enumerate(scene.description["links"][1:]):
            points = np.array([marker["at"] for marker in link["markers"] if (k + 1, marker["name"]) in jointed])
            outline = position[k] + points[[*range(len(points)), 0]] @ rotation[k].T
            axis.plot(*outline.T[:2], color=colour, linewidth=1.2, alpha=0.75, solid_capstyle="round")
    fixed = np.array([marker["at"] for marker in scene.description["links"][0]["markers"] if (0, marker["name"]) in jointed])
    axis.plot(*fixed.T[:2], "^", color="0.2", markersize=9)
    axis.set(xlabel="x [m]", ylabel="y [m]", title=scene.title, aspect="equal")
    axis.spines[["top", "right"]].set_visible(False)
    scale = plt.cm.ScalarMappable(plt.Normalize(instants[0], instants[-1]), plt.matplotlib.colors.ListedColormap(colours))
    figure.colorbar(scale, ax=axis, label="time [s]", shrink=0.7)


def draw_forward(folder: Path, scene: linkdyn.Scene, run: xr.Dataset, readme: str) -> None:
    for name, panels in {"states": linkdyn.plot.motion, "energies": linkdyn.plot.energies}.items():
        if f"({name}.png)" in readme:
            panels(run)
            save(folder / f"{name}.png")
    if folder.name in STROBES:
        first, last, n = STROBES[folder.name]
        strobe(scene, np.linspace(first, last, n))
        save(folder / "strobe.png")


def draw(folder: Path) -> None:
    """What the README shows of a scene and of those beside it."""
    readme = (folder / "README.md").read_text(encoding="utf-8")
    scene = linkdyn.load(folder / "scene.toml")
    if "(scene.png)" in readme:
        linkdyn.plot.mechanism(scene)
        save(folder / "scene.png")
    if len(scene.times()) < 2:      # poses of a sweep
        return
    goes_forward = folder.name in FORWARD or not any(np.ptp(values) > 0 for values in scene.motion()[0].T)
    run = scene.forward() if goes_forward else scene.inverse()
    for name, panels in PANELS.items():
        if f"({name}.png)" in readme:
            panels(run)
            save(folder / f"{name}.png")
    if "(motion.gif)" in readme:
        linkdyn.plot.animate(run, folder / "motion.gif", scene=scene, frames=FEWER.get(folder.name, FRAMES))
    for other in sorted(folder.glob("scene_*.toml")):
        picture = other.with_name(other.stem.replace("scene", "motion") + ".gif")
        if f"({picture.name})" in readme:
            variant = linkdyn.load(other)
            moves = variant.forward() if other.name == BESIDE.get(folder.name) else variant.inverse()
            linkdyn.plot.animate(moves, picture, scene=variant, frames=FRAMES)
    if goes_forward:
        draw_forward(folder, scene, run, readme)
    if folder.name in BESIDE:
        beside = linkdyn.load(folder / BESIDE[folder.name])
        draw_forward(folder, beside, beside.forward(), readme)


def main() -> None:
    for name in sys.argv[1:] or sorted(path.parent.name for path in FOLDER.glob("*/scene.toml")):
        draw(FOLDER / name)


if __name__ == "__main__":
    main()
