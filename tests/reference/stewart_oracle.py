#!/usr/bin/env python3
"""Inverse dynamics of a general 6-UPS platform in 50 decimal digits, by other ways than the engine's.

Kinematics: the closed-form positions are written in truncated Taylor series of time (taylor.py), so
velocities, spins and accelerations of all 13 bodies come out by exact differentiation of positions
and rotation matrices; no velocity or acceleration formula appears.

Forces, twice:
  full     78 equations in 78 unknowns: for each body, the rates of its momentum and of its angular
           momentum ABOUT THE WORLD ORIGIN equal the applied wrench (world axes throughout). The moment
           of a universal joint is the multiplier of the constraint u . y = 0 between its two axes.
  virtual  6 equations: virtual power of all bodies over the six pose coordinates, no reactions.
They must agree, and the power balance must close, to 1e-35; otherwise the program stops.

Run it to rewrite the reference files beside it and to compare with the published numbers:
    python tests/reference/stewart_oracle.py
"""
from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from mpmath import mp, mpf

mp.dps = 50
from stewart_data import PLATFORMS  # noqa: E402  (its constants need the precision set above)
from taylor import (Taylor, add, columns, cross, dot, derivative, matmul, mul, rates, roll_pitch_yaw,  # noqa: E402
                    scale, spin, sub, transpose, unit, values)

DIGITS = 20  # significant digits written
AGREE = mpf("1e-35")  # 50 digits less the conditioning (< 1e4) and a wide margin


# ---------------------------------------------------------------------------------------- kinematics
def pose_series(q, qd, qdd):
    """The six pose coordinates as series of time."""
    return [Taylor(mpf(a), mpf(b), mpf(c) / 2) for a, b, c in zip(q, qd, qdd)]


def bodies_of(platform, pose):
    """Rotation, origin, cog (series, world axes) and mass data of the 13 bodies, and the leg vectors.

    Order: platform, then lower and upper of leg 1, of leg 2, ...
    """
    rotation = roll_pitch_yaw(pose[3:])
    origin = pose[:3]
    bodies = [placed(platform["top"], rotation, origin)]
    legs = []
    for base, point, axis, lower, upper in zip(platform["base"], platform["platform"], platform["axis"],
                                               platform["lower"], platform["upper"]):
        first = [Taylor(x) for x in base]
        last = add(origin, mul(rotation, point))
        leg = sub(last, first)
        z = unit(leg)
        y = unit(cross(z, axis))
        turned = columns(cross(y, z), y, z)
        bodies += [placed(lower, turned, first), placed(upper, turned, last)]
        legs.append({"U": first, "S": last, "z": z, "y": y, "u": axis, "length": dot(leg, leg).sqrt()})
    return bodies, legs


def placed(body, rotation, origin):
    return {"mass": body["mass"], "inertia": body["inertia"], "rotation": rotation,
            "cog": add(origin, mul(rotation, body["cog"]))}


def momenta(body):
    """Momentum, angular momentum about the cog (series, world axes), kinetic energy (series)."""
    velocity = derivative(body["cog"])
    w = spin(body["rotation"])
    world_inertia = matmul(matmul(body["rotation"], body["inertia"]), transpose(body["rotation"]))
    p = scale(body["mass"], velocity)
    h = mul(world_inertia, w)
    return p, h, (dot(p, velocity) + dot(h, w)) * mpf("0.5")


# ---------------------------------------------------------------------------------------- the 78 equations
# unknowns of leg i, from 13 i: force of U (3), moment of U (1), force of P across the slide (2),
# moment of P (3), driving force (1), force of S (3)
def full_forces(platform, bodies, legs, wrench):
    """Driving forces and joint reactions by balance of momenta about the world origin."""
    n = 78
    matrix = mp.zeros(n, n)
    right = mp.zeros(n, 1)
    axes = [mpf(1) if i == j else mpf(0) for i in range(3) for j in range(3)]
    e = [axes[0:3], axes[3:6], axes[6:9]]

    def enter(body, column, force, point, moment=(0, 0, 0), sign=1):
        """The unknown `column` puts this force at this point, and this moment, on a body."""
        about_origin = add(cross(point, force), [mpf(m) for m in moment])
        for k in range(3):
            matrix[6 * body + k, column] += sign * force[k]
            matrix[6 * body + 3 + k, column] += sign * about_origin[k]

    nil = [mpf(0)] * 3
    for i, leg in enumerate(legs):
        lower, upper, start = 1 + 2 * i, 2 + 2 * i, 13 * i
        u_point, s_point, z, y = (values(leg[k]) for k in ("U", "S", "z", "y"))
        bend = cross(leg["u"], y)  # no power in turning about u or about y
        across = [y, cross(y, z)]
        for k in range(3):
            enter(lower, start + k, e[k], u_point)
        enter(lower, start + 3, nil, u_point, bend)
        for k in range(2):
            enter(upper, start + 4 + k, across[k], s_point)
            enter(lower, start + 4 + k, across[k], s_point, sign=-1)
        for k in range(3):
            enter(upper, start + 6 + k, nil, s_point, e[k])
            enter(lower, start + 6 + k, nil, s_point, e[k], sign=-1)
        enter(upper, start + 9, z, s_point)
        enter(lower, start + 9, z, s_point, sign=-1)
        for k in range(3):
            enter(0, start + 10 + k, e[k], s_point)
            enter(upper, start + 10 + k, e[k], s_point, sign=-1)
    for b, body in enumerate(bodies):
        p, h, _ = momenta(body)
        about_origin = add(cross(body["cog"], p), h)
        weight = scale(body["mass"], platform["gravity"])
        load = values(cross(body["cog"], weight))
        for k in range(3):
            right[6 * b + k] = p[k].rate - weight[k]
            right[6 * b + 3 + k] = about_origin[k].rate - load[k]
    force, moment = wrench[:3], wrench[3:]
    about_origin = add(cross(values(load_point(platform, bodies[0])), force), moment)
    for k in range(3):
        right[k] -= force[k]
        right[3 + k] -= about_origin[k]
    x = mp.lu_solve(matrix, right)
    driving, reaction = [], {}
    for i, leg in enumerate(legs):
        start = 13 * i
        y, z = values(leg["y"]), values(leg["z"])
        part = [x[start + k] for k in range(13)]
        reaction[f"leg{i + 1}.U"] = part[0:3] + scale(part[3], cross(leg["u"], y))
        reaction[f"leg{i + 1}.P"] = add(scale(part[4], y), scale(part[5], cross(y, z))) + part[6:9]
        reaction[f"leg{i + 1}.S"] = part[10:13] + nil
        driving.append(part[9])
    return driving, reaction


def load_point(platform, top):
    """World position (series) of the point of the platform on which the external wrench acts."""
    return add(top["cog"], mul(top["rotation"], sub(platform["load_point"], platform["top"]["cog"])))


# ---------------------------------------------------------------------------------------- virtual power
def virtual_forces(platform, bodies, q, wrench):
    """Driving forces alone, from the virtual power over each pose coordinate."""
    matrix = mp.zeros(6, 6)
    right = mp.zeros(6, 1)
    rate_of_momenta = [tuple(rates(x) for x in momenta(body)[:2]) for body in bodies]
    for k in range(6):
        direction = [1 if j == k else 0 for j in range(6)]
        varied, legs = bodies_of(platform, pose_series(q, direction, [0] * 6))
        for body, (p_rate, h_rate) in zip(varied, rate_of_momenta):
            shift, turn = rates(body["cog"]), values(spin(body["rotation"]))
            inertial = sub(p_rate, scale(body["mass"], platform["gravity"]))
            right[k] += dot(shift, inertial) + dot(turn, h_rate)
        right[k] -= dot(rates(load_point(platform, varied[0])), wrench[:3])
        right[k] -= dot(values(spin(varied[0]["rotation"])), wrench[3:])
        for i, leg in enumerate(legs):
            matrix[k, i] = leg["length"].rate
    return list(mp.lu_solve(matrix, right))


def power_imbalance(platform, bodies, legs, driving, wrench):
    """Driving power + weight + external wrench - rate of kinetic energy, over the sum of magnitudes."""
    terms = [f * leg["length"].rate for f, leg in zip(driving, legs)]
    terms += [body["mass"] * dot(platform["gravity"], rates(body["cog"])) for body in bodies]
    terms += [dot(wrench[:3], rates(load_point(platform, bodies[0]))), dot(wrench[3:], values(spin(bodies[0]["rotation"])))]
    terms += [-momenta(body)[2].rate for body in bodies]
    size = sum(abs(t) for t in terms)
    return abs(sum(terms)) / size if size else mpf(0)


# ---------------------------------------------------------------------------------------- states given otherwise
def pose_from_lengths(platform, given):
    """Pose, rates and accelerations from leg lengths and their derivatives: Newton's method, then linear maps."""
    wanted = [[mpf(x) for x in given[key]] for key in ("length", "rate", "acceleration")]
    q = [mpf(x) for x in given["guess"].split()]

    def lengths(q, qd):
        return [leg["length"] for leg in bodies_of(platform, pose_series(q, qd, [0] * 6))[1]]

    def jacobian(q):
        directions = [[1 if j == k else 0 for j in range(6)] for k in range(6)]
        return mp.matrix([rates(lengths(q, d)) for d in directions]).T

    for _ in range(40):
        step = mp.lu_solve(jacobian(q), mp.matrix(sub(wanted[0], values(lengths(q, [0] * 6)))))
        q = add(q, list(step))
        if mp.norm(step) < mpf("1e-45"):
            break
    else:
        raise SystemExit(f"{given['name']}: leg lengths do not close")
    jac = jacobian(q)
    qd = list(mp.lu_solve(jac, mp.matrix(wanted[1])))
    drift = [x.second for x in lengths(q, qd)]
    return q, qd, list(mp.lu_solve(jac, mp.matrix(sub(wanted[2], drift))))


def pose_from_vectors(given):
    """Rates and accelerations of the angles from angular velocity and acceleration, at zero angles."""
    words = {k: [mpf(x) for x in v.split()] for k, v in given.items() if k != "name"}
    zero = [mpf(0)] * 3
    angular_velocity = lambda rate: spin(roll_pitch_yaw(pose_series(zero, rate, zero)))
    unit_rates = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    jac = mp.matrix([values(angular_velocity(d)) for d in unit_rates]).T
    rate = list(mp.lu_solve(jac, mp.matrix(words["spin"])))
    drift = rates(angular_velocity(rate))
    second = list(mp.lu_solve(jac, mp.matrix(sub(words["spin_rate"], drift))))
    return words["position"] + zero, words["velocity"] + rate, words["acceleration"] + second


def all_states(platform):
    """Every state of a data set as exact doubles."""
    other = [(g["name"], pose_from_lengths(platform, g)) for g in platform.get("length_states", [])]
    other += [(g["name"], pose_from_vectors(g)) for g in platform.get("vector_states", [])]
    doubles = lambda v: [float(mp.chop(x, AGREE)) for x in v]
    given = [{"name": name, "q": doubles(q), "qd": doubles(qd), "qdd": doubles(qdd), "wrench": [0.0] * 6}
             for name, (q, qd, qdd) in other]
    return given + platform["states"]


# ---------------------------------------------------------------------------------------- references
def solve(platform, q, qd, qdd, wrench):
    """Driving forces, reactions, leg lengths and their rates of one state; stops if the two ways differ."""
    wrench = [mpf(x) for x in wrench]
    bodies, legs = bodies_of(platform, pose_series(q, qd, qdd))
    driving, reaction = full_forces(platform, bodies, legs, wrench)
    virtual = virtual_forces(platform, bodies, q, wrench)
    size = max(abs(f) for f in driving)
    gap = max(abs(a - b) for a, b in zip(driving, virtual)) / size
    leak = power_imbalance(platform, bodies, legs, driving, wrench)
    if max(gap, leak) > AGREE:
        raise SystemExit(f"two derivations differ: forces {mp.nstr(gap, 3)}, power {mp.nstr(leak, 3)}")
    return {"driving_force": driving, "reaction": reaction,
            "length": [leg["length"].value for leg in legs], "length_rate": [leg["length"].rate for leg in legs],
            "agreement": max(gap, leak)}


def printed_digits_agree(ours, printed):
    """Whether `ours`, rounded as `printed` is, gives the same digits; and the relative difference."""
    decimals = len(printed.partition(".")[2])
    rounded = mp.nint(ours * mpf(10) ** decimals) == mp.nint(mpf(printed) * mpf(10) ** decimals)
    return bool(rounded), abs(ours / mpf(printed) - 1)


def reference(name, report):
    """The reference record of one data set; published numbers compared on the way."""
    platform = PLATFORMS[name]()
    states, failed = [], False
    for given in all_states(platform):
        result = solve(platform, *(given[k] for k in ("q", "qd", "qdd", "wrench")))
        if given["name"] in platform["published"]:
            printed, source = platform["published"][given["name"]]
            checks = [printed_digits_agree(f, p) for f, p in zip(result["driving_force"], printed.split())]
            worst = max(c[1] for c in checks)
            exact = sum(c[0] for c in checks)
            report(f"{name}: {given['name']} ({source}): {exact} of 6 forces agree to every printed digit, "
                   f"largest relative difference {mp.nstr(worst, 2)}")
            # aris prints doubles to more digits than they hold; it was itself right to 1e-13
            failed = failed or (exact < 6 and worst > mpf("5e-13"))
            given = {**given, "published_driving_force": printed.split(), "published_by": source}
        tiny = AGREE * max(abs(f) for f in result["driving_force"])  # what is left of exact zeros
        text = lambda v: [mp.nstr(x, DIGITS) if abs(x) > tiny else "0" for x in v]
        states.append({**given, "driving_force": text(result["driving_force"]),
                       "reaction": {joint: text(w) for joint, w in result["reaction"].items()},
                       "length": text(result["length"]), "length_rate": text(result["length_rate"])})
    if failed:
        raise SystemExit(f"{name}: published numbers not met")
    return {"name": name, "digits": DIGITS, "working_digits": mp.dps,
            "wrench_on": platform["wrench_on"], "coordinates": ["x", "y", "z", "roll", "pitch", "yaw"], "states": states}


def write(record, path):
    """JSON with one list a line, so that a change shows as a short diff."""
    lines = []
    for s in record["states"]:
        fields = [f'   "{k}": {json.dumps(v)}' for k, v in s.items() if k != "reaction"]
        joints = ",\n".join(f'    "{joint}": {json.dumps(w)}' for joint, w in s["reaction"].items())
        fields.append('   "reaction": {\n' + joints + "}")
        lines.append("  {\n" + ",\n".join(fields) + "}")
    head = "".join(f' "{k}": {json.dumps(v)},\n' for k, v in record.items() if k != "states")
    path.write_text("{\n" + head + ' "states": [\n' + ",\n".join(lines) + "]}\n")


def main(arguments=None):
    parser = argparse.ArgumentParser(description="Write the Stewart references and compare with published numbers.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder (default: beside this file)")
    parser.add_argument("names", nargs="*", default=list(PLATFORMS), help="data sets (default: all)")
    options = parser.parse_args(arguments)
    for name in options.names:
        write(reference(name, print), options.out / f"stewart_{name}.json")
    return 0


if __name__ == "__main__":
    sys.exit(main())
