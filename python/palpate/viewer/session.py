"""Session of the viewer, without sockets: the running simulation, commands and messages."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from palpate._native import TOOL_SETTINGS
from palpate.errors import DeviceError, Error, ViewerError
from palpate.green import BackgroundPrecompute, GreensFunction
from palpate.scene import BuiltScene
from palpate.scene.tables import ToolTable
from palpate.simulation import Contact, Frame, Simulation
from palpate.viewer.fields import ClientView, Fields, SurfaceMap
from palpate.viewer.messages import encode, flag, index, number, numbered, quaternion, vector, word
from palpate.viewer.motion import HISTORY_COLUMNS, MovingBody, history
from palpate.viewer.recorder import RecentRows, SessionRecorder, downsampled
from palpate.viewer.shown_body import ShownBody, title_of
from palpate.viewer.tool_shapes import kind_of, outline, shape_choices, with_shape

# The contact radius slider ends at this part of the body's longest side.
LARGEST_RADIUS = 0.12
# Tool targets farther than this many body sizes from the body are refused.
REACH = 10.0
# A frame younger than this serves all clients, s.
FRAME_AGE = 0.008


class Session:
    """One running scene.

    Parameters
    ----------
    built
        Scene with its Green's function.
    own_tools
        Tools as the scene file has them, where the scene's have been given other shapes since.
    maps
        What a palpation has left of each body.
    folder
        Where recordings go.
    simulation
        What is shown; None makes the loop of the scene.

    """

    # Whether a page may press and change things, and bring a file; types of messages that watching pages may send.
    controllable = True
    takes_files = True
    from_all: frozenset[str] = frozenset()
    # Rows of the log that are sent with a frame at most.
    log_sent = 64

    def __init__(
        self,
        built: BuiltScene,
        own_tools: Sequence[ToolTable] | None = None,
        maps: Sequence[SurfaceMap | None] | None = None,
        folder: Path = Path(),
        simulation: Simulation | None = None,
    ):
        self.built = built
        scene = built.scene
        self.own_tools = scene.tools if own_tools is None else own_tools
        self.simulation = Simulation(built) if simulation is None else simulation
        self.recorder = SessionRecorder(self.simulation, folder)
        self.maps = [None] * len(built.bodies) if maps is None else maps
        # What is computed of the bodies beside the loop, by their rank, once this session is shown.
        self.growing: Mapping[int, BackgroundPrecompute] = {}
        # Files of shapes may be gone when another page opens.
        self._outlines = [outline(tool, scene.folder) for tool in scene.tools]
        self._bodies = [self._shown(body) for body in range(len(built.bodies))]
        placed = np.vstack([body.points_to_scene(body.green.surface_positions) for body in built.bodies])
        low, high = placed.min(axis=0), placed.max(axis=0)
        self._centre, self.size = 0.5 * (low + high), float((high - low).max())
        self._active = [False] * len(scene.tools)
        # The press under way of each tool.
        self._pressed: dict[int, Mapping[str, Any]] = {}
        largest = self.simulation.largest_contact_radius(LARGEST_RADIUS * self.size)
        self._max_radii = [max(largest, tool.contact_radius) for tool in scene.tools]
        moving = next((body for body, one in enumerate(built.bodies) if one.motion is not None), None)
        self._moving = None if moving is None else MovingBody(self.simulation, moving)
        self._log, self._history = RecentRows(3), RecentRows(HISTORY_COLUMNS)
        self._body_time = 0.0
        self._frame: Frame | None = None
        self._frame_time = 0.0

    def _shown(self, body: int) -> ShownBody:
        built, scene = self.built.bodies[body], self.built.scene
        material = scene.bodies[body].material or scene.material
        ratio = None if built.body is None else material.poissons_ratio
        return ShownBody.of(built, Fields(self.simulation, body, self.maps[body]), ratio)

    def start(self) -> None:
        """Start the loop."""
        self.simulation.start()

    def resume(self) -> None:
        """Start the loop again after a stop; a device that has gone leaves its tool to the pointer."""
        try:
            self.simulation.start()
        except DeviceError:
            self.simulation.start_without_devices()

    def close(self) -> None:
        """Stop the loop."""
        self.simulation.stop()

    def settings(self) -> dict[str, Any]:
        """Message with what the sliders show: a value for each body, or for each tool."""
        return {
            "type": "settings",
            "youngs_modulus": [self.simulation.youngs_modulus_of(body) for body in range(len(self._bodies))],
            **self._of_tools(),
            "shape": [kind_of(tool) for tool in self.built.scene.tools],
            "strain_limit": self.simulation.strain_limit,
            "time_scale": None if self._moving is None else self._moving.time_scale,
        }

    def _of_tools(self) -> dict[str, list[float]]:
        now = self.simulation._settings()
        return {name: now[name] for name in TOOL_SETTINGS}

    def _defaults(self) -> dict[str, Any]:
        """Return what the sliders go back to: the values of the scene."""
        tools, moduli = self.built.scene.tools, [body.green.youngs_modulus for body in self.built.bodies]
        changeable = [self.simulation.youngs_modulus_of(body) is not None for body in range(len(moduli))]
        return {
            "youngs_modulus": [e if able else None for e, able in zip(moduli, changeable, strict=True)],
            **{name: [getattr(tool, name) for tool in tools] for name in TOOL_SETTINGS},
            "strain_limit": self.built.scene.view.strain_limit,
        }

    def release(self, tool: int | None = None) -> None:
        """Take a tool out of the scene, or all of them."""
        for released in range(len(self._active)) if tool is None else [tool]:
            if self._active[released]:
                self.simulation.remove(released)
                self._active[released] = False
            self._pressed.pop(released, None)

    def handle(self, message: Mapping[str, Any]) -> bool:
        """Do what a controlling client says. Returns whether settings changed.

        Raises Error for a message that makes no sense, or a value that is refused.
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

    def record(self, message: Mapping[str, Any]) -> dict[str, Any] | None:
        """Begin a recording, or end it: the message about its end; Error for a recording that cannot be written."""
        if not flag(message, "on"):
            return self.recorder.stop()
        self.release()
        self.recorder.start()
        return None

    def reshaped(self, message: Mapping[str, Any]) -> BuiltScene | None:
        """Scene with the same bodies, one tool with the shape of a message; None if it has that now.

        Raises Error for a shape that the tool may not take.
        """
        tool, name = index(message, "tool", len(self._active)), word(message, "name")
        scene, own = self.built.scene, self.own_tools[tool]
        offered = [choice["name"] for choice in shape_choices(own)]
        if name not in offered:
            raise ViewerError(f"shape: this tool is no '{name}'; it may be {' or '.join(offered)}")
        if name == kind_of(scene.tools[tool]):
            return None
        tools = [*scene.tools[:tool], with_shape(own, name, scene.folder), *scene.tools[tool + 1 :]]
        return replace(self.built, scene=scene.model_copy(update={"tools": tools}))

    def copy_settings(self, other: Session) -> None:
        """Set what the sliders of another session on the same bodies have set."""
        self._apply(other.settings())
        if self._moving is not None and other._moving is not None:
            self._moving.set_time_scale(other._moving.time_scale)

    def take_stores_of(self, other: Session) -> None:
        """Go on with the stores of another session on the same bodies: they may have grown since this one was made."""
        for body, (own, grown) in enumerate(zip(self.built.bodies, other.built.bodies, strict=True)):
            if grown.green is not own.green:
                self.take_store(body, grown.green, grown.is_growing)

    def pressed(self) -> list[Mapping[str, Any]]:
        """Presses under way, for a session that takes the place of this one."""
        return list(self._pressed.values())

    def press_on(self, pressed: Iterable[Mapping[str, Any]]) -> None:
        """Go on with the presses of another session on the same bodies, as they were last."""
        for message in pressed:
            # A tool that a device moves now is not for the pointer any more.
            with contextlib.suppress(Error):
                self._press(message)

    def take_store(self, body: int, green: GreensFunction, is_growing: bool) -> None:
        """Go on with a store of the same body in which more may be touched."""
        self.simulation.take_store(body, green, is_growing)
        self.built = replace(self.built, bodies=self.simulation.bodies)

    def scene_message(self) -> bytes:
        """Geometry and numbers of the scene."""
        tools = [{**outline, **self._tool_entry(tool)} for tool, (outline, _) in enumerate(self._outlines)]
        header = {"type": "scene", "tools": tools, **self._scene_header()}
        bodies = numbered([body.arrays() for body in self._bodies])
        return encode(header, {**bodies, **numbered([arrays for _, arrays in self._outlines], "tools/")})

    def _scene_header(self) -> dict[str, Any]:
        """Header of the scene message but for the tools."""
        scene = self.built.scene
        view = scene.view
        return {
            "name": scene.name,
            "title": title_of(scene.name),
            "size": self.size,
            "strain_limit": self.simulation.strain_limit,
            "defaults": self._defaults(),
            "max_force": scene.device.max_force,
            "bodies": [body.header(self.simulation.youngs_modulus_of(i)) for i, body in enumerate(self._bodies)],
            "motion": None if self._moving is None else self._moving.header(),
            "view": {"position": view.position, "target": view.target} if view.position and view.target else None,
            "replay": self._replay_scene(),
        }

    def _tool_entry(self, tool: int) -> dict[str, Any]:
        """Entry of the scene message, but for what its shape looks like."""
        return {
            "device": self.simulation.devices.get(tool),
            "shapes": shape_choices(self.own_tools[tool]),
            "contact": self.built.scene.tools[tool].contact,
            **{name: values[tool] for name, values in self._of_tools().items()},
            "max_contact_radius": self._max_radii[tool],
        }

    def frame_message(self, number: int, log_seen: tuple[int, int], wants: ClientView) -> tuple[bytes, tuple[int, int]]:
        """Binary message of the latest tick for a client, and up to where it carries log and history."""
        frame = self._latest()
        header = {
            "type": "frame",
            "frame": number,
            "time": frame.time,
            "tools": [self._tool_header(frame, tool) for tool in range(len(self._active))],
            **{k: frame.statistics[k] for k in ("compute_us", "wakeup_us", "ticks", "missed_deadlines", "fault")},
            "realtime": all(frame.statistics["realtime"]),
        }
        bodies, arrays = self._drawn(frame, log_seen, wants)
        return encode({**header, **bodies}, arrays), (self._log.end, self._history.end)

    def _drawn(
        self, frame: Frame, log_seen: tuple[int, int], wants: ClientView
    ) -> tuple[dict[str, Any], dict[str, tuple[str, np.ndarray]]]:
        """Part of a frame message about the bodies, and its arrays."""
        poses = [self._pose(frame, body) for body in range(len(self._bodies))]
        pairs = list(zip(self._bodies, poses, strict=True))
        pictures = [body.picture(wants.field, pose, wants.cutaway, wants.full_scale) for body, pose in pairs]
        strains = [body.fields.largest_strain(pose) for body, pose in pairs]
        log, moved = self._log.since(log_seen[0]), self._history.since(log_seen[1])
        header = {
            "contacts": [self._contact_header(contact) for contact in frame.contacts],
            "strain": max(strains),
            "bodies": [{"strain": strain} for strain in strains],
            "motion": self._motion_header(),
            "fields": [picture.header for picture in pictures],
            "interior": [picture.interior for picture in pictures],
            "recording": self.recorder.header(),
            "replay": self._replay_header(),
        }
        rows = {"log": ("f4", downsampled(log, self.log_sent, 2)), "history": ("f4", downsampled(moved, self.log_sent))}
        return header, {**numbered([picture.arrays for picture in pictures]), **rows}

    def _motion_header(self) -> dict[str, Any] | None:
        """Part of a frame message about the motion; the watched node as the vertex that is drawn for it."""
        moving = self._moving
        if moving is None:
            return None
        motion = moving.frame_header()
        return {**motion, "watched": self._bodies[moving.index].drawn_row(motion["watched"])}

    def _replay_scene(self) -> dict[str, Any] | None:
        """Part of the scene message about a replay."""
        return None

    def _replay_header(self) -> dict[str, Any] | None:
        """Part of a frame message about a replay."""
        return None

    def _pose(self, frame: Frame, body: int) -> np.ndarray:
        """Displacements (s, 3), m, that are drawn of a body."""
        displacements = frame.bodies[body].displacements
        moving = self._moving
        return displacements if moving is None or moving.index != body else moving.pose(displacements)

    def _contact_header(self, contact: Contact) -> dict[str, Any]:
        """Entry of a frame message: the place in the body's frame, the force on the body in that of the scene."""
        # What holds on, by its law or by a grab, does so by its patch: it has no depth of its own.
        local = contact.mode == "press" and self.built.scene.tools[contact.tool].contact == "local"
        return {
            "tool": contact.tool,
            "body": contact.body,
            "mode": contact.mode,
            "point": contact._own_point.tolist(),
            "normal": contact._own_normal.tolist(),
            "force": contact.force.tolist(),
            "radius": float(contact.radius) if local else self.simulation.contact_radius_of(contact.tool),
            "depth": float(contact.depth) if local else None,
            "stiffness": float(contact.stiffness) if local else None,
            "slipping": bool(contact.slipping),
            "error": contact.error,
        }

    def _tool_header(self, frame: Frame, tool: int) -> dict[str, Any]:
        device, limited = frame.positions[tool], bool(frame.limited[tool])
        # A tool that is limited stays where its contact has it; the device goes on.
        contact = next((c for c in frame.contacts if c.tool == tool and c.limited), None)
        position = device if contact is None else contact.anchor + contact.displacement
        return {
            "position": position.tolist(),
            "orientation": frame.orientations[tool].tolist(),
            "active": bool(frame.active[tool]),
            "limited": limited,
            # Where the device is, while the tool does not follow it.
            "wanted": device.tolist() if limited else None,
            "force": frame.forces[tool].tolist(),
            "refused": frame.statistics["refused"][tool],
            "thin": frame.statistics["thin"][tool],
        }

    def _press(self, message: Mapping[str, Any]) -> bool:
        tool, position = index(message, "tool", len(self._active)), np.array(vector(message, "position"))
        if tool in self.simulation.devices:
            raise ViewerError(f"press: tool {tool} is moved by {self.simulation.devices[tool]}")
        grab = "grab" in message and flag(message, "grab")
        if np.abs(position - self._centre).max() > REACH * self.size:
            raise ViewerError("press: the position is far away from the body")
        turned = quaternion(message, "orientation") if "orientation" in message else None
        if self._moving is not None:
            self._moving.end_mode()
            self._moving.struck_at = None
        self.simulation.move(position.tolist(), tool=tool, orientation=turned)
        self.simulation.grab(grab, tool)
        self._active[tool], self._pressed[tool] = True, message
        return False

    def _release(self, message: Mapping[str, Any]) -> bool:
        self.release(index(message, "tool", len(self._active)) if "tool" in message else None)
        return False

    def _set(self, message: Mapping[str, Any]) -> bool:
        known: dict[str, Callable[[float, Mapping[str, Any]], None]] = {
            **{name: partial(self._set_of_tools, name) for name in TOOL_SETTINGS},
            "youngs_modulus": self._set_youngs_modulus,
            "contact_radius": self._set_radius,
            "strain_limit": lambda limit, _: self.simulation.set_strain_limit(limit),
            "time_scale": lambda scale, _: self._in_motion("slow motion").set_time_scale(scale),
        }
        keys = set(message) - {"type", "body", "tool"}
        if not keys or not keys <= set(known):
            raise ViewerError(f"set takes {' or '.join(known)}")
        for key in sorted(keys):
            known[key](number(message, key), message)
        return True

    def _set_youngs_modulus(self, youngs_modulus: float, message: Mapping[str, Any]) -> None:
        self.simulation.set_youngs_modulus(youngs_modulus, index(message, "body", len(self._bodies)))

    def _tools(self, message: Mapping[str, Any]) -> Sequence[int]:
        """Return the tool that a message names, or all of them."""
        return [index(message, "tool", len(self._active))] if "tool" in message else range(len(self._active))

    def _set_of_tools(self, name: str, value: float, message: Mapping[str, Any]) -> None:
        for tool in self._tools(message):
            self.simulation._set_of_tools(name, value, tool)

    def _apply(self, values: Mapping[str, Any]) -> None:
        """Set what a message of settings has for each tool and body, and the limit of strain."""
        for name in TOOL_SETTINGS:
            for tool, value in enumerate(values[name]):
                self.simulation._set_of_tools(name, value, tool)
        for body, modulus in enumerate(values["youngs_modulus"]):
            if modulus is not None:
                self.simulation.set_youngs_modulus(modulus, body)
        self.simulation.set_strain_limit(values["strain_limit"])

    def _set_radius(self, radius: float, message: Mapping[str, Any]) -> None:
        tools = self._tools(message)
        largest = min(self._max_radii[tool] for tool in tools)
        if radius > largest:
            raise ViewerError(f"the contact radius goes up to {1e3 * largest:.3g} mm on this body")
        for tool in tools:
            self.simulation.set_radius(radius, tool)

    def _reset(self, _message: Mapping[str, Any]) -> bool:
        self.release()
        self._apply(self._defaults())
        if self._moving is not None:
            self._moving.end_mode()
        self.simulation.reset()
        return True

    def _latest(self) -> Frame:
        now = time.monotonic()
        if self._frame is None or now - self._frame_time > FRAME_AGE:
            self._frame, self._frame_time = self.simulation._read_frame(), now
            self._store_log()
            if self._moving is not None:
                self._moving.follow(self._frame.contacts)
        return self._frame

    def _store_log(self) -> None:
        rows = self.simulation.drain_log()
        force = np.sqrt(np.einsum("ij,ij->i", rows["force"], rows["force"]))
        self._log.append(np.column_stack([rows["time"], force, rows["compute_us"]]))
        if self._moving is not None and len(rows):
            self._history.append(history(rows, self._body_time))
            self._body_time = float(rows["body_time"][-1])

    def _strike(self, message: Mapping[str, Any]) -> bool:
        moving = self._in_motion("strike")
        if "body" in message and index(message, "body", len(self._bodies)) != moving.index:
            raise ViewerError("strike: this body does not move")
        moving.strike(message, REACH * self.size, self._now())
        return False

    def _repeat(self, _message: Mapping[str, Any]) -> bool:
        self._in_motion("repeat").repeat(self._now())
        return False

    def _now(self) -> float:
        """Body time up to this moment."""
        self._store_log()
        return self._body_time

    def _mode(self, message: Mapping[str, Any]) -> bool:
        moving = self._in_motion("mode")
        moving.show_mode(message)
        if moving.shows_mode:
            # A shape is shown of a body at rest. A latched fault stays until the person resets it.
            self.release()
            if self.simulation._read_frame().statistics["fault"] is None:
                self.simulation.reset()
        return False

    def _in_motion(self, what: str) -> MovingBody:
        if self._moving is None:
            raise ViewerError(f"{what}: this body does not move")
        return self._moving


def choices(names: Sequence[str]) -> list[dict[str, str]]:
    """Entries of the model chooser."""
    return [{"name": name, "title": title_of(name)} for name in names]
