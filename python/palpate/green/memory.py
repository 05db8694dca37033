"""Memory of this process, and the remainder of a memory limit."""

from __future__ import annotations

import os
from pathlib import Path

from palpate.errors import BodyError
from palpate.units import memory as memory_units

# Linux describes this process here.
_PROCESS = Path("/proc/self/statm")


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
