"""What a session keeps of its loop: the last rows of the log and of the history, and recordings as files."""

from __future__ import annotations

import shlex
import time
from pathlib import Path
from typing import Any

import numpy as np

from palpate.errors import ViewerError
from palpate.simulation import RecordingStatus, Simulation

# Rows of the 1 kHz log kept for slow clients.
LOG_KEPT = 4000
# Names are told apart by seconds; so many recordings may begin within one.
MOST_IN_A_SECOND = 100


class RecentRows:
    """The last rows of a growing table; clients say how many they have seen."""

    def __init__(self, columns: int):
        self._rows = np.zeros((0, columns))
        self.end = 0

    def append(self, rows: np.ndarray) -> None:
        """Add rows; the oldest go."""
        self._rows = np.vstack([self._rows, rows])[-LOG_KEPT:]
        self.end += len(rows)

    def clear(self) -> None:
        """Forget all rows."""
        self._rows = self._rows[:0]

    def since(self, seen: int) -> np.ndarray:
        """Rows beyond so many."""
        return self._rows[max(len(self._rows) - max(self.end - seen, 0), 0) :]


def downsampled(rows: np.ndarray, most: int, peaks: int | None = None) -> np.ndarray:
    """Rows that a frame may carry, evenly; of the column ``peaks`` the largest value of each group is kept."""
    stride = -(-len(rows) // most) or 1
    thin = rows[::stride].copy()
    if peaks is not None and stride > 1 and len(rows):
        thin[:, peaks] = np.maximum.reduceat(rows[:, peaks], np.arange(0, len(rows), stride))
    return thin


class SessionRecorder:
    """Recordings of a running loop, as files of a folder."""

    def __init__(self, simulation: Simulation, folder: Path):
        self._simulation, self._folder = simulation, folder

    def start(self) -> None:
        """Record in a new file, named by scene and time; no file is ever written over.

        Raises Error if the file cannot be written, or the loop is being recorded already.
        """
        if self._simulation.recording is not None:
            raise ViewerError("record: this session is being recorded already")
        path = self._free_path()
        try:
            self._simulation.record(path)
        except OSError as error:
            raise ViewerError(f"cannot record in {path}: {error.strerror or error}") from None

    def stop(self, reason: str | None = None) -> dict[str, Any] | None:
        """End the recording, if there is one: the message about it, with the reason if nobody asked for it."""
        status = self._simulation.stop_recording()
        if status is None:
            return None
        replay = f"palpate replay {shlex.quote(str(status.path))}"
        return {"type": "recorded", **self._status_message(status), "replay": replay, "reason": reason}

    def stop_after_failure(self) -> dict[str, Any] | None:
        """End a recording that cannot go on: the message with the reason."""
        status = self._simulation.recording
        return None if status is None or status.error is None else self.stop()

    def header(self) -> dict[str, Any] | None:
        """Part of a frame message: how the recording is doing."""
        status = self._simulation.recording
        return None if status is None else self._status_message(status)

    def _free_path(self) -> Path:
        stem = f"{self._simulation.scene.name}-{time.strftime('%Y%m%d-%H%M%S')}"
        names = [f"{stem}.mcap", *(f"{stem}-{number}.mcap" for number in range(2, MOST_IN_A_SECOND + 1))]
        paths = (self._folder.absolute() / name.replace("/", "-") for name in names)
        free = next((path for path in paths if not path.exists()), None)
        if free is None:
            raise ViewerError(f"{self._folder}: too many recordings within this second: try again")
        return free

    def _status_message(self, status: RecordingStatus) -> dict[str, Any]:
        return {
            "path": str(status.path.absolute()),
            "ticks": status.ticks,
            "seconds": status.ticks / self._simulation.scene.device.rate,
            "size": status.size,
            "dropped": status.dropped,
            "error": status.error,
        }
