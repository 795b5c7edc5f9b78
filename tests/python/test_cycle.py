"""Cycle results against closed forms and other roads: momentum against reactions, causes against virtual work, bearings by hand."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

import linkdyn
from linkdyn import cycle
from linkdyn._cycle.averages import rms, shares
from machines import RPM, engine

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def shaft(load: dict, rpm: float = 300.0, samples: int = 721) -> linkdyn.Scene:
    """A disc on a hinge that turns evenly, with a load."""
    return linkdyn.Scene({
        "space": "planar",
        "frame": {"markers": {"A": [0, 0]}},
        "link": [{"name": "disc", "markers": {"A": [0, 0]}, "mass": 0}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "disc.A"]}],
        "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "rate": rpm * RPM, "start": 0.0}}],
        "actuator": [{"joint": "A"}],
        "load": [{"on": "disc.A", **load}],
        "time": {"end": 60 / rpm, "samples": samples},
    })


def by_reactions(run, scene, about):
    """Force and moment on the frame: minus what its joints do, and its drives."""
    joints = {joint["name"]: joint for joint in scene.description["joints"]}
    names = list(map(str, run.component.values))
    n = run.sizes["sample"]
    force, moment = np.zeros((n, 3)), np.zeros((n, 3))
    for name, joint in joints.items():
        if 0 not in joint["links"]:
            continue
        sign = -1 if joint["links"][0] == 0 else 1
        wrench = {c: run.reaction.sel(joint=name, component=c).values for c in names}
        f, m = (np.stack([wrench.get(k + x, np.zeros(n)) for x in "xyz"], axis=1) for k in "FM")
        labels = [f"{link['name']}.{joint['markers'][1]}" for k, link in enumerate(scene.description["links"]) if k == joint["links"][1]]
        place = run.linkdyn.marker(labels[0], scene=scene).position.values
        place = np.hstack([place, np.zeros((n, 3 - place.shape[1]))])
        if name in run.actuator.values:
            marker = next(m for m in scene.description["links"][joint["links"][0]]["markers"] if m["name"] == joint["markers"][0])
            axis = np.array([0, 0, 1.0]) if scene.planar and joint["type"] == "revolute" else np.array(marker["axis"]) / np.linalg.norm(marker["axis"])
            assert joint["links"][0] == 0
            drive = run.driving_force.sel(actuator=name).values[:, None] * axis
            f, m = (f + drive, m) if joint["type"] == "prismatic" else (f, m + drive)
        force += sign * f
        moment += sign * (m + np.cross(place - about, f))
    return force, moment


def test_instants_that_go_back_are_refused(tmp_path):
    """A mean over samples out of their order is none of a cycle: 0, 1 and 0.5 s gave a mean power above the peak."""
    run = linkdyn.load(EXAMPLES / "fourbar" / "scene.toml").inverse(t=[0.0, 1.0, 0.5])
    calls = {
        "energy": lambda: run.linkdyn.energy(), "flywheel": lambda: run.linkdyn.flywheel(0.02),
        "sheet": lambda: linkdyn.sheet(run, tmp_path / "run.html"), "view": lambda: run.linkdyn.view(tmp_path / "view.html"),
    }
    for name, call in calls.items():
        with pytest.raises(linkdyn.InputError, match=f"^{name}: the instants of the run go back, 0.5 s follows 1 s"):
            call()


# ---------------------------------------------------------------- points

@pytest.mark.parametrize("kind", ["six-bar", "excavator", "hexapod", "delta", "arm", "3-rrr", "screw_lift", "air_bearing_stage"])
def test_velocities_and_accelerations_are_derivatives(kind):
    """By central differences; the last two have screws, slides on a table and welds."""
    scene = linkdyn.load(EXAMPLES / kind / "scene.toml") if (EXAMPLES / kind).is_dir() else linkdyn.new(kind)
    times = scene.times()
    t, h = times[13:-10:37], 1e-3 * (times[1] - times[0])
    steps = np.arange(-3, 4)
    around = scene.inverse(t=np.add.outer(t, h * steps).reshape(-1))
    run = scene.inverse(t=t)
    for name in [f"{link['name']}.{link['markers'][-1]['name']}" for link in scene.description["links"][1:4]]:
        found = run.linkdyn.marker(name)
        places = around.linkdyn.marker(name).position.values.reshape(len(t), 7, -1)
        speed = np.einsum("k,nkx->nx", [-1, 9, -45, 0, 45, -9, 1], places) / (60 * h)
        speeds = around.linkdyn.marker(name).velocity.values.reshape(len(t), 7, -1)
        rise = np.einsum("k,nkx->nx", [-1, 9, -45, 0, 45, -9, 1], speeds) / (60 * h)
        size = 1.0 + np.abs(found.velocity.values).max()
        np.testing.assert_allclose(found.velocity, speed, rtol=0, atol=1e-7 * size)
        np.testing.assert_allclose(found.acceleration, rise, rtol=0, atol=1e-6 * (1 + np.abs(rise).max()))


def test_crank_pin_in_closed_form():
    run = engine().inverse()
    pin, w = run.linkdyn.marker("crank.B"), 6000 * RPM
    turn = np.stack([np.cos(run.q.values[:, 0]), np.sin(run.q.values[:, 0])], axis=1)
    np.testing.assert_allclose(pin.position, 0.05 * turn, atol=1e-15)
    np.testing.assert_allclose(pin.acceleration, -0.05 * w**2 * turn, atol=1e-11 * w**2)
    assert pin.acceleration.units == "m/s2" and pin.position.dims == ("sample", "axis")


@pytest.mark.parametrize("samples", [4, 42, 500])
def test_relative_angles_count_turns_by_their_rates(samples: int) -> None:
    """A disc of 50 turns, seen from the frame, however far its samples are apart."""
    content = tomllib.loads(shaft({"moment": 1.0}, rpm=3000.0).text)
    content["time"] = {"end": 1.0, "samples": samples}
    run = linkdyn.Scene(content).inverse()
    np.testing.assert_allclose(run.linkdyn.relative_pose("disc", "frame").angle, np.linspace(0.0, 100 * np.pi, samples), atol=1e-11)


def test_relative_pose_is_the_joint_variable():
    scene = linkdyn.new("six-bar")
    run = scene.inverse()
    angle = run.linkdyn.relative_pose("coupler", "crank").angle.values
    variable = run.joint_variable.sel(variable="B.angle").values
    np.testing.assert_allclose(angle - angle[0], variable - variable[0], atol=1e-12)
    seen = linkdyn.new("hexapod").inverse().linkdyn.relative_pose("platform", "leg1.lower")
    np.testing.assert_allclose(np.einsum("nij,nik->njk", seen.rotation, seen.rotation), np.broadcast_to(np.eye(3), (201, 3, 3)), atol=1e-12)


# ---------------------------------------------------------------- shaking

def test_engine_at_6000_rpm_shakes_in_first_and_second_order():
    """Piston m r w^2 (cos + A2 cos 2), A2 = k + k^3/4 + 15 k^5/128 + ..., k the ratio of crank to rod."""
    run = engine().inverse()
    force = run.linkdyn.shaking().force.values[:, 0]
    theta, w, k = run.q.values[:, 0], 6000 * RPM, 0.25
    waves = [2 * np.mean(force[:-1] * np.cos(h * theta[:-1])) for h in (1, 2)]
    size = 0.5 * 0.05 * w**2
    assert waves[0] == pytest.approx(size, rel=1e-9)
    assert waves[1] == pytest.approx(size * (k + k**3 / 4 + 15 * k**5 / 128), rel=3e-5)


@pytest.mark.parametrize("kind", ["six-bar", "slider-crank", "excavator", "hexapod", "delta", "arm", "five-bar"])
def test_momentum_and_reactions_shake_alike(kind):
    scene = linkdyn.new(kind)
    run = scene.inverse()
    about = np.array([0.3, -0.2, 0.0 if scene.planar else 0.5])
    found = run.linkdyn.shaking(about[:2] if scene.planar else about)
    force, moment = by_reactions(run, scene, about)
    n = found.force.shape[1]
    np.testing.assert_allclose(found.force, force[:, :n], rtol=0, atol=1e-9 * np.abs(force).max())
    np.testing.assert_allclose(found.moment, moment[:, 2:] if scene.planar else moment, rtol=0, atol=1e-9 * np.abs(moment).max())
    np.testing.assert_allclose(found.force_by_cause.sum("cause"), found.force, atol=1e-12 * np.abs(force).max())


def test_springs_and_dampers_on_the_frame_count():
    scene = linkdyn.new("four-bar").with_(
        {"frame.markers.S": [0.1, -0.2], "spring": [{"name": "S", "between": ["frame.S", "rocker.C"], "stiffness": 300.0, "damping": 40.0, "rest": 0.1}]})
    run = scene.inverse()
    tip = run.linkdyn.marker("rocker.C")
    arm = tip.position.values - [0.1, -0.2]
    length = np.linalg.norm(arm, axis=1, keepdims=True)
    pull = 300.0 * (length - 0.1) + 40.0 * np.sum(arm * tip.velocity.values, axis=1, keepdims=True) / length
    force, _ = by_reactions(run, scene, np.zeros(3))
    np.testing.assert_allclose(run.linkdyn.shaking().force, force[:, :2] + pull * arm / length, rtol=0, atol=1e-10 * pull.max())


# ---------------------------------------------------------------- causes

@pytest.mark.parametrize("kind", ["six-bar", "hexapod", "delta", "excavator", "scissor-lift"])
def test_causes_add_up_and_do_their_own_work(kind):
    """The power that the drives spend on a cause is what the cause takes: virtual work, without any reaction."""
    scene = linkdyn.new(kind)
    run = scene.inverse()
    found = run.linkdyn.contributions()
    for name in ("driving_force", "reaction"):
        size = float(np.abs(found[name]).max())
        np.testing.assert_allclose(found[name].sum("cause"), run[name], rtol=0, atol=1e-12 * size)
    spent = (found.driving_force * run.driving_speed).sum("actuator")
    assert set(map(str, found.cause.values)) == {"inertia", "weight", *(f"load {name}" for name in scene.loads)}
    at_rest = scene.with_({"load": None} if scene.loads else {}).inverse(run.q.values, want="driving_force")
    np.testing.assert_allclose(found.driving_force.sel(cause="weight"), at_rest.driving_force, rtol=0, atol=1e-9 * np.abs(run.driving_force).max())
    for i, load in enumerate(scene.description["loads"]):
        if load["axes"] == "world":
            force = scene.load_values(run.time.values)[:, i, : 2 if scene.planar else 3]
            speed = run.linkdyn.marker(load["name"]).velocity.values
            np.testing.assert_allclose(spent.sel(cause=f"load {load['name']}"), -(force * speed).sum(axis=1), rtol=0, atol=1e-9 * (1 + np.abs(force * speed).max()))


def test_contributions_of_given_wrenches_and_springs():
    scene = linkdyn.new("four-bar").with_({"spring": [{"name": "S", "joint": "D", "stiffness": 5.0, "rest": 1.0}]})
    q, qd, qdd = scene.motion()
    run = scene.inverse(q, qd, qdd, wrench={"coupler.P": [1.0, 2.0, 0.3]})
    found = run.linkdyn.contributions()
    assert list(map(str, found.cause.values)) == ["inertia", "weight", *(f"load {name}" for name in scene.loads), "spring S", "given coupler.P"]
    np.testing.assert_allclose(found.reaction.sum("cause"), run.reaction, atol=1e-12 * np.abs(run.reaction).max())


def test_preloads_are_a_cause_of_their_own():
    """Two motors on one shaft: each turns half the load; of preloads half their difference is left, against each other."""
    scene = shaft({"moment": -8.0}, samples=5)
    scene = linkdyn.Scene({**tomllib.loads(scene.text), "actuator": [{"joint": "A", "preload": 6.0}, {"joint": "A", "name": "second", "preload": -2.0}]})
    found = scene.inverse().linkdyn.contributions().driving_force.isel(sample=2)
    assert list(map(str, found.cause.values)) == ["inertia", "weight", "load disc.A", "preload"]
    np.testing.assert_allclose(found, [[0, 0], [0, 0], [4, 4], [4, -4]], atol=1e-12)


def test_what_events_bring_on_has_causes():
    """A brake that an event brings on stays in the scenes by which causes are found: they were refused, for the event was not there."""
    scene = linkdyn.load(Path(__file__).resolve().parents[2] / "examples" / "hoist" / "scene.toml")
    for run in scene.inverse(), scene.forward(t=[0.0, 1.0, 2.0]):
        found = run.linkdyn.contributions()
        np.testing.assert_allclose(found.driving_force.sum("cause"), run.driving_force, atol=1e-9 * np.abs(run.driving_force).max())


def test_contributions_of_a_forward_run():
    scene = linkdyn.new("four-bar")
    run = scene.forward(0.4)
    found = run.linkdyn.contributions()
    np.testing.assert_allclose(found.driving_force.sum("cause"), run.driving_force, atol=1e-9 * np.abs(run.driving_force).max())


# ---------------------------------------------------------------- energy

def test_flywheel_of_a_textbook_torque_curve():
    """Load 100 + 60 sin 2 theta: half a wave of it holds 60 J."""
    scene = shaft({"moment": {"law": "harmonic", "mean": -100.0, "amplitude": -60.0, "frequency": 2 * 300 * RPM}})
    run = scene.inverse()
    w = 300 * RPM
    wheel = run.linkdyn.flywheel(0.02)
    assert float(wheel.energy) == pytest.approx(60.0, rel=1e-4)
    assert float(wheel.inertia) == pytest.approx(60.0 / (0.02 * w**2), rel=1e-4)
    assert float(wheel.mean_torque) == pytest.approx(100.0, rel=1e-12)
    assert float(wheel.slowest_at) in (pytest.approx(0.05, abs=1e-9), pytest.approx(0.15, abs=1e-9))
    energy = run.linkdyn.energy()
    assert float(energy.mean_power.sel(drive="A")) == pytest.approx(100.0 * w, rel=1e-12)
    assert float(energy.peak_power.sel(drive="all")) == pytest.approx(160.0 * w, rel=1e-4)
    assert float(energy.fluctuation.sel(drive="A")) == pytest.approx(60.0, rel=1e-4)
    assert float(energy.energy_back.sel(drive="A")) == 0.0
    assert float(run.linkdyn.rms().sel(actuator="A")) == pytest.approx(np.sqrt(100.0**2 + 60.0**2 / 2), rel=1 / 721)    # both ends count


@pytest.mark.parametrize("samples", [42, 61, 721])
def test_flywheel_on_a_shaft_that_turns_often_between_samples(samples: int) -> None:
    """50 turns in one wave of the load, which 5/pi turns of 5 N m hold: counted by the speed, not by the nearest angles."""
    content = tomllib.loads(shaft({"moment": {"law": "harmonic", "mean": -3.0, "amplitude": 5.0, "frequency": "1 Hz"}}, rpm=3000.0).text)
    content["time"] = {"end": 1.0, "samples": samples}
    wheel = linkdyn.Scene(content).inverse().linkdyn.flywheel(0.01)
    w = 3000 * RPM
    assert float(wheel.mean_speed) == pytest.approx(w, rel=1e-12)
    assert float(wheel.energy) == pytest.approx(10.0 / (2 * np.pi) * w, rel=5e-3)
    assert float(wheel.inertia) == pytest.approx(10.0 / (2 * np.pi) / (0.01 * w), rel=5e-3)


def test_energy_in_and_back():
    """60 sin 2 theta: two half waves of 60 J go in, two come back."""
    run = shaft({"moment": {"law": "harmonic", "mean": 0.0, "amplitude": 60.0, "frequency": 2 * 300 * RPM}}).inverse()
    energy = run.linkdyn.energy().sel(drive="all")
    assert float(energy.energy_in) == pytest.approx(120.0, rel=1e-4) and float(energy.energy_back) == pytest.approx(120.0, rel=1e-4)
    assert float(energy.energy) == pytest.approx(0.0, abs=1e-9)


def test_averages_are_over_the_time():
    even = shaft({"moment": 5.0}).inverse()
    np.testing.assert_allclose(shares(even), 1 / 721, rtol=1e-11)
    scene = shaft({"moment": {"law": "harmonic", "mean": 0.0, "amplitude": 60.0, "frequency": 300 * RPM}})
    t = 0.2 * np.linspace(0, 1, 4001) ** 3          # crowded at the beginning
    run = scene.inverse(t=t)
    assert float(run.linkdyn.rms().sel(actuator="A")) == pytest.approx(60 / np.sqrt(2), rel=1e-3)
    assert abs(float(rms(run.driving_force.values[:, 0], np.full(4001, 1 / 4001))) * np.sqrt(2) / 60 - 1) > 0.02     # each alike is not the same


def test_duty_cycle():
    light, heavy = (shaft({"moment": -m}).inverse() for m in (10.0, 40.0))
    found = cycle.duty_cycle([(light, 6.0), (heavy, 1.0), (0.0, 3.0)])
    assert float(found.sel(actuator="A")) == pytest.approx(np.sqrt((6 * 10.0**2 + 40.0**2) / 10), rel=1e-12)


# ---------------------------------------------------------------- bearings

def test_life_under_a_constant_load():
    run = shaft({"force": [3000.0, 4000.0]}, rpm=1200.0).inverse()
    for exponent in (3.0, 10 / 3):
        found = run.linkdyn.bearing_life("A", capacity=35_000.0, exponent=exponent)
        assert float(found.equivalent_load) == pytest.approx(5000.0, rel=1e-12)
        assert float(found.life_turns) == pytest.approx(1e6 * 7.0**exponent, rel=1e-12)
        assert float(found.life_hours) == pytest.approx(1e6 * 7.0**exponent / (60 * 1200), rel=1e-12)


def test_life_under_a_load_that_swells():
    """The cubic mean of F + A sin is (F^3 + 3/2 F A^2)^(1/3)."""
    run = shaft({"force": [{"law": "harmonic", "mean": 5000.0, "amplitude": 3000.0, "frequency": 300 * RPM}, 0.0]}).inverse(t=np.linspace(0, 0.2, 720, endpoint=False))
    found = run.linkdyn.bearing_life("A", capacity=20_000.0)
    assert float(found.equivalent_load) == pytest.approx((5000.0**3 + 1.5 * 5000.0 * 3000.0**2) ** (1 / 3), rel=1e-9)
    assert float(found.peak_load) == pytest.approx(8000.0, rel=1e-9)


def overhung(load: list[float]) -> linkdyn.Scene:
    """A shaft along z with a load 0.3 m beyond the middle of its bearings."""
    return linkdyn.Scene({
        "space": "spatial",
        "frame": {"markers": {"A": [0, 0, 0]}},
        "link": [{"name": "shaft", "markers": {"A": [0, 0, 0], "P": [0, 0, 0.3]}, "mass": 0}],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "shaft.A"]}],
        "coordinate": [{"joint": "A", "motion": {"law": "constant-rate", "rate": 10.0, "start": 0.0}}],
        "actuator": [{"joint": "A"}],
        "load": [{"on": "shaft.P", "force": load}],
        "time": {"end": 1.0, "samples": 11},
    })


def test_two_bearings_share_a_moment():
    run = overhung([0.0, 1000.0, 0.0]).inverse()
    with pytest.raises(linkdyn.InputError, match="moment across its axis.*span="):
        run.linkdyn.bearing_life("A", capacity=1e4)
    found = run.linkdyn.bearing_life("A", capacity=1e4, span=0.2)
    assert float(found.equivalent_load) == pytest.approx(1000.0 * (0.5 + 0.3 / 0.2), rel=1e-12)


def test_thrust_wants_its_factor():
    run = overhung([0.0, 0.0, 500.0]).inverse()
    with pytest.raises(linkdyn.InputError, match="thrust.*axial_factor="):
        run.linkdyn.bearing_life("A", capacity=1e4)
    assert float(run.linkdyn.bearing_life("A", capacity=1e4, axial_factor=1.6).equivalent_load) == pytest.approx(800.0, rel=1e-12)


def test_pressure_times_speed():
    found = shaft({"force": [6000.0, 8000.0]}, rpm=120.0).inverse().linkdyn.plain_bearing("A", diameter=0.05, width=0.04)
    pressure, speed = 10_000.0 / (0.05 * 0.04), 120 * RPM * 0.025
    assert [float(found[name]) for name in ("peak_pressure", "peak_speed", "peak_pv", "mean_pv")] == pytest.approx(
        [pressure, speed, pressure * speed, pressure * speed], rel=1e-12)


# ---------------------------------------------------------------- what is wrong

@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda run: run.linkdyn.marker("copler.P"), "unknown marker.*did you mean 'coupler.P'"),
        (lambda run: run.linkdyn.relative_pose("crnk", "frame"), "link: 'crnk': unknown link.*did you mean 'crank'"),
        (lambda run: run.linkdyn.shaking([1.0]), r"about: expected shape \(2,\)"),
        (lambda run: run.linkdyn.shaking([np.nan, 0.0]), r"about\[0\] is not a finite number"),
        (lambda run: run.linkdyn.bearing_life("Q", capacity=1.0), "unknown joint"),
        (lambda run: run.linkdyn.bearing_life("A", capacity=-1.0), "capacity: expected a number above zero"),
        (lambda run: run.linkdyn.bearing_life("A", capacity=1.0, exponent=2.0), "exponent: 2:.*3 of ball"),
        (lambda run: run.linkdyn.bearing_life("A", capacity=np.inf), "capacity: expected a finite number"),
        (lambda run: run.linkdyn.plain_bearing("A", diameter=0.0, width=1.0), "diameter: expected a number above zero"),
        (lambda run: run.linkdyn.plain_bearing("A", diameter=1.0, width=-1.0), "width: expected a number above zero"),
        (lambda run: run.drop_vars("reaction").linkdyn.plain_bearing("A", diameter=1.0, width=1.0), "no reaction.*want='reaction'"),
        (lambda run: run.drop_vars("joint_rate").linkdyn.plain_bearing("A", diameter=1.0, width=1.0), "no joint_rate.*want='joint_variable'"),
        (lambda run: run.drop_vars(["reaction", "driving_force"]).linkdyn.contributions(), "neither driving forces nor reactions"),
        (lambda run: run.drop_vars("driving_power").linkdyn.energy(), "no driving_power.*want='power'"),
        (lambda run: run.isel(sample=[0]).linkdyn.energy(), "no instants"),
        (lambda run: run.linkdyn.flywheel(0.0), "fluctuation: expected a number above zero"),
        (lambda run: run.linkdyn.flywheel(0.1, "B"), "unknown actuator"),
        (lambda run: run.linkdyn.rms("force"), "no force"),
        (lambda run: cycle.duty_cycle([(0.0, 1.0)]), "no run among them"),
        (lambda run: cycle.duty_cycle([(run, 0.0)]), "seconds: expected a number above zero"),
        (lambda run: cycle.duty_cycle([(run, 1.0), (np.nan, 1.0)]), r"phases\[1\]: value: expected a finite number"),
        (lambda run: cycle.duty_cycle([(run, 1.0), ("12 N m", 1.0)]), r"phases\[1\]: value: expected a number"),
        (lambda run: cycle.duty_cycle([(run, 1.0), run]), r"phases\[1\]: expected \(run, seconds\)"),
        (lambda run: cycle.duty_cycle([(run.assign(status=run.status + 1), 1.0)]), r"phases\[0\]: all samples failed"),
        (lambda run: run.assign(driving_force=run.driving_force * 1.5).linkdyn.contributions(), "not all that acts"),
        (lambda run: run.drop_attrs().linkdyn.marker("coupler.P"), "no attribute 'scene'"),
    ],
)
def test_refused(call, message):
    run = linkdyn.new("four-bar").inverse()
    with pytest.raises(linkdyn.InputError, match=message):
        call(run)


def test_failed_samples_are_nan_and_told(crossing):
    scene = linkdyn.Scene(crossing)
    run = scene.inverse()
    bad = run.status.values != 0
    assert bad.any() and not bad.all()
    for values in (run.linkdyn.shaking(scene=scene).force.values, run.linkdyn.contributions(scene=scene).driving_force.values[0]):
        assert np.isnan(values[bad]).all() and np.isfinite(values[~bad]).all()
    with pytest.raises(linkdyn.InputError, match="samples? failed"):
        run.linkdyn.energy()


def test_a_batch_keeps_the_instants_of_its_loads():
    """Shaking forces and causes of a batch took the loads of the instant 0, whatever instants it had been given."""
    scene = linkdyn.new("slider-crank")
    along, order = scene.inverse(), np.random.default_rng(1).permutation(201)
    state = [values[order] for values in scene.motion()]
    batch = scene.inverse(*state, t=scene.times()[order])
    whole = along.linkdyn.shaking().force.values
    assert np.ptp(along.linkdyn.shaking().force_by_cause.sel(cause="load").values) > 0.1 * np.abs(whole).max()
    np.testing.assert_allclose(batch.linkdyn.shaking().force.values, whole[order], rtol=0, atol=1e-9 * np.abs(whole).max())
    by_cause, atol = along.linkdyn.contributions().reaction.values[:, order], 1e-9 * float(np.abs(along.reaction).max())
    np.testing.assert_allclose(batch.linkdyn.contributions().reaction.values, by_cause, rtol=0, atol=atol)
    one = scene.inverse(*[values[60:61] for values in scene.motion()], t=scene.times()[60])
    np.testing.assert_allclose(one.linkdyn.shaking().force.values[0], whole[60], rtol=1e-9)
