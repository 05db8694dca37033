"""The nodule of examples/nodule.toml: what the finger feels over it, against a direct finite element solve."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse.linalg
from conftest import skfem_stiffness

import palpate

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).parents[3] / "examples" / "nodule.toml"
TOP, RADIUS, PRESS = 0.04, 0.005, 1e-3


@pytest.fixture(scope="module")
def nodule(cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache))
        # Without the finer elements under the finger: both solutions are of the same mesh.
        scene = palpate.Scene.read(EXAMPLE)
        body = scene.bodies[0].model_copy(update={"refine": scene.bodies[0].refine[:1]})
        coarser = scene.model_copy(update={"bodies": [body]})
        coarser._source = scene._source
        return coarser.build()


def patch_weights(mesh, point, radius, split=24):
    """`int N_i phi dA / int phi dA` on the flat top by brute force: the centroids of split^2 parts of each face."""
    faces = mesh.surface_faces
    flat = faces[(np.abs(mesh.nodes[faces][:, :, 2] - TOP) < 1e-9).all(axis=1)]
    i, j = np.meshgrid(np.arange(split), np.arange(split), indexing="ij")
    upright = np.stack([i + 1 / 3, j + 1 / 3], axis=-1)[i + j < split]
    turned = np.stack([i + 2 / 3, j + 2 / 3], axis=-1)[i + j < split - 1]
    parts = np.vstack([upright, turned]) / split
    L = np.column_stack([1 - parts.sum(axis=1), parts])
    shapes = np.hstack([L * (2 * L - 1), 4 * L * np.roll(L, -1, axis=1)])
    corners = mesh.nodes[flat[:, :3]]
    positions = np.einsum("pn,knx->kpx", L, corners)
    distance = np.linalg.norm(positions - point, axis=2) / radius
    mask = np.where(distance < 1, (1 - distance**2) ** 2, 0)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1) / 2
    weights = np.zeros(len(mesh.nodes))
    np.add.at(weights, flat, np.einsum("pn,kp,k->kn", shapes, mask, areas))
    return weights / weights.sum()


def test_stiffness_over_the_nodule_equals_a_direct_solve(nodule):
    body = nodule.bodies[0].body
    assert len(np.unique(body.mesh.regions)) == 2
    K = skfem_stiffness(body)
    free = np.setdiff1d(np.arange(K.shape[0]), body.fixed_dofs)
    symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    solve = scipy.sparse.linalg.splu(K[free][:, free].tocsc(), **symmetric).solve
    for x in (0.02, 0.036, 0.04, 0.047):
        point = np.array([x, 0.04, TOP])
        load = np.zeros(K.shape[0])
        load[2::3] = patch_weights(body.mesh, point, RADIUS)
        u = np.zeros(K.shape[0])
        u[free] = solve(load[free])
        direct = 1 / (load @ u)
        felt = -nodule.bodies[0].green.touch(point, (None, None, -PRESS), RADIUS).force[2] / PRESS
        assert felt == pytest.approx(direct, rel=0.01)


def test_the_nodule_is_as_large_as_asked(nodule):
    """Elements follow the sphere by their centroids; their volume is that of the sphere to a few per cent."""
    mesh = nodule.bodies[0].body.mesh
    volume = mesh.volumes[mesh.regions == 1].sum()
    assert volume == pytest.approx(4 / 3 * np.pi * 0.005**3, rel=0.03)
