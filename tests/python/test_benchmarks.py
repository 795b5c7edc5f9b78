"""The benchmarks' tables and pictures: every solver has its place in them, and only `make renew` touches committed files."""

from __future__ import annotations

import re

import bench_inverse
import linkdyn
import matplotlib.pyplot as plt
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
