"""Where a marker is along a run, how fast it goes, how it accelerates; and where one link is, seen from another."""

from __future__ import annotations

import numpy as np
import xarray as xr

from .._arguments import as_known
from .._pose import quaternion_of
from ..scene import Scene
from .kinematics import link_motion, links_at_rest
from .turns import turned_on

__all__ = ["marker", "marker_names", "relative_pose"]

AXES = {2: ["x", "y"], 3: ["x", "y", "z"]}
"""In the plane and in space."""


def marker(run: xr.Dataset, name: str, scene: Scene) -> xr.Dataset:
    """Position, velocity and acceleration of a marker.

    Parameters
    ----------
    run
        Results of `Scene.inverse` or `Scene.forward`.
    name
        Link and marker, "coupler.P", or "frame.A".
    scene
        The scene that was run.

    Returns
    -------
    xarray.Dataset
        ``position`` [m], ``velocity`` [m/s], ``acceleration`` [m/s^2], world axes, each (sample, axis), with the run's time; NaN at samples
        that failed.

    Raises
    ------
    InputError
        There is no such marker; a coordinate is an angle of a spherical joint.
    """
    link, at = _place(scene, name)
    values = link_motion(scene, run).of_point(link, at)
    return _over_samples(run, scene, {
        "position": (values[0], "m", f"position of {name}, world axes"),
        "velocity": (values[1], "m/s", f"velocity of {name}, world axes"),
        "acceleration": (values[2], "m/s2", f"acceleration of {name}, world axes"),
    }, {"marker": name})


def relative_pose(run: xr.Dataset, link: str, seen_from: str, scene: Scene) -> xr.Dataset:
    """Where a link is, seen from another.

    Parameters
    ----------
    run
        Results of `Scene.inverse` or `Scene.forward`.
    link, seen_from
        Names of links, or "frame".
    scene
        The scene that was run.

    Returns
    -------
    xarray.Dataset
        ``position`` [m] (sample, axis) of the link's origin in the axes of the other; planar ``angle`` [rad] (sample) by which it is turned
        against the other, going on from sample to sample along a motion; spatial ``rotation`` (sample, axis, link_axis) that takes the
        link's axes to the other's, and ``quaternion`` (sample, quaternion_component) w x y z, the same, w not negative.

    Raises
    ------
    InputError
        There is no such link.
    """
    known = ["frame", *scene.links]
    here = known.index(as_known("relative_pose: link", link, known, "link"))
    there = known.index(as_known("relative_pose: seen_from", seen_from, known, "link"))
    motion = links_at_rest(scene, run)
    back = np.swapaxes(motion.rotation[:, there], 1, 2)
    position = (back @ (motion.position[:, here] - motion.position[:, there])[..., np.newaxis])[..., 0]
    rotation = back @ motion.rotation[:, here]
    words = f"of {link}, seen from {seen_from}"
    found = _over_samples(run, scene, {"position": (position, "m", f"position {words}")}, {"link": link, "seen_from": seen_from})
    failed = run.status.values != 0 if "status" in run else np.zeros(len(rotation), dtype=bool)
    found.position.values[failed] = np.nan
    rotation[failed] = np.nan
    if scene.planar:
        angle = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
        good = ~failed
        if "time" in run.coords and {"qd", "qdd"} <= set(run.data_vars):
            spin = link_motion(scene, run).spin[good, :, 2]
            angle[good] = turned_on(angle[good], spin[:, here] - spin[:, there], run.time.values[good])
        elif "time" in run.coords:
            angle[good] = np.unwrap(angle[good])
        found["angle"] = ("sample", angle, {"units": "rad", "long_name": f"angle {words}"})
    else:
        found["rotation"] = (("sample", "axis", "link_axis"), rotation, {"units": "1", "long_name": f"rotation {words}"})
        quaternion = quaternion_of(rotation)
        found["quaternion"] = (("sample", "quaternion_component"), quaternion, {"units": "1", "long_name": f"the same as quaternion {words}"})
        found = found.assign_coords(link_axis=AXES[3], quaternion_component=list("wxyz"))
    return found


def marker_names(scene: Scene) -> list[str]:
    """Of the frame and of all links."""
    return [f"{link['name']}.{marker['name']}" for link in scene.description["links"] for marker in link["markers"]]


def _place(scene: Scene, name: str) -> tuple[int, list[float]]:
    """Link and place in its axes."""
    as_known("marker: name", name, marker_names(scene), "marker")
    return next(
        (k, marker["at"])
        for k, link in enumerate(scene.description["links"])
        for marker in link["markers"]
        if f"{link['name']}.{marker['name']}" == name
    )


def _over_samples(run: xr.Dataset, scene: Scene, values: dict[str, tuple[np.ndarray, str, str]], attributes: dict[str, str]) -> xr.Dataset:
    """Vectors at every sample, with the run's clock."""
    axes = AXES[2 if scene.planar else 3]
    clock = {"time": run.time} if "time" in run.coords else {}
    return xr.Dataset(
        {name: (("sample", "axis"), array[:, : len(axes)].copy(), {"units": unit, "long_name": words}) for name, (array, unit, words) in values.items()},
        {**clock, "axis": axes},
        attributes,
    )
