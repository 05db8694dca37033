"""Presses deeper than the tool's radius into a smooth organ: the force grows to the end.

Where the body's compliance changes along the surface within the depth, steps of Newton's method went to and fro, and a
contact of 1 N faded to nothing while the tool went on.
"""

from __future__ import annotations

import numpy as np
import pytest

import palpate
from palpate.mesh.triangles import node_normals
from palpate.scene import BuiltScene
from palpate.validation.verify.contact.loop import UNLIMITED, sphere

# Nodes of the built-in kidney at which the force was lost; R, m.
NODES, RADIUS = (364, 2024, 2602, 2721), 8e-3
DEEP, TICK, START = 1.5, 20e-6, 0.5e-3
# Surface that may be touched, over the radius.
AROUND = 4.0
# Part of the force that may be lost on the way: the compliance has a kink over an element's edge.
LOST = 0.01


def pressed(node: int, law: str) -> np.ndarray:
    """Forces along the normal, N, of a press by 20 um a tick."""
    mesh = palpate.models.kidney()
    material = palpate.Material(10e3, 0.45, law=law)
    body = palpate.Body(mesh, material=material, fixed=palpate.models.fixed("kidney", mesh))
    place, normal = mesh.nodes[node], node_normals(mesh.nodes, mesh.surface_triangles)[node]
    near = np.linalg.norm(mesh.nodes[mesh.surface_nodes] - place, axis=1) < AROUND * RADIUS
    green = palpate.precompute(body, touch=mesh.surface_nodes[near], progress=False)
    scene = palpate.Scene(
        body={"model": "kidney"}, tool=[sphere(RADIUS, 0.0)], device=UNLIMITED, view={"strain_limit": 0.0}
    )
    down = np.arange(-START, DEEP * RADIUS, TICK)
    path = place + (RADIUS - down)[:, None] * normal
    return palpate.Simulation(BuiltScene.of(scene, body, green)).play(path).computed_forces @ normal


def lost(forces: np.ndarray) -> float:
    """Largest part of the force that is lost on the way."""
    return float((np.maximum.accumulate(forces) - forces).max() / forces.max())


@pytest.mark.quick(3)
@pytest.mark.filterwarnings("ignore::palpate.TouchWarning")
@pytest.mark.parametrize("law", ["linear", "neo-hookean"])
@pytest.mark.parametrize("node", NODES)
def test_the_force_of_a_deep_press_grows_to_the_end(node, law):
    forces = pressed(node, law)
    assert forces.max() > 0.3
    assert lost(forces) <= LOST, f"{100 * lost(forces):.1f} % of {forces.max():.2f} N"


def test_a_force_that_is_lost_is_seen():
    forces = np.linspace(0.0, 1.0, 800) ** 1.5
    assert lost(forces) == 0.0
    assert lost(np.where(np.arange(800) == 700, 0.95 * forces, forces)) > LOST
    assert lost(np.append(forces, forces[::-1])) > LOST
