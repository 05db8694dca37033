"""A mesh with materials and supports: what the finite element method solves."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
import scipy

from palpate.body.assembly import element_arrays, mass_matrix, stiffness_matrix
from palpate.body.loads import Loads
from palpate.body.material import Material, element_laws, material_rows, warn_of_locking
from palpate.body.mechanism import find_mechanism
from palpate.body.overlap import require_apart
from palpate.body.supports import Fixed, element_components, fixed_mask, rigid_constraint_rank
from palpate.errors import BodyError
from palpate.mesh import TetMesh
from palpate.units import brief_repr
from palpate.vectors import place_text


class Body:
    """A supported elastic body.

    Parameters
    ----------
    mesh
        The tetrahedra.
    material
        One :class:`Material`, or one for each region of the mesh, by number or name.
    fixed
        Supported nodes: a predicate such as ``"z < min + 1mm"``, indices, an (n,) mask, an (n, 3) mask of components,
        ``{"z": indices}``, a function of the (n, 3) node positions that returns a mask, or None for a body without
        supports.
    loads
        What acts on it at rest, before it is touched: weight, pressure, forces.

    Attributes
    ----------
    element_materials
        (m, 3) Young's modulus, Pa, Poisson's ratio, and density, kg/m^3, of each element.
    fixed_mask
        (n, 3) whether each component is fixed.

    Raises
    ------
    BodyError
        What is no mesh, an index out of range, a mask of the wrong length, supports that hold no node, a region without
        a material.

    """

    def __init__(
        self,
        mesh: TetMesh,
        *,
        material: Material | Mapping[int | str, Material],
        fixed: Fixed = None,
        loads: Loads | None = None,
    ):
        if not isinstance(mesh, TetMesh):
            raise BodyError(
                f"mesh must be a palpate.TetMesh, got {brief_repr(mesh)}: read a volume mesh by palpate.TetMesh.read, "
                "fill a surface by palpate.tetrahedralize"
            )
        self.mesh = mesh
        self.material = material
        self.element_materials = material_rows(mesh, material)
        warn_of_locking(mesh, self.element_materials[:, 1].max())
        mask = fixed_mask(mesh.nodes, fixed)
        mask.setflags(write=False)
        self.fixed_mask = mask
        self.loads = loads

    def __repr__(self) -> str:
        mesh, fixed = self.mesh, len(self.fixed_nodes)
        materials = 1 if isinstance(self.material, Material) else len(self.material)
        counts = f"{len(mesh.nodes)} nodes, {len(mesh.tets)} {mesh.tets.shape[1]}-node tets"
        return f"Body({counts}, {materials} material{'s' if materials > 1 else ''}, {fixed} nodes fixed)"

    @cached_property
    def is_hyperelastic(self) -> bool:
        """Whether a material of it has a law beyond small strain."""
        return any(name != "linear" for name, *_ in element_laws(self.mesh, self.material)[0])

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
        return stiffness_matrix(self.mesh, self.element_materials)

    def mass(self, *, lumped: bool = False) -> scipy.sparse.csc_array:
        """Mass matrix of all dofs, (3n, 3n), kg; consistent, or lumped to the diagonal."""
        return mass_matrix(self.mesh, self.element_materials, lumped=lumped)

    def load_vector(self) -> np.ndarray:
        """Turn the reference loads into nodal forces, (n, 3) N; what falls on a support goes straight into it.

        Raises
        ------
        BodyError
            A node that does not exist, or a part of the surface without faces.

        """
        if self.loads is None:
            return np.zeros((len(self.mesh.nodes), 3))
        return self.loads.nodal(self.mesh, self.element_materials)

    def _element_arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return element_arrays(self.mesh, self.element_materials)

    def require_supported(self) -> None:
        """Refuse a body that could move without deforming, or two in one place.

        Raises
        ------
        BodyError
            No support, nothing left free, or a part of the body that its supports, or hinges and balls between parts,
            leave free to move; with its place.

        """
        if not self.fixed_mask.any():
            raise BodyError(
                "the body has no support, so a touch would move it away: fix at least three nodes that are not in line"
            )
        if self.fixed_mask.all():
            raise BodyError("every node is fixed, so nothing can deform: leave some nodes free")
        labels = element_components(self.mesh.tets, len(self.mesh.nodes))
        require_apart(self.mesh, labels)
        for part in np.unique(labels):
            members = np.flatnonzero(labels == part)
            rank = rigid_constraint_rank(self.mesh.nodes[members], self.fixed_mask[members])
            if rank < 6:
                supports = "no support" if rank == 0 else f"supports that leave {6 - rank} rigid motions free"
                place = place_text(self.mesh.nodes[members[0]])
                raise BodyError(
                    f"the part of {len(members)} nodes around node {members[0]} at {place} has {supports}: "
                    "fix at least three of its nodes that are not in line"
                )
        mechanism = find_mechanism(self.mesh, self.fixed_mask)
        if mechanism is not None:
            raise BodyError(mechanism.message(self.mesh.nodes, len(self.mesh.nodes)))
