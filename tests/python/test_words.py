"""What a designer reads: explain, summaries, and why a mechanism does not close."""

import re
import subprocess
from pathlib import Path

import linkdyn
import pytest
from linkdyn.cli import executable

FOUR_BAR = """
space = "planar"
gravity = [0, -9.81]

[frame]
markers = { A = [0, 0], D = ["300 mm", 0] }

[[link]]
name = "crank"
markers = { A = [0, 0], B = ["50 mm", 0] }
mass = 0.2

[[link]]
name = "coupler"
markers = { B = [0, 0], C = ["280 mm", 0] }
mass = 0.4

[[link]]
name = "rocker"
markers = { C = ["100 mm", 0], D = [0, 0] }
mass = 0.3

[[joint]]
name = "A"
type = "revolute"
between = ["frame.A", "crank.A"]

[[joint]]
name = "B"
type = "revolute"
between = ["crank.B", "coupler.B"]

[[joint]]
name = "C"
type = "revolute"
between = ["coupler.C", "rocker.C"]
branch = 1

[[joint]]
name = "D"
type = "revolute"
between = ["frame.D", "rocker.D"]

[[coordinate]]
joint = "A"
motion = { law = "constant-rate", rate = "60 rpm" }

[[actuator]]
joint = "A"
"""
DELTA = """
space = "spatial"

[frame]
markers = { B = { at = ["150 mm", 0, 0], repeat = 3, about = "z" } }

[[link]]
name = "plate"
mass = "0.3 kg"
inertia = { diagonal = [3e-4, 3e-4, 6e-4] }
markers = { P = { at = ["50 mm", 0, 0], repeat = 3, about = "z" } }

[[chain]]
type = "R(SS)2"
name = "arm"
repeat = 3
about = "z"
base = "frame.B#"
platform = "plate.P#"
axis = [0, 1, 0]
zero = [1, 0, 0]
elbow = 1
width = "60 mm"
crank = { length = "200 mm", mass = "0.35 kg" }
rod = { length = "500 mm", mass = "0.08 kg" }

[[coordinate]]
link = "plate"
components = ["x", "y", "z"]
motion = { x = { law = "cycloidal", from = "-100 mm", to = "100 mm", duration = "0.3 s" }, z = "%s" }
"""
SECOND_DRIVE = '[[actuator]]\njoint = "D"\n'


def summary(text: str, folder) -> tuple[int, str]:
    scene = folder / "scene.toml"
    scene.write_text(text)
    result = subprocess.run([executable(), "inverse", scene], cwd=folder, capture_output=True, text=True, timeout=60)
    return result.returncode, result.stdout


def test_links_that_never_close_say_how_far_they_are_apart(tmp_path):
    code, said = summary(FOUR_BAR.replace("280 mm", "28 mm"), tmp_path)
    assert code == 3
    assert (
        "cannot be closed at the start: joints 'B' and 'D' are 0.25 m apart, the links reach from 0.072 m to 0.128 m"
        in said
    )


def test_what_is_not_assembled_is_no_work_of_the_dense_solver(tmp_path):
    short = FOUR_BAR.replace("280 mm", "28 mm")
    assert "dense solver" not in summary(short, tmp_path)[1]
    assert linkdyn.Scene(short).inverse().attrs["samples_dense"] == 0


def test_more_drives_than_coordinates_are_told(tmp_path):
    code, said = summary(FOUR_BAR + SECOND_DRIVE, tmp_path)
    assert code == 0 and "2 drives share the work of 1 coordinate: taken is the least sum of squares" in said
    assert "share the work" not in summary(FOUR_BAR, tmp_path)[1]
    assert "2 drives share the work of 1 coordinate" in linkdyn.Scene(FOUR_BAR + SECOND_DRIVE).explain()


def test_explain_tells_where_the_motion_leads():
    explained = linkdyn.Scene(FOUR_BAR).explain()
    assert "Motion from 0 to 1 s" in explained
    assert "A                       0 to 360 deg, at most 360 deg/s and 0 deg/s2" in explained
    turning = '{ law = "constant-rate", rate = "60 rpm" }'
    radians = FOUR_BAR.replace(turning, '{ law = "cycloidal", from = 0, to = 90, duration = 1 }')
    assert "0 to 5156.6 deg, at most 10313 deg/s" in linkdyn.Scene(radians).explain()
    still = FOUR_BAR.replace(turning, '"30 deg"')
    assert "stays at 30 deg" in linkdyn.Scene(still).explain()
    free = FOUR_BAR.replace("motion = " + turning, 'start = "30 deg"')
    assert "Motion" not in linkdyn.Scene(free + "[time]\nend = 1\n").explain()


def test_a_period_in_another_unit_than_its_table_is_refused(tmp_path):
    (tmp_path / "gas.csv").write_text("phi [deg],force [N]\n0,0\n180,-90\n359,0\n")
    load = """
[measures]
phi = { joint = "A" }

[[load]]
on = "rocker.C"
force = [{ table = "gas.csv", column = "force", over = "phi", period = %s }, 0]
"""
    scene = tmp_path / "scene.toml"
    scene.write_text(FOUR_BAR + load % '"360 deg"')
    assert (linkdyn.load(scene).inverse().status == 0).all()
    scene.write_text(FOUR_BAR + load % "360")
    with pytest.raises(linkdyn.SceneError, match=r"'period' = 360 rad is more than 20 times the table's 6\.26.*unit"):
        linkdyn.load(scene)


def test_a_start_out_of_reach_says_where_it_is():
    """It was told of the wrong coordinate alone, which stands still in another assembly."""
    turned = DELTA.replace('name = "plate"\n', 'name = "plate"\nstart = { angles = [0, 0, "40 deg"] }\n')     # closed by iteration
    with pytest.raises(linkdyn.SceneError, match=r"cannot be closed at the start, .*z = -0\.95 m \(expected coordinates within reach"):
        linkdyn.Scene(turned % "-950 mm")
    arm = linkdyn.Scene(DELTA % "-950 mm").inverse()  # by formulas, arm by arm
    assert (arm.status == 1).all() and arm.attrs["failure"] == "t = 0 s: links 'arm1.crank', 'arm1.rod1' cannot be closed at the start"
    assert (linkdyn.Scene(DELTA % "-550 mm").inverse().status == 0).all()


def test_moments_of_rounding_are_none(tmp_path):
    """Balls and universal joints on massless arms: 2.5e-14 N m were told beside 1,153 N."""
    scene = Path(__file__).resolve().parents[1] / "scenes" / "hexaglide.toml"
    said = subprocess.run([executable(), "inverse", scene, "--no-output"], cwd=tmp_path, capture_output=True, text=True, timeout=60).stdout
    assert re.search(r"largest reaction moment +none", said)
