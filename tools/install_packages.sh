#!/bin/sh
# Install the system packages that building linkdyn needs and that are missing. Does nothing, and
# asks for no rights, when all are there.
# Usage: [MPI=1] [TESTS=1] install_packages.sh PYTHON
# MPI=1 asks for OpenMPI too, for -Dmpi=enabled; TESTS=1 for the browser that the viewer is tested in.
set -u
python=$1
missing=""

need() { # need PACKAGE COMMAND...: the package is missing if the command fails
    package=$1
    shift
    "$@" >/dev/null 2>&1 || missing="$missing $package"
}

need gfortran gfortran --version
need g++ g++ --version
need pkg-config pkg-config --version
if ! ninja --version >/dev/null 2>&1; then need ninja-build ninja-build --version; fi
need libopenblas-dev pkg-config --exists openblas
need libgsl-dev pkg-config --exists gsl
need libnetcdff-dev pkg-config --exists netcdf-fortran
need libtomlplusplus-dev pkg-config --exists tomlplusplus
# without it kernels are interpreted; other processors have no use for it
if [ "$(uname -m)" = x86_64 ]; then need libxbyak-dev sh -c "echo '#include <xbyak/xbyak.h>' | g++ -E -x c++ - -o /dev/null"; fi
if [ -n "${MPI:-}" ]; then
    need libopenmpi-dev mpifort --version
    need openmpi-bin mpirun --version
fi
if [ -n "${TESTS:-}" ]; then need chromium chromium --version; fi
need python3 "$python" --version
need python3-venv "$python" -c "import ensurepip, venv"
need python3-dev "$python" -c "import os, sysconfig as s; os.stat(s.get_path('include') + '/Python.h')"

install="apt-get install -y --no-install-recommends$missing"
if [ -n "$missing" ]; then
    echo "Missing system packages:$missing"
    if ! command -v apt-get >/dev/null 2>&1; then
        echo "This is no Debian system: install the like of these packages, then try again." >&2
        exit 1
    fi
    if [ "$(id -u)" -eq 0 ]; then
        as_root=""
    elif sudo -n true 2>/dev/null; then
        as_root="sudo -n"
    else
        echo "Installing them needs root. Run this line, then try again:" >&2
        echo "    sudo sh -c 'apt-get update && $install'" >&2
        exit 1
    fi
    $as_root apt-get update -q &&
        $as_root env DEBIAN_FRONTEND=noninteractive $install || {
        echo "apt-get failed. Once its complaint is settled, run:" >&2
        echo "    sudo sh -c 'apt-get update && $install'" >&2
        exit 1
    }
fi

if ! "$python" -c "import sys; sys.exit(sys.version_info < (3, 11))"; then
    echo "linkdyn needs Python 3.11 or newer; $python is $("$python" --version 2>&1). Name another: make PYTHON=..." >&2
    exit 1
fi
