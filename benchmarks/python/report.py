"""What benchmarks leave behind: tables and pictures under results/benchmarks, which git does not know.

`make renew` puts them into the documents that show them (renew.py).
"""

from __future__ import annotations

import datetime
import os
from pathlib import Path

import matplotlib

matplotlib.use("Agg")  # pictures go to files
import matplotlib.pyplot as plt  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "results" / "benchmarks"


def save_table(name: str, text: str) -> None:
    """Keep a table (Markdown) under the name of its place in a document."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    (FOLDER / f"{name}.md").write_text(f"{text}\n")


def save_picture(figure: plt.Figure, name: str) -> None:
    """Keep a picture under its name in a document, and close it."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    figure.savefig(FOLDER / f"{name}.png", dpi=110)
    plt.close(figure)


def clear_axis(axis: plt.Axes) -> None:
    """Thin grid, no frame at the top and on the right."""
    axis.grid(True, which="major", color="0.9", linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)


def legend_beside(axis: plt.Axes) -> None:
    """A legend on the right of the axis, where it hides nothing."""
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")


def processor_line() -> str:
    """Date and processor."""
    information = Path("/proc/cpuinfo").read_text()
    names = (line.split(":", 1)[1].strip() for line in information.splitlines() if line.startswith("model name"))
    wide = "AVX-512" if "avx512f" in information else "no AVX-512"
    return f"{datetime.date.today()}, {next(names, 'unknown processor')}, {wide}, {os.cpu_count()} cores"
