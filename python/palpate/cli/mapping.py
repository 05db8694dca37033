"""The command that palpates a body by a protocol and maps its stiffness."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from palpate.cli.app import app
from palpate.cli.bodies import (
    ElementChoice,
    Fix,
    MaxSize,
    MaxVolumeLoss,
    MesherChoice,
    MeshUnit,
    Part,
    PoissonsRatio,
    Segments,
    ToolRadius,
    YoungsModulus,
)
from palpate.cli.option_values import read_option

if TYPE_CHECKING:
    from palpate.palpation import Detection, StiffnessMap
    from palpate.scene import BuiltScene

# What keeps finished presses, in the folder of the results.
PARTIAL, PLAIN_PARTIAL = "palpation.partial", "palpation-plain.partial"


@app.command("map")
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
    radius: ToolRadius = None,
    fix: Fix = None,
    youngs_modulus: YoungsModulus = None,
    poissons_ratio: PoissonsRatio = None,
    unit: MeshUnit = None,
    max_size: MaxSize = None,
    element: ElementChoice = None,
    mesher: MesherChoice = None,
    part: Part = None,
    max_volume_loss: MaxVolumeLoss = None,
    segment: Segments = None,
) -> None:
    """Press a grid of points on a body, without a hand, and map its stiffness and what lies hidden in it.

    The tool is the scene's first. Curves, the map and pictures are written into a folder; Ctrl-C keeps finished
    presses, and the same command continues from there. 'palpate run FILE --map DIR/stiffness.vtu' shows the map.

    Example: palpate map scene.toml --grid 10mm --depth 3mm --speed 10mm/s

    Example: palpate map nodule.toml --grid 8mm --depth 1.5mm --on "z > max - 1mm" --out found

    Example: palpate map liver --grid 15mm --depth 2mm --strokes
    """
    from palpate.cli.checks import require_folder
    from palpate.cli.run_file import RunOptions

    length, quickness = _quantities()
    given = {"spacing": length("--grid", grid), "depth": length("--depth", depth), "speed": quickness("--speed", speed)}
    material = {"youngs_modulus": youngs_modulus, "poissons_ratio": poissons_ratio}
    of_file = {"unit": unit, "max_size": max_size, "element": element, "mesher": mesher, "part": part}
    of_file |= {"max_volume_loss": max_volume_loss, "segment": tuple(segment) if segment else None}
    folder = out if out is not None else Path(f"{file.stem}-palpation")
    require_folder(folder)
    built = _build_scene(file, RunOptions(radius=radius, fix=fix, **material, **of_file))
    with _folder(folder):
        found, detection, written = _palpate(built, folder, given, on, strokes, against)
    _print_result(found, detection, folder, written)


def _quantities() -> tuple[Callable[[str, str], float], Callable[[str, str], float]]:
    """Readers of positive lengths and speeds that name the option of a mistake."""
    from palpate import units as quantities
    from palpate.errors import UnitError

    def reader(read: Callable[[str], float]) -> Callable[[str, str], float]:
        def named(option: str, text: str) -> float:
            value = read_option(option, text, read)
            if not 0 < value < float("inf"):
                raise UnitError(f"{option} must be positive, got {text}")
            return value

        return named

    return reader(quantities.length), reader(quantities.speed)


def _build_scene(file: Path, options: Any) -> BuiltScene:
    """Scene of a file, or of a built-in model by its name."""
    from palpate.cli.checks import no_such_model, require_body
    from palpate.cli.run_file import built_from, scene_with
    from palpate.models import NAMES
    from palpate.progress import status_line
    from palpate.scene import model_scene

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
    from palpate.errors import Error

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
    from palpate.palpation import compare, stiffness_map
    from palpate.palpation.detection import DETECTION_FILES, has_several_materials
    from palpate.scene import Scene

    other = None if against is None else Scene.read(against)
    try:
        partial_exists = (folder / PARTIAL).exists()
        found = stiffness_map(built, **given, on=on, strokes=strokes, partial=folder / PARTIAL, progress=True)
        if partial_exists:
            resumed = (
                f"{found.resumed} of {len(found.curves)} known" if found.resumed else "of another palpation: not used"
            )
            print(f"{folder / PARTIAL}: {resumed}")
        detection = None
        if other is not None or any(has_several_materials(body.body) for body in built.bodies):
            detection = compare(found, other, partial=folder / PLAIN_PARTIAL, progress=True)
    except KeyboardInterrupt:
        print(
            f"palpate: finished presses are kept in {folder}, and the same command continues",
            file=sys.stderr,
        )
        raise typer.Exit(130) from None
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
    import numpy as np

    from palpate.units import count_text

    left_out = ", ".join(f"{count} {reason}" for reason, count in found.skipped.items())
    strokes = f" on {count_text(found.strokes.max() + 1, 'stroke')}" if found.strokes.max() >= 0 else ""
    print(f"{count_text(len(found.points), 'point')}{strokes}" + (f"; left out: {left_out}" if left_out else ""))
    low, high = int(np.nanargmin(found.stiffness)), int(np.nanargmax(found.stiffness))
    places = ", ".join(f"{found.stiffness[k]:.4g} N/m at {_millimetres(found.points[k])}" for k in (low, high))
    print(f"stiffness at {1e3 * found.depth:.3g} mm: from {places}; median {np.nanmedian(found.stiffness):.4g} N/m")
    for reason in dict.fromkeys(found.held_by[found.held_by != ""]):
        held = found.held_by == reason
        reached = f" from {1e3 * np.nanmin(found.reached_depth[held]):.2g} mm on" if "limit" in reason else ""
        points = count_text(held.sum(), "point has", "points have")
        print(f"palpate: note: {points} no stiffness ({reason}{reached})", file=sys.stderr)
    for nodule in detection.nodules if detection is not None else ():
        change = f"{100 * abs(nodule.ratio - 1):.1f} % {'stiffer' if nodule.ratio > 1 else 'softer'}"
        print(f"nodule under {_millimetres(nodule.place)}: {change}, half of it {1e3 * nodule.half_width:.2g} mm away")
    if detection is not None and not detection.nodules:
        print("no nodule: nothing differs by more than 2 %")
    print(f"wrote {folder}: " + ", ".join(sorted(path.name for path in written)))


def _millimetres(place: Any) -> str:
    return "(" + ", ".join(f"{1e3 * x:.1f}" for x in place) + ") mm"
