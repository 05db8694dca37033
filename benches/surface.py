"""All of the surface of a cube in stages, timed, beside direct solutions at random nodes."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import scipy.sparse
import typer

from benches.output import count_of
from palpate.body import Body
from palpate.green import Plan, plan
from palpate.validation.verify.surface import cube, direct_columns, in_stages, largest_errors, random_nodes


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


def surface_errors(body: Body, precision: str, path: Path) -> SurfaceErrors:
    """Compute all columns of a body and compare those of random nodes."""
    begun = time.perf_counter()
    green, stages = in_stages(body, precision, path)
    took = time.perf_counter() - begun
    chosen = random_nodes(body, green)
    begun = time.perf_counter()
    direct = direct_columns(body, chosen, dissected(body))
    direct_s = time.perf_counter() - begun
    errors = largest_errors(green, chosen, direct)
    size = path.stat().st_size
    return SurfaceErrors(len(body.mesh.tets), len(green.surface_nodes), took, direct_s, size, *errors, stages)


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


def run(tets: int, precision: str, folder: Path | None = None) -> tuple[Plan, SurfaceErrors]:
    """Plan and compute all columns of a cube of about so many tetrahedra; the store is removed afterwards.

    ``folder`` is where it goes meanwhile; None takes one for temporary files.
    """
    body = cube(tets)
    with tempfile.TemporaryDirectory(dir=folder) as place:
        path = Path(place) / "cube.palpate"
        planned = plan(body, precision=precision, path=path)
        return planned, surface_errors(body, precision, path)


def surface(
    tets: Annotated[str, typer.Option(help="Tetrahedra of the cube, such as 5k or 100k.")] = "100k",
    precision: Annotated[str, typer.Option(help="Number formats.")] = "f16,f32",
    folder: Annotated[Path | None, typer.Option(help="Where the stores go meanwhile.")] = None,
) -> None:
    """All of a surface in stages, with its plan, beside direct solutions by SuperLU at 20 random nodes.

    Example: python -m benches surface --tets 100k --precision f16
    """
    for chosen in precision.split(","):
        planned, found = run(count_of(tets), chosen, folder)
        print(
            f"{found.tets} tetrahedra, {found.surface_nodes} surface nodes, {chosen}, {found.stages} stores on the way"
        )
        print(planned)
        print(f"columns in {found.precompute_s:.3g} s, store {found.store_bytes / 1e9:.3g} GB")
        print(
            f"20 random nodes beside SuperLU ({found.direct_s:.3g} s): largest error of a displacement "
            f"{found.largest:.2g}, {found.stated:.2g} of the error stated"
        )
