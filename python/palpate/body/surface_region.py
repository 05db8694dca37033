"""Parts of a body's surface, selected by a user: by nodes, a predicate, a group of the mesh file, or a solid."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from palpate.body.body import Body
from palpate.body.selection import parse
from palpate.errors import BodyError
from palpate.units import brief_repr

# Node numbers, a mask of all nodes, text, or a function of (n, 3) positions such as a solid of `palpate.mesh.shapes`.
SurfaceRegion = Sequence[int] | np.ndarray | str | Callable[[np.ndarray], np.ndarray]


def surface_region(body: Body, region: SurfaceRegion | None, what: str) -> np.ndarray:
    """Surface nodes of a region, ascending; None: all of them. ``what`` names it in errors.

    Text is the name or number of a region of the mesh file, whose nodes on the surface are meant, or a predicate over
    x, y and z, m. Numbers must be surface nodes; all else names those of its nodes that are. Raises BodyError for a
    number that is no surface node, text that cannot be read, or a region without a surface node.
    """
    mesh, surface = body.mesh, body.mesh.surface_nodes
    if region is None:
        return surface
    if isinstance(region, str):
        mask = _group(body, region)
        mask = parse(region)(mesh.nodes) if mask is None else mask
    elif callable(region):
        mask = np.asarray(region(mesh.nodes))
    else:
        mask = np.asarray(region)
        if mask.dtype != bool:
            return _numbered(surface, mask, what)
    if mask.shape != (len(mesh.nodes),) or mask.dtype != bool:
        raise BodyError(f"{what}: a region must give a boolean mask of the {len(mesh.nodes)} nodes")
    inside = surface[mask[surface]]
    if not len(inside):
        low, high = mesh.bounds.round(4).tolist()
        name = f"'{region}'" if isinstance(region, str) else brief_repr(region)
        raise BodyError(f"{what}: no surface node lies in {name}: the body reaches from {low} to {high} m")
    return inside


def _numbered(surface: np.ndarray, nodes: np.ndarray, what: str) -> np.ndarray:
    nodes = np.unique(nodes)
    if nodes.size == 0 or not np.issubdtype(nodes.dtype, np.integer):
        raise BodyError(f"{what} must be a list of surface node indices")
    outside = np.flatnonzero(~np.isin(nodes, surface))
    if outside.size:
        raise BodyError(f"{what}: node {nodes[outside[0]]} is not on the surface")
    return nodes


def _group(body: Body, name: str) -> np.ndarray | None:
    """Mask of the nodes of a region of the mesh file; None if it has none of that name."""
    mesh = body.mesh
    number = mesh.region_names.get(name, int(name) if name.isascii() and name.isdecimal() else None)
    elements = mesh.regions == number
    if number is None or not elements.any():
        return None
    mask = np.zeros(len(mesh.nodes), dtype=bool)
    mask[mesh.tets[elements]] = True
    return mask
