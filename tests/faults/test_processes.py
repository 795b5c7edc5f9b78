"""A sweep over the processes of mpirun, in a build with MPI: LINKDYN_MPI names it, or the package's own executable is one."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
import tomli_w

from linkdyn.cli import executable

MPIRUN = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n"]
WITHOUT = "built without MPI"


@pytest.fixture(scope="module")
def parallel():
    """Run it on some processes, each of which starts in a folder of its own: 0, 1, ..."""
    program = os.environ.get("LINKDYN_MPI", executable())
    if shutil.which("mpirun") is None:
        pytest.skip("no MPI here")

    def run(n: int, folder: Path, *arguments: str) -> subprocess.CompletedProcess:
        in_own_folder = 'cd "$0/$OMPI_COMM_WORLD_RANK" && exec "$@"'
        command = [*MPIRUN, str(n), "sh", "-c", in_own_folder, folder, program, *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=60)

    return run


@pytest.fixture()
def folders(tsai, tmp_path) -> Path:
    """The same scene with a table, in four folders."""
    tsai["coordinate"][0]["motion"] = {"x": {"table": "x.csv"}, "y": 0.0, "z": 1.0}
    tsai["time"] = {"end": 1, "samples": 3}
    tsai["sweep"] = {"axis": [{"time": True, "linspace": [0, 1, 5]}]}
    for rank in range(4):
        folder = tmp_path / str(rank)
        folder.mkdir()
        (folder / "scene.toml").write_text(tomli_w.dumps(tsai))
        (folder / "x.csv").write_text("t,x\n0,-1.6\n1,-1.5\n")
    return tmp_path


def ours(result: subprocess.CompletedProcess) -> list[str]:
    """What linkdyn itself said."""
    return [line for line in result.stderr.splitlines() if "scene.toml" in line or "linkdyn" in line]


@pytest.mark.parametrize("fault", ["none", "missing scene", "missing table", "stale scene", "stale table"])
def test_processes_compare_their_scenes(fault, parallel, folders):
    """A copy that is missing or out of date on one machine ends all of them, with one line that says where."""
    if fault.startswith("missing"):
        (folders / "2" / {"missing scene": "scene.toml", "missing table": "x.csv"}[fault]).unlink()
    if fault == "stale scene":
        scene = folders / "2" / "scene.toml"
        scene.write_text(scene.read_text().replace("mass = ", "mass = 1"))
    if fault == "stale table":
        (folders / "2" / "x.csv").write_text("t,x\n0,-1.6\n1,-1.4\n")
    result = parallel(4, folders, "sweep", "scene.toml", "-o", str(folders / "run.nc"))
    if WITHOUT in result.stderr:
        pytest.skip(WITHOUT)
    if fault == "none":
        assert result.returncode == 0, result.stderr
        assert "in each of 4 processes" in result.stdout
        return
    assert result.returncode != 0 and not (folders / "run.nc").exists()
    (line,) = ours(result)
    assert line.startswith("process 2 on "), line
    assert ("there is no such file" if fault.startswith("missing") else "is not what process 0 has") in line
