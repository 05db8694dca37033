"""Every stage from a mesh to a felt contact, on bodies of a thousand to a million tetrahedra.

Each size is measured in a process of its own (:mod:`palpate.validation.bench.scale_row`). Bodies are blocks of the same
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
from typing import Any

import numpy as np

from palpate.atomic import written_beside
from palpate.errors import Error
from palpate.validation.bench.scale_row import Job, Row
from palpate.validation.bench.servo import machine
from palpate.validation.plots import plot_scaling

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

    ``report`` is told the size and the stage.

    Raises
    ------
    Error
        A size that cannot be measured, and why; a file of other settings or another machine.

    """
    results = Results(settings, _kept(keep, settings))
    for size in settings.sizes:
        if size not in results.rows:
            results.rows[size] = _measured(settings.job(size), report)
            _keep(keep, results)
    rows = {size: results.rows[size] for size in sorted(settings.sizes)}
    return Results(settings, rows)


def _measured(job: Job, report: Callable[[str], None]) -> Row:
    """Measure in a child, whose last line is the row."""
    command = [sys.executable, "-m", "palpate.validation.bench.scale_row", json.dumps(asdict(job))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        told: dict[str, Any] = {}
        try:
            for line in child.stdout or ():
                told = json.loads(line)
                if "stage" in told:
                    report(f"{job.tetrahedra} tetrahedra: {told['stage']}")
            failure = child.stderr.read() if child.stderr else ""
        except BaseException:
            child.kill()
            raise
    if child.returncode or "row" not in told:
        lines = failure.strip().splitlines() or [f"its process ended with status {child.returncode}"]
        raise Error(f"{job.tetrahedra} tetrahedra cannot be measured: {lines[-1]}")
    return Row(**told["row"])


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
        told = [(row.seconds.get(name), row.cpu_seconds.get(name)) for row in rows]
        return ["-" if wall is None else _seconds(wall, cpu) for wall, cpu in told]

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


def as_json(results: Results) -> dict[str, Any]:
    """Everything as plain data: times in s, ticks and frames in us, memory and store in bytes."""
    rows = {str(size): asdict(row) for size, row in results.rows.items()}
    settings = {**asdict(results.settings), "sizes": list(results.settings.sizes)}
    return {"machine": machine(), "settings": settings, "rows": rows, "exponents": exponents(results)}


def plot(results: Results, path: Path) -> None:
    """Draw the stages, memory and store, ticks and frames, against tetrahedra."""
    rows = list(results.rows.values())
    names = dict.fromkeys(name for row in rows for name in row.seconds)
    plot_scaling(
        [row.tetrahedra for row in rows],
        {
            **{name: [row.cpu_seconds.get(name) for row in rows] for name in names},
            f"{TOTAL}, on the wall": [total(row) for row in rows],
            TOTAL: [cpu_total(row) for row in rows],
        },
        {
            "peak memory": [row.peak for row in rows],
            "planned": [row.planned for row in rows],
            "store": [row.store for row in rows],
        },
        {
            "tick: median": [row.tick_median for row in rows],
            "tick: costliest place": [row.tick_worst for row in rows],
            "frame": [row.frame for row in rows],
        },
        path,
    )


def _seconds(*values: float) -> str:
    return "; ".join(f"{value:.3g}" if value < 100 else f"{value:.0f}" for value in values)


def _keep(path: Path | None, results: Results) -> None:
    if path is not None:
        with written_beside(path) as partial:
            partial.write_text(json.dumps(as_json(results), indent=1))


def _kept(path: Path | None, settings: Settings) -> dict[int, Row]:
    """Rows of an earlier run of the same bodies on the same machine; none without a file."""
    if path is None or not path.exists():
        return {}
    try:
        held = json.loads(path.read_text())
        # More sizes may be asked for than the last time.
        wanted = {name: value for name, value in asdict(settings).items() if name != "sizes"}
        same = held["machine"] == machine() and all(held["settings"][name] == wanted[name] for name in wanted)
        rows = {int(size): Row(**row) for size, row in held["rows"].items()} if same else {}
    except (ValueError, KeyError, TypeError):
        raise Error(f"{path}: is not a file of this benchmark; delete it, or choose another --out") from None
    if not same:
        raise Error(f"{path}: holds rows of other settings or of another machine; delete it, or choose another --out")
    return rows
