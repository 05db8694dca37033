"""A mesh with materials and supports: what the finite element method solves."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import connected_components

from palpate import _native
from palpate.errors import BodyError, LockingWarning
from palpate.loads import Loads
from palpate.selection import node_indices

if TYPE_CHECKING:
    from palpate.mesh import TetMesh

# Largest Poisson's ratio without volumetric locking to speak of, by nodes an element: 4-node tetrahedra cannot keep
# their volume without keeping their shape; 10-node ones can until the conditioning of K gives out.
LOCKING = {4: 0.45, 10: 0.499}

AXES = {"x": 0, "y": 1, "z": 2}

Fixed = Sequence[int] | np.ndarray | Mapping[str, Sequence[int]] | Callable[[np.ndarray], np.ndarray] | None


@dataclass(frozen=True)
class Material:
    """Isotropic linear elastic material.

    Parameters
    ----------
    youngs_modulus
        Pa, positive.
    poissons_ratio
        In (-1, 0.5). Nearly incompressible materials make elements lock: 4-node tetrahedra above about 0.45, 10-node
        ones hardly; a :class:`palpate.LockingWarning` says so.
    density
        kg/m^3.

    """

    youngs_modulus: float
    poissons_ratio: float
    density: float = 1000.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.youngs_modulus) and self.youngs_modulus > 0):
            raise BodyError(f"Young's modulus must be positive, got {self.youngs_modulus} Pa")
        if not -1 < self.poissons_ratio < 0.5:
            raise BodyError(f"Poisson's ratio must lie in (-1, 0.5), got {self.poissons_ratio}")
        if not (np.isfinite(self.density) and self.density >= 0):
            raise BodyError(f"density must not be negative, got {self.density} kg/m^3")


class Body:
    """A supported elastic body.

    Parameters
    ----------
    mesh
        The tetrahedra.
    material
        One :class:`Material`, or one for each region of the mesh, by number or name.
    fixed
        Supported nodes: indices, an (n,) mask, an (n, 3) mask of components, ``{"z": indices}``, a function of
        the (n, 3) node positions that returns a mask, or None for a body without supports.
    loads
        What acts on it at rest, before it is touched: weight, pressure, forces.

    Raises
    ------
    BodyError
        An index out of range, a mask of the wrong length, a region without a material.

    """

    def __init__(
        self,
        mesh: TetMesh,
        *,
        material: Material | Mapping[int | str, Material],
        fixed: Fixed = None,
        loads: Loads | None = None,
    ):
        self.mesh = mesh
        self.material = material
        self._material_rows = _material_rows(mesh, material)
        _warn_of_locking(mesh, self._material_rows[:, 1].max())
        mask = _fixed_mask(mesh.nodes, fixed)
        mask.setflags(write=False)
        self.fixed_mask = mask
        self.loads = loads

    @property
    def fixed_nodes(self) -> np.ndarray:
        """Nodes with any fixed component, ascending (f,)."""
        return np.flatnonzero(self.fixed_mask.any(axis=1))

    @property
    def fixed_dofs(self) -> np.ndarray:
        """Fixed dofs, 3 * node + axis, ascending."""
        return np.flatnonzero(self.fixed_mask.ravel())

    def stiffness(self) -> scipy.sparse.csc_array:
        """Stiffness matrix of all dofs, (3n, 3n), N/m."""
        return self._csc(_native.stiffness(*self._element_arrays()))

    def mass(self, *, lumped: bool = False) -> scipy.sparse.csc_array:
        """Mass matrix of all dofs, (3n, 3n), kg; consistent, or lumped to the diagonal."""
        return self._csc(_native.mass(*self._element_arrays(), lumped))

    def load_vector(self) -> np.ndarray:
        """Turn the reference loads into nodal forces, (n, 3) N; what falls on a support goes straight into it.

        Raises
        ------
        BodyError
            A node that does not exist, or a part of the surface without faces.

        """
        return np.zeros((len(self.mesh.nodes), 3)) if self.loads is None else self.loads.nodal(self)

    def _csc(self, arrays: tuple[np.ndarray, np.ndarray, np.ndarray]) -> scipy.sparse.csc_array:
        start, rows, values = arrays
        size = 3 * len(self.mesh.nodes)
        return scipy.sparse.csc_array((values, rows.astype(np.int64), start), shape=(size, size))

    def _element_arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        nodes = np.ascontiguousarray(self.mesh.nodes, dtype=np.float64)
        return nodes, np.ascontiguousarray(self.mesh.tets, dtype=np.uint32), self._material_rows

    def require_supported(self) -> None:
        """Refuse a body that could move without deforming.

        Raises
        ------
        BodyError
            No support, nothing left free, or a part of the body that its supports do not hold.

        """
        if not self.fixed_mask.any():
            raise BodyError("the body has no support: fix some nodes, or it flies away when touched")
        if self.fixed_mask.all():
            raise BodyError("every node is fixed: nothing is left to deform")
        labels = element_components(self.mesh.tets, len(self.mesh.nodes))
        for part in np.unique(labels):
            members = np.flatnonzero(labels == part)
            rank = _rigid_constraint_rank(self.mesh.nodes[members], self.fixed_mask[members])
            if rank < 6:
                held = "no support" if rank == 0 else f"supports that leave {6 - rank} rigid motions free"
                raise BodyError(
                    f"the part of {len(members)} nodes around node {members[0]} has {held}: "
                    "fix at least three of its nodes that are not in line"
                )


def element_components(tets: np.ndarray, node_count: int) -> np.ndarray:
    """Label of the connected part each node belongs to, (n,)."""
    first = np.repeat(tets[:, 0], tets.shape[1] - 1)
    graph = scipy.sparse.coo_array(
        (np.ones(len(first), dtype=np.int8), (first, tets[:, 1:].ravel())), shape=(node_count, node_count)
    )
    return connected_components(graph, directed=False)[1]


def _rigid_constraint_rank(nodes: np.ndarray, mask: np.ndarray) -> int:
    """How many of the six rigid motions the fixed components prevent."""
    where, axis = np.nonzero(mask)
    if len(where) == 0:
        return 0
    size = max(float(np.ptp(nodes, axis=0).max()), 1e-30)
    arm = (nodes[where] - nodes.mean(axis=0)) / size
    direction = np.eye(3)[axis]
    rows = np.hstack([direction, np.cross(arm, direction)])
    return int(np.linalg.matrix_rank(rows.T @ rows, tol=1e-10 * len(where)))


def _material_rows(mesh: TetMesh, material: Material | Mapping[int | str, Material]) -> np.ndarray:
    """Young's modulus, Poisson's ratio and density of each element, (m, 3)."""
    if isinstance(material, Material):
        table = {int(region): material for region in np.unique(mesh.regions)}
    else:
        table = {_region_number(mesh, region): m for region, m in material.items()}
    missing = sorted(set(np.unique(mesh.regions).tolist()) - set(table))
    if missing:
        names = {number: name for name, number in mesh.region_names.items()}
        region = names.get(missing[0], missing[0])
        raise BodyError(f"region {region} of the mesh has no material; given are {', '.join(map(str, material))}")
    rows = np.empty((len(mesh.tets), 3))
    for region, m in table.items():
        rows[mesh.regions == region] = (m.youngs_modulus, m.poissons_ratio, m.density)
    return rows


def _region_number(mesh: TetMesh, region: int | str) -> int:
    if not isinstance(region, str):
        return int(region)
    if region not in mesh.region_names:
        known = ", ".join(mesh.region_names) or "none"
        raise BodyError(f"the mesh has no region called '{region}'; it has {known}")
    return mesh.region_names[region]


def _warn_of_locking(mesh: TetMesh, poissons_ratio: float) -> None:
    count = mesh.tets.shape[1]
    if poissons_ratio <= LOCKING[count]:
        return
    remedy = "10-node ones (mesh.to_quadratic()), " if count == 4 else ""
    warnings.warn(
        f"volumetric locking: {count}-node tetrahedra are too stiff at Poisson's ratio {poissons_ratio:g}, above "
        f"{LOCKING[count]}; {remedy}a smaller ratio or a finer mesh help",
        LockingWarning,
        stacklevel=3,
    )


def _fixed_mask(nodes: np.ndarray, fixed: Fixed) -> np.ndarray:
    count = len(nodes)
    mask = np.zeros((count, 3), dtype=bool)
    if fixed is None:
        return mask
    if callable(fixed):
        fixed = np.asarray(fixed(nodes))
        if fixed.shape not in {(count,), (count, 3)} or fixed.dtype != bool:
            raise BodyError(f"the function for fixed must return a boolean mask of length {count}")
    if isinstance(fixed, Mapping):
        for name, nodes_of_axis in fixed.items():
            if name not in AXES:
                raise BodyError(f"unknown axis '{name}' in fixed: use 'x', 'y' or 'z'")
            mask[node_indices(nodes_of_axis, count, "fixed"), AXES[name]] = True
        return mask
    array = np.asarray(fixed)
    if array.dtype == bool:
        if array.shape == (count, 3):
            return array.copy()
        if array.shape == (count,):
            mask[array] = True
            return mask
        raise BodyError(f"a mask for fixed must have length {count}, got shape {array.shape}")
    mask[node_indices(array, count, "fixed")] = True
    return mask
