"""Elastic constants at the surface: what the contact law needs of a body below the size of its elements."""

from __future__ import annotations

import numpy as np

from palpate.body.body import Body


def surface_moduli(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Young's modulus (s,), Pa, and Poisson's ratio (s,) at the surface nodes: the means of the elements around."""
    nodes = len(body.mesh.nodes)
    tets = body.mesh.tets.ravel()
    per_node = body.mesh.tets.shape[1]
    count = np.bincount(tets, minlength=nodes)[body.mesh.surface_nodes]
    constants = [np.repeat(body.element_materials[:, column], per_node) for column in (0, 1)]
    sums = [np.bincount(tets, weights=values, minlength=nodes) for values in constants]
    young, poisson = (total[body.mesh.surface_nodes] / count for total in sums)
    return np.ascontiguousarray(young), np.ascontiguousarray(poisson)
