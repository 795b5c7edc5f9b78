"""Types of what stands in a scene file, for those who write one in Python; what is right, the engine's reader says."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypeAlias, TypedDict

import numpy as np
from numpy.typing import NDArray

__all__ = ["Brake", "Drive", "Law", "LegLink", "Marker", "Named", "Quantity", "Stiffness", "Table", "Vector", "n_copies", "plain", "table_of"]

Quantity: TypeAlias = float | str | np.number[Any]
"""A number in SI units and radians, or a text: "60 rpm", "L/2 + 12 mm"."""
Vector: TypeAlias = Sequence[Quantity] | NDArray[Any]
"""In space three, in a plane two."""
Table: TypeAlias = dict[str, Any]
Law: TypeAlias = Quantity | Mapping[str, Any]
"""A value that stays, or a table, as those that `linkdyn.laws` gives."""


class Named:
    """A part that goes by its name where the scene file has the name."""

    name: str

    def __str__(self) -> str:
        return self.name


class Marker(TypedDict, total=False):
    """A point of a link with its axes."""

    at: Vector
    axis: Vector
    x: Vector
    repeat: int
    about: str | Vector
    angles: Sequence[Quantity]
    mirror: Literal["xy", "xz", "yz"]


class Stiffness(TypedDict, total=False):
    """Of a joint: N/m along and across its axis, N m/rad about and across it."""

    radial: Quantity
    axial: Quantity
    tilt: Quantity
    torsion: Quantity


Brake = TypedDict(
    "Brake", {"torque": Quantity, "from": Quantity, "until": Quantity, "from_event": str, "until_event": str, "begins": Literal["on", "off"]}, total=False
)
"""On the shaft of a motor; the functional form, since one of its keys is a word of Python."""


class Strands(TypedDict, total=False):
    """Of a belt that stretches, each of its two."""

    stiffness: Quantity
    damping: Quantity
    pretension: Quantity


class Drive(TypedDict, total=False):
    """The motor behind an actuator."""

    ratio: Quantity
    lead: Quantity
    rotor_inertia: Quantity
    screw_inertia: Quantity
    efficiency: Quantity
    back_efficiency: Quantity
    torque_constant: Quantity
    resistance: Quantity
    inductance: Quantity
    torque_limit: Quantity
    current_limit: Quantity
    power_limit: Quantity
    torque_curve: Mapping[str, Any]
    brake: Brake
    creep_speed: Quantity


class Cylinder(TypedDict, total=False):
    """The hydraulic or pneumatic cylinder behind an actuator, and its valve."""

    bore: Quantity
    rod: Quantity
    through_rod: bool
    stroke: Sequence[Quantity]
    dead_volumes: Sequence[Quantity]
    bulk_modulus: Quantity
    air: Quantity
    gas: Mapping[str, Quantity]
    supply: Quantity
    tank: Quantity
    valve: Mapping[str, Quantity]
    leakage: Quantity
    pressures: Sequence[Quantity]


Elastic = TypedDict("Elastic", {
    "from": "str | Vector", "to": "str | Sequence[str]", "E": Quantity, "G": Quantity, "area": Quantity, "shear_area": Quantity, "I": Quantity,
    "Iy": Quantity, "Iz": Quantity, "y": Vector, "J": Quantity, "compliance": "Sequence[Sequence[float]]",
}, total=False)  # fmt: skip
"""How a link gives way: a beam from where its mass acts to its joints, by modulus and section, or a matrix [m, rad; N, N m]."""


class LegLink(TypedDict, total=False):
    """A link of a chain; ``length`` is that of cranks and rods."""

    length: Quantity
    mass: Quantity
    cog: Vector
    inertia: Quantity | Vector | Mapping[str, Vector]
    inertia_check: bool
    elastic: Elastic | Sequence[Elastic]


class WordLink(TypedDict, total=False):
    """A link of a chain that is a row of letters; ``to`` leads from its first joint to its next [m]."""

    to: Vector
    mass: Quantity
    cog: Vector
    inertia: Quantity | Vector | Mapping[str, Vector]
    inertia_check: bool
    elastic: Elastic | Sequence[Elastic]


def table_of(keys: Mapping[str, Any]) -> Table:
    """Arguments of a function as a table of the scene file: what is None is left out, ``from_`` is the key ``from``."""
    return {"from" if key == "from_" else key: plain(value) for key, value in keys.items() if value is not None}


def n_copies(table: Mapping[str, Any]) -> int:
    """How many parts a table stands for: as many as `repeat` says, else one for each of its `angles`; with images twice as many."""
    n: int = table.get("repeat", len(table.get("angles", [0])))
    return n * (2 if "mirror" in table else 1)


def plain(value: Any) -> Any:
    """As TOML has it: lists for tuples and arrays, names for links, Python's numbers for those of numpy."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value.name if isinstance(value, Named) else value
