"""Legs of a hexapod written link by link: whichever way round, in whatever axes, they are closed by formulas, with the results of one way that
is closed by iteration."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import linkdyn
import numpy as np
import pytest
from cross_checks import agrees_with_itself, hold_together
from numpy.typing import NDArray
from test_said_otherwise import elements, matrix, other_link_axes, with_starts, write_markers

pytestmark = pytest.mark.accuracy

Array = NDArray[np.float64]
Content = dict[str, Any]
ANGLES = np.radians([10.0, 110.0, 130.0, 230.0, 250.0, 350.0])
TOPS = np.radians([48.0, 72.0, 168.0, 192.0, 288.0, 312.0])
WAVES = {"x": (0.0, 0.1, 0.5), "y": (0.0, 0.08, 0.7), "z": (1.9, 0.1, 0.3), "roll": (0.0, 0.2, 0.4), "pitch": (0.0, 0.1, 0.6), "yaw": (0.0, 0.1, 0.45)}
KINDS = {"UPS": ("universal", "prismatic", "spherical"), "UCU": ("universal", "cylindrical", "universal")}


def hexapod(kind: str = "UPS", base_is_first: bool = True) -> Content:
    """Legs in the axes in which a chain has them, hung on the base or, as if the machine stood on its head, on the platform. Their halves have
    no symmetry, so it shows which way they are turned."""
    motion = {name: {"law": "harmonic", "mean": mean, "amplitude": amplitude, "frequency": frequency} for name, (mean, amplitude, frequency) in WAVES.items()}
    frame: Content = {}
    top: Content = {}
    links: list[Content] = []
    joints: list[Content] = []
    for k, (a, b) in enumerate(zip(ANGLES, TOPS, strict=True)):
        low, high = np.array([1.6 * np.cos(a), 1.6 * np.sin(a), 0.0]), np.array([1.1 * np.cos(b), 1.1 * np.sin(b), 0.0])
        across = np.cross(high + [0, 0, 1.9] - low, [0, 0, 1.0])
        across /= np.linalg.norm(across)
        # of a ball the markers' axes are upwards, far from where its angles have no meaning
        frame[f"B{k}"] = {"at": low.tolist(), "axis": across.tolist() if kind == "UCU" or base_is_first else [0, 0, 1]}
        top[f"T{k}"] = {"at": high.tolist(), "axis": across.tolist() if kind == "UCU" or not base_is_first else [0, 0, 1]}
        links += [{"name": f"lower{k}", "mass": 45.0, "cog": [0.02, 0.01, 0.55], "inertia": [4.6, 4.9, 0.35, 0.01, -0.02, 0.03],
                   "markers": {"U": {"at": [0, 0, 0], "axis": [0, 1, 0]}, "P": [0, 0, 0]}},
                  {"name": f"upper{k}", "mass": 18.0, "cog": [-0.01, 0.03, -0.6], "inertia": [2.2, 2.16, 0.06, 0.02, 0.01, 0.0],
                   "markers": {"P": [0, 0, 0], "S": {"at": [0, 0, 0], "axis": [0, 1, 0] if kind == "UCU" else [0, 0, 1]}}}]
        ends = (f"frame.B{k}", f"platform.T{k}") if base_is_first else (f"platform.T{k}", f"frame.B{k}")
        pairs = [[ends[0], f"lower{k}.U"], [f"lower{k}.P", f"upper{k}.P"], [f"upper{k}.S", ends[1]]]
        joints += [{"name": f"{letter}{k}", "type": name, "between": pair}
                   for letter, name, pair in zip(("U", "P", "S"), KINDS[kind], pairs, strict=True)]
    platform = {"name": "platform", "mass": 850.0, "cog": [0.08, -0.05, 0.35], "inertia": [310.0, 285.0, 420.0, -12.5, -9.5, 18.0],
                "markers": top, "start": {"position": [0, 0, 1.9]}}
    return {"title": "hexapod", "space": "spatial", "gravity": [0, 0, -9.81], "frame": {"markers": frame}, "link": [platform, *links],
            "joint": joints, "coordinate": [{"link": "platform", "motion": motion}],
            "actuator": [{"joint": f"P{k}"} | ({} if kind == "UPS" else {"variable": "slide"}) for k in range(6)],
            "time": {"end": 1.0, "samples": 21}}


def reverse(*letters: str) -> Callable[[Content], None]:
    def change(content: Content) -> None:
        for joint in content["joint"]:
            if joint["name"][0] in letters:
                joint["between"].reverse()
    return change


def legs_in_other_axes(content: Content) -> None:
    """The platform stays, whose pose is told in its axes."""
    platform = content["link"].pop(0)
    other_link_axes(content, np.random.default_rng(5))
    content["link"].insert(0, platform)


def slide_downwards(content: Content) -> None:
    for link in content["link"][1:]:
        marker = link["markers"]["P"]
        marker["axis"] = (-np.array(marker["axis"])).tolist()


def axes_of_cross_reversed(content: Content) -> None:
    for link in content["link"][1:]:
        for name, marker in link["markers"].items():
            if name in "US":
                marker["axis"] = (-np.array(marker["axis"])).tolist()


def marker_along_the_slide(content: Content) -> None:
    for link in content["link"][1:]:
        marker = link["markers"]["P"]
        marker["at"] = (np.array(marker["at"]) + 0.2 * np.array(marker["axis"])).tolist()


def everything(content: Content) -> None:
    for change in (reverse("U", "S"), slide_downwards, axes_of_cross_reversed, marker_along_the_slide, legs_in_other_axes, reverse("P")):
        change(content)


WAYS = {"cross reversed": reverse("U"), "slide reversed": reverse("P"), "last joint reversed": reverse("S"), "all reversed": reverse("U", "P", "S"),
        "other axes": legs_in_other_axes, "slide downwards": slide_downwards, "axes of the cross reversed": axes_of_cross_reversed,
        "marker along the slide": marker_along_the_slide, "everything": everything}


def standing(kind: str, base_is_first: bool) -> Content:
    """All links begin where those of the plain scene do, their slides drawn out upwards, all axes told in full."""
    content = with_starts(hexapod(kind, base_is_first))
    for part in (content["frame"], *content["link"]):
        write_markers(part, np.eye(3), np.zeros(3))
    return content


def iterated(content: Content) -> linkdyn.Scene:
    """Each lower half is of two parts of its own, between its joints, that a hinge and a brace hold together: no leg of two links."""
    content = copy.deepcopy(content)
    for link in list(content["link"]):
        if not link["name"].startswith("lower"):
            continue
        whole = np.array(elements(matrix(link["inertia"])))
        other = copy.deepcopy(link) | {"name": f"{link['name']}_half", "mass": 0.4 * link["mass"], "inertia": (0.4 * whole).tolist()}
        link |= {"mass": 0.6 * link["mass"], "inertia": (0.6 * whole).tolist()}
        content["link"].append(other)
        slide = next(joint for joint in content["joint"] if f"{link['name']}.P" in joint["between"])
        slide["between"] = [end.replace(f"{link['name']}.P", f"{link['name']}_half.P") for end in slide["between"]]
        hold_together(content, link["name"], other["name"])
    scene = linkdyn.Scene(content)
    assert scene.explain().count("Newton") == 6
    return scene


def force_of_slides(run: Any) -> Array:
    return np.asarray(run.driving_force)


@pytest.mark.parametrize("base_is_first", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_against_iteration(kind: str, base_is_first: bool) -> None:
    content = standing(kind, base_is_first)
    closed, other = linkdyn.Scene(content), iterated(content)
    text = closed.explain()
    assert text.count(f"{kind} leg") == 6 and "Newton" not in text
    motion = closed.motion(np.linspace(0, 1, 101))
    one, two = (scene.inverse(*motion, want="all") for scene in (closed, other))
    assert (one.status == 0).all() and (two.status == 0).all()
    assert one.attrs["samples_closed_form"] == 101 and two.attrs["samples_iterated"] == 101
    np.testing.assert_allclose(one.driving_force, two.driving_force, rtol=0, atol=1e-12 * float(np.abs(two.driving_force).max()))
    for name, tolerance in (("joint_variable", 1e-12), ("joint_rate", 1e-11), ("joint_acceleration", 1e-10), ("reaction", 1e-12)):
        if name not in one:
            continue
        mine, its = (np.asarray(run[name])[:, : one[name].shape[1]] for run in (one, two))
        np.testing.assert_allclose(mine, its, rtol=0, atol=tolerance * max(1.0, float(np.abs(its).max())), err_msg=name)
    here, there = (scene.poses(q=motion[0]) for scene in (closed, other))
    n = len(closed.links)
    np.testing.assert_allclose(here.position, there.position[:, :n], rtol=0, atol=1e-13)
    np.testing.assert_allclose(here.rotation, there.rotation[:, :n], rtol=0, atol=1e-13)
    falls = [scene.forward(0.2, step=0.1, rtol=1e-10, atol=1e-10).q for scene in (closed, other)]
    np.testing.assert_allclose(falls[0], falls[1], rtol=0, atol=1e-8)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("base_is_first", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_written_otherwise(kind: str, base_is_first: bool, way: str) -> None:
    """The same forces by every solver and in motion, and by formulas."""
    content = standing(kind, base_is_first)
    plain = linkdyn.Scene(content)
    changed = copy.deepcopy(content)
    WAYS[way](changed)
    other = linkdyn.Scene(changed)
    assert other.explain().count(f"{kind} leg") == 6 and "Newton" not in other.explain()
    motion = plain.motion(np.linspace(0, 1, 41))
    one, two = (scene.inverse(*motion, want="all") for scene in (plain, other))
    assert (two.status == 0).all() and two.attrs["samples_closed_form"] == 41
    bound = 1e-12 * float(np.abs(one.driving_force).max())
    ratio = np.sign(force_of_slides(two)[0] / force_of_slides(one)[0])
    assert (ratio == ratio[0]).all()
    np.testing.assert_allclose(ratio * force_of_slides(two), force_of_slides(one), rtol=0, atol=bound)
    for solver in ("lapack", "gauss-jordan", "reduced"):
        forces = force_of_slides(other.inverse(*motion, solver=solver))
        np.testing.assert_allclose(ratio * forces, force_of_slides(one), rtol=0, atol=10 * bound, err_msg=solver)
    np.testing.assert_allclose(np.linalg.norm(two.reaction[..., :3], axis=-1), np.linalg.norm(one.reaction[..., :3], axis=-1), rtol=0, atol=10 * bound)
    falls = [scene.forward(0.1, step=0.05, rtol=1e-10, atol=1e-10).q for scene in (plain, other)]
    np.testing.assert_allclose(falls[0], falls[1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_forces_and_rates(kind: str) -> None:
    content = standing(kind, True)
    everything(content)
    agrees_with_itself(linkdyn.Scene(content), step=1e-4, within=1e-8)


def test_start_chooses_the_way() -> None:
    """A leg's halves begin turned about its line, or its slide drawn out the other way, if their `start` says so; and stay so."""
    content = standing("UCU", True)
    for half, name in ((1, "lower0"), (2, "upper0")):
        flipped = copy.deepcopy(content)
        link = flipped["link"][half]
        assert link["name"] == name
        link["start"]["rotation"] = (np.array(link["start"]["rotation"]) @ np.diag([-1.0, -1.0, 1.0])).tolist()
        scene = linkdyn.Scene(flipped)
        assert "Newton" not in scene.explain()
        q = scene.motion(np.linspace(0, 1, 21))[0]
        plain, other = linkdyn.Scene(content).poses(q=q).rotation, scene.poses(q=q).rotation
        k = scene.links.index(name)
        np.testing.assert_allclose(other[:, k], plain[:, k] @ np.diag([-1.0, -1.0, 1.0]), rtol=0, atol=1e-13)
        np.testing.assert_allclose(np.delete(other, k, axis=1), np.delete(plain, k, axis=1), rtol=0, atol=1e-13)


def test_branch_is_refused() -> None:
    content = standing("UCU", True)
    content["joint"][1]["branch"] = 1
    with pytest.raises(linkdyn.SceneError, match="joint 'P0': 'branch' has no meaning here: its links are a leg .expected 'start' of joints or links"):
        linkdyn.Scene(content)


def test_bent_leg_is_iterated() -> None:
    """A slide beside the line from end to end, or a cross that is not square to it, is no such leg."""
    for name, marker in (("upper0", "P"), ("lower0", "U")):
        for kind in KINDS:
            content = standing(kind, True)
            link = next(link for link in content["link"] if link["name"] == name)
            if marker == "P":
                link["markers"]["P"]["at"] = [0.01, 0.0, 0.0]
            else:
                link["markers"]["U"] = {"at": [0, 0, 0], "axis": [0, 1, 0.01], "x": [1, 0, 0]}
            scene = linkdyn.Scene(content)
            assert scene.explain().count("Newton") == 1
            run = scene.inverse(*scene.motion(np.linspace(0, 1, 5)))
            assert (run.status == 0).all()
