"""One connection: bounded memory in both directions, and never a wait."""

from __future__ import annotations

import socket

from palpate.openigtlink.messages import Message, MessageError, Reader

# A message must be complete, and one that goes out must be taken up, within this time, s.
PATIENCE = 5.0
# Bytes taken from a peer at a time: a hundred poses, and a tick's share of the thread.
MOST_READ = 16_384
# Bytes that the system keeps for a slow peer: what it gets is not older than about a second.
MOST_SENT = 16_384


class Peer:
    """A peer that has connected: its socket, which this object closes, and its address."""

    def __init__(self, connection: socket.socket, name: str):
        connection.setblocking(False)
        # Small messages at 60 Hz: none waits for the next one.
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, MOST_SENT)
        self.connection, self.name = connection, name
        self._reader = Reader()
        self._unsent = b""
        self._reading_since = self._sending_since = 0.0

    def read(self, now: float) -> list[Message]:
        """Messages that have become complete.

        Raises MessageError for bytes that are no message; ConnectionError for a peer that has gone.
        """
        try:
            data = self.connection.recv(MOST_READ)
        except (BlockingIOError, InterruptedError):
            return []
        if not data:
            raise ConnectionError("it closed the connection")
        if not self._reader.is_within_message:
            self._reading_since = now
        messages = self._reader.push(data)
        if messages:
            self._reading_since = now
        return messages

    def send(self, data: bytes, now: float) -> bool:
        """Send data if the peer has taken up all that was sent before; else leave it out: frames are never queued.

        Raises OSError for a peer that has gone.
        """
        if self._unsent:
            return False
        self._unsent, self._sending_since = data, now
        self.flush()
        return True

    def flush(self) -> None:
        """Send on what the peer takes up."""
        if self._unsent:
            try:
                sent = self.connection.send(self._unsent)
            except (BlockingIOError, InterruptedError):
                return
            self._unsent = self._unsent[sent:]

    def require_alive(self, now: float) -> None:
        """Raise MessageError for a peer that has stopped within a message, or takes nothing up."""
        if self._reader.is_within_message and now - self._reading_since > PATIENCE:
            raise MessageError(f"a message was not complete after {PATIENCE:g} s")
        if self._unsent and now - self._sending_since > PATIENCE:
            raise MessageError(f"it has read nothing for {PATIENCE:g} s")

    def close(self) -> None:
        """Close the connection."""
        self.connection.close()
