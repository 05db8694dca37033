"""A block on a table that the tests of palpation press."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import palpate
from palpate.validation.verify.grids import box

SIDE, HEIGHT, RADIUS = 0.06, 0.04, 4e-3
TOP = "z > max - 1mm"


def block_body(modulus: float = 10e3, loads: palpate.Loads | None = None) -> palpate.Body:
    """60 x 60 x 40 mm of 10-node tetrahedra, glued at its bottom."""
    mesh = box((6, 6, 4), (SIDE, SIDE, HEIGHT), quadratic=True)
    return palpate.Body(mesh, material=palpate.Material(modulus, 0.45), fixed=lambda p: p[:, 2] < 1e-9, loads=loads)


def scene_of(
    store: Path, device: dict[str, Any] | None = None, strain_limit: float = 0.0, **tool: Any
) -> palpate.Scene:
    """Scene of a store with a small sphere without friction."""
    view, tool = {"strain_limit": strain_limit}, {"radius": RADIUS, "friction": 0.0, **tool}
    return palpate.Scene(body={"store": str(store)}, tool=tool, device=device or {}, view=view)
