"""Every stage from a mesh to a felt contact, on bodies of a thousand to a million tetrahedra.

Each size is measured in a process of its own (:mod:`benches.scale_row`). Bodies are blocks of the same
cubes, so that a tool meets the same elements on all of them; or meshes of one surface, ever finer, for the time from a
surface file to the first touch.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from benches.output import ROOT, Json, Out, Table, count_of, make_folder, print_written, show
from benches.rows_file import RowsFile
from benches.scale_row import Job, Row
from palpate.atomic import written_beside
from palpate.errors import Error
from palpate.figures import empty_figure, write_figure
from palpate.input_file import require_file
from palpate.units import memory as memory_units

SIZES = (1_000, 10_000, 100_000, 1_000_000)
# What users wait for from the mesh, or the surface, to the first touch: all stages but those of the loop's own.
TOTAL = "to first touch"


@dataclass(frozen=True)
class Settings:
    """What is measured; the attributes but ``sizes`` as of :class:`Job`.

    Attributes
    ----------
    sizes
        Numbers of tetrahedra.

    """

    sizes: tuple[int, ...] = SIZES
    touched: int = 2000
    precision: str | None = "f16"
    surface: str | None = None
    memory: int | None = None

    def job(self, size: int) -> Job:
        """One size."""
        return Job(size, self.touched, self.precision, self.surface, self.memory)


@dataclass(frozen=True)
class Results:
    """Rows by the number of tetrahedra that was asked for."""

    settings: Settings
    rows: dict[int, Row] = field(default_factory=dict)


def run(settings: Settings, keep: Path | None = None, report: Callable[[str], None] = lambda _: None) -> Results:
    """Measure; rows are kept in a file as they come, and those that it has already are not measured again.

    ``report`` is called with the size and the stage.

    Raises
    ------
    Error
        A size that cannot be measured, and why; a file of other settings or another machine.

    """
    # More sizes may be asked for than the last time.
    file = RowsFile(keep, {name: value for name, value in asdict(settings).items() if name != "sizes"})
    rows = {row.pop("size"): Row(**row) for row in file.read()}
    for size in settings.sizes:
        if size not in rows:
            rows[size] = _measure_in_child(settings.job(size), report)
            file.write([{"size": size, **asdict(row)} for size, row in rows.items()])
    return Results(settings, {size: rows[size] for size in sorted(settings.sizes)})


def _measure_in_child(job: Job, report: Callable[[str], None]) -> Row:
    """Measure in a child, whose last line is the row."""
    command = [sys.executable, "-m", "benches.scale_row", json.dumps(asdict(job))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT) as child:
        message: dict[str, Any] = {}
        try:
            for line in child.stdout or ():
                message = json.loads(line)
                if "stage" in message:
                    report(f"{job.tetrahedra} tetrahedra: {message['stage']}")
            failure = child.stderr.read() if child.stderr else ""
        except BaseException:
            child.kill()
            raise
    if child.returncode or "row" not in message:
        lines = failure.strip().splitlines() or [f"its process ended with status {child.returncode}"]
        raise Error(f"{job.tetrahedra} tetrahedra cannot be measured: {lines[-1]}")
    return Row(**message["row"])


def total(row: Row) -> float:
    """Seconds from the beginning to the first touch."""
    return sum(row.seconds.values())


def cpu_total(row: Row) -> float:
    """Seconds of all processors from the beginning to the first touch."""
    return sum(row.cpu_seconds.values())


def exponents(results: Results) -> dict[str, float]:
    """Powers of the number of tetrahedra by which times, memory and store grow; the fit is over all sizes.

    Times are those of the processors, which other programs disturb less.
    """
    rows = list(results.rows.values())
    if len(rows) < 2:
        return {}
    counts = np.log([row.tetrahedra for row in rows])
    values = {name: [row.cpu_seconds.get(name, 0.0) for row in rows] for name in rows[0].cpu_seconds}
    values[TOTAL] = [cpu_total(row) for row in rows]
    for name in ("peak", "peak_whole", "store", "tick_median", "tick_worst", "frame"):
        values[name] = [float(getattr(row, name)) for row in rows]
    positive = {name: of for name, of in values.items() if min(of) > 0}
    return {name: float(np.polyfit(counts, np.log(of), 1)[0]) for name, of in positive.items()}


def table(results: Results) -> tuple[list[str], list[list[str]]]:
    """Headings and lines for people, a column a size and the exponents last; s on the wall, and of all processors."""
    rows, powers = list(results.rows.values()), exponents(results)
    headings = ["", *(f"{row.tetrahedra} tets" for row in rows), "power"]

    def line(title: str, power: str | None, cells: Sequence[str]) -> list[str]:
        return [title, *cells, f"{powers[power]:.2f}" if power in powers else ""]

    def times(name: str) -> list[str]:
        times = [(row.seconds.get(name), row.cpu_seconds.get(name)) for row in rows]
        return ["-" if wall is None else _seconds(wall, cpu) for wall, cpu in times]

    lines = [
        line("nodes", None, [str(row.nodes) for row in rows]),
        line("on the surface; touchable", None, [f"{row.surface_nodes}; {row.touched}" for row in rows]),
    ]
    names = dict.fromkeys(name for row in rows for name in row.seconds)
    lines += [line(name, name, times(name)) for name in names]
    lines += [
        line(TOTAL, TOTAL, [_seconds(total(row), cpu_total(row)) for row in rows]),
        line("peak memory of the precomputation, MB", "peak", [f"{row.peak / 1e6:.0f}" for row in rows]),
        line("  planned over measured", None, [f"{row.planned / row.peak:.2f}" for row in rows]),
        line("  with meshing and touching, MB", "peak_whole", [f"{row.peak_whole / 1e6:.0f}" for row in rows]),
        line("store, MB", "store", [f"{row.store / 1e6:.1f}" for row in rows]),
        line("tick, median, us", "tick_median", [f"{row.tick_median:.1f}" for row in rows]),
        line("  costliest place, us", "tick_worst", [f"{row.tick_worst:.1f}" for row in rows]),
        line("  longest of all plays, us", None, [f"{row.tick_noisy:.0f}" for row in rows]),
        line("frame, whole surface, us", "frame", [f"{row.frame:.0f}" for row in rows]),
    ]
    return headings, lines


def markdown(results: Results) -> str:
    """Return the table for a page."""
    headings, lines = table(results)
    rows = [headings, ["---"] * len(headings), *([cell.strip() for cell in line] for line in lines)]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def plot(results: Results, path: Path) -> None:
    """Draw the stages, memory and store, ticks and frames, against tetrahedra."""
    from matplotlib import colormaps

    rows = list(results.rows.values())
    counts = [row.tetrahedra for row in rows]
    figure = empty_figure(17.0, 4.8)
    left, middle, right = figure.subplots(1, 3)
    for rank, name in enumerate(dict.fromkeys(name for row in rows for name in row.seconds)):
        known = [(row.tetrahedra, row.cpu_seconds[name]) for row in rows if row.cpu_seconds.get(name)]
        if known:
            left.plot(*zip(*known, strict=True), "o-", markersize=4, label=name, color=colormaps["tab20"](rank))
    left.plot(counts, [total(row) for row in rows], "ko:", markersize=4, label=f"{TOTAL}, on the wall")
    left.plot(counts, [cpu_total(row) for row in rows], "ko-", markersize=4, linewidth=2.4, label=TOTAL)
    for name, key, style in (("peak memory", "peak", "o-"), ("planned", "planned", "^:"), ("store", "store", "o-")):
        middle.plot(counts, [getattr(row, key) / 1e6 for row in rows], style, markersize=5, label=name)
    ticks = (("tick: median", "tick_median"), ("tick: costliest place", "tick_worst"), ("frame", "frame"))
    for name, key in ticks:
        right.plot(counts, [getattr(row, key) for row in rows], "o-", markersize=4, label=name)
    for axes, label in ((left, "s of all processors"), (middle, "MB"), (right, "us")):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("tetrahedra")
        axes.set_ylabel(label)
        axes.grid(True, which="major", alpha=0.3)
        beside = {"loc": "upper left", "bbox_to_anchor": (1, 1)} if axes is left else {}
        axes.legend(frameon=False, fontsize=8, **beside)
    write_figure(figure, path)


def _seconds(*values: float) -> str:
    return "; ".join(f"{value:.3g}" if value < 100 else f"{value:.0f}" for value in values)


def scale(
    sizes: Annotated[str, typer.Option(help="Numbers of tetrahedra.")] = "1k,10k,100k,1M",
    touched: Annotated[int, typer.Option(min=1, help="Nodes that may be touched; all where there are fewer.")] = 2000,
    precision: Annotated[str, typer.Option(help="Stored number format, or 'auto'.")] = "f16",
    surface: Annotated[
        Path | None, typer.Option(help="Fill this surface (STL, PLY, OBJ; metres) in place of making grids.")
    ] = None,
    memory: Annotated[str | None, typer.Option(help="Memory that a size may take, such as 8GB.")] = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """All stages from a mesh or a surface to the first touch, memory, store, ticks and frames, over tetrahedra.

    A million tetrahedra take minutes, and gigabytes. With --out rows are kept in scale.json as they come, a run that
    was interrupted goes on from there, and scale.md and scale.png are written.

    Example: python -m benches scale --sizes 1k,10k,100k

    Example: python -m benches scale --surface liver.stl --sizes 5k,50k --out scale
    """
    if precision not in ("auto", "f16", "f32", "f64"):
        raise Error(f"unknown precision '{precision}': use 'f16', 'f32', 'f64' or 'auto'")
    if surface is not None:
        require_file(surface, Error)
    settings = Settings(
        tuple(count_of(size) for size in sizes.split(",")),
        touched,
        None if precision == "auto" else precision,
        None if surface is None else str(surface.resolve()),
        None if memory is None else int(memory_units(memory)),
    )
    folder = make_folder(out)
    with Console(stderr=True).status("measuring") as status:
        results = run(settings, folder and folder / "scale.json", status.update)
    if folder is not None:
        plot(results, folder / "scale.png")
        with written_beside(folder / "scale.md") as partial:
            partial.write_text(markdown(results))
        print_written(folder / "scale.json", folder / "scale.md", folder / "scale.png")
    notes = [
        "seconds on the wall; of all processors, which other programs disturb less",
        "power: of the number of tetrahedra, fitted to the processors' time",
        "costliest place: the shortest of its plays",
    ]
    shown = Table("From the mesh to the first touch, s", *table(results), notes=notes)
    show(as_json, list(results.rows.values()), shown, exponents=exponents(results))
