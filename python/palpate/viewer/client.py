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

from palpate.viewer.session import ClientView, Session
from palpate.viewer.setup_session import SetupSession

# Messages a second that a page may send.
MAX_RATE = 1500.0


@dataclass(eq=False)
class Client:
    """One connected page."""

    connection: ServerConnection
    shown: Session | SetupSession | None = None
    # Of which it was told that its loop does not run.
    refused: Session | SetupSession | None = None
    wants: ClientView = field(default_factory=ClientView)
    sent: int = 0
    log_seen: tuple[int, int] = (0, 0)
    may_send: asyncio.Event = field(default_factory=asyncio.Event)
    last_message: float = field(default_factory=time.monotonic)
    allowance: float = MAX_RATE

    async def send(self, message: dict[str, Any]) -> None:
        """Send a text message; a client that has gone is left to its own handler."""
        with contextlib.suppress(ConnectionClosed):
            await self.connection.send(json.dumps(message))

    def is_within_rate(self) -> bool:
        """Count a message that has come; False for one too many."""
        now = time.monotonic()
        self.allowance = min(self.allowance + (now - self.last_message) * MAX_RATE, MAX_RATE) - 1.0
        self.last_message = now
        return self.allowance >= 0.0
