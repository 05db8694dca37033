"""What a benchmark prints: tables for people or JSON for programs, and the machine that it ran on."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from palpate.errors import Error

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of the tables.")]
Out = Annotated[Path | None, typer.Option(help="Folder for plots and files.")]
# Children of a benchmark start here, to find the package of benchmarks.
ROOT = Path(__file__).resolve().parents[1]
MULTIPLES = {"k": 1_000, "M": 1_000_000}
# Width of a table that does not go to a terminal, characters.
WIDTH = 150


@dataclass(frozen=True)
class Table:
    """A table; None among its lines draws a rule.

    Attributes
    ----------
    title, headings, lines
        Text, a string a cell.
    words
        How many columns, from the left, hold words; figures stand on the right.
    notes
        Sentences below it.

    """

    title: str
    headings: Sequence[str]
    lines: Sequence[Sequence[str] | None]
    words: int = 1
    notes: Sequence[str] = ()


def show(as_json: bool, rows: Sequence[Any], *tables: Table, **more: Any) -> None:
    """Print rows (dataclasses) as JSON with the machine and ``more``, or the tables."""
    if as_json:
        data = {"machine": machine(), "rows": [asdict(row) for row in rows], **more}
        print(json.dumps(data, indent=2, default=np.ndarray.tolist))
        return
    from rich.console import Console
    from rich.table import Table as Shown

    console = Console()
    if not console.is_terminal:
        console.width = max(console.width, WIDTH)
    for table in tables:
        shown = Shown(title=table.title, title_justify="left")
        for rank, heading in enumerate(table.headings):
            shown.add_column(heading, justify="left" if rank < table.words else "right", no_wrap=True)
        for line in table.lines:
            if line is None:
                shown.add_section()
            else:
                shown.add_row(*line)
        console.print(shown)
        for note in table.notes:
            print(note)


def transposed(
    title: str, names: Sequence[str], lines: Sequence[tuple[str, Sequence[str]] | None], notes: Sequence[str] = ()
) -> Table:
    """Table with a column a name and a line a figure."""
    return Table(title, ["", *names], [None if line is None else [line[0], *line[1]] for line in lines], notes=notes)


def make_folder(folder: Path | None) -> Path | None:
    """Make the folder of ``--out``."""
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def print_written(*paths: Path) -> None:
    """Say which files were written."""
    print(f"wrote {', '.join(map(str, paths))}", file=sys.stderr)


def machine() -> dict[str, Any]:
    """Return what the figures belong to."""
    from palpate.validation.doctor.machine import read_machine

    found = read_machine()
    return {"processor": found.processor, "cpus": len(os.sched_getaffinity(0)), "kernel": found.kernel}


def count_of(text: str) -> int:
    """Tetrahedra of ``"100k"``."""
    number, last = text.strip(), text.strip()[-1:]
    try:
        count = round(float(number[:-1] if last in MULTIPLES else number) * MULTIPLES.get(last, 1))
    except (ValueError, OverflowError):
        count = 0
    if count < 100:
        raise Error(f"'{text}' is no number of tetrahedra: give at least 100, such as 10k or 1M")
    return count
