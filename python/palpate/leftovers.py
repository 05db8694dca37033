"""Unfinished files of killed processes: beside their place, named after it and the process.

Files are written as ``<name>.<process>.new`` (stores), ``<name>.<process>.partial`` (what stands beside them) or
``.<process>.<name>`` (everything else) and renamed when they are complete. A process that is killed leaves them, in
full size; the next writer there removes them. Processes are those of this machine: what one in another container
writes into the same folder looks like a leftover.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import sys
from pathlib import Path

_NAMES = (re.compile(r"(?P<name>.+)\.(?P<process>\d+)\.(new|partial)"), re.compile(r"\.(?P<process>\d+)\.(?P<name>.+)"))


def remove_leftovers(path: Path) -> None:
    """Remove what killed processes left of a file that is about to be written."""
    if not path.parent.is_dir():
        return
    for file in path.parent.iterdir():
        if is_leftover(file, path.name):
            if file.is_dir():
                shutil.rmtree(file, ignore_errors=True)
                continue
            with contextlib.suppress(OSError):
                file.unlink()


def is_leftover(file: Path, name: str | None = None) -> bool:
    """Whether a process that is gone was writing this file; of a file ``name`` alone if it is given."""
    match = next(filter(None, (pattern.fullmatch(file.name) for pattern in _NAMES)), None)
    if match is None or name not in (None, match["name"]):
        return False
    return not _runs(int(match["process"]))


def _runs(process: int) -> bool:
    if sys.platform == "win32":
        return _runs_on_windows(process)
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        # Somebody else's process; or no process at all, and no file of ours.
        return True
    return True


def _runs_on_windows(process: int) -> bool:
    """Ask for the exit code: ``os.kill`` would end the process there, or the program that asks."""
    import ctypes

    limited_information, still_active, refused = 0x1000, 259, 5
    kernel = ctypes.WinDLL("kernel32", use_last_error=True)
    kernel.OpenProcess.restype = ctypes.c_void_p
    handle = kernel.OpenProcess(limited_information, False, process)
    if not handle:
        return ctypes.get_last_error() == refused
    code = ctypes.c_ulong()
    known = kernel.GetExitCodeProcess(ctypes.c_void_p(handle), ctypes.byref(code))
    kernel.CloseHandle(ctypes.c_void_p(handle))
    return not known or code.value == still_active
