"""A sphere beside the liver's rim has the same force on elements of a half to an eighth of the size.

Their faces follow the same curved surface, but creases of the rim are drawn that larger elements smooth over. Some end
near the place, some meet in a saddle, and some leave a node side by side.
"""

from __future__ import annotations

import numpy as np
import pytest

import palpate
from benches.strain.refined import refined
from palpate.mesh.triangles import node_normals
from palpate.validation.verify.contact.loop import loop_of, sphere

NODE, RADIUS, TICK, DEPTHS = 463, 10e-3, 20e-6, np.array([1e-3, 2e-3, 5e-3])
# Longest edges of the elements within a distance of the place, m.
LONGEST, WITHIN = (8e-3, 4e-3, 2e-3), 12e-3
# Surface that may be touched, over the radius.
AROUND = 3.6
TOLERANCE = 0.05


def forces(mesh: palpate.TetMesh, place: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Along the normal at the depths, N."""
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.45), fixed=mesh.nodes[:, 1] > 0.02)
    near = np.linalg.norm(mesh.nodes[mesh.surface_nodes] - place, axis=1) < AROUND * RADIUS
    green = palpate.precompute(body, touch=mesh.surface_nodes[near], progress=False)
    down = np.arange(-0.5e-3, DEPTHS[-1] + TICK, TICK)
    path = place + (RADIUS - down)[:, None] * normal
    pressed = loop_of(body, green, [sphere(RADIUS)]).play(path).computed_forces @ normal
    return np.interp(DEPTHS, down, pressed)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::palpate.TouchWarning")
def test_the_force_beside_a_rim_does_not_depend_on_the_elements():
    mesh = palpate.models.liver()
    place, normal = mesh.nodes[NODE], node_normals(mesh.nodes, mesh.surface_triangles)[NODE]
    found = np.array([forces(refined(mesh, place, edge, WITHIN), place, normal) for edge in LONGEST])
    assert np.all(np.ptp(found, axis=0) < TOLERANCE * found.mean(axis=0)), found
