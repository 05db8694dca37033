"""Elastic constants at the surface: what the contact law needs of a body below the size of its elements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from palpate.body.body import Body
from palpate.errors import BodyError


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


def moduli_of_store(description: Mapping[str, Any], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Constants of a body of which only the store is there, at its ``count`` surface nodes.

    Raises
    ------
    BodyError
        An older store of a body of several materials: it does not say where each of them is.

    """
    known = description.get("surface_moduli")
    if known is None:
        materials = list(description.get("materials", {}).values())
        if len(materials) != 1:
            raise BodyError(
                "this store of several materials does not say which is at the surface: compute it again, or give the "
                "tool contact = 'patch'"
            )
        known = [[value] for value in materials[0][:2]]
    young, poisson = (np.broadcast_to(np.asarray(values, dtype=float), count).copy() for values in known)
    return young, poisson
