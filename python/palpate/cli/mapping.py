"""The command that palpates a body by a protocol and maps its stiffness."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from palpate import units
from palpate.cli.app import app, keeping, millimetres, print_note
from palpate.cli.bodies import BodyOptions, FillingOptions
from palpate.cli.checks import no_such_model, read_option, require_body, require_folder
from palpate.cli.option_groups import grouped
from palpate.cli.run_file import RunOptions, built_from, scene_with
from palpate.errors import Error, UnitError
from palpate.models import NAMES
from palpate.palpation import Detection, StiffnessMap, compare, stiffness_map
from palpate.palpation.detection import DETECTION_FILES, has_several_materials
from palpate.progress import status_line
from palpate.scene import BuiltScene, Scene, model_scene
from palpate.units import count_text

# What keeps finished presses, in the folder of the results.
PARTIAL, PLAIN_PARTIAL = "palpation.partial", "palpation-plain.partial"


@app.command("map")
@grouped
def map_command(
    file: Annotated[
        Path, typer.Argument(help="Scene (.toml), store (.palpate), volume mesh, surface, or a model's name.")
    ],
    grid: Annotated[str, typer.Option(help="Distance of the points, or of the strokes, such as 10mm.")],
    depth: Annotated[str, typer.Option(help="Depth of a press from first touch, such as 3mm.")],
    speed: Annotated[str, typer.Option(help="Speed of a press, or along a stroke.")] = "10mm/s",
    on: Annotated[
        str | None, typer.Option(help="Part of the surface, such as 'z > max - 1mm'; default: all that may be touched.")
    ] = None,
    strokes: Annotated[
        bool, typer.Option("--strokes", help="Slide over lines at the depth instead of pressing.")
    ] = False,
    against: Annotated[
        Path | None,
        typer.Option(help="Scene to compare with; default: for a body with regions the same body without them."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the results; default: <name>-palpation.")] = None,
    *,
    body: BodyOptions,
    filling: FillingOptions,
) -> None:
    """Press a grid of points on a body, without a hand, and map its stiffness and what lies hidden in it.

    The tool is the scene's first. Curves, the map and pictures are written into a folder; Ctrl-C keeps finished
    presses, and the same command continues from there. 'palpate run FILE --map DIR/stiffness.vtu' shows the map.

    Example: palpate map scene.toml --grid 10mm --depth 3mm --speed 10mm/s

    Example: palpate map nodule.toml --grid 8mm --depth 1.5mm --on "z > max - 1mm" --out found

    Example: palpate map liver --grid 15mm --depth 2mm --strokes
    """
    given = {"spacing": _positive("--grid", grid, units.length), "depth": _positive("--depth", depth, units.length)}
    given["speed"] = _positive("--speed", speed, units.speed)
    folder = out if out is not None else Path(f"{file.stem}-palpation")
    require_folder(folder)
    built = _build_scene(file, RunOptions(**vars(body), **vars(filling)))
    with _folder(folder):
        found, detection, written = _palpate(built, folder, given, on, strokes, against)
    _print_result(found, detection, folder, written)


def _positive(option: str, text: str, read: Callable[[str], float]) -> float:
    """Positive length or speed of an option."""
    value = read_option(option, text, read)
    if not 0 < value < float("inf"):
        raise UnitError(f"{option} must be positive, got {text}")
    return value


def _build_scene(file: Path, options: Any) -> BuiltScene:
    """Scene of a file, or of a built-in model by its name."""
    if file.exists() or file.suffix:
        require_body(file)
        return built_from(file, options)
    if str(file) not in NAMES:
        raise no_such_model(str(file))
    options.refuse(file, {"radius", "fix", "youngs_modulus", "poissons_ratio"}, "a model has its own mesh")
    with status_line(f"preparing {file}"):
        return scene_with(model_scene(str(file)), options).build()


@contextlib.contextmanager
def _folder(folder: Path) -> Any:
    """Make a folder, and take it away again if nothing was put into it."""
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except Error:
        with contextlib.suppress(OSError):
            folder.rmdir()
        raise


def _palpate(
    built: BuiltScene, folder: Path, given: dict[str, float], on: str | None, strokes: bool, against: Path | None
) -> tuple[StiffnessMap, Detection | None, list[Path]]:
    """Palpate, write, and forget what was kept for going on."""
    other = None if against is None else Scene.read(against)
    with keeping("presses", folder):
        partial_exists = (folder / PARTIAL).exists()
        found = stiffness_map(built, **given, on=on, strokes=strokes, partial=folder / PARTIAL, progress=True)
        if partial_exists:
            known = f"{found.resumed} of {len(found.curves)} known"
            print(f"{folder / PARTIAL}: {known if found.resumed else 'of another palpation: not used'}")
        detection = None
        if other is not None or any(has_several_materials(body.body) for body in built.bodies):
            detection = compare(found, other, partial=folder / PLAIN_PARTIAL, progress=True)
    written = found.save(folder)
    if detection is not None:
        written += detection.save(folder)
    else:
        # Those of an earlier scene would be taken for this one's.
        for name in DETECTION_FILES:
            (folder / name).unlink(missing_ok=True)
    for name in (PARTIAL, PLAIN_PARTIAL):
        (folder / name).unlink(missing_ok=True)
    return found, detection, written


def _print_result(found: StiffnessMap, detection: Detection | None, folder: Path, written: Sequence[Path]) -> None:
    """Say what was found, what was left out, and what held the tool."""
    left_out = ", ".join(f"{count} {reason}" for reason, count in found.skipped.items())
    strokes = f" on {count_text(found.strokes.max() + 1, 'stroke')}" if found.strokes.max() >= 0 else ""
    print(f"{count_text(len(found.points), 'point')}{strokes}" + (f"; left out: {left_out}" if left_out else ""))
    low, high = int(np.nanargmin(found.stiffness)), int(np.nanargmax(found.stiffness))
    places = ", ".join(f"{found.stiffness[k]:.4g} N/m at {millimetres(found.points[k])}" for k in (low, high))
    print(f"stiffness at {1e3 * found.depth:.3g} mm: from {places}; median {np.nanmedian(found.stiffness):.4g} N/m")
    for reason in dict.fromkeys(found.held_by[found.held_by != ""]):
        held = found.held_by == reason
        reached = f" from {1e3 * np.nanmin(found.reached_depth[held]):.2g} mm on" if "limit" in reason else ""
        points = count_text(held.sum(), "point has", "points have")
        print_note(f"{points} no stiffness ({reason}{reached})")
    for nodule in detection.nodules if detection is not None else ():
        change = f"{100 * abs(nodule.ratio - 1):.1f} % {'stiffer' if nodule.ratio > 1 else 'softer'}"
        print(f"nodule under {millimetres(nodule.place)}: {change}, half of it {1e3 * nodule.half_width:.2g} mm away")
    if detection is not None and not detection.nodules:
        print("no nodule: nothing differs by more than 2 %")
    print(f"wrote {folder}: " + ", ".join(sorted(path.name for path in written)))
