"""Session whose page receives nothing that would show where the nodule is.

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
from palpate.simulation import Contact, Frame
from palpate.viewer.fields import ClientView, Picture
from palpate.viewer.messages import numbered
from palpate.viewer.session import Session

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
    """One trial: a body with a nodule or without; the tone is loudest at ``loud_force``, N."""

    takes_files = False

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

    def _scene_header(self) -> dict[str, Any]:
        """Header of the scene message but for the tools: the same for every trial."""
        body = {**self._bodies[0].header(None), "fields": [], "regions": [], "poissons_ratio": None}
        hidden = {"title": "Exam", "strain_limit": 0.0, "bodies": [body], "motion": None, "replay": None}
        return {**super()._scene_header(), **hidden, "defaults": {**self._defaults(), "youngs_modulus": [None]}}

    def _tool_header(self, frame: Frame, tool: int) -> dict[str, Any]:
        return {**super()._tool_header(frame, tool), **SILENT}

    def _drawn(
        self, frame: Frame, log_seen: tuple[int, int], wants: ClientView
    ) -> tuple[dict[str, Any], dict[str, tuple[str, np.ndarray]]]:
        """Part of a frame message: the force on the device, over a body that does not deform."""
        self._follow(frame.contacts)
        rows = len(self._bodies[0].drawn.nodes)
        header = {
            "contacts": [],
            "strain": 0.0,
            "bodies": [{"strain": 0.0}],
            "motion": None,
            "fields": [NOTHING],
            "interior": [False],
            "recording": None,
            "replay": None,
            "loudness": min(float(np.linalg.norm(frame.forces[0])) / self._loud_force, 1.0),
        }
        still = Picture(NOTHING, np.zeros((rows, 3)), np.zeros(rows), False)
        return header, {
            **numbered([still.arrays]),
            "log": ("f4", np.zeros((0, 3))),
            "history": ("f4", np.zeros((0, 8))),
        }

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
