"""Tables of a motion whose instants stand in a column `time`, as results and other programs have them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import linkdyn


def scene_of(folder: Path, head: str, **keys: str) -> linkdyn.Scene:
    """A slide that follows a table."""
    folder.joinpath("motion.csv").write_text(f"{head},s [m]\n0,0\n1,0.1\n2,0.4\n3,0.9\n")
    return linkdyn.Scene({
        "space": "planar", "frame": {"markers": {"A": [0, 0]}}, "link": [{"name": "car", "markers": {"A": [0, 0]}, "mass": 1}],
        "joint": [{"name": "A", "type": "prismatic", "between": ["frame.A", "car.A"]}],
        "coordinate": [{"joint": "A", "motion": {"law": "table", "table": "motion.csv", "column": "s", **keys}}],
        "actuator": [{"joint": "A"}], "time": {"end": 3.0, "samples": 13},
    }, folder=folder)  # fmt: skip


@pytest.mark.parametrize("head", ["time [s]", "time", "Time [s]"])
def test_instants_in_a_column_time(tmp_path: Path, head: str) -> None:
    """The same bits as with the column `t`, named or not."""
    plain = scene_of(tmp_path, "t [s]").inverse().driving_force.values
    np.testing.assert_array_equal(scene_of(tmp_path, head).inverse().driving_force.values, plain)
    np.testing.assert_array_equal(scene_of(tmp_path, head, time=head.partition(" ")[0]).inverse().driving_force.values, plain)


def test_a_column_t_goes_first(tmp_path: Path) -> None:
    """A table that has both is read as ever; a column that is named and not there is refused."""
    both = "time [s],t [s]"
    tmp_path.joinpath("motion.csv").write_text("")
    with pytest.raises(linkdyn.SceneError, match="no column 'clock'"):
        scene_of(tmp_path, "time [s]", time="clock")
    text = scene_of(tmp_path, "t [s]")
    tmp_path.joinpath("motion.csv").write_text(f"{both},s [m]\n9,0,0\n8,1,0.1\n7,2,0.4\n6,3,0.9\n")
    again = linkdyn.Scene(text.text, folder=tmp_path)
    np.testing.assert_array_equal(again.inverse().driving_force.values, text.inverse().driving_force.values)
