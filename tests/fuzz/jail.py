"""A call in a process of its own, so that a crash or an endless loop is a finding and not the end of the search.

Limits are of computing time, not of the clock, so that they mean the same on a busy machine. After `ENOUGH` seconds the
process gets what Ctrl-C sends; a run or a sweep may be at work for as long as it likes, but has to hear that within `HEARS` more.
"""

from __future__ import annotations

import faulthandler
import math
import os
import pickle
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


def slowness() -> float:
    """How much slower than usual this machine computes: by the best of a few short loops."""
    usual = 8e-9
    """[s] an addition, about, on the machine on which a case takes hundredths of a second."""
    n = 100_000
    best = math.inf
    for _ in range(5):
        before = time.process_time()
        sum(range(n))
        best = min(best, time.process_time() - before)
    return min(max(best / (n * usual), 1.0), 10.0)


PATIENCE = float(os.environ.get("LINKDYN_FUZZ_PATIENCE", "1")) * slowness()
"""How much slower than usual this build on this machine computes."""
ENOUGH, HEARS = 2.0 * PATIENCE, 2.0 * PATIENCE
"""[s] of computing; a case takes hundredths. An interrupt is to be heard within a second."""
STUCK = 120.0 * PATIENCE
"""[s] of the clock for a process that computes nothing."""


@dataclass(frozen=True)
class Outcome:
    """How a process ended."""

    status: int
    """Exit status; negative: the signal that killed it."""
    output: str
    errors: str
    is_deaf: bool = False
    """It did not hear the interrupt."""
    is_interrupted: bool = False
    value: Any = None
    """What the function gave."""


def computed(pid: int) -> float:
    """Computing time of a process so far [s]."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except FileNotFoundError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def wait(pid: int, ended: Callable[[], int | None]) -> tuple[int, bool, bool]:
    """Exit status of a process, whether it was deaf to an interrupt, whether it was interrupted."""
    before, since, interrupted, pause = 0.0, time.monotonic(), False, 0.001
    while (status := ended()) is None:
        seconds = computed(pid)
        if seconds > ENOUGH and not interrupted:
            os.kill(pid, signal.SIGINT)
            interrupted = True
        if seconds > before:
            before, since = seconds, time.monotonic()
        if seconds > ENOUGH + HEARS or time.monotonic() - since > STUCK:
            os.kill(pid, signal.SIGKILL)
            while (status := ended()) is None:
                time.sleep(0.001)
            return status, True, interrupted
        time.sleep(pause)
        pause = min(1.5 * pause, 0.05)
    return status, False, interrupted


def call(function: Callable[[], Any]) -> Outcome:
    """Call a function in a forked process; its value comes back."""
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors, tempfile.TemporaryFile() as answer:
        sys.stdout.flush()
        sys.stderr.flush()
        pid = os.fork()
        if pid == 0:
            _child(function, output.fileno(), errors.fileno(), answer.fileno())

        def ended() -> int | None:
            found, status = os.waitpid(pid, os.WNOHANG)
            return os.waitstatus_to_exitcode(status) if found else None

        status, is_deaf, interrupted = wait(pid, ended)
        texts = []
        for file in (output, errors):
            file.seek(0)
            texts.append(file.read().decode("utf-8", errors="replace"))
        answer.seek(0)
        data = answer.read()
        return Outcome(status, *texts, is_deaf, interrupted, pickle.loads(data) if data else None)


def _child(function: Callable[[], Any], output: int, errors: int, answer: int) -> None:
    status = 70
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        os.dup2(output, 1)
        os.dup2(errors, 2)
        faulthandler.enable(open(2, "w", closefd=False))
        value = function()
        os.write(answer, pickle.dumps(value))
        status = 0
    except KeyboardInterrupt:
        status = 130
    except BaseException:  # noqa: BLE001 (what the function lets out is a fault of the fuzzer: its trace is shown)
        import traceback

        os.write(2, traceback.format_exc().encode(errors="replace"))
    finally:
        os._exit(status)


def command(words: Sequence[str | bytes | Path], folder: Path, environment: dict[str, str] | None = None) -> Outcome:
    """Run a program in a folder."""
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(
            [os.fsencode(word) for word in words], cwd=folder, stdin=subprocess.DEVNULL, stdout=output, stderr=errors,
            env=os.environ | (environment or {}),
        )  # fmt: skip
        status, is_deaf, interrupted = wait(process.pid, process.poll)
        texts = []
        for file in (output, errors):
            file.seek(0)
            texts.append(file.read(100_000).decode("utf-8", errors="replace"))
        return Outcome(status, *texts, is_deaf, interrupted)
