#!/usr/bin/env bash
# Builds the program of pages without a server: scripts/build_web.sh FILE. The target wasm32-unknown-unknown comes from rustup;
# where that has none, compiler, target and linker come from Debian's packages, into target/wasm-toolchain (785 MB), which runs
# beside whatever the system has: 190 MB to fetch, half a minute.
set -euo pipefail
cd "$(dirname "$0")/.."
out=$1
target=wasm32-unknown-unknown
root=$PWD/target/wasm-toolchain
suite=forky

has_target() {
    [ -n "$(find "$(rustc --print sysroot)/lib/rustlib/$target/lib" -name 'libcore-*.rlib' 2>/dev/null)" ]
}

# Runs a program of the packages by their own loader and libraries: the system's may be older.
wrapper() {
    printf '#!/bin/sh\nexec %s/usr/lib64/ld-linux-x86-64.so.2 --argv0 %s --library-path %s:%s %s "$@"\n' \
        "$root" "$1" "$root/usr/lib/x86_64-linux-gnu" "$(dirname "$2")/../lib" "$2" >"$root/$1"
    chmod +x "$root/$1"
}

from_debian() {
    [ -f "$root/.ready" ] && return
    command -v apt-get >/dev/null && [ "$(dpkg --print-architecture)" = amd64 ] || {
        echo "the target $target is missing: rustup target add $target" >&2
        exit 1
    }
    # The mirror is that of the system's own packages.
    mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | grep -v security | sort -u | head -n 1)
    rm -rf "$root"
    mkdir -p "$root"/apt/{lists/partial,archives/partial,debs}
    echo "deb $mirror $suite main" >"$root/apt/sources.list"
    cat >"$root/apt/apt.conf" <<EOF
Dir::State "$root/apt";
Dir::State::lists "$root/apt/lists";
Dir::State::status "/dev/null";
Dir::Cache "$root/apt";
Dir::Etc::sourcelist "$root/apt/sources.list";
Dir::Etc::sourceparts "-";
APT::Sandbox::User "root";
Acquire::Languages "none";
EOF
    export APT_CONFIG=$root/apt/apt.conf
    apt-get update -qq >/dev/null
    # The compiler is a shared library; what that one needs, but no C compiler: the system's links build scripts.
    library=$(apt-cache depends libstd-rust-dev | sed -n 's/.*Depends: \(libstd-rust-[0-9.]*\)$/\1/p')
    linker=$(apt-cache depends libstd-rust-dev-wasm32 | sed -n 's/.*Recommends: \(lld-[0-9]*\)$/\1/p')
    needed=$(apt-cache depends --recurse --no-recommends --no-suggests --no-conflicts --no-breaks --no-replaces \
        --no-enhances "$library" "$linker" | grep '^[a-z]' | sort -u)
    # shellcheck disable=SC2086  # names of packages
    (cd "$root/apt/debs" && apt-get download -qq rustc libstd-rust-dev libstd-rust-dev-wasm32 $needed)
    for package in "$root"/apt/debs/*.deb; do dpkg-deb -x "$package" "$root"; done
    rm -rf "$root/apt"
    wrapper rustc "$root/usr/bin/rustc"
    wrapper wasm-ld "$(find "$root/usr/lib" -path '*llvm-*/bin/lld')"
    "$root/rustc" -vV >/dev/null
    touch "$root/.ready"
}

if ! has_target; then
    # Where rustup reaches nothing it would try for a minute.
    if timeout 20 rustup target add $target >/dev/null 2>&1 && has_target; then :; else
        from_debian
        export RUSTC=$root/rustc CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$root/wasm-ld
    fi
fi
# Vectors of 128 bits, but none of the relaxed ones: their rounding differs between engines.
RUSTFLAGS="-C target-feature=+simd128" cargo build --quiet --locked --profile web --target $target --target-dir target/web -p palpate-web
mkdir -p "$(dirname "$out")"
cp "target/web/$target/web/palpate_web.wasm" "$out.new"
mv "$out.new" "$out"
