"""Session that replays a recording: time line, pause, slow motion, and the comparison of every bit."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from palpate.errors import ViewerError
from palpate.simulation import Frame, ReplayedSimulation
from palpate.viewer.messages import flag, number, whole
from palpate.viewer.session import FRAME_AGE, Session

# Recorded seconds shown in a second.
SLOWEST, FASTEST = 0.01, 1.0
# Computing between two frames, s: while playing, and on the way to another place of the time line.
PLAYING, SEEKING = 0.05, 0.2
# Time between two frames that counts, s: nothing is skipped where nobody looked for longer.
LONGEST_PAUSE = 0.1


class ReplaySession(Session):
    """A recording that is made again, and shown."""

    controllable = False
    takes_files = False
    from_all = frozenset({"replay"})
    log_sent = 600

    def __init__(self, simulation: ReplayedSimulation):
        super().__init__(simulation.scene_as_built, simulation=simulation)
        self._replayed = simulation
        self._goal, self._place = 1, 1.0
        self._playing, self._speed = True, 1.0
        self._looked = time.monotonic()
        self._restarts = 0

    def start(self) -> None:
        """Nothing runs."""

    def release(self, tool: int | None = None) -> None:
        """Nothing is held."""

    def handle(self, message: Mapping[str, Any]) -> bool:
        """Go to a tick, play or pause, or change the speed. Returns that no settings changed.

        Raises Error for a message that makes no sense, or one that wants to press or change something.
        """
        if message["type"] != "replay":
            raise ViewerError("this is a replay: nothing can be pressed or changed")
        known = {"type", "tick", "play", "speed"}
        if not set(message) <= known or len(message) < 2:
            raise ViewerError("replay takes tick, play or speed")
        play = flag(message, "play") if "play" in message else self._playing
        speed = number(message, "speed") if "speed" in message else self._speed
        if not SLOWEST <= speed <= FASTEST:
            raise ViewerError(f"replay: the speed goes from {SLOWEST:g} to {FASTEST:g}")
        if "tick" in message:
            self._go_to(whole(message, "tick", 1, self._replayed.ticks))
        if play and not self._playing and self._goal == self._replayed.ticks:
            self._go_to(1)
        self._playing, self._speed = play, speed
        self._looked = time.monotonic()
        self._frame = None
        return False

    def _go_to(self, tick: int) -> None:
        self._goal, self._place = tick, float(tick)

    def reshaped(self, message: Mapping[str, Any]) -> None:
        """Raise ViewerError: tools have the shapes that they had."""
        raise ViewerError("this is a replay: tools have the shapes that they had")

    def _latest(self) -> Frame:
        now = time.monotonic()
        if self._frame is not None and now - self._frame_time <= FRAME_AGE:
            return self._frame
        self._advance(now)
        # What going on took is no age of the frame.
        self._frame = None
        frame = super()._latest()
        self._follow()
        return frame

    def _advance(self, now: float) -> None:
        """Go on to where the time line is to be; where ticks take long, as far as there is time for."""
        passed, self._looked = min(now - self._looked, LONGEST_PAUSE), now
        replayed = self._replayed
        arrived = replayed.ticks_done == self._goal
        if arrived and self._playing:
            self._place = min(self._place + passed * self._speed * self.built.scene.device.rate, float(replayed.ticks))
            self._goal = int(self._place)
        replayed.advance(self._goal, PLAYING if arrived else SEEKING)
        if arrived and self._playing and replayed.ticks_done < self._goal:
            # It is played as fast as ticks can be made.
            self._go_to(replayed.ticks_done)
        self._goal = min(self._goal, replayed.ticks)
        self._playing &= self._goal < replayed.ticks

    def _follow(self) -> None:
        """Take over from the recording what a running session is told."""
        recorded, tick = self._replayed.recorded, self._replayed.ticks_done - 1
        active = np.atleast_1d(recorded.active[tick]).tolist()
        self._active = active + [False] * (len(self._active) - len(active))
        moving, watched = self._moving, self._replayed.watched
        if moving is not None and watched is not None and watched[0] == moving.index:
            moving.watched = int(self.built.bodies[moving.index].green.surface_nodes[watched[1]])

    def _store_log(self) -> None:
        if self._restarts != self._replayed.restarts:
            self._restarts, self._body_time = self._replayed.restarts, 0.0
            self._log.clear()
            self._history.clear()
        super()._store_log()

    def _replay_scene(self) -> dict[str, Any]:
        recorded, ticks = self._replayed.recorded, self._replayed.ticks
        path = recorded.source if isinstance(recorded.source, Path) else Path("recording")
        return {
            "name": path.name,
            "path": str(path.absolute()),
            "ticks": ticks,
            "rate": self.built.scene.device.rate,
            "events": [
                {"tick": tick + 1, "kind": _kind(what), "text": what} for tick, what in recorded.events if tick < ticks
            ],
            "note": self._recording_note(),
        }

    def _recording_note(self) -> str | None:
        """Say what is to be known about a recording that is not whole."""
        recorded, ticks = self._replayed.recorded, self._replayed.ticks
        if recorded.dropped is None:
            return "The file was cut short; this is what it has."
        if recorded.dropped > 0:
            return f"{recorded.dropped} ticks were not recorded: what follows tick {ticks} cannot be computed again."
        return None

    def _replay_header(self) -> dict[str, Any]:
        replayed, difference = self._replayed, self._replayed.difference
        divergence = None
        if difference is not None:
            divergence = {"tick": difference.tick + 1, "of": difference.of, "quantity": difference.quantity}
        return {
            "tick": replayed.ticks_done,
            "goal": self._goal,
            "playing": self._playing,
            "speed": self._speed,
            "checked": replayed.checked,
            "restarts": replayed.restarts,
            "difference": divergence and {**divergence, "text": str(difference)},
            "settings": self.settings(),
        }


def _kind(what: str) -> str:
    """Name what a mark on the time line stands for."""
    return next((kind for kind in ("reset", "strike") if what.startswith(kind)), "fault")
