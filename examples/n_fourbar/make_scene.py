#!/usr/bin/env python3
"""Write the scene of a chain of N four-bars: python make_scene.py N [FILE]."""
from __future__ import annotations

import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
FILES = {2: "scene.toml", 40: "scene_40.toml"}


def scene_of(n: int) -> str:
    """N + 1 bars stand on the frame, N rods join their tops; all 1 m, 1 kg, uniform."""
    bases = ", ".join(f"A{i} = [{i}.0, 0.0]" for i in range(n + 1))
    lines = [f'title = "{n} four-bars in a row"', 'space = "planar"', "gravity = [0.0, -9.81]", "",
             "[frame]", f"markers = {{ {bases} }}", ""]
    for kind, i in [("bar", 0)] + [(kind, i) for i in range(1, n + 1) for kind in ("rod", "bar")]:
        ends, angle, place = ("A = [0.0, 0.0], B", "90 deg", [i, 0]) if kind == "bar" else ("L = [0.0, 0.0], R", 0.0, [i - 1, 1])
        lines += ["[[link]]", f'name = "{kind}{i}"', f"markers = {{ {ends} = [1.0, 0.0] }}", "mass = 1.0", "cog = [0.5, 0.0]",
                  "inertia = 0.08333333333333333",
                  f"start = {{ position = [{place[0]}.0, {place[1]}.0], angle = {angle!r} }}".replace("'", '"'), ""]
    joints = [("A0", "frame.A0", "bar0.A")]
    for i in range(1, n + 1):
        joints += [(f"L{i}", f"bar{i - 1}.B", f"rod{i}.L"), (f"R{i}", f"rod{i}.R", f"bar{i}.B"), (f"A{i}", f"frame.A{i}", f"bar{i}.A")]
    for name, first, second in joints:
        lines += ["[[joint]]", f'name = "{name}"', 'type = "revolute"', f'between = ["{first}", "{second}"]', ""]
    lines += ["[[coordinate]]", 'joint = "A0"', "start = { position = 1.5707963267948966, velocity = -1.0 }     # upright; B0 goes at +1 m/s", "",
              "[time]", "end = 20.0", "samples = 401", ""]
    return "\n".join(lines)


def main() -> None:
    n = int(sys.argv[1])
    file = Path(sys.argv[2]) if len(sys.argv) > 2 else FOLDER / FILES[n]
    file.write_text(scene_of(n))


if __name__ == "__main__":
    main()
