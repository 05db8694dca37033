"""A checked surface filled by NETGEN, with elements as small as its shape needs."""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.errors import MeshError, MeshWarning
from palpate.mesh.child import FILES_FAILED, OUT_OF_PROCESSOR_TIME, failure_of, run_limited
from palpate.mesh.curve import curve, refine
from palpate.mesh.fill_job import IN_CUBE, FillJob, length_text
from palpate.mesh.fit import GOOD_LOSS, Fit, change_text, mean_edge
from palpate.mesh.surface_state import SurfaceState
from palpate.mesh.tetmesh import TetMesh
from palpate.mesh.triangles import closest_on

if TYPE_CHECKING:
    import trimesh

# Where the default size is too coarse for the shape, elements become smaller by up to this factor, in so many attempts:
# all of them where more than this share of the volume is lost, for such a mesh does not tell where.
FINEST, ATTEMPTS, LOST = 4.0, 5, 0.05
# Attempts at a size that is given.
ATTEMPTS_GIVEN = 2

# NETGEN takes about 0.25 ms for each tetrahedron, more than the columns of a region of touch. Beyond so many it makes
# them twice as large, and each is cut into eight (`refine`). Cutting twice was tried: where a body is thin NETGEN's
# elements are then smaller than asked for, and 64 times as many are half again too many.
MOST_BY_NETGEN = 30_000

# Seconds for NETGEN to prove that a surface that intersects itself can be filled: mostly it hangs, or crashes.
TIME_LIMIT = 30.0

# The mesh may cut corners of a curved surface, but not lose a part of it.
VOLUME_TOLERANCE = 0.1
WRAP_HINT = "leave out mesher = 'netgen', and it is wrapped"


class MesherFailedError(MeshError):
    """NETGEN made no mesh."""


@dataclass(frozen=True, eq=False)
class Filling:
    """What is to be filled, and how."""

    name: str  # of the surface in messages
    surface: SurfaceState  # the surface, m, and what is known of it
    job: FillJob
    # Of one run, s of processor time, which other programs do not change; None: as long as it takes.
    processor_limit: float | None = None

    @property
    def shape(self) -> trimesh.Trimesh:
        """The surface, m."""
        return self.surface.shape

    @property
    def extent(self) -> float:
        """Longest side, m."""
        return float(np.ptp(self.shape.vertices, axis=0).max())

    def mesh(self) -> TetMesh:
        """Fill the surface; MeshError for a mesher that failed, or a mesh that loses a part of the body, and why."""
        size = self.job.size_in(self.extent)
        halvings = self._halvings(size)
        found: tuple[TetMesh, Fit] | None = None
        points, local = np.empty((0, 3)), np.empty(0)
        patience = self.job.time_limit if self._crossing is None else min(self.job.time_limit, TIME_LIMIT)
        deadline = time.monotonic() + patience
        for _ in range(ATTEMPTS if self.job.size is None else ATTEMPTS_GIVEN):
            # Where a size is given, parts that NETGEN's larger elements miss are got back by smaller ones there.
            least = size / 2**halvings if self.job.size is not None else self.job.size_in(self.extent) / FINEST
            attempt = self._tetrahedra((size, halvings), points, local, deadline)
            fit = Fit.of(attempt, self.shape) if isinstance(attempt, TetMesh) else None
            if fit is not None and (found is None or abs(fit.loss) < abs(found[1].loss)):
                found = attempt, fit
            # What one run cannot do at a size, another is not given the time for: the surface is wrapped instead.
            late = time.monotonic() > deadline or (isinstance(attempt, str) and OUT_OF_PROCESSOR_TIME in attempt)
            if late or size <= least or (fit is not None and fit.is_good(size)):
                break
            if fit is None or abs(fit.loss) > (GOOD_LOSS if halvings else LOST):
                points, local = np.empty((0, 3)), np.empty(0)
                # Elements that are to be cut may have been too large for the shape.
                size, halvings = (size, halvings - 1) if halvings else (max(size / 2, least), self._halvings(size / 2))
                continue
            before = np.full(len(fit.points), size) if len(local) == 0 else local
            points, local = fit.points, fit.sizes(before, least)
            if np.array_equal(before, local):
                break
        if found is None:
            raise MesherFailedError(f"{self.name}: {self._reason(size, attempt)}")
        self._warn_of_losses(*found, size)
        return found[0]

    def _halvings(self, size: float) -> int:
        """How often elements are halved after NETGEN."""
        return int(self.shape.volume * IN_CUBE / size**3 > MOST_BY_NETGEN)

    def _warn_of_losses(self, mesh: TetMesh, fit: Fit, size: float) -> None:
        """Warn of what the mesh loses, or refuse it."""
        if fit.is_good(size):
            return
        what = "the mesh" if self.job.size is None else f"with elements of {length_text(size)} the mesh"
        message = f"{self.name}: {what} {change_text(fit.loss, fit.gaps.max())}"
        smaller = f"elements of {length_text(fit.size_for_good(min(size, mean_edge(mesh))))} (--max-size) should do"
        if abs(fit.loss) > VOLUME_TOLERANCE:
            raise MeshError(f"{message}; {self._crossing or f'they are too large for it, {smaller}'}")
        warnings.warn(f"{message}; {self._crossing or f'for less, {smaller}'}", MeshWarning, stacklevel=5)

    def _reason(self, size: float, failures: str) -> str:
        """Why no mesh was made."""
        crossing = self._crossing
        if crossing is not None:
            return crossing
        return (
            f"NETGEN {failures} with elements of {length_text(size)}, though the surface does not intersect itself: "
            f"try elements of {length_text(size / 2)}, or {WRAP_HINT}"
        )

    @property
    def _crossing(self) -> str | None:
        """Where the surface intersects itself, if it does."""
        place = self.surface.crossing
        return None if place is None else f"the surface intersects itself near {place} m; {WRAP_HINT}"

    def _tetrahedra(
        self, sizes: tuple[float, int], points: np.ndarray, local: np.ndarray, deadline: float
    ) -> TetMesh | str:
        """Elements of a size, smaller at points, halved so often after NETGEN; or how the mesher failed."""
        size, halvings = sizes
        origin, extent = self.shape.vertices.min(axis=0), self.extent
        smaller = local < size
        # In a unit box, for NETGEN's tolerances are absolute.
        unit = extent / 2**halvings
        job = {
            "vertices": (self.shape.vertices - origin) / extent,
            "faces": self.shape.faces,
            "size": size / unit,
            "processor_limit": self.processor_limit or 0.0,
            "balls": self.job.balls(origin, extent, unit),
            "points": np.column_stack([(points[smaller] - origin) / extent, local[smaller] / unit]),
        }
        result = self._run(job, deadline)
        if isinstance(result, str):
            return result
        mesh = TetMesh(result[0] * extent + origin, result[1])
        for _ in range(halvings):
            mesh = refine(mesh, self._projected)
        return curve(mesh, self._projected) if self.job.element == "quadratic" else mesh

    def _run(self, job: dict[str, np.ndarray | float], deadline: float) -> tuple[np.ndarray, np.ndarray] | str:
        """Nodes and tetrahedra, or how the mesher failed."""
        with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
            surface_file, mesh_file = Path(folder) / "surface.npz", Path(folder) / "mesh.npz"
            np.savez(surface_file, **job)
            # Even triangles are best; where NETGEN cannot make them, the surface as given may still be filled.
            failures = []
            for route in ("remesh", "keep"):
                command = [sys.executable, "-m", "palpate.mesh.netgen_child", route, str(surface_file), str(mesh_file)]
                status = run_limited(command, max(deadline - time.monotonic(), 0.0))
                failure = failure_of(status, self.job.time_limit)
                if status == FILES_FAILED:
                    raise MeshError(f"{self.name}: NETGEN {failure}")
                if failure is None and mesh_file.exists():
                    with np.load(mesh_file) as result:
                        return result["nodes"], result["tets"]
                failures.append(failure or "returned no tetrahedra")
                if failure == OUT_OF_PROCESSOR_TIME:
                    return f"{failure} when filling the surface"
        return f"{failures[0]} when remeshing the surface, and {failures[1]} when keeping it,"

    def _projected(self, points: np.ndarray) -> np.ndarray:
        return closest_on(self.shape.vertices, self.shape.faces)(points)
