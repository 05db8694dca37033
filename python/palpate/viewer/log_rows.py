"""Rows of the log and of the history that clients have not seen."""

from __future__ import annotations

import numpy as np

# Rows of the 1 kHz log kept for slow clients.
LOG_KEPT = 4000


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
