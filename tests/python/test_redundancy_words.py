"""What is said of scenes whose joints hold a loop more often than once, or leave a leg to spin."""

import re

import linkdyn
import pytest

Z = [0.0, 0.0, 1.0]
CORNERS = [[0.0, 0.0, 0.0], [0.2, 0.3, 0.0], [0.9, 0.6, 0.0], [1.0, 0.0, 0.0]]


def loop(kinds: list[str], corners: list[list[float]], axes: list[list[float]] | None = None) -> dict:
    """One loop of links between joints J1, J2, ..., the first driven; the links' axes are the frame's as drawn."""
    axes = axes or [Z]*len(corners)
    links = [{"name": f"link{i + 1}", "mass": 1.0, "inertia": {"diagonal": [0.01, 0.01, 0.01]}, "cog": [0.0, 0.0, 0.0],
              "markers": {"P": {"at": [0.0, 0.0, 0.0], "axis": axes[i]},
                          "Q": {"at": [b - a for a, b in zip(here, there)], "axis": axes[i + 1]}}}
             for i, (here, there) in enumerate(zip(corners, corners[1:]))]
    ends = ["frame.A", *(f"link{i}.{m}" for i in range(1, len(corners)) for m in "PQ"), "frame.Z"]
    return {
        "title": "loop", "space": "spatial", "link": links,
        "frame": {"markers": {"A": {"at": corners[0], "axis": axes[0]}, "Z": {"at": corners[-1], "axis": axes[-1]}}},
        "joint": [{"name": f"J{i + 1}", "type": kind, "between": ends[2*i:2*i + 2]} for i, kind in enumerate(kinds)],
        "coordinate": [{"joint": "J1", "motion": {"law": "constant-rate", "start": "5 deg", "rate": "10 rpm"}}],
        "actuator": [{"joint": "J1"}],
    }


def message_of(scene: dict) -> str:
    with pytest.raises(linkdyn.SceneError) as refusal:
        linkdyn.Scene(scene | {"redundancy": "refuse"})
    return str(refusal.value)


@pytest.mark.parametrize(("kinds", "corners", "axes", "directions", "remedy"), [
    # a planar four-bar in space: its closing joint holds it in the plane thrice more
    (["revolute"]*4, CORNERS, None,
     "3 constraint directions are redundant, held by the other joints already: "
     "of joint 'J4' the force along its axis and both moments across its axis", {"J4": "spherical", "J3": "cylindrical"}),
    (["revolute", "revolute", "cylindrical", "revolute"], CORNERS, None,
     "2 constraint directions are redundant, held by the other joints already: of joint 'J4' both moments across its axis",
     {"J4": "spherical"}),
    (["revolute", "revolute", "revolute", "prismatic"], [[0, 0, 0], [0.2, 0.3, 0], [0.9, 0, 0], [1.5, 0, 0]], [Z, Z, Z, [1, 0, 0]],
     "of joint 'J4' one force across its axis and one moment across its axis and the moment about its axis",
     {"J3": "spherical", "J2": "cylindrical"}),
], ids=["four-bar", "with a cylindrical joint", "slider-crank"])
def test_redundant_directions(kinds, corners, axes, directions, remedy) -> None:
    """The message says which directions are held twice, and kinds of joints with which the scene is taken."""
    scene = loop(kinds, [[float(x) for x in corner] for corner in corners], axes)
    message = message_of(scene)
    assert directions in message
    assert dict(re.findall(r"joint '(\w+)' (\w+)", message[message.index("; make"):])) == remedy
    for joint in scene["joint"]:
        joint["type"] = remedy.get(joint["name"], joint["type"])
    scene["coordinate"][0]["motion"]["rate"] = 0.0
    assert linkdyn.Scene(scene).inverse(t=[0.0]).status.item() == 0


def test_a_loop_with_a_freedom_more() -> None:
    """Five bars in a plane count as over-constrained by one; three directions are."""
    scene = loop(["revolute"]*5, [*CORNERS[:2], [0.5, 0.8, 0.0], *CORNERS[2:]])
    assert "links 'link1', 'link2', 'link3', 'link4': 3 constraint directions are redundant" in message_of(scene)


def test_a_third_crank() -> None:
    """In the plane: a parallelogram's third crank holds what two hold."""
    cranks = [("A", 0.0), ("B", 1.0), ("C", 2.0)]
    body = {"mass": 1.0, "inertia": 0.1, "cog": [0.0, 0.0]}
    scene = {
        "title": "three cranks", "space": "planar", "frame": {"markers": {name: {"at": [x, 0.0]} for name, x in cranks}},
        "link": [*({"name": f"crank{name}", **body, "markers": {"O": {"at": [0.0, 0.0]}, "E": {"at": [0.0, 0.5]}}} for name, _ in cranks),
                 {"name": "bar", **body, "markers": {name: {"at": [x, 0.0]} for name, x in cranks}}],
        "joint": [{"name": f"{end}{name}", "type": "revolute", "between": between} for name, _ in cranks for end, between in (
            ("O", [f"frame.{name}", f"crank{name}.O"]), ("E", [f"crank{name}.E", f"bar.{name}"]))],
        "coordinate": [{"joint": "OA", "motion": {"law": "constant", "value": "10 deg"}}], "actuator": [{"joint": "OA"}],
    }
    message = message_of(scene)
    assert "1 constraint direction is redundant, held by the other joints already: of joint 'EC' one force" in message
    assert "make" not in message


def test_a_leg_spins_about_itself() -> None:
    """A leg of two links with a ball joint at either end is named, and how many more there are."""
    scene = loop(["revolute", "spherical", "prismatic", "spherical", "revolute"], [*CORNERS[:2], [0.5, 0.45, 0.0], *CORNERS[2:]],
                 [Z, Z, [0.7, 0.3, 0.0], Z, Z])
    message = message_of(scene)
    assert "links 'link2', 'link3' can spin between their spherical joints 'J2', 'J4' (make one of them universal)" in message


def test_a_limit_is_told() -> None:
    """A table on two spindles without a guide: threads cannot let go of a part of what they hold, and the message says so."""
    seats = {"A1": [0.0, 0.0, 0.0], "A2": [0.6, 0.0, 0.0]}
    threads = {"B1": [0.0, 0.0, 0.3], "B2": [0.6, 0.0, 0.3]}
    body = {"mass": 2.0, "inertia": {"diagonal": [0.1, 0.1, 0.1]}}
    scene = {"space": "spatial", "frame": {"markers": seats}, "coordinate": [{"joint": "A1"}], "actuator": [{"joint": "A1"}],
             "link": [{"name": "table", "markers": threads, **body}, *({"name": f"s{k}", "markers": {f"A{k}": seats[f"A{k}"], f"B{k}": threads[f"B{k}"]}, **body} for k in (1, 2))],
             "joint": [*({"name": f"A{k}", "type": "revolute", "between": [f"frame.A{k}", f"s{k}.A{k}"]} for k in (1, 2)),
                       *({"name": f"B{k}", "type": "screw", "lead": 0.005, "between": [f"s{k}.B{k}", f"table.B{k}"]} for k in (1, 2)),
                       {"name": "belt", "type": "belt", "between": ["s1.A1", "s2.A2"], "radii": [0.03, 0.03]}]}
    with pytest.raises(linkdyn.SceneError, match="redundancy = 'minimum-norm' needs joints that can let go of just these: .* a screw lets go of all but its thread"):
        linkdyn.Scene(scene)
