"""The command ``linkdyn balance``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from .common import Parser, draw_into_files, refuse, say

if TYPE_CHECKING:
    from .._cycle.balance import Balance

__all__ = ["balance_command", "parser"]

DESCRIPTION = """\
Counterweights on links that turn about a hinge of the frame, so that the forces of inertia shake the frame less along the scene's motion:
mass times distance and direction for each link, the force before and after."""
ENDINGS = (".png", ".svg", ".pdf")


def parser() -> Parser:
    """What the command takes."""
    balance = Parser("balance", "SCENE", DESCRIPTION)
    add = balance.add_argument
    add("scene", metavar="SCENE", help="a scene file whose motion is one cycle, or several")
    add("--links", metavar="LIST", help="that may carry a counterweight, with commas between; default: all hinged to the frame")
    add("--minimise", metavar="NAME", default="rms", help="of the force: rms (default), peak or harmonics")
    add("--harmonics", metavar="LIST", help="which of them, such as 1,2: waves a turn of the crank; default 1")
    add("-o", "--output", metavar="FILE", help="a picture of the force before and after, .png, .svg or .pdf; default: none")
    balance.add_last()
    return balance


def balance_command(arguments: Sequence[str]) -> int:
    """Say what was found; the exit status."""
    options = parser().parse_args(arguments)
    file = Path(options.output) if options.output is not None else None
    if file and file.suffix.lower() not in ENDINGS:
        return refuse(f"balance: {str(file)!r} (expected a file that ends in {', '.join(ENDINGS)})")
    if options.harmonics is not None and options.minimise != "harmonics":
        return refuse("balance: --harmonics goes with --minimise harmonics")
    draw_into_files()
    from .._cycle.balance import balance
    from .._output import picture
    from ..errors import LinkdynError
    from ..scene import Scene

    try:
        links = None if options.links is None else [name for name in options.links.split(",") if name]
        scene = Scene(Path(options.scene))
        found = balance(scene, links, options.minimise, _numbers(options.harmonics or "1"))
        if file:
            picture(found.plot(), options.output, scene._inputs(), dpi=150)
    except LinkdynError as error:
        return refuse(str(error))
    except OSError as error:
        return refuse(f"{error.filename or file}: {error.strerror or error}")
    say(told(found))
    if file and not options.quiet:
        say(f"\n  picture          {options.output}")
    return 0


def told(found: Balance) -> str:
    """The tables that the command prints."""
    import numpy as np

    lines = [found.scene.title, "", f"  {'counterweight':<20}{'m r [kg m]':>14}{'angle [deg]':>14}" + ("" if found.scene.planar else "   direction in link axes")]
    for (name, row), moment in zip(found.counterweights.iterrows(), found.moment):
        size = float(row.moment)
        angle = f"{np.degrees(row.angle):14.4g}" if size > 0 and found.scene.planar else f"{'':>14}"
        direction = "" if found.scene.planar or size == 0 else "   (" + ", ".join(f"{x / size:.4g}" for x in moment) + ")"
        lines.append(f"  {name:<20}{size:14.6g}{angle}{direction}")
    lines += ["", f"  {'force of inertia [N]':<20}{'before':>14}{'after':>14}"]
    largest = float(found.figures.before.max())
    for name, row in found.figures.iterrows():
        values = (0.0 if abs(value) < 1e-12 * largest else value for value in (row.before, row.after))     # rounding
        lines.append(f"  {name:<20}" + "".join(f"{value:14.6g}" for value in values))
    if not found.is_cycle:
        lines.append("  no closed cycle: the motion does not end as it begins, and has no harmonics (expected [time] to be one cycle)")
    if found.coarse:
        lines.append(f"  sampling: {found.coarse}")
    if found.above_least > 0:
        lines.append(f"  the peak is at most {100 * found.above_least:.2g} % above the least there is")
    return "\n".join(lines)


def _numbers(text: str) -> list[int]:
    from ..errors import InputError

    try:
        return [int(word) for word in text.split(",") if word]
    except ValueError:
        raise InputError(f"balance: --harmonics: expected whole numbers with commas between, got {text!r}") from None
