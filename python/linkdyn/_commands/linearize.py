"""``linkdyn linearize``: poles of a mechanism near a state."""

from __future__ import annotations

from collections.abc import Sequence

from .common import Parser, refuse, say

__all__ = ["linearize_command", "parser"]

ROUNDING = 1e-7
"""Of the largest pole: a smaller one is none, but for rounding (that of a mass that moves freely is double)."""
DESCRIPTION = """\
Linearize a mechanism at its start, or at an instant of its motion, and print the poles: how fast each motion near there fades or grows, and how
often it swings. Scene.linearize of the Python package has the matrices."""


def parser() -> Parser:
    """What the command takes."""
    command = Parser("linearize", "SCENE", DESCRIPTION)
    add = command.add_argument
    add("scene", metavar="SCENE", help="the scene file")
    add("--at", metavar="T", type=float, help="instant of the scene's motion [s]; its start unless given")
    command.add_last()
    return command


def linearize_command(arguments: Sequence[str]) -> int:
    """Print the table; the exit status."""
    options = parser().parse_args(arguments)
    from ..errors import LinkdynError
    from ..scene import load

    try:
        scene = load(options.scene)
        lin = scene.linearize(options.at)
    except LinkdynError as error:
        return refuse(str(error))
    say(scene.title or options.scene)
    say(f"  at {float(lin.time):g} s{', an equilibrium' if lin.is_equilibrium else ', on a motion: no equilibrium'}")
    say("     frequency    damping   time constant")
    least = ROUNDING * float(lin.frequency.max())
    for pole in range(lin.sizes["pole"]):
        growth, turning, frequency, damping = (
            float(lin[name][pole]) for name in ("growth", "angular_frequency", "frequency", "damping_ratio")
        )
        if frequency <= least:
            say(_line("", "", "", "moves freely"))
        elif turning >= 0.0:    # of a pair one line
            fate = "fades" if growth < 0.0 else "grows"
            constant = f"{1 / abs(growth):.4g} s" if growth else ""
            if turning:
                say(_line(f"{frequency:.4g} Hz", f"{100 * damping + 0.0:.3g} %", constant, f"swings and {fate}" if growth else "swings"))
            else:
                say(_line("", "", constant, fate))
    return 0


def _line(frequency: str, damping: str, constant: str, words: str) -> str:
    """One pole in numbers and words."""
    return f"  {frequency:>12} {damping:>10} {constant:>15}   {words}"
