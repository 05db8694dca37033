"""Volume mesh files, by meshio; by readers of ours what it cannot read: Netgen's own .vol and Gmsh's first format."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.atomic import written_beside
from palpate.errors import MeshError, MeshWarning
from palpate.input_file import require_file, require_writable
from palpate.mesh.cells import CURVED, Block, shape_of, split
from palpate.mesh.elements import boundary_faces
from palpate.mesh.size import scale_of
from palpate.units import length_scale

if TYPE_CHECKING:
    import meshio

# The format of each ending, in the words of meshio. Its ASCII Gmsh files with point data do
# not read back, so Gmsh is written in binary.
WRITERS = {
    ".msh": "gmsh22",
    ".vtu": "vtu",
    ".vtk": "vtk",
    ".inp": "abaqus",
    ".node": "tetgen",
    ".ele": "tetgen",
    ".vol": "netgen",
    ".mesh": "medit",
}
# Endings whose writer, or format as meshio knows it, has 4-node tetrahedra only.
LINEAR_ONLY = {".node", ".ele", ".mesh"}
# Netgen's node at each place of ours, by the number of an element's nodes. It is negatively oriented, and its mid-side
# nodes are those of its edges 01, 02, 03, 12, 13, 23; those of a face of its edges 12, 20, 01.
FROM_NETGEN = {4: [0, 2, 1, 3], 10: [0, 2, 1, 3, 5, 7, 4, 6, 9, 8]}
FACE_FROM_NETGEN = {3: [0, 1, 2], 6: [0, 1, 2, 5, 3, 4]}
REGION_NAMES = ("region", "gmsh:physical", "medit:ref")
# Solid elements by Gmsh's number of their type: meshio's name, and its order of the nodes.
SOLIDS = {
    4: ("tetra", [0, 1, 2, 3]),
    5: ("hexahedron", list(range(8))),
    6: ("wedge", list(range(6))),
    7: ("pyramid", list(range(5))),
    11: ("tetra10", [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]),
}
# Points, lines and faces, which a solid does not need.
LOWER = {1, 2, 3, 8, 9, 10, 15, 16}


@dataclass(frozen=True, eq=False)
class Volume:
    """What a volume mesh file holds, not checked."""

    nodes: np.ndarray  # (n, 3), m in memory, in the file's unit of length on its way to or from it
    tets: np.ndarray  # (m, 4) or (m, 10) node indices
    regions: np.ndarray  # (m,) integer labels
    region_names: Mapping[str, int]  # labels by name


def read_volume(path: Path, unit: str | None) -> Volume:
    """Read nodes, tetrahedra and regions of a file whose unit of length is ``unit``; nodes are in m."""
    require_file(path, MeshError)
    if path.suffix == ".vol":
        volume = _read_netgen(path)
    else:
        volume = _tetrahedra(path, _read_meshio(path))
    used = np.unique(volume.tets)
    used = used[(used >= 0) & (used < len(volume.nodes))]
    return replace(volume, nodes=volume.nodes * scale_of(str(path), volume.nodes[used], unit))


def _read_meshio(path: Path) -> meshio.Mesh:
    import meshio

    if path.suffix not in WRITERS:
        raise MeshError(f"{path}: unknown volume format '{path.suffix}'; known are {', '.join(WRITERS)}")
    if path.suffix == ".msh" and _is_first_format(path):
        return _read_first_format(path)
    # meshio prints its complaints and may end the program; both become one error of ours.
    noise = io.StringIO()
    try:
        with contextlib.redirect_stdout(noise), contextlib.redirect_stderr(noise), _refusing_unknown_cells(path):
            return meshio.read(path)
    except MeshError:
        raise
    except (Exception, SystemExit) as error:
        output = noise.getvalue().strip()
        reason = output if isinstance(error, SystemExit) and output else str(error).strip() or type(error).__name__
        # meshio looks types of cells up by their name.
        reason = f"unknown {reason}" if isinstance(error, KeyError) else reason
        reason = " ".join(reason.split())[:200]
        raise MeshError(f"{path}: cannot be read as a {path.suffix} file ({reason})") from None


@contextlib.contextmanager
def _refusing_unknown_cells(path: Path) -> Iterator[None]:
    """Refuse cells of VTK types that meshio does not know: its two readers leave them out with a printed complaint."""
    from meshio import _vtk_common
    from meshio._mesh import topological_dimension
    from meshio.vtk import _vtk_51
    from meshio.vtu import _vtu

    known = _vtk_common.vtk_to_meshio_type
    read = [number for number, kind in known.items() if kind in topological_dimension]

    def checked(connectivity: np.ndarray, offsets: np.ndarray, types: np.ndarray, data: dict) -> tuple:
        unread = np.flatnonzero(~np.isin(types, read))
        if unread.size:
            number = int(types[unread[0]])
            name = known.get(number, f"VTK {number}")
            raise _unknown(path, name, int((types == number).sum()), int(unread[0]))
        return _vtk_common.vtk_cells_from_data(connectivity, offsets, types, data)

    try:
        _vtk_51.vtk_cells_from_data = _vtu.vtk_cells_from_data = checked
        yield
    finally:
        _vtk_51.vtk_cells_from_data = _vtu.vtk_cells_from_data = _vtk_common.vtk_cells_from_data


def _unknown(path: Path, kind: str, count: int, first: int) -> MeshError:
    return MeshError(
        f"{path}: {count} cells are of type {kind}, which is not read (first: cell {first}): save them as tetrahedra, "
        "hexahedra, wedges or pyramids"
    )


def _tetrahedra(path: Path, mesh: meshio.Mesh) -> Volume:
    blocks = _solid_blocks(path, mesh)
    types = {mesh.cells[i].type for i in blocks}
    if not blocks:
        found = ", ".join(sorted({cells.type for cells in mesh.cells})) or "nothing"
        hint = "; make tetrahedra with 'palpate mesh'" if "triangle" in found else ""
        raise MeshError(f"{path}: holds no tetrahedra (found: {found}){hint}")
    if types == {"tetra", "tetra10"}:
        raise MeshError(f"{path}: mixes 4-node and 10-node tetrahedra")
    nodes = np.asarray(mesh.points, dtype=np.float64)[:, :3]
    if len(types) == 1 and types <= {"tetra", "tetra10"}:
        tets = np.concatenate([mesh.cells[i].data for i in blocks]).astype(np.int64)
        cells = np.arange(len(tets))
    else:
        tets, cells = _split(path, nodes, [(mesh.cells[i].type, mesh.cells[i].data, blocks[i]) for i in blocks])
    regions, names = _regions(mesh, list(blocks))
    return Volume(nodes, tets, regions[cells], names)


def _solid_blocks(path: Path, mesh: meshio.Mesh) -> dict[int, int]:
    """Find the runs of cells that have a volume, and the index of the first cell of each."""
    blocks, first = {}, 0
    for i, cells in enumerate(mesh.cells):
        if cells.dim == 3:
            if shape_of(cells.type) is None:
                raise _unknown(path, cells.type, len(cells.data), first)
            blocks[i] = first
        first += len(cells.data)
    return blocks


def _split(path: Path, nodes: np.ndarray, blocks: list[Block]) -> tuple[np.ndarray, np.ndarray]:
    """Tetrahedra of cells of any known kind, and for each its cell."""
    try:
        tets, cells = split(nodes, blocks)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from None
    counts = Counter()
    for kind, connectivity, _ in blocks:
        counts[kind] += len(connectivity)
    given = ", ".join(f"{count} {kind}" for kind, count in counts.items())
    straightened = "; edges are straight, their mid-side nodes dropped" if counts.keys() & CURVED.keys() else ""
    warnings.warn(
        f"{path}: cells ({given}) were split into {len(tets)} tetrahedra{straightened}", MeshWarning, stacklevel=5
    )
    return tets, cells


def _regions(mesh: meshio.Mesh, blocks: list[int]) -> tuple[np.ndarray, dict[str, int]]:
    """Label of each cell of these blocks, and the names of labels."""
    candidates = {
        name: np.concatenate([np.asarray(data[i]).ravel() for i in blocks])
        for name, data in mesh.cell_data.items()
        if all(np.issubdtype(np.asarray(data[i]).dtype, np.integer) for i in blocks)
    }
    named = [name for name in REGION_NAMES if name in candidates]
    chosen = named[0] if named else next(iter(candidates)) if len(candidates) == 1 else None
    count = sum(len(mesh.cells[i].data) for i in blocks)
    regions = np.zeros(count, dtype=np.int64) if chosen is None else candidates[chosen].astype(np.int64)
    # Gmsh's physical names: the number of the group and its dimension.
    numbers = {name: np.asarray(value).ravel() for name, value in mesh.field_data.items()}
    names = {name: int(v[0]) for name, v in numbers.items() if chosen == "gmsh:physical" and len(v) == 2 and v[1] == 3}
    return regions, names


def _read_netgen(path: Path) -> Volume:
    """Read the ``points`` and ``volumeelements`` sections of a Netgen mesh (1-based, negatively oriented)."""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    heads = {line.strip(): i for i, line in enumerate(lines) if line.strip() in {"points", "volumeelements"}}
    if len(heads) != 2:
        raise MeshError(f"{path}: holds no points and volume elements of a Netgen mesh")
    try:
        elements = _netgen_section(lines, heads["volumeelements"])
        counts = np.array([int(e[1]) for e in elements])
        others = np.flatnonzero(~np.isin(counts, list(FROM_NETGEN)))
        if others.size:
            raise _unknown(path, f"Netgen's with {counts[others[0]]} nodes", others.size, int(others[0]))
        if len(np.unique(counts)) > 1:
            raise MeshError(f"{path}: mixes 4-node and 10-node tetrahedra")
        count = int(counts[0])
        nodes = np.array([[float(v) for v in row[:3]] for row in _netgen_section(lines, heads["points"])])
        tets = np.array([[int(v) - 1 for v in e[2 : 2 + count]] for e in elements])
        regions = np.array([int(e[0]) for e in elements])
    except (ValueError, IndexError) as error:
        raise MeshError(f"{path}: damaged Netgen mesh ({error})") from None
    return Volume(nodes.reshape(-1, 3), tets[:, FROM_NETGEN[count]], regions, {})


def _netgen_section(lines: list[str], head: int) -> list[list[str]]:
    count = int(lines[head + 1])
    rows = [line.split() for line in lines[head + 2 : head + 2 + count]]
    if len(rows) < count:
        raise ValueError(f"'{lines[head].strip()}' is cut short")
    return rows


def write_volume(mesh: Volume, path: Path, unit: str) -> None:
    """Write beside the file, then rename."""
    import meshio

    if path.suffix not in WRITERS:
        raise MeshError(f"{path}: unknown volume format '{path.suffix}'; known are {', '.join(WRITERS)}")
    require_writable(path, MeshError)
    is_quadratic = mesh.tets.shape[1] == 10
    if is_quadratic and path.suffix in LINEAR_ONLY:
        known = ", ".join(ending for ending in WRITERS if ending not in LINEAR_ONLY)
        raise MeshError(f"{path}: 10-node tetrahedra cannot be written to {path.suffix} files; use {known}")
    name = {".msh": "gmsh:physical", ".mesh": "medit:ref"}.get(path.suffix, "region")
    data = {name: [mesh.regions]}
    if path.suffix == ".msh":
        data["gmsh:geometrical"] = [mesh.regions]
    if path.suffix in {".inp", ".vol"}:
        data = {}
    points = mesh.nodes / length_scale(unit)
    names = {name: np.array([number, 3]) for name, number in mesh.region_names.items()} if path.suffix == ".msh" else {}
    cells = [("tetra10" if is_quadratic else "tetra", mesh.tets)]
    content = meshio.Mesh(points, cells, cell_data=data, field_data=names)
    options = {"binary": True} if path.suffix == ".msh" else {}
    noise = io.StringIO()
    with contextlib.redirect_stdout(noise), contextlib.redirect_stderr(noise):
        if WRITERS[path.suffix] == "tetgen":
            _write_tetgen(content, path)
            return
        with written_beside(path) as partial:
            if path.suffix == ".vol":
                _write_netgen(partial, points, mesh)
            elif path.suffix == ".inp":
                _write_abaqus(partial, content)
            else:
                meshio.write(partial, content, WRITERS[path.suffix], **options)


def _write_tetgen(content: meshio.Mesh, path: Path) -> None:
    """TetGen keeps nodes and elements in two files beside each other."""
    import meshio

    nodes, elements = path.with_suffix(".node"), path.with_suffix(".ele")
    with written_beside(elements) as partial_elements, written_beside(nodes) as partial_nodes:
        # Beside means the same stem, for meshio writes both files from the name of one.
        meshio.write(partial_nodes, content, "tetgen")
        assert partial_nodes.with_suffix(".ele") == partial_elements


def _write_abaqus(path: Path, content: meshio.Mesh) -> None:
    """Plain elements: meshio names 10-node tetrahedra after Abaqus' modified hybrid ones, which are others."""
    import meshio

    meshio.write(path, content, "abaqus")
    path.write_text(path.read_text().replace("TYPE=C3D10MH", "TYPE=C3D10"))


def _write_netgen(path: Path, points: np.ndarray, mesh: Volume) -> None:
    """Points, volume elements and the outer surface as Netgen reads them."""
    faces = boundary_faces(mesh.tets)
    faces = faces[:, np.argsort(FACE_FROM_NETGEN[faces.shape[1]])] + 1
    tets = mesh.tets[:, np.argsort(FROM_NETGEN[mesh.tets.shape[1]])] + 1
    rows = np.column_stack([mesh.regions, np.full(len(tets), tets.shape[1]), tets])
    with path.open("w") as file:
        file.write("mesh3d\ndimension\n3\ngeomtype\n0\n\nsurfaceelements\n")
        file.write(f"{len(faces)}\n")
        file.writelines(f"1 1 1 0 {len(face)} {' '.join(map(str, face))}\n" for face in faces.tolist())
        file.write(f"\nvolumeelements\n{len(tets)}\n")
        file.writelines(f"{' '.join(map(str, row))}\n" for row in rows.tolist())
        file.write(f"\npoints\n{len(points)}\n")
        file.writelines(f"{x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
        file.write("\nendmesh\n")


def _is_first_format(path: Path) -> bool:
    """Whether a file begins as one of Gmsh's first format (`$NOD`, `$ELM`), which older programs still write."""
    with path.open("rb") as file:
        return file.read(256).lstrip().startswith(b"$NOD")


def _read_first_format(path: Path) -> meshio.Mesh:
    """Read nodes and solid elements; the physical number of an element is its region.

    Raises MeshError for a file that is cut short or has elements of another kind, with the line.
    """
    import meshio

    lines = enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1)
    try:
        nodes = [(int(words[0]), [float(x) for x in words[1:4]]) for words in _gmsh_section(lines, "$NOD")]
        rank = {number: row for row, (number, _) in enumerate(nodes)}
        cells: dict[str, list[list[int]]] = {}
        regions: dict[str, list[int]] = {}
        for words in _gmsh_section(lines, "$ELM"):
            kind, region, of_element = int(words[1]), int(words[2]), [rank[int(word)] for word in words[5:]]
            if kind in LOWER:
                continue
            if kind not in SOLIDS:
                raise MeshError(f"{path}: elements of Gmsh's type {kind} are not read: save 4- or 10-node tetrahedra")
            name, order = SOLIDS[kind]
            cells.setdefault(name, []).append([of_element[node] for node in order])
            regions.setdefault(name, []).append(region)
    except (ValueError, KeyError, IndexError):
        number = next(lines, (None, ""))[0]
        where = f":{number - 1}" if number else ""
        raise MeshError(f"{path}{where}: is no whole file of Gmsh's first format") from None
    points = np.array([place for _, place in nodes], dtype=float).reshape(-1, 3)
    blocks = [(name, np.array(rows)) for name, rows in cells.items()]
    return meshio.Mesh(points, blocks, cell_data={"gmsh:physical": [np.array(regions[name]) for name in cells]})


def _gmsh_section(lines: Iterator[tuple[int, str]], name: str) -> Iterator[list[str]]:
    """Words of each line of a section; its first line has their number."""
    for _, line in lines:
        if line.strip() == name:
            break
    count = int(next(lines, (0, ""))[1])
    for _ in range(count):
        yield next(lines, (0, ""))[1].split()
