"""Cost of a tick against the size of the body: one sticking contact, a touch region of 1000 nodes on both bodies.

Run: .venv/bin/python benches/tick_cost.py

The force loop reads only the contact's rows of Psi, so a body of 20,000 nodes should cost what one of 1,000 does.
Both are timed in turns in the same run; the medians and their ratio are printed.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

import palpate

TOUCHABLE = 1000
TICKS = 20_000
TURNS = 9
RADIUS = 0.06


def ball(max_element_size: float) -> palpate.TetMesh:
    """Ball of 60 mm radius filled with elements of the given size."""
    import trimesh

    fine = max_element_size < 0.004
    return palpate.tetrahedralize(
        trimesh.creation.icosphere(subdivisions=5 if fine else 4, radius=RADIUS), max_element_size
    )


def simulation(mesh: palpate.TetMesh, folder: Path) -> palpate.Simulation:
    """Ready to press on the top, the 1000 (or all) highest surface nodes touchable."""
    soft = palpate.Material(youngs_modulus=10e3, poissons_ratio=0.45)
    body = palpate.Body(mesh, material=soft, fixed=lambda p: p[:, 2] < -0.8 * RADIUS)
    highest = mesh.surface_nodes[np.argsort(-mesh.nodes[mesh.surface_nodes, 2])[:TOUCHABLE]]
    store = folder / f"{len(mesh.nodes)}.palpate"
    palpate.precompute(body, touch=np.sort(highest), path=store)
    return palpate.Simulation(palpate.Scene.of_store(store))


def microseconds_a_tick(pressed: palpate.Simulation, path: np.ndarray) -> float:
    """Mean over one offline run along a path, overhead of the call included."""
    began = time.perf_counter()
    forces = pressed.run(path)
    elapsed = time.perf_counter() - began
    assert (forces[len(forces) // 2] != 0).any(), "the tool does not touch"
    return 1e6 * elapsed / len(path)


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        bodies = [ball(0.0085), ball(0.0032)]
        loops = [simulation(mesh, Path(folder)) for mesh in bodies]
        depth = 0.004 * np.sin(np.linspace(0, np.pi, TICKS))
        path = np.column_stack([np.zeros((TICKS, 2)), RADIUS + 0.005 - depth])
        times = np.array([[microseconds_a_tick(loop, path) for loop in loops] for _ in range(TURNS)])
    medians = np.median(times, axis=0)
    for mesh, median in zip(bodies, medians, strict=True):
        print(f"{len(mesh.nodes):6d} nodes, {len(mesh.surface_nodes):5d} on the surface: {median:.2f} us a tick")
    print(f"ratio {medians[1] / medians[0]:.2f} (of {TURNS} turns of {TICKS} ticks each)")


if __name__ == "__main__":
    main()
