"""Checks of options, files and folders that a command was given, before its work; errors name the option."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import typer

from palpate.errors import Error, SceneError, StoreError, UnitError
from palpate.input_file import require_file
from palpate.mesh.files import WRITERS
from palpate.mesh.surface_file import SURFACE_ENDINGS
from palpate.models import NAMES
from palpate.scene import Scene, model_scene
from palpate.segmentation.endings import SEGMENTATION_ENDINGS, is_segmentation
from palpate.simulation import require_new_recording
from palpate.units import length_scale


def require_folder(folder: Path, option: str = "--out") -> None:
    """Refuse a file where an option names a folder, which may be yet to be made."""
    for place in (folder, *folder.parents):
        if place.exists():
            if not place.is_dir():
                raise Error(f"{place} is a file: {option} names a folder")
            return


def require_places(record: Path | None, out: Path | None, page: tuple[str, int] | None = None) -> None:
    """Refuse places where a run cannot leave its recording, its folder of results or its page (host, port)."""
    if record is not None:
        require_recordable(record)
    if out is not None:
        require_folder(out)
    if page is not None:
        from palpate.viewer.pages import require_free_port

        require_free_port(*page)


def require_recordable(file: Path) -> None:
    """Refuse a file in which a simulation would not record, or one whose ending no command would open again."""
    if file.suffix != ".mcap":
        raise SceneError(f"--record {file}: a recording ends in .mcap: name it {file.with_suffix('.mcap')}")
    require_new_recording(file)


def require_store_name(file: Path) -> None:
    """Refuse a name that no command would take for a store."""
    if file.suffix != ".palpate":
        raise StoreError(f"--out {file}: a store ends in .palpate: name it {file.with_suffix('.palpate')}")


def require_store(file: Path) -> None:
    """Refuse a file that is missing, or no store."""
    require_file(file, StoreError)
    if file.suffix != ".palpate":
        raise StoreError(f"{file} is no store: 'palpate precompute {shlex.quote(str(file))}' makes one (.palpate)")


def require_body(file: Path) -> None:
    """Refuse a file that is missing, or of a kind that holds no body."""
    require_file(file, SceneError)
    if file.suffix.lower() == ".mcap":
        raise SceneError(f"{file} is a recording: 'palpate replay' shows it, 'palpate export' and 'compare' read it")
    # Formats of volume meshes and scenes are looked up as they are written.
    known = (".toml", ".palpate", *WRITERS)
    if file.suffix in known or file.suffix.lower() in SURFACE_ENDINGS or is_segmentation(file):
        return
    surfaces, volumes, maps = (", ".join(endings) for endings in (SURFACE_ENDINGS, WRITERS, SEGMENTATION_ENDINGS))
    raise SceneError(
        f"{file}: files of this kind are not read: scenes are .toml, stores .palpate, surfaces {surfaces}, volume "
        f"meshes {volumes}, label maps {maps}"
    )


def scene_of_file(file: Path) -> Scene:
    """Scene of a file or a store; SceneError for other files."""
    if file.suffix == ".palpate":
        return Scene.of_store(file)
    require_file(file, SceneError)
    if file.suffix != ".toml":
        raise SceneError(f"{file} is no scene: write one (.toml) that names it in [body], or give a store (.palpate)")
    return Scene.read(file)


def scene_of_name(name: str) -> Scene:
    """Scene of a file, a store, or a built-in model by its name; SceneError for anything else."""
    file = Path(name)
    if file.exists() or file.suffix:
        return scene_of_file(file)
    if name not in NAMES:
        raise no_such_model(name)
    return model_scene(name)


def no_such_model(name: str) -> SceneError:
    """Error for what is neither a file nor a model."""
    return SceneError(f"{name}: no such file, and no model of that name; models are {', '.join(NAMES)}")


def read_option(option: str, text: str, read: Callable[[str], Any]) -> Any:
    """Value of what was typed for an option; the UnitError of what cannot be read names the option."""
    try:
        return read(text)
    except UnitError as error:
        raise UnitError(f"{option}: {error}") from None


def require_unit(unit: str | None) -> None:
    """Refuse a unit that is no length, before the file is read."""
    if unit is not None:
        read_option("--unit", unit, length_scale)


def finite(seconds: float | None) -> float | None:
    """Refuse a time without an end."""
    if seconds is not None and not math.isfinite(seconds):
        raise typer.BadParameter(f"{seconds} is not a number of seconds")
    return seconds
