"""Files that the package writes: there whole or not at all, as those of the executable.

Written beside the target, then given its name. Links are followed. What is no regular file (a device, a pipe, ``/dev/stdout``) is written through
to and never replaced, folders are refused, and so is whatever the result was computed from.
"""

from __future__ import annotations

import errno
import os
import re
import stat
import threading
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING, Any

from ._printable import printable
from .errors import FileError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Inputs", "picture", "refuse_inputs", "scene_inputs", "text_inputs", "write_by", "write_output"]

Inputs = Iterable[tuple[str, str]]
"""Files that something was computed from, and what each of them is, in the words of a message."""
MOST_LINKS = 40
"""As many as Linux follows."""
DEEPEST = 16
"""Files that include one another."""
DESCRIPTOR = re.compile(r"/(dev|proc/self|proc/\d+)/fd/(\d{1,9})")
PART = re.compile(r"\.(\d{1,18})@(.*)\.part", re.DOTALL)
"""What the name of a part has behind that of its target: the process that writes it, and its machine."""
_one_at_a_time = threading.Lock()
"""Threads of a process would have one part."""


def write_output(target: str | os.PathLike[str], data: str | bytes, inputs: Inputs = (), *, replaces: bool = True) -> None:
    """Write a whole file.

    Parameters
    ----------
    target
        Its name, with links that are followed.
    data
        What is written; text as UTF-8.
    inputs
        None of them may be the target, by whatever name.
    replaces
        False: a file that is there stays.

    Raises
    ------
    FileExistsError
        It is there, and must not be replaced.
    FileError
        It cannot be written, or is an input. Nothing is left, and what was there stays.
    """
    name = os.fspath(target)
    refuse_inputs(name, inputs)
    if not replaces and os.path.lexists(name) and not os.path.isdir(name):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), name)
    whole = data.encode("utf-8", "surrogateescape") if isinstance(data, str) else data
    try:
        place = _behind_links(name)
        if _is_regular(place):
            with _one_at_a_time:
                _write_beside(place, whole, replaces)
        else:
            with os.fdopen(_open_through(place), "wb", buffering=0) as file:
                _write_all(file, whole)
    except FileExistsError:
        if not replaces:
            raise
        raise _cannot(name, os.strerror(errno.EEXIST)) from None    # it came while we were writing
    except IsADirectoryError:
        raise _cannot(name, "is a folder (expected a file name)") from None
    except (OSError, ValueError) as error:
        raise _cannot(name, _reason(error, name)) from error


def write_by(target: str | os.PathLike[str], write: Callable[[str], object], inputs: Inputs = ()) -> None:
    """Let somebody write a whole file who wants the name of a regular one.

    Parameters
    ----------
    target
        Its name, with links that are followed.
    write
        Writes to the name that it is given.
    inputs
        None of them may be the target, by whatever name.

    Raises
    ------
    FileError
        It cannot be written, or is an input. Nothing is left, and what was there stays.
    """
    name = os.fspath(target)
    refuse_inputs(name, inputs)
    try:
        place = _behind_links(name)
        if not _is_regular(place):
            raise _cannot(name, "is a device or a pipe (expected a file name)")
        with _one_at_a_time, _part_beside(place, True) as part:
            write(part)
    except IsADirectoryError:
        raise _cannot(name, "is a folder (expected a file name)") from None
    except (OSError, ValueError) as error:
        raise _cannot(name, _reason(error, name)) from error


def refuse_inputs(target: str | os.PathLike[str], inputs: Inputs) -> None:
    """Nothing that is written may be a file that was read.

    Raises
    ------
    FileError
        It is; the message says which.
    """
    try:
        there = os.stat(target)
    except (OSError, ValueError):    # nothing is replaced
        return
    for file, what in inputs:
        try:
            is_same = os.path.samestat(there, os.stat(file))
        except (OSError, ValueError):    # no file
            continue
        if is_same:
            raise _cannot(os.fspath(target), f"{what} (expected another file)")


def scene_inputs(file: str | os.PathLike[str] | None, text: str = "", folder: str | os.PathLike[str] = ".") -> Iterator[tuple[str, str]]:
    """What a scene was read from: its file, if it has one, all that this includes, tables and meshes of its text."""
    if file is not None:
        yield os.fspath(file), "is the scene file"
        yield from text_inputs(_parsed(file), os.path.dirname(file))
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return
    yield from text_inputs(content, folder)


def text_inputs(content: Any, folder: str | os.PathLike[str], key: str = "", depth: int = 0) -> Iterator[tuple[str, str]]:
    """What a scene's content may name as a file: every text in it but the title, since hardly one is the name of a file that is there."""
    if isinstance(content, Mapping):
        for name, item in content.items():
            yield from text_inputs(item, folder, str(name), depth)
    elif isinstance(content, (list, tuple)):
        for item in content:
            yield from text_inputs(item, folder, key, depth)
    elif isinstance(content, (str, os.PathLike)) and key != "title":
        path = os.path.join(folder, content)
        words = {"include": "is included by the scene", "mesh": "is a mesh of the scene"}
        yield path, words.get(key, "is a table of the scene")
        if key == "include" and depth < DEEPEST:
            yield from text_inputs(_parsed(path), os.path.dirname(path), "", depth + 1)


def picture(figure: Figure, target: str | os.PathLike[str], inputs: Inputs = (), *, dpi: float) -> None:
    """Write a figure; the ending of the name says as what.

    Raises
    ------
    FileError
        As `write_output`.
    """
    import io

    stream = io.BytesIO()
    # a layout leaves no room for the names of axes in space, and much where there is nothing
    border = "tight" if any(axis.name == "3d" for axis in figure.axes) else None
    figure.savefig(stream, format=os.path.splitext(target)[1][1:].lower(), dpi=dpi, bbox_inches=border)
    write_output(target, stream.getvalue(), inputs)


def _parsed(file: str | os.PathLike[str]) -> dict[str, Any]:
    """A scene file's content; nothing where that cannot be read: who reads it in earnest says so."""
    try:
        if not os.path.isfile(file):    # a pipe was read already
            return {}
        with open(file, "rb") as stream:
            return tomllib.load(stream)
    except (OSError, ValueError, RecursionError):
        return {}


def _reason(error: OSError | ValueError, name: str) -> str:
    if isinstance(error, FileNotFoundError) and not os.path.isdir(os.path.dirname(name) or "."):
        return f"there is no folder {os.path.dirname(name)!r}"
    return getattr(error, "strerror", None) or str(error)


def _cannot(name: str, reason: str) -> FileError:
    return FileError(printable(f"{name or repr(name)}: cannot be written: {reason}"))


def _behind_links(path: str) -> str:
    """The name behind all links, which need not be there; or the descriptor of a process, which is no name of a file."""
    for _ in range(MOST_LINKS + 1):
        if DESCRIPTOR.fullmatch(path) or not os.path.islink(path):
            return path
        path = os.path.join(os.path.dirname(path), os.readlink(path))
    raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))


def _is_regular(place: str) -> bool:
    """A file, or the name for one; False: a device, a pipe, a descriptor."""
    if DESCRIPTOR.fullmatch(place):
        return False
    try:
        mode = os.lstat(place).st_mode
    except FileNotFoundError:
        return True
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    return stat.S_ISREG(mode)


def _open_through(place: str) -> int:
    found = DESCRIPTOR.fullmatch(place)
    if found and found[1] in ("dev", "proc/self", f"proc/{os.getpid()}"):
        return os.dup(int(found[2]))
    return os.open(place, os.O_WRONLY | os.O_NOCTTY | os.O_CLOEXEC)


def _write_beside(place: str, data: bytes, replaces: bool) -> None:
    """Write the part, on the disk of the target, and put it in its place."""
    with _part_beside(place, replaces) as part, open(part, "wb", buffering=0) as file:
        _write_all(file, data)


@contextmanager
def _part_beside(place: str, replaces: bool) -> Iterator[str]:
    """An empty part on the disk of the target, which takes its place when it was filled; parts that killed processes left are removed."""
    _remove_leftovers(place)
    is_there = os.path.exists(place)
    if is_there and not os.access(place, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    part = f"{place}.{os.getpid()}@{os.uname().nodename}.part"
    descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
    try:
        with os.fdopen(descriptor, "wb", buffering=0):
            if is_there:
                os.fchmod(descriptor, stat.S_IMODE(os.stat(place).st_mode) & 0o777)
        yield part
        _bring_to_disk(part)
        if not replaces:
            os.link(part, place)
            os.unlink(part)
        elif _is_regular(place):
            os.replace(part, place)
        else:
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST))
    except BaseException:
        os.unlink(part)
        raise


def _bring_to_disk(file: str) -> None:
    """A full disk may show only here."""
    descriptor = os.open(file, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _write_all(file: IO[bytes], data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]


def _remove_leftovers(place: str) -> None:
    """Of processes of this machine that are gone."""
    folder, base = os.path.split(place)
    try:
        names = os.listdir(folder or ".")
    except OSError:
        return
    for name in names:
        found = PART.fullmatch(name, len(base)) if name.startswith(base) else None
        if found and found[2] == os.uname().nodename and _is_gone(int(found[1])):
            os.unlink(os.path.join(folder, name))


def _is_gone(process: int) -> bool:
    if process == os.getpid():
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return False
