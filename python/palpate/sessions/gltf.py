"""A recording as an animated GLB: bodies by morph targets, tools and forces by moving nodes.

Displacements of a session lie in a space of few dimensions, for contacts are few and displacements are linear in their
forces. So a body has one morph target for each direction of that space, and each frame the weights of all: what a frame
displaces beyond the directions found so far by more than a tolerance gives the next one (Gram-Schmidt). Normals are not
linear in displacements; those of the targets are the best fit over all frames.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from palpate.atomic import written_beside
from palpate.errors import Error
from palpate.sessions.frames import RecordedFrames
from palpate.sessions.shapes import arrow, arrow_scale, longest_side, tools_of
from palpate.sessions.tables import Report
from palpate.vectors import turning_z_to

# Displacements that are lost, over the longest side of the bodies: far below what is seen.
TOLERANCE = 1e-4
# Base colours, red green blue in linear light, and roughness.
BODY, TOOLS, FORCE = ((0.62, 0.24, 0.18), 0.55), ((0.25, 0.32, 0.42), 0.4), ((0.85, 0.45, 0.02), 0.6)
# glTF has y up, scenes have z: a quarter turn about x, as x y z w.
UPRIGHT = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
# glTF's numbers of the types of buffers.
VERTICES, INDICES, FLOAT, UINT = 34962, 34963, 5126, 5125


class Directions:
    """Orthonormal directions (k, n) that span given rows (t, n) to a tolerance, and their weights, found row by row."""

    def __init__(self, size: int, tolerance: float):
        self._basis, self._tolerance = np.zeros((0, size)), tolerance
        self._weights: list[np.ndarray] = []

    def add(self, row: np.ndarray) -> None:
        """One more row (n,)."""
        weights = self._basis @ row
        rest = row - weights @ self._basis
        again = self._basis @ rest  # twice is enough to be orthogonal to rounding
        rest, weights = rest - again @ self._basis, weights + again
        if np.abs(rest).max(initial=0.0) > self._tolerance:
            size = float(np.linalg.norm(rest))
            self._basis = np.vstack([self._basis, rest / size])
            weights = np.append(weights, size)
        self._weights.append(weights)

    def targets(self) -> tuple[np.ndarray, np.ndarray]:
        """Targets (k, n) and weights (t, k) of at most one in magnitude, as sliders of other programs have them."""
        count = len(self._basis)
        weights = np.zeros((len(self._weights), count))
        for padded, row in zip(weights, self._weights, strict=True):
            padded[: len(row)] = row
        largest = np.abs(weights).max(axis=0, initial=np.finfo(float).tiny)
        return self._basis * largest[:, None], weights / largest


def write_glb(frames: RecordedFrames, path: Path, report: Report = None) -> None:
    """Write frames as one animation; Error if pygltflib is not installed."""
    try:
        import pygltflib  # noqa: F401  asked for before the work
    except ImportError:
        raise Error("GLB needs pygltflib: pip install 'palpate[export]'") from None
    motion = _Motion(frames, report)
    document = _Document(motion.times)
    for body, (surface, directions) in enumerate(zip(motion.surfaces, motion.directions, strict=True)):
        document.add_body(frames.simulation.bodies[body].name, surface, *directions.targets())
    shapes, pointer = tools_of(frames.simulation), arrow()
    for tool, shape in enumerate(shapes):
        moved = {name: values[:, tool] for name, values in motion.tools.items()}
        scale = np.repeat(moved["present"][:, None], 3, axis=1).astype(float)
        tracks = {"translation": moved["positions"], "rotation": moved["orientations"]}
        document.add_moving(f"tool {tool}", shape, TOOLS, tracks | {"scale": scale})
        force = moved["forces"] * arrow_scale(frames.simulation, frames.recording.forces)
        length = np.linalg.norm(force, axis=1)
        turns = turning_z_to(force)
        tracks = {"translation": moved["positions"], "rotation": turns, "scale": np.repeat(length[:, None], 3, axis=1)}
        document.add_moving(f"force {tool}", pointer, FORCE, tracks)
    with written_beside(path) as partial:
        document.write(partial)


class _Motion:
    """What moves over the frames."""

    def __init__(self, frames: RecordedFrames, report: Report):
        tolerance = TOLERANCE * longest_side(frames.simulation)
        self.surfaces: list[trimesh.Trimesh] = []
        self.directions: list[Directions] = []
        rows: dict[str, list[np.ndarray]] = {name: [] for name in ("positions", "orientations", "forces", "present")}
        times = []
        for rank, recorded in enumerate(frames):
            drawn = [body.surface_in_scene() for body in recorded.frame.bodies]
            if not self.surfaces:
                self.surfaces = [trimesh.Trimesh(one.positions, one.triangles, process=False) for one in drawn]
                self.directions = [Directions(one.displacements.size, tolerance) for one in drawn]
            for directions, one in zip(self.directions, drawn, strict=True):
                directions.add(one.displacements.ravel())
            for name in ("positions", "orientations", "forces"):
                rows[name].append(np.nan_to_num(getattr(recorded.frame, name)))
            rows["present"].append(recorded.present)
            times.append(recorded.time)
            if report is not None:
                report(rank + 1, len(frames))
        self.tools = {name: np.array(values) for name, values in rows.items()}
        self.times = np.array(times) - times[0]


def fitted_normals(surface: trimesh.Trimesh, targets: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Change of the normals (k, n, 3) with each weight, as the best fit over all frames."""
    rest, products = surface.vertex_normals, np.zeros((len(targets), 3 * len(surface.vertices)))
    for row in weights:
        moved = surface.vertices + (row @ targets).reshape(-1, 3)
        normals = trimesh.Trimesh(moved, surface.faces, process=False).vertex_normals
        products += np.outer(row, (normals - rest).ravel())
    return (np.linalg.pinv(weights.T @ weights) @ products).reshape(len(targets), -1, 3)


class _Document:
    """A glTF document under construction, with one animation."""

    def __init__(self, times: np.ndarray):
        import pygltflib

        self._kinds: Any = pygltflib
        root = pygltflib.Node(name="scene", rotation=UPRIGHT, children=[])
        self._document = pygltflib.GLTF2(
            asset=pygltflib.Asset(version="2.0", generator="palpate"), scene=0, scenes=[pygltflib.Scene(nodes=[0])]
        )
        self._document.nodes, self._root = [root], root
        self._document.animations = [pygltflib.Animation(name="session", samplers=[], channels=[])]
        self._bytes = bytearray()
        self._times = self._accessor(times, "SCALAR", bounds=True)

    def add_body(self, name: str, surface: trimesh.Trimesh, targets: np.ndarray, weights: np.ndarray) -> None:
        """Surface (n points) that moves by targets (k, 3 n), m, with weights (t, k)."""
        node = self._node(name, surface, BODY)
        if len(targets) == 0:
            return
        primitive = self._document.meshes[node.mesh].primitives[0]
        normals = fitted_normals(surface, targets, weights)
        for target, turned in zip(targets.reshape(len(targets), -1, 3), normals, strict=True):
            places, turns = self._accessor(target, "VEC3", VERTICES, True), self._accessor(turned, "VEC3", VERTICES)
            primitive.targets.append({"POSITION": places, "NORMAL": turns})
        self._document.meshes[node.mesh].weights = [0.0] * len(targets)
        self._animate(node, "weights", weights.ravel(), "SCALAR")

    def add_moving(self, name: str, surface: trimesh.Trimesh, look: tuple, tracks: dict[str, np.ndarray]) -> None:
        """Surface that moves as a whole: ``translation``, ``rotation`` (w x y z) and ``scale`` over the frames."""
        node = self._node(name, surface, look)
        for path, values in tracks.items():
            if path == "rotation":
                self._animate(node, path, _continuous(values)[:, [1, 2, 3, 0]], "VEC4")
            else:
                self._animate(node, path, values, "VEC3")

    def write(self, path: Path) -> None:
        self._document.buffers = [self._kinds.Buffer(byteLength=len(self._bytes))]
        self._document.set_binary_blob(bytes(self._bytes))
        self._document.save_binary(path)

    def _node(self, name: str, surface: trimesh.Trimesh, look: tuple) -> Any:
        gl, document = self._kinds, self._document
        color, roughness = look
        attributes = gl.Attributes(
            POSITION=self._accessor(surface.vertices, "VEC3", VERTICES, True),
            NORMAL=self._accessor(surface.vertex_normals, "VEC3", VERTICES),
        )
        indices = self._accessor(surface.faces.ravel(), "SCALAR", INDICES)
        primitive = gl.Primitive(attributes=attributes, indices=indices, material=len(document.materials), targets=[])
        surface_look = gl.PbrMetallicRoughness(
            baseColorFactor=[*color, 1.0], metallicFactor=0.0, roughnessFactor=roughness
        )
        document.materials.append(gl.Material(name=name, pbrMetallicRoughness=surface_look, alphaCutoff=None))
        document.meshes.append(gl.Mesh(name=name, primitives=[primitive], weights=[]))
        node = gl.Node(name=name, mesh=len(document.meshes) - 1)
        self._root.children.append(len(document.nodes))
        document.nodes.append(node)
        return node

    def _animate(self, node: Any, path: str, values: np.ndarray, kind: str) -> None:
        gl, animation = self._kinds, self._document.animations[0]
        output = self._accessor(values, kind)
        animation.samplers.append(gl.AnimationSampler(input=self._times, output=output, interpolation="LINEAR"))
        target = gl.AnimationChannelTarget(node=self._document.nodes.index(node), path=path)
        animation.channels.append(gl.AnimationChannel(sampler=len(animation.samplers) - 1, target=target))

    def _accessor(self, values: np.ndarray, kind: str, target: int | None = None, bounds: bool = False) -> int:
        """Put values into the buffer, as floats or as indices, and give their number."""
        gl, document = self._kinds, self._document
        dtype, component = (np.uint32, UINT) if target == INDICES else (np.float32, FLOAT)
        data = np.ascontiguousarray(values, dtype=dtype)
        document.bufferViews.append(
            gl.BufferView(buffer=0, byteOffset=len(self._bytes), byteLength=data.nbytes, target=target)
        )
        self._bytes += data.tobytes()
        entry = gl.Accessor(
            bufferView=len(document.bufferViews) - 1, componentType=component, count=len(data), type=kind
        )
        if bounds:
            rows = data.reshape(len(data), -1)
            entry.min, entry.max = rows.min(axis=0).tolist(), rows.max(axis=0).tolist()
        document.accessors.append(entry)
        return len(document.accessors) - 1


def _continuous(quaternions: np.ndarray) -> np.ndarray:
    """Of the two signs of each rotation the one nearer to that before it, so that none turns the long way round."""
    signs = np.sign((quaternions[1:] * quaternions[:-1]).sum(axis=1))
    signs[signs == 0] = 1.0
    return quaternions * np.concatenate([[1.0], np.cumprod(signs)])[:, None]
