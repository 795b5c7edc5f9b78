"""Programs in C and Fortran, built against the installed library: they get Python's numbers, and errors where they are wrong."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from itertools import takewhile
from pathlib import Path

import linkdyn
import numpy as np
import pytest
from linkdyn import _bind

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


def test_outcomes_of_calls_have_one_number_each() -> None:
    """The engine and its handles number them; the header, the Fortran module and the Python package repeat these numbers."""

    def numbers(pattern: str, *files: str) -> dict[str, int]:
        text = "".join((ROOT / file).read_text() for file in files)
        return {name.lower(): int(value) for name, value in re.findall(pattern, text)}

    engine = numbers(r"parameter :: status_(\w+) = (\d+)", "fortran/core/linkdyn_status.f90", "fortran/api/linkdyn_handles.f90",
                     "fortran/api/linkdyn_open_run.f90")
    header = numbers(r"LINKDYN_(?!SAMPLE_)([A-Z_]+) = (\d+)", "fortran/api/linkdyn.h")
    assert header == {name: code for name, code in engine.items() if name != "interrupted"}    # no call of the library listens
    assert header == numbers(r"parameter :: linkdyn_(\w+) = (\d+)", "fortran/api/linkdyn.f90")
    names = {"BAD_INPUT": "bad_input", "IO_ERROR": "io_error", "UNAVAILABLE": "unavailable", "STALE_HANDLE": "closed", "INTERRUPTED": "interrupted"}
    assert all(getattr(_bind, name) == engine[other] for name, other in names.items())


def test_guide_names_every_outcome_of_a_sample() -> None:
    status = linkdyn.load(SCENE).inverse(t=[0.0]).status
    told = re.findall(r"^\| (\d) `(\w+)` \|", (ROOT / "docs" / "guide.md").read_text(), re.M)
    assert [(int(code), name) for code, name in told] == list(zip(status.flag_values.tolist(), status.flag_meanings.split()))


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


def test_fortran_example_without_its_file_says_so_in_a_line(compiled: Compiled, tmp_path: Path) -> None:
    """Where in the program it ended stood there, too."""
    program = compiled("gfortran", EXAMPLES / "library_fortran" / "main.f90", "-Wall", "-Werror")
    with pytest.raises(AssertionError) as caught:
        program(tmp_path / "none.toml")
    told = list(takewhile(str.strip, str(caught.value).splitlines()[1:]))     # then pytest has its say
    assert len(told) == 1 and "none.toml" in told[0]


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


def test_attitudes_as_quaternions(compiled: Compiled, tmp_path: Path) -> None:
    """A hexapod in poses some of which are at the pole of its angles: Python's forces, and those of the angles where these tell them."""
    scene = linkdyn.load(EXAMPLES / "stewart_tsai" / "scene.toml")
    rng = np.random.default_rng(5)
    base = scene.motion(np.linspace(0.0, 0.5, 8))[0]
    small = lambda *shape: 0.1 * rng.standard_normal(shape)
    turned = base[:, 3:].copy()
    turned[3:, 1] = np.pi / 2 - np.array([0.0, 1e-9, 1e-3, 0.3, -0.2])
    quaternion = linkdyn.Pose(position=base[:, :3], rotation=np.array([by_angles(*angles) for angles in turned])).quaternion * 3.0
    motion = [small(8, 3) for _ in range(4)]
    rates = dict(zip(("velocity", "acceleration", "angular_velocity", "angular_acceleration"), motion, strict=True))
    pose = linkdyn.Pose(position=base[:, :3], quaternion=quaternion, **rates)
    file = tmp_path / "attitudes.txt"
    np.savetxt(file, np.hstack([base[:, :3], *motion[:2], quaternion, *motion[2:]]), fmt="%.17g")
    link, *printed = compiled("cc", HERE / "attitudes.c", *STRICT)(EXAMPLES / "stewart_tsai" / "scene.toml", "8", file).split()
    expected = scene.inverse(pose={link: pose}).driving_force.values
    np.testing.assert_allclose(np.array(printed, dtype=float).reshape(expected.shape), expected, rtol=1e-12)
    # one of them by its angles, by their rates as differences tell them
    turn = lambda s: rotation_of(motion[2][0] * s + motion[3][0] * s**2 / 2) @ by_angles(*turned[0])
    angles = np.array([angles_of(turn(s)) for s in (-1e-4, 0.0, 1e-4)])
    rate, rate2 = (angles[2] - angles[0]) / 2e-4, (angles[0] - 2 * angles[1] + angles[2]) / 1e-8
    q, qd, qdd = (np.hstack(both)[np.newaxis] for both in ((base[0, :3], angles[1]), (motion[0][0], rate), (motion[1][0], rate2)))
    by_angle = scene.inverse(q=q, qd=qd, qdd=qdd).driving_force.values[0]
    np.testing.assert_allclose(by_angle, expected[0], rtol=1e-5)


def test_rotation_matrices_from_fortran(compiled: Compiled) -> None:
    """The forces of the same angles, row by row; what mirrors is refused, with its sample."""
    printed = compiled("gfortran", HERE / "attitudes.f90", "-Wall", "-Werror")(EXAMPLES / "stewart_tsai" / "scene.toml").splitlines()
    assert float(printed[0]) < 1e-11
    assert printed[1] == "sample 2 (the first is 0): the rotation of 'platform' mirrors (expected a rotation, whose determinant is 1)"
    assert "10 or 15 numbers" in printed[2]


def by_angles(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Rx(roll) Ry(pitch) Rz(yaw)."""
    return rotation_of([roll, 0, 0]) @ rotation_of([0, pitch, 0]) @ rotation_of([0, 0, yaw])


def angles_of(r: np.ndarray) -> list[float]:
    return [np.arctan2(-r[1, 2], r[2, 2]), np.arcsin(r[0, 2]), np.arctan2(-r[0, 1], r[0, 0])]


def rotation_of(vector: Sequence[float] | np.ndarray) -> np.ndarray:
    """Rodrigues' rotation."""
    x, y, z = vector
    k, angle = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), np.linalg.norm(vector)
    return np.eye(3) + np.sinc(angle / np.pi) * k + np.sinc(angle / 2 / np.pi)**2 / 2 * k @ k


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
