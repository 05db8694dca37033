"""Progress of long work: a bar with the time left on a terminal, silence elsewhere."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator


class Reporter:
    """Is called with what is done and all there is to do; ``phase`` names the current phase."""

    def __init__(self, report: Callable[[int, int], None], phase: Callable[[str], None]):
        self._report, self.phase = report, phase

    def __call__(self, done: int, total: int) -> None:
        """Tell how far it is."""
        self._report(done, total)


def reported_to(*reporters: Reporter | None) -> Reporter:
    """Make a reporter that passes on to all that there are."""
    given = [reporter for reporter in reporters if reporter is not None]

    def report(done: int, total: int) -> None:
        for reporter in given:
            reporter(done, total)

    def begin(phase: str) -> None:
        for reporter in given:
            reporter.phase(phase)

    return Reporter(report, begin)


@contextlib.contextmanager
def progress_reporter(title: str, progress: bool | Callable[[int, int], None]) -> Iterator[Reporter | None]:
    """Yield the reporter of the progress, or None where there is no terminal. A reporter takes phases too."""
    if isinstance(progress, Reporter):
        yield progress
        return
    if callable(progress):
        yield Reporter(progress, lambda _: None)
        return
    if not progress or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=None)
        yield Reporter(
            lambda done, total: bar.update(task, completed=done, total=total),
            lambda phase: bar.update(task, description=f"{title}: {phase}"),
        )


@contextlib.contextmanager
def status_line(text: str) -> Iterator[None]:
    """Say on a terminal what takes long; it disappears when done."""
    shown = sys.stderr.isatty()
    if shown:
        print(f"{text} ...", end="\r", file=sys.stderr, flush=True)
    try:
        yield
    finally:
        if shown:
            print(" " * (len(text) + 4), end="\r", file=sys.stderr, flush=True)
