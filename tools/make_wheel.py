"""Make the wheel and the source archive, look at what is in them, and test the wheel where nothing is installed.

Usage: make_wheel.py [--shared] [OPTION...]    OPTION: of meson, such as -Dmarch=x86-64-v3

The wheel is for every processor of its kind. It carries what it needs: static HDF5 and netCDF without remote data and the
reference LAPACK, built by tools/wheels/build_libraries.sh, and the compiler's own libraries, copied by auditwheel. --shared takes
the system's netCDF and OpenBLAS instead, which need no building and make it several times as large. Everything goes to
build/wheels; no GPL code is in it, for GSL is left out.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build"
WHEELS = BUILD / "wheels"
LIBRARIES = BUILD / "libraries"
MEGABYTE = 1_000_000
MOST_WHEEL, MOST_SDIST = 12 * MEGABYTE, 4 * MEGABYTE
PORTABLE = ("-Dgsl=disabled", "-Dmarch=")
STATIC = ("-Dlapack=netlib", "-Dnetcdf=static")
TESTS = ("tests/cli/test_cli.py", "tests/cli/test_sheet.py", "tests/cli/test_sweep.py", "tests/python/test_scene.py", "tests/python/test_references.py")
"""Of all parts, but for forward runs from the command line: these are tests of the default method, which is GSL's."""
NEEDED = ("linkdyn/_bin/linkdyn", "linkdyn/liblinkdyn_package.so", "licenses/LICENSE", "licenses/licenses/HDF5.txt", "licenses/licenses/GPL-3.txt", "licenses/licenses/LGPL-2.1.txt")


def run(*command: str | Path, **environment: str) -> None:
    """A step; its failure ends everything."""
    print("$", *command, flush=True)
    if subprocess.run([*map(str, command)], cwd=ROOT, env=os.environ | environment, check=False).returncode != 0:
        sys.exit(f"make_wheel.py: failed: {' '.join(map(str, command))}")


def only(folder: Path, pattern: str) -> Path:
    """The one file of its kind that is there."""
    found = sorted(folder.glob(pattern))
    if len(found) != 1:
        sys.exit(f"make_wheel.py: {len(found)} files {pattern} in {folder} (expected one)")
    return found[0]


def empty(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for file in folder.iterdir():
        file.unlink()
    return folder


def build_wheel(options: tuple[str, ...], packages: dict[str, str], folder: Path) -> Path:
    """As pip builds it, in a folder of its own that is kept for the next time."""
    settings = [f"--config-settings=setup-args={option}" for option in options]
    settings.append(f"--config-settings=build-dir=build/portable{'' if packages else '-shared'}")
    run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-build-isolation", "--no-deps", "--wheel-dir", empty(folder), *settings, ".", **packages)
    return only(folder, "*.whl")


def repair(wheel: Path) -> Path:
    """Bring the libraries along that a system need not have."""
    run(sys.executable, "-m", "auditwheel", "repair", "--strip", "--zip-compression-level", "9", "--wheel-dir", empty(WHEELS), wheel)
    return only(WHEELS, "*.whl")


def look_at(wheel: Path, most: int) -> None:
    """Size and contents."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        libraries = sorted((item.file_size, Path(item.filename).name) for item in archive.infolist() if ".libs/" in item.filename and item.file_size)
    for size, name in reversed(libraries):
        print(f"  {size / MEGABYTE:6.2f} MB  {name}")
    print(f"{wheel.name}: {wheel.stat().st_size / MEGABYTE:.2f} MB, {len(libraries)} libraries beside it")
    if missing := [need for need in NEEDED if not any(name.endswith(need) for name in names)]:
        sys.exit(f"make_wheel.py: not in the wheel: {', '.join(missing)}")
    if wheel.stat().st_size > most:
        sys.exit(f"make_wheel.py: larger than {most / MEGABYTE:.0f} MB")


def try_out(wheel: Path) -> None:
    """Install it where nothing is, and run tests that leave no part out."""
    with tempfile.TemporaryDirectory() as folder:
        bare = Path(folder) / "venv"
        venv.create(bare, with_pip=True)
        python = bare / "bin" / "python"
        clean = {"PATH": f"{bare / 'bin'}:/usr/bin:/bin", "LD_LIBRARY_PATH": "", "PYTHONPATH": "", "OPENBLAS_NUM_THREADS": "1"}
        run(python, "-m", "pip", "install", "--quiet", f"{wheel}[test]", **clean)
        run(bare / "bin" / "linkdyn", "--version", **clean)
        run(python, "-m", "pytest", "-q", "-n", str(os.cpu_count()), "-p", "no:cacheprovider", *TESTS, **clean)


def build_sdist() -> None:
    """Of what is committed."""
    run(sys.executable, "-m", "build", "--sdist", "--no-isolation", "--outdir", WHEELS)
    sdist = only(WHEELS, "*.tar.gz")
    print(f"{sdist.name}: {sdist.stat().st_size / MEGABYTE:.2f} MB")
    if sdist.stat().st_size > MOST_SDIST:
        sys.exit(f"make_wheel.py: larger than {MOST_SDIST / MEGABYTE:.0f} MB")


def main(*arguments: str) -> None:
    shared = "--shared" in arguments
    options = (*PORTABLE, *(() if shared else STATIC), *(option for option in arguments if option != "--shared"))
    packages = {}
    if not shared:
        if not (LIBRARIES / "lib" / "pkgconfig" / "lapack.pc").exists():
            run("sh", "tools/wheels/build_libraries.sh", LIBRARIES, BUILD / "libraries-src")
        packages = {"PKG_CONFIG_PATH": str(LIBRARIES / "lib" / "pkgconfig")}
    wheel = repair(build_wheel(options, packages, BUILD / "wheels-raw"))
    look_at(wheel, 100 * MEGABYTE if shared else MOST_WHEEL)
    try_out(wheel)
    build_sdist()


if __name__ == "__main__":
    main(*sys.argv[1:])
