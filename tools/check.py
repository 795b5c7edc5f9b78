"""Build linkdyn in other ways, run the tests that each of them is for, and count everything together.

Usage: check.py [NAME ...]

Names are `test`, all tests of the ordinary build (`make test` leaves the thorough ones out, and takes fewer of the fuzzer's cases),
the ways below, and `blas`. Without a name: all. The last line is `N passed, N failed`, exit status 1 if anything failed. What
cannot run on this machine is said before it, and so is what LINKDYN_CHECK_UNTIL, an instant in seconds since 1970, leaves no time to
begin: a machine that is given so long and no longer would otherwise end without any count.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from run_tests import ROOT, Count, close, described, run_all, run_fortran, run_python

BUILD = ROOT / "build"
ORDINARY = BUILD / "wheel"
TWIN = BUILD / "real128"
ACCURACY = ("-m", "accuracy and not long", "--cases", "3")
"""Long runs never come to LAPACK; the ordinary build runs all cases."""
FUZZ_CASES = "2000"
"""Of the ordinary build; `make test` takes fewer."""
TWIN_RESULTS = BUILD / "twin-results"
"""Of the twin, for all ways: they are the same."""
OPTIMIZED_LITTLE = ("-Dbuildtype=plain", "-Doptimization=1")
"""Quick to build."""


@dataclass(frozen=True)
class Way:
    """A way to build, and what to run of it."""

    says: str
    options: tuple[str, ...]
    """Of meson."""
    tests: tuple[str, ...]
    """Arguments of pytest; none: no Python."""
    environment: Callable[[], dict[str, str]] = dict
    lacks: Callable[[], str] = str
    """Why it cannot run here; empty: it can."""
    precision: str = "real64"
    build_of: str = ""
    """Another way whose build serves, and whose Fortran suites do; empty: its own."""


# ------------------------------------------------------------------------------------------------ what a machine has
def lacks_sanitizers() -> str:
    return "" if sanitizers() else "gcc has no sanitizer libraries"


def sanitizers() -> list[str]:
    """Libraries that a Python which was not built with them has to load first."""
    found = []
    for name in ("libasan.so", "libubsan.so"):
        path = subprocess.run(["gcc", f"-print-file-name={name}"], capture_output=True, text=True, check=False).stdout.strip()
        if not Path(path).is_absolute():
            return []
        found.append(path)
    return found


def sanitized() -> dict[str, str]:
    """Python's own allocator would hide what is allocated from the sanitizer, and Python leaks by design."""
    return {
        "LD_PRELOAD": " ".join(sanitizers()),
        "PYTHONMALLOC": "malloc",
        "ASAN_OPTIONS": "detect_leaks=0",
        "UBSAN_OPTIONS": "halt_on_error=1:print_stacktrace=1",
        "LINKDYN_FUZZ_PATIENCE": "20",
        "LINKDYN_FUZZ_CASES": "100",
    }


def lacks_mpi() -> str:
    missing = [program for program in ("mpifort", "mpirun") if shutil.which(program) is None]
    return f"no {' and no '.join(missing)} (MPI=1 sh tools/install_packages.sh installs OpenMPI)" if missing else ""


def lacks_instructions(*flags: str) -> Callable[[], str]:
    def lacks() -> str:
        information = Path("/proc/cpuinfo").read_text(encoding="utf-8") if Path("/proc/cpuinfo").exists() else ""
        missing = [flag for flag in flags if f" {flag} " not in information.replace("\n", " \n")]
        return f"the processor has no {', '.join(missing)}" if missing else ""

    return lacks


BY_MPI = () if lacks_mpi() else ("-Dmpi=enabled",)

WAYS = {
    "checked": Way(
        "bounds, pointers and memory looked at while running, what was never set is NaN; 4 lanes, SSE2 alone, without GSL",
        (*OPTIMIZED_LITTLE, "-Dfortran_args=['-fcheck=all,no-array-temps', '-finit-real=snan', '-finit-derived']",
         "-Dlanes=4", "-Dmarch=x86-64", "-Dgsl=disabled"),
        # bounds on rounding errors are for lanes32, whose instructions round otherwise;
        # what a test has many cases of goes the same ways through the code in most
        ("tests/python", "tests/cli", "tests/faults", "tests/fuzz", "-m", "(lanes or not accuracy) and not (long or python_alone)", "--cases", "3"),
        lambda: {"LINKDYN_SLOWNESS": "5", "LINKDYN_FUZZ_PATIENCE": "20", "LINKDYN_FUZZ_CASES": "200"},
    ),
    "sanitized": Way(
        "addresses, undefined behaviour of C and C++ and, without Python, leaks looked at while running",
        # of Fortran's own rules `checked` looks at more
        (*OPTIMIZED_LITTLE, "-Db_sanitize=address,undefined", "-Db_lundef=false", "-Dfortran_args=-fno-sanitize=undefined"),
        ("tests/cli", "tests/fuzz", "-m", "not python_alone", "--cases", "60"),
        sanitized,
        lacks_sanitizers,
    ),
    "quadruple": Way("the Fortran suites in quadruple precision", (), (), precision="real128"),
    "lanes32": Way(
        "32 lanes, AVX2 in records' code too, without OpenMP",
        (*OPTIMIZED_LITTLE, "-Dlanes=32", "-Dmarch=x86-64-v3", "-Dopenmp=disabled", *BY_MPI),
        ("tests", "-m", "(accuracy or lanes) and not long", "--cases", "3"),
        lambda: {"LINKDYN_CODE": "avx2"},
        lacks=lacks_instructions("avx2", "fma"),
    ),
    "mpi": Way(
        "sweeps over the processes of mpirun",
        (),
        # OpenMPI's own files outgrow the limit that stands for a full disk; processes that begin at the same time come in each other's
        # way with the folder of its session
        ("tests/cli/test_sweep.py", "tests/faults/test_processes.py", "-k", "not full_disk", "-n", "1"),
        lambda: {"LINKDYN_HAS_MPI": "1"},
        lambda: lacks_mpi() or lacks_instructions("avx2", "fma")(),
        build_of="lanes32",
    ),
}
"""Names are those of `make check-NAME`."""
OTHERS = {"test": "all tests of the ordinary build", "blas": "accuracy with other BLAS kernels"}

KERNELS = {
    "Nehalem": ("sse4_2",),
    "Haswell": ("avx2", "fma"),
    "Zen": ("avx2", "fma"),
    "SkylakeX": ("avx512f", "avx512dq", "avx512bw", "avx512vl"),
}
"""OPENBLAS_CORETYPE, and what the processor must have to run it."""


# -------------------------------------------------------------------------------------------------------- one by one
def run_way(name: str) -> Count:
    """Build it in a folder of its own, install it beside itself, run its tests."""
    way = WAYS[name]
    built = way.build_of or name
    folder = TWIN if way.precision == "real128" else BUILD / f"check-{built}"
    options = () if way.precision == "real128" else ("-Dpython=enabled", *WAYS[built].options)
    if not build(folder, ("-Dtests=true", *options), way.precision):
        return Count(failed=1)
    environment = way.environment()
    quiet = {key: value for key, value in environment.items() if key not in ("LD_PRELOAD", "ASAN_OPTIONS")}
    count = Count() if way.build_of else run_fortran(folder, way.precision, quiet)
    if way.tests:
        site = next(iter(folder.glob("stage/**/linkdyn/__init__.py"))).parent.parent
        twin = {"LINKDYN_REAL128": str(TWIN / "app" / "linkdyn-real128")}
        of_build = {"PYTHONPATH": str(site)} | described(folder)
        count += run_python(folder / "pytest.xml", list(way.tests), twin | environment | of_build)
    return count


def build(folder: Path, options: tuple[str, ...], precision: str) -> bool:
    """Configure and compile; install into `stage` what the package needs."""
    is_new = not (folder / "build.ninja").exists()
    steps = [
        ["meson", "setup", *([] if is_new else ["--reconfigure"]), str(folder), *options],
        ["meson", "compile", "-C", str(folder), *([] if precision == "real64" else [f"tester-{precision}"])],
    ]
    if precision == "real64":
        steps.append(["meson", "install", "-C", str(folder), "--no-rebuild", "--quiet", "--destdir", str(folder.resolve() / "stage")])
    with (folder.parent / f"{folder.name}.log").open("w", encoding="utf-8") as log:
        for step in steps:
            if subprocess.run(step, cwd=ROOT, stdout=log, stderr=subprocess.STDOUT, check=False).returncode != 0:
                print(f"{' '.join(step)} failed: {log.name}")
                return False
    return True


def lacks_time() -> str:
    until = os.environ.get("LINKDYN_CHECK_UNTIL", "")
    return "no time is left to begin it" if until and time.time() > float(until) else ""


def run_kernels() -> Iterator[tuple[str, Count | str]]:
    """The accuracy tests of the ordinary build with each of the BLAS kernels; or why not."""
    for kernel, flags in KERNELS.items():
        environment = {"OPENBLAS_CORETYPE": kernel}
        reason = lacks_instructions(*flags)() or lacks_kernel(kernel) or lacks_time()
        yield f"blas {kernel}", reason or (
            run_fortran(ORDINARY, "real64", environment)
            + run_python(ORDINARY.resolve() / "pytest-blas.xml", [*ACCURACY, "tests"], environment | described(ORDINARY))
        )


def lacks_kernel(name: str) -> str:
    """A BLAS takes the kernel only if it was built with a choice of them."""
    ask = "import ctypes, ctypes.util as u; f = ctypes.CDLL(u.find_library('openblas')).openblas_get_corename; f.restype = ctypes.c_char_p; print(f().decode())"
    run = subprocess.run([sys.executable, "-c", ask], env=os.environ | {"OPENBLAS_CORETYPE": name}, capture_output=True, text=True, check=False)
    taken = run.stdout.strip()
    return "" if taken.lower() == name.lower() else f"this BLAS takes {taken or 'another one'} instead"


def run_named(name: str) -> Iterator[tuple[str, Count | str]]:
    """All tests of the ordinary build, a way, or the kernels of BLAS, as they are named after `make check-`."""
    if name == "test":
        yield name, run_all(ORDINARY, [])
        return
    if name == "blas":
        yield from run_kernels()
        return
    reason = WAYS[name].lacks() or lacks_time()
    yield name, reason or run_way(name)


def main(*names: str) -> int:
    known = ("test", *WAYS, "blas")
    if unknown := [name for name in names if name not in known]:
        print(f"check.py: no way named {', '.join(unknown)} (expected {', '.join(known)})")
        return 2
    shutil.rmtree(TWIN_RESULTS, ignore_errors=True)
    os.environ["LINKDYN_TWIN_RESULTS"] = str(TWIN_RESULTS)
    os.environ.setdefault("LINKDYN_FUZZ_CASES", FUZZ_CASES)
    total, lines = Count(), []
    for name in names or known:
        says = WAYS[name].says if name in WAYS else OTHERS[name]
        print(f"\n=== {name}: {says}", flush=True)
        start = time.monotonic()
        for title, result in run_named(name):
            if isinstance(result, str):
                lines.append(f"  {title:14} NOT RUN: {result}")
            else:
                total += result
                lines.append(f"  {title:14} {result} in {time.monotonic() - start:.0f} s")
            start = time.monotonic()
    print("\n".join(["", *lines]))
    return close(total)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
