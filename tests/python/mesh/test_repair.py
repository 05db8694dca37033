"""What repairing leaves beside the body: dropped with its count and volume, so that the body can be solved."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import trimesh
from conftest import box_mesh

import palpate


def with_crumbs(body: palpate.TetMesh) -> tuple[np.ndarray, np.ndarray]:
    """The body, a tetrahedron on one of its edges, one on a vertex and one beside it; each of a millimetre."""
    corner = 1e-3 * np.vstack([np.zeros(3), np.eye(3)])
    (a, b), vertex, new = body.surface_triangles[0][:2], body.surface_triangles[9][0], len(body.nodes)
    middle = body.nodes[[a, b]].mean(axis=0)
    nodes = np.vstack([body.nodes, middle + corner[1:3], body.nodes[vertex] + corner[1:], corner + 0.2])
    crumbs = [[a, b, new, new + 1], [vertex, new + 2, new + 3, new + 4], [new + 5, new + 6, new + 7, new + 8]]
    return nodes, np.vstack([body.tets, crumbs])


def test_crumbs_of_a_repaired_surface_are_dropped_by_count_and_volume(monkeypatch):
    """As fTetWild leaves them: the file of its child is written here."""
    body = box_mesh()
    nodes, tets = with_crumbs(body)
    crumbs = palpate.TetMesh(nodes, tets).volume - body.volume

    def child(command: list[str], time_limit: float) -> int:
        # In the unit box: the longest side is 80 mm.
        np.savez(command[-1], nodes=nodes / 0.08, tets=tets)
        return 0

    monkeypatch.setattr(sys.modules["palpate.mesh.tetrahedralize"], "run_limited", child)
    with pytest.warns(palpate.MeshWarning) as said:
        mesh = palpate.tetrahedralize(trimesh.creation.box(bounds=[[0, 0, 0], [0.08, 0.05, 0.05]]), repair=True)
    text = f"3 tetrahedra that share no face with the rest, {crumbs:.2g} m3 of 0.0002 m3, were dropped"
    assert sum(text in str(warning.message) for warning in said) == 1
    assert mesh.volume == pytest.approx(body.volume, rel=1e-12)
    assert len(mesh.tets) == len(body.tets)
    clamped = {"material": palpate.Material(1e4, 0.4), "fixed": lambda p: p[:, 0] < 1e-9}
    palpate.Body(mesh, **clamped).require_supported()
    with pytest.raises(palpate.BodyError, match=r"part of 4 nodes around"):
        palpate.Body(palpate.TetMesh(nodes, tets), **clamped).require_supported()
