"""What elements lack of a half-space's compliance under a patch as wide as the contact law takes it.

A block is pressed by the patch `(1 - r^2/b^2)^2` in the middle of its top. What its elements lack is the difference
from `c_half(b) + C_reg`, where `C_reg` is that of elements that are fine below the patch.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import palpate
from benches.output import Table
from benches.strain.solid import _face_points, _solved
from palpate.validation.verify.contact.reference import graded
from palpate.validation.verify.grids import lattice, mapped

SIZE, MODULUS, RATIOS = (0.12, 0.12, 0.05), 10e3, (0.3, 0.45, 0.49)
# Edges of elements, m: cubes cut into six, and the largest of NETGEN.
CUBES, LARGEST = 0.05 / 6, 0.012
# Radii of patches over the spacing of nodes; those that tell the regular part of the fine mesh, m.
SPACINGS, WIDTHS = (2.5, 3.0, 3.5, 4.0), np.array([0.012, 0.016, 0.02, 0.025])
# Points along an edge of each face at which the pressure is summed.
POINTS = 24
# Mean displacement of a half-space over `(1 - nu^2) F / (E b)`.
HALF_SPACE = 0.766544


@dataclass(frozen=True)
class ElementsRow:
    """Share of `c_half(b)` that elements lack, at `SPACINGS`; `spacing` is that of nodes on the surface, m."""

    elements: str
    poisson: float
    nodes: int
    spacing: float
    lacking: list[float]


def lacking_rows() -> Iterator[ElementsRow]:
    """Measure both meshes at all ratios."""
    for poisson in RATIOS:
        fine = [0.06 + graded(-0.06, 0.06, 0.0, 0.015, 0.003)] * 2 + [0.05 - graded(0, 0.05, 0.0, 0.012, 0.003)[::-1]]
        regular = compliances(mapped(lattice(*fine), quadratic=True), poisson, WIDTHS) - _half_space(poisson, WIDTHS)
        by_width = np.polyfit(WIDTHS**2, regular, 1)
        for name, mesh in (("cubes cut into six", _cubes()), ("NETGEN", _netgen())):
            spacing = _spacing(mesh)
            widths = spacing * np.array(SPACINGS)
            expected = _half_space(poisson, widths) + np.polyval(by_width, widths**2)
            lacking = (expected - compliances(mesh, poisson, widths)) / _half_space(poisson, widths)
            yield ElementsRow(name, poisson, len(mesh.nodes), spacing, lacking.tolist())


def compliances(mesh: palpate.TetMesh, poisson: float, widths: np.ndarray) -> np.ndarray:
    """Return mean displacements, m/N, under patches of radii, m, at the node in the middle of the top."""
    body = palpate.Body(mesh, material=palpate.Material(MODULUS, poisson), fixed=mesh.nodes[:, 2] < 1e-9)
    faces, (shapes, share) = np.asarray(mesh.surface_faces), _face_points(POINTS)
    faces = faces[(mesh.nodes[faces, 2] > SIZE[2] - 1e-9).all(axis=1)]
    corners, at = mesh.nodes[faces[:, :3]], np.einsum("qi,kic->kqc", shapes, mesh.nodes[faces])
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    free = np.setdiff1d(np.arange(mesh.nodes.size), body.fixed_dofs)
    stiffness = body.stiffness()[free][:, free].tocsc()
    found = []
    for width in widths:
        r = np.linalg.norm(at - mesh.nodes[_middle(mesh)], axis=2) / width
        pressure = np.where(r < 1.0, (1.0 - np.minimum(r, 1.0) ** 2) ** 2, 0.0) * area[:, None] * share
        load = np.zeros(mesh.nodes.shape)
        np.add.at(load[:, 2], faces, pressure @ shapes)
        weights = load.ravel()[free] / pressure.sum()
        found.append(float(weights @ _solved(stiffness, weights)))
    return np.array(found)


def _half_space(poisson: float, widths: np.ndarray) -> np.ndarray:
    return HALF_SPACE * (1.0 - poisson**2) / (MODULUS * widths)


def _middle(mesh: palpate.TetMesh) -> int:
    return int(np.argmin(np.linalg.norm(mesh.nodes - np.array([SIZE[0] / 2, SIZE[1] / 2, SIZE[2]]), axis=1)))


def _spacing(mesh: palpate.TetMesh) -> float:
    """Mean spacing of nodes around the middle as the contact law takes it: of the mean edge at each node around."""
    faces = np.asarray(mesh.surface_faces)
    parts = np.concatenate([faces[:, k] for k in ([0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5])])
    around = np.unique(parts[(parts == _middle(mesh)).any(axis=1)])
    return float(np.mean([_mean_edge(mesh, parts, node) for node in around]))


def _mean_edge(mesh: palpate.TetMesh, parts: np.ndarray, node: int) -> float:
    others = parts[(parts == node).any(axis=1)]
    return float(np.linalg.norm(mesh.nodes[others[others != node]] - mesh.nodes[node], axis=1).mean())


def _cubes() -> palpate.TetMesh:
    axes = [np.linspace(0.0, size, round(size / CUBES) + 1) for size in SIZE]
    return mapped(lattice(*axes), quadratic=True)


def _netgen() -> palpate.TetMesh:
    import trimesh

    with tempfile.TemporaryDirectory() as folder:
        block = trimesh.creation.box(SIZE)
        block.apply_translation(np.array(SIZE) / 2)
        block.export(Path(folder) / "block.stl")
        mesh = palpate.tetrahedralize(Path(folder) / "block.stl", max_element_size=LARGEST, unit="m")
    return mesh.to_quadratic()


def table(rows: list[ElementsRow]) -> Table:
    """Table of shares in per cent."""
    lines = [
        [row.elements, f"{row.poisson:g}", f"{1e3 * row.spacing:.1f}"] + [f"{100 * x:.1f}" for x in row.lacking]
        for row in rows
    ]
    headings = ["elements", "nu", "spacing, mm", *(f"b = {x:g} spacings, %" for x in SPACINGS)]
    return Table("What 10-node elements lack of a half-space's compliance", headings, lines)
