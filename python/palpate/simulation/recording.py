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


@dataclass(frozen=True, eq=False, repr=False)
class Recording(ComparedByValue):
    """Ticks of an offline run. Compared by value, number by number; not hashable.

    Attributes
    ----------
    time
        (t,) s.
    forces, torques
        On the device, (t, 3) N and N m about the tip, for positions (t, 3); (t, tools, 3) for positions (t, tools, 3).
    displacements
        (t, watched nodes, 3) m, in the frames of the bodies.
    limited
        (t,) or (t, tools): whether the limit of strain kept a tool from following its device.
    energies
        For each body over the ticks; None for one that does not move.

    """

    time: np.ndarray
    forces: np.ndarray
    torques: np.ndarray
    displacements: np.ndarray
    limited: np.ndarray
    energies: tuple[Energy | None, ...]

    @property
    def energy(self) -> Energy | None:
        """Of the first body that moves; None if none does."""
        return next((energy for energy in self.energies if energy is not None), None)

    def __repr__(self) -> str:
        largest = np.linalg.norm(self.forces, axis=-1).max(initial=0.0)
        watched = f"{self.displacements.shape[1]} nodes watched"
        return f"Recording({len(self.time)} ticks, largest force {largest:.4g} N, {watched})"
