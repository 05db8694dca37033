"""The command that describes a file of any kind, and lines about a store for other commands."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from palpate.cli.app import app, mesh_line
from palpate.cli.bodies import is_surface, likely_units
from palpate.cli.checks import require_body, require_unit
from palpate.cli.completion import units
from palpate.dynamics import ModalBasis
from palpate.green import GreensFunction, error_text
from palpate.green.series import lines_of_series, series_line
from palpate.mesh import TetMesh, size_text
from palpate.mesh.label_process import label_summary
from palpate.mesh.surface_state import require_finite
from palpate.mesh.tetrahedralize import read_surface
from palpate.scene import Scene
from palpate.segmentation.endings import is_segmentation
from palpate.units import length_scale

# Tables that a store takes the place of.
OF_STORE = ("material", "supports", "touch", "region", "loads", "dynamics")


@app.command()
def info(
    file: Annotated[Path, typer.Argument(help="A store, modes, a scene, a volume mesh, a surface or a segmentation.")],
    unit: Annotated[
        str | None,
        typer.Option(
            help="Unit of length; default: m, for a surface the unit that fits its size.", autocompletion=units
        ),
    ] = None,
) -> None:
    """Describe a file.

    Example: palpate info liver.palpate
    """
    require_body(file)
    require_unit(unit)
    if file.name.endswith(".modes.palpate"):
        basis = ModalBasis.load(file)
        print(f"{file}: {len(basis)} modes, {basis.frequencies[0]:.4g} to {basis.frequencies[-1]:.4g} Hz")
        _print_origin(basis.description, basis.key)
        return
    if file.name.endswith(".series.palpate"):
        print(f"{file}: {series_line(file)}")
        return
    if file.suffix == ".palpate":
        green = GreensFunction.load(file)
        print(f"{file}: {green_line(green)}")
        print(f"  {precision_line(green)}")
        _print_origin(green.description, green.key)
        for line in lines_of_series(file):
            print(f"  {line}")
        return
    if file.suffix == ".toml":
        _print_scene(file)
        return
    if is_segmentation(file):
        _print_segmentation(file, unit)
        return
    if is_surface(file):
        _print_surface(file, unit)
        return
    # A mesh of an unlikely size is described, not refused.
    tets = TetMesh.read(file, unit or "m")
    print(f"{file}: {mesh_line(tets)}")
    low, high = 1e3 * tets.bounds
    print(f"  bounds: {low.round(2).tolist()} to {high.round(2).tolist()} mm, volume {1e6 * tets.volume:.4g} cm3")
    print(
        f"  regions: {sorted(set(tets.regions.tolist()))}, dihedral angle >= {tets.dihedral_angles().min():.1f} degrees"
    )


def _print_origin(description: dict[str, object], key: str) -> None:
    """Say what a precomputed file was made from."""
    # Constants at every surface node are for programs.
    for name, value in ((name, value) for name, value in description.items() if name != "surface_moduli"):
        print(f"  {name.replace('_', ' ')}: {value}")
    print(f"  key: {key}")


def precision_line(green: GreensFunction) -> str:
    """Precision of its numbers, and what touches are right to."""
    touch, stamp = error_text(green.touch_error), error_text(green.stamp_error)
    return f"precision {green.precision}: touches right to {touch}, nodal forces under a stamp to {stamp}, as measured"


def green_line(green: GreensFunction) -> str:
    """Sizes of the body and of the file."""
    size = green.path.stat().st_size / 1e6
    return (
        f"Green's function of a body of {size_text(green.extents)}, {len(green.touchable_nodes)} of "
        f"{len(green.surface_nodes)} surface nodes touchable, {len(green.fixed_nodes)} nodes fixed, {green.precision}, "
        f"{size:.1f} MB"
    )


def _print_scene(file: Path) -> None:
    """Print all keys of a scene with their values, and materials of its stores; Error for files that do not suit."""
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


def _print_segmentation(path: Path, unit: str | None) -> None:
    """Print the voxels, the segments with their volumes, and the command that makes a body of them."""
    labels = label_summary(path, unit)
    sides = " x ".join(f"{1e3 * side:.4g}" for side in labels.spacing)
    shape = " x ".join(map(str, labels.shape))
    print(f"{path}: label map of {shape} voxels of {sides} mm, {len(labels.segments)} segments")
    for segment in labels.segments:
        volume = f"{1e6 * segment.voxels * labels.voxel_volume:.4g} cm3, {segment.voxels:,} voxels"
        print(f"  '{segment.name}' (label {segment.value}): {volume if segment.voxels else 'empty'}")
    largest = max(labels.segments, key=lambda segment: segment.voxels)
    print(f"  to touch it: palpate run {shlex.quote(str(path))} --segment {shlex.quote(str(largest.name))}")


def _print_surface(path: Path, unit: str | None) -> None:
    """Print counts, size, volume, whether it can be filled, and the command that does."""
    unit, *others = likely_units(path) if unit is None else [unit]
    shape, scale = read_surface(path), length_scale(unit)
    require_finite(str(path), shape)
    shape.merge_vertices(merge_tex=True, merge_norm=True)
    print(f"{path}: surface of {len(shape.vertices)} vertices, {len(shape.faces)} triangles")
    low, high = 1e3 * scale * shape.bounds
    size = " x ".join(f"{side:.4g}" for side in high - low)
    may_be = f"; it may also be {' or '.join(others)}" if others else ""
    place = f"from {low.round(2).tolist()} to {high.round(2).tolist()} mm"
    print(f"  {size} mm if its unit is {unit} (--unit{may_be}), {place}")
    _, uses = np.unique(shape.edges_sorted, axis=0, return_counts=True)
    rims, crowded = int((uses == 1).sum()), int((uses > 2).sum())
    faults = [
        f"{rims} open edges" if rims else "",
        f"{crowded} edges of more than two triangles" if crowded else "",
        "" if shape.is_winding_consistent else "triangles that disagree on which side is outside",
    ]
    if any(faults):
        print(f"  not closed: {', '.join(filter(None, faults))}; what it encloses is filled all the same")
    else:
        print(f"  closed, volume {1e6 * scale**3 * abs(shape.volume):.4g} cm3")
    if shape.body_count != 1:
        print(f"  {shape.body_count} separate surfaces: of several parts the largest is filled (--part)")
    files = shlex.join([str(path), str(path.with_suffix(".vtu"))])
    print(f"  to tetrahedra: palpate mesh {files} --unit {unit}")
