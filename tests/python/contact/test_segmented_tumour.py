"""A tumour in a segmented CT is felt as in the body of the analytic shapes that the CT was made from."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh
from label_maps import ball, ellipsoid, labels_of, write_nrrd

import palpate
from palpate.mesh.fill_job import FillJob, FillOptions
from palpate.mesh.inner import InnerRegion, InnerRegions
from palpate.mesh.surface_file import SurfaceFile
from palpate.mesh.tetrahedralize import tetrahedralize_with
from palpate.mesh.wrapping import Wrapping
from palpate.scene import BuiltScene
from palpate.validation.verify.contact.loop import UNLIMITED, straight

pytest.importorskip("pytetwild", reason="pytetwild has no wheel for macOS", exc_type=ImportError)

# Half axes of the liver, middle and radius of the tumour, mm; Young's moduli, Pa; radius and depths of the tip, m.
SEMI, TUMOUR, TUMOUR_RADIUS = np.array([60.0, 45.0, 35.0]), np.array([10.0, 5.0, 22.0]), 6.0
SOFT, HARD = 5e3, 40e3
TIP, DEPTH, DEEPER = 5e-3, 1.5e-3, 0.2e-3
# Place of the surface that is nearest to the tumour, 12.2 mm from its middle, mm; by Newton's method in closed form.
OVER = np.array([11.36563, 6.35815, 34.00865])
# Largest difference in contrast, 2 points.
POINTS = 0.02


def felt(mesh: palpate.TetMesh, youngs_modulus: float) -> np.ndarray:
    """Force, N, and stiffness, N/m, of a fingertip over a tumour of a Young's modulus."""
    material = {"liver": palpate.Material(SOFT, 0.45), "tumor": palpate.Material(youngs_modulus, 0.45)}
    body = palpate.Body(mesh, material=material, fixed=lambda p: p[:, 2] < -0.02)
    over = 1e-3 * OVER
    green = palpate.precompute(body, touch=lambda p: np.linalg.norm(p - over, axis=1) < 0.03, progress=False)
    tables = {"supports": {"fixed": "z < -20mm"}, "tool": {"radius": TIP, "friction": 0.0}, "device": UNLIMITED}
    scene = palpate.Scene(body={"model": "liver"}, view={"strain_limit": 0.0}, **tables)
    normal = OVER / SEMI**2 / np.linalg.norm(OVER / SEMI**2)
    forces = []
    for depth in (DEPTH - DEEPER, DEPTH, DEPTH + DEEPER):
        path = straight(over + normal * (TIP + 3e-3), over + normal * (TIP - depth), 5e-5)
        run = palpate.Simulation(BuiltScene.of(scene, body, green)).run(np.vstack([path, np.repeat(path[-1:], 20, 0)]))
        forces.append(run[-1] @ normal)
    return np.array([forces[1], (forces[2] - forces[0]) / (2 * DEEPER)])


def contrast(mesh: palpate.TetMesh) -> np.ndarray:
    """How much larger force and stiffness are than without the tumour, on the same mesh."""
    # Several materials, for the law of contact treats a body of one differently.
    return felt(mesh, HARD) / felt(mesh, SOFT * (1 + 1e-9)) - 1


def analytic() -> palpate.TetMesh:
    """Mesh of the ellipsoid and the ball themselves, with elements of 1.8 mm around the tumour."""
    liver = trimesh.creation.icosphere(subdivisions=6)
    liver.apply_scale(1e-3 * SEMI)
    tumour = trimesh.creation.icosphere(subdivisions=5, radius=1e-3 * TUMOUR_RADIUS)
    tumour.apply_translation(1e-3 * TUMOUR)
    inside = ball(1e-3 * TUMOUR, 1e-3 * TUMOUR_RADIUS)
    size = 0.3e-3 * TUMOUR_RADIUS
    region = InnerRegion("tumor", np.asarray(tumour.vertices), np.asarray(tumour.faces), inside, size)
    balls = [(tuple(1e-3 * TUMOUR), 2.4e-3 * TUMOUR_RADIUS, size)]
    inner = InnerRegions("liver", [region])
    surface = SurfaceFile("analytic", liver)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", palpate.MeshWarning)
        job = FillJob("quadratic", 0.016, balls, FillOptions(), 300, lambda _: None)
        return Wrapping(surface, "", job, inner).mesh()


@pytest.mark.slow
def test_contrast_over_a_tumour_of_12_mm(tmp_path):
    labels, affine = labels_of([ellipsoid(SEMI), ball(TUMOUR, TUMOUR_RADIUS)], 1.1 * SEMI)
    path = write_nrrd(tmp_path / "ct.seg.nrrd", labels, affine, {"liver": 1, "tumor": 2})
    with pytest.warns(palpate.MeshWarning):
        mesh = tetrahedralize_with("quadratic", path, options=FillOptions(segments=("liver", "tumor")))
    segmented, true = contrast(mesh), contrast(analytic())
    # That of the liver itself, and one that is felt.
    assert (true > 0.08).all()
    np.testing.assert_allclose(segmented, true, atol=POINTS)
