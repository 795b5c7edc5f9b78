"""A hexapod's forces by formulas written out by hand (benchmarks/hand): no line of them is the engine's."""

from __future__ import annotations

import subprocess
from pathlib import Path

import bench_hand
import numpy as np
import pytest
from report import ROOT

ROUNDINGS = 1000
"""Of the largest force: some hundred operations on the way to it, times the platform's condition number, which is below ten."""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> object:
    file: Path = tmp_path_factory.mktemp("hand") / "libhexapod_by_hand.so"
    source = ROOT / "benchmarks" / "hand" / "hexapod.c"
    subprocess.run(["cc", "-O1", "-Wno-psabi", "-shared", "-fPIC", "-o", str(file), str(source), "-lm"], check=True)
    return bench_hand.load_library(file)


@pytest.mark.parametrize("name", bench_hand.SCENES)
def test_forces_are_those_found_by_hand(name: str, library: object) -> None:
    assert bench_hand.ByHand(name, library).difference() < ROUNDINGS * np.finfo(float).eps
