"""Messages that name what is meant: chains without a name, tables with who reads them, units by all their readings, folders."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import linkdyn
import pytest

ROOT = Path(__file__).resolve().parents[2]
HEXAPOD = ROOT / "examples" / "stewart_tsai" / "scene.toml"

CRANK = """
space = "planar"
[frame]
markers = { O = [0, 0] }
[[link]]
name = "crank"
markers = { O = [0, 0] }
mass = 1.0
inertia = 0.1
[[joint]]
name = "J"
type = "revolute"
between = ["frame.O", "crank.O"]
[[coordinate]]
joint = "J"
motion = { table = "motion.csv", column = "J" }
[[actuator]]
joint = "J"
"""
CRANK_MOTION = 16
"""Its line."""


def call(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-c", "from linkdyn.cli import main; main()", *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, timeout=120, cwd=folder)


def test_a_chain_without_name_is_called_leg() -> None:
    text = HEXAPOD.read_text()
    line = 'name = "leg"\n'
    assert text.count(line) == 1
    unnamed = linkdyn.Scene(text.replace(line, ""), folder=HEXAPOD.parent)
    changes = {"chain.leg.lower.mass": 0.4}
    expected = linkdyn.load(HEXAPOD).with_(changes).inverse().driving_force
    assert (unnamed.with_(changes).inverse().driving_force == expected).all()
    with pytest.raises(linkdyn.InputError, match="there is no chain 'legs' \\(expected one of 'leg'\\)"):
        unnamed.with_({"chain.legs.lower.mass": 0.4})
    swept = unnamed.sweep({"axis": [{"parameter": "chain.leg.lower.mass", "values": [0.4]}, {"time": True, "values": [0.0]}], "reduce": ["driving_force"]})
    assert abs(float(swept.driving_force_max.max()) - float(expected[0].max())) < 1e-9
    with pytest.raises(linkdyn.SceneError, match="there is no 'legs' in 'chain'.*did you mean 'leg'"):
        unnamed.sweep({"axis": [{"parameter": "chain.legs.lower.mass", "values": [0.4]}], "reduce": ["driving_force"]})


@pytest.mark.parametrize(("table", "says"), [
    ("t,J\n0,0\n1,a\n", "motion.csv:3: "),
    ("t,K\n0,0\n1,1\n", "motion.csv: no column 'J'"),
    ("t,J [m]\n0,0\n1,1\n", "motion.csv: column 'J'"),
    ("t,J\n0,0\n0,1\n", "motion.csv:3: "),
    ("\n", "motion.csv: the table is empty"),
])
def test_faults_of_tables_say_who_reads_them(table: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "crank.toml").write_text(CRANK)
    (tmp_path / "motion.csv").write_text(table)
    done = call(tmp_path, "inverse", "crank.toml")
    assert done.returncode == 2 and done.stderr.startswith(f"crank.toml:{CRANK_MOTION}: coordinate 'J', motion: {says}"), done.stderr


def test_the_reader_is_the_one_that_fails(tmp_path: Path) -> None:
    """A file that the coordinate read well, of which a load asks for a column that is not there."""
    (tmp_path / "crank.toml").write_text(CRANK + '[[load]]\non = "crank.O"\nforce = [{ table = "motion.csv", column = "F" }, 0]\n')
    (tmp_path / "motion.csv").write_text("t,J\n0,0\n1,1\n")
    done = call(tmp_path, "inverse", "crank.toml")
    assert done.stderr.startswith("crank.toml:21: load on 'crank.O', force: motion.csv: no column 'F'"), done.stderr


@pytest.mark.parametrize(("unit", "meant"), [("mpa", "'MPa' or 'mPa'"), ("MPA", "'MPa' or 'mPa'"), ("kpa", "'kPa'"), ("Mrad", "'mrad'"), ("hour", "'h'")])
def test_units_that_may_be_two(unit: str, meant: str) -> None:
    with pytest.raises(linkdyn.SceneError, match=f"did you mean {meant}\\?"):
        linkdyn.Scene(CRANK.replace("mass = 1.0", f'mass = "0.2 {unit}"'))


def test_folders_that_are_not_there(tmp_path: Path) -> None:
    assert call(tmp_path, "new", "four-bar", "-q").returncode == 0
    for command, target in (("generate", "none/m"), ("generate", "none/"), ("inverse", "none/run.nc"), ("draw", "none/x.png")):
        kernel = ["--kernel", "inverse"] if command == "generate" else []
        done = call(tmp_path, command, "four-bar.toml", *kernel, "-o", target)
        assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
        assert "cannot be written: there is no folder 'none" in done.stderr, done.stderr


def test_code_into_a_folder(tmp_path: Path) -> None:
    assert call(tmp_path, "new", "four-bar", "-q").returncode == 0
    (tmp_path / "gen").mkdir()
    done = call(tmp_path, "generate", "four-bar.toml", "--kernel", "inverse", "-o", "gen/")
    assert done.returncode == 0, done.stderr
    assert sorted(file.name for file in (tmp_path / "gen").iterdir()) == ["four-bar_inverse.c", "four-bar_inverse.h"]


def test_transmissions_of_joints_that_are_not_there(tmp_path: Path) -> None:
    robot = """<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="J" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
<transmission name="t"><joint name="I"/></transmission></robot>"""
    (tmp_path / "r.urdf").write_text(robot)
    done = call(tmp_path, "convert", "r.urdf", "-o", "r.toml")
    assert done.returncode == 2 and "r.urdf:3: joint 'I': the robot has no such joint" in done.stderr, done.stderr
