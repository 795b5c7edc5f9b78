#!/usr/bin/env python3
"""Draw the pictures in the READMEs of the examples: forces.png, reactions.png and scene.png beside each scene.

    python examples/draw_pictures.py [EXAMPLE ...]
"""
from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")   # pictures go to files
import matplotlib.pyplot as plt
from PIL import Image

import linkdyn
import linkdyn.plot

FOLDER = Path(__file__).resolve().parent
COLOURS = 256   # a palette is enough, and a third of the size


def save(file: Path) -> None:
    plt.gcf().savefig(file, dpi=80, bbox_inches="tight")
    plt.close("all")
    Image.open(file).convert("RGB").quantize(COLOURS).save(file, optimize=True)


def main() -> None:
    names = sys.argv[1:] or sorted(path.parent.name for path in FOLDER.glob("*/scene.toml"))
    for name in names:
        scene = linkdyn.load(FOLDER / name / "scene.toml")
        run = scene.inverse()
        linkdyn.plot.driving_forces(run)
        save(FOLDER / name / "forces.png")
        linkdyn.plot.reactions(run)
        save(FOLDER / name / "reactions.png")
        linkdyn.plot.scene3d(scene)
        save(FOLDER / name / "scene.png")


if __name__ == "__main__":
    main()
