"""A ball hidden in a block, pressed by a sphere above it, solved directly on a mesh whose faces follow the ball.

A quarter of the block, half of it where the ball lies aside, or all of it, from NETGEN's own solids: the steps that a
ball has on a lattice change the force by two points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.body import Material
from palpate.mesh import TetMesh
from palpate.validation.verify.benchmark import green_of, quiet_body
from palpate.validation.verify.contact import tools
from palpate.validation.verify.contact.signorini import ContactProblem

MM = 1e-3
# Size of the elements far away, in the ball, and under the sphere, mm.
FAR, IN_BALL, UNDER = 8.0, 2.2, 1.1


@dataclass(frozen=True)
class HiddenBall:
    """A ball in a block of half-width and height ``size``, m, that is glued at its bottom.

    Depth of the centre and radius, m; the centre, and the block's, lies ``aside`` of the sphere along x and y, m.
    """

    depth: float
    radius: float
    aside: tuple[float, float] = (0.0, 0.0)
    size: float = 0.04

    def mesh(self, reach: float) -> TetMesh:
        """Return the part with the origin under the sphere; regions 0 and 1, the ball, of its volume."""
        mesh = self._mesh(reach, self.radius)
        corners = mesh.nodes[mesh.tets[mesh.regions == 1][:, :4]]
        found = self._parts * np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6
        # Its flat faces lie within the ball.
        return self._mesh(reach, self.radius * (4 / 3 * np.pi * self.radius**3 / found) ** (1 / 3))

    @property
    def _parts(self) -> int:
        """How many of what is meshed make the block."""
        return 2 ** self.aside.count(0.0)

    def _mesh(self, reach: float, radius: float) -> TetMesh:
        from netgen.csg import CSGeometry, Plane, Pnt, Sphere, Vec
        from netgen.meshing import MeshingParameters

        size, reach, aside = self.size / MM, reach / MM, [offset / MM for offset in self.aside]
        # Of a block that lies evenly about the sphere one side is meshed.
        low = [0.0 if offset == 0 else offset - size for offset in aside]
        corners = {-1: Pnt(*low, -size), 1: Pnt(*(offset + size for offset in aside), 0)}
        planes = [Plane(corners[side], Vec(*(side * np.eye(3)[axis]))) for axis in range(3) for side in corners]
        block = planes[0]
        for plane in planes[1:]:
            block = block * plane
        ball = Sphere(Pnt(*aside, -self.depth / MM), radius / MM)
        geometry = CSGeometry()
        geometry.Add(block - ball)
        geometry.Add((block * ball).maxh(IN_BALL))
        parameters = MeshingParameters(maxh=FAR, grading=0.5)
        for x in np.arange(max(low[0], -reach), reach, 0.5):
            for y in np.arange(max(low[1], -reach), reach, 0.5):
                parameters.RestrictH(x, y, 0, UNDER)
        volume_mesh = geometry.GenerateMesh(mp=parameters)
        nodes = np.array([point.p for point in volume_mesh.Points()]) * MM
        elements = volume_mesh.Elements3D().NumPy()
        tets = elements["nodes"][:, [0, 2, 1, 3]].astype(np.int64) - 1
        return TetMesh(nodes, tets, elements["index"].astype(np.int64) - 1).to_quadratic()

    def pressed(self, radius: float, depths: Sequence[float], soft: Material, moduli: Sequence[float]) -> np.ndarray:
        """Solve for forces (len(moduli), len(depths)), N, on a sphere, m deep, for balls of moduli, Pa."""
        reach = 1.35 * np.sqrt(radius * max(depths))
        mesh = self.mesh(reach)
        fixed = np.zeros(mesh.nodes.shape, dtype=bool)
        # Planes of symmetry.
        for axis in (axis for axis in range(2) if self.aside[axis] == 0):
            fixed[:, axis] = np.abs(mesh.nodes[:, axis]) < 1e-9
        fixed[mesh.nodes[:, 2] < -self.size + 1e-9] = True
        touch = np.flatnonzero((np.abs(mesh.nodes[:, 2]) < 1e-9) & (np.abs(mesh.nodes[:, :2]) < reach).all(axis=1))
        forces = []
        for modulus in moduli:
            material = {0: soft, 1: Material(modulus, soft.poissons_ratio)}
            problem = ContactProblem.on_top(green_of(quiet_body(mesh, material, fixed), touch=touch), mesh)
            forces.append([self._parts * press.force for press in problem.press(tools.sphere(radius), depths)])
        return np.array(forces)
