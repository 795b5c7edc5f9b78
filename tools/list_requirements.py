"""Print the requirements of pyproject.toml, one a line, for pip.

Usage: list_requirements.py GROUP...    GROUP: build, run, or the name of an optional dependency
"""

import sys
import tomllib
from pathlib import Path


def main(*groups: str) -> None:
    table = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text(encoding="utf-8"))
    known = {
        "build": table["build-system"]["requires"],
        "run": table["project"]["dependencies"],
        **table["project"]["optional-dependencies"],
    }
    for group in groups:
        print("\n".join(known[group]))


if __name__ == "__main__":
    main(*sys.argv[1:])
