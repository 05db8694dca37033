"""Recordings of runs and of sessions, and the log of a running loop."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from palpate import _native
from palpate.atomic import written_beside
from palpate.dynamics import Energy
from palpate.equality import ComparedByValue
from palpate.errors import SceneError
from palpate.input_file import require_file, require_writable
from palpate.simulation.about import require_readable, shown_of

LOG_DTYPE = np.dtype(
    [("time", "f8"), ("position", "f8", 3), ("force", "f8", 3), ("compute_us", "f8"), ("wakeup_us", "f8")]
    + [("watched", "f8", 3), ("body_time", "f8")]
    + [(name, "f8") for name in ("kinetic", "strain", "coupling", "dissipated", "work")]
)
CONTACT_DTYPE = np.dtype(
    [("tick", "u8"), ("tool", "u1"), ("body", "u1"), ("grab", "?"), ("slipping", "?"), ("limited", "?")]
    + [(name, "f4", 3) for name in ("point", "normal", "force", "torque")]
    + [(name, "f4") for name in ("radius", "depth", "stiffness", "error")]
)
# Columns of tools, and how many numbers they have a tool.
VECTORS = {
    "positions": 3,
    "orientations": 4,
    "velocities": 3,
    "angular_velocities": 3,
    "forces": 3,
    "torques": 3,
    "computed_forces": 3,
    "computed_torques": 3,
    "port_energy": 3,
}


def _of_tools(columns: Mapping[str, Any], name: str) -> np.ndarray:
    """Give a column of tools in the shape of the positions that were given."""
    given, single = shown_of(columns["about"])
    each = (VECTORS[name],) if name in VECTORS else ()
    values = columns[name].reshape(-1, int(columns["about"]["tools"]), *each)
    return values[:, 0] if single else values[:, :given]


def _column(name: str, description: str) -> Any:
    """Make the property that gives a column of tools."""

    def read(recording: Recording) -> np.ndarray:
        return _of_tools(recording._columns, name)

    return property(read, doc=description)


def require_new_recording(path: Path) -> None:
    """Refuse a file that exists, or a place where none can be put, before a loop runs that is to be recorded there."""
    require_writable(path, SceneError)
    if path.exists():
        raise SceneError(f"{path}: exists: give another name, or delete it first")


@dataclass(frozen=True)
class RecordingStatus:
    """How the recording of a running loop is doing.

    Attributes
    ----------
    path
        The file.
    ticks
        Written so far.
    size
        Of the file, bytes.
    dropped
        Ticks that could not be written.
    error
        Why nothing is written any more; None if all is well.

    """

    path: Path
    ticks: int
    size: int
    dropped: int
    error: str | None


@dataclass(frozen=True, eq=False, repr=False)
class Recording(ComparedByValue):
    """Ticks of an offline run or of a recorded session. Compared by value, number by number; not hashable.

    Arrays of tools are (t, ...) where the positions were given as (t, 3), or the scene has one tool, and else
    (t, tools, ...).

    Attributes
    ----------
    time
        (t,) s, at the end of each tick.
    forces, torques
        On the device after the safety stage, (t, 3) or (t, tools, 3), N and N m about the tip.
    displacements
        (t, watched nodes, 3) m, in the frames of the bodies; of a run that was watched, not kept in a file.
    limited
        (t,) or (t, tools): whether the limit of strain kept a tool from following its device.
    energies
        For each body over the ticks; None for one that does not move.
    dropped
        Ticks that could not be written; None for a file that was cut short.
    source
        The file, or its bytes.

    """

    time: np.ndarray
    forces: np.ndarray
    torques: np.ndarray
    displacements: np.ndarray
    limited: np.ndarray
    energies: tuple[Energy | None, ...]
    dropped: int | None = field(default=0, compare=False)
    source: bytes | Path = field(default=b"", compare=False)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Recording:
        """Read a recording (MCAP); of one that was cut short, all up to there.

        Raises
        ------
        Error
            A file that cannot be read, or is no recording.

        """
        source = Path(path)
        require_file(source, SceneError)
        return cls._of(source)

    @classmethod
    def _of(cls, source: bytes | Path) -> Recording:
        columns = _columns_of(source)
        number = columns["number"]
        rate = float(columns["about"]["rate"])
        if columns["about"]["clock"] == "0":
            time = np.arange(1, len(number) + 1) / rate
        else:
            due = columns["due_ns"]
            time = 1e-9 * (due - due[:1]) + 1 / rate
        energies = _energies(columns, len(number))
        forces, torques = _of_tools(columns, "forces"), _of_tools(columns, "torques")
        watched = np.zeros((len(number), 0, 3))
        recording = cls(
            time, forces, torques, watched, _of_tools(columns, "limited"), energies, columns["dropped"], source
        )
        recording.__dict__["_columns"] = columns
        return recording

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a file (MCAP) that Foxglove, the tools of ROS 2 and :meth:`load` read.

        Raises
        ------
        SceneError
            There is no folder to put it in, or a folder has that name.
        OSError
            The file cannot be written; nothing is left of it.

        """
        require_writable(Path(path), SceneError)
        data = self.source if isinstance(self.source, bytes) else self.source.read_bytes()
        with written_beside(Path(path)) as partial:
            partial.write_bytes(data)

    @property
    def energy(self) -> Energy | None:
        """Of the first body that moves; None if none does."""
        return next((energy for energy in self.energies if energy is not None), None)

    @property
    def about(self) -> Mapping[str, str]:
        """What the recording says of itself: scene, version, keys of the bodies."""
        return self._columns["about"]

    @property
    def contacts(self) -> np.ndarray:
        """Rows of CONTACT_DTYPE in the order of ticks: vectors in the scene, m and N on the body, to five digits.

        ``error`` is the estimated relative error of the force; 0 for a linear material.
        """
        state = self._columns["contact_state"].reshape(-1, 6)
        numbers = self._columns["contact_numbers"].reshape(-1, 16)
        rows = np.zeros(len(state), CONTACT_DTYPE)
        for rank, name in enumerate(("tick", "tool", "body")):
            rows[name] = state[:, rank]
        rows["grab"], rows["slipping"], rows["limited"] = state[:, 3] == 2, state[:, 4] > 0, state[:, 5] > 0
        for rank, name in enumerate(("point", "normal", "force", "torque")):
            rows[name] = numbers[:, 3 * rank : 3 * rank + 3]
        for rank, name in enumerate(("radius", "depth", "stiffness", "error")):
            rows[name] = numbers[:, 12 + rank]
        return rows

    @property
    def ticks(self) -> np.ndarray:
        """(t,) number of each tick since the recording began; where some were dropped, they are missing."""
        return self._columns["number"]

    positions = _column("positions", "Of the tips as measured, (t, 3) or (t, tools, 3), m.")
    orientations = _column("orientations", "Of the tools, (t, 4) or (t, tools, 4), unit quaternions w x y z.")
    velocities = _column("velocities", "Of the tips as measured, (t, 3) or (t, tools, 3), m/s.")
    angular_velocities = _column("angular_velocities", "As measured, (t, 3) or (t, tools, 3), rad/s.")
    computed_forces = _column("computed_forces", "Before the safety stage, (t, 3) or (t, tools, 3), N.")
    computed_torques = _column(
        "computed_torques", "Before the safety stage, (t, 3) or (t, tools, 3), N m about the tips."
    )
    port_energy = _column("port_energy", "Given to the hand, owed and never paid, (t, 3) or (t, tools, 3), J.")
    buttons = _column("buttons", "(t,) or (t, tools): a bit for each button held.")
    active = _column("active", "(t,) or (t, tools): whether a tool is in the scene.")

    @property
    def compute_us(self) -> np.ndarray:
        """(t,) that the ticks took, us; 0 without a clock."""
        return self._columns["compute_us"]

    @property
    def wakeup_us(self) -> np.ndarray:
        """(t,) from when each tick was due to when it began, us; 0 without a clock."""
        return self._columns["delay_us"]

    @property
    def events(self) -> Sequence[tuple[int, str]]:
        """Ticks and what happened in them: resets, strikes, faults."""
        return self._columns["events"]

    @property
    def settings(self) -> Sequence[Mapping[str, Any]]:
        """Settings in the order in which they came into force, from the tick ``tick`` on.

        ``contact_radius`` (m) and ``friction`` are of each tool, ``stiffness_scale`` of each body, ``strain_limit`` and
        ``time_scale`` of the scene. ``strike_body``, ``strike_point`` (m), ``strike_impulse`` (N s), ``strike_radius``
        (m) and ``strike_duration`` (s) are those of the latest strike.
        """
        bodies = len(json.loads(self.about["keys"]))
        return [{**row, "stiffness_scale": row["stiffness_scale"][:bodies]} for row in self._columns["settings"]]

    @cached_property
    def _columns(self) -> dict[str, Any]:
        return _columns_of(self.source)

    def __repr__(self) -> str:
        largest = np.linalg.norm(self.forces, axis=-1).max(initial=0.0)
        watched = f"{self.displacements.shape[1]} nodes watched"
        return f"Recording({len(self.time)} ticks, largest force {largest:.4g} N, {watched})"


def _columns_of(source: bytes | Path) -> dict[str, Any]:
    columns = _native.read_recording(source)
    require_readable(columns["about"], str(source) if isinstance(source, Path) else "the recording")
    return columns


def _energies(columns: dict[str, Any], ticks: int) -> tuple[Energy | None, ...]:
    """For each body; None for one that has none in any tick."""
    rows = columns["bodies"].reshape(-1, 8)
    energies: list[Energy | None] = []
    for body in range(len(json.loads(columns["about"]["keys"]))):
        own = rows[rows[:, 1] == body]
        energies.append(Energy(*own[:, 3:].T) if len(own) == ticks and ticks else None)
    return tuple(energies)
