"""What a run says of the machine's cycle: shaking forces, causes, energy, flywheels, bearings, points.

Every function takes a run, the Dataset of `Scene.inverse` or `Scene.forward`; ``run.linkdyn`` has them at hand, with the scene that the run keeps.
"""

from __future__ import annotations

from ._cycle.averages import shares
from ._cycle.bearings import bearing_life, plain_bearing
from ._cycle.causes import contributions
from ._cycle.energy import duty_cycle, energy, flywheel
from ._cycle.shaking import shaking
from ._cycle.transmissions import cylinder, motor
from ._geometry.marker_motion import marker, relative_pose
from ._listing import only

__all__ = [
    "bearing_life", "contributions", "cylinder", "duty_cycle", "energy", "flywheel", "marker", "motor", "plain_bearing", "relative_pose", "shaking", "shares",
]
__dir__ = only(__all__)
