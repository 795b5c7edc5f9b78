"""Write the completion of the command linkdyn for a shell, from the help that it prints.

Usage: write_completion.py EXECUTABLE SHELL FILE    SHELL: bash, zsh, fish
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from command_help import SUFFIXES, Command, Option, commands_of

BASH = """\
# Completion of linkdyn for bash. Written from its help by tools/write_completion.py.
_linkdyn() {
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} list=""
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "%(commands)s --help --version" -- "$word"))
        return
    fi
    case "${COMP_WORDS[1]} $before" in
%(values)s    esac
    if [ -n "$list" ]; then
        case "$word" in
            *,*) COMPREPLY=($(compgen -P "${word%%,*}," -W "$list" -- "${word##*,}")) ;;
            *) COMPREPLY=($(compgen -W "$list" -- "$word")) ;;
        esac
        return
    fi
    case "${COMP_WORDS[1]}:$word" in
%(options)s        *) COMPREPLY=($(compgen -d -S / -- "$word") $(compgen -f -X '!*.toml' -- "$word")) ;;
    esac
}
complete -o nospace -F _linkdyn linkdyn
"""


def bash(commands: list[Command]) -> str:
    """For bash."""
    values, options = "", ""
    for command in commands:
        names = " ".join(name for option in command.options for name in option.names)
        options += f'        {command.name}:-*) COMPREPLY=($(compgen -W "{names}" -- "$word")) ;;\n'
        for option in (option for option in command.options if option.value):
            pattern = "|".join(f'"{command.name} {name}"' for name in option.names)
            action = "return"
            if option.choices:
                action = f'list="{" ".join(option.choices)}"'
            elif option.value == "FILE":
                action = 'COMPREPLY=($(compgen -f -- "$word")); return'
            values += f"        {pattern}) {action} ;;\n"
        if len(SUFFIXES[command.argument]) > 1:
            files = " ".join(f"""$(compgen -f -X '!*.{suffix}' -- "$word")""" for suffix in SUFFIXES[command.argument])
            options += f'        {command.name}:*) COMPREPLY=($(compgen -d -S / -- "$word") {files}) ;;\n'
        if command.words:
            options += f'        {command.name}:*) COMPREPLY=($(compgen -W "{" ".join(command.words)}" -- "$word")) ;;\n'
    return BASH % {"commands": " ".join(command.name for command in commands), "values": values, "options": options}


ZSH = """\
#compdef linkdyn
# Completion of linkdyn for zsh. Written from its help by tools/write_completion.py.
_linkdyn() {
    local -a commands=(
%(commands)s    )
    if (( CURRENT == 2 )); then
        _describe command commands
        _arguments --help'[what the commands are]' --version'[the version]'
        return
    fi
    local command=$words[2]
    words=("$words[1]" "${(@)words[3,-1]}")
    (( CURRENT -= 1 ))
    case $command in
%(options)s    esac
}
_linkdyn "$@"
"""


def zsh(commands: list[Command]) -> str:
    """For zsh."""
    def plain(text: str) -> str:
        return re.sub(r"([\[\]:'\\])", lambda m: "'\\''" if m[1] == "'" else "\\" + m[1], text)

    def taken(option: Option) -> str:
        if option.choices:
            words = " ".join(option.choices)
            return f":{option.value}:_values -s , {option.value} {words}" if option.value == "LIST" else f":{option.value}:({words})"
        return f":{option.value}:" + ("_files" if option.value == "FILE" else "") if option.value else ""

    lines, cases = "", ""
    for command in commands:
        lines += f"        '{command.name}:{plain(command.summary)}'\n"
        cases += f"        {command.name})\n            _arguments \\\n"
        for option in command.options:
            alone = f"({' '.join(option.names)})"
            for name in option.names:
                cases += f"                '{alone}{name}[{plain(option.text.partition(';')[0])}]{taken(option)}' \\\n"
        suffixes = "|".join(SUFFIXES[command.argument])
        offered = f"({' '.join(command.words)})" if command.words else f'_files -g "*.({suffixes})"'
        cases += f"                '1:{plain(command.argument)}:{offered}' ;;\n"
    return ZSH % {"commands": lines, "options": cases}


def fish(commands: list[Command]) -> str:
    """For fish."""
    def quoted(text: str) -> str:
        return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"

    lines = ["# Completion of linkdyn for fish. Written from its help by tools/write_completion.py.", "complete -c linkdyn -f"]
    for name in ("help", "version"):
        lines.append(f"complete -c linkdyn -n __fish_use_subcommand -l {name}")
    for command in commands:
        seen = f"-n '__fish_seen_subcommand_from {command.name}'"
        lines.append(f"complete -c linkdyn -n __fish_use_subcommand -a {command.name} -d {quoted(command.summary)}")
        for suffix in SUFFIXES[command.argument]:
            lines.append(f"complete -c linkdyn {seen} -a '(__fish_complete_suffix .{suffix})'")
        if command.words:
            lines.append(f"complete -c linkdyn {seen} -a '{' '.join(command.words)}'")
        for option in command.options:
            names = " ".join(f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}" for name in option.names)
            takes = {"": "", "FILE": " -r -F"}.get(option.value, " -x")
            if option.value == "LIST" and option.choices:
                takes += f" -a \"(__fish_complete_list , 'string split \\  -- {' '.join(option.choices)}')\""
            elif option.choices:
                takes += f" -a '{' '.join(option.choices)}'"
            lines.append(f"complete -c linkdyn {seen} {names}{takes} -d {quoted(option.text.partition(';')[0])}")
    return "\n".join(lines) + "\n"


def main(executable: str, shell: str, file: str) -> None:
    write = {"bash": bash, "zsh": zsh, "fish": fish}[shell]
    Path(file).write_text(write(commands_of(executable)), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
