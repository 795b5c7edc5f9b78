"""Five 6-UPS platforms, as exact decimals, and the numbers printed for four of them.

Each platform is a dict: gravity, base and platform joint points, the first universal axis u of each
leg (in base axes), bodies (mass, cog and inertia about the cog, in the link's own axes), the platform's
point on which wrenches act (`load_point`, `wrench_on` its name in the example's scene), states, and
`published`: state name -> (printed driving forces, where from). Lengths in m, masses in kg.
The fifth platform is the drilling table of the main example, not published anywhere.
Leg axes: z = unit vector from U to S, y = unit(z x u), x = y x z; lower has its origin at U, upper at S.
"""
from __future__ import annotations

import random

from mpmath import mp, mpf, pi


def numbers(text):
    return [mpf(word) for word in text.split()]


def diagonal(a, b, c):
    return [[mpf(a), mpf(0), mpf(0)], [mpf(0), mpf(b), mpf(0)], [mpf(0), mpf(0), mpf(c)]]


def body(mass, cog, inertia):
    return {"mass": mpf(mass), "cog": [mpf(x) for x in cog], "inertia": inertia}


def thin_rod(mass, cog_z, transverse):
    """A leg link whose inertia about its own axis is neglected."""
    return body(mass, [0, 0, cog_z], diagonal(transverse, transverse, 0))


CENTER = {"wrench_on": "platform.center", "load_point": [mpf(0)] * 3}


def state(name, position=(0, 0, 0), angles=(0, 0, 0), velocity=(0, 0, 0), angular_rates=(0, 0, 0),
          acceleration=(0, 0, 0), angular_accelerations=(0, 0, 0), wrench=(0, 0, 0, 0, 0, 0)):
    """A pose with its first and second time derivatives: x y z roll pitch yaw; wrench in world axes.

    Everything is rounded to double precision here, so that a program in double precision can be given
    exactly the input that the reference was computed for.
    """
    join = lambda a, b: [float(x) for x in (*a, *b)]
    return {"name": name, "q": join(position, angles), "qd": join(velocity, angular_rates),
            "qdd": join(acceleration, angular_accelerations), "wrench": [float(x) for x in wrench]}


def random_states(seed, home, reach, turn, force, moment, count):
    """Poses about `home` in fast motion, every second one with a wrench; four decimals."""
    draw = random.Random(seed)
    pick = lambda size, n=3: [round(draw.uniform(-size, size), 4) for _ in range(n)]
    states = []
    for i in range(1, count + 1):
        position = [round(h + d, 4) for h, d in zip(home, pick(reach))]
        loaded = [round(x, 1) for x in pick(force) + pick(moment)] if i % 2 == 0 else [0] * 6
        states.append(state(f"random {i}", position, pick(turn), pick(0.8), pick(1.2), pick(6.0), pick(9.0),
                            loaded))
    return states


# ------------------------------------------------------------------------------------------------ Tsai
def tsai():
    """Tsai, J. Mech. Des. 122(1) (2000) 3-9; numbers of the checkpoints computed twice for this project."""
    rod = mpf(1) / 160
    w = mpf(3)

    def pattern_1(name, wt):
        s, c = mpf("0.2") * mp.sin(wt), mpf("0.2") * mp.cos(wt)
        return state(name, (-1.5 + s, s, 1 + s), velocity=[w * c] * 3, acceleration=[-w**2 * s] * 3)

    def pattern_2(name, wt):
        amplitude = pi / 6
        return state(name, (-1.5, 0, 1), (0, 0, amplitude * mp.sin(wt)),
                     angular_rates=(0, 0, amplitude * w * mp.cos(wt)),
                     angular_accelerations=(0, 0, -amplitude * w**2 * mp.sin(wt)))

    table = {
        "pattern 1, wt = 0": (0, "7.2467905131 7.2513941658 7.2244335907 7.2158614268 7.2473780508 7.2513395972"),
        "pattern 1, wt = pi/4": (pi / 4, "4.8593887357 7.2760636374 3.1712395702 2.3479220288 7.8003382184 6.2382708839"),
        "pattern 1, wt = pi/2": (pi / 2, "4.0830992614 7.3414642376 1.6087721603 0.4259665489 7.9779630225 5.9665120592"),
        "pattern 1, wt = 5 pi/4": (5 * pi / 4,
                                   "11.1125787996 7.3964312613 12.0637456707 12.6674488959 6.0993442134 9.1364092992"),
        "pattern 1, wt = 3 pi/2": (3 * pi / 2,
                                   "13.6044983873 7.5060078644 14.5485255802 15.2595602379 5.2213888419 10.3839837542"),
    }
    return {
        "name": "tsai",
        **CENTER,
        "gravity": numbers("0 0 -9.80665"),
        "base": [numbers(t) for t in ("-2.12 1.374 0", "-2.38 1.224 0", "-2.38 -1.224 0", "-2.12 -1.374 0",
                                      "0 -0.15 0", "0 0.15 0")],
        "platform": [numbers(t) for t in ("0.17 0.595 -0.4", "-0.6 0.15 -0.4", "-0.6 -0.15 -0.4",
                                          "0.17 -0.595 -0.4", "0.43 -0.445 -0.4", "0.43 0.445 -0.4")],
        "axis": [numbers("0 1 0")] * 6,
        "top": body("1.5", [0, 0, 0], diagonal("0.08", "0.08", "0.08")),
        "lower": [thin_rod("0.1", "0.5", rod)] * 6,
        "upper": [thin_rod("0.1", "-0.5", rod)] * 6,
        "states": [pattern_1(name, wt) for name, (wt, _) in table.items()]
        + [pattern_2("pattern 2, wt = 0.3", mpf("0.3")), pattern_2("pattern 2, wt = pi/2", pi / 2)]
        + random_states(2000, (-1.5, 0.0, 1.0), 0.15, 0.3, 20, 5, 6),
        "published": {name: (forces, "computed twice for this project from Tsai's data") for name, (_, forces) in table.items()},
    }


# ------------------------------------------------------------------------------------------------ aris
ARIS_PARTS = """
p1a 1 -.62 .13 -.58 105.0 116.25 100.28 20.11015 12.2000345614 .58539
p1b 1 -.12 .53 -.58 15.0 16.25 100.28 10.11015 12.2000345614 .58539
p2a 1 -.622 .113 -.538 105.2 116.75 100.88 21.11015 11.2000345614 1.58539
p2b 1 -.621 .131 -.581 105.1 116.251 100.281 20.110151 12.20003 .585391
p3a 1.82156 -.621 .131 -.581 105.1 116.251 100.281 20.110151 12.20003 .585391
p3b .82156 -.6221 .1312 -.5812 105.12 116.2512 100.2812 20.1101512 12.3 .5853912
p4a 1.52156 -.521 .231 -.481 115.1 106.251 110.281 21.110151 13.20003 .555391
p4b 1.82756 -.621 .131 -.581 105.1 116.251 100.281 20.110151 12.20003 .585391
p5a 1.82156 -.621 .131 -.581 105.1 112.251 100.281 20.110151 12.20003 .585391
p5b 1.82156 -.521 .131 -.581 105.1 116.251 100.281 20.110151 12.20003 .585391
p6a 1.82156 -.621 .131 -.581 125.1 116.251 100.281 20.110151 12.20003 .585391
p6b 1.82156 -.621 .131 -.581 105.1 126.251 100.281 20.110151 12.20003 .585391
up  1.82156 -.651 .1313 -.5814 105.1 116.271 100.221 20.120151 12.22003 .583391
"""


def aris_body(row, leg):
    """Mass, cog, inertia about the cog from aris' ten numbers.

    A row is m, m cx, m cy, m cz and the inertia about the part's origin Ixx Iyy Izz Ixy Ixz Iyz (matrix
    entries). In a leg aris has y along the leg and z = unit(X x y); our axes are x = x, y = -z, z = y.
    """
    m, *moment = row[:4]
    xx, yy, zz, xy, xz, yz = row[4:]
    cog = [c / m for c in moment]
    about_origin = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    square = sum(c * c for c in cog)
    inertia = [[about_origin[i][j] - m * ((square if i == j else 0) - cog[i] * cog[j]) for j in range(3)]
               for i in range(3)]
    if leg:
        turn = [(0, 1), (2, -1), (1, 1)]  # our axis k is aris' axis turn[k][0], times turn[k][1]
        cog = [sign * cog[i] for i, sign in turn]
        inertia = [[a * b * inertia[i][j] for j, b in turn] for i, a in turn]
    return {"mass": m, "cog": cog, "inertia": inertia}


def aris():
    """aris, test_dynamic_model_solver.cpp, test_stewart: 13 different bodies, numbers only.

    The states come from leg lengths and their derivatives; `length_states` are turned into poses by the
    oracle's forward kinematics, started from `guess`.
    """
    rows = {words[0]: [mpf(x) for x in words[1:]] for words in (line.split() for line in ARIS_PARTS.split("\n") if line)}
    return {
        "name": "aris",
        **CENTER,
        "gravity": numbers("0 -9.8 0"),
        "base": [numbers(t) for t in ("1 0 0", "1 0 0", "0 0 1.732", "0 0 1.732", "-1 0 0", "-1 0 0")],
        "platform": [numbers(t) for t in ("0 0 -0.289", "0.25 0 0.144", "0.25 0 0.144", "-0.25 0 0.144",
                                          "-0.25 0 0.144", "0 0 -0.289")],
        "axis": [numbers("1 0 0")] * 6,
        "top": aris_body(rows["up"], leg=False),
        "lower": [aris_body(rows[f"p{i}a"], leg=True) for i in range(1, 7)],
        "upper": [aris_body(rows[f"p{i}b"], leg=True) for i in range(1, 7)],
        "length_states": [
            {"name": "aris state 1", "length": ["2"] * 6, "rate": ["0"] * 6, "acceleration": ["0"] * 6,
             "guess": "0 1.7078344386197 0.577658198650165 -2.2e-5 0 0"},
            {"name": "aris state 2", "length": "2.15 2.03 1.98 1.68 2.22 2.01".split(),
             "rate": "0.687 1.521 -0.325 0.665 1.225 -0.999".split(),
             "acceleration": "1.687 0.521 -1.325 1.665 0.225 -1.999".split(),
             "guess": "0.0674 1.6635 0.9075 0.0539 0.8287 0.2514"},
        ],
        "states": random_states(8, (0.0, 1.6, 0.6), 0.15, 0.25, 300, 100, 10),
        "published": {
            "aris state 1": ("11.3871054640557503 13.6991667810515523 -5.9717817946918421 5.582590345218188 "
                             "50.4497942853426551 41.095003074918246", "aris test_stewart, printed by its authors"),
            "aris state 2": ("2124.4812403533132965 275.7606350348426645 2757.4743715794970740 -3994.5016219944400291 "
                             "3892.2226684026377370 -4810.0920919994805445", "aris test_stewart, printed by its authors"),
        },
        # pose printed by aris for state 2 (rows of R and p) and its twist (v of the point at the ground's origin; w)
        "published_pose": numbers("0.654617242227831 -0.16813527373803 0.737025641279234 0.0674004103296998 "
                                  "0.286892301165042 0.957269694021347 -0.0364354283699648 1.66351811346172 "
                                  "-0.699406229390514 0.235298241883176 0.674881962758251 0.907546391448817"),
        "published_twist": numbers("1.54280498347778 -3.5672322648189 8.32397818500295 "
                                   "-4.13258637478804 0.22970180278509 2.06026880988204"),
    }


# ------------------------------------------------------------------------------------------------ Taghirad
def taghirad():
    """Taghirad 2013 / Oftadeh, Aref, Taghirad 2010; legs' inertia about the cog, axial part neglected."""
    ring = lambda radius, degrees: [[radius * mp.cos(mp.radians(a)), radius * mp.sin(mp.radians(a)), mpf(0)] for a in degrees]
    home = "static at (0, 0, 1)"
    away = "static at (0.25, 0.25, 1.25)"
    return {
        "name": "taghirad",
        **CENTER,
        "gravity": numbers("0 0 -9.81"),
        "base": ring(2, (0, 60, 120, 180, 240, 300)),
        "platform": ring(1, (30, 30, 150, 150, 270, 270)),
        "axis": [numbers("0 1 0")] * 6,
        "top": body("1150", [0, 0, 0], diagonal(570, 285, 285)),
        "lower": [thin_rod("85", "0.75", 16)] * 6,
        "upper": [thin_rod("22", "-0.75", "4.1")] * 6,
        "states": [state(home, (0, 0, 1)), state(away, (0.25, 0.25, 1.25))]
        + random_states(2013, (0.0, 0.0, 1.1), 0.2, 0.25, 5000, 1500, 9),
        # dynamic state given by angular velocity and acceleration vectors
        "vector_states": [{"name": "dynamic at (0.25, 0.25, 1.25)", "position": "0.25 0.25 1.25",
                           "velocity": "0.5 -0.3 0.2", "spin": "0.4 -0.2 0.3",
                           "acceleration": "1 2 3", "spin_rate": "0.1 0.2 0.3"}],
        "published": {
            home: (" ".join(["3618.6257462328"] * 6), "computed twice for this project"),
            away: ("2460.8981352025 3347.662575077 4949.4863885708 1074.4941173815 1757.7821956713 4749.3483378677",
                   "computed twice for this project"),
        },
    }


# ------------------------------------------------------------------------------------------------ MathWorks
def cylinder(density, length, outer, inner):
    """Mass, transverse and axial inertia about the cog of a round bar or tube."""
    mass = pi * (outer**2 - inner**2) * length * density
    return mass, mass * (3 * (outer**2 + inner**2) + length**2) / 12, mass * (outer**2 + inner**2) / 2


def mathworks(axial=False):
    """The MathWorks Stewart demo, from its geometry. `axial`: keep the legs' inertia about their own axis.

    It is neglected by default: the demo's legs end in universal joints and turn freely about a
    cylindrical joint, ours do not, and without that inertia both kinds of leg need the same forces.
    """
    ring = lambda radius, degrees: [[radius * mp.cos(mp.radians(a)), radius * mp.sin(mp.radians(a)), mpf(0)] for a in degrees]
    base = ring(3, [mpf(120 * k) + s * mpf("2.5") for k in range(3) for s in (-1, 1)])
    top = ring(1, [mpf(120 * k + 60 + 10 * s) for k in range(3) for s in (-1, 1)])
    top = [top[5], *top[:5]]  # leg i joins top (6, 1..5) to base (1..6)
    length = mp.sqrt(sum((a - b) ** 2 for a, b in zip(top[0], base[0])) + 4)
    density = mpf(76000) / mpf("9.81")
    mass_1, inertia_1, axial_1 = cylinder(density, length * 3 / 4, mpf("0.05"), mpf("0.03"))
    mass_2, inertia_2, axial_2 = cylinder(density, length * 3 / 4, mpf("0.03"), mpf(0))
    mass_p, inertia_p, polar_p = cylinder(density, mpf("0.05"), mpf(1), mpf(0))
    leg = lambda m, z, i, j: body(m, [0, 0, z], diagonal(i, i, j if axial else 0))
    home = "static at home"
    return {
        "name": "mathworks",
        **CENTER,
        "gravity": numbers("0 0 -9.81"),
        "base": base,
        "platform": top,
        "axis": [numbers("0 1 0")] * 6,
        "top": body(mass_p, [0, 0, 0], diagonal(inertia_p, inertia_p, polar_p)),
        "lower": [leg(mass_1, length * 3 / 8, inertia_1, axial_1)] * 6,
        "upper": [leg(mass_2, -length * 3 / 8, inertia_2, axial_2)] * 6,
        "length": length,
        "states": [state(home, (0, 0, 2))] + random_states(1993, (0.0, 0.0, 2.0), 0.2, 0.25, 4000, 1200, 10),
        "vector_states": [{"name": "dynamic at (0.2, -0.1, 2.1)", "position": "0.2 -0.1 2.1", "velocity": "0.3 0.2 -0.1",
                           "spin": "0.1 -0.2 0.3", "acceleration": "1 -2 0.5", "spin_rate": "0.4 0.5 -0.6"}],
        "published": {home: (" ".join(["4078.7836567"] * 6), "computed twice for this project")},
        # rounded in the source: mass and transverse inertia of both leg links, length, top
        "published_data": {"length": "3.15380068", "mass_1": "92.110671", "inertia_1": "43.023997",
                           "mass_2": "51.812253", "inertia_2": "24.168616", "mass_top": "1216.926818"},
    }


# ------------------------------------------------------------------------------------------------ drilling table
def drilling():
    """The worktable of examples/stewart_drilling: full tensor, offset centre of mass, an axis u for each leg, load off-centre."""
    pair = lambda x, y: [(x, y, 0), (x, -y, 0)]
    mirrored = lambda one, two, three: [pair(*one)[0], pair(*two)[0], pair(*three)[0],
                                        pair(*three)[1], pair(*two)[1], pair(*one)[1]]
    decimals = lambda points: [[mpf(str(c)) for c in p] for p in points]
    ip = numbers("310 285 420 -12.5 -9.5 18")
    axes = decimals([(0.54, 0.84, 0), (0.45, 0.89, 0), (1, -0.05, 0), (1, 0.05, 0), (-0.45, 0.89, 0), (-0.54, 0.84, 0)])
    return {
        "name": "drilling",
        "wrench_on": "platform.hole4",
        "load_point": numbers("-0.25 -0.05 0.38"),
        "gravity": numbers("0 0 -9.805"),
        "base": decimals(mirrored((1.58, 0.28), (-0.55, 1.5), (-1.03, 1.23))),
        "platform": decimals(mirrored((0.74, 0.82), (0.34, 1.05), (-1.08, 0.23))),
        "axis": [[c / mp.sqrt(sum(x * x for x in u)) for c in u] for u in axes],
        "top": body("850", ["0.08", "-0.05", "0.35"],
                    [[ip[0], ip[3], ip[5]], [ip[3], ip[1], ip[4]], [ip[5], ip[4], ip[2]]]),
        "lower": [body("45", [0, 0, "0.55"], diagonal("4.6", "4.9", "0.35"))] * 6,
        "upper": [body("18", [0, 0, "-0.6"], diagonal("2.2", "2.16", "0.06"))] * 6,
        "states": random_states(2024, (0.0, 0.0, 1.45), 0.2, 0.35, 8000, 60, 8),
        "published": {},
    }


PLATFORMS = {"tsai": tsai, "aris": aris, "taghirad": taghirad, "mathworks": mathworks, "drilling": drilling}
