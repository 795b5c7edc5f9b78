"""A live view for notebooks: sliders move the coordinates, and the forces follow at once. Needs anywidget
(``pip install linkdyn[widget]``)."""

from __future__ import annotations

import math
from typing import Any

import anywidget
import numpy as np
import traitlets
import xarray as xr
from numpy.typing import NDArray

from ._drawing.forces import force_kinds
from ._drawing.style import readable
from ._listing import only
from ._view.data import describe
from ._view.page import bundle
from .errors import InputError
from .scene import Scene

__all__ = ["Live"]
__dir__ = only(__all__)

TURN, REACH = math.pi, 0.25
"""To each side of the start a slider goes so far without a motion to tell: [rad], and part of the links' largest size."""

STEADY = ("box", "extent", "eye", "ground", "joints", "names")
"""What does not change with the position."""


class Live(anywidget.AnyWidget):
    """A mechanism to be moved by hand.

    Parameters
    ----------
    scene
        With as many actuators as coordinates.
    rates : bool
        Hold the rates and accelerations that the scene's motion begins with; default: all at rest, static forces.
    height : int
        Of the picture [px].

    Attributes
    ----------
    q : list of float
        The coordinates [m, rad]; may be set, too.
    run : xarray.Dataset
        The results in this position.

    Raises
    ------
    InputError
        The scene cannot be computed by inverse dynamics.
    UnavailableError
        The package was built without the viewer.
    """

    description = traitlets.Dict().tag(sync=True)
    block = traitlets.Bytes().tag(sync=True)
    coordinates: Any = traitlets.List().tag(sync=True)
    q = traitlets.List(traitlets.Float()).tag(sync=True)
    height = traitlets.Int(560).tag(sync=True)

    def __init__(self, scene: Scene, *, rates: bool = False, height: int = 560) -> None:
        if not isinstance(scene, Scene):
            raise InputError(f"Live: scene: expected a Scene, got {type(scene).__name__}")
        self._scene = scene
        motion = scene.motion()
        self._rates = tuple(values[:1] if rates else np.zeros_like(values[:1]) for values in motion[1:])
        self._whole = describe(scene.inverse(), scene, kinds=())[0]
        self.run = self._computed(motion[0][0])
        description, block = self._described()
        self._esm = bundle()
        super().__init__(
            description=description,
            block=block,
            coordinates=_ranges(scene, motion[0], self._whole["extent"]),
            q=motion[0][0].tolist(),
            height=height,
        )

    @traitlets.observe("q")
    def _moved(self, change: Any) -> None:
        if len(self.q) != len(self._scene.coordinates):
            raise InputError(f"Live: q: expected {len(self._scene.coordinates)} numbers, got {len(self.q)}")
        self.run = self._computed(np.array(self.q))
        if self.run.status.values[0] == 0:  # elsewhere the picture stays: there is nothing to show
            with self.hold_sync():
                self.description, self.block = self._described()

    def _computed(self, q: NDArray[np.float64]) -> xr.Dataset:
        return self._scene.inverse(q[np.newaxis], *self._rates, t=self._scene.times()[:1])

    def _described(self) -> tuple[dict[str, Any], bytes]:
        """This position, in a frame and to scales that hold for the whole motion."""
        run = self.run.assign_coords(time=("sample", self._scene.times()[:1]))
        description, block = describe(run, self._scene, kinds=force_kinds("Live", None, self._scene.planar), origin=self._whole["origin"])
        arrows = [here | {"largest": all_["largest"] or here["largest"]} for here, all_ in zip(description["arrows"], self._whole["arrows"])]
        return description | {key: self._whole[key] for key in STEADY} | {"arrows": arrows, "traces": []}, block


def _ranges(scene: Scene, q: NDArray[np.float64], extent: float) -> list[dict[str, Any]]:
    """What the sliders run over: the scene's motion with room, or a turn, or a part of the mechanism's size."""
    found = []
    for k, entry in enumerate(scene.description["coordinates"]):
        low, high = float(q[:, k].min()), float(q[:, k].max())
        least = TURN if entry["unit"] == "rad" and scene.planar else (0.3 if entry["unit"] == "rad" else REACH * extent)
        room = max(0.1 * (high - low), 0.0 if high > low else least)
        factor, unit = readable(entry["unit"], max(abs(low - room), abs(high + room)))
        found.append({"name": entry["name"], "unit": unit, "factor": factor, "low": low - room, "high": high + room})
    return found
