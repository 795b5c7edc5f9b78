#!/usr/bin/env python3
"""The lecture's program Pidp6barpo, line by line: inverse dynamics of a six-bar linkage with crank input and slider output.

The names are the program's: MP6BARPO finds the motion of the joints, GRVP6BARPO that of the centres of mass, IDP6BARPO sets
up [A]{F} = b and solves it. Where the program calls them in a loop over 361 crank angles, the arrays here hold all of them.

    python sixbar.py [--inclined] [PICTURE]
"""

from __future__ import annotations

import argparse

import numpy as np

from linkdyn.lecture import Angle, Point, PRR_links, RRR_links, Slide, coupler_point, crank_input

GRAV = -9.805  # [m/s2]
NV = 15
"""Unknowns: two forces at each of J0 to J5; normal force and moment of the rail; driving torque."""

# Kinematic parameters (chosen: the slides show them in a figure), [m]
L = (0.3, 0.8, 0.5, 0.8)  # crank J0J1, coupler J1J2, follower J3J2, rod J5J4
GSI, ETA = (0.4, 0.06), (0.3, 0.02)  # J4 in axes J2->J1; J5 in axes of the slider
J0, J3 = Point((0.0, 0.0)), Point((-0.72, -0.21))

# Mass and inertia parameters (the slides' table): crank, coupler, follower, rod, slider
M = (4.72, 15.72, 7.86, 12.58, 5.00)  # [kg]
I = (0.0354, 0.8000, 0.1638, 0.6709, 0.0200)  # [kg m2]
GSIG, ETAG = (0.15, 0.40, 0.25, 0.40, 0.00), (0.00, 0.00, 0.05, 0.00, 0.00)  # centres of mass [m]

FE = 100.0  # against the slider [N]
RATE = 2 * np.pi  # 60 rpm


def MP6BARPO(PG: Point, psi: Angle, theta: Angle) -> tuple[list[Point], Slide]:
    """Displacement, velocity and acceleration of the joints J0 to J6 and of the slider along its rail."""
    minv = (1, 1)
    J1 = crank_input(J0, L[0], theta)
    J2 = RRR_links(J3, J1, L[2], L[1], minv[0])
    J4, _ = coupler_point(J2, J1, GSI[0], ETA[0])
    s, J6, J5 = PRR_links(J4, L[3], PG, psi, GSI[1], ETA[1], minv[1])
    return [J0, J1, J2, J3, J4, J5, J6], s


def GRVP6BARPO(J: list[Point]) -> tuple[list[Point], list[Angle]]:
    """Centres of mass and angles of the links, each in the axes from one of its joints to another."""
    ends = ((J[0], J[1]), (J[2], J[1]), (J[3], J[2]), (J[5], J[4]), (J[6], J[5]))
    found = [coupler_point(*joints, gsi, eta) for joints, gsi, eta in zip(ends, GSIG, ETAG)]
    return [point for point, _ in found], [angle for _, angle in found]


def IDP6BARPO(J: list[Point], psi: Angle, CG: list[Point], phig: list[Angle], fe: float) -> tuple[np.ndarray, np.ndarray]:
    """Matrix (N, 15, 15) and right-hand side (N, 15) of the slides, rows and columns in their order.

    Errata of the slides' matrix: link 1, column F2Y is X2 - XG1; the torque's column has its 1 in row 3; the last row
    has I4 and X6, Y6, G4.
    """
    n = len(CG[0].x)
    wa, wb = np.zeros((n, NV, NV)), np.zeros((n, NV))
    cp, sp = np.cos(psi.the), np.sin(psi.the)
    # ----- Coefficient matrix: link, and the joints whose forces act on it, with their signs
    for link, forces in enumerate((((0, 1), (1, 1)), ((1, -1), (2, 1), (4, 1)), ((2, -1), (3, 1)), ((4, -1), (5, 1)), ((5, -1),))):
        x, y, moment = 3 * link, 3 * link + 1, 3 * link + 2
        for k, sign in forces:
            wa[:, x, 2 * k] = sign
            wa[:, y, 2 * k + 1] = sign
            wa[:, moment, 2 * k] = sign * (CG[link].y - J[k].y)
            wa[:, moment, 2 * k + 1] = sign * (J[k].x - CG[link].x)
    wa[:, 12, 12] = sp
    wa[:, 13, 12] = -cp
    wa[:, 14, 12] = (CG[4].x - J[6].x) * cp + (CG[4].y - J[6].y) * sp
    wa[:, 14, 13] = 1.0
    wa[:, 2, 14] = 1.0
    # ----- Constant vector
    for link in range(5):
        wb[:, 3 * link] = M[link] * CG[link].ddx
        wb[:, 3 * link + 1] = M[link] * (CG[link].ddy - GRAV)
        wb[:, 3 * link + 2] = I[link] * phig[link].ddthe
    wb[:, 12] += fe * cp
    wb[:, 13] += fe * sp
    wb[:, 14] += fe * ((J[6].x - CG[4].x) * sp + (CG[4].y - J[6].y) * cp)
    return wa, wb


def analyse(PG: Point, psi: Angle, theta: Angle, fe: float = FE) -> dict[str, np.ndarray]:
    """Motion and forces for all crank angles.

    Returns
    -------
    dict
        "slide" (N,) [m], "joints" (7, N, 2) [m], "forces" (N, 6, 2) of J0 to J5 [N], "normal" (N,) force of the rail
        [N], "tau_j6" (N,) its moment and "tau_i" (N,) the driving torque [N m].
    """
    J, s = MP6BARPO(PG, psi, theta)
    CG, phig = GRVP6BARPO(J)
    wa, wb = IDP6BARPO(J, psi, CG, phig, fe)
    F = np.linalg.solve(wa, wb[..., np.newaxis])[..., 0]
    joints = np.array([np.broadcast_to(joint.p, (len(F), 2)) for joint in J])
    return {
        "slide": s.v,
        "joints": joints,
        "forces": F[:, :12].reshape(-1, 6, 2),
        "normal": F[:, 12],
        "tau_j6": F[:, 13],
        "tau_i": F[:, 14],
    }


def rail(inclined: bool) -> tuple[Point, Angle]:
    """The two rails of examples/sixbar_slider."""
    return (Point((0.0, 0.05)), Angle(0.2)) if inclined else (Point((0.0, 0.10)), Angle(0.0))


def draw(theta: np.ndarray, found: dict[str, np.ndarray], file: str) -> None:
    """The slides' three pictures: driving torque, output slider, joint force at J4."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 3, figsize=(12.0, 3.6), layout="constrained")
    degrees = np.degrees(theta)
    axes[0].plot(degrees, found["tau_i"])
    axes[0].set(title="(i) driving torque", ylabel="torque [N m]")
    axes[1].plot(degrees, found["normal"], label="normal force [N]")
    axes[1].plot(degrees, 10 * found["tau_j6"], label="10 x moment [N m]")
    axes[1].set(title="(ii) force and moment of the rail")
    axes[1].legend(frameon=False)
    axes[2].plot(degrees, found["forces"][:, 4, 0], label="X")
    axes[2].plot(degrees, found["forces"][:, 4, 1], label="Y")
    axes[2].plot(degrees, np.linalg.norm(found["forces"][:, 4], axis=1), "0.4", linestyle="--", label="magnitude")
    axes[2].set(title="(iii) joint force at J4", ylabel="force [N]")
    axes[2].legend(frameon=False)
    for axis in axes:
        axis.set(xlabel="crank angle [deg]", xlim=(0, 360), xticks=range(0, 361, 60))
        axis.grid(color="0.9", linewidth=0.6)
        axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(file, dpi=80)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--inclined", action="store_true", help="rail at 0.2 rad instead of level")
    parser.add_argument("picture", nargs="?", help="draw to this file")
    arguments = parser.parse_args()
    theta = Angle(np.radians(np.arange(361.0)), RATE)
    found = analyse(*rail(arguments.inclined), theta)
    print("  theta      s        J4x       J4y        F4x        F4y       F6y     tau_6     tau_i")
    for k in range(0, 361, 30):
        row = [found["slide"][k], *found["joints"][4, k], *found["forces"][k, 4]]
        row += [found["normal"][k], found["tau_j6"][k], found["tau_i"][k]]
        print(f"{k:7.1f} " + "{:9.5f} {:9.5f} {:9.5f} {:10.3f} {:10.3f} {:9.3f} {:9.4f} {:9.3f}".format(*row))
    if arguments.picture:
        draw(theta.the, found, arguments.picture)


if __name__ == "__main__":
    main()
