"""Messages from peers to a simulation, and its messages to them, in the units and axes of the wire.

The wire has millimetres, and the patient's axes RAS or LPS. Palpate has metres, and bodies of segmentations in RAS: x
to the patient's right, y to the front (anterior), z to the head (superior). Slicer has the same axes in millimetres.
LPS, of DICOM and ITK, turns x and y around.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np

from palpate.atomic import written_beside
from palpate.errors import Error
from palpate.openigtlink.messages import (
    Message,
    MessageError,
    pack,
    point_content,
    read_string,
    read_transform,
    string_content,
    transform_content,
)
from palpate.simulation import Frame, Simulation

MILLIMETRES = 1e3
# A tool that nobody moves for this long leaves the scene, s.
SILENCE = 0.5
# Names of the devices of messages.
TOOL, BODY, COMMAND = "Tool", "Body", "Command"
TOOL_POSE, CONTACTS, FORCE, ANSWER = "ToolPose", "Contacts", "Force", "Answer"


class Axes:
    """Conversion of a scene (m, RAS) to the wire (mm, RAS or LPS), in whose world the scene may stand anywhere."""

    def __init__(self, name: Literal["RAS", "LPS"] = "RAS"):
        self.name = name
        self._signs = np.array([1.0, 1.0, 1.0] if name == "RAS" else [-1.0, -1.0, 1.0])
        self._placement = np.eye(4)

    def place(self, matrix: np.ndarray) -> None:
        """Take the placement of the scene in the world of the wire, (4, 4) in mm."""
        self._placement = np.array(matrix, dtype=float)

    def pose_from_wire(self, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position, m, and unit quaternion w x y z in the scene."""
        from scipy.spatial.transform import Rotation

        own = np.linalg.inv(self._placement) @ matrix
        turned = own[:3, :3] * np.outer(self._signs, self._signs)
        x, y, z, w = Rotation.from_matrix(turned).as_quat(canonical=True)
        return self._signs * own[:3, 3] / MILLIMETRES, np.array([w, x, y, z])

    def pose_to_wire(self, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """Matrix (4, 4), mm, of a position, m, and a unit quaternion in the scene."""
        from scipy.spatial.transform import Rotation

        own = np.eye(4)
        w, x, y, z = orientation
        own[:3, :3] = Rotation.from_quat([x, y, z, w]).as_matrix() * np.outer(self._signs, self._signs)
        own[:3, 3] = self._signs * np.asarray(position) * MILLIMETRES
        return self._placement @ own

    def points_to_wire(self, points: np.ndarray) -> np.ndarray:
        """Points (k, 3), mm, of points in the scene, m."""
        return (self._signs * points * MILLIMETRES) @ self._placement[:3, :3].T + self._placement[:3, 3]

    def vector_to_wire(self, vector: np.ndarray) -> np.ndarray:
        """Vector of the scene in the axes of the wire, in its own unit; torques too, because both are right-handed."""
        return self._placement[:3, :3] @ (self._signs * vector)


class Link:
    """A simulation as peers see it.

    In: TRANSFORM ``Tool`` or ``Tool0`` to ``Tool3`` moves a tool. TRANSFORM ``Body`` is the pose of the scene in the
    peer's world. STRING ``Command`` is ``reset``, or ``surface``, which writes the deformed surface to a file of
    ``folder``. Out: TRANSFORM ``ToolPose`` (``ToolPose1``...), POINT ``Contacts``, STRING ``Force`` (JSON in N and N m,
    axes of the wire) and STRING ``Answer``.

    ``simulation`` gives the simulation that runs now, None where none does.
    """

    def __init__(self, simulation: Callable[[], Simulation | None], axes: Axes | None = None, folder: Path = Path()):
        self._simulation, self.axes, self._folder = simulation, axes or Axes(), folder
        # Who moves each tool, when it was last moved, and how often by then.
        self._movers: dict[int, tuple[object, float, int]] = {}

    def take(self, peer: object, message: Message, now: float) -> bytes | None:
        """Do what a message says; an answer for its peer alone, or None. What Palpate does not know is left alone.

        Raises MessageError for a message whose content is wrong.
        """
        simulation = self._simulation()
        if message.kind == "TRANSFORM" and message.device == BODY:
            self.axes.place(read_transform(message))
        elif message.kind == "TRANSFORM" and message.device.startswith(TOOL):
            tool = _rank(message.device)
            if simulation is not None and tool is not None and tool < len(simulation.scene.tools):
                self._move(simulation, tool, read_transform(message), peer, now)
        elif message.kind == "STRING" and message.device == COMMAND:
            return pack("STRING", ANSWER, string_content(self._command(simulation, read_string(message))), time.time())
        return None

    def _move(self, simulation: Simulation, tool: int, matrix: np.ndarray, peer: object, now: float) -> None:
        mover, since, _ = self._movers.get(tool, (peer, now, 0))
        if mover is not peer and now - since < SILENCE:
            return
        position, orientation = self.axes.pose_from_wire(matrix)
        try:
            simulation.move(position, tool=tool, orientation=orientation)
        except Error as error:
            raise MessageError(str(error)) from None
        self._movers[tool] = (peer, now, simulation._moves[tool])

    def _command(self, simulation: Simulation | None, text: str) -> str:
        if simulation is None:
            return "refused: nothing runs"
        try:
            if text == "reset":
                simulation.reset()
                return "done"
            if text == "surface":
                return f"surface {self._write_surface(simulation.frame())}"
        except (Error, OSError) as error:
            return f"refused: {error}"
        return "refused: commands are 'reset' and 'surface'"

    def _write_surface(self, frame: Frame) -> Path:
        """Write the deformed surface of all bodies, mm in the axes of the wire, as ASCII PLY: Slicer reads it."""
        surfaces = [body.surface_in_scene() for body in frame.bodies]
        starts = np.cumsum([0, *(len(surface.positions) for surface in surfaces)])
        points = self.axes.points_to_wire(np.concatenate([surface.positions for surface in surfaces]))
        faces = np.concatenate([s.triangles + start for s, start in zip(surfaces, starts, strict=False)])
        path = (self._folder / "deformed.ply").absolute()
        header = f"ply\nformat ascii 1.0\ncomment mm {self.axes.name}\nelement vertex {len(points)}\n"
        header += "property float x\nproperty float y\nproperty float z\n"
        header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
        rows = [" ".join(f"{x:.9g}" for x in point) for point in points]
        rows += ["3 " + " ".join(map(str, face)) for face in faces]
        with written_beside(path) as beside:
            beside.write_text(header + "\n".join(rows) + "\n")
        return path

    def let_go(self, peer: object) -> None:
        """Take the tools of a disconnected peer out of the scene."""
        for tool in [tool for tool, (mover, *_) in self._movers.items() if mover is peer]:
            self._remove(tool)

    def let_go_of_silent(self, now: float) -> None:
        """Take tools out of the scene whose peer has been silent for too long."""
        for tool in [tool for tool, (_, since, _) in self._movers.items() if now - since > SILENCE]:
            self._remove(tool)

    def _remove(self, tool: int) -> None:
        *_, moves = self._movers.pop(tool)
        simulation = self._simulation()
        # A tool that the page has moved since then stays in the scene.
        if simulation is not None and tool < len(simulation.scene.tools) and simulation._moves[tool] == moves:
            simulation.remove(tool)

    def state(self) -> bytes | None:
        """Messages of the latest tick; None where nothing runs."""
        simulation = self._simulation()
        if simulation is None:
            return None
        try:
            frame = simulation.frame()
        except Error:
            return None
        now, axes = time.time(), self.axes
        sent = []
        for tool in np.flatnonzero(frame.active):
            matrix = axes.pose_to_wire(frame.positions[tool], frame.orientations[tool])
            sent.append(pack("TRANSFORM", f"{TOOL_POSE}{tool or ''}", transform_content(matrix), now))
        contacts = frame.contacts
        if contacts:
            points = axes.points_to_wire(np.array([contact.point for contact in contacts]))
            names = [f"tool {contact.tool} on body {contact.body}" for contact in contacts]
            diameters = [2e3 * contact.radius for contact in contacts]
            sent.append(pack("POINT", CONTACTS, point_content(points, names, diameters), now))
        wrenches = {
            "time_s": round(frame.time, 6),
            "axes": axes.name,
            "force_N": [axes.vector_to_wire(force).tolist() for force in frame.forces],
            "torque_Nm": [axes.vector_to_wire(torque).tolist() for torque in frame.torques],
            "fault": frame.statistics["fault"],
        }
        sent.append(pack("STRING", FORCE, string_content(json.dumps(wrenches)), now))
        return b"".join(sent)


def _rank(device: str) -> int | None:
    """Rank of the tool of a device's name: that of 'Tool' is 0."""
    number = device.removeprefix(TOOL)
    if number == "":
        return 0
    return int(number) if number.isascii() and number.isdigit() and len(number) < 3 else None
