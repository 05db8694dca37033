"""Poses of a client's frames in 16 bits, as differences from the frame that it had before.

A displacement is told in steps of ``extent 2^-17``, the extent being the longest side of the body at rest, or in steps
that are a power of two larger where 16 bits would not hold the largest one. So it is off by half a step: 4e-6 of the
body where displacements reach up to a quarter of it, 1.5e-5 where they are as long as the body; a picture of 4000
pixels across is off by a sixteenth of a pixel at most. Numbers of steps are subtracted without loss, modulo 2^16, and
what has not moved is not sent. A client has at most one frame that it has not acknowledged: both know the one before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

# Finest step over the extent of the body, and the largest number of steps.
FINEST, RANGE = 2.0**-17, 32767
# Arrays of a message.
Arrays = dict[str, tuple[str, np.ndarray]]


@dataclass(frozen=True)
class _Steps:
    """A pose in steps: frame, step (m), numbers of steps (v, 3), values of the field (v,)."""

    frame: int
    step: float
    steps: np.ndarray
    scalar: np.ndarray


@dataclass(frozen=True)
class CodedPoses:
    """Entries of a frame's header and arrays, of each body.

    A header has the number of rows, the step, m, and the frame that is the base, None for a whole pose. ``moved`` and
    ``colored`` are masks of the rows that differ from the base, the lowest bit of a byte first; ``steps`` (m, 3) are
    the differences of the first, ``scalar`` (c,) the values of the second. Of a whole pose all rows are there, without
    masks.
    """

    headers: list[dict[str, Any]]
    arrays: list[Arrays]


@dataclass
class PoseCoder:
    """Codes the poses of one client's frames."""

    _known: list[_Steps] = field(default_factory=list)

    def forget(self) -> None:
        """Code the next poses as a whole."""
        self._known = []

    def code(self, frame: int, poses: Sequence[tuple[np.ndarray, np.ndarray, float]]) -> CodedPoses:
        """Code displacements (v, 3), m, values of the field (v,) from 0 to 255, and the extent, m, of each body."""
        now = [_in_steps(frame, *pose) for pose in poses]
        known = self._known if len(self._known) == len(now) else [None] * len(now)
        coded = [_coded(one, base) for one, base in zip(now, known, strict=True)]
        self._known = now
        return CodedPoses([header for header, _ in coded], [arrays for _, arrays in coded])


class PoseReader:
    """Reads what a :class:`PoseCoder` has coded, for programs other than the page."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def read(self, header: Mapping[str, Any], arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Arrays of a frame, with the displacements, m, and the values of the field in place of what is coded."""
        poses = {}
        for body, told in enumerate(header["poses"]):
            coded = {name: arrays.pop(f"{body}/{name}") for name in ("moved", "steps", "colored", "scalar")}
            self._known[body] = steps, scalar = self._added(body, told, coded)
            poses |= {f"{body}/displacements": told["step"] * steps, f"{body}/scalar": scalar}
        return {**arrays, **poses}

    def _added(
        self, body: int, told: Mapping[str, Any], coded: Mapping[str, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        if told["base"] is None:
            return coded["steps"], coded["scalar"]
        steps, scalar = (known.copy() for known in self._known[body])
        moved, colored = (
            np.unpackbits(coded[name], count=told["rows"], bitorder="little") for name in ("moved", "colored")
        )
        steps[moved == 1] += coded["steps"]
        scalar[colored == 1] = coded["scalar"]
        return steps, scalar


def _in_steps(frame: int, displacements: np.ndarray, scalar: np.ndarray, extent: float) -> _Steps:
    step, largest = FINEST * extent, float(np.abs(displacements).max(initial=0.0))
    while largest > RANGE * step:
        step *= 2.0
    return _Steps(frame, step, np.rint(displacements / step).astype(np.int16), np.asarray(scalar, dtype=np.uint8))


def _coded(now: _Steps, base: _Steps | None) -> tuple[dict[str, Any], Arrays]:
    header = {"rows": len(now.steps), "step": now.step, "base": None}
    if base is None or base.step != now.step or len(base.steps) != len(now.steps):
        none = ("u1", np.zeros(0))
        return header, {"moved": none, "steps": ("i2", now.steps), "colored": none, "scalar": ("u1", now.scalar)}
    # Differences of numbers of 16 bits wrap, and so do the sums that undo them.
    differences = now.steps - base.steps
    moved, colored = (differences != 0).any(axis=1), now.scalar != base.scalar
    told = differences[moved]
    short = np.array_equal(told, told.astype(np.int8))
    header["base"] = base.frame
    return header, {
        "moved": ("u1", np.packbits(moved, bitorder="little")),
        "steps": ("i1" if short else "i2", told),
        "colored": ("u1", np.packbits(colored, bitorder="little")),
        "scalar": ("u1", now.scalar[colored]),
    }
