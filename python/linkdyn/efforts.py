"""What an actuator does in forward runs, for ``law=`` of `linkdyn.Builder.actuator`: each function gives the table of the scene file.

>>> from linkdyn import efforts
>>> efforts.pd(stiffness=900, damping=40, target="0.3 m")
{'type': 'pd', 'stiffness': 900, 'damping': 40, 'target': '0.3 m'}

q is the joint variable. Keys and defaults are those of ``[[actuator]]`` in docs/scene-file.md.
"""

from __future__ import annotations

import os
from typing import Any, Literal

from ._listing import only
from ._scene_types import Law, Quantity, Table, table_of

__all__ = ["constant", "dc_motor", "formula", "inverse", "pd", "spring_damper", "table", "valve", "voltage"]
__dir__ = only(__all__)


def inverse() -> Table:
    """What inverse dynamics of the motion asks for: the default."""
    return _effort("inverse", {})


def constant(value: Quantity, *, at: Literal["motor"] | None = None) -> Table:
    """A constant force or torque.

    Parameters
    ----------
    value
        [N, N m]
    at
        "motor": it is the motor's torque [N m], ahead of gear or screw.
    """
    return _effort("constant", locals())


def formula(value: str, *, at: Literal["motor"] | None = None) -> Table:
    """A formula of measures, laws and variables.

    Parameters
    ----------
    value
        Such as "-0.4 N*m*sign(turning)" [N, N m].
    at
        As of `constant`.
    """
    return _effort("formula", locals())


def voltage(value: Law) -> Table:
    """What a direct current motor makes of a voltage: k (value - k w)/R, with the torque constant k, resistance R and speed w of its drive.

    Parameters
    ----------
    value
        A voltage, a formula, or a table of `linkdyn.laws.table` [V].
    """
    return _effort("voltage", locals())


def spring_damper(*, stiffness: Quantity | None = None, damping: Quantity | None = None, rest: Quantity | None = None) -> Table:
    """Effort -stiffness (q - rest) - damping q'.

    Parameters
    ----------
    stiffness
        [N/m, N m/rad]
    damping
        [N s/m, N m s/rad]
    rest
        [m, rad]
    """
    return _effort("spring-damper", locals())


def pd(*, target: Law, stiffness: Quantity | None = None, damping: Quantity | None = None) -> Table:
    """Effort stiffness (target - q) + damping (target' - q').

    Parameters
    ----------
    target
        A value, or a law of `linkdyn.laws` [m, rad].
    stiffness
        [N/m, N m/rad]
    damping
        [N s/m, N m s/rad]
    """
    return _effort("pd", locals())


def dc_motor(*, n: Quantity, eta: Quantity, K_T: Quantity, K_E: Quantity, K_P: Quantity, R_a: Quantity, target: Law) -> Table:
    """A servo motor: n eta K_T (K_P (target - q) - K_E n q')/R_a.

    Parameters
    ----------
    n
        Reduction ratio; at a slide [rad/m].
    eta
        Efficiency, 0 to 1.
    K_T
        Torque constant [N m/A].
    K_E
        Back-EMF constant [V s].
    K_P
        Gain [V/rad], at a slide [V/m].
    R_a
        Resistance [ohm].
    target
        A value, or a law of `linkdyn.laws` [m, rad].
    """
    return _effort("dc-motor", locals())


def table(
    table: str | os.PathLike[str], *, column: str | None = None, time: str | None = None, interpolation: Literal["spline", "linear"] | None = None,
    over: str | None = None, argument: str | None = None, period: Quantity | None = None, at: Literal["motor"] | None = None,
) -> Table:  # fmt: skip
    """A column of a CSV file, over time or over a measure [N, N m].

    Parameters
    ----------
    table, column, time, interpolation, over, argument, period
        As of `linkdyn.laws.table`.
    at
        As of `constant`.
    """
    return _effort("table", locals())


def valve(value: Law) -> Table:
    """How far the valve of the actuator's cylinder is open.

    Parameters
    ----------
    value
        From -1 to 1, above zero the rod comes out: a number, a formula of measures, laws and variables, or a table.
    """
    return _effort("valve", locals())


def _effort(name: str, keys: dict[str, Any]) -> Table:
    return {"type": name} | table_of(keys)
