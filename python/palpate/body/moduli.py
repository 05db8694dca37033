"""Elastic constants at the surface: what the contact law needs of a body below the size of its elements."""

from __future__ import annotations

import numpy as np

from palpate.body.body import Body
from palpate.body.material import strain_term_rows


def surface_moduli(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Young's modulus (s,), Pa, and Poisson's ratio (s,) at the surface nodes.

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
