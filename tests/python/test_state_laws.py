"""Forces that depend on the state of the mechanism, each against a road of its own: closed forms, virtual power by hand, mpmath."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import linkdyn
from integrators import CONTROLLED, METHODS

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

SLIDE = """
space = "planar"
gravity = [0, {gravity}]

[frame]
markers = {{ O = {{ at = [0, 0], axis = {axis} }} }}

[[link]]
name = "mass"
mass = {mass}
inertia = 0.001
markers = {{ C = {{ at = [0, 0], axis = {axis} }} }}

[[joint]]
name = "x"
type = "prismatic"
between = ["frame.O", "mass.C"]

[[coordinate]]
joint = "x"
start = {{ position = {start}, velocity = {velocity} }}

[measures]
x = {{ joint = "x" }}
u = {{ joint = "x", rate = true }}
w = {{ marker = "mass.C", component = "y", rate = true }}

{forces}

[time]
end = {end}
samples = {samples}
"""


def slide(forces: str, *, mass: float = 1, start: float = 0, velocity: float = 0, gravity: float = 0, axis: str = "[1, 0]",
          end: float = 2, samples: int = 5) -> linkdyn.Scene:
    """A mass on a rail."""
    return linkdyn.Scene(SLIDE.format(forces=forces, mass=mass, start=start, velocity=velocity, gravity=gravity, axis=axis,
                                      end=end, samples=samples))


# ---------------------------------------------------------------- forward runs against closed forms


@pytest.mark.parametrize("method", CONTROLLED)
def test_fall_through_air(method: str) -> None:
    """Quadratic drag: w = -vt tanh(g t/vt), y = -vt^2/g log cosh(g t/vt)."""
    scene = slide('[[load]]\non = "mass.C"\nforce = [0, "-0.01 N*s^2/m^2*w*abs(w)"]', mass=0.2, gravity=-9.81, axis="[0, 1]", end=4)
    run = scene.forward(method=method)
    t, vt = run.time.values, math.sqrt(0.2 * 9.81 / 0.01)
    loose = 1e-5 if method == "msbdf" else 2e-8
    np.testing.assert_allclose(run.qd[:, 0], -vt * np.tanh(9.81 * t / vt), rtol=loose, atol=loose)
    np.testing.assert_allclose(run.q[:, 0], -(vt**2) / 9.81 * np.log(np.cosh(9.81 * t / vt)), rtol=loose, atol=loose)


def test_fall_in_space_is_that_in_a_plane() -> None:
    """The same fall of a spatial body, measured in z."""
    scene = linkdyn.Scene("""
space = "spatial"
gravity = [0, 0, -9.81]
[[link]]
name = "ball"
mass = 0.2
inertia = [0.001, 0.001, 0.001, 0, 0, 0]
markers = { C = [0, 0, 0] }
[[coordinate]]
link = "ball"
[measures]
w = { coordinate = "ball.z", rate = true }
[[load]]
on = "ball.C"
force = [0, 0, "-0.01 N*s^2/m^2*w*abs(w)"]
[time]
end = 4
samples = 5
""")
    run = scene.forward()
    vt = math.sqrt(0.2 * 9.81 / 0.01)
    np.testing.assert_allclose(run.qd[:, 2], -vt * np.tanh(9.81 * run.time / vt), rtol=1e-8, atol=1e-9)


def test_load_that_turns_with_its_link() -> None:
    """A moment on a turning disk, -c omega, and a force in the disk's axes that adds c r: spin fades as exp(-c t/J)."""
    scene = linkdyn.Scene("""
space = "spatial"
[frame]
markers = { O = [0, 0, 0] }
[[link]]
name = "disk"
mass = 1
inertia = [0.3, 0.3, 0.5, 0, 0, 0]
markers = { O = [0, 0, 0], rim = ["0.4 m", 0, 0] }
[[joint]]
name = "J"
type = "revolute"
between = ["frame.O", "disk.O"]
[[coordinate]]
joint = "J"
start = { position = 1, velocity = 3 }
[measures]
omega = { joint = "J", rate = true }
[[load]]
on = "disk.rim"
axes = "link"
force = [0, "-0.1 N*s*omega/(1 rad)", 0]
moment = [0, 0, "-0.2 N*m*s/rad*omega"]
[time]
end = 2
samples = 5
""")
    run = scene.forward()
    np.testing.assert_allclose(run.qd[:, 0], 3 * np.exp(-(0.2 + 0.1 * 0.4) / 0.5 * run.time), rtol=1e-8)


def test_cubic_spring() -> None:
    """Duffing's oscillator against 30 digits of mpmath's Taylor series."""
    mp = pytest.importorskip("mpmath")
    with mp.workdps(30):
        solve = mp.odefun(lambda _, y: [y[1], -10 * y[0] - 1000 * y[0] ** 3], 0, [mp.mpf("0.3"), 0])
        wanted = [[float(c) for c in solve(t)] for t in (0.5, 1)]
    scene = slide('[[spring]]\nname = "k"\njoint = "x"\nstiffness = 10\nforce = "1000 N/m^3*stretch^3"', start=0.3, end=1, samples=3)
    run = scene.forward(rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(np.column_stack([run.q[1:, 0], run.qd[1:, 0]]), wanted, rtol=1e-8)


def test_spring_between_markers_by_table(tmp_path: Path) -> None:
    """A characteristic in two straight pieces: half swings of two stiffnesses, one after the other."""
    (tmp_path / "k.csv").write_text("stretch [m], F [N]\n-1, -40\n0, 0\n1, 90\n")
    text = SLIDE.format(mass=1, gravity=0, axis="[1, 0]", start=0, velocity=2, end=1, samples=41, forces="""
[[spring]]
name = "k"
between = ["frame.base", "mass.C"]
rest = "3 m"
force = { table = "k.csv", column = "F", over = "stretch" }
""").replace("markers = { O = {", "markers = { base = [-3, 0], O = {", 1)
    run = linkdyn.Scene(text, folder=tmp_path).forward()
    first, second = math.sqrt(90), math.sqrt(40)
    t = run.time.values
    back = t - math.pi / first
    wanted = np.where(back < 0, 2 / first * np.sin(first * t), -2 / second * np.sin(second * back))
    assert math.pi / first + math.pi / second > 0.8
    np.testing.assert_allclose(run.q[t < 0.8, 0], wanted[t < 0.8], atol=3e-8)


@pytest.mark.parametrize("method", ["rk8pd", "rkf45", "gbs"])
def test_sliding_friction_by_sign(method: str) -> None:
    """A spring and dry friction: half cosines about +-0.05 m, each 0.1 m shorter; the force jumps wherever the mass turns."""
    scene = slide('[[actuator]]\njoint = "x"\nlaw = { type = "formula", value = "-0.5 N*sign(u)" }\n'
                  '[[spring]]\nname = "k"\njoint = "x"\nstiffness = 10', start=1, end=4, samples=41)
    run = scene.forward(method=method)
    assert run.attrs["stopped"] == ""
    w = math.sqrt(10)
    n = np.floor(run.time.values * w / math.pi)
    wanted = (-1) ** n * ((1 - 0.1 * n - 0.05) * np.cos(w * run.time.values - n * math.pi) + 0.05)
    np.testing.assert_allclose(run.q[:, 0], wanted, atol=1e-7)


@pytest.mark.parametrize("method", CONTROLLED)
def test_law_that_jumps_to_and_fro_is_told(method: str) -> None:
    """Friction that holds: a sign() cannot, and the run says so. Without a look at the jump itself gbs went on, by stages that came upon
    either side in turn and agreed on their mean (0.287 m for 0.25 m); rkf45 did not come to an end."""
    scene = slide('[[load]]\non = "mass.C"\nforce = ["1 N - 3 N*sign(u)", 0]', velocity=1, end=1)
    run = scene.forward(method=method)
    assert "alternates between two values" in run.attrs["stopped"] and "tanh" in run.attrs["stopped"]
    np.testing.assert_allclose(run.q[1, 0], 0.25 - 0.0625, rtol=1e-7 if method == "msbdf" else 1e-8)
    assert np.isnan(run.q[-1, 0])


def test_drive_by_table_over_its_joint(tmp_path: Path) -> None:
    """Driving force -4 x from a table over x: a harmonic motion."""
    (tmp_path / "f.csv").write_text("x [mm], push [N]\n-2000, 8\n2000, -8\n")
    scene = linkdyn.Scene(slide("").text.replace("[time]", """[[actuator]]
joint = "x"
law = { type = "table", table = "f.csv", column = "push", over = "x" }
[time]""").replace("position = 0", "position = 0.5"), folder=tmp_path)
    run = scene.forward()
    np.testing.assert_allclose(run.q[:, 0], 0.5 * np.cos(2 * run.time), atol=1e-8)
    np.testing.assert_allclose(run.driving_force[:, 0], -4 * run.q[:, 0], rtol=1e-12, atol=1e-12)


# ---------------------------------------------------------------- inverse dynamics by virtual power


def ram_way(crank: np.ndarray) -> np.ndarray:
    """Of the shaper's ram pin over its crank angle, from the drawing alone."""
    pin = np.array([0.11 * np.cos(crank), 0.32 + 0.11 * np.sin(crank)])
    lever = np.arctan2(pin[1], pin[0])
    return 0.6 * np.cos(lever) + np.sqrt(0.18**2 - (0.64 - 0.6 * np.sin(lever)) ** 2)


def test_shaper_cuts_one_way_only() -> None:
    """What the cut and the friction ask of the drive, times its speed, is their power; on the way back the cut asks nothing."""
    scene = linkdyn.load(EXAMPLES / "shaper" / "scene.toml")
    run = scene.inverse(want="all")
    bare = scene.with_({"variables.cut": 0, "variables.rub": 0}).inverse()
    crank, h = run.q.values[:, 0], 1e-6
    x = ram_way(crank)
    v = (ram_way(crank + h) - ram_way(crank - h)) / (2 * h) * run.qd.values[:, 0]
    way = x - 0.175
    chip = np.clip((way + 0.12) / 0.004, 0, 1) * (way < 0.15)
    force = -3500 * chip * (v > 0) - 90 * np.tanh(v / 0.005)
    torque = (run.driving_force - bare.driving_force).values[:, 0]
    np.testing.assert_allclose(torque * run.qd.values[:, 0], -force * v, rtol=1e-6, atol=1e-4)
    assert (chip * (v > 0) > 0.5).sum() > 100 and (chip * (v < 0) > 0.5).sum() > 50    # metal on both ways
    assert abs(run.power_imbalance).max() < 1e-12


@pytest.mark.parametrize("solver", ["lapack", "gauss-jordan", "reduced"])
def test_solvers_agree(solver: str) -> None:
    scene = linkdyn.load(EXAMPLES / "shaper" / "scene.toml")
    np.testing.assert_allclose(scene.inverse(solver=solver).driving_force, scene.inverse().driving_force, rtol=1e-10, atol=1e-8)


def test_gas_over_two_turns() -> None:
    """Torque of the gas by its pressure, read from the file by numpy, and the lever arm of the crank drive by differences."""
    scene = linkdyn.load(EXAMPLES / "four_stroke" / "scene.toml").with_({"variables.viscous": 0})
    scene = linkdyn.Scene(scene.text.replace('interpolation = "spline"', 'interpolation = "linear"'), folder=scene.folder)
    q = np.linspace(-20, 40, 601)[:, np.newaxis] + 0.003        # ten turns; 0.003 keeps off the rows
    qd = np.full(q.shape, 100.0)
    table = np.loadtxt(EXAMPLES / "four_stroke" / "pressure.csv", delimiter=",", skiprows=2)
    phi = np.degrees(q[:, 0]) - 90
    pressure = np.interp(phi % 720, np.append(table[:, 0], 720), np.append(table[:, 1], table[0, 1]))
    bare = scene.with_({"variables.bore": 1e-9})

    def height(angle: np.ndarray) -> np.ndarray:
        return 0.043 * np.sin(angle) + np.sqrt(0.143**2 - (0.043 * np.cos(angle)) ** 2)

    slope = (height(q[:, 0] + 1e-6) - height(q[:, 0] - 1e-6)) / 2e-6
    torque = (scene.inverse(q, qd).driving_force - bare.inverse(q, qd).driving_force).values[:, 0]
    wanted = (pressure - 101.3) * 1e3 * math.pi / 4 * 0.086**2 * slope
    np.testing.assert_allclose(torque, wanted, rtol=1e-6, atol=1e-3)


def test_periodic_spline_goes_round(tmp_path: Path) -> None:
    """A sine from 24 rows, smooth across the end of its period and turns away from it."""
    rows = "\n".join(f"{a}, {math.sin(math.radians(a))!r}" for a in range(0, 360, 15))
    (tmp_path / "s.csv").write_text("angle [deg], M [N*m]\n" + rows + "\n")
    scene = linkdyn.Scene("""
space = "planar"
[frame]
markers = { O = [0, 0] }
[[link]]
name = "disk"
mass = 1
inertia = 1
markers = { O = [0, 0] }
[[joint]]
name = "J"
type = "revolute"
between = ["frame.O", "disk.O"]
[[coordinate]]
joint = "J"
[[actuator]]
joint = "J"
[measures]
phi = { joint = "J" }
[[load]]
on = "disk.O"
moment = { table = "s.csv", column = "M", argument = "angle", over = "phi", period = "1 rev", interpolation = "spline" }
""", folder=tmp_path)
    q = np.linspace(-30, 30, 977)[:, np.newaxis]
    np.testing.assert_allclose(scene.inverse(q).driving_force[:, 0], -np.sin(q[:, 0]), atol=1.5e-5)
    near = np.array([[2 * math.pi - 1e-7], [2 * math.pi + 1e-7]])
    found = scene.inverse(near).driving_force.values[:, 0]
    np.testing.assert_allclose(np.diff(found), -2e-7 * np.cos(0), rtol=1e-2)


def test_press_over_its_slide(tmp_path: Path) -> None:
    """Stamping force over the way of the ram: the torque of an eccentric press is force times dx/dphi."""
    (tmp_path / "stamp.csv").write_text("x [mm], F [kN]\n0, 0\n240, 0\n255, 60\n258, 150\n262, 20\n270, 20\n")
    scene = linkdyn.Scene("""
space = "planar"
[frame]
markers = { O = [0, 0], rail = { at = [0, 0], axis = [1, 0] } }
[[link]]
name = "crank"
markers = { O = [0, 0], A = { at = [0.06, 0], axis = [1, 0] } }
mass = 0
[[link]]
name = "rod"
markers = { A = [0, 0], B = [0.2, 0] }
mass = 0
[[link]]
name = "ram"
markers = { B = { at = [0, 0], axis = [1, 0] } }
mass = 0
start = { position = [0.2, 0] }
[[joint]]
name = "O"
type = "revolute"
between = ["frame.O", "crank.O"]
[[joint]]
name = "A"
type = "revolute"
between = ["crank.A", "rod.A"]
[[joint]]
name = "B"
type = "revolute"
between = ["rod.B", "ram.B"]
[[joint]]
name = "rail"
type = "prismatic"
between = ["frame.rail", "ram.B"]
[[coordinate]]
joint = "O"
[[actuator]]
joint = "O"
[measures]
x = { joint = "rail" }
v = { joint = "rail", rate = true }
[laws]
stamp = { table = "stamp.csv", column = "F", over = "x" }
[[load]]
on = "ram.B"
force = ["if(v, -stamp, 0 N)", 0]
""", folder=tmp_path)
    q = np.linspace(0.01, 6.2, 400)[:, np.newaxis]
    for sense in (1.0, -1.0):
        force = scene.inverse(q, np.full(q.shape, sense)).driving_force.values[:, 0]
        x = 0.06 * np.cos(q[:, 0]) + np.sqrt(0.04 - (0.06 * np.sin(q[:, 0])) ** 2)
        slope = -0.06 * np.sin(q[:, 0]) * (1 + 0.06 * np.cos(q[:, 0]) / np.sqrt(0.04 - (0.06 * np.sin(q[:, 0])) ** 2))
        stamp = np.interp(x * 1e3, [0, 240, 255, 258, 262, 270], [0, 0, 60, 150, 20, 20]) * 1e3
        np.testing.assert_allclose(force, np.where(slope * sense > 0, stamp, 0) * slope, rtol=1e-9, atol=1e-6)


def test_forward_follows_inverse() -> None:
    """The engine driven by what inverse dynamics found turns as it was told to."""
    scene = linkdyn.load(EXAMPLES / "four_stroke" / "scene.toml")
    text = scene.text[: scene.text.index("law = { type = \"formula\"")] + 'law = { type = "inverse" }\n' \
        + scene.text[scene.text.index("\n[measures]"):]
    scene = linkdyn.Scene(text, folder=scene.folder)
    run = scene.forward(0.02, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(run.q[:, 0], math.pi / 2 + 100 * math.pi * run.time, rtol=1e-7)
    wanted = scene.inverse(t=run.time.values)
    np.testing.assert_allclose(run.driving_force, wanted.driving_force, atol=1e-4)


def test_forward_run_keeps_its_energy_books() -> None:
    """What the engine's brake takes out, the gas puts in: kinetic energy changes by the work of all forces."""
    scene = linkdyn.load(EXAMPLES / "four_stroke" / "scene.toml")
    run = scene.forward(want="all")
    assert run.attrs["stopped"] == "" and (run.status == 0).all()
    assert abs(run.power_imbalance).max() < 1e-9
    speed = run.qd.values[:, 0]
    assert 290 < speed.min() < speed.max() < 340
    assert np.ptp(speed) > 5                                            # one power stroke in four


# ---------------------------------------------------------------- everywhere alike


def test_time_beside_the_state() -> None:
    """A law of time and place: `t` of a batch reaches it."""
    scene = slide('[[actuator]]\njoint = "x"\n[[load]]\non = "mass.C"\nforce = ["3 N/(m*s)*x*time", 0]')
    q = np.array([[0.5], [0.7], [0.9]])
    t = np.array([1.0, 2.0, 4.0])
    np.testing.assert_allclose(scene.inverse(q, t=t).driving_force[:, 0], -3 * q[:, 0] * t, rtol=1e-14)
    np.testing.assert_allclose(scene.solve(q, t=t)["driving_force"][:, 0], -3 * q[:, 0] * t, rtol=1e-14)
    np.testing.assert_allclose(scene.inverse(q).driving_force[:, 0], 0, atol=1e-300)
    run = slide('[[load]]\non = "mass.C"\nforce = ["6 N/s*time", 0]').forward()
    np.testing.assert_allclose(run.q[:, 0], run.time**3, atol=1e-9)


def test_sweep_is_the_batch() -> None:
    """Torques of the shaper over crank angles, speeds and cuts: those of a sweep are those of batches, design by design."""
    scene = linkdyn.load(EXAMPLES / "shaper" / "scene.toml")
    found = scene.sweep({
        "reduce": ["driving_force"],
        "axis": [
            {"parameter": "variables.cut", "values": [1000.0, 3500.0]},
            {"rate": "crank", "values": [-6.0, 3.0]},
            {"coordinate": "crank", "linspace": [0.0, 6.0, 61]},
        ],
    }, keep="driving_force")
    kept = found.driving_force.values.reshape(2, 2, 61)
    q = np.linspace(0, 6, 61)[:, np.newaxis]
    for i, cut in enumerate((1000.0, 3500.0)):
        for k, rate in enumerate((-6.0, 3.0)):
            wanted = scene.with_({"variables.cut": cut}).inverse(q, np.full(q.shape, rate)).driving_force.values[:, 0]
            np.testing.assert_allclose(kept[i, k], wanted, rtol=1e-12)
    assert np.ptp(kept[1, 0] - kept[0, 0]) > 100


def test_sweep_over_time() -> None:
    """Along the motion laws have its instants."""
    scene = slide('[[actuator]]\njoint = "x"\n[[load]]\non = "mass.C"\nforce = ["3 N/s*time", 0]')
    found = scene.sweep({"reduce": ["driving_force"], "axis": [{"time": True, "linspace": [0, 2, 5]}]})
    assert float(found.driving_force_min[..., 0].min()) == -6 and float(found.driving_force_max[..., 0].max()) == 0


def test_errors_are_estimated() -> None:
    """Estimates are small, and no smaller than the difference of two solvers; loads scale as they ought to in similar copies."""
    scene = linkdyn.load(EXAMPLES / "four_stroke" / "scene.toml")
    run, other = scene.inverse(error=True), scene.inverse(solver="lapack")
    assert run.error.quantile(0.98) < 1e-10         # at dead points all moments are zero
    assert (abs(run.driving_force - other.driving_force) <= 4 * run.driving_force_error + 1e-12).all()
    shaper = linkdyn.load(EXAMPLES / "shaper" / "scene.toml").inverse(error=True)
    assert np.median(shaper.error) < 1e-10
    forward = scene.forward(0.01, error=True)
    assert forward.qd_error.max() < 1e-3


def test_table_left_is_flagged(tmp_path: Path) -> None:
    """Beyond its rows a table says nothing: the sample is undefined, its neighbours are not; a forward run names the law."""
    (tmp_path / "f.csv").write_text("x [m], F [N]\n0, 5\n1, 5\n")
    forces = '[[load]]\non = "mass.C"\nforce = [{ table = "f.csv", column = "F", over = "x" }, 0]'
    text = SLIDE.format(forces=forces + '\n[[actuator]]\njoint = "x"\nlaw = { type = "constant", value = 0 }', mass=1, start=0.5,
                        velocity=0, gravity=0, axis="[1, 0]", end=2, samples=21)
    scene = linkdyn.Scene(text, folder=tmp_path)
    run = scene.inverse(np.array([[0.0], [0.5], [1.0], [1.0000001], [-3.0], [0.2]]))
    assert list(run.status.values) == [0, 0, 0, 4, 4, 0]
    assert np.isnan(run.driving_force[3, 0]) and run.driving_force[5, 0] == -5
    for method in ("gbs", "seulex"):
        forward = scene.forward(method=method)
        assert "is outside its table, 0 to 1" in forward.attrs["stopped"] and "mass.C" in forward.attrs["stopped"], method
    good = forward.time.values < 0.447
    np.testing.assert_allclose(forward.q[good, 0], 0.5 + 2.5 * forward.time[good] ** 2, atol=1e-9)


def test_formula_without_value_is_flagged() -> None:
    scene = slide('[[actuator]]\njoint = "x"\n[[load]]\non = "mass.C"\nforce = ["1 N*m/x + 1 N*sqrt(1 - (x/(1 m))^2)", 0]')
    run = scene.inverse(np.array([[0.5], [0.0], [2.0], [-1.0]]))
    assert list(run.status.values) == [0, 4, 4, 0]


def test_ensemble_feels_laws() -> None:
    """Members of an ensemble, each the drag of its own speed."""
    scene = slide('[[load]]\non = "mass.C"\nforce = ["-2 N*s/m*u", 0]', end=1)
    u0 = np.linspace(-1, 1, 9)
    runs = scene.ensemble(np.zeros((9, 1)), u0[:, np.newaxis], [0.0, 0.5, 1.0])
    last = runs.qd.isel(time=-1).values[:, 0]
    np.testing.assert_allclose(last, u0 * math.exp(-2), rtol=1e-6, atol=1e-12)


def test_long_run_counts_the_turns_of_its_table() -> None:
    """After ten cycles rates are still those of the right stroke: differences of the motion against accelerations found anew."""
    scene = linkdyn.load(EXAMPLES / "four_stroke" / "scene.toml")
    t = np.concatenate([[0.0], np.ravel(0.36 + 0.0016 * np.arange(25)[:, np.newaxis] + [-2e-6, 0, 2e-6])])
    run = scene.forward(t=t, rtol=1e-11, atol=1e-11, want="all")
    rate = run.qd.values[1:, 0].reshape(-1, 3)
    np.testing.assert_allclose((rate[:, 2] - rate[:, 0]) / 4e-6, run.qdd.values[2::3, 0], rtol=1e-3, atol=2)
    assert np.ptp(run.qdd.values[2::3, 0]) > 1000
    batch = scene.inverse(run.q.values, run.qd.values, run.qdd.values)
    np.testing.assert_allclose(batch.driving_force, run.driving_force, atol=1e-6)


# ---------------------------------------------------------------- what is told of loads


def test_loads_as_they_act() -> None:
    """`load_values` of a motion, of a batch and of a forward run: the formula written out."""
    scene = linkdyn.load(EXAMPLES / "shaper" / "scene.toml")
    run = scene.inverse(want="all")
    v = run.joint_rate.sel(variable="guide.slide").values
    friction = -90 * np.tanh(v / 0.005)
    np.testing.assert_allclose(scene.load_values()[:, 1, 0], friction, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(scene.load_values(None, run.q, run.qd)[:, 1, 0], friction, rtol=1e-9, atol=1e-6)
    assert (scene.load_values(0.0, run.q.values[:3], run.qd.values[:3])[:, 1, 0] == scene.load_values()[:3, 1, 0]).all()
    with pytest.raises(linkdyn.InputError, match="t: expected one instant"):
        scene.load_values([0.0, 1.0], run.q.values[:3])


def test_cycle_results_know_the_loads() -> None:
    """The frame feels all that acts: its reactions add up to the shaking force; causes add up to the whole."""
    scene = linkdyn.load(EXAMPLES / "shaper" / "scene.toml")
    run = scene.inverse(want="all")
    on_links = run.reaction.sel(joint=["crank", "lever", "guide"]).values[:, :, :2].sum(axis=1)
    shaking = linkdyn.cycle.shaking(run, scene)
    np.testing.assert_allclose(shaking.force.values[:, :2], -on_links, rtol=1e-7, atol=1e-6)
    causes = linkdyn.cycle.contributions(run, scene)
    np.testing.assert_allclose(causes.driving_force.sum("cause"), run.driving_force, rtol=1e-9, atol=1e-7)


def test_failure_in_words(tmp_path: Path) -> None:
    """Along a motion the first sample without a force says which law has none, and where."""
    (tmp_path / "f.csv").write_text("x [m], F [N]\n0, 5\n1, 5\n")
    text = SLIDE.format(forces='[laws]\npush = { table = "f.csv", column = "F", over = "place", argument = "x" }\n\n[[load]]\non = "mass.C"\n'
                               'force = ["push", 0]\n\n[[actuator]]\njoint = "x"', mass=1, start=0, velocity=0, gravity=0,
                        axis="[1, 0]", end=2, samples=21)
    text = text.replace("start = { position = 0, velocity = 0 }", 'motion = { law = "constant-rate", rate = 1 }')
    # of a marker nobody knows before how far it goes; over the coordinate itself the scene would be refused
    text = text.replace("[measures]", '[measures]\nplace = { marker = "mass.C", component = "x" }')
    run = linkdyn.Scene(text, folder=tmp_path).inverse()
    assert list(run.status.values) == [0] * 11 + [4] * 10
    assert run.attrs["failure"].startswith("t = 1.1 s: law 'push' has no value: place = 1.1")


def test_code_is_refused() -> None:
    with pytest.raises(linkdyn.InputError, match="follows the state of the mechanism"):
        linkdyn.load(EXAMPLES / "shaper" / "scene.toml").generate("inverse")


def test_old_variables_may_be_called_as_new_functions() -> None:
    """`step` and `sign` are functions only with a bracket behind them."""
    scene = linkdyn.Scene(slide("", mass=1).text.replace("mass = 1", 'mass = "mm"') + """
[variables]
step = "3 kg"
exp = 2
mm = "step*exp + 1 kg*sign(-2)*step(1) + 1 kg*if(1, 2, 3)"
""")
    assert scene.description["links"][1]["mass"] == 7


def test_laws_go_on_where_a_coordinate_is_exchanged() -> None:
    """Told by its piston, whose dead points the crank's angle passes, or by its crank: the same motion with the same laws."""
    text = (EXAMPLES / "slider_crank" / "scene_forward.toml").read_text()
    laws = """
[measures]
phi = { joint = "A" }
v = { joint = "D", rate = true }
x = { joint = "D" }

[[load]]
on = "piston.face"
force = ["-30 N*s/m*v - 40 N/m*x", 0]

[[load]]
on = "crank.A"
moment = "0.4 N*m*sin(phi) - 0.05 N*m*tanh(v/(0.2 m/s))"
"""
    run = linkdyn.Scene(text + laws).forward(0.2, want="all")
    assert run.attrs["stopped"] == "" and "until" in run.attrs["coordinates_integrated"]
    angle = run.joint_variable.sel(variable="A.angle").values
    rate = run.joint_rate.sel(variable="A.angle").values
    head, tail = text.split("[[coordinate]]")
    start = f'[[coordinate]]\njoint = "A"\nstart = {{ position = {float(angle[0])!r}, velocity = {float(rate[0])!r} }}\n'
    other = linkdyn.Scene(head + start + tail[tail.index("\n[time]"):] + laws).forward(0.2)
    np.testing.assert_allclose(other.q[:, 0], np.unwrap(angle), rtol=1e-6, atol=1e-6)
    assert np.ptp(other.q.values[:, 0]) > 1


def test_matrix_of_explain_has_springs_and_laws() -> None:
    """The right-hand side that is printed is that of the equations that are solved: b of the slide along its rail."""
    forces = '[[actuator]]\njoint = "x"\n[[load]]\non = "mass.C"\nforce = ["-7 N*step(x)", 0]\n[[spring]]\nname = "k"\njoint = "x"\nstiffness = 10'
    text = slide(forces, start=0.5).explain(matrix=True)
    assert "12.000" in text                             # 7 + 10*0.5, which the drive must give


@pytest.mark.parametrize("solver", ["elimination", "lapack", "gauss-jordan", "reduced"])
@pytest.mark.parametrize("mass", [0, 1])
def test_springs_pull_massless_links(mass: int, solver: str) -> None:
    """A link without inertia has a right-hand side where a spring or its law acts on it."""
    scene = linkdyn.Scene(f"""
space = "planar"
[frame]
markers = {{ O = [0, 0] }}
[[link]]
name = "arm"
markers = {{ O = [0, 0] }}
mass = {mass}
[[joint]]
name = "J"
type = "revolute"
between = ["frame.O", "arm.O"]
[[coordinate]]
joint = "J"
[[actuator]]
joint = "J"
[[spring]]
name = "S"
joint = "J"
stiffness = 10
force = "4 N*m*stretch^2"
""")
    np.testing.assert_allclose(scene.inverse([[0.5]], solver=solver).driving_force, [[6.0]], rtol=1e-14)


def test_numbers_of_laws_vary() -> None:
    """By `with_` and in sweeps, as any number of the scene."""
    scene = slide('[laws]\nF = "3 N"\nk = 4\n\n[[actuator]]\njoint = "x"\n[[load]]\non = "mass.C"\nforce = ["-F*k*x/(1 m)", 0]')
    assert scene.with_({"laws.k": 8}).inverse([[0.5]]).driving_force == 12
    assert scene.with_({"laws.F": "1 N"}).inverse([[0.5]]).driving_force == 2
    axes = [{"parameter": "laws.k", "values": [1, 2]}, {"coordinate": "x", "values": [0.5, 1]}]
    found = scene.sweep({"reduce": ["driving_force"], "axis": axes})
    np.testing.assert_allclose(found.driving_force_mean[:, 0], [2.25, 4.5])


def test_errors_of_moments_and_turning_springs() -> None:
    """Copies of another size feel moments, springs about axes and driving torques in proportion: else errors would be of order one."""
    text = """
space = "planar"
gravity = [0, -9.81]
[frame]
markers = { O = [0, 0] }
[[link]]
name = "arm"
markers = { O = [0, 0], tip = [0.7, 0] }
mass = 2
cog = [0.3, 0.1]
inertia = 0.2
[[joint]]
name = "J"
type = "revolute"
between = ["frame.O", "arm.O"]
[[coordinate]]
joint = "J"
start = { position = 0.4, velocity = 1 }
[[actuator]]
joint = "J"
law = { type = "formula", value = "2 N*m*cos(phi) - 0.5 N*m*s/rad*omega" }
[measures]
phi = { joint = "J" }
omega = { joint = "J", rate = true }
y = { marker = "arm.tip", component = "y" }
[[load]]
on = "arm.tip"
axes = "link"
force = ["3 N*sin(phi)", "-8 N/m*y"]
moment = "-0.3 N*m*s/rad*omega - 2 N*y"
[[spring]]
name = "S"
joint = "J"
rest = 0.2
force = "4 N*m/rad^3*stretch^3 + 0.1 N*m*s/rad*rate"
[[spring]]
name = "T"
between = ["frame.O", "arm.tip"]
rest = 0.5
force = "50 N/m*stretch"
[time]
end = 2
samples = 9
"""
    scene = linkdyn.Scene(text)
    q = np.linspace(-1, 2, 7)[:, np.newaxis]
    assert scene.inverse(q, np.sin(q) + 2, error=True).error.max() < 1e-12
    run = scene.forward(error=True)
    assert run.q_error[1:].max() < 1e-7 and run.driving_force_error[1:].max() < 1e-6


@pytest.mark.parametrize("solver", ["elimination", "lapack"])
def test_angles_that_a_ball_does_not_tell(solver: str) -> None:
    """A ball in a four-bar whose pitch stays at a right angle: roll and yaw are rounding there, a law over them has no value; pitch has."""
    body = {"mass": 1.0, "inertia": {"diagonal": [0.1] * 3}}

    def status(variable: str, rate: bool) -> set[int]:
        scene = linkdyn.Scene({
            "space": "spatial", "frame": {"markers": {"A": [0, 0, 0], "C": [2.0, 0.2, 0], "S": [0, 0, 0]}},
            "link": [{"name": "crank", "markers": {"A": [0, 0, 0], "P": {"at": [0.3, 0, 0], "axis": [1, 0, 0], "x": [0, 0, 1]}}} | body,
                     {"name": "rod", "markers": {"P": [0, 0, 0], "Q": [1.5, 0, 0]}} | body,
                     {"name": "rocker", "markers": {"C": [0, 0, 0], "Q": [1.0, 0, 0]}} | body, {"name": "sled", "markers": {"S": [0, 0, 0]}} | body],
            "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "crank.A"]}, {"name": "P", "type": "spherical", "between": ["crank.P", "rod.P"]},
                      {"name": "Q", "type": "revolute", "between": ["rod.Q", "rocker.Q"]}, {"name": "C", "type": "revolute", "between": ["frame.C", "rocker.C"]},
                      {"name": "S", "type": "prismatic", "between": ["frame.S", "sled.S"]}],
            "coordinate": [{"joint": "A", "start": 0.6}, {"joint": "S"}], "actuator": [{"joint": "A"}, {"joint": "S"}],
            "measures": {"turn": {"joint": "P", "variable": variable, "rate": rate}},
            "load": [{"on": "sled.S", "force": [0, 0, "turn*(1 N s/rad)" if rate else "turn*(1 N/rad)"]}],
        })  # fmt: skip
        angle = np.linspace(0.3, 0.9, 20)
        run = scene.inverse(q=np.column_stack([angle, 0 * angle]), qd=np.tile([2.0, 0.0], (20, 1)), want="driving_force", solver=solver)
        return set(run.status.values.tolist())

    assert all(status(variable, rate) == {4} for variable in ("roll", "yaw") for rate in (False, True))
    assert all(status("pitch", rate) == {0} for rate in (False, True))


LEFT_BEHIND = """
space = "planar"
gravity = [0.0, 0.0]

[frame]
markers = { A = [0.0, 0.0], D = [1.0, 0.0] }

[[link]]
name = "crank"
markers = { A = [0.0, 0.0], B = [0.4, 0.0] }
mass = 1.0
inertia = 0.02

[[link]]
name = "coupler"
markers = { B = [0.0, 0.0], C = [0.9, 0.0] }
mass = 2.0
inertia = 0.2

[[link]]
name = "rocker"
markers = { D = [0.0, 0.0], C = [0.4, 0.0] }
mass = 1.0
inertia = 0.02

[[joint]]
name = "A"
type = "revolute"
between = ["frame.A", "crank.A"]

[[joint]]
name = "B"
type = "revolute"
between = ["crank.B", "coupler.B"]

[[joint]]
name = "C"
type = "revolute"
between = ["coupler.C", "rocker.C"]

[[joint]]
name = "D"
type = "revolute"
between = ["frame.D", "rocker.D"]
start = "60 deg"

[[coordinate]]
joint = "A"
start = { position = "60 deg", velocity = "1 rad/s" }

[measures]
bend = { joint = "B" }

[time]
end = 1.0
samples = 11
"""
BEHIND = {
    "load": '[[load]]\non = "coupler.B"\nforce = [{ table = "law.csv", over = "bend", argument = "angle", column = "force" }, 0.0]\n',
    "actuator": '[[actuator]]\njoint = "A"\n'
    'law = { type = "table", table = "law.csv", over = "bend", argument = "angle", column = "force" }\n',
}


@pytest.mark.parametrize("kind", BEHIND)
@pytest.mark.parametrize("method", METHODS)
def test_a_run_names_the_law_whose_table_it_leaves(tmp_path: Path, method: str, kind: str) -> None:
    # the table is over a joint variable that is no coordinate: nobody knows before the run how far that goes
    (tmp_path / "law.csv").write_text("angle [rad],force\n-1.5,0\n-1.2,-1\n-0.9,-2\n", encoding="utf-8")
    (tmp_path / "scene.toml").write_text(LEFT_BEHIND + BEHIND[kind], encoding="utf-8")
    run = linkdyn.load(tmp_path / "scene.toml").forward(method=method)
    assert "has no value: bend = -" in run.attrs["stopped"]
    assert "is outside its table, -1.5 to -0.9 rad" in run.attrs["stopped"]
    assert kind in run.attrs["stopped"]
    assert run.attrs["stopped"].startswith("stopped at t = 0.")
