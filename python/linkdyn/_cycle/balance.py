"""Counterweights on links that turn about the frame, so that the machine shakes its foundation less.

The force of inertia on the frame is linear in the mass moments of the counterweights, so that the best ones follow in closed form; only
those for the least peak are approached step by step, with a bound that tells how near they are.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .._arguments import as_count, as_known, as_mapping, as_names, as_positive
from .._geometry.frame_motion import with_frame
from .._geometry.kinematics import LinkMotion, link_motion
from .._geometry.turns import turned_on
from ..errors import InputError
from ..scene import Scene
from .averages import good_samples, rms, shares
from .shaking import inertia_wrench

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["GOALS", "Balance", "balance"]

Vectors = NDArray[np.float64]

GOALS = ("rms", "peak", "harmonics")
NEAR_ENOUGH, MOST_STEPS = 1e-4, 20000
"""How far above its lower bound a peak may be, as a part of it, and after how many steps it is taken as it is."""
NOTHING = 1e-10
"""A force, or the effect of a counterweight, below this part of the whole is rounding."""
CLOSED = 1e-6
"""How far the force at the end of a cycle may be from that at its beginning, as a part of the largest."""


@dataclass(frozen=True, repr=False)
class Balance:
    """Counterweights, and the force of inertia on the frame without and with them."""

    scene: Scene
    time: Vectors
    """(N,) [s]"""
    links: tuple[str, ...]
    pivots: Vectors
    """(n, 3) of each link, in its axes [m]."""
    moment: Vectors
    """(n, 3) mass times distance from the pivot, in link axes [kg m]."""
    before: Vectors
    after: Vectors
    """(N, 3) force on the frame, world axes [N]."""
    weights: Vectors
    """(N,) part of the time that each sample stands for in an rms value, as everywhere in the package."""
    turns: int
    """Of the crank in the run: a harmonic is so many waves a turn."""
    goal: str
    above_least: float
    """By which part the peak may be above the least one there is; 0 of what is found in closed form."""
    is_cycle: bool = True
    """Does the force end as it begins? Else the motion has no harmonics."""
    coarse: str = ""
    """Which coordinate goes so far from sample to sample that peaks and harmonics are missed; empty: none."""

    def __repr__(self) -> str:
        weights = ", ".join(f"{link} {size:.3g} kg m" for link, size in self.counterweights.moment.items())
        peak = self.figures.loc["peak"]
        return f"<linkdyn.Balance of {self.scene.title!r}: {weights}; peak of the force of inertia {peak.before:.4g} N, with them {peak.after:.4g} N>"

    @property
    def counterweights(self) -> pd.DataFrame:
        """A row a link: ``moment`` [kg m], the product m r; ``angle`` [rad] of its direction about z from the link's x axis; ``x``, ``y``, ``z`` of the moment in link
        axes [kg m]."""
        import pandas as pd

        columns = {
            "moment": np.linalg.norm(self.moment, axis=1),
            "angle": np.arctan2(self.moment[:, 1], self.moment[:, 0]),
            **dict(zip("xyz", self.moment.T)),
        }
        return pd.DataFrame(columns, index=pd.Index(self.links, name="link"))

    @property
    def figures(self) -> pd.DataFrame:
        """Peak and rms value of the force, and of a closed cycle its first six harmonics a turn of the crank [N], ``before`` and ``after``.

        A harmonic is the root of the sum of the squares of its components' amplitudes."""
        import pandas as pd

        rows = {}
        for column, force in (("before", self.before), ("after", self.after)):
            sizes = np.linalg.norm(force, axis=1)
            found = {"peak": sizes.max(), "rms": float(rms(sizes, self.weights))}
            if self.is_cycle:
                waves = _waves(self.time, range(1, 7), self.turns)
                amplitudes = 2 * np.linalg.norm(np.einsum("hn,nk->hk", waves, force), axis=1)
                found |= {f"harmonic {h}": value for h, value in enumerate(amplitudes, start=1)}
            rows[column] = found
        return pd.DataFrame(rows)

    def with_counterweights(self, radius: dict[str, float]) -> Scene:
        """The scene with the counterweights as points on their links.

        Parameters
        ----------
        radius
            Of each link the distance [m] of its counterweight from the pivot; its mass is the moment over it.

        Raises
        ------
        InputError
            A link without a radius, a radius that is not above zero, a link of a chain or a pattern, which the scene file does not
            have by its name.
        """
        radii = as_mapping("with_counterweights: radius", radius, "distances by the names of links")
        for name in radii:
            as_known("with_counterweights: radius", name, self.links, "link")
        changes: dict[str, Any] = {}
        bodies = {link["name"]: link for link in self.scene.description["links"]}
        for name, pivot, moment in zip(self.links, self.pivots, self.moment):
            if name not in radii:
                raise InputError(f"with_counterweights: radius: there is none of {name!r}")
            arm = as_positive(f"with_counterweights: radius[{name!r}]", radii[name])
            size = float(np.linalg.norm(moment))
            if size > 0:
                changes |= _loaded(bodies[name], self.scene.planar, size / arm, pivot + moment / size * arm)
        return self.scene.with_(changes) if changes else self.scene

    def plot(self) -> Figure:
        """Hodographs of the force before and after, and its size over time."""
        from .._drawing.balance_plot import balance_plot

        return balance_plot(self)


def balance(
    scene: Scene,
    links: Iterable[str] | None = None,
    minimise: str = "rms",
    harmonics: Iterable[int] = (1,),
) -> Balance:
    """The counterweights that shake the frame least along the scene's own motion.

    What counts is the force of inertia: loads that act within the machine, as gas in a cylinder, come back to the frame, weight is constant.

    Parameters
    ----------
    scene
        With a motion that is one cycle.
    links
        That may carry a counterweight: they turn about a hinge of the frame. Default: all that do.
    minimise
        "rms", "peak" of the force's size, or "harmonics": the sum of the squares of some of its harmonics.
    harmonics
        Their numbers, 1 being one wave a turn of the crank; a wave in the whole run, if nothing in it turns on.

    Raises
    ------
    InputError
        A link that is not hinged to the frame, an unknown goal, samples that failed, for harmonics a motion that does not come back to its beginning; a frame
        that moves and accelerates the hinge of a counterweight, whose mass would count there besides mass times distance.
    """
    goal = as_known("balance: minimise", minimise, GOALS, "goal")
    hinged = _hinged(scene)
    chosen = list(hinged) if links is None else [name for name in as_names("balance: links", links).split(",") if name]
    for name in chosen:
        if name in scene.links and name not in hinged:
            raise InputError(f"balance: links: {name!r} does not turn about a hinge of the frame (expected one of {', '.join(hinged) or 'none'})")
        as_known("balance: links", name, hinged, "link")
        if chosen.count(name) > 1:
            raise InputError(f"balance: links: {name!r} stands there twice, and each would take a part of its counterweight (expected it once)")
    if not hinged:
        raise InputError("balance: no link turns about a hinge of the frame: there is no place for a counterweight")
    if not chosen:
        raise InputError(f"balance: links: names none (expected one at least of {', '.join(hinged)})")
    orders = _orders(harmonics)
    run = scene.inverse(want="joint_variable")
    if n := int((~good_samples(run)).sum()):
        raise InputError(f"balance: {n} sample{'s' if n > 1 else ''} failed (expected a motion of which all can be computed)")
    if run.sizes["sample"] < 3:
        raise InputError("balance: the scene does not move (expected coordinates with a motion)")
    seen = link_motion(scene, run)
    motion = with_frame(seen, run, "balance")
    _need_hinges_at_ease(motion, {name: hinged[name] for name in chosen})
    before = inertia_wrench(motion, run, np.zeros(3))[0]
    planes = [_across(hinged[name][2]) for name in chosen]
    effect = np.concatenate([_effect(motion, hinged[name][0], plane) for name, plane in zip(chosen, planes)], axis=2)
    above, turns = 0.0, _turns(seen, hinged, run.time.values)
    if goal == "harmonics":
        moments = _least_harmonics(run.time.values, before, effect, orders, turns)
    elif goal == "rms":
        moments = _least_squares(before, effect, _parts(run.time.values))    # so that the best does not depend on where a cycle is cut open
    else:
        moments, above = _least_peak(before, effect)
    moments[np.abs(moments) < NOTHING * np.abs(moments).max()] = 0.0
    moment = np.stack([plane.T @ moments[2 * i : 2 * i + 2] for i, plane in enumerate(planes)]) + 0.0    # no -0, whose angle is -180 degrees
    after = before + effect @ moments
    pivots = np.stack([hinged[name][1] for name in chosen])
    return Balance(scene, run.time.values, tuple(chosen), pivots, moment, before, after, shares(run), turns, goal, above, _is_closed(before),
                   str(run.attrs["coarse_sampling"]))


def _orders(harmonics: Any) -> list[int]:
    try:
        orders = sorted({as_count("balance: harmonics", order) for order in harmonics})
    except TypeError:
        raise InputError("balance: harmonics: expected whole numbers such as (1, 2)") from None
    if not orders:
        raise InputError("balance: harmonics: names none (expected one at least)")
    return orders


def _hinged(scene: Scene) -> dict[str, tuple[int, Vectors, Vectors]]:
    """Links that turn about the frame: number, pivot and axis in link axes."""
    found = {}
    for joint in scene.description["joints"]:
        if joint["type"] != "revolute" or 0 not in joint["links"]:
            continue
        side = 1 - joint["links"].index(0)
        link = scene.description["links"][joint["links"][side]]
        marker = next(marker for marker in link["markers"] if marker["name"] == joint["markers"][side])
        axis = np.array([0.0, 0.0, 1.0]) if scene.planar else np.array(marker["axis"])
        found[link["name"]] = (joint["links"][side], np.array(marker["at"]), axis / np.linalg.norm(axis))
    return found


def _need_hinges_at_ease(motion: LinkMotion, hinged: dict[str, tuple[int, Vectors, Vectors]]) -> None:
    """Refuse hinges that a moving frame accelerates: there the force of a counterweight is not by its mass moment alone, nor linear in it."""
    if not motion.scene.description["frame_moves"]:
        return
    least = NOTHING * float(np.linalg.norm(motion.acceleration, axis=2).max())
    for name, (number, pivot, _) in hinged.items():
        if (most := float(np.linalg.norm(motion.of_point(number, pivot)[2], axis=1).max())) > least:
            raise InputError(
                f"balance: links: the motion of the frame accelerates the hinge of {name!r} by up to {most:.3g} m/s2, where a counterweight's mass counts besides its "
                "mass times distance (expected a frame at rest: the scene without [frame.motion])")


def _turns(motion: LinkMotion, hinged: dict[str, tuple[int, Vectors, Vectors]], time: Vectors) -> int:
    """Whole turns of the slowest link that turns on through the run; 1 if none does."""
    found = []
    for number, _, axis in hinged.values():
        plane = _across(axis)
        arm = motion.rotation[:, number] @ plane[0]
        start = motion.rotation[0, number] @ plane.T
        rate = motion.spin[:, number] @ np.cross(start[:, 0], start[:, 1])
        angle = turned_on(np.arctan2(arm @ start[:, 1], arm @ start[:, 0]), rate, time)
        whole = round(abs(angle[-1]) / (2 * np.pi))
        if whole and abs(abs(angle[-1]) - 2 * np.pi * whole) < CLOSED:
            found.append(whole)
    return min(found, default=1)


def _across(axis: Vectors) -> Vectors:
    """(2, 3) directions square to an axis: of z, x and y."""
    first = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = first - (first @ axis) * axis
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first)])


def _effect(motion: LinkMotion, link: int, plane: Vectors) -> Vectors:
    """(N, 3, 2) force on the frame for a unit moment along each direction: minus the acceleration of its tip about the pivot."""
    spin, rate = motion.spin[:, link], motion.spin_rate[:, link]
    columns = []
    for direction in plane:
        arm = motion.rotation[:, link] @ direction
        columns.append(-np.cross(rate, arm) - np.cross(spin, np.cross(spin, arm)))
    return np.stack(columns, axis=2)


def _least_squares(force: Vectors, effect: Vectors, weights: Vectors) -> Vectors:
    """Of all moments that do equally well the smallest ones."""
    root = np.sqrt(weights)[:, np.newaxis]
    rows = (root[..., np.newaxis] * effect).reshape(-1, effect.shape[2])
    return _smallest(rows, -(root * force).reshape(-1), float(np.linalg.norm(rows)))


def _smallest(rows: Vectors, right: Vectors, scale: float) -> Vectors:
    """The least squares solution of least size; directions whose effect is rounding, seen from ``scale``, are left alone."""
    left, values, turned = np.linalg.svd(rows, full_matrices=False)
    kept = values > NOTHING * scale
    found: Vectors = turned[kept].T @ ((left.T[kept] @ right) / values[kept])
    return found


def _least_harmonics(time: Vectors, force: Vectors, effect: Vectors, orders: Sequence[int], turns: int) -> Vectors:
    if not _is_closed(force):
        raise InputError("balance: harmonics: the motion does not end as it begins (expected [time] to be one cycle)")
    if 2 * max(orders) * turns >= len(time) - 1:
        raise InputError(f"balance: harmonics: {max(orders)} waves a turn are too many for {len(time)} samples (expected fewer, or more [time] samples)")
    both = _waves(time, orders, turns)
    waves: Vectors = np.concatenate([both.real, both.imag])
    rows = np.einsum("hn,nkm->hkm", waves, effect).reshape(-1, effect.shape[2])
    whole = float(np.sqrt((effect**2).sum() / len(effect)))
    return _smallest(rows, -(waves @ force).reshape(-1), whole)


def _is_closed(force: Vectors) -> bool:
    """Does a cycle end as it begins?"""
    return bool(np.abs(force[-1] - force[0]).max() <= CLOSED * np.abs(force).max())


def _waves(time: Vectors, orders: Iterable[int], turns: int) -> NDArray[np.complex128]:
    """(order, N): what takes samples to the coefficients of so many waves a turn, by the trapezoidal rule."""
    phase = 2 * np.pi * (time - time[0]) / (time[-1] - time[0])
    turning: NDArray[np.complex128] = np.exp(np.outer(-1j * turns * np.array(list(orders)), phase))
    turning *= _parts(time)
    return turning


def _parts(time: Vectors) -> Vectors:
    """(N,) weights of the trapezoidal rule for means: both ends of a cycle are one instant, and count as one."""
    gaps = np.diff(time)
    parts: Vectors = (np.append(0.0, gaps) + np.append(gaps, 0.0)) / 2 / (time[-1] - time[0])
    return parts


def _least_peak(force: Vectors, effect: Vectors) -> tuple[Vectors, float]:
    """Lawson's algorithm: least squares whose weights grow where the force is large.

    The weighted rms value of any step is a lower bound of all peaks, so the gap to it is known.
    """
    size = float(np.linalg.norm(force, axis=1).max())
    if size == 0.0:
        return np.zeros(effect.shape[2]), 0.0
    weights = np.full(len(force), 1.0 / len(force))
    best, least, bound = np.zeros(effect.shape[2]), size, 0.0
    for _ in range(MOST_STEPS):
        moments = _least_squares(force, effect, weights)
        sizes = np.linalg.norm(force + effect @ moments, axis=1)
        if sizes.max() < least:
            best, least = moments, float(sizes.max())
        bound = max(bound, float(np.sqrt(weights @ sizes**2)))
        if least - bound <= NEAR_ENOUGH * bound or least <= NOTHING * size:
            break
        weights = weights * sizes
        weights /= weights.sum()
    return best, 0.0 if least <= NOTHING * size else (least - bound) / bound


def _loaded(link: dict[str, Any], planar: bool, mass: float, place: Vectors) -> dict[str, Any]:
    """Mass properties of a link with a point mass on it, as changes of the scene."""
    whole = link["mass"] + mass
    cog = (link["mass"] * np.array(link["cog"]) + mass * place) / whole
    xx, yy, zz, xy, yz, zx = link["inertia"]
    tensor = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
    for part, at in ((link["mass"], np.array(link["cog"])), (mass, place)):
        arm = at - cog
        tensor = tensor + part * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    path = f"link.{link['name']}"
    inertia = tensor[2, 2] if planar else [tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[1, 2], tensor[2, 0]]
    return {f"{path}.mass": whole, f"{path}.cog": (cog[:2] if planar else cog).tolist(), f"{path}.inertia": inertia}
