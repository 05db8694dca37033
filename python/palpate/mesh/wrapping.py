"""Any surface filled: what it encloses is wrapped and meshed in a child process, and fitted to the surface."""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from palpate.errors import MeshError, MeshWarning
from palpate.mesh.child import failure_of, run_limited
from palpate.mesh.curve import curve, refine, snap
from palpate.mesh.elements import face_parts
from palpate.mesh.fill_job import FillJob, length_text
from palpate.mesh.filling import IN_CUBE, MOST_BY_NETGEN, Filling, MesherFailedError
from palpate.mesh.fit import GOOD_LOSS, change_text, distances, mean_edge
from palpate.mesh.inner import InnerRegions, faces_between
from palpate.mesh.size import size_text
from palpate.mesh.surface_file import SurfaceFile
from palpate.mesh.surface_state import SurfaceState
from palpate.mesh.tetmesh import TetMesh
from palpate.mesh.triangles import closest_on
from palpate.vectors import place_text

# Cells of the grid along the longest side, at least and at most, and in an element.
CELLS, MOST_CELLS, CELLS_IN_ELEMENT = 80, 200, 5.0
# Nodes are put back on the given surface from at most so many cells, and this part of an element.
REACH_CELLS, REACH_ELEMENT = 2.0, 0.4
# A part of the tetrahedra that is smaller than this share of the largest is none.
CRUMB = 0.01
# Walls are reported as lost from this share of the surface on: at sharp edges a wrap is always a little off.
LEAST_LOST_SHARE = 0.005
# Holes are reported from this share of the new surface on: what lies behind them is a guess.
LEAST_CLOSED_SHARE = 0.02
# So many parts that are left out are named.
MOST_NAMED = 3
INSTALL = "Install it by 'pip install pytetwild' (for Linux and Windows)"


@dataclass(frozen=True, eq=False)
class Wrapping:
    """What is to be wrapped and filled, and how."""

    surface: SurfaceFile  # triangles, m
    reason: str  # why it is wrapped, after "the surface"
    job: FillJob
    inner: InnerRegions | None = None  # regions whose boundaries elements follow

    @property
    def name(self) -> str:
        """Of the surface in messages."""
        return self.surface.name

    def mesh(self) -> TetMesh:
        """Fill what the surface encloses.

        Raises MeshError for a surface without an inside, a part that is not there, a mesher that failed, or a mesh that
        loses more of the volume than allowed.
        """
        points = np.asarray(self.surface.shape.vertices)
        origin, extent = points.min(axis=0), float(np.ptp(points, axis=0).max())
        if not extent > 0:
            raise MeshError(f"{self.name}: all of its points coincide")
        size = self.job.size_in(extent)
        arrays = self._run(origin, extent, size)
        wrap = _Wrapped(arrays, origin, extent)
        halvings = int(wrap.volume * IN_CUBE / size**3 > MOST_BY_NETGEN)
        if halvings:
            arrays = self._run(origin, extent, 2 * size)
        mesh = self._tetrahedra(arrays, wrap, size)
        self.job.stage("fitting to the surface")
        reach = min(REACH_CELLS * wrap.cell, REACH_ELEMENT * size)
        project = wrap.projection(reach)
        mesh = snap(mesh, project)
        for _ in range(halvings):
            mesh = snap(refine(mesh, project), project)
        within = None
        if self.inner is not None:
            mesh = self.inner.snapped(self.inner.marked(mesh))
            within = faces_between(mesh), self.inner.project
        if self.job.element == "quadratic":
            mesh = curve(mesh, project, within)
        self._report(mesh, wrap)
        return mesh

    def _run(self, origin: np.ndarray, extent: float, size: float) -> dict[str, np.ndarray]:
        """Results of the child, in a unit box; without tetrahedra where fTetWild failed or is not there."""
        faces = np.asarray(self.surface.shape.faces)
        labels, part = self.surface.part_of_face, self.job.options.part
        cells = np.clip(CELLS_IN_ELEMENT * extent / size, CELLS, MOST_CELLS)
        with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
            surface_file, mesh_file, stages = (Path(folder) / name for name in ("surface.npz", "mesh.npz", "stages"))
            np.savez(
                surface_file,
                vertices=(np.asarray(self.surface.shape.vertices) - origin) / extent,
                faces=faces,
                labels=labels if len(labels) == len(faces) else np.full(len(faces), -1),
                size=size / extent,
                part=0 if part == "all" else part,
                cells=int(cells),
                balls=self.job.balls(origin, extent, extent),
                **({} if self.inner is None else self.inner.job(origin, extent)),
            )
            command = [sys.executable, "-m", "palpate.mesh.wrap_child", *map(str, (surface_file, mesh_file, stages))]
            status = run_limited(command, self.job.time_limit, lambda: self._watch(stages))
            found: dict[str, np.ndarray] = {}
            if mesh_file.exists():
                with np.load(mesh_file) as result:
                    found = dict(result)
        if "reason" in found:
            raise MeshError(f"{self.name}: the surface cannot be filled: {found['reason']}")
        failure = failure_of(status, self.job.time_limit)
        if "volume" not in found:
            raise MeshError(
                f"{self.name}: the surface could not be wrapped: its process {failure or 'returned no tetrahedra'}"
            )
        if failure is not None:
            warnings.warn(f"{self.name}: fTetWild {failure}; NETGEN fills the wrap", MeshWarning, stacklevel=4)
        elif len(found["nodes"]) == 0:
            warnings.warn(
                f"{self.name}: fTetWild is not installed, so NETGEN fills the wrap: it is slower, makes flatter "
                f"elements, and may fail. {INSTALL}",
                MeshWarning,
                stacklevel=4,
            )
            found["missing"] = np.array(True)
        return found

    def _watch(self, stages: Path) -> None:
        if stages.exists():
            lines = stages.read_text().splitlines()
            if lines:
                self.job.stage(lines[-1])

    def _tetrahedra(self, arrays: dict[str, np.ndarray], wrap: _Wrapped, size: float) -> TetMesh:
        if len(arrays["nodes"]):
            mesh = TetMesh(arrays["nodes"] * wrap.extent + wrap.origin, arrays["tets"])
            return mesh if self.job.options.part == "all" else _without_crumbs(self.name, mesh)
        import trimesh

        shape = trimesh.Trimesh(wrap.to_metres(arrays["vertices"]), arrays["faces"], process=False)
        filling = Filling(self.name, SurfaceState.of(shape), replace(self.job, element="linear", size=size))
        with warnings.catch_warnings():
            # What is lost is measured when its nodes are on the given surface.
            warnings.simplefilter("ignore", MeshWarning)
            try:
                return filling.mesh()
            except MesherFailedError:
                advice = INSTALL if "missing" in arrays else "Try another --max-size"
                raise MeshError(
                    f"{self.name}: the surface {self.reason}; it was wrapped, and NETGEN cannot fill the wrap. {advice}"
                ) from None

    def _report(self, mesh: TetMesh, wrap: _Wrapped) -> None:
        """Warn of what was done and lost, a line each, or refuse the mesh."""
        loss = 1.0 - mesh.volume / wrap.volume
        gap = float(distances(mesh, wrap.points).max()) if len(wrap.points) else 0.0
        what = f"the mesh {change_text(loss, gap)}"
        finer = f"--max-size {length_text(0.5 * mean_edge(mesh)).replace(' ', '')} makes a finer one"
        if abs(loss) > float(self.job.options.max_volume_loss):
            allow = f"--max-volume-loss {np.ceil(100 * abs(loss)):.0f}% takes it"
            raise MeshError(f"{self.name}: the surface {self.reason}; {what}: {finer}, {allow}")
        self._warn(f"the surface {self.reason} and was wrapped; {what}{f'; {finer}' if abs(loss) > GOOD_LOSS else ''}")
        self._report_parts(wrap)
        if wrap.closed_share > LEAST_CLOSED_SHARE:
            self._warn(f"{100 * wrap.closed_share:.0f} % of the new surface closes holes, where its shape is a guess")
        if wrap.lost_share > LEAST_LOST_SHARE:
            place = place_text(1e3 * wrap.lost_points[0], "mm")
            self._warn(
                f"walls thinner than about {length_text(2 * wrap.cell)} were lost, {100 * wrap.lost_share:.1f} % of "
                f"the surface, as near {place}"
            )

    def _report_parts(self, wrap: _Wrapped) -> None:
        part = self.job.options.part
        if part == "all" or len(wrap.parts) == 1:
            return
        total = sum(volume for volume, *_ in wrap.parts)
        left_out = [rank for rank in range(len(wrap.parts)) if rank != part - 1]
        for rank in left_out[:MOST_NAMED]:
            volume, middle, sides, label = wrap.parts[rank]
            title = f", '{self.surface.part_names[label]}'" if label >= 0 else ""
            place = place_text(1e3 * middle, "mm")
            self._warn(
                f"part {rank + 1} of {len(wrap.parts)}{title} ({size_text(sides)} around {place}, "
                f"{100 * volume / total:.2g} % of the volume) was left out; --part {rank + 1} or --part all takes it"
            )
        if len(left_out) > MOST_NAMED:
            self._warn(f"{len(left_out) - MOST_NAMED} smaller parts were left out")

    def _warn(self, text: str) -> None:
        warnings.warn(f"{self.name}: {text}", MeshWarning, stacklevel=6)


class _Wrapped:
    """What the child found, m."""

    def __init__(self, arrays: dict[str, np.ndarray], origin: np.ndarray, extent: float):
        self.origin, self.extent = origin, extent
        self.volume, self.cell = float(arrays["volume"]) * extent**3, float(arrays["cell"]) * extent
        self.points, self.lost_points = self.to_metres(arrays["points"]), self.to_metres(arrays["lost_points"])
        self.lost_share, self.closed_share = float(arrays["lost_share"]), float(arrays["closed_share"])
        self.parts = [
            (float(volume) * extent**3, self.to_metres(middle), sides * extent, int(label))
            for volume, middle, sides, label in zip(
                *(arrays[f"part_{name}"] for name in ("volume", "middle", "sides", "label")), strict=True
            )
        ]
        used = np.unique(arrays["target"])
        self._target = self.to_metres(arrays["target_vertices"][used])
        self._faces = np.searchsorted(used, arrays["target"])

    def to_metres(self, points: np.ndarray) -> np.ndarray:
        """Points of the unit box, m."""
        return points * self.extent + self.origin

    def projection(self, reach: float) -> Callable[[np.ndarray], np.ndarray]:
        """Closest points of the given surface, where that is not farther than ``reach``; else the points themselves."""
        closest_to = closest_on(self._target, self._faces) if len(self._faces) else None

        def project(points: np.ndarray) -> np.ndarray:
            if closest_to is None or len(points) == 0:
                return points
            closest = closest_to(points)
            near = np.linalg.norm(closest - points, axis=1) <= reach
            return np.where(near[:, None], closest, points)

        return project


def _without_crumbs(name: str, mesh: TetMesh) -> TetMesh:
    """Drop what fTetWild leaves hanging on edges and vertices, or beside the body: parts without a face to the rest."""
    labels = face_parts(mesh.tets)
    volumes = np.bincount(labels, mesh.volumes)
    kept = (volumes >= CRUMB * volumes.max())[labels]
    if kept.all():
        return mesh
    warnings.warn(
        f"{name}: {(~kept).sum()} tetrahedra that share no face with the rest, {mesh.volumes[~kept].sum():.2g} m3 of "
        f"{mesh.volume:.3g} m3, were dropped",
        MeshWarning,
        stacklevel=3,
    )
    used = np.unique(mesh.tets[kept])
    return TetMesh(mesh.nodes[used], np.searchsorted(used, mesh.tets[kept]), mesh.regions[kept])
