"""How far a long work is, reported to all pages."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Any

from palpate.mesh.tetrahedralize import STAGES
from palpate.progress import Reporter
from palpate.viewer.background import CancellableTask


def status(text: str, progress: float | None = None, left_s: float | None = None) -> dict[str, Any]:
    """Message of a long work; an empty text ends it."""
    return {"type": "status", "text": text, "progress": progress, "left_s": left_s}


class StatusReporter(Reporter):
    """Sends how far a work is, from any thread; it begins with the first call. Made on the thread of the event loop.

    The work stops where a page has cancelled it. The time left follows from the pace of a phase; stages of filling take
    different times, and have none.

    Parameters
    ----------
    text
        What is done.
    work
        The work, which a page may cancel.
    send_all
        Sends a message to all pages.

    """

    def __init__(self, text: str, work: CancellableTask, send_all: Callable[[dict[str, Any]], Awaitable[None]]):
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
        self._loop.call_soon_threadsafe(lambda: self._loop.create_task(self._send_all(message)))
