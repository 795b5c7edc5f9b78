"""Scenes shared by the tests, and what a build may lack without failing them."""

from __future__ import annotations

import os
import signal
import subprocess
import time
import tomllib
from collections.abc import Callable, Generator
from functools import cache
from pathlib import Path
from typing import Any

import linkdyn
import pytest
import xarray as xr
from integrators import METHODS
from linkdyn.cli import executable, quadruple_twin

ROOT = Path(__file__).resolve().parents[1]
PATIENCE = 60.0
"""Seconds to wait for what a process does; on a crowded machine, too."""
PROMISED = frozenset(os.environ.get("LINKDYN_PROMISES", "").split())
"""What the build was made with, as tools/run_tests.py tells; of an installation of which nobody tells nothing is promised."""
OPTIONAL = {"gsl": "GNU Scientific Library", "viewer": "built without the viewer", "mujoco": "MuJoCo"}
"""What a build or a machine may do without, each with words by which errors name it."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """For builds that show faults of code, whatever the numbers: checked, sanitized."""
    parser.addoption("--cases", type=int, help="of each test with parameters at most so many, evenly spread; a third of it of thorough ones")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Choose the cases, the first and the last of a test among them."""
    most = config.getoption("--cases")
    if most is None:
        return
    tests: dict[str, list[pytest.Item]] = {}
    for item in items:
        tests.setdefault(item.nodeid.partition("[")[0], []).append(item)
    chosen = set()
    for cases in tests.values():
        n = min(max(1, most // 3) if cases[0].get_closest_marker("thorough") else most, len(cases))
        apart = (len(cases) - 1) / max(n - 1, 1)
        chosen |= {id(cases[round(i * apart)]) for i in range(n)}
    config.hook.pytest_deselected(items=[item for item in items if id(item) not in chosen])
    items[:] = [item for item in items if id(item) in chosen]


def pytest_configure() -> None:
    """What this session starts hears signals, though the session itself may run under nohup or behind a script's `&`."""
    for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL), (signal.SIGHUP, signal.SIG_DFL)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)


def excuse(missing: linkdyn.UnavailableError) -> None:
    """Skip the test for what a build may lack and does not promise; all else that is missing fails it."""
    for name, words in OPTIONAL.items():
        if words in str(missing) and name not in PROMISED:
            pytest.skip(str(missing))
    raise missing


@cache
def refusal_of(method: str) -> linkdyn.UnavailableError | None:
    """What a build without an integrator says, asked with the shortest of runs."""
    try:
        linkdyn.load(ROOT / "examples" / "fourbar" / "scene.toml").forward(t=[0.0], method=method)
    except linkdyn.UnavailableError as missing:
        return missing
    return None


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Tests with an integrator for parameter are for builds that have it, those with the mark `twin` for where it is built."""
    if item.get_closest_marker("twin") and quadruple_twin() is None:
        (pytest.fail if "twin" in PROMISED else pytest.skip)("linkdyn-real128 is not built (make real128)")
    given = getattr(item, "callspec").params.values() if hasattr(item, "callspec") else ()
    for method in METHODS:
        if method in [value for value in given if isinstance(value, str)] and (missing := refusal_of(method)):
            excuse(missing)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, object, object]:
    """What a build without one of the optional libraries says it cannot do is no failure of it."""
    try:
        return (yield)
    except linkdyn.UnavailableError as missing:
        excuse(missing)


@pytest.fixture(scope="session")
def tsai_file() -> Path:
    """A small Stewart platform: no tables, six coordinates and actuators."""
    return ROOT / "examples" / "stewart_tsai" / "scene.toml"


@pytest.fixture()
def tsai(tsai_file: Path) -> dict[str, Any]:
    """The same as a dict."""
    return tomllib.loads(tsai_file.read_text())


@pytest.fixture()
def crossing(tsai: dict[str, Any]) -> dict[str, Any]:
    """Five samples, the third of which has no solution: leg 1 shrinks to length zero.

    All numbers are sums of powers of two, so that the length is zero exactly.
    """
    tsai["frame"]["markers"]["B1"] = [0.25, 0.5, 0.0]
    tsai["link"][0]["markers"]["P1"] = [0.25, 0.5, -0.5]
    tsai["time"] = {"start": 0.0, "end": 4.0, "samples": 5}
    tsai["coordinate"][0]["motion"] = {
        "x": 0.0,
        "y": 0.0,
        "z": {"law": "constant-rate", "start": 1.5, "rate": -0.5},
    }
    return tsai


@pytest.fixture()
def kept_sweep(tsai: dict[str, Any]) -> dict[str, Any]:
    """With a sweep of many chunks, all samples kept; lapack takes its time over each."""
    tsai["sweep"] = {
        "reduce": ["driving_force", "determinant"],
        "keep": ["driving_force"],
        "map": ["platform.z", "platform.x"],
        "chunk": 32,
        "histogram": {"driving_force": True},
        "axis": [
            {"coordinate": "platform.x", "linspace": [-1.7, -1.3, 12]},
            {"coordinate": "platform.y", "random": {"from": -0.2, "to": 0.2, "n": 8, "seed": 4}},
            {"coordinate": "platform.z", "linspace": [0.8, 1.2, 8]},
        ],
        "constraint": [{"of": "driving_position", "min": 1.0}],
    }
    return tsai


@pytest.fixture(scope="session")
def start_sweep() -> Callable[..., subprocess.Popen[str]]:
    """Start a sweep that notes every chunk."""

    def start(scene: Path, output: Path, *options: str) -> subprocess.Popen[str]:
        command = [executable(), "sweep", scene, "-o", output, "-q", "--solver", "lapack", "--checkpoint", "0", *options]
        return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)

    return start


@pytest.fixture(scope="session")
def wait_for() -> Callable[[Path, subprocess.Popen[str]], None]:
    """Wait until a process has made a file."""

    def wait(path: Path, process: subprocess.Popen[str]) -> None:
        until = time.monotonic() + PATIENCE
        while not path.exists():
            assert process.poll() is None, process.stderr and process.stderr.read()
            assert time.monotonic() < until, f"no {path.name} after {PATIENCE:g} s"
            time.sleep(0.001)

    return wait


@pytest.fixture(scope="session")
def interrupt_sweep(start_sweep: Callable[..., subprocess.Popen[str]], wait_for: Callable[..., None]) -> Callable[[Path, Path], None]:
    """A sweep killed behind its first checkpoint."""

    def interrupt(scene: Path, output: Path) -> None:
        with start_sweep(scene, output) as process:
            wait_for(Path(f"{output}.checkpoint"), process)
            process.kill()

    return interrupt


@pytest.fixture(scope="session")
def same() -> Callable[[Path, Path], bool]:
    """Do two files hold the same results?"""

    def compare(one: Path, two: Path) -> bool:
        with xr.open_dataset(one) as a, xr.open_dataset(two) as b:
            return set(a.variables) == set(b.variables) and all(a[name].equals(b[name]) for name in a.variables)

    return compare
