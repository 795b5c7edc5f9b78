#!/usr/bin/env python3
"""Write scene.toml from the numbers of aris' Stewart test (13 different bodies), converted exactly.

Source: github.com/py0330/aris, test/test_dynamic/test_dynamic_model_solver.cpp, test_stewart (numbers only).
aris gives, for each part, m, m cx, m cy, m cz and the inertia about the part's ORIGIN as Ixx Iyy Izz Ixy Ixz Iyz
(matrix entries). In its legs y runs along the leg and z = unit(X x y), X the ground's x axis, which is also the first
axis of the universal joint. linkdyn wants the inertia about the centre of mass, as Ixx Iyy Izz Ixy Iyz Izx, with
z along the leg and y = unit(z x X); so x = x, y = -z, z = y of aris. All in rational numbers, rounded once.
"""
from fractions import Fraction
from pathlib import Path

PARTS = """
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
LEG_AXES = ((0, 1), (2, -1), (1, 1))   # our axis k is aris' axis [k][0] times [k][1]
OWN_AXES = ((0, 1), (1, 1), (2, 1))


def about_cog(row):
    """Mass, centre of mass and inertia about it, in aris' axes."""
    mass, *moment = row[:4]
    xx, yy, zz, xy, xz, yz = row[4:]
    tensor = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    cog = [c / mass for c in moment]
    square = sum(c * c for c in cog)
    for i in range(3):
        for j in range(3):
            tensor[i][j] -= mass * ((square if i == j else 0) - cog[i] * cog[j])
    return mass, cog, tensor


def fields(row, axes):
    """The same in our axes, as TOML values of mass, cog and inertia."""
    mass, cog, tensor = about_cog(row)
    cog = [sign * cog[k] for k, sign in axes]
    entry = lambda i, j: axes[i][1] * axes[j][1] * tensor[axes[i][0]][axes[j][0]]
    inertia = [entry(i, j) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))]
    number = lambda x: repr(float(x))
    vector = lambda v: "[" + ", ".join(number(x) for x in v) + "]"
    return number(mass), vector(cog), vector(inertia)


def body(row):
    mass, cog, inertia = fields(row, LEG_AXES)
    return f"    {{ mass = {mass}, cog = {cog}, inertia = {inertia}, inertia_check = false }},"


def scene():
    lines = [line.split() for line in PARTS.split("\n") if line]
    rows = {name: [Fraction(x) for x in values] for name, *values in lines}
    mass, cog, inertia = fields(rows["up"], OWN_AXES)
    lower = "\n".join(body(rows[f"p{i}a"]) for i in range(1, 7))
    upper = "\n".join(body(rows[f"p{i}b"]) for i in range(1, 7))
    return TEMPLATE.format(mass=mass, cog=cog, inertia=inertia, lower=lower, upper=upper)


TEMPLATE = """\
# The Stewart platform of aris' own tests: 13 different bodies with full inertia tensors. Written by make_scene.py,
# which says where the numbers come from and how they are converted; change that, not this.
# From rest in its state 1 (all legs 2 m long) to rest in the pose of its state 2. Gravity is along -y.
title = "Stewart platform of the aris tests"
space = "spatial"
gravity = [0.0, -9.8, 0.0]

[time]
start = 0.0
end = 2.0
step = 0.01

[frame.markers]
B1 = [1.0, 0.0, 0.0]
B2 = [1.0, 0.0, 0.0]
B3 = [0.0, 0.0, 1.732]
B4 = [0.0, 0.0, 1.732]
B5 = [-1.0, 0.0, 0.0]
B6 = [-1.0, 0.0, 0.0]

# synthetic tensors that no body can have: the check is off
[[link]]
name = "platform"
mass = {mass}
cog = {cog}
inertia = {inertia}
inertia_check = false

[link.markers]
center = [0.0, 0.0, 0.0]
P1 = [0.0, 0.0, -0.289]
P2 = [0.25, 0.0, 0.144]
P3 = [0.25, 0.0, 0.144]
P4 = [-0.25, 0.0, 0.144]
P5 = [-0.25, 0.0, 0.144]
P6 = [0.0, 0.0, -0.289]

# poses found from the leg lengths by Newton's method in 50 digits
[[coordinate]]
link = "platform"

[coordinate.motion]
x = {{ law = "polynomial-345", from = 0.0, to = 0.06740041032969844, duration = 2.0 }}
y = {{ law = "polynomial-345", from = 1.7078344386197044, to = 1.6635181134617252, duration = 2.0 }}
z = {{ law = "polynomial-345", from = 0.5776581986501643, to = 0.9075463914488151, duration = 2.0 }}
roll = {{ law = "polynomial-345", from = -2.2312668404361396e-05, to = 0.05393549220635385, duration = 2.0 }}
pitch = {{ law = "polynomial-345", from = 0.0, to = 0.8286589138824234, duration = 2.0 }}
yaw = {{ law = "polynomial-345", from = 0.0, to = 0.2514107230767535, duration = 2.0 }}

[[chain]]
type = "UPS"
name = "leg"
base = ["frame.B1", "frame.B2", "frame.B3", "frame.B4", "frame.B5", "frame.B6"]
platform = ["platform.P1", "platform.P2", "platform.P3", "platform.P4", "platform.P5", "platform.P6"]
axis = [1.0, 0.0, 0.0]
lower = [
{lower}
]
upper = [
{upper}
]
actuated = true
"""


if __name__ == "__main__":
    Path(__file__).with_name("scene.toml").write_text(scene())
