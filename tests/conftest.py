"""Scenes shared by the tests."""

from __future__ import annotations

import signal
import tomllib
from collections.abc import Generator
from pathlib import Path
from typing import Any

import linkdyn
import pytest

ROOT = Path(__file__).resolve().parents[1]


def pytest_configure() -> None:
    """What this session starts hears signals, though the session itself may run under nohup or behind a script's `&`."""
    for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL), (signal.SIGHUP, signal.SIG_DFL)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, object, object]:
    """What a build without one of the optional libraries says it cannot do is no failure of it."""
    try:
        return (yield)
    except linkdyn.UnavailableError as missing:
        pytest.skip(str(missing))


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
