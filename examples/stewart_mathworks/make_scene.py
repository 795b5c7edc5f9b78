#!/usr/bin/env python3
"""Write scene.toml of the MathWorks Stewart platform from the geometry its demo is built from.

The demo (mech_stewart_control_setup.m, 2002) derives joint points, masses and inertias from radii, angles
and the density of steel; the same is done here, in 40 digits, and rounded once to double precision.
"""
from pathlib import Path

from mpmath import cos, mp, mpf, pi, radians, sin, sqrt

mp.dps = 40

BASE_RADIUS, BASE_ANGLE = mpf(3), mpf("2.5")   # m, deg to either side of 0, 120, 240
TOP_RADIUS, TOP_ANGLE = mpf(1), mpf(10)        # m, deg to either side of 60, 180, 300
HEIGHT = mpf(2)
TOP_THICKNESS = mpf("0.05")
TUBE, ROD = (mpf("0.05"), mpf("0.03")), (mpf("0.03"), mpf(0))   # outer and inner radius of the leg links
DENSITY = mpf(76000) / mpf("9.81")


def ring(radius, angle, first):
    """Six points in pairs about first, first + 120, first + 240 deg."""
    degrees = [first + 120 * k + side * angle for k in range(3) for side in (-1, 1)]
    return [(radius * cos(radians(a)), radius * sin(radians(a)), mpf(0)) for a in degrees]


def cylinder(length, outer, inner):
    """Mass, transverse and axial inertia about the centre of mass."""
    mass = pi * (outer**2 - inner**2) * length * DENSITY
    return mass, mass * (3 * (outer**2 + inner**2) + length**2) / 12, mass * (outer**2 + inner**2) / 2


def text(x):
    return repr(float(x) + 0.0)


def vector(v):
    return "[" + ", ".join(text(mp.chop(x)) for x in v) + "]"


def markers(prefix, points):
    return "\n".join(f"{prefix}{i} = {vector(p)}" for i, p in enumerate(points, 1))


def leg_link(length, radii, cog):
    mass, transverse, _ = cylinder(length, *radii)
    return (f"{{ mass = {text(mass)}, cog = {vector((0, 0, cog))}, "
            f"inertia = {{ diagonal = {vector((transverse, transverse, 0))} }}, inertia_check = false }}")


def scene():
    base = ring(BASE_RADIUS, BASE_ANGLE, 0)
    top = ring(TOP_RADIUS, TOP_ANGLE, 60)
    top = [top[5], *top[:5]]                   # leg i joins top (6, 1..5) to base (1..6)
    length = sqrt(sum((a - b) ** 2 for a, b in zip(base[0], top[0])) + HEIGHT**2)
    link_length, cog = length * 3 / 4, length * 3 / 8
    mass, transverse, axial = cylinder(TOP_THICKNESS, TOP_RADIUS, 0)
    names = lambda link, prefix: ", ".join(f'"{link}.{prefix}{i}"' for i in range(1, 7))
    return f"""\
# The Stewart platform of the MathWorks demo (Simscape / SimMechanics, 2002). Written by make_scene.py, which
# holds the geometry that these numbers come from; change that, not this.
# From rest at home, where all six forces are equal, up and to the side with a tilt, and back.
title = "Stewart platform of the MathWorks demo"
space = "spatial"
gravity = [0.0, 0.0, -9.81]

[time]
start = 0.0
end = 4.0
step = 0.01

[frame.markers]
{markers("B", base)}

# a steel disc of 1 m radius, 50 mm thick, its centre of mass in the plane of the joints
[[link]]
name = "platform"
mass = {text(mass)}
inertia = {{ diagonal = {vector((transverse, transverse, axial))} }}

[link.markers]
center = [0.0, 0.0, 0.0]
{markers("P", top)}

[[coordinate]]
link = "platform"

[coordinate.motion]
x = {{ law = "cycloidal", times = [0, 1.5, 2.5, 4], values = [0, 0.2, -0.1, 0] }}
y = {{ law = "cycloidal", times = [0, 1.5, 2.5, 4], values = [0, -0.1, 0.2, 0] }}
z = {{ law = "cycloidal", times = [0, 1.5, 2.5, 4], values = [2, 2.15, 2.05, 2] }}
roll = {{ law = "cycloidal", times = [0, 1.5, 2.5, 4], values = [0, "10 deg", "-8 deg", 0] }}
pitch = {{ law = "cycloidal", times = [0, 1.5, 2.5, 4], values = [0, "-6 deg", "8 deg", 0] }}
yaw = {{ law = "cycloidal", times = [0, 1.5, 2.5, 4], values = [0, "12 deg", "-12 deg", 0] }}

# Steel tube below, steel rod above, each 3/4 of the home length {mp.nstr(length, 10)} m. Their inertia about the
# leg's own axis is left out (hence no check of the tensor): the demo's legs turn freely about a
# cylindrical joint, these do not, and without it both need the same forces.
[[chain]]
type = "UPS"
name = "leg"
base = [{names("frame", "B")}]
platform = [{names("platform", "P")}]
axis = [0.0, 1.0, 0.0]
lower = {leg_link(link_length, TUBE, cog)}
upper = {leg_link(link_length, ROD, -cog)}
actuated = true
"""


if __name__ == "__main__":
    Path(__file__).with_name("scene.toml").write_text(scene())
