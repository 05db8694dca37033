"""Commands that replay, export and compare recordings."""

from __future__ import annotations

import json
import sys
import warnings
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from palpate import sessions, simulation
from palpate.cli.app import app, prepared
from palpate.cli.checks import read_option, require_folder
from palpate.cli.completion import formats
from palpate.cli.option_groups import grouped
from palpate.cli.running import Page
from palpate.errors import Error, RecordingWarning, SceneError
from palpate.scene import Scene
from palpate.sessions import FORMATS, Comparison, QuantityDifference, rerun
from palpate.sessions import compare as compared
from palpate.simulation import Recording, Replayed
from palpate.units import time
from palpate.validation.plots import plot_comparison

RecordingFile = Annotated[Path, typer.Argument(help="Recording (.mcap) of 'palpate run --record' or of a program.")]
# Differences that are printed; more are only counted.
SHOWN = 10


@app.command()
def export(
    file: Annotated[Path, typer.Argument(help="A recording (.mcap).")],
    to: Annotated[
        str | None, typer.Option(help="csv, parquet, pvd, glb or mp4; default: as --out.", autocompletion=formats)
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write; default: beside the recording.")
    ] = None,
    rate: Annotated[float | None, typer.Option(help="Frames a second of pvd, glb and mp4; default: 30.")] = None,
    start: Annotated[str, typer.Option("--from", help="Begin there, such as 2s.")] = "0s",
    end: Annotated[str | None, typer.Option("--until", help="End there, such as 5s; default: at the end.")] = None,
    scene: Annotated[
        Path | None, typer.Option(help="Scene file with the same bodies; default: the scene in the recording.")
    ] = None,
) -> None:
    """Write a recording for other programs: tables, ParaView, Blender, slides.

    csv and parquet have one row a tick, and one row a contact in a second file. pvd is a time series for ParaView,
    glb an animation for Blender and other viewers, mp4 a film. These need the scene, and the recording is replayed.

    Example: palpate export press.mcap --to csv

    Example: palpate export press.mcap --to mp4 --from 2s --until 5s

    Example: palpate export press.mcap --out results/press.pvd --rate 60
    """
    target = _target(file, to, out)
    recording = _loaded(file)
    span = {"start": read_option("--from", start, time)}
    span["end"] = None if end is None else read_option("--until", end, time)
    same = None if scene is None else Scene.read(scene)
    for written in sessions.export(recording, target, rate=rate, scene=same, progress=True, **span):
        print(written)


def _target(file: Path, to: str | None, out: Path | None) -> Path:
    """File to write; Error for no format, an unknown one, or two that contradict each other."""
    known = ", ".join(f"{ending[1:]} ({what})" for ending, what in FORMATS.items())
    if to is not None and f".{to}" not in FORMATS:
        raise Error(f"--to {to}: unknown format; known are {known}")
    if out is None:
        if to is None:
            raise Error(f"give --to or --out; formats are {known}")
        return file.with_suffix(f".{to}")
    if to is None or out.suffix.lower() == f".{to}":
        return out
    if out.suffix:
        raise Error(f"--to {to} and --out {out} name two formats")
    return out.with_suffix(f".{to}")


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(help="A recording (.mcap).")],
    b: Annotated[Path | None, typer.Argument(help="Another one; or --scene.")] = None,
    scene: Annotated[
        Path | None, typer.Option(help="Scene file: compare with what the same hand would have felt there.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the plot and, with --scene, the recording.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """Compare two recordings tick by tick; exit code 0 for the same bits, 1 for others.

    Example: palpate compare before.mcap after.mcap --out results

    Example: palpate compare press.mcap --scene stiffer.toml
    """
    if (b is None) == (scene is None):
        raise Error("compare takes two recordings, or one and --scene")
    if out is not None:
        require_folder(out)
    first = _loaded(a)
    if b is not None:
        second, name = _loaded(b), b.name
    else:
        second, name = _rerun(first, scene), scene.name
    found = compared(first, second)
    if as_json:
        print(json.dumps(_as_json(found), indent=2, ensure_ascii=False))
    else:
        _print(found, (a.name, name))
    if out is not None:
        _write(out, (first, second), (a, b or scene), keep=b is None)
    raise typer.Exit(0 if found.same else 1)


def _rerun(recording: Recording, scene: Path) -> Recording:
    return rerun(recording, prepared(Scene.read(scene)), progress=True)


def _write(out: Path, both: tuple[Recording, Recording], files: tuple[Path, Path], keep: bool) -> None:
    """Write the plot, and the second recording where there is no file of it."""
    out.mkdir(parents=True, exist_ok=True)
    name = f"{files[0].stem}-{files[1].stem}"
    plot_comparison(*both, (files[0].name, files[1].name), out / f"{name}.png")
    written = [out / f"{name}.png"]
    if keep:
        both[1].save(out / f"{name}.mcap")
        written.append(out / f"{name}.mcap")
    print(f"wrote {' and '.join(map(str, written))}", file=sys.stderr)


def _loaded(file: Path) -> Recording:
    """Read a recording, and tell of one that is not whole."""
    recording = Recording.load(file)
    if recording.dropped is None:
        length = f"{recording.time[-1]:.3f} s" if len(recording.time) else "nothing"
        text = f"{file} was cut short: what is there is {length}"
        warnings.warn(text, RecordingWarning, stacklevel=2)
    elif recording.dropped:
        warnings.warn(f"{file}: {recording.dropped} ticks were dropped", RecordingWarning, stacklevel=2)
    return recording


def _print(found: Comparison, names: tuple[str, str]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    console.width = max(console.width, 110) if not console.is_terminal else console.width
    if found.same:
        print(f"{names[0]} and {names[1]}: the same bits in all {found.ticks} ticks")
    else:
        print(f"{names[0]} has {found.counts[0]} ticks, {names[1]} {found.counts[1]}; {found.ticks} are compared")
    first = found.first
    if first is not None:
        what = ", an input: what follows cannot be the same" if first.is_input else ""
        print(f"first difference: tick {first.first}, {f'{first.of} {first.quantity}'.strip()}{what}")
        table = Table(box=None, pad_edge=False, header_style="dim")
        for title in ("", "difference of"):
            table.add_column(title, no_wrap=True)
        for title in ("largest", "rms", "largest value", "at tick", "time [s]", "from tick"):
            table.add_column(title, justify="right", no_wrap=True)
        for row in found.quantities:
            if row.first is not None:
                table.add_row(*_cells(row))
        console.print(table)
    for key, was, now in found.settings:
        print(f"{key}: {_text_of(was)} and {_text_of(now)}")


def _cells(row: QuantityDifference) -> tuple[str, ...]:
    def figure(value: float) -> str:
        return f"{value:.3g} {row.unit}".strip()

    largest = "by sign of zero" if row.largest == 0 else figure(row.largest)
    rest = (figure(row.rms), figure(row.reference), str(row.tick), f"{row.time:.3f}", str(row.first))
    return row.of, row.quantity, largest, *rest


def _text_of(value: object) -> str:
    return "not given" if value is None else str(value)


def _as_json(found: Comparison) -> dict:
    first = None if found.first is None else found.first.first
    settings = [dict(zip(("key", "a", "b"), row, strict=True)) for row in found.settings]
    return {**asdict(found), "settings": settings, "same": found.same, "first": first}


@app.command()
@grouped
def replay(
    file: RecordingFile,
    scene: Annotated[
        Path | None, typer.Option(help="Scene file that should give the same; default: the scene of the recording.")
    ] = None,
    headless: Annotated[
        bool, typer.Option("--headless", help="No viewer: only print whether every bit is the same.")
    ] = False,
    *,
    page: Page,
) -> None:
    """Replay a recording tick by tick and compare every bit, in the browser with a time line, or headless.

    With --headless the exit code is 0 if all bits are the same, 1 if one is not, and 2 if the recording cannot be made
    again.

    Example: palpate replay press.mcap

    Example: palpate replay press.mcap --headless
    """
    recording = Recording.load(file)
    given = None if scene is None else Scene.read(scene)
    try:
        if not headless:
            from palpate.viewer.live import open_replay

            open_replay(recording, given, **vars(page))
            return
        replayed = simulation.replay(recording, given, progress=True)
        if replayed.ticks == 0:
            raise SceneError("no tick of it can be computed again: the file was cut short, or nothing was recorded")
    except SceneError as error:
        raise SceneError(f"{file}: {error}") from error
    print(_report_text(file, recording, replayed))
    if not replayed.same:
        raise typer.Exit(1)


def _report_text(file: Path, recording: Recording, replayed: Replayed) -> str:
    lines = [str(difference) for difference in replayed.differences[:SHOWN]]
    if len(replayed.differences) > SHOWN:
        lines.append(f"and {len(replayed.differences) - SHOWN} more: look at the first")
    if not lines:
        lines = [f"{file}: {replayed.ticks} ticks computed again: every bit is as recorded"]
    if not replayed.whole:
        lines.append(_gap_text(recording, replayed.ticks))
    return "\n".join(lines)


def _gap_text(recording: Recording, ticks: int) -> str:
    """Why the last ticks of a recording were not computed again."""
    if recording.dropped is None:
        return f"note: the file was cut short, by a crash or a full disk; it has {len(recording.ticks)} ticks"
    return f"note: {recording.dropped} ticks were not recorded; what follows tick {ticks - 1} was not computed again"
