"""Meshes: topology, repair, and files that other programs read."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest
import trimesh
from conftest import box_mesh

import palpate
from palpate.mesh import tetrahedralize as module_function
from palpate.mesh.files import WRITERS
from palpate.mesh.surface_file import load_surface

tetrahedralize = module_function


def test_surface_is_closed_outward_and_complete():
    mesh = box_mesh()
    surface = trimesh.Trimesh(mesh.nodes, mesh.surface_triangles, process=False)
    surface.remove_unreferenced_vertices()
    assert surface.is_watertight
    assert surface.volume == pytest.approx(0.08 * 0.05 * 0.05, rel=1e-12)
    assert surface.area == pytest.approx(2 * (0.08 * 0.05 * 2 + 0.05**2), rel=1e-12)
    assert mesh.volume == pytest.approx(surface.volume, rel=1e-12)
    assert np.array_equal(mesh.surface_nodes, np.unique(mesh.surface_triangles))


def test_inverted_tetrahedra_are_turned_round_without_reordering_nodes():
    mesh = box_mesh()
    tets = mesh.tets.copy()
    tets[::3] = tets[::3][:, [1, 0, 2, 3]]
    repaired = palpate.TetMesh(mesh.nodes, tets)
    assert (repaired.volumes > 0).all()
    assert np.array_equal(repaired.nodes, mesh.nodes)


def test_orphans_are_dropped_with_a_warning():
    mesh = box_mesh()
    nodes = np.vstack([[9.0, 9.0, 9.0], mesh.nodes, [8.0, 8.0, 8.0]])
    with pytest.warns(palpate.MeshWarning, match="2 nodes belong to no tetrahedron"):
        cleaned = palpate.TetMesh(nodes, mesh.tets + 1)
    assert np.array_equal(cleaned.nodes, mesh.nodes)
    assert np.array_equal(cleaned.tets, mesh.tets)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda n, t: n.__setitem__((5, 1), np.nan), "node 5 has a coordinate that is not finite"),
        (lambda n, t: t.__setitem__((7, 2), 10**6), "tetrahedron 7 names a node that does not exist"),
        (lambda n, t: t.__setitem__((7, 2), t[7, 1]), "tetrahedron 7 names the same node twice"),
        (lambda n, t: n.__setitem__(slice(None), n * [1, 1, 0]), "tetrahedra have no volume"),
    ],
)
def test_unusable_meshes_are_refused_by_index(change, message):
    mesh = box_mesh()
    nodes, tets = mesh.nodes.copy(), mesh.tets.copy()
    change(nodes, tets)
    with pytest.raises(palpate.MeshError, match=message):
        palpate.TetMesh(nodes, tets)


@pytest.mark.parametrize("ending", sorted(WRITERS))
def test_files_round_trip(tmp_path, ending):
    mesh = box_mesh()
    regions = (mesh.nodes[mesh.tets].mean(axis=1)[:, 0] > 0.04).astype(int) + 1
    mesh = palpate.TetMesh(mesh.nodes, mesh.tets, regions)
    path = tmp_path / f"body{ending}"
    mesh.write(path, unit="mm")
    again = palpate.TetMesh.read(path, unit="mm")
    assert np.abs(again.nodes - mesh.nodes).max() <= 1e-15
    assert np.array_equal(np.sort(again.tets), np.sort(mesh.tets))
    if ending not in {".inp"}:  # Abaqus has no integer cell data
        assert np.array_equal(again.regions, regions)
    assert all(name.startswith("body") for name in os.listdir(tmp_path))


def test_netgen_reads_our_vol_file(tmp_path):
    from netgen.meshing import Mesh

    mesh = box_mesh()
    mesh.write(tmp_path / "body.vol")
    theirs = Mesh(3)
    theirs.Load(str(tmp_path / "body.vol"))
    assert len(theirs.Elements3D()) == len(mesh.tets)
    theirs.Save(str(tmp_path / "theirs.vol"))
    again = palpate.TetMesh.read(tmp_path / "theirs.vol")
    assert again.volume == pytest.approx(mesh.volume, rel=1e-9)


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "off", "glb"])
def test_surfaces_are_read_whole(tmp_path, ending):
    """Whichever file they are from, all that fills them gets the same triangles."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.04)
    ball.export(tmp_path / f"ball.{ending}")
    shape = load_surface(tmp_path / f"ball.{ending}").shape
    shape.merge_vertices()
    assert shape.is_watertight and len(shape.faces) == len(ball.faces)
    assert shape.triangles_center == pytest.approx(ball.triangles_center, abs=1e-8)


def test_a_surface_of_a_file_is_filled(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.04)
    ball.export(tmp_path / "ball.stl")
    with pytest.warns(palpate.MeshWarning, match="the mesh loses"):
        mesh = tetrahedralize(tmp_path / "ball.stl", max_element_size=0.012)
    assert mesh.volume == pytest.approx(ball.volume, rel=0.06)
    assert np.linalg.norm(mesh.nodes[mesh.surface_nodes], axis=1) == pytest.approx(0.04, rel=0.03)
    assert mesh.dihedral_angles().min() > 5


@pytest.mark.slow
def test_refinement_balls_are_local():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.04)
    with pytest.warns(palpate.MeshWarning, match="the mesh loses"):
        coarse = tetrahedralize(ball, max_element_size=0.012)
        fine = tetrahedralize(ball, max_element_size=0.012, refine=[((0, 0, 0.04), 0.01, 0.002)])
    near, far = (lambda m: np.linalg.norm(m.nodes - [0, 0, 0.04], axis=1) < 0.01), (lambda m: m.nodes[:, 2] < -0.01)
    assert near(fine).sum() > 8 * near(coarse).sum()
    assert far(fine).sum() < 1.5 * far(coarse).sum()


def test_mesher_that_hangs_or_crashes_is_reported(tmp_path, monkeypatch):
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.04)
    for program, message in [
        ("import time; time.sleep(60)", "did not finish in 1 s"),
        ("import os; os.abort()", "crashed .SIGABRT."),
        ("pass", "returned no tetrahedra"),
        ("import sys; sys.exit(3)", "could not write its files in /.* .is there room on that disk.."),
    ]:
        fake = tmp_path / "fake.sh"
        fake.write_text(
            textwrap.dedent(f"""\
            #!/bin/sh
            exec {sys.executable} -c '{program}'
            """)
        )
        fake.chmod(0o755)
        with monkeypatch.context() as patch:
            patch.setattr(sys, "executable", str(fake))
            with pytest.raises(palpate.MeshError, match=message):
                tetrahedralize(ball, time_limit=1 if "sleep" in program else 60)


def test_a_full_temporary_folder_is_no_reason_for_another_mesh(tmp_path, monkeypatch):
    """Filling the surface as given instead would make elements of another size, without a message."""
    fake = tmp_path / "fake.sh"
    fake.write_text(f'#!/bin/sh\n[ "$3" = remesh ] && exit 3\nexec {sys.executable} "$@"\n')
    fake.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(fake))
    with pytest.raises(palpate.MeshError, match="NETGEN could not write its files in"):
        tetrahedralize(trimesh.creation.icosphere(subdivisions=2, radius=0.04), mesher="netgen")


def test_self_intersecting_surface_is_reported():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.04)
    ball.vertices[np.argmax(ball.vertices[:, 2])] = [0, 0, -0.08]
    with pytest.raises(palpate.MeshError, match="intersects itself"):
        tetrahedralize(ball, max_element_size=0.02, time_limit=20, mesher="netgen")


@pytest.mark.parametrize(("name", "content", "message"), [
    ("a.vtu", b"", "empty"), ("a.vtu", b"<nonsense", "cannot be read as a .vtu"),
    ("a.xyz", b"1", "unknown volume format"),
    ("a.vol", b"mesh3d\n", "holds no points"), ("a.msh", b"$MeshFormat\n4.1 0 8\n", "cannot be read as a .msh"),
])  # fmt: skip
def test_unreadable_volumes_are_named(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(palpate.MeshError, match=message):
        palpate.TetMesh.read(tmp_path / name)


def test_a_full_disk_names_the_file_and_leaves_nothing(tmp_path):
    """Files of this child may not grow beyond 1 kB: writing fails midway, as on a full disk."""
    box_mesh().write(tmp_path / "box.vtu")
    code = """
        import os, resource, signal, sys
        import palpate
        mesh = palpate.TetMesh.read("box.vtu")
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
        for ending in sys.argv[1:]:
            try:
                mesh.write(f"out{ending}")
            except OSError as error:
                print(ending, error.filename, *os.listdir())
    """
    endings = sorted(WRITERS)
    command = [sys.executable, "-c", textwrap.dedent(code), *endings]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    lines = [line.split() for line in result.stdout.splitlines()]
    assert [ending for ending, *_ in lines] == endings
    for ending, file, *left in lines:
        assert file.startswith("out."), ending
        assert left == ["box.vtu"], ending


def test_regions_by_shape_follow_the_centroids():
    mesh = box_mesh(cells=(8, 6, 6))
    c = mesh.nodes[mesh.tets].mean(axis=1)
    marked = mesh.with_regions(
        {
            5: palpate.shapes.HalfSpace((0, 0, 0.02), (0, 0, 2)),
            "bar": [palpate.shapes.Cylinder((0, 0.02, 0.03), (0.05, 0.02, 0.03), 0.01)],
            3: lambda p: p[:, 0] > 0.07,
            "nodule": palpate.shapes.Sphere((0.02, 0.02, 0.03), 0.01),
        }
    )
    bar = (c[:, 0] <= 0.05) & (np.hypot(c[:, 1] - 0.02, c[:, 2] - 0.03) <= 0.01)
    expected = np.where(c[:, 2] <= 0.02, 5, 0)
    expected[bar] = 6
    expected[c[:, 0] > 0.07] = 3
    expected[np.linalg.norm(c - [0.02, 0.02, 0.03], axis=1) <= 0.01] = 7
    assert marked.region_names == {"bar": 6, "nodule": 7}
    assert np.array_equal(marked.regions, expected)
    assert set(expected) == {0, 3, 5, 6, 7}
    assert (mesh.regions == 0).all()


def test_regions_by_name_from_gmsh(tmp_path):
    mesh = box_mesh().with_regions({"skin": palpate.shapes.Box((-1, -1, 0.03), (1, 1, 1)), 4: lambda p: p[:, 0] > 0.06})
    mesh.write(tmp_path / "named.msh")
    read = palpate.TetMesh.read(tmp_path / "named.msh")
    assert read.region_names == {"skin": 5}
    assert np.array_equal(read.regions, mesh.regions)
    soft, stiff = palpate.Material(1e3, 0.3), palpate.Material(9e3, 0.3)
    body = palpate.Body(read, material={0: soft, "skin": stiff, 4: soft})
    assert np.array_equal(body.element_materials[:, 0], np.where(mesh.regions == 5, 9e3, 1e3))
    with pytest.raises(palpate.BodyError, match="no region called 'sikn'; it has skin"):
        palpate.Body(read, material={0: soft, "sikn": stiff, 4: soft})
    with pytest.raises(palpate.BodyError, match="region skin of the mesh has no material; given are 0, 4"):
        palpate.Body(read, material={0: soft, 4: soft})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda s: s.Sphere((0, 0), 1), "the centre of a sphere needs three numbers, got 2"),
        (lambda s: s.Sphere((0, 0, 0), 0), "the radius of a sphere must be positive"),
        (lambda s: s.Box((0, 0, 0), (1, 0, 1)), "from its low to its high corner"),
        (lambda s: s.Cylinder((0, 0, 1), (0, 0, 1), 1), "must have a length"),
        (lambda s: s.HalfSpace((0, 0, 1), (0, 0, 0)), "must have a direction"),
        (lambda s: box_mesh().with_regions({2: s.Sphere((9, 9, 9), 1)}), "region 2: no element has its centroid"),
        (lambda s: box_mesh().with_regions({2: lambda p: p}), "region 2: .* must return a boolean mask"),
    ],
)
def test_bad_shapes_are_refused(make, message):
    with pytest.raises(palpate.MeshError, match=message):
        make(palpate.shapes)
