"""Surfaces with holes, overlaps and parts are filled, with reports; those without an inside are refused."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh
from command_line import run
from conftest import box_mesh

import palpate
from palpate.mesh.child import OUT_OF_PROCESSOR_TIME
from palpate.mesh.curve import LEAST_ANGLE, snap
from palpate.mesh.elements import smallest_dihedral_angles
from palpate.mesh.fill_job import FillOptions
from palpate.mesh.filling import Filling
from palpate.mesh.solid_field import SolidField, cleaned, oriented
from palpate.mesh.tetrahedralize import tetrahedralize_with
from palpate.mesh.wrap import WrapError, wrap
from palpate.mesh.wrapping import _without_crumbs

pytest.importorskip("pytetwild", reason="pytetwild has no wheel for macOS", exc_type=ImportError)

RADIUS = 40.0
BALL = 4 / 3 * np.pi * 0.04**3


def broken_ball() -> trimesh.Trimesh:
    """Of radius 40 in millimetres: a hole of 8 around its top, every tenth triangle turned round, some doubled."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
    faces = ball.faces[np.linalg.norm(ball.triangles_center - [0, 0, RADIUS], axis=1) > 8].copy()
    faces[::10] = faces[::10, ::-1]
    return trimesh.Trimesh(ball.vertices, np.vstack([faces, faces[:200]]), process=False)


def with_a_bar() -> tuple[trimesh.Trimesh, float]:
    """The broken ball and a bar of 100 x 24 x 24 mm through it; the volume of both, m^3."""
    bar = trimesh.creation.box(extents=(100, 24, 24))
    # Of the bar outside of the ball, by cutting it into fine cubes.
    axis = (np.arange(200) + 0.5) / 200 - 0.5
    x, y, z = np.meshgrid(100 * axis, 24 * axis, 24 * axis, indexing="ij")
    outside = float((x**2 + y**2 + z**2 > RADIUS**2).mean())
    return trimesh.util.concatenate([broken_ball(), bar]), BALL + outside * 100 * 24 * 24e-9


def field_of(shape: trimesh.Trimesh) -> SolidField:
    extent = np.ptp(shape.vertices, axis=0).max()
    points = (shape.vertices - shape.vertices.min(axis=0)) / extent
    vertices, faces, _ = cleaned(points, np.asarray(shape.faces), np.full(len(shape.faces), -1))
    return SolidField(vertices, oriented(vertices, faces))


@pytest.mark.slow
def test_a_broken_surface_is_filled_without_an_option_more(tmp_path):
    surface, volume = with_a_bar()
    surface.export(tmp_path / "scan.stl")
    result = run("run", "scan.stl", "--unit", "mm", "--headless", "0.5", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert float(result.stdout.split("largest force ")[1].split(" N")[0]) > 0.01
    text = [line for line in result.stderr.splitlines() if "was wrapped" in line]
    assert len(text) == 1 and "open edges" in text[0] and "% of the volume" in text[0] and "mm off" in text[0]
    with pytest.warns(palpate.MeshWarning, match="was wrapped"):
        mesh = tetrahedralize_with("quadratic", tmp_path / "scan.stl", None, "mm")
    assert mesh.volume == pytest.approx(volume, rel=0.02)
    assert mesh.dihedral_angles().min() > 3
    on_ball = mesh.nodes[mesh.surface_nodes]
    on_ball = on_ball[(np.abs(on_ball[:, 1:]).max(axis=1) > 0.014) & (on_ball[:, 2] < 0.03)]
    # Corners and mid-side nodes lie on the given surface, whose facets lie 0.1 mm within the sphere.
    assert np.median(np.abs(np.linalg.norm(on_ball, axis=1) - 0.04)) < 1.5e-4


@pytest.mark.slow
def test_the_part_that_is_wanted_is_filled_and_the_others_are_named(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.icosphere(subdivisions=3, radius=40.0), node_name="liver")
    away = trimesh.transformations.translation_matrix([70, 0, 0])
    scene.add_geometry(trimesh.creation.box(extents=(40, 30, 30)), node_name="kidney", transform=away)
    scene.export(tmp_path / "organs.glb")
    with pytest.warns(palpate.MeshWarning) as record:
        largest = palpate.tetrahedralize(tmp_path / "organs.glb", 0.01, "mm")
    texts = [str(warning.message) for warning in record]
    assert any(np.all([word in text for word in ("part 2 of 2", "'kidney'", "--part all")]) for text in texts), texts
    assert largest.volume == pytest.approx(BALL, rel=0.03)
    with pytest.warns(palpate.MeshWarning):
        second = palpate.tetrahedralize(tmp_path / "organs.glb", 0.01, "mm", part=2)
    assert second.volume == pytest.approx(40 * 30 * 30e-9, rel=0.02)
    assert second.bounds[0, 0] == pytest.approx(0.05, abs=1e-3)


def test_parts_of_a_field():
    one, two = trimesh.creation.box(extents=(4, 4, 4)), trimesh.creation.box(extents=(2, 2, 2))
    two.apply_translation([5, 0, 0])
    field = field_of(trimesh.util.concatenate([one, two]))
    labels = np.full(len(field.faces), -1)
    unit = 8.0**3  # the longest side is 8
    both, second = wrap(field, labels, None, 40), wrap(field, labels, 2, 40)
    assert [part.volume * unit for part in both.parts] == pytest.approx([64, 8], rel=0.02)
    assert both.volume * unit == pytest.approx(72, rel=1e-6)
    assert second.volume * unit == pytest.approx(8, rel=0.1)
    low, high = second.vertices.min(axis=0) * 8, second.vertices.max(axis=0) * 8
    assert low == pytest.approx([6, 1, 1], abs=0.1) and high == pytest.approx([8, 3, 3], abs=0.1)
    with pytest.raises(WrapError, match="there is no part 3: the surface has 2"):
        wrap(field, labels, 3, 40)


@pytest.mark.quick(2)
@pytest.mark.parametrize("damage", ["none", "inside out", "turned", "doubled", "open"])
def test_the_field_of_a_ball(damage):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.5)
    faces = np.array(ball.faces)
    if damage == "inside out":
        faces = faces[:, ::-1]
    elif damage == "turned":
        faces[::5] = faces[::5, ::-1]
    elif damage == "doubled":
        faces = np.vstack([faces, faces[::3]])
    elif damage == "open":
        faces = faces[ball.triangles_center[:, 2] < 0.45]
    field = field_of(trimesh.Trimesh(ball.vertices, faces, process=False))
    grid, whole = field.on_grid(np.zeros(3), np.ones(3), 1 / 40)
    assert whole == (damage != "open")
    places = np.stack(np.meshgrid(*map(np.arange, grid.values.shape), indexing="ij"), axis=-1)
    distance = np.linalg.norm(grid.origin + grid.cell * places - 0.5, axis=-1) - 0.5
    wrong = (distance > 0.02) & (grid.values < 0) | (distance < -0.02) & (grid.values > 0)
    # A plane caps the hole: the winding number there is a half near the middle between cap and sphere.
    assert wrong.sum() == 0 or (damage == "open" and places[wrong][:, 2].min() * grid.cell + grid.origin[2] > 0.9)


def test_needles_are_thinned_out():
    """The winding number of a cylinder of 2,000 sides took a minute and a half."""
    shape = trimesh.creation.cylinder(radius=0.2, height=1.0, sections=2000)
    points = np.asarray(shape.vertices) - shape.vertices.min(axis=0)
    vertices, faces, _ = cleaned(points, np.asarray(shape.faces), np.full(len(shape.faces), -1))
    assert len(faces) < len(shape.faces) / 4
    thinned = trimesh.Trimesh(vertices, faces, process=False)
    assert thinned.is_watertight and thinned.volume == pytest.approx(shape.volume, rel=2e-3)
    # A surface with few needles stays as it is.
    few = trimesh.creation.cylinder(radius=0.2, height=1.0, sections=100)
    assert len(cleaned(np.asarray(few.vertices) + 0.5, np.asarray(few.faces), np.zeros(400))[1]) == len(few.faces)


@pytest.mark.slow
def test_a_surface_that_netgen_takes_long_for_is_wrapped(monkeypatch):
    runs = []
    monkeypatch.setattr(Filling, "_run", lambda filling, *_: runs.append(1) or OUT_OF_PROCESSOR_TIME)
    with pytest.warns(palpate.MeshWarning, match="could not be filled by NETGEN and was wrapped"):
        palpate.tetrahedralize(trimesh.creation.icosphere(subdivisions=3, radius=RADIUS), unit="mm")
    # No second attempt at another size.
    assert len(runs) == 1


@pytest.mark.slow
def test_a_wavy_sheet_is_refused_and_closed_holes_are_noted():
    x, y = np.meshgrid(np.linspace(0, 0.1, 40), np.linspace(0, 0.1, 40), indexing="ij")
    corner = (np.arange(39)[:, None] * 40 + np.arange(39)).ravel()
    faces = np.vstack([corner + [[0], [40], [1]], corner + [[40], [41], [1]]]).reshape(2, 3, -1)
    faces = np.concatenate([part.T for part in faces])
    points = np.column_stack([x.ravel(), y.ravel(), (0.01 * np.sin(40 * x) * np.cos(50 * y)).ravel()])
    with pytest.raises(palpate.MeshError, match="it is a sheet, which has no inside"):
        palpate.tetrahedralize(trimesh.Trimesh(points, faces, process=False), unit="m")
    ball = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
    ball.update_faces(ball.triangles_center[:, 2] < 0.8 * RADIUS)
    with pytest.warns(palpate.MeshWarning) as record:
        palpate.tetrahedralize(ball, 0.012, "mm")
    (note,) = [str(w.message) for w in record if "closes holes" in str(w.message)]
    # A tenth of the sphere is missing; the flatter wrap across it has less.
    assert 5 <= int(note.split(" %")[0].split()[-1]) <= 11


def test_what_encloses_nothing_is_refused():
    sheet = trimesh.creation.box(extents=(80, 80, 80)).subdivide()
    sheet.update_faces(sheet.triangles_center[:, 2] > 39)
    with pytest.raises(palpate.MeshError, match="cannot be filled: it encloses nothing: its triangles have no inside"):
        palpate.tetrahedralize(sheet, unit="mm")


def test_a_surface_is_not_wrapped_where_netgen_is_asked_for():
    with pytest.raises(palpate.MeshError, match=r"is not closed \(.* open edges\); mend it .* leave out mesher"):
        palpate.tetrahedralize(broken_ball(), unit="mm", mesher="netgen")


@pytest.mark.slow
def test_a_volume_lost_beyond_what_is_allowed_is_refused():
    """No mesh keeps the volume of a hollow ball to a ten-thousandth of a per cent."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=RADIUS)
    ball.update_faces(np.arange(len(ball.faces)) > 0)
    with pytest.raises(palpate.MeshError, match=r"% of the volume .*--max-size .*--max-volume-loss \d+% takes it"):
        palpate.tetrahedralize(ball, 0.02, "mm", max_volume_loss=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"part": 0}, "part must be a number from 1 on or 'all'"),
        ({"part": "largest"}, "part must be"),
        ({"mesher": "gmsh"}, "mesher must be 'netgen' or 'wrap'"),
        ({"max_volume_loss": "120%"}, "max_volume_loss must be at least 0 and below 1"),
    ],
)
def test_wrong_options_are_refused(options, message):
    with pytest.raises(palpate.MeshError, match=message):
        FillOptions(**options)


def test_snapping_moves_nodes_onto_the_surface_and_keeps_elements():
    """A grid of cubes, its nodes moved at random, onto the box that it came from; some of it onto a far plane."""
    mesh = box_mesh(cells=(6, 4, 4))
    random = np.random.default_rng(0)
    shaken = palpate.TetMesh(mesh.nodes + random.uniform(-2e-3, 2e-3, mesh.nodes.shape), mesh.tets)
    low, high = mesh.bounds

    def onto_box(points: np.ndarray) -> np.ndarray:
        inside = np.clip(points, low, high)
        sides = np.concatenate([inside - low, high - inside], axis=1)
        nearest = sides.argmin(axis=1)
        rows = np.arange(len(points))
        inside[rows, nearest % 3] = np.where(nearest < 3, low[nearest % 3], high[nearest % 3])
        return inside

    snapped = snap(shaken, onto_box)
    before, after = shaken.dihedral_angles(), smallest_dihedral_angles(snapped.nodes, snapped.tets)
    assert (after >= np.minimum(LEAST_ANGLE, 0.6 * before) - 1e-9).all()
    away = np.linalg.norm(onto_box(snapped.nodes[snapped.surface_nodes]) - snapped.nodes[snapped.surface_nodes], axis=1)
    assert np.median(away) < 1e-9
    # All nodes onto one plane: every element would be flat.
    flattened = snap(mesh, lambda points: points * [1, 1, 0])
    assert smallest_dihedral_angles(flattened.nodes, flattened.tets).min() > 0.6 * LEAST_ANGLE


def test_crumbs_are_dropped_by_count_and_volume():
    """A tetrahedron on an edge of the body, one on a vertex and one beside it; each of a millimetre."""
    body = box_mesh()
    corner = 1e-3 * np.vstack([np.zeros(3), np.eye(3)])
    (a, b), vertex, new = body.surface_triangles[0][:2], body.surface_triangles[9][0], len(body.nodes)
    middle = body.nodes[[a, b]].mean(axis=0)
    nodes = np.vstack([body.nodes, middle + corner[1:3], body.nodes[vertex] + corner[1:], corner + 0.2])
    crumbs = [[a, b, new, new + 1], [vertex, new + 2, new + 3, new + 4], [new + 5, new + 6, new + 7, new + 8]]
    whole = palpate.TetMesh(nodes, np.vstack([body.tets, crumbs]))
    text = (
        f"3 tetrahedra that share no face with the rest, {whole.volume - body.volume:.2g} m3 of 0.0002 m3, were dropped"
    )
    with pytest.warns(palpate.MeshWarning) as record:
        mesh = _without_crumbs("surface", whole)
    assert text in str(record[0].message)
    assert mesh.volume == pytest.approx(body.volume, rel=1e-12)
    assert len(mesh.tets) == len(body.tets)


def test_flat_elements_of_a_given_mesh_are_warned_of(tmp_path):
    mesh = box_mesh()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mesh.write(tmp_path / "good.vtu")
        palpate.TetMesh.read(tmp_path / "good.vtu")
    flat = mesh.nodes * [1, 1, 1e-3]
    palpate.TetMesh(flat, mesh.tets).write(tmp_path / "flat.vtu")
    with pytest.warns(palpate.MeshWarning, match=r"tetrahedra have a dihedral angle below 2 degrees \(smallest"):
        palpate.TetMesh.read(tmp_path / "flat.vtu")
