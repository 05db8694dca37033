"""The command that solves bodies for good."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from palpate import units
from palpate.body import Loads, Material, surface_region
from palpate.cli.app import app
from palpate.cli.bodies import (
    Dask,
    ElementChoice,
    FillingOptions,
    Unit,
    body_of,
    cluster,
    in_unit,
    materials_of,
    read_any,
)
from palpate.cli.checks import read_option, require_body, require_store_name
from palpate.cli.completion import precisions
from palpate.cli.describing import green_line, precision_line
from palpate.cli.option_groups import grouped
from palpate.cli.run_file import print_expected
from palpate.errors import SceneError, StoreError
from palpate.green import GreensFunction, plan, precompute
from palpate.input_file import require_writable
from palpate.scene import Scene

# What counts for a scene, too.
OF_SCENE = {"file", "dask"}


@app.command("precompute")
@grouped
def precompute_command(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="Volume mesh, a surface or segmentation to fill, or a scene (.toml).")],
    fix: Annotated[str | None, typer.Option(help="Supported nodes, such as 'z < 0.01' or 'z < min + 5mm'.")] = None,
    youngs_modulus: Annotated[str, typer.Option("-E", help="Young's modulus, such as 10kPa.")] = "10kPa",
    poissons_ratio: Annotated[float, typer.Option("--nu", help="Poisson's ratio, below 0.5.")] = 0.45,
    density: Annotated[str, typer.Option(help="Density, such as 1000kg/m3; used with --gravity.")] = "1000kg/m3",
    gravity: Annotated[
        str | None, typer.Option(help="Acceleration under which the body sags, m/s^2, such as 0,0,-9.81.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File of the store; default: in the cache.")] = None,
    unit: Unit = None,
    precision: Annotated[
        str | None,
        typer.Option(
            help="Stored number format: f16, f32 or f64; default: the cheapest that answers touches to 0.03 %.",
            autocompletion=precisions,
        ),
    ] = None,
    touch: Annotated[
        str | None, typer.Option(help="Touchable surface: 'z > 3cm', or a region of the mesh file; default: all.")
    ] = None,
    first: Annotated[
        str | None, typer.Option(help="Part to compute first; the store is written as soon as this part is ready.")
    ] = None,
    element: ElementChoice = None,
    *,
    filling: FillingOptions,
    memory: Annotated[
        str | None, typer.Option(help="Largest memory, such as 8GB; with --dask for each worker.")
    ] = None,
    dask: Dask = None,
) -> None:
    """Solve the body once, so that any touch is answered in microseconds.

    The command prints the time, memory and disk that it needs, and stops if there is too little.
    Ctrl-C keeps finished columns in STORE.partial; the same command continues from there, with or without --dask.
    Of a scene all bodies are solved, and their series beyond small strain for its spheres, into the cache.

    Example: palpate precompute liver.vtu --fix "z < min + 5mm" -E 10kPa --nu 0.45 -o liver.palpate

    Example: palpate precompute liver.vtu --fix "z < min + 5mm" --touch "z > 2cm" --first "z > 3cm" -o a.palpate

    Example: palpate precompute scene.toml --dask tcp://10.0.0.1:8786
    """
    if file.suffix == ".toml":
        _precompute_scene(context, file, dask)
        return
    require_body(file)
    if fix is None:
        raise SceneError(f"{file}: --fix is missing: the nodes that are held, such as --fix 'z < min + 5mm'")
    if out is not None:
        require_store_name(out)
        require_writable(out, StoreError)
    modulus, mass = read_option("-E", youngs_modulus, units.pressure), read_option("--density", density, units.density)
    material = Material(modulus, poissons_ratio, mass)
    parts = () if gravity is None else gravity.split(",")
    loads = Loads(gravity=[read_option("--gravity", g, units.acceleration) for g in parts]) if parts else None
    with cluster(dask) as workers:
        volume_mesh = in_unit(unit, lambda unit: read_any(file, unit, element, filling))
        body = body_of(volume_mesh, materials_of(volume_mesh, material, filling.segment), fix, loads)
        region = None if touch is None else surface_region(body, touch, "--touch")
        asked = {"precision": precision, "touch": region, "first": first}
        asked |= {"path": out, "memory": memory, "dask": workers}
        planned = plan(body, **asked)
        print(f"{planned}{' at most: the precision is chosen by the body' if precision is None else ''}")

        def ready(green: GreensFunction) -> None:
            print(f"{green.path}: {len(green.touchable_nodes)} nodes can be touched by now")

        green = precompute(body, **asked, ready=ready if workers is None else None)
    print(f"{green.path}: {green_line(green)}")
    print(precision_line(green))


def _precompute_scene(context: typer.Context, file: Path, dask: str | None) -> None:
    """Solve the bodies of a scene, and compute their series."""
    for parameter in context.command.params:
        given = context.get_parameter_source(parameter.name or "")
        if parameter.name not in OF_SCENE and given is not None and given.name == "COMMANDLINE":
            raise SceneError(f"{file}: {parameter.opts[-1]} is not for this file: a scene has its own bodies")
    scene = Scene.read(file)
    with cluster(dask) as workers:
        built = scene.precompute(dask=workers, announce=print_expected)
    for body in built.bodies:
        print(f"{body.green.path}: {green_line(body.green)}")
        for radius, series in body.series:
            if series is not None:
                print(f"series beyond small strain below spheres of {1e3 * radius:g} mm: {series.places:,} places")
