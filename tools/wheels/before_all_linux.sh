#!/bin/sh
# What a manylinux image lacks for building wheels. Usage: before_all_linux.sh PROJECT
set -eu
dnf install -y --setopt=install_weak_deps=False cmake curl make pkgconf-pkg-config xz zlib-devel
sh "$1/tools/wheels/build_libraries.sh" /opt/libraries /tmp/libraries-src
# so is the encoder of machine code, for x86-64
if [ "$(uname -m)" = x86_64 ]; then
    curl -fsSL https://github.com/herumi/xbyak/archive/refs/tags/v6.68.tar.gz | tar -xz -C /tmp
    cp -r /tmp/xbyak-6.68/xbyak /usr/local/include/
fi
# toml++ is headers alone; its wrap is the newest that meson knows
mkdir -p "$1/subprojects"
[ -f "$1/subprojects/tomlplusplus.wrap" ] || { cd "$1" && pipx run meson wrap install tomlplusplus; }
