"""Replay of recordings, in the page or headless."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from palpate.cli.app import app
from palpate.cli.running import PORT, Browser, Host, Port

if TYPE_CHECKING:
    from palpate.simulation import Recording, Replayed

RecordingFile = Annotated[Path, typer.Argument(help="Recording (.mcap) of 'palpate run --record' or of a program.")]
# Differences that are printed; more are only counted.
SHOWN = 10


@app.command()
def replay(
    file: RecordingFile,
    scene: Annotated[
        Path | None, typer.Option(help="Scene file that should give the same; default: the scene of the recording.")
    ] = None,
    headless: Annotated[
        bool, typer.Option("--headless", help="No viewer: only print whether every bit is the same.")
    ] = False,
    port: Port = PORT,
    host: Host = "127.0.0.1",
    browser: Browser = True,
) -> None:
    """Replay a recording tick by tick and compare every bit, in the browser with a time line, or headless.

    With --headless the exit code is 0 if all bits are the same, 1 if one is not, and 2 if the recording cannot be made
    again.

    Example: palpate replay press.mcap

    Example: palpate replay press.mcap --headless
    """
    from palpate import simulation
    from palpate.errors import SceneError
    from palpate.scene import Scene

    recording = simulation.Recording.load(file)
    given = None if scene is None else Scene.read(scene)
    try:
        if not headless:
            from palpate.viewer.live import open_replay

            open_replay(recording, given, host=host, port=port, browser=browser)
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
    """Say why a recording could not be made again to its end."""
    if recording.dropped is None:
        return f"note: the file was cut short, by a crash or a full disk; it has {len(recording.ticks)} ticks"
    return f"note: {recording.dropped} ticks were not recorded; what follows tick {ticks - 1} was not computed again"
