"""Reference loads of a body: forces that act on it without contact.

All become nodal forces by the shape functions, `F_i = int N_i b dV + int N_i t dA`, the forces that do the same work as
the load itself on any displacement that the elements can take.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from palpate import units
from palpate.body.assembly import mass_matrix
from palpate.body.selection import Selection, node_indices, selected_nodes
from palpate.equality import ComparedByValue
from palpate.errors import BodyError
from palpate.mesh import TetMesh
from palpate.mesh.shape_functions import surface_integrals
from palpate.vectors import number, three_numbers

# A body in a fast centrifuge; beyond it the number was meant in cm/s^2 or mm/s^2.
MOST_GRAVITY = 300.0


@dataclass(frozen=True, eq=False)
class Loads(ComparedByValue):
    """Loads that act on a body at rest.

    Numbers are SI, and any of them may be text with a unit, such as ``"200Pa"``.
    A part of the surface is named by node indices, an (n,) mask or a function of the (n, 3) positions; a face carries
    the load if all of its corners are named.

    Parameters
    ----------
    gravity
        Acceleration (3,), m/s^2; each element weighs by its material's density.
    pressure
        Pairs of a part of the surface and a pressure, Pa; positive pushes into the body.
    spread
        Pairs of a part of the surface and a total force (3,), N, spread evenly over its area.
    forces
        Force (3,), N, on single nodes, inside too.

    Raises
    ------
    BodyError
        A number that is not finite, a wrong length, or a gravity beyond 300 m/s^2.
    UnitError
        Text that is no quantity.

    """

    gravity: Sequence[float] = (0.0, 0.0, 0.0)
    pressure: Sequence[tuple[Selection, float]] = ()
    spread: Sequence[tuple[Selection, Sequence[float]]] = ()
    forces: Mapping[int, Sequence[float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        gravity = three_numbers(self.gravity, "gravity", BodyError, units.acceleration)
        mistake = gravity_error(gravity)
        if mistake is not None:
            raise BodyError(mistake)
        object.__setattr__(self, "gravity", gravity)
        pairs = _pairs(self.pressure, "pressure")
        pressure = [(where, number(units.pressure(value), "pressure", BodyError)) for where, value in pairs]
        pairs = _pairs(self.spread, "spread")
        spread = [(where, three_numbers(force, "spread", BodyError, units.force)) for where, force in pairs]
        if not isinstance(self.forces, Mapping):
            raise BodyError("forces must map nodes to forces, such as {7: (0, 0, -1)}")
        forces = {
            node: three_numbers(force, f"forces: node {node}", BodyError, units.force)
            for node, force in self.forces.items()
        }
        object.__setattr__(self, "pressure", tuple(pressure))
        object.__setattr__(self, "spread", tuple(spread))
        object.__setattr__(self, "forces", forces)

    def nodal(self, mesh: TetMesh, materials: np.ndarray) -> np.ndarray:
        """Nodal forces on the nodes of a mesh, (n, 3) N.

        Parameters
        ----------
        mesh
            Of the body.
        materials
            (m, 3) Young's modulus, Pa, Poisson's ratio, and density, kg/m^3, of each element.

        Raises
        ------
        BodyError
            A node that does not exist, or a part of the surface without faces.

        """
        nodes = mesh.nodes
        total = np.zeros((len(nodes), 3))
        if any(self.gravity):
            # The row sums of the consistent mass are int rho N_i dV.
            total += (mass_matrix(mesh, materials) @ np.tile(self.gravity, len(nodes))).reshape(-1, 3)
        for where, value in self.pressure:
            faces = _faces_of(mesh, where, "pressure")
            _, along_normal = surface_integrals(nodes, faces)
            np.add.at(total, faces, -value * along_normal)
        for where, force in self.spread:
            faces = _faces_of(mesh, where, "spread")
            areas, _ = surface_integrals(nodes, faces)
            np.add.at(total, faces, areas[:, :, None] / areas.sum() * np.array(force))
        for node, force in self.forces.items():
            total[node_indices([node], len(nodes), "forces")] += force
        return total


def _faces_of(mesh: TetMesh, where: Selection, what: str) -> np.ndarray:
    """Boundary faces with all corners in a set of nodes, (k, 3 or 6), outward."""
    chosen = np.zeros(len(mesh.nodes), dtype=bool)
    chosen[selected_nodes(where, mesh.nodes, what)] = True
    faces = mesh.surface_faces
    faces = faces[chosen[faces[:, :3]].all(axis=1)]
    if len(faces) == 0:
        raise BodyError(f"{what}: no face of the surface has all of its corners among the given nodes: name more nodes")
    return faces


def _pairs(given: Any, what: str) -> list[tuple[Selection, Any]]:
    try:
        return [(where, value) for where, value in given]
    except (TypeError, ValueError):
        raise BodyError(f"{what} takes pairs of a part of the surface and a load") from None


def gravity_error(gravity: Sequence[float]) -> str | None:
    """Say what is wrong with an acceleration, m/s^2, that no body on earth feels; None for any other."""
    size = float(np.linalg.norm(gravity))
    if size <= MOST_GRAVITY:
        return None
    return (
        f"gravity of {size:.4g} m/s^2 is {size / 9.81:.3g} times that of the earth: give it in m/s^2, "
        f"such as '-9.81m/s^2'"
    )
