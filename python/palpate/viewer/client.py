"""A page that is connected to the server."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from dataclasses import dataclass, field
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from palpate.viewer.fields import ClientView
from palpate.viewer.session import Session
from palpate.viewer.setup_session import SetupSession

# Messages a second that a page may send.
MAX_RATE = 1500.0
# A page that does not take a message for this long is disconnected, s: what is sent to it would pile up.
STALLED_AFTER = 10.0


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
