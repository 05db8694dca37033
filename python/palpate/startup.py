"""Handling of Ctrl-C during imports of the command line: one line and exit code 130, no traceback."""

from __future__ import annotations

import os
import signal
import sys
import threading


def end_quietly_when_interrupted() -> None:
    """Until :func:`restore_interrupts`, end a process that is the command line; change nothing in any other."""
    in_main = threading.current_thread() is threading.main_thread()
    if in_main and _is_command_line() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def restore_interrupts() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _is_command_line() -> bool:
    arguments = sys.orig_argv[1:]
    program = os.path.basename(arguments[0]) if arguments else ""
    return program == "palpate" or arguments[:2] == ["-m", "palpate"]


def _end(*_signal: object) -> None:
    # Nothing has begun that would have to be ended in order.
    os.write(2, b"palpate: interrupted\n")
    os._exit(130)
