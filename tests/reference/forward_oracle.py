#!/usr/bin/env python3
"""Forward dynamics of the examples in many digits, by other ways than the engine's: rewrites forward.json.

    python tests/reference/forward_oracle.py [CASE ...]     # all of them: some minutes; needs mpmath and gmpy2

Planar scenes: Lagrange's multipliers in absolute coordinates and Taylor series (planar_taylor.py). Spatial ones: virtual power and
momentum balances (spatial_motion.py). Where the motion is known exactly, it is taken: the cycloidal starts and the chain of
four-bars, which moves like a pendulum. The program stops where two ways disagree.
"""
from __future__ import annotations

import csv
import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import gmpy2
from gmpy2 import mpfr
from mpmath import mp, mpf

import planar_oracle
import planar_taylor
import spatial_motion
from planar_taylor import number

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parents[1] / "examples"
DIGITS = 20
RCSP_RATE = 10     # of the crank at the start of rcsp_free [rad/s]


def load(path: str) -> dict:
    return tomllib.loads((EXAMPLES / path).read_text(encoding="utf-8"))


def text(value) -> str:
    return mp.nstr(mpf(str(value)), DIGITS)


def written(state: dict) -> dict:
    """Numbers as text with 20 digits."""
    return {key: {k: [text(x) for x in v] for k, v in value.items()} if isinstance(value, dict)
            else [text(x) for x in value] if isinstance(value, list) else value for key, value in state.items()}


def starts(scene: dict) -> tuple[list, list]:
    """Positions and rates of the coordinates at the start."""
    entries = [c["start"] if isinstance(c["start"], dict) else {"position": c["start"]} for c in scene["coordinate"]]
    return [e["position"] for e in entries], [e.get("velocity", 0.0) for e in entries]


# ------------------------------------------------------------------------------------------------------------ planar
def guess_fourbar(q, scene):
    crank = 10 + 4 * complex(mp.expj(q[0]))
    top = planar_oracle.meet(0j, 8, crank, 8, 1)
    return [10, 0, q[0], *planar_oracle.pose(top, crank), *planar_oracle.pose(0j, top)]


def guess_starts(q, scene):
    """Where the scene says that the links start; the crank turns by the coordinate."""
    poses = [link.get("start", {"position": [0, 0], "angle": q[0]}) for link in scene["link"]]
    return [mpf(x) for pose in poses for x in (*pose["position"], pose["angle"])]


def planar_run(path: str, guess, instants: list[float]) -> list[dict]:
    """States at the instants, integrated from the scene's start."""
    scene = load(path)
    mechanism = planar_oracle.Mechanism(scene)
    q, qd = ([mpf(x) for x in values] for values in starts(scene))
    x = mechanism.close(guess(q, scene), q)
    v = mp.lu_solve(mechanism.jacobian(x, q), mp.matrix([0] * (mechanism.n - len(q)) + qd))
    split = lambda values: [[number(mp.nstr(value, 50)) for value in values[i : i + 3]] for i in range(0, mechanism.n, 3)]
    run = planar_taylor.Run(scene)
    run.start(split(list(x)), split(list(v)))
    states = []
    for instant in instants:
        run.advance(number(instant))
        states.append({**run.state(), "t": instant})
        print(f"  {path} t = {instant}: gap of the joints {float(largest_gap(run)):.1e}", flush=True)
    return states


def largest_gap(run) -> mpfr:
    """Joints are never corrected: how far they have come apart bounds the error."""
    def place(body, point):
        if body is run.frame:
            return body.points[point]
        return [centre[0] + arm[0] for centre, arm in zip((body.x, body.y), body.arms[point])]
    gap = max(abs(a - b) for _, first, second in run.joints for a, b in zip(place(*first), place(*second)))
    assert gap < mpfr("1e-28"), gap
    return gap


def fourbar_start() -> list[dict]:
    """The exact motion of the law, with the torque and the reactions of planar_oracle."""
    scene = load("fourbar_start/scene.toml")
    law, start = scene["coordinate"][0]["motion"], mpf(scene["coordinate"][0]["start"])
    mechanism = planar_oracle.Mechanism(scene)
    states = []
    for t in (0.7, 2.0, 5.0, 10.0):
        q, qd, qdd = cycloidal_start(mpf(t), start, mpf(1), mpf(law["duration"]))
        reaction, torque = mechanism.solve(guess_fourbar([q], scene), [q], [qd], [qdd])
        states.append({"t": t, "q": [q], "qd": [qd], "qdd": [qdd], "driving_force": torque, "reaction": reaction})
    return states


def cycloidal_start(t, start, speed, duration):
    """Angle, rate and acceleration of a rate that rises like u - sin(2 pi u)/(2 pi)."""
    if t >= duration:
        return start + speed * (t - duration / 2), speed, mpf(0)
    u = t / duration
    wave = 2 * mp.pi * u
    angle = start + speed * duration * (u**2 / 2 + (mp.cos(wave) - 1) / (4 * mp.pi**2))
    return angle, speed * (u - mp.sin(wave) / (2 * mp.pi)), speed * (1 - mp.cos(wave)) / duration


def n_fourbar(path: str, instants: list[float]) -> list[dict]:
    """A pendulum: phi" = c sin(phi), c = g ((N+1)/2 + N)/((N+1)/3 + N); q = pi/2 - phi. Forces by multipliers."""
    scene = load(path)
    n = sum(link["name"].startswith("rod") for link in scene["link"])
    gravity = -number(scene["gravity"][1])
    inertia = number(scene["link"][0]["inertia"])       # a twelfth, as a double
    c = gravity * (mpfr(n + 1) / 2 + n) / ((n + 1) * (inertia + mpfr(1) / 4) + n)
    (q,), (qd,) = starts(scene)
    quarter = gmpy2.const_pi() / 2
    rate = lambda t, y: [y[1], c * gmpy2.sin(y[0])]
    solve = lambda each: spatial_motion.integrate(rate, [quarter - number(q), -number(qd)], [mpfr(0), *map(number, instants)], each)[0]
    states = []
    for t, (phi, phi_rate), (other, _) in zip(instants, solve(150)[1:], solve(180)[1:]):
        assert abs(phi - other) < mpfr("1e-25"), (phi, other)
        angle = quarter - phi
        along = [gmpy2.cos(angle), gmpy2.sin(angle)]
        position, velocity = [], []
        for link in scene["link"]:
            i = int(link["name"][3:])
            is_rod = link["name"].startswith("rod")
            base = [mpfr(i - 1), mpfr(0)] if is_rod else [mpfr(i), mpfr(0)]
            position.append([base[0] + along[0], along[1], mpfr(0)] if is_rod else [*base, angle])
            velocity.append([along[1] * phi_rate, -along[0] * phi_rate, mpfr(0)] if is_rod else [mpfr(0), mpfr(0), -phi_rate])
        run = planar_taylor.Run(scene)
        run.start(position, velocity)
        right, (constant, varying) = run.right(0), run.entries()
        matrix = [[mpfr(0)] * run.size for _ in range(run.size)]
        for row, column, value in constant + [(row, column, sign * series[0]) for row, column, sign, series in varying]:
            matrix[row][column] += value
        x = planar_taylor.Factors(matrix).solve(right)
        run.unknown = [[value] for value in x]
        offset = 3 * len(run.bodies)
        acceleration = -c * gmpy2.sin(phi)
        assert abs(x[2] - acceleration) < mpfr("1e-25"), (x[2], acceleration)
        states.append({"t": t, "q": [angle], "qd": [-phi_rate], "qdd": [acceleration], "driving_force": [],
                       "reaction": {name: [x[offset + 2 * j], x[offset + 2 * j + 1], mpfr(0)] for j, (name, _, _) in enumerate(run.joints)}})
        print(f"  {path} t = {t}: x(B0) = {float(along[0]):.15g}, y(B0) = {float(along[1]):.15g}", flush=True)
    return states


# ----------------------------------------------------------------------------------------------------------- spatial
def rcsp_start() -> list[dict]:
    scene = load("rcsp_start/scene.toml")
    mechanism = spatial_motion.rcsp(scene, None)
    states = []
    for t in (0.3, 1.0, 1.7, 2.0):
        q, qd, qdd = cycloidal_start(mpf(t), mpf(0), 2 * mp.pi, mpf(1))
        reaction = mechanism.reactions([q], [qd], [qdd], mpf(t))
        torque = reaction.pop("drive R")[5]
        states.append({"t": t, "q": [q], "qd": [qd], "qdd": [qdd], "driving_force": [torque], "reaction": reaction})
    return states


def rcsp_free() -> list[dict]:
    """Let go at 10 rad/s, without torque."""
    mechanism = spatial_motion.rcsp(load("rcsp_start/scene.toml"), lambda t, q, qd: mpf(0))
    return released(mechanism, RCSP_RATE, (mpf("0.5"), mpf(1), mpf(2)))


def spatial_slider_crank() -> list[dict]:
    """Let go at 6 rad/s."""
    return released(spatial_motion.slider_crank(load("spatial_slider_crank/scene.toml")), 6, (mpf("0.1"), mpf(1), mpf(5)), driven=False)


def released(mechanism, start_rate, instants, driven: bool = True) -> list[dict]:
    """One coordinate, from zero, without drive: energy gives the rate as a function of the angle, and a quadrature the time."""

    def energies(angle):
        """Kinetic energy at a rate of 1 rad/s, and potential energy."""
        bodies, _ = mechanism.bodies_of(mechanism.series([angle], [1], [0]))
        kinetic = sum(spatial_motion.momenta(body)[2].value for body in bodies.values())
        weight = sum(body["mass"] * body["cog"][2].value for body in bodies.values()) * -mechanism.gravity[2]
        return kinetic, weight

    unit, weight = energies(mpf(0))
    total = unit * start_rate**2 + weight

    def slowness(angle):
        unit, weight = energies(angle)
        return mp.sqrt(unit / (total - weight))

    states, angle, time = [], mpf(0), mpf(0)
    for t in instants:
        new = angle + start_rate * (t - time)        # Newton's method on the time of arrival
        came = arrival(slowness, angle, new)
        while abs(miss := t - time - came) > mpf(10) ** -27:
            came += arrival(slowness, new, new + miss / slowness(new))
            new += miss / slowness(new)
        angle, time = new, t
        states.append(spatial_state(mechanism, float(t), [angle], [1 / slowness(angle)], driven))
        print(f"  t = {float(t)}: {mp.nstr(angle, 20)}", flush=True)
    return states


def arrival(slowness, begin, end):
    """Integral of the slowness by Gauss and Legendre, twice."""
    pieces = max(1, int(abs(end - begin) / mpf("0.25")))
    knots = [begin + (end - begin) * i / pieces for i in range(pieces + 1)]
    value, error = mp.quad(slowness, knots, method="gauss-legendre", maxdegree=4, error=True)
    assert error < mpf(10) ** -20, error
    return value


def spatial_state(mechanism, t, q, qd, driven) -> dict:
    qdd = mechanism.accelerations(q, qd, mpf(t))
    return {"t": t, "q": q, "qd": qd, "qdd": qdd, "driving_force": [0.0] if driven else [],
            "reaction": mechanism.reactions(q, qd, qdd, mpf(t))}


def flyball_governor() -> list[dict]:
    scene = load("flyball_governor/scene.toml")
    for coordinate in scene["coordinate"]:
        for key, value in coordinate["start"].items():
            coordinate["start"][key] = {"1 rev/s": 6.283185307179586, "30 deg": 0.5235987755982988}.get(value, value)
    (_, angle, _, height), (spin, *_) = starts(scene)
    rate = spatial_motion.governor_rate(scene, number(spin))
    mechanism = spatial_motion.governor(scene)
    instants = [0.0, 0.01, 0.1, 1.0, 3.0]
    start = [mpfr(0), number(angle), mpfr(0), number(height), mpfr(0)]
    states, y = [], start
    for begin, end in zip(instants, instants[1:]):
        steps = round((end - begin) / 2e-4)
        first = y
        y = spatial_motion.integrate(rate, first, [number(begin), number(end)], steps)[0][-1]
        if end < 1:
            other = spatial_motion.integrate(rate, first, [number(begin), number(end)], round(1.25 * steps))[0][-1]
            difference = max(abs(a - b) for a, b in zip(y, other))
            print(f"  flyball_governor t = {end}: two step lengths differ by {float(difference):.1e}", flush=True)
            assert difference < mpfr("1e-20")
        turn, alpha, alpha_rate, s, s_rate = (mpf(str(value)) for value in y)
        spin_now = mpf(str(rate(0, y)[0]))
        states.append(spatial_state(mechanism, end, [turn, alpha, alpha, s], [spin_now, alpha_rate, alpha_rate, s_rate], driven=False))
        by_hand = [mpf(str(value)) for value in rate(0, y)]
        assert abs(by_hand[2] - states[-1]["qdd"][1]) < mpf("1e-25") * (1 + abs(by_hand[2]))
        assert abs(by_hand[4] - states[-1]["qdd"][3]) < mpf("1e-25") * (1 + abs(by_hand[4]))
        print(f"  flyball_governor t = {end}: s = {mp.nstr(s, 14)}, angle {mp.nstr(alpha, 14)}, spin {mp.nstr(spin_now, 14)}", flush=True)
    return states


def stewart_forward(path: str) -> list[dict]:
    """No other way here: linkdyn's own equations in quadruple precision, found on the path (`make real128`)."""
    states = []
    for t in (0.5, 1.0, 2.0):
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "out.csv"
            subprocess.run(["linkdyn-real128", "forward", EXAMPLES / path, "--until", str(t), "--samples", "2", "--method", "gbs",
                            "--rtol", "1e-20", "--atol", "1e-20", "--want", "driving_force,reaction", "--csv", "-o", out, "--quiet"],
                           check=True)
            header, *rows = csv.reader(out.open())
        value = {name.rsplit(" [", 1)[0]: x for name, x in zip(header, rows[-1])}
        part = lambda kind: [x for name, x in value.items() if name.split()[0] == kind]
        reactions = {}
        for name, x in value.items():
            if name.startswith("reaction "):
                reactions.setdefault(name.split()[1], []).append(x)
        states.append({"t": t, **{kind: part(kind) for kind in ("q", "qd", "qdd", "driving_force")}, "reaction": reactions})
    return states


CASES = {
    "andrews": ("andrews/scene_forward.toml", lambda p: planar_run(p, guess_starts, [0.005, 0.01, 0.03, 0.05])),
    "fourbar_start": ("fourbar_start/scene.toml", lambda p: fourbar_start()),
    "fourbar_constant_torque": ("fourbar_constant_torque/scene.toml", lambda p: planar_run(p, guess_fourbar, [0.5, 2.5, 5.0, 12.0])),
    "fivebar_motors": ("fivebar_motors/scene.toml", lambda p: planar_run(p, planar_oracle.guess_fivebar, [0.05, 0.1, 0.3, 1.0])),
    "n_fourbar_2": ("n_fourbar/scene.toml", lambda p: n_fourbar(p, [1.0, 5.0, 10.0, 20.0])),
    "n_fourbar_40": ("n_fourbar/scene_40.toml", lambda p: n_fourbar(p, [1.0, 10.0, 20.0])),
    "rcsp_start": ("rcsp_start/scene.toml", lambda p: rcsp_start()),
    "rcsp_free": ("rcsp_start/scene.toml", lambda p: rcsp_free()),
    "spatial_slider_crank": ("spatial_slider_crank/scene.toml", lambda p: spatial_slider_crank()),
    "flyball_governor": ("flyball_governor/scene.toml", lambda p: flyball_governor()),
    "stewart_forward": ("stewart_forward/scene.toml", stewart_forward),
}


def main() -> None:
    file = HERE / "forward.json"
    cases = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    for name in sys.argv[1:] or CASES:
        path, solve = CASES[name]
        print(name, flush=True)
        states = [{key: value for key, value in state.items() if key != "pose"} for state in solve(path)]
        cases[name] = {"scene": path, "states": [written(state) for state in states]}
        file.write_text(json.dumps(cases, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
