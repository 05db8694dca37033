"""Simulation that replays a recording up to any tick."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from palpate import _native
from palpate.errors import SceneError
from palpate.scene import BuiltScene, Scene
from palpate.simulation.about import measured_by_surface
from palpate.simulation.connecting import assume_recorded
from palpate.simulation.frame import PERCENTILES, Frame, frame_of
from palpate.simulation.recording import LOG_DTYPE, Recording
from palpate.simulation.replay import Difference, built_scene_of, ticks_before_gap
from palpate.simulation.simulation import Simulation

# Ticks between two looks at the clock.
SLICE = 50
# Rows of the log are kept this long before the latest tick, s.
LOG_SECONDS = 10.0


class ReplayedSimulation(Simulation):
    """Frames and log of a recording, as those of a running loop; commands have no effect on them.

    Parameters
    ----------
    recorded
        The recording.
    scene
        The scene that should give the same; None takes that of the recording.

    Attributes
    ----------
    scene_as_built
        The scene that computes it again.
    ticks
        How many of its ticks can be made again.
    ticks_done
        How many of them have been made, up to the one that is shown.
    checked
        How many have been compared with what was recorded.
    restarts
        How often it went back: only from the first tick can the others be made.
    difference
        The first; None if so far every bit is the same.

    Raises
    ------
    Error
        A recording without a tick, or of bodies that cannot be built or are others now.

    """

    def __init__(self, recorded: Recording, scene: Scene | BuiltScene | None = None):
        self.scene_as_built = built_scene_of(recorded, scene)
        super().__init__(self.scene_as_built)
        self._by_surface = measured_by_surface(recorded.about)
        self._arm_strain_limit()
        assume_recorded(self._core, recorded.about)
        self.recorded, self.ticks = recorded, ticks_before_gap(recorded)
        if self.ticks == 0:
            raise SceneError("the recording has no tick that can be computed again")
        self.checked, self.restarts = 0, 0
        self.difference: Difference | None = None
        # Of all ticks: what computing took then, not now.
        self._timing = {"compute_us": _percentiles(recorded.compute_us), "wakeup_us": _percentiles(recorded.wakeup_us)}
        self._begin()
        self.advance(1, 0.0)

    def _begin(self) -> None:
        self._again = _native.Replay(self._core, self.recorded.source)
        self.ticks_done = 0
        self._rows: list[np.ndarray] = []
        self._frame: Frame | None = None

    def advance(self, tick: int, seconds: float) -> None:
        """Make ticks up to and with the ``tick``-th, counted from 1, for about so many seconds at most."""
        if tick < self.ticks_done:
            self._begin()
            self.restarts += 1
        end = time.monotonic() + seconds
        while self.ticks_done < tick:
            ticks, found = self._again.step(min(SLICE, tick - self.ticks_done))
            if ticks == 0:
                # The file ends here.
                self.ticks = self.ticks_done
                break
            self.ticks_done += ticks
            self._compare(found)
            self._take_log(tick)
            if time.monotonic() > end:
                break

    def _compare(self, found: list[tuple[int, str, str, list[float], list[float]]]) -> None:
        if found and self.difference is None:
            tick, of, quantity, recorded, replayed = found[0]
            self.difference = Difference(tick, of, quantity, tuple(recorded), tuple(replayed))
        self.checked = max(self.checked, self.ticks_done)
        self._frame = None

    def _take_log(self, goal: int) -> None:
        rows = np.ascontiguousarray(self._again.drain_log()).view(LOG_DTYPE)
        if goal - self.ticks_done < LOG_SECONDS * self.scene.device.rate:
            self._rows.append(rows)

    def _settings(self) -> dict[str, Any]:
        return self._again.settings()

    @property
    def watched(self) -> tuple[int, int] | None:
        """Body and rank of the surface node that was watched at the tick that is shown."""
        return self._again.settings()["watched"]

    def frame(self) -> Frame:
        """Read the latest tick that was made; its timing is that of the recording."""
        if self._frame is None:
            raw = {**self._again.frame(), "ticks": self.ticks_done, **self._timing}
            self._frame = self._flagged(frame_of(raw, self.bodies), self.bodies)
        return self._frame

    def _read_frame(self) -> Frame:
        return self.frame()

    def drain_log(self) -> np.ndarray:
        """Rows since the last call, none older than :data:`LOG_SECONDS` where many ticks were made at once."""
        rows = np.concatenate([np.empty(0, LOG_DTYPE), *self._rows])
        self._rows = []
        ticks = np.rint(rows["time"] * self.scene.device.rate).astype(int) - 1
        known = (ticks >= 0) & (ticks < len(self.recorded.compute_us))
        rows["compute_us"][known] = self.recorded.compute_us[ticks[known]]
        return rows

    def watch(self, node: int, body: int = 0) -> None:
        """Nothing: what was watched is in the recording."""

    def set_time_scale(self, time_scale: float) -> None:
        """Nothing: it is in the recording."""


def _percentiles(microseconds: np.ndarray) -> list[float]:
    found: Any = np.percentile(microseconds, [50, 99, 99.9, 100])
    assert len(found) == len(PERCENTILES)
    return found.tolist()
