"""Commands that run the force loop: with the viewer, or headless by a scripted press."""

from __future__ import annotations

import contextlib
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import typer

from palpate.cache import cache_limit, cached_files, kept_by_this_process
from palpate.cli.app import INTERRUPTED, app, prepared, print_note
from palpate.cli.checks import finite, require_body, require_places
from palpate.cli.completion import models
from palpate.cli.impulse import SECONDS, impulse_history, impulse_scene
from palpate.cli.option_groups import grouped
from palpate.cli.run_file import RunOptions, built_from, surface_of
from palpate.cli.scripted import PressRecord, scripted_press
from palpate.errors import ViewerError
from palpate.green import BackgroundPrecompute
from palpate.green.firmness import LOOSE, firmness
from palpate.input_file import require_file
from palpate.models import NAMES
from palpate.progress import Reporter, progress_reporter, reported_to
from palpate.scene import BuiltScene, Scene, model_scene
from palpate.validation.plots import plot_log, write_log
from palpate.viewer.fields import read_map

if TYPE_CHECKING:
    from palpate.viewer.server import ViewerServer

Headless = Annotated[
    float | None,
    typer.Option(min=0.1, callback=finite, help="Press by a script for this many seconds at 1 kHz, without a page."),
]


@dataclass(frozen=True)
class Page:
    """Where the page is served, and whether it is opened."""

    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; 0 takes a free one.")] = 8642
    host: Annotated[str, typer.Option(help="Address to listen on; any other than 127.0.0.1 admits other machines.")] = (
        "127.0.0.1"
    )
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the browser.")] = True

    @property
    def address(self) -> tuple[str, int]:
        """Host and port."""
        return self.host, self.port


@dataclass(frozen=True)
class Recorded:
    """Where a run is recorded, and where its page puts recordings and scenes."""

    record: Annotated[
        Path | None, typer.Option(help="Record every tick in a new file (.mcap), for 'palpate replay' and Foxglove.")
    ] = None
    recordings: Annotated[
        Path, typer.Option(help="Folder for recordings and scenes of the page; default: this one.")
    ] = Path()


@dataclass(frozen=True)
class LinkOptions:
    """What was asked for of OpenIGTLink."""

    igtl: Annotated[
        int | None,
        typer.Option(
            min=0, max=65535, help="Port of OpenIGTLink, such as 18944, for 3D Slicer and trackers; default: closed."
        ),
    ] = None
    igtl_host: Annotated[
        str, typer.Option(help="Address of OpenIGTLink; others than 127.0.0.1 let other machines move the tool.")
    ] = "127.0.0.1"
    igtl_axes: Annotated[
        Literal["RAS", "LPS"], typer.Option(help="Axes of OpenIGTLink's messages, in millimetres.")
    ] = "RAS"
    igtl_from: Annotated[
        str | None,
        typer.Option(help="HOST:PORT of an OpenIGTLink server that sends poses, such as PLUS, to be called."),
    ] = None

    @property
    def is_asked(self) -> bool:
        """Whether anything is to be served or called."""
        return self.igtl is not None or self.igtl_from is not None


@app.command()
@grouped
def demo(
    model: Annotated[str, typer.Argument(help="doll, kidney, liver or beam.", autocompletion=models)] = "liver",
    paper: Annotated[bool, typer.Option("--paper", help="The mesh in the size of the paper.")] = False,
    motion: Annotated[bool, typer.Option("--motion", help="The body moves: strike it, slow it, see modes.")] = False,
    impulse: Annotated[
        bool, typer.Option("--impulse", help="A moving body of hard rubber, struck at its free end with 10 N for 1 ms.")
    ] = False,
    *,
    recorded: Recorded,
    headless: Headless = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the CSV and PNG of --headless and --impulse.")] = None,
    page: Page,
) -> None:
    """Press on a built-in model in the browser.

    With --motion the body moves: strike it, slow it down, look at its natural modes. With --impulse it is struck once
    (the paper's figure 5); --headless or --out then write the history as CSV and a plot instead.

    Example: palpate demo kidney --paper

    Example: palpate demo beam --motion

    Example: palpate demo beam --impulse --paper --out results
    """

    def scene_of(name: str) -> Scene:
        return impulse_scene(name, paper) if impulse else model_scene(name, paper, motion)

    has_page = headless is None and not (impulse and out is not None)
    require_places(recorded.record, out, page.address if has_page else None)
    if impulse and (headless is not None or out is not None):
        impulse_history(model, paper, headless or SECONDS, out or Path())
        return
    built = prepared(scene_of(model))
    _print_cache_use()
    if headless is not None:
        _scripted(built, f"{model}-paper" if paper else model, headless, out or Path(), recorded.record)
        return
    _view(built, page, recorded, NAMES, scene_of)


@app.command()
@grouped
def run(
    file: Annotated[
        Path | None,
        typer.Argument(help="Scene (.toml), store, volume mesh, surface or segmentation; none: an empty page."),
    ] = None,
    *,
    options: RunOptions,
    surface_map: Annotated[
        Path | None, typer.Option("--map", help="Map of 'palpate map' to show: stiffness.vtu or detection.vtu.")
    ] = None,
    recorded: Recorded,
    headless: Headless = None,
    out: Annotated[Path, typer.Option(help="Folder for the log (CSV) and the plot (PNG) of --headless.")] = Path(),
    page: Page,
    link: LinkOptions,
) -> None:
    """Run the 1 kHz force loop on a scene, a store, or a bare mesh or surface, in the browser.

    For a mesh, the command prints the defaults that it takes. For a scene, options of tool, material and
    supports replace those of the file. With --headless it presses on the highest point by a script, and writes
    the log and a plot.

    Example: palpate run scene.toml

    Example: palpate run organ.stl --unit mm --fix "z < min + 5mm" -E 10kPa --radius 8mm

    Example: palpate run ct.seg.nrrd --segment liver --segment tumor=40kPa

    Example: palpate run scene.toml --headless 3 --out results

    Example: palpate run scene.toml --device haply

    Example: palpate run scene.toml --record press.mcap

    Example: palpate run scene.toml --igtl 18944 --no-browser

    A scene with [touch] first opens when that part is ready; the rest is computed while you touch.

    Example: palpate run nodule.toml --map nodule-palpation/detection.vtu

    Without a FILE the page is empty: drop a surface on it, and set the body up there.
    """
    if link.is_asked and (file is None or headless is not None):
        raise typer.BadParameter("--igtl and --igtl-from need a FILE, and no --headless")
    if file is None:
        options.refuse(Path("an empty page"), set(), "what belongs to a body is chosen in the page", of_loop=False)
        if surface_map is not None or headless is not None or recorded.record is not None:
            raise typer.BadParameter("--map, --headless and --record need a FILE")
        _view(None, page, recorded)
        return
    if headless is not None:
        if surface_map is not None:
            raise typer.BadParameter("--map is shown in the page: leave out --headless")
        require_body(file)
        require_places(recorded.record, out)
        built = built_from(file, options)
        _print_cache_use()
        _print_loose(built)
        _scripted(built, file.stem, headless, out, recorded.record)
        return
    _view_early(file, options, page, recorded, link, surface_map)


def _view(
    built: BuiltScene | None,
    page: Page,
    recorded: Recorded,
    models: Sequence[str] = (),
    scene_of: Callable[[str], Scene] | None = None,
) -> None:
    from palpate.viewer.live import PRESS, SET_UP, open_viewer
    from palpate.viewer.server import ViewerServer

    recorded.recordings.mkdir(parents=True, exist_ok=True)
    server = ViewerServer(built, host=page.host, port=page.port, models=models, scene_of=scene_of, **vars(recorded))
    open_viewer(server, browser=page.browser, hint=SET_UP if built is None else PRESS)


def _view_early(
    file: Path, options: RunOptions, page: Page, recorded: Recorded, link: LinkOptions, surface_map: Path | None
) -> None:
    """Open the page at once, and prepare what is touched while it shows the surface and the stages."""
    from palpate.viewer.live import Preparation, Prepared, PreparingSession, open_viewer
    from palpate.viewer.server import ViewerServer

    require_body(file)
    require_places(recorded.record, None, page.address)
    if surface_map is not None:
        require_file(surface_map, ViewerError)
    recorded.recordings.mkdir(parents=True, exist_ok=True)
    server = ViewerServer(PreparingSession(), host=page.host, port=page.port, **vars(recorded))

    def build(reporter: Reporter, draw: Callable[[np.ndarray, np.ndarray], None]) -> Prepared:
        surface = surface_of(file, options)
        if surface is not None:
            draw(*surface)
        # Where a part is touched first, the rest is computed beside the loop.
        growing: dict[int, BackgroundPrecompute] = {}
        with progress_reporter(file.name, True) as bar:
            built = built_from(file, options, growing, reported_to(reporter, bar), draw)
        _print_cache_use()
        _print_loose(built)
        maps = None if surface_map is None else read_map(surface_map, built)
        return Prepared(built, growing, maps)

    with linked(server, link, recorded.recordings):
        open_viewer(server, browser=page.browser, preparation=Preparation(file.name, build))


def _print_cache_use() -> None:
    """Print what stays in the cache of what was prepared."""
    size = kept_by_this_process()
    if size:
        used, limit = sum(file.size for file in cached_files()) / 1e9, cache_limit().size / 1e9
        of_all = f"{used:.3g} of {limit:.3g} GB are used ('palpate cache list')"
        print(f"kept in the cache: {size / 1e6:.1f} MB of this scene; {of_all}", flush=True)


def _print_loose(built: BuiltScene) -> None:
    """Note bodies that hang by so little that a press on them is hardly felt."""
    radius = built.scene.tools[0].contact_radius or built.scene.tools[0].radius or 0.0
    for body in built.bodies:
        share = firmness(body.green, radius)
        if share is not None and share < LOOSE:
            print_note(
                f"{body.name} is held loosely: its top has {share:.1g} of the stiffness of a half-space of the same "
                "material; hold more of it (--fix, [supports])"
            )


def _force_line(record: PressRecord, max_force: float) -> str:
    """Tell the largest force on the device, and that of the body where the device's limit held it."""
    force = (record.log["force"] ** 2).sum(axis=1).max() ** 0.5
    line = f"{len(record.log)} ticks, largest force {force:.3g} N"
    if force >= max_force * (1 - 1e-9) and record.force > max_force:
        line += f", where it was limited ([device] max_force = {max_force:g}): the body's was {record.force:.3f} N"
    return line


def _strain_line(record: PressRecord, strain_limit: float) -> str:
    """Line with the largest strain, its limit, and the stated error, or a warning beyond linear elasticity."""
    line = f"largest strain {100 * record.hardest.largest_strain:.1f} %"
    if record.limited:
        line += f", where the tool was limited ([view] strain_limit = {strain_limit:g})"
    error = record.hardest.largest_error
    if error is not None:
        line += f", estimated error of the force {100 * error:.2g} %"
    elif not record.hardest.within_linear_range:
        line += ": beyond 10 %, where linear elasticity is no longer accurate"
    return line


def _scripted(built: BuiltScene, name: str, seconds: float, out: Path, recording: Path | None) -> None:
    out.mkdir(parents=True, exist_ok=True)
    record = scripted_press(built, seconds, recording)
    log, statistics = record.log, record.last.statistics
    write_log(log, record.depth, record.strain, out / f"{name}.csv")
    plot_log(log, out / f"{name}.png", f"{name}: scripted press at 1 kHz")
    compute, wakeup = statistics["compute_us"], statistics["wakeup_us"]
    print(_force_line(record, built.scene.device.max_force))
    print(_strain_line(record, built.scene.view.strain_limit))
    if record.refused is not None:
        print(f"where the tool reached the body without a force: {record.refused}")
    print("us            p50      p99    p99.9      max")
    for title, row in (("computing", compute), ("wake-up", wakeup)):
        print(f"{title:9s} {row['p50']:7.1f}  {row['p99']:7.1f}  {row['p999']:7.1f}  {row['max']:7.1f}")
    print(f"missed deadlines: {statistics['missed_deadlines']}; wrote {out / name}.csv and .png")
    if recording is not None:
        print(f"recorded {recording}: to compute it again: palpate replay {shlex.quote(str(recording))}")
    priority, locked_memory = statistics["realtime"]
    if not (locked_memory and (priority or built.scene.device.priority == 0)):
        print_note("the system granted no real-time priority or locked memory; see 'palpate doctor'")
    if record.interrupted:
        raise typer.Exit(INTERRUPTED)
    if statistics["fault"] is not None:
        print(f"palpate: {statistics['fault']}", file=sys.stderr)
        raise typer.Exit(1)


@contextlib.contextmanager
def linked(server: ViewerServer, options: LinkOptions, folder: Path) -> Iterator[None]:
    """Serve OpenIGTLink for the scene that a page's server runs; ViewerError for a port in use."""
    if not options.is_asked:
        yield
        return
    from palpate.openigtlink import Axes, Link, LinkServer

    link = Link(lambda: getattr(server.session, "simulation", None), Axes(options.igtl_axes), folder)
    tracker = None if options.igtl_from is None else _address(options.igtl_from)
    with LinkServer(link, options.igtl, host=options.igtl_host, tracker=tracker) as served:
        if served.port is not None:
            print(f"OpenIGTLink is at {options.igtl_host}:{served.port}, in mm and {options.igtl_axes}", flush=True)
        yield


def _address(text: str) -> tuple[str, int]:
    host, colon, port = text.rpartition(":")
    if not (colon and host and port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise typer.BadParameter(f"--igtl-from takes HOST:PORT, got '{text}'")
    return host, int(port)
