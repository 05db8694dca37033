"""Summary of a surface file."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np

from palpate.cli.bodies import likely_units


def print_surface(path: Path, unit: str | None) -> None:
    """Print counts, size, volume, whether it can be filled, and the command that does."""
    from palpate.mesh.surface_state import require_finite
    from palpate.mesh.tetrahedralize import read_surface
    from palpate.units import length_scale

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
