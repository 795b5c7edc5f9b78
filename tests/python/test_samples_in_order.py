"""Samples that follow each other, given from Python: the assembly goes on through change points; of samples on their own it is told that it does not."""

import warnings
from typing import Any

import linkdyn
import numpy as np
import pytest

from .test_assemblies import THROUGH_CHANGE_POINT, parallelogram  # noqa: F401  (a fixture)

ANGLES = np.array([1.0, 2.0, 3.0, 3.1, 3.2, 3.3])[:, None]
"""Of the crank; it passes its change point before the last but one."""
INSTANTS = 0.1 * np.arange(len(ANGLES))


@pytest.fixture
def scene(parallelogram: dict[str, Any]) -> linkdyn.Scene:  # noqa: F811
    parallelogram["gravity"] = [0.0] * len(parallelogram["gravity"])
    return linkdyn.Scene(parallelogram)


def followers_lead(run: Any) -> Any:
    """By how much the follower of a parallelogram stands otherwise than its crank."""
    angle = run.joint_variable.sel(variable=["A.angle", "D.angle"]).values
    return np.abs(angle[:, 1] - angle[:, 0])


@pytest.mark.parametrize("given", [{}, {"t": INSTANTS}])
def test_samples_in_order_pass_change_points(scene: linkdyn.Scene, given: dict[str, Any]) -> None:
    motion = (ANGLES, 0 * ANGLES + 4, 0 * ANGLES + 3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = scene.inverse(*motion, in_order=True, **given)
    assert np.all(run.status == 0) and np.max(followers_lead(run)) < 1e-9
    assert np.flatnonzero(run.assembly == THROUGH_CHANGE_POINT).tolist() == [4] and run.attrs["change_points_passed"] == 1
    assert "time" not in run.coords and ("instant" in run.coords) == ("t" in given)
    bare = scene.solve(*motion, in_order=True, want=None, **given)
    np.testing.assert_array_equal(bare["driving_force"], run.driving_force.values)
    np.testing.assert_array_equal(bare["assembly"], run.assembly.values)


def test_change_points_may_end_samples_in_order(parallelogram: dict[str, Any]) -> None:  # noqa: F811
    run = linkdyn.Scene(parallelogram | {"change_points": "stop"}).inverse(ANGLES, in_order=True)
    assert np.all((run.status.values != 0) == (ANGLES[:, 0] > np.pi))
    assert run.attrs["failure"].startswith("sample 4: ") and "change point" in run.attrs["failure"]


PLANAR = pytest.mark.parametrize("parallelogram", ["planar"], indirect=True)
"""Loops closed by iteration are led straight from the start, sample by sample."""


@PLANAR
@pytest.mark.parametrize("order", [[0, 1, 2, 3, 4, 5], [5, 0, 3, 1, 4, 2]])
def test_samples_on_their_own_tell_of_the_other_assembly(scene: linkdyn.Scene, order: list[int]) -> None:
    with pytest.warns(UserWarning, match="2 of 6 samples on their own lie past a change point.*in_order=True"):
        run = scene.inverse(ANGLES[order])
    assert run.attrs["other_in_order"] == 2 == np.count_nonzero(followers_lead(run) > 0.1)


@PLANAR
def test_the_scenes_own_motion_may_be_samples_on_their_own(scene: linkdyn.Scene) -> None:
    with pytest.warns(UserWarning, match="past a change point"):
        alone = scene.inverse(in_order=False)
    assert alone.attrs["other_in_order"] == np.count_nonzero(followers_lead(alone) % (2 * np.pi) > 1e-6) > 10
    assert np.array_equal(alone.instant, scene.times())


@pytest.mark.parametrize("angles", [[[1.0], [2.0]], [[1.0], [1.0 + 2 * np.pi]], np.empty((0, 1))])
def test_nothing_is_told_of_samples_that_lie_on_the_same_assembly(scene: linkdyn.Scene, angles: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert scene.inverse(angles).attrs["other_in_order"] == 0


@PLANAR
def test_a_stretch_known_to_be_clear_is_not_led_again(scene: linkdyn.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Batches within samples that met no change point cost nothing more; beyond these they do, and are told of."""
    led: list[int] = []
    passed = linkdyn._other_assemblies._passed
    monkeypatch.setattr(linkdyn._other_assemblies, "_passed", lambda scene, way: led.append(len(way)) or passed(scene, way))
    for angles, times_led in ((ANGLES[:3], 1), (ANGLES[1:3], 1), (ANGLES[:4], 2), (ANGLES[:4][::-1], 2)):
        assert scene.inverse(angles).attrs["other_in_order"] == 0 and len(led) == times_led
    for times_led in (3, 4):
        with pytest.warns(UserWarning, match="2 of 6 samples on their own lie past a change point"):
            assert scene.inverse(ANGLES).attrs["other_in_order"] == 2
        assert len(led) == times_led
