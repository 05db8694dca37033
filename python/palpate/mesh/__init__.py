"""Meshes: tetrahedra, their files, and NETGEN to make them from surfaces."""

from palpate.mesh.tetmesh import TetMesh
from palpate.mesh.tetrahedralize import tetrahedralize

__all__ = ["TetMesh", "tetrahedralize"]
