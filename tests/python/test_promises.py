"""What a build promises must be there: its absence fails tests that are skipped in a build without it."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import linkdyn
import pytest

ROOT = Path(__file__).resolve().parents[2]
WITHOUT = {
    "gsl": "method 'rk8pd' needs the GNU Scientific Library, and this linkdyn (1.0) was built without it",
    "viewer": "view: this linkdyn was built without the viewer: node or the network were missing then",
    "mujoco": "convert: MJCF is read by MuJoCo, which is not installed (pip install 'linkdyn[mujoco]')",
}


@pytest.fixture()
def rules():
    """A copy of tests/conftest.py, whose promises a test may set."""
    spec = importlib.util.spec_from_file_location("rules", ROOT / "tests" / "conftest.py")
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


@pytest.mark.parametrize("name", WITHOUT)
def test_what_is_not_promised_is_skipped(rules, monkeypatch, name):
    monkeypatch.setattr(rules, "PROMISED", frozenset(set(WITHOUT) - {name}))
    with pytest.raises(pytest.skip.Exception):
        rules.excuse(linkdyn.UnavailableError(WITHOUT[name]))


@pytest.mark.parametrize("name", WITHOUT)
def test_what_is_promised_fails(rules, monkeypatch, name):
    monkeypatch.setattr(rules, "PROMISED", frozenset({name}))
    with pytest.raises(linkdyn.UnavailableError):
        rules.excuse(linkdyn.UnavailableError(WITHOUT[name]))


def test_what_no_build_may_lack_fails(rules, monkeypatch):
    monkeypatch.setattr(rules, "PROMISED", frozenset())
    with pytest.raises(linkdyn.UnavailableError):
        rules.excuse(linkdyn.UnavailableError("to_parquet needs pyarrow, which is not installed"))


@pytest.mark.parametrize(
    ("found", "options", "promised"),
    [
        (["netcdf-fortran", "gsl"], {"gsl": "auto", "viewer": "auto"}, "gsl twin"),
        (["netcdf-fortran"], {"gsl": "disabled", "viewer": "enabled"}, "twin viewer"),
    ],
)
def test_a_configuration_is_what_a_build_promises(monkeypatch, tmp_path, found, options, promised):
    told = tmp_path / "meson-info"
    told.mkdir()
    (told / "intro-dependencies.json").write_text(json.dumps([{"name": name} for name in found]))
    (told / "intro-buildoptions.json").write_text(json.dumps([{"name": name, "value": value} for name, value in options.items()]))
    monkeypatch.syspath_prepend(ROOT / "tools")
    assert importlib.import_module("run_tests").described(tmp_path) == {"LINKDYN_BUILD": str(tmp_path), "LINKDYN_PROMISES": promised}
