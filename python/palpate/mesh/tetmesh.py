"""Tetrahedral meshes with their touchable surface."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path

import numpy as np

from palpate import _native
from palpate.errors import MeshError, MeshWarning
from palpate.mesh.elements import (
    EDGES,
    FACES,
    MIRRORED,
    boundary_faces,
    corner_volumes,
    drawing_triangles,
    longest_edges,
    smallest_dihedral_angles,
    unique_edges,
)
from palpate.mesh.files import Volume, read_volume, write_volume
from palpate.mesh.shapes import Shape, elements_inside
from palpate.units import brief_repr
from palpate.vectors import number_array

# An element flatter than this part of the cube of its longest edge has no usable shape functions.
DEGENERATE = 1e-12

# Below so many degrees between two faces an element's shape functions are poor, and so is what it feels like.
FLAT_ANGLE = 2.0

# Where the middle of an edge may lie, in parts of the edge's length from the middle between its ends: beyond a quarter
# along the edge its quadratic map folds back, and half across is a half circle.
MIDDLE_ALONG, MIDDLE_ACROSS = 0.25, 0.5


class TetMesh:
    """Tetrahedra with 4 or 10 nodes, in metres.

    Parameters
    ----------
    nodes
        (n, 3) m.
    tets
        (m, 4) or (m, 10) 0-based node indices: corners, then the middles of the edges 01, 12, 02, 03, 13, 23, which
        need not be straight. Inverted elements are turned round; nodes that no element uses are dropped with a
        :class:`palpate.MeshWarning`, the others keep their order.
    regions
        (m,) integer label of each element; zeros if None.
    region_names
        Labels by the names that users gave their regions.

    Raises
    ------
    MeshError
        Coordinates that are not finite, indices out of range, degenerate or folded elements, mid-side nodes away
        from their edge or not shared by all elements around it, or a surface that is not a closed manifold, each with
        the index of the first.

    """

    def __init__(
        self,
        nodes: np.ndarray,
        tets: np.ndarray,
        regions: np.ndarray | None = None,
        region_names: Mapping[str, int] | None = None,
    ):
        nodes = number_array(nodes, "nodes", MeshError).copy()
        tets = _index_array(tets)
        if nodes.ndim != 2 or nodes.shape[1] != 3:
            raise MeshError(f"nodes must have shape (n, 3), got {nodes.shape}")
        regions = _region_array(regions, len(tets))
        if regions.shape != (len(tets),):
            raise MeshError(f"regions must have shape ({len(tets)},), got {regions.shape}")
        _check_indices(nodes, tets)
        nodes, tets = _drop_orphans(nodes, tets)
        self.nodes, self.tets, self.regions = map(_read_only, (nodes, _orient(nodes, tets), regions))
        if not isinstance(region_names, Mapping | None):
            raise MeshError(f"region_names must map names to labels, got {brief_repr(region_names)}")
        self.region_names = dict(region_names or {})

    def __repr__(self) -> str:
        order = "10-node " if self.is_quadratic else ""
        surface = f"{len(self.surface_nodes)} on the surface"
        return f"TetMesh({len(self.nodes)} nodes, {len(self.tets)} {order}tets, {surface})"

    @property
    def is_quadratic(self) -> bool:
        """Whether elements have 10 nodes."""
        return self.tets.shape[1] == 10

    def to_quadratic(self) -> TetMesh:
        """Return the same body in 10-node tetrahedra with straight edges, or this mesh if it has them already.

        Nodes keep their indices; the middles of the edges follow them, one for all elements around an edge.
        """
        if self.is_quadratic:
            return self
        edges, of_element = unique_edges(self.tets)
        nodes = np.vstack([self.nodes, self.nodes[edges].mean(axis=1)])
        tets = np.hstack([self.tets, len(self.nodes) + of_element])
        return TetMesh(nodes, tets, self.regions, self.region_names)

    @cached_property
    def surface_faces(self) -> np.ndarray:
        """Elements' faces on the boundary, outward: (k, 3), or (k, 6) with the middles of the edges 01, 12, 20."""
        return _read_only(boundary_faces(self.tets))

    @cached_property
    def surface_triangles(self) -> np.ndarray:
        """Boundary triangles, (k, 3) node indices, outward; four for a face with mid-side nodes."""
        return _read_only(drawing_triangles(self.surface_faces))

    @cached_property
    def surface_nodes(self) -> np.ndarray:
        """Nodes on the boundary, ascending (s,)."""
        return _read_only(np.unique(self.surface_triangles))

    @cached_property
    def volumes(self) -> np.ndarray:
        """Volume of each element, (m,) m^3."""
        return _native.volumes(self.nodes, self.tets.astype(np.uint32))

    @property
    def volume(self) -> float:
        """Volume, m^3."""
        return float(self.volumes.sum())

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest corner, (2, 3) m."""
        return np.array([self.nodes.min(axis=0), self.nodes.max(axis=0)])

    def dihedral_angles(self) -> np.ndarray:
        """Smallest dihedral angle of each element, (m,) degrees, by its corners: below about 5 an element is poor."""
        return smallest_dihedral_angles(self.nodes, self.tets)

    def warn_of_flat_elements(self, name: str) -> None:
        """Warn of elements whose smallest dihedral angle is below two degrees; ``name`` stands for the mesh."""
        angles = self.dihedral_angles()
        count = int((angles < FLAT_ANGLE).sum())
        if count:
            warnings.warn(
                f"{name}: {count} tetrahedra have a dihedral angle below {FLAT_ANGLE:g} degrees (smallest: "
                f"{angles.min():.2g}); forces near them are less accurate",
                MeshWarning,
                stacklevel=3,
            )

    @classmethod
    def read(cls, path: str | os.PathLike[str], unit: str | None = None) -> TetMesh:
        """Read a volume mesh; ``unit`` is the file's unit of length, metres if None.

        Gmsh .msh, VTU, VTK, Abaqus .inp, TetGen .node/.ele, Netgen .vol and Medit .mesh are understood; 10-node
        tetrahedra in all but TetGen's and Medit's. Node order is the file's. Regions come from cell data ``region``,
        ``gmsh:physical`` or ``medit:ref``, else from the only integer cell array; their names from Gmsh's physical
        names. Hexahedra, wedges and pyramids are split into 4-node tetrahedra, and a :class:`palpate.MeshWarning` says
        so; those with mid-side nodes by their corners.

        Raises
        ------
        MeshError
            A file that is missing, not readable, holds no solid cells, or cells of another kind.
        UnclearUnitError
            No unit is given, and in metres the body is below a millimetre or above three metres long; with a unit given
            that is a warning.

        """
        volume = read_volume(Path(path), unit)
        mesh = cls(volume.nodes, volume.tets, volume.regions, volume.region_names)
        mesh.warn_of_flat_elements(str(path))
        return mesh

    def with_regions(self, placed: Mapping[int | str, Shape | Iterable[Shape]]) -> TetMesh:
        """Return the same mesh with solids marked as regions, later ones over earlier ones.

        Parameters
        ----------
        placed
            For each region, a number or a name, the solid or solids of :mod:`palpate.shapes` (or functions of (m, 3)
            positions) that make it up. An element belongs to a solid if its centroid does. A name that is new takes the
            lowest number above all others.

        Raises
        ------
        MeshError
            A solid that holds no element: it lies outside, or the elements there are too large.

        """
        regions, names = self.regions.copy(), dict(self.region_names)
        for region, solids in placed.items():
            number = region
            if isinstance(region, str):
                taken = [*regions.tolist(), *names.values(), *(r for r in placed if not isinstance(r, str))]
                number = names.setdefault(region, max(taken) + 1)
            for solid in [solids] if callable(solids) else solids:
                try:
                    regions[elements_inside(solid, self.nodes, self.tets)] = number
                except MeshError as error:
                    raise MeshError(f"region {region}: {error}") from None
        return TetMesh(self.nodes, self.tets, regions, names)

    def write(self, path: str | os.PathLike[str], unit: str = "m") -> None:
        """Write the mesh and its regions in the format of the file's ending; replaced only when complete."""
        write_volume(Volume(self.nodes, self.tets, self.regions, self.region_names), Path(path), unit)


def _read_only(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


def _region_array(regions: np.ndarray | None, count: int) -> np.ndarray:
    if regions is None:
        return np.zeros(count, dtype=np.int64)
    given = number_array(regions, "regions", MeshError)
    if not (given == np.trunc(given)).all():
        raise MeshError(f"regions must be whole numbers, got {brief_repr(regions)}")
    return np.array(regions).astype(np.int64)


def _index_array(tets: np.ndarray) -> np.ndarray:
    tets = np.array(tets, order="C", copy=True)
    if tets.ndim != 2 or tets.shape[1] not in FACES or not np.issubdtype(tets.dtype, np.integer):
        raise MeshError(f"tets must be integers of shape (m, 4) or (m, 10), got {tets.dtype} {tets.shape}")
    if len(tets) == 0:
        raise MeshError("the mesh has no tetrahedra")
    return tets.astype(np.int64)


def _check_indices(nodes: np.ndarray, tets: np.ndarray) -> None:
    bad = np.flatnonzero(((tets < 0) | (tets >= len(nodes))).any(axis=1))
    if bad.size:
        raise MeshError(f"tetrahedron {bad[0]} names a node that does not exist (nodes are 0 to {len(nodes) - 1})")
    bad = np.flatnonzero(~np.isfinite(nodes).all(axis=1))
    if bad.size:
        raise MeshError(f"node {bad[0]} has a coordinate that is not finite")
    repeated = np.flatnonzero((np.diff(np.sort(tets, axis=1), axis=1) == 0).any(axis=1))
    if repeated.size:
        raise MeshError(f"tetrahedron {repeated[0]} names the same node twice")


def _drop_orphans(nodes: np.ndarray, tets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    used = np.zeros(len(nodes), dtype=bool)
    used[tets] = True
    if used.all():
        return nodes, tets
    orphans = np.flatnonzero(~used)
    warnings.warn(
        f"{len(orphans)} nodes belong to no tetrahedron and were dropped (first: node {orphans[0]})",
        MeshWarning,
        stacklevel=3,
    )
    return np.ascontiguousarray(nodes[used]), (np.cumsum(used) - 1)[tets]


def _orient(nodes: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Turn inverted elements round; refuse those without volume, and folded ones."""
    volumes = corner_volumes(nodes, tets)
    longest = longest_edges(nodes, tets)
    flat = np.flatnonzero(np.abs(volumes) <= DEGENERATE * longest**3)
    if flat.size:
        raise MeshError(f"{len(flat)} tetrahedra have no volume (first: tetrahedron {flat[0]}); mesh the body again")
    inverted = volumes < 0
    tets[inverted] = tets[inverted][:, MIRRORED[tets.shape[1]]]
    if tets.shape[1] == 10:
        _check_middles(nodes, tets)
        least = _native.determinant_ranges(nodes, tets.astype(np.uint32)).reshape(-1, 2)[:, 0]
        folded = np.flatnonzero(least <= 6 * DEGENERATE * longest**3)
        if folded.size:
            raise MeshError(
                f"{len(folded)} tetrahedra are folded over by their mid-side nodes (first: tetrahedron {folded[0]})"
            )
    return tets


def _check_middles(nodes: np.ndarray, tets: np.ndarray) -> None:
    """Refuse mid-side nodes that are corners, that neighbours do not share, or that are away from their edge."""
    corner = np.zeros(len(nodes), dtype=bool)
    corner[tets[:, :4]] = True
    both = np.argwhere(corner[tets[:, 4:]])
    if both.size:
        element, middle = both[0]
        raise MeshError(
            f"node {tets[element, 4 + middle]} is a mid-side node of tetrahedron {element} and a corner of another"
        )
    a, b = nodes[tets[:, EDGES[:, 0]]], nodes[tets[:, EDGES[:, 1]]]
    offset, span = nodes[tets[:, 4:]] - 0.5 * (a + b), b - a
    squared = np.einsum("eij,eij->ei", span, span)
    along = np.einsum("eij,eij->ei", offset, span) / squared
    across = np.linalg.norm(offset - along[:, :, None] * span, axis=2) / np.sqrt(squared)
    away = np.argwhere((np.abs(along) >= MIDDLE_ALONG) | (across >= MIDDLE_ACROSS))
    if away.size:
        element, edge = away[0]
        i, j = tets[element, EDGES[edge]]
        raise MeshError(
            f"node {tets[element, 4 + edge]} of tetrahedron {element} is not near the middle between its nodes {i} and "
            f"{j}: mid-side nodes follow the corners in the order of the edges 01, 12, 02, 03, 13, 23"
        )
    _, edges = unique_edges(tets[:, :4])
    of_edge = np.zeros(edges.max() + 1, dtype=np.int64)
    of_edge[edges] = tets[:, 4:]
    unshared = np.argwhere(of_edge[edges] != tets[:, 4:])
    if unshared.size:
        element, edge = unshared[0]
        a, b = tets[element, EDGES[edge]]
        raise MeshError(
            f"tetrahedron {element} does not share node {tets[element, 4 + edge]}, in the middle between nodes {a} "
            f"and {b}, with its neighbours"
        )
