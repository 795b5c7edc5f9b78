"""What `dir` tells of a module."""

from __future__ import annotations

from collections.abc import Callable, Sequence

__all__ = ["only"]


def only(names: Sequence[str]) -> Callable[[], list[str]]:
    """A module's ``__dir__`` that lists what there is for users, and not what that is made of."""
    return lambda: sorted(names)
