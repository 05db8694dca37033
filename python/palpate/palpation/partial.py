"""Runs of a palpation that are finished, kept in a file until the last one is.

The file begins with a mark and the key, a hash of everything that determines the forces. Each run is appended as a head
of three numbers (its rank, its ticks, the CRC-32 of what follows), its forces and whether strain was limited at each
tick. What a killed process left behind the last whole run is cut off. A file with another key is not used.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from palpate.atomic import naming

MARK = b"palpate palpation 1\n"
_HEAD = struct.Struct("<III")

Run = tuple[np.ndarray, np.ndarray]


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
