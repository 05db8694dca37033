"""Stability of the loop with devices and hands, from the command line."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from palpate.cli.benchmarks import bench_app

if TYPE_CHECKING:
    from rich.console import Console

    from palpate.validation.bench.touches import Touch
    from palpate.validation.bench.zwidth import DeviceRow, Row


@bench_app.command()
def zwidth(
    out: Annotated[Path | None, typer.Option(help="Folder for zwidth.csv, devices.csv and zwidth.png.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the tables.")] = False,
) -> None:
    """Largest stiffness that the loop holds on emulated devices, by bisection, beside theory.

    A map over delay and mass, and the known devices in a loose and a firm hand. It takes some minutes.

    Example: palpate bench zwidth --out plots
    """
    from dataclasses import asdict

    from palpate.progress import progress_reporter
    from palpate.validation.bench import zwidth as bench

    with progress_reporter("measuring the largest stable stiffness", True) as report:
        rows, devices = bench.run(report)
    if as_json:
        print(json.dumps({"map": [asdict(row) for row in rows], "devices": [asdict(row) for row in devices]}, indent=2))
    else:
        _print_map(rows)
        _print_devices(devices)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        bench.write(rows, out / "zwidth.csv")
        bench.write(devices, out / "devices.csv")
        bench.plot(rows, out / "zwidth.png")
        print(f"wrote {out / 'zwidth.csv'}, {out / 'devices.csv'} and {out / 'zwidth.png'}", file=sys.stderr)


def _print_map(rows: list[Row]) -> None:
    from rich.table import Table

    from palpate.validation.bench.zwidth import DAMPING, PERIOD

    title = f"Largest stable stiffness, N/m, of a tip with {DAMPING:g} N s/m at {1 / PERIOD:g} Hz"
    table = Table(title=title, title_justify="left")
    columns = ("mass g", "delay ms", "b/(T/2+d)", "eigenvalue", "measured", "controller", "whole stage")
    for name in columns:
        table.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        figures = (row.any_hand, row.eigenvalue, row.bare, row.controlled, row.whole)
        table.add_row(f"{1e3 * row.mass:g}", f"{1e3 * row.delay:g}", *(f"{figure:.1f}" for figure in figures))
    _wide_console().print(table)


def _print_devices(rows: list[DeviceRow]) -> None:
    from rich.table import Table

    table = Table(title="Known devices with assumed mechanics, N/m", title_justify="left")
    table.add_column("device", no_wrap=True)
    for name in ("recommended", "alone", "loose hand", "measured", "firm hand", "measured"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        figures = (row.recommended, row.any_hand, row.loose, row.loose_measured, row.firm, row.firm_measured)
        table.add_row(row.name, *(f"{figure:.0f}" for figure in figures))
    _wide_console().print(table)
    print("alone, hands: by theory, friction and encoder apart; measured: with them, tapped at 0.1 m/s")


@bench_app.command()
def touches(
    scenes: Annotated[
        list[Path] | None, typer.Argument(help="Scene files (.toml); the built-in models if none is named.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the tables.")] = False,
) -> None:
    """Press, slide, hold and lift with simulated hands on every known device; exit code 1 if a tip does not rest.

    Each scene is touched with eight emulated devices, with and without their dry friction, loosely and firmly held;
    tools ask for no more stiffness than the device holds. A Touch on blocks of 800 and 30,000 N/m shows what that limit
    does.

    Example: palpate bench touches examples/block.toml examples/nodule.toml
    """
    from dataclasses import asdict, replace

    from palpate.models import NAMES
    from palpate.progress import narrated
    from palpate.scene import Scene, model_scene
    from palpate.validation.bench.emulation import frictionless, known_devices
    from palpate.validation.bench.touches import HANDS, controls, hardest_at_rest, touches
    from palpate.validation.bench.zwidth import Spring

    known = known_devices()
    devices = [*known.values(), *map(frictionless, known.values())]
    given = [(path.stem, Scene.read(path)) for path in scenes or []]
    found: list[Touch] = []
    for name, scene in given or [(name, model_scene(name, True, False)) for name in NAMES]:
        with narrated(f"touching {name}"):
            found += [replace(touch, scene=name) for touch in touches(scene.build(progress=False), devices)]
    with narrated("touching hard blocks"):
        spring, own = Spring(), known["Touch"]
        hard = controls(spring, own)
        hardest = [
            (one.name, hand, hardest_at_rest(spring, one, hand)) for one in (own, frictionless(own)) for hand in HANDS
        ]
    if as_json:
        rows = [{**asdict(touch), "stable": touch.stable} for touch in (*found, *(touch for touch, _ in hard))]
        print(json.dumps({"touches": rows, "hardest": hardest}, indent=2))
    else:
        _print_scenes(found)
        _print_blocks(hard)
        for name, hand, stiffness in hardest:
            print(f"{name}, in a {hand} hand: comes to rest on blocks up to {stiffness:.0f} N/m")
    wrong = any(touch.stable != expected for touch, expected in hard if expected is not None)
    if wrong or not all(touch.stable for touch in found):
        raise typer.Exit(1)


def _print_scenes(found: list[Touch]) -> None:
    """One row a scene and hand, and one for each device on which a tip does not rest."""
    from itertools import groupby

    from rich.table import Table

    table = Table(title="Touches by simulated hands on emulated devices", title_justify="left")
    table.add_column("scene", no_wrap=True)
    table.add_column("hand", no_wrap=True)
    for name in ("devices", "at rest", "force N", "speed mm/s", "unrest um", "of what is allowed"):
        table.add_column(name, justify="right", no_wrap=True)
    for (scene, hand), group in groupby(sorted(found, key=lambda t: (t.scene, t.hand)), lambda t: (t.scene, t.hand)):
        rows = list(group)
        counts = (str(len(rows)), str(sum(touch.stable for touch in rows)))
        most = (max(touch.force for touch in rows), 1e3 * max(touch.speed for touch in rows))
        unrest = 1e6 * max(touch.unrest for touch in rows), max(touch.unrest / touch.allowed for touch in rows)
        figures = (f"{most[0]:.2f}", f"{most[1]:.0f}", f"{unrest[0]:.1f}", f"{100 * unrest[1]:.0f} %")
        table.add_row(scene, hand, *counts, *figures)
    _wide_console().print(table)
    for touch in found:
        if not touch.stable:
            print(f"UNSTABLE: {touch.scene}, {touch.device}, {touch.hand}: {1e6 * touch.unrest:.0f} um")


def _print_blocks(found: list[tuple[Touch, bool | None]]) -> None:
    from rich.table import Table

    table = Table(title="A Touch on blocks, limited to what it holds, and not", title_justify="left")
    for name in ("block", "hand"):
        table.add_column(name, no_wrap=True)
    for name in ("at most N/m", "force N", "unrest um", "allowed", ""):
        table.add_column(name, justify="right", no_wrap=True)
    for touch, expected in found:
        figures = (f"{touch.max_stiffness:g}", f"{touch.force:.2f}", f"{1e6 * touch.unrest:.1f}")
        table.add_row(touch.scene, touch.hand, *figures, f"{1e6 * touch.allowed:.0f}", _verdict(touch, expected))
    _wide_console().print(table)


def _wide_console() -> Console:
    """Return a console that does not cut columns where nobody looks."""
    from rich.console import Console

    console = Console()
    console.width = max(console.width, 120) if not console.is_terminal else console.width
    return console


def _verdict(touch: Touch, expected: bool | None) -> str:
    said = "stable" if touch.stable else "UNSTABLE"
    return said if expected is None or touch.stable == expected else f"{said}: wrong"
