"""Independent references for planar inverse dynamics: Newton on all joint constraints, 50 digits.

Nothing is shared with the engine: the unknowns are the poses of all links at once, closed by Newton's method on every joint;
rates and accelerations solve the same Jacobian; the forces are the multipliers of the constraints (Lagrange), from which
reactions follow. Circles are intersected, with complex numbers, for the first guess only.

Usage: python planar_oracle.py    (writes planar.json)
"""
from __future__ import annotations

import json
import tomllib
from pathlib import Path

import mpmath as mp

mp.mp.dps = 50
HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parents[1] / "examples"
DIGITS = 20


def meet(a: complex, ra: float, b: complex, rb: float, side: int) -> complex:
    """Intersection of two circles, left (+1) or right (-1) of the way from a to b."""
    d = b - a
    x = (ra**2 - rb**2 + abs(d) ** 2) / (2 * abs(d))
    return a + (x + side * 1j * abs(ra**2 - x**2) ** 0.5) * d / abs(d)


def pose(origin: complex, towards: complex) -> list:
    d = towards - origin
    return [mp.mpf(origin.real), mp.mpf(origin.imag), mp.atan2(d.imag, d.real)]


def guess_sixbar(q, scene):
    j1 = 0.3 * complex(mp.expj(q[0]))
    j3 = complex(-0.72, -0.21)
    j2 = meet(j3, 0.5, j1, 0.8, 1)
    j4 = j2 + complex(0.4, 0.3) * (j1 - j2) / abs(j1 - j2)
    rail = scene["frame"]["markers"]["rail"]
    u = complex(*rail["axis"])
    base = complex(*rail["at"]) + complex(0.06, 0.02) * u
    d = (base - j4) / u
    j5 = j4 + ((0.8**2 - d.imag**2) ** 0.5 + 1j * d.imag) * u
    slider = j5 - complex(0.06, 0.02) * u
    return [0, 0, q[0], *pose(j2, j1), *pose(j3, j2), *pose(j5, j4), *pose(slider, slider + u)]


def guess_fivebar(q, scene):
    j2 = 0.05 + 0.4 * complex(mp.expj(q[0]))
    j4 = -0.05 + 0.4 * complex(mp.expj(q[1]))
    j3 = meet(j4, 0.6, j2, 0.6, 1)
    return [*pose(0.05 + 0j, j2), *pose(j3, j2), *pose(j4, j3), *pose(-0.05 + 0j, j4)]


def guess_as_written(q, scene):
    return [mp.mpf(0)] * (3 * len(scene["link"]))


CASES = {
    "sixbar_slider/scene.toml": (guess_sixbar, [[0.4], [1.7], [3.9], [5.5]], [6.3], [5.0]),
    "sixbar_slider/scene_inclined.toml": (guess_sixbar, [[0.4], [1.7], [3.9], [5.5]], [6.3], [-5.0]),
    "fivebar_parallel/scene.toml": (guess_fivebar, [[1.0, 2.2], [0.8, 2.05], [0.6, 1.8]], [-0.5, 0.8], [3.0, -2.0]),
    "stephenson_iii/scene.toml": (guess_as_written, [[0.0], [0.02], [0.05]], [1.5], [0.7]),
}


class Mechanism:
    """A planar scene as constraints phi(x) = 0 on the poses x of its links.

    `number` reads the scene's numbers: as the doubles that the engine has (default), or as the decimals in the file.
    """

    def __init__(self, scene, number=mp.mpf):
        self.scene = scene
        self.number = number
        self.links = {link["name"]: i for i, link in enumerate(scene["link"])}
        self.n = 3 * len(self.links)

    def marker(self, name):
        link, marker = name.split(".")
        owner = self.scene["frame"] if link == "frame" else self.scene["link"][self.links[link]]
        value = owner["markers"][marker]
        at, axis = (value["at"], value["axis"]) if isinstance(value, dict) else (value, [1, 0])
        return self.links.get(link, -1), self.complex(at), self.complex(axis)

    def complex(self, pair):
        return mp.mpc(*map(self.number, pair))

    def coordinate_joints(self):
        joints = {joint["name"]: joint for joint in self.scene["joint"]}
        return [joints[coordinate["joint"]] for coordinate in self.scene["coordinate"]]

    def coordinates_turn(self):
        """Which coordinates are angles."""
        return [joint["type"] == "revolute" for joint in self.coordinate_joints()]

    def place(self, x, link, point):
        """A point's place, and its derivatives by the link's x, y, angle (complex numbers)."""
        if link < 0:
            return point
        return mp.mpc(x[3 * link], x[3 * link + 1]) + point * mp.expj(x[3 * link + 2])

    def angle(self, x, link):
        return mp.mpf(0) if link < 0 else x[3 * link + 2]

    def constraints(self, x, q):
        """All gaps: two a joint, then one a coordinate."""
        gaps = []
        for joint in self.scene["joint"]:
            (i, a, u), (j, b, w) = map(self.marker, joint["between"])
            gap = self.place(x, j, b) - self.place(x, i, a)
            if joint["type"] == "revolute":
                gaps += [gap.real, gap.imag]
            else:
                turn = self.angle(x, j) + mp.arg(w) - self.angle(x, i) - mp.arg(u)
                along = gap / (u / abs(u) * mp.expj(self.angle(x, i)))
                gaps += [along.imag, turn]
        for value, joint in zip(q, self.coordinate_joints()):
            (i, a, u), (j, b, _) = map(self.marker, joint["between"])
            if joint["type"] == "revolute":
                gaps.append(self.angle(x, j) - self.angle(x, i) - value)
            else:
                gap = self.place(x, j, b) - self.place(x, i, a)
                gaps.append((gap / (u / abs(u) * mp.expj(self.angle(x, i)))).real - value)
        return gaps

    def jacobian(self, x, q):
        """Derivatives by central differences: the digits of mpmath make them exact to 25 places and more."""
        step = mp.mpf(10) ** -(7 * mp.mp.dps // 20)
        columns = []
        for k in range(self.n):
            ahead, behind = list(x), list(x)
            ahead[k] += step
            behind[k] -= step
            columns.append([(a - b) / (2 * step) for a, b in zip(self.constraints(ahead, q), self.constraints(behind, q))])
        return mp.matrix(columns).T

    def close(self, x, q):
        for _ in range(30):
            change = mp.lu_solve(self.jacobian(x, q), -mp.matrix(self.constraints(x, q)))
            x = [a + b for a, b in zip(x, change)]
            if mp.norm(change) < mp.mpf(10) ** -(4 * mp.mp.dps // 5):
                return x
        raise ArithmeticError("Newton's method did not converge")

    def solve(self, x, q, qd, qdd):
        """Reactions of all joints and driving torques."""
        x = self.close(x, q)
        jac = self.jacobian(x, q)
        n_free = self.n - len(q)
        velocity = mp.lu_solve(jac, mp.matrix([0] * n_free + list(qd)))
        # phi" = J x" + d2(phi along the velocity): second difference along the path x + t v.
        h = mp.mpf(10) ** -(mp.mp.dps // 4) / max([1, *(abs(v) for v in velocity[2::3])])
        ahead = self.constraints([a + h * b for a, b in zip(x, velocity)], q)
        behind = self.constraints([a - h * b for a, b in zip(x, velocity)], q)
        here = self.constraints(x, q)
        curve = [(a - 2 * b + c) / h**2 for a, b, c in zip(ahead, here, behind)]
        acceleration = mp.lu_solve(jac, mp.matrix([0] * n_free + list(qdd)) - mp.matrix(curve))
        multiplier = mp.lu_solve(jac.T, self.required(x, velocity, acceleration))
        return self.reactions(x, multiplier), [multiplier[n_free + k] for k in range(len(q))]

    def required(self, x, v, a):
        """Generalized force that the constraints must supply, by link: x, y, and moment about the origin."""
        out = mp.matrix(self.n, 1)
        gravity = self.complex(self.scene.get("gravity", [0, 0]))
        for i, link in enumerate(self.scene["link"]):
            turn = mp.expj(x[3 * i + 2])
            arm = self.complex(link.get("cog", [0, 0])) * turn
            centre = mp.mpc(a[3 * i], a[3 * i + 1]) + (1j * a[3 * i + 2] - v[3 * i + 2] ** 2) * arm
            force = self.number(link["mass"]) * (centre - gravity)
            moment = self.number(link["inertia"]) * a[3 * i + 2] + (mp.conj(arm) * force).imag
            for load in self.scene.get("load", []):
                owner, at, _ = self.marker(load["on"])
                if owner != i:
                    continue
                f = self.complex(load.get("force", [0, 0])) * (turn if load.get("axes") == "link" else 1)
                force -= f
                moment -= self.number(load.get("moment", 0)) + (mp.conj(at * turn) * f).imag
            out[3 * i], out[3 * i + 1], out[3 * i + 2] = force.real, force.imag, moment
        return out

    def reactions(self, x, multiplier):
        """What the first link exerts on the second at the second's marker: Fx Fy Mz."""
        result = {}
        for k, joint in enumerate(self.scene["joint"]):
            m1, m2 = multiplier[2 * k], multiplier[2 * k + 1]
            if joint["type"] == "revolute":
                result[joint["name"]] = [m1, m2, mp.mpf(0)]
            else:
                i, _, u = self.marker(joint["between"][0])
                force = 1j * m1 * u / abs(u) * mp.expj(self.angle(x, i))
                result[joint["name"]] = [force.real, force.imag, m2]
        return result


def main():
    cases = {}
    for name, (guess, positions, qd, qdd) in CASES.items():
        scene = tomllib.loads((EXAMPLES / name).read_text(encoding="utf-8"))
        mechanism = Mechanism(scene)    # the doubles that the engine reads
        states = []
        for q in positions:
            numbers = [mp.mpf(value) for value in q]
            reaction, torque = mechanism.solve(guess(numbers, scene), numbers, map(mp.mpf, qd), list(map(mp.mpf, qdd)))
            states.append({
                "q": q, "qd": qd, "qdd": qdd,
                "driving_force": [mp.nstr(t, DIGITS) for t in torque],
                "reaction": {joint: [mp.nstr(f, DIGITS) for f in r] for joint, r in reaction.items()},
            })
        cases[name] = states
    (HERE / "planar.json").write_text(json.dumps(cases, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
