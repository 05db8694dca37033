"""Child processes for meshers, which bad surfaces crash or hang: limited in time, and gone with their parent."""

from __future__ import annotations

import os
import signal
import subprocess


def run_limited(command: list[str], time_limit: float) -> int | None:
    """Exit status of a child in a process group of its own; None if it ran out of time."""
    # Its input stays open as long as this process lives: the child's end_with_parent watches it.
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return process.wait(time_limit)
    except subprocess.TimeoutExpired:
        return None
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        process.stdin.close()


def failure_of(status: int | None, time_limit: float) -> str | None:
    """Say how a mesher failed; None if it did not."""
    if status is None:
        return f"did not finish in {time_limit:g} s and was stopped"
    if status < 0:
        return f"crashed ({signal.Signals(-status).name})"
    return "returned no tetrahedra" if status else None
