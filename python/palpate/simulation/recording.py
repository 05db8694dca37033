"""What ticks leave behind: the log of a running loop, the recording of an offline run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.dynamics import Energy
from palpate.equality import ComparedByValue

LOG_DTYPE = np.dtype(
    [("time", "f8"), ("position", "f8", 3), ("force", "f8", 3), ("compute_us", "f8"), ("wakeup_us", "f8")]
    + [("watched", "f8", 3), ("body_time", "f8")]
    + [(name, "f8") for name in ("kinetic", "strain", "coupling", "dissipated", "work")]
)
# Ticks a second.
RATE = 1000.0


@dataclass(frozen=True, eq=False, repr=False)
class Recording(ComparedByValue):
    """Ticks of an offline run. Compared by value, number by number; not hashable.

    Attributes
    ----------
    time
        (t,) s.
    forces
        (t, 3) N on the device.
    displacements
        (t, watched nodes, 3) m.
    energy
        Over the ticks; None for a body that does not move.

    """

    time: np.ndarray
    forces: np.ndarray
    displacements: np.ndarray
    energy: Energy | None

    def __repr__(self) -> str:
        largest = np.linalg.norm(self.forces, axis=1).max(initial=0.0)
        watched = f"{self.displacements.shape[1]} nodes watched"
        return f"Recording({len(self.time)} ticks, largest force {largest:.4g} N, {watched})"
