"""Cylinders of 10-node elements that a sphere presses in the middle, as the axisymmetric reference solver has them."""

from __future__ import annotations

import itertools
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import palpate
from benches.strain.axisymmetric import top_height, with_curved_top
from palpate.scene import BuiltScene, Scene
from palpate.scene.series import with_series
from palpate.simulation import Simulation
from palpate.validation.verify.contact.loop import UNLIMITED, sphere
from palpate.validation.verify.contact.reference import graded

RADIUS = 0.01
REFERENCES = Path(__file__).parents[2] / "tests/data/large_strain.json"
# Tetrahedra of a cuboid, by its corners 4 x + 2 y + z.
CUBOID = ((0, 4, 6, 7), (0, 4, 7, 5), (0, 5, 7, 1), (0, 6, 2, 7), (0, 2, 3, 7), (0, 3, 1, 7))
# Distance from the middle up to which elements are fine, over the sphere's radius.
REACH = 1.6
# Longest edges of elements, m, and radius of the part of the top that may be touched.
EDGE, TOUCHED = 0.012, 0.036
LAWS = {
    "neo-hookean": {},
    # Constants over c10 + c01 of the references.
    "mooney-rivlin": {"c10": 0.5, "c01": 0.5},
    "yeoh": {"c10": 1.0, "c20": 0.5},
}


@dataclass(frozen=True)
class Cylinder:
    """A cylinder on a table, bonded below, or held at its rim, with forces of full Newton's method; top at z = 0."""

    name: str
    radius: float
    height: float
    nu: float
    support: str
    law: str
    depths: list[float]
    forces: list[float]
    # Curvature of the top at its middle, 1/m.
    curvature: float = 0.0
    # Edges of elements below the sphere, m; None: equal elements of EDGE.
    cell: float | None = None

    def material(self, modulus: float = 10e3) -> palpate.Material:
        """Return its material."""
        half = modulus / (4.0 * (1.0 + self.nu))
        constants = {name: half * value for name, value in LAWS[self.law].items()}
        given = {"youngs_modulus": modulus} if self.law == "neo-hookean" else {}
        return palpate.Material(poissons_ratio=self.nu, law=self.law, **given, **constants)

    def mesh(self) -> palpate.TetMesh:
        """Return 10-node elements that follow the circle at the rim and the top."""
        mesh = self.corner_mesh().to_quadratic()
        r = np.hypot(*mesh.nodes.T[:2])
        return palpate.TetMesh(with_curved_top(mesh.nodes, r, self.curvature), mesh.tets)

    def corner_mesh(self) -> palpate.TetMesh:
        """Return the same as 4-node elements."""
        axis, z = self._axes()
        x, y = np.meshgrid(axis, axis, indexing="ij")
        # Squares around the middle become circles towards the rim; the rim's polygon is scaled to the circle's area.
        square, distance = np.maximum(np.abs(x), np.abs(y)), np.hypot(x, y)
        rounded = 1.0 if self.cell is None else (square / self.radius) ** 2
        stretch = 1.0 - rounded + rounded * np.divide(square, distance, out=np.zeros_like(x), where=distance > 0)
        plane = np.stack([x * stretch, y * stretch], -1)
        first, second = plane[1:, 1:] - plane[:-1, :-1], plane[:-1, 1:] - plane[1:, :-1]
        area = 0.5 * np.abs(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]).sum()
        plane *= np.sqrt(np.pi * self.radius**2 / area)
        nodes = np.concatenate([np.dstack([plane, np.full_like(x, height)]).reshape(-1, 3) for height in z])
        across, down = len(axis) - 1, len(z) - 1
        number = np.arange(len(nodes)).reshape(down + 1, across + 1, across + 1)
        tets = []
        for k, i, j in itertools.product(range(down), range(across), range(across)):
            corners = [number[k + c, i + a, j + b] for a, b, c in itertools.product((0, 1), repeat=3)]
            tets += [[corners[corner] for corner in tet] for tet in CUBOID]
        return palpate.TetMesh(nodes, np.array(tets))

    def _axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return coordinates across and down, m."""
        if self.cell is not None:
            # A plate bends most at its rim: with coarse elements there it is 6 % too stiff.
            reach = self.radius if self.support == "rim" else REACH * RADIUS
            across = graded(-self.radius, self.radius, 0.0, min(reach, self.radius), self.cell)
            return across, -graded(0.0, self.height, 0.0, min(reach, self.height), self.cell)[::-1]
        across, down = 2 * max(1, round(self.radius / EDGE)), max(2, round(self.height / EDGE))
        return np.linspace(-self.radius, self.radius, across + 1), np.linspace(-self.height, 0.0, down + 1)

    def body(self, linear: bool = False) -> palpate.Body:
        """Return the body with its supports, of 10-node elements or of 4-node ones."""
        mesh = self.corner_mesh() if linear else self.mesh()
        places = mesh.nodes
        fixed = np.zeros(places.shape, bool)
        bottom = places[:, 2] < -self.height + 1e-9
        if self.support == "table":
            fixed[bottom, 2] = True
            # Not at the top: a held node below the contact takes compliance from it.
            fixed[bottom & (np.hypot(places[:, 0], places[:, 1]) < 1e-9), :2] = True
            fixed[bottom & (np.abs(places[:, 1]) < 1e-9), 1] = True
        elif self.support == "bonded":
            fixed[bottom] = True
        else:
            fixed[np.hypot(places[:, 0], places[:, 1]) > 0.97 * self.radius] = True
        return palpate.Body(mesh, material=self.material(), fixed=fixed)

    def built(self, folder: Path, tool: dict, linear: bool = False) -> BuiltScene:
        """Scene with one tool; only the middle of the top may be touched."""
        body = self.body(linear)
        places = body.mesh.nodes[body.mesh.surface_nodes]
        r = np.hypot(places[:, 0], places[:, 1])
        near = (places[:, 2] > top_height(r, self.curvature) - 1e-9) & (r < TOUCHED)
        green = palpate.precompute(
            body, touch=body.mesh.surface_nodes[near], path=folder / f"{self.name}.palpate", progress=False
        )
        table = {"name": "body", "model": "liver"}  # the table asks for a source; the body is given
        scene = Scene(body=table, tool=[tool], device=UNLIMITED, view={"strain_limit": 0.0})
        return BuiltScene.of(scene, body, green)

    def pressed(self, folder: Path, series: bool = True, linear: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Press the sphere to all depths; return forces, N, and stated errors."""
        built = self.built(folder, sphere(RADIUS, 0.0), linear)
        deepest = max(self.depths)
        down = np.linspace(0.0005, -deepest, int(np.ceil((deepest + 0.0005) / 2e-5)) + 1)
        path = np.column_stack([0 * down, 0 * down, RADIUS + down])
        recording = Simulation(with_series(built) if series else built).play(path)
        contacts = recording.contacts
        depth = -down[contacts["tick"].astype(int)]
        order = np.argsort(depth)
        stated = np.interp(self.depths, depth[order], contacts["error"][order])
        force = np.interp(self.depths, depth[order], contacts["force"][order] @ np.array([0.0, 0.0, -1.0]))
        return force, stated


def references(cell: float | None = None) -> list[Cylinder]:
    """Cylinders with forces by full Newton's method (`python -m benches strain-references`)."""
    return [Cylinder(**case, cell=cell) for case in json.loads(REFERENCES.read_text()).values()]
