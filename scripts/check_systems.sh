#!/usr/bin/env bash
# Checks that the package compiles for Windows and macOS: scripts/check_systems.sh [TARGET...]. Only Rust is checked: no
# compiler, archiver or SDK of these systems is needed, for what they would build is left empty. Nothing is linked.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- x86_64-pc-windows-msvc aarch64-apple-darwin x86_64-apple-darwin
folder=$PWD/target/systems
mkdir -p "$folder"
# Its options are those of cc, ar, ml64 and lib.
cat >"$folder/empty" <<'EOF'
#!/bin/sh
names_output=
for word; do
    case $word in
        -o) names_output=1 ;;
        -Fo* | /Fo*) : >"${word#???}" ;;
        -[oO][uU][tT]:* | /[oO][uU][tT]:*) : >"${word#?????}" ;;
        -E) exit 0 ;;
        *.a | *.lib) : >"$word" ;;
        *) [ -z "$names_output" ] || : >"$word"; names_output= ;;
    esac
done
EOF
chmod +x "$folder/empty"
# In the profile and folder of other builds: the macros and build scripts that these compiled run here too.
for target; do
    if ! timeout 60 rustup target add "$target" >/dev/null 2>&1; then
        echo "$target: not checked, its library cannot be had: rustup target add $target" >&2
        continue
    fi
    name=${target//-/_}
    env "CC_$name=$folder/empty" "CXX_$name=$folder/empty" "AR_$name=$folder/empty" CC_MASM_ASM="$folder/empty" \
        PYO3_CROSS_PYTHON_VERSION=3.10 cargo check --release --quiet --locked --target "$target" -p palpate-python --lib
    echo "$target: compiles"
done
