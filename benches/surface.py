"""All of the surface of a cube in stages, timed, beside direct solutions at random nodes."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from benches.output import count_of
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


def surface(
    tets: Annotated[str, typer.Option(help="Tetrahedra of the cube, such as 5k or 100k.")] = "100k",
    precision: Annotated[str, typer.Option(help="Number formats.")] = "f16,f32",
    folder: Annotated[Path | None, typer.Option(help="Where the stores go meanwhile.")] = None,
) -> None:
    """All of a surface in stages, with its plan, beside direct solutions by SuperLU at 20 random nodes.

    Example: python -m benches surface --tets 100k --precision f16
    """
    for chosen in precision.split(","):
        planned, found = run(count_of(tets), chosen, folder)
        print(
            f"{found.tets} tetrahedra, {found.surface_nodes} surface nodes, {chosen}, {found.stages} stores on the way"
        )
        print(planned)
        print(f"columns in {found.precompute_s:.3g} s, store {found.store_bytes / 1e9:.3g} GB")
        print(
            f"20 random nodes beside SuperLU ({found.direct_s:.3g} s): largest error of a displacement "
            f"{found.largest:.2g}, {found.stated:.2g} of the error stated"
        )
