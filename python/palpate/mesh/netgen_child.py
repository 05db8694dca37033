"""The mesher's own process: ``python -m palpate.mesh.netgen_child ROUTE SURFACE.npz MESH.npz``.

The route ``remesh`` makes a new surface of even triangles and fills it; ``keep`` fills the surface exactly as given.

Exit status 1: no tetrahedra; 3: files that cannot be written, for which another route is no remedy. A crash of
the mesher ends this process alone.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from netgen.meshing import Element2D, FaceDescriptor, Mesh, MeshingParameters, MeshPoint, Pnt
from netgen.stl import STLGeometry

from palpate._native import end_with_parent
from palpate.mesh.child import FILES_FAILED
from palpate.mesh.triangles import area_vectors, units

# Edges sharper than this angle are kept as edges, degrees. NETGEN's default of 30 invents edges on smooth organs.
FEATURE_ANGLE = 80.0


def main(route: str, surface_file: str, mesh_file: str) -> int:
    """Mesh the triangles of ``given`` into ``made``."""
    with np.load(surface_file) as job:
        vertices, faces, size = job["vertices"], job["faces"], float(job["size"])
        _limit_processor_time(float(job["processor_limit"]))
        small = np.vstack([job["points"], *(_ball_points(b[:3], b[3], b[4]) for b in job["balls"])])
    parameters = MeshingParameters(maxh=size, yangle=FEATURE_ANGLE)
    if len(small):
        # A file of sizes, for NETGEN forgets sizes given by RestrictH when it remeshes a surface.
        sizes = Path(surface_file).with_suffix(".msz")
        _write_sizes(sizes, small)
        parameters = MeshingParameters(maxh=size, yangle=FEATURE_ANGLE, meshsizefilename=str(sizes))
    if route == "keep":
        mesh = _fill(vertices, faces, parameters)
    else:
        mesh = _remesh(vertices[faces], Path(surface_file).with_suffix(".stl"), parameters)
    elements = mesh.Elements3D().NumPy()
    nodes = np.array([point.p for point in mesh.Points()])
    if len(elements) == 0:
        return 1
    # 1-based and negatively oriented.
    tets = elements["nodes"][:, [0, 2, 1, 3]].astype(np.int64) - 1
    used = np.unique(tets)
    np.savez(mesh_file, nodes=nodes[used], tets=np.searchsorted(used, tets))
    return 0


def _limit_processor_time(seconds: float) -> None:
    """Let the system end this process after so much processor time; 0 sets no limit, and Windows has none."""
    if seconds > 0 and sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 1))


def _write_sizes(path: Path, points: np.ndarray) -> None:
    """Points with a local size each (k, 4), and no lines, in NETGEN's format."""
    rows = (" ".join(map(repr, point)) for point in points.tolist())
    path.write_text("\n".join([str(len(points)), *rows, "0", ""]))


def _remesh(corners: np.ndarray, surface: Path, parameters: MeshingParameters) -> Mesh:
    _write_stl(surface, corners)
    return STLGeometry(str(surface)).GenerateMesh(mp=parameters)


def _fill(vertices: np.ndarray, faces: np.ndarray, parameters: MeshingParameters) -> Mesh:
    mesh = Mesh()
    points = [mesh.Add(MeshPoint(Pnt(*vertex))) for vertex in vertices.tolist()]
    face = mesh.Add(FaceDescriptor(bc=1, domin=1, surfnr=1))
    for triangle in faces:
        mesh.Add(Element2D(face, [points[k] for k in triangle]))
    mesh.GenerateVolumeMesh(mp=parameters)
    return mesh


def _ball_points(centre: np.ndarray, radius: float, spacing: float) -> np.ndarray:
    """Points where the size is imposed, and the size (k, 4): a grid through the ball, at most 21 to a side."""
    steps = min(int(np.ceil(radius / spacing)), 10)
    axis = np.linspace(-radius, radius, 2 * steps + 1)
    grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    inside = centre + grid[np.linalg.norm(grid, axis=1) <= radius * (1 + 1e-9)]
    return np.column_stack([inside, np.full(len(inside), spacing)])


def _write_stl(path: Path, corners: np.ndarray) -> None:
    record = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["normal"] = units(area_vectors(corners))
    record["corners"] = corners
    with path.open("wb") as file:
        file.write(b"palpate".ljust(80) + np.uint32(len(corners)).tobytes() + record.tobytes())


if __name__ == "__main__":
    end_with_parent()
    try:
        sys.exit(main(*sys.argv[1:4]))
    except OSError:
        sys.exit(FILES_FAILED)
