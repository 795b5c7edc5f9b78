"""Friction in joints, driven by their reactions: each check by a road of its own.

Closed forms (block, wedge, screw, friction circle), Newton's method in 50 digits on all equations at once, virtual power by a
power balance made of results alone, solvers and engines against each other.
"""

from __future__ import annotations

import math
from pathlib import Path

import mpmath
import numpy as np
import pytest

import linkdyn

TESTS = Path(__file__).resolve().parents[1]
EXAMPLES = TESTS.parent / "examples"
SOLVERS = ("elimination", "gauss-jordan", "gauss-jordan-plain", "lapack")
G = 9.81

BLOCK = """
space = "planar"
gravity = [0, -9.81]
[frame]
markers = {{ O = {{ at = [0, 0], axis = [{c}, {s}] }} }}
[[link]]
name = "block"
mass = 3
inertia = 0.01
cog = [0, 0]
markers = {{ C = {{ at = [0, 0], axis = [{c}, {s}] }}, top = [0, 0.2] }}
[[joint]]
name = "incline"
type = "prismatic"
between = ["frame.O", "block.C"]
[[coordinate]]
joint = "incline"
[[actuator]]
joint = "incline"
[[load]]
on = "block.top"
force = [0, 0]
[[friction]]
joint = "incline"
{friction}
"""


def block(friction: str, angle: float = 0.4) -> linkdyn.Scene:
    """A block on an incline, pulled along it."""
    return linkdyn.Scene(BLOCK.format(c=math.cos(angle), s=math.sin(angle), friction=friction))


@pytest.mark.parametrize("solver", SOLVERS)
def test_block_on_incline(solver: str) -> None:
    """F = m a + m g sin(alpha) + mu N sign(v), N = m g cos(alpha); nothing of it at rest."""
    scene, v = block("coulomb = 0.3"), np.array([0.5, -0.5, 0.0])
    run = scene.inverse(q=np.zeros((3, 1)), qd=v[:, None], qdd=np.full((3, 1), 0.7), solver=solver)
    normal = 3 * G * math.cos(0.4)
    np.testing.assert_allclose(run.driving_force[:, 0], 3 * 0.7 + 3 * G * math.sin(0.4) + 0.3 * normal * np.sign(v), rtol=1e-13)
    np.testing.assert_allclose(run.friction_power[:, 0], 0.3 * normal * np.abs(v), rtol=1e-13)
    np.testing.assert_allclose(run.friction[:, 0, 0], -0.3 * normal * np.sign(v) * math.cos(0.4), rtol=1e-13)
    assert np.abs(run.power_imbalance).max() < 1e-14


def test_coefficients_over_speed() -> None:
    """Stribeck's curve, what is viscous, the preload, and the smooth passage through rest."""
    scene = block('coulomb = 0.1\nstatic = 0.25\nstribeck_speed = "20 mm/s"\nviscous = "40 N*s/m"\npreload = "100 N"\n'
                  'creep_speed = "2 mm/s"')
    v = np.array([1e-4, -1e-3, 0.01, -0.03, 0.2, 3.0])
    run = scene.inverse(q=np.zeros((6, 1)), qd=v[:, None], qdd=np.zeros((6, 1)))
    mu = 0.1 + 0.15 * np.exp(-((v / 0.02) ** 2))
    expected = 3 * G * math.sin(0.4) + mu * np.tanh(v / 0.002) * (3 * G * math.cos(0.4) + 100) + 40 * v
    np.testing.assert_allclose(run.driving_force[:, 0], expected, rtol=1e-13)


def test_ends_of_a_guide() -> None:
    """A force above the guide tilts the block: both ends carry, and the friction of both retards."""
    scene, pull, length = block('coulomb = 0.3\nlength = "100 mm"', 0.0), 40.0, 0.1
    run = scene.inverse(q=[[0.0]], qd=[[0.2]], qdd=[[0.0]], wrench={"block.top": [pull, 0, 0]})
    weight, moment = 3 * G, 0.2 * pull
    ends = abs(weight / 2 + moment / length) + abs(weight / 2 - moment / length)
    assert ends > 1.5 * weight
    np.testing.assert_allclose(run.driving_force[0, 0], 0.3 * ends - pull, rtol=1e-13)


# ---------------------------------------------------------------- all mechanisms

FRICTION = {
    "revolute": {"coulomb": 0.12, "radius": 0.006},
    "prismatic": {"coulomb": 0.08},
    "cylindrical": {"coulomb": 0.09, "radius": 0.005, "length": 0.4},
    "universal": {"coulomb": 0.1, "radius": 0.006, "length": 0.3, "collar": 0.008},
    "spherical": {"coulomb": 0.11, "radius": 0.007},
    "planar": {"coulomb": 0.1, "radius": 0.02},
    "screw": {"coulomb": 0.05, "radius": 0.01, "length": 0.3},
}
APART = {"ball_joint": "nothing drives it", "flat_cam_3d": "it rubs already", "preloaded_shaft": "its bearings share reactions",
         "helical_reducer": "friction does not feel what drives its wheels apart", "worm_drive": "nor here"}
MECHANISMS = {
    path.parent.name + "/" + path.stem: path
    for path in [
        *(path for path in sorted((TESTS / "scenes").glob("*.toml")) if path.stem not in APART),
        *(EXAMPLES / name / "scene.toml" for name in (
            "andrews", "delta", "fourbar", "screw_lift", "slider_crank", "stephenson_iii", "stewart_aris", "stewart_drilling", "watt_i")),
    ]
}


def with_friction(path: Path) -> tuple[linkdyn.Scene, linkdyn.Scene]:
    """A mechanism as it is, and with friction in all of its joints that may have some."""
    plain = linkdyn.Scene(path)
    spinning = plain.description["idle_spins"].replace("+", " ").split()
    tables = []
    for joint in plain.description["joints"]:
        if joint["type"] not in FRICTION or any(plain.links[link - 1] in spinning for link in joint["links"] if link > 0):
            continue
        values = {key: value for key, value in FRICTION[joint["type"]].items()}
        tables.append(f'[[friction]]\njoint = "{joint["name"]}"\n' + "\n".join(f"{k} = {v}" for k, v in values.items()))
    return plain, linkdyn.Scene(plain.text + "\n" + "\n".join(tables) + "\n", folder=path.parent)


@pytest.mark.parametrize("name", MECHANISMS)
def test_what_friction_takes_the_drives_supply(name: str) -> None:
    """Ideal reactions do no work: with friction the drives supply what they did without, and what friction takes."""
    plain, rough = with_friction(MECHANISMS[name])
    q, qd, qdd = plain.motion()
    some = slice(0, len(q), max(1, len(q) // 40))
    rates = np.where(np.abs(qd[some]).max() > 0, qd[some], 0.1 * np.cos(np.arange(q[some].size).reshape(q[some].shape)))
    without = plain.inverse(q=q[some], qd=rates, qdd=qdd[some])
    run = rough.inverse(q=q[some], qd=rates, qdd=qdd[some], error=True)
    good = without.status.values == 0
    assert good.any() and (run.status.values[good] == 0).all()
    loss = run.friction_power.sum("joint").values[good]
    more = (run.driving_power.sum("actuator") - without.driving_power.sum("actuator")).values[good]
    assert (run.friction_power.values[good] >= 0).all() and loss.max() > 0
    size = np.abs(run.driving_power.values[good]).max()
    np.testing.assert_allclose(more, loss, atol=1e-12 * size, rtol=1e-9)
    assert np.abs(run.power_imbalance.values[good]).max() < 1e-12
    assert (run.driving_force_error.values[good] <= 1e-6 * np.abs(run.driving_force.values[good]).max()).all()
    check_laws(rough, run, good)
    for solver in SOLVERS:
        other = rough.inverse(q=q[some], qd=rates, qdd=qdd[some], solver=solver)
        for quantity in ("driving_force", "reaction", "friction"):
            values = run[quantity].values[good]
            np.testing.assert_allclose(other[quantity].values[good], values, rtol=1e-8, atol=1e-9 * np.abs(values).max())


def check_laws(scene: linkdyn.Scene, run: object, good: np.ndarray) -> None:
    """The law of friction where results alone tell it: F across the axis along which friction acts."""
    for joint in scene.description["joints"]:
        law = FRICTION.get(joint["type"])
        found = run.friction.sel(joint=joint["name"]).values[good]
        reaction = run.reaction.sel(joint=joint["name"]).values[good]
        if law is None or not np.abs(found).max() > 0 or joint["type"] not in ("revolute", "prismatic", "spherical"):
            continue
        n = 2 if scene.planar else 3
        force, moment = reaction[:, :n], found[:, n:]
        speed = np.linalg.norm(run.joint_rate.values[good][:, [str(v).startswith(joint["name"] + ".") for v in run.variable.values]], axis=1)
        if joint["type"] == "prismatic":
            size, pressed = np.linalg.norm(found[:, :n], axis=1), np.linalg.norm(force, axis=1)
            np.testing.assert_allclose(size, law["coulomb"] * pressed * np.tanh(speed / 1e-3), rtol=1e-9, atol=1e-12 * size.max())
            continue
        size = np.linalg.norm(moment, axis=1)
        pressed = np.linalg.norm(force, axis=1)
        if joint["type"] == "revolute" and not scene.planar:
            axis = moment / np.maximum(size, 1e-300)[:, None]
            pressed = np.linalg.norm(np.cross(axis, force), axis=1)
        if joint["type"] == "revolute":
            slow = np.tanh(law["radius"] * speed / 1e-3)
            np.testing.assert_allclose(size, law["coulomb"] * law["radius"] * pressed * slow, rtol=1e-9, atol=1e-11 * size.max())
        else:
            assert (size <= law["coulomb"] * law["radius"] * pressed * (1 + 1e-9)).all()


# ---------------------------------------------------------------- a slider-crank in 50 digits

CRANK = """
space = "planar"
gravity = [0, -9.81]
[frame]
markers = {{ A = [0, 0], D = [0, 0] }}
[[link]]
name = "crank"
mass = 1.5
inertia = 0.004
cog = [0.05, 0.01]
markers = {{ A = [0, 0], B = [0.12, 0] }}
[[link]]
name = "rod"
mass = {rod}
inertia = {rod_inertia}
cog = [0.16, 0]
markers = {{ B = [0, 0], C = [0.4, 0] }}
[[link]]
name = "slider"
mass = 2
inertia = 0.002
markers = {{ C = [0, 0], tip = [0.02, 0.03] }}
[[joint]]
name = "A"
type = "revolute"
between = ["frame.A", "crank.A"]
[[joint]]
name = "B"
type = "revolute"
between = ["crank.B", "rod.B"]
[[joint]]
name = "C"
type = "revolute"
between = ["rod.C", "slider.C"]
branch = 1
[[joint]]
name = "D"
type = "prismatic"
between = ["frame.D", "slider.C"]
[[coordinate]]
joint = "A"
[[actuator]]
joint = "A"
[[load]]
on = "slider.tip"
force = [-800, 0]
[[friction]]
joint = "A"
coulomb = 0.2
radius = "30 mm"
[[friction]]
joint = "B"
coulomb = 0.15
static = 0.25
stribeck_speed = "80 mm/s"
radius = "25 mm"
[[friction]]
joint = "C"
coulomb = 0.2
radius = "20 mm"
viscous = "0.3 N*m*s"
[[friction]]
joint = "D"
coulomb = {slide}
length = "90 mm"
[time]
end = 0
samples = 1
"""


def slider_crank_by_hand(angle: float, rate: float, acceleration: float) -> mpmath.matrix:
    """Newton's method in 50 digits on the nine equations of three bodies and what friction says of them, all at once.

    Unknown: forces at A, B, C on crank, rod, slider, normal force and moment of the guide, torque. Motion by differentiating the
    closure by hand.
    """
    mp = mpmath.mp
    with mp.workdps(50):
        r, l, x_cog = mp.mpf(0.12), mp.mpf(0.4), mp.mpf(0.16)
        a, w, e = map(mp.mpf, (angle, rate, acceleration))
        b = mp.asin(-r * mp.sin(a) / l)
        wb = -r * w * mp.cos(a) / (l * mp.cos(b))
        eb = (-r * e * mp.cos(a) + r * w**2 * mp.sin(a) + l * wb**2 * mp.sin(b)) / (l * mp.cos(b))

        def point(base: tuple, angle: mpmath.mpf, rate: mpmath.mpf, accel: mpmath.mpf, x: mpmath.mpf, y: mpmath.mpf) -> tuple:
            u = (x * mp.cos(angle) - y * mp.sin(angle), x * mp.sin(angle) + y * mp.cos(angle))
            return (
                (base[0][0] + u[0], base[0][1] + u[1]),
                (base[1][0] - rate * u[1], base[1][1] + rate * u[0]),
                (base[2][0] - accel * u[1] - rate**2 * u[0], base[2][1] + accel * u[0] - rate**2 * u[1]),
            )

        origin = ((0, 0), (0, 0), (0, 0))
        g1 = point(origin, a, w, e, mp.mpf(0.05), mp.mpf(0.01))
        pin = point(origin, a, w, e, r, mp.mpf(0))
        g2 = point(pin, b, wb, eb, x_cog, mp.mpf(0))
        wrist = point(pin, b, wb, eb, l, mp.mpf(0))
        speed = wrist[1][0]
        creep = mp.mpf(0.001)

        def friction(mu: mpmath.mpf, radius: mpmath.mpf, slip: mpmath.mpf, force: mpmath.mpf) -> mpmath.mpf:
            return -mu * radius * force * mp.tanh(radius * slip / creep)

        def equations(*u: mpmath.mpf) -> list:
            ax, ay, bx, by, cx, cy, n, m, torque = u
            v_b = mp.mpf(0.025) * abs(wb - w)
            mu_b = mp.mpf(0.15) + (mp.mpf(0.25) - mp.mpf(0.15)) * mp.exp(-((v_b / mp.mpf(0.08)) ** 2))
            fa = friction(mp.mpf(0.2), mp.mpf(0.03), w, mp.hypot(ax, ay))
            fb = friction(mu_b, mp.mpf(0.025), wb - w, mp.hypot(bx, by))
            fc = friction(mp.mpf(0.2), mp.mpf(0.02), -wb, mp.hypot(cx, cy)) - mp.mpf(0.3) * (-wb)
            ends = abs(n / 2 + m / mp.mpf(0.09)) + abs(n / 2 - m / mp.mpf(0.09))
            fd = -mp.mpf(0.1) * ends * mp.tanh(speed / creep)
            gravity = mp.mpf(-9.81)
            return [
                ax - bx - mp.mpf(1.5) * g1[2][0],
                ay - by + mp.mpf(1.5) * (gravity - g1[2][1]),
                torque + fa - fb + cross(sub((0, 0), g1[0]), (ax, ay)) - cross(sub(pin[0], g1[0]), (bx, by)) - mp.mpf(0.004) * e,
                bx - cx - mp.mpf(1.1) * g2[2][0],
                by - cy + mp.mpf(1.1) * (gravity - g2[2][1]),
                fb - fc + cross(sub(pin[0], g2[0]), (bx, by)) - cross(sub(wrist[0], g2[0]), (cx, cy)) - mp.mpf(0.014) * eb,
                cx - 800 + fd - 2 * wrist[2][0],
                cy + n + 2 * gravity - 2 * wrist[2][1],
                fc + m + mp.mpf(0.03) * 800,
            ]

        def cross(p: tuple, f: tuple) -> mpmath.mpf:
            return p[0] * f[1] - p[1] * f[0]

        def sub(p: tuple, q: tuple) -> tuple:
            return (p[0] - q[0], p[1] - q[1])

        # from the frictionless solution: the equations are then those of a start near it
        start = [900, 100, 900, 100, 900, 100, 100, -20, 20]
        return mpmath.findroot(equations, start, tol=1e-70, maxsteps=60)


@pytest.mark.parametrize("motion", [(0.7, 6.0, 3.0), (2.5, -4.0, 0.0), (4.4, 0.2, -1.0), (5.6, 1e-3, 2.0)])
def test_slider_crank_in_50_digits(motion: tuple[float, float, float]) -> None:
    """All reactions, and the torque, to rounding."""
    scene = linkdyn.Scene(CRANK.format(rod=1.1, rod_inertia=0.014, slide=0.1))
    angle, rate, acceleration = motion
    run = scene.inverse(q=[[angle]], qd=[[rate]], qdd=[[acceleration]], t=[0.0])
    expected = [float(x) for x in slider_crank_by_hand(*motion)]
    r = run.reaction.values[0]
    found = [*r[0, :2], *r[1, :2], *r[2, :2], r[3, 1], r[3, 2], run.driving_force.values[0, 0]]
    np.testing.assert_allclose(found, expected, rtol=2e-13, atol=2e-12 * max(map(abs, expected)))


def test_friction_circles() -> None:
    """A rod without mass between two pins carries a force along a common tangent of both friction circles."""
    scene = linkdyn.Scene(CRANK.format(rod=0, rod_inertia=0, slide=0))
    for angle, rate in ((0.7, 6.0), (2.2, -5.0), (4.0, 8.0)):
        run = scene.inverse(q=[[angle]], qd=[[rate]], qdd=[[0.0]], t=[0.0])
        b = math.asin(-0.3 * math.sin(angle))
        wb = -0.3 * rate * math.cos(angle) / math.cos(b)
        v_b = 0.025 * abs(wb - rate)
        mu_b = 0.15 + 0.1 * math.exp(-((v_b / 0.08) ** 2))
        force = run.reaction.values[0, 1, :2]  # crank on rod at B
        at_b = mu_b * 0.025 * np.sign(wb - rate)  # by how much the line of force passes B, C: against the relative turning
        at_c = 0.2 * 0.02 * np.sign(wb) + 0.3 * wb / np.linalg.norm(force)  # what is viscous widens the circle
        along = math.cos(b) * force[0] + math.sin(b) * force[1]
        across = -math.sin(b) * force[0] + math.cos(b) * force[1]
        assert abs(at_b + at_c) > 5e-5
        assert across / math.hypot(along, across) == pytest.approx(-(at_b + at_c) / 0.4, rel=1e-11)


# ---------------------------------------------------------------- screws and wedges, that lock

JACK = """
space = "spatial"
gravity = [0, 0, 0]
[frame]
markers = {{ S = [0, 0, 0], N = [0, 0, 0.4] }}
[[link]]
name = "screw"
mass = 0
markers = {{ S = [0, 0, 0], T = [0, 0, 0.1] }}
[[link]]
name = "rod"
mass = 0
markers = {{ T = [0, 0, -0.3], N = {{ at = [0, 0, 0], axis = [1, 0, 0] }} }}
start = {{ position = [0, 0, 0.4] }}
[[link]]
name = "pad"
mass = 0
markers = {{ N = [0, 0, 0], U = {{ at = [0, 0, 0], axis = [0, 1, 0] }} }}
start = {{ position = [0, 0, 0.4] }}
[[joint]]
name = "thread"
type = "screw"
lead = "{lead} mm"
between = ["frame.S", "screw.S"]
[[joint]]
name = "ball"
type = "spherical"
between = ["screw.T", "rod.T"]
[[joint]]
name = "cardan"
type = "universal"
between = ["rod.N", "pad.U"]
[[joint]]
name = "rail"
type = "prismatic"
between = ["frame.N", "pad.N"]
[[coordinate]]
joint = "{driven}"
[[actuator]]
joint = "{driven}"
[[load]]
on = "pad.N"
force = [0, 0, {force}]
[[load]]
on = "screw.S"
moment = [0, 0, {moment}]
[[friction]]
joint = "thread"
coulomb = {mu}
radius = "11 mm"
[time]
end = 0
samples = 1
"""


def jack(mu: float, lead: float = 5, driven: str = "thread", force: float = 0, moment: float = 0) -> linkdyn.Scene:
    """A screw in the frame that pushes a pad along a rail, by a rod between a ball and a universal joint."""
    return linkdyn.Scene(JACK.format(mu=mu, lead=lead, driven=driven, force=force, moment=moment))


@pytest.mark.parametrize("lead", [5, -5, 60])
def test_jack(lead: float) -> None:
    """W r tan(slope + friction angle) up, W r tan(slope - friction angle) down, whatever the hand of the thread."""
    weight, r, phi = 2e4, 0.011, math.atan(0.12)
    slope = math.atan(abs(lead) * 1e-3 / (2 * math.pi * r))
    scene = jack(0.12, lead, force=-weight)
    sense = math.copysign(1, lead)
    up = scene.inverse(q=[[0.0]], qd=[[sense * 9.0]], qdd=[[0.0]])
    down = scene.inverse(q=[[0.0]], qd=[[-sense * 9.0]], qdd=[[0.0]])
    assert float(up.joint_rate.sel(variable="rail.slide")[0]) > 0
    np.testing.assert_allclose(up.driving_force.values[0, 0], sense * weight * r * math.tan(slope + phi), rtol=1e-12)
    np.testing.assert_allclose(down.driving_force.values[0, 0], sense * weight * r * math.tan(slope - phi), rtol=1e-12)


WEDGE = """
space = "planar"
[frame]
markers = {{ O = {{ at = [0, 0], axis = [1, 0] }}, P = {{ at = [0, 0], axis = [0, 1] }} }}
[[link]]
name = "wedge"
mass = 0
markers = {{ O = {{ at = [0, 0], axis = [1, 0] }}, W = {{ at = [0, 0], axis = [{c}, {s}] }} }}
[[link]]
name = "block"
mass = 0
markers = {{ W = {{ at = [0, 0], axis = [{c}, {s}] }} }}
[[link]]
name = "ram"
mass = 0
markers = {{ W = [0, 0], P = {{ at = [0, 0], axis = [0, 1] }} }}
[[joint]]
name = "ground"
type = "prismatic"
between = ["frame.O", "wedge.O"]
[[joint]]
name = "slope"
type = "prismatic"
between = ["wedge.W", "block.W"]
[[joint]]
name = "pin"
type = "revolute"
between = ["block.W", "ram.W"]
[[joint]]
name = "press"
type = "prismatic"
between = ["frame.P", "ram.P"]
[[coordinate]]
joint = "press"
[[actuator]]
joint = "press"
[[load]]
on = "wedge.O"
force = [{force}, 0]
[[friction]]
joint = "slope"
coulomb = {mu}
[time]
end = 0
samples = 1
"""


def pushed_screw(mu: float, resisting: float, slope: float) -> linkdyn.Scene:
    return jack(mu, 2000 * math.pi * 0.011 * math.tan(slope), driven="rail", moment=resisting * 0.011)


def pushed_wedge(mu: float, resisting: float, slope: float) -> linkdyn.Scene:
    return linkdyn.Scene(WEDGE.format(c=math.cos(slope), s=math.sin(slope), mu=mu, force=-resisting))


@pytest.mark.parametrize("machine", [pushed_screw, pushed_wedge])
@pytest.mark.parametrize("solver", SOLVERS)
def test_locks(machine: object, solver: str) -> None:
    """What is pushed down its slope against a force: that force over tan(slope - friction angle) until it locks, and then nothing."""
    slope, force = 0.3, 1400.0
    name = "thread" if machine is pushed_screw else "slope"
    sign = 1 if machine is pushed_screw else -1  # which way drives it against the force
    for part in (0.3, 0.9, 0.999, 0.999999, 1.000001, 1.001, 1.5, 4.0):
        scene = machine(math.tan(part * slope), -sign * force, slope)
        run = scene.inverse(q=[[0.0]], qd=[[sign * 0.2]], qdd=[[0.0]], solver=solver)
        if part < 1:
            assert run.status.values[0] == 0
            np.testing.assert_allclose(run.driving_force.values[0, 0], sign * force / math.tan(slope * (1 - part)), rtol=1e-12 / (1 - part))
        else:
            assert run.status.values[0] == 6 and run.status.attrs["flag_meanings"].split()[6] == "locked"
            assert np.isnan(run.driving_force.values).all() and np.isnan(run.reaction.values).all()
            assert f"joint '{name}' locks" in run.attrs["failure"]
        # the other way the force drives it, and nothing locks
        run = scene.inverse(q=[[0.0]], qd=[[-sign * 0.2]], qdd=[[0.0]], solver=solver)
        assert run.status.values[0] == 0
        np.testing.assert_allclose(run.driving_force.values[0, 0], sign * force / math.tan(slope * (1 + part)), rtol=1e-9)


# ---------------------------------------------------------------- forward runs

TIME = '\n[time]\nend = {end}\nsamples = {samples}\n'


@pytest.mark.parametrize("method", ["rk8pd", "gbs", "seulex"])
def test_block_comes_to_rest(method: str) -> None:
    """m v' = -mu m g tanh(v/creep): sinh(v/creep) falls exponentially."""
    text = block('coulomb = 0.3\ncreep_speed = "50 mm/s"', 0.0).text.replace(
        'joint = "incline"\n[[actuator]]\njoint = "incline"', 'joint = "incline"\nstart = { position = 0, velocity = 2 }')
    scene = linkdyn.Scene(text + TIME.format(end=1.0, samples=21))
    run = scene.forward(method=method)
    t, creep = run.time.values, 0.05
    v = creep * np.arcsinh(np.sinh(2 / creep) * np.exp(-0.3 * G * t / creep))
    np.testing.assert_allclose(run.qd[:, 0], v, atol=2e-7)
    assert float(run.qd[-1, 0]) < 1e-6


def test_creeps_on_an_incline() -> None:
    """A block that friction would hold creeps down at creep atanh(tan(angle)/mu)."""
    text = block('coulomb = 0.5\ncreep_speed = "1 mm/s"', 0.3).text.replace('[[actuator]]\njoint = "incline"', "")
    run = linkdyn.Scene(text + TIME.format(end=0.5, samples=3)).forward(method="seulex")
    expected = -1e-3 * math.atanh(math.tan(0.3) / 0.5)
    assert float(run.qd[-1, 0]) == pytest.approx(expected, rel=1e-6)


ROTOR = """
space = "planar"
[[link]]
name = "rotor"
mass = 40
inertia = 0.5
cog = [0.1, 0]
markers = { O = [0, 0] }
[frame]
markers = { O = [0, 0] }
[[joint]]
name = "pin"
type = "revolute"
between = ["frame.O", "rotor.O"]
[[coordinate]]
joint = "pin"
start = { position = 0, velocity = 60 }
[[friction]]
joint = "pin"
coulomb = 0.3
radius = "80 mm"
[time]
end = 2
samples = 11
"""


def test_rotor_on_its_pin() -> None:
    """Its own centrifugal force brakes it, and braking adds to the force: 1/w = 1/w0 + k t, J k = mu r m e sqrt(1 + k^2)."""
    scene = linkdyn.Scene(ROTOR)
    run = scene.forward()
    about_pin, load = 0.5 + 40 * 0.1**2, 0.3 * 0.08 * 40 * 0.1
    k = load / math.sqrt(about_pin**2 - load**2)
    np.testing.assert_allclose(run.qd[:, 0], 1 / (1 / 60 + k * run.time.values), rtol=1e-8)
    other = scene.forward(method="rk4", step=1e-3)
    np.testing.assert_allclose(other.qd[:, 0], run.qd[:, 0], rtol=1e-6)
    spun = scene.ensemble(q=np.zeros((3, 1)), qd=np.array([[60.0], [30.0], [-60.0]]), t=[0.0, 2.0], step=1e-3)
    np.testing.assert_allclose(spun.qd.values[..., 0].reshape(3, 2)[:, -1], [1 / (1 / 60 + 2 * k), 1 / (1 / 30 + 2 * k), -1 / (1 / 60 + 2 * k)], rtol=1e-6)


def test_rotor_seizes() -> None:
    """With too large a pin the force of braking outgrows what brakes: no acceleration fits, and the pin is named."""
    scene = linkdyn.Scene(ROTOR.replace("80 mm", "800 mm"))
    with pytest.raises(linkdyn.InputError, match="joint 'pin' locks"):
        scene.forward()


@pytest.mark.parametrize("name", ["fourbar", "slider_crank", "stewart_aris", "screw_lift"])
def test_forward_after_inverse(name: str) -> None:
    """The forces of inverse dynamics keep up the motion that they were found for."""
    rough = with_friction(EXAMPLES / name / "scene.toml")[1]
    inverse = rough.inverse()
    t = inverse.time.values
    end = t[0] + 0.3 * (t[-1] - t[0])
    instants = t[t <= end]
    run = rough.forward(t=instants, method="rk8pd")
    good = run.status.values == 0
    assert good.all()
    size = np.abs(inverse.driving_force.values).max()
    n = len(instants)
    np.testing.assert_allclose(run.q, inverse.q[:n], atol=1e-6)
    np.testing.assert_allclose(run.driving_force, inverse.driving_force[:n], atol=1e-5 * size)
    np.testing.assert_allclose(run.friction_power, inverse.friction_power[:n], atol=1e-5 * np.abs(inverse.friction_power).max())
    assert np.abs(run.power_imbalance).max() < 1e-9


def test_simulator_feels_friction() -> None:
    """Step by step as in one run."""
    scene = linkdyn.Scene(ROTOR)
    whole = scene.forward(t=[0.0, 0.5, 1.0])
    simulator = scene.simulator()
    for _ in range(2):
        simulator.step(0.5, [])
    np.testing.assert_allclose(simulator.qd, whole.qd[-1], rtol=1e-7)


# ---------------------------------------------------------------- around it


def test_contributions_name_friction() -> None:
    """All causes add up; friction is what it adds to the ideal machine."""
    plain, rough = with_friction(EXAMPLES / "fourbar" / "scene.toml")
    run, ideal = rough.inverse(), plain.inverse()
    causes = linkdyn.cycle.contributions(run, rough)
    assert "friction" in causes.cause.values
    found = causes.driving_force.sel(cause="friction").values
    np.testing.assert_allclose(found, run.driving_force.values - ideal.driving_force.values, atol=1e-10)
    np.testing.assert_allclose(causes.reaction.sum("cause"), run.reaction, atol=1e-8)


def test_sweep_with_friction() -> None:
    """A sweep over poses, speeds and the coefficient finds the peak that single scenes find, and counts what locks."""
    text = CRANK.format(rod=1.1, rod_inertia=0.014, slide='"mu"') + "\n[variables]\nmu = 0.1\n"
    angles, coefficients = np.linspace(0.1, 6.0, 33), (0.05, 0.1, 30.0)
    largest, locked = 0.0, 0
    for mu in coefficients:
        scene = linkdyn.Scene(text.replace("mu = 0.1", f"mu = {mu}"))
        for rate in (5.0, -5.0):
            q = angles[:, None]
            run = scene.inverse(q=q, qd=np.full_like(q, rate), qdd=0 * q, t=np.zeros(33))
            largest = max(largest, float(run.driving_force.max()))
            locked += int((run.status == 6).sum())
    assert locked > 0
    swept = linkdyn.Scene(text).sweep({
        "reduce": ["driving_force"],
        "axis": [{"coordinate": "A", "linspace": [0.1, 6.0, 33]}, {"rate": "A", "values": [5.0, -5.0]},
                 {"parameter": "friction.D.coulomb", "values": list(coefficients)}],
    })
    assert float(swept.driving_force_max.max()) == pytest.approx(largest, rel=1e-12)
    assert int(swept.outcome_count.sel(outcome="locked").sum()) == locked


def test_changes_by_joint() -> None:
    """A table of friction is called by its joint, put in and taken out."""
    scene = linkdyn.Scene(CRANK.format(rod=1.1, rod_inertia=0.014, slide=0.1))
    again = scene.with_({"friction.A": None, "friction.B": None, "friction.C": None, "friction.D.coulomb": 0.2})
    one = again.with_({"friction.A": {"joint": "A", "coulomb": 0.2, "radius": "30 mm"}})
    at = {"q": [[0.4]], "qd": [[3.0]], "qdd": [[0.0]], "t": [0.0]}
    first, second = again.inverse(**at).friction_power[0], one.inverse(**at).friction_power[0]
    assert (first > 0).values.tolist() == [False, False, False, True] and (second > 0).values.tolist() == [True, False, False, True]


def test_motion_without_forces() -> None:
    """Kinematics alone asks for no friction."""
    plain, rough = with_friction(EXAMPLES / "fourbar" / "scene.toml")
    q = plain.motion()[0][:20]
    np.testing.assert_array_equal(plain.poses(q).position, rough.poses(q).position)
    np.testing.assert_array_equal(rough.load_values(q=q, qd=q).shape, plain.load_values(q=q, qd=q).shape)


def test_what_cannot_be() -> None:
    """Solvers without reactions, code without an iteration, and spins that friction would decide are refused by name."""
    scene = linkdyn.Scene(CRANK.format(rod=1.1, rod_inertia=0.014, slide=0.1))
    with pytest.raises(linkdyn.InputError, match="'reduced' has no reactions, which friction at joint 'A' comes from"):
        scene.inverse(q=[[0.3]], qd=[[0.0]], qdd=[[0.0]], t=[0.0], solver="reduced")
    with pytest.raises(linkdyn.InputError, match="friction at joint 'A' needs an iteration"):
        scene.generate()
    rssr = linkdyn.Scene(TESTS / "scenes" / "rssr.toml").text
    with pytest.raises(linkdyn.SceneError, match="friction at joint 'B' holds it back"):
        linkdyn.Scene(rssr + '\n[[friction]]\njoint = "B"\ncoulomb = 0.1\nradius = 0.01\n')


PENDULUM = """
space = "planar"
gravity = [0, -9.81]
[frame]
markers = { O = [0, 0] }
[[link]]
name = "upper"
mass = 2
inertia = 0.05
cog = [0.3, 0]
markers = { O = [0, 0], T = [0.6, 0] }
[[link]]
name = "lower"
mass = 2
inertia = 0.05
cog = [0.3, 0]
markers = { O = [0, 0] }
[[joint]]
name = "A"
type = "revolute"
between = ["frame.O", "upper.O"]
[[joint]]
name = "B"
type = "revolute"
between = ["upper.T", "lower.O"]
[[coordinate]]
joint = "A"
start = { position = 0.3, velocity = 0 }
[[coordinate]]
joint = "B"
[[friction]]
joint = "A"
coulomb = 0.2
radius = "20 mm"
[[friction]]
joint = "B"
coulomb = 0.2
radius = "20 mm"
[time]
end = 5
samples = 4001
"""


def test_energy_goes_into_friction() -> None:
    """A double pendulum loses what the power of friction adds up to, whichever method; most of it by the record."""
    scene = linkdyn.Scene(PENDULUM)
    run = scene.forward(method="gbs", rtol=1e-11, atol=1e-11)
    energy = (run.kinetic_energy + run.potential_energy).values
    loss = float(run.friction_power.sum("joint").integrate("time"))
    assert energy[0] - energy[-1] == pytest.approx(loss, rel=1e-5) and loss > 1
    other = scene.forward(method="seulex", rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(other.q, run.q, atol=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["rsur", "hexaglide", "excavator"])
def test_long_batches(name: str) -> None:
    """Batches worth a program, closed by iteration too: as by the dense solver."""
    _, rough = with_friction(TESTS / "scenes" / f"{name}.toml")
    q = rough.motion()[0]
    q = np.repeat(q, -(-300 // len(q)), axis=0)
    qd = 0.3 * np.cos(np.arange(q.size).reshape(q.shape))
    run, dense = (rough.inverse(q=q, qd=qd, qdd=-qd, t=np.zeros(len(q)), solver=solver) for solver in ("elimination", "lapack"))
    assert (run.status == 0).all()
    for quantity in ("driving_force", "reaction", "friction", "friction_power"):
        values = dense[quantity].values
        np.testing.assert_allclose(run[quantity].values, values, rtol=1e-9, atol=1e-10 * np.abs(values).max())


def test_neighbours_change_nothing() -> None:
    """Samples are settled side by side, and take more or fewer rounds: each has the same bits whatever stands beside it."""
    _, rough = with_friction(EXAMPLES / "stewart_aris" / "scene.toml")
    n = 640
    t = np.linspace(0.0, 2.0, n)
    q, qd, qdd, *_ = rough.motion(t)
    qd = qd * (np.arange(n) % 5)[:, None]**2
    whole = rough.inverse(q=q, qd=qd, qdd=qdd)
    assert (whole.status == 0).all()
    for part in (slice(3, None, 5), slice(97, 112), slice(None, None, -1)):
        alone = rough.inverse(q=q[part], qd=qd[part], qdd=qdd[part])
        for quantity in ("driving_force", "reaction", "friction"):
            np.testing.assert_array_equal(alone[quantity].values, whole[quantity].values[part])


@pytest.mark.thorough
def test_grows_steadily_until_it_locks() -> None:
    """With growing coefficients forces change without a jump until a sample locks, and it stays locked."""
    text = CRANK.format(rod=1.1, rod_inertia=0.014, slide='"2*s"').replace("coulomb = 0.2", 'coulomb = "2*s"')
    text = text.replace('"30 mm"', '"60 mm"').replace('"20 mm"', '"60 mm"') + "\n[variables]\ns = 1.0\n"
    scene, random = linkdyn.Scene(text), np.random.default_rng(5)
    q, qd, qdd = random.uniform(0, 6.28, (60, 1)), random.uniform(-8, 8, (60, 1)), random.uniform(-20, 20, (60, 1))
    runs = [scene.with_({"variables.s": float(s)}).inverse(q=q, qd=qd, qdd=qdd, t=np.zeros(60)) for s in np.linspace(0, 1, 81)]
    status = np.array([run.status.values for run in runs])
    assert set(np.unique(status)) == {0, 6} and 10 < (status[-1] == 6).sum() < 50
    for sample in status.T:
        locked = np.flatnonzero(sample == 6)
        assert len(locked) == 0 or (sample[locked[0]:] == 6).all()
    torque = np.array([run.driving_force.values[:, 0] for run in runs])
    for values in torque.T[status[-1] == 0]:
        steps = np.abs(np.diff(values))
        assert (steps[1:-1] <= 3 * np.maximum(steps[:-2], steps[2:]) + 1e-6).all()


# ---------------------------------------------------------------- kinds with several freedoms, one link each

LINK = """
space = "spatial"
gravity = [1.2, -9.81, -4.0]
[frame]
markers = {{ O = {{ at = [0.1, 0, 0], axis = [0, 0, 1] }} }}
[[link]]
name = "body"
mass = 3
inertia = [0.02, 0.03, 0.04, 0.001, 0, 0.002]
cog = [0.15, 0.05, 0.02]
markers = {{ O = {{ at = [0, 0, 0], axis = {axis} }} }}
[[joint]]
name = "J"
type = "{kind}"
between = ["frame.O", "body.O"]
{driven}
[[friction]]
joint = "J"
coulomb = 0.2
radius = "15 mm"
{more}
"""


def one_link(kind: str, variables: list[str], more: str = "", axis: str = "[0, 0, 1]") -> linkdyn.Scene:
    driven = "".join(f'[[{table}]]\njoint = "J"\nvariable = "{name}"\n' for table in ("coordinate", "actuator") for name in variables)
    return linkdyn.Scene(LINK.format(kind=kind, driven=driven, more=more, axis=axis))


def parts(run: object) -> tuple[np.ndarray, ...]:
    """Force and moment of reaction and friction of the only joint."""
    reaction, friction = run.reaction.values[0, 0], run.friction.values[0, 0]
    return reaction[:3], reaction[3:], friction[:3], friction[3:]


@pytest.mark.parametrize("solver", ["elimination", "lapack"])
def test_bush_and_plate(solver: str) -> None:
    """They rub against the helical motion of their surface."""
    z = np.array([0.0, 0.0, 1.0])
    bush = one_link("cylindrical", ["angle", "slide"], 'length = "60 mm"\npreload = "20 N"')
    run = bush.inverse(q=[[0.4, 0.1]], qd=[[7.0, -0.3]], qdd=[[1.0, 2.0]], solver=solver)
    force, moment, held, turned_back = parts(run)
    across, tilt = force - force[2] * z, np.cross(moment, z) / 0.06
    pressed = np.linalg.norm(across / 2 + tilt) + np.linalg.norm(across / 2 - tilt) + 20
    speed = math.hypot(0.3, 0.015 * 7)
    np.testing.assert_allclose(held, -0.2 * pressed * -0.3 / speed * z, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(turned_back, -0.2 * pressed * 0.015**2 * 7 / speed * z, rtol=1e-12, atol=1e-12)
    plate = one_link("planar", ["x", "y", "angle"])
    run = plate.inverse(q=[[0.1, 0.2, 0.5]], qd=[[0.3, -0.4, 6.0]], qdd=[[0.0, 1.0, 2.0]], solver=solver)
    force, moment, held, turned_back = parts(run)
    speed = math.hypot(0.3, 0.4, 0.015 * 6)
    np.testing.assert_allclose(held, -0.2 * abs(force[2]) * np.array([0.3, -0.4, 0]) / speed, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(turned_back, -0.2 * abs(force[2]) * 0.015**2 * 6 / speed * z, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("solver", ["elimination", "lapack"])
def test_both_pins_of_a_universal_joint(solver: str) -> None:
    """Each by the force across it, its ends and its collar."""
    scene = one_link("universal", ["angle1", "angle2"], 'length = "50 mm"\ncollar = "22 mm"', axis="[0, 1, 0]")
    q, rates = [[0.3, 0.5]], np.array([2.0, -3.0])
    run = scene.inverse(q=q, qd=[rates], qdd=[[1.0, 4.0]], solver=solver)
    force, moment, held, turned_back = parts(run)
    axes = np.array([[0.0, 0.0, 1.0], scene.poses(q).rotation[0, 0] @ [0.0, 1.0, 0.0]])
    expected = np.zeros(3)
    for axis, rate in zip(axes, rates):
        thrust = force @ axis
        across, tilt = force - thrust * axis, np.cross(moment, axis) / 0.05
        pressed = np.linalg.norm(across / 2 + tilt) + np.linalg.norm(across / 2 - tilt)
        expected -= 0.2 * (0.015 * pressed + 0.022 * abs(thrust)) * np.sign(rate) * axis
    np.testing.assert_allclose(turned_back, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(held, 0, atol=1e-15)
    np.testing.assert_allclose(run.friction_power.values[0, 0], -expected @ (rates @ axes), rtol=1e-12)


@pytest.mark.parametrize("tolerances", [np.geomspace(1e-11, 1e-9, 12), np.geomspace(1e-9, 1e-6, 25)], ids=["fine", "coarse"])
def test_kinks_are_not_taken_for_rounding(tolerances: np.ndarray) -> None:
    """A stiff method whose Jacobian is taken on one side of a kink, and a millionth of the step later on the other."""
    scene = linkdyn.Scene({
        "space": "planar",
        "gravity": [0, -9.81],
        "frame": {"markers": {"O": [0, 0]}},
        "link": [
            {"name": "cart", "mass": 1.69, "markers": {"O": [0, 0]}},
            {"name": "pole", "mass": 0.402, "cog": [0.192, 0.02], "inertia": 0.0261, "markers": {"O": [0, 0], "P": [0.5, 0]}},
        ],
        "joint": [
            {"name": "X", "type": "prismatic", "between": ["frame.O", "cart.O"]},
            {"name": "J", "type": "revolute", "between": ["cart.O", "pole.O"]},
        ],
        "coordinate": [{"joint": "X", "start": {"velocity": -0.105, "position": 0}}, {"joint": "J", "start": {"position": 1.81, "velocity": 1.79}}],
        "payload": [{"on": "pole.P", "mass": 0.548, "from": 0.12, "until": 0.288}],
        "spring": [
            {"name": "S", "joint": "J", "stiffness": 171, "damping": 1.73},
            {"name": "S2", "between": ["frame.O", "pole.P"], "stiffness": 6.88, "damping": 1.68, "rest": 0.142},
        ],
        "load": [{
            "on": "pole.P",
            "force": [
                {"law": "harmonic", "amplitude": 1.08, "frequency": 23.8},
                {"law": "cycloidal", "from": 0, "to": 0.754, "begin": 0.1, "duration": 0.2},
            ],
            "axes": "world",
        }],
        "friction": [{"joint": "X", "coulomb": 0.293, "creep_speed": 0.0197}],
        "actuator": [{"joint": "X", "law": {"type": "constant", "value": 1.8}}],
    })  # fmt: skip
    t = np.linspace(0.0, 0.5, 6)
    exact = scene.forward(t=t, method="gbs", rtol=1e-12, atol=1e-12).q.values[-1]
    for tolerance in tolerances:
        run = scene.forward(t=t, method="seulex", rtol=tolerance, atol=tolerance)
        assert run.attrs["stopped"] == "", tolerance
        np.testing.assert_allclose(run.q.values[-1], exact, atol=1e4 * tolerance)


@pytest.mark.parametrize("order", [1, -1])
def test_the_joint_that_locks_is_named_and_not_what_carries_it(order: int) -> None:
    """A lever that carries a drawer which jams: the lever's hinge is pressed more, and has no part in the growth."""
    scene = {
        "space": "spatial",
        "gravity": [0, 0, -9.81],
        "frame": {"markers": {"A": {"at": [0.1, 0.2, 0.3], "axis": [1, 0.2, 0.1]}, "S": [0.5, 0.4, 0.9]}},
        "link": [
            {
                "name": "lever",
                "mass": 2.0,
                "cog": [0.1, 0.05, -0.3],
                "inertia": [0.06, 0.05, 0.02, 0.003, -0.002, 0.001],
                "markers": {"A": {"at": [0, 0, 0], "axis": [1, 0, 0]}, "B": {"at": [0.05, 0.02, -0.6], "axis": [0.3, 1, 0.2]}, "T": [0.1, 0.1, -0.5]},
            },
            {
                "name": "drawer",
                "mass": 1.2,
                "cog": [0.0, 0.03, -0.2],
                "inertia": [0.03, 0.025, 0.01, 0.001, 0.002, -0.001],
                "markers": {"B": {"at": [0, 0, 0], "axis": [0, 1, 0]}, "tip": [0.1, 0, -0.4]},
            },
        ],
        "joint": [
            {"name": "A", "type": "revolute", "between": ["frame.A", "lever.A"]},
            {"name": "B", "type": "cylindrical", "between": ["lever.B", "drawer.B"]},
        ],
        "coordinate": [
            {"joint": "A", "start": {"position": 0.4, "velocity": 1.0}},
            {"joint": "B", "variable": "angle", "start": {"position": -0.3, "velocity": 2.0}},
            {"joint": "B", "variable": "slide", "start": {"position": 0.05, "velocity": 0.3}},
        ],
        "spring": [
            {"name": "s", "between": ["frame.S", "drawer.tip"], "stiffness": 60, "damping": 1.5, "rest": 0.4},
            {"name": "k", "joint": "B", "variable": "slide", "stiffness": 150, "damping": 1.0},
        ],
        "friction": [
            {"joint": "A", "coulomb": 0.15, "radius": 0.03, "length": 0.1, "collar": 0.04, "creep_speed": 0.02},
            {"joint": "B", "coulomb": 0.2, "radius": 0.02, "length": 0.08, "preload": 3.0, "viscous": 0.5, "creep_speed": 0.02},
        ][::order],
        "payload": [
            {"on": "drawer.tip", "mass": {"law": "polynomial-345", "from": 0.5, "to": 1.5, "begin": 0.3, "duration": 0.5}},
            {"on": "lever.T", "mass": 0.7, "from": 0.6, "until": 1.1},
        ],
        "actuator": [{"joint": "A", "law": {"type": "spring-damper", "stiffness": 20, "damping": 0.3, "rest": 0.2}, "drive": {"ratio": 20, "rotor_inertia": 1e-4}}],
    }
    stopped = linkdyn.Scene(scene).forward(t=np.linspace(0, 1.5, 4), rtol=1e-7, atol=1e-7).attrs["stopped"]
    assert "joint 'B' locks: its friction grows" in stopped


BELT = """
space = "planar"
gravity = [0, -9.81]
[frame]
markers = { O = [0, 0], W = [-1, 0.1] }
[[link]]
name = "belt"
mass = 5
markers = { O = [0, 0] }
[[link]]
name = "block"
mass = 2
markers = { O = [0, 0], P = [0, 0.1] }
[[joint]]
name = "P"
type = "prismatic"
between = ["frame.O", "belt.O"]
[[joint]]
name = "Q"
type = "prismatic"
between = ["belt.O", "block.O"]
[[coordinate]]
joint = "P"
driven = true
motion = { law = "constant-rate", rate = 0.2 }
[[coordinate]]
joint = "Q"
start = { position = 0, velocity = 0 }
[[actuator]]
joint = "P"
law = { type = "inverse" }
[[spring]]
name = "coil"
between = ["frame.W", "block.P"]
stiffness = 300
rest = 1.0
[[friction]]
joint = "Q"
coulomb = 0.2
static = 0.35
stribeck_speed = 0.1
viscous = 1.5
sticking = true
"""
"""A block on a belt, held by a spring: it sticks and slips."""


@pytest.mark.parametrize("tolerance", [1e-16, 1e-19, 1e-20, 1e-22])
def test_no_tolerance_lets_long_steps_pass_for_rounding(tolerance: float) -> None:
    """Below what doubles can have `gbs` comes as near as at 1e-13: steps whose errors fall with their length are too long, whatever shorter ones round off."""
    scene = linkdyn.Scene(BELT)
    t = np.linspace(0, 2, 21)
    other = scene.forward(t=t, method="rk8pd", rtol=1e-13, atol=1e-13)
    run = scene.forward(t=t, method="gbs", rtol=tolerance, atol=tolerance)
    assert (run.status.values == 0).all()
    np.testing.assert_allclose(run.q.values, other.q.values, rtol=0, atol=1e-12)
