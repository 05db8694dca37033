"""Two bodies and two tools for the page: two sessions that run side by side, sent as one scene.

The first tool touches the first body only, the second tool the second one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from palpate.viewer.messages import decode, encode
from palpate.viewer.session import Session, Wants
from palpate.viewer.shown_body import placed

NAMES = {"float32": "f4", "uint32": "u4", "uint8": "u1"}


class PairSession:
    """What the server asks of a session, of two.

    Parameters
    ----------
    first, second
        The sessions; the second body is placed.
    position, orientation
        Of the second body's frame, m and a unit quaternion w x y z.

    """

    def __init__(self, first: Session, second: Session, position: tuple[float, ...], orientation: tuple[float, ...]):
        self.sessions = [first, second]
        self._position, self._orientation = position, orientation

    def close(self) -> None:
        for session in self.sessions:
            session.close()

    def settings(self) -> dict[str, Any]:
        first, second = (session.settings() for session in self.sessions)
        return {**first, **{key: first[key] + second[key] for key in ("youngs_modulus", "contact_radius")}}

    def release(self) -> None:
        for session in self.sessions:
            session.release()

    def handle(self, message: Mapping[str, Any]) -> bool:
        which = message.get("tool", message.get("body"))
        if which is None:
            return any([session.handle(message) for session in self.sessions])
        own = {**message, **{key: 0 for key in ("tool", "body") if key in message}}
        if which == 1 and "position" in message:
            own["position"] = self._in_second(np.array(message["position"])).tolist()
        return self.sessions[which].handle(own)

    def scene_message(self) -> bytes:
        (first, arrays), (second, others) = (decode(session.scene_message()) for session in self.sessions)
        for key in ("bodies", "tools"):
            first[key] += second[key]
        first["bodies"][1].update(position=self._position, orientation=self._orientation)
        first["size"] = 1.5 * first["size"]
        return self._joined(first, arrays, others)

    def frame_message(self, number: int, log_seen: Any, wants: Wants) -> tuple[bytes, Any]:
        seen = log_seen if isinstance(log_seen[0], tuple) else (log_seen, log_seen)
        pairs = zip(self.sessions, seen, strict=True)
        sent = [session.frame_message(number, mine, wants) for session, mine in pairs]
        (first, arrays), (second, others) = (decode(message) for message, _ in sent)
        for tool in second["tools"]:
            tool["position"] = self._in_scene(tool["position"])
            tool["wanted"] = tool["wanted"] and self._in_scene(tool["wanted"])
            tool["force"] = placed(np.array([tool["force"]]), (0, 0, 0), self._orientation)[0].tolist()
        for contact in second["contacts"]:
            contact.update(tool=1, body=1)
        for key in ("tools", "contacts", "bodies", "fields", "interior"):
            first[key] += second[key]
        first["strain"] = max(first["strain"], second["strain"])
        return self._joined(first, arrays, others), (sent[0][1], sent[1][1])

    def _joined(self, header: dict, arrays: dict, others: dict) -> bytes:
        del header["arrays"]
        renamed = {name.replace("0/", "1/"): array for name, array in others.items() if name.startswith("0/")}
        both = {**arrays, **renamed}
        return encode(header, {name: (NAMES[array.dtype.name], array) for name, array in both.items()})

    def _in_scene(self, point: list[float]) -> list[float]:
        return placed(np.array([point]), self._position, self._orientation)[0].tolist()

    def _in_second(self, point: np.ndarray) -> np.ndarray:
        w, x, y, z = self._orientation
        return placed(np.array([point]) - self._position, (0, 0, 0), (w, -x, -y, -z))[0]
