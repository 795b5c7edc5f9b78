"""Which slides are a cylinder with its rod, and which a block on a bar: the same in every picture."""

from __future__ import annotations

from typing import Any

__all__ = ["SLIDING", "is_telescope"]

SLIDING = ("prismatic", "cylindrical", "screw")
"""Joints whose two markers lie apart on an axis."""


def is_telescope(description: dict[str, Any], joint: dict[str, Any]) -> bool:
    """It slides between two moving links, and is driven or within a chain.

    A slide that nothing drives is a block in a guide: a slotted lever, a roller under a platform. Whether both links are slim enough is for the picture to
    say.
    """
    if joint["type"] not in SLIDING or 0 in joint["links"]:
        return False
    owner, dot, _ = joint["name"].rpartition(".")
    is_within = all(description["links"][link]["name"].startswith(owner + dot) for link in joint["links"])
    driven = {actuator["name"].partition(":")[0] for actuator in description["actuators"]}
    return bool(dot and is_within) or bool(driven & {joint["name"], f"{joint['name']}.slide"})
