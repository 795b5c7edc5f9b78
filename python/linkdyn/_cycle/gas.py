"""Gas in a cylinder: what flows into its chambers for a motion, and the power of what flows.

As the engine has it (fortran/model/linkdyn_cylinder_laws.f90): flows are told in the volume that the gas has at the reference pressure of ISO 6358, what
flows in is as warm as the reference, and a chamber changes by a polytropic exponent.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["REFERENCE_WORDS", "chamber_volumes", "filling_flow", "flow_power"]

Values = NDArray[np.float64]

ATMOSPHERE, REFERENCE = 101325.0, 1e5
"""[Pa], absolute"""
REFERENCE_WORDS = "in the volume at 1 bar"


def chamber_volumes(slide: Values, areas: tuple[float, float], stroke: tuple[float, float], dead: tuple[float, float]) -> tuple[Values, Values]:
    """Of the sides without and with the rod [m^3], where the slide is."""
    way = np.sign(stroke[1] - stroke[0]) * (slide - stroke[0])
    return dead[0] + areas[0] * way, dead[1] + areas[1] * (abs(stroke[1] - stroke[0]) - way)


def filling_flow(pressure: Values, pressure_rate: Values, volume: Values, swept: Values, exponent: float) -> Values:
    """What has to flow in while the piston leaves room and the pressure changes [m^3/s]: p_r Q = p A v + V p'/n.

    ``pressure`` is above the atmosphere's, ``swept`` the room A v that the piston leaves in a second.
    """
    flow: Values = ((ATMOSPHERE + pressure) * swept + volume * pressure_rate / exponent) / REFERENCE
    return flow


def flow_power(pressure: Values, flow: Values, tank: float) -> Values:
    """Power of a flow of gas above the tank's pressure [W]: p_r Q ln(p/p_tank), absolute pressures.

    The work that the gas could do on its way to the tank's pressure at the temperature of its surroundings: the "air power" of Cai, Kawashima, Kagawa,
    Power assessment of flowing compressed air, J. Fluids Eng. 128 (2006) 402-405, which has the atmosphere for tank.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        power: Values = REFERENCE * flow * np.log((ATMOSPHERE + pressure) / (ATMOSPHERE + tank))
    return power
