"""Metadata of a recording: enough to build the same simulation again."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from palpate import _native
from palpate.errors import SceneError
from palpate.scene import BuiltBody, BuiltScene, Scene
from palpate.scene.series import sphere_radii
from palpate.scene.tables import SceneTables

# Raised when what is recorded, or what follows from it, changes.
FORMAT = 4


def about(
    scene: SceneTables, bodies: Sequence[BuiltBody], devices: Sequence[tuple], shown: tuple[int, bool], clock: bool
) -> dict[str, str]:
    """Tables of the scene, where its paths start, keys of what was computed for its bodies, and limits of its devices.

    ``shown`` is the number of tools that a recording shows, and whether it shows one without an axis of tools.
    """
    keys = [[body.green.key, None if body.motion is None else body.motion.basis.key] for body in bodies]
    return {
        "format": str(FORMAT),
        "version": _native.__version__,
        "scene": json.dumps(recorded_tables(scene)),
        "name": scene.name,
        "folder": str(scene.folder.absolute()),
        "bodies": json.dumps([body.name for body in bodies]),
        "keys": json.dumps(keys),
        "series": series_text([[(radius, known.known) for radius, known in body.series if known] for body in bodies]),
        "rate": repr(scene.device.rate),
        "tools": str(len(scene.tools)),
        "devices": json.dumps(devices),
        "shown": json.dumps(shown),
        "clock": str(int(clock)),
    }


def recorded_tables(scene: SceneTables) -> dict[str, Any]:
    """Tables as they were given; the law of each tool is named: its default follows from other keys."""
    tables = scene.model_dump(mode="json", by_alias=True, exclude_unset=True)
    tools = [tool.model_dump(mode="json", by_alias=True, exclude_unset=True) for tool in scene.tools]
    tables["tool"] = [{**given, "contact": tool.contact} for given, tool in zip(tools, scene.tools, strict=True)]
    return tables


def require_readable(about: Mapping[str, str], name: str) -> None:
    """Refuse texts that this version cannot read.

    Raises SceneError for a recording of a later version of Palpate, or one without what every recording has.
    """
    try:
        if int(about["format"]) > FORMAT:
            raise SceneError(
                f"{name}: the recording was made by Palpate {about['version']}, which is newer: update this one"
            )
        scene, keys, names, devices = (json.loads(about[key]) for key in ("scene", "keys", "bodies", "devices"))
        _, single = json.loads(about["shown"])
        given = [isinstance(scene, dict), *(isinstance(value, list) for value in (keys, names, devices))]
        given += [isinstance(single, bool), len(keys) == len(names), all(len(pair) == 2 for pair in keys)]
        known = {"folder", "name", "clock"} <= set(about) and int(about["tools"]) > 0 and float(about["rate"]) > 0
    except (KeyError, TypeError, ValueError) as error:
        raise SceneError(f"{name}: the recording is damaged: {type(error).__name__} in what was recorded") from None
    if not (all(given) and known):
        raise SceneError(f"{name}: the recording is damaged: the recorded scene is missing")


def scene_of(about: dict[str, str]) -> Scene:
    """Scene of a recording; SceneError for tables that this version does not know."""
    scene = Scene(**json.loads(about["scene"]))
    scene.start_paths_in(Path(about["folder"]))
    return scene


def require_same(about: dict[str, str], built: BuiltScene) -> None:
    """Refuse bodies that are not those of the recording.

    Raises SceneError with the first body that differs, or for another number of bodies or tools.
    """
    keys, names = json.loads(about["keys"]), json.loads(about["bodies"])
    counts = (len(keys), int(about["tools"]))
    given = (len(built.bodies), len(built.scene.tools))
    if counts != given:
        raise SceneError(
            f"the recording has {counts[0]} bodies and {counts[1]} tools, the scene {given[0]} and {given[1]}"
        )
    for (green, basis), name, body in zip(keys, names, built.bodies, strict=True):
        now = None if body.motion is None else body.motion.basis.key
        if green != body.green.key or basis != now:
            what = "mesh, material, supports or precision" if green != body.green.key else "modes"
            raise SceneError(
                f"'{name}' is not the body that was recorded: its {what} differ (made by Palpate {about['version']}); "
                f"give the scene as it was then"
            )


def with_recorded_series(about: dict[str, str], built: BuiltScene) -> BuiltScene:
    """Leave out what the recorded loop did not know of the series: it may have begun before all was computed.

    Raises SceneError for a series that lacks what was known then.
    """
    recorded = json.loads(about.get("series", "[]")) or [[] for _ in built.bodies]
    radii = sphere_radii(built)
    bodies = []
    for body, of_body in zip(built.bodies, recorded, strict=True):
        # Before format 4 a series was known as a whole, or not at all.
        blocks = dict(entry if isinstance(entry, list) else (entry, None) for entry in of_body)
        # A scene with other tools has other series.
        blocks = {radius: text for radius, text in blocks.items() if radius in radii}
        known = dict(body.series)
        series = tuple((radius, _part(body, known.get(radius), text)) for radius, text in blocks.items())
        bodies.append(replace(body, series=series))
    return replace(built, bodies=tuple(bodies))


def series_text(known: Sequence[Sequence[tuple[float, Sequence[bool]]]]) -> str:
    """Text about the series of each body: radius, m, and which blocks of places are known."""
    return json.dumps([[[radius, "".join("01"[has] for has in blocks)] for radius, blocks in of] for of in known])


def _part(body: BuiltBody, known: _native.Series | None, blocks: str | None) -> _native.Series | None:
    """Return the recorded part of a series, by a digit for each block; None where nothing was known."""
    if blocks is not None and "1" not in blocks:
        return None
    wanted = None if blocks is None else [digit == "1" for digit in blocks]
    part = known if known is None or wanted is None else known.only(wanted)
    if part is None:
        raise SceneError(
            f"'{body.name}' has no series beyond small strain like the one of the recording: give the scene as it was "
            "then, and let its series be computed"
        )
    return part


def measured_by_surface(about: Mapping[str, str]) -> bool:
    """Whether the strain of all bodies was measured by their surfaces, as in a page without a server."""
    return about.get("strain") == "surface"


def shown_of(about: dict[str, str]) -> tuple[int, bool]:
    """Return the number of tools that a recording shows, and whether it shows one without an axis of tools."""
    given, single = json.loads(about["shown"])
    return given, single
