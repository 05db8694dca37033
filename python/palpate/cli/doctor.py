"""The command that measures whether this machine keeps 1 kHz."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.app import app


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
    from palpate.errors import Error
    from palpate.input_file import require_writable

    if plot is not None:
        require_writable(plot, Error)
    from palpate.progress import progress_reporter
    from palpate.validation.doctor import report as module

    with progress_reporter("running the loop", True) as bar:
        report = None if bar is None else lambda passed: bar(round(10 * passed), round(10 * seconds))
        found = module.examine(seconds, report)
    if plot is not None:
        from palpate.validation.plots import plot_wakeups

        granted = "with" if found.loop.priority else "without"
        plot_wakeups(found.loop.wakeup_us, f"wake-up of the loop, {granted} real-time priority, {seconds:g} s", plot)
        print(f"wrote {plot}", file=sys.stderr)
    print(json.dumps(module.as_json(found), indent=2) if as_json else module.as_text(found))
