"""The order of the layers holds, and the script that checks it sees a breach."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SPEC = importlib.util.spec_from_file_location("check_layers", ROOT / "tools" / "check_layers.py")
check_layers = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(check_layers)


@pytest.mark.thorough
def test_sources_keep_the_order() -> None:
    assert check_layers.read_sources(ROOT), "no sources found"
    assert check_layers.find_violations(ROOT) == []


@pytest.mark.parametrize(
    ("layer", "line", "complaint"),
    [
        ("core", "use linkdyn_upper", "core lies below assembly"),
        ("integrate", "use linkdyn_upper", "integrate lies below assembly"),
        ("model", "use linkdyn_nowhere", "which no source defines"),
        ("model", "use netcdf", "the netCDF library"),
        ("model", "use, intrinsic :: iso_c_binding", "C kinds"),
        ("output", "use linkdyn_upper, only: x, &  ! a comment\n        y, operator(.dot.)\n    z = x .dot. x", "uses y of linkdyn_upper nowhere"),
        ("output", "use linkdyn_upper, only: wp\n    ! wp\n    x = 'wp' + wp2", "uses wp of linkdyn_upper nowhere"),
        ("lanes", "real(wp), parameter :: third = 3.0d-1", "real kinds"),
        ("linalg", "call dgesvx(a)", "LAPACK"),
        ("analysis", "call get_command_argument(1, name)", "the command line"),
        ("files", "error stop 1", "stop"),
        ("files", "public :: orphan", "orphan is public, and nobody else knows it"),
        ("files", "function f() bind(c, name=\"linkdyn_upper\")", "the name of a module"),
    ],
)
def test_a_breach_is_seen(tmp_path: Path, layer: str, line: str, complaint: str) -> None:
    for folder, name, body in (("assembly", "linkdyn_upper", ""), (layer, "linkdyn_culprit", line)):
        path = tmp_path / "fortran" / folder / f"{name}.f90"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"module {name}\n    {body}\nend module {name}\n", encoding="utf-8")
    violations = check_layers.find_violations(tmp_path)
    assert len(violations) == 1
    assert violations[0].startswith(f"{layer}/linkdyn_culprit.f90") and complaint in violations[0]


def test_text_and_comments_are_no_breach(tmp_path: Path) -> None:
    path = tmp_path / "fortran" / "core" / "linkdyn_words.f90"
    path.parent.mkdir(parents=True)
    path.write_text('module linkdyn_words\n    ! use netcdf\n    x = "stop 1.0d0"\nend module linkdyn_words\n',
                    encoding="utf-8")
    assert check_layers.find_violations(tmp_path) == []


def test_kinds_and_directives_are_uses(tmp_path: Path) -> None:
    path = tmp_path / "fortran" / "core" / "linkdyn_words.f90"
    path.parent.mkdir(parents=True)
    lines = ["use linkdyn_words, only: wp, n_thread => team, wp2", "x = 1.0_wp + 2._wp2", "!$omp parallel num_threads(n_thread)"]
    path.write_text("module linkdyn_words\n" + "\n".join(lines) + "\nend module linkdyn_words\n", encoding="utf-8")
    assert check_layers.find_violations(tmp_path) == []
