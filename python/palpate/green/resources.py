"""Memory of this process and what a limit leaves of it; disk space that a store and its partial file need."""

from __future__ import annotations

import os
import shutil
from bisect import bisect_right
from dataclasses import dataclass
from pathlib import Path

from palpate.errors import BodyError, StoreError
from palpate.units import memory as memory_units

# Linux describes this process here.
_PROCESS = Path("/proc/self/statm")
# Bytes of a number in the store, and in the finished blocks beside it.
STORED = {"f16": 2, "f32": 4, "f64": 8}
KEPT = {"f16": 4, "f32": 4, "f64": 8}


def memory_in_use() -> int:
    """Bytes that this process holds in memory now; 0 where the system does not report them."""
    if not _PROCESS.exists():
        return 0
    return int(_PROCESS.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def available_memory() -> int | None:
    """Bytes that this machine can still give, as far as the system reports it; None where it does not."""
    if not _PROCESS.exists():
        return None
    lines = dict(line.split(":", 1) for line in Path("/proc/meminfo").read_text().splitlines())
    kilobytes = lines.get("MemAvailable", "").split()
    return 1024 * int(kilobytes[0]) if kilobytes else None


def allowed_memory(limit: int | str) -> int:
    """Bytes that may still be taken when the process as a whole may reach ``limit`` bytes, or text such as ``"8GB"``.

    Raises BodyError if nothing is left.
    """
    total, used = memory_units(limit), memory_in_use()
    if not total > used:
        raise BodyError(f"a memory limit of {total / 1e9:.3g} GB is less than the {used / 1e9:.3g} GB already in use")
    return int(total - used)


@dataclass(frozen=True)
class DiskUse:
    """Bytes that a precomputation takes on the disk."""

    store: int  # the finished store
    # Finished blocks beside it, until it is finished. Of two entries that mirror each other one is kept.
    partial: int
    before: int  # the store of the stage before the last, which is replaced by rename

    @property
    def peak(self) -> int:
        """All of it at once: while the last store is written."""
        return self.store + self.partial + self.before

    @classmethod
    def of(cls, columns: int, rows: int, precision: str, in_stages: bool) -> DiskUse:
        """Count for an operator of so many columns and rows."""
        store = STORED[precision] * columns * rows
        partial = KEPT[precision] * (columns * rows - columns * (columns - 1) // 2)
        # Each stage but the last is written; the last is about as large as all before it.
        return cls(store, partial, store // 2 if in_stages else 0)


def require_room(target: Path, columns: int, rows: int, precision: str, in_stages: bool) -> None:
    """Raise StoreError if the files of a precomputation have no room beside ``target``, and say what would."""
    free = free_bytes(target)
    needed = DiskUse.of(columns, rows, precision, in_stages)
    if needed.peak <= free:
        return
    raise StoreError(
        f"{target}: the store in {precision} takes {_gb(needed.store)} and its unfinished columns "
        f"{_gb(needed.partial)} beside it, {_gb(needed.peak)} in all, but {_gb(free)} are free there: "
        f"{_fitting_alternatives(columns, rows, precision, in_stages, free)}"
    )


def free_bytes(target: Path) -> int:
    """Bytes free for ``target``: those of its file system, and what an unfinished computation of it holds already."""
    partial = target.with_name(f"{target.name}.partial")
    held = partial.stat().st_blocks * 512 if partial.exists() else 0
    return shutil.disk_usage(target.absolute().parent).free + held


def _fitting_alternatives(columns: int, rows: int, precision: str, in_stages: bool, free: int) -> str:
    others = [
        f"'{other}' takes {_gb(smaller.peak)}"
        for other in STORED
        if STORED[other] < STORED[precision] and (smaller := DiskUse.of(columns, rows, other, in_stages)).peak <= free
    ]
    counts = range(1, columns // 3 + 1)
    fitting = bisect_right(counts, free, key=lambda nodes: DiskUse.of(3 * nodes, rows, precision, in_stages).peak)
    region = [f"a touch region of up to {fitting} of the {columns // 3} nodes fits"] if fitting else []
    return ", ".join([*region, *others, "or name a file on a larger disk"])


def _gb(size: int) -> str:
    return f"{size / 1e9:.3g} GB"
