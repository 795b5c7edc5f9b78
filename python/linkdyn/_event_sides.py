"""Results just before and just behind what happens in a forward run, beside those of its samples: there are its true peaks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

__all__ = ["EventSides", "event_words", "events_within"]

Values = NDArray[np.float64]


@dataclass(frozen=True)
class EventSides:
    """The events of a run that lie within its samples: of each two rows, before and behind.

    A sample has its own number; behind those of the samples come the rows of the events.
    """

    run: xr.Dataset
    events: NDArray[np.intp]
    """Numbers of the events."""
    time: Values
    """(rows,) [s]"""

    @classmethod
    def of(cls, run: xr.Dataset) -> EventSides:
        """None at all where nothing is told beside events, or samples have no time."""
        events = events_within(run) if "side" in run.dims else np.zeros(0, np.intp)
        time = np.repeat(run.event_time.values[events], 2) if events.size else np.zeros(0)
        return cls(run, events, time)

    def rows(self, name: str) -> Values:
        """(rows, ...) a result beside the events; no rows where it is not told there."""
        told = self.run.get(f"event_{name}")
        shape = self.run[name].shape[1:]
        if told is None or not self.events.size or told.dims[:2] != ("event", "side") or told.shape[2:] != shape:
            return np.zeros((0, *shape))
        values: Values = told.values[self.events]
        return values.reshape(-1, *shape)

    def behind(self, name: str) -> Values:
        """(samples + rows, ...) a result at the samples, and behind these beside the events."""
        return np.concatenate([self.run[name].values, self.rows(name)])

    def words(self, row: int) -> str:
        """ "just before impact of bumper.min" """
        side = str(self.run.side.values[row % 2])
        return f"just {side} {event_words(self.run, int(self.events[row // 2]))}"

    def in_time(self, name: str) -> xr.Dataset:
        """The run's coordinates and one of its results, with the rows of the events among the samples: where it jumps it has both ends.

        At the instant of an event the samples come first. The run itself where there are no rows.
        """
        rows = self.rows(name)
        if not len(rows):
            return self.run
        order = np.argsort(np.concatenate([self.run.time.values, self.time]), kind="stable")
        told = {"q": np.concatenate([self.run.q.values, np.repeat(self.run.event_q.values[self.events], 2, axis=0)]), name: self.behind(name)}
        time = np.concatenate([self.run.time.values, self.time])[order]
        others = {key: axis for key, axis in self.run.coords.items() if not {"sample", "event", "side"} & set(axis.dims)}
        return xr.Dataset({key: (self.run[key].dims, values[order], self.run[key].attrs) for key, values in told.items()},
                          {**others, "time": ("sample", time, self.run.time.attrs)}, self.run.attrs)


def events_within(run: xr.Dataset) -> NDArray[np.intp]:
    """Numbers of the events that lie within the run's samples; none where samples have no time."""
    if "event_time" not in run or "time" not in run.coords or not run.time.size:
        return np.zeros(0, np.intp)
    instants, time = run.event_time.values, np.atleast_1d(run.time.values)
    return np.flatnonzero((instants >= time.min()) & (instants <= time.max()))


def event_words(run: xr.Dataset, event: int) -> str:
    """What happened: "impact of bumper.min"."""
    kinds = str(run.event_kind.attrs["flag_meanings"]).split()
    return f"{kinds[int(run.event_kind.values[event])]} of {run.event.values[event]}"
