"""What a server shows, the pages that show it, and how another session takes its place while pages stay connected."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, TypeVar

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from palpate.errors import Error, ViewerError
from palpate.viewer.computing import Computing
from palpate.viewer.fields import ClientView
from palpate.viewer.session import Session
from palpate.viewer.setup_session import SetupSession
from palpate.viewer.status import CancellableTask, StatusReporter, error_message, status

# Messages a second that a page may send.
MAX_RATE = 1500.0
# A page that does not take a message for this long is disconnected, s: what is sent to it would pile up.
STALLED_AFTER = 10.0
Shown = Session | SetupSession
Result = TypeVar("Result")

ONE_SCENE = "a recording is of one scene, and this one has another now"
# How long the end of a server waits for a long work that was cancelled, s.
CANCEL_PATIENCE = 5.0


@dataclass(eq=False)
class Client:
    """One connected page."""

    connection: ServerConnection
    shown: Session | SetupSession | None = None
    # The session whose frames failed, once the page has the error message.
    refused: Session | SetupSession | None = None
    wants: ClientView = field(default_factory=ClientView)
    sent: int = 0
    log_seen: tuple[int, int] = (0, 0)
    may_send: asyncio.Event = field(default_factory=asyncio.Event)
    last_message: float = field(default_factory=time.monotonic)
    allowance: float = MAX_RATE
    # Messages to be written; the future of one, if it has one, is set when it is written.
    _outgoing: asyncio.Queue[tuple[str | bytes, asyncio.Future[None] | None]] = field(default_factory=asyncio.Queue)

    def send(self, message: dict[str, Any]) -> None:
        """Send a text message, without waiting for this page: the others would wait, too."""
        self._outgoing.put_nowait((json.dumps(message), None))

    async def send_now(self, data: bytes) -> None:
        """Send a binary message after all that was sent before, and wait until it is written."""
        written: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._outgoing.put_nowait((data, written))
        await written

    async def write(self) -> None:
        """Write what is sent, until the connection ends; one that takes nothing for long is ended."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                data, written = await self._outgoing.get()
                try:
                    await asyncio.wait_for(self.connection.send(data), STALLED_AFTER)
                except asyncio.TimeoutError:
                    self.abort()
                    return
                if written is not None and not written.done():
                    written.set_result(None)

    def abort(self) -> None:
        """End the connection without a word: its page takes none."""
        self.connection.transport.abort()

    def is_within_rate(self) -> bool:
        """Count a message that has come; False for one too many."""
        now = time.monotonic()
        self.allowance = min(self.allowance + (now - self.last_message) * MAX_RATE, MAX_RATE) - 1.0
        self.last_message = now
        return self.allowance >= 0.0


class SessionHost:
    """A session, the thread that works with it, what is computed beside it, and the pages that show it.

    One long work at a time prepares another session. All that touches the session is done on the worker's thread, one
    thing after the other; what is done there asks for the session when its turn comes, not before.
    """

    def __init__(self, session: Shown):
        self._session = session
        self._computing = Computing(session.growing)
        self._computing.begin()
        session.start()
        # A single thread keeps frames, settings and commands of the running simulation in order without locks.
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="palpate-session")
        self._clients: list[Client] = []
        self._controller: Client | None = None
        self._building: CancellableTask | None = None
        self._work: asyncio.Task[None] | None = None
        # Of the long work, for pages that open meanwhile.
        self._status: dict[str, Any] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    # Pages.

    def send_all(self, message: dict[str, Any] | None, but_control: bool = False) -> None:
        """Send a message to all pages, or to those that watch; None is no message. On the thread of the event loop."""
        if message is None:
            return
        if message["type"] == "status":
            self._status = message if message["text"] else None
        for client in self._clients:
            if not (but_control and client is self._controller):
                client.send(message)

    def send_control(self, message: dict[str, Any]) -> None:
        """Send a message to the page in control."""
        if self._controller is not None:
            self._controller.send(message)

    async def send_settings(self) -> None:
        """Send all pages what the sliders show."""
        self.send_all(await self.with_session(lambda session: session.settings()))

    # The session.

    @property
    def session(self) -> Shown:
        """What is shown."""
        return self._session

    async def call(self, work: Callable[..., Result], *arguments: Any) -> Result:
        """Do ``work(*arguments)`` on the worker's thread, and return its result or raise its error."""
        return await asyncio.get_running_loop().run_in_executor(self._worker, work, *arguments)

    async def with_session(self, work: Callable[[Any], Result]) -> Result:
        """Do ``work(session)`` on the worker's thread, with the session that is shown when its turn comes."""
        return await self.call(lambda: work(self._session))

    def exchange(self, session: Shown) -> None:
        """Put a session in the place of the one that runs. If it does not start, the one before runs again.

        On the worker's thread. The old loop ends first: two at real-time priority would keep each other from their
        deadlines. A recording of it ends, and pages get the message about that.
        """
        before = self._session
        self._stop(before)
        try:
            session.start()
        except BaseException as error:
            discard(session)
            self._resume(before)
            if isinstance(error, Error):
                raise type(error)(f"{error}; the scene shown before stays") from error
            raise
        self._session = session

    def replace(self, session: Shown) -> None:
        """Exchange sessions, and what is computed beside them."""
        self.exchange(session)
        self._computing.close()
        self._computing = Computing(session.growing)
        self._computing.begin()

    def computed(self) -> dict[str, Any]:
        """Message with what can be touched by now. On the worker's thread."""
        return self._computing.message(self._session)

    def take_computed(self) -> dict[str, Any] | None:
        """Give the loop what has become ready: the message about it, if there is something new. On the same thread."""
        return self._computing.step(self._session)

    def restore(self, before: Shown) -> None:
        """Put a session back that another had taken the place of. On the worker's thread."""
        self._stop(self._session)
        self._resume(before)

    def _stop(self, session: Shown) -> None:
        recorded = session.recorder.stop(ONE_SCENE)
        if recorded is not None and self._loop is not None:
            self._loop.call_soon_threadsafe(self.send_all, recorded)
        session.release()
        session.close()

    def _resume(self, session: Shown) -> None:
        session.resume()
        self._session = session
        # Its tools may be moved otherwise now: pages get the scene anew.
        for client in self._clients:
            client.shown = None

    # Long work.

    def begin_building(self) -> CancellableTask:
        """Begin something long; ViewerError while another is not done."""
        self.require_idle()
        self._building = CancellableTask()
        return self._building

    @property
    def is_building(self) -> bool:
        """Whether something long is under way."""
        return self._building is not None

    def require_idle(self) -> None:
        """Raise ViewerError for what would get in the way of a long work that is under way."""
        if self.is_building:
            raise ViewerError("wait until what is being prepared is ready, or cancel it")

    def work(self, coroutine: Coroutine[Any, Any, None]) -> None:
        """Do the long work that has begun, beside all else."""
        self._work = asyncio.create_task(coroutine)

    def cancel(self) -> None:
        """Cancel the long work, if there is one."""
        if self._building is not None:
            self._building.cancel()

    async def end_work(self) -> None:
        """Cancel the long work, and wait until pages have its end."""
        self.cancel()
        if self._work is not None:
            await asyncio.wait({self._work}, timeout=CANCEL_PATIENCE)

    def finish_building(self) -> None:
        """Let another long work begin, and send pages that this one has ended."""
        self._building = None
        self.send_all(status(""))

    def reporter(self, text: str, work: CancellableTask) -> StatusReporter:
        """Send all pages how far a long work is."""
        return StatusReporter(text, work, self.send_all)

    async def switch(
        self, text: str, make: Callable[[], Session], exchange: Callable[[Session], None], building: CancellableTask
    ) -> None:
        """Make a session beside the one that runs, and put it in its place."""
        try:
            self.send_all(status(text))
            await self.with_session(lambda session: session.release())
            session = await building.run(make, discard)
            await self.call(exchange, session)
        except Exception as error:
            # None of any kind may leave the pages without a message.
            self.send_all(error_message(error))
        finally:
            await self.send_settings()
            self.finish_building()


def discard(session: Shown) -> None:
    """End a session that is not shown, and what is computed beside it."""
    session.close()
    Computing(session.growing).close()
