"""`--states` without a column `time`: samples that stand alone have numbers, and nothing that needs time is said of them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import linkdyn
import numpy as np
import pandas as pd
import pytest

SCENE = "slider-crank"
ANGLES = [30.0, 60.0, 90.0, 120.0]


def call(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-W", "always", "-c", "from linkdyn.cli import main; main()", *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, timeout=120, cwd=folder)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("states")
    assert call(place, "new", SCENE).returncode == 0
    rows = "\n".join(map(str, ANGLES))
    (place / "states.csv").write_text(f"q crank [deg]\n{rows}\n")
    return place


def inverse(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    done = call(folder, "inverse", f"{SCENE}.toml", "--states", *arguments)
    assert done.returncode in (0, 3), done.stderr
    return done


def test_numbers_in_place_of_instants(folder: Path) -> None:
    said = inverse(folder, "states.csv", "-o", "out.nc").stdout
    assert "t [s]" not in said and "t = " not in said
    (drive,) = [line.split() for line in said.splitlines() if line.strip().startswith("crank [N m]")]
    assert (drive[4], drive[6]) == ("2", "0"), drive            # lowest and highest
    assert "rms" in said and "at sample" in said
    assert "at B, sample 2" in said


def test_the_file_is_what_python_computes(folder: Path) -> None:
    inverse(folder, "states.csv", "-o", "out.nc")
    run = linkdyn.read(folder / "out.nc")
    batch = linkdyn.load(folder / f"{SCENE}.toml").inverse(q=np.radians(ANGLES)[:, np.newaxis])
    assert "time" not in run.coords
    assert set(run.coords) == set(batch.coords)
    np.testing.assert_allclose(run.driving_force, batch.driving_force, rtol=1e-12)
    pd.testing.assert_frame_equal(run.linkdyn.worst("driving_force"), batch.linkdyn.worst("driving_force"))
    with pytest.raises(linkdyn.InputError, match="no instants"):
        run.linkdyn.energy()


def test_csv_counts_its_rows_and_is_read_again(folder: Path) -> None:
    inverse(folder, "states.csv", "-o", "out.csv", "--csv")
    table = pd.read_csv(folder / "out.csv")
    assert list(table)[:2] == ["sample", "q crank [rad]"]
    assert table["sample"].tolist() == [0, 1, 2, 3]
    inverse(folder, "out.csv", "-o", "again.csv", "--csv")
    assert (folder / "out.csv").read_text() == (folder / "again.csv").read_text()


def test_sheet_of_samples(folder: Path) -> None:
    done = inverse(folder, "states.csv", "-o", "out.nc", "--sheet", "sheet.html")
    assert "Warning" not in done.stderr, done.stderr
    page = (folder / "sheet.html").read_text()
    assert "t = 0" not in page and ">nan<" not in page
    assert "sample 2" in page and "over the samples" in page


def test_one_instant_has_no_energy(folder: Path) -> None:
    """A motion that stands still in time: refused where it is asked for, left out of a sheet."""
    (folder / "instant.csv").write_text("time [s],q crank [deg],qd crank,qdd crank\n2,30,0,0\n2,60,0,0\n")
    done = inverse(folder, "instant.csv", "-o", "instant.nc", "--sheet", "instant.html")
    assert done.returncode == 0 and "Warning" not in done.stderr, done.stderr
    assert ">nan<" not in (folder / "instant.html").read_text()
    with pytest.raises(linkdyn.InputError, match="all samples of the run are at 2 s"):
        linkdyn.read(folder / "instant.nc").linkdyn.energy()


def test_failed_rows_are_named_across_blocks(folder: Path) -> None:
    """The number is that of the row in the whole file, however many blocks of samples the summary is made of."""
    scene = (folder / f"{SCENE}.toml").read_text()
    assert 'L = "3.5*r"' in scene
    (folder / "short.toml").write_text(scene.replace('L = "3.5*r"', 'L = "0.9*r"'))    # does not reach the cylinder at 90 deg
    angles = np.where(np.arange(5000) < 4321, 0.0, 90.0)
    (folder / "many.csv").write_text("q crank [deg]\n" + "\n".join(map(str, angles)) + "\n")
    said = call(folder, "inverse", f"{SCENE}.toml", "--states", "many.csv", "--no-output").stdout
    (drive,) = [line.split() for line in said.splitlines() if line.strip().startswith("crank [N m]")]
    assert (drive[4], drive[6]) == ("4321", "0"), said
    done = call(folder, "inverse", "short.toml", "--states", "many.csv", "--no-output")
    assert "679 of 5000, first at sample 4321" in done.stderr, done.stderr
