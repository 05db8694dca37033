"""Contact as a sensor of a robot simulator: copies of a scene, stepped together by poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate import _native, units
from palpate.equality import ComparedByValue
from palpate.errors import SceneError
from palpate.scene import BuiltScene, Scene, ToolTable
from palpate.scene.tables import SceneTables
from palpate.simulation.script import require_unit_length
from palpate.simulation.simulation import Simulation
from palpate.units import brief_repr, count_text
from palpate.vectors import number_array

POSE, WRENCH, CONTACT = 7, 6, 21
MOST_COPIES = 65_536
MOST_TAXELS = 256


@dataclass(frozen=True, eq=False, repr=False)
class SensorContacts(ComparedByValue):
    """All contacts of the copies after a step, one a row, in the world. Compared by value; not hashable.

    Attributes
    ----------
    copy, tool, body
        (k,) numbers of the copy, the tool and the body.
    point, normal
        (k, 3) contact point on the untouched surface, m, and outward normal of the body there.
    force, torque
        (k, 3) on the body, N, and about the tip of the tool, N m: those on the tool are the opposite.
    slipping, limited
        (k,) whether the contact slips, and whether the limit of strain holds the tool back.
    radius, depth, stiffness
        (k,) contact radius, m, approach, m, and stiffness along the normal, N/m; 0 unless the law is ``local``.
    error
        (k,) estimated relative error of the force; NaN where none is stated, as for a linear material.

    """

    copy: np.ndarray
    tool: np.ndarray
    body: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    torque: np.ndarray
    slipping: np.ndarray
    limited: np.ndarray
    radius: np.ndarray
    depth: np.ndarray
    stiffness: np.ndarray
    error: np.ndarray

    def __len__(self) -> int:
        return len(self.copy)

    def __repr__(self) -> str:
        return f"SensorContacts({len(self)} contacts of {len(np.unique(self.copy))} copies)"


class Sensor:
    """Copies of a scene whose tools a program moves: poses in, wrenches out.

    No thread and no clock: :meth:`step` makes one tick of every copy, on all processors (``RAYON_NUM_THREADS`` limits
    them). The same poses give the same bits as :meth:`palpate.Simulation.run`, whatever the number of copies and
    threads. Copies share what was prepared of the scene; each has contacts, motions and limits of its own.

    Parameters
    ----------
    scene
        What the tools touch; or a simulation, whose settings the copies take as they are.
    count
        Number of copies.
    taxels
        Rows and columns of the grid on which :attr:`pressures` are reported; None for none. It needs tools with
        ``contact = "local"``.
    taxel_size
        Width and height of that grid, m or with a unit; by default those of each tool.
    device_limits
        Whether wrenches pass ramp, slew limit and largest force of ``scene.device``, as forces of a simulation do.
        Without these limits they are those of the contacts, from the first step on.

    Raises
    ------
    SceneError
        A count, a grid or a size that is out of range, or taxels of a tool whose law has no pressures.
    Error
        As of :class:`palpate.Simulation`.

    """

    def __init__(
        self,
        scene: Scene | BuiltScene | Simulation,
        count: int = 1,
        *,
        taxels: tuple[int, int] | None = None,
        taxel_size: float | str | Sequence[float | str] | None = None,
        device_limits: bool = True,
    ):
        self._count = _whole(count, "count", MOST_COPIES)
        self._taxels = None if taxels is None else _grid(taxels)
        simulation = scene if isinstance(scene, Simulation) else Simulation(scene)
        self._scene = simulation.scene
        sides = None
        if self._taxels is not None:
            sides = (*self._taxels, _taxel_sides(self._scene, _sides(taxel_size)))
        simulation._prepare_script()
        self._core = _native.SensorCore(simulation._core, self._count, bool(device_limits), sides)
        self._raw: dict[str, Any] | None = None

    def __repr__(self) -> str:
        return f"Sensor({self._scene.name}, {self._count} copies, {count_text(self.tools, 'tool')})"

    @property
    def count(self) -> int:
        """Number of copies."""
        return self._count

    @property
    def tools(self) -> int:
        """Number of tools of each copy."""
        return len(self._scene.tools)

    def step(self, poses: np.ndarray, dt: float | str | None = None) -> np.ndarray:
        """Put the tools where they are now, and compute their wrenches.

        Parameters
        ----------
        poses
            (count, tools, 7): position of the tip, m, and orientation, a unit quaternion w x y z, in the world. (7,)
            and (tools, 7) stand for one copy, (count, 7) for one tool. A position of NaN takes the tool out of the
            scene.
        dt
            Time since the last step, s; by default a tick of the scene's loop, 1 ms.

        Returns
        -------
        numpy.ndarray
            (count, tools, 6): force, N, and torque about the tip, N m, on each tool, in the world.

        Raises
        ------
        SceneError
            Another shape, an infinite position, a quaternion that is not of length one, or a time that is not positive.

        """
        period = 1.0 / self._scene.device.rate if dt is None else units.time(dt)
        if not (0.0 < period < 1.0):
            raise SceneError(f"dt must lie between 0 and 1 s, got {period:g}")
        self._raw = self._core.step(self._poses(poses), period)
        return self._raw["wrenches"].reshape(self._count, self.tools, WRENCH)

    def reset(self, copies: Sequence[int] | np.ndarray | None = None) -> None:
        """Begin copies anew with their next step: no contacts, bodies at rest, faults cleared.

        Parameters
        ----------
        copies
            Their numbers, or a mask (count,); None for all.

        Raises
        ------
        SceneError
            Numbers that there are not.

        """
        chosen = np.arange(self._count) if copies is None else np.atleast_1d(np.asarray(copies))
        if chosen.dtype == bool:
            if chosen.shape != (self._count,):
                raise SceneError(f"a mask of copies must have shape ({self._count},), got {chosen.shape}")
            chosen = np.flatnonzero(chosen)
        if chosen.size and (chosen.dtype.kind not in "iu" or chosen.min() < 0 or chosen.max() >= self._count):
            raise SceneError(f"copies must be numbers from 0 to {self._count - 1}, got {brief_repr(copies)}")
        self._core.reset(chosen.astype(int).tolist())

    @property
    def contacts(self) -> SensorContacts:
        """All contacts after the last step."""
        rows = np.empty((0, CONTACT)) if self._raw is None else self._raw["contacts"].reshape(-1, CONTACT)
        numbers = (rows[:, k].astype(int) for k in range(3))
        vectors = (rows[:, 9 + 3 * k : 12 + 3 * k] for k in range(4))
        flags = (rows[:, k] != 0.0 for k in (3, 4))
        error = np.where(rows[:, 8] > 0.0, rows[:, 8], np.nan)
        return SensorContacts(*numbers, *vectors, *flags, rows[:, 5], rows[:, 6], rows[:, 7], error)

    @property
    def pressures(self) -> np.ndarray:
        """(count, tools, rows, columns) Pa: normal force on each taxel after the last step, over its area.

        The taxels lie in the plane z = 0 of the tool's frame, rows along y and columns along x, both ascending. They
        look along -z. A tool that faces the surface reads the contact pressure; one that is inclined reads the force
        over the area of the surface as seen along z. Contacts on its back, or inclined by more than 84 degrees, are not
        seen.
        """
        if self._taxels is None:
            raise SceneError("the sensor has no taxels: give it taxels=(rows, columns)")
        shape = (self._count, self.tools, *self._taxels)
        return np.zeros(shape) if self._raw is None else self._raw["pressures"].reshape(shape)

    @property
    def net_forces_w(self) -> np.ndarray:
        """(count, tools, 3) N: sum of the contact forces on each tool, in the world; the name is Isaac Lab's."""
        contacts, forces = self.contacts, np.zeros((self._count, self.tools, 3))
        np.subtract.at(forces, (contacts.copy, contacts.tool), contacts.force)
        return forces

    @property
    def contact_pos_w(self) -> np.ndarray:
        """(count, tools, 3) m: mean of each tool's contact points, weighted by force; NaN without a contact."""
        contacts = self.contacts
        weights, points = np.zeros((self._count, self.tools)), np.zeros((self._count, self.tools, 3))
        size = np.linalg.norm(contacts.force, axis=1)
        np.add.at(weights, (contacts.copy, contacts.tool), size)
        np.add.at(points, (contacts.copy, contacts.tool), size[:, None] * contacts.point)
        with np.errstate(invalid="ignore", divide="ignore"):
            return points / weights[:, :, None]

    @property
    def faults(self) -> dict[int, str]:
        """Copies whose wrenches are zero because of a fault, with its reason; :meth:`reset` clears it."""
        return {} if self._raw is None else dict(self._raw["faults"])

    def _poses(self, poses: np.ndarray) -> np.ndarray:
        shape = (self._count, self.tools, POSE)
        given = number_array(poses, "poses", SceneError)
        alone = (self._count == 1 and given.shape == shape[1:]) or (self.tools == 1 and given.shape == shape[::2])
        if alone or (given.shape == (POSE,) and shape[:2] == (1, 1)):
            given = given.reshape(shape)
        if given.shape != shape:
            raise SceneError(f"poses must have shape {shape}, got {given.shape}")
        infinite = np.argwhere(np.isinf(given[..., :3]).any(axis=2))
        if len(infinite):
            copy, tool = infinite[0]
            raise SceneError(
                f"the position of tool {tool} of copy {copy} is infinite; NaN takes a tool out of the scene"
            )
        present = np.isfinite(given[..., :3]).all(axis=2)
        require_unit_length(given[..., 3:], present, "of copy")
        return given


def _whole(value: Any, what: str, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not 1 <= value <= most:
        raise SceneError(f"{what} must be a whole number from 1 to {most}, got {brief_repr(value)}")
    return int(value)


def _grid(taxels: Any) -> tuple[int, int]:
    if not isinstance(taxels, (tuple, list)) or len(taxels) != 2:
        raise SceneError(f"taxels must be a pair of rows and columns, got {brief_repr(taxels)}")
    rows, columns = (_whole(number, "a number of taxels", MOST_TAXELS) for number in taxels)
    return rows, columns


def _sides(size: Any) -> tuple[float, float] | None:
    if size is None:
        return None
    pair = size if isinstance(size, (tuple, list, np.ndarray)) else (size, size)
    sides = tuple(units.length(side) for side in pair)
    if len(sides) != 2 or not all(np.isfinite(side) and side > 0 for side in sides):
        raise SceneError(f"taxel_size must be one or two positive lengths, got {brief_repr(size)}")
    return sides


def _taxel_sides(scene: SceneTables, sides: tuple[float, float] | None) -> list[tuple[float, float]]:
    """Width along x and height along y of the grid of each tool, m: those given, or as large as the tool seen along z.

    Raises SceneError for a tool whose law has no pressures.
    """
    for rank, tool in enumerate(scene.tools):
        if tool.contact != "local":
            raise SceneError(
                f"taxels need pressures, which contact = '{tool.contact}' of tool {rank} has not: give it 'local'"
            )
    return [sides or _width_of(tool, scene) for tool in scene.tools]


def _width_of(tool: ToolTable, scene: SceneTables) -> tuple[float, float]:
    kind, lengths, vertices, _ = tool.shape_arguments(scene.folder)
    if kind == "surface":
        width, height = 2.0 * np.abs(np.array(vertices)[:, :2]).max(axis=0)
        return float(width), float(height)
    return 2.0 * lengths[0], 2.0 * lengths[1 if kind == "ellipsoid" else 0]
