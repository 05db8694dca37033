"""Presses of a scene's tool as they were measured, computed by the scene's own law for materials that a fit tries."""

from __future__ import annotations

import math
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.errors import FitError, PalpateWarning
from palpate.fitting.measurements import Indentations
from palpate.fitting.unknowns import Unknowns
from palpate.green import precompute
from palpate.palpation.press import standing_on
from palpate.scene import BuiltBody, BuiltScene, Scene, mesh_of_body, unsolved_body
from palpate.scene.series import with_series
from palpate.simulation import Sensor, Simulation

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

# Depths of a computed press: closer together where the force begins, `(k/n)^2` of the deepest.
DEPTHS = 90
# Computed presses go deeper than measured ones by this factor, for the touch may have been earlier.
DEEPER = 1.15
# Of the tool's radius: the law of a contact ends at two, rows beyond it are left out, and so many are in another unit.
MOST_RADII = 10.0
# A place farther from the surface than this part of the tool's size is none.
FAR = 1.0


@dataclass(frozen=True)
class Curves:
    """Computed presses of a body whose first modulus is that of the scene."""

    force: tuple[PchipInterpolator, ...]  # of each curve, N by depth, m
    limit: np.ndarray  # depth of each curve, m, at which the law ends
    error: float  # largest stated error of a force


class Presses:
    """Computes presses at the measured places, each material once."""

    def __init__(self, unknowns: Unknowns, scene: Scene, measured: Indentations):
        self._unknowns, self._measured = unknowns, measured
        self._scene = _to_press(scene, measured)
        self._reference = unknowns.slots[0].material.youngs_modulus
        self._known: dict[tuple[float, ...], Curves] = {}
        self._mesh = mesh_of_body(self._scene)
        self._require_depths()
        self._folder = tempfile.TemporaryDirectory(prefix="palpate-fit-")
        self.points = self.normals = np.empty((0, 3))
        self.solved = 0

    def _require_depths(self) -> None:
        """Refuse depths far beyond the tool, or beyond the body: their unit is another one."""
        depths, tool = self._measured.depth, self._scene.tools[0]
        deepest = int(depths.argmax())
        longest = float(np.ptp(self._mesh.nodes, axis=0).max())
        limits = {
            "ten radii of the tool, which are": MOST_RADII * tool.reach,
            "the body, whose longest side is": longest,
        }
        for what, limit in limits.items():
            if 0 < limit < depths[deepest]:
                name = self._measured.names[self._measured.curve[deepest]]
                raise FitError(
                    f"{name}: a depth of {1e3 * depths[deepest]:.4g} mm is beyond {what} {1e3 * limit:.4g} mm: are the "
                    "depths in another unit (--depth-unit)?"
                )

    @property
    def has_pad(self) -> bool:
        """Whether a soft pad on the tool keeps forces from scaling with the body's modulus."""
        return self._scene.tools[0].pad_youngs_modulus is not None

    def forces(self, numbers: Mapping[str, float], offsets: np.ndarray) -> np.ndarray:
        """Return forces (n,), N, at the measured depths less the offset of each curve."""
        return self._read(numbers, offsets, 0)

    def slopes(self, numbers: Mapping[str, float], offsets: np.ndarray) -> np.ndarray:
        """Stiffness (n,), N/m, there."""
        return self._read(numbers, offsets, 1)

    def _read(self, numbers: Mapping[str, float], offsets: np.ndarray, derivative: int) -> np.ndarray:
        curves, measured = self.curves(numbers), self._measured
        out = np.zeros(len(measured.force))
        for k, force in enumerate(curves.force):
            rows = measured.curve == k
            depth = measured.depth[rows] - offsets[k]
            out[rows] = np.where(depth > 0, force(np.clip(depth, 0, None), derivative), 0.0)
        return out * math.exp(numbers["material.youngs_modulus"]) / self._reference

    def curves(self, numbers: Mapping[str, float]) -> Curves:
        """Presses of the body with these ratios, on a first modulus of the scene's."""
        scale = math.exp(numbers["material.youngs_modulus"]) / self._reference
        key = (*self._unknowns.solution_key(numbers), round(scale, 9) if self.has_pad else 1.0)
        if key not in self._known:
            self._known[key] = self._solve({**numbers, "material.youngs_modulus": math.log(self._reference)}, scale)
        return self._known[key]

    def _solve(self, numbers: Mapping[str, float], scale: float) -> Curves:
        scene = self._unknowns.scene_with(numbers)
        scene = scene.model_copy(update={"tools": self._scene.tools, "view": self._scene.view})
        if self.has_pad:
            # A body stiffer by a factor under a pad is a body as it was under a pad softer by it.
            tool = scene.tools[0]
            softer = tool.model_copy(update={"pad_youngs_modulus": tool.pad_youngs_modulus / scale})
            scene = scene.model_copy(update={"tools": [softer]})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PalpateWarning)
            body = unsolved_body(scene, 0, self._mesh)
            table = scene.bodies[0]
            area = (table.touch or scene.touch).areas(body.mesh)["touch"]
            store = Path(self._folder.name) / f"{self.solved}.palpate"
            green = precompute(body, precision=table.precision, touch=area, path=store, progress=False)
            built = BuiltScene(scene, (BuiltBody(body, green, None, table.title, table.position, table.orientation),))
            curves = self._press(with_series(built))
        for path in Path(self._folder.name).iterdir():
            path.unlink()
        self.solved += 1
        return curves

    def _press(self, built: BuiltScene) -> Curves:
        from scipy.interpolate import PchipInterpolator

        simulation = Simulation(built)
        if not len(self.points):
            self._find_places(simulation)
        orientations, reach = standing_on(simulation, self.normals)
        sensor = Sensor(simulation, len(self.points), device_limits=False)
        deepest = np.array([self._measured.depth[self._measured.curve == k].max() for k in range(len(self.points))])
        parts = DEEPER * (np.arange(DEPTHS + 1) / DEPTHS) ** 2
        force, limit, error = np.zeros((len(parts), len(self.points))), np.full(len(self.points), np.inf), 0.0
        for rank, part in enumerate([-0.05, *parts]):
            tips = self.points + (reach - part * deepest)[:, None] * self.normals
            wrenches = sensor.step(np.concatenate([tips, orientations], axis=1)[:, None])[:, 0, :3]
            if rank == 0:
                continue
            force[rank - 1] = np.einsum("ij,ij->i", wrenches, self.normals)
            contacts = sensor.contacts
            held = np.unique(contacts.copy[contacts.limited])
            limit[held] = np.minimum(limit[held], part * deepest[held])
            if part <= 1.0:
                error = max(error, float(np.nan_to_num(contacts.error).max(initial=0.0)))
        if sensor.faults:
            raise FitError(f"{self._measured.names[min(sensor.faults)]}: {sensor.faults[min(sensor.faults)]}")
        silent = force[-1] <= 0
        if silent.any():
            name = self._measured.names[int(np.argmax(silent))]
            raise FitError(f"{name}: the tool feels nothing there: is the place on the surface that may be touched?")
        splines = tuple(PchipInterpolator(d * parts, f) for d, f in zip(deepest, force.T, strict=True))
        return Curves(splines, limit, error)

    def _find_places(self, simulation: Simulation) -> None:
        """Take the closest points of the surface; without a place the one in the middle, seen along z."""
        nodes = simulation.bodies[0].points_to_scene(simulation.bodies[0].green.surface_positions)
        asked = self._measured.points
        if asked is None:
            low, high = nodes.min(axis=0), nodes.max(axis=0)
            top = [*(0.5 * (low + high))[:2], high[2]]
            asked = np.repeat([top], len(self._measured.names), axis=0)
        self.points, self.normals, distances = simulation.closest(asked)
        far = ~(np.abs(distances) <= FAR * (0.1 * np.ptp(nodes, axis=0).max()))
        if far.any():
            name = self._measured.names[int(np.argmax(far))]
            raise FitError(f"{name} lies {1e3 * abs(distances[far][0]):.3g} mm from the surface: is it in the scene?")

    def close(self) -> None:
        """Delete what was computed."""
        self._folder.cleanup()


def _to_press(scene: Scene, measured: Indentations) -> Scene:
    """Scene as it is pressed: its first tool alone, of the measured radius, without the limit of strain.

    Raises FitError for a scene that has no static law of its material alone.
    """
    if len(scene.bodies) > 1:
        raise FitError("the scene has several bodies: fit one at a time")
    body, tool = scene.bodies[0], scene.tools[0]
    if body.store is not None:
        raise FitError("a store has its material in it: name the mesh in the scene")
    if body.loads or (body.loads is None and scene.loads):
        raise FitError("a body under loads has forces of its own: leave the loads out of the scene")
    if tool.contact != "local":
        raise FitError(f"contact = '{tool.contact}' has no law of an indenter: use 'local'")
    if measured.radius is not None:
        if tool.shape not in ("sphere", "capsule", "punch"):
            raise FitError(f"the data give a radius, which a tool of shape '{tool.shape}' does not have")
        tool = tool.model_copy(update={"radius": measured.radius})
    view = scene.view.model_copy(update={"strain_limit": 0.0})
    return scene.model_copy(update={"tools": [tool], "view": view})
