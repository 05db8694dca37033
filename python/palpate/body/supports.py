"""Supports of a body: which components of which nodes are fixed, and whether the body can still move rigidly."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import scipy

from palpate.body.selection import AXES, node_indices, parse
from palpate.errors import BodyError

Fixed = str | Sequence[int] | np.ndarray | Mapping[str, Sequence[int]] | Callable[[np.ndarray], np.ndarray] | None


def fixed_mask(nodes: np.ndarray, fixed: Fixed) -> np.ndarray:
    """Mask of the fixed components of each node, (n, 3); only None fixes none.

    Raises BodyError for an index out of range, a mask of the wrong length, an unknown axis, or supports that hold no
    node.
    """
    if fixed is None:
        return np.zeros((len(nodes), 3), dtype=bool)
    mask = _named_mask(nodes, parse(fixed) if isinstance(fixed, str) else fixed)
    if not mask.any():
        of_what = f" = '{fixed}'" if isinstance(fixed, str) else ""
        low, high = (bound.round(4).tolist() for bound in (nodes.min(axis=0), nodes.max(axis=0)))
        raise BodyError(
            f"fixed{of_what} holds no node: the body reaches from {low} to {high} m; None leaves it without supports"
        )
    return mask


def _named_mask(nodes: np.ndarray, fixed: Fixed) -> np.ndarray:
    count = len(nodes)
    mask = np.zeros((count, 3), dtype=bool)
    if callable(fixed):
        fixed = np.asarray(fixed(nodes))
        if fixed.shape not in {(count,), (count, 3)} or fixed.dtype != bool:
            raise BodyError(f"the function for fixed must return a boolean mask of length {count}")
    if isinstance(fixed, Mapping):
        for name, nodes_of_axis in fixed.items():
            if name not in AXES:
                raise BodyError(f"unknown axis '{name}' in fixed: use 'x', 'y' or 'z'")
            mask[node_indices(nodes_of_axis, count, "fixed"), AXES[name]] = True
        return mask
    array = np.asarray(fixed)
    if array.dtype == bool and array.shape == (count, 3):
        return array.copy()
    mask[node_indices(array, count, "fixed")] = True
    return mask


def element_components(tets: np.ndarray, node_count: int) -> np.ndarray:
    """Label of the connected part each node belongs to, (n,)."""
    first = np.repeat(tets[:, 0], tets.shape[1] - 1)
    graph = scipy.sparse.coo_array(
        (np.ones(len(first), dtype=np.int8), (first, tets[:, 1:].ravel())), shape=(node_count, node_count)
    )
    return scipy.sparse.csgraph.connected_components(graph, directed=False)[1]


def rigid_constraint_rank(nodes: np.ndarray, mask: np.ndarray) -> int:
    """How many of the six rigid motions the fixed components prevent."""
    where, axis = np.nonzero(mask)
    if len(where) == 0:
        return 0
    size = max(float(np.ptp(nodes, axis=0).max()), 1e-30)
    arm = (nodes[where] - nodes.mean(axis=0)) / size
    direction = np.eye(3)[axis]
    rows = np.hstack([direction, np.cross(arm, direction)])
    return int(np.linalg.matrix_rank(rows.T @ rows, tol=1e-10 * len(where)))
