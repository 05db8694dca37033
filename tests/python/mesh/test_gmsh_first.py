"""Gmsh's first format: the mesh that its second one has, by another reader."""

from __future__ import annotations

import meshio
import numpy as np
import pytest
from conftest import bent, box_mesh

import palpate

TYPES = {"tetra": 4, "tetra10": 11}


def first_format(path, mesh: palpate.TetMesh) -> None:
    """Write numbers of nodes with gaps, a face that is left out, and regions, as programs of the time did."""
    numbers = 10 * np.arange(len(mesh.nodes)) + 7
    lines = ["$NOD", str(len(mesh.nodes))]
    lines += [f"{n} {x:.17g} {y:.17g} {z:.17g}" for n, (x, y, z) in zip(numbers, mesh.nodes, strict=True)]
    lines += ["$ENDNOD", "$ELM", str(len(mesh.tets) + 1), f"1 2 9 1 3 {numbers[0]} {numbers[1]} {numbers[2]}"]
    order = [0, 1, 2, 3] if mesh.tets.shape[1] == 4 else [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]
    kind = 4 if mesh.tets.shape[1] == 4 else 11
    for rank, (tet, region) in enumerate(zip(mesh.tets[:, order], mesh.regions, strict=True), 2):
        lines.append(" ".join(map(str, [rank, kind, region, 1, len(tet), *numbers[tet]])))
    path.write_text("\n".join([*lines, "$ENDELM", ""]))


@pytest.mark.parametrize("quadratic", [False, True])
def test_it_is_the_mesh_of_the_second_format(tmp_path, quadratic):
    mesh = box_mesh()
    mesh = palpate.TetMesh(mesh.nodes, mesh.tets, 1 + (mesh.nodes[mesh.tets].mean(axis=1)[:, 0] > 0.04))
    mesh = bent(mesh.to_quadratic()) if quadratic else mesh
    first_format(tmp_path / "first.msh", mesh)
    mesh.write(tmp_path / "second.msh")
    first, second = (palpate.TetMesh.read(tmp_path / f"{name}.msh", "m") for name in ("first", "second"))
    assert np.array_equal(first.tets, second.tets) and np.array_equal(first.regions, second.regions)
    assert np.abs(first.nodes - second.nodes).max() < 1e-15 and len(np.unique(first.regions)) == 2
    assert len(meshio.read(tmp_path / "second.msh").points) == len(first.nodes)
