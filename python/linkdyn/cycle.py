"""What a run says of the machine's cycle: shaking forces, causes, energy, flywheels, bearings, points.

Every function takes a run, the Dataset of `Scene.inverse` or `Scene.forward`; ``run.linkdyn`` has them at hand, with the scene that the run keeps.
"""

from __future__ import annotations

from ._averages import shares
from ._bearings import bearing_life, plain_bearing
from ._causes import contributions
from ._energy import duty_cycle, energy, flywheel
from ._marker_motion import marker, relative_pose
from ._shaking import shaking
from ._transmissions import cylinder, motor

__all__ = [
    "bearing_life", "contributions", "cylinder", "duty_cycle", "energy", "flywheel", "marker", "motor", "plain_bearing", "relative_pose", "shaking", "shares",
]
