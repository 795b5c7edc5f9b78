#!/usr/bin/env python3
"""Hexapods with friction in all of their joints against the same without: time of inverse dynamics, in one run.

    python benchmarks/python/bench_friction.py

Bearings rub by their own reactions, so that both are settled together, sample by sample. Processor time, plain and rough in turns: the
ratio hardly feels what else the machine does. Table `friction` under results/benchmarks.
"""
from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import linkdyn
from report import ROOT, processor_line, save_table

SCENES = ("tsai", "aris", "drilling")
WANTS = {"driving_force": "driving forces", "driving_force,reaction": "and reactions", None: "all"}
BEARINGS = {
    "universal": 'coulomb = 0.01\nradius = "10 mm"',
    "spherical": 'coulomb = 0.05\nradius = "10 mm"',
    "prismatic": "coulomb = 0.1",
    "cylindrical": 'coulomb = 0.1\nradius = "10 mm"',
}
N = 8192
TURNS = 25


def with_friction(name: str) -> tuple[linkdyn.Scene, linkdyn.Scene]:
    """A hexapod as it is, and with friction in all joints that may have some: an idle spin has none to make it."""
    path = ROOT / "examples" / f"stewart_{name}" / "scene.toml"
    plain = linkdyn.load(path)
    idle = plain.description["idle_spins"].replace("+", " ").split()
    tables = [
        f'[[friction]]\njoint = "{joint["name"]}"\n{BEARINGS[joint["type"]]}\n'
        for joint in plain.description["joints"]
        if joint["type"] in BEARINGS and not any(plain.links[link - 1] in idle for link in joint["links"] if link > 0)
    ]
    return plain, linkdyn.Scene("\n".join([plain.text, *tables]), folder=path.parent)


def seconds(work: Callable[[], object]) -> float:
    """Of the processor."""
    start = time.process_time()
    work()
    return time.process_time() - start


def measure(name: str, want: str | None) -> dict[str, str]:
    """Both in turns, on samples along the scene's motion."""
    scenes = with_friction(name)
    t = scenes[0].times()
    q, qd, qdd, *_ = scenes[0].motion(np.linspace(t[0], t[-1], N))
    works = [lambda scene=scene: scene.inverse(q=q, qd=qd, qdd=qdd, want=want) for scene in scenes]
    for work in works:      # programs are made
        assert (work().status == 0).all()
    plain, rough = np.array([[seconds(work) for work in works] for _ in range(TURNS)]).T
    return {
        "scene": name,
        "results": WANTS[want],
        "plain, us": f"{plain.min() / N * 1e6:.3f}",
        "with friction, us": f"{rough.min() / N * 1e6:.3f}",
        "ratio": f"{np.median(rough / plain):.2f}",
    }


def table(rows: list[dict[str, str]]) -> str:
    lines = [list(rows[0]), ["---", "---", "---:", "---:", "---:"], *(list(row.values()) for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    text = f"{processor_line()}; one thread.\n\n{table([measure(name, want) for name in SCENES for want in WANTS])}"
    save_table("friction", text)
    print(text)


if __name__ == "__main__":
    main()
