"""Slabs of soft tissue with a nodule somewhere inside, on one regular mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.body import Body, Material
from palpate.green import precompute
from palpate.mesh import TetMesh
from palpate.mesh.elements import kuhn_tets
from palpate.scene import BuiltScene, Scene

# Sides of a slab, m, and cells along them.
SIDES, CELLS = np.array([0.06, 0.06, 0.03]), np.array([10, 10, 5])
TISSUE, NODULE = Material(5e3, 0.45), Material(60e3, 0.45)
NODULE_RADIUS, TOOL_RADIUS = 0.006, 0.005
# The nodule's middle lies so far from the sides, m, and so deep.
MARGIN, DEPTHS = 0.014, (0.009, 0.013)


@dataclass(frozen=True)
class Slab:
    """A slab ready to be touched, and the middle (3,) of its nodule, m; None for a plain one."""

    scene: BuiltScene
    nodule: np.ndarray | None


def plain_slab() -> Slab:
    """Slab without a nodule."""
    return _solved(None)


def random_slab(number: int) -> Slab:
    """Slab whose nodule lies somewhere: the same number gives the same slab."""
    random = np.random.default_rng([26, number])
    place = random.uniform([MARGIN, MARGIN], SIDES[:2] - MARGIN)
    return _solved(np.array([*place, SIDES[2] - random.uniform(*DEPTHS)]))


def _solved(nodule: np.ndarray | None) -> Slab:
    mesh = _mesh()
    middles = mesh.nodes[mesh.tets].mean(axis=1)
    inside = np.zeros(len(middles), int)
    if nodule is not None:
        inside[np.linalg.norm(middles - nodule, axis=1) < NODULE_RADIUS] = 1
        # Where the elements are that were taken; all have one volume.
        nodule = middles[inside == 1].mean(axis=0)
    body = Body(
        TetMesh(mesh.nodes, mesh.tets, inside).to_quadratic(),
        material={0: TISSUE, 1: NODULE} if nodule is not None else TISSUE,
        fixed="z < min + 0.1mm",
    )
    green = precompute(body, touch="z > max - 0.1mm", precision="f32", progress=False)
    scene = Scene(
        body={"model": "beam", "name": "slab"},
        material={"law": "linear"},
        tool={"radius": TOOL_RADIUS, "friction": 0.1},
        view={"strain_limit": 0},
    )
    return Slab(BuiltScene.of(scene, body, green), nodule)


def _mesh() -> TetMesh:
    axes = [np.linspace(0.0, side, cells + 1) for side, cells in zip(SIDES, CELLS, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    return TetMesh(nodes, kuhn_tets(CELLS + 1))
