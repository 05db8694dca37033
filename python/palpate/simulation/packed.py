"""A scene for programs without Python: a folder with everything that the force loop needs of it.

The folder holds ``scene.json``, a store for each body, and arrays as safetensors; what the numbers mean is in
docs/c-api.md. They are those that :class:`palpate.Simulation` hands to its own loop.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from palpate import _native
from palpate.atomic import folder_beside
from palpate.errors import SceneError
from palpate.green import GreensFunction
from palpate.input_file import require_replaceable
from palpate.scene import BuiltBody, BuiltScene, Scene
from palpate.scene.series import with_whole_series
from palpate.scene.tables import SceneTables
from palpate.simulation.native import body_arguments, core_of, largest_force, needs_moduli, tool_arguments

# Format of the folder; crates/scene reads it.
FORMAT, VERSION = "palpate-scene", 3
SCENE_FILE = "scene.json"
_TYPES = {"f8": "F64", "u4": "U32", "u8": "U64"}


def pack(scene: Scene | BuiltScene, path: str | os.PathLike[str], inside: bool = True) -> None:
    """Write a scene as a folder that programs without Python load: ``palpate_scene_load`` in C.

    Bodies are meshed and precomputed if need be; their stores are linked into the folder, or copied to another file
    system. An earlier packed scene of that name is replaced, when the new one is complete. Without the ``inside``
    of its bodies, a packed scene limits the strain in their surfaces.

    Raises
    ------
    SceneError
        A place that is no packed scene, or cannot be written.
    Error
        As of :meth:`palpate.Scene.build`.

    """
    where = Path(path)
    require_replaceable(where, SCENE_FILE, SceneError)
    built = scene if isinstance(scene, BuiltScene) else scene.build()
    with folder_beside(where) as folder:
        description = describe(built, folder, inside)
        text = json.dumps(description, indent=2, allow_nan=False)
        (folder / SCENE_FILE).write_text(text + "\n", encoding="utf-8")


def describe(
    built: BuiltScene, folder: Path, inside: bool = True, others: Sequence[SceneTables] = ()
) -> dict[str, Any]:
    """Write stores and arrays into the folder; what ``scene.json`` says of them.

    What contact needs is written for the tools of ``others`` too, scenes of the same bodies.
    """
    built = with_whole_series(built, True)
    scene, device = built.scene, built.scene.device
    bodies, described = [], []
    for rank, body in enumerate(built.bodies):
        store = folder / f"body-{rank}.palpate"
        _place_store(body.green, store)
        arguments = body_arguments(body, needs_moduli(scene))
        described.append(_body(body, arguments, store, folder / f"body-{rank}.arrays.safetensors", inside))
        bodies.append((_native.GreenCore.load(store), *arguments[1:]))
    # Whatever is refused is refused here; and what contact needs beyond the stores is kept beside them.
    for one in (scene, *others):
        core_of(one, bodies)
    return {
        "format": FORMAT,
        "version": VERSION,
        "palpate": version("palpate"),
        "name": scene.name,
        "bodies": described,
        "tools": [describe_tool(scene, rank, folder) for rank in range(len(scene.tools))],
        "device": {
            "max_force": largest_force(scene),
            "max_slew": device.max_slew,
            "ramp": device.ramp,
            "rate": device.rate,
            "cpus": list(device.cpus),
            "priority": device.priority,
        },
        "strain_limit": scene.view.strain_limit,
    }


def _place_store(green: GreensFunction, target: Path) -> None:
    """Link a store into the folder; copy it to another file system, write one that is in memory only."""
    if green.path is None or not green.path.exists():
        green.save(target)
        return
    with contextlib.suppress(OSError):
        os.link(green.path, target)
        return
    shutil.copyfile(green.path, target)


def _body(body: BuiltBody, arguments: tuple[Any, ...], store: Path, path: Path, inside: bool) -> dict[str, Any]:
    _, position, orientation, moving, moduli, series = arguments
    arrays: dict[str, np.ndarray] = {}
    if moduli is not None:
        arrays["youngs"], arrays["poissons"], terms, _ = moduli
        if terms is not None and terms.any():
            arrays["strain_terms"] = terms
    if series:
        arrays["series_radii"] = np.array([radius for radius, _ in series])
        arrays["series"] = np.concatenate([known.fields for _, known in series])
    motion = None
    if moving is not None:
        arrays["eigenvalues"], arrays["shapes"], (dt, alpha, delta, mass, stiffness), exact, coupling = moving
        scheme = {"dt": dt, "alpha": alpha, "delta": delta, "rayleigh": [mass, stiffness], "coupling": coupling}
        motion = {"scheme": "exact" if exact else "newmark", **scheme}
    if body.body is not None and inside:
        start, nodes, gradients = body.green.native_strain_measure.gradients()
        arrays["nodes"], arrays["tets"], arrays["materials"] = body.body._element_arrays()
        arrays |= {"gradient_start": start, "gradient_nodes": nodes, "gradients": gradients.reshape(-1, 3)}
    return {
        "name": body.name,
        "store": {"file": store.name, "key": body.green.key},
        "arrays": _written(path, arrays),
        "position": list(position),
        "orientation": list(orientation),
        "one_material": bool(moduli is not None and moduli[3]),
        "motion": motion,
    }


def describe_tool(scene: SceneTables, rank: int, folder: Path) -> dict[str, Any]:
    """Write the surface of a tool from a file into the folder; its entry of ``scene.json``."""
    (kind, lengths, vertices, triangles), law, max_stiffness, pad, settings = tool_arguments(scene, rank)
    device = scene.device_of(rank)
    arrays = None
    if kind == "surface":
        surface = {"vertices": np.array(vertices, dtype=float), "triangles": np.array(triangles, dtype=np.uint32)}
        arrays = _written(folder / f"tool-{rank}.arrays.safetensors", surface)
    return {
        "shape": {"kind": kind, "lengths": lengths, "arrays": arrays},
        "law": law,
        **settings,
        "pad_youngs_modulus": pad,
        "max_stiffness": max_stiffness,
        "max_force": device.max_force / device.force_scale,
    }


def _written(path: Path, arrays: Mapping[str, np.ndarray]) -> dict[str, str]:
    """Write arrays as safetensors (a header of JSON, then the bytes); name and checksum of the file."""
    header: dict[str, Any] = {"__metadata__": {"format": f"{FORMAT}-arrays"}}
    blocks, end = [], 0
    for name, array in arrays.items():
        block = np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<"), copy=False)
        dtype, begin, end = _TYPES[block.dtype.str[1:]], end, end + block.nbytes
        header[name] = {"dtype": dtype, "shape": list(block.shape), "data_offsets": [begin, end]}
        blocks.append(block.tobytes())
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    data = b"".join([len(text).to_bytes(8, "little"), text, *blocks])
    path.write_bytes(data)
    return {"file": path.name, "checksum": _native.checksum(data)}
