"""Programs in C and Fortran, built against the installed library: they get Python's numbers, and errors where they are wrong."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import linkdyn
import numpy as np
import pytest

from .conftest import BUILD, ROOT, run

EXAMPLES = ROOT / "examples"
HERE = Path(__file__).parent
SCENE = EXAMPLES / "fourbar_start" / "scene.toml"
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror")
Compiled = Callable[..., Callable[..., str]]


def numbers_of(text: str, pattern: str) -> np.ndarray:
    """The numbers of the lines that match, in their order."""
    return np.array([float(number) for number in re.findall(pattern, text, re.M)])


@pytest.fixture(scope="module")
def largest() -> np.ndarray:
    """What the examples print of the reactions, from Python."""
    force = linkdyn.load(SCENE).inverse(t=np.linspace(0.0, 4.0, 401)).reaction.sel(component=["Fx", "Fy"])
    return np.sqrt((force**2).sum("component")).max(force.dims[0]).values


@pytest.fixture(scope="module")
def energy() -> float:
    """And of the forward run."""
    return float(linkdyn.load(SCENE).forward(t=[0.0, 1.0, 2.0], method="gbs").kinetic_energy[-1])


def test_header_names_every_outcome_of_a_sample() -> None:
    header = (ROOT / "fortran" / "api" / "linkdyn.h").read_text()
    named = {name.lower(): int(value) for name, value in re.findall(r"LINKDYN_SAMPLE_(\w+) = (\d+)", header)}
    status = linkdyn.load(SCENE).inverse(t=[0.0]).status
    assert named == dict(zip(status.flag_meanings.split(), status.flag_values.tolist()))


# ------------------------------------------------------------------------------------------------ the examples
def test_c_example(compiled: Compiled, largest: np.ndarray, energy: float) -> None:
    printed = compiled("cc", EXAMPLES / "library_c" / "main.c", *STRICT)(SCENE)
    np.testing.assert_allclose(numbers_of(printed, r"^J\d (\S+) N"), largest, rtol=1e-8)
    np.testing.assert_allclose(numbers_of(printed, r"energy at 2 s: (\S+) J"), [energy] * 2, rtol=1e-7)
    force = linkdyn.load(SCENE).inverse(t=[0.0, 0.5, 1.0]).driving_force.values[:, 0]
    np.testing.assert_allclose(numbers_of(printed, r"^drive at \S+ s: (\S+)"), force, rtol=1e-8)
    assert printed in (EXAMPLES / "library_c" / "README.md").read_text()


def test_c_example_by_cmake(prefix: Path, found: dict[str, str], tmp_path: Path, largest: np.ndarray) -> None:
    run("cmake", "-S", EXAMPLES / "library_c", "-B", tmp_path, f"-DCMAKE_PREFIX_PATH={prefix}")
    run("cmake", "--build", tmp_path)
    printed = run(tmp_path / "main", SCENE, **found)
    np.testing.assert_allclose(numbers_of(printed, r"^J\d (\S+) N"), largest, rtol=1e-8)


def test_fortran_example(compiled: Compiled, largest: np.ndarray, energy: float) -> None:
    printed = compiled("gfortran", EXAMPLES / "library_fortran" / "main.f90", "-Wall", "-Werror")(SCENE)
    np.testing.assert_allclose(numbers_of(printed, r"^J\d +(\S+) N"), largest, rtol=1e-8)
    np.testing.assert_allclose(numbers_of(printed, r"energy at 2 s: +(\S+) J"), [energy] * 2, rtol=1e-7)


# ------------------------------------------------------------------------------------------------ what is promised
def test_wrong_calls_are_errors_with_a_line(compiled: Compiled, tmp_path: Path) -> None:
    broken = tmp_path / "broken.toml"
    broken.write_text(SCENE.read_text().replace("frame.J1", "frame.J9"))
    assert compiled("cc", HERE / "wrong_calls.c", *STRICT)(SCENE, broken).endswith("all refused\n")


def test_threads(compiled: Compiled, tmp_path: Path) -> None:
    """Scenes shared and of a thread's own, opened, closed, refused, all at once."""
    broken = tmp_path / "broken.toml"
    broken.write_text(SCENE.read_text().replace("frame.J1", "frame.J9"))
    assert compiled("cc", HERE / "threads.c", "-std=gnu11", "-Wall", "-Werror", "-pthread")(SCENE, broken) == "all alike\n"


def test_a_crowd_of_threads(compiled: Compiled) -> None:
    """Closed forms and iteration, friction, cams, gears, shared reactions, payloads, moving frames: the same bits as alone."""
    kinds = ("fourbar_start", "stewart_tsai", "delta", "agile_eye", "valve_train", "planetary_gearbox", "knuckle_press", "screw_lift",
             "toggle_clamp", "fivebar_pick", "ship_hexapod", "hoist", "four_stroke")  # fmt: skip
    scenes = [EXAMPLES / kind / "scene.toml" for kind in kinds]
    assert compiled("cc", HERE / "crowd.c", "-std=gnu11", "-Wall", "-Werror", "-pthread")(*scenes) == "all alike\n"


@pytest.mark.parametrize("example", ["ship_hexapod", "hoist", "fivebar_pick"])
def test_forces_at_instants(compiled: Compiled, example: str) -> None:
    """Frames that move, laws and payloads that change with time ask for them."""
    file = EXAMPLES / example / "scene.toml"
    printed = compiled("cc", HERE / "instants.c", *STRICT)(file)
    t = 0.1 * np.arange(11)
    scene = linkdyn.load(file)
    q, qd, qdd = scene.motion(t)
    expected = scene.inverse(q=q, qd=qd, qdd=qdd, t=t).driving_force.values
    np.testing.assert_allclose(np.array(printed.split(), dtype=float).reshape(expected.shape), expected, rtol=1e-12)


@pytest.mark.parametrize("example", ["fourbar_start", "stewart_tsai", "stewart_drilling", "slider_crank"])
def test_one_pose_allocates_nothing(compiled: Compiled, example: str) -> None:
    assert compiled("cc", HERE / "allocations.c", "-std=gnu11", "-Wall", "-Werror")(EXAMPLES / example / "scene.toml") == "0\n"


def test_a_state_brings_its_assembly_along(compiled: Compiled) -> None:
    """Half a turn on, the crank is not where the scene's start would have it at the same stroke."""
    assert compiled("cc", HERE / "states.c", *STRICT)(HERE / "stroke.toml").endswith("as it went on\n")


def test_names_are_those_of_the_header() -> None:
    """The header, the list of what the library shows, and what it does show."""
    header = (ROOT / "fortran" / "api" / "linkdyn.h").read_text()
    declared = set(re.findall(r"\b(linkdyn_\w+)\(", re.sub(r"/\*.*?\*/", "", header, flags=re.S)))
    listed = set(re.findall(r"^    (linkdyn_\w+);", (ROOT / "fortran" / "api" / "linkdyn.map").read_text(), re.M))
    library = BUILD / "fortran" / "api" / "liblinkdyn.so"
    shown = {line.split()[-1] for line in run("nm", "-D", "--defined-only", library).splitlines()}
    assert declared == listed
    assert declared == {name for name in shown if not name.startswith("__linkdyn_MOD_")}


def test_header_is_cpp_too(compiled: Compiled, tmp_path: Path) -> None:
    source = tmp_path / "version.cpp"
    source.write_text("#include <linkdyn.h>\n#include <cstdio>\nint main() { std::puts(linkdyn_version()); }\n")
    assert compiled("c++", source, "-Wall", "-Wextra", "-Wpedantic", "-Werror")().strip() == linkdyn.__version__


def test_it_has_the_number_of_its_interface(prefix: Path) -> None:
    library = next(prefix.glob("**/liblinkdyn.so"))
    assert re.search(r"SONAME.*\[liblinkdyn\.so\.\d+\]", run("readelf", "-d", library.resolve()))
