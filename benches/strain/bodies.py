"""Bodies that the law at large strain is measured on, with forces of full Newton's method.

Cylinders have forces of fine axisymmetric elements (`strain-references`). The others are solved on their own mesh, so
that both have the same elements.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import palpate
from benches.strain.cylinders import RADIUS, references
from benches.strain.materials import NeoHookean
from benches.strain.refined import refined
from benches.strain.solid import Solid
from palpate.mesh.triangles import node_normals
from palpate.validation.verify.contact.reference import graded
from palpate.validation.verify.grids import lattice, mapped

MODULUS, POISSON = 10e3, 0.45
# Forces of full solutions on the meshes of the bodies below.
SOLVED = Path(__file__).with_name("solid_forces.json")
# Edges of elements below the sphere, m, and distance up to which they are that fine.
CELL, FINE = 0.004, 0.012
# Longest edges of the liver's elements below the sphere, and distance up to which they are that fine, m. With edges of
# 4.6 mm full solutions scatter by 4 % from one depth to the next.
LIVER_EDGE, LIVER_FINE = 0.0021, 0.008


@dataclass(frozen=True)
class Pressed:
    """A neo-Hookean body, the place where a sphere of 10 mm presses it, and depths, m.

    Attributes
    ----------
    name, mesh, held, poisson
        10-node elements; mask (n, 3) of what is held.
    place, normal
        Point of the surface, m, and its outward normal.
    depths
        Ascending, m.
    forces
        Of full Newton's method, N; None: they are solved on the mesh.

    """

    name: str
    mesh: palpate.TetMesh
    held: np.ndarray
    place: np.ndarray
    normal: np.ndarray
    depths: np.ndarray
    poisson: float = POISSON
    forces: np.ndarray | None = None

    def body(self, law: str) -> palpate.Body:
        """Return the body with a law."""
        return palpate.Body(self.mesh, material=palpate.Material(MODULUS, self.poisson, law=law), fixed=self.held)

    def full(self) -> np.ndarray:
        """Return forces along the normal, N, down to where Newton's method converges; stored beside this file.

        Raises
        ------
        RuntimeError
            It does not converge at the first depth.

        """
        if self.forces is not None:
            return self.forces
        asked = {"nodes": len(self.mesh.nodes), "depths": self.depths.tolist()}
        found = _stored().get(self.name, {})
        if {key: found.get(key) for key in asked} != asked:
            found = {**asked, "forces": self._solved()}
            SOLVED.write_text(json.dumps({**_stored(), self.name: found}, indent=1) + "\n")
        return np.array(found["forces"])

    def _solved(self) -> list[float]:
        solid = Solid(self.mesh, NeoHookean(MODULUS, self.poisson), self.held.all(axis=1))
        found = [round(force, 6) for force in solid.pressed(self.place, self.normal, RADIUS, self.depths)]
        if not found:
            # An empty row would count as one without an error.
            raise RuntimeError(f"{self.name}: Newton's method does not converge at {1e3 * self.depths[0]:g} mm")
        return found


def _stored() -> dict[str, dict]:
    return json.loads(SOLVED.read_text()) if SOLVED.exists() else {}


def cylinders(cell: float = CELL) -> Iterator[Pressed]:
    """Return blocks of 25 and 50 mm on a smooth table, bonded layers and columns, a plate held at its rim."""
    for case in references(cell):
        if case.name.startswith("random"):
            continue
        body = case.body()
        held = np.zeros((len(body.mesh.nodes), 3), bool)
        held.ravel()[body.fixed_dofs] = True
        up = np.array([0.0, 0.0, 1.0])
        yield Pressed(
            case.name, body.mesh, held, 0.0 * up, up, np.array(case.depths), case.nu, forces=np.array(case.forces)
        )


def _cuboid(name: str, axes: list[np.ndarray], is_held: str, place: tuple[float, float], depths: np.ndarray) -> Pressed:
    mesh = mapped(lattice(*axes), quadratic=True)
    x, _, z = mesh.nodes.T
    held = {
        "bottom": z < 1e-9,
        "left": x < 1e-9,
        "both ends": (x < 1e-9) | (x > axes[0][-1] - 1e-9),
    }[is_held]
    top = np.array([*place, axes[2][-1]])
    return Pressed(name, mesh, np.repeat(held[:, None], 3, axis=1), top, np.array([0.0, 0.0, 1.0]), depths)


def _divided(ends: np.ndarray, centre: float, reach: float) -> np.ndarray:
    """Divide the cells between some ends in two where they are within a distance of a place."""
    near = (ends[:-1] < centre + reach - 1e-9) & (ends[1:] > centre - reach + 1e-9)
    return np.sort(np.concatenate([ends, 0.5 * (ends[:-1] + ends[1:])[near]]))


def cuboids() -> Iterator[Pressed]:
    """Return a cantilever, a plate clamped at two sides and a block beside its edge, finer below the sphere."""
    equal = np.linspace
    axes = [_divided(equal(0, 0.1, 21), 0.08, 0.005), *(_divided(equal(0, 0.02, 5), at, 0.005) for at in (0.01, 0.02))]
    yield _cuboid("cantilever", axes, "left", (0.08, 0.01), np.array([0.005, 0.01, 0.02]))
    across = 0.03 + graded(-0.03, 0.03, 0.0, FINE, 0.006)
    axes = [
        _divided(equal(0, 0.1, 19), 0.05, 0.009),
        _divided(across, 0.03, 0.009),
        _divided(equal(0, 0.01, 4), 0.01, 0.003),
    ]
    yield _cuboid("plate at two sides", axes, "both ends", (0.05, 0.03), np.array([0.005, 0.01, 0.015]))
    beside = 0.012
    axes = [
        _divided(graded(0.0, 0.06, beside, FINE, CELL), beside, 0.008),
        _divided(0.03 + graded(-0.03, 0.03, 0.0, FINE, CELL), 0.03, 0.008),
        _divided(0.03 - graded(0.0, 0.03, 0.0, FINE, CELL)[::-1], 0.03, 0.008),
    ]
    yield _cuboid("12 mm from an edge", axes, "bottom", (beside, 0.03), np.array([0.003, 0.006, 0.009]))


def liver(places: int) -> Iterator[Pressed]:
    """Press the built-in liver at nodes of the side that it does not lie on, with finer elements below the sphere.

    The law is measured on them, and on the liver's own elements, which are too large for a full solution.
    """
    mesh = palpate.models.liver()
    rng = np.random.default_rng(5)
    normals = node_normals(mesh.nodes, mesh.surface_triangles)
    corners = np.unique(mesh.tets[:, :4])
    front = mesh.surface_nodes[normals[mesh.surface_nodes, 1] < -0.7]
    upper = np.intersect1d(front, corners)
    depths = np.array([0.005, 0.01, 0.015])
    for node in rng.choice(upper, places, replace=False):
        place, normal = mesh.nodes[node], normals[node]
        finer = refined(mesh, place, LIVER_EDGE, LIVER_FINE)
        case = Pressed(f"liver, node {node}", finer, _lying(finer), place, normal, depths)
        yield case
        yield replace(case, name=f"{case.name}, own elements", mesh=mesh, held=_lying(mesh), forces=case.full())


def _lying(liver: palpate.TetMesh) -> np.ndarray:
    """Return what is held of a liver that lies on its back, as in the demo."""
    return np.repeat((liver.nodes[:, 1] > 0.02)[:, None], 3, axis=1)
