"""The thread that serves peers: it accepts, reads, sends at a rate, and calls trackers that are servers themselves.

Each connection has bounded memory in both directions, and never waits.
"""

from __future__ import annotations

import contextlib
import errno
import selectors
import socket
import sys
import threading
import time

from palpate.errors import ViewerError
from palpate.openigtlink.link import Link
from palpate.openigtlink.messages import Message, MessageError, Reader

# A message must be complete, and one that goes out must be taken up, within this time, s.
PATIENCE = 5.0
# Bytes taken from a peer at a time: a hundred poses, and a tick's share of the thread.
MOST_READ = 16_384
# Bytes that the system keeps for a slow peer: what it gets is not older than about a second.
MOST_SENT = 16_384
PORT = 18944
MOST_PEERS = 8
# Time between two calls of a tracker that does not answer, s.
REDIAL = 1.0


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


class LinkServer:
    """Serves a link on a port, on this machine alone unless another host is given.

    As a context manager it runs on a thread of its own. That thread never waits for a peer, and the force loop never
    waits for it.

    Parameters
    ----------
    link
        What peers say goes there, and what they get comes from it.
    port
        0 takes a free one; None listens nowhere.
    host
        Address to listen on.
    rate
        How often the state is sent, Hz.
    tracker
        Host and port of a server to be called besides, such as that of PLUS.

    Raises
    ------
    ViewerError
        A port that is in use, a host that this machine does not have, or a tracker whose name is unknown.

    """

    def __init__(
        self,
        link: Link,
        port: int | None = PORT,
        *,
        host: str = "127.0.0.1",
        rate: float = 100.0,
        tracker: tuple[str, int] | None = None,
    ):
        self.link, self._period = link, 1.0 / rate
        self._tracker = None if tracker is None else _resolved(*tracker)
        self._selector = selectors.DefaultSelector()
        self._peers: dict[socket.socket, Peer] = {}
        self._listener: socket.socket | None = None
        self._called: socket.socket | None = None
        self._redial = 0.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="palpate-igtl", daemon=True)
        if port is not None:
            self._listener = _listening(host, port)
            self._selector.register(self._listener, selectors.EVENT_READ)

    @property
    def port(self) -> int | None:
        """The port on which it listens."""
        return None if self._listener is None else int(self._listener.getsockname()[1])

    def __enter__(self) -> LinkServer:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.stop()

    def stop(self) -> None:
        """End the thread, and close all connections."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        for peer in list(self._peers.values()):
            self._drop(peer, None)
        for open_socket in (self._listener, self._called):
            if open_socket is not None:
                open_socket.close()
        self._selector.close()

    def _serve(self) -> None:
        due = time.monotonic()
        while not self._stop.is_set():
            now = time.monotonic()
            for key, _ in self._selector.select(max(0.0, min(due - now, 0.1))):
                self._ready(key.fileobj, time.monotonic())
            now = time.monotonic()
            self._call_tracker(now)
            if now >= due:
                # A state that could not be sent in time is left out.
                due = max(due + self._period, now)
                self._send_state(now)

    def _ready(self, which: object, now: float) -> None:
        if which is self._listener:
            self._accept()
        elif which is self._called:
            self._connected()
        elif (peer := self._peers.get(which)) is not None:  # type: ignore[call-overload]
            try:
                for message in peer.read(now):
                    answer = self.link.take(peer, message, now)
                    if answer is not None:
                        peer.send(answer, now)
            except (MessageError, OSError) as error:
                self._drop(peer, error)

    def _accept(self) -> None:
        assert self._listener is not None
        try:
            connection, address = self._listener.accept()
        except OSError:
            return
        if len(self._peers) >= MOST_PEERS:
            connection.close()
            return
        self._add(connection, f"{address[0]}:{address[1]}")

    def _add(self, connection: socket.socket, name: str) -> None:
        self._peers[connection] = Peer(connection, name)
        self._selector.register(connection, selectors.EVENT_READ)

    def _drop(self, peer: Peer, error: Exception | None) -> None:
        self._selector.unregister(peer.connection)
        del self._peers[peer.connection]
        self.link.let_go(peer)
        peer.close()
        if isinstance(error, MessageError):
            print(f"palpate: note: OpenIGTLink: {peer.name} was disconnected: {error}", file=sys.stderr, flush=True)

    def _send_state(self, now: float) -> None:
        self.link.let_go_of_silent(now)
        state = self.link.state() if self._peers else None
        for peer in list(self._peers.values()):
            try:
                peer.flush()
                if state is not None:
                    peer.send(state, now)
                peer.require_alive(now)
            except (MessageError, OSError) as error:
                self._drop(peer, error)

    def _call_tracker(self, now: float) -> None:
        if self._tracker is None or self._called is not None or now < self._redial:
            return
        name = f"{self._tracker[0]}:{self._tracker[1]}"
        if any(peer.name == name for peer in self._peers.values()):
            return
        self._redial = now + REDIAL
        self._called = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._called.setblocking(False)
        try:
            begun = self._called.connect_ex(self._tracker)
        except OSError:
            begun = -1
        if begun not in (0, errno.EINPROGRESS):
            self._called.close()
            self._called = None
            return
        self._selector.register(self._called, selectors.EVENT_WRITE)

    def _connected(self) -> None:
        called, self._called = self._called, None
        assert called is not None and self._tracker is not None
        self._selector.unregister(called)
        if called.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) != 0:
            called.close()
            return
        self._add(called, f"{self._tracker[0]}:{self._tracker[1]}")


def _resolved(host: str, port: int) -> tuple[str, int]:
    """Address of a tracker: what is looked up later would keep the peers waiting."""
    try:
        found = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_STREAM)
    except (OSError, OverflowError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ViewerError(f"OpenIGTLink: the host '{host}' of --igtl-from is unknown: {reason}") from None
    return found[0][4][:2]  # type: ignore[return-value]


def _listening(host: str, port: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except (OSError, OverflowError) as error:
        with contextlib.suppress(OSError):
            listener.close()
        raise ViewerError(f"OpenIGTLink cannot listen on {host}:{port}: {error}; give another port to --igtl") from None
    listener.listen(MOST_PEERS)
    listener.setblocking(False)
    return listener
