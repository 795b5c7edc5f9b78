"""Machines whose forces are known in closed form."""

from __future__ import annotations

import linkdyn
import numpy as np

RPM = 2 * np.pi / 60


def engine(crank: float = 0.05, rod: float = 0.2, rpm: float = 6000.0, samples: int = 721, **piston: float) -> linkdyn.Scene:
    """A slider-crank of which only the piston has mass, over one turn."""
    return linkdyn.Scene({
        "title": "Engine",
        "space": "planar",
        "frame": {"markers": {"A": [0, 0], "guide": {"at": [0, 0], "axis": [1, 0]}}},
        "link": [
            {"name": "crank", "markers": {"A": [0, 0], "B": [crank, 0]}, "mass": 0},
            {"name": "rod", "markers": {"B": [0, 0], "C": [rod, 0]}, "mass": 0},
            {"name": "piston", "markers": {"C": {"at": [0, 0], "axis": [1, 0]}}, "mass": piston.get("mass", 0.5)},
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]},
            {"name": "B", "type": "revolute", "between": ["crank.B", "rod.B"]},
            {"name": "C", "type": "revolute", "between": ["rod.C", "piston.C"]},
            {"name": "guide", "type": "prismatic", "between": ["frame.guide", "piston.C"], "start": crank + rod},
        ],
        "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "rate": rpm * RPM, "start": 0.0}}],
        "actuator": [{"joint": "A"}],
        "time": {"end": 60 / rpm, "samples": samples},
    })
