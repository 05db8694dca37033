"""Segmentations filled: boundaries of segments by a process of their own, wrapped, with elements that follow them."""

from __future__ import annotations

import functools
import os
import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from palpate.errors import MeshError, MeshWarning
from palpate.mesh.fill_job import Ball, Element, FillJob, require_fitting_size
from palpate.mesh.inner import InnerRegion, InnerRegions
from palpate.mesh.label_process import label_arrays
from palpate.mesh.surface_file import SurfaceFile
from palpate.mesh.tetmesh import TetMesh
from palpate.mesh.wrapping import Wrapping
from palpate.segmentation.smoothing import inside_field

Draw = Callable[[np.ndarray, np.ndarray], None]
# Elements in and around an inner segment, in parts of half its thickness, by their kind: a ball of radius r gets edges
# of so many r. What they do to the contrast of a nodule: docs/accuracy.md.
SIZE_WITHIN = {"linear": 0.35, "quadratic": 0.4}
# Segments thinner than this part of the body's elements are not resolved: elements there would be too many.
THINNEST = 0.05


def segmented(path: str | os.PathLike[str], unit: str | None, job: FillJob, drawn: Draw | None = None) -> TetMesh:
    """Fill chosen segments of a label map; several become regions with their names.

    ``drawn`` is called with the boundary, vertices (k, 3), m, and triangles, before it is filled. Raises MeshError for
    a file that cannot be read, a segment that is not there or empty, or what :class:`Wrapping` raises.
    """
    import trimesh

    if job.options.mesher == "netgen":
        raise MeshError(f"{path}: NETGEN fills surfaces; leave out mesher = 'netgen' for a segmentation")
    found = label_arrays("boundaries", path, unit, job.options.segments, job.time_limit)
    name = str(path)
    if drawn is not None:
        drawn(found["vertices"], found["faces"])
    shape = trimesh.Trimesh(found["vertices"], found["faces"], process=False)
    require_fitting_size(name, shape, job)
    size = job.size_in(float(np.ptp(found["vertices"], axis=0).max()))
    inner, balls = _inner(found, job.element, size)
    _note_boundaries(name, found)
    job = replace(job, size=size, refine=[*job.refine, *balls])
    mesh = Wrapping(SurfaceFile(name, shape), "bounds smoothed segments", job, inner).mesh()
    if inner is None:
        return TetMesh(mesh.nodes, mesh.tets, mesh.regions, {str(found["names"][0]): 0})
    inner.require_elements(name, mesh)
    _note_volumes(name, found, mesh)
    # In the order in which they were given, by which materials belong to them.
    numbers = {str(title): mesh.region_names[str(title)] for title in found["names"]}
    return TetMesh(mesh.nodes, mesh.tets, mesh.regions, numbers)


def _inner(found: dict[str, np.ndarray], element: Element, size: float) -> tuple[InnerRegions | None, list[Ball]]:
    """Regions of all segments but the largest, and the balls of finer elements for them."""
    names, rest = found["names"], int(found["rest"])
    regions, balls = [], []
    for rank in range(len(names)):
        if rank == rest:
            continue
        sizes = np.clip(SIZE_WITHIN[element] * found[f"balls_{rank}"][:, 4], THINNEST * size, size)
        for (*center, radius, _), own in zip(found[f"balls_{rank}"].tolist(), sizes.tolist(), strict=True):
            if own < size:
                balls.append((tuple(center), radius, own))
        field, affine = found[f"field_{rank}"], found[f"affine_{rank}"]
        inside = functools.partial(inside_field, field, affine)
        triangles = found[f"vertices_{rank}"], found[f"faces_{rank}"]
        regions.append(InnerRegion(str(names[rank]), *triangles, inside, float(sizes.max())))
    return (InnerRegions(str(names[rest]), regions) if regions else None), balls


def _note_boundaries(name: str, found: dict[str, np.ndarray]) -> None:
    """Report what was smoothed, its volume before and after, and what was left out."""
    before, after, width = found["whole"].tolist()
    voxels = " x ".join(f"{1e3 * side:.3g}" for side in found["spacing"])
    titles = ", ".join(f"'{title}'" for title in found["names"])
    _warn(
        f"{name}: {titles}: {_volume(before)} in voxels of {voxels} mm, {_volume(after)} within the boundary "
        f"(smoothed by {1e3 * width:.2g} mm)"
    )
    if found["at_edge"]:
        _warn(f"{name}: a segment reaches the edge of the image: the body is cut flat there")
    for title, volume in zip(found["cavity_names"], found["cavity_volumes"], strict=True):
        _warn(f"{name}: '{title}' ({_volume(volume)}) lies in a cavity of the body, which stays empty; add --segment")


def _note_volumes(name: str, found: dict[str, np.ndarray], mesh: TetMesh) -> None:
    """Report the volume of each segment in voxels and in elements."""
    lines = []
    for title, before in zip(found["names"], found["volumes"], strict=True):
        after = mesh.volumes[mesh.regions == mesh.region_names[str(title)]].sum()
        lines.append(f"'{title}' {_volume(before)} in voxels, {_volume(after)} in elements")
    _warn(f"{name}: {'; '.join(lines)}")


def _volume(cubic_metres: float) -> str:
    return f"{1e6 * cubic_metres:.4g} cm3"


def _warn(text: str) -> None:
    warnings.warn(text, MeshWarning, stacklevel=6)
