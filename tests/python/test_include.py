"""Scenes in several files: the joined scene is the one written in one file, messages name file and line, nothing foreign is told."""

from __future__ import annotations

import os
import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import linkdyn
from linkdyn.cli import executable

ROOT = Path(__file__).resolve().parents[2]
WHOLE = (ROOT / "tests" / "scenes" / "variables.toml").read_text()
MAIN, PARTS = WHOLE[: WHOLE.index("[variables]")], WHOLE[WHOLE.index("[variables]") :]


def write(folder: Path, **files: str) -> Path:
    """Files by their names without the ending; the scene's path."""
    for name, text in files.items():
        path = folder / f"{name}.toml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder / "scene.toml"


def command(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess:
    return subprocess.run([executable(), *map(str, arguments)], capture_output=True, text=True, timeout=60, cwd=cwd)


def refused(scene: Path) -> str:
    """The one line with which a scene is refused, by the command and by Python."""
    result = command("explain", scene)
    assert result.returncode == 2 and result.stdout == "" and result.stderr.count("\n") == 1, result
    with pytest.raises(linkdyn.SceneError) as caught:
        linkdyn.load(scene)
    assert str(caught.value) == result.stderr.rstrip("\n").removeprefix("linkdyn: ")
    return result.stderr


def same(one: linkdyn.Scene, other: linkdyn.Scene) -> None:
    """Bit for bit."""
    a, b = one.inverse(), other.inverse()
    assert set(a) == set(b) and (a.status == 0).all()
    for name in a.variables:
        assert a[name].values.tobytes() == b[name].values.tobytes(), name


def pieces(text: str) -> list[str]:
    """The scene cut before each [[link]] and [[joint]]."""
    return ["[[" + part if i else part for i, part in enumerate(text.split("[["))]


def test_two_files_are_one(tmp_path):
    scene = write(tmp_path, scene='include = "parts.toml"\n' + MAIN, parts=PARTS)
    same(linkdyn.load(scene), linkdyn.Scene(WHOLE))
    assert command("inverse", scene, "--no-output").returncode == 0


def test_files_in_folders_and_lists(tmp_path):
    head, *tables = pieces(PARTS)
    links, others = [t for t in tables if t.startswith("[[link")], [t for t in tables if not t.startswith("[[link")]
    scene = write(
        tmp_path, scene='include = ["parts/values.toml", "parts/joints.toml"]\n' + MAIN,
        **{"parts/values": 'include = "deeper/links.toml"\n' + head, "parts/deeper/links": "".join(links), "parts/joints": "".join(others)},
    )  # fmt: skip
    for folder, name in ((tmp_path, "scene.toml"), (tmp_path / "parts", "../scene.toml"), (tmp_path, scene)):
        assert command("inverse", name, "--no-output", cwd=folder).returncode == 0
    same(linkdyn.load(scene), linkdyn.Scene(WHOLE))


def test_tables_of_both_files_are_merged(tmp_path):
    variables = tomllib.loads(WHOLE)["variables"]
    first = {name: variables[name] for name in ("r", "ratio", "g")}
    lines = lambda table: "[variables]\n" + "".join(f"{k} = {v!r}\n" for k, v in table.items())  # noqa: E731
    rest = PARTS[PARTS.index("[frame]") :]
    scene = write(
        tmp_path, scene='include = "values.toml"\n' + MAIN + lines(first) + rest,
        values=lines({k: v for k, v in variables.items() if k not in first}),
    )  # fmt: skip
    same(linkdyn.load(scene), linkdyn.Scene(WHOLE))


def test_arrays_of_tables_are_appended_in_order(tmp_path):
    head, *tables = pieces(PARTS)
    scene = write(tmp_path, scene='include = ["a.toml", "b.toml"]\n' + MAIN + head + tables[0], a="".join(tables[1:4]), b="".join(tables[4:]))
    assert linkdyn.load(scene).links == ("crank", "rod", "piston")
    same(linkdyn.load(scene), linkdyn.Scene(WHOLE))


def test_a_text_or_dict_includes_from_its_folder(tmp_path):
    write(tmp_path, parts=PARTS)
    text = 'include = "parts.toml"\n' + MAIN
    for source in (text, tomllib.loads(text)):
        same(linkdyn.Scene(source, folder=tmp_path), linkdyn.Scene(WHOLE))
        with pytest.raises(linkdyn.SceneError, match=r"include './parts.toml': there is no such file"):
            linkdyn.Scene(source)


# ---- what is kept


def test_what_is_kept_needs_no_other_file(tmp_path):
    scene = linkdyn.load(write(tmp_path, scene='include = "parts.toml"\n' + MAIN, parts=PARTS))
    command("inverse", tmp_path / "scene.toml", "--output", tmp_path / "run.nc")
    for file in tmp_path.glob("*.toml"):
        file.unlink()
    with xr.open_dataset(tmp_path / "run.nc") as run:
        kept = run.attrs["scene"]
    assert kept == scene.text == scene.inverse().attrs["scene"] and "include" not in tomllib.loads(kept)
    same(linkdyn.Scene(kept), linkdyn.Scene(WHOLE))
    same(scene.with_({"variables.r": 0.06}), linkdyn.Scene(WHOLE).with_({"variables.r": 0.06}))


def test_every_kind_of_value_is_written_anew(tmp_path):
    """Numbers to the last bit, texts with quotes and line ends, keys that need quotes, lists and tables inside each other."""
    part = '''
title = "a \\"quoted\\" 'title' \\\\ with\\nends ü"
[frame]
markers = { "a-key" = { at = [0.1, 1e-300], axis = [3, 4] }, plain = [-0.0, 12345678901234567890.0] }
[[link]]
name = "arm"
mass = 0.30000000000000004
cog = ["12 mm", 0x10]
inertia_check = false
markers = { x = [0, 0] }
inertia = 1e22
'''
    rest = """
[[joint]]
name = "J"
type = "revolute"
between = ["frame.plain", "arm.x"]

[[coordinate]]
joint = "J"
"""
    scene = write(tmp_path, scene='include = "part.toml"\nspace = "planar"\n' + rest, part=part)
    opened = linkdyn.load(scene)
    content = tomllib.loads(opened.text)
    assert content["title"] == tomllib.loads(part)["title"]
    expected = tomllib.loads(part)["frame"]["markers"]
    assert content["frame"]["markers"] == expected
    assert content["link"][0]["mass"] == 0.30000000000000004 and content["link"][0]["cog"] == ["12 mm", 16]
    assert list(content["link"][0]) == ["name", "mass", "cog", "inertia_check", "markers", "inertia"]    # as written


def test_tables_lie_beside_the_file_that_names_them(tmp_path):
    rows = "t, J1 [deg]\n" + "".join(f"{0.1 * i}, {10 * i + i * i}\n" for i in range(11))
    motion = PARTS.replace('{ law = "constant-rate", rate = "60 rpm" }', '{ table = "motion.csv" }')
    write(tmp_path, scene='include = "machine/parts.toml"\n' + MAIN, **{"machine/parts": motion}, one=MAIN + motion)
    (tmp_path / "machine" / "motion.csv").write_text(rows)
    joined = linkdyn.load(tmp_path / "scene.toml")
    assert 'table = "machine/motion.csv"' in joined.text
    (tmp_path / "motion.csv").write_text(rows)
    same(joined, linkdyn.load(tmp_path / "one.toml"))
    result = command("inverse", tmp_path / "scene.toml", "--output", tmp_path / "machine" / "motion.csv")
    assert result.returncode == 2 and "is a table of the scene" in result.stderr


def test_results_do_not_replace_an_included_file(tmp_path):
    scene = write(tmp_path, scene='include = "parts.toml"\n' + MAIN, parts=PARTS)
    result = command("inverse", scene, "--output", tmp_path / "parts.toml")
    assert result.returncode == 2 and "is included by the scene" in result.stderr
    assert (tmp_path / "parts.toml").read_text() == PARTS


SWEEP = """
[sweep]
[[sweep.axis]]
parameter = "variables.r"
linspace = [0.03, 0.06, 4]
[[sweep.axis]]
time = true
linspace = [0, 1, 9]
"""


def test_sweeps_of_several_files(tmp_path):
    scene = write(tmp_path, scene='include = ["parts.toml", "study.toml"]\n' + MAIN, parts=PARTS, study=SWEEP)
    a, b = linkdyn.load(scene).sweep(), linkdyn.Scene(WHOLE + SWEEP).sweep()
    np.testing.assert_array_equal(a.driving_force_max, b.driving_force_max)
    assert command("sweep", scene, "--output", tmp_path / "a.nc", "--yes").returncode == 0
    # A design that is none is told with the line of the file that has the fault.
    bad = PARTS.replace('mass = "m"', 'mass = "m - 0.4 kg"')
    write(tmp_path, parts=bad)
    result = command("sweep", scene, "--output", tmp_path / "b.nc", "--yes")
    line = 1 + bad[: bad.index('mass = "m - 0.4 kg"')].count("\n")
    assert f"{tmp_path}/parts.toml:{line}: link 'rod'" in result.stdout + result.stderr


# ---- refusals


@pytest.mark.parametrize(
    ("files", "place", "fragment"),
    [
        ({"scene": 'include = "missing.toml"\n'}, "scene.toml:1", "missing.toml': there is no such file"),
        ({"scene": 'include = "."\n'}, "scene.toml:1", "this is a directory"),
        ({"scene": 'include = ""\n'}, "scene.toml:1", "is empty (expected the name of a file)"),
        ({"scene": "include = 3\n"}, "scene.toml:1", "is an integer (expected the name of a file, or a list of names)"),
        ({"scene": "\ninclude = [\n3]\n"}, "scene.toml:3", "holds an integer (expected names of files)"),
        ({"scene": 'include = "scene.toml"\n'}, "scene.toml:1", "is part of the scene already, as the file itself"),
        ({"scene": 'include = "a.toml"\n', "a": '\ninclude = "b.toml"\n', "b": '\n\ninclude = "./scene.toml"\n'}, "b.toml:3", "is part of the scene already"),
        ({"scene": 'include = "a.toml"\n', "a": 'include = "a.toml"\n'}, "a.toml:1", "is part of the scene already (expected each file once)"),
        ({"scene": 'include = ["a.toml", "a.toml"]\n', "a": "\n"}, "scene.toml:1", "is part of the scene already"),
        ({"scene": f'include = "{"x" * 2000}"\n'}, "scene.toml:1", "is longer than 1024 letters"),
        ({"scene": 'include = "a0.toml"\n'} | {f"a{i}": f'include = "a{i + 1}.toml"\n' for i in range(20)}, "a14.toml:1", "one too deep"),
        ({"scene": f"include = {[f'a{i}.toml' for i in range(120)]}\n"} | {f"a{i}": "\n" for i in range(120)}, "scene.toml:1", "one too many"),
        ({"scene": 'include = "a.toml"\n', "a": "\n\n[[link\n"}, "a.toml:3", "this is not TOML"),
        ({"scene": 'title = "x"\ninclude = "a.toml"\n', "a": '\ntitle = "y"\n'}, "a.toml:2", "key 'title' is there already, on line 1 of "),
        ({"scene": 'include = "a.toml"\n[variables]\nr = 1\n', "a": "[variables]\nq = 1\nr = 2\n"}, "a.toml:3", "key 'variables.r' is there already, on line 3 of "),
        ({"scene": 'include = ["a.toml", "b.toml"]\n', "a": "link = []\n", "b": "[[link]]\n"}, "b.toml:1", "key 'link' is there already, on line 1 of "),
        ({"scene": 'include = "a.toml"\nspace = "planar"\n[[link]]\nname = "a"\nmass = 1\n', "a": '\n[[link]]\nname = "a"\nmass = 1\n'}, "a.toml:2",
         "there is another link of that name on line 3 of "),
        ({"scene": 'include = "a.toml"\nspace = "planar"\n[[link]]\nname = "a"\nmass = 1\n', "a": '\n[[link]]\nname = "b"\nmas = 1\n'}, "a.toml:4", "did you mean 'mass'?"),
        ({"scene": 'include = "a.toml"\nspace = "planar"\n[[link]]\nname = "a"\nmass = "w"\n', "a": "\n[variables]\nw = \"3 mm\"\n"}, "scene.toml:5", "'w' is a length"),
        ({"scene": 'include = "a.toml"\nspace = "planar"\n[[link]]\nname = "a"\nmass = "q"\n', "a": "\n[variables]\nq = \"3 m +\"\n"}, "a.toml:3", "variable 'q'"),
        ({"scene": 'include = "a.toml"\nspace = "planar"\n', "a": "\nstudy = 1\n"}, "a.toml:2", "unknown key 'study'"),
    ],
)  # fmt: skip
def test_faults_are_told_with_file_and_line(files, place, fragment, tmp_path):
    said = refused(write(tmp_path, **files))
    assert f"{tmp_path}/{place}: " in said and fragment in said, said


def test_hostile_paths(tmp_path):
    home = tmp_path / "home"
    (tmp_path / "outside").mkdir()
    for name in ("/dev/zero", "/dev/urandom"):
        assert "File too large" in refused(write(home, scene=f'include = "{name}"\n'))
    for name in ("\\u001b[31m", "a\\nb", "\\u0000", "~/x", "*.toml", "-o"):
        refused(write(home, scene=f'include = "{name}"\n'))
    fifo = home / "pipe"
    os.mkfifo(fifo)
    writer = subprocess.Popen(["sh", "-c", f"echo 'title = 3' > '{fifo}'"])
    result = command("explain", write(home, scene='include = "pipe"\nspace = "planar"\n'))
    writer.wait(timeout=10)
    assert result.returncode == 2 and "pipe:1: key 'title'" in result.stderr


SECRETS = ["hunter2", "[hunter2]\na = 1\n", "hunter2 = 1\n", 'title = "x"\nhunter2 = 1\n', "key = hunter2\n", "superuser:hunter2:19000::\n", "a = [hunter2\n"]


@pytest.mark.parametrize("way", ["absolute", "upwards", "symbolic link", "nested"])
@pytest.mark.parametrize("secret", SECRETS)
def test_nothing_is_told_of_a_foreign_file(secret, way, tmp_path):
    home, outside = tmp_path / "home", tmp_path / "outside"
    home.mkdir()
    outside.mkdir()
    (outside / "shadow").write_text(secret)
    (home / "link").symlink_to(outside / "shadow")
    name = {"absolute": outside / "shadow", "upwards": "../outside/shadow", "symbolic link": "link", "nested": "../outside/shadow"}[way]
    if way == "nested":
        scene = write(home, scene='include = "part.toml"\nspace = "planar"\n', part=f'include = "{name}"\n')
    else:
        scene = write(home, scene=f'include = "{name}"\nspace = "planar"\n')
    said = refused(scene)
    assert "hunter2" not in said and "superuser" not in said and ("shadow" in said or "link" in said), said


def test_parts_shared_by_scenes_lie_outside(tmp_path):
    """A file outside the scene's folder that holds parts of a scene is as good as another."""
    home = tmp_path / "home"
    scene = write(home, scene='include = "../common/parts.toml"\n' + MAIN)
    write(tmp_path, **{"common/parts": PARTS})
    same(linkdyn.load(scene), linkdyn.Scene(WHOLE))
