"""A scene as one file for a page without a server: what its program reads, and what it draws."""

from __future__ import annotations

import gzip
import json
import struct
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from palpate import _native
from palpate._native import TOOL_SETTINGS
from palpate.errors import ViewerError
from palpate.scene import BuiltScene
from palpate.scene.series import with_whole_series
from palpate.scene.tables import SceneTables
from palpate.simulation.about import recorded_tables
from palpate.simulation.packed import SCENE_FILE, describe, describe_tool
from palpate.viewer.fields import DISPLACEMENT, SURFACE_STRAIN
from palpate.viewer.messages import decode, encode, numbered
from palpate.viewer.session import Session
from palpate.viewer.shown_body import ShownBody, title_of
from palpate.viewer.tool_shapes import kind_of, outline, shape_choices, with_shape

# Fields that the program of the page computes: those of the surface alone.
OFFERED = (DISPLACEMENT, SURFACE_STRAIN)
# Nodes inside of a body follow so many nodes of its surface where it is cut open.
FOLLOWED = 12


def packed_page(built: BuiltScene, name: str) -> bytes:
    """Return the file of a scene, called ``name`` in the page: a header of JSON, then the parts, compressed.

    Of each store only the part that contacts and pictures read is taken, with the same numbers: forces are those of the
    store to the bit. Raises ViewerError for a scene that a device moves.
    """
    if any(built.scene.device_of(tool).kind != "simulated" for tool in range(len(built.scene.tools))):
        raise ViewerError("a page without a server has no devices: give its tools the kind 'simulated'")
    # The page and its recordings have the series as a whole.
    session = Session(with_whole_series(built, True))
    files = {"page/scene.bin": _scene(session, name), "page/page.bin": _page(session, name), **_program_files(session)}
    header = json.dumps([{"name": name, "size": len(data)} for name, data in files.items()]).encode()
    parts = [struct.pack("<I", len(header)) + header, *files.values()]
    return gzip.compress(b"".join(part + b"\0" * (-len(part) % 8) for part in parts), 9, mtime=0)


def _program_files(session: Session) -> dict[str, bytes]:
    """Files of a packed scene without the inside of its bodies, by name."""
    others = [scene for tool in range(len(session.own_tools)) for scene in _with_other_shapes(session, tool).values()]
    with tempfile.TemporaryDirectory() as where:
        folder = Path(where)
        description = describe(session.built, folder, False, others)
        files = {SCENE_FILE: json.dumps(description, allow_nan=False).encode()}
        for path in sorted(folder.iterdir()):
            store = next((one for one in description["bodies"] if one["store"]["file"] == path.name), None)
            files[path.name] = path.read_bytes() if store is None else _native.GreenCore.load(path).packed()
    return files


def _scene(session: Session, name: str) -> bytes:
    """Scene message, with what this page offers."""
    header, arrays = decode(session.scene_message())
    del header["arrays"]
    header["name"], header["title"] = name, title_of(name)
    names = {field.name for field in OFFERED}
    for body in header["bodies"]:
        body["server_fields"] = [field for field in body["fields"] if field["name"] not in names]
        body["fields"] = [{"name": field.name, "title": field.title} for field in OFFERED]
    return encode(header, {name: (array.dtype.str[1:], array) for name, array in arrays.items()})


def _page(session: Session, name: str) -> bytes:
    """Return what the worker knows beside the scene message."""
    built, tools = session.built, len(session.built.scene.tools)
    about = session.simulation._about((tools, tools == 1), clock=True)
    header = {
        "version": about["version"],
        "name": name,
        "about": {**about, "strain": "surface"},
        "settings": session.settings(),
        "centre": session._centre.tolist(),
        "size": session.size,
        "shapes": [_other_shapes(session, tool) for tool in range(tools)],
        "max_radii": [float(radius) for radius in session._max_radii],
        "bodies": [_body(session, rank) for rank in range(len(built.bodies))],
        "motion": _motion(session),
    }
    return encode(header, numbered([_arrays(shown) for shown in session._bodies]))


def _with_other_shapes(session: Session, tool: int) -> dict[str, SceneTables]:
    """Scenes in which a tool has another shape that it may take, by the name of the shape."""
    scene, own = session.built.scene, session.own_tools[tool]
    names = [choice["name"] for choice in shape_choices(own) if choice["name"] != kind_of(own)]
    tables = {name: with_shape(own, name, scene.folder) for name in names}
    before, after = scene.tools[:tool], scene.tools[tool + 1 :]
    return {name: scene.model_copy(update={"tools": [*before, one, *after]}) for name, one in tables.items()}


def _other_shapes(session: Session, tool: int) -> dict[str, Any]:
    """Shapes that a tool may take in place of its own: each for the loop, for the scene message and for recordings."""
    found = {}
    for name, scene in _with_other_shapes(session, tool).items():
        table = scene.tools[tool]
        found[name] = {
            "description": describe_tool(scene, tool, scene.folder),
            "entry": {**outline(table, scene.folder)[0], **{key: getattr(table, key) for key in TOOL_SETTINGS}},
            "table": recorded_tables(scene)["tool"][tool],
        }
    return found


def _body(session: Session, rank: int) -> dict[str, Any]:
    built = session.built.bodies[rank]
    _, nodes_per_face = built.green._core.surface_faces
    return {
        "size": float(built.green.extents.max()),
        "nodes_per_face": nodes_per_face,
        "position": list(built.position),
        "orientation": list(built.orientation),
    }


def _motion(session: Session) -> dict[str, Any] | None:
    moving = session._moving
    if moving is None:
        return None
    return {
        "body": moving.index,
        "watched": moving.frame_header()["watched"],
        "duration": moving._duration,
        "max_impulse": moving.max_impulse,
        "strike": moving.header()["strike"],
    }


def _arrays(shown: ShownBody) -> dict[str, tuple[str, np.ndarray]]:
    green = shown.built.green
    faces, _ = green._core.surface_faces
    inner, rows, weights = _inside(shown)
    return {
        "positions": ("f4", green.surface_positions.ravel()),
        "faces": ("u4", np.asarray(faces).ravel()),
        "drawn": ("u4", shown.drawn.nodes),
        "surface_nodes": ("u4", green.surface_nodes),
        "inner_nodes": ("u4", inner),
        "inner_rows": ("u4", rows.ravel()),
        "inner_weights": ("f4", weights.ravel()),
    }


def _inside(shown: ShownBody) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes inside of a body (i,), rows of the surface nodes that each follows (i, k), and its weights (i, k).

    A page knows no factor of the inside. Where a body is cut open, its nodes move by the mean of the surface nodes
    around them, weighed by the inverse square of the distance: for the eye, not for a measurement.
    """
    from scipy.spatial import cKDTree

    body, green = shown.built.body, shown.built.green
    if body is None or not green.follows_inside or not shown.drawn.is_whole:
        none = np.zeros(0)
        return none, none, none
    inner = np.setdiff1d(np.arange(len(body.mesh.nodes)), green.surface_nodes)
    distance, rows = cKDTree(green.surface_positions).query(body.mesh.nodes[inner], k=FOLLOWED)
    weights = 1.0 / np.maximum(distance, 1e-9) ** 2
    return inner, rows, weights / weights.sum(axis=1, keepdims=True)
