"""Strain of the surface: whether a pose is still within what linear elasticity can say."""

from __future__ import annotations

import numpy as np

# Linear elasticity is honest to about this strain; beyond it a pose is reported.
HONEST_STRAIN = 0.1


class SurfaceStrain:
    """Green strain in the plane of each surface triangle.

    With the edges of a triangle as columns, ``R`` at rest (in its plane, 2x2) and ``D`` deformed (3x2), the deformation
    gradient is ``F = D R^-1`` and ``E = (F^T F - I) / 2``. It is zero for rigid motions, so a large rotation, which the
    linear solution draws as growth, is reported too.

    Parameters
    ----------
    positions
        (s, 3) m, the surface at rest.
    triangles
        (k, 3) rows of ``positions``.

    """

    def __init__(self, positions: np.ndarray, triangles: np.ndarray):
        self._triangles = triangles
        self._positions = positions
        first, second = self._edges(positions)
        length = np.linalg.norm(first, axis=1)
        axis = first / length[:, None]
        along = np.einsum("ij,ij->i", second, axis)
        across = np.linalg.norm(second - along[:, None] * axis, axis=1)
        # R = [[length, along], [0, across]] is upper triangular: its inverse is written out.
        self._inverse = (1.0 / length, -along / (length * across), 1.0 / across)

    def largest(self, displacements: np.ndarray) -> float:
        """Largest principal strain, in magnitude, for displacements (s, 3) m."""
        first, second = self._edges(self._positions + displacements)
        a, b, c = self._inverse
        g1 = a[:, None] * first
        g2 = b[:, None] * first + c[:, None] * second
        exx = 0.5 * (np.einsum("ij,ij->i", g1, g1) - 1.0)
        eyy = 0.5 * (np.einsum("ij,ij->i", g2, g2) - 1.0)
        exy = 0.5 * np.einsum("ij,ij->i", g1, g2)
        mean, radius = 0.5 * (exx + eyy), np.hypot(0.5 * (exx - eyy), exy)
        return float((np.abs(mean) + radius).max())

    def _edges(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        corners = positions[self._triangles]
        return corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
