"""Export of deformed bodies to files, to other libraries, and as pictures."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from palpate.fields.export import as_pyvista, write_result
from palpate.fields.picture import DeformedSurface, as_html, draw

if TYPE_CHECKING:
    import meshio
    from matplotlib.figure import Figure


class Exportable(ABC):
    """One body or several, with files, meshes and pictures of them."""

    @abstractmethod
    def to_meshio(self) -> meshio.Mesh:
        """Return the body at rest with displacement, strain and stress at its nodes, as a mesh of meshio."""

    @abstractmethod
    def _drawn_surfaces(self) -> list[DeformedSurface]:
        """Surfaces of a picture."""

    def to_pyvista(self) -> Any:
        """Give the same as :meth:`to_meshio` as pyvista's unstructured grid.

        Raises
        ------
        Error
            pyvista is not installed.

        """
        return as_pyvista(self.to_meshio())

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write what :meth:`to_meshio` gives as .vtu or .vtk, for ParaView; replaced only when complete.

        Raises
        ------
        MeshError
            Another ending, or no place for a file.

        """
        write_result(self.to_meshio(), path)

    def plot(self, magnification: float = 1.0) -> Figure:
        """Draw the deformed body, coloured by displacement, as a figure of matplotlib; ``savefig`` writes it.

        Parameters
        ----------
        magnification
            Of the displacements that are drawn; the colours tell the true ones.

        """
        return draw(self._drawn_surfaces(), magnification, repr(self))

    def _repr_html_(self) -> str:
        return as_html(repr(self), self._drawn_surfaces())
