"""The envelope of the force loop from the command line."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from palpate.cli.benchmarks import bench_app

if TYPE_CHECKING:
    from palpate.validation.bench.servo import Results


@bench_app.command()
def servo(
    quick: Annotated[bool, typer.Option("--quick", help="The two smaller bodies, fewer ticks; half a minute.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for servo.json and servo.png; a run that was interrupted goes on from there."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the tables.")] = False,
) -> None:
    """Envelope of the force loop: surface nodes, contacts and law against computing and wake-up times.

    Every kind of tick has its own row. It takes some ten minutes; with --out it can be interrupted.

    Example: palpate bench servo --quick

    Example: palpate bench servo --out envelope
    """
    from palpate.progress import progress_reporter
    from palpate.validation.bench import servo as bench

    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    with progress_reporter("measuring the force loop", True) as report:
        keep = None if out is None else out / "servo.json"
        results = bench.run(bench.QUICK if quick else bench.Settings(), keep, report)
    if out is not None:
        bench.plot(results, out / "servo.png")
    if as_json:
        print(json.dumps(bench.as_json(results), indent=2))
        return
    _print_ticks(results)
    _print_loops(results)
    if out is not None:
        print(f"wrote {out / 'servo.json'} and {out / 'servo.png'}", file=sys.stderr)


def _print_ticks(results: Results) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title="Computing time of every kind of tick, us of its thread", title_justify="left")
    for name in ("law", "surface nodes", "contacts", "tick"):
        table.add_column(name, no_wrap=True)
    for name in ("median", "p99.9", "worst", "costliest place"):
        table.add_column(name, justify="right")
    for row in results.rows:
        start = (row.law, str(row.surface_nodes), str(row.contacts))
        for kind, (times, most) in row.ticks.items():
            figures = (times.median, times.p999, times.worst, most)
            table.add_row(*start, kind, *(f"{value:.1f}" for value in figures))
            start = ("", "", "")
        table.add_section()
    Console().print(table)
    print("costliest place: the shortest of its plays, as other programs and first touches of memory do not come twice")


def _print_loops(results: Results) -> None:
    from rich.console import Console
    from rich.table import Table

    rows = [row for row in results.rows if row.compute and row.wakeup]
    if not rows:
        return
    table = Table(title="The running loop at 1 kHz, us", title_justify="left")
    for name in ("law", "surface nodes", "contacts", "computing: median", "p99.9", "worst"):
        table.add_column(name, justify="right")
    for name in ("wake-up: median", "p99.9", "worst", "missed by computing", "by waking"):
        table.add_column(name, justify="right")
    for row in rows:
        figures = [value for t in (row.compute, row.wakeup) if t for value in (t.median, t.p999, t.worst)]
        missed = (str(row.missed_computing), str(row.missed_waking))
        table.add_row(row.law, str(row.surface_nodes), str(row.contacts), *(f"{v:.0f}" for v in figures), *missed)
    Console().print(table)
