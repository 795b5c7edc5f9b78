"""The sizing sheet: its numbers are those of the results, its file is sound."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot

import linkdyn
from linkdyn._sheets.sheet import sheet_page, significant
from sheet_file import column, number, read

pytestmark = [pytest.mark.python_alone, pytest.mark.usefixtures("closed_figures")]

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def spatial_table() -> dict:
    return {
        "on": "platform.center",
        "reduce": [
            *("driving_force", "driving_position", "driving_speed", "driving_power", "reaction", "reaction_force"),
            *("reaction_moment", "force_amplification", "moment_amplification", "condition", "determinant", "swing", "clearance"),
        ],
        "histogram": {"bins": 10, "driving_force": True},
        "axis": [
            {"coordinate": "platform.x", "linspace": [-1.7, -1.3, 4]},
            {"coordinate": "platform.z", "linspace": [0.8, 1.1, 4]},
            {"rate": "platform.x", "values": [0, 0.3, -0.2], "group": "case"},
            {"load": "platform.center", "component": "Fz", "values": [0, 0, -25], "group": "case"},
        ],
        "constraint": [{"of": "driving_position", "at": ["leg1.P", "leg2.P"], "max": 1.4, "name": "stroke"}],
        "limit": [
            {"of": "driving_force", "min": -1, "max": 14, "name": "drive"},
            {"of": "swing", "max": "80 deg", "name": "joint swing"},
        ],
    }


@pytest.fixture(scope="module")
def run(scene):
    return scene.sweep(spatial_table())


@pytest.fixture(scope="module")
def written(run, tmp_path_factory) -> Path:
    return linkdyn.sheet(run, tmp_path_factory.mktemp("sheet") / "out.html")


def test_actuators(run, written):
    _, tables = read(written)
    rows = tables["Actuators"]
    assert [row[0].text for row in rows] == list(run.actuator.values)
    push, pull = run.driving_force_max.values, run.driving_force_min.values
    np.testing.assert_array_equal(column(rows, 1), np.where(push > 0, push, np.nan))
    np.testing.assert_array_equal(column(rows, 2), np.where(pull < 0, pull, np.nan))
    np.testing.assert_array_equal(column(rows, 3), run.driving_force_rms)
    np.testing.assert_array_equal(column(rows, 4), run.driving_position_min)
    np.testing.assert_array_equal(column(rows, 6), (run.driving_position_max - run.driving_position_min).values)
    np.testing.assert_array_equal(column(rows, 7), np.maximum(-run.driving_speed_min, run.driving_speed_max))
    np.testing.assert_array_equal(column(rows, 8), run.driving_power_max)
    np.testing.assert_array_equal(column(rows, 10), run.regenerative_share)
    for row in rows:                # what is read is what is meant: newtons, millimetres, per cent
        assert number(row[1]) == pytest.approx(float(row[1].get("data-si")), rel=5e-4)
        assert number(row[4]) == pytest.approx(1e3 * float(row[4].get("data-si")), rel=5e-4)
        assert number(row[10]) == pytest.approx(1e2 * float(row[10].get("data-si")), rel=5e-3)


def test_places(run, written):
    _, tables = read(written)
    x, z, rate, load = run.driving_force_max_at.sel(actuator="leg3.P").values
    text = tables["Where the peaks are"][2][1].text
    assert text.startswith(f"x {1e3 * x:.4g} mm, z {1e3 * z:.4g} mm; ".replace("-", "−"))
    assert (f"Fz {load:.4g} N".replace("-", "−") in text) == (load != 0)
    assert (f"rates x {rate:.4g} m/s".replace("-", "−") in text) == (rate != 0)


def test_joints(run, written):
    _, tables = read(written)
    rows = tables["Joint loads"]
    assert [row[0].text for row in rows] == ["leg*.U", "leg*.P", "leg*.S"]
    for row, kind in zip(rows, "UPS"):
        joints = [name for name in run.joint.values if name.endswith(kind)]
        forces = run.reaction_force_max.sel(joint=joints)
        assert float(row[1].get("data-si")) == float(forces.max())
        assert row[2].text == joints[int(np.argmax(forces.values))]
        largest = np.maximum(np.abs(run.reaction_min), np.abs(run.reaction_max)).sel(joint=joints).max("joint")
        np.testing.assert_array_equal(column([row], 5), largest.values[:1])
    assert float(rows[0][-1].get("data-si")) == float(run.swing_max.sel(swing_joint=[f"leg{k}.U" for k in range(1, 7)]).max())
    assert rows[1][-1].text == "–"


def test_limits(run, written):
    _, tables = read(written)
    stroke, drive, swing = tables["Limits"]
    assert [row[0].text for row in (stroke, drive, swing)] == ["stroke", "drive", "joint swing"]
    longest = float(run.driving_position_max.sel(actuator=["leg1.P", "leg2.P"]).max())
    assert float(stroke[6].get("data-si")) == longest
    assert float(stroke[8].get("data-si")) == (1.4 - longest) / 1.4 >= 0
    peak = float(run.driving_force_max.max())
    assert float(drive[8].get("data-si")) == (14 - peak) / 14 < 0
    assert drive[7].text == str(run.actuator.values[int(np.argmax(run.driving_force_max.values))])
    assert "alarm" in drive[6].get("class") and "alarm" in drive[8].get("class") and "alarm" not in (drive[5].get("class") or "")
    for row in (stroke, drive, swing):
        assert float(row[9].get("data-si")) == float(run.outcome_count.sel(outcome=row[0].text))
    feasible = {row[0].text: float(row[1].get("data-si")) for row in tables["Feasibility"]}
    assert sum(feasible.values()) == int(run.samples) and feasible["feasible"] == int(run.outcome_count[0])


def test_worst_load_and_condition(run, written):
    _, tables = read(written)
    rows = tables["Worst load on platform.center"]
    np.testing.assert_array_equal(column(rows, 1), run.force_amplification_max)
    np.testing.assert_array_equal(column(rows, 3), run.moment_amplification_max)
    shown = [float(text) for text in rows[1][2].text.strip("()").replace("−", "-").split(", ")]
    np.testing.assert_allclose(shown, run.force_amplification_direction.values[1], atol=5e-3)
    quality = {row[0].text: row[1] for row in tables["Distance from singularities and collisions"]}
    assert float(quality["largest condition number"].get("data-si")) == float(run.condition_max)
    assert float(quality["smallest gap between legs"].get("data-si")) == float(run.clearance_min)


def test_pictures_are_inside(written):
    root, _ = read(written)
    sources = [image.get("src") for image in root.iter("img")]
    assert len(sources) >= 3        # the machine, bars, histograms
    for source in sources:
        head, _, data = source.partition(",")
        start = base64.b64decode(data, validate=True)[:200]
        assert start.startswith(b"\x89PNG") if "png" in head else b"<?xml" in start
    assert "http" not in re.sub(r'src="[^"]*"', "", written.read_text())
    assert not pyplot.get_fignums(), "pictures are closed"


def test_same_results_same_file(run, written, tmp_path):
    assert written.read_bytes() == linkdyn.sheet(run, tmp_path / "two.html").read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["two.html"]


def test_pdf_is_one_page(run, tmp_path):
    data = linkdyn.sheet(run, tmp_path / "out.pdf").read_bytes()
    assert data.startswith(b"%PDF") and data.rstrip().endswith(b"%%EOF")
    assert re.search(rb"/Count (\d+)", data).group(1) == b"1"


@pytest.mark.parametrize("name", ["out.html", "out.pdf"])
def test_planar(name, tmp_path):
    """A torque, a slider, three components, no swing; angles of the crank in degrees."""
    scene = linkdyn.load(EXAMPLES / "slider_crank" / "scene.toml")
    crank = scene.coordinates[0]
    table = {
        "reduce": ["driving_force", "driving_position", "driving_power", "reaction", "reaction_force"],
        "axis": [{"coordinate": crank, "linspace": ["0 deg", "350 deg", 36]}, {"rate": crank, "values": [20, 40]}],
        "limit": [{"of": "driving_force", "max": "1 N*m", "min": "-1 N*m"}],
    }
    run = scene.sweep(table)
    file = linkdyn.sheet(run, tmp_path / name)
    if name.endswith("pdf"):
        return
    _, tables = read(file)
    assert float(tables["Actuators"][0][1].get("data-si")) == float(run.driving_force_max[0])
    assert [row[0].text for row in tables["Joint loads"]] == list(run.joint.values)
    assert "deg" in tables["Where the peaks are"][0][1].text


def test_designs_are_compared(scene, tmp_path):
    table = spatial_table()
    table["axis"].insert(0, {"parameter": "link.platform.mass", "name": "mass", "linspace": [1, 3, 3]})
    run = scene.sweep(table)
    _, tables = read(linkdyn.sheet(run, tmp_path / "out.html"))
    rows = tables["Designs"]
    np.testing.assert_array_equal(column(rows, 1), [1, 2, 3])
    np.testing.assert_array_equal(column(rows, 2), run.driving_force_max.max("actuator"))
    np.testing.assert_array_equal(column(rows, 3), run.driving_force_min.min("actuator"))
    _, tables = read(linkdyn.sheet(run, tmp_path / "second.html", design=1))
    np.testing.assert_array_equal(column(tables["Actuators"], 1), run.driving_force_max.values[1])
    assert "design 1: mass = 2" in (tmp_path / "second.html").read_text()


def test_little_is_reduced(scene, tmp_path):
    """No actuators, no joints: what is there is shown, what is not is named."""
    run = scene.sweep({"reduce": ["condition"], "moments": False, "axis": [{"coordinate": "platform.x", "linspace": [-1.6, -1.4, 3]}]})
    root, tables = read(linkdyn.sheet(run, tmp_path / "out.html"))
    assert set(tables) == {"Feasibility", "Distance from singularities and collisions", "Swept"}
    assert "joint swing (swing)" in "".join(root.itertext())


def test_nothing_is_feasible(scene, tmp_path):
    table = spatial_table()
    table["constraint"][0]["max"] = 0.1
    run = scene.sweep(table)
    assert int(run.samples_reduced) == 0
    _, tables = read(linkdyn.sheet(run, tmp_path / "out.html"))
    assert {cell.text for cell in tables["Actuators"][0][1:-1]} == {"–"}       # the last is a share of nothing


def test_title_with_marks(scene, tmp_path):
    run = scene.sweep({"reduce": ["condition"], "axis": [{"coordinate": "platform.x", "values": [-1.5]}]})
    run.attrs["title"] = 'a < b & "c" $x$'
    root, _ = read(linkdyn.sheet(run, tmp_path / "out.html"))
    assert root.find("body/h1").text == 'a < b & "c" $x$'
    linkdyn.sheet(run, tmp_path / "out.pdf")


@pytest.mark.parametrize(
    ("value", "text"),
    [(1234.567, "1235"), (-0.0123456, "−0.01235"), (0.0, "0"), (99999.6, "100000"), (12.0, "12.00"), (1.5e-7, "1.500e−07")],
)
def test_numbers(value, text):
    assert significant(value) == text


def test_refused(run, scene, tmp_path):
    with pytest.raises(linkdyn.InputError, match=".html or .pdf"):
        linkdyn.sheet(run, tmp_path / "out.doc")
    with pytest.raises(linkdyn.InputError, match="no results of a sweep"):
        linkdyn.sheet(run.drop_vars("outcome_count"), tmp_path / "out.html")
    with pytest.raises(linkdyn.InputError, match="one design only"):
        linkdyn.sheet(run, tmp_path / "out.html", design=2)
    with pytest.raises(linkdyn.FileError, match="cannot be written"):
        linkdyn.sheet(run, tmp_path / "nowhere" / "out.html")
    assert sheet_page(run).title == run.attrs["title"]
