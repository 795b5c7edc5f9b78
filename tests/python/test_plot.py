"""Pictures: every line, label and unit is there."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot as plt
from matplotlib.text import Text
from PIL import Image

import linkdyn
from linkdyn import plot
from linkdyn._drawing.names import sampled
from linkdyn._sheets import run_sheet
from linkdyn._view import data as view_data

pytestmark = [pytest.mark.python_alone, pytest.mark.usefixtures("closed_figures")]


def test_driving_forces(run):
    figure, axes = plot.driving_forces(run)
    assert axes.shape == (1,)
    names = {text.get_text().split()[0]: text.get_text() for text in axes[0].texts}
    assert set(names) == set(run.actuator.values)
    force = run.driving_force.sel(actuator="leg1.P").values
    assert f"{force[np.argmax(np.abs(force))]:.4g} N" in names["leg1.P"]
    assert axes[0].get_ylabel() == "driving force [N]" and axes[0].get_xlabel() == "time [s]"
    figure.canvas.draw()


def test_reactions(run):
    figure, axes = plot.reactions(run)
    assert axes.shape == (3, 2)
    line = axes[0, 0].get_lines()[0]
    expected = np.linalg.norm(run.reaction.sel(joint="leg1.U", component=["Fx", "Fy", "Fz"]), axis=1)
    np.testing.assert_allclose(line.get_ydata(), expected, rtol=1e-14)
    assert axes[1, 1].get_ylabel() == "moment [N·m]"
    figure.canvas.draw()
    for k in (0, 1):    # what is as wide as both columns says nothing of when it is in the panels above
        assert axes[1, k].get_xlabel() == "time [s]" and axes[1, k].xaxis.get_tick_params()["labelbottom"]


def test_few_joints_share_a_panel(run):
    """Up to eight lines are in one panel, whatever numbers their names have."""
    few = run.isel(joint=[0, 1, 2, 3])
    assert len({str(name).rpartition(".")[2] for name in few.joint.values}) > 1
    _, axes = plot.reactions(few)
    assert len(axes) == 1 and len(axes[0, 0].get_lines()) == 8      # and their peaks


def test_a_constant_line_lies_below_the_edge(run):
    """Of a force that hardly changes the whole line is seen."""
    even = run.isel(joint=[0]).copy(deep=True)
    even["reaction"] = even.reaction.isel(sample=[0] * even.sizes["sample"]).copy(data=np.ones(even.reaction.shape))
    _, axes = plot.reactions(even)
    low, high = axes[0, 0].get_ylim()
    assert low == 0.0 and high == pytest.approx(1.05 * np.sqrt(3))


def test_errors_of_rounding_alone_have_whole_decades():
    """A study in which every solver is exact: no ticks between 1.18e-15 and 1.3e-15."""
    rows = {"analysis": ["inverse"] * 2, "method": ["elimination", "dense"], "seconds": [1e-6, 2e-6], "error": [1.18e-15, 1.3e-15]}
    _, axes = plot.study(xr.Dataset({name: ("row", values) for name, values in rows.items()}))
    low, high = axes[0].get_ylim()
    assert (low, high) == (pytest.approx(1e-15), pytest.approx(1e-14))


def test_rounding_of_zero_is_no_reaction(run):
    """Moments that no joint bears have no panel, and no line beside true ones."""
    noisy = run.copy(deep=True)
    moments = {"component": ["Mx", "My", "Mz"]}
    rounding = 1e-17 * np.random.default_rng(1).normal(size=noisy.reaction.loc[moments].shape)
    noisy["reaction"].loc[moments] = rounding
    _, axes = plot.reactions(noisy)
    assert axes.shape == (3, 1)
    assert not any("Mx" in head for head in run_sheet._joints(noisy).head)
    noisy["reaction"].loc[{"joint": "leg1.P", **moments}] = run.reaction.sel(joint="leg1.P", **moments).values
    _, axes = plot.reactions(noisy)
    assert [axis.get_visible() for axis in axes[:, 1]] == [False, True, False]
    assert [text.get_text().split()[0] for text in axes[1, 1].texts] == ["leg1.P"]
    table = run_sheet._joints(noisy)
    column = next(i for i, head in enumerate(table.head) if head.startswith("Mx"))
    assert [row[0].text for row in table.rows if row[column].text != run_sheet.NONE] == ["leg1.P"]


def test_small_numbers_have_ticks_that_differ(run):
    small = run.copy(deep=True)
    small["driving_force"] = 1e-15 * small.driving_force
    figure, axes = plot.driving_forces(small)
    figure.canvas.draw()
    texts = [tick.get_text() for tick in axes[0].get_yticklabels()]
    assert len(set(texts)) == len(texts) > 2


def test_pictures_with_failed_samples(crossing):
    """Curves have gaps there, and nowhere else."""
    run = linkdyn.Scene(crossing).inverse()
    failed = run.status.values != 0
    assert failed.any() and not failed.all()
    for draw in (plot.driving_forces, plot.reactions):
        figure, axes = draw(run)
        figure.canvas.draw()
        whole = [line for axis in np.ravel(axes) for line in axis.lines if len(line.get_ydata()) == len(failed)]
        assert whole
        for line in whole:
            np.testing.assert_array_equal(np.isnan(np.asarray(line.get_ydata(), float)), failed)


def test_batch_without_time(scene):
    figure, axes = plot.driving_forces(scene.inverse(scene.motion()[0][:10]))
    assert axes[0].get_xlabel() == "sample"
    figure.canvas.draw()


def test_scene3d(scene):
    figure, axis = plot.scene3d(scene)
    texts = {text.get_text().strip() for text in axis.texts}
    assert {"platform", "frame", "leg1", "leg6"} <= texts
    assert [axis.get_xlabel(), axis.get_ylabel(), axis.get_zlabel()] == ["x [m]", "y [m]", "z [m]"]
    kinds = {text.get_text() for text in axis.get_legend().get_texts()}
    assert kinds == {"universal", "prismatic", "spherical"}
    figure.canvas.draw()


def test_scene3d_draws_the_platform_where_it_is(scene):
    q = np.array([0.1, -0.2, 1.2, 0.0, 0.0, 0.0])
    _, axis = plot.scene3d(scene, q)
    drawn = np.concatenate([np.array(line.get_data_3d()).T for line in axis.get_lines()])
    for name, at in {m["name"]: m["at"] for m in scene.description["links"][1]["markers"]}.items():
        distance = np.linalg.norm(drawn - (q[:3] + at), axis=1).min()
        assert distance < 1e-12, name


def test_what_cannot_be_drawn_is_refused(scene, crossing):
    with pytest.raises(linkdyn.InputError, match="no reaction"):
        plot.reactions(scene.inverse(scene.motion()[0][:2], want="driving_force"))
    wrong = linkdyn.Scene(crossing)
    with pytest.raises(linkdyn.InputError, match="cannot be assembled"):
        plot.scene3d(wrong, wrong.motion()[0][2])


# ---------------------------------------------------------------- planar drawings and moving pictures

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture(scope="module")
def sixbar():
    return linkdyn.load(EXAMPLES / "sixbar_slider" / "scene.toml")


@pytest.fixture(scope="module")
def turn(sixbar):
    return sixbar.inverse()


def test_a_slot_is_named_once():
    """Its block and pin, which the engine has besides, stood beside it under names that nobody gave."""
    scene = linkdyn.new("quick-return")
    figure, axis = plot.mechanism(scene)
    texts = [name for text in axis.texts for name in text.get_text().split(", ")]
    plt.close(figure)
    description, _ = view_data.describe(scene.inverse(), scene, kinds=())
    for names in (texts, [name for entry in description["names"] for name in entry[0].split(", ")]):
        assert names.count("slot") == 1 and not any(name.startswith("slot.") for name in names)


@pytest.mark.parametrize(("q", "got"), [([0.1, 0.2], "(2,)"), ([[0.1]], "(1, 1)"), (0.1, "()")])
def test_the_pose_of_a_mechanism_has_a_number_for_each_coordinate(q, got):
    """What was wrong was told of an array that nobody gave, of shape (1, 2) where (N, 1) was expected."""
    with pytest.raises(linkdyn.InputError, match=re.escape(f"mechanism: q: expected shape (1,) for one pose (A), got {got}")):
        plot.mechanism(linkdyn.new("four-bar"), q=q)


def test_names_of_a_planar_mechanism_do_not_overlap(sixbar):
    for name in ("sixbar_slider", "slider_crank", "andrews", "watt_i"):
        figure, axis = plot.mechanism(linkdyn.load(EXAMPLES / name / "scene.toml"))
        figure.canvas.draw()
        boxes = [text.get_window_extent() for text in axis.texts]
        assert len(boxes) >= 6, name
        for k, box in enumerate(boxes):
            assert not any(box.overlaps(other) for other in boxes[:k]), (name, axis.texts[k].get_text())
            assert axis.bbox.contains(*box.min) and axis.bbox.contains(*box.max), (name, axis.texts[k].get_text())


@pytest.mark.parametrize("name", ["four_stroke", "hoist", "hill_start", "flyball_governor", "screw_lift"])
def test_numbers_of_narrow_axes_do_not_overlap(name):
    figure, axis = plot.mechanism(linkdyn.load(EXAMPLES / name / "scene.toml"))
    figure.canvas.draw()
    for one in (axis.xaxis, axis.yaxis, *([axis.zaxis] if hasattr(axis, "zaxis") else [])):
        boxes = [tick.label1.get_window_extent() for tick in one.get_major_ticks() if tick.label1.get_text() and tick.label1.get_visible()]
        assert not any(box.overlaps(other) for k, box in enumerate(boxes) for other in boxes[:k]), (name, one.axis_name)


@pytest.mark.parametrize("name", ["worm_winch", "air_bearing_stage", "bucket_tappet", "stewart_taghirad"])
def test_pictures_in_space_are_as_large_as_what_is_drawn(name, tmp_path):
    """Also when they are saved without a wish for that; tall and flat mechanisms as those between."""
    figure, axis = plot.mechanism(linkdyn.load(EXAMPLES / name / "scene.toml"))
    for border in (None, "tight"):
        figure.savefig(tmp_path / "scene.png", dpi=60, bbox_inches=border)
        rows, columns = np.nonzero((plt.imread(tmp_path / "scene.png")[..., :3] < 0.99).any(axis=2))
        height, width = plt.imread(tmp_path / "scene.png").shape[:2]
        assert max(rows.min(), columns.min(), height - 1 - rows.max(), width - 1 - columns.max()) < 0.25 * 60, border
        assert min(rows.min(), columns.min(), height - 1 - rows.max(), width - 1 - columns.max()) > 0, border
    figure.draw_without_rendering()
    legend = axis.get_legend().get_window_extent()
    assert not legend.overlaps(axis.title.get_window_extent()) and axis.title.get_window_extent().y0 < legend.y1 + 20


@pytest.mark.parametrize("name", ["worm_winch", "bucket_tappet", "flyball_governor", "agile_eye", "ship_hexapod"])
def test_numbers_in_space_stand_beside_their_axis(name):
    figure, axis = plot.mechanism(linkdyn.load(EXAMPLES / name / "scene.toml"))
    figure.draw_without_rendering()
    numbers = []
    for one in (axis.xaxis, axis.yaxis, axis.zaxis):
        low, high = one.get_view_interval()
        line = sampled(one.line.get_transform().transform(one.line.get_xydata()), 1.0)
        own = [tick.label1.get_window_extent() for tick in one.get_major_ticks() if low <= tick.get_loc() <= high]
        for box in own:
            gap = np.linalg.norm(np.maximum(np.abs(line - (box.min + box.max) / 2) - box.size / 2, 0.0), axis=1).min()
            assert 1.0 < gap < 20.0, (one.axis_name, gap)
        numbers.append(own)
    assert not any(box.overlaps(other) for k, some in enumerate(numbers) for others in numbers[:k] for box in some for other in others)


@pytest.mark.parametrize("name", ["crankshaft_bearings", "double_wishbone", "worm_winch"])
def test_names_of_a_spatial_mechanism_stand_on_no_joint_and_on_no_other(name):
    """Drawn once, and again from where the drawing was turned to: then they go with what they name."""
    scene = linkdyn.Scene(Path(__file__).parents[2] / "examples" / name / "scene.toml")
    figure, axis = plot.mechanism(scene)
    figure.draw_without_rendering()
    joints = np.array([axis.transData.transform(line.get_xydata()[0]) for line in axis.lines if len(line.get_xydata()) == 1])
    boxes = [Text.get_window_extent(text) for text in axis.texts]     # without leaders
    assert len(boxes) > 5 and len(joints) > 2
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:k]), axis.texts[k].get_text()
        assert not any(box.contains(*joint) for joint in joints), axis.texts[k].get_text()
    (load,) = (text for text in axis.texts if text.get_text() == {"worm_winch": "load", "double_wishbone": "C"}.get(name, "A"))
    before = load.xy
    axis.view_init(elev=10.0, azim=axis.azim + 40.0)
    figure.draw_without_rendering()
    assert np.linalg.norm(np.subtract(load.xy, before)) > 1e-3


def test_names_of_bent_chains_belong_to_their_lines():
    """The middle of a leg's joints lies beside its rods: the name stood there, between three legs."""
    figure, axis = plot.mechanism(linkdyn.load(EXAMPLES / "tripteron" / "scene.toml"))
    figure.draw_without_rendering()
    for leg in ("leg1", "leg2", "leg3"):
        (name,) = (text for text in axis.texts if text.get_text() == leg)
        anchor = axis.transData.transform(name.xy)
        lines = [axis.transData.transform(line.get_xydata()) for line in axis.lines if len(line.get_xydata()) == 2]
        assert min(np.linalg.norm(sampled(line, 0.5) - anchor, axis=1).min() for line in lines) < 1.0, leg


@pytest.mark.thorough
def test_names_without_room_are_left_out_and_counted():
    """Those of 40 four-bars in a row lay on each other, none could be read."""
    figure, axis = plot.mechanism(linkdyn.load(EXAMPLES / "n_fourbar" / "scene_40.toml"))
    figure.draw_without_rendering()
    *names, note = axis.texts
    boxes = [text.get_window_extent() for text in names]
    assert not any(box.shrunk(0.8, 0.8).overlaps(other.shrunk(0.8, 0.8)) for k, box in enumerate(boxes) for other in boxes[:k])
    assert note.get_text().endswith("names left out: no room")
    _, axis = plot.mechanism(linkdyn.load(EXAMPLES / "n_fourbar" / "scene.toml"))
    assert len(names) > 20 and not any("left out" in text.get_text() for text in axis.texts)


def test_plates_are_convex():
    """A carrier that holds its planets and, between them, the sun: a triangle, no dart."""
    _, axis = plot.mechanism(linkdyn.load(EXAMPLES / "planetary_gearbox" / "scene.toml"))
    (plate,) = (patch.get_xy() for patch in axis.patches if len(patch.get_xy()) == 4 and np.ptp(patch.get_xy()[:, 1]) > 0.1)
    sides = np.diff(np.concatenate([plate, plate[1:2]]), axis=0)
    turns = sides[:-1, 0] * sides[1:, 1] - sides[:-1, 1] * sides[1:, 0]
    assert (turns > 0).all() and len(turns) == 3


def test_long_names_stand_beside_what_they_name():
    """A long name is as near as a short one where its end is: not on the piston, nor on the numbers of an axis."""
    _, axis = plot.mechanism(linkdyn.load(EXAMPLES / "four_stroke" / "scene.toml"))
    axis.figure.canvas.draw()
    (name,) = (text for text in axis.texts if text.get_text() == "small, cylinder")
    (piston,) = (patch for patch in axis.patches if patch.get_gid() == "solid" and patch.get_xy()[:, 1].min() > 0.1)
    box = name.get_window_extent()
    assert not box.overlaps(piston.get_window_extent()) and axis.bbox.contains(*box.min) and axis.bbox.contains(*box.max)


def test_planar_links_are_drawn_where_they_are(sixbar):
    """Bars end at the joints, also in a position that is not the first."""
    q = np.array([2.0])
    _, axis = plot.mechanism(sixbar, q)
    drawn = np.concatenate([line.get_xydata() for line in axis.get_lines()])
    tip = 0.3 * np.array([np.cos(2.0), np.sin(2.0)])
    assert np.nanmin(np.linalg.norm(drawn - tip, axis=1)) < 1e-12


def _names_of(path):
    _, axis = plot.mechanism(linkdyn.load(path))
    return {text.get_text() for text in axis.texts}


def test_only_driven_slides_are_cylinders():
    """A roller under a platform and a block on a lever are drawn as what they are, with their names."""
    names = _names_of(Path(linkdyn.__file__).parent / "_scenes" / "scissor-lift.toml")
    assert {"platform", "roller2", "cylinder"} <= names and not {"barrel", "piston"} & names
    assert {"lever", "block"} <= _names_of(EXAMPLES / "shaper" / "scene.toml")
    assert {"cylinder1", "cylinder2", "cylinder3"} <= _names_of(Path(linkdyn.__file__).parent / "_scenes" / "excavator.toml")


def test_what_lies_beside_a_cylinder_is_not_hidden():
    """A cylinder whose barrel carries a bracket is drawn as the links that it is made of."""
    text = (Path(linkdyn.__file__).parent / "_scenes" / "scissor-lift.toml").read_text()
    barrel = 'name = "barrel"\nmarkers = { c = { at = [0, 0], axis = [1, 0] } }'
    assert barrel in text
    _, axis = plot.mechanism(linkdyn.Scene(text.replace(barrel, barrel[:-1] + ', bracket = ["0.2 m", "0.1 m"] }')))
    assert {"barrel", "piston"} <= {text.get_text() for text in axis.texts}


def test_a_straight_link_is_a_bar_to_its_tip():
    """A lid beyond its hinge is as thick as between its hinges."""
    scene = linkdyn.load(EXAMPLES / "stopped_rocker" / "scene.toml")
    _, axis = plot.mechanism(scene)
    ways = [np.linalg.norm(np.diff(line.get_xydata(), axis=0)) for line in axis.get_lines() if line.get_linewidth() > 3 and len(line.get_xydata()) == 2]
    markers = next(link["markers"] for link in scene.description["links"] if link["name"] == "lid")
    longest = max(np.linalg.norm(np.subtract(a["at"], b["at"])) for a in markers for b in markers)
    assert max(ways) == pytest.approx(longest, rel=1e-9)


def test_flat_mechanism_has_a_flat_picture():
    figure, _ = plot.mechanism(linkdyn.load(EXAMPLES / "slider_crank" / "scene.toml"))
    width, height = figure.get_size_inches()
    assert height < 0.5 * width


def test_a_mechanism_in_one_point_is_drawn(tmp_path):
    """A disc on its own axis."""
    disc = linkdyn.Scene({
        "space": "planar", "frame": {"markers": {"O": [0, 0]}},
        "link": [{"name": "disc", "markers": {"A": [0, 0]}, "mass": 1, "cog": [0, 0], "inertia": 0.1}],
        "joint": [{"name": "J", "type": "revolute", "between": ["frame.O", "disc.A"]}],
        "coordinate": [{"joint": "J"}], "actuator": [{"joint": "J"}],
    })  # fmt: skip
    figure, axis = plot.mechanism(disc)
    assert np.isfinite([*figure.get_size_inches(), *axis.get_xlim()]).all()
    figure.savefig(tmp_path / "disc.png")


@pytest.mark.parametrize(("name", "ends", "pieces"), [
    ("geared_fivebar", [("frame", "K"), ("rod1", "C")], ["coil"]),
    ("double_wishbone", [("frame", "tower"), ("lower", "strut")], ["barrel", "rod", "coil"]),
])
def test_springs_are_drawn_between_their_ends(name: str, ends: list[tuple[str, str]], pieces: list[str]) -> None:
    """A coil that begins and ends where the spring is held, and goes round the line between; what damps is a barrel and a rod."""
    scene = linkdyn.load(EXAMPLES / name / "scene.toml")
    poses = scene.poses(scene.motion()[0][:1])
    links = [entry["name"] for entry in scene.description["links"]]
    held = []
    for link, marker in ends:
        k = links.index(link)
        at = next(np.array(entry["at"]) for entry in scene.description["links"][k]["markers"] if entry["name"] == marker)
        held.append(at if k == 0 else poses.position[0, k - 1] + poses.rotation[0, k - 1] @ at)
    held = np.array(held)
    _, axis = plot.mechanism(scene)
    lines = [np.array(line.get_data() if scene.planar else line.get_data_3d()).T for line in axis.get_lines()]
    held = held[:, : lines[0].shape[1]]
    coil = next(line for line in lines if len(line) > 10 and np.allclose(line[[0, -1]], held, atol=1e-12))
    along = (held[1] - held[0]) / np.linalg.norm(held[1] - held[0])
    off = (coil - held[0]) - np.outer((coil - held[0]) @ along, along)
    assert np.linalg.norm(off, axis=1).max() > 0.01 * np.linalg.norm(held[1] - held[0])
    halves = [line for line in lines if len(line) == 2 and (np.allclose(line[0], held[0], atol=1e-12) or np.allclose(line[1], held[1], atol=1e-12))]
    middles = [line for line in halves if np.allclose(line, held[0] + np.outer((line - held[0]) @ along, along), atol=1e-12)]
    assert (len(middles) >= 2) == ("barrel" in pieces)


def test_springs_and_brakes_of_hinges_go_round_them() -> None:
    for name, is_closed in (("tests/scenes/threerrr_pattern.toml", False), ("examples/fourbar_constant_torque/scene.toml", True)):
        scene = linkdyn.load(EXAMPLES.parent / name)
        spring = scene.description["springs"][0]
        assert (spring["stiffness"] == 0.0) == is_closed and spring["variable"] == "angle"
        pin = next(np.array(entry["at"])[:2] for entry in scene.description["links"][0]["markers"] if entry["name"] == spring["markers"][0])
        _, axis = plot.mechanism(scene)
        rounds = [np.array(line.get_data()).T - pin for line in axis.get_lines() if len(line.get_xdata()) >= 15]
        size = np.ptp(axis.get_xlim())
        close = [line for line in rounds if 0.005 * size < np.linalg.norm(line, axis=1).min() and np.linalg.norm(line, axis=1).max() < 0.06 * size]
        assert len(close) >= 1, name


def test_a_picture_that_cannot_be_drawn_says_which_links_do_not_close() -> None:
    scene = linkdyn.load(EXAMPLES / "fourbar" / "scene.toml")
    long = scene.with_({"link.coupler.markers.J3": [100, 0]})
    with pytest.raises(linkdyn.InputError, match="cannot be assembled in this position: links 'follower', 'coupler' cannot be closed"):
        plot.mechanism(long)


def test_soft_stops_are_no_springs_to_be_drawn() -> None:
    scene = linkdyn.load(EXAMPLES / "toggle_clamp" / "scene.toml")
    assert scene.description["stops"] and scene.description["springs"] == []


def test_a_pendulum_is_drawn_to_its_centre_of_mass():
    """It has no marker but its pivot: the picture was a point, and the interactive one the inside of a joint."""
    scene = linkdyn.Scene(Path(__file__).parents[1] / "scenes" / "ball_joint.toml")
    _, axis = plot.mechanism(scene)
    drawn = np.concatenate([np.array(line.get_data_3d()).T for line in axis.get_lines()])
    poses = scene.poses(scene.forward(t=[0.0]).q.values)
    centre = poses.position[0, 0] + poses.rotation[0, 0] @ [0.3, 0.0, 0.0]
    assert np.linalg.norm(drawn - centre, axis=1).min() < 1e-12
    description, _ = view_data.describe(scene.forward(t=[0.0, 1.0]), scene, kinds=())
    assert 0.25 < description["extent"] < 0.65
    legs = linkdyn.Scene(EXAMPLES / "stewart_tsai" / "scene.toml")
    seen, _ = view_data.describe(legs.inverse(t=[0.0]), legs, kinds=())
    assert seen["links"] == legs.description["links"]       # barrels and rods have an axis


def test_hodograph(turn):
    figure, axes = plot.hodograph(turn, ["J4", "J1"])
    assert [axis.get_title().split(":")[0] for axis in axes] == ["J4", "J1"]
    curve = max(axes[0].get_lines(), key=lambda line: len(line.get_xdata()))
    np.testing.assert_array_equal(curve.get_xydata(), turn.reaction.sel(joint="J4", component=["Fx", "Fy"]))
    figure.canvas.draw()


def test_polar(turn):
    figure, axis = plot.polar(turn)
    line = axis.get_lines()[1]
    expected = np.linalg.norm(turn.reaction.sel(joint="J1", component=["Fx", "Fy"]), axis=1)
    np.testing.assert_allclose(line.get_ydata(), expected, rtol=1e-14)
    np.testing.assert_array_equal(line.get_xdata(), turn.q[:, 0])
    figure.canvas.draw()


@pytest.mark.parametrize("kind", ["planar inverse", "spatial inverse", "spatial forward"])
def test_animate(tmp_path, kind, turn, scene, run):
    if kind == "spatial forward":
        shown = linkdyn.load(EXAMPLES / "stewart_forward" / "scene.toml").forward(0.1, method="rk4", step=5e-3)
    else:
        shown = turn if kind == "planar inverse" else run
    file = plot.animate(shown, tmp_path / "motion.gif", frames=5)
    with Image.open(file) as picture:
        assert picture.n_frames == 5 and picture.info["duration"] == pytest.approx(1000 / 15, abs=10)
        pictures = []
        for k in range(5):
            picture.seek(k)
            pictures.append(np.asarray(picture.convert("RGB")).astype(int))
    assert all(np.abs(a - b).max() > 100 for a, b in zip(pictures, pictures[1:])), "it moves"
    assert (pictures[0][0, 0] == 255).all()


def test_animation_shows_the_arrows_asked_for(tmp_path, turn):
    red, green = np.array([0xB2, 0x18, 0x2B]), np.array([0x1B, 0x78, 0x37])
    for forces, colours in (("all", (red, green)), ("reaction", (red,)), ((), ())):
        file = plot.animate(turn, tmp_path / "motion.gif", frames=3, forces=forces)
        picture = np.asarray(Image.open(file).convert("RGB")).astype(int)
        for colour in (red, green):
            there = (np.abs(picture - colour).max(axis=2) <= 2).sum() > 20
            assert there == any(colour is wanted for wanted in colours), (forces, colour)


def test_failed_samples_are_left_out(tmp_path, crossing):
    file = plot.animate(linkdyn.Scene(crossing).inverse(), tmp_path / "motion.gif")
    assert Image.open(file).n_frames == 4


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda run: plot.animate(run, "motion.avi"), "ends in .gif or .mp4"),
        (lambda run: plot.animate(run, "motion.gif", forces="wind"), "unknown 'wind'"),
        (lambda run: plot.animate(run, "motion.gif", frames=0), "frames: expected"),
        (lambda run: plot.animate(run.drop_attrs(), "motion.gif"), "no attribute 'scene'"),
        (lambda run: plot.hodograph(run, ["J9"]), "no joint 'J9'"),
        (lambda run: plot.hodograph(run, components="xz"), "expected two of x, y"),
        (lambda run: plot.polar(run, coordinate="J6"), "no angle of the run"),
    ],
)
def test_what_cannot_be_shown_is_refused(turn, call, message):
    with pytest.raises(linkdyn.InputError, match=message):
        call(turn)


def test_film_without_ffmpeg_says_so(turn, monkeypatch, tmp_path):
    from matplotlib import animation

    monkeypatch.setattr(animation.writers, "is_available", lambda name: False)
    with pytest.raises(linkdyn.UnavailableError, match="ffmpeg"):
        plot.animate(turn, tmp_path / "motion.mp4")


@pytest.mark.skipif(sys.platform == "win32", reason="a script of the shell stands for ffmpeg")
def test_film_without_an_encoder_says_what_ffmpeg_said(turn, monkeypatch, tmp_path):
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\ncase \"$*\" in *-version*) exit 0;; esac\necho \"Unknown encoder 'h264'\" >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    with pytest.raises(linkdyn.UnavailableError, match=r"^animate: \.mp4: ffmpeg failed: Unknown encoder 'h264' \(expected .*\)$"):
        plot.animate(turn, tmp_path / "motion.mp4")
    assert not (tmp_path / "motion.mp4").exists()


def test_the_tip_of_a_link_is_the_end_of_a_bar() -> None:
    """A pole on one pin and the pole's tip were joined by a thin line."""
    _, axes = plot.mechanism(linkdyn.load(EXAMPLES / "cart_pole" / "scene.toml"))
    bars = [line for line in axes.lines if line.get_linewidth() > 3 and np.hypot(*np.ptp(line.get_xydata(), axis=0)) > 0.9]
    assert len(bars) == 2  # its edge and itself


def test_what_arrows_mean_stands_where_the_mechanism_comes_least(closed_figures) -> None:
    """The ram of the shaper ran below it."""
    from matplotlib import pyplot

    from linkdyn._drawing import animation

    _, axes = pyplot.subplots()
    axes.set(xlim=(0, 10), ylim=(0, 10))
    size = np.array([0.4, 0.15])
    for points, corner in (([[5, 5]], "upper left"), ([[1, 9.5], [5, 5]], "upper right"), ([[1, 9.5], [9, 9.5]], "lower left"),
                           ([[1, 9.5], [9, 9.5], [1, 1], [9, 1]], None)):  # fmt: skip
        assert animation._empty_corner(axes, np.array([points], dtype=float), size) == corner
    assert animation._empty_corner(axes, np.array([[[5.0, 9.5]]]), np.array([0.95, 0.15])) == "lower left"


def test_no_name_lies_on_an_axis(closed_figures) -> None:
    """P1 and P2 of the linkage along the edges of its cube did."""
    figure, axes = plot.mechanism(linkdyn.load(EXAMPLES / "bricard" / "scene.toml"))
    figure.canvas.draw()
    lines = [axes.transData.transform(axis.line.get_xydata()) for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
    names = [Text.get_window_extent(artist) for artist in axes.texts if artist.get_text()]
    assert len(names) == 12
    for start, end in lines:
        along = start + np.linspace(0.0, 1.0, 2000)[:, np.newaxis] * (end - start)
        assert not any(box.x0 < x < box.x1 and box.y0 < y < box.y1 for box in names for x, y in along)


TITLE = r"A linkage with a title of many words, whose prototype costs $5 \frac or $6 and whose words go on and on and on, whatever paper they are written on"


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["four-bar", "hexapod"])
def test_titles_are_as_written_and_within_the_picture(kind: str, tmp_path: Path, closed_figures) -> None:
    """Long ones were cut off on both sides, and dollars taken for formulas: a wrong one ended in Python's own error."""
    scene = linkdyn.new(kind).with_({"title": TITLE})
    run = scene.inverse()
    figures = [plot.mechanism(scene)[0], plot.driving_forces(run)[0], plot.reactions(run)[0]]
    if kind == "four-bar":
        figures += [plot.polar(run)[0], plot.assemblies(scene)[0], scene.balance(["crank"]).plot()]
    for figure in figures:
        figure.canvas.draw()
        titles = [text for text in figure.findobj(Text) if "prototype" in text.get_text()]
        assert titles
        for title in titles:
            box = title.get_window_extent()
            assert not title.get_parse_math() and box.x0 >= -1.0 and box.x1 <= figure.bbox.x1 + 1.0
    plot.animate(run, tmp_path / "run.gif", frames=1)
    for name in ("run.pdf", "run.html"):
        run.linkdyn.sheet(tmp_path / name)


def test_rounding_is_no_force_in_a_picture(closed_figures) -> None:
    figure = linkdyn.new("four-bar").balance().plot()
    assert [text.get_text() for text in figure.axes[1].texts if "after" in text.get_text()] == ["after  peak 0 N"]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["A$\\frac$", 'A"x'])
def test_names_are_as_written(name: str, tmp_path: Path) -> None:
    """Dollars were taken for formulas; results of maps along what has a backslash or a quotation mark in its name could not be read."""
    parts = {"joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "rod.A"]}], "coordinate": [{"joint": "A"}], "actuator": [{"joint": "A"}]}
    parts["joint"][0]["name"] = parts["coordinate"][0]["joint"] = parts["actuator"][0]["joint"] = name
    rod = {"name": "rod", "mass": 2.0, "cog": [0.3, 0.0], "inertia": 0.06, "markers": {"A": [0.0, 0.0], "B": [0.6, 0.0]}}
    motion = {"law": "constant-rate", "rate": 1.0}
    parts["coordinate"][0]["motion"] = motion
    scene = linkdyn.Scene({"space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"A": [0, 0]}}, "link": [rod], **parts})
    scene.inverse().linkdyn.sheet(tmp_path / "run.html")
    table = {"axis": [{"coordinate": name, "linspace": [0.0, 6.0, 7]}], "map": [name]}
    run = scene.sweep(table, keep=["driving_force", "driving_speed"])
    assert run.sizes[name] == 7
    run.linkdyn.sheet(tmp_path / "sweep.html")
