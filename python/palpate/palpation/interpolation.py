"""Interpolation of values at scattered places of a surface.

Interpolated by radial basis functions, `sum w_i |x - x_i| + c`, over the closest places: what was measured stands at
its place, between places it is as smooth as that allows. Distances are those of places and normals together, so that
the far side of a thin part, or the next side beyond an edge, takes nothing from this one.
"""

from __future__ import annotations

import numpy as np

# Share of normals in the distance, by spacings; how far from the closest place values are known, in spacings: out to
# the corner of a square lattice's last cell, and over an edge half-way round.
NORMALS, KNOWN = 1.2, 1.6
NEIGHBOURS = 24


def joined(points: np.ndarray, normals: np.ndarray, spacing: float) -> np.ndarray:
    """Points (n, 3), m, and unit normals (n, 3) as places (n, 6), whose distances count in spacings, m."""
    return np.hstack([points / spacing, NORMALS * normals])


def interpolated(asked: np.ndarray, places: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n,) at places (n, 6) of :func:`joined`, from those (p,) at others (p, 6), NaN where nothing is known.

    NaN where none is near.
    """
    from scipy.interpolate import RBFInterpolator
    from scipy.spatial import cKDTree

    known = np.isfinite(values)
    found = np.full(len(asked), np.nan)
    if known.any():
        near = cKDTree(places[known]).query(asked)[0] < KNOWN
        if near.any():
            neighbours = min(NEIGHBOURS, int(known.sum()))
            fit = RBFInterpolator(places[known], values[known], neighbours, kernel="linear", degree=0)
            found[near] = fit(asked[near])
    return found
