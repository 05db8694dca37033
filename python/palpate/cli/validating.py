"""Commands that measure: the accuracy table, and whether this machine keeps 1 kHz."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from palpate.cli.app import app
from palpate.cli.completion import checks
from palpate.errors import Error
from palpate.input_file import require_writable
from palpate.progress import progress_reporter, status_line
from palpate.validation.plots import plot_wakeups

if TYPE_CHECKING:
    from palpate.validation.verify import Benchmark, Check, Outcome


@app.command()
def verify(
    names: Annotated[
        list[str] | None, typer.Argument(help="Benchmarks; all if none is named.", autocompletion=checks)
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the plots, as PNG.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """Compute benchmarks with known answers, and compare. The exit code is 1 if a figure misses its tolerance.

    Example: palpate verify

    Example: palpate verify cantilever le10

    Example: palpate verify convergence felt --out plots
    """
    from palpate.validation.verify import chosen

    outcomes: list[tuple[Benchmark, Outcome]] = []
    for benchmark in chosen(names or []):
        with status_line(benchmark.title):
            outcomes.append((benchmark, benchmark.run()))
    if as_json:
        print(json.dumps(_as_rows(outcomes), indent=2))
    else:
        _print_table(outcomes)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        for _, outcome in outcomes:
            for file, draw in outcome.plots.items():
                draw(out / file)
    if not all(check.passed for _, outcome in outcomes for check in outcome.checks):
        raise typer.Exit(1)


def _as_rows(outcomes: list[tuple[Benchmark, Outcome]]) -> list[dict]:
    return [
        {"benchmark": benchmark.name, **asdict(check), "error": check.error, "verdict": _verdict(check)}
        for benchmark, outcome in outcomes
        for check in outcome.checks
    ]


def _print_table(outcomes: list[tuple[Benchmark, Outcome]]) -> None:
    """One block a benchmark: its title with the source of its targets, then its figures."""
    from rich.console import Console
    from rich.table import Table

    console = Console()
    console.width = max(console.width, 100) if not console.is_terminal else console.width
    for k, (benchmark, outcome) in enumerate(outcomes):
        sources = "; ".join(dict.fromkeys(check.source for check in outcome.checks))
        console.print(f"[bold]{benchmark.name}[/bold]  {benchmark.title} [dim]({sources})[/dim]", highlight=False)
        table = Table(box=None, pad_edge=False, show_header=k == 0, header_style="dim", expand=True)
        table.add_column("", ratio=1)
        for title, width in (("computed", 12), ("target", 11), ("error", 8), ("tolerance", 9), ("", 5)):
            table.add_column(title, width=width, justify="right", no_wrap=True)
        for check in outcome.checks:
            verdict = _verdict(check)
            style = {"pass": "green", "FAIL": "bold red", "shown": "dim"}[verdict]
            table.add_row(f"  {check.quantity}", *_figures(check), f"[{style}]{verdict}[/{style}]")
        console.print(table)
    judged = [check for _, outcome in outcomes for check in outcome.checks if check.tolerance is not None]
    missed = sum(not check.passed for check in judged)
    console.print(f"{len(judged)} figures, {missed or 'none'} beyond tolerance", highlight=False)


def _figures(check: Check) -> tuple[str, ...]:
    """Format computed, target, error and tolerance."""
    tolerance = "" if check.tolerance is None else _part(check.tolerance)
    if check.target == 0:  # the figure is an error itself
        return _part(check.computed), "0", _part(check.error), tolerance
    unit = f" {check.unit}" if check.unit else ""
    return f"{check.computed:.4g}{unit}", f"{check.target:.4g}{unit}", _part(check.error), tolerance


def _part(value: float) -> str:
    """Format a relative figure: per cent, or a power of ten if there is too little of it."""
    if value == 0:
        return "0"
    return f"{100 * value:.2g} %" if value >= 1e-4 else f"{value:.0e}"


def _verdict(check: Check) -> str:
    if check.tolerance is None:
        return "shown"
    return "pass" if check.passed else "FAIL"


@app.command()
def doctor(
    seconds: Annotated[float, typer.Option(min=1.0, max=3600.0, help="How long the loop runs.")] = 30.0,
    plot: Annotated[Path | None, typer.Option(help="Draw the histogram of wake-ups into this PNG.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, with the same keys on every machine.")] = False,
) -> None:
    """Measure whether this machine keeps 1 kHz, and print what to change.

    It reads limits, kernel and processors, runs the loop, plays every kind of tick, and opens the page.

    Example: palpate doctor --seconds 10

    Example: palpate doctor --json > machine.json
    """
    if plot is not None:
        require_writable(plot, Error)
    from palpate.validation.doctor import report as module

    with progress_reporter("running the loop", True) as bar:
        report = None if bar is None else lambda passed: bar(round(10 * passed), round(10 * seconds))
        found = module.examine(seconds, report)
    if plot is not None:
        granted = "with" if found.loop.priority else "without"
        plot_wakeups(found.loop.wakeup_us, f"wake-up of the loop, {granted} real-time priority, {seconds:g} s", plot)
        print(f"wrote {plot}", file=sys.stderr)
    print(json.dumps(module.as_json(found), indent=2) if as_json else module.as_text(found))
