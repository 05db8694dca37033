"""A deformed body: displacements of its surface, with strain, stress and fields derived from them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from palpate.fields.export import DeformedSurface, Exportable, surface_mesh, volume_mesh
from palpate.fields.strain_measure import StrainReporting, StrainSource, SurfaceStrain
from palpate.fields.stress import StressRecovery

if TYPE_CHECKING:
    import meshio

    from palpate.body import Body


class ResultSource(StrainSource, Protocol):
    """What a deformed body belongs to: a Green's function."""

    body: Body | None
    surface_nodes: np.ndarray
    surface_positions: np.ndarray
    surface_faces: np.ndarray
    surface_triangles: np.ndarray

    @property
    def stress_everywhere(self) -> StressRecovery:
        """Recovery of stress and strain at all nodes of the body."""


class Result(StrainReporting, Exportable):
    """Displacements of a surface, with all that follows from them.

    Of a body whose elements are known, files and meshes hold its tetrahedra with fields at all nodes. These are
    ``displacement`` (m), ``strain`` and ``stress`` (Pa) by the components xx, yy, zz, xy, yz, xz, ``largest_strain``
    (principal, in magnitude) and ``von_mises`` (Pa). Frames of a hyperelastic body have ``green_lagrange_strain`` as
    well, and ``largest_strain`` is of that. The inside is in equilibrium with the surface. A bare store knows the
    surface alone: its faces with ``displacement`` and ``largest_strain``.
    """

    _source: ResultSource
    # Young's modulus now over that of the source.
    _stiffness_scale: float = 1.0
    # Whether its displacements are those of a material beyond small strain.
    _is_hyperelastic: bool = False

    def to_meshio(self) -> meshio.Mesh:
        """Body at rest with its displacement, strain and stress at the nodes, as a mesh of meshio."""
        source = self._source
        if source.body is None:
            faces = np.searchsorted(source.surface_nodes, source.surface_faces)
            strain = SurfaceStrain(source.surface_positions, faces).at_nodes(self.displacements)
            written = surface_mesh(source.surface_positions, faces, self.displacements, strain)
        else:
            recovery, mesh = source.stress_everywhere, source.body.mesh
            everywhere = recovery.interior.extend(self.displacements)
            field = recovery.recover_inside(everywhere)
            field = replace(field, stress=self._stiffness_scale * field.stress)
            written = volume_mesh(mesh.nodes, mesh.tets, everywhere, field, mesh.regions, self._is_hyperelastic)
        rows = source.surface_nodes if source.body is not None else slice(None)
        for name, values in self._at_surface_nodes().items():
            data = np.zeros((len(written.points), *values.shape[1:]))
            data[rows] = values
            written.point_data[name] = data
        return written

    def _at_surface_nodes(self) -> dict[str, np.ndarray]:
        """Further data at the surface nodes, (s, ...), by name."""
        return {}

    def deformed_surface(self) -> DeformedSurface:
        """Surface to be drawn."""
        triangles = np.searchsorted(self._source.surface_nodes, self._source.surface_triangles)
        return DeformedSurface(self._source.surface_positions, triangles, self.displacements)

    def _drawn_surfaces(self) -> list[DeformedSurface]:
        return [self.deformed_surface()]
