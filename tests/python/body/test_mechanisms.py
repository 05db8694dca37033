"""Bodies whose parts hang on hinges and balls are refused, as the rank of the stiffness says; others are not."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh, direct_solve, relative

import palpate

SOFT = palpate.Material(10e3, 0.3)
STEP = 0.01


def voxels(filled: np.ndarray) -> palpate.TetMesh:
    """Cubes of a grid in tetrahedra that fit each other (scikit-fem's), where ``filled`` (a, b, c)."""
    import skfem

    axes = [np.arange(count + 1) * STEP for count in filled.shape]
    grid = skfem.MeshTet.init_tensor(*axes)
    nodes, tets = grid.p.T, grid.t.T
    cube = np.floor(nodes[tets].mean(axis=1) / STEP).astype(int)
    filled_tets = tets[filled[tuple(cube.T)]]
    used = np.unique(filled_tets)
    return palpate.TetMesh(nodes[used], np.searchsorted(used, filled_tets))


def strainless_motions(body: palpate.Body) -> int:
    """How many displacements of the free dofs have no energy, by a dense eigenvalue problem."""
    free = np.setdiff1d(np.arange(3 * len(body.mesh.nodes)), body.fixed_dofs)
    values = np.linalg.eigvalsh(body.stiffness()[free][:, free].toarray())
    return int((values < 1e-10 * values.max()).sum())


def cubes(*places) -> palpate.TetMesh:
    filled = np.zeros(np.max(places, axis=0) + 1, dtype=bool)
    filled[tuple(np.transpose(places))] = True
    return voxels(filled)


def bottom(nodes: np.ndarray) -> np.ndarray:
    return nodes[:, 2] < 1e-9


@pytest.mark.parametrize(
    ("places", "quadratic", "message"),
    [
        # Cubes that share an edge, and a vertex.
        ([(0, 0, 0), (1, 0, 1)], False,
         r"part of 8 nodes around \(0.015, 0.005, 0.015\) m meets the other 8 only at the edge between "
         r"nodes \d+ at \(0.01, 0, 0.01\) m and \d+ at \(0.01, 0.01, 0.01\) m, and turns"),
        ([(0, 0, 0), (1, 0, 1)], True, "only at the edge between nodes"),
        ([(0, 0, 0), (1, 1, 1)], False, r"only at node \d+ at \(0.01, 0.01, 0.01\) m, and turns about it"),
        ([(0, 0, 0), (1, 1, 1)], True, r"only at node \d+ at \(0.01, 0.01, 0.01\) m, and turns about it"),
        # A chain of hinges: the smallest of those that move is named.
        ([(0, 0, 0), (1, 0, 1), (2, 0, 2), (3, 0, 2)], False, "part of 8 nodes .* only at"),
    ],
)  # fmt: skip
def test_hinges_and_balls_are_named_by_their_place(places, quadratic, message):
    mesh = cubes(*places)
    body = palpate.Body(mesh.to_quadratic() if quadratic else mesh, material=SOFT, fixed=bottom)
    assert strainless_motions(body) > 0
    with pytest.raises(palpate.BodyError, match=message):
        palpate.precompute(body, progress=False)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_part_with_enough_supports_of_its_own_is_no_mechanism(count):
    """The second cube hangs on an edge of the first, and nodes of its far face are fixed: one off the axis suffices."""
    mesh = cubes((0, 0, 0), (1, 0, 1))
    far = np.flatnonzero(mesh.nodes[:, 0] > 0.019)[:count]
    fixed = bottom(mesh.nodes)
    fixed[far] = True
    body = palpate.Body(mesh, material=SOFT, fixed=fixed)
    assert strainless_motions(body) == 0
    green = palpate.precompute(body, precision="f64", progress=False)
    node = int(np.setdiff1d(green.surface_nodes, body.fixed_nodes)[-1])
    loads = np.zeros(3 * len(mesh.nodes))
    loads[3 * node + 2] = 0.01
    expected, _ = direct_solve(body, dict.fromkeys(body.fixed_dofs.tolist(), 0.0), loads)
    answer = green.solve(forces={node: (0, 0, 0.01)})
    assert relative(answer.displacements, expected[green.surface_nodes]) < 1e-9


def test_parts_welded_along_edges_that_are_not_in_line_are_held():
    """A cube beside two others that touch it along two edges at a right angle."""
    mesh = cubes((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 0, 1), (0, 1, 1), (1, 1, 1), (2, 0, 1), (2, 1, 1))
    body = palpate.Body(mesh, material=SOFT, fixed=bottom)
    assert strainless_motions(body) == 0
    body.require_supported()


@pytest.mark.parametrize("hangs", [False, True])
def test_one_hinge_among_hundreds_of_welds_is_found(hangs):
    """A lattice of 256 cubes, each along edges of its neighbours; then a corner of it by one edge alone."""
    filled = np.indices((8, 8, 8)).sum(axis=0) % 2 == 0
    if hangs:
        filled[5:, 5:, 4:] = False
        filled[7, 7, 6] = filled[6, 6, 6] = filled[6, 5, 5] = filled[5, 6, 5] = filled[5, 5, 6] = True
    mesh = voxels(filled)
    body = palpate.Body(mesh, material=SOFT, fixed=bottom)
    if not hangs:
        body.require_supported()
        return
    with pytest.raises(
        palpate.BodyError, match=r"around \(0.075, 0.075, 0.065\) m meets the other \d+ only at the edge"
    ):
        body.require_supported()


@pytest.mark.parametrize("seed", range(60))
def test_the_verdict_is_that_of_the_rank(seed):
    """Random cubes of a grid, welded by faces, edges and vertices in any way, with random supports."""
    generator = np.random.default_rng(seed)
    filled = generator.random((3, 2, 3)) < generator.uniform(0.3, 0.7)
    filled[0, 0, 0] = True
    mesh = voxels(filled)
    mask = np.zeros((len(mesh.nodes), 3), dtype=bool)
    mask[bottom(mesh.nodes)] = True
    mask[generator.choice(len(mesh.nodes), generator.integers(0, 4))] |= generator.random(3) < 0.7
    body = palpate.Body(mesh, material=SOFT, fixed=mask)
    if strainless_motions(body) == 0:
        body.require_supported()
    else:
        with pytest.raises(palpate.BodyError, match=r" at .* m"):
            body.require_supported()


@pytest.mark.parametrize(("contrast", "regular"), [(1e6, True), (1e11, False)])
def test_a_stiff_half_on_a_soft_one_is_answered_or_refused_by_its_place(contrast, regular):
    """Beyond 1 / eps nothing is left of the soft half's digits in the sums with the stiff one's."""
    mesh = box_mesh(cells=(4, 2, 2)).with_regions({1: lambda p: p[:, 0] > 0.04})
    materials = {0: SOFT, 1: palpate.Material(10e3 * contrast, 0.3)}
    body = palpate.Body(mesh, material=materials, fixed=lambda p: p[:, 0] < 1e-9)
    if not regular:
        with pytest.raises(palpate.BodyError, match=r"condition number \d+e1[3-6].*around node \d+ at .* materials"):
            palpate.precompute(body, precision="f64", progress=False)
        return
    green = palpate.precompute(body, precision="f64", progress=False)
    node = int(np.argmax(mesh.nodes[:, 0]))
    loads = np.zeros(3 * len(mesh.nodes))
    loads[3 * node] = 1.0
    expected, _ = direct_solve(body, dict.fromkeys(body.fixed_dofs.tolist(), 0.0), loads)
    assert relative(green.solve(forces={node: (1.0, 0, 0)}).displacements, expected[green.surface_nodes]) < 1e-4
