"""The wrapping mesher's own process: ``python -m palpate.mesh.wrap_child SURFACE.npz MESH.npz STAGES``.

What the triangles of a surface enclose is wrapped, and the wrap filled by fTetWild (Hu, Schneider, Wang, Zorin and
Panozzo 2020), where that is installed. The name of each stage is a line of the file STAGES.

Exit status 1: no tetrahedra; the reason, if it is the surface's, is ``reason`` of the result.
"""

from __future__ import annotations

import importlib.util
import os
import sys
import types
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np

from palpate._native import end_with_parent
from palpate.mesh.inner_triangles import Triangles, inner_triangles, within_surface
from palpate.mesh.solid_field import SolidField, cleaned, oriented
from palpate.mesh.wrap import Part, Wrap, WrapError, wrap

# The wrap is kept to this part of its diagonal, or of the edge wanted, whichever is less.
ENVELOPE, ENVELOPE_OF_EDGE = 4.5e-3, 0.06
# AMIPS energy at which an element is good enough; 3 is that of a regular one.
STOP_ENERGY = 15.0


def main(surface_file: str, mesh_file: str, stages: str) -> int:
    """Mesh what the triangles of ``given`` enclose into ``made``."""
    with np.load(surface_file) as job:
        vertices, faces, labels = job["vertices"], job["faces"].astype(np.int64), job["labels"]
        size, part, cells, balls = float(job["size"]), int(job["part"]), int(job["cells"]), job["balls"]
        inner = [
            (job[f"inner_vertices_{rank}"], job[f"inner_faces_{rank}"], float(own))
            for rank, own in enumerate(job["inner_sizes"] if "inner_sizes" in job else ())
        ]
    _note(stages, "looking for the inside")
    vertices, faces, labels = cleaned(vertices, faces, labels)
    if len(faces) == 0:
        np.savez(mesh_file, reason="its triangles have no area")
        return 1
    field = SolidField(vertices, oriented(vertices, faces))
    _note(stages, "wrapping")
    try:
        wrapped = wrap(field, labels, part or None, cells)
    except WrapError as error:
        np.savez(mesh_file, reason=str(error))
        return 1
    target = _beside(field, wrapped)
    found = {name: value for name, value in vars(wrapped).items() if name not in ("parts", "band")}
    found |= {f"part_{f.name}": np.array([getattr(part, f.name) for part in wrapped.parts]) for f in fields(Part)}
    found |= {"target": field.faces[target], "target_vertices": field.vertices}
    # Another mesher may fill the wrap where this one fails.
    nodes, tets = np.empty((0, 3)), np.empty((0, 4), dtype=np.int64)
    np.savez(mesh_file, nodes=nodes, tets=tets, **found)
    tetrahedralize = _tetrahedralizer()
    if tetrahedralize is not None:
        _note(stages, "filling with tetrahedra")
        within = inner_triangles(wrapped.vertices, wrapped.faces, inner)
        # The envelope is one for all surfaces, so it follows the finest.
        finest = min([size, *(2 * own for *_, own in inner)])
        nodes, tets = _fill(tetrahedralize, wrapped, within, (size, finest), balls, Path(mesh_file).parent)
        partial = Path(mesh_file).with_suffix(".partial.npz")
        np.savez(partial, nodes=nodes, tets=tets, **found)
        partial.replace(mesh_file)
    return 0


def _note(stages: str, name: str) -> None:
    with Path(stages).open("a") as file:
        file.write(name + "\n")


def _tetrahedralizer() -> Callable | None:
    """Take fTetWild from pytetwild without its package's first lines, which load PyVista and VTK; None without it."""
    try:
        spec = importlib.util.find_spec("pytetwild")
    except ImportError:
        return None
    if spec is None:
        return None
    package = types.ModuleType("pytetwild")
    package.__path__ = list(spec.submodule_search_locations or [])
    sys.modules["pytetwild"] = package
    from pytetwild import pytetwild

    return pytetwild.tetrahedralize


def _fill(
    tetrahedralize: Callable,
    wrapped: Wrap,
    within: Triangles | None,
    sizes: tuple[float, float],
    balls: np.ndarray,
    folder: Path,
) -> tuple[np.ndarray, np.ndarray]:
    """Tetrahedra of a size, and of another where the balls are; the finest of sizes sets the envelope."""
    size, finest = sizes
    vertices, faces = np.ascontiguousarray(wrapped.vertices), wrapped.faces
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    options = {} if len(balls) == 0 else _sizing(vertices, size, balls)
    if within is not None:
        # fTetWild would count inner triangles, some of them open surfaces, in its own test of what is outside.
        options["disable_filtering"] = True
        faces = np.vstack([faces, within[1] + len(vertices)])
        vertices = np.vstack([vertices, within[0]])
    # fTetWild leaves a surface of its own in the working directory.
    os.chdir(folder)
    nodes, tets = tetrahedralize(
        vertices,
        np.ascontiguousarray(faces, dtype=np.int32),
        edge_length_abs=size,
        epsilon=min(ENVELOPE, ENVELOPE_OF_EDGE * finest / diagonal),
        stop_energy=STOP_ENERGY,
        coarsen=False,
        num_threads=os.cpu_count() or 1,
        **options,
    )
    if within is not None:
        tets = tets[within_surface(nodes[tets].mean(axis=1), wrapped.vertices, wrapped.faces)]
    used = np.unique(tets)
    return nodes[used], np.searchsorted(used, tets)


def _sizing(vertices: np.ndarray, size: float, balls: np.ndarray) -> dict[str, np.ndarray]:
    """Edge lengths on a grid of cubes, six tetrahedra each, smaller in balls (k, 5) of centre, radius and size."""
    low, high = vertices.min(axis=0) - 0.1, vertices.max(axis=0) + 0.1
    counts = np.ceil((high - low) * 24).astype(np.int64) + 1
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    values = np.full(len(points), size)
    for x, y, z, radius, small in balls:
        away = np.linalg.norm(points - [x, y, z], axis=1)
        # No place of the grid may lie in a small ball, so what is near it counts as well.
        values[away <= radius + 1 / 24] = np.minimum(values[away <= radius + 1 / 24], small)
    corner = np.arange(len(points)).reshape(counts)
    base = corner[:-1, :-1, :-1].ravel()
    steps = np.array([corner[1, 0, 0], corner[0, 1, 0], corner[0, 0, 1]])
    tets = []
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
        path = np.cumsum([0, steps[a], steps[b], steps[c]])
        tets.append(base[:, None] + path)
    return {"bg_vertices": points, "bg_tets": np.concatenate(tets).astype(np.int32), "bg_values": values}


def _beside(field: SolidField, wrapped: Wrap) -> np.ndarray:
    """Mask of the triangles of the surface that lie on the wrap, not within it or on a part that is left out."""
    corners = field.vertices[field.faces]
    # Their corners and middles, and the middles of these.
    weights = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]], dtype=float)
    weights /= weights.sum(axis=1, keepdims=True)
    near = np.zeros(len(corners), dtype=bool)
    for weight in weights:
        near |= wrapped.band.values[wrapped.band.indices(np.einsum("k,ikj->ij", weight, corners))]
    return near


if __name__ == "__main__":
    end_with_parent()
    sys.exit(main(*sys.argv[1:4]))
