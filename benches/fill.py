"""Surfaces filled at the default size: whether, how fast and how well, beside NETGEN alone on the surface itself."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benches.fill_corpus import Case, corpus
from benches.output import ROOT, Json, Out, Table, make_folder, show
from benches.rows_file import RowsFile
from palpate.progress import status_line

# What has to hold: seconds, MB, degrees, share of the volume, seconds to a first touch by triangles.
MOST_SECONDS, MOST_MEMORY, LEAST_ANGLE, MOST_LOSS = 20.0, 2000.0, 3.0, 0.02
TOUCHED = {"rough scan of 100,000": 10.0, "ball of 1,000,000": 30.0}
# Reasons for which a surface may be refused.
HOLDS = ("no inside",)


@dataclass(frozen=True)
class Row:
    """A surface, what was made of it (see `benches.fill_row`), by NETGEN alone, and the time to a touch."""

    name: str
    kind: str
    thick: bool
    filled: dict[str, Any]
    netgen: dict[str, Any] = field(default_factory=dict)
    touch: dict[str, Any] = field(default_factory=dict)

    @property
    def is_right(self) -> bool:
        """Whether it was filled, or refused for a reason that holds."""
        if "refused" in self.filled:
            return self.kind == "no inside" and any(reason in self.filled["refused"] for reason in HOLDS)
        return "nodes" in self.filled and self.kind != "no inside"

    def faults(self) -> list[str]:
        """List what does not hold."""
        found, outcome = [] if self.is_right else ["not filled"], self.filled
        if outcome.get("seconds", 0) > MOST_SECONDS:
            found.append(f"{outcome['seconds']:.0f} s")
        if outcome.get("memory_mb", 0) > MOST_MEMORY:
            found.append(f"{outcome['memory_mb']:.0f} MB")
        if outcome.get("angle", 90) < LEAST_ANGLE:
            found.append(f"{outcome['angle']:.1f} degrees")
        if self.thick and abs(outcome.get("volume_error", 0)) > MOST_LOSS:
            found.append(f"volume {100 * outcome['volume_error']:+.1f} %")
        if self.touch and self.touch.get("touch_s", np.inf) > TOUCHED[self.name]:
            found.append(f"touched after {self.touch.get('touch_s', np.inf):.0f} s")
        return found


def measure(case: Case, with_netgen: bool) -> Row:
    """Fill a surface in processes of their own."""
    filled = _in_process(case.name, "auto")
    netgen = _in_process(case.name, "netgen") if with_netgen else {}
    touch = _in_process(case.name, "touch") if case.name in TOUCHED else {}
    return Row(case.name, case.kind, case.thick, filled, netgen, touch)


def _in_process(name: str, way: str) -> dict[str, Any]:
    command = [sys.executable, "-m", "benches.fill_row", name, way]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        return {"failed": (done.stderr.strip().splitlines() or [f"status {done.returncode}"])[-1]}
    return json.loads(lines[-1])


def as_table(rows: Sequence[Row]) -> Table:
    """Return one line per surface."""
    lines = []
    for row in rows:
        outcome, alone = row.filled, row.netgen
        by = (
            "failed"
            if "failed" in outcome
            else "refused"
            if "refused" in outcome
            else "wrap"
            if outcome["wrapped"]
            else "NETGEN"
        )
        cells = [
            row.kind,
            row.name,
            by,
            _figure(outcome, "seconds", "{:.1f}"),
            _figure(outcome, "processor_s", "{:.1f}"),
        ]
        cells += [_figure(outcome, "angle", "{:.1f}"), _figure(outcome, "volume_error", "{:+.1f}", 100)]
        cells += [_figure(outcome, "hausdorff", "{:.1f}", 100), _figure(outcome, "memory_mb", "{:.0f}")]
        ran = bool(alone) and "nodes" in alone
        ratio = f"{outcome['seconds'] / alone['seconds']:.2f}" if ran and "nodes" in outcome else "-"
        lines.append([*cells, _figure(alone, "seconds", "{:.1f}") if ran else "refused" if alone else "-", ratio])
    headings = ["kind", "surface", "by", "s", "cpu s", "angle", "volume %", "off %", "MB", "NETGEN alone: s", "ratio"]
    right = sum(row.is_right for row in rows)
    notes = [f"{right} of {len(rows)} filled, or refused for a reason that holds"]
    notes += [f"{row.name}: {', '.join(row.faults())}" for row in rows if row.faults()]
    notes += [
        f"{row.name}: touched {row.touch['touch_s']:.1f} s after its file was opened"
        for row in rows
        if "touch_s" in row.touch
    ]
    return Table("Surfaces filled at the default size, 10-node elements", headings, lines, words=3, notes=notes)


def _figure(row: dict[str, Any], name: str, form: str, factor: float = 1.0) -> str:
    return form.format(factor * row[name]) if name in row else "-"


def fill(
    only: Annotated[str, typer.Option(help="Kinds, such as 'holes,thin'; default: all.")] = "",
    netgen: Annotated[bool, typer.Option("--netgen/--no-netgen", help="Whether NETGEN alone runs beside it.")] = True,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Fill a corpus of more than 60 surfaces, whole and damaged; exit code 1 where one of them is not as it should be.

    With --out, rows are kept in fill.json, from which an interrupted run continues.

    Example: python -m benches fill --only holes,flipped
    """
    kinds = [kind.strip() for kind in only.split(",") if kind.strip()]
    folder = make_folder(out)
    file = RowsFile(None if folder is None else Path(folder) / "fill.json", {"netgen": netgen})
    records = file.read()
    for case in corpus():
        if (kinds and case.kind not in kinds) or any(row["name"] == case.name for row in records):
            continue
        with status_line(f"filling {case.name}"):
            records.append(asdict(measure(case, netgen)))
        file.write(records)
    rows = [Row(**row) for row in records if not kinds or row["kind"] in kinds]
    show(as_json, rows, as_table(rows))
    if any(row.faults() for row in rows):
        raise typer.Exit(1)
