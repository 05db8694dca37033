"""Same scene, same path, same bits: again, and with another number of threads."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import palpate
from palpate.scene import BuiltBody, BuiltScene

UP = np.array([0.0, 0.0, 1.0])
TURNED = (0.5, 0.5, -0.5, 0.5)


def play(store: Path) -> palpate.Recording:
    """Two tools on two placed bodies, limited in strain, off and on again; every number that a script leaves."""
    tables = [{"store": os.fspath(store)}, {"store": os.fspath(store), "position": [0.1, 0, 0], "orientation": TURNED}]
    tools = [{"radius": 0.006, "contact_radius": 0.012}, {"radius": 0.005, "contact_radius": 0.008}]
    scene = palpate.Scene(body=tables, tool=tools, device={"ramp": 0}).build(progress=False)
    return palpate.Simulation(scene).play(path_of(scene.bodies), watch=[(0, 5), (1, 5)])


def path_of(bodies: tuple[BuiltBody, ...]) -> np.ndarray:
    depth = 0.012 * np.abs(np.sin(np.linspace(0, 3 * np.pi, 500))) - 0.001
    first = np.array([0.031, 0.026, 0.056]) - np.outer(depth, UP) + np.outer(depth, [0.3, 0.1, 0])
    second = np.array([0.061, 0.026, 0.055]) - np.outer(depth, UP)
    return np.stack([first, np.where(np.arange(500)[:, None] < 250, second, bodies[1].points_to_scene(second))], axis=1)


def digest(recording: palpate.Recording) -> str:
    arrays = (recording.forces, recording.torques, recording.displacements, recording.limited)
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


def test_the_same_bits_again_and_with_any_number_of_threads(block_green, tmp_path):
    store = tmp_path / "block.palpate"
    block_green.save(store)
    recording = play(store)
    assert np.abs(recording.forces).max() > 0.1 and recording.limited.any(axis=0).all()
    assert np.array_equal(play(store).forces, recording.forces)
    code = f"from test_determinism import *; print(digest(play(Path({os.fspath(store)!r}))))"
    for threads in ("1", "2"):
        paths = [os.fspath(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = {**os.environ, "RAYON_NUM_THREADS": threads, "PYTHONPATH": os.pathsep.join(paths)}
        run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=280)
        assert run.returncode == 0, run.stderr
        assert run.stdout.strip() == digest(recording)


@pytest.mark.slow
def test_the_same_bits_from_a_store_of_any_number_of_threads(block, tmp_path):
    """What is precomputed does not depend on the threads either."""
    digests = set()
    block.mesh.write(tmp_path / "block.vtu")
    code = (
        "import sys, hashlib, palpate; body = palpate.Body(palpate.TetMesh.read('block.vtu'), "
        "material=palpate.Material(10e3, 0.4, 1000.0), fixed=lambda p: p[:, 0] < 1e-9); "
        "green = palpate.precompute(body, precision='f64', path=sys.argv[1], progress=False); "
        "touch = green.touch((0.04, 0.026, 0.05), (0, 0, -1e-3), 0.01); "
        "print(hashlib.sha256(touch.displacements.tobytes()).hexdigest())"
    )
    for threads in ("1", "2"):
        command = [sys.executable, "-c", code, f"{threads}.palpate"]
        environment = {**os.environ, "RAYON_NUM_THREADS": threads}
        run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=280, cwd=tmp_path)
        assert run.returncode == 0, run.stderr
        digests.add(run.stdout.strip())
    assert len(digests) == 1


@pytest.mark.parametrize("contact", ["patch", "node"])
def test_two_simulations_of_one_scene_do_not_share_a_state(block, block_green, contact):
    scene = palpate.Scene(body={"store": "b.palpate"}, tool={"radius": 0.006, "contact": contact})
    one, other = (palpate.Simulation(BuiltScene.of(scene, block, block_green)) for _ in range(2))
    path = np.array([0.041, 0.026, 0.057]) - np.outer(np.linspace(0, 0.004, 100), UP)
    first = one.run(path)
    assert np.abs(first).max() > 0
    one.run(path[::-1])
    assert np.array_equal(other.run(path), first) and np.array_equal(one.run(path), first)
