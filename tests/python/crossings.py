"""Tools that go over bodies: their poses, exact first touches, and what the force loop computes on the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation
from strange_bodies import BODIES

import palpate
from palpate.scene import BuiltScene
from palpate.validation.verify.contact.loop import UNLIMITED, loop_of

UP = np.array([0.0, 0.0, 1.0])
# The page's tools for a radius of 6 mm, the reported ones, and a sphere much smaller than an element.
TOOLS: dict[str, dict[str, Any]] = {
    "sphere": {"radius": 6e-3},
    "small sphere": {"radius": 2e-3},
    "ellipsoid": {"shape": "ellipsoid", "semi_axes": (9.6e-3, 7.2e-3, 6e-3)},
    "capsule": {"shape": "capsule", "radius": 3e-3, "length": 18e-3},
    "thick capsule": {"shape": "capsule", "radius": 4e-3, "length": 14e-3},
    "punch": {"shape": "punch", "radius": 6e-3, "rounding": 1.8e-3},
    "file": {"shape": "capsule.stl", "unit": "mm"},
}
# The radius of each; of an ellipsoid the smallest semi-axis, of the file that of its capsule.
RADII = {name: table.get("radius", 6e-3) for name, table in TOOLS.items()} | {"file": 3e-3}
LYING = Rotation.from_rotvec([0.0, np.pi / 2, 0.0])


@dataclass(frozen=True)
class Loops:
    """Force loops on the bodies of a module, each body computed once."""

    folder: Path
    known: dict[str, tuple[palpate.Body, palpate.GreensFunction]]

    def body(self, name: str) -> tuple[palpate.Body, palpate.GreensFunction]:
        if name not in self.known:
            body = BODIES[name]()
            green = palpate.precompute(body, precision="f32", path=self.folder / f"{name}.palpate", progress=False)
            self.known[name] = body, green
        return self.known[name]

    def loop(
        self, body: str, tool: str, friction: float = 0.0, device: Mapping[str, Any] | None = None
    ) -> palpate.Simulation:
        """Loop of a body and a tool; without a device one that limits nothing."""
        table = {**TOOLS[tool], "friction": friction}
        if tool == "file":
            table["shape"] = str(capsule_file(self.folder))
        limits, view = (UNLIMITED, {"strain_limit": 0}) if device is None else (device, {})
        scene = palpate.Scene(body={"store": "body.palpate"}, tool=table, device=limits, view=view)
        return palpate.Simulation(BuiltScene.of(scene, *self.body(body)))


def capsule_file(folder: Path) -> Path:
    """Surface file of the capsule, in mm, its front at the origin."""
    path = folder / "capsule.stl"
    if not path.exists():
        mesh = trimesh.creation.capsule(18.0, 3.0, count=[28, 28])
        mesh.apply_translation([0.0, 0.0, -3.0 - mesh.vertices[:, 2].min()])
        mesh.export(path)
    return path


@cache
def organ(name: str) -> tuple[palpate.Body, palpate.GreensFunction]:
    """A built-in body of 10 kPa that stands on its lowest 8 mm."""
    mesh = getattr(palpate.models, name)()
    feet = mesh.nodes[:, 2].min() + 0.008
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.45), fixed=lambda x: x[:, 2] < feet)
    return body, palpate.precompute(body, precision="f32", progress=False)


def organ_forces(
    name: str, tool: Mapping[str, Any], path: np.ndarray, orientation: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
) -> np.ndarray:
    """Forces (t, 3), N, on a tool without friction that goes over an organ, its orientation w x y z not normalized."""
    turned = np.tile(np.array(orientation) / np.linalg.norm(orientation), (len(path), 1))
    return loop_of(*organ(name), [{**tool, "friction": 0.0}]).play(path, turned).computed_forces


def wxyz(rotation: Rotation) -> np.ndarray:
    return np.roll(rotation.as_quat(), 1, axis=-1)


def upright_on(normal: np.ndarray, spin: float) -> Rotation:
    """Turn that takes the tool's own axis, z, to the normal."""
    across = np.cross(normal, [1.0, 0.3, 0.2])
    across /= np.linalg.norm(across)
    frame = np.column_stack([across, np.cross(normal, across), normal])
    return Rotation.from_matrix(frame) * Rotation.from_rotvec([0.0, 0.0, spin])


def lowest(tool: str, rotation: Rotation, normal: np.ndarray) -> np.ndarray:
    """Lowest point of a tool against a normal, from its origin, m; of a side or a face that lies flat the middle."""
    given = TOOLS["capsule" if tool == "file" else tool]
    axis, shape = rotation.apply(UP), given.get("shape", "sphere")
    if shape == "ellipsoid":
        turned = rotation.as_matrix()
        squares = turned @ np.diag(np.square(given["semi_axes"])) @ turned.T
        return -squares @ normal / np.sqrt(normal @ squares @ normal)
    if shape == "punch":
        # Only upright and within the rounding of upright.
        out = normal - (axis @ normal) * axis
        size = np.linalg.norm(out)
        flat = (given["radius"] - given["rounding"]) * out / size if size > 1e-9 else 0.0 * out
        return given["rounding"] * (axis - normal) - flat
    along = axis @ normal
    middle = 0.0 if shape == "sphere" else given["length"] * (0.5 if abs(along) < 1e-9 else float(along < 0))
    return middle * axis - given["radius"] * normal


@dataclass(frozen=True)
class Played:
    """What the loop computed over a path: forces and torques on the device before the safety stage, (t, 3)."""

    path: np.ndarray
    forces: np.ndarray
    torques: np.ndarray
    recording: palpate.Recording

    @property
    def size(self) -> np.ndarray:
        return np.linalg.norm(self.forces, axis=1)


def played(simulation: palpate.Simulation, path: np.ndarray, rotation: Rotation) -> Played:
    """Play a path (t, 3), m, with one orientation, or one a tick."""
    turned = wxyz(rotation)
    recording = simulation.play(path, np.tile(turned, (len(path), 1)) if turned.ndim == 1 else turned)
    return Played(path, recording.computed_forces, recording.computed_torques, recording)


def polyline(corners: list[np.ndarray], step: float) -> np.ndarray:
    """Points (t, 3), m, along straight legs, about a step apart."""
    legs = [np.asarray(corners[0])[None]]
    for first, second in pairwise(corners):
        count = max(2, int(np.ceil(np.linalg.norm(np.subtract(second, first)) / step)))
        legs.append(first + np.linspace(0, 1, count + 1)[1:, None] * np.subtract(second, first))
    return np.vstack(legs)


def arc(start: np.ndarray, centre: np.ndarray, axis: np.ndarray, angle: float, step: float) -> np.ndarray:
    """Points (t, 3), m, from behind ``start`` round an axis, about a step apart."""
    spoke = start - centre
    count = max(2, int(np.ceil(abs(angle) * np.linalg.norm(spoke) / step)))
    return centre + Rotation.from_rotvec(np.linspace(0, angle, count + 1)[1:, None] * axis).apply(spoke)


def surface_places(green: palpate.GreensFunction, body: palpate.Body, count: int, seed: int) -> np.ndarray:
    """Random points (count, 3), m, of the free surface, as many on every part as it has area."""
    random, mesh = np.random.default_rng(seed), body.mesh
    corners = mesh.nodes[mesh.surface_triangles]
    held = np.isin(mesh.surface_triangles, body.fixed_nodes).any(axis=1)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) * ~held
    part = random.random((count, 2))
    part[part.sum(axis=1) > 1] = 1 - part[part.sum(axis=1) > 1]
    first, second, third = corners[random.choice(len(area), count, p=area / area.sum())].transpose(1, 0, 2)
    return first + part[:, :1] * (second - first) + part[:, 1:] * (third - first)
