"""The command that fits a scene's material to measured indentations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.app import app, millimetres, print_note
from palpate.errors import FitError
from palpate.fitting import Indentations, fit
from palpate.input_file import require_writable
from palpate.progress import status_line


@app.command("fit")
def fit_command(
    measured: Annotated[Path, typer.Argument(help="CSV file of force against depth, with units in its header.")],
    scene: Annotated[Path, typer.Argument(help="Scene (.toml): body, supports, indenter and a first material.")],
    force_unit: Annotated[str | None, typer.Option(help="Unit of the forces, such as mN.")] = None,
    depth_unit: Annotated[str | None, typer.Option(help="Unit of the depths, such as um.")] = None,
    force_column: Annotated[str | None, typer.Option(help="Title of the column of forces.")] = None,
    depth_column: Annotated[str | None, typer.Option(help="Title of the column of depths.")] = None,
    hold: Annotated[
        list[str] | None, typer.Option(help="Key that stays as it is, such as poissons_ratio; may be given again.")
    ] = None,
    find_touch: Annotated[bool, typer.Option("--find-touch", help="Fit the depth of first touch as well.")] = False,
    out: Annotated[
        Path | None, typer.Option(help="Scene file with the result; default: <scene>-fitted.toml beside the scene.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Picture of curves and residuals, .png or .svg; default: <measured>-fit.png.")
    ] = None,
) -> None:
    """Fit Young's moduli, and what else the data determine, to indentations; write the scene with the result.

    Force against depth is compared with the press of the scene's first tool at the same places, by the law of its
    material. Intervals are of 95 %. What the data cannot determine stays as it is in the scene.

    Example: palpate fit measured.csv scene.toml

    Example: palpate fit export.csv phantom.toml --force-unit mN --depth-unit um --find-touch
    """
    columns = {"force_column": force_column, "depth_column": depth_column}
    data = Indentations.read(measured, force_unit=force_unit, depth_unit=depth_unit, **columns)
    result = out if out is not None else scene.with_name(f"{scene.stem}-fitted.toml")
    picture = plot if plot is not None else Path(f"{measured.stem}-fit.png")
    if picture.suffix.lower() not in (".png", ".svg"):
        raise FitError(f"--plot {picture}: a picture ends in .png or .svg")
    for path in (result, picture):
        require_writable(path, FitError)
    with status_line(f"fitting {scene} to {measured}"):
        found = fit(scene, data, hold=hold or (), find_touch=find_touch)
    rows, curves = len(found.measured.force), len(found.measured.names)
    solved = "1 body" if found.solved == 1 else f"{found.solved} bodies"
    print(f"{rows} rows of {curves} curve{'s' if curves > 1 else ''}; {solved} solved")
    for name, point in zip(found.measured.names, found.points, strict=True):
        print(f"{name}: pressed at {millimetres(point)}")
    for parameter in found.parameters:
        print(parameter)
    if find_touch:
        for name, depth in zip(found.measured.names, found.touch, strict=True):
            print(f"{name}: first touch at {1e3 * depth:.3g} mm")
    print(f"residuals: {100 * found.scatter:.2g} % of the largest force (root mean square)")
    for note in found.notes:
        print_note(note)
    found.write_scene(result)
    found.picture(picture)
    print(f"wrote {result}, {picture}")
