"""Tetrahedra from a surface; the meshers run in child processes, for bad surfaces can hang or crash them."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.errors import MeshError
from palpate.mesh.fill_job import Ball, Element, FillJob, FillOptions, Mesher, Which, require_fitting_size
from palpate.mesh.filling import Filling, MesherFailedError
from palpate.mesh.segmented import Draw, segmented
from palpate.mesh.size import scale_of
from palpate.mesh.surface_file import SurfaceFile, load_surface
from palpate.mesh.surface_state import BY_HAND, MOST_FOR_NETGEN, SurfaceState, require_closed, require_finite
from palpate.mesh.tetmesh import TetMesh
from palpate.mesh.wrapping import Wrapping
from palpate.progress import Reporter, progress_reporter
from palpate.segmentation.endings import SEGMENTATION_ENDINGS, is_segmentation
from palpate.units import length
from palpate.vectors import three_numbers

if TYPE_CHECKING:
    import trimesh

TIME_LIMIT = 300.0  # s
# Seconds of processor time that a run of NETGEN gets at a size of its own before the surface is wrapped: which mesher
# it is must not depend on what else the machine does.
PATIENCE = 8.0
# What a progress bar shows, in order.
STAGES = (
    *("reading", "checking", "looking for the inside", "wrapping", "filling with tetrahedra"),
    "fitting to the surface",
)


def tetrahedralize(
    surface: str | os.PathLike[str] | trimesh.Trimesh,
    max_element_size: float | str | None = None,
    unit: str | None = None,
    refine: Sequence[Ball] = (),
    *,
    mesher: Mesher | None = None,
    part: Which = 1,
    max_volume_loss: float | str = 0.05,
    segments: Sequence[str | int] = (),
    time_limit: float = TIME_LIMIT,
    progress: bool | Callable[[int, int], None] = True,
) -> TetMesh:
    """Fill a surface, or segments of a label map, with 4-node tetrahedra.

    A closed surface of one part is filled by NETGEN. One that is open, crosses itself, has several parts or very many
    triangles is wrapped. What its triangles enclose, by their winding number, gets a new surface, which fTetWild fills.
    Nodes on the surface are put back on the given triangles. A :class:`palpate.MeshWarning` says what was done.

    Before solving, ``.to_quadratic()`` is advised, at twice the element size: at the same price the result is several
    times more accurate.

    Parameters
    ----------
    surface
        STL, OBJ, PLY, OFF, GLB or glTF file, a trimesh surface, or a segmentation: NRRD or NIfTI file.
    max_element_size
        Longest edge wanted, m or text such as ``"4mm"``; None: a fifteenth of the longest side, and where the surface
        is curved so strongly or the body so thin that more than a hundredth of the volume would be lost, down to a
        sixtieth. A :class:`palpate.MeshWarning` reports a loss that remains.
    unit
        Unit of length of the surface; None: metres, of a segmentation that of the file, or millimetres.
    refine
        Finer balls: ``((x, y, z), radius, size)`` in m.
    mesher
        ``"netgen"`` or ``"wrap"``; None: chosen by the surface.
    part
        Which part of a solid of several: its rank in volume from 1 on, or ``"all"``. Wraps only.
    max_volume_loss
        Share of the volume that the mesh of a wrap may lose, or text such as ``"10%"``.
    segments
        Segments of a label map by name, or by label; each becomes a region of the mesh.
    time_limit
        Seconds after which the mesher is stopped.
    progress
        Whether to show a bar on a terminal; or a function of (stages done, all stages).

    Raises
    ------
    MeshError
        A surface that encloses nothing or cannot be filled, with what is wrong with it, a mesher that crashed, hung or
        returned nothing, or a mesh that loses more of the volume than allowed.
    UnclearUnitError
        No unit is given, and in metres the body is below a millimetre or above three metres long; with a unit given
        that is a warning.

    """
    options = FillOptions(mesher, part, max_volume_loss, tuple(segments))
    return tetrahedralize_with("linear", surface, max_element_size, unit, refine, options, time_limit, progress)


def tetrahedralize_with(
    element: Element,
    surface: str | os.PathLike[str] | trimesh.Trimesh | SurfaceFile,
    max_element_size: float | str | None = None,
    unit: str | None = None,
    refine: Sequence[Ball] = (),
    options: FillOptions | None = None,
    time_limit: float = TIME_LIMIT,
    progress: bool | Callable[[int, int], None] = True,
    drawn: Draw | None = None,
) -> TetMesh:
    """Fill a surface as :func:`tetrahedralize` does, with either element; None: a size that suits it.

    ``drawn`` is called with the boundary of a segmentation before that is filled.

    The mid-side nodes of 10-node elements lie on the surface, so these may be several times larger than a curve is wide
    before they lose volume.
    """
    size = None if max_element_size is None else length(max_element_size)
    if size is not None and not (np.isfinite(size) and size > 0):
        raise MeshError(f"max_element_size must be positive, got {max_element_size}")
    for center, radius, ball_size in refine:
        three_numbers(center, "the centre of a ball in refine", MeshError)
        if not (np.isfinite([radius, ball_size]).all() and radius > 0 and ball_size > 0):
            raise MeshError("refine takes ((x, y, z), radius, size) with positive radius and size in metres")
    title = "filling the surface" if not isinstance(surface, (str, os.PathLike)) else f"filling {Path(surface).name}"
    with progress_reporter(title, progress) as report:
        stage = _stages(report)
        stage("reading")
        job = FillJob(element, size, refine, options or FillOptions(), time_limit, stage)
        if isinstance(surface, (str, os.PathLike)) and is_segmentation(surface):
            name, mesh = str(surface), segmented(surface, unit, job, drawn)
        else:
            given = _scaled(surface, unit, job.options)
            stage("checking")
            require_fitting_size(given.name, given.shape, job)
            name, mesh = given.name, _filled(given, job)
    mesh.warn_of_flat_elements(name)
    return mesh


def _scaled(surface: str | os.PathLike[str] | trimesh.Trimesh, unit: str | None, options: FillOptions) -> SurfaceFile:
    """Surface in metres."""
    loaded = load_surface(surface)
    if options.segments:
        raise MeshError(f"{loaded.name}: is a surface; label maps have segments ({', '.join(SEGMENTATION_ENDINGS)})")
    shape = loaded.shape.copy()
    shape.apply_scale(scale_of(loaded.name, shape.vertices, unit))
    return SurfaceFile(loaded.name, shape, loaded.part_names, loaded.part_of_face)


def _stages(report: Reporter | None) -> Callable[[str], None]:
    """Return a function that reports a stage by its name."""

    def stage(name: str) -> None:
        if report is not None:
            report.phase(name)
            report(STAGES.index(name), len(STAGES))

    return stage


def _filled(given: SurfaceFile, job: FillJob) -> TetMesh:
    """Tetrahedra by the mesher that is asked for, or by the one that suits the surface."""
    options = job.options
    surface, reason = _chosen(given, options)
    if surface is not None:
        if options.part not in (1, "all"):
            raise MeshError(f"{given.name}: there is no part {options.part}: the surface has 1")
        job.stage("filling with tetrahedra")
        own = options.mesher is None and job.size is None
        try:
            return Filling(given.name, surface, job, PATIENCE if own else None).mesh()
        except MeshError as error:
            # At a size that is given, a mesh too coarse for the shape is the size's fault.
            if options.mesher == "netgen" or not (own or isinstance(error, MesherFailedError)):
                raise
            reason = "could not be filled by NETGEN"
    return Wrapping(given, reason, job).mesh()


def _chosen(given: SurfaceFile, options: FillOptions) -> tuple[SurfaceState | None, str]:
    """Return the closed surface for NETGEN; or None, and why the surface is to be wrapped, after "the surface".

    Raises MeshError for a surface that NETGEN is asked for and cannot fill.
    """
    if options.mesher == "netgen":
        hint = f"{BY_HAND}, or leave out mesher = 'netgen': then it is wrapped"
        return require_closed(given.name, given.shape, hint), ""
    require_finite(given.name, given.shape)
    if options.mesher == "wrap":
        return None, "was given to be wrapped"
    if len(given.shape.faces) > MOST_FOR_NETGEN:
        return None, f"has {len(given.shape.faces):,} triangles"
    # A copy is cleaned: named parts are found by the triangles of the file.
    state = SurfaceState.of(given.shape.copy())
    reason = state.fault() or state.doubt()
    if reason is not None:
        return None, reason
    state.turn_outward(given.name)
    return state, ""


def read_surface(path: str | os.PathLike[str]) -> trimesh.Trimesh:
    """Read a surface as it is, in its own unit; MeshError for a file that is missing or cannot be read."""
    return load_surface(path).shape


def closed_surface(path: str | os.PathLike[str]) -> trimesh.Trimesh:
    """Read a closed surface of one part, in its own unit.

    Raises MeshError for a file that is missing or cannot be read, or a surface that is open, crossed or empty.
    """
    loaded = load_surface(path)
    return require_closed(loaded.name, loaded.shape).shape
