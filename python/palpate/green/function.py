"""The Green's function of a body, and contacts solved with it."""

from __future__ import annotations

import json
import operator
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from palpate import _native, units
from palpate.atomic import destination, remove_leftovers
from palpate.body import Body, description, problem_arrays
from palpate.cache import hold
from palpate.errors import BodyError, StoreError, TouchWarning
from palpate.fields import STRAIN_LIMIT, ElementStrain, StrainMeasure, StressRecovery, SurfaceStrain
from palpate.green.answer import Answer, Touch
from palpate.green.bounds import check_error
from palpate.input_file import require_file
from palpate.mesh import size_text
from palpate.units import brief_repr
from palpate.vectors import Reader, brief, three_components, three_numbers

# Numbers in SI, or text with a unit.
Components = Sequence[float | str | None]

# What happens inside of a body with more nodes is not followed from frame to frame: the factor of its inner part takes
# longer than the first touch (1,000,000 tetrahedra, 176,000 nodes: 2 min, 9 GB, and a second for every pose).
MOST_NODES_INSIDE = 50_000

# A touch may land beside its point by the contact radius, and by this part of the body's longest side: flat triangles
# lie so far below a curved surface.
BESIDE = 0.01


class GreensFunction:
    """Compliance of a body seen from its touchable surface.

    Made by :func:`precompute` or :meth:`load`; immutable.

    Attributes
    ----------
    body
        What it was made for; None where only the store is known.
    surface_nodes
        (s,) nodes on the boundary, ascending; rows of answers follow them.
    surface_positions
        (s, 3) m, of the unloaded body.
    surface_faces, surface_triangles
        (k, 3 or 6) elements' faces on the boundary, and the flat triangles (t, 3) that they are drawn by; node indices,
        outward.
    touchable_nodes
        Surface nodes that may be touched, ascending.
    fixed_dofs, fixed_nodes
        Fixed dofs, 3 * node + axis, and nodes with any fixed component; ascending.

    """

    def __init__(self, core: _native.GreenCore, body: Body | None = None):
        self._core = core
        self.body = body
        hold(self.path, self)
        self.surface_nodes = core.surface_nodes.astype(np.int64)
        self.surface_positions = core.surface_positions.reshape(-1, 3)
        faces, width = core.surface_faces
        self.surface_faces = self.surface_nodes[faces.reshape(-1, width)]
        self.surface_triangles = self.surface_nodes[core.surface_triangles.reshape(-1, 3)]
        ranks = core.touch_ranks.astype(np.int64)
        self.touchable_nodes = self.surface_nodes[ranks]
        self.fixed_dofs = core.fixed_dofs.astype(np.int64)
        self.fixed_nodes = np.unique(self.fixed_dofs // 3)
        self._first_column = {int(n): 3 * i for i, n in enumerate(self.touchable_nodes)}
        self._surface_rank = {int(n): i for i, n in enumerate(self.surface_nodes)}

    def __repr__(self) -> str:
        touchable, surface = len(self.touchable_nodes), len(self.surface_nodes)
        modulus = "" if self.youngs_modulus is None else f", E = {self.youngs_modulus:.4g} Pa"
        file = "in memory" if self.path is None else str(self.path)
        return f"GreensFunction({surface} surface nodes, {touchable} touchable, {self.precision}{modulus}, {file})"

    @property
    def precision(self) -> str:
        """Stored number format, ``"f16"``, ``"f32"`` or ``"f64"``."""
        return self._core.precision

    @property
    def touch_error(self) -> float:
        """Estimated relative error of the force on a pressed node or patch: the largest of those probed."""
        return self._core.typical_errors[0]

    @property
    def stamp_error(self) -> float:
        """Estimated relative error of nodal forces under a stamp of eight nodes: the largest of those probed."""
        return self._core.typical_errors[1]

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

    @property
    def extents(self) -> np.ndarray:
        """Sides of the body's bounding box (3,), m."""
        return np.ptp(self.surface_positions, axis=0)

    @cached_property
    def surface_corners(self) -> np.ndarray:
        """Corners (t, 3) of the triangles as rows of what belongs to the surface nodes."""
        return self._core.surface_triangles.astype(np.int64).reshape(-1, 3)

    @cached_property
    def _surface_search(self) -> _native.SurfaceSearch:
        return _native.SurfaceSearch(self.surface_positions, self.surface_corners.astype(np.uint32))

    def closest_on_surface(self, points: np.ndarray) -> np.ndarray:
        """Find the closest points (n, 3), m, of the untouched surface to points (n, 3), m."""
        return self._surface_search.closest(np.asarray(points, dtype=float)).reshape(-1, 3)

    def is_thin_at(self, point: Sequence[float], normal: Sequence[float], thickness: float) -> bool:
        """Whether the body ends within a thickness, m, below a point (3,), m, of its surface with normal (3,)."""
        return self._surface_search.is_thin_at(point, normal, thickness)

    @cached_property
    def strain_measure(self) -> StrainMeasure:
        """Measure of the largest strain of answers: by elements; of a bare store or a large body, by the surface."""
        if not self.follows_inside:
            return self.surface_strain
        return ElementStrain(self.stress_recovery)

    @property
    def follows_inside(self) -> bool:
        """Whether poses are followed inside of the body: its elements are known, and not too many."""
        return self.body is not None and len(self.body.mesh.nodes) <= MOST_NODES_INSIDE

    @cached_property
    def stress_recovery(self) -> StressRecovery:
        """Recovery of stress and strain at the surface nodes.

        Raises
        ------
        BodyError
            A bare store: it does not know the elements.

        """
        if self.body is None:
            raise BodyError("a bare store knows only the surface: stress needs the elements of the body")
        return StressRecovery(self.body)

    @cached_property
    def stress_everywhere(self) -> StressRecovery:
        """Recovery of stress and strain at all nodes of the body, inner ones too.

        Raises
        ------
        BodyError
            A bare store: it does not know the elements.

        """
        interior = self.stress_recovery.interior
        assert self.body is not None
        return StressRecovery(self.body, np.arange(len(self.body.mesh.nodes)), interior)

    @cached_property
    def native_strain_measure(self) -> _native.StrainMeasure:
        """The same measure for the force loop, which limits strain."""
        measure = self.strain_measure
        if not isinstance(measure, ElementStrain):
            return _native.StrainMeasure.of_surface(self._core)
        operator = measure.recovery.strain_operator
        rows = operator.indptr.astype(np.int64), operator.indices.astype(np.uint32), operator.data
        return _native.StrainMeasure.of_elements(*rows, measure.recovery.interior.core)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the store; an existing file is replaced only when the new one is complete."""
        target = destination(Path(path), StoreError)
        remove_leftovers(target)
        self._core.save(target)

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, body: Body | None = None) -> GreensFunction:
        """Read a store and verify every block of it.

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
        require_file(path, StoreError)
        green = cls(_native.GreenCore.load(path), body)
        if body is not None:
            touch = None if len(green.touchable_nodes) == len(green.surface_nodes) else green.touchable_nodes
            problem = problem_arrays(body, touch)
            # Made with this format named, or chosen by the body.
            if green.key not in (_native.GreenCore.content_key(problem, name) for name in (None, green.precision)):
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
            free, or fixed by its support. Fixed nodes may be named: their support moves.
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
        PrecisionError
            An answer that may be wrong by more than 10 %; a :class:`palpate.PrecisionWarning` reports more than 1 %.

        """
        forced = self._by_column(forces, "forces", units.force)
        placed = self._by_column(displacements, "displacements", units.length)
        if isinstance(release, str) or not isinstance(release, Iterable):
            raise BodyError(f"release must be a list of fixed nodes, got {brief_repr(release)}")
        freed = {column for node in release for column in self._released_columns(node)}
        u, f, reactions, error = self._core.solve(forced, placed, freed)
        check_error(error, self.precision, "the answer", stacklevel=2)
        u, f = u.reshape(-1, 3), f.reshape(-1, 3)
        return Answer(u, f, self._reactions(f, reactions), error, self)

    def touch(
        self,
        point: Sequence[float | str],
        displacement: Components,
        radius: float | str = 0.0,
        *,
        on_surface: bool = True,
    ) -> Touch:
        """Press a patch of the surface.

        Parameters
        ----------
        point
            Contact point, m, on the unloaded body; the closest point of the surface is taken. Lengths may also be text
            with a unit, such as ``"4cm"``.
        displacement
            Weighted mean displacement of the patch from the unloaded shape, m; None leaves a component free.
        radius
            Contact radius, m; 0 is a point contact.
        on_surface
            Whether the point is meant to lie on the surface: one farther from it than the contact radius is refused.
            False takes the closest point, however far.

        A :class:`palpate.TouchWarning` says if the surface is strained by more than 30 %, where linear elasticity
        has no meaning.

        Raises
        ------
        BodyError
            A number that is not finite, a point that lies too far from the surface, a radius that is negative, larger
            than the body, or covers more nodes than a tick can weigh.
        UnitError
            Text that is no length.
        PrecisionError
            A force that may be wrong by more than 10 %; a :class:`palpate.PrecisionWarning` reports more than 1 %.

        """
        reach = units.length(radius)
        if not (np.isfinite(reach) and reach >= 0):
            raise BodyError(f"the contact radius must not be negative, got {reach:g} m")
        self._require_size(reach)
        target = three_numbers(point, "the touch point", BodyError, units.length)
        wanted = three_components(displacement, "displacement", BodyError, units.length)
        landed = self.closest_on_surface(np.array([target]))[0]
        distance = float(np.linalg.norm(landed - target))
        if on_surface and distance > max(reach, BESIDE * self.extents.max()):
            raise BodyError(
                f"the touch point lies {size_text([distance])} from the surface of the body, which is "
                f"{size_text(self.extents)}, from {brief(self.surface_positions.min(axis=0))} m on: give metres, or "
                f"text such as '4cm'; on_surface=False takes the closest point"
            )
        try:
            force, u, error = self._core.touch(target, wanted, reach)
        except BodyError:
            if self.accepts_contact_radius(reach):
                raise
            raise self._too_wide(reach) from None
        check_error(error, self.precision, "the touch", stacklevel=2)
        touch = Touch(np.array(force), u.reshape(-1, 3), landed, distance, error, self)
        strain = self.surface_strain.largest(touch.displacements)
        if not strain <= STRAIN_LIMIT:
            warnings.warn(
                f"the touch strains the surface by {100 * strain:.0f} %, beyond the limit of {100 * STRAIN_LIMIT:.0f} %"
                f": linear elasticity has no meaning there; press less deep, or with a larger radius",
                TouchWarning,
                stacklevel=2,
            )
        return touch

    @cached_property
    def surface_strain(self) -> SurfaceStrain:
        """Measure of the strain in the plane of the surface: it needs no elements, and takes little time."""
        return SurfaceStrain(self.surface_positions, np.searchsorted(self.surface_nodes, self.surface_faces))

    @cached_property
    def edge_length(self) -> float:
        """Median edge of the triangles of the surface, m."""
        corners = self.surface_positions[self.surface_corners]
        return float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))

    def _require_size(self, radius: float) -> None:
        """Refuse a contact radius that cannot be meant for this body."""
        if radius > self.extents.max():
            raise BodyError(
                f"the contact radius of {radius:.4g} m is larger than the body, which is {size_text(self.extents)}: "
                f"give metres, or text such as '5mm'"
            )

    def _too_wide(self, radius: float) -> BodyError:
        largest = 1e3 * self.largest_contact_radius(radius)
        return BodyError(
            f"a contact radius of {1e3 * radius:.4g} mm covers more nodes than a touch can weigh: give a radius of "
            f"at most {largest:.3g} mm (--radius), or make the mesh coarser"
        )

    def accepts_contact_radius(self, radius: float) -> bool:
        """Whether contacts of a radius, m, can be weighed everywhere on the surface."""
        return self._core.accepts_contact_radius(float(radius))

    def largest_contact_radius(self, limit: float) -> float:
        """Largest contact radius up to ``limit`` (m) that can be weighed everywhere, to about a hundredth."""
        return self._core.largest_contact_radius(float(limit))

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

    def _by_column(self, values: Mapping[int, Components] | None, argument: str, read: Reader) -> dict[int, float]:
        """Given components by column of the operator."""
        columns = {}
        if not isinstance(values, Mapping | None):
            raise BodyError(f"{argument} must map nodes to three components, such as {{7: (None, None, -1e-3)}}")
        for node, components in (values or {}).items():
            first = self._column(node, argument)
            for axis, value in enumerate(three_components(components, f"{argument}: node {node}", BodyError, read)):
                if value is not None:
                    columns[first + axis] = value
        return columns

    def _column(self, node: int, argument: str) -> int:
        try:
            return self._first_column[operator.index(node)]
        except (KeyError, TypeError):
            raise BodyError(f"{argument}: node {node} is not touchable") from None

    def _released_columns(self, node: int) -> list[int]:
        """Columns of the fixed components of a node whose support is taken away."""
        if not isinstance(node, (int, np.integer)) or not np.isin(node, self.fixed_nodes):
            raise BodyError(f"release: node {node} is not fixed")
        if int(node) not in self._surface_rank:
            raise BodyError(f"release: fixed node {node} lies inside the body; only surface nodes can be released")
        first = self._column(node, "release")
        return list(range(first, first + 3))


def require_precise(green: GreensFunction, what: str) -> None:
    """Refuse a store in which touches may be wrong by more than 10 %, and warn of 1 %: before a loop runs on it.

    The PrecisionError and the warning say that ``what`` would be wrong.
    """
    check_error(green.touch_error, green.precision, what, stacklevel=2)


def _difference(green: GreensFunction, body: Body) -> str:
    """First thing in which a store and a body are seen to differ."""
    stored, now = green.description, description(body)
    for name in ("element", "nodes", "tets", "surface_nodes", "fixed_nodes", "materials", "load_N"):
        if stored.get(name) != now[name]:
            return f"was made for another body ({name.replace('_', ' ')}: {stored.get(name)} there, {now[name]} here)"
    if not np.array_equal(green.fixed_dofs, body.fixed_dofs):
        return "was made for another body (other nodes are fixed)"
    if not np.array_equal(green._core.loads, problem_arrays(body, None)[-1]):
        return "was made for another body (other loads)"
    return "was made for another body (node positions or elements differ)"
