"""Truncated Taylor series in one parameter, on mpmath numbers.

A series holds the value and the first two Taylor coefficients of a quantity at t = 0, so a closed-form
position written with these numbers carries its velocity and acceleration along, exactly: no rate
formula is ever written down. Vectors are lists of three series, matrices lists of three rows.
"""
from __future__ import annotations

from mpmath import mp, mpf


class Taylor:
    """c[0] + c[1] t + c[2] t^2 + O(t^3)."""

    __slots__ = ("c",)

    def __init__(self, *c):
        self.c = [mpf(x) for x in c] + [mpf(0)] * (3 - len(c))

    @property
    def value(self):
        return self.c[0]

    @property
    def rate(self):
        return self.c[1]

    @property
    def second(self):
        """Second derivative at t = 0."""
        return 2 * self.c[2]

    def derivative(self):
        """Series of the time derivative; its last coefficient is unknown and left zero."""
        return Taylor(self.c[1], 2 * self.c[2])

    def __add__(self, other):
        other = lift(other)
        return Taylor(*(a + b for a, b in zip(self.c, other.c)))

    __radd__ = __add__

    def __neg__(self):
        return Taylor(*(-a for a in self.c))

    def __sub__(self, other):
        return self + (-lift(other))

    def __rsub__(self, other):
        return lift(other) - self

    def __mul__(self, other):
        a, b = self.c, lift(other).c
        return Taylor(a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[0] * b[2] + a[1] * b[1] + a[2] * b[0])

    __rmul__ = __mul__

    def compose(self, f, df, ddf):
        """f(self), from f and its derivatives at self.c[0]."""
        return Taylor(f, df * self.c[1], df * self.c[2] + ddf * self.c[1] ** 2 / 2)

    def __truediv__(self, other):
        x = lift(other)
        v = x.c[0]
        return self * x.compose(1 / v, -1 / v**2, 2 / v**3)

    def sqrt(self):
        r = mp.sqrt(self.c[0])
        return self.compose(r, 1 / (2 * r), -1 / (4 * r**3))

    def sin(self):
        s, c = mp.sin(self.c[0]), mp.cos(self.c[0])
        return self.compose(s, c, -s)

    def cos(self):
        s, c = mp.sin(self.c[0]), mp.cos(self.c[0])
        return self.compose(c, -s, -c)


def lift(x):
    """A number as a constant series; a series as it is."""
    return x if isinstance(x, Taylor) else Taylor(x)


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def add(*vectors):
    return [sum(c[1:], c[0]) for c in zip(*vectors)]


def sub(a, b):
    return [x - y for x, y in zip(a, b)]


def scale(k, a):
    return [k * x for x in a]


def unit(a):
    length = lift(dot(a, a)).sqrt()
    return [x / length for x in a]


def columns(x, y, z):
    """Matrix with the given columns."""
    return [list(row) for row in zip(x, y, z)]


def transpose(m):
    return [list(row) for row in zip(*m)]


def mul(m, v):
    """Matrix times vector."""
    return [dot(row, v) for row in m]


def matmul(a, b):
    return transpose([mul(a, column) for column in transpose(b)])


def derivative(v):
    """Time derivative of a vector or a matrix of series."""
    return [derivative(x) if isinstance(x, list) else x.derivative() for x in v]


def values(v):
    return [x.value for x in v]


def rates(v):
    return [x.rate for x in v]


def roll_pitch_yaw(angle):
    """R = Rx(roll) Ry(pitch) Rz(yaw) of three series."""
    (sr, cr), (sp, cp), (sy, cy) = [(lift(a).sin(), lift(a).cos()) for a in angle]
    one, nil = lift(1), lift(0)
    rx = [[one, nil, nil], [nil, cr, -sr], [nil, sr, cr]]
    ry = [[cp, nil, sp], [nil, one, nil], [-sp, nil, cp]]
    rz = [[cy, -sy, nil], [sy, cy, nil], [nil, nil, one]]
    return matmul(matmul(rx, ry), rz)


def spin(rotation):
    """Angular velocity in world axes: the axial vector of R' R^T, as a series."""
    w = matmul(derivative(rotation), transpose(rotation))
    return [w[2][1], w[0][2], w[1][0]]
