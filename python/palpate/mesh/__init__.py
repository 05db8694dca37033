"""Tetrahedra: nodes, elements, surface; their files; meshing of surfaces; solids that place regions in them."""

from palpate.mesh import shapes
from palpate.mesh.size import size_text
from palpate.mesh.tetmesh import TetMesh
from palpate.mesh.tetrahedralize import tetrahedralize

__all__ = ["TetMesh", "shapes", "size_text", "tetrahedralize"]
