"""All of a surface, computed in stages, against direct solutions at random nodes."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import scipy.sparse
from scipy.sparse.linalg import splu

from palpate.body import Body, Material
from palpate.green import GreensFunction, precompute
from palpate.validation.verify.benchmark import Check, Outcome
from palpate.validation.verify.grids import box

SIDE = 0.1
SOFT = Material(10e3, 0.45)
NODES = 20
# Largest error of a displacement over the largest displacement, where entries have 24 bits.
SINGLE = 1e-6


def cube(tets: int) -> Body:
    """Cube of about so many tetrahedra, held at its lower face."""
    cells = max(round((tets / 6) ** (1 / 3)), 2)
    return Body(box((cells,) * 3, (SIDE,) * 3, quadratic=False), material=SOFT, fixed=lambda p: p[:, 2] < 1e-9)


def in_stages(body: Body, precision: str, path: Path) -> tuple[GreensFunction, int]:
    """Compute all columns of a body, its upper face first; and return how many stores there were on the way."""
    stores: list[int] = []
    top = body.mesh.surface_nodes[body.mesh.nodes[body.mesh.surface_nodes, 2] > SIDE * (1 - 1e-9)]
    green = precompute(
        body,
        precision=precision,
        first=top,
        path=path,
        progress=False,
        ready=lambda green: stores.append(len(green.touchable_nodes)),
    )
    return green, len(stores)


def random_nodes(body: Body, green: GreensFunction) -> np.ndarray:
    """Nodes (20,) of the surface that are free."""
    free = np.setdiff1d(green.surface_nodes, body.fixed_nodes)
    return np.random.default_rng(5).choice(free, NODES, replace=False)


def largest_errors(green: GreensFunction, chosen: np.ndarray, direct: np.ndarray) -> tuple[float, float]:
    """Largest error of a displacement over the largest of its column, and over the error that the answer states."""
    largest = stated = 0.0
    for rank, node in enumerate(chosen.tolist()):
        for axis in range(3):
            answer = green.solve(forces={node: tuple(np.eye(3)[axis])})
            exact = direct[:, 3 * rank + axis].reshape(-1, 3)[green.surface_nodes]
            error = float(np.abs(answer.displacements - exact).max() / np.abs(exact).max())
            largest, stated = max(largest, error), max(stated, error / answer.error)
    return largest, stated


def direct_columns(body: Body, nodes: np.ndarray, order: np.ndarray | None = None) -> np.ndarray:
    """Displacements (3n, 3k) of all dofs, m, under unit forces on the dofs of nodes (k,), by SuperLU.

    ``order`` is that in which nodes (n,) are eliminated; None leaves it to SuperLU.
    """
    stiffness = scipy.sparse.csc_array(body.stiffness())
    nodes_in_order = np.arange(len(body.mesh.nodes)) if order is None else order
    dofs_in_order = (3 * nodes_in_order[:, None] + np.arange(3)).ravel()
    free = dofs_in_order[~np.isin(dofs_in_order, body.fixed_dofs)]
    factor = splu(
        stiffness[free][:, free].tocsc(),
        permc_spec="MMD_AT_PLUS_A" if order is None else "NATURAL",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
    right = (free[:, None] == dofs).astype(float)
    columns = np.zeros((stiffness.shape[0], len(dofs)))
    columns[free] = factor.solve(right)
    return columns


def full_surface() -> Outcome:
    """All of the surface of 5k tetrahedra in two formats, 20 random nodes beside a direct solver."""
    body, checks, direct = cube(5000), [], None
    with tempfile.TemporaryDirectory() as folder:
        for precision, tolerance in (("f32", SINGLE), ("f16", None)):
            green, _ = in_stages(body, precision, Path(folder) / f"{precision}.palpate")
            chosen = random_nodes(body, green)
            direct = direct_columns(body, chosen) if direct is None else direct
            largest, stated = largest_errors(green, chosen, direct)
            what = f"{precision}: displacement, largest error of {NODES} nodes"
            checks.append(Check(what, largest, 0.0, "SuperLU", tolerance))
            within = float(stated <= 1.0)
            checks.append(Check(f"{precision}: within the error that the answer states", within, 1.0, "SuperLU", 0.0))
    return Outcome(checks)
