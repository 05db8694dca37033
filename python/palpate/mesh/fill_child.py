"""A process that reads a file of any kind: ``python -m palpate.mesh.fill_child FOLDER FILE UNIT REPORT``.

A file from elsewhere may crash or hang what reads it, and the meshers too, so that nothing of it is read by the process
of the page. ``UNIT`` is ``-`` where it is not known. Results are files in FOLDER: `SURFACE`, the triangles of a surface
in their own unit, as soon as they are read; then `MESH`, the tetrahedra in metres. REPORT gets a line of JSON for each
step: ``read`` with sizes and units, ``stage``, ``note``, and at the end ``filled`` or ``error``.
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from palpate._native import end_with_parent
from palpate.errors import Error, MeshError
from palpate.mesh.files import WRITERS
from palpate.mesh.fill_job import FillOptions
from palpate.mesh.size import COMMON_UNITS, units_of_size
from palpate.mesh.surface_file import SURFACE_ENDINGS, load_surface
from palpate.mesh.tetmesh import TetMesh
from palpate.mesh.tetrahedralize import STAGES, tetrahedralize_with
from palpate.segmentation.boundaries import default_segments, selectors
from palpate.segmentation.endings import SEGMENTATION_ENDINGS, is_segmentation
from palpate.segmentation.reading import load_label_map
from palpate.units import length_scale

SURFACE, MESH = "surface.npz", "mesh.npz"
# Label maps carry their unit; lengths are shown in this one.
SHOWN_UNIT = "mm"
# So many segments that are left out are named.
MOST_NAMED = 5
# glTF is in metres by its specification (Khronos, glTF 2.0, section 3.4).
IN_METRES = (".glb", ".gltf")


def main(folder: str, file: str, unit: str, report: str) -> int:
    """Read and fill a file; messages name it as it lies in the folder."""
    os.chdir(folder)

    def say(**line: Any) -> None:
        with Path(report).open("a") as lines:
            lines.write(json.dumps(line) + "\n")

    warnings.showwarning = lambda message, *_args, **_kwargs: say(note=str(message).removeprefix(f"{file}: "))
    warnings.simplefilter("always")
    try:
        mesh = _read(Path(file), None if unit == "-" else unit, say)
    except Error as error:
        say(error=str(error).removeprefix(f"{file}: "))
        return 1
    except MemoryError:
        say(error="needs more memory than there is")
        return 1
    partial = Path(f"partial-{MESH}")
    np.savez(partial, nodes=mesh.nodes, tets=mesh.tets, regions=mesh.regions)
    partial.replace(MESH)
    say(filled=True, names=mesh.region_names)
    return 0


def _read(path: Path, unit: str | None, say: Callable[..., None]) -> TetMesh:
    ending = path.suffix.lower()
    say(stage="reading", done=0, total=len(STAGES))
    if ending in SURFACE_ENDINGS:
        loaded = load_surface(path)
        points = np.asarray(loaded.shape.vertices)
        used = _unit(path, points, unit, say)
        np.savez(SURFACE, vertices=points, faces=np.asarray(loaded.shape.faces))
        say(stage="checking", done=1, total=len(STAGES), drawn=True)
        return tetrahedralize_with("quadratic", loaded, unit=used, progress=_stage_lines(say))
    if ending in WRITERS:
        mesh = TetMesh.read(path, "m")
        used = _unit(path, mesh.nodes, unit, say)
        return TetMesh.read(path, used)
    if is_segmentation(path):
        return _segments(path, unit, say)
    known = ", ".join((*SURFACE_ENDINGS, *SEGMENTATION_ENDINGS, *WRITERS))
    raise MeshError(f"{path}: no surface, mesh or segmentation by its ending; known are {known}")


def _segments(path: Path, unit: str | None, say: Callable[..., None]) -> TetMesh:
    """Fill the segments that hang together with the largest; its boundary is drawn as soon as it is known."""
    labels = load_label_map(path, unit)
    chosen, left_out = default_segments(labels)
    names = selectors(labels, chosen)
    del labels
    if left_out:
        shown = ", ".join(f"'{name}'" for name in left_out[:MOST_NAMED])
        more = f" and {len(left_out) - MOST_NAMED} more" if len(left_out) > MOST_NAMED else ""
        say(note=f"{shown}{more} were left out: small, or apart from '{chosen[0].name}'")

    def drawn(vertices: np.ndarray, faces: np.ndarray) -> None:
        points = vertices / length_scale(SHOWN_UNIT)
        say(read=True, sides=np.ptp(points, axis=0).tolist(), fitting=[SHOWN_UNIT], unit=SHOWN_UNIT)
        np.savez(SURFACE, vertices=points, faces=faces)
        say(stage=STAGES[1], done=1, total=len(STAGES), drawn=True)

    options = FillOptions(segments=tuple(names))
    return tetrahedralize_with("quadratic", path, unit=unit, options=options, progress=_stage_lines(say), drawn=drawn)


def _stage_lines(say: Callable[..., None]) -> Callable[[int, int], None]:
    """Report each stage of filling once, by its rank."""
    last = 1

    def report(done: int, total: int) -> None:
        nonlocal last
        if done > last:
            last = done
            say(stage=STAGES[done], done=done, total=total)

    return report


def _unit(path: Path, points: np.ndarray, unit: str | None, say: Callable[..., None]) -> str:
    """Report the sides of the body in the file's unit, and the units that it may be in; take the likeliest."""
    fitting = ["m"] if path.suffix.lower() in IN_METRES else units_of_size(points) or list(COMMON_UNITS)
    used = unit or fitting[0]
    sides = np.ptp(points, axis=0) if len(points) else np.zeros(3)
    say(read=True, sides=sides.tolist(), fitting=fitting, unit=used)
    return used


if __name__ == "__main__":
    end_with_parent()
    sys.exit(main(*sys.argv[1:5]))
