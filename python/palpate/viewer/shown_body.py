"""A body as the page shows it: where it stands, and its part of the scene message."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.body import Body
from palpate.mesh.elements import drawing_tets
from palpate.scene import BuiltBody
from palpate.viewer.fields import Fields


@dataclass(frozen=True)
class ShownBody:
    """One body of a running scene.

    Attributes
    ----------
    built
        The body, its Green's function, its place.
    fields
        What may be drawn in colours.
    poissons_ratio
        None for several materials or a bare store.

    """

    built: BuiltBody
    fields: Fields
    poissons_ratio: float | None = None

    def header(self, youngs_modulus: float | None) -> dict[str, Any]:
        """Entry of the scene message; the modulus, Pa, is None where it cannot be changed."""
        green, body = self.built.green, self.built.body
        return {
            "name": self.built.name,
            "title": titled(self.built.name),
            "nodes": int(green.surface_nodes.max()) + 1 if body is None else len(body.mesh.nodes),
            "tets": 0 if body is None else len(body.mesh.tets),
            "surface_nodes": len(green.surface_nodes),
            "triangles": len(green.surface_triangles),
            "youngs_modulus": youngs_modulus,
            "poissons_ratio": self.poissons_ratio,
            "position": list(self.built.position),
            "orientation": list(self.built.orientation),
            "fields": [{"name": field.name, "title": field.title} for field in self.fields.offered],
            "regions": [] if body is None else regions_of(body)[0],
        }

    def arrays(self) -> dict[str, tuple[str, np.ndarray]]:
        """Arrays of the scene message, in the body's frame."""
        green, body = self.built.green, self.built.body
        if body is None:
            nodes, tets = np.zeros((int(green.surface_nodes.max()) + 1, 3)), np.zeros((0, 4))
            regions = np.zeros(0)
            nodes[green.surface_nodes] = green.surface_positions
            fixed = np.intersect1d(green.fixed_nodes, green.surface_nodes)
        else:
            nodes, tets, fixed = body.mesh.nodes, drawing_tets(body.mesh.tets), green.fixed_nodes
            regions = np.repeat(regions_of(body)[1], len(tets) // len(body.mesh.tets))
        return {
            "nodes": ("f4", nodes),
            "tets": ("u4", tets),
            "tet_regions": ("u4", regions),
            "surface_triangles": ("u4", green.surface_triangles),
            "surface_nodes": ("u4", green.surface_nodes),
            "fixed_nodes": ("u4", fixed),
            "free": ("f4", green.free_displacements),
        }


def regions_of(body: Body) -> tuple[list[dict[str, Any]], np.ndarray]:
    """Return the entries of the scene message for a body's regions, and which of them each element (m,) is in."""
    mesh = body.mesh
    labels, first, ranks = np.unique(mesh.regions, return_index=True, return_inverse=True)
    names = {label: name for name, label in mesh.region_names.items()}
    entries = []
    for label, element in zip(labels.tolist(), first, strict=True):
        modulus, ratio, density = body.element_materials[element].tolist()
        unnamed = "Rest of the body" if label == 0 else f"Region {label}"
        title = titled(names[label]) if label in names else unnamed
        entries.append({"title": title, "youngs_modulus": modulus, "poissons_ratio": ratio, "density": density})
    return entries, ranks.ravel()


def titled(name: str) -> str:
    """Name as people read it."""
    return name.replace("_", " ").capitalize()
