"""A long computation on a thread beside the event loop of the server."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable
from typing import TypeVar

from palpate.errors import ViewerError

Result = TypeVar("Result")


class CancellableTask:
    """A computation that a person may cancel.

    It runs on a thread that nobody waits for at the end of the program. Cancelled, it stops at its next report of
    progress; a library that gives none goes on to its end, unheard.
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
            # Nobody waits any more where the server has ended meanwhile.
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(finish, result, error)

        threading.Thread(target=compute, name="palpate-long-work", daemon=True).start()
        stopped = asyncio.ensure_future(self._stopped.wait())
        await asyncio.wait({done, stopped}, return_when=asyncio.FIRST_COMPLETED)
        stopped.cancel()
        self.require_wanted()
        return done.result()
