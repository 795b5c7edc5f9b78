"""The example of a sizing study, on few samples."""

from __future__ import annotations

import importlib.util
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import linkdyn

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "stewart_workspace"
SPEC = importlib.util.spec_from_file_location("stewart_workspace", FOLDER / "run.py")
example = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(example)


@pytest.mark.thorough
def test_runs(tmp_path, monkeypatch, capsys):
    few = {"x": 3, "y": 3, "z": 2, "roll": 2, "pitch": 2, "yaw": 1}
    for name in ("QUICK", "KEPT", "STUDY"):
        monkeypatch.setattr(example, name, few)
    monkeypatch.setattr(example, "RADIUS", ["-0.2 m", "0.2 m", 3])
    monkeypatch.setattr(example, "SPACING", ["-0.1 m", "0.2 m", 2])
    monkeypatch.setattr(sys, "argv", ["run.py", "--out", str(tmp_path)])
    example.main()
    printed = capsys.readouterr().out
    assert printed.startswith(f"{72 * 14} samples") and "6 designs" in printed
    for name in ("workspace.nc", "sheet.html", "sheet.pdf", "force_slices.png", "feasible.png", "sizing.png", "designs.png"):
        assert (tmp_path / name).stat().st_size > 1000, name


def test_cases_are_whole():
    """Fourteen load cases; moves at 0.3 m/s and 1.5 m/s2 along diagonals, each direction and tilt once with either sign."""
    axes = [axis for axis in tomllib.loads((FOLDER / "scene.toml").read_text())["sweep"]["axis"] if axis.get("group") == "case"]
    assert {len(axis["values"]) for axis in axes} == {14}
    by_name = {axis.get("rate") or axis.get("acceleration") or axis["component"]: [] for axis in axes}
    for axis in axes:
        by_name[axis.get("rate") or axis.get("acceleration") or axis["component"]].append(np.array(axis["values"]))
    xyz = [by_name[f"platform.{name}"] for name in "xyz"]
    assert np.linalg.norm([rate for rate, _ in xyz], axis=0)[6:] == pytest.approx(0.3, rel=2e-3)
    assert np.linalg.norm([acceleration for _, acceleration in xyz], axis=0)[6:] == pytest.approx(1.5, rel=2e-3)
    signs = np.sign([rate for name in ("x", "y", "z", "roll", "pitch") for rate in by_name[f"platform.{name}"][:1]])[:, 6:]
    assert np.all(signs @ signs.T == 8 * np.eye(5))      # no two go together more often than against each other
    # the thrust beside the middle turns: M = r x F with r = 0.25 m along x and y
    mx, my, fz = by_name["Mx"][0], by_name["My"][0], by_name["Fz"][0]
    assert np.abs(mx).max() == np.abs(my).max() == pytest.approx(0.25 * 8115, abs=0.5)
    assert np.all((fz < 0) >= ((mx != 0) | (my != 0)))


def test_designs_move_the_joints():
    """Pairs go outward as a whole, joints of a pair apart from each other."""
    scene = linkdyn.load(FOLDER / "scene.toml")
    outward, apart = example.design_axes()
    markers = {m["name"]: np.array(m["at"]) for m in scene.description["links"][1]["markers"]}

    def moved(axis: dict, by: float) -> dict[str, np.ndarray]:
        points = {name: at.copy() for name, at in markers.items()}
        for path, weight in zip(axis["parameter"], axis["weights"]):
            name, k = path.rsplit(".", 1)[1].rstrip("]").split("[")
            points[name][int(k)] += weight * by
        return points

    further, wider = moved(outward, 0.1), moved(apart, 0.1)
    for first, second in example.PAIRS.values():
        middle, gap = (markers[first] + markers[second]) / 2, markers[second] - markers[first]
        assert np.linalg.norm((further[first] + further[second]) / 2) - np.linalg.norm(middle) == pytest.approx(0.1, abs=1e-3)
        np.testing.assert_allclose(further[second] - further[first], gap, atol=1e-12)
        np.testing.assert_allclose((wider[first] + wider[second]) / 2, middle, atol=1e-12)
        # markers are rounded to centimetres: a pair does not lie quite across its direction
        assert np.linalg.norm(wider[second] - wider[first]) - np.linalg.norm(gap) == pytest.approx(0.2, abs=1e-3)


def test_fewer_values():
    table = tomllib.loads((FOLDER / "scene.toml").read_text())["sweep"]
    few = example.thinned(table, {"x": 2, "y": 2, "z": 2, "roll": 1, "pitch": 1, "yaw": 1})
    assert [axis["linspace"][2] for axis in few["axis"] if "linspace" in axis] == [2, 2, 2]
    assert sum(axis.get("values") == [0] for axis in few["axis"]) == 3
    assert table["axis"][0]["linspace"][2] == 11       # the scene's own is as it was
