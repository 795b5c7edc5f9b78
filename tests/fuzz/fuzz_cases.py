"""The cases of the fuzzer: what number i is, follows from i alone."""

from __future__ import annotations

import contextlib
import copy
import csv
import os
import random
import signal
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import linkdyn
import numpy as np
import oracle
import tomli_w
import xarray as xr
from corpus import Seed, seeds
from jail import Outcome, call, command
from linkdyn import lecture
from linkdyn.cli import executable
from mutate import ODD, WORDS, change_slightly, mutate_array, mutate_scene, mutate_table, mutate_text, shown

SOLVERS = ("elimination", "lapack", "gauss-jordan", "reduced", "gauss-jordan-plain")
METHODS = ("rk8pd", "rkf45", "gbs", "seulex", "msbdf", "rk4")
WANTS = ("driving_force", "reaction", "joint_variable", "power", "checks", "rcond", "singularity_distance", "all")
LONG = 20_000
"""Samples of a motion that are too many for one case."""
ENDLESS = "interrupted in: "
"""Said of the call that was at work for too long."""
MAY_BE_LONG = ("forward", "sweep", "ensemble")
"""Calls that a change of a scene can make as long as it likes; who makes others waits for nothing."""
DONE, BAD_INPUT, SAMPLES_FAILED, INTERRUPTED = 0, 2, 3, 130


@dataclass
class Finding:
    """Something wrong with an answer."""

    case: int
    what: str
    how: list[str] = field(default_factory=list)
    """What the case was."""

    def __str__(self) -> str:
        return "\n    ".join([f"case {self.case}: {self.what}", *self.how])


@dataclass
class Report:
    """What came of a case."""

    findings: list[Finding] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)
    calls: int = 0
    answered: int = 0
    """Calls that were not refused."""

    def __iadd__(self, other: Report) -> Report:
        self.findings += other.findings
        self.messages += other.messages
        self.calls += other.calls
        self.answered += other.answered
        return self


@dataclass
class Files:
    """A scene's folder for one case."""

    text: bytes
    tables: dict[str, bytes]

    @contextlib.contextmanager
    def folder(self) -> Iterator[Path]:
        with tempfile.TemporaryDirectory(prefix="fuzz") as name:
            for file, data in ({"scene.toml": self.text} | self.tables).items():
                (Path(name) / file).write_bytes(data)
            yield Path(name)


def run_case(number: int) -> Report:
    """Make a case and run it."""
    dice = random.Random(f"linkdyn {number}")
    kind = dice.choices((scene_case, motion_case, argument_case, command_case, lecture_case), (45, 10, 18, 21, 6))[0]
    how: list[str] = []
    outcome = kind(dice, how)
    report = outcome.value if isinstance(outcome.value, Report) else Report()
    found = [finding.what for finding in report.findings]
    if outcome.is_deaf:
        found.append("does not hear an interrupt, or hangs")
    elif outcome.is_interrupted and (endless := [line for line in outcome.errors.splitlines() if line.startswith(ENDLESS)]):
        found += [f"at work for too long: {line.removeprefix(ENDLESS)}" for line in endless]
    elif outcome.is_interrupted and outcome.status == -signal.SIGINT:
        pass  # a sweep ends by the signal itself, which a shell shows as 130
    elif outcome.status < 0:
        found.append(f"killed by signal {-outcome.status}: {outcome.errors[-1500:]}")
    elif outcome.status not in (DONE, BAD_INPUT, SAMPLES_FAILED, INTERRUPTED):
        found.append(f"exit status {outcome.status}: {outcome.errors[-1500:]}")
    if any(word in outcome.errors for word in ("runtime error", "Sanitizer", "Backtrace", "Traceback")):
        found.append(f"on standard error: {outcome.errors[-1500:]}")
    report.findings = [Finding(number, what, how) for what in dict.fromkeys(found)]
    return report


# ----------------------------------------------------------------------------------------------------------- scenes
def mutated(dice: random.Random, how: list[str]) -> Files:
    """A seed with its content, text or tables changed."""
    seed, other = dice.choice(seeds()), dice.choice(seeds())
    how.append(f"scene: {seed.name}")
    text, tables = seed.text, dict(seed.tables)
    kind = dice.random()
    if kind < 0.75:
        content = seed.content()
        how += mutate_scene(dice, content, other.content(), dice.choice((1, 1, 1, 2, 3, 5)))
        try:
            text = tomli_w.dumps(content).encode()
        except (ValueError, UnicodeEncodeError):     # a lone surrogate or the like, which no file can hold
            text = seed.text
    elif kind < 0.9 or not tables:
        text, said = mutate_text(dice, text)
        how.append(f"scene's text {said}")
    else:
        name = dice.choice(sorted(tables))
        tables[name], said = mutate_table(dice, tables[name])
        how.append(f"{name}: {said}")
    return Files(text, tables)


class Calls:
    """Calls into the package, judged one by one."""

    def __init__(self, how: list[str]) -> None:
        self.report, self.how = Report(), how

    def __call__(self, says: str, function: Callable[[], Any]) -> Any:
        """What a call gives; None if it was refused."""
        self.report.calls += 1
        try:
            value = function()
        except KeyboardInterrupt:
            if not says.startswith(MAY_BE_LONG):
                os.write(2, f"{ENDLESS}{says}\n".encode(errors="replace"))
            raise
        except Exception as error:  # noqa: BLE001 (raw exceptions are what is looked for)
            self.blame(says, oracle.raised(error))
            self.report.messages.append(f"{type(error).__name__}: {error}")
            return None
        self.report.answered += 1
        if isinstance(value, xr.Dataset):
            self.blame(says, oracle.numbers(value))
        return value

    def blame(self, says: str, wrong: Iterable[str]) -> None:
        self.report.findings += [Finding(0, f"{says}: {what}") for what in wrong]


def scene_case(dice: random.Random, how: list[str]) -> Outcome:
    """A mutated scene through everything that takes one."""
    files = mutated(dice, how)
    with files.folder() as folder:
        return call(lambda: through_everything(dice, folder, Calls(how)).report)


def through_everything(dice: random.Random, folder: Path, calls: Calls) -> Calls:
    scene = calls("load", lambda: linkdyn.load(folder / "scene.toml"))
    if scene is None:
        return calls
    report = calls("explain", lambda: scene.explain(dice.random() < 0.3))
    if report is not None and any(not character.isprintable() and character != "\n" for character in report):
        calls.blame("explain", ["unprintable characters"])
    time = scene.description["time"]
    t = np.sort(time["first"] + (time["last"] - time["first"]) * np.array([0.0, *(dice.random() for _ in range(4))]))
    run = calls("inverse", lambda: scene.inverse(t=t, error=True))
    other = calls("inverse by lapack", lambda: scene.inverse(t=t, solver="lapack", error=True))
    if run is not None and other is not None:
        calls.blame("inverse", oracle.agree(run, other))
    motion = calls("motion", lambda: scene.motion(t))
    if motion is not None:
        q, qd, qdd = motion
        calls("solve", lambda: scene.solve(q, qd, qdd, want="all"))
        poses = calls("poses", lambda: scene.poses(q, in_order=dice.random() < 0.5))
        if poses is not None and not np.isfinite(poses.position[poses.status == 0]).all():
            calls.blame("poses", ["a place that is no number beside status 0"])
    long = max(1e-6, min(10.0, abs(time["last"] - time["first"]) or 1.0))
    ahead = time["first"] + long * 10 ** -dice.uniform(0, 3) * np.linspace(0, 1, 4)
    calls("forward", lambda: scene.forward(t=ahead, method=dice.choice(METHODS), error=dice.random() < 0.2))
    if b"sweep" in (folder / "scene.toml").read_bytes():
        calls("sweep", scene.sweep)
    return calls


# ---------------------------------------------------------------------------------------------------------- motions
def motion_case(dice: random.Random, how: list[str]) -> Outcome:
    """A scene with a few other numbers, moved by its forces."""
    seed = dice.choice(seeds())
    how.append(f"scene: {seed.name}")
    content = seed.content()
    how += change_slightly(dice, content, dice.randrange(4))
    with Files(tomli_w.dumps(content).encode(), seed.tables).folder() as folder:
        return call(lambda: moved_twice(dice, folder, Calls(how)).report)


def moved_twice(dice: random.Random, folder: Path, calls: Calls) -> Calls:
    """By two methods, one of them at a tolerance that it is not used to; then by inverse dynamics."""
    scene = calls("load", lambda: linkdyn.load(folder / "scene.toml"))
    if scene is None:
        return calls
    time = scene.description["time"]
    t = time["first"] + max(1e-3, min(1.0, abs(time["last"] - time["first"]))) * 10 ** -dice.uniform(0, 2) * np.linspace(0, 1, 9)
    methods = dice.sample([method for method in METHODS if method != "rk4"], 2)     # which has no tolerance
    one = calls("forward", lambda: scene.forward(t=t, method=methods[0], error=True, want="all"))
    other = calls("forward", lambda: scene.forward(t=t, method=methods[1], error=True, want="all", rtol=1e-10, atol=1e-10))
    if one is None or other is None:
        return calls
    calls.blame("forward", oracle.motions_agree(one, other))
    good = one.status.values == 0
    # through a dead point a mechanism goes over to another assembly, which a sample on its own is not on
    if good.any() and not one.attrs["coordinates_integrated"]:
        q, qd, qdd, instants = (one[name].values[good] for name in ("q", "qd", "qdd", "time"))
        back = calls("inverse", lambda: scene.inverse(q, qd, qdd, t=instants))
        if back is not None and not back.attrs.get("other_in_order", 0):     # nor past a change point, as is told
            calls.blame("inverse after forward", oracle.returns(one, back))
    return calls


# -------------------------------------------------------------------------------------------------------- arguments
def argument_case(dice: random.Random, how: list[str]) -> Outcome:
    """An example as it is, called with arguments of which some are wrong."""
    seed = dice.choice([seed for seed in seeds() if seed.name.startswith("examples/")])
    how.append(f"scene: {seed.name}")
    with Files(seed.text, seed.tables).folder() as folder:
        return call(lambda: wrong_arguments(dice, seed, folder, Calls(how)).report)


def wrong_arguments(dice: random.Random, seed: Seed, folder: Path, calls: Calls) -> Calls:
    scene = linkdyn.load(folder / "scene.toml")
    n = dice.choice((1, 2, 3, 17, 20))
    first, last = (scene.description["time"][key] for key in ("first", "last"))
    t = np.linspace(first, last, n)
    q, qd, qdd = scene.motion(t)
    places = [f"{link['name']}.{marker}" for link in scene.description["links"] for marker in (point["name"] for point in link["markers"])]
    good: dict[str, Callable[[], Any]] = {
        "q": lambda: q,
        "qd": lambda: qd,
        "qdd": lambda: qdd,
        "t": lambda: t,
        "wrench": lambda: {dice.choice(places): np.ones((n, 3 if scene.planar else 6))},
        "want": lambda: ",".join(dice.sample(WANTS[:-1], dice.randint(1, 3))),
        "solver": lambda: dice.choice(SOLVERS),
        "threads": lambda: dice.choice((1, 2)),
        "error": lambda: dice.random() < 0.5,
        "in_order": lambda: dice.random() < 0.5,
        "joint_variable": lambda: variables_of(scene, q),
        "method": lambda: dice.choice(METHODS),
        "step": lambda: (last - first) / 100 or 0.01,
        "rtol": lambda: 1e-6,
        "atol": lambda: 1e-6,
        "switch": lambda: True,
        "t_end": lambda: first + (last - first) / 50,
        "progress": lambda: False,
        "changes": lambda: {f"link.{dice.choice(scene.links)}.mass": 2.0},
        "matrix": lambda: dice.random() < 0.5,
        "sweep": lambda: sweep_of(dice, scene, q),
        "keep": lambda: ("driving_force",),
        "source": lambda: seed.content(),
        "path": lambda: folder / "scene.toml",
        "folder": lambda: folder,
    }
    name, function, required, optional = dice.choice((
        ("inverse", scene.inverse, ("q",), ("qd", "qdd", "wrench", "t", "want", "solver", "threads", "error")),
        ("inverse", scene.inverse, (), ("t", "want", "solver", "threads", "error", "wrench")),
        ("solve", scene.solve, ("q",), ("qd", "qdd", "wrench", "t", "want", "solver", "threads", "error")),
        ("forward", scene.forward, ("t_end",), ("method", "step", "rtol", "atol", "want", "solver", "threads", "error", "switch", "progress")),
        ("forward", scene.forward, ("t",), ("method", "step", "rtol", "atol", "want", "solver", "threads", "progress")),
        ("ensemble", scene.ensemble, ("q", "qd", "t", "step"), ("threads", "progress")),
        ("poses", scene.poses, ("q",), ("in_order",)),
        ("poses", scene.poses, ("joint_variable",), ()),
        ("motion", scene.motion, ("t",), ()),
        ("load_values", scene.load_values, ("t",), ()),
        ("with_", scene.with_, ("changes",), ()),
        ("explain", scene.explain, ("matrix",), ()),
        ("sweep", scene.sweep, ("sweep",), ("keep", "solver", "threads")),
        ("Scene", linkdyn.Scene, ("source",), ("folder",)),
        ("load", linkdyn.load, ("path",), ()),
    ))  # fmt: skip
    names = [*required, *(word for word in optional if dice.random() < 0.4)]
    wrong = set(dice.sample(names, min(len(names), dice.choice((0, 1, 1, 2)))))
    given = {}
    for word in names:
        value = good[word]()
        given[word] = spoiled(dice, value) if word in wrong else value
    says = f"{name}({', '.join(f'{word}={shown(value)}' for word, value in given.items())})"
    calls(says, lambda: function(**given))
    return calls


def variables_of(scene: linkdyn.Scene, q: np.ndarray) -> np.ndarray:
    """All joint variables at some poses; zeros where nothing is driven."""
    try:
        return scene.inverse(q, want="joint_variable").joint_variable.values
    except linkdyn.InputError:
        return np.zeros((len(q), len(scene.joints)))


def sweep_of(dice: random.Random, scene: linkdyn.Scene, q: np.ndarray) -> dict[str, Any]:
    """A small table [sweep] about the motion's first pose."""
    axes = [{"coordinate": name, "linspace": [float(value) - 0.01, float(value) + 0.01, 3]} for name, value in zip(scene.coordinates, q[0])]
    return {"axis": dice.sample(axes, min(2, len(axes))), "reduce": ["driving_force"]}


def spoiled(dice: random.Random, value: Any) -> Any:
    """A value of another kind, or damaged inside."""
    if isinstance(value, np.ndarray) and dice.random() < 0.85:
        return mutate_array(dice, value)
    if isinstance(value, dict) and dice.random() < 0.85:
        value = copy.deepcopy(value)
        key = dice.choice(list(value))
        kind = dice.randrange(4)
        if kind == 0:
            value[dice.choice((*WORDS, *(odd for odd in ODD if odd.__hash__ is not None)))] = value.pop(key)
        elif kind == 1 and isinstance(value[key], np.ndarray):
            value[key] = mutate_array(dice, value[key])
        elif kind == 2 and isinstance(value[key], list) and value[key] and isinstance(value[key][0], dict):
            mutate_scene(dice, value, copy.deepcopy(value), 1)
        else:
            value[key] = dice.choice(ODD)
        return value
    if isinstance(value, str) and dice.random() < 0.5:
        return dice.choice((*WORDS, value + ",", value.upper(), [value], (value, value), value.encode()))
    if isinstance(value, (int, float)) and not isinstance(value, bool) and dice.random() < 0.5:
        return dice.choice((-value, 0, float("nan"), float("inf"), np.float32(value), np.array(value), np.array([value]), str(value), 1e-300 * value))
    return dice.choice(ODD)


# ---------------------------------------------------------------------------------------------------------- lecture
def lecture_case(dice: random.Random, how: list[str]) -> Outcome:
    """The lecture's modules with some nonsense among their arguments."""
    return call(lambda: lecture_calls(dice, Calls(how)).report)


def lecture_calls(dice: random.Random, calls: Calls) -> Calls:
    n = dice.choice((0, 1, 3, 17))
    rng = np.random.default_rng(dice.randrange(2**32))

    def number(*shape: int) -> Any:
        value = rng.normal(size=shape)
        return spoiled(dice, value) if dice.random() < 0.15 else value

    def length() -> Any:
        value = float(abs(rng.normal()))
        return spoiled(dice, value) if dice.random() < 0.2 else value

    def mode() -> Any:
        return dice.choice(ODD) if dice.random() < 0.2 else dice.choice((1, -1))

    def point(width: int) -> Any:
        return lecture.Point(number(n, width), number(n, width), number(width))

    def angle() -> Any:
        return lecture.Angle(number(n), number(n), number())

    functions = (
        ("crank_input", lambda: lecture.crank_input(point(2), length(), angle())),
        ("rrr_links", lambda: lecture.rrr_links(point(2), point(2), length(), length(), mode())),
        ("coupler_point", lambda: lecture.coupler_point(point(2), point(2), length(), length())),
        ("link_angle", lambda: lecture.link_angle(point(2), point(2))),
        ("fd_crank_input", lambda: lecture.fd_crank_input(point(2), length(), angle(), crank=mode(), cranks=mode())),
        ("fd_rrr_links", lambda: lecture.fd_rrr_links(point(2), point(2), length(), length(), mode())),
        ("Slide", lambda: lecture.Slide(number(n), number(), number(n))),
    )
    for _ in range(8):
        name, function = dice.choice(functions)
        calls(f"lecture.{name}", function)
    return calls


# --------------------------------------------------------------------------------------------------- the executable
OPTIONS: dict[str, tuple[tuple[str, Callable[[random.Random], str] | None], ...]] = {
    "inverse": (
        ("-o", lambda dice: dice.choice(("out.nc", "out.csv", "scene.toml", ".", "", "no/where.nc", "motion.csv", "é.nc", "x" * 300))),
        ("--csv", None), ("--no-output", None), ("--want", lambda dice: ",".join(dice.choices(WANTS, k=dice.randint(1, 3)))),
        ("--solver", lambda dice: dice.choice(SOLVERS)), ("--error", None), ("--states", lambda dice: "states.csv"),
        ("--threads", lambda dice: dice.choice(("1", "2", "0", "-1", "1.5", "99999999999"))), ("--compress", None), ("-q", None),
    ),
    "forward": (
        ("-o", lambda dice: dice.choice(("out.nc", "out.csv", "scene.toml", ".", "", "no/where.nc"))), ("--csv", None),
        ("--until", lambda dice: dice.choice(("0.01", "1e-3", "0", "-1", "nan", "inf", "1e400"))),
        ("--samples", lambda dice: dice.choice(("2", "5", "1", "0", "-3", "2.5", "99999999999"))),
        ("--method", lambda dice: dice.choice(METHODS)), ("--step", lambda dice: dice.choice(("1e-3", "0.1", "0", "-1", "1e-300"))),
        ("--rtol", lambda dice: dice.choice(("1e-6", "1e-12", "0", "-1", "1e-300"))), ("--error", None), ("--no-switch", None),
        ("--want", lambda dice: dice.choice(WANTS)), ("--solver", lambda dice: dice.choice(SOLVERS)), ("--compress", None), ("-q", None),
        ("--checkpoint", lambda dice: "3"),
    ),
    "explain": (("--matrix", None),),
    "sweep": (
        ("-o", lambda dice: dice.choice(("out.nc", ".", "scene.toml"))), ("--keep", lambda dice: dice.choice(("driving_force", "reaction", "x", ""))),
        ("--threads", lambda dice: dice.choice(("1", "2", "0"))), ("--resume", None), ("--checkpoint", lambda dice: dice.choice(("0", "1", "-1"))),
        ("--solver", lambda dice: dice.choice(SOLVERS)), ("-q", None),
    ),
}  # fmt: skip


def command_case(dice: random.Random, how: list[str]) -> Outcome:
    """The executable with a scene, mutated or not, and arguments of which some are wrong."""
    if dice.random() < 0.6:
        files = mutated(dice, how)
    else:
        seed = dice.choice(seeds())
        how.append(f"scene: {seed.name}")
        files = Files(seed.text, dict(seed.tables))
    words = arguments(dice)
    how.append("linkdyn " + " ".join(map(shown, words)))
    with files.folder() as folder:
        if "states.csv" in words:
            table = states(files, folder)
            if dice.random() < 0.7:
                table, said = mutate_table(dice, table)
                how.append(f"states.csv: {said}")
            (folder / "states.csv").write_bytes(table)
        before = {file.name: file.read_bytes() for file in folder.iterdir()}
        outcome = command([executable(), *words], folder)
        report = Report(calls=1, answered=int(outcome.status != BAD_INPUT))
        report.findings = [Finding(0, what) for what in judge_command(words, outcome, before, folder)]
        if outcome.status == BAD_INPUT:
            report.messages.append(outcome.errors.strip())
    return Outcome(outcome.status, outcome.output, outcome.errors, outcome.is_deaf, outcome.is_interrupted, report)


def arguments(dice: random.Random) -> list[str]:
    """Words of a command line."""
    name = dice.choice(("inverse",) * 4 + ("forward",) * 4 + ("explain", "sweep"))
    words = ["scene.toml"]
    for option, value in OPTIONS[name]:
        if dice.random() < 0.25:
            words += [option] if value is None else [option, value(dice)]
    if name == "forward" and "--until" not in words:
        words += ["--until", "0.01"]
    words = [name, *words]
    if dice.random() < 0.2:
        i = dice.randrange(len(words))
        kind = dice.randrange(5)
        if kind == 0:
            del words[i]
        elif kind == 1:
            words.insert(i, words[i])
        elif kind == 2:
            words[i] = dice.choice(WORDS).replace("\0", "")
        elif kind == 3:
            words[i] = words[i][:-1] or "-"
        else:
            words.insert(i, dice.choice(("--help", "--version", "--", "-", "--unknown", "-x", "--csv=1", "--want=", "-qq")))
    return words


def states(files: Files, folder: Path) -> bytes:
    """A table for --states along the scene's own motion; any table where the scene cannot be read."""

    def table() -> str:
        scene = linkdyn.load(folder / "scene.toml")
        time = scene.description["time"]
        q, qd, qdd = scene.motion(np.linspace(time["first"], time["last"], 7))
        names = [f"{kind} {name}" for kind in ("q", "qd", "qdd") for name in scene.coordinates]
        rows = np.hstack([q, qd, qdd])
        return "\n".join([",".join(names), *(",".join(map(repr, map(float, row))) for row in rows)]) + "\n"

    outcome = call(table)
    return outcome.value.encode() if outcome.value else b"time,q x,qd x\n0,1,2\n1,2,3\n"


def judge_command(words: list[str], outcome: Outcome, before: dict[str, bytes], folder: Path) -> list[str]:
    """Exit status, message and files."""
    wrong = []
    after = {file.name: file for file in folder.iterdir()}
    for name, data in before.items():
        if name not in after or after[name].read_bytes() != data:
            wrong.append(f"input {name} was changed")
    new = sorted(set(after) - set(before))
    if outcome.status == BAD_INPUT:
        wrong += oracle.message(outcome.errors)
        if new:
            wrong.append(f"refused, but left {', '.join(new)}")
    if outcome.status in (DONE, SAMPLES_FAILED):
        wrong += [f"left {name}" for name in new if not name.endswith((".nc", ".csv")) and name not in words]
        for name in new:
            wrong += [f"{name}: {what}" for what in judge_file(folder / name)]
    return wrong


def judge_file(file: Path) -> list[str]:
    """A file of results is whole, and its good samples have numbers."""
    if not file.read_bytes().startswith(b"\x89HDF"):
        with file.open(newline="") as lines:
            header, *rows = csv.reader(lines)
        if any(len(row) != len(header) for row in rows):
            return ["rows of unequal length"]
        if "status" not in header:
            return []
        place = header.index("status")
        bad = [
            f"{title} = {value} beside status ok"
            for row in rows
            if row[place] == "ok"
            for title, value in zip(header, row)
            if "nan" in value.lower() or ("inf" in value.lower() and not oracle.MAY_BE_INFINITE.search(title.split(" ")[0]))
        ]
        return bad[:1]
    try:
        with xr.open_dataset(file, engine="netcdf4") as run:
            return oracle.numbers(run.load())
    except (OSError, ValueError) as error:
        return [f"cannot be opened: {error}"]
