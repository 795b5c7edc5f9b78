"""Machine code of kernels, from outside: chosen, refused, told, and the same bits."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import linkdyn
from linkdyn import _bind, cli

ROOT = Path(__file__).resolve().parents[2]
SCENES = ["examples/fourbar/scene.toml", "examples/stewart_drilling/scene.toml", "examples/rcsp_start/scene.toml",
          "tests/scenes/rsur.toml"]
CODES = ["interpreter", "scalar", "avx2", "avx512"]

FORBID = """
import ctypes, os, sys
PR_SET_MDWE, REFUSE_EXEC_GAIN = 65, 1
if ctypes.CDLL(None).prctl(PR_SET_MDWE, REFUSE_EXEC_GAIN, 0, 0, 0):
    sys.exit(77)
os.execv(sys.argv[1], sys.argv[1:])
"""
"""Run a program that may not make memory executable; 77: the system cannot forbid it."""


@pytest.fixture(autouse=True)
def no_choice_left() -> Iterator[None]:
    yield
    linkdyn.use_code(None)


def run_cli(*words: str, environment: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run([cli.executable(), *words], capture_output=True, text=True, timeout=120, check=False,
                          env=os.environ | (environment or {}))


@pytest.mark.parametrize("name", SCENES)
def test_all_code_gives_the_same_bits(name: str) -> None:
    found = {}
    for code in CODES:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")     # of code that this processor does not run
            linkdyn.use_code(code)
        found[code] = linkdyn.load(ROOT / name).inverse()
    for code in CODES[1:]:
        for variable, want in found["interpreter"].data_vars.items():
            np.testing.assert_array_equal(found[code][variable], want, err_msg=f"{code}: {variable}")


def test_forward_runs_have_the_same_bits() -> None:
    ends = []
    for code in ("interpreter", "avx2"):
        linkdyn.use_code(code)
        ends.append(linkdyn.load(ROOT / "examples" / "n_fourbar" / "scene.toml").forward(t=[0, 2.0]).q.values[-1])
    np.testing.assert_array_equal(*ends)


def test_results_tell_the_code() -> None:
    linkdyn.use_code("interpreter")
    assert linkdyn.code_in_use() == "interpreter"
    assert linkdyn.load(ROOT / "examples" / "fourbar" / "scene.toml").inverse().attrs["machine_code"] == "interpreter"


@pytest.mark.parametrize("name", ["avx1024", "", " ", "AVX2"])
def test_unknown_code_is_refused_by_name(name: str) -> None:
    with pytest.raises(linkdyn.InputError, match="expected interpreter, scalar, avx2 or avx512"):
        linkdyn.use_code(name)


def test_code_that_does_not_run_here_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Silently, other code ran."""
    monkeypatch.setattr(_bind, "code_in_use", lambda: "interpreter (no machine code for this processor)")
    with pytest.warns(UserWarning, match="code: 'avx512' does not run here, kernels are made of interpreter \\(no machine code"):
        linkdyn.use_code("avx512")
    monkeypatch.undo()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        linkdyn.use_code("interpreter")
        linkdyn.use_code(None)


def test_what_is_no_name_is_refused_as_code() -> None:
    with pytest.raises(linkdyn.InputError, match="^code: expected a name, got 3"):
        linkdyn.use_code(3)  # type: ignore[arg-type]


def test_command_refuses_unknown_code() -> None:
    scene = str(ROOT / "examples" / "fourbar" / "scene.toml")
    run = run_cli("inverse", scene, "--no-output", "--code", "avx")
    assert run.returncode == 2 and run.stderr.count("\n") == 1 and "'avx'" in run.stderr and "avx2" in run.stderr
    run = run_cli("inverse", scene, "--no-output", environment={"LINKDYN_CODE": "fast"})
    assert run.returncode == 2 and run.stderr.count("\n") == 1 and "LINKDYN_CODE: 'fast'" in run.stderr


def test_a_system_that_lets_no_new_code_run(tmp_path: Path) -> None:
    """The run goes on, interpreted, to the same numbers, and says so in one line."""
    scene = str(ROOT / "examples" / "fourbar" / "scene.toml")
    words = [str(cli.executable()), "inverse", scene, "--csv", "-o"]
    free = subprocess.run([*words, str(tmp_path / "free.csv")], capture_output=True, text=True, timeout=120, check=True)
    run = subprocess.run([sys.executable, "-c", FORBID, *words, str(tmp_path / "bound.csv")], capture_output=True, text=True,
                         timeout=120, check=False)
    if run.returncode == 77:
        pytest.skip("this system cannot forbid it")
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "free.csv").read_bytes() == (tmp_path / "bound.csv").read_bytes()
    lines = [line for line in run.stdout.splitlines() if "machine code" in line]
    assert len(lines) == 1 and "interpreter (" in lines[0]
    if "machine code" not in free.stdout:          # this build has machine code
        assert "the system lets no new code run" in lines[0]
