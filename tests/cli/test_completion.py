"""What shells and `man` know of the command, as it is installed."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from linkdyn.cli import executable

pytestmark = pytest.mark.python_alone

SHARE = Path(sys.prefix) / "share"
COMMANDS = ("inverse", "forward", "sweep", "study", "generate", "view", "new", "convert", "explain")


def options_of(command: str) -> set[str]:
    """Long options in the command's help."""
    said = subprocess.run([sys.executable, "-m", "linkdyn", command, "--help"], capture_output=True, text=True, check=True).stdout
    return set(re.findall(r"--[a-z]+(?:-[a-z]+)*", re.sub(r"^(?!\s+-).*$", "", said, flags=re.M)))


@pytest.mark.parametrize("file", ["bash-completion/completions/linkdyn.bash", "zsh/site-functions/_linkdyn", "fish/vendor_completions.d/linkdyn.fish",
                                  "man/man1/linkdyn.1"])
def test_all_commands_and_options_are_known(file):
    text = (SHARE / file).read_text().replace("\\-", "-")
    for command in COMMANDS:
        assert command in text
        for option in options_of(command):
            shown = f"-l {option[2:]} " if file.endswith(".fish") else option
            assert shown in f"{text} ", f"{command} {option}"


@pytest.mark.parametrize(("typed", "offered"), [
    (["i"], "inverse"),
    (["--v"], "--version"),
    (["inverse", "--wa"], "--want"),
    (["inverse", "--want", "driving_force,rea"], "driving_force,reaction"),
    (["inverse", "--solver", "gauss"], "gauss-jordan gauss-jordan-plain"),
    (["forward", "--method", "rk"], "rk8pd rkf45 rk4"),
    (["inverse", "--threads", ""], ""),
    (["inverse", "s"], "scene.toml"),
    (["view", "r"], "run.nc"),
    (["generate", "--kernel", "kin"], "kinematics"),
    (["inverse", "--code", ""], "avx512 avx2 scalar interpreter"),
    (["forward", "--want", "driving_force,c"], "driving_force,checks driving_force,controller driving_force,clutch driving_force,cylinder"),
    (["generate", "--want", "driving_force,vel"], "driving_force,velocity"),
    (["new", "h"], "hexapod"),
    (["convert", "s"], "scene.toml"),
    (["convert", "--clo"], "--closing"),
    (["convert", "--closing", "sp"], "spherical"),
    (["new", "--f"], "--force"),
    (["inverse", "r"], ""),
])
def test_bash(typed, offered, tmp_path):
    for name in ("scene.toml", "scene.png", "run.nc"):
        (tmp_path / name).touch()
    script = """source "$1"; shift; COMP_WORDS=(linkdyn "$@"); COMP_CWORD=$#; _linkdyn; echo "${COMPREPLY[@]}" """
    command = ["bash", "-c", script, "bash", SHARE / "bash-completion" / "completions" / "linkdyn.bash", *typed]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert (done.stdout.strip(), done.stderr) == (offered, "")


def test_manual_page_says_what_help_says():
    page = (SHARE / "man" / "man1" / "linkdyn.1").read_text()
    version = subprocess.run([executable(), "--version"], capture_output=True, text=True, check=True).stdout.split()[1]
    assert page.startswith(f'.TH LINKDYN 1 "" "linkdyn {version}"')
    lines = page.splitlines()
    assert lines[lines.index(".B 3") + 1].startswith("Done, but some samples failed")
    assert not [line for line in lines if line.startswith(".") and not re.match(r"\.(TH|SH|SS|TP|B|br)\b", line)]
