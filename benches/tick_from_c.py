"""What a tick costs a program in C++ beside one in Rust: the same scene and path, in turn.

Run: .venv/bin/python benches/tick_from_c.py --prefix DIR

Needs g++ and pkg-config, and the library installed: `make install PREFIX=DIR`.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np

import palpate

ROOT = Path(__file__).resolve().parents[1]
TICKS, PASSES, ROUNDS = 2000, 20, 9
# What docs/c-api.md promises.
MOST = 1.2


def path_of(top: np.ndarray) -> np.ndarray:
    """Press, slide and lift, again and again: every kind of tick, (TICKS, 3) m."""
    phase = np.linspace(0, 16 * np.pi, TICKS)
    height = 0.004 + 0.004 * np.cos(phase)
    return top + np.stack([0.01 * np.sin(phase / 8), 0.008 * np.cos(phase / 8), height], axis=1)


def main() -> None:
    """Measure both in turn and print their medians, and the ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--prefix", type=Path, required=True, help="Where the library is installed.")
    prefix = parser.parse_args().prefix.resolve()
    flags = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "palpate"],
        env={**os.environ, "PKG_CONFIG_PATH": f"{prefix}/lib/pkgconfig"},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    with tempfile.TemporaryDirectory() as folder:
        packed, positions, program = (Path(folder) / name for name in ("liver.pack", "positions", "tick_from_c"))
        scene = palpate.Scene(
            body={"model": "liver", "paper": True}, tool={"radius": 0.006}, view={"strain_limit": 0}
        ).build()
        palpate.pack(scene, packed)
        surface = scene.bodies[0].green.surface_positions
        positions.write_bytes(path_of(surface[surface[:, 2].argmax()]).tobytes())
        source = ROOT / "benches/tick_from_c.cpp"
        subprocess.run(
            ["g++", "-O2", "-std=c++17", source, "-o", program, *flags, f"-Wl,-rpath,{prefix}/lib"], check=True
        )
        # Together with the extension, so that both share what is compiled.
        packages = ["-p", "palpate-capi", "-p", "palpate-python", "--example", "ticks"]
        subprocess.run(["cargo", "build", "--release", "--quiet", *packages], cwd=ROOT, check=True)
        rust = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release/examples/ticks"
        times = np.array([[_time(which, packed, positions) for which in (rust, program)] for _ in range(ROUNDS)])
    (of_rust, of_c), ratio = 1e-3 * np.median(times, axis=0), np.median(times[:, 1] / times[:, 0])
    print(f"a tick from Rust {of_rust:.2f} us, from C++ {of_c:.2f} us: ratio {ratio:.3f} (median of {ROUNDS} rounds)")
    raise SystemExit(0 if ratio <= MOST else 1)


def _time(program: Path, scene: Path, positions: Path) -> float:
    done = subprocess.run([program, scene, positions, str(PASSES)], capture_output=True, text=True, check=True)
    return float(done.stdout)


if __name__ == "__main__":
    main()
