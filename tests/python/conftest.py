from __future__ import annotations

import numpy as np
import pytest

import palpate
from palpate.mesh import TetMesh


def box_mesh(cells=(4, 3, 3), size=(0.08, 0.05, 0.05), jitter=0.15, seed=1) -> TetMesh:
    """Box of tetrahedra (scikit-fem's), interior nodes moved at random: independent of our own mesher."""
    import skfem

    axes = [np.linspace(0, s, c + 1) for s, c in zip(size, cells, strict=True)]
    made = skfem.MeshTet.init_tensor(*axes)
    nodes, tets = made.p.T.copy(), made.t.T.copy()
    inside = np.ones(len(nodes), dtype=bool)
    for k in range(3):
        inside &= (nodes[:, k] > 1e-9) & (nodes[:, k] < size[k] - 1e-9)
    step = np.array(size) / np.array(cells)
    nodes[inside] += jitter * step * np.random.default_rng(seed).uniform(-1, 1, (inside.sum(), 3))
    return TetMesh(nodes, tets)


def skfem_stiffness(body: palpate.Body):
    """Stiffness by scikit-fem, node-major dofs."""
    import skfem
    from skfem.helpers import ddot, eye, sym_grad, trace

    mesh = skfem.MeshTet(body.mesh.nodes.T.copy(), body.mesh.tets.T.copy())
    e, nu = body._material_rows[:, 0], body._material_rows[:, 1]
    lam, mu = nu * e / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP1()))

    @skfem.BilinearForm
    def form(u, v, w):
        strain = sym_grad(u)
        stress = lam[:, None] * eye(trace(strain), 3) + 2 * mu[:, None] * strain
        return ddot(stress, sym_grad(v))

    order = basis.nodal_dofs.T.ravel()  # ours -> theirs
    return form.assemble(basis).tocsc()[order][:, order]


def skfem_mass(body: palpate.Body):
    """Consistent mass by scikit-fem, node-major dofs."""
    import skfem
    from skfem.helpers import dot

    mesh = skfem.MeshTet(body.mesh.nodes.T.copy(), body.mesh.tets.T.copy())
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP1()), intorder=2)
    density = body._material_rows[:, 2][:, None]
    form = skfem.BilinearForm(lambda u, v, _w: density * dot(u, v))
    order = basis.nodal_dofs.T.ravel()
    return form.assemble(basis).tocsc()[order][:, order]


@pytest.fixture(autouse=True)
def private_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture(scope="session")
def block() -> palpate.Body:
    mesh = box_mesh()
    return palpate.Body(mesh, material=palpate.Material(10e3, 0.4, 1000.0), fixed=lambda p: p[:, 0] < 1e-9)


@pytest.fixture(scope="session")
def block_green(block, tmp_path_factory) -> palpate.GreensFunction:
    return palpate.precompute(block, precision="f64", path=tmp_path_factory.mktemp("green") / "block.palpate")
