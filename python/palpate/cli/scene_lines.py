"""Lines about a scene file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from palpate.scene import Scene

# Tables that a store takes the place of.
OF_STORE = ("material", "supports", "touch", "region", "loads", "dynamics")


def print_scene(file: Path) -> None:
    """Print all keys of a scene with their values, and materials of its stores; Error for files that do not suit."""
    from palpate.scene import Scene

    scene = Scene.read(file)
    scene.require_files()
    print(f"{file}: scene of {scene.name}")
    entries = scene.model_dump(by_alias=True, exclude_none=True)
    for owner, entry in zip([scene, *scene.bodies], [entries, *entries["body"]], strict=True):
        if owner.material is not None:  # the modulus may be that of the law's constants
            entry["material"]["youngs_modulus"] = owner.material.material().youngs_modulus
    for body, entry in zip(scene.bodies, entries["body"], strict=True):
        if body.store is not None:
            entry.update(_of_store(scene, body.store))
    for name, value in entries.items():
        if name not in OF_STORE or any(body.store is None for body in scene.bodies):
            _print_entry(name, value)
    if any(tool.radius is None or tool.contact_radius is None for tool in scene.tools):
        print("  radii of tools that are not given: a sixteenth of the longest side of the body")
    print("  lengths in m, pressures in Pa, forces in N, times in s")


def _of_store(scene: Scene, store: str) -> dict[str, Any]:
    """Materials of a store: one, or one for each of its regions."""
    from palpate.green import GreensFunction

    materials = GreensFunction.load(scene.folder / store).description.get("materials", {})
    names = ("youngs_modulus", "poissons_ratio", "density")
    own = {region: dict(zip(names, values, strict=True)) for region, values in materials.items()}
    return {"material": own["all"] if list(own) == ["all"] else own}


def _print_entry(name: str, value: Any) -> None:
    """Print the keys under a name of a scene, those of several tables with their number."""
    if isinstance(value, dict):
        for key, inner in value.items():
            _print_entry(f"{name}.{key}", inner)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for rank, entry in enumerate(value):
            _print_entry(name if len(value) == 1 else f"{name}[{rank}]", entry)
    elif value != []:
        print(f"  {name} = {value}")
