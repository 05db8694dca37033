"""What grows with a body, from the command line."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from palpate.cli.benchmarks import bench_app

if TYPE_CHECKING:
    from palpate.validation.bench.scale import Results, Settings

MULTIPLES = {"k": 1_000, "M": 1_000_000}


@bench_app.command()
def scale(
    sizes: Annotated[str, typer.Option(help="Numbers of tetrahedra.")] = "1k,10k,100k,1M",
    touched: Annotated[int, typer.Option(min=1, help="Nodes that may be touched; all where there are fewer.")] = 2000,
    precision: Annotated[str, typer.Option(help="Stored number format, or 'auto'.")] = "f16",
    surface: Annotated[
        Path | None, typer.Option(help="Fill this surface (STL, PLY, OBJ; metres) in place of making grids.")
    ] = None,
    memory: Annotated[str | None, typer.Option(help="Memory that a size may take, such as 8GB.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for scale.json, .md and .png; a run that was interrupted goes on from there."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """All stages from a mesh or a surface to the first touch, memory, store, ticks and frames, over tetrahedra.

    A million tetrahedra take minutes, and gigabytes.

    Example: palpate bench scale --sizes 1k,10k,100k

    Example: palpate bench scale --surface liver.stl --sizes 5k,50k --out scale
    """
    from palpate.errors import Error
    from palpate.input_file import require_file
    from palpate.units import memory as memory_units
    from palpate.validation.bench import scale as bench

    if precision not in ("auto", "f16", "f32", "f64"):
        raise Error(f"unknown precision '{precision}': use 'f16', 'f32', 'f64' or 'auto'")
    if surface is not None:
        require_file(surface, Error)
    settings = bench.Settings(
        tuple(_count(size) for size in sizes.split(",")),
        touched,
        None if precision == "auto" else precision,
        None if surface is None else str(surface.resolve()),
        None if memory is None else int(memory_units(memory)),
    )
    results = _measured(settings, out)
    if as_json:
        print(json.dumps(bench.as_json(results), indent=2))
    else:
        _print(results)


def _measured(settings: Settings, out: Path | None) -> Results:
    """Measure, and write what a folder is to hold."""
    from rich.console import Console

    from palpate.atomic import written_beside
    from palpate.validation.bench import scale as bench

    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    console = Console(stderr=True)
    with console.status("measuring") as status:
        results = bench.run(settings, None if out is None else out / "scale.json", status.update)
    if out is not None:
        bench.plot(results, out / "scale.png")
        with written_beside(out / "scale.md") as partial:
            partial.write_text(bench.markdown(results))
        print(f"wrote {out / 'scale.json'}, {out / 'scale.md'} and {out / 'scale.png'}", file=sys.stderr)
    return results


def _count(text: str) -> int:
    """Tetrahedra of ``"100k"``."""
    from palpate.errors import Error

    number, last = text.strip(), text.strip()[-1:]
    factor = MULTIPLES.get(last, 1)
    try:
        count = round(float(number[:-1] if last in MULTIPLES else number) * factor)
    except (ValueError, OverflowError):
        count = 0
    if count < 100:
        raise Error(f"'{text}' is no number of tetrahedra: give at least 100, such as 10k or 1M")
    return count


def _print(results: Results) -> None:
    from rich.console import Console
    from rich.table import Table

    from palpate.validation.bench.scale import table

    headings, lines = table(results)
    shown = Table(title="From the mesh to the first touch, s", title_justify="left")
    for rank, heading in enumerate(headings):
        shown.add_column(heading, justify="right" if rank else "left", no_wrap=True)
    for line in lines:
        shown.add_row(*line)
    Console().print(shown)
    print("seconds on the wall; of all processors, which other programs disturb less")
    print(
        "power: of the number of tetrahedra, fitted to the processors' time; costliest place: the shortest of its plays"
    )
