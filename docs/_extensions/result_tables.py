"""Sphinx extension: tables of measured figures, from the JSON that `scripts/record_results.py` writes.

The directive ``results`` names a file of docs/_results and, for ``verify``, the benchmarks to show. Below each table
stand its command, date, commit and machine.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import date
from itertools import groupby
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from tables import table

Rows = Sequence[dict[str, Any]]


def verify(record: dict[str, Any], names: Sequence[str]) -> str:
    """Return figures beside their targets; names of benchmarks choose among them."""
    known = {row["benchmark"] for row in record["rows"]}
    if missing := set(names) - known:
        raise ValueError(f"verify.json has no benchmark {', '.join(sorted(missing))}")
    rows = [row for row in record["rows"] if not names or row["benchmark"] in names]
    lines = []
    for name, group in groupby(rows, lambda row: row["benchmark"]):
        for rank, row in enumerate(worst_of_kind(group)):
            lines.append((f"`{name}`" if rank == 0 else "", row["quantity"], *figures(row)))
    return table(("benchmark", "figure", "computed", "target", "error", "tolerance"), lines)


def worst_of_kind(rows: Iterable[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Of figures that should be zero and differ in their case alone (``case: figure``), only the worst."""
    kinds: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        _, colon, kind = row["quantity"].rpartition(": ")
        alike = bool(colon) and row["target"] == 0
        kinds.setdefault(kind if alike else row["quantity"] + str(row["target"]), []).append(row)
    for kind, alike in kinds.items():
        worst = max(alike, key=lambda row: row["error"])
        yield worst if len(alike) == 1 else worst | {"quantity": f"{kind}, worst of {len(alike)} cases"}


def figures(row: dict[str, Any]) -> tuple[str, str, str, str]:
    """Cells of one figure: computed, target, error, tolerance."""
    unit = f" {row['unit']}" if row["unit"] else ""
    exact = row["target"] == 0
    error = "" if exact else f"{100 * row['error']:.2g} %"
    bound = row["tolerance"]
    tolerance = "shown" if bound is None else f"{bound:g}" if exact else f"{100 * bound:.2g} %"
    if row["verdict"] == "FAIL":
        tolerance += ", **missed**"
    return f"{row['computed']:.4g}{unit}", f"{row['target']:.4g}{unit}", error, tolerance


def elements(record: dict[str, Any], _: Sequence[str]) -> str:
    """Return errors of a patch by element, size and Poisson's ratio."""
    ratios = list(record["rows"][0]["errors"])
    head = ("body", "nodes an element", "nodes", "time", "store", *(f"error, nu = {ratio}" for ratio in ratios))
    lines = [
        (
            *(row["body"], str(row["element_nodes"]), str(row["nodes"])),
            *(f"{row['precompute_cpu_s']:.2f} s", f"{row['store_bytes'] / 1e6:.1f} MB"),
            *(f"{100 * row['errors'][ratio]:+.1f} %" for ratio in ratios),
        )
        for row in record["rows"]
    ]
    return table(head, lines)


def contact(record: dict[str, Any], _: Sequence[str]) -> str:
    """Return mean forces over those of the direct solution, and half their range over the places."""
    head = ("", *(f"{1e3 * depth:g} mm deep" for depth in record["depths"]))
    lines = [("direct solution", *(f"{1e3 * force:.1f} mN" for force in record["truth"]))]
    for row, ratios in zip(record["rows"], record["ratios"], strict=True):
        # A place a row, a depth a column.
        columns = list(zip(*row["forces"], strict=True))
        spreads = [(max(forces) - min(forces)) / 2 / (sum(forces) / len(forces)) for forces in columns]
        cells = [f"{ratio:.2f} ± {100 * spread:.2g} %" for ratio, spread in zip(ratios, spreads, strict=True)]
        lines.append((f"{row['method']} ({row['mesh']})", *cells))
    return table(head, lines)


def scale(record: dict[str, Any], _: Sequence[str]) -> str:
    """Return seconds of each stage on the wall, of all processors, and memory, by size."""
    rows = record["rows"]
    lines = [("nodes", *(str(row["nodes"]) for row in rows))]
    for stage in rows[0]["seconds"]:
        pairs = ((row["seconds"][stage], row["cpu_seconds"][stage]) for row in rows)
        lines.append((stage, *(f"{wall:.3g}; {cpu:.3g}" for wall, cpu in pairs)))
    lines.append(("peak memory of the precomputation, MB", *(f"{row['peak'] / 1e6:.0f}" for row in rows)))
    lines.append(("store, MB", *(f"{row['store'] / 1e6:.1f}" for row in rows)))
    lines.append(("tick, median, us", *(f"{1e6 * row['tick_median']:.1f}" for row in rows)))
    return table(("", *(f"{row['tetrahedra']} tetrahedra" for row in rows)), lines)


MAKERS: dict[str, Callable[[dict[str, Any], Sequence[str]], str]] = {
    "verify": verify,
    "palpation": verify,
    "elements": elements,
    "contact": contact,
    "scale": scale,
}


def origin(record: dict[str, Any]) -> str:
    """Return the sentence below a table: where its figures are from."""
    day = date.fromisoformat(record["date"])
    machine = record["machine"]
    return (
        f"`{record['command']}`, {day.day} {day:%B %Y}, commit `{record['commit']}`, "
        f"{machine['cpus']} processors ({machine['processor']}, kernel {machine['kernel']})."
    )


def markdown(folder: Path, name: str, chosen: Sequence[str]) -> str:
    """Return a table with its origin."""
    path = folder / f"{name}.json"
    if name not in MAKERS or not path.exists():
        raise ValueError(f"docs/_results has no table '{name}'")
    record = json.loads(path.read_text())
    return f"{MAKERS[name](record, chosen)}\n{origin(record)}\n"


class ResultsDirective(Directive):
    """Write the table of a file of results."""

    required_arguments = 1
    optional_arguments = 100

    def run(self) -> list[nodes.Node]:
        """Make the table; an unknown file or benchmark is an error of the build."""
        env = self.state.document.settings.env
        name, *chosen = self.arguments
        folder = Path(env.srcdir) / "_results"
        env.note_dependency(str(folder / f"{name}.json"))
        try:
            text = markdown(folder, name, chosen)
        except ValueError as error:
            raise self.error(str(error)) from None
        node = nodes.container()
        self.state.nested_parse(StringList(text.splitlines(), source=name), self.content_offset, node)
        return node.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("results", ResultsDirective)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
