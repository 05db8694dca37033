"""The Green's function of a body: precompute it once, then answer any touch by a small solve."""

from __future__ import annotations

import contextlib
import json
import operator
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate import _native
from palpate.body import Body
from palpate.errors import BodyError, StoreError, StoreWarning
from palpate.memory import allowed_memory
from palpate.progress import progress_reporter
from palpate.strain import Strained, SurfaceStrain

if TYPE_CHECKING:
    from palpate.gauge import StrainGauge

Components = Sequence[float | None]


@dataclass(frozen=True)
class Answer(Strained):
    """Solution of a changed boundary value problem.

    Attributes
    ----------
    displacements
        (s, 3) m; rows follow the surface nodes.
    forces
        (s, 3) N, `K u` at the surface nodes: applied loads, contact forces and support reactions.
    reactions
        (f, 3) N, `K u` at the body's fixed nodes.

    """

    displacements: np.ndarray
    forces: np.ndarray
    reactions: np.ndarray
    _source: GreensFunction = field(repr=False, compare=False)


@dataclass(frozen=True)
class Touch(Strained):
    """Answer to a patch contact: force on the body (3,), N, and displacements (s, 3), m."""

    force: np.ndarray
    displacements: np.ndarray
    _source: GreensFunction = field(repr=False, compare=False)


def cache_directory() -> Path:
    """Folder of precomputed files: ``$XDG_CACHE_HOME/palpate``."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "palpate"


class GreensFunction:
    """Compliance of a body seen from its touchable surface.

    Made by :func:`precompute` or :meth:`load`; immutable. ``body`` is what it was made for, None where only the store
    is known.
    """

    def __init__(self, core: _native.GreenCore, body: Body | None = None):
        self._core = core
        self.body = body
        self.surface_nodes = core.surface_nodes.astype(np.int64)
        self.surface_positions = core.surface_positions.reshape(-1, 3)
        faces, width = core.surface_faces
        self.surface_faces = self.surface_nodes[faces.reshape(-1, width)]
        self.surface_triangles = self.surface_nodes[core.surface_triangles.reshape(-1, 3)]
        ranks = core.touch_ranks.astype(np.int64)
        self.touchable_nodes = self.surface_nodes[ranks]
        self.fixed_dofs = core.fixed_dofs.astype(np.int64)
        self.fixed_nodes = np.unique(self.fixed_dofs // 3)
        self._fixed = frozenset(self.fixed_dofs.tolist())
        self._first_column = {int(n): 3 * i for i, n in enumerate(self.touchable_nodes)}
        self._surface_rank = {int(n): i for i, n in enumerate(self.surface_nodes)}

    @property
    def precision(self) -> str:
        """Stored number format, ``"f16"``, ``"f32"`` or ``"f64"``."""
        return self._core.precision

    @property
    def key(self) -> str:
        """Hash of everything that determines the numbers."""
        return self._core.key

    @property
    def path(self) -> Path | None:
        """File behind it, if any."""
        return None if self._core.path is None else Path(self._core.path)

    @property
    def youngs_modulus(self) -> float | None:
        """Young's modulus, Pa, if the whole body has one and no loads: then it only scales forces."""
        return self._core.youngs_modulus

    @property
    def description(self) -> dict[str, Any]:
        """What it was made from."""
        return json.loads(self._core.description or "{}")

    @property
    def free_displacements(self) -> np.ndarray:
        """Displacements of the surface under the body's own loads, untouched, (s, 3) m; all answers start from them."""
        return self._core.free_displacements.reshape(-1, 3)

    @cached_property
    def strain_gauge(self) -> StrainGauge:
        """What measures the largest strain of answers: by the elements of the body, of a bare store by its surface."""
        if self.body is None:
            return SurfaceStrain(self.surface_positions, np.searchsorted(self.surface_nodes, self.surface_faces))
        from palpate.gauge import ElementStrain
        from palpate.stress import StressRecovery

        return ElementStrain(StressRecovery(self.body))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the store; an existing file is replaced only when the new one is complete."""
        self._core.save(Path(path))

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, body: Body | None = None) -> GreensFunction:
        """Map a store and verify every block of it.

        Parameters
        ----------
        path
            The file.
        body
            If given, a store that was made for another body is refused.

        Raises
        ------
        StoreError
            Not a store, damaged, of another version, or made for another body.

        """
        path = Path(path)
        if not path.exists():
            raise StoreError(f"{path}: no such file")
        green = cls(_native.GreenCore.load(path), body)
        if body is not None:
            touch = None if len(green.touchable_nodes) == len(green.surface_nodes) else green.touchable_nodes
            expected = _native.GreenCore.content_key(problem_arrays(body, touch), green.precision)
            if expected != green.key:
                raise StoreError(f"{path}: {_difference(green, body)}; compute it again")
        return green

    def solve(
        self,
        *,
        displacements: Mapping[int, Components] | None = None,
        forces: Mapping[int, Components] | None = None,
        release: Sequence[int] = (),
    ) -> Answer:
        """Answer a change of boundary conditions by the capacitance matrix algorithm.

        Parameters
        ----------
        displacements
            Prescribed displacement of touchable nodes from the unloaded shape, m; None leaves a component as it is:
            free, or held by its support. Fixed nodes may be named: their support moves.
        forces
            Forces on touchable nodes, N, besides the body's own loads; None is no force. On a support they go straight
            into it.
        release
            Fixed nodes on the surface whose support is taken away, but for components that ``displacements``
            prescribes.

        Raises
        ------
        BodyError
            A node that is not touchable, or in ``release`` not fixed; a wrong length; a number that is not finite;
            a force and a displacement on the same component; released supports that leave the body free to move.

        """
        forced, placed = self._by_column(forces, "forces"), self._by_column(displacements, "displacements")
        freed = {column for node in release for column in self._released_columns(node)}
        known: dict[int, float] = {}
        switched: dict[int, float] = {}
        for column in {*forced, *placed, *freed}:
            fixed = self._is_fixed(column)
            if column in placed:
                if forced.get(column) and (column in freed or not fixed):
                    node, axis = self.touchable_nodes[column // 3], "xyz"[column % 3]
                    raise BodyError(f"node {node} has both a force and a displacement along {axis}")
                (known if fixed else switched)[column] = placed[column]
            elif column in freed:
                switched[column] = forced.get(column, 0.0)
            elif not fixed:  # a force on a support goes straight into it and moves nothing
                known[column] = forced[column]
        u, f, reactions = self._core.solve(sorted(known.items()), sorted(switched.items()))
        u, f = u.reshape(-1, 3), f.reshape(-1, 3)
        return Answer(u, f, self._reactions(f, reactions), self)

    def touch(self, point: Sequence[float], displacement: Components, radius: float = 0.0) -> Touch:
        """Press a patch of the surface.

        Parameters
        ----------
        point
            Contact point, m, on the unloaded body; the closest point of the surface is taken.
        displacement
            Weighted mean displacement of the patch from the unloaded shape, m; None leaves a component free.
        radius
            Contact radius, m; 0 is a point contact.

        """
        if not (np.isfinite(radius) and radius >= 0):
            raise BodyError(f"the contact radius must not be negative, got {radius}")
        target = _components(point, None, "point")
        if None in target:
            raise BodyError("the touch point needs three numbers")
        force, u = self._core.touch(target, _components(displacement, None, "displacement"), float(radius))
        return Touch(np.array(force), u.reshape(-1, 3), self)

    def _reactions(self, surface_forces: np.ndarray, fixed_dof_forces: np.ndarray) -> np.ndarray:
        """`K u` at the fixed nodes; a free component carries the loads on it."""
        loads = self._core.loads.reshape(-1, 3)
        reactions = loads[self.fixed_nodes] if len(loads) else np.zeros((len(self.fixed_nodes), 3))
        for i, node in enumerate(self.fixed_nodes):
            rank = self._surface_rank.get(int(node))
            if rank is not None:
                reactions[i] = surface_forces[rank]
        rows = np.searchsorted(self.fixed_nodes, self.fixed_dofs // 3)
        reactions[rows, self.fixed_dofs % 3] = fixed_dof_forces
        return reactions

    def _by_column(self, values: Mapping[int, Components] | None, argument: str) -> dict[int, float]:
        """Given components by column of the operator."""
        columns = {}
        for node, components in (values or {}).items():
            first = self._column(node, argument)
            for axis, value in enumerate(_components(components, node, argument)):
                if value is not None:
                    columns[first + axis] = value
        return columns

    def _column(self, node: int, argument: str) -> int:
        try:
            return self._first_column[operator.index(node)]
        except (KeyError, TypeError):
            raise BodyError(f"{argument}: node {node} is not touchable") from None

    def _is_fixed(self, column: int) -> bool:
        return 3 * int(self.touchable_nodes[column // 3]) + column % 3 in self._fixed

    def _released_columns(self, node: int) -> list[int]:
        """Columns of the fixed components of a node whose support is taken away."""
        if not isinstance(node, (int, np.integer)) or not np.isin(node, self.fixed_nodes):
            raise BodyError(f"release: node {node} is not fixed")
        if int(node) not in self._surface_rank:
            raise BodyError(f"release: fixed node {node} lies inside the body; only surface nodes can be released")
        first = self._column(node, "release")
        return [column for column in range(first, first + 3) if self._is_fixed(column)]


def precompute(
    body: Body,
    *,
    precision: str = "f32",
    touch: Sequence[int] | np.ndarray | None = None,
    path: str | os.PathLike[str] | None = None,
    memory: int | str | None = None,
    progress: bool | Callable[[int, int], None] = True,
) -> GreensFunction:
    """Green's function of a body, from its file if that matches, else computed and written there.

    An interrupted computation leaves what it finished in ``<path>.partial``; the next one with the same arguments goes
    on from there, to the same bits.

    Parameters
    ----------
    body
        A supported body, with its loads.
    precision
        Stored number format: ``"f64"``; ``"f32"`` (right to about 2e-6 of a column's largest entry); or ``"f16"``
        (5e-4), a quarter of the size of ``"f64"``. Answers are computed in double from what is stored.
    touch
        Surface nodes that may be touched; None: all.
    path
        File; None keeps it in the cache under its content key.
    memory
        Bytes that the process may take at its peak, or text such as ``"8GB"``; None: as many as are useful. The
        operator itself is written as it is computed, and takes none.
    progress
        True shows a bar on a terminal; a function is called with columns done and in all.

    Raises
    ------
    BodyError
        A body that its supports do not hold, a touch node that is not on the surface, or a bound of memory that
        cannot be kept.

    """
    body.require_supported()
    problem = problem_arrays(body, touch)
    key = _native.GreenCore.content_key(problem, precision)
    if path is None:
        target = cache_directory() / f"{key[:32]}.palpate"
        target.parent.mkdir(parents=True, exist_ok=True)
    else:
        target = Path(path)
    if target.exists():
        with contextlib.suppress(StoreError):
            return GreensFunction(_native.GreenCore.load(target, key), body)
    allowed = None if memory is None else allowed_memory(memory)
    with progress_reporter("precomputing", progress) as report:
        _, discarded = _native.GreenCore.precompute_to(
            problem, precision, json.dumps(_describe(body)), report, target, allowed
        )
    if discarded:
        warnings.warn(
            f"{target}.partial belonged to another computation and was thrown away", StoreWarning, stacklevel=2
        )
    return GreensFunction(_native.GreenCore.load(target, key), body)


def problem_arrays(body: Body, touch: Sequence[int] | np.ndarray | None) -> tuple[np.ndarray, ...]:
    """Arrays that determine the reference problem, in the order of the native module."""
    surface_nodes = body.mesh.surface_nodes
    if touch is None:
        ranks = np.arange(len(surface_nodes))
    else:
        nodes = np.unique(np.asarray(touch))
        if nodes.size == 0 or not np.issubdtype(nodes.dtype, np.integer):
            raise BodyError("touch must be a list of surface node indices")
        ranks = np.searchsorted(surface_nodes, nodes)
        inside = np.flatnonzero(surface_nodes[np.minimum(ranks, len(surface_nodes) - 1)] != nodes)
        if inside.size:
            raise BodyError(f"touch: node {nodes[inside[0]]} is not on the surface")
    indices = [body.fixed_dofs, surface_nodes, body.mesh.surface_faces, ranks]
    loads = body.load_vector().ravel()
    loads = loads if loads.any() else np.empty(0)
    return (*body._element_arrays(), *(np.ascontiguousarray(i, dtype=np.uint32) for i in indices), loads)


def _describe(body: Body) -> dict[str, Any]:
    materials = body.material if isinstance(body.material, Mapping) else {"all": body.material}
    total = body.load_vector().sum(axis=0)
    return {
        "nodes": len(body.mesh.nodes),
        "tets": len(body.mesh.tets),
        "element": "quadratic" if body.mesh.is_quadratic else "linear",
        "surface_nodes": len(body.mesh.surface_nodes),
        "fixed_nodes": len(body.fixed_nodes),
        "materials": {str(k): [m.youngs_modulus, m.poissons_ratio, m.density] for k, m in materials.items()},
        "load_N": total.tolist(),
    }


def _difference(green: GreensFunction, body: Body) -> str:
    """First thing in which a store and a body are seen to differ."""
    stored, now = green.description, _describe(body)
    for name in ("element", "nodes", "tets", "surface_nodes", "fixed_nodes", "materials", "load_N"):
        if stored.get(name) != now[name]:
            return f"was made for another body ({name.replace('_', ' ')}: {stored.get(name)} there, {now[name]} here)"
    if not np.array_equal(green.fixed_dofs, body.fixed_dofs):
        return "was made for another body (other nodes are fixed)"
    if not np.array_equal(green._core.loads, problem_arrays(body, None)[-1]):
        return "was made for another body (other loads)"
    return "was made for another body (node positions or elements differ)"


def _components(values: Components, node: int | None, argument: str) -> tuple[float | None, ...]:
    where = argument if node is None else f"{argument}: node {node}"
    try:
        result = tuple(None if v is None else float(v) for v in values)
    except (TypeError, ValueError):
        raise BodyError(f"{where} needs three numbers") from None
    if len(result) != 3:
        raise BodyError(f"{where} needs three numbers, got {len(result)}")
    if not all(v is None or np.isfinite(v) for v in result):
        raise BodyError(f"{where} has a number that is not finite")
    return result
