"""Names of the integrators of forward runs."""

CONTROLLED = ("rk8pd", "rkf45", "gbs", "seulex", "msbdf")
"""Those whose steps follow an error allowed."""
METHODS = (*CONTROLLED, "rk4")
