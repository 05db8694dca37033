"""Frames of a recording, replayed at the rate of a film."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from palpate import _native
from palpate.errors import Error, RecordingWarning
from palpate.scene import BuiltScene, Scene
from palpate.simulation import Frame, Recording, frame_of, simulation_of, ticks_before_gap


@dataclass(frozen=True)
class Span:
    """What of a recording is shown, and how often."""

    # s since the recording began; no end is that of the recording.
    start: float = 0.0
    end: float | None = None
    rate: float = 30.0  # frames a second

    def ticks(self, time: np.ndarray) -> np.ndarray:
        """Rows of ``time`` (t,), s: of each frame the first tick that is not before it.

        Raises Error if nothing lies within the span, or for a rate that is not positive.
        """
        if not (np.isfinite(self.rate) and self.rate > 0):
            raise Error(f"the rate of frames must be positive, got {self.rate:g}")
        within = self.within(time)
        count = int((time[within[-1]] - time[within[0]]) * self.rate) + 1
        wanted = time[within[0]] + np.arange(count) / self.rate
        # Half a nanosecond of room for the rounding of the times.
        return np.unique(np.minimum(np.searchsorted(time, wanted - 5e-10), within[-1]))

    def within(self, time: np.ndarray) -> np.ndarray:
        """Rows of ``time`` (t,), s, that lie within the span; Error if there are none."""
        end = np.inf if self.end is None else self.end
        rows = np.flatnonzero((time >= self.start) & (time <= end))
        if len(time) == 0:
            raise Error("the recording is empty: there is nothing to write")
        if len(rows) == 0:
            upto = "on" if self.end is None else f"to {self.end:g} s"
            raise Error(f"nothing was recorded from {self.start:g} s {upto}: the recording is {time[-1]:.3f} s long")
        return rows


@dataclass(frozen=True)
class RecordedFrame:
    """A frame, and what the recording says of it."""

    row: int  # of the recording
    time: float  # since the recording began, s
    frame: Frame  # bodies, tools and contacts
    present: np.ndarray  # (tools,): whether each is in the scene


class RecordedFrames:
    """Frames of a recording, each time they are asked for made again from its first tick.

    Parameters
    ----------
    recording
        Up to its first tick that was dropped.
    span
        Which frames.
    scene
        In place of that of the recording, with the same bodies.

    Attributes
    ----------
    simulation
        What it was made with.
    rows
        Of the recording, one a frame.

    Raises
    ------
    Error
        Bodies that cannot be built or are not those of the recording, or a span without frames.

    """

    def __init__(self, recording: Recording, span: Span, scene: Scene | BuiltScene | None = None):
        whole = ticks_before_gap(recording)
        if whole < len(recording.ticks):
            _warn(f"ticks were dropped after {recording.time[whole - 1]:.3f} s: frames end there")
        self.recording = recording
        self.rows = span.ticks(recording.time[:whole])
        self.simulation = simulation_of(recording, scene)
        tools = len(self.simulation.scene.tools)
        columns = recording.active.reshape(len(recording.ticks), -1)
        self._present = np.zeros((len(columns), tools), dtype=bool)
        self._present[:, : columns.shape[1]] = columns
        self._warned = False

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[RecordedFrame]:
        again = _native.Replay(self.simulation._core, self.recording.source)
        done = 0
        for row in self.rows.tolist():
            _, differences = again.step(row + 1 - done)
            done = row + 1
            if differences and not self._warned:
                tick, of, quantity = differences[0][:3]
                _warn(
                    f"frames differ from the recording from tick {tick} on ({of} {quantity}); was it made by "
                    "another version?"
                )
                self._warned = True
            frame = frame_of(again.frame(), self.simulation.bodies)
            yield RecordedFrame(row, float(self.recording.time[row]), frame, self._present[row])


def _warn(text: str) -> None:
    warnings.warn(text, RecordingWarning, stacklevel=3)
