"""All of a surface, computed in stages, against direct solutions at random nodes."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse
from scipy.sparse.linalg import splu

from palpate.body import Body, Material
from palpate.green import GreensFunction, precompute
from palpate.validation.verify.check import Check, Outcome
from palpate.validation.verify.grids import box

SIDE = 0.1
SOFT = Material(10e3, 0.45)
NODES = 20
# Largest error of a displacement over the largest displacement, where entries have 24 bits.
SINGLE = 1e-6


@dataclass(frozen=True)
class SurfaceErrors:
    """Columns of some nodes beside direct solutions.

    Attributes
    ----------
    tets, surface_nodes
        Of the body.
    precompute_s, direct_s
        Time of all columns in stages, and of the factor and columns of the direct solver, s.
    store_bytes
        Of the file.
    largest
        Largest error of a displacement, over the largest displacement of its column.
    stated
        Largest of that error over the one that the answer itself states.
    stages
        Stores on the way.

    """

    tets: int
    surface_nodes: int
    precompute_s: float
    direct_s: float
    store_bytes: int
    largest: float
    stated: float
    stages: int


def cube(tets: int) -> Body:
    """Cube of about so many tetrahedra, held at its lower face."""
    cells = max(round((tets / 6) ** (1 / 3)), 2)
    return Body(box((cells,) * 3, (SIDE,) * 3, quadratic=False), material=SOFT, fixed=lambda p: p[:, 2] < 1e-9)


def surface_errors(body: Body, precision: str, path: Path, count: int = NODES) -> SurfaceErrors:
    """Compute all columns of a body, its upper face first, and compare those of random nodes."""
    stores: list[int] = []
    begun = time.perf_counter()
    top = body.mesh.surface_nodes[body.mesh.nodes[body.mesh.surface_nodes, 2] > SIDE * (1 - 1e-9)]
    green = precompute(
        body,
        precision=precision,
        first=top,
        path=path,
        progress=False,
        ready=lambda green: stores.append(len(green.touchable_nodes)),
    )
    took = time.perf_counter() - begun
    surface = green.surface_nodes
    free = np.setdiff1d(surface, body.fixed_nodes)
    chosen = np.random.default_rng(5).choice(free, count, replace=False)
    begun = time.perf_counter()
    direct = direct_columns(body, chosen)
    direct_s = time.perf_counter() - begun
    largest, stated = _compare(green, chosen, direct)
    size = path.stat().st_size
    return SurfaceErrors(len(body.mesh.tets), len(surface), took, direct_s, size, largest, stated, len(stores))


def _compare(green: GreensFunction, chosen: np.ndarray, direct: np.ndarray) -> tuple[float, float]:
    largest = stated = 0.0
    for rank, node in enumerate(chosen.tolist()):
        for axis in range(3):
            answer = green.solve(forces={node: tuple(np.eye(3)[axis])})
            exact = direct[:, 3 * rank + axis].reshape(-1, 3)[green.surface_nodes]
            error = float(np.abs(answer.displacements - exact).max() / np.abs(exact).max())
            largest, stated = max(largest, error), max(stated, error / answer.error)
    return largest, stated


def direct_columns(body: Body, nodes: np.ndarray) -> np.ndarray:
    """Displacements (3n, 3k) of all dofs, m, under unit forces on the dofs of nodes (k,), by SuperLU."""
    stiffness = scipy.sparse.csc_array(body.stiffness())
    free = np.setdiff1d(np.arange(stiffness.shape[0]), body.fixed_dofs)
    order = (3 * dissected(body)[:, None] + np.arange(3)).ravel()
    order = order[np.isin(order, free)]
    factor = splu(
        stiffness[order][:, order].tocsc(),
        permc_spec="NATURAL",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
    right = np.zeros((len(free), len(dofs)))
    place = np.empty(stiffness.shape[0], np.int64)
    place[order] = np.arange(len(order))
    right[place[dofs], np.arange(len(dofs))] = 1.0
    columns = np.zeros((stiffness.shape[0], len(dofs)))
    columns[order] = factor.solve(right)
    return columns


def dissected(body: Body) -> np.ndarray:
    """Nodes (n,) by nested dissection: both halves of the longest side, then those that part them (George, 1973)."""
    mesh = body.mesh
    edges = np.concatenate([mesh.tets[:, [a, b]] for a in range(4) for b in range(a)])
    links = scipy.sparse.coo_array((np.ones(len(edges), bool), edges.T), shape=(len(mesh.nodes),) * 2).tocsr()
    links = (links + links.T).tocsr()

    def order(nodes: np.ndarray) -> list[np.ndarray]:
        if len(nodes) <= 40:
            return [nodes]
        positions = mesh.nodes[nodes]
        axis = int(np.ptp(positions, axis=0).argmax())
        high = positions[:, axis] > np.median(positions[:, axis])
        if not high.any():
            return [nodes]
        low_nodes, high_nodes = nodes[~high], nodes[high]
        beside = np.zeros(len(mesh.nodes), bool)
        beside[high_nodes] = True
        parting = np.asarray(links[low_nodes] @ beside.astype(np.int64)) > 0
        return [*order(low_nodes[~parting]), *order(high_nodes), low_nodes[parting]]

    return np.concatenate(order(np.arange(len(mesh.nodes))))


def full_surface() -> Outcome:
    """All of the surface of 5k tetrahedra in two formats, 20 random nodes beside a direct solver."""
    body, checks = cube(5000), []
    with tempfile.TemporaryDirectory() as folder:
        for precision, tolerance in (("f32", SINGLE), ("f16", None)):
            found = surface_errors(body, precision, Path(folder) / f"{precision}.palpate")
            what = f"{precision}: displacement, largest error of {NODES} nodes"
            checks.append(Check(what, found.largest, 0.0, "SuperLU", tolerance))
            within = float(found.stated <= 1.0)
            checks.append(Check(f"{precision}: within the error that the answer states", within, 1.0, "SuperLU", 0.0))
    return Outcome(checks)
