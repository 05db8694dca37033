"""A long work of the server: beside the event loop, cancelled by a person, and reported to all pages."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

from palpate.errors import Error, ViewerError, system_text
from palpate.mesh.tetrahedralize import STAGES
from palpate.progress import Reporter

Result = TypeVar("Result")
LOG = logging.getLogger(__name__)


class CancellableTask:
    """A computation that a person may cancel.

    It runs on a daemon thread, which the end of the program does not wait for. Cancelled, it stops at its next report
    of progress; a library without reports computes to its end, and the result is dropped.
    """

    def __init__(self) -> None:
        self._cancelled = threading.Event()
        self._stopped = asyncio.Event()

    def cancel(self) -> None:
        """Stop, as soon as the computation next reports."""
        self._cancelled.set()
        self._stopped.set()

    @property
    def is_cancelled(self) -> bool:
        """Whether it has been cancelled."""
        return self._cancelled.is_set()

    def require_wanted(self) -> None:
        """Raise ViewerError once it is cancelled."""
        if self._cancelled.is_set():
            raise ViewerError("cancelled: the body shown before stays")

    async def run(self, work: Callable[[], Result], discard: Callable[[Result], None]) -> Result:
        """Do ``work()`` and return its result; one that comes after cancelling is handed to ``discard``.

        Raises ViewerError if it was cancelled.
        """
        loop = asyncio.get_running_loop()
        done: asyncio.Future[Result] = loop.create_future()

        def finish(result: Result | None, error: BaseException | None) -> None:
            if self._cancelled.is_set():
                if error is None:
                    discard(result)  # type: ignore[arg-type]
            elif error is not None:
                done.set_exception(error)
            else:
                done.set_result(result)  # type: ignore[arg-type]

        def compute() -> None:
            result, error = None, None
            try:
                result = work()
            except BaseException as raised:
                error = raised
            # The loop of events is closed if the server has ended meanwhile.
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(finish, result, error)

        threading.Thread(target=compute, name="palpate-long-work", daemon=True).start()
        stopped = asyncio.ensure_future(self._stopped.wait())
        await asyncio.wait({done, stopped}, return_when=asyncio.FIRST_COMPLETED)
        stopped.cancel()
        self.require_wanted()
        return done.result()


def status(text: str, progress: float | None = None, left_s: float | None = None) -> dict[str, Any]:
    """Message of a long work; an empty text ends it."""
    return {"type": "status", "text": text, "progress": progress, "left_s": left_s}


def error_message(error: BaseException) -> dict[str, Any]:
    """Message of what went wrong; a mistake of a user, a full disk, or one of the program."""
    if isinstance(error, Error):
        text = str(error)
    elif isinstance(error, OSError) and error.strerror:
        text = system_text(error)
    else:
        text = f"a mistake within palpate, please report it: {error!r}"
        LOG.error("a mistake within palpate", exc_info=error)
    return {"type": "error", "text": text}


class StatusReporter(Reporter):
    """Sends how far a work is, from any thread; it begins with the first call. Made on the thread of the event loop.

    The work stops where a page has cancelled it. The time left follows from the pace of a phase; stages of filling take
    different times, and have none. ``send_all`` sends a message to all pages, on the thread of the event loop.
    """

    def __init__(self, text: str, work: CancellableTask, send_all: Callable[[dict[str, Any]], None]):
        super().__init__(self._count, self._begin)
        self._text, self._work, self._send_all = text, work, send_all
        self._loop = asyncio.get_running_loop()
        self._phase = ""
        self._began: float | None = None

    def _begin(self, phase: str) -> None:
        self._work.require_wanted()
        self._phase, self._began = phase, None
        self._send(None, None)

    def _count(self, done: int, total: int) -> None:
        self._work.require_wanted()
        self._began = self._began or time.monotonic()
        part = done / max(total, 1)
        known = part > 0.02 and self._phase not in STAGES
        self._send(part, (time.monotonic() - self._began) * (1.0 - part) / part if known else None)

    def _send(self, part: float | None, left_s: float | None) -> None:
        text = f"{self._text}: {self._phase}" if self._phase else self._text
        message = status(text, part, left_s)
        self._loop.call_soon_threadsafe(self._send_all, message)
