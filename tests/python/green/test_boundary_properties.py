"""Any change of boundary conditions equals a fresh direct solve, over random bodies, materials, supports and loads."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from conftest import box_mesh, direct_solve, relative
from hypothesis import HealthCheck, given, note, settings
from hypothesis import strategies as st

import palpate

# The direct solve and ours both carry round-off times the condition number; the strategies keep that below 1e6.
TOLERANCE = 1e-9
MANY = settings(
    max_examples=250, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)

lengths = st.floats(0.02, 0.1)
newtons = st.floats(-0.1, 0.1)
seeds = st.integers(0, 2**20)


@st.composite
def meshes(draw) -> palpate.TetMesh:
    """Jittered boxes, some with a quarter cut away to an L."""
    cells = tuple(draw(st.integers(2, 4)) for _ in range(3))
    size = tuple(draw(lengths) for _ in range(3))
    mesh = box_mesh(cells, size, jitter=draw(st.floats(0, 0.25)), seed=draw(seeds))
    if draw(st.booleans()):
        centres = mesh.nodes[mesh.tets].mean(axis=1) / np.array(size)
        corner = (centres[:, 0] > 0.5) & (centres[:, 2] > 0.5)
        remaining = mesh.tets[~corner]
        used = np.unique(remaining)
        mesh = palpate.TetMesh(mesh.nodes[used], np.searchsorted(used, remaining))
    return mesh


@st.composite
def materials(draw, mesh):
    """One to three materials, in random regions."""
    count = draw(st.integers(1, 3))
    regions = np.random.default_rng(draw(seeds)).integers(0, count, len(mesh.tets))
    table = {
        region: palpate.Material(
            10.0 ** draw(st.floats(3, 5)), draw(st.floats(-0.3, 0.45)), draw(st.floats(500.0, 2000.0))
        )
        for region in range(count)
    }
    return palpate.TetMesh(mesh.nodes, mesh.tets, regions), table


@st.composite
def supports(draw, mesh):
    """The face at least x fixed by nodes, plus some single components anywhere, inside too."""
    nodes = mesh.nodes
    mask = np.zeros((len(nodes), 3), dtype=bool)
    mask[nodes[:, 0] < nodes[:, 0].min() + 1e-9] = True
    rng = np.random.default_rng(draw(seeds))
    mask |= rng.random(mask.shape) < draw(st.sampled_from([0.0, 0.1]))
    if draw(st.booleans()):
        # Rollers: some of the fixed nodes give in one direction.
        mask[rng.random(len(nodes)) < 0.3, draw(st.integers(0, 2))] = False
    return mask


@st.composite
def loads(draw, mesh):
    """None, or any of gravity, pressure on the far face and a force on any node."""
    if draw(st.booleans()):
        return None
    far = mesh.nodes[:, 0].max() - 1e-9
    return palpate.Loads(
        gravity=tuple(draw(st.floats(-10, 10)) for _ in range(3)),
        pressure=[(lambda p: p[:, 0] > far, draw(st.floats(-100, 100)))] if draw(st.booleans()) else (),
        forces={draw(st.integers(0, len(mesh.nodes) - 1)): tuple(draw(newtons) for _ in range(3))},
    )


@st.composite
def bodies(draw) -> palpate.Body:
    """A body whose supports prevent rigid motions."""
    mesh, table = draw(materials(draw(meshes())))
    mask = draw(supports(mesh))
    body = palpate.Body(mesh, material=table, fixed=mask, loads=draw(loads(mesh)))
    try:
        body.require_supported()
    except palpate.BodyError:
        mask[mesh.nodes[:, 0] < mesh.nodes[:, 0].min() + 1e-9] = True
        body = palpate.Body(mesh, material=table, fixed=mask, loads=body.loads)
    return body


@st.composite
def changes(draw, body) -> dict:
    """Prescribed components, forces and releases on random surface nodes, supports among them."""
    rng = np.random.default_rng(draw(seeds))
    surface = rng.permutation(body.mesh.surface_nodes)
    counts = [draw(st.integers(0, 5)) for _ in range(2)]
    placed, forced = surface[: counts[0]], surface[counts[0] : sum(counts)]
    supported = np.intersect1d(surface, body.fixed_nodes)
    released = rng.permutation(supported)[: draw(st.integers(0, min(3, max(len(supported) - 6, 0))))]
    displacements = {
        int(n): tuple(
            v if keep else None for v, keep in zip(1e-3 * rng.normal(size=3), rng.random(3) < 0.7, strict=True)
        )
        for n in placed
    }
    forces = {int(n): tuple((0.02 * rng.normal(size=3)).tolist()) for n in forced}
    return {"displacements": displacements, "forces": forces, "release": [int(n) for n in released]}


def reference(body: palpate.Body, change: dict):
    """The changed problem, written down anew."""
    gone = {3 * n + k for n in change["release"] for k in range(3)}
    prescribed = {d: 0.0 for d in body.fixed_dofs.tolist() if d not in gone}
    for node, values in change["displacements"].items():
        prescribed |= {3 * node + k: v for k, v in enumerate(values) if v is not None}
    forces = body.load_vector().ravel()
    for node, values in change["forces"].items():
        forces[3 * node : 3 * node + 3] += values
    return direct_solve(body, prescribed, forces)


@pytest.mark.slow
@MANY
@given(st.data())
def test_any_change_equals_a_direct_solve(data):
    body = data.draw(bodies())
    change = data.draw(changes(body))
    note(f"{body.mesh}, {len(body.fixed_dofs)} fixed dofs, {change}")
    with tempfile.TemporaryDirectory() as folder:
        green = palpate.precompute(body, precision="f64", path=Path(folder) / "body.palpate")
        answer = green.solve(**change)
    u, f = reference(body, change)
    surface = body.mesh.surface_nodes
    if not u.any():
        assert not answer.displacements.any()
        assert not answer.forces.any()
        return
    assert relative(answer.displacements, u[surface]) <= TOLERANCE
    assert relative(answer.forces, f[surface]) <= TOLERANCE
    assert np.abs(answer.reactions - f[body.fixed_nodes]).max() <= TOLERANCE * np.abs(f).max()


@pytest.mark.slow
@MANY
@given(st.data())
def test_answers_superpose_and_work_is_reciprocal(data):
    """Linearity, and Betti: one set of forces works on the displacements of another as much as that one on its own."""
    mesh, table = data.draw(materials(data.draw(meshes())))
    body = palpate.Body(mesh, material=table, fixed=data.draw(supports(mesh)))
    try:
        body.require_supported()
    except palpate.BodyError:
        return
    rng = np.random.default_rng(data.draw(seeds))
    first, second = ({int(n): 0.02 * rng.normal(size=3)} for n in rng.choice(mesh.surface_nodes, 2))
    with tempfile.TemporaryDirectory() as folder:
        green = palpate.precompute(body, precision="f64", path=Path(folder) / "body.palpate")
        a, b = green.solve(forces=first), green.solve(forces=second)
        both = green.solve(forces={n: first.get(n, 0) + second.get(n, 0) for n in {*first, *second}})
    scale = max(np.abs(a.displacements).max(), np.abs(b.displacements).max())
    assert np.abs(both.displacements - a.displacements - b.displacements).max() <= 1e-12 * scale

    def work(forces, answer):
        return sum(f @ answer.displacements[np.searchsorted(mesh.surface_nodes, n)] for n, f in forces.items())

    assert abs(work(first, b) - work(second, a)) <= 1e-9 * (abs(work(first, a)) + abs(work(second, b)))
