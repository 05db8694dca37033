"""What is printed of a body before it is computed, and where a body that takes long is touched first."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from conftest import box_mesh

import palpate
from palpate.scene import sizes
from palpate.scene.sizes import TOWARDS_VIEWER, Expected, seen_middle

VIEWPORT = Path(__file__).parents[3] / "viewer" / "src" / "scene" / "viewport.ts"
SIZE = np.array([0.08, 0.05, 0.05])


def block(fixed: str) -> palpate.Body:
    mesh = box_mesh((8, 6, 6), jitter=0.0)
    held = palpate.body.parse(fixed)(mesh.nodes)
    return palpate.Body(mesh, material=palpate.Material(1e4, 0.45), fixed=held)


def test_the_page_looks_from_where_the_first_touch_is_planned():
    numbers = re.search(r"DEFAULT_DIRECTION = new THREE.Vector3\(([^)]*)\)", VIEWPORT.read_text()).group(1)
    assert tuple(map(float, numbers.split(","))) == TOWARDS_VIEWER


def test_a_long_body_is_touched_first_where_the_page_shows_its_middle(monkeypatch):
    monkeypatch.setattr(sizes, "LONG", 0.0)
    body = block("z < min + 1mm")
    (center, radius) = Expected.of(body).first
    # The line of sight through the middle of the box leaves it at the front, y = 0, above its middle.
    step = 0.5 * SIZE[1] / -TOWARDS_VIEWER[1]
    leaves = 0.5 * SIZE + step * np.array(TOWARDS_VIEWER)
    assert center[1] == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.norm(np.array(center) - leaves) < radius == pytest.approx(0.15 * SIZE[0])
    # Where that is held, it is the top.
    assert seen_middle(block("y < min + 1mm"))[2] == pytest.approx(SIZE[2])


def test_a_body_whose_store_is_there_has_no_line():
    body = block("z < min + 1mm")
    line = str(Expected.of(body))
    assert line.startswith(f"computing {3 * len(body.mesh.surface_nodes)} columns: at most ")
    assert f"({len(body.mesh.nodes)} nodes, {len(body.mesh.surface_nodes)} on the surface)" in line
    palpate.precompute(body, progress=False)
    assert str(Expected.of(body)) == ""
