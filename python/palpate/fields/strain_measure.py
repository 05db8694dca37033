"""Largest strain of a pose: the measure that is reported and that limits tools.

Of a body whose elements are known it is the largest principal strain in magnitude, `max |e_1|, |e_3|`, over the surface
nodes, with the infinitesimal strain that :class:`palpate.StressRecovery` recovers there. A bare store knows no
elements, and those of a body of more than 50,000 nodes cost too much: there it is the Green strain in the plane of the
surface, :class:`palpate.fields.SurfaceStrain`.

A measure works in two steps, so that many poses of one contact cost little each: a ``sample`` that is an affine
function of the displacements, and the ``magnitudes`` of a sample.
"""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import numpy as np

from palpate.mesh.shape_functions import TRIANGLE_EDGES, TRIANGLE_NODES, derivatives

# Linear elasticity is accurate up to about this strain; a pose beyond it is reported.
LINEAR_STRAIN_LIMIT = 0.1
# Strain at which the tool of a scene is held, and from which an answer has no meaning.
STRAIN_LIMIT = 0.3
# Derivatives along the edges from corner 0 to corners 1 and 2 of the shape functions of a face, (places, nodes, 2), by
# the number of its nodes: anywhere on a flat triangle, at each node of a 6-node face.
_SLOPES = {
    count: derivatives(places, count, TRIANGLE_EDGES)
    for count, places in ((3, TRIANGLE_NODES[:1]), (6, TRIANGLE_NODES))
}


class StrainMeasure(Protocol):
    """Measure of the strain of a pose."""

    def sample(self, displacements: np.ndarray) -> np.ndarray:
        """Quantity that strain follows from, affine in displacements (s, 3), m."""

    def magnitudes(self, sample: np.ndarray) -> np.ndarray:
        """Largest principal strain in magnitude at each place that is looked at."""

    def largest(self, displacements: np.ndarray) -> float:
        """Largest of the magnitudes, for displacements (s, 3), m."""
        return float(self.magnitudes(self.sample(displacements)).max())


class StrainSource(Protocol):
    """Body or simulation that a pose belongs to."""

    @property
    def strain_measure(self) -> StrainMeasure:
        """Measure of the strain of its poses."""


class StrainReporting:
    """A pose that knows its largest strain; ``_source`` has the measure."""

    displacements: np.ndarray
    _source: StrainSource

    @cached_property
    def largest_strain(self) -> float:
        """Largest principal strain in magnitude over the surface; milliseconds, when read."""
        return self._source.strain_measure.largest(self.displacements)

    @property
    def within_linear_range(self) -> bool:
        """Whether the largest strain is within the 10 % up to which linear elasticity is accurate."""
        return self.largest_strain <= LINEAR_STRAIN_LIMIT


class SurfaceStrain(StrainMeasure):
    """Green strain in the plane of the elements' faces.

    With the tangents of a face as columns, ``R`` at rest (in their plane, 2x2), ``D`` deformed (3x2)::

        F = D R^-1        E = (F^T F - I) / 2

    It is zero for rigid motions, so a large
    rotation, which the linear solution draws as growth, is reported too. On a flat triangle it is constant. On a 6-node
    face it is taken at the nodes, where the magnitudes of all faces around a node are averaged. They bound that of the
    mean strain, and faces need not lie in one plane.

    Parameters
    ----------
    positions
        (s, 3) m, the surface at rest.
    faces
        (k, 3) or (k, 6) rows of ``positions``.

    """

    def __init__(self, positions: np.ndarray, faces: np.ndarray):
        self._faces = faces
        self._positions = positions
        self._slopes = _SLOPES[faces.shape[1]]
        self._faces_around = np.maximum(np.bincount(faces.ravel(), minlength=len(positions)), 1)
        first, second = self._tangents(positions)
        length = np.linalg.norm(first, axis=-1)
        axis = first / length[..., None]
        along = np.einsum("...i,...i->...", second, axis)
        across = np.linalg.norm(second - along[..., None] * axis, axis=-1)
        # R = [[length, along], [0, across]] is upper triangular: its inverse is written out.
        self._inverse = (1.0 / length, -along / (length * across), 1.0 / across)

    def sample(self, displacements: np.ndarray) -> np.ndarray:
        """Tangents ``D`` of the deformed faces, (2, k, places, 3), for displacements (s, 3), m."""
        return np.stack(self._tangents(self._positions + displacements))

    def magnitudes(self, sample: np.ndarray) -> np.ndarray:
        """Largest principal strain in magnitude, of each flat triangle or at each node of 6-node faces."""
        strain = self._at_places(sample)
        return self._averaged(strain) if len(self._slopes) > 1 else strain[:, 0]

    def at_nodes(self, displacements: np.ndarray) -> np.ndarray:
        """Mean of the faces around each node, (s,): to be drawn."""
        return self._averaged(self._at_places(self.sample(displacements)))

    def _at_places(self, tangents: np.ndarray) -> np.ndarray:
        """Largest principal strain in magnitude at the places of each face, (k, places)."""
        first, second = tangents
        a, b, c = self._inverse
        g1 = a[..., None] * first
        g2 = b[..., None] * first + c[..., None] * second
        exx = 0.5 * (np.einsum("...i,...i->...", g1, g1) - 1.0)
        eyy = 0.5 * (np.einsum("...i,...i->...", g2, g2) - 1.0)
        exy = 0.5 * np.einsum("...i,...i->...", g1, g2)
        mean, radius = 0.5 * (exx + eyy), np.hypot(0.5 * (exx - eyy), exy)
        return np.abs(mean) + radius

    def _averaged(self, at_places: np.ndarray) -> np.ndarray:
        """Means over the faces around each node; a flat triangle counts alike at its corners."""
        values = np.broadcast_to(at_places, self._faces.shape)
        return np.bincount(self._faces.ravel(), values.ravel(), minlength=len(self._positions)) / self._faces_around

    def _tangents(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tangents along both edges from corner 0, (k, places, 3) each."""
        nodes = positions[self._faces]
        first, second = (np.tensordot(nodes, self._slopes[:, :, k], axes=(1, 1)).swapaxes(1, 2) for k in (0, 1))
        return first, second
