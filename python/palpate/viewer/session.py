"""What the viewer shows and does, without sockets: the running simulation, its commands, its messages."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.errors import ViewerError
from palpate.mesh.elements import drawing_tets
from palpate.scene import BuiltScene
from palpate.simulation import Frame, LimitedTool, Simulation
from palpate.viewer.fields import Fields
from palpate.viewer.messages import encode, number, vector
from palpate.viewer.motion import HISTORY_COLUMNS, MovingBody, history

# The contact radius slider ends at this part of the body's longest side.
LARGEST_RADIUS = 0.12
# Tool targets farther than this many body sizes from the body are refused.
REACH = 10.0
# Rows of the 1 kHz log kept for slow clients, and at most sent with a frame.
LOG_KEPT = 4000
LOG_SENT = 64
# A frame younger than this serves all clients, s.
FRAME_AGE = 0.008


@dataclass(frozen=True)
class Wants:
    """What a client looks at: a field by name, and whether it sees the inside."""

    field: str = ""
    cutaway: bool = False


class Session:
    """One running scene.

    Parameters
    ----------
    built
        Scene with its Green's function.

    """

    def __init__(self, built: BuiltScene):
        self.built = built
        green = built.green
        self._positions = green.surface_positions
        self._triangles = np.searchsorted(green.surface_nodes, green.surface_triangles)
        low, high = self._positions.min(axis=0), self._positions.max(axis=0)
        self._centre, self.size = 0.5 * (low + high), float((high - low).max())
        self.simulation = Simulation(built)
        self._fields = Fields(self.simulation, self.size)
        self._tool = LimitedTool(self.simulation, built.scene.view.strain_limit)
        self._max_radius = max(
            self.simulation.largest_contact_radius(LARGEST_RADIUS * self.size), built.scene.tool.contact_radius
        )
        self._moving = None if built.motion is None else MovingBody(self.simulation, built, self.size)
        self._log, self._history = _Tail(3), _Tail(HISTORY_COLUMNS)
        self._body_time = 0.0
        self._frame: Frame | None = None
        self._frame_time = 0.0
        self.active = False
        self.simulation.start()

    def close(self) -> None:
        """Stop the loop."""
        self.simulation.stop()

    def settings(self) -> dict[str, Any]:
        """Message with what the sliders show."""
        return {
            "type": "settings",
            "youngs_modulus": self.simulation.youngs_modulus,
            "contact_radius": self.simulation.contact_radius,
            "time_scale": None if self._moving is None else self._moving.time_scale,
        }

    def release(self) -> None:
        """Take the tool out of the scene."""
        if self.active:
            self._tool.remove()
            self.active = False

    def handle(self, message: Mapping[str, Any]) -> bool:
        """Do what a controlling client says. Returns whether settings changed.

        Raises
        ------
        Error
            A message that makes no sense, or a value that is refused.

        """
        handlers: dict[str, Callable[[Mapping[str, Any]], bool]] = {
            "press": self._press,
            "release": self._release,
            "set": self._set,
            "reset": self._reset,
            "strike": self._strike,
            "repeat": self._repeat,
            "mode": self._mode,
        }
        handler = handlers.get(message["type"])
        if handler is None:
            raise ViewerError(f"unknown message '{message['type'][:40]}'")
        return handler(message)

    def scene_message(self) -> bytes:
        """Geometry and numbers of the scene."""
        green, scene, body = self.built.green, self.built.scene, self.built.body
        if body is None:  # from a store, which knows only the surface
            nodes, tets, count = np.zeros((int(green.surface_nodes.max()) + 1, 3)), np.zeros((0, 4)), 0
            nodes[green.surface_nodes] = self._positions
            fixed = np.intersect1d(green.fixed_nodes, green.surface_nodes)
        else:
            nodes, tets, fixed = body.mesh.nodes, drawing_tets(body.mesh.tets), green.fixed_nodes
            count = len(body.mesh.tets)
        view = scene.view
        header = {
            "type": "scene",
            "name": scene.name,
            "title": scene.name.replace("_", " ").capitalize(),
            "nodes": len(nodes),
            "tets": count,
            "surface_nodes": len(green.surface_nodes),
            "triangles": len(self._triangles),
            "youngs_modulus": self.simulation.youngs_modulus,
            "poissons_ratio": None if body is None else scene.material.poissons_ratio,
            "contact_radius": self.simulation.contact_radius,
            "max_contact_radius": self._max_radius,
            "tool_radius": scene.tool.radius,
            "max_force": scene.device.max_force,
            "size": self.size,
            "hold_strain": view.strain_limit,
            "fields": [{"name": field.name, "title": field.title} for field in self._fields.offered],
            "motion": None if self._moving is None else self._moving.header(),
            "view": {"position": view.position, "target": view.target} if view.position and view.target else None,
        }
        arrays = {
            "nodes": ("f4", nodes),
            "tets": ("u4", tets),
            "surface_triangles": ("u4", green.surface_triangles),
            "surface_nodes": ("u4", green.surface_nodes),
            "fixed_nodes": ("u4", fixed),
            "free": ("f4", green.free_displacements),
        }
        return encode(header, arrays)

    def frame_message(self, number: int, log_seen: tuple[int, int], wants: Wants) -> tuple[bytes, tuple[int, int]]:
        """Binary message of the latest tick, and up to where it carries log and history."""
        frame = self._latest()
        shown = frame.displacements if self._moving is None else self._moving.pose(frame.displacements)
        picture = self._fields.picture(wants.field, shown, wants.cutaway)
        wanted, limited = self._tool.wanted, self._tool.limited
        log, moved = self._log.since(log_seen[0]), self._history.since(log_seen[1])
        header = {
            "type": "frame",
            "frame": number,
            "time": frame.time,
            "tool": {
                "position": frame.positions[0].tolist(),
                "active": self.active,
                # Where the pointer is, while the tool is limited.
                "wanted": wanted.tolist() if limited and wanted is not None else None,
            },
            "force": frame.forces[0].tolist(),
            "contacts": [
                {
                    "mode": contact.mode,
                    "point": contact.point.tolist(),
                    "normal": contact.normal.tolist(),
                    "force": contact.force.tolist(),
                }
                for contact in frame.contacts
            ],
            **{k: frame.statistics[k] for k in ("compute_us", "wakeup_us", "ticks", "missed_deadlines", "fault")},
            "realtime": all(frame.statistics["realtime"]),
            "refused": bool(frame.statistics["refused"][0]),
            "strain": self._fields.largest_strain(shown),
            "motion": None if self._moving is None else self._moving.frame_header(),
            "field": picture.header,
            "interior": picture.interior,
        }
        arrays = {
            "displacements": ("f4", picture.displacements),
            "scalar": ("u1", picture.scalar),
            "log": ("f4", _thin(log, 2)),
            "history": ("f4", _thin(moved)),
        }
        return encode(header, arrays), (self._log.end, self._history.end)

    def _press(self, message: Mapping[str, Any]) -> bool:
        position = np.array(vector(message, "position"))
        grab = message.get("grab", False)
        if not isinstance(grab, bool):
            raise ViewerError("press: grab must be true or false")
        if np.abs(position - self._centre).max() > REACH * self.size:
            raise ViewerError("press: the position is far away from the body")
        if self._moving is not None:
            self._moving.end_mode()
            self._moving.struck_at = None
        self._tool.move(position)
        self.simulation.grab(grab)
        self.active = True
        return False

    def _release(self, _message: Mapping[str, Any]) -> bool:
        self.release()
        return False

    def _set(self, message: Mapping[str, Any]) -> bool:
        known = {
            "youngs_modulus": self.simulation.set_youngs_modulus,
            "contact_radius": self._set_radius,
            "time_scale": self._set_time_scale,
        }
        keys = set(message) - {"type"}
        if not keys or not keys <= set(known):
            raise ViewerError(f"set takes {' or '.join(known)}")
        for key in sorted(keys):
            known[key](number(message, key))
        return True

    def _set_time_scale(self, time_scale: float) -> None:
        self._in_motion("slow motion").set_time_scale(time_scale)

    def _set_radius(self, radius: float) -> None:
        if radius > self._max_radius:
            raise ViewerError(f"the contact radius goes up to {1e3 * self._max_radius:.3g} mm on this body")
        self.simulation.set_radius(radius)

    def _reset(self, _message: Mapping[str, Any]) -> bool:
        self.release()
        tool, reference = self.built.scene.tool, self.built.green.youngs_modulus
        self.simulation.set_radius(tool.contact_radius)
        if self._moving is not None:
            self._moving.end_mode()
        elif reference is not None:
            self.simulation.set_youngs_modulus(reference)
        self.simulation.reset()
        return True

    def _latest(self) -> Frame:
        now = time.monotonic()
        if self._frame is None or now - self._frame_time > FRAME_AGE:
            # A contact that has begun since the pointer moved is limited from here on.
            self._tool.update()
            self._frame, self._frame_time = self.simulation.frame(), now
            self._keep_log()
            if self._moving is not None:
                self._moving.follow(self._frame.contacts)
        return self._frame

    def _keep_log(self) -> None:
        rows = self.simulation.drain_log()
        force = np.sqrt(np.einsum("ij,ij->i", rows["force"], rows["force"]))
        self._log.append(np.column_stack([rows["time"], force, rows["compute_us"]]))
        if self._moving is not None and len(rows):
            self._history.append(history(rows, self._body_time))
            self._body_time = float(rows["body_time"][-1])

    def _strike(self, message: Mapping[str, Any]) -> bool:
        moving = self._in_motion("strike")
        moving.strike(message, REACH * self.size, self._centre, self._now())
        return False

    def _repeat(self, _message: Mapping[str, Any]) -> bool:
        self._in_motion("repeat").repeat(self._now())
        return False

    def _now(self) -> float:
        """Body time up to this moment."""
        self._keep_log()
        return self._body_time

    def _mode(self, message: Mapping[str, Any]) -> bool:
        moving = self._in_motion("mode")
        moving.show_mode(message)
        if moving.shows_mode:
            # A shape is shown of a body at rest. A latched fault stays until the person resets it.
            self.release()
            if self.simulation.frame().statistics["fault"] is None:
                self.simulation.reset()
        return False

    def _in_motion(self, what: str) -> MovingBody:
        if self._moving is None:
            raise ViewerError(f"{what}: this body does not move")
        return self._moving


class _Tail:
    """The last rows of a growing table; clients say how many they have seen."""

    def __init__(self, columns: int):
        self._rows = np.zeros((0, columns))
        self.end = 0

    def append(self, rows: np.ndarray) -> None:
        self._rows = np.vstack([self._rows, rows])[-LOG_KEPT:]
        self.end += len(rows)

    def since(self, seen: int) -> np.ndarray:
        return self._rows[max(len(self._rows) - max(self.end - seen, 0), 0) :]


def _thin(rows: np.ndarray, peaks: int | None = None) -> np.ndarray:
    """Rows that a frame may carry, evenly; of the column ``peaks`` the largest value of each group is kept."""
    stride = -(-len(rows) // LOG_SENT) or 1
    thin = rows[::stride].copy()
    if peaks is not None and stride > 1 and len(rows):
        thin[:, peaks] = np.maximum.reduceat(rows[:, peaks], np.arange(0, len(rows), stride))
    return thin


def choices(names: Sequence[str]) -> list[dict[str, str]]:
    """Entries of the model chooser."""
    return [{"name": name, "title": name.replace("_", " ").capitalize()} for name in names]
