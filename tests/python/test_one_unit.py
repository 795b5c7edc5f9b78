"""The unit of hot layers: its order, and what must not be in it."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
UPPER = "module upper\n    use lower, only: x\nend module upper\n"
LOWER = "module lower\n    integer :: x\nend module lower\n"
TYPE = """module lower
    type, abstract :: base    !! with procedures
        integer :: x
    contains
        procedure(first), deferred :: a{}
    end type base
end module lower
"""


def concatenate(folder: Path, *texts: str) -> subprocess.CompletedProcess[str]:
    files = [folder / f"part{i}.f90" for i in range(len(texts))]
    for file, text in zip(files, texts, strict=True):
        file.write_text(text)
    command = [sys.executable, ROOT / "tools" / "one_unit.py", folder / "unit.f90", *files]
    return subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)


def test_modules_come_before_those_who_use_them(tmp_path: Path) -> None:
    assert concatenate(tmp_path, UPPER, LOWER).returncode == 0
    unit = (tmp_path / "unit.f90").read_text()
    assert unit.index("module lower") < unit.index("module upper")


def test_types_with_several_procedures_stay_out(tmp_path: Path) -> None:
    assert concatenate(tmp_path, UPPER, TYPE.format("")).returncode == 0
    for more in (", b", "\n        procedure :: b => b_of_base"):
        refusal = concatenate(tmp_path, UPPER, TYPE.format(more))
        assert refusal.returncode != 0 and "part1.f90: type base has several procedures" in refusal.stderr
