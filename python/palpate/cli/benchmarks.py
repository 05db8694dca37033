"""Benchmarks from the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from palpate.cli.app import app

if TYPE_CHECKING:
    from palpate.validation.bench import dynamics as dynamics_bench
    from palpate.validation.bench.contact import Results as ContactResults
    from palpate.validation.bench.elements import Row as ElementRow
    from palpate.validation.bench.paper import Row
    from palpate.validation.bench.precompute import Result
    from palpate.validation.bench.tick import Row as TickRow
    from palpate.validation.bench.viewer import Row as ViewerRow

bench_app = typer.Typer(help="Measure, beside something else in the same run.", no_args_is_help=True)
app.add_typer(bench_app, name="bench")


@bench_app.command()
def paper(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """Table 1 of the paper: its figures, its method here, and Palpate.

    Example: palpate bench paper --json > paper.json
    """
    from palpate.progress import narrated
    from palpate.validation.bench import paper as bench

    with narrated("measuring doll, kidney and liver"):
        rows = bench.run()
    if as_json:
        print(json.dumps(bench.as_json(rows), indent=2))
        return
    _print_table(rows)


@bench_app.command()
def contact(
    out: Annotated[Path | None, typer.Option(help="Folder for the plot, as PNG.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """Force of a sphere on elements larger than the contact: Palpate, MuJoCo and Drake beside a direct solution.

    Peers: pip install 'palpate[bench]'. Example: palpate bench contact --out plots
    """
    from palpate.progress import narrated
    from palpate.validation.bench import contact as bench

    with narrated("pressing; with all peers it takes some minutes"):
        results = bench.run()
    if as_json:
        print(json.dumps(bench.as_json(results), indent=2))
    else:
        _print_contact(results)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        bench.plot(results, out / "contact.png")


def _print_contact(results: ContactResults) -> None:
    from rich.console import Console
    from rich.table import Table

    from palpate.validation.bench.contact import DEPTHS

    table = Table(title="Force over that of the direct solution; half its range over the places of an element")
    table.add_column("depth", no_wrap=True)
    table.add_column("direct", justify="right", no_wrap=True)
    for row in results.rows:
        table.add_column(f"{row.method}\n{row.mesh}", justify="right")
    for i, (depth, force) in enumerate(zip(DEPTHS, results.truth, strict=True)):
        cells = (f"{row.means[i] / force:.2f}\n+-{100 * row.spread[i]:.2g} %" for row in results.rows)
        table.add_row(f"{1e3 * depth:g} mm", f"{1e3 * force:.1f} mN", *cells)
    table.add_row("step", "", *("" if row.step_us is None else f"{row.step_us:.1f} us" for row in results.rows))
    Console().print(table)
    ticks = Table(
        title="A tick of a sliding sphere, and numpy: three equations, the whole contact; us", title_justify="left"
    )
    for heading in ("surface nodes", "median", "worst", "numpy: solve", "numpy: contact"):
        ticks.add_column(heading, justify="right")
    for tick in results.ticks:
        figures = (tick.median, tick.worst, tick.solve, tick.numpy)
        ticks.add_row(str(tick.surface_nodes), *(f"{v:.1f}" for v in figures))
    kinds = Table(title="Every kind of tick, us", title_justify="left")
    kinds.add_column("tick", no_wrap=True)
    for heading in ("median", "worst"):
        kinds.add_column(heading, justify="right")
    for kind in results.kinds:
        kinds.add_row(kind.kind, f"{kind.median:.1f}", f"{kind.worst:.1f}")
    Console().print(ticks)
    Console().print(kinds)
    for peer, package in results.missing.items():
        print(f"{peer} was left out: pip install {package}")


@bench_app.command()
def dynamics(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
    large: Annotated[bool, typer.Option("--large", help="Also a liver of 20,000 nodes; takes minutes.")] = False,
) -> None:
    """Table 2 of the paper: one time step by its method, by sparse solvers, and by Palpate.

    CHOLMOD (scikit-sparse) and PARDISO (pypardiso) take part where they are installed.

    Example: palpate bench dynamics --json > dynamics.json
    """
    from palpate.progress import narrated
    from palpate.validation.bench import dynamics as bench

    with narrated("measuring beam and livers in motion"):
        rows = bench.run(large)
    if as_json:
        print(json.dumps(bench.as_json(rows), indent=2))
        return
    _print_dynamics(rows)


def _print_dynamics(rows: list[dynamics_bench.Row]) -> None:
    from rich.console import Console
    from rich.table import Table

    from palpate.validation.bench.peers import SPARSE

    table = Table(title="Table 2 of the paper, and here: one step of 1 ms, in us")
    table.add_column("")
    for row in rows:
        table.add_column(row.model, justify="right")

    def line(title: str, cell) -> None:
        table.add_row(title, *("-" if cell(row) is None else cell(row) for row in rows))

    def number(value: float | None, digits: int = 1) -> str | None:
        return None if value is None else f"{value:.{digits}f}"

    line("nodes: paper", lambda r: number(r.paper_nodes, 0))
    line("nodes: here", lambda r: str(r.nodes))
    line("free dofs", lambda r: str(r.dofs))
    line("modes", lambda r: str(r.modes))
    table.add_section()
    line("paper, Pentium 4", lambda r: number(r.paper_step_ms and 1e3 * r.paper_step_ms, 0))
    line("its dense inverse here", lambda r: number(r.dense_step_us))
    for name in SPARSE:
        line(name, lambda r, name=name: number(r.sparse_step_us.get(name)))
    line("Palpate, all dofs by its sparse factor", lambda r: number(r.own_sparse_step_us))
    line("Palpate, all modes, a force on a node", lambda r: number(r.modal_step_us))
    table.add_section()
    line("Palpate, force tick in contact", lambda r: number(r.tick_us))
    line("Palpate, force tick, landing and leaving", lambda r: number(r.tapping_us))
    line("Palpate, whole surface for a frame", lambda r: number(r.surface_us))
    line("tick: times faster than the dense inverse", lambda r: number(r.tick_times_dense, 0))
    line("tick: times faster than the best sparse", lambda r: number(r.tick_times_sparse, 0))
    line("60 Hz with surface: times dense inverse", lambda r: number(r.frame_times_dense, 0))
    line("60 Hz with surface: times the best sparse", lambda r: number(r.frame_times_sparse, 0))
    line("difference from SuperLU after 50 steps", lambda r: f"{r.difference:.0e}")
    console = Console()
    console.print(table)
    absent = [name for name in SPARSE if name not in rows[0].sparse_step_us]
    if absent:
        console.print(f"not installed: {', '.join(absent)}")


@bench_app.command()
def elements(
    out: Annotated[Path | None, typer.Option(help="Folder for the plot, as PNG.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """4-node and 10-node tetrahedra: error of the felt stiffness against the price of precomputing.

    Example: palpate bench elements --out plots
    """
    from palpate.progress import narrated
    from palpate.validation.bench import elements as bench

    with narrated("measuring both elements on a cube and on the liver"):
        rows = bench.run()
    if as_json:
        print(json.dumps(bench.as_json(rows), indent=2))
    else:
        _print_elements(rows)
    if out is not None:
        from palpate.validation.bench.elements import plot_elements

        out.mkdir(parents=True, exist_ok=True)
        plot_elements(rows, out / "elements.png")


def _print_elements(rows: list[ElementRow]) -> None:
    from rich.table import Table

    table = Table(title="Price of precomputing, and error of the stiffness felt by a patch")
    table.add_column("body")
    for title in ("element", "nodes", "surface", "time [s]", "store [MB]"):
        table.add_column(title, justify="right")
    for nu in rows[0].errors:
        table.add_column(f"nu {nu}", justify="right", no_wrap=True)
    for before, row in zip([rows[0], *rows], rows, strict=False):
        if (before.body, before.element_nodes) != (row.body, row.element_nodes):
            table.add_section()
        errors = (f"{100 * error:+.1f} %" for error in row.errors.values())
        size = str(row.element_nodes), str(row.nodes), str(row.surface_nodes)
        table.add_row(row.body, *size, f"{row.precompute_cpu_s:.2f}", f"{1e-6 * row.store_bytes:.1f}", *errors)


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
    from palpate.progress import narrated
    from palpate.validation.bench import precompute as bench

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


@bench_app.command()
def surface(
    tets: Annotated[str, typer.Option(help="Tetrahedra of the cube, such as 5k or 100k.")] = "100k",
    precision: Annotated[str, typer.Option(help="Number formats.")] = "f16,f32",
    folder: Annotated[Path | None, typer.Option(help="Where the stores go meanwhile.")] = None,
) -> None:
    """All of a surface in stages, with its plan, beside direct solutions by SuperLU at 20 random nodes.

    Example: palpate bench surface --tets 100k --precision f16
    """
    from palpate.validation.bench import surface as bench

    count = int(float(tets.removesuffix("k")) * (1000 if tets.endswith("k") else 1))
    for chosen in precision.split(","):
        planned, found = bench.run(count, chosen, folder)
        print(
            f"{found.tets} tetrahedra, {found.surface_nodes} surface nodes, {chosen}, {found.stages} stores on the way"
        )
        print(planned)
        print(f"columns in {found.precompute_s:.3g} s, store {found.store_bytes / 1e9:.3g} GB")
        print(
            f"20 random nodes beside SuperLU ({found.direct_s:.3g} s): largest error of a displacement "
            f"{found.largest:.2g}, {found.stated:.2g} of the error stated"
        )


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
        print(f"Palpate's file, written, verified and read: {ours.writing_seconds:.3g} s more")
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


@bench_app.command()
def tick(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """Cost of every kind of tick over the nodes under a contact, the costliest place beside the mean.

    Example: palpate bench tick --json > tick.json
    """
    from palpate.progress import narrated
    from palpate.validation.bench import tick as bench

    with narrated("pressing on the liver at many places"):
        rows = bench.run()
    if as_json:
        print(json.dumps(bench.as_json(rows), indent=2))
        return
    _print_tick(rows)


def _print_tick(rows: list[TickRow]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("nodes", "body", "tick", title="Microseconds a tick")
    for column in ("mean", "costliest place", "plain gather"):
        table.add_column(column, justify="right")
    for row in rows:
        gather = "" if row.gather is None else f"{row.gather:.1f}"
        body = "moves" if row.motion else "at rest"
        table.add_row(str(row.nodes), body, row.kind, f"{row.mean:.1f}", f"{row.costliest:.1f}", gather)
    Console().print(table)


@bench_app.command()
def viewer(
    paper: Annotated[bool, typer.Option("--paper", help="The meshes in the size of the paper; quicker.")] = False,
    seconds: Annotated[float, typer.Option(min=0.1, help="How long each model is pressed.")] = 4.0,
    surfaces: Annotated[bool, typer.Option("--surfaces", help="Large surfaces: frames, and a page.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """How long the viewer's server stalls while a page presses, moves sliders and changes the model.

    100 presses and 25 settings a second; each model with an empty cache first, then from the cache. With --surfaces:
    what frames of 20,000, 100,000 and 500,000 triangles weigh, drawn whole and by fewer, and how long a page takes.

    Example: palpate bench viewer --seconds 2
    """
    from palpate.progress import narrated

    if surfaces:
        _bench_surfaces(as_json)
        return
    from palpate.validation.bench import viewer as bench

    with narrated("measuring; an empty cache takes a minute or two"):
        rows = bench.run(paper=paper, seconds=seconds)
    if as_json:
        print(json.dumps(bench.as_json(rows), indent=2))
        return
    _print_viewer(rows)


def _bench_surfaces(as_json: bool) -> None:
    from rich.console import Console
    from rich.table import Table

    from palpate.progress import narrated
    from palpate.validation.bench import surfaces as bench

    with narrated("measuring frames and a page"):
        rows = bench.run()
    if as_json:
        print(json.dumps(bench.as_json(rows), indent=2))
        return
    table = Table(title="Large surfaces in the page", title_justify="left")
    titles = (
        "triangles",
        "drawn",
        "scene MB",
        "32 bits kB",
        "whole",
        "moves",
        "deflated",
        "still",
        "code ms",
        "deflate",
    )
    for title in (*titles, "frames/s", "read ms", "move ms"):
        table.add_column(title, justify="right")
    for row in rows:
        lengths = (row.float_kb, row.whole_kb, row.pressed_kb, row.deflated_kb, row.still_kb)
        page = (row.frames_per_second, row.read_ms, row.move_ms)
        table.add_row(
            *(f"{row.triangles:,}", f"{row.drawn:,}", f"{row.scene_mb:.1f}"),
            *(f"{length:.0f}" for length in lengths),
            *(f"{row.code_ms:.1f}", f"{row.deflate_ms:.1f}"),
            *("-" if value is None else f"{value:.1f}" for value in page),
        )
    Console(width=150).print(table)
    print(
        "frames in kB: 32 bits a number; 16 bits, whole; differences of a dent that moves, and deflated; nothing moves"
    )


def _print_viewer(rows: list[ViewerRow]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title="The viewer's server under 100 presses and 25 settings a second", title_justify="left")
    table.add_column("", no_wrap=True)
    for title in ("s", "stall ms", "mean", "idle", "frames/s", "ticks/s", "loops"):
        table.add_column(title, justify="right")
    for row in rows:
        stalls = (f"{row.longest_stall_ms:.1f}", f"{row.mean_stall_ms:.2f}", f"{row.longest_idle_ms:.1f}")
        rates = (f"{row.frames_per_second:.0f}", f"{row.ticks_per_second:.0f}")
        loops = "-" if row.most_loops is None else str(row.most_loops)
        table.add_row(row.phase, f"{row.seconds:.1f}", *stalls, *rates, loops)
    Console().print(table)
    print("stall: longest halt of the event loop, and the mean; idle: of a process beside it that does nothing")
    print(f"longest stall of the event loop: {max(row.longest_stall_ms for row in rows):.1f} ms")
