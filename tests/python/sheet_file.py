"""What a sheet's file says, to a person and to a program."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np


def read(file: Path) -> tuple[ET.Element, dict[str, list[list[ET.Element]]]]:
    """The document, which is XML, too, and its tables: cells by title and row."""
    text = file.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>")
    root = ET.fromstring(text)
    tables = {
        section.find("h2").text: [list(row) for row in section.find("table/tbody")]
        for section in root.iter("section")
        if section.find("table") is not None
    }
    return root, tables


def number(cell: ET.Element) -> float:
    """As read by a person, where the minus sign is a long one."""
    return float(re.sub(r"[\u202f]", "", cell.text).replace("−", "-"))


def column(rows: list[list[ET.Element]], k: int) -> np.ndarray:
    """The numbers behind the cells, in SI units; NaN where there is none."""
    return np.array([float(row[k].get("data-si", "nan")) for row in rows])
