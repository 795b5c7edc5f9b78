"""Results that every process of a run of tests needs: each is computed by one of them, while the others compute the next."""

from __future__ import annotations

import fcntl
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np


def compute_together(folder: Path, tasks: Mapping[str, Callable[[], np.ndarray]]) -> dict[str, np.ndarray]:
    """The tasks' arrays by name, which are left in a folder that the processes share.

    What another process is at work on comes last; if it dies over it, its lock is gone with it and the task is done here.
    """
    folder.mkdir(parents=True, exist_ok=True)
    passed_over = [name for name, task in tasks.items() if not compute(folder / name, task, fcntl.LOCK_NB)]
    for name in passed_over:
        compute(folder / name, tasks[name])
    return {name: np.load(file_of(folder / name)) for name in tasks}


def compute(stem: Path, task: Callable[[], np.ndarray], waits: int = 0) -> bool:
    """Is it there, or computed now? Not if somebody else is at it and one doesn't wait."""
    with stem.with_name(f"{stem.name}.lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | waits)
        except BlockingIOError:
            return False
        if not file_of(stem).exists():
            np.save(file_of(stem), task())
    return True


def file_of(stem: Path) -> Path:
    return stem.with_name(f"{stem.name}.npy")
