"""Check that what pages and comments name is there: paths, links with their anchors, names of the code, names in the modules said to have them.

Usage: check_docs.py [ROOT]

Prints one line per finding; exit status 1 if there is any. Looked at are README.md, CONTRIBUTING.md, the pages of docs/, and what
comments and docstrings of the engine and the package have in `backticks`.
"""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath

PAGES = re.compile(r"^(README|CONTRIBUTING)\.md$|^docs/[\w-]+\.md$|^examples/README\.md$")
COMMENTED = re.compile(r"^(fortran|app|c|python)/.*\.(f90|c|h|cpp|py)$")
CODE = re.compile(r"\.(f90|inc|in|c|h|cpp|hpp|py|js|build|options|toml|yml|css|html|csv)$|^Makefile$")
TEXT = re.compile(r"`([^`\n]+)`")
LINK = re.compile(r"\]\(([^)#\s]*)(?:#([^)\s]+))?\)")
PATH = re.compile(r"^[\w.-]+(/[\w.-]+)+/?$|^[\w-]+\.(f90|py|md|h|c|js)$")
NAME = re.compile(r"^[a-z_][a-z0-9]*(_[a-z0-9]+)+(\(\))?$")
PAIR = re.compile(r"`([A-Za-z_]\w*)` of `([\w/]+(?:\.f90|\.py)?)`")

MADE = ("build/", "results/", ".venv/", "lib/", "include/", "_viewer/", "/")
"""What a build, a run or an installation makes, or the system has."""
FOREIGN = {"math.h", "m/s2", "1/min", "rad/min", "first-mechanism"}
"""Names that are not this project's."""
MADE_UP = {"moment_amplification_direction", "force_amplification_direction", "groups/linkdyn_NAME.f90", "linkdyn_NAME.f90"}
"""Names that the code puts together, or that stand for many."""


@dataclass(frozen=True)
class Tree:
    """The project's files."""

    texts: dict[str, str]
    """Of pages and of code, by path."""
    words: frozenset[str]
    """Of the code, but for those in backticks."""
    by_name: dict[str, list[str]]
    """Files and folders by their last name, with and without its ending."""

    def named(self, path: str) -> list[str]:
        """Files and folders whose path ends so, with or without an ending of its own."""
        path = path.rstrip("/")
        known = self.by_name.get(path.rpartition("/")[2], [])
        return [file for file in known if any(f"/{own}".endswith(f"/{path}") for own in (file, file.rpartition(".")[0]))]


def read_tree(root: Path) -> Tree:
    """What git knows of, or would take in."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout.splitlines()
    files = [file for file in listed if (root / file).is_file()]
    texts = {file: (root / file).read_text(encoding="utf-8", errors="replace") for file in files if file.endswith(".md") or CODE.search(file)}
    folders = {str(parent) for file in files for parent in PurePosixPath(file).parents}
    words = {word for file, text in texts.items() if CODE.search(file) for word in re.findall(r"\w+", without_quotes(file, text))}
    by_name: dict[str, list[str]] = {}
    for path in {*files, *folders}:
        for name in {PurePosixPath(path).name, PurePosixPath(path).stem}:
            by_name.setdefault(name, []).append(path)
    return Tree(texts, frozenset(words), by_name)


def without_quotes(file: str, text: str) -> str:
    """What is no mention of a name: in JavaScript backticks hold texts."""
    return text if file.endswith(".js") else TEXT.sub("", text)


@cache
def anchors(page: Path) -> set[str]:
    """Of headings, as GitHub makes them, and those written out."""
    text = page.read_text(encoding="utf-8")
    heads = re.findall(r"^#+\s+(.*)$", text, re.M)
    own = {re.sub(r"[^\w\s-]", "", head).strip().lower().replace(" ", "-") for head in heads}
    return own | set(re.findall(r'id="([^"]+)"', text)) | set(re.findall(r"^\(([\w-]+)\)=", text, re.M))


def beside(page: str, path: str) -> str:
    """A path as a page writes it, from the root of the project."""
    parts: list[str] = []
    for part in [*PurePosixPath(page).parent.parts, *path.split("/")]:
        if part == "..":
            parts = parts[:-1]
        elif part not in ("", "."):
            parts.append(part)
    return "/".join(parts)


def broken_links(root: Path, page: str, text: str) -> list[str]:
    """Links of a page, or of some of its text, to files or headings that are not there."""
    found = []
    for path, anchor in LINK.findall(text):
        if "://" in path or path.startswith("mailto:"):
            continue
        target = beside(page, path) if path else page
        if not (root / target).exists():
            found.append(f"no file {path}")
        elif anchor and target.endswith(".md") and anchor not in anchors(root / target):
            found.append(f"no heading #{anchor} in {target}")
    return found


def unknown_names(tree: Tree, line: str) -> list[str]:
    found = []
    for text in TEXT.findall(line):
        if text in FOREIGN | MADE_UP or text.startswith(MADE):
            continue
        if PATH.match(text) and not tree.named(text.replace(".f90", "")) and not tree.named(text):
            # `folder/module.name`: a name of a module
            module, _, name = text.rpartition(".")
            if not any(re.search(rf"\b{name}\b", tree.texts.get(file, "")) for file in tree.named(module)):
                found.append(f"no file {text}")
        elif NAME.match(text) and text.removesuffix("()") not in tree.words and not tree.named(text):
            found.append(f"no name {text}")
    return found


def misplaced_names(tree: Tree, line: str) -> list[str]:
    """`name` of `module`: the module has it."""
    found = []
    for name, module in PAIR.findall(line):
        sources = [file for file in tree.named(module.removesuffix(".f90").removesuffix(".py")) if CODE.search(file)]
        if sources and not any(re.search(rf"\b{name}\b", tree.texts[file]) for file in sources):
            found.append(f"no {name} in {', '.join(sources)}")
    return found


def find_untrue(root: Path) -> list[str]:
    """All findings, with page and line."""
    tree = read_tree(root)
    findings = []
    for page in sorted(file for file in tree.texts if PAGES.search(file)):
        for number, line in enumerate(tree.texts[page].splitlines(), 1):
            told = broken_links(root, page, line) + unknown_names(tree, line) + misplaced_names(tree, line)
            findings += [f"{page}:{number}: {finding}" for finding in told]
    for file in sorted(file for file in tree.texts if COMMENTED.search(file)):
        for number, line in enumerate(tree.texts[file].splitlines(), 1):
            findings += [f"{file}:{number}: {finding}" for finding in unknown_names(tree, line)]
    return findings


if __name__ == "__main__":
    problems = find_untrue(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
    print("\n".join(problems) if problems else "pages and comments name what is there")
    sys.exit(1 if problems else 0)
