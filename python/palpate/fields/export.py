"""Results for other programs and for people: meshio meshes with displacement, strain and stress, files, pictures.

Tensors are written by their six components in the order of VTK: xx, yy, zz, xy, yz, xz.
"""

from __future__ import annotations

import base64
import html
import io
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.atomic import written_beside
from palpate.errors import Error, MeshError
from palpate.fields.stress import SurfaceStress, largest_magnitude
from palpate.input_file import require_writable

if TYPE_CHECKING:
    import meshio
    from matplotlib.figure import Figure

FORMATS = {".vtu": "vtu", ".vtk": "vtk"}
ROWS, COLUMNS = np.array([0, 1, 2, 0, 1, 0]), np.array([0, 1, 2, 1, 2, 2])
# meshio's name of a cell by its nodes.
FACES, TETS = {3: "triangle", 6: "triangle6"}, {4: "tetra", 10: "tetra10"}
# Triangles that are drawn within about a second.
MOST_TRIANGLES = 40_000


def volume_mesh(
    nodes: np.ndarray,
    tets: np.ndarray,
    displacements: np.ndarray,
    field: SurfaceStress,
    regions: np.ndarray,
    is_hyperelastic: bool,
) -> meshio.Mesh:
    """Tetrahedra of a body with its displacement (m), strain and stress (Pa) at all nodes."""
    import meshio

    finite = {"green_lagrange_strain": components(field.green_lagrange_strain)} if is_hyperelastic else {}
    measured = field.green_lagrange_strain if is_hyperelastic else field.strain
    data = {
        "displacement": displacements,
        "strain": components(field.strain),
        "stress": components(field.stress),
        "largest_strain": largest_magnitude(measured),
        "von_mises": field.von_mises,
        **finite,
    }
    return meshio.Mesh(nodes, [(TETS[tets.shape[1]], tets)], point_data=data, cell_data={"region": [regions]})


def surface_mesh(
    positions: np.ndarray, faces: np.ndarray, displacements: np.ndarray, strain: np.ndarray
) -> meshio.Mesh:
    """Surface of a body whose elements are not known, with its displacement (m) and largest strain."""
    import meshio

    data = {"displacement": displacements, "largest_strain": strain}
    return meshio.Mesh(positions, [(FACES[faces.shape[1]], faces)], point_data=data)


def components(tensors: np.ndarray) -> np.ndarray:
    """Six components (n, 6) of symmetric tensors (n, 3, 3)."""
    return tensors[:, ROWS, COLUMNS]


def tensors(six: np.ndarray) -> np.ndarray:
    """Symmetric tensors (n, 3, 3) of their six components (n, 6)."""
    full = np.empty((len(six), 3, 3))
    full[:, ROWS, COLUMNS] = full[:, COLUMNS, ROWS] = six
    return full


def placed(
    mesh: meshio.Mesh, points: Callable[[np.ndarray], np.ndarray], vectors: Callable[[np.ndarray], np.ndarray]
) -> meshio.Mesh:
    """Mesh of a body's own frame in the scene, by what its frame does to points (n, 3) and to vectors."""
    import meshio

    data = dict(mesh.point_data)
    for name in ("displacement", "force"):
        if name in data:
            data[name] = vectors(data[name])
    for name in ("strain", "stress"):
        if name in data:
            turned = vectors(tensors(data[name]))  # each row turned, then each column
            data[name] = components(vectors(turned.swapaxes(1, 2)))
    return meshio.Mesh(points(mesh.points), mesh.cells, point_data=data, cell_data=mesh.cell_data)


def together(meshes: Sequence[meshio.Mesh]) -> meshio.Mesh:
    """Join meshes of several bodies, with the number of the body as data of cells; NaN where a body lacks data."""
    import meshio

    starts = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    cells = [
        (block.type, block.data + start) for mesh, start in zip(meshes, starts, strict=False) for block in mesh.cells
    ]
    bodies = [
        np.full(len(block.data), body, dtype=np.int64) for body, mesh in enumerate(meshes) for block in mesh.cells
    ]
    names = dict.fromkeys(name for mesh in meshes for name in mesh.point_data)
    data = {name: np.concatenate([_data(mesh, name, meshes) for mesh in meshes]) for name in names}
    points = np.vstack([mesh.points for mesh in meshes])
    return meshio.Mesh(points, cells, point_data=data, cell_data={"body": bodies})


def _data(mesh: meshio.Mesh, name: str, meshes: Sequence[meshio.Mesh]) -> np.ndarray:
    if name in mesh.point_data:
        return mesh.point_data[name]
    like = next(other.point_data[name] for other in meshes if name in other.point_data)
    return np.full((len(mesh.points), *like.shape[1:]), np.nan)


def write_result(mesh: meshio.Mesh, path: str | os.PathLike[str]) -> None:
    """Write a result by the ending of its file; an existing file is replaced only when the new one is complete.

    Raises MeshError for another ending than .vtu or .vtk, or no place for a file.
    """
    import meshio

    target = Path(path)
    if target.suffix.lower() not in FORMATS:
        raise MeshError(f"{target}: a result is written as {' or '.join(FORMATS)}, got '{target.suffix}'")
    require_writable(target, MeshError)
    with written_beside(target) as partial:
        meshio.write(partial, mesh, FORMATS[target.suffix.lower()])


def as_pyvista(mesh: meshio.Mesh) -> Any:
    """Turn a mesh into pyvista's unstructured grid; Error if pyvista is not installed."""
    try:
        import pyvista
    except ImportError:
        raise Error("to_pyvista needs pyvista: pip install pyvista") from None
    return pyvista.from_meshio(mesh)


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
            Factor on the drawn displacements. The colours show them without it.

        """
        return draw(self._drawn_surfaces(), magnification, repr(self))

    def _repr_html_(self) -> str:
        return as_html(repr(self), self._drawn_surfaces())


@dataclass(frozen=True)
class DeformedSurface:
    """A surface to be drawn."""

    positions: np.ndarray  # (s, 3) m, at rest
    triangles: np.ndarray  # (t, 3) rows of ``positions``, outward
    displacements: np.ndarray  # (s, 3) m


def draw(surfaces: Sequence[DeformedSurface], magnification: float, title: str) -> Figure:
    """Deformed surfaces coloured by the size of the displacement, in mm."""
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = Figure(figsize=(7, 5), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    moved = [1e3 * np.linalg.norm(surface.displacements, axis=1) for surface in surfaces]
    largest = max(float(values.max(initial=0.0)) for values in moved) or 1.0
    ends = []
    for surface, values in zip(surfaces, moved, strict=True):
        places = 1e3 * (surface.positions + magnification * surface.displacements)
        ends += [places.min(axis=0), places.max(axis=0)]
        patches = Poly3DCollection(places[surface.triangles], cmap="viridis", linewidths=0)
        patches.set_array(values[surface.triangles].mean(axis=1))
        patches.set_clim(0.0, largest)
        axes.add_collection3d(patches)
    low, high = np.min(ends, axis=0), np.max(ends, axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(np.maximum(high - low, 1e-3 * (high - low).max()))
    axes.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]", title=title)
    figure.colorbar(patches, ax=axes, label="displacement [mm]", shrink=0.7)
    return figure


def as_html(text: str, surfaces: Sequence[DeformedSurface]) -> str:
    """Text of a result, and its picture where that is drawn within a moment, for notebooks."""
    markup = f"<pre>{html.escape(text)}</pre>"
    if sum(len(surface.triangles) for surface in surfaces) > MOST_TRIANGLES:
        return markup
    picture = io.BytesIO()
    draw(surfaces, 1.0, "").savefig(picture, format="png", dpi=80)
    encoded = base64.b64encode(picture.getvalue()).decode()
    return f'{markup}<img alt="deformed surface" src="data:image/png;base64,{encoded}">'
