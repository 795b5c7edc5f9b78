"""Write the manual page of the command linkdyn, from the help that it prints.

Usage: write_man_page.py EXECUTABLE FILE
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from command_help import Command, Option, commands_of

STATUSES = (
    ("0", "Done."),
    ("2", "Bad input, or a file that cannot be written; one line on standard error says which and why."),
    ("3", "Done, but some samples failed: they are flagged, and NaN in the results."),
    ("130, 143", "Interrupted; a forward run's file has what was computed."),
)


def man(commands: list[Command], version: str) -> str:
    """The page, section 1."""

    def roff(text: str) -> str:
        text = text.replace("\\", "\\e").replace("-", "\\-")
        return "\\&" + text if text[:1] in ".'" else text

    def heads(option: Option) -> str:
        value = f" \\fI{roff(option.value)}\\fR" if option.value else ""
        return ", ".join(f"\\fB{roff(name)}\\fR" for name in option.names) + value

    lines = [
        f'.TH LINKDYN 1 "" "linkdyn {version}" "User Commands"',
        ".SH NAME", "linkdyn \\- forces and motion of link mechanisms",
        ".SH SYNOPSIS",
    ]
    for command in commands:
        lines += [f".B linkdyn {command.name}", f"\\fI{roff(command.argument)}\\fR [\\fIoptions\\fR]", ".br"]
    lines += [
        ".SH DESCRIPTION",
        "Computes planar and spatial mechanisms of links and joints with closed loops, as a scene file (TOML) describes them: "
        "driving forces and all joint reactions from a motion, or the motion from driving forces.",
        ".SH COMMANDS",
    ]
    for command in commands:
        lines += [f".SS linkdyn {command.name} {roff(command.argument)}", roff(command.text)]
        for option in command.options:
            lines += [".TP", heads(option), roff(option.text)]
    lines.append(".SH EXIT STATUS")
    for code, meaning in STATUSES:
        lines += [".TP", f".B {code}", roff(meaning)]
    lines += [".SH ENVIRONMENT", ".TP", ".B LINKDYN_REAL128", "Path of the executable in quadruple precision, the measure of \\fBlinkdyn study\\fR."]
    return "\n".join(lines) + "\n"


def main(executable: str, file: str) -> None:
    version = subprocess.run([executable, "--version"], capture_output=True, text=True, check=True).stdout.split()[1]
    Path(file).write_text(man(commands_of(executable), version), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
