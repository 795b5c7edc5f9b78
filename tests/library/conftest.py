"""The library as other programs meet it: installed under a prefix, found by pkg-config and CMake."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("LINKDYN_BUILD", ROOT / "build" / "wheel"))


def run(*command: str | Path, folder: Path = ROOT, **environment: str) -> str:
    """What a command prints; its errors are the test's."""
    done = subprocess.run(
        [*map(str, command)], cwd=folder, env=os.environ | environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="session")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where library, header and all are installed; the build never knew of this place."""
    stage = tmp_path_factory.mktemp("stage")
    run("meson", "install", "-C", BUILD, "--no-rebuild", "--quiet", "--tags", "devel", "--destdir", stage)
    header = next(stage.glob("**/include/linkdyn.h"))
    return header.parent.parent


@pytest.fixture(scope="session")
def found(prefix: Path) -> dict[str, str]:
    """Environment in which pkg-config and the loader find it."""
    packages = next(prefix.glob("**/linkdyn.pc")).parent    # lib/pkgconfig
    return {"PKG_CONFIG_PATH": str(packages), "LD_LIBRARY_PATH": str(packages.parent)}


@pytest.fixture(scope="session")
def compiled(prefix: Path, found: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Callable[..., str]]:
    """Build a program by pkg-config; gives what runs it."""
    ask = ("pkg-config", f"--define-variable=prefix={prefix}", "linkdyn")    # a folder configured before says where it would go
    flags = {kind: run(*ask, f"--{kind}", **found).split() for kind in ("cflags", "libs")}

    def build(compiler: str, source: Path, *options: str) -> Callable[..., str]:
        program = tmp_path_factory.mktemp(source.stem) / "main"
        run(compiler, *options, *flags["cflags"], source, *flags["libs"], "-lm", "-o", program)
        return lambda *arguments: run(program, *arguments, **found)

    return build
