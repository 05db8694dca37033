"""Benchmarks from the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from palpate.cli.app import app

if TYPE_CHECKING:
    from palpate.bench.paper import Row
    from palpate.bench.precompute import Result

bench_app = typer.Typer(help="Measure, beside something else in the same run.", no_args_is_help=True)
app.add_typer(bench_app, name="bench")


@bench_app.command()
def paper(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """Table 1 of the paper: its figures, its method here, and Palpate.

    Example: palpate bench paper --json > paper.json
    """
    from palpate.bench import paper as bench
    from palpate.progress import narrated

    with narrated("measuring doll, kidney and liver"):
        rows = bench.run()
    if as_json:
        print(json.dumps(bench.as_json(rows), indent=2))
        return
    _print_table(rows)


@bench_app.command()
def precompute(
    sizes: Annotated[str, typer.Option(help="Bodies, of about 1k, 2k, 15k and 20k nodes.")] = "1k,2k,20k",
    threads: Annotated[str, typer.Option(help="Numbers of threads.")] = "1,2",
    plot: Annotated[Path | None, typer.Option(help="Draw time against surface dofs into this PNG.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """All surface columns of a liver, beside other solvers in the same run.

    Peers: pip install 'palpate[bench]'. Example: palpate bench precompute --sizes 1k,2k --plot precompute.png
    """
    from palpate.bench import precompute as bench
    from palpate.progress import narrated

    with narrated("measuring; the larger bodies take minutes"):
        results = bench.run(sizes.split(","), [int(count) for count in threads.split(",")])
    if plot is not None:
        bench.plot(results, plot)
    if as_json:
        print(json.dumps(bench.as_json(results), indent=2))
        return
    _print_precompute(results)
    for peer, package in bench.missing_peers().items():
        print(f"{peer} was left out: pip install {package}")


def _print_precompute(results: list[Result]) -> None:
    from rich.console import Console
    from rich.table import Table

    groups: dict[tuple[str, int], list[Result]] = {}
    for r in results:
        groups.setdefault((r.size, r.threads), []).append(r)
    for (_, threads), rows in groups.items():
        ours = next(r for r in rows if r.method == "Palpate")
        title = f"{ours.nodes} nodes, {ours.surface_dofs} surface dofs, {threads} thread{'s' * (threads > 1)}"
        table = Table(title=title, title_justify="left")
        table.add_column("all surface columns by", no_wrap=True)
        for heading in ("s", "share", "CPU s", "share", "columns", "runs"):
            table.add_column(heading, justify="right")
        for r in rows:
            shares = (f"{ours.seconds / r.seconds:.3f}", f"{ours.cpu_seconds / r.cpu_seconds:.3f}")
            columns = "all" if r.sampled is None else f"{r.sampled} scaled"
            table.add_row(
                r.method, f"{r.seconds:.4g}", shares[0], f"{r.cpu_seconds:.4g}", shares[1], columns, str(r.repeats)
            )
        Console().print(table)
        print(f"Palpate's file, written, verified and mapped: {ours.writing_seconds:.3g} s more")
    print("share: Palpate's time over that of the row")


def _print_table(rows: list[Row]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title="Table 1 of the paper, and here")
    table.add_column("")
    for row in rows:
        table.add_column(row.model, justify="right")

    def line(title: str, cell) -> None:
        table.add_row(title, *(cell(row) for row in rows))

    line("nodes: paper", lambda r: str(r.paper_nodes))
    line("nodes: here", lambda r: str(r.nodes))
    line("tetrahedra: paper", lambda r: str(r.paper_tets))
    line("tetrahedra: here", lambda r: str(r.tets))
    line("surface nodes: paper", lambda r: str(r.paper_surface_nodes))
    line("surface nodes: here", lambda r: str(r.surface_nodes))
    line("surface triangles: paper", lambda r: str(r.paper_surface_triangles))
    line("surface triangles: here", lambda r: str(r.surface_triangles))
    table.add_section()
    line("precompute: paper, Pentium 4", lambda r: f"{r.paper_precompute_s / 60:.1f} min")
    line("precompute: its dense inverse here", lambda r: f"{r.dense_precompute_s:.2f} s")
    line("precompute: Palpate", lambda r: f"{r.precompute_s:.2f} s")
    line("  times faster than its method here", lambda r: f"{r.precompute_ratio:.1f}")
    table.add_section()
    line("contact and surface: paper, Pentium 4", lambda r: f"{r.paper_simulation_us:.0f} us")
    line("contact and surface: its method here", lambda r: f"{r.dense_simulation_us:.1f} us")
    line("force alone, one tick: Palpate", lambda r: f"{r.force_us:.2f} us")
    line("force and whole surface: Palpate", lambda r: f"{r.force_and_surface_us:.1f} us")
    table.add_section()
    line("force of both methods, relative difference", lambda r: f"{r.difference:.0e}")
    console = Console()
    console.print(table)
    console.print("force alone: patch contact with geometry and safety stage, as the 1 kHz loop runs it")
