"""What a tick costs a program in C++ beside one in Rust: the same scene and path, in turn.

Needs g++, pkg-config and cargo, and the library installed: `make install PREFIX=DIR`.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np

import palpate
from benches.tick_case import Row

HERE = Path(__file__).resolve().parent
TICKS, PASSES, ROUNDS = 2000, 20, 9
# Name of the ratio among the figures, and what docs/c-api.md promises of it.
RATIO, MOST = "over Rust", 1.2


def rows(prefix: Path) -> list[Row]:
    """Measure both in turn: medians of the rounds, and beside that of C++ the median ratio to Rust in a round."""
    prefix = prefix.resolve()
    with tempfile.TemporaryDirectory() as folder:
        packed, positions, of_c = (Path(folder) / name for name in ("liver.pack", "positions", "tick_from_c"))
        scene = palpate.Scene(
            body={"model": "liver", "paper": True}, tool={"radius": 0.006}, view={"strain_limit": 0}
        ).build()
        palpate.pack(scene, packed)
        surface = scene.bodies[0].green.surface_positions
        positions.write_bytes(_path(surface[surface[:, 2].argmax()]).tobytes())
        programs = (_built_rust(), _built_c(prefix, of_c))
        times = 1e-3 * np.array([[_time(one, packed, positions) for one in programs] for _ in range(ROUNDS)])
    ratio = float(np.median(times[:, 1] / times[:, 0]))
    medians = np.median(times, axis=0).tolist()
    return [
        Row("c", {"program": "Rust", "tick": "all"}, medians[0]),
        Row("c", {"program": "C++", "tick": "all"}, medians[1], beside={RATIO: ratio}),
    ]


def _path(top: np.ndarray) -> np.ndarray:
    """Press, slide and lift, again and again: every kind of tick, (TICKS, 3) m."""
    phase = np.linspace(0, 16 * np.pi, TICKS)
    height = 0.004 + 0.004 * np.cos(phase)
    return top + np.stack([0.01 * np.sin(phase / 8), 0.008 * np.cos(phase / 8), height], axis=1)


def _built_c(prefix: Path, program: Path) -> Path:
    environment = {**os.environ, "PKG_CONFIG_PATH": f"{prefix}/lib/pkgconfig"}
    command = ["pkg-config", "--cflags", "--libs", "palpate"]
    flags = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.split()
    source = HERE / "tick_from_c.cpp"
    subprocess.run(["g++", "-O2", "-std=c++17", source, "-o", program, *flags, f"-Wl,-rpath,{prefix}/lib"], check=True)
    return program


def _built_rust() -> Path:
    # Together with the extension, so that both share what is compiled.
    packages = ["-p", "palpate-capi", "-p", "palpate-python", "--example", "ticks"]
    subprocess.run(["cargo", "build", "--release", "--quiet", *packages], cwd=HERE.parent, check=True)
    return Path(os.environ.get("CARGO_TARGET_DIR", HERE.parent / "target")) / "release/examples/ticks"


def _time(program: Path, scene: Path, positions: Path) -> float:
    done = subprocess.run([program, scene, positions, str(PASSES)], capture_output=True, text=True, check=True)
    return float(done.stdout)
