#!/bin/sh
# What a manylinux image lacks for building wheels. Usage: before_all_linux.sh PROJECT
set -eu
dnf install -y --setopt=install_weak_deps=False cmake curl make pkgconf-pkg-config xz zlib-devel
sh "$1/tools/wheels/build_libraries.sh" /opt/libraries /tmp/libraries-src
# toml++ is headers alone; its wrap is the newest that meson knows
mkdir -p "$1/subprojects"
[ -f "$1/subprojects/tomlplusplus.wrap" ] || { cd "$1" && pipx run meson wrap install tomlplusplus; }
