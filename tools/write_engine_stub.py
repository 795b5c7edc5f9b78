"""Write the types of the engine module, python/linkdyn/_engine.pyi, as f2py tells them in its docstrings.

Usage: write_engine_stub.py       of the linkdyn that is installed; to be called when the flat interface has changed
"""

from __future__ import annotations

import re
from pathlib import Path

STUB = Path(__file__).resolve().parent.parent / "python" / "linkdyn" / "_engine.pyi"
HEAD = '''"""The engine as f2py wraps it. Written by tools/write_engine_stub.py."""

from typing import Any

from numpy.typing import NDArray
'''
ITEM = re.compile(r"^(\w+) : (.*)", re.M)
SECTION = re.compile(r"^(Parameters|Other Parameters|Returns)\n-+\n(.*?)(?=\n\n|\Z)", re.M | re.S)


def kind(text: str) -> str:
    """Type of what f2py calls "input rank-1 array('d') with bounds (n)", "string(len=32)", "int"."""
    if "array" in text:
        return "NDArray[Any]"
    if "string" in text:
        return "str" if "input" in text else "bytes"
    return "float" if "float" in text else "int"


def signature(name: str, doc: str) -> str:
    """A procedure as a static method; sizes that f2py finds out itself are left out."""
    sections = {title: ITEM.findall(body) for title, body in SECTION.findall(doc)}
    arguments = ", ".join(f"{label}: {kind(text)}" for label, text in sections.get("Parameters", []))
    returned = [kind(text) for _, text in sections.get("Returns", [])]
    result = "None" if not returned else returned[0] if len(returned) == 1 else f"tuple[{', '.join(returned)}]"
    return f"    @staticmethod\n    def {name}({arguments}) -> {result}: ...\n"


def stub() -> str:
    """The text of the stub."""
    from linkdyn import _engine

    parts = [HEAD]
    for module in sorted(name for name in vars(_engine) if name.startswith("linkdyn_")):
        holder = getattr(_engine, module)
        procedures = sorted(name for name in dir(holder) if name.startswith("api_"))
        parts.append(f"\nclass {module}:\n" + "".join(signature(name, getattr(holder, name).__doc__) for name in procedures))
    return "".join(parts)


if __name__ == "__main__":
    STUB.write_text(stub(), encoding="utf-8")
