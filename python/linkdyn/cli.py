"""The command ``linkdyn``: hands over to the executable inside the package, draws sheets after it; views, draws, balances and converts scenes, writes new ones."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

from ._listing import only

__all__ = ["executable", "main", "quadruple_twin"]
__dir__ = only(__all__)

PROGRAMS = Path(__file__).parent / "_bin"
OF_PACKAGE = ("new", "draw", "convert", "balance", "linearize")
"""Commands of the package alone."""
BESIDE_EXECUTABLE = ("view", "assemblies")
"""Commands of the package that go with an executable."""
WITH_SHEET = ("inverse", "forward", "sweep")
"""Commands whose results a sheet can be drawn of."""
RANKS = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK")
"""Where launchers of MPI leave the number of the process."""


def executable() -> Path:
    """Path of the executable.

    Raises
    ------
    FileNotFoundError
        The package was built without it.
    """
    path = PROGRAMS / "linkdyn"
    if not path.is_file():
        raise FileNotFoundError(f"{path}: the executable is not in the package (expected a build with its app)")
    return path


def quadruple_twin() -> Path | None:
    """Path of ``linkdyn-real128``, the same program in quadruple precision; None if it is not built.

    Looked for in the environment variable ``LINKDYN_REAL128``, then beside the executable, where ``make real128``
    puts it.
    """
    if given := os.environ.get("LINKDYN_REAL128"):
        return Path(given)
    path = PROGRAMS / "linkdyn-real128"
    return path if path.is_file() else None


def main() -> None:
    """Become the executable, with the same arguments; stay for what the package does itself."""
    _end_at_interrupts()
    arguments = sys.argv[1:]
    name = arguments[0] if arguments else ""
    if name in OF_PACKAGE:
        sys.exit(_command(name)(arguments[1:]))
    try:
        path = executable()
    except FileNotFoundError as error:
        sys.exit(str(error))
    if twin := quadruple_twin():
        os.environ["LINKDYN_REAL128"] = os.fspath(twin)
    if name in BESIDE_EXECUTABLE:
        sys.exit(_command(name)(arguments[1:]))
    if _asks_for_sheet(arguments):
        sys.exit(_run_with_sheet(path, arguments))
    os.execv(path, ["linkdyn", *arguments])


def _command(name: str) -> Callable[[Sequence[str]], int]:
    """What a command of the package does with its arguments; the exit status."""
    module = import_module(f"._commands.{name}", __package__)
    function: Callable[[Sequence[str]], int] = getattr(module, f"{name}_command")
    return function


def _end_at_interrupts() -> None:
    """Ctrl-C ends a command by the signal, as it ends any program that has nothing to tidy up; an interrupt that is ignored stays ignored."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def _asks_for_sheet(arguments: Sequence[str]) -> bool:
    is_help = any(word in ("-h", "--help") for word in arguments)
    return arguments[:1] != [] and arguments[0] in WITH_SHEET and not is_help and any(word.split("=")[0] == "--sheet" for word in arguments)


def _run_with_sheet(path: Path, arguments: list[str]) -> int:
    """Run the command, then draw the sheet of its results; the exit status."""
    from ._commands.common import SOME_FAILED, refuse

    target, rest = _take_option(arguments, ("--sheet",))
    if not target or Path(target).suffix.lower() not in (".html", ".pdf"):
        return refuse(f"--sheet: {target or ''!r} (expected a file that ends in .html or .pdf)")
    sheet_file = Path(target)
    if not sheet_file.absolute().parent.is_dir():
        return refuse(f"--sheet: {target!r}: the folder is not there")
    if problem := _destroys(target, rest):
        return refuse(problem)
    for word in ("--no-output", "--csv"):
        if word in rest:
            return refuse(f"--sheet: it is drawn from results in a netCDF file (expected a run without {word})")
    results, _ = _take_option(rest, ("-o", "--output"))
    if results is None:
        results = str(sheet_file.with_suffix(".nc"))
        rest = [*rest, "--output", results]
    code = _executed(path, rest)
    if code not in (0, SOME_FAILED):
        return code if code > 0 else 128 - code
    if any(os.environ.get(name, "0") != "0" for name in RANKS):     # one process of several draws
        return code
    return _draw(results, sheet_file, rest) or code


def _destroys(target: str, arguments: list[str]) -> str:
    """What the sheet would replace of what the command reads, in the words of a message; empty: nothing. Asked before a long run."""
    from ._output import refuse_inputs, scene_inputs
    from .errors import FileError

    states, _ = _take_option(arguments, ("--states",))
    results, _ = _take_option(arguments, ("-o", "--output"))
    named = [(states or "", "is the file of --states"), (results or "", "is the file of results")]
    scenes = [word for word in arguments[1:] if not word.startswith("-")]     # values of options are among them
    try:
        refuse_inputs(target, [*named, *(place for scene in scenes for place in scene_inputs(scene))])
    except FileError as error:
        return f"--sheet: {error}"
    if results is not None and os.path.realpath(results) == os.path.realpath(target):
        return f"--sheet: {target}: is the file of results (expected another file)"
    return ""


def _executed(path: Path, arguments: list[str]) -> int:
    """Exit status of the executable, which hears a Ctrl-C as well: it is waited for, a moment."""
    import subprocess

    is_default = signal.getsignal(signal.SIGINT) == signal.SIG_DFL
    try:
        if is_default:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        return subprocess.run([path, *arguments], check=False).returncode
    except KeyboardInterrupt:
        return 128 + signal.SIGINT
    finally:
        if is_default:
            signal.signal(signal.SIGINT, signal.SIG_DFL)


def _draw(results: str, sheet_file: Path, arguments: list[str]) -> int:
    from ._commands.common import draw_into_files, refuse, say

    draw_into_files()
    from ._sheets.sheet import sheet
    from .errors import LinkdynError
    from .results import read
    from .scene import Scene

    try:
        sheet(read(results), sheet_file, scene=Scene(Path(_scene_file(arguments))))
    except LinkdynError as error:
        return refuse(str(error))
    if not {"-q", "--quiet"} & set(arguments):
        say(f"  sheet            {sheet_file}")
    return 0


def _take_option(arguments: Sequence[str], names: tuple[str, ...]) -> tuple[str | None, list[str]]:
    """Value of an option ("--name VALUE" or "--name=VALUE"), and the arguments without it."""
    value, rest, words = None, [], iter(arguments)
    for word in words:
        name, equals, tail = word.partition("=")
        if name in names:
            value = tail if equals else next(words, None)
        else:
            rest.append(word)
    return value, rest


def _scene_file(arguments: Sequence[str]) -> str:
    """The one word that is neither an option nor the value of one; the executable has accepted them all."""
    bare = ("--resume", "--yes", "-q", "--quiet", "--compress", "--error", "--no-switch")
    words = iter(arguments[1:])
    for word in words:
        if not word.startswith("-"):
            return word
        if "=" not in word and word not in bare:
            next(words, None)
    raise AssertionError("a run without a scene succeeded")
