"""Possible places of nodules, and the forces of presses there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from palpate.exam.file import ExamFile
from palpate.mesh import TetMesh
from palpate.scene import BuiltScene
from palpate.simulation import Simulation
from palpate.vectors import turning_z_to

# The tool comes down from this far above, m, by so much a tick, m (20 mm/s at 1 kHz), and stays for so many ticks: the
# forces have long stood still by then, after the ramp of the safety stage.
ABOVE, ADVANCE, STAYING = 1e-3, 2e-5, 300
# Points that random places are chosen among, and orders in which they are tried before they are given up.
DRAWS, ORDERS = 2000, 50


@dataclass(frozen=True)
class Places:
    """Points of the surface at rest, under which nodules may lie, in the frame of the body."""

    # (p, 3) m, and outward unit normals (p, 3).
    points: np.ndarray
    normals: np.ndarray

    def closest(self, point: np.ndarray) -> int:
        """Return the number of the place that is closest to a point (3,), m."""
        return int(np.argmin(np.linalg.norm(self.points - point, axis=1)))


def places_of(exam: ExamFile, mesh: TetMesh, touchable: np.ndarray) -> Places:
    """Places of an exam, listed or drawn, on the faces whose corners may all be touched.

    Raises SceneError for no such faces, or a box in which so many random places do not fit.
    """
    triangles = mesh.surface_triangles
    triangles = triangles[np.isin(triangles, touchable).all(axis=1)]
    if len(triangles) == 0:
        raise exam.mistake(["exam", "search"], "exam.search: it holds nodes, but no whole face of the surface")
    surface = trimesh.Trimesh(mesh.nodes, triangles, process=False)
    if exam.question.places is not None:
        points, _, faces = trimesh.proximity.closest_point_naive(surface, np.array(exam.question.places))
    else:
        points, faces = _drawn(exam, surface)
    return Places(points, surface.face_normals[faces])


def _drawn(exam: ExamFile, surface: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    """Random points, evenly over the surface within the box: in a random order each that is far from those before."""
    table = exam.question.random
    assert table is not None
    low, high = np.array(table.low), np.array(table.high)
    points, faces = trimesh.sample.sample_surface(surface, DRAWS, seed=table.seed)
    points, faces = np.asarray(points), np.asarray(faces)
    inside = np.flatnonzero(((low <= points) & (points <= high)).all(axis=1))
    draw, most = np.random.default_rng([table.seed, 3]), 0
    for _ in range(ORDERS):
        chosen: list[int] = []
        for rank in draw.permutation(inside).tolist():
            if (np.linalg.norm(points[chosen] - points[rank], axis=1) >= table.apart).all():
                chosen.append(rank)
            if len(chosen) == table.count:
                return points[chosen], faces[chosen]
        most = max(most, len(chosen))
    text = f"only {most} of {table.count} places found in the box, {1e3 * table.apart:g} mm apart"
    raise exam.mistake(["exam", "random"], f"exam.random: {text}")


def forces_at(built: BuiltScene, places: Places, depth: float) -> np.ndarray:
    """Force along the normal (p,), N, of a tool pressed to a depth, m, at each place, without a clock."""
    body, tool = built.bodies[0], built.scene.tools[0]
    points, normals = body.points_to_scene(places.points), body.vectors_to_scene(places.normals)
    down = np.arange(ABOVE, -depth, -ADVANCE)
    heights = np.concatenate([down, np.full(STAYING, -depth)]) + tool.reach
    path, turned = [], []
    for point, normal in zip(points, normals, strict=True):
        path += [point + np.outer(heights, normal), np.full((1, 3), np.nan)]
        turned.append(np.tile(turning_z_to(normal), (len(heights) + 1, 1)))
    recording = Simulation(built).play(np.vstack(path), np.vstack(turned))
    last = (len(heights) + 1) * np.arange(1, len(points) + 1) - 2
    return np.einsum("ij,ij->i", recording.forces[last], normals)
