"""Scenes from robots of other programs, and the other way: ``linkdyn.convert`` and ``linkdyn convert``."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from .._arguments import as_flag, as_known, as_path
from .._builder import Builder
from .._output import Inputs, text_inputs, write_output
from ..errors import InputError, SceneError
from ..scene import Scene

__all__ = ["Conversion", "convert"]

CLOSING = ("revolute", "spherical", "fixed")


@dataclass(frozen=True)
class Conversion:
    """What `convert` found."""

    text: str
    """Of the file: a scene, or MJCF."""
    left_out: tuple[str, ...]
    """What the other format has no place for, or what was taken for something else: a line each."""
    builder: Builder | None
    """The scene, to be gone on with; None where the text is MJCF."""
    _inputs: Inputs = field(default=(), repr=False)

    def scene(self) -> Scene:
        """The scene, read and checked.

        Raises
        ------
        InputError
            The text is MJCF.
        SceneError
            The robot makes no scene that can be computed.
        """
        if self.builder is None:
            raise InputError("convert: what was made is MJCF (expected a robot, of which a scene is made)")
        return self.builder.scene()

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the file.

        Raises
        ------
        FileError
            It cannot be written, or is one that was read.
        """
        self._write(as_path("path", path))

    def _write(self, path: str, replaces: bool = True) -> None:
        write_output(path, self.text, self._inputs, replaces=replaces)

    def __repr__(self) -> str:
        return f"<linkdyn.Conversion to {'MJCF' if self.builder is None else 'a scene'}: {len(self.left_out)} left out>"


def convert(
    source: Scene | str | os.PathLike[str], closing: Literal["revolute", "spherical", "fixed"] = "revolute", folder: str | os.PathLike[str] | None = None,
    *, hold: bool = False,
) -> Conversion:  # fmt: skip
    """Make a scene of a robot in MJCF or URDF, or MJCF of a scene.

    Parameters
    ----------
    source
        A file of MJCF (read by MuJoCo, which must be installed) or URDF; or a `Scene`, or the file of one.
    closing
        The joint that pairs of frames ``closing_NAME_1``, ``closing_NAME_2`` of a URDF stand for.
    hold
        Bodies that float become parts of the frame where they start.
    folder
        Where the scene is to lie: names of meshes start there; default: the current folder.

    Returns
    -------
    Conversion
        The text, what was left out, and the `Builder` of the scene.

    Raises
    ------
    InputError
        The file is wrong: file, line, what, what was expected.
    UnavailableError
        MJCF is to be read, and MuJoCo is not installed.

    Examples
    --------
    >>> robot = linkdyn.convert("robot.urdf")
    >>> print(*robot.left_out, sep="\\n")
    >>> scene = robot.scene()
    >>> linkdyn.convert(scene).write("robot.xml")
    """
    closing = as_known("closing", closing, CLOSING, "joint")  # type: ignore[assignment]
    path = "" if isinstance(source, Scene) else as_path("source", source)
    if isinstance(source, Scene) or path.endswith(".toml"):
        from .mjcf_writer import as_mjcf

        scene = source if isinstance(source, Scene) else Scene(Path(path))
        text, left_out = as_mjcf(scene)
        return Conversion(text, tuple(left_out), None, tuple(scene._inputs()))
    from .robot import held
    from .robot_scene import as_builder
    from .xml_file import XmlFile

    file = XmlFile(Path(path))
    if file.root.tag == "robot":
        from .urdf import read_urdf

        robot = read_urdf(file, closing, Path.cwd() if folder is None else Path(as_path("folder", folder)))
    elif file.root.tag == "mujoco":
        from .mjcf_reader import read_mjcf

        robot = read_mjcf(file.path)
    else:
        raise InputError(f"{file.path}: root element {file.root.tag[:60]!r} (expected 'mujoco' or 'robot')")
    if as_flag("hold", hold):
        robot = held(robot)
    builder = as_builder(robot)
    builder._folder = folder
    try:
        builder.scene()
    except SceneError as error:
        robot.left_out.append(f"as it is, the scene is refused: {error}")
    inputs = ((os.fspath(file.path), "is the file of the robot"), *text_inputs(builder.to_dict(), "." if folder is None else folder))
    return Conversion(builder.to_toml(), tuple(robot.left_out), builder, inputs)
