"""Arrays of a body's reference problem for the native module, and its description for files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from palpate.body.body import Body
from palpate.body.moduli import surface_moduli
from palpate.errors import BodyError


def problem_arrays(body: Body, touch: Sequence[int] | np.ndarray | None) -> tuple[np.ndarray, ...]:
    """Arrays that determine the reference problem, in the order of the native module."""
    surface_nodes = body.mesh.surface_nodes
    if touch is None:
        ranks = np.arange(len(surface_nodes))
    else:
        nodes = np.unique(np.asarray(touch))
        if nodes.size == 0 or not np.issubdtype(nodes.dtype, np.integer):
            raise BodyError("touch must be a list of surface node indices")
        ranks = np.searchsorted(surface_nodes, nodes)
        inside = np.flatnonzero(surface_nodes[np.minimum(ranks, len(surface_nodes) - 1)] != nodes)
        if inside.size:
            raise BodyError(f"touch: node {nodes[inside[0]]} is not on the surface")
    indices = [body.fixed_dofs, surface_nodes, body.mesh.surface_faces, ranks]
    loads = body.load_vector().ravel()
    loads = loads if loads.any() else np.empty(0)
    return (*body._element_arrays(), *(np.ascontiguousarray(i, dtype=np.uint32) for i in indices), loads)


def description(body: Body) -> dict[str, Any]:
    """Give counts, materials and loads of a body: kept in its files, and compared where keys differ."""
    materials = body.material if isinstance(body.material, Mapping) else {"all": body.material}
    total = body.load_vector().sum(axis=0)
    young, poisson = surface_moduli(body)
    even = np.ptp(young) == 0 and np.ptp(poisson) == 0
    return {
        "nodes": len(body.mesh.nodes),
        "tets": len(body.mesh.tets),
        "element": "quadratic" if body.mesh.is_quadratic else "linear",
        "surface_nodes": len(body.mesh.surface_nodes),
        "fixed_nodes": len(body.fixed_nodes),
        "materials": {str(k): [m.youngs_modulus, m.poissons_ratio, m.density] for k, m in materials.items()},
        # What tools meet: once where the surface is of one material, else at every surface node.
        "surface_moduli": [m[:1].tolist() if even else m.tolist() for m in (young, poisson)],
        "load_N": total.tolist(),
    }
