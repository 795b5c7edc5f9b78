#!/bin/sh
# Build the libraries that a wheel's executable needs, static and position-independent, with nothing in them that linkdyn has
# no use for: HDF5 without its tools, netCDF without remote data (DAP, S3: they bring curl, OpenSSL, Kerberos), netCDF-Fortran,
# and the reference LAPACK. zlib is the system's, a part of every platform's baseline.
# Usage: build_libraries.sh PREFIX [FOLDER]
# FOLDER keeps the sources from one time to the next. Then build linkdyn with
#   PKG_CONFIG_PATH=PREFIX/lib/pkgconfig, -Dlapack=netlib
set -eu
prefix=$1
work=${2:-$(mktemp -d)}
archive=${LINKDYN_SOURCES:-https://deb.debian.org/debian/pool/main}
jobs=$(nproc 2>/dev/null || echo 2)

get() { # get FILE PATH SHA256: bring a source here, whoever had it, and see that it is the one meant
    [ -f "$work/$1" ] || curl --fail --location --silent --show-error -o "$work/$1" "$archive/$2/$1"
    echo "$3  $work/$1" | sha256sum --check --quiet -
    mkdir -p "$work/${1%%_*}"
    tar -xf "$work/$1" -C "$work/${1%%_*}" --strip-components=1
}

build() { # build NAME OPTION...: static, for shared objects, not tested
    name=$1
    shift
    (
        mkdir -p "$work/$name/build"
        cd "$work/$name/build"
        ../configure --prefix="$prefix" --libdir="$prefix/lib" --disable-shared --with-pic "$@"
        make -j "$jobs" install
    ) >"$work/$name.log" 2>&1 || { tail -n 30 "$work/$name.log"; exit 1; }
}

mkdir -p "$work"
get hdf5_1.10.8+repack1.orig.tar.gz h/hdf5 7b38e58ff83b13fd8959a90b13bf896bc318ba096c940ab0847abf3ad41a0b31
get netcdf_4.9.0.orig.tar.gz n/netcdf 9f4cb864f3ab54adb75409984c6202323d2fc66c003e5308f3cdf224ed41c0a6
get netcdf-fortran_4.6.0+really4.5.4+ds.orig.tar.xz n/netcdf-fortran 3f1916a18e5f621327395d614880fe6d41c04fcf142c55ee2fb3c2d3d2240d4a
get lapack_3.11.0.orig.tar.gz l/lapack 4b9ba79bfd4921ca820e83979db76ab3363155709444a787979e81c22285ffa9

export CPPFLAGS="-I$prefix/include" LDFLAGS="-L$prefix/lib" PKG_CONFIG_PATH="$prefix/lib/pkgconfig"
build hdf5 --enable-build-mode=production --disable-fortran --disable-cxx --disable-tools --disable-tests --without-szlib
# what else the machine happens to have is not looked for
build netcdf --disable-dap --disable-byterange --disable-nczarr --disable-libxml2 --disable-plugins --disable-utilities \
    --disable-testsets --disable-examples \
    ac_cv_lib_curl_curl_easy_setopt=no ac_cv_search_SZ_BufftoBuffCompress=no ac_cv_lib_sz_SZ_BufftoBuffCompress=no \
    ac_cv_search_BZ2_bzCompress=no ac_cv_lib_bz2_BZ2_bzCompress=no ac_cv_lib_zstd_ZSTD_compress=no ac_cv_lib_blosc_blosc_init=no
LIBS="-lnetcdf -lhdf5_hl -lhdf5 -lz -ldl -lm" build netcdf-fortran

# of LAPACK double precision alone; it has no configure
cmake -S "$work/lapack" -B "$work/lapack/build" -DCMAKE_BUILD_TYPE=Release -DCMAKE_POSITION_INDEPENDENT_CODE=ON \
    -DCMAKE_INSTALL_PREFIX="$prefix" -DCMAKE_INSTALL_LIBDIR=lib -DBUILD_SHARED_LIBS=OFF -DBUILD_TESTING=OFF \
    -DBUILD_SINGLE=OFF -DBUILD_COMPLEX=OFF -DBUILD_COMPLEX16=OFF >"$work/lapack.log" 2>&1
cmake --build "$work/lapack/build" --target install --parallel "$jobs" >>"$work/lapack.log" 2>&1
