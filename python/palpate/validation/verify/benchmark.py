"""Parts of a benchmark: figures with their targets, plots, and solutions by the same calls a user has."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from palpate.body import Body, Fixed, Loads, Material
from palpate.dynamics import ModalBasis, modes
from palpate.errors import LockingWarning, TouchWarning
from palpate.green import GreensFunction, precompute
from palpate.mesh import TetMesh


@dataclass(frozen=True)
class Check:
    """One figure beside its target."""

    quantity: str  # what it is, with what it was computed on
    # In ``unit``; a target of zero makes the error absolute.
    computed: float
    target: float
    source: str  # where the target comes from
    tolerance: float | None  # largest error that passes; None shows the figure without a verdict
    unit: str = ""

    @property
    def error(self) -> float:
        """Difference relative to the target; to one if that is zero."""
        return abs(self.computed - self.target) / (abs(self.target) or 1.0)

    @property
    def passed(self) -> bool:
        """Within the tolerance, or without one."""
        return self.tolerance is None or self.error <= self.tolerance


@dataclass(frozen=True)
class Outcome:
    """Checks of a benchmark, and its plots by file name: functions that draw into a path."""

    checks: list[Check]
    plots: dict[str, Callable[[Path], None]] = field(default_factory=dict)


@dataclass(frozen=True)
class Benchmark:
    """A benchmark by name; ``slow`` ones take more than a few seconds."""

    name: str
    title: str
    run: Callable[[], Outcome]
    slow: bool = False


def quiet_body(
    mesh: TetMesh, material: Material | Mapping[int, Material], fixed: Fixed, loads: Loads | None = None
) -> Body:
    """Make a body; locking is what some benchmarks show, so nobody needs to be warned of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LockingWarning)
        return Body(mesh, material=material, fixed=fixed, loads=loads)


def green_of(body: Body, touch: Sequence[int] | np.ndarray | None = None, precision: str = "f64") -> GreensFunction:
    """Green's function, always computed anew; its file is gone with its last user.

    Loads may stand for moved supports, and figures of linear elasticity hold at any size: no strain is warned of.
    """
    with tempfile.TemporaryDirectory(prefix="palpate-verify-") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", TouchWarning)
        return precompute(body, precision=precision, touch=touch, path=Path(folder) / "green.palpate", progress=False)


def modes_of(body: Body, count: int) -> ModalBasis:
    """Lowest modes, always computed anew."""
    with tempfile.TemporaryDirectory(prefix="palpate-verify-") as folder:
        return modes(body, count, path=Path(folder) / "modes.palpate", progress=False)


def surface_response(body: Body) -> np.ndarray:
    """Displacements of the surface nodes under the body's loads, (s, 3) m."""
    return green_of(body, touch=body.mesh.surface_nodes[:1]).free_displacements


def with_moved_supports(body: Body, motion: np.ndarray) -> Body:
    """Turn a motion (n, 3), m, of the supports into loads, besides those that the body has.

    With `u_D` at the supports, `K_NN u_N = F_N - K_ND u_D`: the same free displacements follow from fixed supports and
    the forces `-K_ND u_D`. This needs no columns of `Psi` for the supports. The motion is read at fixed components
    only.
    """
    moved = np.where(body.fixed_mask, motion, 0.0)
    forces = body.load_vector() - (body.stiffness() @ moved.ravel()).reshape(-1, 3)
    forces[body.fixed_mask] = 0.0
    named = {int(node): forces[node] for node in np.flatnonzero(forces.any(axis=1))}
    return Body(body.mesh, material=body.material, fixed=body.fixed_mask, loads=Loads(forces=named))


def at_node(mesh: TetMesh, position: Sequence[float]) -> int:
    """Row, among the surface nodes, of the one nearest to a position."""
    return int(np.linalg.norm(mesh.nodes[mesh.surface_nodes] - position, axis=1).argmin())
