"""One surface of ``python -m benches fill``, in a process of its own so that its peak of memory is its own.

``python -m benches.fill_row NAME MESHER`` prints a line of JSON; MESHER is auto, netgen or touch.
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from benches.fill_corpus import Case, Given, corpus

# Seconds that NETGEN alone gets.
NETGEN_LIMIT = 60.0
SAMPLES = 20_000
# Share of its height at which a body is held when it is touched, and how deep, in parts of its size.
HELD, DEPTH = 0.1, 0.02


def main(name: str, way: str) -> None:
    """Fill a surface and print what came of it."""
    case = next(case for case in corpus() if case.name == name)
    given = case.make()
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as folder:
        path = Path(folder) / "surface.ply"
        given.surface.export(path)
        print(json.dumps(_touched(path) if way == "touch" else _filled(case, given, path, way)))


def _filled(case: Case, given: Given, path: Path, way: str) -> dict[str, Any]:
    import palpate
    from palpate.mesh.fill_job import FillOptions
    from palpate.mesh.tetrahedralize import tetrahedralize_with

    options = FillOptions(None if way == "auto" else "netgen", max_volume_loss=0.9)
    limit = NETGEN_LIMIT if way == "netgen" else 300.0
    row: dict[str, Any] = {"triangles": len(given.surface.faces)}
    began, cpu = time.perf_counter(), _processor_time()
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        try:
            mesh = tetrahedralize_with("quadratic", path, None, "m", options=options, time_limit=limit, progress=False)
        except palpate.Error as error:
            mesh, row["refused"] = None, str(error).removeprefix(f"{path}: ")
    row |= {"seconds": time.perf_counter() - began, "processor_s": _processor_time() - cpu}
    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    row["memory_mb"] = sum(resource.getrusage(kind).ru_maxrss for kind in kinds) / 1e3
    if mesh is None:
        return row
    texts = [str(note.message).removeprefix(f"{path}: ") for note in notes]
    row |= {"notes": texts, "wrapped": any("was wrapped" in text for text in texts)}
    row |= {"nodes": len(mesh.nodes), "surface_nodes": len(mesh.surface_nodes)}
    row["angle"] = float(mesh.dihedral_angles().min())
    if given.truth is not None:
        row["volume_error"] = mesh.volume / abs(given.truth.volume) - 1.0
        row["hausdorff"] = _hausdorff(mesh, given.truth) / float(np.ptp(mesh.bounds, axis=0).max())
    return row


def _hausdorff(mesh: Any, truth: Any) -> float:
    """Largest distance of points on either surface from the other, m."""
    import trimesh

    from palpate import _native
    from palpate.mesh.fit import distances

    points = trimesh.sample.sample_surface(truth, SAMPLES, seed=0)[0]
    search = _native.SurfaceSearch(np.ascontiguousarray(truth.vertices, dtype=float), truth.faces.astype(np.uint32))
    own = np.ascontiguousarray(mesh.nodes[mesh.surface_nodes])
    back = np.linalg.norm(search.closest(own).reshape(-1, 3) - own, axis=1)
    return float(max(distances(mesh, np.asarray(points)).max(), back.max()))


def _touched(path: Path) -> dict[str, Any]:
    """Seconds from the file to the first force, the import of the package included, as `palpate run` takes them."""
    began = time.perf_counter()
    import palpate
    from palpate.mesh.tetrahedralize import tetrahedralize_with

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mesh = tetrahedralize_with("quadratic", path, None, "m", progress=False)
        filled = time.perf_counter()
        low, high = mesh.bounds
        held = mesh.nodes[:, 2] < low[2] + HELD * (high[2] - low[2])
        body = palpate.Body(mesh, material=palpate.Material(1e4, 0.45), fixed=held)
        green = palpate.precompute(body, path=path.with_suffix(".palpate"), progress=False)
        top = mesh.nodes[mesh.nodes[:, 2].argmax()]
        touch = green.touch(top, (None, None, -DEPTH * float(np.ptp(mesh.bounds, axis=0).max())), 0.006)
    end = time.perf_counter()
    return {"fill_s": filled - began, "touch_s": end - began, "force": float(np.linalg.norm(touch.force))}


def _processor_time() -> float:
    """Processor time of this process and its ended children, s."""
    used = [resource.getrusage(kind) for kind in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


if __name__ == "__main__":
    main(*sys.argv[1:3])
