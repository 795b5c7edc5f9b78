"""What the command linkdyn takes, read from the help that it prints: for completions and the manual page."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

SOURCES = Path(__file__).resolve().parent.parent / "python"
COMMAND = re.compile(r"^  linkdyn (\w+) (SCENE\S*|\[KIND\])(?: \[options\])? +(.*)$", re.M)
OPTION = re.compile(r"^  (-.*?)  +(\S.*(?:\n {8,}\S.*)*)", re.M)
SUFFIXES = {"SCENE": ["toml"], "SCENE|RUN.nc": ["toml", "nc"], "SCENE|ROBOT": ["toml", "xml", "urdf"], "[KIND]": []}
IN_PACKAGE = {"view": "_commands.view", "draw": "_commands.draw", "balance": "_commands.balance", "new": "_commands.new", "assemblies": "_commands.assemblies",
              "convert": "_commands.convert"}
"""Commands that are a part of the Python package, and where."""


@dataclass(frozen=True)
class Option:
    """One option, under its names."""

    names: tuple[str, ...]
    value: str
    """What it takes: FILE, NAME, LIST, ...; empty: nothing."""
    text: str

    @property
    def choices(self) -> list[str]:
        """The words that a NAME or LIST may be, if its text enumerates some."""
        if self.value not in ("NAME", "LIST"):
            return []
        plain = re.sub(r"\([^)]*\)", "", self.text).partition("such as")[0].replace("all of these", "all")
        parts = re.split(r"[,;:]| or | and ", f" {plain}")
        words = [part.strip() for part in parts if re.fullmatch(r"\s*(?!default\b)[a-z][\w-]*\s*", part)]
        return words if len(words) > 1 else []


@dataclass(frozen=True)
class Command:
    """One command with its options."""

    name: str
    argument: str
    summary: str
    text: str
    """A paragraph."""
    options: tuple[Option, ...]
    words: tuple[str, ...] = ()
    """What the argument may be, if it is no file."""


def parse_options(text: str) -> tuple[Option, ...]:
    """The lines of a help text that start with an option. Names end with what they take: "--rtol R, --atol A" are two options."""
    found = []
    for heads, meaning in OPTION.findall(text):
        names: list[str] = []
        for head in heads.split(", "):
            name, _, value = head.partition(" ")
            names.append(name)
            if value or head is heads.split(", ")[-1]:
                found.append(Option(tuple(names), value, " ".join(meaning.split())))
                names = []
        if names:
            found.append(Option(tuple(names), "", " ".join(meaning.split())))
    return tuple(found)


def command_in_package(name: str, argument: str, summary: str) -> Command:
    """What a command of the Python package says of itself."""
    if str(SOURCES) not in sys.path:
        sys.path.insert(0, str(SOURCES))
    sys.dont_write_bytecode = True
    module = importlib.import_module(f"linkdyn.{IN_PACKAGE[name]}")
    parser = module.parser()
    options = tuple(Option(tuple(a.option_strings), a.metavar or "", a.help or "") for a in parser._actions if a.option_strings)
    words = tuple(module.kinds()) if argument == "[KIND]" else ()
    return Command(name, argument, summary, " ".join((parser.description or "").split()), options, words)


def commands_of(executable: str) -> list[Command]:
    """All commands, in the order of the help."""

    def help_of(*words: str) -> str:
        return subprocess.run([executable, *words, "--help"], capture_output=True, text=True, check=True).stdout

    found = []
    for name, argument, summary in COMMAND.findall(help_of()):
        if name in IN_PACKAGE:
            found.append(command_in_package(name, argument, summary))
        else:
            said = help_of(name)
            found.append(Command(name, argument, summary, " ".join(said.split("\n\n")[1].split()), parse_options(said)))
    return found
