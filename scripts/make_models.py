"""Make the models that ``palpate.models`` ships: ``python scripts/make_models.py [NAME ...]``.

Implicit shape -> marching cubes -> collapse of the shortest edges down to the wanted count -> flips and tangential
smoothing on the implicit surface -> NETGEN fills the surface as it is; for 10-node elements, middles of the surface's
edges -> onto the implicit surface, as far as no element folds. No step is random: the same versions of the tools give
the same files.
"""

from __future__ import annotations

import argparse
import heapq
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from model_shapes import SHAPES, Field, Shape
from palpate.mesh import TetMesh
from palpate.mesh.child import run_limited
from palpate.mesh.curve import curve
from palpate.mesh.elements import FACES

DATA = Path(__file__).resolve().parent.parent / "python" / "palpate" / "models" / "data"
MILLIMETRE = 1e-3
ROUNDS = 50  # of flips and smoothing; many more let vertices slide off thin parts
MESHER_LIMIT = 120.0  # s


@dataclass(frozen=True)
class Target:
    """What one file should hold, and how to look for it; counts are those of 4-node tetrahedra, before any middles."""

    shape: str
    surface_nodes: int
    tets: int
    nodes: int | None = None
    grading: tuple[float, ...] = (1.0,)  # exponents of the shape's own local sizes to try; 0 is even
    sizes: tuple[float, ...] = (1.0,)  # element sizes to try, mm
    curved: bool = False  # 10 nodes an element, on the shape
    samples: int = 4  # vertices of the marching cubes, at least, for each that is kept


# The counts of the paper (tables 1 and 2), and finer ones to look at.
TARGETS = {
    "doll-paper": Target("plain_doll", 714, 2803, 894, (0.4, 0.5), (12.8, 12.9, 13.0, 13.1)),
    "kidney-paper": Target("kidney", 454, 1749, 572, (0.9, 1.0, 1.1), (6.8, 7.2, 7.6, 8.0)),
    "liver-paper": Target("liver", 845, 5430, None, (0.0,), (8.6, 8.7, 8.82, 8.85)),
    "liver_dynamic-paper": Target("liver", 585, 2671, 784, (0.0,), (10.8, 11.0, 11.2)),
    "doll": Target("doll", 610, 2000, None, (1.0,), (12.0, 13.0, 14.0), True, 20),
    "kidney": Target("kidney", 610, 2800, None, (1.0,), (5.8, 6.0, 6.2), True, 5),
    "liver": Target("liver", 610, 2500, None, (1.0,), (10.4, 10.6, 10.8), True, 20),
}
TOLERANCE = 0.03  # part of a count that is close enough; among meshes that are, the best angles win

# The beam's box, mm, its cells in the fine mesh, and those tried for the surface of the coarse one.
BEAM = (100.0, 20.0, 20.0)
FINE_CELLS = (20, 4, 4)
COARSE_CELLS = [(n, 3, 3) for n in (17, 18)]
COARSE = Target("beam", 0, 873, 281, (1.0,), (5.8, 6.0, 6.2, 7.2, 7.3, 7.4))
BEAM_NAMES = ("beam", "beam-paper")


def main() -> None:
    """Make all models, or those named."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"any of {', '.join((*TARGETS, *BEAM_NAMES))}")
    DATA.mkdir(parents=True, exist_ok=True)
    for name in parser.parse_args().names or (*TARGETS, *BEAM_NAMES):
        began = time.perf_counter()
        mesh = make(name)
        save(mesh, name)
        size = np.ptp(mesh.nodes, axis=0) * 1e3
        print(
            f"{name}: {len(mesh.nodes)} nodes, {len(mesh.tets)} tets, {len(mesh.surface_nodes)} surface nodes, "
            f"{len(mesh.surface_triangles)} triangles, dihedral >= {mesh.dihedral_angles().min():.1f}, "
            f"{' x '.join(f'{s:.0f}' for s in size)} mm, {mesh.volume * 1e6:.0f} ml, "
            f"{time.perf_counter() - began:.1f} s",
            flush=True,
        )


def make(name: str) -> TetMesh:
    """One model, in metres, resting on z = 0."""
    if name == "beam":
        return box(FINE_CELLS).to_quadratic()
    if name == "beam-paper":
        return best((box_surface(cells) for cells in COARSE_CELLS), COARSE)
    target = TARGETS[name]
    shape = SHAPES[target.shape]
    graded = (replace(shape, size=lambda p, g=g: shape.size(p) ** g) for g in target.grading)
    mesh = best((surface(s, target.surface_nodes, target.samples) for s in graded), target)
    mesh = polish(mesh, shape.field)
    if target.curved:
        mesh = curve(mesh, lambda points: project(points / MILLIMETRE, shape.field, 1.0, 8) * MILLIMETRE)
    return TetMesh(mesh.nodes - [0, 0, mesh.nodes[:, 2].min()], mesh.tets)


def best(surfaces: Iterable[tuple[np.ndarray, np.ndarray]], target: Target) -> TetMesh:
    """Fill each surface (mm) with each element size; of those with the wanted counts, the one with the best angles."""
    found, best_score = None, np.inf
    for vertices, faces in surfaces:
        for size in target.sizes:
            mesh = fill(vertices * MILLIMETRE, faces, size * MILLIMETRE)
            if mesh is None:
                continue
            angle = float(mesh.dihedral_angles().min())
            errors = [len(mesh.tets) / target.tets - 1, len(mesh.nodes) / (target.nodes or len(mesh.nodes)) - 1]
            off = max(max(abs(e) for e in errors) - TOLERANCE, 0)
            score = 1e4 * off - angle
            print(f"  {size:5.2f} mm: {len(mesh.nodes)} nodes, {len(mesh.tets)} tets, {angle:.1f} degrees", flush=True)
            if score < best_score:
                found, best_score = mesh, score
    if found is None:
        raise SystemExit("NETGEN fills none of the surfaces tried")
    return found


def save(mesh: TetMesh, name: str) -> None:
    """Write coordinates (m) and 32-bit indices; single precision is enough, but a beam's ends stay where they are."""
    precision = np.float64 if name in BEAM_NAMES else np.float32
    np.savez_compressed(DATA / f"{name}.npz", nodes=mesh.nodes.astype(precision), tets=mesh.tets.astype(np.int32))


# --- surface -----------------------------------------------------------------------------------------------------


def surface(shape: Shape, count: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Even triangles with exactly ``count`` vertices on the shape: (count, 3) mm, (2 count - 4, 3)."""
    vertices, faces = marching_cubes(shape, samples * count)
    if len(vertices) - len(faces) // 2 != 2:
        raise SystemExit("the shape has a hole through it, or more than one part")
    # A long way in steps: without a return to the shape in between, collapses would wear off what is thin.
    while len(vertices) > 6 * count:
        vertices, faces = collapse(vertices, faces, shape.size(vertices), int(0.6 * len(vertices)))
        vertices = project(vertices, shape.field, float(np.sqrt(shape.size(vertices)).mean()))
        faces = flip(vertices, faces)
    vertices, faces = collapse(vertices, faces, shape.size(vertices), count)
    for round_ in range(ROUNDS):
        faces = flip(vertices, faces)
        vertices = relax(vertices, faces, shape, tangential=round_ > 3)
    return vertices, faces


def marching_cubes(shape: Shape, at_least: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate at the coarsest spacing that gives enough vertices."""
    from skimage.measure import marching_cubes as skimage_marching_cubes

    low, high = np.array(shape.low, float), np.array(shape.high, float)
    spacing = float((high - low).max()) / 24
    while True:
        axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        vertices, faces, _, _ = skimage_marching_cubes(shape.field(grid), 0.0, spacing=(spacing,) * 3)
        if len(vertices) >= at_least:
            vertices = vertices.astype(float) + low
            return project(vertices, shape.field, spacing / 2), outward(vertices, faces.astype(np.int64))
        spacing *= 0.85


def outward(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Turn all triangles so that the enclosed volume is positive."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return faces if np.einsum("ij,ij", np.cross(a, b), c) > 0 else faces[:, ::-1].copy()


def project(points: np.ndarray, field: Field, longest_step: float, rounds: int = 4) -> np.ndarray:
    """Newton steps along the gradient onto the zero surface."""
    for _ in range(rounds):
        value, gradient = field(points), slope(points, field)
        step = -value / np.maximum(np.einsum("ij,ij->i", gradient, gradient), 0.05)
        step = np.clip(step, -longest_step, longest_step)
        points = points + step[:, None] * gradient
    return points


def slope(points: np.ndarray, field: Field, step: float = 1e-2) -> np.ndarray:
    """Gradient of the field by central differences."""
    moves = step * np.eye(3)
    return np.stack([(field(points + m) - field(points - m)) / (2 * step) for m in moves], axis=-1)


def collapse(vertices: np.ndarray, faces: np.ndarray, size: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Collapse the edge that is shortest for its place, again and again, until ``count`` vertices are left."""
    points, around = vertices.copy(), [set() for _ in vertices]
    triangles = [tuple(t) for t in faces.tolist()]
    for index, triangle in enumerate(triangles):
        for v in triangle:
            around[v].add(index)

    def neighbours(v):
        return {w for t in around[v] for w in triangles[t]} - {v}

    def rank(a, b):
        return float(np.linalg.norm(points[a] - points[b]) / (size[a] + size[b]))

    heap = [(rank(a, b), a, b) for t in triangles for a, b in zip(t, t[1:] + t[:1], strict=True) if a < b]
    heapq.heapify(heap)
    alive, left = np.ones(len(points), bool), len(points)
    while left > count:
        length, a, b = heapq.heappop(heap)
        if not (alive[a] and alive[b]) or not around[a] & around[b] or abs(length - rank(a, b)) > 1e-9 * length:
            continue
        shared = neighbours(a) & neighbours(b)
        middle = (points[a] + points[b]) / 2
        if (
            len(shared) != 2
            or any(len(around[v]) <= 3 for v in shared)
            or _folds(points, triangles, around, a, b, middle)
        ):
            continue
        gone = around[a] & around[b]
        for t in gone:
            for v in triangles[t]:
                around[v].discard(t)
        for t in around[b]:
            triangles[t] = tuple(a if v == b else v for v in triangles[t])
        around[a] |= around[b]
        around[b] = set()
        alive[b], points[a], size[a] = False, middle, (size[a] + size[b]) / 2
        left -= 1
        for v in neighbours(a):
            heapq.heappush(heap, (rank(a, v), *sorted((a, v))))
    kept = np.flatnonzero(alive)
    used = sorted({t for v in kept for t in around[v]})
    return points[kept], np.searchsorted(kept, np.array([triangles[t] for t in used]))


def _folds(
    points: np.ndarray, triangles: list[tuple], around: list[set[int]], a: int, b: int, middle: np.ndarray
) -> bool:
    """Say whether a triangle would turn over if ``a`` and ``b`` both moved to ``middle``."""
    for t in around[a] ^ around[b]:
        old = points[list(triangles[t])]
        new = np.array([middle if v in (a, b) else points[v] for v in triangles[t]])
        before, after = (np.cross(c[1] - c[0], c[2] - c[0]) for c in (old, new))
        if before @ after < 0.2 * np.linalg.norm(before) * np.linalg.norm(after):
            return True
    return False


def flip(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Turn edges whose two opposite angles exceed 180 degrees together (Delaunay), where that folds nothing."""
    faces = faces.copy()
    edges = np.concatenate([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]])
    opposite = faces.T.ravel()
    owner = np.tile(np.arange(len(faces)), 3)
    keys = np.sort(edges, axis=1)
    order = np.lexsort((keys[:, 1], keys[:, 0]))
    first, second = order[0::2], order[1::2]
    angle = _angle(vertices, opposite[first], edges[first]) + _angle(vertices, opposite[second], edges[second])
    present = {tuple(e) for e in keys[first].tolist()}
    valence = np.bincount(faces.ravel(), minlength=len(vertices))
    touched: set[int] = set()
    for k in np.argsort(-angle, kind="stable"):
        if angle[k] <= np.pi + 0.02:
            break
        one, two = int(owner[first[k]]), int(owner[second[k]])
        a, b = edges[first[k]].tolist()
        c, d = int(opposite[first[k]]), int(opposite[second[k]])
        # New triangles (c, a, d) and (d, b, c) keep the orientation of (c, a, b).
        if {one, two} & touched or (min(c, d), max(c, d)) in present or min(valence[a], valence[b]) <= 4:
            continue
        pair = np.array([[c, a, d], [d, b, c]])
        normals = np.cross(vertices[pair[:, 1]] - vertices[pair[:, 0]], vertices[pair[:, 2]] - vertices[pair[:, 0]])
        old = faces[[one, two]]
        before = np.cross(vertices[old[:, 1]] - vertices[old[:, 0]], vertices[old[:, 2]] - vertices[old[:, 0]])
        # An edge of the shape stays an edge.
        if before[0] @ before[1] <= 0.5 * np.linalg.norm(before[0]) * np.linalg.norm(before[1]):
            continue
        mean = before.sum(axis=0)
        if (normals @ mean <= 0.3 * np.linalg.norm(normals, axis=1) * np.linalg.norm(mean)).any():
            continue
        faces[one], faces[two] = pair
        touched |= {one, two}
        present.add((min(c, d), max(c, d)))
        present.discard((min(a, b), max(a, b)))
        valence[[a, b]] -= 1
        valence[[c, d]] += 1
    return faces


def _angle(vertices: np.ndarray, at: np.ndarray, ends: np.ndarray) -> np.ndarray:
    u, v = vertices[ends[:, 0]] - vertices[at], vertices[ends[:, 1]] - vertices[at]
    return np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v))


def relax(vertices: np.ndarray, faces: np.ndarray, shape: Shape, tangential: bool) -> np.ndarray:
    """Move each vertex towards the weighted centroid of its triangles, then back onto the surface."""
    corners = vertices[faces]
    centroids = corners.mean(axis=1)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    weights = areas / shape.size(centroids) ** 4
    total, pull = np.zeros(len(vertices)), np.zeros_like(vertices)
    for k in range(3):
        np.add.at(total, faces[:, k], weights)
        np.add.at(pull, faces[:, k], weights[:, None] * centroids)
    move = 0.6 * (pull / total[:, None] - vertices)
    if tangential:
        normal = slope(vertices, shape.field)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        move -= np.einsum("ij,ij->i", move, normal)[:, None] * normal
    return project(vertices + move, shape.field, float(np.sqrt(areas.mean())) / 2, rounds=2)


# --- volume ------------------------------------------------------------------------------------------------------


def fill(vertices: np.ndarray, faces: np.ndarray, size: float) -> TetMesh | None:
    """Tetrahedra of edge length up to ``size`` m inside a surface kept as it is; None if NETGEN fails."""
    extent, origin = float(np.ptp(vertices, axis=0).max()), vertices.min(axis=0)
    with tempfile.TemporaryDirectory(prefix="palpate-models-") as folder:
        surface_file, mesh_file = Path(folder) / "surface.npz", Path(folder) / "mesh.npz"
        scaled = (vertices - origin) / extent
        job = {"balls": np.empty((0, 5)), "points": np.empty((0, 4))}
        np.savez(surface_file, vertices=scaled, faces=faces, size=size / extent, **job)
        command = [sys.executable, "-m", "palpate.mesh.netgen_child", "keep", str(surface_file), str(mesh_file)]
        if run_limited(command, MESHER_LIMIT) != 0 or not mesh_file.exists():
            return None
        with np.load(mesh_file) as result:
            return TetMesh(result["nodes"] * extent + origin, result["tets"])


def polish(mesh: TetMesh, field: Field, goal: float = 15.0, rounds: int = 6) -> TetMesh:
    """Move the nodes of flat tetrahedra, surface nodes along the shape (mm), while that opens the worst angle."""
    points, tets = mesh.nodes / MILLIMETRE, mesh.tets
    on_surface = np.isin(np.arange(len(points)), mesh.surface_nodes)
    stars: list[list[int]] = [[] for _ in points]
    for index, tet in enumerate(tets.tolist()):
        for node in tet:
            stars[node].append(index)
    grid = np.array(list(np.ndindex(3, 3, 3))) - 1.0
    directions = np.concatenate([step * grid for step in (0.02, 0.06, 0.15)])
    for _ in range(rounds):
        angles = smallest_angles(points[tets])
        flat = np.flatnonzero(angles < goal)
        for node in dict.fromkeys(tets[flat[np.argsort(angles[flat])]].ravel().tolist()):
            star = tets[stars[node]]
            reach = np.linalg.norm(points[star] - points[node], axis=-1).max()
            tries = points[node] + reach * directions
            if on_surface[node]:
                tries = project(tries, field, reach / 4)
            corners = np.where((star == node)[None, :, :, None], tries[:, None, None, :], points[star][None])
            worst = smallest_angles(corners).min(axis=1)
            if worst.max() > smallest_angles(points[star]).min() + 1e-3:
                points[node] = tries[np.argmax(worst)]
    return TetMesh(points * MILLIMETRE, tets)


def smallest_angles(corners: np.ndarray) -> np.ndarray:
    """Smallest dihedral angle of each tetrahedron (..., 4, 3), degrees; below 0 where it is inverted."""
    p = corners[..., FACES[4], :]
    normals = np.cross(p[..., 1, :] - p[..., 0, :], p[..., 2, :] - p[..., 0, :])
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    cosines = np.einsum("...ik,...jk->...ij", normals, normals)
    i, j = np.triu_indices(4, 1)
    angles = 180 - np.degrees(np.arccos(np.clip(cosines[..., i, j], -1, 1))).max(axis=-1)
    a, b, c, d = (corners[..., k, :] for k in range(4))
    volume = np.einsum("...k,...k->...", np.cross(b - a, c - a), d - a)
    return np.where(volume > 0, angles, -1.0)


def box(cells: tuple[int, int, int]) -> TetMesh:
    """Fill the beam with cubes of five tetrahedra each, mirrored from cube to cube."""
    axes = [np.linspace(0, length, n + 1) for length, n in zip(BEAM, cells, strict=True)]
    axes[1] -= BEAM[1] / 2
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) * MILLIMETRE
    number = np.arange(len(nodes)).reshape([n + 1 for n in cells])
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    even = np.array([[0, 3, 5, 6], [1, 0, 3, 5], [2, 0, 3, 6], [4, 0, 5, 6], [7, 3, 5, 6]])
    tets = []
    for cell in np.ndindex(*cells):
        at = np.array(cell) + corners
        ids = number[tuple(at.T)]
        tets.append(ids[even] if sum(cell) % 2 == 0 else ids[7 - even])
    return TetMesh(nodes, np.concatenate(tets))


def box_surface(cells: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Surface of the beam's box: (s, 3) mm, (k, 3)."""
    mesh = box(cells)
    return mesh.nodes[mesh.surface_nodes] / MILLIMETRE, np.searchsorted(mesh.surface_nodes, mesh.surface_triangles)


if __name__ == "__main__":
    main()
