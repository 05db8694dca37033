"""The command that runs a study."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from palpate.cli.app import app, keeping, print_note
from palpate.cli.bodies import Dask, cluster
from palpate.cli.checks import require_folder
from palpate.study import Study, StudyResult
from palpate.units import count_text


@app.command()
def study(
    file: Annotated[Path, typer.Argument(help="Study file (.toml): a scene with presses and a grid of values.")],
    out: Annotated[Path | None, typer.Option(help="Folder of the results; default: <name>-study.")] = None,
    dask: Dask = None,
) -> None:
    """Solve many bodies or materials, press each of them, and write one table.

    Ctrl-C keeps finished bodies in the folder; the same command continues from there. A study with new cases computes
    only what is new.

    Example: palpate study study.toml

    Example: palpate study patients.toml --out patients --dask tcp://10.0.0.1:8786
    """
    folder = out if out is not None else Path(f"{file.stem}-study")
    require_folder(folder)
    read = Study.read(file)
    with cluster(dask) as workers, keeping("bodies", folder):
        result = read.run(folder, dask=workers)
    _print_result(result, folder)


def _print_result(result: StudyResult, folder: Path) -> None:
    """Write the results, and say what was found and what could not be."""
    cases = len(np.unique(result.columns["case"]))
    known = f", {result.resumed} of them known before" if result.resumed else ""
    print(f"{count_text(cases, 'body', 'bodies')}{known}; varied: {', '.join(result.varied) or 'nothing'}")
    stiffness = result.columns.get("stiffness_N_per_m", np.empty(0))
    if np.isfinite(stiffness).any():
        low, high = np.nanmin(stiffness), np.nanmax(stiffness)
        error = np.nanmax(result.columns["error"])
        print(f"stiffness from {low:.4g} to {high:.4g} N/m, errors of solving up to {error:.1g}")
    for note in result.notes:
        print_note(note)
    print(f"wrote {folder}: {', '.join(path.name for path in result.save(folder))}")
    for number, problem in result.problems.items():
        print_note(f"case {number}: {problem}", "error")
    if result.problems:
        raise typer.Exit(2)
