"""Sphinx: the pages of docs, the READMEs of examples and benchmarks as they are, tutorials run while they are built.

`tools/build_docs.py` lays these folders beside each other, so that links between them hold here as they do in the project.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import linkdyn
from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

ROOT = Path(__file__).resolve().parents[2]

project = "linkdyn"
author = "The linkdyn developers"
copyright = "The linkdyn developers, BSD-3-Clause"
release = version = linkdyn.__version__

extensions = ["myst_nb", "numpydoc", "sphinx.ext.autodoc", "sphinx_design"]
root_doc = "docs/index"
exclude_patterns = ["docs/site", "examples/README.md", "**/.ipynb_checkpoints"]    # the gallery stands for the page of the examples
default_role = "py:obj"

myst_enable_extensions = ["colon_fence", "dollarmath", "attrs_inline"]
myst_heading_anchors = 4
nb_execution_mode = "cache"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "none"          # numpydoc says types in words, with shapes and units
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

html_math_renderer = "mathml"       # browsers draw it themselves: nothing is fetched from elsewhere
html_theme = "pydata_sphinx_theme"
html_title = "linkdyn"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navbar_end": ["theme-switcher"],
    "navigation_with_keys": False,
    "show_prev_next": True,
    "secondary_sidebar_items": {"**": ["page-toc"], "docs/index": [], "gallery": []},
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "tango",
}
html_sidebars = {"docs/*": [], "benchmarks/*": [], "C*": [], "gallery": []}   # where nothing stands beside a page

ANCHOR = re.compile(r'<a id="([\w-]+)"></a>')
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)\s]+)\)")
VIEW = """

## Look at it

Play it, look from anywhere, switch forces and plots: [on a page of its own]({page}){{.external}}.

```{{raw}} html
<iframe class="view" src="{page}" title="interactive picture" loading="lazy"></iframe>
```
"""


def read_page(app: Sphinx, docname: str, source: list[str]) -> None:
    """Anchors in a form that Sphinx knows, links to what is not on the site as plain text, the view of an example."""
    here = Path(app.srcdir, docname).parent
    text = ANCHOR.sub(r"(\1)=", source[0])
    text = LINK.sub(lambda link: _link(app, here, link), text)
    folder = Path(docname).parent
    if Path(app.outdir, "views", f"{folder.name}.html").exists() and folder.parent.name == "examples":
        text += VIEW.format(page=f"../../views/{folder.name}.html")
    source[0] = text


def _link(app: Sphinx, here: Path, link: re.Match[str]) -> str:
    words, target = link.groups()
    file, _, anchor = target.partition("#")
    if not file or "://" in file or file.startswith("mailto:"):
        return link[0]
    path = here / file
    if path.is_dir() and (path / "README.md").exists():
        path, file = path / "README.md", f"{file.rstrip('/')}/README.md"
    name = os.path.relpath(os.path.normpath(path), app.srcdir)
    if not path.exists() and (ROOT / name).exists():
        return words        # of the sources, which are no pages
    return f"[{words}]({file}{'#' + anchor if anchor else ''})"


def write_math(translator: HTML5Translator, node: nodes.math) -> None:
    """A formula in a line of text."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def write_equation(translator: HTML5Translator, node: nodes.math_block) -> None:
    """A formula of its own line."""
    translator.body.append(f'<div class="equation">{convert(node.astext(), display="block")}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    app.add_html_math_renderer("mathml", (write_math, None), (write_equation, None))
    app.connect("source-read", read_page)
