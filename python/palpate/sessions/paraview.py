"""A recording as a time series for ParaView: a .pvd that lists a .vtu for each body, and one for the tools, a frame."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh

from palpate.atomic import folder_beside, written_beside
from palpate.errors import Error
from palpate.sessions.frames import RecordedFrame, RecordedFrames
from palpate.sessions.shapes import tools_of
from palpate.sessions.tables import Report
from palpate.simulation import BodyFrame
from palpate.vectors import rotated

OURS = re.compile(r"(body\d+|tools)_\d{6}\.vtu")


def frames_folder(path: Path) -> Path:
    """Folder of the frames beside a .pvd; Error if there is one, with other files in it."""
    folder = path.with_name(f"{path.stem}_frames")
    if folder.exists() and not (folder.is_dir() and all(OURS.fullmatch(file.name) for file in folder.iterdir())):
        raise Error(f"{folder}: exists and contains other files than frames: give another --out, or move it")
    return folder


def write_pvd(frames: RecordedFrames, path: Path, report: Report = None) -> None:
    """Write frames; the list appears when all of them are there."""
    import meshio

    folder = frames_folder(path)
    tools = tools_of(frames.simulation)
    listed = []
    with folder_beside(folder) as partial:
        for rank, recorded in enumerate(frames):
            meshes = [(f"body{k}", body_mesh(body)) for k, body in enumerate(recorded.frame.bodies)]
            meshes.append(("tools", tools_mesh(recorded, tools)))
            for part, (name, mesh) in enumerate(meshes):
                file = f"{name}_{rank:06d}.vtu"
                meshio.write(partial / file, mesh, "vtu")
                listed.append((recorded.time, part, name, f"{folder.name}/{file}"))
            if report is not None:
                report(rank + 1, len(frames))
    with written_beside(path) as partial:
        _collection(listed).write(partial, xml_declaration=True, encoding="utf-8")


def body_mesh(body: BodyFrame):
    """Deformed surface of a body in the scene, with its displacement, m, at the nodes."""
    import meshio

    surface = body.surface_in_scene()
    places = surface.positions + surface.displacements
    return meshio.Mesh(places, [("triangle", surface.triangles)], point_data={"displacement": surface.displacements})


def tools_mesh(recorded: RecordedFrame, shapes: list[trimesh.Trimesh]):
    """Tips of the tools as single points that carry their vectors, and the surfaces around them, which carry zeros.

    So a glyph draws one arrow a tool. One that is out of the scene is drawn in to its tip.
    """
    import meshio

    frame, count = recorded.frame, len(shapes)
    tips = np.nan_to_num(frame.positions)
    points, triangles = [tips], []
    start = count
    for tool, shape in enumerate(shapes):
        turned = rotated(shape.vertices * bool(recorded.present[tool]), tuple(frame.orientations[tool]))
        points.append(turned + tips[tool])
        triangles.append(start + np.asarray(shape.faces))
        start += len(shape.vertices)
    data = {"force": np.zeros((start, 3)), "torque": np.zeros((start, 3)), "in_scene": np.zeros(start, dtype=np.int64)}
    data["force"][:count], data["torque"][:count] = frame.forces, frame.torques
    owner = np.repeat(np.arange(count), [len(shape.vertices) for shape in shapes])
    data["tool"] = np.concatenate([np.arange(count), owner])
    data["in_scene"] = recorded.present[data["tool"]].astype(np.int64)
    cells = [("vertex", np.arange(count)[:, None]), ("triangle", np.vstack(triangles))]
    return meshio.Mesh(np.vstack(points), cells, point_data=data)


def _collection(listed: list[tuple[float, int, str, str]]) -> ElementTree.ElementTree:
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = ElementTree.SubElement(root, "Collection")
    for time, part, name, file in listed:
        entry = {"timestep": repr(time), "group": "", "part": str(part), "name": name, "file": file}
        ElementTree.SubElement(collection, "DataSet", entry)
    tree = ElementTree.ElementTree(root)
    ElementTree.indent(tree)
    return tree
