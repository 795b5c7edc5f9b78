"""The executable as its users start it, on a bad day."""

from __future__ import annotations

import os
import stat
import subprocess
from pathlib import Path

import pytest

from linkdyn.cli import executable

BAD_INPUT = 2


@pytest.fixture(scope="session")
def program():
    """Run the executable to its end."""

    def run(*arguments, **options) -> subprocess.CompletedProcess:
        return subprocess.run(
            [executable(), *map(str, arguments)], capture_output=True, text=True, errors="replace", timeout=120, **options
        )

    return run


@pytest.fixture(scope="session")
def refused(program):
    """Run it: one line on standard error that holds some words, nothing on standard output, exit status 2."""

    def run(*arguments, says: str | tuple[str, ...], **options) -> None:
        result = program(*arguments, **options)
        assert result.returncode == BAD_INPUT, result
        assert result.stdout == ""
        assert result.stderr.count("\n") == 1 and result.stderr.endswith("\n"), result.stderr
        for words in [says] if isinstance(says, str) else says:
            assert words in result.stderr, result.stderr

    return run


@pytest.fixture()
def scene(tsai_file: Path, tmp_path: Path) -> Path:
    """A scene in a folder of its own."""
    file = tmp_path / "scene.toml"
    file.write_text(tsai_file.read_text())
    return file


@pytest.fixture()
def names(tmp_path: Path):
    """What lies in the folder now."""
    return lambda: sorted(path.name for path in tmp_path.iterdir())


@pytest.fixture()
def devices(tmp_path) -> Path:
    """The system's null and full, made once more: as root a faulty program would destroy those of the machine."""
    folder = tmp_path / "devices"
    folder.mkdir()
    try:
        os.mknod(folder / "null", stat.S_IFCHR | 0o666, os.makedev(1, 3))
        os.mknod(folder / "full", stat.S_IFCHR | 0o666, os.makedev(1, 7))
    except PermissionError:
        return Path("/dev")    # nobody else can destroy them
    return folder
