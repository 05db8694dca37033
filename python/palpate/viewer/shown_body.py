"""A body in the page: the surface that is drawn of it, its placement, and its part of the scene message.

All of a surface is drawn, or fewer triangles where there are more than a page takes. Vertices that are drawn are
surface nodes, in place: displacements and fields are exact there, and what is left out is only the nodes between. What
is felt knows nothing of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from palpate import _native
from palpate.body import Body
from palpate.mesh.elements import drawing_tets, face_owners
from palpate.mesh.triangles import node_normals
from palpate.scene import BuiltBody
from palpate.viewer.fields import Fields, Picture

# Triangles of one body that a page draws at most: docs/benchmarks.md.
MOST_TRIANGLES = 60_000
# Sheets that face away from each other are apart: a normal counts as so many mean distances between drawn vertices.
APART = 4.0


@dataclass(frozen=True)
class DrawnSurface:
    """What is drawn of a surface of s nodes."""

    nodes: np.ndarray  # rows (v,) of the surface nodes that are drawn, ascending
    triangles: np.ndarray  # corners (k, 3) among them
    regions: np.ndarray  # rank of the region behind each triangle (k,)
    # The drawn vertex that stands for each surface node (s,); None where all are drawn.
    owners: np.ndarray | None = None
    deviation: float = 0.0  # how far the surface lies from the drawn triangles at rest, about, m

    @property
    def is_whole(self) -> bool:
        """Whether all of the surface is drawn."""
        return self.owners is None


def drawn_surface(built: BuiltBody, of_element: np.ndarray, most: int | None = None) -> DrawnSurface:
    """Surface of a body, or at most about so many triangles of it, by default as many as a page takes.

    ``of_element`` has the region of each element.
    """
    green = built.green
    triangles = np.searchsorted(green.surface_nodes, green.surface_triangles)
    regions = _regions(built, of_element, len(triangles))
    return drawn_triangles(green.surface_positions, triangles, regions, most)


def drawn_triangles(
    positions: np.ndarray, triangles: np.ndarray, regions: np.ndarray, most: int | None = None
) -> DrawnSurface:
    """Do the same for triangles (k, 3) of positions (s, 3), m, with the region behind each (k,)."""
    most = MOST_TRIANGLES if most is None else most
    if len(triangles) <= most:
        return DrawnSurface(np.arange(len(positions)), triangles, regions)
    parts, deviation = [], 0.0
    seams = _on_seams(triangles, regions, len(positions))
    for region in np.unique(regions):
        corners = triangles[regions == region].astype(np.uint32)
        fewer, off = _native.simplified(positions, corners.ravel(), seams, int(most * len(corners) / len(triangles)))
        parts.append((fewer.reshape(-1, 3), np.full(len(fewer) // 3, region)))
        deviation = max(deviation, off)
    corners = np.vstack([corners for corners, _ in parts])
    nodes, ranks = np.unique(corners, return_inverse=True)
    owners = _owners(positions, node_normals(positions, triangles), nodes)
    return DrawnSurface(nodes, ranks.reshape(-1, 3), np.concatenate([r for _, r in parts]), owners, deviation)


def _regions(built: BuiltBody, of_element: np.ndarray, count: int) -> np.ndarray:
    """Rank of the region behind each triangle of the surface (k,)."""
    if built.body is None or not of_element.any():
        return np.zeros(count, dtype=np.int64)
    owners = face_owners(built.body.mesh.tets)
    # A face with mid-side nodes is drawn as several triangles.
    return of_element[np.repeat(owners, count // len(owners))]


def _on_seams(triangles: np.ndarray, regions: np.ndarray, count: int) -> np.ndarray:
    """Whether each node (s,) is a corner of triangles of several regions."""
    low, high = np.full(count, regions.max() + 1), np.full(count, -1)
    for corner in triangles.T:
        np.minimum.at(low, corner, regions)
        np.maximum.at(high, corner, regions)
    return low < high


def _owners(positions: np.ndarray, normals: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Drawn vertex (s,) that is nearest to each node on its own side of the body."""
    from scipy.spatial import cKDTree

    tree = cKDTree(positions[nodes])
    spacing = float(np.median(tree.query(positions[nodes], k=2)[0][:, 1]))
    sided = np.hstack([positions, APART * spacing * normals])
    return cKDTree(sided[nodes]).query(sided)[1]


@dataclass(frozen=True)
class ShownBody:
    """One body of a running scene."""

    built: BuiltBody  # the body, its Green's function, its place
    fields: Fields  # what may be drawn in colours
    drawn: DrawnSurface  # the surface that the page draws
    poissons_ratio: float | None = None  # None for several materials or a bare store

    @classmethod
    def of(cls, built: BuiltBody, fields: Fields, poissons_ratio: float | None) -> ShownBody:
        """Find what is drawn of a body."""
        of_element = np.zeros(0, dtype=np.int64) if built.body is None else regions_of(built.body)[1]
        return cls(built, fields, drawn_surface(built, of_element), poissons_ratio)

    def picture(self, name: str, displacements: np.ndarray, cutaway: bool, full_scale: float | None) -> Picture:
        """Field of a pose at the vertices that are drawn, or at all nodes where the body is cut open."""
        whole = self.drawn.is_whole
        picture = self.fields.picture(name, displacements, cutaway and whole, full_scale)
        if whole:
            return picture
        rows = self.drawn.nodes
        return replace(picture, displacements=picture.displacements[rows], scalar=picture.scalar[rows])

    def drawn_row(self, node: int) -> int:
        """Vertex that stands for a surface node by its row."""
        return node if self.drawn.owners is None else int(self.drawn.owners[node])

    def header(self, youngs_modulus: float | None) -> dict[str, Any]:
        """Entry of the scene message; the modulus, Pa, is None where it cannot be changed."""
        green, body = self.built.green, self.built.body
        outer = int(green.surface_nodes.max()) + 1
        return {
            **body_header(self.built.name, self.drawn, len(green.surface_nodes), len(green.surface_triangles)),
            "nodes": len(body.mesh.nodes) if body is not None and green.follows_inside else outer,
            "tets": len(body.mesh.tets) if body is not None and green.follows_inside else 0,
            "youngs_modulus": youngs_modulus,
            "poissons_ratio": self.poissons_ratio,
            "position": list(self.built.position),
            "orientation": list(self.built.orientation),
            "fields": [{"name": field.name, "title": field.title} for field in self.fields.offered],
            "server_fields": [],
            "regions": [] if body is None else regions_of(body)[0],
        }

    def arrays(self) -> dict[str, tuple[str, np.ndarray]]:
        """Arrays of the scene message, in the body's frame.

        Of a body that is drawn by fewer triangles the nodes are those that are drawn, and it has no inside.
        """
        drawn, green = self.drawn, self.built.green
        nodes, tets, regions, surface, fixed = self._mesh() if drawn.is_whole else self._outside()
        inside = {"tets": ("u4", tets), "tet_regions": ("u4", regions), "fixed_nodes": ("u4", fixed)}
        return body_arrays(drawn, nodes, surface, green.free_displacements[drawn.nodes]) | inside

    def _mesh(self) -> tuple[np.ndarray, ...]:
        """Nodes, tetrahedra, their regions, surface nodes and supported nodes, of a body that is drawn as it is."""
        green, body = self.built.green, self.built.body
        if body is None or not green.follows_inside:
            nodes = np.zeros((int(green.surface_nodes.max()) + 1, 3))
            nodes[green.surface_nodes] = green.surface_positions
            fixed = np.intersect1d(green.fixed_nodes, green.surface_nodes)
            return nodes, np.zeros((0, 4)), np.zeros(0), green.surface_nodes, fixed
        tets = drawing_tets(body.mesh.tets)
        regions = np.repeat(regions_of(body)[1], len(tets) // len(body.mesh.tets))
        return body.mesh.nodes, tets, regions, green.surface_nodes, green.fixed_nodes

    def _outside(self) -> tuple[np.ndarray, ...]:
        """Return the same of the vertices that are drawn, without an inside."""
        green, rows = self.built.green, self.drawn.nodes
        fixed = np.flatnonzero(np.isin(green.surface_nodes[rows], green.fixed_nodes))
        return green.surface_positions[rows], np.zeros((0, 4)), np.zeros(0), np.arange(len(rows)), fixed


def body_header(name: str, drawn: DrawnSurface, nodes: int, triangles: int) -> dict[str, Any]:
    """Entry of the scene message for a surface with nothing but so many nodes and triangles."""
    return {
        "name": name,
        "title": title_of(name),
        "nodes": len(drawn.nodes),
        "tets": 0,
        "surface_nodes": nodes,
        "triangles": triangles,
        "drawn": None if drawn.is_whole else {"triangles": len(drawn.triangles), "deviation": drawn.deviation},
        "youngs_modulus": None,
        "poissons_ratio": None,
        "position": [0.0, 0.0, 0.0],
        "orientation": [1.0, 0.0, 0.0, 0.0],
        "fields": [],
        "server_fields": [],
        "regions": [],
    }


def body_arrays(
    drawn: DrawnSurface, nodes: np.ndarray, surface: np.ndarray, free: np.ndarray
) -> dict[str, tuple[str, np.ndarray]]:
    """Arrays of the scene message for positions, m, surface nodes among them, and their free displacements, m."""
    nothing = np.zeros(0)
    return {
        "nodes": ("f4", nodes),
        "tets": ("u4", np.zeros((0, 4))),
        "tet_regions": ("u4", nothing),
        "surface_triangles": ("u4", surface[drawn.triangles]),
        "triangle_regions": ("u4", drawn.regions),
        "surface_nodes": ("u4", surface),
        "fixed_nodes": ("u4", nothing),
        "free": ("f4", free),
        "owners": ("u4", nothing if drawn.owners is None else drawn.owners),
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
        title = title_of(names[label]) if label in names else unnamed
        entries.append({"title": title, "youngs_modulus": modulus, "poissons_ratio": ratio, "density": density})
    return entries, ranks.ravel()


def title_of(name: str) -> str:
    """Name as people read it."""
    return name.replace("_", " ").capitalize()
