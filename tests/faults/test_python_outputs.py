"""Whatever Python writes, by command or by call: nothing is destroyed but what the user wants replaced, nothing is left half-written."""

from __future__ import annotations

import contextlib
import io
import os
import resource
import signal
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest
from matplotlib import pyplot

import linkdyn
from linkdyn import cli, plot
from linkdyn._commands.assemblies import assemblies_command
from linkdyn._commands.balance import balance_command
from linkdyn._commands.convert import convert_command
from linkdyn._commands.draw import draw_command
from linkdyn._commands.new import new_command
from linkdyn._output import write_output
from linkdyn._commands.view import view_command

pytestmark = pytest.mark.python_alone

ROOT = Path(__file__).resolve().parents[2]
FOURBAR = (ROOT / "examples" / "fourbar" / "scene.toml").read_text()
LOAD = '[[load]]\non = "coupler.J5"\ntable = "load.csv"\n'


def load() -> linkdyn.Scene:
    return linkdyn.load("scene.toml")


def run():
    return load().inverse()


def by_command(command: Callable[[list[str]], int], *words: str) -> Callable[[str], None]:
    """What it says where it refuses is raised, as calls do."""

    def write(target: str) -> None:
        said = io.StringIO()
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            code = command([*words, target])
        if code != 0:
            assert code == 2 and said.getvalue().count("\n") == 1 and said.getvalue().startswith("linkdyn: "), said.getvalue()
            raise linkdyn.FileError(said.getvalue().strip())

    return write


def with_sheet(arguments: list[str]) -> int:
    return cli._run_with_sheet(cli.executable(), arguments)


WRITERS: dict[str, tuple[str, Callable[[str], object]]] = {
    "draw": (".png", by_command(draw_command, "scene.toml", "-o")),
    "view": (".html", by_command(view_command, "scene.toml", "--no-open", "-o")),
    "assemblies": (".svg", by_command(assemblies_command, "scene.toml", "--picture")),
    "balance": (".pdf", by_command(balance_command, "scene.toml", "-o")),
    "convert": (".xml", by_command(convert_command, "scene.toml", "--force", "-o")),
    "new": (".toml", by_command(new_command, "four-bar", "--force", "-o")),
    "--sheet": (".html", by_command(with_sheet, "inverse", "scene.toml", "-q", "-o", "run.nc", "--sheet")),
    "sheet": (".pdf", lambda target: linkdyn.sheet(run(), target)),
    "linkdyn.view": (".html", lambda target: linkdyn.view(run(), target)),
    "linkdyn.view of a scene": (".html", lambda target: linkdyn.view(load(), target)),
    "animate": (".gif", lambda target: plot.animate(run(), target, frames=2)),
    "to_csv": (".csv", lambda target: run().linkdyn.to_csv(target)),
    "to_parquet": (".parquet", lambda target: run().linkdyn.to_parquet(target)),
    "to_toml": (".toml", lambda target: linkdyn.Builder.of("scene.toml").to_toml(target)),
    "Conversion.write": (".xml", lambda target: linkdyn.convert(load()).write(target)),
    "GeneratedCode.write": (".c", lambda target: load().generate(name=target.removesuffix(".c")).write(".")),
}
READS = [name for name in WRITERS if name not in ("new", "to_toml")]
"""Writers of what was computed from files. A builder is there to change its scene, and may replace it."""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Iterator[Path]:
    """With a scene, a file that it includes, and a table."""
    first, rest = FOURBAR.split("[frame]")
    scene = "[frame]" + rest.partition("[[load]]")[0]
    (tmp_path / "part.toml").write_text('[variables]\nd = "2 s"\n')
    (tmp_path / "load.csv").write_text("t,Fx\n0,100\n10,100\n")
    (tmp_path / "scene.toml").write_text(f'include = "part.toml"\n{first}[time]\nend = 4\nsamples = 21\n\n{scene}{LOAD}')
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    pyplot.close("all")


@pytest.fixture(params=WRITERS)
def writer(request) -> tuple[str, Callable[[str], object]]:
    if request.param == "to_parquet":
        pytest.importorskip("pyarrow")
    return WRITERS[request.param]


def left_over(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if ".part" in path.name and path.name != "part.toml"]


# ---- what is no regular file, links


def test_pipes_are_written_through(writer, folder):
    ending, write = writer
    pipe = folder / f"pipe{ending}"
    os.mkfifo(pipe)
    got = bytearray()
    reader = threading.Thread(target=lambda: got.extend(pipe.read_bytes()), daemon=True)
    reader.start()
    write(pipe.name)
    reader.join(timeout=30)
    assert len(got) > 100 and stat.S_ISFIFO(pipe.lstat().st_mode)


@pytest.mark.thorough
def test_links_are_followed(writer, folder, devices):
    ending, write = writer
    (folder / "data").mkdir()
    for name, target in (("there", "data/there"), ("new", "first"), ("first", "data/new")):
        (folder / f"{name}{ending}").symlink_to(f"{target}{ending}")
    (folder / f"null{ending}").symlink_to(devices / "null")
    there = folder / "data" / f"there{ending}"
    there.write_text("earlier")
    there.chmod(0o640)
    for name in ("there", "new", "null"):
        write(f"{name}{ending}")
    assert all((folder / f"{name}{ending}").is_symlink() for name in ("there", "new", "first", "null"))
    assert stat.S_ISCHR((devices / "null").lstat().st_mode) and stat.S_IMODE(there.stat().st_mode) == 0o640
    assert {path.name for path in (folder / "data").iterdir()} == {f"there{ending}", f"new{ending}"}
    assert there.stat().st_size > 100 and (folder / "data" / f"new{ending}").stat().st_size > 100


def test_folders_are_refused(writer, folder):
    ending, write = writer
    (folder / f"x{ending}").mkdir()
    with pytest.raises(linkdyn.FileError, match=f"x{ending}: cannot be written: is a folder"):
        write(f"x{ending}")
    assert not list((folder / f"x{ending}").iterdir()) and not left_over(folder)


# ---- inputs


@pytest.mark.parametrize("source", ["scene.toml", "load.csv", "part.toml"])
@pytest.mark.parametrize("name", READS)
def test_no_output_is_an_input(name, source, folder):
    if name == "to_parquet":
        pytest.importorskip("pyarrow")
    ending, write = WRITERS[name]
    target = f"other{ending}"
    (folder / target).symlink_to(source)
    before = (folder / source).read_bytes()
    words = {"scene.toml": "is the scene file", "load.csv": "is a table of the scene", "part.toml": "is included by the scene"}
    with pytest.raises(linkdyn.FileError, match=f"{target}: cannot be written: {words[source]}"):
        write(target)
    assert (folder / source).read_bytes() == before and (folder / target).is_symlink()


def test_a_scene_with_the_name_of_its_own_output(folder):
    (folder / "sc.html").write_bytes((folder / "scene.toml").read_bytes())
    for command, words in ((with_sheet, ["inverse", "sc.html", "-q", "--sheet"]), (view_command, ["sc.html", "--no-open", "-o"])):
        with pytest.raises(linkdyn.FileError, match="is the scene file"):
            by_command(command, *words)("sc.html")
    assert (folder / "sc.html").read_bytes() == (folder / "scene.toml").read_bytes()
    assert not (folder / "sc.nc").exists()    # found out before the run


@pytest.mark.parametrize("name", ["to_csv", "linkdyn.view", "view", "sheet", "--sheet"])
def test_results_that_were_read_stay(name, folder):
    results = run()
    results.to_netcdf("run.html")
    read = linkdyn.read("run.html")
    before = (folder / "run.html").read_bytes()
    write = {
        "to_csv": read.linkdyn.to_csv, "linkdyn.view": lambda target: linkdyn.view(read, target), "sheet": lambda target: linkdyn.sheet(read, target),
        "view": by_command(view_command, "run.nc", "--no-open", "-o"), "--sheet": by_command(with_sheet, "inverse", "scene.toml", "-q", "-o", "run.html", "--sheet"),
    }[name]
    (folder / "run.nc").symlink_to("run.html")
    with pytest.raises(linkdyn.FileError, match="run.html: cannot be written: is the file of results"):
        write("run.html")
    assert (folder / "run.html").read_bytes() == before


def test_variants_of_a_scene_know_its_file(folder):
    with pytest.raises(linkdyn.FileError, match="is the scene file"):
        load().with_({"time.end": 1}).inverse().linkdyn.to_csv("scene.toml")


def test_builders_do_not_replace_tables():
    with pytest.raises(linkdyn.FileError, match="is a table of the scene"):
        linkdyn.Builder.of("scene.toml").to_toml("load.csv")


def test_robots_are_not_replaced_by_their_scenes(folder):
    robot = folder / "robot.urdf"
    robot.write_text(ROBOT)
    before = robot.read_bytes()
    (folder / "robot.toml").symlink_to("robot.urdf")
    with pytest.raises(linkdyn.FileError, match="is the file of the robot"):
        by_command(convert_command, "robot.urdf", "--force", "-o")("robot.toml")
    assert robot.read_bytes() == before


ROBOT = """<robot name="r"><link name="base"/><link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="J" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint></robot>"""


# ---- no room


@pytest.fixture()
def little_room() -> Iterator[None]:
    """As `ulimit -f`; Python ignores the signal."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("name", [name for name in WRITERS if name not in ("--sheet", "GeneratedCode.write")])
def test_limit_on_files_is_a_full_disk(name, folder, request):
    """Of the others the results, or what the code is made in, would not fit either."""
    if name == "to_parquet":
        pytest.importorskip("pyarrow")
    ending, write = WRITERS[name]
    target = folder / f"out{ending}"
    target.write_text("earlier")
    write(f"warm{ending}")    # caches of fonts are files, too
    request.getfixturevalue("little_room")
    with pytest.raises(linkdyn.FileError, match=f"out{ending}: cannot be written: File too large"):
        write(f"out{ending}")
    assert target.read_text() == "earlier" and not left_over(folder)


def test_full_device(writer, folder, devices):
    ending, write = writer
    (folder / f"full{ending}").symlink_to(devices / "full")
    with pytest.raises(linkdyn.FileError, match=f"full{ending}: cannot be written: No space left on device"):
        write(f"full{ending}")


@pytest.mark.parametrize("words", [["draw", "scene.toml"], ["assemblies", "scene.toml"], ["new"], ["new", "arm", "-o", "-"], ["inverse", "scene.toml", "-q", "--sheet", "x.html"]], ids=" ".join)
def test_full_standard_output(words, devices):
    with (devices / "full").open("wb") as full:
        result = subprocess.run([sys.executable, "-m", "linkdyn", *words], stdout=full, stderr=subprocess.PIPE, timeout=120)
    is_silent = "-q" in words    # nothing is written
    assert (result.returncode, result.stderr) == ((0, b"") if is_silent else (2, b"linkdyn: standard output: cannot be written: No space left on device\n"))


def test_parts_of_killed_processes_are_removed(folder):
    gone = subprocess.Popen(["true"])
    gone.wait()
    mine, others = f"x.csv.{gone.pid}@{os.uname().nodename}.part", [f"x.csv.{os.getppid()}@{os.uname().nodename}.part", f"x.csv.{gone.pid}@elsewhere.part"]
    trap = f"x.csv.{os.getpid()}@{os.uname().nodename}.part"
    for name in (mine, *others):
        (folder / name).write_text("")
    (folder / trap).symlink_to("scene.toml")
    scene = (folder / "scene.toml").read_bytes()
    write_output("x.csv", "text")
    assert sorted(path.name for path in left_over(folder)) == sorted(others)
    assert (folder / "x.csv").read_text() == "text" and (folder / "scene.toml").read_bytes() == scene


# ---- terminals, signals


def executed(*words: str) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-m", "linkdyn", *words], capture_output=True, timeout=120)


@pytest.mark.thorough
@pytest.mark.parametrize("words", [["draw"], ["view", "--no-open"], ["assemblies", "--picture", "x\x1b.png"], ["balance"], ["balance", "-o", "x\x1b.png"],
                                   ["inverse", "--sheet", "x\x1b\u009b.pdf"], ["draw", "-o", "no\x1b/x.png"], ["draw", "--at", "\x1b1"],
                                   ["view", "-o", "no\x1b/x.html"], ["convert", "-o", "x\x1b.xml"]], ids=" ".join)  # fmt: skip
def test_scenes_do_not_command_the_terminal(words, folder):
    scene = folder / "sc\x1b]0;owned\x07.toml"
    scene.write_text(r'title = "T \u001b]0;owned\u0007 \u009b31m"' + "\n" + FOURBAR.split("\n", 1)[1])
    result = executed(words[0], scene.name, *words[1:])
    said = result.stdout + result.stderr
    assert b"\x1b" not in said and b"\x07" not in said and "\u009b".encode() not in said and said, said
    assert b"Glyph" not in said and b"Traceback" not in said


def test_titles_do_not_break_pictures(folder):
    """XML has no place for control characters."""
    (folder / "evil.toml").write_text(FOURBAR.replace("Starting", r"\u001b]0;owned\u0007"))
    assert executed("draw", "evil.toml", "-o", "x.svg").returncode == 0 and executed("assemblies", "evil.toml", "--picture", "y.svg").returncode == 0
    for name in ("x.svg", "y.svg"):
        text = (folder / name).read_text()
        assert ElementTree.fromstring(text) is not None and r"\x1B]0;owned\x07" in text


def test_new_does_not_command_the_terminal(folder):
    assert executed("new", "arm", "-o", "x\x1b.toml").stdout.splitlines()[0] == rb"  scene            x\x1B.toml"
    said = executed("new", "arm", "-o", b"x\xff.toml").stdout.splitlines()
    assert said[0] == rb"  scene            x\xFF.toml"


@pytest.mark.parametrize("words", [["draw", "scene.toml"], ["view", "scene.toml", "--no-open"], ["assemblies", "scene.toml"], ["explain", "scene.toml", "--matrix"],
                                   ["inverse", "scene.toml", "--sheet", "x.html"]], ids=" ".join)  # fmt: skip
@pytest.mark.parametrize("delay", [0.05, 0.2, 0.5])
def test_interrupts_while_a_command_starts(words, delay, folder):
    """Told from the outside once Python is up: its own first steps are not ours."""
    program = "import sys, linkdyn.cli as cli; sys.argv = ['linkdyn', *sys.argv[1:]]; print('up', flush=True); cli.main()"
    with subprocess.Popen([sys.executable, "-c", program, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"up\n"
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=60)[1]
    assert b"Traceback" not in said and b"KeyboardInterrupt" not in said
    assert process.returncode in (0, -signal.SIGINT, 130)
