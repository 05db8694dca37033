"""A session whose page is told nothing from which an eye could read what is hidden.

What would give a nodule away: elements and regions, the wire frame of a mesh made finer around it, the dent that is
shallower over it, colours, force and stiffness as numbers, arrows and plots, the centre of pressure, the limit of
strain. So the page gets the surface at rest of a body that all trials have in common, no displacements, no contacts, no
log. It gets where the tool is, which its hand knows, and how loud the tone is that stands for the force where there is
no device to be felt.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.scene import BuiltScene
from palpate.simulation import Contact
from palpate.viewer.messages import by_body, encode
from palpate.viewer.pose_code import PoseCoder
from palpate.viewer.session import Session, Wants
from palpate.viewer.tool_shapes import by_tool, outline

# The only field, always zero.
NOTHING = {
    **{"name": "displacement", "title": "Displacement", "unit": "mm", "signed": False},
    **{"gaps": False, "min": 0.0, "max": 1.0, "largest": 0.0},
}
# What a page is not told of a tool.
SILENT = {"limited": False, "wanted": None, "force": [0.0, 0.0, 0.0], "refused": None, "thin": False}
# Messages of a client that this session takes; settings would change what is felt.
TAKEN = ("press", "release", "reset")


class HiddenSession(Session):
    """One trial.

    Parameters
    ----------
    built
        Body with a nodule or without.
    loud_force
        Force at which the tone is loudest, N.

    """

    def __init__(self, built: BuiltScene, loud_force: float):
        super().__init__(built)
        self._loud_force = loud_force
        self._touched: np.ndarray | None = None

    def takes(self, kind: str) -> bool:
        """Whether a client may send messages of a kind."""
        return kind in TAKEN

    def settings(self) -> dict[str, Any]:
        """Message with what the sliders show: no modulus, for nobody changes it."""
        return {**super().settings(), "youngs_modulus": [None]}

    def scene_message(self) -> bytes:
        """Geometry of the surface at rest, the same for every trial."""
        scene = self.built.scene
        shapes = [outline(tool, scene.folder) for tool in scene.tools]
        view = scene.view
        shown = self._bodies[0]
        header = {
            "type": "scene",
            "name": scene.name,
            "title": "Exam",
            "size": self.size,
            "strain_limit": 0.0,
            "defaults": {**self._defaults(), "youngs_modulus": [None]},
            "max_force": scene.device.max_force,
            "bodies": [{**shown.header(None), "fields": [], "regions": [], "poissons_ratio": None}],
            "tools": [{**told, **self._tool_entry(tool)} for tool, (told, _) in enumerate(shapes)],
            "motion": None,
            "view": {"position": view.position, "target": view.target} if view.position and view.target else None,
            "replay": None,
        }
        return encode(header, {**by_body([shown.arrays()]), **by_tool([arrays for _, arrays in shapes])})

    def frame_message(
        self, number: int, log_seen: tuple[int, int], wants: Wants, coder: PoseCoder
    ) -> tuple[bytes, tuple[int, int]]:
        """Where the tool is and the force on the device, over a body that does not deform."""
        frame = self._latest()
        self._follow(frame.contacts)
        rows = len(self._bodies[0].drawn.nodes)
        coded = coder.code(number, [(np.zeros((rows, 3)), np.zeros(rows), self._bodies[0].extent)])
        header = {
            "type": "frame",
            "frame": number,
            "time": frame.time,
            "tools": [{**self._tool_header(frame, 0), **SILENT}],
            "contacts": [],
            **{k: frame.statistics[k] for k in ("compute_us", "wakeup_us", "ticks", "missed_deadlines", "fault")},
            "realtime": all(frame.statistics["realtime"]),
            "strain": 0.0,
            "bodies": [{"strain": 0.0}],
            "motion": None,
            "fields": [NOTHING],
            "interior": [False],
            "poses": coded.headers,
            "recording": None,
            "replay": None,
            "loudness": min(float(np.linalg.norm(frame.forces[0])) / self._loud_force, 1.0),
        }
        empty = {"log": ("f4", np.zeros((0, 3))), "history": ("f4", np.zeros((0, 8)))}
        return encode(header, {**by_body(coded.arrays), **empty}), log_seen

    @property
    def touched(self) -> list[float] | None:
        """Point (3,) of the surface at rest, m, in the frame of the body, that is touched or was last; None before."""
        self._follow(self.simulation.contacts())
        return None if self._touched is None else self._touched.tolist()

    def _follow(self, contacts: list[Contact]) -> None:
        """Keep the place of the hardest contact."""
        if contacts:
            hardest = max(contacts, key=lambda contact: float(np.linalg.norm(contact.force)))
            self._touched = self.built.bodies[0].points_to_body(hardest.point)
