"""What ticks leave behind: the log of a running loop, the recording of an offline run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LOG_DTYPE = np.dtype(
    [("time", "f8"), ("position", "f8", 3), ("force", "f8", 3), ("compute_us", "f8"), ("wakeup_us", "f8")]
    + [("watched", "f8", 3), ("body_time", "f8")]
    + [(name, "f8") for name in ("kinetic", "strain", "coupling", "dissipated", "work")]
)
# Ticks a second.
RATE = 1000.0


@dataclass(frozen=True)
class MotionEnergy:
    """Energies of a body in motion, J: a number, or an array over the ticks of a recording.

    Attributes
    ----------
    kinetic, strain, coupling
        Of the body's motion, of its deformation, and of the springs between tools and body.
    dissipated, work
        Taken out by damping, and done by tools and strikes, since the start.

    """

    kinetic: float | np.ndarray
    strain: float | np.ndarray
    coupling: float | np.ndarray
    dissipated: float | np.ndarray
    work: float | np.ndarray

    @property
    def total(self) -> float | np.ndarray:
        """What the body and its couplings hold now, J."""
        return self.kinetic + self.strain + self.coupling


@dataclass(frozen=True)
class Recording:
    """Ticks of an offline run.

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
    energy: MotionEnergy | None
