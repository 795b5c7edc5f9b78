"""Scenes from elsewhere: what they hold neither commands a terminal nor makes messages read out other files."""

from __future__ import annotations

import os
import subprocess
import unicodedata
from pathlib import Path

import pytest
import tomli_w

import linkdyn
from linkdyn.cli import executable

EVIL = "\x1b]0;owned\x07\x1b[31m\x08\x7f\u0085\u009b31m\r"
"""Renames the window, turns red, backs up: C0, DEL and C1."""


def commands(text: str) -> set[str]:
    """Characters in a text that control, turn or hide others, but line ends."""
    return {character for character in text if unicodedata.category(character) in {"Cc", "Cf", "Zl", "Zp"} and character != "\n"}


def executed(*arguments: object, cwd: Path) -> subprocess.CompletedProcess:
    return subprocess.run([executable(), *map(os.fsencode, map(str, arguments))], cwd=cwd, capture_output=True, timeout=60)


def with_title(scene: dict) -> dict:
    return scene | {"title": f"A title {EVIL} goes on"}


def with_key(scene: dict) -> dict:
    return scene | {f"key{EVIL}": 1}


def with_name(scene: dict) -> dict:
    scene["link"][0]["name"] = f"link{EVIL}"
    return scene


def with_name_of_the_second_set(scene: dict) -> dict:
    scene["link"][0]["name"] = "plat\u009bform"
    return scene


def with_name_that_turns(scene: dict) -> dict:
    """Right to left, without width, a line of its own, a mark at the beginning: what is read is not what is written."""
    scene["link"][0]["name"] = "plat\u202eform\u200b \u2028 \u2066x\ufeff"
    return scene


def with_word(scene: dict) -> dict:
    return scene | {"space": EVIL}


def with_unit(scene: dict) -> dict:
    scene["link"][0]["mass"] = f"3 {EVIL}"
    return scene


def with_reference(scene: dict) -> dict:
    scene["joint"] = [{"name": "J", "type": "revolute", "between": [f"frame.{EVIL}", f"{EVIL}.a"]}]
    return scene


def with_table(scene: dict) -> dict:
    scene["coordinate"][0]["motion"] = {"table": f"{EVIL.replace('/', '')}.csv"}
    return scene


SCENES = [with_title, with_key, with_name, with_name_of_the_second_set, with_name_that_turns, with_word, with_unit, with_reference, with_table]


@pytest.mark.parametrize("change", SCENES)
def test_scenes_do_not_command_the_terminal(change, tsai, tmp_path):
    text = tomli_w.dumps(change(tsai))
    (tmp_path / "scene.toml").write_text(text)
    for arguments in (["explain", "scene.toml"], ["inverse", "scene.toml", "--no-output"], ["forward", "scene.toml", "--no-output"],
                      ["sweep", "scene.toml"]):
        result = executed(*arguments, cwd=tmp_path)
        said = (result.stdout + result.stderr).decode()    # well-formed UTF-8, too
        assert said and commands(said) == set(), (arguments, said)
        assert result.stderr.count(b"\n") <= 1
    try:
        scene = linkdyn.Scene(text)
        assert commands(scene.explain() + repr(scene)) == set()
    except linkdyn.LinkdynError as error:
        assert commands(str(error)) == set()


def test_what_was_meant_can_be_seen(tsai, tmp_path):
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(with_title(tsai)), encoding="utf-8")
    said = executed("explain", "scene.toml", cwd=tmp_path).stdout.decode()
    assert said.startswith(r"A title \x1B]0;owned\x07\x1B[31m\x08\x7F")


def test_letters_of_all_languages_stay(tsai, tmp_path):
    title = "Größe Ωμέγα 機構 🦾"
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(tsai | {"title": title}), encoding="utf-8")
    assert executed("explain", "scene.toml", cwd=tmp_path).stdout.decode().startswith(title + "\n")
    assert linkdyn.Scene(tsai | {"title": title}).explain().startswith(title)


@pytest.mark.parametrize("header", [b"\x1b[2Jt,x", b"t,\x1b[2J", b"t,x [\x1b[2J]", b"\xff\xfe,x", b"t,\xc2\x9b", b"t,x\n0,\x1b[2J"])
def test_tables_do_not_command_the_terminal(header, tsai, tmp_path):
    (tmp_path / "table.csv").write_bytes(header + b"\n0,1\n1,2\n")
    tsai["coordinate"][0]["motion"] = {"x": {"table": "table.csv"}}
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(tsai))
    result = executed("inverse", "scene.toml", "--no-output", cwd=tmp_path)
    assert result.returncode == 2 and commands(result.stderr.decode()) == set()
    with pytest.raises(linkdyn.SceneError) as error:
        linkdyn.load(tmp_path / "scene.toml")
    assert commands(str(error.value)) == set()


def test_arguments_do_not_command_the_terminal(tmp_path):
    for arguments in ([f"inverse{EVIL}"], ["inverse", f"{EVIL}.toml"], ["inverse", "a.toml", f"--{EVIL}"], ["inverse", "a.toml", "--solver", EVIL]):
        result = executed(*arguments, cwd=tmp_path)
        assert result.returncode == 2 and commands(result.stderr.decode()) == set()


# ---- tables of others

SECRET = "hunter2"
SECRETS = {
    "words": f"superuser:{SECRET}:19000::\nuser:{SECRET}:1\n",
    "one line": SECRET,
    "columns": f"t,{SECRET}\n0,1\n1,2\n",
    "doubles": f"{SECRET},{SECRET}\n0,1\n",
    "number": f"1,{SECRET}\n0,1\n",
    "numbers": "31337,1\n0,1\n",
    "value": f"t,x\n0,{SECRET}\n",
    "unit": f"t,x [{SECRET}]\n0,1\n1,2\n",
    "ragged": f"t,x\n0\n{SECRET}\n",
    "brackets": f"t,[{SECRET}]\n0,1\n",
}


@pytest.mark.parametrize("way", ["absolute", "upwards", "symbolic_link"])
@pytest.mark.parametrize("kind", SECRETS)
def test_a_failed_read_tells_nothing_of_a_foreign_file(kind, way, tsai, tmp_path):
    """A scene that names a file outside its folder learns no more of it than that it is no such table."""
    home, outside = tmp_path / "scene", tmp_path / "outside"
    home.mkdir()
    outside.mkdir()
    (outside / "shadow").write_text(SECRETS[kind])
    name = {"absolute": str(outside / "shadow"), "upwards": "../outside/shadow", "symbolic_link": "link"}[way]
    (home / "link").symlink_to(outside / "shadow")
    tsai["coordinate"][0]["motion"] = {"x": {"table": name}}
    (home / "scene.toml").write_text(tomli_w.dumps(tsai))
    for folder, file in ((home, "scene.toml"), (tmp_path, "scene/scene.toml")):
        said = executed("explain", file, cwd=folder).stderr.decode()
        assert said.count("\n") == 1 and ("shadow" in said or "link" in said)
        assert SECRET not in said and "31337" not in said and "superuser" not in said, said
    with pytest.raises(linkdyn.SceneError) as error:
        linkdyn.load(home / "scene.toml")
    assert SECRET not in str(error.value) and "31337" not in str(error.value)


@pytest.mark.parametrize("kind", [kind for kind in SECRETS if kind not in ("numbers", "ragged", "one line", "brackets")])
def test_a_table_of_ones_own_is_quoted(kind, tsai, tmp_path):
    """Beside the scene, or in a folder there: what is wrong is shown."""
    (tmp_path / "tables").mkdir()
    for name in ("table.csv", "tables/table.csv"):
        (tmp_path / name).write_text(SECRETS[kind])
        tsai["coordinate"][0]["motion"] = {"x": {"table": name}}
        (tmp_path / "scene.toml").write_text(tomli_w.dumps(tsai))
        for folder, file in ((tmp_path, "scene.toml"), (tmp_path / "tables", "../scene.toml")):
            said = executed("explain", file, cwd=folder).stderr.decode()
            assert SECRET[:-1] in said or kind == "number" and "'1'" in said, said


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/urandom"])
def test_files_without_an_end(device, tsai, tmp_path):
    """As a scene, a table or states: read to a limit, then refused."""
    tsai["coordinate"][0]["motion"] = {"x": {"table": device}}
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(tsai))
    for arguments in (["explain", "scene.toml"], ["explain", device]):
        result = executed(*arguments, cwd=tmp_path)
        assert result.returncode == 2 and b"File too large" in result.stderr


def test_a_scene_from_a_pipe(tsai_file, tmp_path):
    """A file that has no size beforehand is read all the same."""
    with tsai_file.open("rb") as scene:
        result = subprocess.run([executable(), "explain", "/dev/stdin"], stdin=scene, capture_output=True, timeout=60)
    assert result.returncode == 0
    piped = subprocess.run([executable(), "explain", "/dev/stdin"], input=tsai_file.read_bytes(), capture_output=True, timeout=60)
    assert piped.stdout == result.stdout
