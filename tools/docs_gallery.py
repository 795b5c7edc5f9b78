"""The gallery of the site: every example is run; its picture and its interactive page are made of that run."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("Agg")   # pictures go to files
import linkdyn
import linkdyn.plot
from linkdyn._view.page import run_of
from matplotlib import pyplot
from PIL import Image, ImageChops

GROUPS = {
    "Planar linkages": ("fourbar", "slider_crank", "sixbar_slider", "lecture_sixbar", "watt_i", "stephenson_iii", "fivebar_parallel",
                         "engine_balance", "shaper", "four_stroke", "knuckle_press", "toggle_clamp", "scissor_lift", "excavator"),
    "Platforms": ("stewart_drilling", "stewart_workspace", "stewart_tsai", "stewart_taghirad", "stewart_aris", "stewart_mathworks",
                  "delta", "tripod", "ship_hexapod"),
    "Screws, tables, welds": ("screw_lift", "air_bearing_stage"),
    "More constraints than needed": ("agile_eye", "tripteron", "crankshaft_bearings", "bricard"),
    "Gears and belts": ("planetary_crank", "planetary_gearbox", "geared_fivebar", "wolfrom_drive", "worm_winch"),
    "Cams and slots": ("valve_train", "bucket_tappet", "thread_guide"),
    "Set going": ("fourbar_start", "fourbar_constant_torque", "fivebar_motors", "andrews", "n_fourbar", "rcsp_start", "spatial_slider_crank",
                  "flyball_governor", "stewart_forward", "double_wishbone", "cart_pole", "swing_arm",
                  "stopped_rocker", "hill_start", "capture", "hoist", "loader_crane", "belt_drive", "fivebar_pick"),
}
HEAD = """\
# Gallery

Every example of the project, run while this site was made. A click leads to its scene, its results and a view to play with.
"""
CARD = """\
:::{{grid-item-card}} {title}
:img-top: {picture}
:link: {page}
:link-type: doc

{text}
:::
"""


@dataclass(frozen=True)
class Example:
    """A folder of examples."""

    folder: Path

    @property
    def scene(self) -> Path:
        """What it computes; the lecture's program has none, but the mechanism of `sixbar_slider`."""
        own = self.folder / "scene.toml"
        return own if own.exists() else self.folder.parent / "sixbar_slider" / "scene.toml"

    @property
    def title(self) -> str:
        return self._readme.partition("\n")[0].lstrip("# ")

    @property
    def text(self) -> str:
        """The first sentence below the title, as plain words; the point behind an initial in brackets ends none."""
        paragraph = " ".join(self._readme.split("\n\n")[1].split())
        plain = re.sub(r"\[([^\]]+)\]\([^)]*\)", r"\1", paragraph).replace("`", "")
        return re.split(r"(?<=[.])(?<![(][A-Z][.])(?<![.]-[A-Z][.]) (?=[A-Z])", plain)[0].rstrip(":")

    @property
    def _readme(self) -> str:
        return (self.folder / "README.md").read_text(encoding="utf-8")

    def make(self, views: Path, pictures: Path) -> None:
        """Run it; draw and write what is older than its scene."""
        view, picture = views / f"{self.folder.name}.html", pictures / f"{self.folder.name}.png"
        engine = Path(linkdyn._bind._engine.__file__ or "")
        newest = max(file.stat().st_mtime for file in (self.scene, Path(__file__), engine))
        if all(file.exists() and file.stat().st_mtime > newest for file in (view, picture)):
            return
        scene = linkdyn.load(self.scene)
        run = run_of(scene)
        linkdyn.view(run, view, scene=scene)
        good = run.q.values[(run.status.values == 0)]
        figure, axes = linkdyn.plot.mechanism(scene, good[len(good) // 8], names=False)
        axes.set_title("")
        axes.set_axis_off()
        figure.savefig(picture, dpi=160, bbox_inches="tight")
        pyplot.close("all")
        crop(picture)


def crop(picture: Path) -> None:
    """Take the paper around a drawing away: axes in space leave much of it."""
    image = Image.open(picture).convert("RGB")
    drawn = ImageChops.difference(image, Image.new("RGB", image.size, "white")).getbbox()
    image.crop(drawn).save(picture, optimize=True)


def examples(folder: Path) -> Iterator[tuple[str, list[Example]]]:
    """By groups; one that is in none is an error of this file."""
    listed = {name for names in GROUPS.values() for name in names}
    there = {readme.parent.name for readme in folder.glob("*/README.md")} - {program.folder.name for program in programs(folder)}
    if listed != there:
        raise SystemExit(f"tools/docs_gallery.py: GROUPS and examples differ: {', '.join(sorted(listed ^ there))}")
    for group, names in GROUPS.items():
        yield group, [Example(folder / name) for name in names]


def programs(folder: Path) -> list[Example]:
    """In other languages, with nothing to look at."""
    return [Example(folder / name) for name in sorted({main.parent.name for main in folder.glob("*/main.*")})]


def write_gallery(folder: Path, source: Path, views: Path) -> None:
    """The page `gallery.md` of the site's sources, pictures beside it, and the views."""
    pictures = source / "pictures"
    for made in (pictures, views):
        made.mkdir(parents=True, exist_ok=True)
    text = HEAD
    for group, members in examples(folder):
        text += f"\n## {group}\n\n::::{{grid}} 1 2 3 3\n:gutter: 3\n\n"
        for example in members:
            example.make(views, pictures)
            name = example.folder.name
            text += CARD.format(title=example.title, picture=f"pictures/{name}.png", page=f"examples/{name}/README", text=example.text)
        text += "::::\n"
    text += "\n## Programs\n\n"
    for program in programs(folder):
        text += f"- [{program.title}](examples/{program.folder.name}/README.md): {program.text}\n"
    shown = [*(example for _, members in examples(folder) for example in members), *programs(folder)]
    pages = "\n".join(f"examples/{example.folder.name}/README" for example in shown)
    page = source / "gallery.md"
    text += f"\n```{{toctree}}\n:hidden:\n\n{pages}\n```\n"
    if not page.exists() or page.read_text(encoding="utf-8") != text:
        page.write_text(text, encoding="utf-8")
