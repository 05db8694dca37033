"""Where a surface of triangles intersects itself."""

from __future__ import annotations

import numpy as np

# Cells along the longest side of the grid that finds triangles near each other, at most.
MOST_CELLS = 64
# Pairs that are tested at a time.
CHUNK = 1_000_000
# An edge is parallel to a triangle below this share of their lengths; one that meets its border counts as piercing it,
# to this part of its size, for triangles that share no vertex do not touch.
PARALLEL, BORDER = 1e-6, 1e-9


def first_crossing(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray | None:
    """Find a point (3,) where an edge of one triangle passes through another that shares no vertex with it, if any.

    Edges and triangles are tested by T. Moller and B. Trumbore's method (1997), those near each other by a grid.
    """
    for a, b in _near_pairs(vertices[faces]):
        apart = (faces[a][:, :, None] != faces[b][:, None, :]).all(axis=(1, 2))
        for first, second in ((a[apart], b[apart]), (b[apart], a[apart])):
            point = _pierced(vertices[faces[first]], vertices[faces[second]])
            if point is not None:
                return point
    return None


def _pierced(edges_of: np.ndarray, triangles: np.ndarray) -> np.ndarray | None:
    """Point where an edge of the first pierces the second, triangles (k, 3, 3) each."""
    a, span, across = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    for i in range(3):
        start, along = edges_of[:, i], edges_of[:, (i + 1) % 3] - edges_of[:, i]
        p = np.cross(along, across)
        determinant = np.einsum("ij,ij->i", span, p)
        scale = np.linalg.norm(along, axis=1) * np.linalg.norm(span, axis=1) * np.linalg.norm(across, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.where(np.abs(determinant) > PARALLEL * scale, 1.0 / determinant, np.nan)
        offset = start - a
        q = np.cross(offset, span)
        u, v = inverse * np.einsum("ij,ij->i", offset, p), inverse * np.einsum("ij,ij->i", along, q)
        t = inverse * np.einsum("ij,ij->i", across, q)
        hit = (np.minimum(u, v) > -BORDER) & (u + v < 1 + BORDER) & (np.abs(t - 0.5) < 0.5 + BORDER)
        if hit.any():
            k = int(np.argmax(hit))
            return start[k] + t[k] * along[k]
    return None


def _near_pairs(corners: np.ndarray):
    """Pairs of triangles whose boxes meet a common cell of a grid, in chunks of indices."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    origin, extent = low.min(axis=0), float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    cell = max(2.0 * float(np.median((high - low).max(axis=1))), extent / MOST_CELLS)
    first, last = (np.floor((x - origin) / cell).astype(np.int64) for x in (low, high))
    shape = last - first + 1
    counts = shape.prod(axis=1)
    triangle = np.repeat(np.arange(len(corners)), counts)
    rank = np.arange(len(triangle)) - np.repeat(np.cumsum(counts) - counts, counts)
    ny, nz = shape[triangle, 1], shape[triangle, 2]
    place = first[triangle] + np.column_stack([rank // (ny * nz), rank // nz % ny, rank % nz])
    number = np.ravel_multi_index(tuple(place.T), tuple(last.max(axis=0) + 1))
    order = np.argsort(number, kind="stable")
    triangle, number = triangle[order], number[order]
    start = np.flatnonzero(np.diff(number, prepend=-1))
    size = np.diff(start, append=len(number))
    # Each entry with those after it in its cell.
    after = np.repeat(start + size, size) - np.arange(len(number)) - 1
    begin = 0
    while begin < len(number):
        end = begin + max(1, int(np.searchsorted(np.cumsum(after[begin:]), CHUNK)))
        entry = np.repeat(np.arange(begin, min(end, len(number))), after[begin:end])
        step = np.arange(len(entry)) - np.repeat(np.cumsum(after[begin:end]) - after[begin:end], after[begin:end])
        a, b = triangle[entry], triangle[entry + step + 1]
        meet = ((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)
        yield a[meet], b[meet]
        begin = end
