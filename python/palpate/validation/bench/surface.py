"""All of the surface of a cube in stages, timed, beside direct solutions at random nodes."""

from __future__ import annotations

import tempfile
from pathlib import Path

from palpate.green import Plan, plan
from palpate.validation.verify.surface import SurfaceErrors, cube, surface_errors


def run(tets: int, precision: str, folder: Path | None = None) -> tuple[Plan, SurfaceErrors]:
    """Plan and compute all columns of a cube of about so many tetrahedra; the store is removed afterwards.

    ``folder`` is where it goes meanwhile; None takes one for temporary files.
    """
    body = cube(tets)
    with tempfile.TemporaryDirectory(dir=folder) as place:
        path = Path(place) / "cube.palpate"
        planned = plan(body, precision=precision, path=path)
        return planned, surface_errors(body, precision, path)
