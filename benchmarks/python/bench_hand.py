#!/usr/bin/env python3
"""A hexapod's 78 unknowns by a kernel written by hand, against the record of its scene: time and difference.

    python benchmarks/python/bench_hand.py [--library FILE]

The kernel is benchmarks/hand/hexapod.c, built for this machine's processor. It is timed on samples that lie in its lanes already;
the record through `Scene.inverse`, samples in and out. Table `hand` under results/benchmarks.
"""
from __future__ import annotations

import argparse
import ctypes
import time
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np

import linkdyn
from report import ROOT, processor_line, save_table

SCENES = ("tsai", "aris", "drilling")
LANES, LEGS, GIVEN, UNKNOWNS = 8, 6, 24, 78
N = 16_384
SMALL = 512
"""Samples that stay in the second-level cache with all their results."""


class Body(ctypes.Structure):
    _fields_ = [("mass", ctypes.c_double), ("cog", ctypes.c_double * 3), ("inertia", ctypes.c_double * 6)]


class Hexapod(ctypes.Structure):
    """`struct hexapod` of hexapod.h."""

    _fields_ = [
        ("gravity", ctypes.c_double * 3),
        ("platform", Body),
        ("base", ctypes.c_double * 3 * LEGS),
        ("top", ctypes.c_double * 3 * LEGS),
        ("axis", ctypes.c_double * 3 * LEGS),
        ("lower", Body * LEGS),
        ("upper", Body * LEGS),
        ("row", ctypes.c_int * 6),
        ("column", ctypes.c_int * 6),
    ]


def number(value: object) -> float:
    """A number of a scene, with or without its unit."""
    return float(str(value).split()[0])


def point(marker: object) -> np.ndarray:
    return np.array(marker["at"] if isinstance(marker, dict) else marker, dtype=float)


def body_of(content: dict) -> Body:
    inertia = content["inertia"]
    if isinstance(inertia, dict):
        inertia = [*inertia["diagonal"], 0.0, 0.0, 0.0]
    return Body(number(content["mass"]), tuple(content.get("cog", (0.0, 0.0, 0.0))), tuple(map(float, inertia)))


def machine_of(content: dict) -> Hexapod:
    """The hexapod of a scene with one chain of six legs."""
    chain, platform = content["chain"][0], content["link"][0]
    markers = {"frame": content["frame"]["markers"], platform["name"]: platform["markers"]}

    def at(name: str) -> np.ndarray:
        link, marker = name.split(".")
        return point(markers[link][marker])

    axis = np.broadcast_to(np.array(chain["axis"], dtype=float), (LEGS, 3))
    machine = Hexapod(gravity=tuple(content["gravity"]), platform=body_of(platform))
    for i in range(LEGS):
        machine.base[i][:] = at(chain["base"][i])
        machine.top[i][:] = at(chain["platform"][i])
        machine.axis[i][:] = axis[i] / np.linalg.norm(axis[i])
        machine.lower[i], machine.upper[i] = (body_of(half if isinstance(half, dict) else half[i]) for half in (chain["lower"], chain["upper"]))
    return machine


def into_lanes(samples: np.ndarray) -> np.ndarray:
    """(n, k) to blocks (n / 8, k, 8)."""
    return np.ascontiguousarray(samples.reshape(-1, LANES, samples.shape[1]).transpose(0, 2, 1))


def out_of_lanes(blocks: np.ndarray) -> np.ndarray:
    return blocks.transpose(0, 2, 1).reshape(-1, blocks.shape[1])


def aligned(shape: tuple[int, ...]) -> np.ndarray:
    """Zeros that begin at a multiple of 64 bytes."""
    room = np.zeros(int(np.prod(shape)) + 8)
    shift = (-room.ctypes.data // 8) % 8
    return room[shift : shift + int(np.prod(shape))].reshape(shape)


def best(work: Callable[[], object], passes: int = 7) -> float:
    """Seconds of the quickest pass, each of at least 0.05 s."""
    start = time.perf_counter()
    work()
    repeats = 1 + int(0.05 / (time.perf_counter() - start))
    times = []
    for _ in range(passes):
        start = time.perf_counter()
        for _ in range(repeats):
            work()
        times.append((time.perf_counter() - start) / repeats)
    return min(times)


def samples_of(scene: linkdyn.Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pose, velocity and acceleration along the scene's motion (N, 6), without its loads."""
    t = scene.times()
    q, qd, qdd, *_ = scene.motion(np.linspace(t[0], t[-1], N))
    return q, qd, qdd


def difference(run: object, found: np.ndarray) -> float:
    """Largest difference of driving forces, and of the sizes of forces at the universal and spherical joints, relative to the largest force."""
    legs = found.reshape(len(found), LEGS, 13)
    forces = np.linalg.norm(run.reaction.values[..., :3], axis=-1)
    named = {name: forces[:, i] for i, name in enumerate(run.joint.values.tolist())}
    scale = forces.max(axis=1)
    worst = np.abs(legs[..., 5] - run.driving_force.values).max(axis=1)
    for i in range(LEGS):
        for joint, columns in (("S", slice(0, 3)), ("U", slice(9, 12))):
            size = np.linalg.norm(legs[:, i, columns], axis=1)
            worst = np.maximum(worst, np.abs(size - named[f"leg{i + 1}.{joint}"]))
    return float((worst / scale).max())


class ByHand:
    """The kernel for one scene, at samples along its motion that lie in its lanes."""

    def __init__(self, name: str, library: ctypes.CDLL) -> None:
        self.file = ROOT / "examples" / f"stewart_{name}" / "scene.toml"
        self.scene = linkdyn.load(self.file)
        self.samples = samples_of(self.scene)
        self._library, self._machine = library, machine_of(tomllib.loads(self.file.read_text()))
        self._given, self._unknown = aligned((N // LANES, GIVEN, LANES)), aligned((N // LANES, UNKNOWNS, LANES))
        self._given[:] = into_lanes(np.hstack([*self.samples, np.zeros((N, 6))]))
        self._pointers = [array.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for array in (self._given, self._unknown)]
        library.hexapod_order(ctypes.byref(self._machine), self._pointers[0])

    def run(self, n: int) -> None:
        """The first n samples."""
        self._library.hexapod_forces(ctypes.byref(self._machine), n // LANES, *self._pointers)

    def difference(self) -> float:
        """From the scene's own results, see `difference`."""
        self.run(N)
        return difference(self.scene.inverse(*self.samples), out_of_lanes(self._unknown))


def best_of_record(kernel: ByHand, code: str | None) -> float:
    """Seconds a sample through Python, all 78 unknowns wanted; a scene's kernels stay as they are made first."""
    linkdyn.use_code(code)
    scene = linkdyn.load(kernel.file)
    return best(lambda: scene.inverse(*kernel.samples, want="driving_force,reaction")) / N


def measure(name: str, library: ctypes.CDLL) -> dict[str, str]:
    kernel = ByHand(name, library)
    hand = best(lambda: kernel.run(SMALL)) / SMALL
    record = {code: best_of_record(kernel, code) for code in (None, "interpreter")}
    return {
        "scene": name,
        "by hand, us": f"{hand * 1e6:.3f}",
        "machine code, us": f"{record[None] * 1e6:.3f}",
        "interpreted, us": f"{record['interpreter'] * 1e6:.3f}",
        "ratio": f"{record[None] / hand:.1f}",
        "difference": f"{kernel.difference():.1e}",
    }


def load_library(file: Path) -> ctypes.CDLL:
    """The kernel, with the types of what it takes."""
    library, numbers = ctypes.CDLL(str(file)), ctypes.POINTER(ctypes.c_double)
    library.hexapod_forces.argtypes = [ctypes.POINTER(Hexapod), ctypes.c_long, numbers, numbers]
    library.hexapod_order.argtypes = [ctypes.POINTER(Hexapod), numbers]
    library.hexapod_forces.restype = library.hexapod_order.restype = None
    return library


def table(rows: list[dict[str, str]]) -> str:
    heads = list(rows[0])
    lines = [heads, ["---", *["---:"] * (len(heads) - 1)], *(list(row.values()) for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--library", type=Path, default=ROOT / "build" / "wheel" / "benchmarks" / "libhexapod_by_hand.so")
    library = load_library(parser.parse_args().library)
    text = f"{processor_line()}; one thread.\n\n{table([measure(name, library) for name in SCENES])}"
    save_table("hand", text)
    print(text)


if __name__ == "__main__":
    main()
