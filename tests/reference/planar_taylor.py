"""Motion of planar scenes from given forces: Lagrange's multipliers in absolute coordinates, Taylor series in time.

Nothing is shared with the engine. Every link has its own x, y, angle; every hinge two multipliers, which are the force that the
first link exerts on the second. Accelerations and multipliers solve one linear system, whose matrix and right-hand side are
power series of time: coefficient by coefficient, with one LU factorisation a step, they give the Taylor series of the motion.
Numbers are gmpy2's, 50 digits; series of 40 terms; steps are chosen so that the last terms stay below 1e-34.

Hinges only. Forces: gravity, constant loads, springs and dampers between markers or at a hinge, constant torques, DC motors.
"""
from __future__ import annotations

from operator import mul

import gmpy2
from gmpy2 import mpfr

gmpy2.get_context().precision = 168     # 50 digits
ORDER = 40
SMALL = mpfr("1e-34")


def number(x) -> mpfr:
    """A double, an mpmath number or a text, without loss."""
    return mpfr(x) if isinstance(x, (float, int)) else mpfr(str(x))


def product(a: list, b: list, k: int):
    """Coefficient k of a*b."""
    return sum(map(mul, a[: k + 1], b[k::-1]), mpfr(0))


class Body:
    """A link: series of its centre of mass and angle, of the sine and cosine, of its rate, and of its arms."""

    def __init__(self, mass, inertia):
        self.mass, self.inertia = mass, inertia
        self.points = []            # (x, y) from the centre of mass, link axes
        self.arms = []              # their series, world axes

    def point(self, x, y) -> int:
        self.points.append((x, y))
        return len(self.points) - 1

    def start(self, position, velocity):
        self.x, self.y, self.angle = ([p, v] for p, v in zip(position, velocity))
        self.cos, self.sin = [gmpy2.cos(self.angle[0])], [gmpy2.sin(self.angle[0])]
        self.spin, self.spin2 = [velocity[2]], [velocity[2] ** 2]
        self.arms = [([c[0]], [c[1]]) for c in (self.turned(p, 0) for p in self.points)]

    def turned(self, point, k):
        return point[0] * self.cos[k] - point[1] * self.sin[k], point[0] * self.sin[k] + point[1] * self.cos[k]

    def extend(self, k):
        """Coefficients k >= 1 of what follows from the angle's coefficients up to k + 1."""
        rate = [j * c for j, c in enumerate(self.angle[: k + 1])]
        self.cos.append(-product(rate[1:], self.sin, k - 1) / k)
        self.sin.append(product(rate[1:], self.cos, k - 1) / k)
        self.spin.append((k + 1) * self.angle[k + 1])
        self.spin2.append(product(self.spin, self.spin, k))
        for point, arm in zip(self.points, self.arms):
            for series, c in zip(arm, self.turned(point, k)):
                series.append(c)


class Fixed:
    """The frame, seen as a body that rests."""

    def __init__(self):
        self.points = []

    def point(self, x, y) -> int:
        self.points.append((x, y))
        return len(self.points) - 1


class Run:
    """A scene (the content of its file) under way."""

    def __init__(self, scene: dict):
        self.scene = scene
        self.frame = Fixed()
        self.bodies = [Body(number(link["mass"]), number(link["inertia"])) for link in scene["link"]]
        self.index = {link["name"]: i for i, link in enumerate(scene["link"])}
        self.gravity = [number(g) for g in scene.get("gravity", [0, 0])]
        self.joints = [(joint["name"], *map(self.attach, joint["between"])) for joint in scene["joint"]]
        self.loads = [(self.attach(load["on"]), [number(f) for f in load.get("force", [0, 0])], number(load.get("moment", 0)))
                      for load in scene.get("load", [])]
        self.springs = [Spring(self, spring) for spring in scene.get("spring", [])]
        self.drives = [Drive(self, actuator) for actuator in scene.get("actuator", [])]
        self.size = 3 * len(self.bodies) + 2 * len(self.joints)
        self.time = mpfr(0)

    def attach(self, name: str):
        """(body or frame, number of the point)."""
        link, marker = name.split(".")
        if link == "frame":
            value = self.scene["frame"]["markers"][marker]
            return self.frame, self.frame.point(*map(number, value))
        entry = self.scene["link"][self.index[link]]
        value = [number(m) - number(c) for m, c in zip(entry["markers"][marker], entry["cog"])]
        return self.bodies[self.index[link]], self.bodies[self.index[link]].point(*value)

    def hinge(self, name: str):
        """First and second body of a joint."""
        return next((a[0], b[0]) for joint, a, b in self.joints if joint == name)

    def start(self, position, velocity):
        """position, velocity: (x, y, angle) of each link's origin, from which those of the centres follow."""
        for body, link, p, v in zip(self.bodies, self.scene["link"], position, velocity):
            cx, cy = map(number, link["cog"])
            c, s = gmpy2.cos(p[2]), gmpy2.sin(p[2])
            ax, ay = cx * c - cy * s, cx * s + cy * c
            body.start([p[0] + ax, p[1] + ay, p[2]], [v[0] - v[2] * ay, v[1] + v[2] * ax, v[2]])

    def row_of(self, body) -> int:
        return 3 * self.bodies.index(body)

    def entries(self):
        """The matrix: constants as numbers, varying entries as (sign, series)."""
        constant, varying = [], []
        for i, body in enumerate(self.bodies):
            for k, value in enumerate((body.mass, body.mass, body.inertia)):
                constant.append((3 * i + k, 3 * i + k, value))
        for j, (_, first, second) in enumerate(self.joints):
            column = 3 * len(self.bodies) + 2 * j
            for sign, (body, point) in ((1, second), (-1, first)):
                if body is self.frame:
                    continue
                row, (ax, ay) = self.row_of(body), body.arms[point]
                for k in (0, 1):    # m a - force = ..., and the same numbers, transposed: gap" = 0
                    constant.append((row + k, column + k, mpfr(-sign)))
                    constant.append((column + k, row + k, mpfr(sign)))
                for k, factor, series in ((0, 1, ay), (1, -1, ax)):
                    varying.append((row + 2, column + k, sign * factor, series))
                    varying.append((column + k, row + 2, -sign * factor, series))
        return constant, varying

    def right(self, k: int) -> list:
        """Coefficient k of the right-hand side."""
        out = [mpfr(0)] * self.size
        for body in self.bodies if k == 0 else ():
            row = self.row_of(body)
            out[row], out[row + 1] = (body.mass * g for g in self.gravity)
        for (body, point), force, moment in self.loads:
            self.push(out, body, body.arms[point], force, moment, k)
        for item in (*self.springs, *self.drives):
            item.act(out, k)
        for j, (_, first, second) in enumerate(self.joints):
            row = 3 * len(self.bodies) + 2 * j
            for sign, (body, point) in ((1, second), (-1, first)):
                if body is not self.frame:
                    for axis in (0, 1):
                        out[row + axis] += sign * product(body.spin2, body.arms[point][axis], k)
        return out

    def push(self, out, body, arm, force, moment, k):
        """Add a constant force at an arm and a constant moment."""
        row = self.row_of(body)
        if k == 0:
            out[row], out[row + 1] = out[row] + force[0], out[row + 1] + force[1]
            out[row + 2] += moment
        out[row + 2] += arm[0][k] * force[1] - arm[1][k] * force[0]

    def expand(self):
        """Taylor series of all poses and reactions at the present instant."""
        constant, varying = self.entries()
        matrix = [[mpfr(0)] * self.size for _ in range(self.size)]
        for i, j, value in constant:
            matrix[i][j] += value
        for i, j, sign, series in varying:
            matrix[i][j] += sign * series[0]
        factors = Factors(matrix)
        unknown = [[] for _ in range(self.size)]
        for k in range(ORDER - 1):
            if k:
                for body in self.bodies:
                    body.extend(k)
            right = self.right(k)
            for i, j, sign, series in varying if k else ():
                right[i] -= sign * sum(map(mul, series[1 : k + 1], unknown[j][k - 1 :: -1]), mpfr(0))
            for value, series in zip(factors.solve(right), unknown):
                series.append(value)
            for i, body in enumerate(self.bodies):
                for axis, series in enumerate((body.x, body.y, body.angle)):
                    series.append(unknown[3 * i + axis][k] / ((k + 1) * (k + 2)))
        self.unknown = unknown

    def longest_step(self):
        """How far the series reach."""
        series = [s for body in self.bodies for s in (body.x, body.y, body.angle)]
        steps = []
        for n in (ORDER, ORDER - 1):
            largest = max(abs(s[n]) for s in series)
            if largest:
                steps.append((SMALL / largest) ** (mpfr(1) / n))
        return min(steps)

    def advance(self, until):
        """Step to the instant `until`; series are those at it afterwards."""
        while self.time < until:
            self.expand()
            step = min(self.longest_step(), until - self.time)
            for body in self.bodies:
                state = [(horner(s, step), horner([k * c for k, c in enumerate(s)][1:], step))
                         for s in (body.x, body.y, body.angle)]
                body.start([p for p, _ in state], [v for _, v in state])
            self.time = until if step == until - self.time else self.time + step
        self.expand()

    def state(self) -> dict:
        """Coordinates (joint angles), rates, accelerations, driving forces and reactions at the present instant."""
        def angle(joint, k):
            first, second = self.hinge(joint)
            return (second.angle[k] - (0 if first is self.frame else first.angle[k])) * (2 if k == 2 else 1)
        names = [c["joint"] for c in self.scene["coordinate"]]
        offset = 3 * len(self.bodies)
        return {"t": self.time, **{key: [angle(n, k) for n in names] for k, key in enumerate(("q", "qd", "qdd"))},
                "driving_force": [drive.torque(0) for drive in self.drives],
                "reaction": {name: [self.unknown[offset + 2 * j][0], self.unknown[offset + 2 * j + 1][0], mpfr(0)]
                             for j, (name, _, _) in enumerate(self.joints)},
                "pose": {link["name"]: [body.x[0], body.y[0], body.angle[0]]
                         for link, body in zip(self.scene["link"], self.bodies)}}

    def energy(self):
        """Kinetic energy, and potential energy of gravity and springs."""
        kinetic = sum((b.mass * (b.x[1] ** 2 + b.y[1] ** 2) + b.inertia * b.angle[1] ** 2) / 2 for b in self.bodies)
        weight = -sum(b.mass * (self.gravity[0] * b.x[0] + self.gravity[1] * b.y[0]) for b in self.bodies)
        return kinetic, weight + sum((s.energy() for s in self.springs), mpfr(0))


class Drive:
    """Torque of an actuator at a hinge."""

    def __init__(self, run, actuator):
        self.run = run
        self.first, self.second = run.hinge(actuator["joint"])
        law = actuator["law"]
        self.kind = law["type"]
        if self.kind == "constant":
            self.value = number(law["value"])
        elif self.kind == "dc-motor":
            n, eta, kt, ke, kp, ra = (number(law[key]) for key in ("n", "eta", "K_T", "K_E", "K_P", "R_a"))
            self.stiffness, self.damping = n * eta * kt * kp / ra, n * eta * kt * ke * n / ra
            self.target = number(law["target"])
        else:
            raise ValueError(self.kind)

    def torque(self, k):
        if self.kind == "constant":
            return self.value if k == 0 else mpfr(0)
        angle, rate = self.second.angle[k], (k + 1) * self.second.angle[k + 1]
        if self.first is not self.run.frame:
            angle, rate = angle - self.first.angle[k], rate - (k + 1) * self.first.angle[k + 1]
        return self.stiffness * ((self.target if k == 0 else 0) - angle) - self.damping * rate

    def act(self, out, k):
        turn(self.run, out, self.first, self.second, self.torque(k))


def turn(run, out, first, second, torque):
    out[run.row_of(second) + 2] += torque
    if first is not run.frame:
        out[run.row_of(first) + 2] -= torque


class Spring:
    """Between two markers, the first on the frame, or a damper and spring at a hinge."""

    def __init__(self, run, spring):
        self.run = run
        self.stiffness, self.damping, self.rest = (number(spring.get(key, 0)) for key in ("stiffness", "damping", "rest"))
        self.joint = spring.get("joint")
        if self.joint:
            self.ends = run.hinge(self.joint)
        else:
            (frame, a), self.end = map(run.attach, spring["between"])
            assert frame is run.frame and self.damping == 0
            self.anchor = run.frame.points[a]

    def act(self, out, k):
        run = self.run
        if self.joint:
            first, second = self.ends
            angle, rate = second.angle[k], (k + 1) * second.angle[k + 1]
            if first is not run.frame:
                angle, rate = angle - first.angle[k], rate - (k + 1) * first.angle[k + 1]
            turn(run, out, first, second, -self.stiffness * (angle - (self.rest if k == 0 else 0)) - self.damping * rate)
            return
        body, point = self.end
        if k == 0:
            self.d, self.square, self.length, self.pull, self.force = ([], []), [], [], [], ([], [])
        for axis, centre in enumerate((body.x, body.y)):
            self.d[axis].append(centre[k] + body.arms[point][axis][k] - (self.anchor[axis] if k == 0 else 0))
        self.square.append(product(self.d[0], self.d[0], k) + product(self.d[1], self.d[1], k))
        if k == 0:
            self.length.append(gmpy2.sqrt(self.square[0]))
            self.pull.append(-self.stiffness * (1 - self.rest / self.length[0]))
        else:
            inner = sum(map(mul, self.length[1:k], self.length[k - 1 : 0 : -1]), mpfr(0))
            self.length.append((self.square[k] - inner) / (2 * self.length[0]))
            # pull*length = -stiffness*(length - rest)
            known = sum(map(mul, self.length[1 : k + 1], self.pull[k - 1 :: -1]), mpfr(0))
            self.pull.append((-self.stiffness * self.length[k] - known) / self.length[0])
        row = run.row_of(body)
        for axis in (0, 1):
            self.force[axis].append(product(self.pull, self.d[axis], k))
            out[row + axis] += self.force[axis][k]
        ax, ay = body.arms[point]
        out[row + 2] += product(ax, self.force[1], k) - product(ay, self.force[0], k)

    def energy(self):
        if self.joint:
            return mpfr(0)
        return self.stiffness * (self.length[0] - self.rest) ** 2 / 2


class Factors:
    """LU with partial pivoting, rows as sparse as they are."""

    def __init__(self, matrix):
        n = len(matrix)
        a = [row[:] for row in matrix]
        self.order = list(range(n))
        self.steps = []
        for k in range(n):
            p = max(range(k, n), key=lambda i: abs(a[i][k]))
            a[k], a[p] = a[p], a[k]
            self.order[k], self.order[p] = self.order[p], self.order[k]
            for i in range(k + 1, n):
                if a[i][k]:
                    factor = a[i][k] = a[i][k] / a[k][k]
                    row, top = a[i], a[k]
                    for j in range(k + 1, n):
                        if top[j]:
                            row[j] -= factor * top[j]
        self.lower = [[(j, a[i][j]) for j in range(i) if a[i][j]] for i in range(n)]
        self.upper = [[(j, a[i][j]) for j in range(i + 1, n) if a[i][j]] for i in range(n)]
        self.pivot = [a[i][i] for i in range(n)]

    def solve(self, right):
        x = [right[i] for i in self.order]
        for i, row in enumerate(self.lower):
            for j, value in row:
                x[i] -= value * x[j]
        for i in range(len(x) - 1, -1, -1):
            for j, value in self.upper[i]:
                x[i] -= value * x[j]
            x[i] /= self.pivot[i]
        return x


def horner(series, step):
    value = mpfr(0)
    for c in reversed(series):
        value = value * step + c
    return value
