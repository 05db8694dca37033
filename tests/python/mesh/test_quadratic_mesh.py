"""Meshes of 10-node tetrahedra: topology, repair, files, and what is refused."""

from __future__ import annotations

import subprocess
import sys

import meshio
import numpy as np
import pytest
import trimesh
from conftest import bent, box_mesh

import palpate
from palpate.mesh.elements import drawing_tets
from palpate.mesh.files import LINEAR_ONLY, WRITERS

EDGES = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]


@pytest.fixture(scope="module")
def linear():
    mesh = box_mesh(cells=(3, 2, 2))
    regions = (mesh.nodes[mesh.tets].mean(axis=1)[:, 0] > 0.04).astype(int) + 1
    return palpate.TetMesh(mesh.nodes, mesh.tets, regions)


@pytest.fixture(scope="module")
def curved(linear):
    return bent(linear.to_quadratic())


def test_middles_follow_the_nodes_and_are_shared(linear):
    mesh = linear.to_quadratic()
    assert mesh.tets.shape == (len(linear.tets), 10)
    assert np.array_equal(mesh.nodes[: len(linear.nodes)], linear.nodes)
    assert np.array_equal(mesh.tets[:, :4], linear.tets)
    assert np.array_equal(mesh.regions, linear.regions)
    edges = {tuple(sorted((t[i], t[j]))) for t in linear.tets.tolist() for i, j in EDGES}
    assert len(mesh.nodes) == len(linear.nodes) + len(edges)
    for k, (i, j) in enumerate(EDGES):
        middles = (mesh.nodes[mesh.tets[:, i]] + mesh.nodes[mesh.tets[:, j]]) / 2
        assert np.abs(mesh.nodes[mesh.tets[:, 4 + k]] - middles).max() <= 1e-17
    assert mesh.volumes == pytest.approx(linear.volumes, rel=1e-12)
    assert mesh.to_quadratic() is mesh
    assert "10-node" in repr(mesh)


def test_surface_is_drawn_by_four_triangles_a_face(linear, curved):
    straight = linear.to_quadratic()
    for mesh in (straight, curved):
        assert mesh.surface_faces.shape == (len(linear.surface_triangles), 6)
        assert len(mesh.surface_triangles) == 4 * len(mesh.surface_faces)
        assert np.array_equal(mesh.surface_nodes, np.unique(mesh.surface_faces))
        surface = trimesh.Trimesh(mesh.nodes, mesh.surface_triangles, process=False)
        surface.remove_unreferenced_vertices()
        assert surface.is_watertight
        assert surface.volume == pytest.approx(mesh.volume, rel=1e-12 if mesh is straight else 0.01)
        for k in range(3):
            ends = mesh.nodes[mesh.surface_faces[:, k]] + mesh.nodes[mesh.surface_faces[:, (k + 1) % 3]]
            offset = mesh.nodes[mesh.surface_faces[:, 3 + k]] - ends / 2
            assert np.abs(offset).max() <= (1e-16 if mesh is straight else 2e-3)


def test_drawing_tets_fill_the_body(linear):
    mesh = linear.to_quadratic()
    p = mesh.nodes[drawing_tets(mesh.tets)]
    volumes = np.einsum("ij,ij->i", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), p[:, 3] - p[:, 0]) / 6
    assert volumes.reshape(-1, 8) == pytest.approx(np.tile(mesh.volumes[:, None] / 8, 8), rel=1e-9)


@pytest.mark.parametrize("shape", ["straight", "curved"])
def test_inverted_elements_are_turned_round_with_their_middles(linear, curved, shape):
    mesh = linear.to_quadratic() if shape == "straight" else curved
    tets = mesh.tets.copy()
    tets[::2] = tets[::2][:, [1, 0, 2, 3, 4, 6, 5, 8, 7, 9]]
    repaired = palpate.TetMesh(mesh.nodes, tets)
    assert repaired.volumes == pytest.approx(mesh.volumes, rel=1e-12)
    assert np.array_equal(np.sort(repaired.surface_faces, axis=None), np.sort(mesh.surface_faces, axis=None))


def test_orphans_are_dropped(curved):
    nodes = np.vstack([[9.0, 9.0, 9.0], curved.nodes])
    with pytest.warns(palpate.MeshWarning, match="1 nodes belong to no tetrahedron"):
        cleaned = palpate.TetMesh(nodes, curved.tets + 1)
    assert np.array_equal(cleaned.tets, curved.tets)


def swap_middles(nodes, tets):
    """Gmsh's order read as if it were VTK's."""
    tets[:, [8, 9]] = tets[:, [9, 8]]


def unshare(nodes, tets):
    """One element gets a middle of its own, in the same place."""
    nodes[-1] = nodes[tets[5, 6]]
    tets[5, 6] = len(nodes) - 1


def fold(nodes, tets):
    """The middle of an edge moved so far across that the element turns over, though it stays near the edge."""
    a, b, c, d = nodes[tets[5, :4]]
    normal = np.cross(c - a, d - a)
    nodes[tets[5, 9]] += 0.49 * np.linalg.norm(d - c) * np.sign(normal @ (b - a)) * normal / np.linalg.norm(normal)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (swap_middles, r"node \d+ of tetrahedron \d+ is not near the middle between its nodes \d+ and \d+"),
        (lambda n, t: n.__setitem__(t[5, 7], n[t[5, 0]]), r"node \d+ of tetrahedron \d+ is not near the middle"),
        (lambda n, t: t.__setitem__((5, 6), t[5, 0]), "tetrahedron 5 names the same node twice"),
        (lambda n, t: t.__setitem__((5, 6), t[40, 0]), r"mid-side node of tetrahedron 5 and a corner"),
        (unshare, r"tetrahedron \d+ does not share node \d+, in the middle between nodes \d+ and \d+"),
        (fold, r"tetrahedra are folded over by their mid-side nodes \(first: tetrahedron \d+\)"),
        (lambda n, t: n.__setitem__(slice(None), n * [1, 1, 0]), r"no volume \(first: tetrahedron 0\)"),
    ],
)
def test_bad_elements_are_refused_by_index(linear, change, message):
    mesh = linear.to_quadratic()
    nodes, tets = np.vstack([mesh.nodes, np.zeros(3)]), mesh.tets.copy()
    if change is not unshare:
        nodes = nodes[:-1]
    change(nodes, tets)
    with pytest.raises(palpate.MeshError, match=message):
        palpate.TetMesh(nodes, tets)


@pytest.mark.parametrize("ending", sorted(WRITERS))
def test_files_round_trip(curved, tmp_path, ending):
    path = tmp_path / f"body{ending}"
    if ending in LINEAR_ONLY:
        with pytest.raises(palpate.MeshError, match=f"cannot be written to {ending} files; use .msh"):
            curved.write(path)
        return
    curved.write(path, unit="mm")
    again = palpate.TetMesh.read(path, unit="mm")
    assert np.abs(again.nodes - curved.nodes).max() <= 1e-15
    assert np.array_equal(again.tets, curved.tets)
    assert again.volume == pytest.approx(curved.volume, rel=1e-12)
    if ending != ".inp":  # Abaqus has no integer cell data
        assert np.array_equal(again.regions, curved.regions)
    else:
        assert "TYPE=C3D10\n" in path.read_text()


def test_gmsh_orders_its_last_two_middles_the_other_way_round(tmp_path):
    """An element written by hand in the order of Gmsh's manual: edges 01, 12, 20, 30, 32, 31."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    nodes = np.vstack(
        [corners, [(corners[i] + corners[j]) / 2 for i, j in [(0, 1), (1, 2), (2, 0), (3, 0), (3, 2), (3, 1)]]]
    )
    nodes[8] += [0.1, 0.1, 0]  # the middle of 23, pushed out
    lines = [f"{i} {x} {y} {z}" for i, (x, y, z) in enumerate(nodes, 1)]
    head = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", "10", *lines, "$EndNodes"]
    element = "1 11 2 7 7 1 2 3 4 5 6 7 8 9 10"
    path = tmp_path / "gmsh.msh"
    path.write_text("\n".join([*head, "$Elements", "1", element, "$EndElements", ""]))
    mesh = palpate.TetMesh.read(path)
    assert np.array_equal(mesh.nodes, nodes)
    assert mesh.tets.tolist() == [[0, 1, 2, 3, 4, 5, 6, 7, 9, 8]]
    assert mesh.regions.tolist() == [7]
    mesh.write(tmp_path / "ours.msh")
    assert palpate.TetMesh.read(tmp_path / "ours.msh").volume == pytest.approx(mesh.volume, rel=1e-12)


def test_vtu_holds_quadratic_tetrahedra_in_vtks_order(curved, tmp_path):
    curved.write(tmp_path / "body.vtu")
    theirs = meshio.read(tmp_path / "body.vtu")
    assert [cells.type for cells in theirs.cells] == ["tetra10"]
    assert np.array_equal(theirs.cells[0].data, curved.tets)


def test_netgen_reads_and_makes_second_order(linear, curved, tmp_path):
    from netgen.meshing import Mesh

    curved.write(tmp_path / "body.vol")
    theirs = Mesh(3)
    theirs.Load(str(tmp_path / "body.vol"))
    theirs.Save(str(tmp_path / "theirs.vol"))
    again = palpate.TetMesh.read(tmp_path / "theirs.vol")
    assert again.volume == pytest.approx(curved.volume, rel=1e-9)
    linear.write(tmp_path / "linear.vol")
    # In a process of its own: it would curve edges after a geometry that another test has left in this one.
    raise_order = "m = Mesh(3); m.Load('linear.vol'); m.SecondOrder(); m.Save('raised.vol')"
    subprocess.run([sys.executable, "-c", f"from netgen.meshing import Mesh; {raise_order}"], cwd=tmp_path, check=True)
    mesh, ours = palpate.TetMesh.read(tmp_path / "raised.vol"), linear.to_quadratic()
    assert mesh.tets.shape == ours.tets.shape
    assert mesh.nodes[mesh.tets] == pytest.approx(ours.nodes[ours.tets], abs=1e-12)
