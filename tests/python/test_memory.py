"""No number hangs on what memory held before: what is allocated is filled with other bytes, and every bit stays."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

RUNS = """
import sys, warnings
import numpy as np
import linkdyn
warnings.simplefilter("ignore")
for name in sys.argv[2:]:
    scene = linkdyn.load(name)
    for times in (4, 5):
        run = scene.forward(t=np.linspace(0.0, 4.0, times), method=sys.argv[1])
        print(name, [run[part].values.tobytes().hex() for part in ("q", "qd", "driving_force")])
"""


@pytest.mark.parametrize("method", ["gbs", "seulex"])
def test_no_bit_of_a_run_hangs_on_what_memory_held(method: str) -> None:
    """Lanes to spare were led and iterated on from whatever they held: the last digits of the others differed in two runs of a hundred."""
    scenes = [str(EXAMPLES / name / "scene.toml") for name in ("screw_lift", "fourbar", "double_wishbone")]

    def bits(fill: int) -> str:
        surroundings = {**os.environ, "MALLOC_PERTURB_": str(fill)}
        return subprocess.run([sys.executable, "-c", RUNS, method, *scenes], env=surroundings, check=True, capture_output=True, text=True).stdout

    plain = bits(0)
    assert plain.count("\n") == 2 * len(scenes)
    assert [bits(fill) for fill in (85, 170)] == [plain, plain]
