"""What `-o` may name: whatever it is, nothing is destroyed but what the user wants replaced, and nothing is left half-written."""

from __future__ import annotations

import os
import resource
import signal
import socket
import stat
import subprocess
import threading
import time
from pathlib import Path

import pytest
import tomli_w
import xarray as xr

from linkdyn.cli import executable

KINDS = {"nc": [], "csv": ["--csv"]}


def quick(scene: Path, target: object, kind: str) -> list[str]:
    return ["inverse", str(scene), "-q", "-o", str(target), *KINDS[kind]]


@pytest.fixture(params=["forward", "inverse", "sweep"])
def writing_command(request, tsai, tmp_path) -> list[str]:
    """A command that writes, on a scene that it takes little time for."""
    tsai["sweep"] = {"axis": [{"coordinate": "platform.x", "linspace": [-1.6, -1.4, 5]}]}
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(tsai))
    until = ["--until", "0.001", "--samples", "2"] if request.param == "forward" else []
    return [request.param, "scene.toml", "-q", *until]


# ---- what is no regular file


@pytest.mark.parametrize("kind", KINDS)
def test_pipe_is_written_through(kind, program, scene, tmp_path):
    """A reader at the other end gets the whole file, and the pipe stays a pipe."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got = bytearray()
    reader = threading.Thread(target=lambda: got.extend(pipe.read_bytes()))
    reader.start()
    assert program(*quick(scene, pipe, kind)).returncode == 0
    reader.join()
    assert stat.S_ISFIFO(pipe.lstat().st_mode)
    copy = tmp_path / "copy"
    copy.write_bytes(got)
    if kind == "csv":
        assert got.startswith(b"time [s],") and got.count(b"\n") > 100
    else:
        assert xr.load_dataset(copy).sizes["sample"] > 100


@pytest.mark.parametrize("link", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_device_is_never_replaced(kind, link, program, scene, devices, tmp_path):
    """A rename over a device would destroy it."""
    (tmp_path / "link").symlink_to(devices / "null")
    result = program(*quick(scene, tmp_path / "link" if link else devices / "null", kind))
    assert result.returncode == 0, result.stderr
    assert stat.S_ISCHR((devices / "null").lstat().st_mode)


def test_standard_output_redirected_to_a_file(scene, tmp_path):
    """The table and the summary behind it, in the file that the shell has opened."""
    log = tmp_path / "log"
    log.write_text("earlier\n")
    with log.open("a") as file:
        command = [executable(), "inverse", scene, "--csv", "-o", "/proc/self/fd/1"]
        assert subprocess.run(command, stdout=file, timeout=60).returncode == 0
    lines = log.read_text().splitlines()
    assert lines[0] == "earlier" and lines[1].startswith("time [s],") and lines[-1].endswith("/proc/self/fd/1")


def test_reader_that_leaves(scene):
    """A pipe that nobody reads is a write error, in one line."""
    with subprocess.Popen(
        [executable(), "inverse", scene, "--csv", "-q", "-o", "/proc/self/fd/1"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        process.stdout.close()
        assert process.stderr.read() == b"/proc/self/fd/1: cannot be written: Broken pipe\n"
        assert process.wait(timeout=60) == 2


def test_socket_is_refused(refused, scene, tmp_path):
    with socket.socket(socket.AF_UNIX) as end:
        end.bind(str(tmp_path / "socket"))
        refused("inverse", "scene.toml", "--csv", "-o", "socket", says="socket: cannot be written", cwd=tmp_path)
    assert stat.S_ISSOCK((tmp_path / "socket").lstat().st_mode)


def test_folder_is_refused(writing_command, refused, names, tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to("folder")
    for target in ("folder", "link", "."):
        refused(*writing_command, "-o", target, says=f"{target}: cannot be written: is a folder", cwd=tmp_path)
    assert names() == ["folder", "link", "scene.toml"] and not list((tmp_path / "folder").iterdir())


def test_a_sweep_wants_a_file(refused, tsai, devices, tmp_path):
    """Its checkpoint stands beside it."""
    tsai["sweep"] = {"axis": [{"coordinate": "platform.x", "linspace": [-1.6, -1.4, 5]}]}
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(tsai))
    refused("sweep", "scene.toml", "-o", devices / "null", says="is a device or a pipe", cwd=tmp_path)


# ---- links


def test_links_are_followed(writing_command, program, tmp_path):
    """The file behind the link is written, be it there or not; the link stays."""
    (tmp_path / "data").mkdir()
    (tmp_path / "there").symlink_to("data/there.out")
    (tmp_path / "data" / "there.out").write_text("earlier results")
    (tmp_path / "dangling").symlink_to("first")
    (tmp_path / "first").symlink_to(tmp_path / "data" / "new.out")
    for link in ("there", "dangling"):
        result = program(*writing_command, "-o", link, cwd=tmp_path)
        assert result.returncode == 0, result.stderr
        assert (tmp_path / link).is_symlink() and (tmp_path / "first").is_symlink()
    sizes = {path.name: path.stat().st_size for path in (tmp_path / "data").iterdir()}
    assert set(sizes) == {"there.out", "new.out"} and min(sizes.values()) > 100


def test_circle_of_links(refused, scene, tmp_path):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    refused("inverse", scene, "-o", tmp_path / "a", says=("cannot be written", "symbolic links"))


def test_permissions_are_kept(program, scene, tmp_path):
    target = tmp_path / "run.csv"
    target.write_text("")
    target.chmod(0o640)
    assert program(*quick(scene, target, "csv")).returncode == 0
    assert stat.S_IMODE(target.stat().st_mode) == 0o640


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_read_only_file_is_not_replaced(refused, scene, tmp_path):
    target = tmp_path / "run.csv"
    target.write_text("kept")
    target.chmod(0o440)
    refused(*quick(scene, target, "csv"), says="Permission denied")
    assert target.read_text() == "kept"


# ---- inputs


@pytest.fixture()
def press(tsai, tmp_path) -> Path:
    """A scene with a table that has the name of its own results."""
    (tmp_path / "press.csv").write_text("t,Fz\n0,0\n1,-10\n")
    tsai["load"] = [{"on": "platform.P1", "table": "press.csv"}]
    tsai["time"] = {"end": 1, "samples": 5}
    tsai["sweep"] = {"axis": [{"coordinate": "platform.x", "linspace": [-1.6, -1.4, 5]}]}
    (tmp_path / "press.toml").write_text(tomli_w.dumps(tsai))
    return tmp_path


@pytest.mark.parametrize("command", [["inverse", "--csv"], ["forward", "--csv", "--until", "0.001"]], ids=lambda command: command[0])
def test_default_name_is_not_the_scenes_own_table(command, refused, press):
    before = (press / "press.csv").read_bytes()
    refused(command[0], "press.toml", *command[1:], says=("press.csv: cannot be written", "table of the scene"), cwd=press)
    assert (press / "press.csv").read_bytes() == before


@pytest.mark.parametrize("way", ["name", "other_name", "hard_link", "symbolic_link"])
@pytest.mark.parametrize(
    ("command", "role"),
    [("inverse", "states"), *((command, role) for command in ("inverse", "forward", "study", "sweep") for role in ("scene", "table"))],
)
def test_no_output_is_an_input(command, role, way, refused, press):
    source = {"scene": "press.toml", "table": "press.csv", "states": "states.csv"}[role]
    (press / "states.csv").write_text("".join(f"{','.join(row)}\n" for row in (
        [f"q platform.{name}" for name in ("x", "y", "z", "roll", "pitch", "yaw")], ["-1.5", "0", "1", "0", "0", "0"])))
    target = {"name": source, "other_name": f"../{press.name}/{source}", "hard_link": "hard", "symbolic_link": "soft"}[way]
    if way == "hard_link":
        (press / "hard").hardlink_to(press / source)
    if way == "symbolic_link":
        (press / "soft").symlink_to(source)
    before = (press / source).read_bytes()
    more = {"inverse": ["--states", "states.csv"] if role == "states" else [], "forward": ["--until", "0.001"],
            "study": ["--until", "0.001"], "sweep": []}[command]
    refused(command, "press.toml", "-o", target, *more, says=f"{target.removeprefix('../')}", cwd=press)
    assert (press / source).read_bytes() == before


def test_checkpoint_and_spool_are_no_inputs(refused, press, tsai):
    """What stands beside the results of a sweep is written, too."""
    for ending in ("checkpoint", "spool"):
        table = press / f"run.nc.{ending}"
        table.write_text("t,Fz\n0,0\n1,-10\n")
        tsai["load"] = [{"on": "platform.P1", "table": table.name}]
        (press / "other.toml").write_text(tomli_w.dumps(tsai))
        refused("sweep", "other.toml", "-o", "run.nc", "--resume", says=f"run.nc.{ending}: cannot be written", cwd=press)
        assert table.read_text().startswith("t,Fz")
        table.unlink()


# ---- parts


def host() -> str:
    return os.uname().nodename


def dead_process() -> int:
    process = subprocess.Popen(["true"])
    process.wait()
    return process.pid


def killed_while_writing(scene: dict, folder: Path, *options: str) -> Path:
    """The part of a run that was killed half-way."""
    scene["time"]["samples"] = 3_000_001
    (folder / "long.toml").write_text(tomli_w.dumps(scene))
    process = subprocess.Popen([executable(), "inverse", "long.toml", "-q", *options], cwd=folder)
    try:
        while not any(path.stat().st_size > 10**6 for path in folder.glob("*.part")):
            assert process.poll() is None
            time.sleep(0.001)
    finally:
        process.kill()
        process.wait()
    (part,) = folder.glob("*.part")
    return part


@pytest.mark.parametrize("options", [["--want", "checks"], ["--csv"]], ids=["nc", "csv"])
def test_the_next_run_removes_what_a_killed_one_left(options, tsai, program, names, tmp_path):
    part = killed_while_writing(tsai, tmp_path, *options)
    target = part.name.split(f".{part.name.split('@')[0].rsplit('.', 1)[1]}@")[0]
    assert part.suffix == ".part" and target in ("long.nc", "long.csv")
    tsai["time"]["samples"] = 5
    (tmp_path / "long.toml").write_text(tomli_w.dumps(tsai))
    assert program("inverse", "long.toml", "-q", *options, cwd=tmp_path).returncode == 0
    assert names() == sorted([target, "long.toml"])


def test_parts_of_others_are_left_alone(program, scene, names, tmp_path):
    """Of a process that lives, of another machine, of another file, and what only looks like one."""
    alive = [f"run.csv.{os.getpid()}@{host()}.part", f"run.csv.{dead_process()}@elsewhere.part",
             f"run.csv.old.{dead_process()}@{host()}.part", "run.csv.part", "run.csv.12.part", f"run.csv.0@{host()}.part"]
    for name in alive:
        (tmp_path / name).write_text("not mine")
    (tmp_path / f"run.csv.{dead_process()}@{host()}.part").write_text("left over")
    assert program(*quick(scene, tmp_path / "run.csv", "csv")).returncode == 0
    assert names() == sorted([*alive, "run.csv", "scene.toml"])


def test_part_is_made_anew_and_follows_no_link(scene, tmp_path):
    """Somebody who guesses the name of a part gains nothing by a link that stands there."""
    victim = tmp_path / "victim"
    victim.write_text("precious")

    def lay_trap() -> None:
        (tmp_path / f"run.csv.{os.getpid()}@{host()}.part").symlink_to(victim)

    result = subprocess.run([executable(), *quick(scene, tmp_path / "run.csv", "csv")], preexec_fn=lay_trap, timeout=60)
    assert result.returncode == 0
    assert victim.read_text() == "precious" and (tmp_path / "run.csv").stat().st_size > 1000


# ---- no room


def limit_file_size() -> None:
    """As `ulimit -f`: the signal that comes along would end the process."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)


@pytest.mark.parametrize("kind", KINDS)
def test_limit_on_files_is_a_full_disk(kind, refused, scene, names):
    refused(*quick(scene, scene.parent / "run", kind), says="run: cannot be written: File too large", preexec_fn=limit_file_size)
    assert names() == ["scene.toml"]


def test_limit_on_files_from_the_first_byte(refused, writing_command, names, tmp_path):
    """Not even an empty file can be told from a full disk."""

    def no_room() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    refused(*writing_command, "-o", "run", says="", preexec_fn=no_room, cwd=tmp_path)
    assert names() == ["scene.toml"]


@pytest.fixture(scope="module")
def small_disk(tmp_path_factory):
    """A file system of 300 KiB."""
    folder = tmp_path_factory.mktemp("disk")
    command = ["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(command, capture_output=True).returncode != 0:
        pytest.skip("only root mounts file systems")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize("kind", KINDS)
def test_full_disk(kind, refused, scene, small_disk):
    (small_disk / "run").write_text("earlier results")
    refused(*quick(scene, small_disk / "run", kind), says="run: cannot be written: No space left on device")
    assert [path.read_text() for path in small_disk.iterdir()] == ["earlier results"]


@pytest.mark.parametrize("kind", KINDS)
def test_full_device(kind, refused, scene, devices):
    """netCDF for a device waits in TMPDIR."""
    refused(*quick(scene, devices / "full", kind), says="full: cannot be written: No space left on device")
    assert stat.S_ISCHR((devices / "full").lstat().st_mode)


def test_no_room_for_scratch(refused, scene, devices, tmp_path):
    environment = os.environ | {"TMPDIR": str(tmp_path / "nowhere")}
    refused(*quick(scene, devices / "null", "nc"), says=("temporary file", "TMPDIR"), env=environment)
