"""A body as the page shows it: where it stands, and its part of the scene message."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.body import Body
from palpate.green import GreensFunction
from palpate.mesh.elements import drawing_tets
from palpate.viewer.fields import Fields


@dataclass(frozen=True)
class ShownBody:
    """One body of a running scene.

    Attributes
    ----------
    name
        As the page lists it.
    body
        None for one from a store, which knows only the surface.
    green, fields
        Its Green's function, and what may be drawn in colours.
    poissons_ratio
        None for several materials or a bare store.
    position, orientation
        Of its own frame in the scene: m, and a unit quaternion w x y z.

    """

    name: str
    body: Body | None
    green: GreensFunction
    fields: Fields
    poissons_ratio: float | None = None
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    orientation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)

    def placed(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) of the body's frame in that of the scene, m."""
        return placed(points, self.position, self.orientation)

    def header(self, youngs_modulus: float | None) -> dict[str, Any]:
        """Entry of the scene message; the modulus, Pa, is None where it cannot be changed."""
        green, body = self.green, self.body
        return {
            "name": self.name,
            "title": titled(self.name),
            "nodes": int(green.surface_nodes.max()) + 1 if body is None else len(body.mesh.nodes),
            "tets": 0 if body is None else len(body.mesh.tets),
            "surface_nodes": len(green.surface_nodes),
            "triangles": len(green.surface_triangles),
            "youngs_modulus": youngs_modulus,
            "poissons_ratio": self.poissons_ratio,
            "position": list(self.position),
            "orientation": list(self.orientation),
            "fields": [{"name": field.name, "title": field.title} for field in self.fields.offered],
        }

    def arrays(self) -> dict[str, tuple[str, np.ndarray]]:
        """Arrays of the scene message, in the body's frame."""
        green, body = self.green, self.body
        if body is None:
            nodes, tets = np.zeros((int(green.surface_nodes.max()) + 1, 3)), np.zeros((0, 4))
            nodes[green.surface_nodes] = green.surface_positions
            fixed = np.intersect1d(green.fixed_nodes, green.surface_nodes)
        else:
            nodes, tets, fixed = body.mesh.nodes, drawing_tets(body.mesh.tets), green.fixed_nodes
        return {
            "nodes": ("f4", nodes),
            "tets": ("u4", tets),
            "surface_triangles": ("u4", green.surface_triangles),
            "surface_nodes": ("u4", green.surface_nodes),
            "fixed_nodes": ("u4", fixed),
            "free": ("f4", green.free_displacements),
        }


def placed(points: np.ndarray, position: tuple[float, ...], orientation: tuple[float, ...]) -> np.ndarray:
    """Rotate points (n, 3) by a unit quaternion `w + v`, `p + 2 v x (v x p + w p)`, and move them."""
    w, v = orientation[0], np.array(orientation[1:])
    return points + 2.0 * np.cross(v, np.cross(v, points) + w * points) + np.array(position)


def titled(name: str) -> str:
    """Name as people read it."""
    return name.replace("_", " ").capitalize()
