"""Scripted sessions from the command line: what the recorder costs, loses and writes."""

from __future__ import annotations

import json
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.benchmarks import bench_app


@bench_app.command()
def record(
    scenes: Annotated[list[Path], typer.Argument(help="Scene files (.toml).")],
    minutes: Annotated[float, typer.Option(min=0.01, help="Length of each session.")] = 1.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """Record a scripted session of each scene at its real rate, and make it again bit by bit.

    Example: palpate bench record examples/block.toml examples/two_bodies.toml --minutes 10
    """
    from palpate.progress import narrated, progress_reporter
    from palpate.scene import Scene
    from palpate.validation.bench.record import run_session

    results = []
    for scene in scenes:
        read = Scene.read(scene)
        with narrated(f"preparing {read.name}"):
            built = read.build()
        with tempfile.TemporaryDirectory() as folder, progress_reporter(read.name, True) as report:
            results.append(run_session(built, scene.stem, Path(folder) / "session.mcap", 60 * minutes, report=report))
    if as_json:
        print(json.dumps([asdict(result) for result in results], indent=2))
        return
    row = "{:16s} {:>8s} {:>8s} {:>8s} {:>10s} {:>9s} {:>10s} {:>8s} {:>8s} {:>6s}"
    head = ("scene", "ticks", "touching", "dropped", "computing", "waking", "not finite", "longest", "MB/min", "same")
    print(row.format(*head))
    for r in results:
        same = "yes" if r.same else "NO"
        numbers = [r.ticks, r.contacts, r.dropped, r.missed_computing, r.missed_waking, r.not_finite]
        print(row.format(r.scene, *map(str, numbers), f"{r.longest_us:.0f} us", f"{r.mb_per_minute:.2f}", same))
    print(
        "computing, waking: deadlines missed while a tick computed, and because one began late; by other programs too"
    )
    print("longest: what the longest tick takes of its own thread's time when the session is made again")
