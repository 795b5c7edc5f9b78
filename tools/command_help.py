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
IN_PACKAGE = {file.stem for file in (SOURCES / "linkdyn" / "_commands").glob("[a-z]*.py")}
"""Commands that are a part of the Python package, which has a module for each."""


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
    """The lines of a help text that start with an option, as "-o, --output FILE"."""

    def option(head: str, meaning: str) -> Option:
        *others, last = head.split(", ")
        name, _, value = last.partition(" ")
        return Option((*others, name), value, " ".join(meaning.split()))

    return tuple(option(head, meaning) for head, meaning in OPTION.findall(text))


def command_in_package(name: str, argument: str, summary: str) -> Command:
    """What a command of the Python package says of itself."""
    if str(SOURCES) not in sys.path:
        sys.path.insert(0, str(SOURCES))
    sys.dont_write_bytecode = True
    module = importlib.import_module(f"linkdyn._commands.{name}")
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
