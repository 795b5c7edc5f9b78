"""The benchmarks' tables and pictures: every solver has its place in them, and only `make renew` touches committed files."""

from __future__ import annotations

import re

import bench_inverse
import linkdyn
import matplotlib.pyplot as plt
import numpy as np
import peer_work
import pytest
import renew
import report


def solvers() -> list[str]:
    """All that the engine knows, from its own words."""
    with pytest.raises(linkdyn.InputError) as refusal:
        linkdyn.load(report.ROOT / "examples" / "fourbar" / "scene.toml").inverse(solver="?")
    return re.split(r", | or ", re.search(r"expected (.*)\)", str(refusal.value)).group(1))


def test_every_solver_is_drawn() -> None:
    rows = [
        {"scene": scene, "solver": solver, "want": want, "us": 1.0 + i, "flops": 100, "force": 1e-15, "reaction": 2e-15}
        for i, solver in enumerate(solvers())
        for scene in bench_inverse.SCENES
        for want in ("all", "driving_force")
    ]
    assert {"lapack", "gauss-jordan-plain"} <= {row["solver"] for row in rows}
    figure = bench_inverse.draw_times(rows)
    names = {text.get_text() for text in figure.axes[0].get_legend().get_texts()}
    assert names >= {row["solver"] for row in rows}
    plt.close(figure)
    assert bench_inverse.table(rows, {"peak": 100.0}).count("\n") == len(rows) + 1


def test_renew_takes_what_was_measured(tmp_path) -> None:
    results, page = tmp_path / "results", tmp_path / "docs" / "page.md"
    for folder in (results, page.parent):
        folder.mkdir()
    page.write_text("Head\n<!-- a -->\nold\n<!-- /a -->\n<!-- b -->\nstays\n<!-- /b -->\n![x](pictures/p.png)\n![y](q.png)\n")
    (results / "a.md").write_text("new\n")
    (results / "p.png").write_bytes(b"picture")
    (results / "elsewhere.md").write_text("no\n")
    assert renew.renew(results, page, {"a", "p", "elsewhere"}) == {"a", "p"}
    text = page.read_text()
    assert "<!-- a -->\nnew\n<!-- /a -->\n<!-- b -->\nstays\n" in text and "old" not in text
    assert (page.parent / "pictures" / "p.png").read_bytes() == b"picture"
    assert not (page.parent / "q.png").exists()


def test_every_place_has_its_benchmark() -> None:
    """Names of tables in the documents, and of what the benchmarks save, are the same."""
    places = {name for page in renew.DOCUMENTS for name in re.findall(r"<!-- ([a-z-]+) -->", page.read_text())}
    sources = "".join(file.read_text() for file in (report.ROOT / "benchmarks" / "python").glob("*.py"))
    saved = set(re.findall(r'save_table\("([a-z-]+)"', sources)) | set(re.findall(r'\("(forward-[a-z]+)"', sources))
    assert saved == places


def world_frames(links: list[dict]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rotation and origin of every link of a tree that peers are given, at its start."""
    frames: list[tuple[np.ndarray, np.ndarray]] = []
    for link in links:
        rotation, origin = frames[link["parent"]] if link["parent"] >= 0 else (np.eye(3), np.zeros(3))
        axis = np.eye(3)["xyz".index(link["joint"][1])]
        origin = origin + rotation @ np.array(link["at"])
        if link["joint"][0] == "P":
            frames.append((rotation, origin + rotation @ axis * link["q"]))
            continue
        cross = np.cross(np.eye(3), axis)      # the matrix of axis x
        frames.append((rotation @ (np.eye(3) + np.sin(link["q"]) * cross + (1.0 - np.cos(link["q"])) * cross @ cross), origin))
    return frames


@pytest.mark.parametrize("make", [lambda: peer_work.planar_work("fourbar_constant_torque/scene.toml", 5.0),
                                  lambda: peer_work.planar_work("andrews/scene_forward.toml", 0.05),
                                  lambda: peer_work.hexapod_forward(0.5), peer_work.hexapod_inverse])
def test_trees_of_the_peers_are_the_scenes(make) -> None:
    """Loops meet, a branch follows its link without another between, and every link's mass is there."""
    scene, work = make()
    frames = world_frames(work["links"])
    for loop in work["loops"]:
        ends = [frames[link][1] + frames[link][0] @ np.array(point) for link, point in zip(loop["links"], loop["points"])]
        np.testing.assert_allclose(*ends, atol=1e-12)
    assert sum(link.get("mass", 0.0) for link in work["links"]) == pytest.approx(sum(link["mass"] for link in scene.description["links"]))
    branch: list[int] = []
    for i, link in enumerate(work["links"]):
        branch = [*branch[: branch.index(link["parent"]) + 1], i] if link["parent"] >= 0 else [i]
