"""Sets of nodes, as users name them: indices, a mask, or a function of the positions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from palpate.errors import BodyError

Selection = Sequence[int] | np.ndarray | Callable[[np.ndarray], np.ndarray]


def node_indices(values: Any, count: int, what: str) -> np.ndarray:
    """Check a list of nodes or an (n,) mask, as indices below ``count``; ``what`` names it in messages.

    Raises BodyError for a mask of the wrong length, an index out of range, anything else.
    """
    array = np.asarray(values)
    if array.dtype == bool:
        if array.shape != (count,):
            raise BodyError(f"a mask for {what} must have length {count}, got shape {array.shape}")
        return np.flatnonzero(array)
    if array.size == 0:
        return np.empty(0, dtype=np.int64)
    if array.ndim != 1 or not np.issubdtype(array.dtype, np.integer):
        raise BodyError(f"{what} nodes must be a one-dimensional list of integers or a mask")
    bad = array[(array < 0) | (array >= count)]
    if bad.size:
        raise BodyError(f"{what} node {bad[0]} does not exist: the mesh has nodes 0 to {count - 1}")
    return array.astype(np.int64)


def selected_nodes(selection: Selection, nodes: np.ndarray, what: str) -> np.ndarray:
    """Like :func:`node_indices`, for a function of the (n, 3) positions too."""
    if callable(selection):
        selection = np.asarray(selection(nodes))
        if selection.dtype != bool:
            raise BodyError(f"the function for {what} must return a boolean mask of length {len(nodes)}")
    return node_indices(selection, len(nodes), what)
