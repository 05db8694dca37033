"""Solutions for the bodies of a study; bodies that share an operator are solved together."""

from __future__ import annotations

import hashlib
import json
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from palpate import _native
from palpate.body import Body, description, problem_arrays
from palpate.cache import digest
from palpate.cluster import require_version, use_threads_of_worker
from palpate.errors import Error, PalpateWarning
from palpate.green import GreensFunction
from palpate.mesh import TetMesh
from palpate.mesh.triangles import closest_on
from palpate.scene import mesh_of_body, unsolved_body
from palpate.scene.files import is_node_file
from palpate.scene.regions import CONSTANTS, MaterialTable
from palpate.scene.sizes import PART_OF_BODY, default_contact_radius
from palpate.scene.tables import SupportsTable
from palpate.study.cases import PressTable, StudyScene

# Of a store with a handful of columns nothing is gained by fewer bits.
PRECISION = "f64"
# Of the operator, where the modulus only scales forces, Pa.
REFERENCE_MODULUS = 10e3
# Meshes kept for the next body of this process.
MESHES_KEPT = 3
# Files that a mesh is split into, by the ending of the one that is named.
PARTS = {".node": (".ele", ".face", ".edge"), ".ele": (".node", ".face", ".edge")}
# Patches are weighed on curved faces: farther out than their flat triangles.
MARGIN = 1.1

# Keys of a part that give it a stiffness of its own.
STIFFNESS = ("youngs_modulus", "law", *CONSTANTS)
# Keys of a body that decide its mesh, besides its file and the names of its segments.
MESH_KEYS = {"model", "paper", "unit", "max_element_size", "element", "refine", "mesher", "part", "max_volume_loss"}


@dataclass(frozen=True)
class Answers:
    """What one body answers."""

    rows: list[dict[str, Any]]  # a row of the table for each press
    notes: list[str]  # what there was to warn of
    problem: str = ""  # why there are no rows; empty if there are


def files_of(scene: StudyScene) -> dict[str, Path]:
    """Files that a body is made of, by their names beside that of its mesh: mesh, buffers of glTF, supported nodes."""
    body = scene.bodies[0]
    supports = scene.supports if body.supports is None else body.supports
    files = {}
    if body.mesh is not None:
        file = scene.folder / body.mesh
        parts = [file.with_suffix(ending) for ending in PARTS.get(file.suffix.lower(), ())]
        files = {part.name: part for part in (file, *parts) if part == file or part.is_file()}
        files |= {name: file.parent / name for name in _buffers(file)}
    if supports is not None and is_node_file(supports.fixed) and (scene.folder / supports.fixed).is_file():
        files[Path(supports.fixed).name] = scene.folder / supports.fixed
    return files


def _buffers(file: Path) -> list[str]:
    """Names of the files of a glTF scene."""
    if file.suffix.lower() != ".gltf":
        return []
    try:
        buffers = json.loads(file.read_bytes()).get("buffers", [])
        names = [unquote(buffer["uri"]) for buffer in buffers if not buffer.get("uri", "data:").startswith("data:")]
    except (OSError, ValueError, AttributeError, TypeError):
        return []  # not a file that can be read: the error comes where it is
    return [name for name in names if (file.parent / name).is_file()]


def mesh_key(scene: StudyScene) -> str:
    """Hash of everything that decides the mesh of a body, and of its supported nodes."""
    body = scene.bodies[0]
    tables = {**body.model_dump(mode="json", include=MESH_KEYS), "segment": [segment.name for segment in body.segment]}
    key = hashlib.sha256(json.dumps(tables, sort_keys=True).encode())
    for name, file in files_of(scene).items():
        key.update(Path(name).suffix.encode() + hashlib.sha256(file.read_bytes()).digest())
    return key.hexdigest()


def operator_key(scene: StudyScene) -> str:
    """Hash of everything that decides the operator of a body and the presses, but for a modulus that scales forces."""
    tables = scene.model_dump(mode="json", include={"bodies", "supports", "material", "region", "loads", "presses"})
    body = tables["bodies"][0]
    for name in ("mesh", "name", "position", "orientation"):
        body.pop(name)
    if scales_with_modulus(scene):
        (body["material"] or tables["material"]).pop("youngs_modulus")
    return digest([_native.__version__, mesh_key(scene), tables])


def case_key(scene: StudyScene) -> str:
    """Hash of everything that decides what a body answers."""
    return hashlib.sha256(f"{operator_key(scene)} {youngs_modulus(scene)!r}".encode()).hexdigest()


def youngs_modulus(scene: StudyScene) -> float:
    """Young's modulus of a body, but for its regions; that of its constants where it has some."""
    return _material(scene).material().youngs_modulus


def _material(scene: StudyScene) -> MaterialTable:
    return scene.bodies[0].material or scene.material


def scales_with_modulus(scene: StudyScene) -> bool:
    """Whether Young's modulus is given and the same everywhere, and nothing but touches loads the body."""
    body = scene.bodies[0]
    loads = scene.loads if body.loads is None else body.loads
    regions = scene.region if body.region is None else body.region
    of_constants = any(getattr(_material(scene), name) is not None for name in CONSTANTS)
    parts = [*regions, *body.segment]
    return not loads and not of_constants and all(getattr(part, name) is None for part in parts for name in STIFFNESS)


def answers(scenes: Sequence[StudyScene]) -> list[Answers]:
    """Answers of bodies that share an operator: it is computed once, if its store says that the modulus only scales."""
    known: GreensFunction | None = None
    found = []
    for scene in scenes:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", PalpateWarning)
            try:
                if known is None or known.youngs_modulus is None:
                    known = _operator(scene)
                factor = 1.0 if known.youngs_modulus is None else youngs_modulus(scene) / known.youngs_modulus
                rows, problem = [_row(known, factor, press) for press in scene.presses], ""
            except (Error, OSError) as error:
                rows, problem = [], str(error)
        notes = [str(warning.message) for warning in caught if issubclass(warning.category, PalpateWarning)]
        found.append(Answers(rows, list(dict.fromkeys(notes)), problem))
    return found


def answers_elsewhere(version: str, scenes: Sequence[StudyScene], files: Sequence[tuple[str, bytes]]) -> list[Answers]:
    """Answers on a worker, which has the contents of the files and not the files."""
    from distributed import get_worker

    require_version(version, get_worker().address)
    use_threads_of_worker()
    with tempfile.TemporaryDirectory(prefix="palpate-study-") as folder:
        for name, content in files:
            file = Path(folder) / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        moved = []
        for scene in scenes:
            path, text = scene.source
            body = scene.bodies[0]
            name = None if body.mesh is None else Path(body.mesh).name
            moved_body = {"mesh": name, "supports": _beside(body.supports)}
            here = {"bodies": [body.model_copy(update=moved_body)], "supports": _beside(scene.supports)}
            here = scene.model_copy(update=here)
            here.replace_source(Path(folder) / path.name, text)
            moved.append(here)
        home = str(scenes[0].source[0].parent)
        return [Answers(a.rows, a.notes, a.problem.replace(folder, home)) for a in answers(moved)]


def _beside(supports: SupportsTable | None) -> SupportsTable | None:
    """Supports whose file of nodes, if they have one, lies beside the scene."""
    if supports is None or not is_node_file(supports.fixed):
        return supports
    return supports.model_copy(update={"fixed": Path(supports.fixed).name})


_meshes: dict[str, TetMesh] = {}


def _mesh(scene: StudyScene) -> TetMesh:
    """Mesh of a body, from those that this process has made lately."""
    key = mesh_key(scene)
    mesh = _meshes.pop(key, None)
    if mesh is None:
        mesh = mesh_of_body(scene)
    _meshes[key] = mesh
    while len(_meshes) > MESHES_KEPT:
        del _meshes[next(iter(_meshes))]
    return mesh


def _operator(scene: StudyScene) -> GreensFunction:
    """Green's function of the nodes that the presses are about.

    Where the modulus only scales forces it is that of a reference, so that what a body answers does not depend on which
    others are computed with it.
    """
    if scales_with_modulus(scene):
        scene = _of_reference_modulus(scene)
    body = unsolved_body(scene, mesh=_mesh(scene))
    body.require_supported()
    problem = problem_arrays(body, _touched_nodes(body, scene.presses))
    precision = scene.bodies[0].precision or PRECISION
    core = _native.GreenCore.precompute(problem, precision, json.dumps(description(body)), None)
    return GreensFunction(core, body)


def _of_reference_modulus(scene: StudyScene) -> StudyScene:
    body = scene.bodies[0]
    material = {"material": _material(scene).model_copy(update={"youngs_modulus": REFERENCE_MODULUS})}
    return scene.model_copy(
        update=material if body.material is None else {"bodies": [body.model_copy(update=material)]}
    )


def _touched_nodes(body: Body, presses: Sequence[PressTable]) -> np.ndarray:
    """Nodes of all surface faces that a patch reaches."""
    mesh = body.mesh
    corners = np.searchsorted(mesh.surface_nodes, mesh.surface_triangles)
    landed_from = closest_on(mesh.nodes[mesh.surface_nodes], corners)
    faces = mesh.nodes[mesh.surface_faces]
    centres = faces.mean(axis=1)
    sizes = np.linalg.norm(faces - centres[:, None], axis=2).max(axis=1)
    touched = np.zeros(len(faces), dtype=bool)
    for press in presses:
        radius = PART_OF_BODY * float(np.ptp(mesh.nodes, axis=0).max()) if press.radius is None else press.radius
        landed = landed_from(np.array([press.point]))[0]
        touched |= np.linalg.norm(centres - landed, axis=1) <= MARGIN * (sizes + radius)
    return np.unique(mesh.surface_faces[touched])


def _row(green: GreensFunction, factor: float, press: PressTable) -> dict[str, Any]:
    """Row of a press; forces are ``factor`` times those of the operator."""
    body = green.body
    assert body is not None
    radius = default_contact_radius(green) if press.radius is None else press.radius
    answer = green.touch(press.point, press.displacement, radius)
    force = factor * answer.force
    moved = np.array([0.0 if component is None else component for component in press.displacement])
    loaded = bool(body.load_vector().any())
    return {
        "press": press.name or "",
        "nodes": len(body.mesh.nodes),
        "tetrahedra": len(body.mesh.tets),
        "volume_m3": float(body.mesh.volume),
        "radius_m": float(radius),
        **{f"point_{axis}_m": float(x) for axis, x in zip("xyz", answer.point, strict=True)},
        "distance_m": float(answer.distance),
        **{f"force_{axis}_N": float(f) for axis, f in zip("xyz", force, strict=True)},
        "force_N": float(np.linalg.norm(force)),
        # What pushes back for each metre; not of a body that its own loads have moved before.
        "stiffness_N_per_m": float("nan") if loaded else float(force @ moved / (moved @ moved)),
        "largest_displacement_m": float(np.linalg.norm(answer.displacements, axis=1).max()),
        "error": float(answer.error),
    }
