#!/usr/bin/env python3
"""linkdyn and its peers side by side: time against error of the same work, one after the other in one run.

    python benchmarks/python/bench_peers.py --python build/peers/bin/python

The peers (MuJoCo, Pinocchio, Exudyn: what pip has of them) live in an environment of their own, which `make bench-peers` makes; each
work is given to a program of benchmarks/peers, which says times and results. Times are processor time of one thread, taken in Python
for all of them. Tables `peers-inverse`, `peers-forward` and pictures peers_inverse.png, peers_fourbar.png, peers_andrews.png,
peers_hexapod.png under results/benchmarks. A peer that is missing or fails is left out, in one line.
"""
from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np

import linkdyn
import peer_work
from linkdyn.cli import quadruple_twin
from report import FOLDER, ROOT, clear_axis, legend_beside, processor_line, save_picture, save_table

PROGRAMS = ROOT / "benchmarks" / "peers"
sys.path.insert(0, str(PROGRAMS))
from work import more_steps, series, timed  # noqa: E402

PEERS = ("mujoco", "pinocchio", "exudyn")
NAMES = {"linkdyn": "linkdyn", "mujoco": "MuJoCo", "pinocchio": "Pinocchio", "exudyn": "Exudyn"}
COLOURS = {"linkdyn": "#009e73", "mujoco": "#d55e00", "pinocchio": "#0072b2", "exudyn": "#cc79a7"}
OWN = ("gbs", "rk8pd", "rk4")
MARKS = "os^"
TARGETS = (1e-4, 1e-6, 1e-8, 1e-10)
EPS = np.finfo(float).eps
BATCH = 2048
EVERYTHING = "linkdyn, all 78 unknowns"
PATIENCE = 600
"""[s] for one program."""


@dataclass
class Case:
    """A run of forward dynamics."""

    name: str
    says: str
    make: Callable[[], tuple[linkdyn.Scene, dict]]
    reference: str
    """In tests/reference/forward.json; none: the quadruple twin is asked."""
    rows: dict[str, list[dict]] = field(default_factory=dict)
    """By program."""


CASES = (
    Case("fourbar", "four-bar under constant torque, 5 s", lambda: peer_work.planar_work("fourbar_constant_torque/scene.toml", 5.0),
         "fourbar_constant_torque"),
    Case("andrews", "Andrews' squeezer, 0.05 s", lambda: peer_work.planar_work("andrews/scene_forward.toml", 0.05), "andrews"),
    Case("hexapod", "hexapod under position feedback, 0.5 s", lambda: peer_work.hexapod_forward(0.5), ""),
)


# ------------------------------------------------------------------------------------------------------------ peers
class Peers:
    """Programs that are there, asked one after the other."""

    def __init__(self, python: Path, folder: Path) -> None:
        self._python, self._folder = python, folder
        self.versions: dict[str, str] = {}
        self._missing: set[str] = set()
        for peer in PEERS:
            there = subprocess.run([python, "-c", f"import {peer}"], capture_output=True, text=True, check=False)
            if there.returncode:
                self._missing.add(peer)
                print(f"left out: {peer}, cannot be imported: {(there.stderr.strip().splitlines() or ['no reason given'])[-1]}")

    def ask(self, peer: str, kind: str, work: dict, *more: Path) -> dict | None:
        """What a program says of a work; None: it is left out."""
        if peer in self._missing:
            return None
        file = self._folder / "work.json"
        file.write_text(json.dumps(work))
        alone = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
        try:
            done = subprocess.run([self._python, PROGRAMS / f"peer_{peer}.py", kind, file, *more], env=os.environ | alone,
                                  capture_output=True, text=True, check=True, timeout=PATIENCE)
        except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
            said = error.stderr if isinstance(error.stderr, str) else ""
            print(f"left out: {peer}, {kind}: {(said.strip().splitlines() or [type(error).__name__])[-1]}")
            return None
        answer = json.loads(done.stdout)
        self.versions[peer] = answer["version"]
        return answer


# ---------------------------------------------------------------------------------------------------------- inverse
def measure_inverse(peers: Peers, folder: Path) -> list[dict]:
    """One row a program: times of a pose and the largest error of the six driving forces at the 50-digit references."""
    scene, work = peer_work.hexapod_inverse()
    states = json.loads((ROOT / "tests" / "reference" / "stewart_tsai.json").read_text())["states"]
    given = {f"reference_{key}": np.array([state[key] for state in states]) for key in ("q", "qd", "qdd", "wrench")}
    exact = np.array([[float(x) for x in state["driving_force"]] for state in states])
    t = scene.times()
    q, qd, qdd, *_ = scene.motion(np.linspace(t[0], t[-1], BATCH))
    samples = folder / "samples.npz"
    np.savez(samples, q=q, qd=qd, qdd=qdd, **given)

    run = scene.inverse(*(given[f"reference_{key}"] for key in ("q", "qd", "qdd")), wrench={"platform.center": given["reference_wrench"]},
                        want="driving_force")
    wants = {"linkdyn": "driving_force", EVERYTHING: "driving_force,reaction"}
    for want in wants.values():      # memory that a process has had once is quicker to get again
        scene.inverse(q, qd, qdd, want=want, threads=1)
    rows = []
    for label, want in wants.items():
        batch, _ = timed(lambda: scene.inverse(q, qd, qdd, want=want, threads=1))
        single, _ = timed(lambda: [scene.solve(q[:1], qd[:1], qdd[:1], want=want, threads=1) for _ in range(50)])
        rows.append({"program": "linkdyn", "label": label, "batch": batch / BATCH * 1e6, "single": single / 50 * 1e6,
                     "error": force_error(run.driving_force.values, exact)})
    for peer in PEERS:
        answer = peers.ask(peer, "inverse", work, samples)
        if answer is None:
            continue
        if "lacks" in answer:
            print(f"left out: {peer}, inverse: {answer['lacks']}")
            continue
        rows.append({"program": peer, "label": answer["version"], **{key: answer[key] for key in ("batch", "calls", "single")},
                     "error": force_error(np.array(answer["forces"]), exact)})
    return rows


def force_error(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest of all states, relative to the state's largest force."""
    return float((np.abs(found - exact).max(axis=1) / np.abs(exact).max(axis=1)).max())


def inverse_table(rows: list[dict]) -> str:
    lines = ["| program | us a pose, batch | of it in the peer's own calls | us, one pose alone | error |", "|---|---:|---:|---:|---:|"]
    for row in rows:
        calls = f"{row['calls']:.3g}" if "calls" in row else ""
        lines.append(f"| {row['label']} | {row['batch']:.3g} | {calls} | {row['single']:.3g} | {row['error']:.1e} |")
    return "\n".join(lines)


def draw_eps(axis: plt.Axes) -> None:
    axis.axhline(EPS, color="0.6", linewidth=0.8, zorder=0)
    axis.annotate("eps", (0.005, EPS), xycoords=("axes fraction", "data"), ha="left", va="bottom", color="0.4")


def draw_inverse(rows: list[dict]) -> plt.Figure:
    figure, axis = plt.subplots(figsize=(7.5, 4.2), layout="constrained")
    for row in rows:
        colour, filled = COLOURS[row["program"]], row["label"] != EVERYTHING
        for key, mark in (("batch", "o"), ("single", "s"), ("calls", "|")):
            if key in row and (filled or key == "batch"):
                axis.plot(row[key], row["error"], mark, color=colour, markersize=9, markeredgewidth=1.6,
                          fillstyle="full" if filled else "none")
        axis.plot([], [], "o", color=colour, fillstyle="full" if filled else "none", label=row["label"])
    for mark, label in (("o", f"batch of {BATCH}"), ("s", "one pose alone"), ("|", "the peer's own calls only")):
        axis.plot([], [], mark, color="0.3", label=label, linestyle="none", markersize=9)
    draw_eps(axis)
    axis.set(xscale="log", yscale="log", ylim=(1e-16, 1e-13), xlabel="processor time of a pose [us]",
             ylabel="largest relative error", title="Hexapod: driving forces from pose, velocity, acceleration")
    clear_axis(axis)
    legend_beside(axis)
    return figure


# ---------------------------------------------------------------------------------------------------------- forward
def reference_state(case: Case, scene: linkdyn.Scene, end: float, folder: Path) -> np.ndarray | None:
    """q and qd at the end."""
    if case.reference:
        states = json.loads((ROOT / "tests" / "reference" / "forward.json").read_text())[case.reference]["states"]
        state = next(state for state in states if state["t"] == end)
        return np.array([float(x) for x in state["q"] + state["qd"]])
    twin = quadruple_twin()
    if twin is None:
        print(f"left out: {case.name}, no linkdyn-real128 for its reference (make real128)")
        return None
    file, out = folder / "scene.toml", folder / "reference.csv"
    file.write_text(scene.text)
    subprocess.run([twin, "forward", file, "--method", "gbs", "--rtol", "1e-18", "--atol", "1e-18", "--until", repr(end), "--samples", "2", "--csv", "-o",
                    out, "--quiet"], check=True)
    header, *_, last = out.read_text().splitlines()
    value = dict(zip((name.strip('"').rsplit(" [", 1)[0] for name in header.split(",")), last.split(",")))
    return np.array([float(value[f"{kind} {name}"]) for kind in ("q", "qd") for name in scene.coordinates])


def own_rows(scene: linkdyn.Scene, end: float) -> list[dict]:
    """Every method of ours through `Scene.forward`."""

    def run(method: str, **settings: float) -> np.ndarray:
        found = scene.forward(t=np.array([0.0, end]), method=method, want="driving_force", threads=1, **settings)
        return np.concatenate([found.q.values[-1], found.qd.values[-1]])

    rows = []
    for method in OWN:
        if method == "rk4":
            rows += series(lambda n: run("rk4", step=end / n), more_steps(50), method)
            continue
        tolerances = [10.0**-digits for digits in range(4, 14)]
        try:
            rows += series(lambda tolerance, method=method: run(method, rtol=tolerance, atol=tolerance), tolerances, method)
        except linkdyn.UnavailableError:
            print(f"left out: linkdyn's {method}, which this build lacks")
    return rows


def measure_forward(case: Case, peers: Peers, folder: Path) -> None:
    scene, work = case.make()
    exact = reference_state(case, scene, work["end"], folder)
    if exact is None:
        return
    course = scene.forward(t=np.linspace(0.0, work["end"], 201), want="driving_force")
    scale = np.repeat([np.abs(course.q.values).max(), np.abs(course.qd.values).max()], len(exact) // 2)
    case.rows["linkdyn"] = own_rows(scene, work["end"])
    for peer in PEERS:
        if (answer := peers.ask(peer, "forward", work)) is not None:
            case.rows[peer] = answer["rows"]
    for rows in case.rows.values():
        for row in rows:
            row["error"] = float((np.abs(np.array(row["state"], dtype=float) - exact) / scale).max())


def methods(case: Case, program: str) -> list[str]:
    return list(dict.fromkeys(row["method"] for row in case.rows[program]))


def forward_table(cases: list[Case]) -> str:
    lines = ["| work | program | method | " + " | ".join(f"ms to {target:.0e}" for target in TARGETS) + " | least error |",
             "|---|---|---|" + "---:|" * (len(TARGETS) + 1)]
    for case in cases:
        for program, rows in case.rows.items():
            for method in methods(case, program):
                mine = [row for row in rows if row["method"] == method and np.isfinite(row["error"])]
                least = [min((row["ms"] for row in mine if row["error"] <= target), default=None) for target in TARGETS]
                cells = " | ".join("" if ms is None else f"{ms:.3g}" for ms in least)
                lines.append(f"| {case.says} | {NAMES[program]} | {method} | {cells} | {min(row['error'] for row in mine):.1e} |")
    return "\n".join(lines)


def front(rows: list[dict]) -> list[dict]:
    """Those that no quicker row beats."""
    kept: list[dict] = []
    for row in sorted((row for row in rows if np.isfinite(row["error"])), key=lambda row: row["ms"]):
        if not kept or row["error"] < kept[-1]["error"]:
            kept.append(row)
    return kept


def draw_forward(case: Case) -> plt.Figure:
    figure, axis = plt.subplots(figsize=(8.5, 4.6), layout="constrained")
    for program, rows in case.rows.items():
        for mark, method in zip(MARKS, methods(case, program)):
            best = front([row for row in rows if row["method"] == method])
            axis.plot([row["ms"] for row in best], [max(row["error"], EPS / 10) for row in best], mark + "-", markersize=4.5,
                      linewidth=1.1, color=COLOURS[program], label=f"{NAMES[program]}, {method}")
    draw_eps(axis)
    axis.set(xscale="log", yscale="log", xlabel="processor time of the run, one thread [ms]", ylabel="relative error at the end",
             title=case.says[0].upper() + case.says[1:])
    clear_axis(axis)
    legend_beside(axis)
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", type=Path, required=True, help="interpreter of the environment that has the peers")
    parser.add_argument("--only", nargs="+", choices=["inverse", *(case.name for case in CASES)], help="these works, and no table kept")
    given = parser.parse_args()
    with TemporaryDirectory() as name:
        folder = Path(name)
        peers = Peers(given.python, folder)
        inverse = measure_inverse(peers, folder) if not given.only or "inverse" in given.only else []
        cases = [case for case in CASES if not given.only or case.name in given.only]
        for case in cases:
            measure_forward(case, peers, folder)
    cases = [case for case in cases if case.rows]
    if inverse:
        save_picture(draw_inverse(inverse), "peers_inverse")
    for case in cases:
        save_picture(draw_forward(case), f"peers_{case.name}")
    head = f"{processor_line()}; one thread, processor time. linkdyn {linkdyn.__version__}, {', '.join(peers.versions.values())}."
    of_inverse, of_forward = f"{head}\n\n{inverse_table(inverse)}", forward_table(cases)
    print(f"{of_inverse}\n\n{of_forward}")
    if not given.only:
        save_table("peers-inverse", of_inverse)
        save_table("peers-forward", of_forward)
    print(f"\nPictures: {FOLDER}")


if __name__ == "__main__":
    main()
