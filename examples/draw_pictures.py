#!/usr/bin/env python3
"""Draw the pictures in the READMEs of the examples: forces.png, reactions.png, scene.png and motion.gif beside each scene;
hodograph.png and polar.png where a README shows them.

Scenes in which nothing is given a motion run forward. Reactions of many unlike joints would be a tower of panels: left out.

    python examples/draw_pictures.py [EXAMPLE ...]
"""
from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")   # pictures go to files
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import linkdyn
import linkdyn.plot

FOLDER = Path(__file__).resolve().parent
COLOURS = 256   # a palette is enough, and a third of the size
MOST_PANELS = 4


def save(file: Path) -> None:
    plt.gcf().savefig(file, dpi=80, bbox_inches="tight")
    plt.close("all")
    Image.open(file).convert("RGB").quantize(COLOURS).save(file, optimize=True)


def main() -> None:
    names = sys.argv[1:] or sorted(path.parent.name for path in FOLDER.glob("*/scene.toml"))
    for name in names:
        scene = linkdyn.load(FOLDER / name / "scene.toml")
        moves = any(np.ptp(values) > 0 for values in scene.motion()[0].T)
        run = scene.inverse() if moves else scene.forward()
        linkdyn.plot.driving_forces(run)
        save(FOLDER / name / "forces.png")
        if len(linkdyn.plot.reactions(run)[1]) <= MOST_PANELS:
            save(FOLDER / name / "reactions.png")
        plt.close("all")
        linkdyn.plot.mechanism(scene)
        save(FOLDER / name / "scene.png")
        linkdyn.plot.animate(run, FOLDER / name / "motion.gif", scene=scene)
        for kind, draw in (("hodograph", linkdyn.plot.hodograph), ("polar", linkdyn.plot.polar)):
            if f"{kind}.png" in (FOLDER / name / "README.md").read_text():
                draw(run)
                save(FOLDER / name / f"{kind}.png")


if __name__ == "__main__":
    main()
