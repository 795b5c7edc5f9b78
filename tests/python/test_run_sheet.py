"""The sheet of a run and the drawing of a scene: their numbers are the run's, their files are sound, nothing in them is empty or hidden."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import linkdyn
import linkdyn.plot as plot
from linkdyn._drawing.lines import _apart, spread_names
from linkdyn._commands.new import kinds
from linkdyn._sheets import pdf, run_sheet
from linkdyn._sheets.sheet import sheet_page
from sheet_file import column, number, read

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
pytestmark = [pytest.mark.python_alone, pytest.mark.usefixtures("closed_figures")]


@pytest.fixture(scope="module")
def six_bar():
    return linkdyn.new("six-bar")


def test_numbers_are_those_of_the_run(six_bar, tmp_path):
    run = six_bar.inverse()
    _, tables = read(linkdyn.sheet(run, tmp_path / "run.html"))
    row = tables["Drives"][0]
    force = run.driving_force.values[:, 0]
    at = run.time.values[[force.argmax(), force.argmin()]]
    assert column([row], 1)[0] == force.max() and column([row], 3)[0] == force.min()
    assert [float(row[k].text.split()[0]) for k in (2, 4)] == pytest.approx(at, rel=1e-5)
    assert column([row], 5)[0] == pytest.approx(np.sqrt((force**2).mean()), rel=1e-12)
    joints = tables["Bearings and guides"]
    size = np.linalg.norm(run.reaction.sel(component=["Fx", "Fy"]), axis=2)
    np.testing.assert_allclose(column(joints, 1), size.max(axis=0), rtol=1e-12)
    assert number(joints[0][1]) == pytest.approx(size[:, 0].max(), rel=1e-3)
    assert "Warnings" not in tables


@pytest.mark.thorough
@pytest.mark.parametrize("kind", list(kinds()))
def test_every_kind_has_a_sheet(kind, tmp_path):
    scene = linkdyn.new(kind)
    page = sheet_page(scene.inverse(), scene=scene)
    assert {"Drives", "Bearings and guides"} <= {table.title for table in page.tables}
    for picture in page.pictures:
        for axis in picture.figure.axes:
            if axis.get_visible():
                assert axis.lines or axis.collections or axis.patches, (kind, picture.caption)
        picture.figure.canvas.draw()
    (tmp_path / "s.html").write_text("")
    file = linkdyn.sheet(scene.inverse(), tmp_path / "s.html")
    ET.fromstring(file.read_text(encoding="utf-8"))


def test_power_that_is_rounding_is_no_warning(tmp_path):
    # In a cam's dwell nothing takes any power: what is left is rounding, beside the forces that push across the way.
    run = linkdyn.new("cam").inverse()
    assert np.abs(run.power_imbalance).max() < 1e-13 and np.abs(run.driving_power).max() > 100
    assert "Warnings" not in read(linkdyn.sheet(run, tmp_path / "run.html"))[1]
    run.power_imbalance[int(np.abs(run.driving_power.values[:, 0]).argmax())] = 1e-6
    _, tables = read(linkdyn.sheet(run, tmp_path / "run.html"))
    assert "the power balance is off by 1e-06 of its terms" in tables["Warnings"][0][0].text


@pytest.mark.parametrize(
    "name, zero, other",
    [("planetary_gearbox", "force", "moment about the origin"),     # planets opposite each other
     ("bucket_tappet", "moment about the origin", "force")],        # all goes up and down on one line through the origin
)
def test_shaking_that_is_rounding_is_zero(name, zero, other):
    run = linkdyn.Scene(Path(__file__).parents[2] / "examples" / name / "scene.toml").inverse()
    (table,) = (part for part in sheet_page(run).tables if part.title.startswith("Shaking"))
    rows = {row[0].text: [cell.text for cell in row[1:]] for row in table.rows}
    assert rows[zero] == ["0", "N" if zero == "force" else "N·m", "–", "0"]
    assert float(rows[other][0]) > 0 and rows[other][2] != "–"


def test_names_beside_lines_do_not_overlap():
    for kind in ("hexapod", "delta", "excavator", "six-bar"):
        run = linkdyn.new(kind).inverse()
        for draw in (plot.driving_forces, plot.reactions):
            figure, axes = draw(run)
            figure.canvas.draw()
            for axis in np.ravel(axes):
                boxes = [text.get_window_extent() for text in axis.texts] if axis.get_visible() else []
                for k, box in enumerate(boxes):
                    assert not any(box.y0 < other.y1 - 1 and other.y0 < box.y1 - 1 for other in boxes[:k]), (kind, axis.texts[k].get_text())


def test_names_move_as_little_as_need_be():
    np.testing.assert_allclose(_apart(np.array([0.2, 0.5, 0.9]), 0.1), [0.2, 0.5, 0.9])
    np.testing.assert_allclose(_apart(np.array([0.5, 0.5, 0.9]), 0.1), [0.45, 0.55, 0.9])
    np.testing.assert_allclose(_apart(np.array([0.0, 0.0, 1.0, 1.0]), 0.2), [0.0, 0.2, 0.8, 1.0])


def test_many_lines_become_an_envelope():
    run = linkdyn.new("hexapod").inverse()
    names = [f"leg{k}.P" for k in range(1, 19)]
    force = np.linspace(1.0, 2.0, 18) * run.driving_force.values[:, :1]
    many = run.drop_dims("actuator").assign_coords(actuator=names, actuator_unit=("actuator", ["N"] * 18)).assign(
        driving_force=(("sample", "actuator"), force))
    _, axes = plot.driving_forces(many)
    assert sum(len(line.get_xdata()) > 1 and len(line.get_xdata()) == 201 for line in axes[0].get_lines()) == 1
    assert any("leg18.P, the worst" in text.get_text() for text in axes[0].texts) and len(axes[0].collections) == 1


def test_joints_without_a_moment_have_no_panel():
    _, axes = plot.reactions(linkdyn.new("four-bar").inverse())
    assert axes.shape == (1, 1)
    _, axes = plot.reactions(linkdyn.new("hexapod").inverse())
    assert [[axis.get_visible() for axis in row] for row in axes] == [[True, True], [True, True], [True, False]]
    axes[0, 0].figure.draw_without_rendering()      # the place of the panel that is not there is its neighbour's
    beside, alone = axes[0, 0].get_window_extent().width, axes[2, 0].get_window_extent().width
    assert alone > 1.9 * beside


def test_hodographs_are_of_forces_that_turn():
    """A force that keeps to a line is told by its magnitude; what is rounding beside the largest is no force."""
    scene = linkdyn.load(EXAMPLES / "flyball_governor" / "scene.toml")
    (picture,) = (item for item in sheet_page(scene.forward(), scene=scene).pictures if "Hodograph" in item.caption)
    assert picture.caption.endswith("; bearing keeps to one line")      # its weight and what shakes it, upright
    assert [axis.get_title().split(":")[0] for axis in picture.figure.axes if axis.get_visible()] == ["pivot1", "pivot2"]
    hill = linkdyn.load(EXAMPLES / "hill_start" / "scene.toml")     # shafts without weight: no forces at all
    assert not any("Joint forces" in item.caption for item in sheet_page(hill.forward(), scene=hill).pictures)
    hoist = linkdyn.load(EXAMPLES / "hoist" / "scene.toml")
    captions = [item.caption for item in sheet_page(hoist.forward(), scene=hoist).pictures]
    assert len(captions) == 3 and not any("Hodograph" in caption for caption in captions)


@pytest.mark.thorough
def test_no_picture_stands_beside_blank_paper(tmp_path):
    """Of a machine that nothing drives its motion is drawn where others have their driving forces; what stands alone has the whole row."""
    scene = linkdyn.load(EXAMPLES / "bricard" / "scene.toml")
    run = scene.forward(t=np.linspace(0.0, 0.5, 6))
    assert [picture.caption for picture in sheet_page(run, scene=scene).pictures][:2] == ["The machine where it starts", "Coordinates and their rates"]

    def classes(run):
        return re.findall(r"<figure(?: class=\"([a-z ]*)\")?>", linkdyn.sheet(run, tmp_path / "run.html", scene=scene).read_text())

    assert classes(run)[:2] == ["half", "half"] and set(classes(run)[2:]) == {"wide whole"}
    assert classes(run.isel(sample=slice(1))) == ["wide"]


def test_texts_of_pictures_are_as_large_as_those_of_the_page(tmp_path):
    """A letter of 10 points in a picture is 10 px to 11 px high: one panel was blown up to the whole width."""
    linkdyn.new("four-bar").inverse().linkdyn.sheet(tmp_path / "run.html")
    styles = re.findall(r'<img style="width: ([0-9.]+)em"', (tmp_path / "run.html").read_text())
    figure, _ = plot.reactions(linkdyn.new("four-bar").inverse())
    assert len(styles) >= 3 and any(float(width) == pytest.approx(7.5 * figure.get_size_inches()[0], rel=0.01) for width in styles)


def test_units_are_those_people_read():
    run = linkdyn.new("excavator").inverse()
    figure, axes = plot.driving_forces(run)
    figure.canvas.draw()
    assert axes[0].get_ylabel() == "driving force [kN]"
    ticks = {float(text.get_text().replace("−", "-")): at for at, text in zip(axes[0].get_yticks(), axes[0].get_yticklabels()) if text.get_text()}
    assert ticks and all(at == pytest.approx(1e3 * value) for value, at in ticks.items())
    _, axes = plot.driving_forces(linkdyn.new("six-bar").inverse(), over="A")
    assert axes[0].get_xlabel() == "angle of A [deg]"
    with pytest.raises(linkdyn.InputError, match="'B' is no angle of the run"):
        plot.driving_forces(linkdyn.new("six-bar").inverse(), over="B")


def test_cylinders_are_drawn_as_cylinders():
    """From hinge to hinge, without a bar or a block of their links."""
    scene = linkdyn.new("excavator")
    run = scene.inverse()
    _, axis = plot.mechanism(scene)
    texts = [text.get_text() for text in axis.texts]
    assert {"cylinder1", "cylinder2", "cylinder3"} <= set(texts) and not any("." in text for text in texts)
    drawn = np.concatenate([line.get_xydata() for line in axis.get_lines()])
    joints = {joint["name"]: joint for joint in scene.description["joints"]}
    for name, link in (("cylinder1.R1", "cylinder1.barrel"), ("cylinder1.R2", "cylinder1.rod")):
        marker = joints[name]["markers"][joints[name]["links"].index(1 + scene.links.index(link))]
        place = run.linkdyn.marker(f"{link}.{marker}").position.values[0]
        assert np.nanmin(np.linalg.norm(drawn - place, axis=1)) < 1e-12


# ---------------------------------------------------------------- warnings

def test_limits_that_are_exceeded_are_told_with_their_place(six_bar, tmp_path):
    bounded = linkdyn.Scene(six_bar.text + """
[sweep]
[[sweep.axis]]
time = true
linspace = [0, 0.1, 2]
[[sweep.limit]]
of = "driving_force"
max = "40 N m"
name = "motor"
[[sweep.limit]]
of = "reaction_force"
at = "C"
max = "10 kN"
name = "pin"
""")
    run = bounded.inverse()
    root, tables = read(linkdyn.sheet(run, tmp_path / "run.html"))
    (what, where), = tables["Warnings"]
    force = run.driving_force.values[:, 0]
    assert "motor" in what.text and f"{force.max():.4g}" in what.text and "allowed 40" in what.text
    assert f"{1e3 * run.time.values[force.argmax()]:.4g}"[:3] in where.text.replace(".", "") or f"{run.time.values[force.argmax()]:.4g}" in where.text
    assert [row[0].text for row in tables["Limits"]] == ["motor", "pin"]


def test_failed_samples_are_told(crossing, tmp_path):
    run = linkdyn.Scene(crossing).inverse()
    _, tables = read(linkdyn.sheet(run, tmp_path / "run.html"))
    n = int((run.status.values != 0).sum())
    what, where = tables["Warnings"][0]
    assert what.text.startswith(f"{n} of {run.sizes['sample']} samples failed")
    first = float(run.time.values[(run.status.values != 0).argmax()])
    assert where.text.startswith(f"first at {first:.6g} s")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda run, folder: linkdyn.sheet(run, folder / "run.txt"), "ends in .html or .pdf"),
        (lambda run, folder: linkdyn.sheet(run, folder / "run.html", design=1), "has one design"),
        (lambda run, folder: linkdyn.sheet(run.drop_vars(["driving_force", "reaction"]), folder / "run.html"), "neither driving forces nor reactions"),
    ],
)
def test_refused(six_bar, tmp_path, make, message):
    with pytest.raises(linkdyn.InputError, match=message):
        make(six_bar.inverse(), tmp_path)


# ---------------------------------------------------------------- the command

def command(*words, folder):
    return subprocess.run([sys.executable, "-m", "linkdyn", *words], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.thorough
def test_sheet_of_a_run(tmp_path):
    (tmp_path / "scene.toml").write_text(linkdyn.new("four-bar").text)
    said = command("inverse", "scene.toml", "--sheet", "out.html", folder=tmp_path)
    assert said.returncode == 0 and said.stdout.splitlines()[-1].split() == ["sheet", "out.html"], said.stderr
    assert read(tmp_path / "out.html")[0] is not None and (tmp_path / "out.nc").is_file()
    assert command("forward", "scene.toml", "--until", "0.1", "--sheet=out.pdf", "-q", folder=tmp_path).returncode == 0
    assert (tmp_path / "out.pdf").read_bytes()[:5] == b"%PDF-"
    for words, message in (
        (("--sheet", "out.txt"), "ends in .html or .pdf"),
        (("--sheet", "none/out.html"), "the folder is not there"),
        (("--sheet", "out.html", "--no-output"), "a run without --no-output"),
    ):
        said = command("inverse", "scene.toml", *words, folder=tmp_path)
        assert said.returncode == 2 and message in said.stderr and len(said.stderr.splitlines()) == 1


@pytest.mark.thorough
def test_sheet_of_a_run_with_failed_samples(crossing, tmp_path):
    (tmp_path / "scene.toml").write_text(linkdyn.Scene(crossing).text)
    said = command("inverse", "scene.toml", "--sheet", "out.html", folder=tmp_path)
    assert said.returncode == 3 and "Warnings" in read(tmp_path / "out.html")[1], said.stderr


@pytest.mark.thorough
def test_draw(tmp_path):
    (tmp_path / "scene.toml").write_text(linkdyn.new("excavator").text)
    said = command("draw", "scene.toml", folder=tmp_path)
    assert said.returncode == 0 and said.stdout.split() == ["picture", "scene.png"], said.stderr
    with Image.open(tmp_path / "scene.png") as picture:
        assert min(picture.size) > 300 and len(picture.convert("RGB").getcolors(1 << 20)) > 20
    assert command("draw", "scene.toml", "-o", "s.svg", "--at", "2", "--no-names", "-q", folder=tmp_path).stdout == ""
    assert "<svg" in (tmp_path / "s.svg").read_text()
    for words, message in (
        (("scene.toml", "-o", "s.txt"), "ends in .png"),
        (("scene.toml", "--at", "noon"), "expected seconds"),
        (("scene.toml", "--at", "1e3"), "expected an instant of the motion, from 0 to"),
        (("scene.toml", "--at", "nan"), "expected seconds, got 'nan'"),
        (("none.toml",), "none.toml"),
        (("scene.toml", "-o", "none/s.png"), "s.png"),
        ((), "required"),
    ):
        said = command("draw", *words, folder=tmp_path)
        assert said.returncode == 2 and message in said.stderr and len(said.stderr.splitlines()) == 1, said.stderr


@pytest.mark.thorough
def test_pages_are_filled(tmp_path):
    """What is wide went to a page of its own as tall as it could be, and a third of the page before was blank; so did the texts below it."""
    scene = linkdyn.load(EXAMPLES / "bricard" / "scene.toml")
    data = linkdyn.sheet(scene.forward(t_end=2.0), tmp_path / "run.pdf", scene=scene).read_bytes()
    assert re.search(rb"/Count (\d+)", data).group(1) == b"1"
    data = linkdyn.sheet(linkdyn.new("hexapod").inverse(), tmp_path / "run.pdf").read_bytes()
    assert re.search(rb"/Count (\d+)", data).group(1) == b"2"


def test_names_keep_apart_in_lower_pictures():
    run = linkdyn.new("hexapod").inverse()
    figure, axes = plot.reactions(run)
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, 0.62 * height)
    for axis in figure.axes:
        spread_names(axis)
    figure.canvas.draw()
    for axis in figure.axes:
        boxes = sorted((text.get_window_extent() for text in axis.texts if text.get_text()), key=lambda box: box.y0)
        assert all(below.y1 <= above.y0 + 1.0 for below, above in zip(boxes, boxes[1:]))


def test_heads_of_columns_do_not_touch(tmp_path):
    """Bold letters are wider: "Mz there" ran into "rms moment"."""
    scene = linkdyn.load(EXAMPLES / "bricard" / "scene.toml")
    page = sheet_page(scene.forward(t_end=1.0), scene=scene)
    table = next(table for table in page.tables if table.title == "Bearings and guides")
    writer = pdf._Writer()
    pdf._table(writer, table, pdf.MARGIN, pdf.WIDTH - pdf.MARGIN)
    figure = writer.at.figure
    renderer = figure.canvas.get_renderer()
    heads = [text.get_window_extent(renderer) for text in figure.texts if text.get_weight() == "bold" and text.get_text() in table.head]
    assert len(heads) == len(table.head)
    gaps = [after.x0 - before.x1 for before, after in zip(heads, heads[1:])]
    assert min(gaps) > 2.0


# ---------------------------------------------------------------- cylinders, stops, controllers, cams

CRANE = """
space = "planar"
gravity = [0, -9.81]
[frame]
markers = { A = { at = [0, 0], axis = [0, 1] } }
[[link]]
name = "load"
mass = 1000
inertia = 1
markers = { A = { at = [0, 0], axis = [0, 1] } }
[[joint]]
name = "ram"
type = "prismatic"
between = ["frame.A", "load.A"]
[[coordinate]]
joint = "ram"
motion = { law = "polynomial-345", from = "500 mm", to = "1150 mm", duration = 2 }
[[actuator]]
joint = "ram"
law = { type = "valve", value = "0.2*step(time - 0.1 s)" }
[actuator.cylinder]
bore = "50 mm"
rod = "30 mm"
stroke = ["600 mm", "1100 mm"]
dead_volumes = ["0.3 litre", "0.3 litre"]
bulk_modulus = "1.3 GPa"
supply = "52 bar"
tank = "2 bar"
valve = { flow = "30 litre/min", drop = "35 bar" }
[time]
end = 2
samples = 201
"""


@pytest.fixture(scope="module")
def crane():
    return linkdyn.Scene(CRANE)


def warned(run, tmp_path, **options):
    _, tables = read(linkdyn.sheet(run, tmp_path / "run.html", **options))
    return tables, [(row[0].text, row[1].text) for row in tables.get("Warnings", [])]


def test_cylinders_stand_on_the_sheet(crane, tmp_path):
    """What is asked of a cylinder beside what it has, by the formulas of a piston; beyond both it is told with its worst instant."""
    run = crane.inverse()
    tables, told = warned(run, tmp_path)
    head, ring = np.pi / 4 * 0.05**2, np.pi / 4 * (0.05**2 - 0.03**2)
    pressure = (1000 * (9.81 + run.qdd.values[:, 0]) + 2e5 * ring) / head
    slide = run.q.values[:, 0]
    row, = tables["Cylinders"]
    assert row[0].text == "ram"
    found = [number(cell) for cell in row if cell.text and cell.text[0].isdigit() and " " not in cell.text]
    flow = head * run.qd.values[:, 0] * 6e4
    weights = np.diff(run.time.values).mean() / (run.time.values[-1] + np.diff(run.time.values).mean())
    assert found == pytest.approx([pressure.max() / 1e5, 2.0, 52.0, flow.max(), flow.sum() * weights,
                                   ((pressure - 2e5) * flow / 6e4).max() / 1e0, 500, 1150, 600, 1100], rel=1e-3)
    above, beyond = pressure > 52e5, (slide < 0.6 - 1e-9) | (slide > 1.1 + 1e-9)
    assert 0 < above.sum() < 201 and 0 < beyond.sum() < 201
    first = run.time.values[[above.argmax(), beyond.argmax()]]
    assert told[0][0] == f"the cylinder at ram is above supply in {above.sum()} of 201 samples: {pressure.max() / 1e5:.4g} bar, available 52 bar"
    assert told[0][1] == f"most at {run.time.values[pressure.argmax()]:.6g} s, first at {first[0]:.6g} s"
    assert told[1][0].startswith(f"the cylinder at ram is beyond stroke in {beyond.sum()} of 201 samples: ")
    assert told[1][0].endswith(" mm, available 600 mm to 1100 mm") and f"first at {first[1]:.6g} s" in told[1][1]
    found = run.linkdyn.cylinder("ram")
    assert (found.attrs["above_supply"], found.attrs["beyond_stroke"], found.attrs["pressures_found"]) == (above.sum(), beyond.sum(), 0)


def test_a_motion_that_a_cylinder_can_is_no_warning(crane, tmp_path):
    """To both ends of the stroke, by the supply that it asks for, but for rounding."""
    fits = crane.with_({"coordinate.ram.motion.from": 0.6, "coordinate.ram.motion.to": 1.1})
    peak = float(fits.inverse().linkdyn.cylinder("ram").peak_pressure)
    tables, told = warned(fits.with_({"actuator.ram.cylinder.supply": peak * (1 - 1e-12)}).inverse(), tmp_path)
    assert told == [] and len(tables["Cylinders"]) == 1


def test_pressures_of_a_run_are_those_of_its_states(crane, tmp_path):
    """They came of the force, the other side at the tank's: 4.8 bar where there were 74.9."""
    run = crane.with_({"coordinate.ram.motion.from": 0.7, "actuator.ram.cylinder.supply": 120e5}).forward(t=np.linspace(0.0, 0.4, 41), rtol=1e-7)
    assert run.attrs["stopped"] == ""
    found = run.linkdyn.cylinder("ram")
    for chamber, name in (("head", "head"), ("rod", "rod")):
        np.testing.assert_array_equal(found[f"{name}_pressure"], run.cylinder_pressure.sel(cylinder="ram", chamber=chamber))
        np.testing.assert_array_equal(found[f"{name}_flow"], run.cylinder_flow.sel(cylinder="ram", chamber=chamber))
    assert found.peak_pressure == run.cylinder_pressure.max() and found.attrs["pressures_found"] == 1
    np.testing.assert_allclose(found.hydraulic_power, ((run.cylinder_pressure - 2e5) * run.cylinder_flow).sum("chamber").squeeze())
    tables, told = warned(run, tmp_path)
    row, = tables["Cylinders"]
    assert told == [] and number(row[1]) == pytest.approx(float(run.cylinder_pressure.sel(chamber="head").max()) / 1e5, rel=1e-3)


def test_stops_that_a_motion_passes_are_told(crane, tmp_path):
    stopped = tomllib.loads(CRANE) | {"stop": [{"name": "end", "joint": "ram", "max": 1.0, "restitution": 0.3}]}
    run = linkdyn.Scene(stopped).inverse()
    beyond = run.q.values[:, 0] > 1.0
    _, told = warned(run, tmp_path)
    assert told[0] == (f"the motion passes the end stop 'end.max' of joint 'ram' by {beyond.sum()} samples", f"first at {run.time.values[beyond.argmax()]:.6g} s")


def test_controllers_at_their_limits_are_told(tmp_path):
    scene = tomllib.loads(CRANE)
    scene["actuator"] = [{"joint": "ram"}]
    scene["coordinate"] = [{"joint": "ram", "start": 0.5}]
    scene["controller"] = [{"actuator": "ram", "target": 0.6, "kp": 4e5, "kd": 4e4, "limit": 12e3}]
    run = linkdyn.Scene(scene).forward(t_end=0.5)
    limited = run.controller_limited.values[:, 0] > 0
    assert 0 < limited.sum() < len(limited)
    _, told = warned(run, tmp_path)
    assert told == [(f"the controller ram is at its limit in {limited.sum()} of {len(limited)} samples", f"first at {run.time.values[limited.argmax()]:.6g} s")]


def test_followers_that_would_leave_their_cams_are_told(tmp_path):
    scene = linkdyn.new("cam")
    run = scene.inverse()
    assert "Warnings" not in warned(run, tmp_path)[0]
    run["contact_force"] = run.contact_force - float(run.contact_force.median())    # as a weaker spring would leave it
    force = run.contact_force.values[:, 0]
    lifts = force < -1e-6
    assert 0 < lifts.sum()
    _, told = warned(run, tmp_path)
    what, where = next(row for row in told if "leave its cam" in row[0])
    assert f"in {lifts.sum()} of {len(lifts)} samples: held by " in what and where.startswith(f"most at {run.time.values[force.argmin()]:.6g} s")


def test_a_motor_at_its_limit_has_no_margin():
    """It was what rounding leaves, 6.573e-14 N m."""
    scene = tomllib.loads(CRANE)
    scene["coordinate"] = [{"joint": "ram", "start": 0.5}]
    scene["actuator"] = [{"joint": "ram", "law": {"type": "formula", "value": "25 N*m", "at": "motor"},
                          "drive": {"lead": 0.01, "rotor_inertia": 1e-4, "torque_limit": 40.0}}]
    run = linkdyn.Scene(scene).forward(t_end=0.2)
    run["torque_margin"] = run.torque_margin * 0 + 6.573e-14     # of 25 N m
    page = sheet_page(run)
    motors = next(table for table in page.tables if table.title == "Motors")
    margin = next(k for k, head in enumerate(motors.head) if head.startswith("least\nmargin"))
    assert motors.rows[0][margin].text == "0" and not any(table.title == "Warnings" for table in page.tables)


def test_a_row_of_a_drive_has_one_unit():
    """Highest, lowest and rms of one force stand in one unit, whatever their sizes: -3761 N stood beside -16.64 kN."""
    scene = linkdyn.load(EXAMPLES / "fourbar" / "scene.toml")
    run = scene.inverse()
    force = run.driving_force.copy(data=np.linspace(-16640.0, -3.761, run.driving_force.size).reshape(run.driving_force.shape))
    (table,) = run_sheet._drives(run.assign(driving_force=force), scene)
    units = {head.rpartition("\n")[2] for head in table.head if head.startswith(("highest", "lowest", "rms\n[kN", "rms\n[N"))}
    assert len(units) == 1 and sum(head.startswith(("highest", "lowest", "rms\n[k")) for head in table.head) >= 3


def test_a_slot_stands_once():
    """The pin of a slot, a joint of its own within, bears what the slot bears: one row."""
    table = run_sheet._joints(linkdyn.new("quick-return").inverse())
    names = [row[0].text for row in table.rows]
    assert "slot" in names and "slot.pin" not in names


def test_the_head_says_from_where_all_is_seen():
    """On a ship places and speeds are as seen from the deck."""
    scene = linkdyn.load(EXAMPLES / "ship_hexapod" / "scene.toml")
    run = scene.inverse(t=[0.0, 0.1])
    assert any("seen from it" in line for line in run_sheet._facts(run, scene))
    still = linkdyn.new("four-bar")
    assert not any("seen from it" in line for line in run_sheet._facts(still.inverse(t=[0.0, 0.1]), still))


def test_drives_that_turn_have_rpm(tmp_path):
    """As motors and data sheets do; drives that push have m/s."""
    run = linkdyn.new("slider-crank").inverse()
    linkdyn.sheet(run, tmp_path / "run.html")
    (table,) = re.findall(r"<h2>Drives</h2>.*?</table>", (tmp_path / "run.html").read_text(), re.S)
    assert "[rpm]" in table and "rad/s" not in table
    assert f"{np.abs(run.driving_speed.values).max() * 30 / np.pi:.4g}" in table


def test_interpolated_in_time():
    """With time as the dimension a run is interpolated as xarray does it, and its methods still know it."""
    run = linkdyn.new("slider-crank").inverse()
    timed = run.swap_dims(sample="time")
    middle = 0.5 * (run.time.values[3] + run.time.values[4])
    between = timed.interp(time=[middle]).driving_force.values[0]
    np.testing.assert_allclose(between, run.driving_force.values[3:5].mean(axis=0), rtol=1e-12)
    assert timed.linkdyn.worst("driving_force").equals(run.linkdyn.worst("driving_force"))
