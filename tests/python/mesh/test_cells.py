"""Hexahedra, wedges and pyramids become tetrahedra that fill the same body once; other cells are refused."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

import palpate

SIZE = np.array([0.06, 0.04, 0.05])
CELLS = (3, 3, 4)


def grid() -> tuple[np.ndarray, np.ndarray]:
    """Nodes of a box, and its hexahedra by column: (3, 3, 4, 8)."""
    axes = [np.linspace(0, s, c + 1) for s, c in zip(SIZE, CELLS, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    index = np.arange(len(nodes)).reshape([c + 1 for c in CELLS])
    low, high = slice(None, -1), slice(1, None)
    bottom = [(low, low), (high, low), (high, high), (low, high)]
    corners = [index[i, j, low] for i, j in bottom] + [index[i, j, high] for i, j in bottom]
    return nodes, np.stack(corners, axis=-1)


def mixed(seed: int) -> tuple[np.ndarray, list[tuple[str, np.ndarray]], np.ndarray]:
    """Box of hexahedra, columns of wedges, and hexahedra in six pyramids; numbered at random, sheared."""
    generator = np.random.default_rng(seed)
    nodes, hexahedra = grid()
    wedged = generator.random(CELLS[:2]) < 0.4
    wedges = []
    for column in hexahedra[wedged]:
        # One diagonal for the whole column, or its own wedges would not fit on each other.
        turn = [0, 1, 2, 3] if generator.random() < 0.5 else [1, 2, 3, 0]
        a, b, c, d = (column[:, k] for k in turn)
        e, f, g, h = (column[:, 4 + k] for k in turn)
        wedges += [np.stack([a, b, c, e, f, g], axis=1), np.stack([a, c, d, e, g, h], axis=1)]
    rest = hexahedra[~wedged].reshape(-1, 8)
    chosen = generator.random(len(rest)) < 0.3
    middles = nodes[rest[chosen]].mean(axis=1)
    faces = np.array([[0, 1, 2, 3], [4, 7, 6, 5], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0]])
    apex = len(nodes) + np.arange(len(middles))
    pyramids = np.concatenate([rest[chosen][:, faces], np.repeat(apex[:, None, None], 6, axis=1)], axis=2)
    nodes = np.vstack([nodes, middles])
    order = generator.permutation(len(nodes))
    nodes = nodes[order] @ np.array([[1, 0.2, 0], [0, 1, 0.3], [0.1, 0, 1]])
    blocks = [("hexahedron", rest[~chosen]), ("wedge", np.concatenate([*wedges, np.empty((0, 6), int)]))]
    blocks.append(("pyramid", pyramids.reshape(-1, 5)))
    return nodes, [(kind, np.argsort(order)[cells]) for kind, cells in blocks if len(cells)], order


def area_of(mesh: palpate.TetMesh) -> float:
    a, b, c = (mesh.nodes[mesh.surface_triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


@pytest.mark.parametrize("seed", range(12))
def test_mixed_cells_fill_the_box_once_without_cracks(tmp_path, seed):
    nodes, blocks, _ = mixed(seed)
    meshio.write(tmp_path / "box.vtu", meshio.Mesh(nodes, blocks))
    with pytest.warns(palpate.MeshWarning, match="were split into"):
        mesh = palpate.TetMesh.read(tmp_path / "box.vtu")
    shear = np.array([[1, 0.2, 0], [0, 1, 0.3], [0.1, 0, 1]])
    edges = np.diag(SIZE) @ shear
    sides = sum(2 * np.linalg.norm(np.cross(edges[i], edges[j])) for i, j in ((0, 1), (1, 2), (0, 2)))
    assert mesh.volume == pytest.approx(abs(np.linalg.det(edges)), rel=1e-12)
    # A face inside that two cells cut differently would count as surface.
    assert area_of(mesh) == pytest.approx(sides, rel=1e-12)
    assert np.array_equal(mesh.nodes, nodes)
    counts = dict(blocks)
    most = 6 * len(counts.get("hexahedron", ())) + 3 * len(counts.get("wedge", ())) + 2 * len(counts.get("pyramid", ()))
    assert len(mesh.tets) == most


@pytest.mark.parametrize(("ending", "name"), [("vtu", "vtu"), ("vtk", "vtk"), ("vtk", "vtk42"), ("msh", "gmsh22"),
                                              ("msh", "gmsh"), ("inp", "abaqus"), ("mesh", "medit")])  # fmt: skip
def test_hexahedra_of_every_format(tmp_path, ending, name):
    nodes, hexahedra = grid()
    cells = hexahedra.reshape(-1, 8)
    label = (np.arange(len(cells)) % 2).astype(np.int32)
    data = {"gmsh:physical": [label], "gmsh:geometrical": [label]} if ending == "msh" else {"region": [label]}
    data = {"medit:ref": [label]} if ending == "mesh" else {} if ending == "inp" else data
    content = meshio.Mesh(100 * nodes, [("hexahedron", cells)], cell_data=data)
    meshio.write(tmp_path / f"box.{ending}", content, file_format=name)
    with pytest.warns(palpate.MeshWarning, match=r"36 hexahedron\) were split into 216 tetrahedra"):
        mesh = palpate.TetMesh.read(tmp_path / f"box.{ending}", unit="cm")
    assert mesh.volume == pytest.approx(SIZE.prod(), rel=1e-12)
    if name not in {"abaqus", "gmsh"}:  # no integer cell data; labels of Gmsh 4 are those of its geometry
        assert mesh.volumes[mesh.regions == 1].sum() == pytest.approx(label.mean() * SIZE.prod(), rel=1e-12)


def test_second_order_hexahedra_are_taken_by_their_corners(tmp_path):
    nodes, hexahedra = grid()
    cells = hexahedra.reshape(-1, 8)
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    ends, of_cell = np.unique(np.sort(cells[:, edges].reshape(-1, 2), axis=1), axis=0, return_inverse=True)
    cells = np.hstack([cells, len(nodes) + of_cell.reshape(-1, 12)])
    meshio.write(
        tmp_path / "box.vtu", meshio.Mesh(np.vstack([nodes, nodes[ends].mean(axis=1)]), [("hexahedron20", cells)])
    )
    with pytest.warns(palpate.MeshWarning) as record:
        mesh = palpate.TetMesh.read(tmp_path / "box.vtu")
    assert "edges are straight, their mid-side nodes dropped" in str(record[0].message)
    assert mesh.volume == pytest.approx(SIZE.prod(), rel=1e-12)
    assert np.array_equal(mesh.nodes, nodes)


def test_a_wedge_written_as_a_hexahedron_keeps_its_volume(tmp_path):
    nodes = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], float)
    cells = np.array([[0, 1, 2, 2, 3, 4, 5, 5]])
    meshio.write(tmp_path / "wedge.vtu", meshio.Mesh(nodes, [("hexahedron", cells)]))
    with pytest.warns(palpate.MeshWarning, match="into 3 tetrahedra"):
        assert palpate.TetMesh.read(tmp_path / "wedge.vtu").volume == pytest.approx(0.5, rel=1e-12)


def with_vtk_type(path, number: int) -> None:
    """Make the last of the cells of a VTU another type."""
    text = path.read_text()
    head, types = text.split('Name="types"', 1)
    opening, rest = types.split(">", 1)
    numbers, rest = rest.split("<", 1)
    values = numbers.split()
    path.write_text(f'{head}Name="types"{opening}>{" ".join([*values[:-1], str(number)])}<{rest}')


@pytest.mark.parametrize(("number", "name"), [(11, "VTK 11"), (15, "penta_prism"), (41, "VTK 41")])
def test_unknown_cells_are_refused_by_count_and_index(tmp_path, number, name):
    nodes, hexahedra = grid()
    content = meshio.Mesh(nodes, [("hexahedron", hexahedra.reshape(-1, 8))])
    meshio.write(tmp_path / "box.vtu", content, binary=False)
    with_vtk_type(tmp_path / "box.vtu", number)
    with pytest.raises(palpate.MeshError, match=rf"box\.vtu: 1 cells are of type {name}.*first: cell 35"):
        palpate.TetMesh.read(tmp_path / "box.vtu")


def test_a_cavity_is_not_left_where_cells_are_of_third_order(tmp_path):
    nodes = np.random.default_rng(1).random((24, 3))
    blocks = [("tetra", np.array([[0, 1, 2, 3]])), ("tetra20", np.arange(4, 24)[None])]
    meshio.write(tmp_path / "a.msh", meshio.Mesh(nodes, blocks), file_format="gmsh22")
    with pytest.raises(palpate.MeshError, match=r"1 cells are of type tetra20, which is not read \(first: cell 1\)"):
        palpate.TetMesh.read(tmp_path / "a.msh")


def test_a_cell_folded_over_is_refused_by_index(tmp_path):
    nodes, hexahedra = grid()
    cells = hexahedra.reshape(-1, 8)
    nodes[cells[0, 0], 0] += 1.2 * SIZE[0] / CELLS[0]
    meshio.write(tmp_path / "box.vtu", meshio.Mesh(nodes, [("hexahedron", cells)]))
    with pytest.raises(palpate.MeshError, match=r"1 cells of type hexahedron are too bent .*first: cell 0"):
        palpate.TetMesh.read(tmp_path / "box.vtu")


def test_tetrahedra_across_the_diagonal_of_a_hexahedron_are_refused(tmp_path):
    """A cube, and on its top two tetrahedra that cut the face along the other diagonal."""
    nodes = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
    nodes = np.vstack([nodes, [0.5, 0.5, 2]])
    cube, fitting, crossing = [list(range(8))], [[4, 5, 6, 8], [4, 6, 7, 8]], [[4, 5, 7, 8], [5, 6, 7, 8]]
    for tets, match in ((fitting, None), (crossing, r"without pyramids between")):
        blocks = [("hexahedron", np.array(cube)), ("tetra", np.array(tets))]
        meshio.write(tmp_path / "a.vtu", meshio.Mesh(nodes, blocks))
        if match is None:
            with pytest.warns(palpate.MeshWarning, match="into 8 tetrahedra"):
                assert palpate.TetMesh.read(tmp_path / "a.vtu").volume == pytest.approx(1 + 1 / 3, rel=1e-12)
        else:
            with pytest.raises(palpate.MeshError, match=match):
                palpate.TetMesh.read(tmp_path / "a.vtu")
