"""What most tests of the package start from."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import pytest
import xarray as xr
from matplotlib import pyplot

import linkdyn


@pytest.fixture(scope="module")
def scene(tsai_file: Path) -> linkdyn.Scene:
    """A small Stewart platform."""
    return linkdyn.load(tsai_file)


@pytest.fixture(scope="module")
def run(scene: linkdyn.Scene) -> xr.Dataset:
    """Its inverse dynamics along its motion."""
    return scene.inverse()


@pytest.fixture()
def closed_figures() -> Iterator[None]:
    """Figures of a test end with it."""
    yield
    pyplot.close("all")
