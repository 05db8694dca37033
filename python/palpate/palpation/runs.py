"""Execution of the runs of a palpation; finished ones are kept in a file until the last one is, and not repeated.

The file begins with a mark and the key, a hash of everything that determines the forces. Each run is appended as a head
of three numbers (its rank, its ticks, the CRC-32 of what follows), its forces and whether strain was limited at each
tick. What a killed process left behind the last whole run is cut off. A file with another key is not used.
"""

from __future__ import annotations

import hashlib
import json
import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from palpate.atomic import naming
from palpate.body import surface_strain_terms
from palpate.errors import SimulationError
from palpate.progress import progress_reporter
from palpate.scene import BodyMotion, BuiltBody, BuiltScene
from palpate.simulation import Simulation

MARK = b"palpate palpation 1\n"
_HEAD = struct.Struct("<III")

Run = tuple[np.ndarray, np.ndarray]
# What of a device is for a hand alone: a palpation has none. The limit of force stands, and what it holds is told.
WITHOUT_A_HAND = {"ramp": 0.0, "max_slew": 1e12}
# Nor is a body at rest to be made softer than it is. In motion the coupling is part of the scheme.
ANY_STIFFNESS = 1e9


class PartialFile:
    """Finished runs: forces on the device (t, 3), N, and whether strain was limited (t,), by rank.

    As a context manager it is closed at the end, and stays; :meth:`remove` takes it away.

    Parameters
    ----------
    path
        Where it is; None keeps nothing.
    key
        Of 64 characters.

    Attributes
    ----------
    runs
        What is finished.
    found
        How many runs stood in the file before.

    """

    def __init__(self, path: Path | None, key: str):
        self.runs: dict[int, Run] = {}
        self._path, self._stream = path, None
        head = MARK + key.encode()
        if path is not None:
            known = path.read_bytes() if path.is_file() else b""
            end = self._read(known, len(head)) if known.startswith(head) else 0
            self._stream = path.open("r+b" if end else "wb")
            if end:
                self._stream.truncate(end)
                self._stream.seek(end)
            else:
                self._stream.write(head)
                self._stream.flush()
        self.found = len(self.runs)

    def __enter__(self) -> PartialFile:
        return self

    def __exit__(self, *_error: object) -> None:
        if self._stream is not None:
            # What could not be written is tried again.
            with naming(self._path):
                self._stream.close()

    def keep(self, rank: int, run: Run) -> None:
        """Add a finished run; it is in the system's hands when this returns."""
        self.runs[rank] = run
        if self._stream is None:
            return
        forces, limited = run
        content = np.asarray(forces, dtype="<f8").tobytes() + np.asarray(limited, dtype="u1").tobytes()
        with naming(self._path):
            self._stream.write(_HEAD.pack(rank, len(limited), zlib.crc32(content)) + content)
            self._stream.flush()

    def remove(self) -> None:
        """Take the file away: what it held stands elsewhere."""
        if self._path is not None and self._stream is not None:
            self._stream.close()
            self._path.unlink(missing_ok=True)

    def _read(self, content: bytes, at: int) -> int:
        """Take over the runs from a place on; where the last whole one ends."""
        while at + _HEAD.size <= len(content):
            rank, ticks, check = _HEAD.unpack_from(content, at)
            begin, end = at + _HEAD.size, at + _HEAD.size + 25 * ticks
            # Zeros, as power losses leave them, are no run.
            if ticks == 0 or end > len(content) or zlib.crc32(content[begin:end]) != check:
                break
            forces = np.frombuffer(content, "<f8", 3 * ticks, begin).reshape(-1, 3)
            self.runs[rank] = forces, np.frombuffer(content, "u1", ticks, begin + 24 * ticks).astype(bool)
            at = end
        return at


@dataclass(frozen=True)
class Path3D:
    """Where a tool goes: positions (t, 3), m, and orientations (t, 4), unit quaternions w x y z, tick by tick."""

    positions: np.ndarray
    orientations: np.ndarray


def probe(built: BuiltScene) -> BuiltScene:
    """Scene with its first tool alone, on a device that a protocol drives."""
    device = dict(WITHOUT_A_HAND)
    if not any(body.motion for body in built.bodies):
        device["max_stiffness"] = ANY_STIFFNESS
    scene = built.scene
    changed = {"tools": scene.tools[:1], "device": scene.device.model_copy(update=device)}
    return replace(built, scene=scene.model_copy(update=changed))


def run_all(
    simulation: Simulation, paths: Sequence[Path3D], partial: Path | None, progress: bool | Callable[[int, int], None]
) -> tuple[list[Run], int]:
    """Run each path from a body at rest; also report how many runs were known already.

    A run is the forces on the device (t, 3), N, and whether strain was limited (t,). Raises SimulationError for a fault
    that latched, with the run that it latched in.
    """
    with (
        PartialFile(partial, key_of(simulation, paths)) as partial_runs,
        progress_reporter("palpating", progress) as report,
    ):
        for rank, path in enumerate(paths):
            if rank not in partial_runs.runs:
                try:
                    recording = simulation._play(path.positions, path.orientations)
                except SimulationError as error:
                    raise SimulationError(f"run {rank} of the palpation: {error}") from None
                partial_runs.keep(rank, (recording.forces, recording.limited))
            if report is not None:
                report(rank + 1, len(paths))
        runs = [partial_runs.runs[rank] for rank in range(len(paths))]
    return runs, partial_runs.found


def key_of(simulation: Simulation, paths: Sequence[Path3D]) -> str:
    """Hash of everything that determines the forces: bodies, tool, limits, version, and every position."""
    scene = simulation.scene
    motions = [_motion_of(body.motion) for body in simulation.bodies]
    identity = {
        "version": version("palpate"),
        "bodies": [(body.green.key, body.position, body.orientation) for body in simulation.bodies],
        "motions": repr(motions),
        "laws": [_laws_of(body) for body in simulation.bodies],
        "tools": [tool.model_dump() for tool in scene.tools],
        "shape": repr(scene.tools[0].shape_arguments(scene.folder)),
        "device": scene.device.model_dump(),
        "strain_limit": scene.view.strain_limit,
        "ticks": [len(path.positions) for path in paths],
    }
    digest = hashlib.sha256(json.dumps(identity, sort_keys=True).encode())
    for path in paths:
        digest.update(np.ascontiguousarray(path.positions).tobytes())
        digest.update(np.ascontiguousarray(path.orientations).tobytes())
    return digest.hexdigest()


def _laws_of(body: BuiltBody) -> str | None:
    """Hash of what the laws of a body's materials differ in: a store holds their constants at small strain only."""
    return None if body.body is None else hashlib.sha256(surface_strain_terms(body.body).tobytes()).hexdigest()


def _motion_of(motion: BodyMotion | None) -> tuple[object, ...] | None:
    if motion is None:
        return None
    modes = motion.basis.eigenvalues.tolist()  # some of those of its key
    return (motion.basis.key, modes, motion.scheme, motion.exact, motion.coupling)
