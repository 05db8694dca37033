"""Columns that are computed while a session runs: finished ones go into its loop, and the page gets a message."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping
from typing import Any

import numpy as np

from palpate.errors import ViewerError
from palpate.green import BackgroundPrecompute
from palpate.viewer.messages import index, whole
from palpate.viewer.session import Session

# Characters of a painted mask, in a message of the size that a client may send.
LONGEST_MASK = 3000
# The time left is sent again when it differs by this part.
TIME_LEFT_CHANGE = 0.05


class Computing:
    """What is computed of the bodies of a session, by their rank."""

    def __init__(self, growing: Mapping[int, BackgroundPrecompute] | None = None):
        self._growing = dict(growing or {})
        self._last_message: dict[str, Any] | None = None

    def begin(self) -> None:
        """Leave the processor to the loop, which begins."""
        for background in self._growing.values():
            background.yield_processor()

    def step(self, session: Session) -> dict[str, Any] | None:
        """Give the loop what has become ready; the message for all pages, if there is something new."""
        for body, background in self._growing.items():
            if body >= len(session.built.bodies):
                continue  # another body is set up in its place for now
            if session.simulation.recording is None:  # a recording is of one scene: the store waits
                green = background.take()
                if green is not None:
                    session.take_store(body, green, not background.is_complete)
        message = self.message(session)
        if self._last_message is not None and _is_same(message, self._last_message):
            return None
        self._last_message = message
        return message

    def message(self, session: Session) -> dict[str, Any]:
        """Message with what can be touched by now."""
        bodies = [self._entry(session, body) for body in range(len(session.built.bodies))]
        return {"type": "computed", "bodies": bodies, "series": _series_entry(session)}

    def _entry(self, session: Session, body: int) -> dict[str, Any]:
        green, background = session.built.bodies[body].green, self._growing.get(body)
        surface = green.surface_nodes
        ready = np.isin(surface, green.touchable_nodes)
        region = ready if background is None else np.isin(surface, background.region)
        waiting = np.isin(surface, [] if background is None else background.waiting)
        columns = 3 * len(green.touchable_nodes)
        return {
            "ready": None if ready.all() else mask_text(ready),
            "region": None if region.all() else mask_text(region),
            "waiting": mask_text(waiting) if waiting.any() else None,
            "done": columns if background is None else background.done,
            "columns": columns if background is None else background.columns,
            "left_s": None if background is None else background.seconds_left,
            "stopped": None if background is None else background.error,
        }

    def paint(self, session: Session, message: Mapping[str, Any]) -> None:
        """Let nodes of a message be computed next.

        Raises ViewerError if nothing is computed of that body, or for nodes that it does not have.
        """
        body = index(message, "body", len(session.built.bodies))
        background, surface = self._growing.get(body), session.built.bodies[body].green.surface_nodes
        if background is None or background.is_complete:
            raise ViewerError("paint: all of this body that may be touched is computed")
        first = whole(message, "first", 0, len(surface) - 1)
        ranks = first + np.flatnonzero(mask_of(message, "nodes"))
        if first % 8 or not len(ranks) or ranks.max() >= len(surface):
            raise ViewerError("paint: nodes must be a mask of surface nodes")
        background.paint(surface[ranks])

    def close(self) -> None:
        """End what is computed; it goes on from there another time."""
        for background in self._growing.values():
            background.close()


def _series_entry(session: Session) -> dict[str, Any] | None:
    """How far the series beyond small strain are; None where nothing is computed of them."""
    simulation = getattr(session, "simulation", None)  # none runs where a body is set up
    background = None if simulation is None else simulation.series
    if background is None or background.is_complete:
        return None
    left = background.seconds_left
    return {
        "done": background.done,
        "places": background.places,
        "left_s": None if left is None else round(left),
        "stopped": background.error,
    }


def mask_text(mask: np.ndarray) -> str:
    """Bits of a mask in base64, the lowest of each byte first."""
    return base64.b64encode(np.packbits(mask, bitorder="little").tobytes()).decode()


def mask_of(message: Mapping[str, Any], key: str) -> np.ndarray:
    """Read a mask of a client's message; ViewerError for what is none, or too long."""
    text, what = message.get(key), f"{message['type']}: {key} must be a mask in base64"
    if not isinstance(text, str) or len(text) > LONGEST_MASK:
        raise ViewerError(what)
    try:
        data = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        raise ViewerError(what) from None
    return np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little").astype(bool)


def _is_same(message: Mapping[str, Any], last: Mapping[str, Any]) -> bool:
    """Whether nothing differs but a little time; another scene may have another number of bodies."""
    if message["series"] != last["series"] or len(message["bodies"]) != len(last["bodies"]):
        return False
    for now, before in zip(message["bodies"], last["bodies"], strict=True):
        left, last_left = now["left_s"], before["left_s"]
        if {**now, "left_s": None} != {**before, "left_s": None} or (left is None) != (last_left is None):
            return False
        if left is not None and abs(left - last_left) > TIME_LEFT_CHANGE * last_left + 1.0:
            return False
    return True
