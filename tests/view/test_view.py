"""The interactive page, in a browser that reaches no host: what is drawn, counted and looked at; its files and messages."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import linkdyn
from linkdyn._view import data as view_data
from linkdyn._view import page as view_page
from linkdyn._commands.view import view_command

from test_glb import CORNERS, FACES, body, glb

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
VIEW = "document.querySelector('#linkdyn-view').viewer"
FRAME = "Number(document.querySelector('#linkdyn-view').dataset.frame)"
COLOURS = {"reaction": (0xB2, 0x18, 0x2B), "load": (0x1B, 0x78, 0x37), "driving": (0x5E, 0x2C, 0x91)}


def near(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Where the picture has a colour."""
    return np.abs(picture - np.array(colour)).max(axis=-1) < 12


def press(page, name: str) -> None:
    page.value(f"root.querySelector('.switch.{name}').click()")


@pytest.fixture(scope="module")
def fourbar():
    return linkdyn.load(EXAMPLES / "fourbar" / "scene.toml")


@pytest.fixture(scope="module")
def fourbar_page(fourbar, tmp_path_factory):
    file = tmp_path_factory.mktemp("view") / "fourbar.html"
    linkdyn.view(fourbar.inverse(), file)
    return file


@pytest.fixture(scope="module")
def excavator():
    return linkdyn.load(ROOT / "tests" / "view" / "excavator.toml")


def test_planar_picture(browser, fourbar, fourbar_page):
    page = browser.open(fourbar_page, "t=4.25")
    run = fourbar.inverse()
    # four joint forces and the arc of the drive; the loads of this example are moments
    assert page.state["arrows"] == "5" and page.state["frame"] == "425"
    # what is switched off is gone
    press(page, "reaction")
    assert page.state["arrows"] == "1"
    assert near(page.picture()[45:330], COLOURS["reaction"]).sum() == 0
    press(page, "reaction")
    # the charts tell the numbers of the instant
    shown = page.value("[...root.querySelectorAll('.chart')].map(c => c.querySelector('.chip b').textContent)")
    assert float(shown[0]) == pytest.approx(run.driving_force.values[425, 0] / 1e3, rel=1e-3)
    force = np.hypot(*run.reaction.sel(joint="J1", component=["Fx", "Fy"]).values[425])
    assert float(shown[1]) == pytest.approx(force / 1e3, rel=1e-3)
    titles = page.value("[...root.querySelectorAll('.chart select')].map(s => s.selectedOptions[0].text)")
    assert titles == ["driving torque [kN·m]", "joint force [kN]"]
    assert not page.complaints


def test_another_size_leaves_no_empty_picture(browser, fourbar_page):
    """What a browser paints is what is there when those who watch sizes have done their work."""
    page = browser.open(fourbar_page)
    colours = page.value("""new Promise(done => {
        const picture = root.querySelector('.picture'), canvas = root.querySelector('canvas');
        const shrink = () => Object.assign(picture.style, {flex: 'none', height: '260px'});
        new ResizeObserver(() => {
            if (picture.style.height !== '260px') { setTimeout(shrink); return; }
            const pixels = new Uint8Array(4 * canvas.width * canvas.height), gl = canvas.getContext('webgl2');
            gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
            done([canvas.height, new Set(new Uint32Array(pixels.buffer)).size]);
        }).observe(picture);
    })""")
    assert colours[0] == 260 and colours[1] > 10
    assert not page.complaints


def test_arrows_are_to_the_scale_of_the_legend(browser, fourbar, tmp_path):
    run = fourbar.inverse()
    run.reaction.loc[{"joint": ["J2", "J3", "J4"]}] = 0.0  # one arrow left
    page = browser.open(linkdyn.view(run, tmp_path / "one.html", forces="reaction").file, "t=4.25")
    assert page.state["arrows"] == "1"
    seen = near(page.picture()[45:330, 300:], COLOURS["reaction"])  # beside the legend
    rows, columns = np.nonzero(seen)
    width, text = page.value("(s => [s.querySelector('i').getBoundingClientRect().width, s.textContent])(root.querySelector('.size'))")
    force = run.reaction.sel(joint="J1", component=["Fx", "Fy"]).values[425]
    number, unit = text.split()
    expected = np.abs(force) / (float(number) * {"N": 1.0, "kN": 1e3}[unit]) * width
    assert max(expected) > 60
    np.testing.assert_allclose([np.ptp(columns), np.ptp(rows)], expected, atol=9)  # half the width of a head


def test_play_scrub_keys(browser, fourbar_page):
    page = browser.open(fourbar_page, "still")
    assert page.state["frame"] == "0"
    page.value("root.querySelector('.page').focus()")
    page.call("Input.dispatchKeyEvent", type="keyDown", key="ArrowRight")
    assert page.state["frame"] == "1"
    page.value("(s => { s.value = 300; s.dispatchEvent(new Event('input')); })(root.querySelector('.player input'))")
    assert page.state["frame"] == "300" and page.value("root.querySelector('output').textContent") == "3.000 s"
    middle = "(r => [r.left + r.width * 0.75, r.top + r.height / 2])"
    box = page.value(f"{middle}(root.querySelector('.u-over').getBoundingClientRect())")
    page.call("Input.dispatchMouseEvent", type="mousePressed", x=box[0], y=box[1], button="left", clickCount=1, buttons=1)
    page.call("Input.dispatchMouseEvent", type="mouseReleased", x=box[0], y=box[1], button="left", clickCount=1)
    assert abs(int(page.state["frame"]) - 450) < 4
    page.value("root.querySelector('.play').click()")
    page.wait(f"{FRAME} > 460 || {FRAME} < 300")
    assert not page.complaints


def test_dark_light_narrow(browser, fourbar_page):
    page = browser.open(fourbar_page, "t=1", size=(380, 700), dark=True)
    assert page.state["theme"] == "dark"
    assert page.picture().mean() < 70
    assert page.value("root.querySelector('.page').scrollWidth <= 380")
    page.value("root.querySelector('.theme').click()")
    assert page.state["theme"] == "light" and page.picture().mean() > 180
    assert not page.complaints


def test_hexapod(browser, tmp_path):
    """700 samples with all forces in 1.5 MB; six legs as cylinders, base and platform as plates."""
    scene = linkdyn.load(EXAMPLES / "stewart_drilling" / "scene.toml")
    run = scene.inverse(t=np.linspace(2.0, 30.0, 700))
    shown = linkdyn.view(run, tmp_path / "hexapod.html")
    assert shown.file.stat().st_size <= 1.5e6
    page = browser.open(shown.file, "t=9")
    load = np.linalg.norm(scene.load_values(np.array([9.0]))[0, :, :3], axis=-1)
    assert int(page.state["arrows"]) == 6 + np.count_nonzero(load > 100)
    assert page.value(f"{VIEW}.mechanism.telescopes.length") == 6
    plates = "link => link.children.filter(mesh => mesh.geometry.type === 'ExtrudeGeometry').length"
    assert page.value(f"{VIEW}.links.slice(0, 2).map({plates})") == [1, 1]
    press(page, "reaction")
    assert int(page.state["arrows"]) > 18
    # turned by the pointer, another picture
    before = page.picture()
    page.call("Input.dispatchMouseEvent", type="mousePressed", x=300, y=250, button="left", clickCount=1, buttons=1)
    page.call("Input.dispatchMouseEvent", type="mouseMoved", x=420, y=250, button="left", buttons=1)
    page.call("Input.dispatchMouseEvent", type="mouseReleased", x=420, y=250, button="left", clickCount=1)
    assert page.state and (np.abs(page.picture()[45:400] - before[45:400]).max(axis=-1) > 40).sum() > 2000
    assert not page.complaints


def test_springs_follow_their_ends(browser, tmp_path):
    """Stretched from one marker to the other at each frame; what is wound round a hinge turns with its link."""
    scene = linkdyn.load(EXAMPLES / "geared_fivebar" / "scene.toml")
    run = scene.inverse()
    page = browser.open(linkdyn.view(run, tmp_path / "spring.html").file, "still")
    link = [entry["name"] for entry in scene.description["links"]].index("rod1")
    at = next(entry["at"] for entry in scene.description["links"][link]["markers"] if entry["name"] == "C")
    for frame in (0, 40):
        page.value(f"{VIEW}.player.seek({frame})")
        ends = page.value(f"""(item => [0, item.length].map(y => item.group.position.clone().set(0, y, 0).applyMatrix4(item.group.matrix).toArray()))
            ({VIEW}.springs.stretched[0])""")
        pose = scene.poses(run.q.values[frame])
        np.testing.assert_allclose(ends[0][:2], [0.08, -0.12], atol=1e-5)
        np.testing.assert_allclose(ends[1][:2], (pose.position[0, link - 1] + pose.rotation[0, link - 1] @ at)[:2], atol=1e-4)
        assert page.value(f"{VIEW}.springs.stretched[0].group.visible")
    assert "return" in page.value("[...root.querySelectorAll('.labels span')].map(s => s.textContent)")
    assert not page.complaints


def test_wheels_are_seen_before_plates_and_round(browser, tmp_path):
    """The sun's rim through the arm's plate, and small discs before the large one that they turn in."""
    page = browser.open(linkdyn.view(linkdyn.load(EXAMPLES / "planetary_gearbox" / "scene.toml").inverse(t=[0.0]), tmp_path / "gears.html").file)
    names = page.value(f"{VIEW}.run.links.map(link => link.name)")
    largest = f"""k => {VIEW}.links[k].children.filter(m => m.position.z > 0).map(m => {{ m.geometry.computeBoundingSphere(); return m; }})
        .sort((a, b) => b.geometry.boundingSphere.radius - a.geometry.boundingSphere.radius)[0].position.z"""
    rim, plate = page.value(f"[{names.index('sun')}, {names.index('arm')}].map({largest})")
    assert rim > plate
    discs = page.value(f"""{VIEW}.links.flatMap(group => group.children.filter(m => m.position.z < -0.002 * {VIEW}.run.extent)
        .map(m => {{ m.geometry.computeBoundingSphere(); return [m.geometry.boundingSphere.radius, m.position.z]; }}))""")
    assert len(discs) > 3 and [z for _, z in sorted(discs)] == sorted((z for _, z in discs), reverse=True)


def test_excavator(browser, excavator, tmp_path):
    run = excavator.inverse()
    file = linkdyn.view(run, tmp_path / "arm.html", traces=("bucket.tip",), plots="joint_variable").file
    page = browser.open(file, "t=3")
    assert page.value(f"{VIEW}.mechanism.telescopes.map(t => t.joint.name)") == ["lift", "crowd", "curl"]
    assert page.value(f"{VIEW}.traces.children.length") == 1
    assert near(page.picture()[45:400], COLOURS["driving"]).sum() > 100
    # the rod reaches into its barrel at every sample, and never through its foot
    inside = page.value(f"""{VIEW}.mechanism.telescopes.map(t => {VIEW}.player.times.map((_, i) => {{
        const first = {VIEW}.poseOf(t.joint.links[0], i), second = {VIEW}.poseOf(t.joint.links[1], i);
        const foot = t.from.clone().applyMatrix4(first), mouth = t.barrelTo.clone().applyMatrix4(first), end = t.rodFrom.clone().applyMatrix4(second);
        return end.distanceTo(foot) < mouth.distanceTo(foot) && end.distanceTo(mouth) < 1.001 * mouth.distanceTo(foot); }}).every(Boolean))""")
    assert inside == [True, True, True]
    # what the page has of the poses is where the links are
    bucket = excavator.links.index("bucket")
    at = page.value(f"{VIEW}.placeOf([{bucket + 1}, 1.3, 0, 0]).toArray()")
    poses = excavator.poses()
    np.testing.assert_allclose(at, (poses.position + 1.3 * poses.rotation[..., 0])[60, bucket], atol=1e-3)
    assert not page.complaints


@pytest.mark.parametrize("scene", ["shaper", "quick-return", "scissor-lift"])
def test_slotted_levers_and_platforms_are_no_cylinders(browser, scene, tmp_path):
    """A block slides on a lever that goes on beyond it; only what is driven is a cylinder."""
    file = EXAMPLES / "shaper" / "scene.toml" if scene == "shaper" else Path(linkdyn.__file__).parent / "_scenes" / f"{scene}.toml"
    page = browser.open(linkdyn.view(linkdyn.load(file).inverse(), tmp_path / "slide.html").file, "still")
    cylinders = page.value(f"{VIEW}.mechanism.telescopes.map(t => t.joint.name)")
    assert cylinders == (["cylinder"] if scene == "scissor-lift" else [])
    slide = "top" if scene == "scissor-lift" else "slot"
    assert slide in page.value(f"{VIEW}.mechanism.rails.map(joint => joint.name)")
    assert not page.complaints


def test_barrels_hold_all_of_their_joints(browser, excavator, tmp_path):
    """A driven slide whose barrel holds another joint beyond its mouth is drawn as bars."""
    page = browser.open(linkdyn.view(excavator.inverse(), tmp_path / "arm.html").file, "still")
    reach = """(joint, far) => { const m = %s.mechanism, end = joint.ends[0];
        const beyond = { ...end, name: "far", at: end.at.clone().addScaledVector(end.axis, far) };
        m.joints.push({ type: "revolute", links: [end.link, 0], ends: [beyond, m.joints[0].ends[0]] });
        const found = m.telescope(joint); m.joints.pop(); return found !== null; }""" % VIEW
    joint = f"{VIEW}.mechanism.joints.find(joint => joint.name === 'lift')"
    assert page.value(f"[0.1, 3].map(far => ({reach})({joint}, far))") == [True, False]


def test_failed_samples(browser, crossing, tmp_path):
    run = linkdyn.Scene(crossing).inverse()
    page = browser.open(linkdyn.view(run, tmp_path / "gap.html").file, "t=2")
    assert page.state["arrows"] == "0"
    assert page.value("root.querySelector('.notice').textContent") == "not computed here: unreachable"
    page.value(f"{VIEW}.player.seek(3)")
    assert page.state["arrows"] == "6" and page.value("root.querySelector('.notice').textContent") == ""
    assert not page.complaints


def test_mesh(browser, tsai_file, tmp_path):
    corners = [[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.2]]
    lines = []
    for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)):
        lines += ["facet normal 0 0 0", "outer loop", *("vertex {} {} {}".format(*corners[i]) for i in face), "endloop", "endfacet"]
    (tmp_path / "part.stl").write_text("\n".join(["solid part", *lines, "endsolid part", ""]))
    scene = linkdyn.load(tsai_file)
    page = browser.open(linkdyn.view(scene, tmp_path / "m.html", meshes={"platform": tmp_path / "part.stl"}, mesh_unit=2).file)
    named = tomllib.loads(scene.text)
    named["link"][0] |= {"mesh": "part.stl", "mesh_unit": "in"}
    named = linkdyn.Scene(named, folder=tmp_path)
    assert view_page.meshes_of(named) == {"platform": (str(tmp_path / "part.stl"), 0.0254)} and '"scale":0.0254' in linkdyn.view(named).html
    k = 1 + scene.links.index("platform")
    assert page.value(f"{VIEW}.links[{k}].children.map(m => m.geometry.attributes.position.count)") == [12]
    normals = np.array(page.value(f"[...{VIEW}.links[{k}].children[0].geometry.attributes.normal.array]")).reshape(-1, 3)
    np.testing.assert_allclose(normals[::3], [[0, 0, -1], [0, -1, 0], [-1, 0, 0], np.full(3, 3**-0.5)], atol=1e-6)     # the file has zeros: black bodies
    widest = "(geometry => { geometry.computeBoundingBox(); return geometry.boundingBox.max.x; })"
    assert page.value(f"{widest}({VIEW}.links[{k}].children[0].geometry)") == pytest.approx(0.4)
    assert not page.complaints


def test_mesh_in_glb(browser, tsai_file, tmp_path):
    """The same triangles, outside out, as the browser has them."""
    (tmp_path / "part.glb").write_bytes(glb(*body([{"mesh": 0, "translation": [1, 0, 0]}])))
    scene = linkdyn.load(tsai_file)
    page = browser.open(linkdyn.view(scene, tmp_path / "m.html", meshes={"platform": tmp_path / "part.glb"}, mesh_unit=0.1).file)
    geometry = f"{VIEW}.links[{1 + scene.links.index('platform')}].children[0].geometry"
    corners = np.array(page.value(f"[...{geometry}.attributes.position.array]")).reshape(-1, 3, 3)
    np.testing.assert_allclose(corners, 0.1 * (CORNERS[FACES] + [1, 0, 0]), atol=1e-6)
    normals = np.array(page.value(f"[...{geometry}.attributes.normal.array]")).reshape(-1, 3)
    np.testing.assert_allclose(normals[:9:3], [[0, 0, -1], [0, -1, 0], [-1, 0, 0]], atol=1e-6)
    assert not page.complaints


def test_texts_stay_texts(browser, fourbar, tmp_path):
    """A title can neither end the script nor bring one."""
    hostile = fourbar.with_({"title": "</script><script>document.title='taken'</script> & <b>"})
    page = browser.open(linkdyn.view(hostile, tmp_path / "x.html").file)
    assert page.value("root.querySelector('h1').textContent") == hostile.title == page.value("document.title")
    assert not page.complaints


def test_names_stand_on_no_other(browser, tmp_path):
    """Of a planetary gear eight joints meet in a hand's breadth; while it turns, too."""
    file = tmp_path / "gears.html"
    linkdyn.view(linkdyn.load(EXAMPLES / "planetary_gearbox" / "scene.toml"), file)
    page = browser.open(file, "t=1.6")
    code = """[...root.querySelectorAll('.labels span:not([hidden])')].map((label) => label.getBoundingClientRect())
              .map(({ left, top, right, bottom }) => [left, top, right, bottom])"""
    for frame in (160, 161, 240):
        page.value(f"{VIEW}.player.seek({frame})")
        assert page.state["frame"] == str(frame)
        boxes = np.array(page.value(code))
        assert len(boxes) > 8
        for k, (left, top, right, bottom) in enumerate(boxes):
            apart = (boxes[:k, 0] >= right) | (boxes[:k, 2] <= left) | (boxes[:k, 1] >= bottom) | (boxes[:k, 3] <= top)
            assert apart.all(), (frame, k)


def test_names_are_whole_in_a_narrow_window(browser, tmp_path):
    """The hook of a crane is at the right of what is seen: its name was cut off."""
    file = tmp_path / "crane.html"
    linkdyn.view(linkdyn.load(EXAMPLES / "loader_crane" / "scene.toml"), file)
    page = browser.open(file, size=(240, 700))
    ends = page.value("[...root.querySelectorAll('.labels span:not([hidden])')].map(label => label.getBoundingClientRect()).map(r => [r.left, r.right])")
    assert len(ends) > 4 and np.min(ends) >= 0 and np.max(ends) <= 241     # a pixel for rounded widths of texts
    rows = page.value("['.play', '.player input', 'output', '.player select'].map(part => root.querySelector(part).getBoundingClientRect()).map(r => (r.top + r.bottom) / 2)")
    assert rows[0] == pytest.approx(rows[1], abs=2) and rows[2] == pytest.approx(rows[3], abs=2) and rows[2] > rows[1] + 10
    assert page.value("document.documentElement.scrollWidth") == 240


def test_the_legend_hides_no_foot(browser, tmp_path):
    """The cylinder of a crane stands on the ground in the lower left."""
    file = tmp_path / "crane.html"
    linkdyn.view(linkdyn.load(EXAMPLES / "loader_crane" / "scene.toml"), file)
    page = browser.open(file, "t=2.8")
    page.state
    legend = page.value("(({ left, top, right, bottom }) => [left, top, right, bottom])(root.querySelector('.scales').getBoundingClientRect())")
    foot = page.value(f"""(() => {{ const v = {VIEW}; const box = v.picture.getBoundingClientRect();
        const joint = v.mechanism.joints.flatMap((joint) => joint.ends).filter((end) => end.link === 0).map(({{ at }}) => v.stage.project(at));
        return joint.map(([x, y]) => [x + box.left, y + box.top]); }})()""")
    assert len(foot) > 1
    assert not any(legend[0] < x < legend[2] and legend[1] < y < legend[3] for x, y in foot)


def test_keys_work_at_once(browser, fourbar_page):
    """Nobody clicks into a page to press a key."""
    page = browser.open(fourbar_page, "t=1")
    for kind in ("keyDown", "keyUp"):
        page.call("Input.dispatchKeyEvent", type=kind, key="ArrowRight", code="ArrowRight")
    assert page.state["frame"] == "101"


def test_long_titles_leave_room(browser, fourbar, tmp_path):
    run = fourbar.inverse(t=[0.0, 0.1])
    told = tomllib.loads(fourbar.text)
    told["title"] = "a title that goes on and on " * 8
    file = tmp_path / "long.html"
    linkdyn.view(run, file, scene=linkdyn.Scene(told))
    page = browser.open(file)
    assert page.value("root.querySelector('header').offsetHeight") < 80
    assert page.value("root.querySelector('h1').title").strip() == told["title"].strip()


def test_charts(browser, fourbar, tmp_path):
    """Their last number is not cut off, zeros lie in the middle, and a finger moves the page up and down."""
    run = fourbar.inverse()
    run["driving_force"] = 0.0 * run.driving_force
    file = tmp_path / "zero.html"
    linkdyn.view(run, file)
    page = browser.open(file)
    plot = f"{VIEW}.charts[0].plot"
    assert page.value(f"{plot}.width - (({plot}.bbox.left + {plot}.bbox.width) / devicePixelRatio)") >= 18
    assert page.value(f"[{plot}.scales.y.min, {plot}.scales.y.max]") == [-1, 1]
    assert page.value(f"{plot}.over.style.touchAction") == "pan-y"


def test_charts_jump_at_events(browser, tmp_path):
    """What stands beside events is drawn between the samples, and the numbers of an instant stay those of its sample."""
    run = linkdyn.load(EXAMPLES / "stopped_rocker" / "scene.toml").forward()
    linkdyn.view(run, tmp_path / "lid.html", plots=["reaction"])
    page = browser.open(tmp_path / "lid.html", "t=0.5")
    chart = f"{VIEW}.charts[0]"
    assert page.value(f"{chart}.series[0].peak") == pytest.approx(run.linkdyn.worst().force["A"], rel=1e-3)
    moments = page.value(f"{chart}.moments")
    assert len(moments) == run.sizes["sample"] + 2 * run.sizes["event"] and moments == sorted(moments)
    frame = page.value(f"{VIEW}.frame ?? {chart}.frame")
    size = np.linalg.norm(run.reaction.values[frame, 0, :2])
    assert page.value(f"{chart}.series[0].numbers[{chart}.placeOf[{frame}]]") == pytest.approx(size, rel=1e-3)
    assert page.value(f"{chart}.times[{frame}]") == pytest.approx(0.5)
    assert not page.complaints


@pytest.mark.parametrize("value", [np.inf, 1e300, np.nan])
def test_numbers_beyond_all_are_not_shown(browser, fourbar, value, tmp_path):
    run = fourbar.inverse()
    run["weight"] = 3.0     # no row of samples
    run.reaction.values[5] = value
    file = tmp_path / "infinite.html"
    with np.errstate(over="ignore"):
        linkdyn.view(run, file)
    page = browser.open(file, "t=0.05")
    assert not page.complaints and page.state["arrows"] == "1"      # the drive
    page.value(f"{VIEW}.player.seek(6)")
    assert page.state["arrows"] == "5"


def test_forces_beside_torques_keep_their_title(tsai_file):
    scene = linkdyn.load(tsai_file)
    run = scene.inverse(scene.motion()[0][:3])
    run = run.assign_coords(actuator_unit=("actuator", ["N m", *run.actuator_unit.values[1:]]))
    run.driving_force.attrs["units"] = "N, N m"
    description, _ = view_data.describe(run, scene, kinds=())
    titles = [(chart["title"], chart["unit"]) for chart in description["charts"] if chart["result"] == "driving_force"]
    assert [title for title, _ in titles] == ["driving torque", "driving force"]


def test_one_sample_without_time(browser, tsai_file, tmp_path):
    scene = linkdyn.load(tsai_file)
    q = scene.motion(0.5)[0]
    page = browser.open(linkdyn.view(scene.inverse(q), tmp_path / "one.html").file)
    assert page.state["arrows"] == "6" and page.value("root.querySelector('.player')") is None
    assert not page.complaints


def test_nothing_is_asked_of_a_network(fourbar_page):
    text = fourbar_page.read_text()
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", text)
    assert "MIT" in text


# ---------------------------------------------------------------- Python and the command line


def test_long_runs_are_thinned_out(tsai_file):
    scene = linkdyn.load(tsai_file)
    assert len(linkdyn.view(scene.inverse(t=np.linspace(0, 1, 5000))).html) < 3e6


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"forces": "wind"}, "forces: unknown 'wind' (expected driving, reaction, load, all or none)"),
        ({"plots": "heat"}, "plots: the run has no 'heat'"),
        ({"traces": "coupler.J9"}, "no moving marker 'coupler.J9'"),
        ({"meshes": {"wheel": "a.stl"}}, "there is no link 'wheel'"),
        ({"meshes": {"crank": "a.obj"}}, "expected a file that ends in .stl or .glb"),
        ({"meshes": {"crank": "nowhere.stl"}}, "nowhere.stl"),
        ({"meshes": {"crank": "empty.stl"}}, "'empty.stl': has no triangles"),
        ({"meshes": {"crank": "short.stl"}}, "'short.stl': has no triangles"),
        ({"mesh_unit": 0}, "mesh_unit"),
        ({"file": "run.pdf"}, "ends in .html"),
        ({"file": "nowhere/run.html"}, "nowhere/run.html: cannot be written: there is no folder 'nowhere'"),
    ],
)
def test_refused(fourbar, options, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty.stl").write_text("solid nothing\nendsolid nothing\n")
    (tmp_path / "short.stl").write_bytes(bytes(80) + (2).to_bytes(4, "little") + bytes(50))
    with pytest.raises(linkdyn.LinkdynError) as caught:
        linkdyn.view(fourbar, **options)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "words"),
    [({"mesh": 3}, "'mesh'"), ({"mesh": "a.stl", "mesh_unit": "km"}, "'km'"), ({"mesh_unit": "mm"}, "missing key 'mesh'")],
)
def test_mesh_keys_refused(keys, words, tsai):
    tsai["link"][0] |= keys
    with pytest.raises(linkdyn.SceneError, match=words):
        linkdyn.Scene(tsai)


@pytest.mark.parametrize("what", ["sweep", "one sample", "no sample"])
def test_what_is_no_run(what, fourbar):
    run = fourbar.inverse()
    if what == "sweep":
        run = fourbar.sweep({"reduce": ["driving_force"], "axis": [{"coordinate": "J1", "linspace": [0, 1, 3]}]})
    else:
        run = run.isel(sample=0 if what == "one sample" else [])
    with pytest.raises(linkdyn.InputError, match="expected results of inverse or forward"):
        linkdyn.view(run)


def test_no_sample_that_can_be_shown(crossing):
    run = linkdyn.Scene(crossing).inverse()
    with pytest.raises(linkdyn.InputError, match="could be assembled"):
        linkdyn.view(run.isel(sample=[2]))


def test_a_build_without_node_says_so(tmp_path):
    """`-I -S`: without pip's node; an empty path: without the system's."""
    done = subprocess.run([sys.executable, "-I", "-S", ROOT / "tools" / "bundle_viewer.py", "fetch", ROOT / "viewer", tmp_path],
                          capture_output=True, text=True, env={"PATH": ""})
    assert done.returncode != 0 and "there is no node" in done.stderr and done.stderr.count("\n") == 1


def test_nothing_foreign_in_the_sources():
    lock = (ROOT / "viewer" / "package-lock.json").read_text()
    assert '"integrity"' in lock and '"resolved"' not in lock  # from whatever registry npm is set to
    listed = re.findall(r"'src/([\w.]+)'", (ROOT / "viewer" / "meson.build").read_text())
    assert sorted(listed) == sorted(path.name for path in (ROOT / "viewer" / "src").iterdir())


def test_without_the_viewer(fourbar, monkeypatch, tmp_path):
    monkeypatch.setattr(view_page, "VIEWER", tmp_path)
    with pytest.raises(linkdyn.UnavailableError, match="built without the viewer"):
        linkdyn.view(fourbar)


def test_in_a_notebook(fourbar):
    shown = linkdyn.view(fourbar)
    assert shown._repr_html_().startswith("<iframe srcdoc=") and "<script" not in shown._repr_html_()
    assert shown.file is None and "four-bar" in repr(shown) and len(repr(shown)) < 120


def run(*arguments, **options):
    command = [sys.executable, "-m", "linkdyn", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **options)


def test_command(tmp_path):
    scene = EXAMPLES / "fourbar_constant_torque" / "scene.toml"
    done = run("view", scene, "--no-open", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "scene.html" in done.stdout and '"kinetic_energy"' in (tmp_path / "scene.html").read_text()  # a forward run
    assert run("inverse", EXAMPLES / "fourbar" / "scene.toml", "-q", "-o", "run.nc", cwd=tmp_path).returncode == 0
    done = run("view", "run.nc", "-o", "page.html", "--no-open", "-q", "--forces", "none", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert '"shown":["traces","names"]' in (tmp_path / "page.html").read_text()


def test_command_with_a_scene_that_reads_tables(tmp_path, monkeypatch, capsys):
    folder = EXAMPLES / "stewart_drilling"
    linkdyn.load(folder / "scene.toml").inverse(want="driving_force").to_netcdf(tmp_path / "run.nc")
    monkeypatch.chdir(tmp_path)
    assert view_command(["run.nc", "--no-open"]) == 2
    told = capsys.readouterr().err
    assert "--scene" in told and told.count("\n") == 1
    assert view_command(["run.nc", "--no-open", "--scene", str(folder / "scene.toml")]) == 0
    assert Path("run.html").stat().st_size < 2e6


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere.toml"], "nowhere.toml: there is no such file"),
        (["nowhere.nc"], "nowhere.nc"),
        ([], "SCENE"),
        (["a.toml", "--wind"], "--wind"),
        (["broken.toml"], "broken.toml:1"),
        (["broken.nc"], "broken.nc"),
    ],
)
def test_command_refuses(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("broken.toml").write_text("title = \n")
    Path("broken.nc").write_text("no netCDF")
    try:
        status = view_command([*arguments, "--no-open"])
    except SystemExit as end:  # of the reader of options
        status = end.code
    told = capsys.readouterr().err
    assert status == 2 and told.count("\n") == 1 and words in told, told
    assert not list(tmp_path.glob("*.html"))


def test_the_bare_executable_says_so():
    from linkdyn.cli import executable

    done = subprocess.run([executable(), "view", "scene.toml"], capture_output=True, text=True)
    assert done.returncode == 2 and "Python package" in done.stderr and done.stderr.count("\n") == 1
