"""A scene built in Python. It is the dict of a scene file while it grows: keys are those of the file, and its reader alone says what is wrong."""

from __future__ import annotations

import copy
import os
import re
import sys
import tomllib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from ._arguments import as_known, as_path, quoted_name
from ._output import text_inputs, write_output
from ._toml import as_toml
from ._scene_types import Cylinder, Drive, Elastic, Law, LegLink, Marker, Named, Quantity, Stiffness, Strands, Table, Vector, WordLink, n_copies, plain, table_of
from .errors import SceneError

if TYPE_CHECKING:
    from .scene import Scene

__all__ = ["Builder", "Frame", "Joint", "Link"]

FIRST = {key: i for i, key in enumerate(("title", "space", "gravity", "change_points", "redundancy", "include", "variables", "measures", "laws", "frame"))}
"""What stands first in a scene file, in this order; the rest stands as it was built."""
WITH_ONE_VARIABLE = ("revolute", "prismatic", "screw", "slot")
"""Joints whose actuator is called by the joint alone, whether its variable is written or not."""
PLACE = re.compile(r"scene\['(\w+)'\](?:\[(\d+)\])?")
"""Where in the dict a message says that something is wrong."""


class Link(Named):
    """A link that is being built; ``link["A"]`` is its marker A wherever one is wanted."""

    _may_have_more = False
    """Markers that do not stand here."""

    def __init__(self, name: str, table: Table) -> None:
        self.name = name
        self._table = table

    def __getitem__(self, marker: str) -> str:
        """A marker that is there, as "link.marker"; of repeated ones "A1" is the first, and "A#" that of a part's own copy.

        Raises
        ------
        InputError
            The link has none of that name.
        """
        if not (self._may_have_more or isinstance(marker, str) and "#" in marker):
            as_known(f"link {quoted_name(self.name)}", marker, self._markers(), "marker")
        return f"{self.name}.{marker}"

    def _markers(self) -> list[str]:
        """Their names; a repeated one's as it is written, and with the numbers of its copies."""
        names: list[str] = []
        for name, spec in self._table.get("markers", {}).items():
            names.append(name)
            if isinstance(spec, Mapping) and {"repeat", "angles", "mirror"} & set(spec):
                numbers = map(str, range(1, n_copies(spec) + 1))
                names += [name.replace("#", number) if "#" in name else name + number for number in numbers]
        return names

    def __repr__(self) -> str:
        return f"<linkdyn link {self.name!r}: markers {', '.join(self._table.get('markers', {})) or 'none'}>"

    def marker(
        self, name: str, at: Vector, *, axis: Vector | None = None, x: Vector | None = None, repeat: int | None = None,
        about: str | Vector | None = None, angles: Sequence[Quantity] | None = None, mirror: Literal["xy", "xz", "yz"] | None = None,
    ) -> str:  # fmt: skip
        """Put a point on the link.

        Parameters
        ----------
        name
            Its name.
        at
            Where it is, in link axes [m].
        axis
            Axis of a joint there; default: z of the link, in a plane x.
        x
            Direction across ``axis`` from which joint angles count.
        repeat, about, angles, mirror
            It is there several times, as ``name1``, ``name2``, ..: copies, axis, angles [rad], plane of images.

        Returns
        -------
        str
            "link.name", as joints, loads and springs want it.
        """
        spec = table_of({key: value for key, value in locals().items() if key not in ("self", "name")})
        self._table.setdefault("markers", {})[name] = spec if len(spec) > 1 else spec["at"]
        return f"{self.name}.{name}"


class Frame(Link):
    """The fixed link; files that are included may have markers of it."""

    def __init__(self, table: Table, may_have_more: bool = False) -> None:
        super().__init__("frame", table)
        self._may_have_more = may_have_more

    def motion(self, *, table: str | os.PathLike[str] | None = None, time: str | None = None, interpolation: Literal["spline", "linear"] | None = None,
               x: Law | None = None, y: Law | None = None, z: Law | None = None, roll: Law | None = None, pitch: Law | None = None,
               yaw: Law | None = None) -> None:  # fmt: skip
        """Let the frame itself move in axes at rest, as a ship does.

        Parameters
        ----------
        x, y, z
            Laws of its origin [m]; what is left out stays at zero.
        roll, pitch, yaw
            Laws of its attitude [rad].
        table, time, interpolation
            Instead: a CSV file with these columns, as of `linkdyn.laws.table`.
        """
        self._table["motion"] = table_of({key: value for key, value in locals().items() if key != "self"})


class Joint(Named):
    """A joint that is being built: goes wherever a joint's name does."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __repr__(self) -> str:
        return f"<linkdyn joint {self.name!r}>"


class Builder:
    """A scene, part by part. Words are those of the scene file, where docs/scene-file.md explains each; numbers are in SI, texts have their unit.

    Parameters
    ----------
    title
        Goes into results and pictures.
    space
        "planar" or "spatial".
    gravity
        Acceleration of free fall [m/s^2].
    change_points
        "pass" or "stop": what happens where two assemblies meet on the way.
    redundancy
        "minimum-norm", "stiffness" or "refuse": what becomes of reactions that the equations leave open.
    include
        Scene files that are joined to this one.

    Attributes
    ----------
    frame : Frame
        The fixed link: ``frame.marker("A", (0, 0))``, ``frame["A"]``, ``frame.motion(..)``.

    Examples
    --------
    >>> b = linkdyn.Builder("A pendulum", "planar", gravity=(0, -9.81))
    >>> rod = b.link("rod", mass=2, inertia=0.06, cog=("0.3 m", 0), markers={"A": (0, 0)})
    >>> pin = b.revolute("A", b.frame.marker("A", (0, 0)), rod["A"])
    >>> b.coordinate(pin, motion=linkdyn.laws.harmonic("20 deg", "0.5 Hz"))
    >>> b.actuator(pin)
    >>> run = b.scene().inverse()
    """

    def __init__(
        self, title: str | None = None, space: Literal["planar", "spatial"] | None = None, *, gravity: Vector | None = None,
        change_points: Literal["pass", "stop"] | None = None, redundancy: Literal["minimum-norm", "stiffness", "refuse"] | None = None,
        include: str | Sequence[str] | None = None,
    ) -> None:  # fmt: skip
        self._content: Table = {key: plain(value) for key, value in locals().items() if key != "self" and value is not None}
        self._places: dict[tuple[str, int], str] = {}
        self._folder: str | os.PathLike[str] | None = None
        self.frame = Frame({}, include is not None)

    @classmethod
    def of(cls, source: Scene | Mapping[str, Any] | str | os.PathLike[str]) -> Builder:
        """Go on from a scene that is there.

        Parameters
        ----------
        source
            A `Scene`, the path of a scene file, or a dict as `to_dict` gives. ``b["crank"]`` is a link of it.
        """
        from .scene import Scene

        builder = cls()
        if isinstance(source, Mapping):
            builder._content = plain(source)
        else:
            scene = source if isinstance(source, Scene) else Scene(source)
            builder._content, builder._folder = tomllib.loads(scene.text), scene.folder
        builder.frame = Frame(builder._content.pop("frame", {}), "include" in builder._content)
        return builder

    def __getitem__(self, name: str) -> Link:
        """A link that is there, by its name: ``b["crank"]["A"]`` is its marker A.

        Raises
        ------
        InputError
            There is none of that name.
        """
        links = {"frame": self.frame} | {str(table.get("name")): table for table in self._content.get("link", [])}
        name = as_known("link", name, links, "link")
        return self.frame if name == "frame" else Link(name, links[name])

    def __repr__(self) -> str:
        counted = ", ".join(f"{len(value)} {key}" for key, value in self._content.items() if isinstance(value, list) and value and isinstance(value[0], dict))
        return f"<linkdyn.Builder {self._content.get('title', '')!r}: {counted or 'nothing yet'}>"

    # ------------------------------------------------------------------------------------------------------ what comes of it
    def scene(self, folder: str | os.PathLike[str] | None = None) -> Scene:
        """The scene, read and checked.

        Parameters
        ----------
        folder
            Where its tables are looked up; default: that of the scene that it goes on from, or the current one.

        Raises
        ------
        SceneError
            Something is wrong: which part, what was expected; a note to the message says where in your program the part was built.
        """
        from .scene import Scene

        try:
            return Scene(self.to_dict(), self._folder if folder is None else folder)
        except SceneError as error:
            if (place := PLACE.match(str(error))) and place[2] and (line := self._places.get((place[1], int(place[2])))):
                error.add_note(f"built at {line}")
            raise

    def to_dict(self) -> Table:
        """The scene as a dict: what ``tomllib`` reads from its file."""
        table = self._content | ({"frame": self.frame._table} if self.frame._table else {})
        return copy.deepcopy(dict(sorted(table.items(), key=lambda item: FIRST.get(item[0], len(FIRST)))))

    def to_toml(self, path: str | os.PathLike[str] | None = None) -> str:
        """The scene file.

        Parameters
        ----------
        path
            Where it is written to; default: nowhere.

        Returns
        -------
        str
            Its text.

        Raises
        ------
        FileError
            It cannot be written, or is a table of the scene.
        """
        text = as_toml(self.to_dict())
        if path is not None:
            write_output(as_path("path", path), text, text_inputs(self.to_dict(), self._folder or "."))
        return text

    # ------------------------------------------------------------------------------------------------------------- bodies
    def link(
        self, name: str, *, mass: Quantity, markers: Mapping[str, Vector | Marker] | None = None, cog: Vector | None = None,
        inertia: Quantity | Vector | Mapping[str, Vector] | None = None, inertia_check: bool | None = None,
        elastic: Elastic | Sequence[Elastic] | None = None, start: Mapping[str, Any] | None = None,
        mesh: str | os.PathLike[str] | None = None, mesh_unit: Literal["m", "cm", "mm", "in"] | None = None, repeat: int | None = None,
        about: str | Vector | None = None, angles: Sequence[Quantity] | None = None, mirror: Literal["xy", "xz", "yz"] | None = None,
    ) -> Link:  # fmt: skip
        """A rigid body.

        Parameters
        ----------
        name
            Its name; ``"leg#"`` for the copies of ``repeat``.
        mass
            [kg]; zero: massless.
        markers
            Points by their names: places [m], or tables with ``at``, ``axis``, ``x``. `Link.marker` puts more on it.
        cog
            Centre of mass in link axes [m]; default: the origin.
        inertia
            About the centre of mass, in link axes [kg m^2]: in a plane a number, in space the elements (Ixx, Iyy, Izz, Ixy, Iyz, Izx)
            of the tensor, or ``{"diagonal": (Ixx, Iyy, Izz)}``.
        inertia_check
            False admits an inertia that no body has.
        elastic
            Of scenes with ``redundancy="stiffness"``: how it bends, twists and stretches between its mass and its joints.
        start
            About where it is at the start: ``{"position": (..), "angles": (..)}`` [m, rad], in a plane ``"angle"``.
        mesh, mesh_unit
            STL or GLB file with its form, for pictures.
        repeat, about, angles, mirror
            It is there several times: copies, axis, angles [rad], plane of images.
        """
        return Link(name, self._add("link", locals()))

    def payload(
        self, on: str, *, mass: Law, inertia: Quantity | Vector | Mapping[str, Vector] | None = None, from_: Quantity | None = None,
        until: Quantity | None = None, repeat: int | None = None,
    ) -> None:  # fmt: skip
        """A mass on a marker, beside the link's own.

        Parameters
        ----------
        on
            Marker where its centre of mass is.
        mass
            [kg], or a law of time.
        inertia
            About the marker, in link axes [kg m^2]; default: a point mass.
        from_, until
            When it is there [s]; default: always.
        repeat
            Copies.
        """
        self._add("payload", locals())

    # ------------------------------------------------------------------------------------------------------------- joints
    def revolute(
        self, name: str, first: str, second: str, *, start: Quantity | None = None, branch: Literal[1, -1] | None = None,
        stiffness: Stiffness | None = None, misfit: Mapping[str, Any] | None = None, repeat: int | None = None,
    ) -> Joint:  # fmt: skip
        """A hinge: the markers' axes lie in one line.

        Parameters
        ----------
        name
            Its name.
        first, second
            Markers of the first and second link: ``crank["A"]``. The joint's angle is how far the second has turned against the first.
        start
            Angle near which loops are closed [rad].
        branch
            Assembly of the dyad that closes here.
        stiffness
            Of scenes with ``redundancy="stiffness"`` [N/m, N m/rad].
        misfit
            There, too: ``{"shift": (..), "turn": (..)}`` by which it was made wrong [m, rad].
        repeat
            Copies.
        """
        return self._joint("revolute", locals())

    def prismatic(
        self, name: str, first: str, second: str, *, start: Quantity | None = None, branch: Literal[1, -1] | None = None,
        stiffness: Stiffness | None = None, misfit: Mapping[str, Any] | None = None, repeat: int | None = None,
    ) -> Joint:  # fmt: skip
        """A slide along the markers' axes; their frames stay parallel.

        Parameters
        ----------
        name
            Its name.
        first, second
            Markers of the first and second link. The joint's ``slide`` is how far the second has gone along the axis.
        start
            Slide near which loops are closed [m].
        branch
            Assembly of the dyad that closes here.
        stiffness
            Of scenes with ``redundancy="stiffness"`` [N/m, N m/rad].
        misfit
            There, too: ``{"shift": (..), "turn": (..)}`` by which it was made wrong [m, rad].
        repeat
            Copies.
        """
        return self._joint("prismatic", locals())

    def cylindrical(
        self, name: str, first: str, second: str, *, start: Mapping[str, Quantity] | None = None, stiffness: Stiffness | None = None,
        misfit: Mapping[str, Any] | None = None, repeat: int | None = None,
    ) -> Joint:  # fmt: skip
        """Turns about the markers' common axis and slides along it.

        Parameters
        ----------
        name
            Its name.
        first, second
            Markers of the first and second link.
        start
            ``{"angle": .., "slide": ..}`` near which loops are closed [rad, m].
        stiffness
            Of scenes with ``redundancy="stiffness"`` [N/m, N m/rad].
        misfit
            There, too: ``{"shift": (..), "turn": (..)}`` by which it was made wrong [m, rad].
        repeat
            Copies.
        """
        return self._joint("cylindrical", locals())

    def spherical(
        self, name: str, first: str, second: str, *, start: Mapping[str, Quantity] | None = None, branch: Literal[1, -1] | None = None,
        stiffness: Stiffness | None = None, misfit: Mapping[str, Any] | None = None, repeat: int | None = None,
    ) -> Joint:  # fmt: skip
        """A ball: the markers' points coincide.

        Parameters
        ----------
        name
            Its name.
        first, second
            Markers of the first and second link.
        start
            ``{"roll": .., "pitch": .., "yaw": ..}`` near which loops are closed [rad].
        branch
            Of a group of cylindrical, spherical and prismatic joint: 1 the farther meeting along the slide, -1 the nearer.
        stiffness
            Of scenes with ``redundancy="stiffness"`` [N/m, N m/rad].
        misfit
            There, too: ``{"shift": (..), "turn": (..)}`` by which it was made wrong [m, rad].
        repeat
            Copies.
        """
        return self._joint("spherical", locals())

    def universal(
        self, name: str, first: str, second: str, *, start: Mapping[str, Quantity] | None = None, stiffness: Stiffness | None = None,
        misfit: Mapping[str, Any] | None = None, repeat: int | None = None,
    ) -> Joint:  # fmt: skip
        """Cardan's joint: the markers' axes cross at the point, square.

        Parameters
        ----------
        name
            Its name.
        first, second
            Markers of the first and second link, each with its axis.
        start
            ``{"angle1": .., "angle2": ..}`` near which loops are closed [rad].
        stiffness
            Of scenes with ``redundancy="stiffness"`` [N/m, N m/rad].
        misfit
            There, too: ``{"shift": (..), "turn": (..)}`` by which it was made wrong [m, rad].
        repeat
            Copies.
        """
        return self._joint("universal", locals())

    def planar(
        self, name: str, first: str, second: str, *, start: Mapping[str, Quantity] | None = None, stiffness: Stiffness | None = None,
        misfit: Mapping[str, Any] | None = None, repeat: int | None = None,
    ) -> Joint:  # fmt: skip
        """A body that slides on a table: the second point stays in the plane across the first axis, which stays parallel to the second.

        Parameters
        ----------
        name
            Its name.
        first, second
            Markers of the first and second link.
        start
            ``{"x": .., "y": .., "angle": ..}`` near which loops are closed [m, rad].
        stiffness
            Of scenes with ``redundancy="stiffness"`` [N/m, N m/rad].
        misfit
            There, too: ``{"shift": (..), "turn": (..)}`` by which it was made wrong [m, rad].
        repeat
            Copies.
        """
        return self._joint("planar", locals())

    def screw(
        self, name: str, first: str, second: str, *, lead: Quantity, start: Quantity | None = None, stiffness: Stiffness | None = None,
        misfit: Mapping[str, Any] | None = None, repeat: int | None = None,
    ) -> Joint:  # fmt: skip
        """A screw and its nut.

        Parameters
        ----------
        name
            Its name.
        first, second
            Markers of the first and second link; their axes lie in one line.
        lead
            How far the second advances in a turn [m]; negative: left-handed.
        start
            Angle near which loops are closed [rad].
        stiffness
            Of scenes with ``redundancy="stiffness"`` [N/m, N m/rad].
        misfit
            There, too: ``{"shift": (..), "turn": (..)}`` by which it was made wrong [m, rad].
        repeat
            Copies.
        """
        return self._joint("screw", locals())

    def fixed(
        self, name: str, first: str, second: str, *, stiffness: Stiffness | None = None, misfit: Mapping[str, Any] | None = None,
        repeat: int | None = None,
    ) -> Joint:  # fmt: skip
        """A weld: axes and x of both markers lie in one line.

        Parameters
        ----------
        name
            Its name.
        first, second
            Markers of the first and second link.
        stiffness
            Of scenes with ``redundancy="stiffness"`` [N/m, N m/rad].
        misfit
            There, too: ``{"shift": (..), "turn": (..)}`` by which it was made wrong [m, rad].
        repeat
            Copies.
        """
        return self._joint("fixed", locals())

    def gear(
        self, name: str, first: str, second: str, *, teeth: Sequence[Quantity], mesh: Literal["external", "internal"] | None = None,
        pressure_angle: Quantity | None = None, helix_angle: Quantity | None = None, lead_angle: Quantity | None = None,
        phase: Quantity | None = None, repeat: int | None = None,
    ) -> Joint:  # fmt: skip
        """Two wheels in mesh, each of which has its hinge already.

        Parameters
        ----------
        name
            Its name.
        first, second
            Markers on the axes of the wheels.
        teeth
            Of the first and second wheel; only their ratio counts.
        mesh
            "internal": the wheel with more teeth is a ring about the other.
        pressure_angle
            Of the teeth, across them: it drives the wheels apart [rad].
        helix_angle
            Of the first wheel's teeth, above zero right-handed: it pushes the wheels along their axes [rad].
        lead_angle
            Of a worm, the first wheel, above zero right-handed: its teeth are starts, and its wheel turns across its axis [rad].
        phase
            Angle of the second where that of the first is zero [rad].
        repeat
            Copies.
        """
        return self._joint("gear", locals())

    def rack(
        self, name: str, first: str, second: str, *, pressure_angle: Quantity | None = None, phase: Quantity | None = None,
        repeat: int | None = None,
    ) -> Joint:  # fmt: skip
        """A wheel and a rack, which have their hinge and slide already.

        Parameters
        ----------
        name
            Its name.
        first
            Marker on the wheel's axis.
        second
            Marker of the rack, on its pitch line.
        pressure_angle
            Of the teeth: it drives rack and wheel apart [rad].
        phase
            Slide of the rack where the wheel's angle is zero [m].
        repeat
            Copies.
        """
        return self._joint("rack", locals())

    def belt(
        self, name: str, first: str, second: str, *, radii: Sequence[Quantity], run: Literal["open", "crossed"] | None = None,
        phase: Quantity | None = None, strands: Strands | None = None, repeat: int | None = None,
    ) -> Joint:  # fmt: skip
        """A belt or chain over two wheels, each of which has its hinge already.

        Parameters
        ----------
        name
            Its name.
        first, second
            Markers on the axes of the wheels.
        radii
            Pitch radii of both [m].
        run
            "crossed": the wheels turn against each other.
        phase
            Angle of the second where that of the first is zero [rad].
        strands
            It stretches: stiffness [N/m], damping [N s/m] and pretension [N] of each strand, ``{"stiffness": 2e5, "pretension": 400}``.
        repeat
            Copies.
        """
        return self._joint("belt", locals())

    def slot(self, name: str, first: str, second: str, *, start: Quantity | None = None, branch: int | None = None, repeat: int | None = None) -> Joint:
        """A pin in a straight slot; in space it may turn any way.

        Parameters
        ----------
        name
            Its name.
        first
            Marker on the slot, its axis along it.
        second
            Marker of the pin.
        start
            Place in the slot near which loops are closed [m].
        branch
            Which of both assemblies, 1 or -1.
        repeat
            Copies.
        """
        return self._joint("slot", locals())

    def cam(
        self, name: str, first: str, second: str, *, follower: Literal["point", "roller", "flat"], curve: Mapping[str, Any],
        radius: Quantity | None = None, side: Literal["outside", "inside", "groove"] | None = None, repeat: int | None = None,
    ) -> Joint:  # fmt: skip
        """A point, roller or straight face on a closed smooth curve, across the cam's axis or round it; cam and follower have their hinge or slide already.

        Parameters
        ----------
        name
            Its name.
        first
            Marker of the cam, about which the curve lies.
        second
            Marker of the follower: its point, its roller's centre, or its face, whose axis points at the cam.
        follower
            What touches the curve.
        curve
            ``{"angle": .., "radius": ..}``, ``{"x": .., "y": ..}``, in space ``{"angle": .., "height": ..}``, or ``{"table": "cam.csv"}`` [rad, m].
        radius
            Of a roller [m].
        side
            "inside": it runs inside the curve; "groove": it is held from both sides.
        repeat
            Copies.
        """
        return self._joint("cam", locals())

    def chain(
        self,
        type: Literal["UPS", "SPS", "UCU", "UPU", "RPS", "cylinder", "PUS", "PSS", "PRS", "RUS", "RSS", "RRS", "RUU", "R(SS)2", "RRR", "PRR", "RPR"] | str,
        *, base: str | Sequence[str], platform: str | Sequence[str], name: str | None = None, names: Sequence[str] | None = None,
        axis: Vector | Sequence[Vector] | None = None, rail: Vector | Sequence[Vector] | None = None, zero: Vector | Sequence[Vector] | None = None,
        top_axis: Vector | Sequence[Vector] | None = None, elbow: Literal[1, -1] | None = None, width: Quantity | None = None,
        lower: LegLink | Sequence[LegLink] | None = None, upper: LegLink | Sequence[LegLink] | None = None,
        barrel: LegLink | Sequence[LegLink] | None = None, carriage: LegLink | Sequence[LegLink] | None = None,
        crank: LegLink | Sequence[LegLink] | None = None, rod: LegLink | Sequence[LegLink] | None = None,
        axes: Sequence[Vector | Sequence[Vector]] | None = None, links: Sequence[WordLink] | None = None,
        stiffness: Stiffness | Sequence[Stiffness] | None = None,
        actuated: bool | None = None, start: Quantity | Sequence[Quantity | Mapping[str, Quantity]] | None = None, repeat: int | None = None,
        about: str | Vector | None = None, angles: Sequence[Quantity] | None = None, mirror: Literal["xy", "xz", "yz"] | None = None,
    ) -> None:  # fmt: skip
        """Ready-made legs between markers, one for each pair; leg ``leg1`` adds ``leg1.lower``, ``leg1.P``, ..

        Parameters
        ----------
        type
            The letters of its joints, from the base on: a kind of leg, or any row of two to eight of R, P, C, U, S, "PRRR".
        base, platform
            Markers of the first and last joints.
        name, names
            Legs are called by the name, "leg", and a number; or by these names.
        axis, rail, zero
            In the base link's axes: of the crank's hinge or the first axis of the universal joint; of the slide; where the crank points at
            angle zero.
        top_axis
            In the platform's axes: of the universal joint there; from the second rod to the first.
        elbow
            1 or -1: the rod is turned from the crank's direction about the hinge forwards or backwards.
        width
            Distance of the two rods of "R(SS)2" [m].
        lower, upper, barrel, carriage, crank, rod
            Mass properties of its links, as far as the kind has them, of cranks and rods with ``length`` [m]: ``{"mass": .., "cog": ..}``.
        axes, links
            Of a row of letters, as drawn with all joint variables zero: direction of each joint, of a universal joint both; link between
            each two, ``{"to": [0, 0, 0.3], "mass": ..}`` with the way to its next joint [m].
        stiffness
            Of its joints, where reactions are shared by stiffness: one for all, or one a joint.
        actuated
            False: the legs are not driven.
        start
            About where the driven joint is at the start [m, rad]; of a row of letters a list, one for each joint.
        repeat, about, angles, mirror
            It is there several times: copies, axis, angles [rad], plane of images.
        """
        self._add("chain", locals())

    # ------------------------------------------------------------------------------------------------------------- motion
    def coordinate(
        self, joint: str | Joint | None = None, *, variable: str | None = None, link: str | Link | None = None, marker: str | None = None,
        components: Sequence[Literal["x", "y", "z", "roll", "pitch", "yaw"]] | None = None, relative_to: str | Link | None = None,
        start: Quantity | Mapping[str, Any] | None = None, motion: Law | None = None, driven: bool | None = None, repeat: int | None = None,
    ) -> None:  # fmt: skip
        """What moves the mechanism: a joint variable, or the pose of a link.

        Parameters
        ----------
        joint, variable
            The coordinate is this joint's variable; which one, if it has several.
        link, marker
            Instead: the pose of a link, or of a marker of it.
        components
            Of the pose: which of x, y, z, roll, pitch, yaw are coordinates; default: all.
        relative_to
            The link that sees the pose; default: the frame.
        start
            Position [m, rad], or ``{"position": .., "velocity": ..}``; of a pose ``{"position": (..), "angles": (..)}``.
        motion
            Law of time, see `linkdyn.laws`; of a pose one for each component, ``{"x": .., "yaw": ..}``, or ``{"table": "motion.csv"}``.
        driven
            True: a forward run follows the motion, too.
        repeat
            Copies.
        """
        self._add("coordinate", locals())

    def time(self, *, start: Quantity | None = None, end: Quantity | None = None, step: Quantity | None = None, samples: int | None = None) -> None:
        """Instants of a run along the motion, both ends included.

        Parameters
        ----------
        start, end
            First and last [s]; default: as long as the laws go.
        step
            Between them [s].
        samples
            How many, instead of ``step``; default 201.
        """
        self._set("time", locals())

    # ------------------------------------------------------------------------------------------------------------- forces
    def actuator(
        self, joint: str | Joint, *, variable: str | None = None, name: str | None = None, share: Quantity | None = None,
        preload: Quantity | None = None, law: Mapping[str, Any] | None = None, drive: Drive | None = None,
        cylinder: Cylinder | None = None, repeat: int | None = None,
    ) -> str:  # fmt: skip
        """A driven joint variable; inverse dynamics finds its force or torque.

        Parameters
        ----------
        joint, variable
            The joint; which variable, if it has several.
        name
            Of its own, where another drives the same variable.
        share
            Where there are more drives than coordinates: its part.
        preload
            What it gives besides, held by the other drives [N, N m].
        law
            What it does in forward runs, see `linkdyn.efforts`.
        drive
            The motor behind it: ratio or lead [m], inertia [kg m^2], efficiency, ..
        cylinder
            The hydraulic or pneumatic cylinder behind it, and its valve: bore, rod [m], stroke, supply [Pa], ..
        repeat
            Copies.

        Returns
        -------
        str
            What it is called, as controllers want it: "J1", "C.slide", "J1:brake".
        """
        self._add("actuator", locals())
        one_of_several = variable is not None and self._kind_of(str(joint)) not in WITH_ONE_VARIABLE
        return f"{joint}{f'.{variable}' if one_of_several else ''}{f':{name}' if name else ''}"

    def controller(
        self, actuator: str | Joint, *, target: Law | Literal["motion"], kp: Quantity | None = None, ki: Quantity | None = None,
        kd: Quantity | None = None, filter: Quantity | None = None, damps: Literal["error", "measured"] | None = None,
        at: Literal["joint", "motor", "terminals", "valve"] | None = None, joint: str | Joint | None = None, variable: str | None = None,
        coordinate: str | None = None, measure: str | None = None, limit: Quantity | None = None, min: Quantity | None = None,
        max: Quantity | None = None, anti_windup: Literal["none", "clamp", "back-calculation"] | None = None,
        tracking_time: Quantity | None = None, feed_forward: Law | Literal["gravity", "inverse"] | None = None,
        rate: Quantity | None = None, delay: Quantity | None = None, delay_samples: int | None = None,
        resolution: Quantity | None = None, output_resolution: Quantity | None = None, name: str | None = None, repeat: int | None = None,
    ) -> None:  # fmt: skip
        """What drives an actuator in forward runs: PD or PID, continuous or sampled.

        Parameters
        ----------
        actuator
            Name of the actuator, which is that of its joint.
        target
            Set point: a number, a text with its unit, a law of time, a formula, or "motion", the scene's own.
        kp, ki, kd
            Gains of the error, its integral, its rate: output over what is measured, /s, s.
        filter
            Time constant of what kd gives [s].
        damps
            kd acts on the rate of the error, or of the measured value alone.
        at
            Where the output acts: force at the joint, torque of the motor [N m], voltage at its terminals [V], opening of the cylinder's valve.
        joint, variable, coordinate, measure
            What is measured; default: the actuator's joint variable.
        limit, min, max
            Of the output: both ways, or each.
        anti_windup, tracking_time
            What becomes of the integral at a limit; the time in which it is led back [s].
        feed_forward
            What goes out besides: a law, a formula, "gravity" or "inverse".
        rate
            Samples in a second, "1 kHz"; default: it is continuous.
        delay, delay_samples
            From a sample to the output that comes of it [s], or in samples.
        resolution, output_resolution
            Steps of what is measured, and of the output.
        name
            Its name; default: that of its actuator.
        repeat
            Copies.
        """
        self._add("controller", locals())

    def load(
        self, on: str, *, force: Sequence[Law] | Mapping[str, Law] | None = None, moment: Law | Sequence[Law] | None = None,
        axes: Literal["world", "link"] | None = None, table: str | os.PathLike[str] | None = None, time: str | None = None,
        interpolation: Literal["spline", "linear"] | None = None, repeat: int | None = None,
    ) -> None:  # fmt: skip
        """A force and a moment on a marker.

        Parameters
        ----------
        on
            The marker.
        force
            Components [N]: numbers, texts with units, laws of time, formulas; or ``{"z": ..}``.
        moment
            The same [N m]; in a plane one.
        axes
            "world" or "link".
        table, time, interpolation
            Instead: a CSV file with columns Fx .. Mz, as of `linkdyn.laws.table`.
        repeat
            Copies.
        """
        self._add("load", locals())

    def spring(
        self, name: str, *, between: Sequence[str] | None = None, joint: str | Joint | None = None, variable: str | None = None,
        stiffness: Quantity | None = None, damping: Quantity | None = None, rest: Quantity | None = None, force: str | Mapping[str, Any] | None = None,
        repeat: int | None = None,
    ) -> None:  # fmt: skip
        """A spring and damper between two markers or at a joint.

        Parameters
        ----------
        name
            Its name.
        between
            Two markers, which it pulls together.
        joint, variable
            Instead: the joint variable that it acts at.
        stiffness
            [N/m, N m/rad]
        damping
            [N s/m, N m s/rad]
        rest
            Where it has no force [m, rad].
        force
            Formula of ``stretch`` and ``rate``, or table over the state, on top [N, N m].
        repeat
            Copies.
        """
        self._add("spring", locals())

    def friction(
        self, joint: str | Joint, *, coulomb: Quantity | None = None, radius: Quantity | None = None, length: Quantity | None = None,
        collar: Quantity | None = None, preload: Quantity | None = None, static: Quantity | None = None, stribeck_speed: Quantity | None = None,
        viscous: Quantity | None = None, creep_speed: Quantity | None = None, sticking: bool | None = None, efficiency: Quantity | None = None,
        repeat: int | None = None,
    ) -> None:  # fmt: skip
        """Friction in a joint, made by its own reaction.

        Parameters
        ----------
        joint
            The joint.
        coulomb
            Coefficient where the surfaces slide fast.
        radius, length, collar
            Of the pin, ball, bush or thread; of the pin or guide; of the face that takes the force along a pin [m].
        preload
            Presses besides [N].
        static, stribeck_speed
            Coefficient where it begins to slide, and the speed over which it falls [m/s].
        viscous
            Damping beside it [N s/m, N m s/rad].
        creep_speed
            Speed below which friction goes to zero [m/s].
        sticking
            True: in forward runs it holds what rests, as a `clutch` does.
        efficiency
            Of the teeth of a gear or rack, instead of `coulomb`, or of a belt; of a worm while it drives.
        repeat
            Copies.
        """
        self._add("friction", locals())

    def measure(
        self, name: str, *, joint: str | Joint | None = None, variable: str | None = None, coordinate: str | None = None, marker: str | None = None,
        component: Literal["x", "y", "z"] | None = None, relative_to: str | Link | None = None, between: Sequence[str] | None = None,
        axes: Sequence[str] | None = None, twist: Sequence[str] | None = None, rate: bool | None = None, near: Quantity | None = None,
    ) -> str:  # fmt: skip
        """A number that forces may depend on; its name, for formulas.

        Parameters
        ----------
        name
            Letters, digits and ``_``.
        joint, variable
            It is this joint variable [m, rad],
        coordinate
            or this coordinate [m, rad],
        marker, component, relative_to
            or the place of this marker [m], as that link sees it,
        between
            or the distance of these two markers [m],
        axes
            or the angle between the axes of these two [rad],
        twist
            or how far the second of these two is turned about its axis, once that is back along the first's [rad].
        rate
            True: how fast that changes.
        near
            Angle within half a turn of which it is taken [rad].
        """
        return self._named("measures", name, table_of(_without(locals(), "name")))

    def law(self, name: str, value: str | Mapping[str, Any]) -> str:
        """A force law over the state; its name, for formulas.

        Parameters
        ----------
        name
            Letters, digits and ``_``.
        value
            A formula of measures, variables and other laws, or ``laws.table(.., over=..)``.
        """
        return self._named("laws", name, plain(value))

    def variable(self, name: str, value: Quantity) -> str:
        """A number with a name, which ``with_`` and sweeps may vary; the name, for arithmetic: ``f"{L}/2 + 12 mm"``.

        Parameters
        ----------
        name
            Letters, digits and ``_``.
        value
            A number, or a text with its unit: "300 mm", "L/2".
        """
        return self._named("variables", name, plain(value))

    # --------------------------------------------------------------------------------------------------- runs and sweeps
    def event(
        self, name: str, *, when: str, direction: Literal["up", "down", "both"] | None = None, do: Literal["note", "stop"] | None = None,
        repeat: int | None = None,
    ) -> str:  # fmt: skip
        """What a forward run looks out for: a number that crosses zero.

        Parameters
        ----------
        name
            Its name.
        when
            Formula of measures, laws and time.
        direction
            Which crossings count.
        do
            Note it, or end the run there.
        repeat
            Copies.

        Returns
        -------
        str
            Its name, as brakes and clutches want it.
        """
        self._add("event", locals())
        return name

    def stop(
        self, name: str, joint: str | Joint | None = None, *, variable: str | None = None, coordinate: str | None = None,
        measure: str | None = None, min: Quantity | None = None, max: Quantity | None = None, stiffness: Quantity | None = None,
        damping: Quantity | None = None, coulomb: Quantity | None = None, creep_speed: Quantity | None = None,
        restitution: Quantity | None = None, repeat: int | None = None,
    ) -> None:  # fmt: skip
        """An end stop of a joint variable, a component of a pose or a measure: it gives way like a spring, or throws back.

        Parameters
        ----------
        name
            Its name.
        joint, variable
            The joint; which variable, if it has several,
        coordinate
            or this coordinate,
        measure
            or this measure of a place: a marker's coordinate, a distance, a tilt.
        min, max
            Where contact begins [m, rad].
        stiffness, damping
            It gives way [N/m, N m/rad], [N s/m, N m s/rad].
        coulomb, creep_speed
            A marker that is pushed rubs across the push with this coefficient; the speed below which it creeps [m/s].
        restitution
            It throws back: speed after an impact over the speed before.
        repeat
            Copies.
        """
        self._add("stop", locals())

    def clutch(
        self, name: str, joint: str | Joint | None = None, *, variable: str | None = None, to: str | Joint | None = None,
        to_variable: str | None = None, between: Sequence[str] | None = None,
        type: Literal["fixed", "spherical", "revolute", "cylindrical", "prismatic", "planar"] | None = None, ratio: Quantity | None = None, capacity: Law | None = None, static: Quantity | None = None, from_: Quantity | None = None,
        until: Quantity | None = None, from_event: str | None = None, until_event: str | None = None,
        begins: Literal["on", "off"] | None = None, repeat: int | None = None,
    ) -> None:  # fmt: skip
        """A clutch, brake, dry friction or lock of a joint variable, or between two of them, or what joins two links, in forward runs.

        Parameters
        ----------
        name
            Its name.
        joint, variable
            The joint; which variable, if it has several. Default: all of them, without `capacity`.
        between, type
            Instead of a joint two markers ``"link.marker"``, held to each other as they stand where it closes: as a weld holds them, or as
            a joint of that type would, with the axes of the first.
        to, to_variable
            The other joint; default: the clutch holds `joint` itself, as a brake does.
        ratio
            It holds the rate of `joint` at `ratio` times that of `to`.
        capacity
            Force or torque that it has when it slips: a number, a text with its unit, a law of time, a formula. Default: it never slips.
        static
            What it holds over that, 1 or more.
        from_, until, from_event, until_event
            When it closes and opens: instants [s], names of events.
        begins
            "on" or "off": before any of these.
        repeat
            Copies.
        """
        self._add("clutch", locals())

    def sweep(self, table: Mapping[str, Any]) -> None:
        """What a sweep varies, bounds and reduces.

        Parameters
        ----------
        table
            As docs/sweep.md has it: ``{"axis": [..], "reduce": [..]}``.
        """
        self._content["sweep"] = plain(table)

    # -------------------------------------------------------------------------------------------------------------- inside
    def _add(self, table: str, keys: Mapping[str, Any]) -> Table:
        """Another ``[[table]]`` of the arguments of the method that asks."""
        if isinstance(taken := keys.get("joint"), Link):
            hint = f"link={taken.name}" if "link" in keys else "one of its joints"
            raise SceneError(f"{table}: joint: {taken.name!r} is a link, no joint (expected {hint})")
        entries = self._content.setdefault(table, [])
        self._places[table, len(entries)] = _caller()
        entries.append(table_of(_without(keys)))
        added: Table = entries[-1]
        return added

    def _joint(self, type: str, keys: Mapping[str, Any]) -> Joint:
        between = {"name": keys["name"], "type": type, "between": [keys["first"], keys["second"]]}
        self._add("joint", between | _without(keys, "name", "first", "second"))
        return Joint(keys["name"])

    def _kind_of(self, joint: str) -> str | None:
        """Type of a joint that was built here; None: of a chain, or one of several copies."""
        return next((table["type"] for table in self._content.get("joint", []) if table.get("name") == joint), None)

    def _set(self, table: str, keys: Mapping[str, Any]) -> None:
        self._content[table] = table_of(_without(keys))

    def _named(self, table: str, name: str, value: Any) -> str:
        self._content.setdefault(table, {})[name] = value
        return name


def _without(keys: Mapping[str, Any], *names: str) -> Table:
    return {key: value for key, value in keys.items() if key not in ("self", *names)}


def _caller() -> str:
    """File and line of the program that builds."""
    frame = sys._getframe(2)
    while frame.f_back is not None and frame.f_code.co_filename == __file__:
        frame = frame.f_back
    return f"{frame.f_code.co_filename}:{frame.f_lineno}"
