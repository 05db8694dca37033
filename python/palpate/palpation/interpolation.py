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


class SurfaceField:
    """A field that is known at places about a spacing, m, apart.

    The ``points`` (p, 3), m, have unit ``normals`` (p, 3). The ``values`` (p,) are NaN where nothing is known.
    """

    def __init__(self, points: np.ndarray, normals: np.ndarray, values: np.ndarray, spacing: float):
        known = np.isfinite(values)
        self._spacing = spacing
        self._places, self._values = self._joined(points[known], normals[known]), values[known]

    def at(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Values (n,) at points (n, 3), m, with normals (n, 3); NaN where none is near."""
        from scipy.interpolate import RBFInterpolator
        from scipy.spatial import cKDTree

        values = np.full(len(points), np.nan)
        if len(self._values) == 0:
            return values
        asked = self._joined(points, normals)
        near = cKDTree(self._places).query(asked)[0] < KNOWN
        if near.any():
            neighbours = min(NEIGHBOURS, len(self._values))
            fit = RBFInterpolator(self._places, self._values, neighbours, kernel="linear", degree=0)
            values[near] = fit(asked[near])
        return values

    def _joined(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        return np.hstack([points / self._spacing, NORMALS * normals])
