"""Arrays of a body's reference problem for the native module, and its description for files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from palpate.body.body import Body
from palpate.body.material import strain_term_rows
from palpate.body.surface_region import surface_region


def problem_arrays(body: Body, touch: Sequence[int] | np.ndarray | None) -> tuple[np.ndarray, ...]:
    """Arrays that determine the reference problem, in the order of the native module."""
    surface_nodes = body.mesh.surface_nodes
    ranks = np.searchsorted(surface_nodes, surface_region(body, touch, "touch"))
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


def surface_moduli(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Young's modulus (s,), Pa, and Poisson's ratio (s,) at the surface nodes, for contacts smaller than elements.

    Of the modulus it is the harmonic mean of the elements around: beside a stiffer part the softer one yields.
    """
    young, poisson = body.element_materials[:, :2].T
    # Over the largest, so that a body of one material keeps its modulus to the bit.
    softness, ratio = _at_surface_nodes(body, np.stack([young.max() / young, poisson], axis=1)).T
    return young.max() / softness, np.ascontiguousarray(ratio)


def surface_strain_terms(body: Body) -> np.ndarray:
    """Coefficients of contacts at finite strain (s, 3) at the surface nodes: the means of the elements around."""
    return _at_surface_nodes(body, strain_term_rows(body.mesh, body.material))


def _at_surface_nodes(body: Body, values: np.ndarray) -> np.ndarray:
    """Return the means (s, k) at the surface nodes of values (m, k) of the elements around."""
    nodes, surface = len(body.mesh.nodes), body.mesh.surface_nodes
    tets, per_node = body.mesh.tets.ravel(), body.mesh.tets.shape[1]
    count = np.bincount(tets, minlength=nodes)[surface]
    columns = (np.bincount(tets, weights=np.repeat(column, per_node), minlength=nodes) for column in values.T)
    return np.stack([column[surface] / count for column in columns], 1)
