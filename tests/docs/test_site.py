"""What the site is made of: links between the project's pages, the gallery's list, the search for dead links."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
from build_docs import dead_links, lay_out, set_up_kernels, stay_at_home  # noqa: E402
from check_docs import broken_links  # noqa: E402
from docs_gallery import examples, write_gallery  # noqa: E402

PAGES = sorted([*(page for page in ROOT.glob("*.md") if page.stem != "ford"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("examples/*/README.md"), *ROOT.glob("benchmarks/*.md")])
CODE = re.compile(r"^```.*?^```|`[^`\n]*`", re.M | re.S)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_between_pages(page):
    assert not broken_links(ROOT, page.relative_to(ROOT).as_posix(), CODE.sub("", page.read_text(encoding="utf-8")))


def test_anchors_are_their_own():
    """The site has one room for the names of all pages: one that stands on two of them leads to either."""
    pages = {page: set(re.findall(r'<a id="([^"]+)">', page.read_text(encoding="utf-8"))) for page in sorted((ROOT / "docs").glob("*.md"))}
    for page, anchors in pages.items():
        for other, others in pages.items():
            assert page >= other or not anchors & others, (page.name, other.name)


def test_anchors_start_a_paragraph():
    """The site takes an anchor for a target only where a line begins with it."""
    for page in ROOT.glob("docs/**/*.md"):
        assert not re.search(r"[^\n]<a id=", page.read_text(encoding="utf-8")), page.name


def test_kernels_show_figures(tmp_path, monkeypatch):
    """With the backend that `make` exports, figures of the tutorials were drawn and not shown."""
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("IPYTHONDIR", "")
    set_up_kernels(tmp_path)
    backend = subprocess.run([sys.executable, "-c", "import matplotlib; print(matplotlib.get_backend())"], capture_output=True, text=True, check=True)
    assert "inline" in backend.stdout


def test_fords_pages_need_no_network(tmp_path):
    """They load Bootstrap from a public host, without which they are bare lists; anything else that they load so is an error."""
    page = tmp_path / "fortran" / "module" / "m.html"
    page.parent.mkdir(parents=True)
    hosts = "https://cdn.jsdelivr.net/npm"
    page.write_text(
        f'<link href="{hosts}/bootstrap@5.3.3/dist/css/bootstrap.min.css" rel="stylesheet"\n integrity="x"><link href="../css/local.css">'
        f'<script src="{hosts}/bootstrap@5.3.3/dist/js/bootstrap.bundle.min.js"\n integrity="x"></script>'
        f'<script src="{hosts}/mathjax@2.7.9/MathJax.js?config=T" async></script><a href="https://forddocs.readthedocs.io">FORD</a>',
        encoding="utf-8",
    )
    stay_at_home(tmp_path)
    text = page.read_text(encoding="utf-8")
    assert '"../../_static/styles/pydata-sphinx-theme.css"' in text and '"../../_static/scripts/bootstrap.js"' in text and hosts not in text
    page.write_text(f'<script src="{hosts}/other.js"></script>', encoding="utf-8")
    with pytest.raises(SystemExit, match=r"fortran/module/m\.html: loads https.*other\.js"):
        stay_at_home(tmp_path)


def test_every_example_is_in_the_gallery():
    found = [example for _, members in examples(ROOT / "examples") for example in members]
    assert len(found) > 20    # that none is missing `examples` checks itself
    for example in found:
        assert example.scene.exists() and 3 < len(example.title) < 70 and "](" not in example.text
        assert 20 < len(example.text) and example.text.count("(") == example.text.count(")"), example.text     # "A Tripteron (C."


def test_an_example_in_no_group_is_an_error(tmp_path):
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "README.md").write_text("# New\n\nOne more.\n")
    with pytest.raises(SystemExit, match="GROUPS and examples differ.*new"):
        list(examples(tmp_path))


def test_gallery_of_one(tmp_path, monkeypatch):
    """An example's picture and view are made of its run, and made again only when it changes."""
    folder = tmp_path / "examples" / "fourbar"
    folder.mkdir(parents=True)
    for name in ("scene.toml", "README.md"):
        (folder / name).write_bytes((ROOT / "examples" / "fourbar" / name).read_bytes())
    monkeypatch.setattr("docs_gallery.GROUPS", {"Linkages": ("fourbar",)})
    made = [tmp_path / "source" / "pictures" / "fourbar.png", tmp_path / "views" / "fourbar.html"]
    write_gallery(tmp_path / "examples", tmp_path / "source", tmp_path / "views")
    times = [file.stat().st_mtime_ns for file in made]
    write_gallery(tmp_path / "examples", tmp_path / "source", tmp_path / "views")
    assert [file.stat().st_mtime_ns for file in made] == times
    page = (tmp_path / "source" / "gallery.md").read_text()
    assert ":img-top: pictures/fourbar.png" in page and ":link: examples/fourbar/README" in page
    assert made[0].read_bytes()[:4] == b"\x89PNG" and "linkdyn-view" in made[1].read_text()


def test_pages_are_laid_out_as_in_the_project(tmp_path):
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "stale.md").write_text("")
    lay_out(tmp_path)
    assert not (tmp_path / "docs" / "stale.md").exists()
    for name in ("docs/index.md", "docs/tutorials/lecture.md", "examples/fourbar/scene.png", "CHANGELOG.md"):
        assert (tmp_path / name).is_file()


def test_dead_links(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "index.html").write_text('<h2 id="here">Here</h2><a href="../a.html#two">up</a><a href="#here">on</a>')
    (tmp_path / "a.html").write_text(
        '<a id="two" href="sub/">folder</a><a href="sub/index.html#here">place</a><a href="https://example.org/x">far</a>'
        '<img src="lost.png"><a href="sub/index.html#there">no place</a><a href="b%20c.html">no page</a>'
    )
    assert sorted(dead_links(tmp_path)) == ["a.html: b%20c.html", "a.html: lost.png", "a.html: sub/index.html#there"]
