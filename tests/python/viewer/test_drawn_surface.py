"""Surfaces drawn by fewer triangles: where they are, that they are whole, which vertex is drawn for a node."""

from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista
import trimesh

import palpate
from palpate.fields import Interior, SurfaceStrain
from palpate.green import function
from palpate.mesh import TetMesh
from palpate.scene import BuiltScene
from palpate.validation.verify.grids import lattice, mapped
from palpate.viewer import messages
from palpate.viewer import shown_body as module
from palpate.viewer.fields import ClientView
from palpate.viewer.session import Session
from palpate.viewer.shown_body import drawn_surface

MOST = 3000


def dome(cells: int = 48) -> TetMesh:
    """Square sheet of 200 mm, 4 mm thick, bent up in the middle: its corners are flat."""
    axes = np.linspace(-0.1, 0.1, cells + 1)

    def place(points: np.ndarray) -> np.ndarray:
        x, y, z = points.T
        return np.column_stack([x, y, z + 0.05 * np.exp(-(x**2 + y**2) / 0.05**2)])

    return mapped(lattice(axes, axes, np.array([0.0, 0.004])), place, quadratic=False)


def drawn(mesh: TetMesh, regions: np.ndarray | None = None, most: int = MOST):
    ranks = mesh.surface_nodes
    green = SimpleNamespace(
        surface_nodes=ranks, surface_triangles=mesh.surface_triangles, surface_positions=mesh.nodes[ranks]
    )
    of_element = np.zeros(len(mesh.tets), dtype=int) if regions is None else regions
    return green, drawn_surface(SimpleNamespace(green=green, body=SimpleNamespace(mesh=mesh)), of_element, most)


def solid(points: np.ndarray, triangles: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(points, triangles, process=False)


def test_a_surface_that_a_page_takes_is_drawn_as_it_is():
    mesh = dome(12)
    green, found = drawn(mesh)
    assert found.is_whole and found.deviation == 0
    assert np.array_equal(green.surface_nodes[found.triangles], mesh.surface_triangles)


def test_fewer_triangles_are_closed_even_and_close_to_the_surface():
    green, found = drawn(dome())
    assert 0.9 * MOST < len(found.triangles) <= MOST < len(green.surface_triangles) / 3
    positions = green.surface_positions
    fewer, whole = solid(positions[found.nodes], found.triangles), solid(positions, _ranks(green))
    assert fewer.is_watertight and fewer.is_winding_consistent
    # Edges of the sheet at 90 degrees are cut by the size of a triangle at most: 0.5 % of the volume.
    assert fewer.volume == pytest.approx(whole.volume, rel=5e-3)
    fewer_faces = pyvista.PolyData.from_regular_faces(fewer.vertices, fewer.faces)
    off = np.abs(pyvista.PolyData(positions).compute_implicit_distance(fewer_faces)["implicit_distance"])
    assert 0 < off.max() < 1e-3 and np.sqrt((off**2).mean()) < 2e-4
    # Flat parts are dented as well as curved ones: there is no triangle that spans them.
    assert fewer.edges_unique_length.max() < 5 * np.median(fewer.edges_unique_length)


def test_each_node_is_drawn_by_a_vertex_near_it_on_its_side():
    green, found = drawn(dome())
    positions = green.surface_positions
    assert np.array_equal(found.owners[found.nodes], np.arange(len(found.nodes)))
    away = np.linalg.norm(positions - positions[found.nodes[found.owners]], axis=1)
    spacing = np.median(solid(positions[found.nodes], found.triangles).edges_unique_length)
    assert away.max() < 2.5 * spacing
    # The sheet is thinner than the triangles that are drawn; inside of its rim no node is drawn on the other side.
    middle = (np.abs(positions[:, :2]) < 0.08).all(axis=1)
    above = positions[:, 2] - 0.05 * np.exp(-(positions[:, :2] ** 2).sum(axis=1) / 0.05**2) > 0.002
    assert np.array_equal(above[middle], above[found.nodes[found.owners]][middle])


def test_borders_of_regions_stay():
    mesh = dome()
    right = mesh.nodes[mesh.tets].mean(axis=1)[:, 0] > 0.0
    green, found = drawn(mesh, right.astype(int))
    positions = green.surface_positions
    middles = positions[found.nodes][found.triangles].mean(axis=1)
    # The border runs along nodes of the mesh, x = 0.
    assert np.array_equal(found.regions == 1, middles[:, 0] > 0)
    seam = np.flatnonzero(np.abs(positions[:, 0]) < 1e-9)
    assert len(seam) > 90 and np.isin(seam, found.nodes).all()
    assert solid(positions[found.nodes], found.triangles).is_watertight


@pytest.fixture(scope="module")
def sheet():
    mesh = dome(24)
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.4), fixed=lambda p: np.abs(p[:, 0]) > 0.0999)
    middle = mesh.surface_nodes[np.argsort(np.linalg.norm(mesh.nodes[mesh.surface_nodes][:, :2], axis=1))[:60]]
    return body, palpate.precompute(body, touch=np.sort(middle), progress=False)


def test_what_is_drawn_of_a_touched_body_are_displacements_of_its_nodes(sheet, monkeypatch):
    body, green = sheet
    monkeypatch.setattr(module, "MOST_TRIANGLES", 800)
    scene = palpate.Scene.of_store("sheet.palpate")
    session = Session(BuiltScene.of(scene, body, green))
    session.start()
    try:
        header, arrays = messages.decode(session.scene_message())
        top = green.surface_positions[np.argmax(green.surface_positions[:, 2])]
        end = time.monotonic() + 30
        read = {"0/displacements": np.zeros(3)}
        # Held first, then pulled: a grab takes hold where the tool is.
        for depth in (0.0, 2e-3):
            session.handle({"type": "press", "tool": 0, "position": (top - [0, 0, depth]).tolist(), "grab": True})
            time.sleep(0.3)
        while time.monotonic() < end and np.abs(read["0/displacements"]).max() < 1e-3:
            message, _ = session.frame_message(1, (0, 0), ClientView(cutaway=True))
            last, read = messages.decode(message)
        exact = session._latest().bodies[0].displacements if session._latest().time == last["time"] else None
    finally:
        session.close()
    told_body = header["bodies"][0]
    assert told_body["triangles"] == len(green.surface_triangles) > told_body["drawn"]["triangles"] > 700
    vertices = len(arrays["0/nodes"])
    assert arrays["0/owners"].shape == (len(green.surface_nodes),) and arrays["0/owners"].max() == vertices - 1
    assert len(arrays["0/tets"]) == 0 and arrays["0/surface_triangles"].max() == vertices - 1
    places = green.surface_positions.astype("f4")
    rows = [np.flatnonzero((places == point).all(axis=1))[0] for point in arrays["0/nodes"]]
    assert not last["interior"][0] and np.abs(read["0/displacements"]).max() > 1e-3
    if exact is not None:
        assert np.array_equal(read["0/displacements"], exact[rows].astype("f4"))
    supported = arrays["0/fixed_nodes"]
    assert (np.abs(arrays["0/nodes"][supported][:, 0]) > 0.0999).all() and len(supported) > 5
    assert not read["0/displacements"][supported].any()


def test_of_a_large_body_the_surface_alone_is_followed(sheet, monkeypatch):
    """Nothing factorises its inner part until somebody asks for stress."""
    body, small = sheet
    monkeypatch.setattr(function, "MOST_NODES_INSIDE", len(body.mesh.nodes) - 1)
    green = palpate.GreensFunction(small._core, body)
    pushed = 1e-3 * np.outer(np.exp(-((green.surface_positions[:, 0] / 0.03) ** 2)), (0.0, 0.0, -1.0))
    with monkeypatch.context() as patch:
        patch.setattr(Interior, "__init__", lambda *_: pytest.fail("the inner part was factorised"))
        session = Session(BuiltScene.of(palpate.Scene.of_store("sheet.palpate"), body, green))
        session.start()
        try:
            header, arrays = messages.decode(session.scene_message())
            last, _ = messages.decode(session.frame_message(1, (0, 0), ClientView(cutaway=True))[0])
            strain = session.simulation.strain_measure.largest(pushed)
        finally:
            session.close()
    result = header["bodies"][0]
    assert result["tets"] == len(arrays["0/tets"]) == 0 and not last["interior"][0]
    assert {field["name"] for field in result["fields"]}.isdisjoint({"von_mises", "principal_stress"})
    faces = np.searchsorted(green.surface_nodes, green.surface_faces)
    assert strain == SurfaceStrain(green.surface_positions, faces).largest(pushed) > 1e-3
    exact = palpate.StressRecovery(body).recover(pushed)
    np.testing.assert_allclose(green.stress_recovery.recover(pushed).stress, exact.stress, rtol=1e-12)


def _ranks(green) -> np.ndarray:
    return np.searchsorted(green.surface_nodes, green.surface_triangles)
