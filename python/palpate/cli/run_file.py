"""Scene of a file for ``palpate run``: a scene file, a store, or a mesh or surface with defaults, which are printed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from pydantic import ValidationError

from palpate import units
from palpate.body import Body, Material
from palpate.body.default_support import lowest_part
from palpate.cli.bodies import (
    BodyOptions,
    FillingOptions,
    body_of,
    is_surface,
    likely_units,
    materials_of,
    read_any,
    segment_tables,
)
from palpate.cli.checks import read_option, require_unit
from palpate.cli.completion import devices
from palpate.errors import SceneError
from palpate.green import BackgroundPrecompute, GreensFunction, precompute
from palpate.mesh import shapes, size_text
from palpate.mesh.segmented import Draw
from palpate.mesh.size import units_of_size
from palpate.mesh.surface_file import load_surface
from palpate.progress import Reporter, progress_reporter, status_line
from palpate.scene import BuiltScene, Scene
from palpate.scene.build import marked_as_growing
from palpate.scene.devices import KINDS
from palpate.scene.mistakes import reason_of
from palpate.scene.regions import DEFAULT_LAW
from palpate.scene.series import with_stored_series
from palpate.scene.sizes import Expected, pressing_radii, require_tool_sizes
from palpate.scene.tables import device_change, device_ranks
from palpate.scene.tool_shape import KEYS
from palpate.segmentation.endings import is_segmentation
from palpate.simulation.scheduling import with_scheduling
from palpate.units import length, length_scale


@dataclass(frozen=True)
class RunOptions(FillingOptions, BodyOptions):
    """Options of the command, as they were typed; None for one that was not."""

    density: Annotated[str | None, typer.Option(help="Density; of a mesh, default: 1000kg/m3.")] = None
    device: Annotated[
        list[str] | None,
        typer.Option(
            help="Device of a tool: haply, touch, forcedimension, or the name of a [[device]]; repeat for the next "
            "tool.",
            autocompletion=devices,
        ),
    ] = None
    cpus: Annotated[
        str | None, typer.Option(help="Processors that the loop's thread keeps to, such as 1 or 2,3; default: any.")
    ] = None
    priority: Annotated[
        int | None, typer.Option(help="Real-time priority of the loop's thread, 1 to 99; 0 asks for none; default: 80.")
    ] = None

    def refuse(self, file: Path, allowed: set[str], reason: str, of_loop: bool = True) -> None:
        """Refuse options that the kind of file does not take; SceneError says which is the first of them, and why."""
        for field in fields(self):
            if getattr(self, field.name) not in (None, []) and field.name not in (
                allowed | OF_LOOP if of_loop else allowed
            ):
                raise SceneError(f"{file}: {FLAGS[field.name]} is not for this file: {reason}")


# Of the loop, whatever the file.
OF_LOOP = {"cpus", "priority", "device"}
FLAGS = {field.name: f"--{field.name.replace('_', '-')}" for field in fields(RunOptions)}
FLAGS |= {"fixed": "--fix", "youngs_modulus": "-E", "poissons_ratio": "--nu"}


def surface_of(file: Path, options: RunOptions) -> tuple[np.ndarray, np.ndarray] | None:
    """Vertices (k, 3), m, and triangles of a file's surface as it is, before it is filled; None for other files."""
    from palpate.viewer.setup_session import merged

    path, unit = file, options.unit
    if file.suffix == ".toml":
        scene = Scene.read(file)
        body = scene.bodies[0]
        if len(scene.bodies) > 1 or not body.fills_a_surface or any(body.position):
            return None
        path, unit = scene.folder / str(body.mesh), body.unit or "m"
    if not is_surface(path):
        return None
    shape = load_surface(path).shape
    vertices = np.asarray(shape.vertices)
    scale = length_scale(unit or next(iter(units_of_size(vertices)), "m"))
    return merged(vertices * scale, np.asarray(shape.faces))


def built_from(
    file: Path,
    options: RunOptions,
    growing: dict[int, BackgroundPrecompute] | None = None,
    progress: bool | Reporter = True,
    drawn: Draw | None = None,
) -> BuiltScene:
    """Scene of a file, ready to run; what is computed on beside it goes into ``growing``, if there is one.

    ``drawn`` takes the boundary of a segmentation, vertices, m, and triangles, before it is filled. Raises Error for a
    file that cannot be read, filled or solved, or an option that does not belong to it.
    """
    if file.suffix == ".palpate":
        options.refuse(file, {"radius"}, "a store carries its material and supports; 'palpate precompute' takes them")
        scene = scene_with(Scene.of_store(file), options)
    elif file.suffix == ".toml":
        places = {"radius", "fix", "youngs_modulus", "poissons_ratio", "density"}
        options.refuse(file, places, "it stands in the table [body] of the scene")
        scene = scene_with(Scene.read(file), options)
    else:
        return _bare(file, options, growing, progress, drawn)
    with status_line(f"preparing {scene.name}"):
        if growing is None:
            return scene.build(progress, announce=print_expected)
        built, rest = scene.build_first(progress, print_expected)
        growing.update(rest)
        return built


def scene_with(scene: Scene, options: RunOptions) -> Scene:
    """Scene in which what was typed stands instead of what was written, in the tables of its bodies too."""
    names = ("youngs_modulus", "poissons_ratio", "density")
    given = {name: value for name, value in asdict(options).items() if name in names and value is not None}
    update: dict[str, Any] = {}
    tables: dict[str, Mapping[str, Any]] = {}
    if given:
        tables["material"] = given
    if options.fix is not None:
        tables["supports"] = {"fixed": options.fix}
    bodies = list(scene.bodies)
    for name, values in tables.items():
        update[name] = _changed(getattr(scene, name), values)
        for rank, body in enumerate(bodies):
            own = getattr(body, name)
            if own is not None:
                bodies[rank] = body.model_copy(update={name: _changed(own, values)})
    if options.radius is not None:
        update["tools"] = [tool.model_copy(update=_radii(tool, options.radius)) for tool in scene.tools]
    if options.cpus is not None or options.priority is not None:
        update["device"] = _scheduled(scene.device, options)
    changed = scene.model_copy(update={**update, "bodies": bodies})
    return _with_devices(changed, options.device) if options.device else changed


def _with_devices(scene: Scene, devices: Sequence[str]) -> Scene:
    """Scene whose first tools are moved by devices: of a table by name, or of a kind, where its own stood."""
    if len(devices) > len(scene.tools):
        raise SceneError(f"--device was given {len(devices)} times, but the scene has {len(scene.tools)} of [[tool]]")
    tables = [scene.device, *scene.additional_devices]
    named = [table.name for table in tables]
    for tool, device in enumerate(devices):
        if device in named or any(table.kind == device for table in tables) or device not in KINDS:
            tools = list(scene.tools)
            tools[tool] = tools[tool].model_copy(update={"device": device})
            scene = scene.model_copy(update={"tools": tools})
    try:
        device_ranks(scene.tools, tables)
    except ValueError as error:
        raise SceneError(f"--device: {error}") from None
    for tool, device in enumerate(devices):
        if scene.device_of(tool).kind != device and device not in named:
            scene = scene.model_copy(update=device_change(scene, tool, device))
    return scene


def _scheduled(device: Any, options: RunOptions) -> Any:
    """Table of the device with the processors and the priority that were typed."""
    cpus = None
    if options.cpus is not None:
        try:
            cpus = [int(cpu) for cpu in options.cpus.split(",")]
        except ValueError:
            raise SceneError(f"--cpus: give numbers of processors, such as 1 or 2,3; got '{options.cpus}'") from None
    try:
        return with_scheduling(device, cpus, options.priority)
    except SceneError as error:
        raise SceneError(str(error).replace("device.", "--", 1)) from None


def _changed(table: Any, values: Mapping[str, Any]) -> Any:
    """Table of the same kind with other values, as strictly checked as in a file."""
    try:
        return type(table)(**{**table.model_dump(exclude_unset=True), **values})
    except ValidationError as error:
        first = error.errors()[0]
        # What a validator of the whole table refuses has no place: it is one of the values.
        key = str(first["loc"][0]) if first["loc"] else next(iter(values))
        raise SceneError(f"{FLAGS[key]}: {reason_of(error)}") from None


def _radii(tool: Any, radius: str) -> dict[str, float]:
    if "radius" not in KEYS.get(tool.shape, (set(),))[0]:
        raise SceneError(f"--radius: a tool of shape '{tool.shape}' has no radius")
    value = read_option("--radius", radius, length)
    if not (np.isfinite(value) and value > 0):
        raise SceneError(f"--radius must be positive, got {radius}")
    return {"radius": value, "contact_radius": value} if tool.contact != "local" else {"radius": value}


def _bare(
    file: Path,
    options: RunOptions,
    growing: dict[int, BackgroundPrecompute] | None,
    progress: bool | Reporter,
    drawn: Draw | None,
) -> BuiltScene:
    """Take a mesh or a surface, with defaults for all that was not typed; which they are is printed."""
    require_unit(options.unit)
    defaults = []
    unit = options.unit
    if unit is None and not is_segmentation(file):
        unit, *others = likely_units(file)
        defaults.append(f"unit {unit} (--unit{'; it may also be ' if others else ''}{' or '.join(others)})")
    # A body that is of no likely size in any unit is asked about, not taken for one in metres.
    known = None if options.unit is None and unit == "m" else unit
    mesh = read_any(file, known, options.element, options, progress, drawn)
    low, high = mesh.bounds
    fix = options.fix
    if fix is None:
        fix = lowest_part(mesh)
        defaults.append(f"held where {fix} (--fix)")
    typed = (options.youngs_modulus, options.poissons_ratio, options.density)
    modulus, ratio, density = (
        default if value is None else value for value, default in zip(typed, ("10kPa", 0.45, "1000kg/m3"), strict=True)
    )
    if options.youngs_modulus is None:
        defaults.append(f"E = {modulus} (-E)")
    if options.poissons_ratio is None:
        defaults.append(f"Poisson's ratio {ratio} (--nu)")
    defaults.append(f"law {DEFAULT_LAW} (a scene may name another)")
    modulus, density = read_option("-E", modulus, units.pressure), read_option("--density", density, units.density)
    material = Material(modulus, ratio, density, DEFAULT_LAW)
    segments = segment_tables(options.segment)
    tables = {"material": asdict(material), "supports": {"fixed": fix}}
    of_loop = {name: getattr(options, name) for name in OF_LOOP}
    of_run = RunOptions(radius=options.radius, **of_loop)
    scene = scene_with(Scene(body={"mesh": str(file), "unit": unit, "segment": segments}, **tables), of_run)
    body = body_of(mesh, materials_of(mesh, material, options.segment), fix)
    require_tool_sizes(scene, float((high - low).max()))
    green = _green(body, pressing_radii(scene, body), growing, progress)
    built = BuiltScene.of(scene, body, green)
    built = with_stored_series(marked_as_growing(built, growing or {}))
    if options.radius is None:
        defaults.append(f"tool of radius {1e3 * built.scene.tools[0].radius:.3g} mm (--radius)")
    print(f"{file}: {size_text(high - low)}" + (f"; by default {', '.join(defaults)}" if defaults else ""))
    return built


def print_expected(expected: Expected) -> None:
    """Print how large a body is and what its store takes, before it is computed."""
    if expected.plan is not None:
        print(expected, flush=True)


def _green(
    body: Body, radii: Sequence[float], growing: dict[int, BackgroundPrecompute] | None, progress: bool | Reporter
) -> GreensFunction:
    """Compute what touches need: at first only where the page shows the middle, if the whole takes long."""
    if isinstance(progress, Reporter):
        progress.phase("planning")
    expected = Expected.of(body, radii=radii)
    print_expected(expected)
    if growing is None or expected.first is None:
        return precompute(body, progress=progress)
    growing[0] = background = BackgroundPrecompute(body, first=shapes.Sphere(*expected.first))
    with progress_reporter("precomputing what is touched first", progress) as report:
        if report is not None:
            report.phase("factorising, and computing what is touched first")
        return background.wait(report)
