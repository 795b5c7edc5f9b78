"""Make the site: Sphinx's pages, the gallery, FORD's pages of the Fortran sources under them; then look whether its links hold.

Usage: build_docs.py FOLDER        into FOLDER/html; warnings end it
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from docs_gallery import write_gallery

ROOT = Path(__file__).resolve().parent.parent
PARTS = ("docs", "examples", "benchmarks", "CHANGELOG.md", "CONTRIBUTING.md")
START = '<!DOCTYPE html><meta charset="utf-8"><title>linkdyn</title><meta http-equiv="refresh" content="0; url=docs/index.html">\n'

ELSEWHERE = {
    "styles": re.compile(r'<link href="https://[^"]*/bootstrap[^"]*"[^>]*>'),
    "scripts": re.compile(r'<script src="https://[^"]*/bootstrap[^"]*"[^>]*></script>'),
    "formulas": re.compile(r'<script src="https://[^"]*/MathJax[^"]*"[^>]*></script>'),
}
LOADED = re.compile(r'<(?:script[^>]*src|link[^>]*href|img[^>]*src)="((?:https?:)?//[^"]*)"')
"""What a page takes from another host while it is shown; its links may lead there."""


class Page(HTMLParser):
    """Where a page leads, and the places in it to which others may."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.places: set[str] = set()
        self.feed(file.read_text(encoding="utf-8", errors="replace"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("href", "src") and value:
                self.links.add(value)
            if (name == "id" or (tag == "a" and name == "name")) and value:
                self.places.add(value)


def dead_links(site: Path) -> list[str]:
    """Links to what is not in the site. Places within FORD's pages are FORD's: it writes and names them in two ways."""
    skipped = {site / "views", site / "_static"}
    pages = {file: Page(file) for file in site.rglob("*.html") if skipped.isdisjoint(file.parents)}
    found = []
    for file, page in pages.items():
        for link in sorted(page.links):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc or not (parts.path or parts.fragment):
                continue
            target = Path(os.path.normpath(file.parent / unquote(parts.path))) if parts.path else file
            if target.is_dir():
                target /= "index.html"
            places = pages[target].places if parts.fragment and target in pages and site / "fortran" not in target.parents else None
            if not target.exists() or (places is not None and unquote(parts.fragment) not in places):
                found.append(f"{file.relative_to(site)}: {link}")
    return found


def lay_out(source: Path) -> None:
    """Copies of the parts of the project that are pages, beside each other as they are there."""
    source.mkdir(parents=True, exist_ok=True)
    for part in PARTS:
        shutil.rmtree(source / part, ignore_errors=True)
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, source / part, ignore=shutil.ignore_patterns("__pycache__", "*.nc"))
        else:
            shutil.copy2(ROOT / part, source / part)


def set_up_kernels(folder: Path) -> None:
    """What runs the tutorials' cells shows their figures, whatever backend `make` exports; that it opens a port is noise."""
    os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
    profile = folder / "profile_default"
    profile.mkdir(parents=True, exist_ok=True)
    (profile / "ipython_kernel_config.py").write_text("c.IPKernelApp.log_level = 40\n", encoding="utf-8")
    os.environ["IPYTHONDIR"] = str(folder)


def stay_at_home(site: Path) -> None:
    """FORD's pages load Bootstrap and MathJax from a public host: Sphinx's theme brings the former, and there are no formulas."""
    theme = site / "_static"
    for file in (site / "fortran").rglob("*.html"):
        at_home = Path(os.path.relpath(theme, file.parent)).as_posix()
        text = ELSEWHERE["styles"].sub(f'<link href="{at_home}/styles/pydata-sphinx-theme.css" rel="stylesheet">', file.read_text(encoding="utf-8"))
        text = ELSEWHERE["scripts"].sub(f'<script src="{at_home}/scripts/bootstrap.js"></script>', text)
        text = ELSEWHERE["formulas"].sub("", text)
        if left := LOADED.search(text):
            sys.exit(f"{file.relative_to(site)}: loads {left[1]} (expected what is in the site)")
        file.write_text(text, encoding="utf-8")


def run(*command: str | Path) -> None:
    beside = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])      # FORD calls pcpp by its name
    if subprocess.run(command, cwd=ROOT, env=os.environ | {"PATH": beside}, check=False).returncode != 0:
        sys.exit(f"{' '.join(map(str, command[2:4]))}: failed")


def main(folder: str) -> None:
    build = Path(folder).resolve()
    source, site = build / "source", build / "html"
    lay_out(source)
    write_gallery(ROOT / "examples", source, site / "views")
    set_up_kernels(build / "ipython")
    python = [sys.executable, "-m"]
    run(*python, "sphinx", "--fail-on-warning", "--keep-going", "--quiet", "-c", ROOT / "docs" / "site", "-d", build / "doctrees", source, site)
    run(*python, "ford", "--quiet", "--output_dir", site / "fortran", ROOT / "ford.md")
    stay_at_home(site)
    (site / "index.html").write_text(START, encoding="utf-8")
    if dead := dead_links(site):
        sys.exit("Links that lead nowhere:\n" + "\n".join(dead))
    print(f"Start reading at {site / 'index.html'}")


if __name__ == "__main__":
    main(*sys.argv[1:])
