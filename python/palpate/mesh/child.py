"""Child processes for meshers, which may crash or hang: they have a time limit and end with their parent."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable

# Exit status of a mesher's process that could not read or write its files.
FILES_FAILED = 3
OUT_OF_PROCESSOR_TIME = "used up its processor time and was stopped"
# How often a child's stage is looked at, s.
LOOK = 0.1


def run_limited(command: list[str], time_limit: float, watch: Callable[[], None] | None = None) -> int | None:
    """Exit status of a child in a process group of its own; None if it ran out of time.

    ``watch`` is called now and then while it runs.
    """
    # Its input stays open as long as this process lives: the child's end_with_parent watches it.
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        deadline = time.monotonic() + time_limit
        while watch is not None and process.poll() is None and time.monotonic() < deadline:
            watch()
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(LOOK)
        return process.wait(max(deadline - time.monotonic(), 0.0))
    except subprocess.TimeoutExpired:
        return None
    finally:
        if process.poll() is None:
            _kill(process)
            process.wait()
        process.stdin.close()


def _kill(process: subprocess.Popen) -> None:
    """End a child, and its own children where the system has process groups."""
    if hasattr(os, "killpg"):
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


def failure_of(status: int | None, time_limit: float) -> str | None:
    """Say how a mesher failed; None if it did not."""
    if status is None:
        return f"did not finish in {time_limit:g} s and was stopped"
    if hasattr(signal, "SIGXCPU") and status == -signal.SIGXCPU:
        return OUT_OF_PROCESSOR_TIME
    if status < 0:
        return f"crashed ({signal.Signals(-status).name})"
    if status == FILES_FAILED:
        return f"could not write its files in {tempfile.gettempdir()} (is there room on that disk?)"
    return "returned no tetrahedra" if status else None
