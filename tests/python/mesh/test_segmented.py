"""Segments of label maps become bodies: volumes, places, inner boundaries that elements follow, and clear refusals."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from command_line import refused, run
from label_maps import ball, ellipsoid, labels_of, turned, write_nifti, write_nrrd

import palpate
from palpate.mesh.fill_job import FillOptions
from palpate.mesh.inner import faces_between
from palpate.mesh.label_process import label_summary
from palpate.mesh.tetrahedralize import tetrahedralize_with
from palpate.progress import Reporter

pytest.importorskip("pytetwild", reason="pytetwild has no wheel for macOS", exc_type=ImportError)

SEMI = np.array([40.0, 30.0, 22.0])
TUMOUR, RADIUS = np.array([12.0, -6.0, 8.0]), 6.0
LIVER = 4 / 3 * np.pi * SEMI.prod() * 1e-9
BALL = 4 / 3 * np.pi * RADIUS**3 * 1e-9
NAMES = {"liver": 1, "tumor": 2}


def oblique() -> tuple[np.ndarray, np.ndarray]:
    """A liver with a tumour in a scan whose slices are turned against the patient."""
    return labels_of([ellipsoid(SEMI), ball(TUMOUR, RADIUS)], (50, 45, 40), rotation=turned())


def filled(path, *segments, element="quadratic", size=None, **options) -> palpate.TetMesh:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", palpate.MeshWarning)
        return tetrahedralize_with(element, path, size, options=FillOptions(segments=segments, **options))


def volume(mesh: palpate.TetMesh, name: str) -> float:
    return float(mesh.volumes[mesh.regions == mesh.region_names[name]].sum())


def middle(mesh: palpate.TetMesh, name: str) -> np.ndarray:
    own = mesh.regions == mesh.region_names[name]
    centroids = mesh.nodes[mesh.tets[own][:, :4]].mean(axis=1)
    return (centroids * mesh.volumes[own, None]).sum(axis=0) / mesh.volumes[own].sum()


@pytest.mark.slow
def test_two_segments_of_an_oblique_scan(tmp_path):
    labels, affine = oblique()
    path = write_nrrd(tmp_path / "ct.seg.nrrd", labels, affine, NAMES)
    with pytest.warns(palpate.MeshWarning) as notes:
        mesh = tetrahedralize_with("quadratic", path, options=FillOptions(segments=("liver", "tumor")))
    texts = [str(note.message) for note in notes]
    assert any("in voxels of 0.7 x 0.7 x 2.5 mm" in text and "within the boundary" in text for text in texts), texts
    assert any("'tumor' 0.9" in text and "in elements" in text for text in texts), texts
    assert list(mesh.region_names) == ["liver", "tumor"]
    # Voxels of the tumour are within 1 % of the ball, those of the liver within 0.1 %.
    assert mesh.volume == pytest.approx(LIVER, rel=0.01)
    assert volume(mesh, "tumor") == pytest.approx((labels == 2).sum() * 0.7 * 0.7 * 2.5e-9, rel=0.02)
    assert volume(mesh, "tumor") == pytest.approx(BALL, rel=0.03)
    np.testing.assert_allclose(1e3 * middle(mesh, "tumor"), TUMOUR, atol=0.25)
    # Elements follow the inner boundary, mid-side nodes too.
    between = np.unique(faces_between(mesh))
    assert len(between) > 40
    off = 1e3 * np.linalg.norm(mesh.nodes[between] - 1e-3 * TUMOUR, axis=1) - RADIUS
    assert np.sqrt((off**2).mean()) < 0.25 and np.abs(off).max() < 0.9
    surface = 1e3 * mesh.nodes[mesh.surface_nodes]
    scaled = np.linalg.norm(surface / SEMI, axis=1)
    off = (scaled - 1) * scaled / np.linalg.norm(surface / SEMI**2, axis=1)
    assert np.sqrt((off**2).mean()) < 0.25
    assert mesh.dihedral_angles().min() > 2


@pytest.mark.slow
def test_a_hole_stays_unless_its_segment_is_chosen(tmp_path):
    labels, affine = labels_of([ball((0, 0, 0), 25), ball((0, 0, 4), 10)], (30, 30, 30), (1, 1, 1))
    path = write_nrrd(tmp_path / "a.seg.nrrd", labels, affine, {"organ": 1, "cyst": 2})
    with pytest.warns(palpate.MeshWarning) as notes:
        hollow = palpate.tetrahedralize(path, "6mm", segments=["organ"])
    assert any("'cyst' (4.1" in str(note.message) and "lies in a cavity" in str(note.message) for note in notes)
    full = filled(path, "organ", "cyst", size=0.015)
    assert hollow.volume == pytest.approx(4 / 3 * np.pi * (0.025**3 - 0.01**3), rel=0.03)
    assert full.volume == pytest.approx(4 / 3 * np.pi * 0.025**3, rel=0.02)
    assert volume(full, "cyst") == pytest.approx(4 / 3 * np.pi * 0.01**3, rel=0.05)


@pytest.mark.slow
def test_a_tumour_at_the_surface_and_one_beside_it(tmp_path):
    """Boundaries that run into the surface and into each other."""
    shapes = [ball((0, 0, 0), 25), ball((0, 0, 20), 9), ball((0, 11, 14), 8)]
    labels, affine = labels_of(shapes[:1], (30, 30, 30), (0.8, 0.8, 1.5))
    inside = labels_of(shapes, (30, 30, 30), (0.8, 0.8, 1.5))[0]
    labels[(labels > 0) & (inside > 0)] = inside[(labels > 0) & (inside > 0)]
    path = write_nifti(tmp_path / "a.nii.gz", labels, affine)
    mesh = filled(path, 1, 2, "3", size=0.015)
    assert list(mesh.region_names) == ["1", "2", "3"]
    for value, name in enumerate(mesh.region_names, 1):
        voxels = (labels == value).sum() * 0.8 * 0.8 * 1.5e-9
        assert volume(mesh, name) == pytest.approx(voxels, rel=0.06), name
    assert mesh.volume == pytest.approx((labels > 0).sum() * 0.8 * 0.8 * 1.5e-9, rel=0.02)


@pytest.mark.slow
def test_scene_with_a_material_for_each_segment(tmp_path):
    labels, affine = oblique()
    write_nrrd(tmp_path / "ct.seg.nrrd", labels, affine, NAMES)
    text = """
[[body]]
mesh = "ct.seg.nrrd"
max_element_size = "20mm"
[[body.segment]]
name = "tumor"
youngs_modulus = "40kPa"
[[body.segment]]
name = 1
[material]
youngs_modulus = "5kPa"
[supports]
fixed = "z < min + 8mm"
[[tool]]
radius = "5mm"
"""
    (tmp_path / "scene.toml").write_text(text)
    scene = palpate.Scene.read(tmp_path / "scene.toml")
    scene.require_files()
    from palpate.scene.build import unsolved_body

    with pytest.warns(palpate.MeshWarning):
        body = unsolved_body(scene)
    young = body.element_materials[:, 0]
    assert set(young) == {5e3, 40e3}
    hard = young == 40e3
    assert body.mesh.volumes[hard].sum() == pytest.approx(BALL, rel=0.06)
    centroids = body.mesh.nodes[body.mesh.tets[hard][:, :4]].mean(axis=1)
    assert np.linalg.norm(1e3 * centroids - TUMOUR, axis=1).max() < RADIUS + 0.5
    (tmp_path / "wrong.toml").write_text(text.replace('"tumor"', '"tumour"'))
    with pytest.raises(palpate.MeshError, match=r"wrong.toml:\d+: .*no segment 'tumour'; did you mean 'tumor'"):
        palpate.Scene.read(tmp_path / "wrong.toml").require_files()
    with pytest.raises(palpate.SceneError, match="segment is for a mesh that is a label map"):
        palpate.Scene(body={"model": "liver", "segment": [{"name": "a"}]})


@pytest.mark.slow
def test_from_the_file_to_a_touch_by_one_command(tmp_path):
    labels, affine = labels_of([ball((0, 0, 0), 22), ball((0, 0, 12), 6)], (26, 26, 26), (1, 1, 2))
    write_nrrd(tmp_path / "ct.seg.nrrd", labels, affine, NAMES)
    # Few elements: the body is to be touched.
    command = ("run", "ct.seg.nrrd", "--segment", "liver", "--segment", "tumor=40kPa", "--max-size", "15mm")
    result = run(*command, "--headless", "0.5", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert float(result.stdout.split("largest force ")[1].split(" N")[0]) > 0.01
    assert "'liver'" in result.stderr and "cm3 in elements" in result.stderr and "--unit" not in result.stdout
    listed = run("info", "ct.seg.nrrd", cwd=tmp_path)
    assert "'liver' (label 1): 43" in listed.stdout and "2 segments" in listed.stdout


@pytest.mark.slow
def test_mistakes_of_the_command_line_are_one_line(tmp_path):
    labels, affine = labels_of([ball((0, 0, 0), 8)], (10, 10, 10))
    write_nrrd(tmp_path / "a.seg.nrrd", labels, affine, {"liver": 1, "empty": 7})
    (tmp_path / "cut.nii.gz").write_bytes(write_nifti(tmp_path / "a.nii.gz", labels, affine).read_bytes()[:-30])
    refused(run("run", "a.seg.nrrd", cwd=tmp_path), "a.seg.nrrd", "give a segment", "'liver', 'empty'")
    refused(run("run", "a.seg.nrrd", "--segment", "lung", cwd=tmp_path), "a.seg.nrrd", "'lung'", "'liver', 'empty'")
    refused(run("mesh", "a.seg.nrrd", "a.vtu", "--segment", "empty", cwd=tmp_path), "'empty' is empty")
    refused(run("run", "a.seg.nrrd", "--segment", "liver=hard", cwd=tmp_path), "'hard' is not a pressure")
    refused(run("run", "cut.nii.gz", cwd=tmp_path), "cut.nii.gz", "cut short")
    refused(run("mesh", "a.seg.nrrd", "a.vtu", "--segment", "liver", "--mesher", "netgen", cwd=tmp_path), "NETGEN")
    refused(run("mesh", "a.seg.nrrd", "a.vtu", "--segment", "liver", "--segment", "1", cwd=tmp_path), "given twice")
    labels = labels.astype(np.int16) * 300 - 1000
    write_nifti(tmp_path / "ct.nii", labels, affine)
    refused(run("run", "ct.nii", "--segment", "1", cwd=tmp_path), "ct.nii", "intensity image")


@pytest.mark.slow
def test_the_boundary_is_drawn_before_it_is_filled(tmp_path):
    labels, affine = labels_of([ellipsoid((20, 15, 12))], (24, 19, 16), (1.5, 1.5, 2.0))
    path = write_nrrd(tmp_path / "ct.nrrd", labels, affine)
    events: list[str] = []
    drawn: list[np.ndarray] = []

    def draw(vertices: np.ndarray, faces: np.ndarray) -> None:
        events.append("drawn")
        drawn.extend((vertices, faces))

    reporter = Reporter(lambda *_: None, events.append)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", palpate.MeshWarning)
        tetrahedralize_with("quadratic", path, progress=reporter, drawn=draw)
    assert events.index("drawn") < events.index("wrapping")
    np.testing.assert_allclose(np.ptp(drawn[0], axis=0), [0.04, 0.03, 0.024], atol=2e-3)


def test_a_summary_is_read_in_a_process_with_a_time_limit(tmp_path, monkeypatch):
    labels, affine = oblique()
    path = write_nrrd(tmp_path / "ct.seg.nrrd", labels, affine, NAMES)
    # What this process would read is not asked for.
    monkeypatch.setattr("palpate.segmentation.nrrd_file.read_nrrd", None)
    summary = label_summary(path)
    assert [(s.name, s.value, s.voxels) for s in summary.segments] == [
        ("liver", 1, int((labels == 1).sum())),
        ("tumor", 2, int((labels == 2).sum())),
    ]
    assert summary.spacing == pytest.approx([7e-4, 7e-4, 2.5e-3])
    with pytest.raises(palpate.MeshError, match="spleen"):
        label_summary(path, segments=["spleen"])
    with pytest.raises(palpate.MeshError, match=r"its process did not finish in 0.01 s and was stopped"):
        label_summary(path, time_limit=0.01)
