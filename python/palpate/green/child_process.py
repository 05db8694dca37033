"""Child processes that compute beside the program: how they start and end, and what they write about their work.

A child reads its job as a pickle from its standard input, and writes a line of JSON on its standard output for whatever
has happened. Where its input ends the program that started it is gone, and it ends.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import IO, Any, NoReturn

from palpate.errors import Error

# Time that a child has to end after its input has, s.
PATIENCE = 2.0


def start_child(what: str) -> subprocess.Popen[bytes]:
    """Start a child that computes ``columns`` or a ``series``, with pipes to its standard input and output."""
    command = [sys.executable, "-m", "palpate.green.child", what]
    # In a session of its own: Ctrl-C in a terminal is for this process, which ends the child.
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)


def end_child(child: subprocess.Popen[bytes]) -> None:
    """Close the input of a child, and wait until it has ended."""
    assert child.stdin is not None
    with contextlib.suppress(OSError):
        child.stdin.close()
    try:
        child.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()


def send_job(to: IO[bytes], job: dict[str, Any]) -> None:
    """Write the job of a child."""
    pickle.dump(job, to)
    to.flush()


def send_line(to: IO[bytes], value: Any) -> None:
    """Write a line of JSON for a child."""
    to.write((json.dumps(value) + "\n").encode())
    to.flush()


def received_job() -> dict[str, Any]:
    """Return the job of this child."""
    return pickle.load(sys.stdin.buffer)


def received_lines() -> Iterator[Any]:
    """Yield what the program writes after the job; ends this child where the program is gone."""
    for line in sys.stdin.buffer:
        yield json.loads(line)
    # Not sys.exit: threads of the computation would be waited for.
    os._exit(0)


def send(**message: Any) -> None:
    """Write a line for the program that started this child."""
    sys.stdout.write(json.dumps(message) + "\n")
    sys.stdout.flush()


def progress_sender(whole: str) -> Callable[[int, int], None]:
    """Return a progress that writes a line when a number has changed; ``whole`` is the name of the number of all."""
    sent = None

    def progress(done: int, count: int) -> None:
        nonlocal sent
        if count and sent != (done, count):
            sent = (done, count)
            send(**{"done": done, whole: count})

    return progress


def compute_and_exit(compute: Callable[[], object], store: object) -> NoReturn:
    """Compute, write how that has ended, and end this child; ``store`` is named where the system refuses its file."""
    try:
        compute()
        send(finished=True)
    except Error as error:
        send(error=str(error))
    except OSError as error:
        send(error=f"{store}: {error.strerror or error}")
    # The reading thread holds the lock of standard input, with which the interpreter cannot end.
    os._exit(0)
