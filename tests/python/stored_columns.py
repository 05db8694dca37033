"""Bodies whose columns tests compare, and the columns as a store has them."""

from __future__ import annotations

import os

import numpy as np

import palpate

CHILD = """
import os, resource, signal, sys, time
sys.path.insert(0, {tests!r})
from conftest import box_mesh
import palpate
body = palpate.Body(box_mesh(cells={cells}), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-9)
"""


def child_program(cells: tuple[int, int, int], body: str) -> str:
    return CHILD.format(tests=os.path.dirname(__file__), cells=cells) + body


def touchable_square(green: palpate.GreensFunction) -> tuple[np.ndarray, np.ndarray]:
    """Stored columns (s3, t3) as doubles, and the mesh dof of each column."""
    rows, columns = 3 * len(green.surface_nodes), 3 * len(green.touchable_nodes)
    entries = np.array([[green._core.entry(i, j) for j in range(columns)] for i in range(rows)])
    return entries, (3 * green.touchable_nodes[:, None] + np.arange(3)).ravel()


def rollers(mesh: palpate.TetMesh) -> palpate.Body:
    """Supports by component, a fixed node inside, two materials."""
    inside = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.surface_nodes)[:2]
    mask = np.zeros((len(mesh.nodes), 3), dtype=bool)
    mask[mesh.nodes[:, 0] < 1e-9, 0] = True
    mask[mesh.nodes[:, 2] < 1e-9, 2] = True
    mask[np.lexsort(mesh.nodes.T)[:2]] = True
    mask[inside] = True
    return palpate.Body(mesh, material=palpate.Material(2e4, 0.45), fixed=mask)
