#!/usr/bin/env bash
# Puts libpalpate, palpate.h, Palpate.cs, palpate.pc and PalpateConfig.cmake below a prefix: install_c.sh [PREFIX] [FOLDER]
# FOLDER is where a build has left the library; without it the library is built here.
set -euo pipefail
root="$(cd "$(dirname "$0")/.." && pwd)"
prefix="${1:-/usr/local}"
built="${2:-}"
if [ -z "$built" ]; then
    cargo build --release --quiet --manifest-path "$root/Cargo.toml" -p palpate-capi
    built="${CARGO_TARGET_DIR:-$root/target}/release"
fi
version="$(sed -n 's/^version = "\(.*\)"/\1/p' "$root/Cargo.toml" | head -n 1)"
number() { sed -n "s/.*PALPATE_ABI_$1: u32 = \([0-9]*\);.*/\1/p" "$root/crates/capi/src/abi.rs"; }
major="$(number MAJOR)"
minor="$(number MINOR)"
mkdir -p "$prefix/lib/pkgconfig" "$prefix/lib/cmake/Palpate" "$prefix/include"
prefix="$(cd "$prefix" && pwd)"
lib="$prefix/lib"

# Beside, then renamed: a program that runs keeps the library that it has. Tables of source lines stay where it was built.
place() { install -m "$1" "$2" "$3.new" && mv -f "$3.new" "$3"; }
place_library() { install -m "$1" "$2" "$3.new" && strip -S "$3.new" && mv -f "$3.new" "$3"; }
place 644 "$root/crates/capi/include/palpate.h" "$prefix/include/palpate.h"
place 644 "$root/crates/capi/csharp/Palpate.cs" "$prefix/include/Palpate.cs"
shared="libpalpate.so.$major"
place_library 755 "$built/libpalpate.so" "$lib/libpalpate.so.$major.$minor"
ln -sfn "libpalpate.so.$major.$minor" "$lib/$shared"
ln -sfn "$shared" "$lib/libpalpate.so"
place_library 644 "$built/libpalpate.a" "$lib/libpalpate.a"

cat >"$lib/pkgconfig/palpate.pc" <<END
prefix=$prefix
libdir=\${prefix}/lib
includedir=\${prefix}/include

Name: palpate
Description: Soft bodies for haptics
Version: $version
Cflags: -I\${includedir}
Libs: -L\${libdir} -lpalpate
Libs.private: -lpthread -ldl -lm
END

cat >"$lib/cmake/Palpate/PalpateConfig.cmake" <<END
# Palpate::palpate is the shared library, Palpate::palpate_static the static one.
get_filename_component(_palpate_prefix "\${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if(NOT TARGET Palpate::palpate)
  add_library(Palpate::palpate SHARED IMPORTED)
  set_target_properties(Palpate::palpate PROPERTIES
    IMPORTED_LOCATION "\${_palpate_prefix}/lib/$shared"
    INTERFACE_INCLUDE_DIRECTORIES "\${_palpate_prefix}/include")
  add_library(Palpate::palpate_static STATIC IMPORTED)
  set_target_properties(Palpate::palpate_static PROPERTIES
    IMPORTED_LOCATION "\${_palpate_prefix}/lib/libpalpate.a"
    INTERFACE_INCLUDE_DIRECTORIES "\${_palpate_prefix}/include"
    INTERFACE_LINK_LIBRARIES "pthread;dl;m")
endif()
unset(_palpate_prefix)
END

cat >"$lib/cmake/Palpate/PalpateConfigVersion.cmake" <<END
set(PACKAGE_VERSION "$version")
# The interface is stable within a major number of the ABI, not of the version: $version is ABI $major.$minor.
if(PACKAGE_FIND_VERSION VERSION_GREATER PACKAGE_VERSION)
  set(PACKAGE_VERSION_COMPATIBLE FALSE)
else()
  set(PACKAGE_VERSION_COMPATIBLE TRUE)
  if(PACKAGE_FIND_VERSION VERSION_EQUAL PACKAGE_VERSION)
    set(PACKAGE_VERSION_EXACT TRUE)
  endif()
endif()
END
echo "palpate $version (ABI $major.$minor) is in $prefix"
