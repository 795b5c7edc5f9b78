"""Forward dynamics of three spatial mechanisms in many digits: the R-C-S-P four-bar, a slider-crank, the flyball governor.

Positions in closed form are truncated Taylor series of time (taylor.py), so that momenta and their rates come by exact
differentiation. Accelerations follow from virtual power, one equation a coordinate and no reaction; the reactions then from
the momentum balances of the bodies about the world origin. Motion is integrated by extrapolation of the modified midpoint rule
(Gragg, Bulirsch, Stoer) in 40 digits; the program stops if two step lengths differ.
"""
from __future__ import annotations

from mpmath import mp, mpf

mp.dps = 50
from stewart_oracle import momenta, placed  # noqa: E402
from taylor import (Taylor, add, columns, cross, dot, lift, matmul, mul, rates, scale, spin, sub, values)  # noqa: E402

COLUMNS = 14    # of the extrapolation: order 28


class Mechanism:
    """Bodies as functions of the coordinates, and the joints between them.

    `bodies_of(q)` takes series and gives (bodies, joints): bodies as `placed` makes them, by name; joints by name as (first
    or None for the frame, second, point, axes of force, axes of moment), in world axes at the instant. `forces(q, qd)` gives the
    wrenches applied beside gravity: (body, point, force, moment, other body or None).
    """

    def __init__(self, gravity, bodies_of, applied):
        self.gravity, self.bodies_of, self.applied = gravity, bodies_of, applied

    def series(self, q, qd, qdd):
        return [Taylor(mpf(a), mpf(b), mpf(c) / 2) for a, b, c in zip(q, qd, qdd)]

    def generalized(self, q, qd, qdd, t):
        """Generalized force that is missing for this acceleration: virtual power over every coordinate."""
        n = len(q)
        bodies, _ = self.bodies_of(self.series(q, qd, qdd))
        rate = {name: tuple(map(rates, momenta(body)[:2])) for name, body in bodies.items()}
        wrenches = self.applied(t, bodies, q, qd)
        missing = []
        for k in range(n):
            varied, _ = self.bodies_of(self.series(q, [int(j == k) for j in range(n)], [0] * n))
            total = mpf(0)
            for name, (p, h) in rate.items():
                body = varied[name]
                total += dot(rates(body["cog"]), sub(p, scale(body["mass"], self.gravity))) + dot(values(spin(body["rotation"])), h)
            for name, point, force, moment in wrenches:
                total -= self.power(varied, name, point, force, moment)
            missing.append(total)
        return missing

    @staticmethod
    def power(bodies, name, point, force, moment):
        """Of a wrench in the motion of a body."""
        body = bodies[name]
        w = values(spin(body["rotation"]))
        velocity = add(rates(body["cog"]), cross(w, sub(point, values(body["cog"]))))
        return dot(velocity, force) + dot(w, moment)

    def accelerations(self, q, qd, t):
        n = len(q)
        here = self.generalized(q, qd, [0] * n, t)
        matrix = mp.matrix(n, n)
        for k in range(n):
            for i, value in enumerate(self.generalized(q, qd, [int(j == k) for j in range(n)], t)):
                matrix[i, k] = value - here[i]
        return list(mp.lu_solve(matrix, -mp.matrix(here)))

    def reactions(self, q, qd, qdd, t):
        """By joint: force and moment of the first body on the second at the point, world axes."""
        bodies, joints = self.bodies_of(self.series(q, qd, qdd))
        row = {name: 6 * i for i, name in enumerate(bodies)}
        unknown = [(joint, f, m) for joint, (_, _, _, forces, moments) in joints.items()
                   for f, m in [(f, NIL) for f in forces] + [(NIL, m) for m in moments]]
        matrix, right = mp.matrix(6 * len(bodies), len(unknown)), mp.matrix(6 * len(bodies), 1)
        for column, (joint, force, moment) in enumerate(unknown):
            first, second, point, _, _ = joints[joint]
            for name, sign in ((first, -1), (second, 1)):
                if name is not None:
                    for k, value in enumerate([*force, *add(cross(point, force), moment)]):
                        matrix[row[name] + k, column] += sign * value
        for name, body in bodies.items():
            p, h, _ = momenta(body)
            about_origin = add(cross(body["cog"], p), h)
            weight = scale(body["mass"], self.gravity)
            load = values(cross(body["cog"], weight))
            for k in range(3):
                right[row[name] + k] += p[k].rate - weight[k]
                right[row[name] + 3 + k] += about_origin[k].rate - load[k]
        for name, point, force, moment in self.applied(t, bodies, q, qd):
            for k, value in enumerate([*force, *add(cross(point, force), moment)]):
                right[row[name] + k] -= value
        x = mp.lu_solve(matrix, right)      # least squares: free coordinates leave more balances than unknowns, and all must hold
        assert mp.norm(matrix * x - right) < mpf(10) ** -20 * (1 + mp.norm(right)), "the accelerations are not those of free motion"
        out = {joint: [mpf(0)] * 6 for joint in joints}
        for value, (joint, force, moment) in zip(x, unknown):
            out[joint] = add(out[joint], scale(value, [*force, *moment]))
        return out


NIL = [mpf(0)] * 3
WORLD = [[mpf(int(i == j)) for j in range(3)] for i in range(3)]


def extrapolate(rate, y, t, length):
    """One step of Gragg, Bulirsch and Stoer."""
    table = []
    for j in range(1, COLUMNS + 1):
        n = 2 * j
        h = length / n
        last, here = y, [a + h * b for a, b in zip(y, rate(t, y))]
        for i in range(1, n):
            last, here = here, [a + 2 * h * b for a, b in zip(last, rate(t + i * h, here))]
        new = [[(a + b + h * c) / 2 for a, b, c in zip(last, here, rate(t + length, here))]]
        for k in range(1, j):
            coarse, fine = (j - k) ** 2, j**2 - (j - k) ** 2
            new.append([a + (a - b) * coarse / fine for a, b in zip(new[k - 1], table[k - 1])])
        table = new
    return table[-1], max(abs(a - b) for a, b in zip(table[-1], table[-2]))


def integrate(rate, y, instants, steps_each):
    """States at the instants (the first is the start), `steps_each` steps between two of them."""
    states, worst = [list(y)], mpf(0)
    for begin, end in zip(instants, instants[1:]):
        length = (end - begin) / steps_each
        for i in range(steps_each):
            y, error = extrapolate(rate, y, begin + i * length, length)
            worst = max(worst, error)
        states.append(list(y))
    return states, worst


# ---------------------------------------------------------------------------------------- R-C-S-P four-bar
def turn_z(angle):
    c, s = angle.cos(), angle.sin()
    return [[c, -s, lift(0)], [s, c, lift(0)], [lift(0), lift(0), lift(1)]]


def rcsp(scene, torque):
    """The lecture's mechanism from its scene file; `torque(t, theta, rate)` drives the crank, None: no drive is applied."""
    links = {link["name"]: link for link in scene["link"]}
    vector = lambda v: [mpf(x) for x in v]
    frame = scene["frame"]["markers"]

    def mass_of(name):
        xx, yy, zz, xy, yz, zx = map(mpf, links[name]["inertia"])
        return {"mass": mpf(links[name]["mass"]), "cog": vector(links[name]["cog"]),
                "inertia": [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]}

    marker = lambda link, name: links[link]["markers"][name]
    direction = lambda v: [x / mp.norm(v) for x in v]
    pivot, l_p, y_p = vector(frame["R"]), vector(frame["P"]["at"]), direction(vector(frame["P"]["axis"]))
    x_p = vector(frame["P"]["x"])
    x_p = direction(sub(x_p, scale(dot(x_p, y_p), y_p)))
    axis_c = marker("crank", "C")
    radius = mpf(marker("coupler", "S")[0])
    reach = mpf(marker("output", "S")[1])
    u_c = direction(vector(axis_c["axis"]))

    def bodies_of(q):
        turned = turn_z(q[0])
        o_a = sub(pivot, mul(turned, vector(marker("crank", "R"))))
        l_c = add(o_a, mul(turned, vector(axis_c["at"])))
        u = mul(turned, u_c)
        # S = L_P + x y_P is `radius` from the line L_C + sigma u; the outer root.
        w0 = sub(l_p, l_c)
        a0, a1 = sub(w0, scale(dot(w0, u), u)), sub(y_p, scale(dot(y_p, u), u))
        half, free = dot(a0, a1), dot(a0, a0) - radius**2
        square = dot(a1, a1)
        x = ((half * half - square * free).sqrt() - half) / square
        s = add(l_p, scale(x, y_p))
        w = sub(s, l_c)
        sigma = dot(w, u)
        n = scale(lift(1) / radius, sub(w, scale(sigma, u)))
        c = add(l_c, scale(sigma, u))
        coupler = columns(n, cross(u, n), u)
        p = add(l_p, scale(x - reach, y_p))
        output = columns(list(map(lift, x_p)), list(map(lift, y_p)), list(map(lift, cross(x_p, y_p))))
        bodies = {"crank": placed(mass_of("crank"), turned, o_a), "coupler": placed(mass_of("coupler"), coupler, c),
                  "output": placed(mass_of("output"), output, p)}
        uv = values(u)
        e2 = [values(column) for column in zip(*turned)][1]
        e1 = cross(e2, uv)
        joints = {"R": (None, "crank", pivot, WORLD, WORLD[:2]),
                  "C": ("crank", "coupler", values(c), [e1, e2], [e1, e2]),
                  "S": ("coupler", "output", values(s), WORLD, []),
                  "P": (None, "output", values(p), [x_p, WORLD[2]], WORLD)}
        if torque is None:      # unknown like a reaction
            joints["drive R"] = (None, "crank", pivot, [], [WORLD[2]])
        return bodies, joints

    def applied(t, bodies, q, qd):
        return [] if torque is None else [("crank", pivot, NIL, [mpf(0), mpf(0), torque(t, q[0], qd[0])])]

    return Mechanism(vector(scene["gravity"]), bodies_of, applied)


# ---------------------------------------------------------------------------------------- spatial slider-crank
def slider_crank(scene):
    """Crank about the x direction, rod, slider on the x axis: everything from the crank's angle in closed form."""
    links = {link["name"]: link for link in scene["link"]}
    vector = lambda v: [mpf(x) for x in v]
    pivot = vector(scene["frame"]["markers"]["A"]["at"])
    arm, length = vector(links["crank"]["markers"]["B"]), mpf(links["rod"]["markers"]["C"]["at"][0])
    e_x, e_y, e_z = WORLD

    def mass_of(name):
        entry = links[name]
        inertia = [[mpf(x) * int(i == j) for j in range(3)] for i, x in enumerate(entry["inertia"]["diagonal"])]
        return {"mass": mpf(entry["mass"]), "cog": vector(entry.get("cog", [0, 0, 0])), "inertia": inertia}

    def bodies_of(q):
        c, s = q[0].cos(), q[0].sin()
        zero, one = lift(0), lift(1)
        turned = [[one, zero, zero], [zero, c, -s], [zero, s, c]]
        b = add(pivot, mul(turned, arm))
        x = b[0] + (length**2 - b[1] * b[1] - b[2] * b[2]).sqrt()
        end = [x, zero, zero]
        along = scale(1 / length, sub(end, b))
        across = cross(e_x, along)
        second = scale(lift(1) / dot(across, across).sqrt(), across)
        rod = columns(along, second, cross(along, second))
        level = columns(*(list(map(lift, e)) for e in WORLD))
        bodies = {"crank": placed(mass_of("crank"), turned, list(map(lift, pivot))), "rod": placed(mass_of("rod"), rod, b),
                  "slider": placed(mass_of("slider"), level, end)}
        joints = {"A": (None, "crank", pivot, WORLD, [e_y, e_z]),
                  "B": ("crank", "rod", values(b), WORLD, []),
                  "C": ("slider", "rod", values(end), WORLD, [cross(e_x, values(second))]),
                  "D": (None, "slider", values(end), [e_y, e_z], WORLD)}
        return bodies, joints

    return Mechanism(vector(scene["gravity"]), bodies_of, lambda t, bodies, q, qd: [])


# ---------------------------------------------------------------------------------------- flyball governor
def governor(scene):
    """Shaft, two arms, slider; coordinates: turn of the shaft, angles of the arms, height of the slider."""
    links = {link["name"]: link for link in scene["link"]}
    vector = lambda v: [mpf(x) for x in v]
    marker = lambda link, name: links[link]["markers"][name]

    def mass_of(name):
        entry = links[name]
        xx, yy, zz = vector(entry["inertia"][:3])
        nil = mpf(0)
        return {"mass": mpf(entry["mass"]), "cog": vector(entry["cog"]), "inertia": [[xx, nil, nil], [nil, yy, nil], [nil, nil, zz]]}

    springs = [(mpf(s["stiffness"]), mpf(s["damping"]), mpf(s["rest"]), *[end.split(".") for end in s["between"]])
               for s in scene["spring"]]

    def bodies_of(q):
        zero, one = lift(0), lift(1)
        shaft = turn_z(q[0])
        bodies = {"shaft": placed(mass_of("shaft"), shaft, [zero] * 3)}
        joints = {"bearing": (None, "shaft", NIL, WORLD, WORLD[:2])}
        ex, ey = ([values(column) for column in zip(*shaft)][k] for k in (0, 1))
        for name, side, angle in (("arm1", 1, q[1]), ("arm2", -1, q[2])):
            c, s = angle.cos(), angle.sin()
            local = [[side * c, zero, side * s], [zero, side * one, zero], [-s, zero, c]]
            pivot = mul(shaft, vector(marker("shaft", f"pivot{name[-1]}")["at"]))
            bodies[name] = placed(mass_of(name), matmul(shaft, local), pivot)
            along = values([row[0] for row in matmul(shaft, local)])
            joints[f"pivot{name[-1]}"] = ("shaft", name, values(pivot), WORLD, [along, cross(along, ey)])
        bodies["slider"] = placed(mass_of("slider"), shaft, [zero, zero, q[3]])
        joints["guide"] = ("shaft", "slider", values([zero, zero, q[3]]), [ex, ey], WORLD)
        return bodies, joints

    def point_of(bodies, link, name):
        body = bodies[link]
        value = marker(link, name)
        arm = sub(vector(value["at"] if isinstance(value, dict) else value), vector(links[link]["cog"]))
        return add(body["cog"], mul(body["rotation"], arm))

    def applied(t, bodies, q, qd):
        out = []
        # Only position and rate of the points are used: they do not depend on the acceleration at hand.
        for stiffness, damping, rest, a, b in springs:
            pa, pb = point_of(bodies, *a), point_of(bodies, *b)
            d = sub(pb, pa)
            length = dot(d, d).sqrt()
            pull = stiffness * (length.value - rest) + damping * length.rate
            force = scale(pull / length.value, values(d))
            out += [(a[0], values(pa), force, NIL), (b[0], values(pb), scale(-1, force), NIL)]
        return out

    return Mechanism(vector(scene["gravity"]), bodies_of, applied)


def governor_rate(scene, spin):
    """Rates of (turn, arm angle, its rate, height of the slider, its rate): Lagrange's equations written out for arms that move alike.

    The moment of momentum about the shaft is constant, so its spin follows from the angle. Numbers of gmpy2, which are quick.
    """
    from gmpy2 import cos, mpfr, sin, sqrt

    links = {link["name"]: link for link in scene["link"]}
    pivot, arm, slider = links["shaft"]["markers"]["pivot1"]["at"], links["arm1"], links["slider"]
    r, height, mass, c = (mpfr(x) for x in (pivot[0], pivot[2], arm["mass"], arm["cog"][0]))
    axial, across, _ = (mpfr(x) for x in arm["inertia"][:3])
    eye, middle, bob, g = (mpfr(x) for x in (slider["markers"]["eye1"][0], arm["markers"]["middle"][0], slider["mass"], -scene["gravity"][2]))
    fixed = mpfr(links["shaft"]["inertia"][2]) + mpfr(slider["inertia"][2])
    spring = scene["spring"][0]
    stiffness, damping, rest = (mpfr(spring[key]) for key in ("stiffness", "damping", "rest"))

    def polar(co, si):
        return fixed + 2 * (mass * (r + c * co) ** 2 + axial * si**2 + across * co**2)

    def rate(t, y):
        _, angle, angle_rate, s, s_rate = y
        co, si = cos(angle), sin(angle)
        turn = moment / polar(co, si)
        dx, dz = middle * co + r - eye, height - middle * si - s
        length = sqrt(dx * dx + dz * dz)
        stretch = (dx * (-middle * si * angle_rate) + dz * (-middle * co * angle_rate - s_rate)) / length
        pull = (stiffness * (length - rest) + damping * stretch) / length
        torque = (turn**2 * (-mass * (r + c * co) * c * si + (axial - across) * si * co) + mass * g * c * co
                  + pull * (dx * middle * si + dz * middle * co))
        return [turn, angle_rate, torque / (mass * c * c + across), s_rate, -g + 2 * pull * dz / bob]

    start = mpfr(scene["coordinate"][1]["start"]["position"])
    moment = polar(cos(start), sin(start)) * spin
    return rate
