"""Handling of Ctrl-C during imports of the command line: one line and exit code 130, no traceback."""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType

# An interrupt within an import comes again after this time, s.
AGAIN = 0.02


def end_quietly_when_interrupted() -> None:
    """Until :func:`restore_interrupts`, end a process that is the command line; change nothing in any other."""
    in_main = threading.current_thread() is threading.main_thread()
    if in_main and _is_command_line() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def restore_interrupts() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again, but not within an import: that is over first."""
    if signal.getsignal(signal.SIGINT) in (_end, signal.default_int_handler):
        signal.signal(signal.SIGINT, _interrupt)


def _is_command_line() -> bool:
    arguments = sys.orig_argv[1:]
    program = os.path.basename(arguments[0]) if arguments else ""
    return program == "palpate" or arguments[:2] == ["-m", "palpate"]


def _end(*_signal: object) -> None:
    # Nothing has begun that would have to be ended in order.
    os.write(2, b"palpate: interrupted\n")
    os._exit(130)


def _interrupt(_signal: int, frame: FrameType | None) -> None:
    # Modules that try whether others are there take any exception for an answer, and the command would go on.
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            again = threading.Timer(AGAIN, _interrupt_main_thread)
            again.daemon = True
            again.start()
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def _interrupt_main_thread() -> None:
    if sys.platform == "win32":
        signal.raise_signal(signal.SIGINT)
    else:
        # A signal of this thread would not wake the other one from what it waits for.
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
