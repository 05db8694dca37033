"""The viewer's server: access, control, and frames at the rate of each client."""

from __future__ import annotations

import asyncio
import errno
import gc
import secrets
import sys
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from palpate.errors import Error, ViewerError
from palpate.green import BackgroundPrecompute
from palpate.scene import BuiltScene, Scene
from palpate.viewer import messages
from palpate.viewer.fields import SurfaceMap
from palpate.viewer.pages import load_pages, port_in_use, reachable, respond
from palpate.viewer.session import Session, choices
from palpate.viewer.session_host import Client, SessionHost
from palpate.viewer.setting_up import MAX_PART, SettingUp
from palpate.viewer.setup_session import SetupSession
from palpate.viewer.status import LOG, error_message

VERSION = version("palpate")
DEFAULT_PORT = 8642
FRAME_RATE = 60.0
# Bounds on what a client may send and how many there may be.
MAX_MESSAGE = 4096
MAX_CLIENTS = 16
HELLO_TIMEOUT = 5.0
# A controller that says nothing for this long, not even that it drew a frame, is lost: its contact is released, s.
LOST_AFTER = 2.0
# Before a frame that failed is tried again, and between two checks for a lost page and for finished columns, s.
STOPPED_PAUSE = LOOK_PAUSE = 0.25
# How long the server waits for connections to close before it ends them, s.
CLOSE_PATIENCE = 3.0
# Between two looks whether a body that is set up has been drawn anew, s.
SET_UP_PAUSE = 0.05
# A page that answers no ping for this long is gone, s. It reads messages one at a time: the next ones wait, pings too.
PING_PATIENCE = 30
BAD_TOKEN = 4401
# So often threads pass on the interpreter's lock while the server runs, s; Python's own 5 ms add up to a visible halt
# where the event loop takes the lock several times for one message.
SWITCH_INTERVAL = 1e-3


class ViewerServer(SessionHost):
    """Serves one session.

    Parameters
    ----------
    built
        What is shown first: a scene, or a session with one; None is an empty page, in which a body is set up.
    host, port
        Where it listens; port 0 takes a free one.
    models
        Names the page may choose from, each made a scene by ``scene_of``.
    scene_of
        Scene of a model.
    record
        New file in which what is shown first is recorded.
    recordings
        Folder of the recordings that the page begins.
    maps
        What a palpation has left of each body.
    growing
        What is computed of bodies beside the loop, by their rank.

    Raises
    ------
    ViewerError
        The page was not built into this package.

    """

    def __init__(
        self,
        built: BuiltScene | Session | SetupSession | None = None,
        *,
        host: str = "127.0.0.1",
        port: int = DEFAULT_PORT,
        models: Sequence[str] = (),
        scene_of: Callable[[str], Scene] | None = None,
        record: Path | None = None,
        recordings: Path = Path(),
        maps: Sequence[SurfaceMap | None] | None = None,
        growing: Mapping[int, BackgroundPrecompute] | None = None,
    ):
        self.host, self.port = host, port
        self.token = secrets.token_urlsafe(24)
        self._pages = load_pages()
        self._maps, self._recordings = maps, recordings
        self._record = record
        if built is None:
            built = SetupSession()
        super().__init__(built if isinstance(built, SetupSession) else self.first_session(built, growing=growing))
        self._setting_up = SettingUp(self, recordings)
        self._models, self._scene_of = list(models), scene_of
        self._server: Server | None = None

    @property
    def address(self) -> str:
        """What a person opens; the token stays in the browser, because fragments are never sent."""
        return self.addresses[0]

    @property
    def addresses(self) -> list[str]:
        """All that a person may open: a server bound to every address is reached from other machines too."""
        names = [f"[{host}]" if ":" in host else host for host in reachable(self.host)]
        return [f"http://{name}:{self.port}/#token={self.token}" for name in names]

    def first_session(
        self,
        built: BuiltScene | Session,
        maps: Sequence[SurfaceMap | None] | None = None,
        growing: Mapping[int, BackgroundPrecompute] | None = None,
    ) -> Session:
        """Session of what is touched first, recorded if that was asked for."""
        self._maps = maps or self._maps
        session = built if isinstance(built, Session) else self._make_session(built)
        session.growing = growing or {}
        if self._record is not None:
            session.simulation.record(self._record)
        return session

    def _make_session(self, built: BuiltScene) -> Session:
        """Session of what is shown first; a derived class may have a kind of its own."""
        return Session(built, maps=self._maps, folder=self._recordings)

    async def start(self) -> None:
        """Listen; ViewerError if the port is in use, or the address is not this machine's."""
        try:
            self._server = await serve(
                self._client,
                self.host,
                self.port,
                process_request=self._request,
                max_size=MAX_PART,
                compression=None,
                ping_interval=5,
                ping_timeout=PING_PATIENCE,
                close_timeout=1,
                server_header=None,
            )
        except OSError as error:
            self._close_session()
            if error.errno == errno.EADDRINUSE:
                raise port_in_use(self.host, self.port) from None
            raise ViewerError(f"cannot listen on {self.host}:{self.port}: {error.strerror or error}") from None
        self.port = self._server.sockets[0].getsockname()[1]
        self._interval = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_INTERVAL)
        # Modules are not garbage: a full collection that looks through them all halts everything for 30 ms.
        gc.collect()
        gc.freeze()
        self._loop = asyncio.get_running_loop()
        # Two tasks: what fails in a message must not end the one that lets go of the body.
        self._watches = [asyncio.create_task(self._watch(look)) for look in (self._watchdog, self._send_computed)]

    async def stop(self) -> dict[str, Any] | None:
        """Close all connections and stop the loop: the report on the recording that this ends, if it ends one."""
        if self._server is not None:
            gc.unfreeze()
            sys.setswitchinterval(self._interval)
            for watch in self._watches:
                watch.cancel()
            self._server.close()
            await self.end_work()
            await self._close_connections(self._server)
        return self._close_session()

    async def _close_connections(self, server: Server) -> None:
        """Wait until all are closed; those of pages that do not answer are ended."""
        try:
            await asyncio.wait_for(server.wait_closed(), CLOSE_PATIENCE)
        except asyncio.TimeoutError:
            for client in self._clients:
                client.abort()
            await server.wait_closed()

    def _close_session(self) -> dict[str, Any] | None:
        self._worker.shutdown()
        self._setting_up.close()
        self._computing.close()
        ended = self._session.recorder.stop()
        self._session.close()
        return ended

    def _request(self, connection: ServerConnection, request: Request) -> Response | None:
        return respond(self._pages, request, self.host, self.port)

    async def _client(self, connection: ServerConnection) -> None:
        if not await self._authenticate(connection):
            return
        client = Client(connection)
        self._clients.append(client)
        tasks = [asyncio.create_task(client.write())]
        try:
            if self._controller is None and self._session.controllable:
                self._controller = client
            await self._send_greeting(client)
            client.may_send.set()
            tasks.append(asyncio.create_task(self._send_frames(client)))
            async for text in connection:
                await self._message(client, text)
        except ConnectionClosed:
            pass
        finally:
            for task in tasks:
                task.cancel()
            self._clients.remove(client)
            await self._release_control(client)

    async def _send_greeting(self, client: Client) -> None:
        """Tell a page what it needs to know before its first scene."""
        role = "control" if self._controller is client else "watch"
        client.send({"type": "welcome", "role": role, "version": VERSION, "models": choices(self._models)})
        client.send(await self.call(self.computed))
        if self._setting_up.is_offered:
            client.send(await self.call(self._setting_up.message))
        if self._status is not None:
            client.send(self._status)

    async def _authenticate(self, connection: ServerConnection) -> bool:
        """Whether the first message carries the token."""
        try:
            hello = messages.parse(await asyncio.wait_for(connection.recv(), HELLO_TIMEOUT))
        except (asyncio.TimeoutError, ConnectionClosed, ViewerError):
            hello = {}
        token = hello.get("token")
        if not (isinstance(token, str) and secrets.compare_digest(_bytes(token), _bytes(self.token))):
            await connection.close(BAD_TOKEN, "wrong or missing token")
            return False
        if hello.get("version") != messages.VERSION:
            await connection.close(1002, "another version of the protocol: load the page again")
            return False
        if len(self._clients) >= MAX_CLIENTS:
            await connection.close(1013, "too many viewers")
            return False
        return True

    async def _message(self, client: Client, text: str | bytes) -> None:
        if not client.is_within_rate():
            await client.connection.close(1008, "too many messages")
            return
        if isinstance(text, str) and len(text.encode("utf-8", "replace")) > MAX_MESSAGE:
            await client.connection.close(1009, "message too big")
            return
        try:
            if isinstance(text, bytes):
                self._require_control(client)
                await self._setting_up.take_part(text)
                return
            message = messages.parse(text)
            if message["type"] == "ack":
                if message.get("frame") == client.sent:
                    client.may_send.set()
            elif message["type"] == "cutaway":
                client.wants = replace(client.wants, cutaway=message.get("on") is True)
            elif message["type"] == "field":
                name, full_scale = messages.word(message, "name"), messages.positive_or_none(message, "max")
                client.wants = replace(client.wants, field=name, full_scale=full_scale)
            else:
                if message["type"] not in self._session.from_all:
                    self._require_control(client)
                await self._command(message)
        except Exception as error:
            client.send(error_message(error))

    def _require_control(self, client: Client) -> None:
        if client is not self._controller:
            raise ViewerError("another viewer has control; this one watches")

    async def _command(self, message: dict[str, Any]) -> None:
        """Do what the controlling client says."""
        if message["type"] == "cancel":
            self.cancel()
        elif message["type"] == "model":
            await self._choose(message.get("name"))
        elif message["type"] == "shape":
            await self._reshape(message)
        elif message["type"] in self._setting_up.kinds:
            await self._setting_up.command(message)
        elif message["type"] == "paint":
            await self.with_session(lambda session: self._computing.paint(session, message))
            await self._send_computed()
        elif message["type"] == "record":
            self.send_all(await self.with_session(lambda session: session.record(message)))
        else:
            await self._handle(message)

    async def _handle(self, message: dict[str, Any]) -> None:
        """Let the session do what a message asks for, and send what that has set."""
        changed = message["type"] == "set"  # some of it, where the rest is refused
        try:
            changed = await self.with_session(lambda session: session.handle(message))
        finally:
            if changed:
                await self.send_settings()

    async def _send_frames(self, client: Client) -> None:
        """Send the latest frame whenever the client has drawn the one before; nothing is ever queued."""
        while True:
            await client.may_send.wait()
            client.may_send.clear()
            session = self._session
            try:
                await self._send_next(client, session)
            except Exception as error:
                # Another session may have taken the place of this one meanwhile.
                if session is self._session:
                    if client.refused is not session:
                        client.refused = session
                        client.send(error_message(error))
                    await asyncio.sleep(STOPPED_PAUSE)
                client.may_send.set()

    async def _send_next(self, client: Client, session: Session | SetupSession) -> None:
        """Send the scene of a session, or a frame of it."""
        if client.shown is not session:
            scene = await self.call(session.scene_message)
            client.shown, client.log_seen = session, (0, 0)
            await client.send_now(scene)
            client.may_send.set()
        elif isinstance(session, Session):
            client.sent += 1
            view = (client.sent, client.log_seen, client.wants)
            message, client.log_seen = await self.call(session.frame_message, *view)
            await client.send_now(message)
            await asyncio.sleep(1.0 / FRAME_RATE)
        else:
            await asyncio.sleep(SET_UP_PAUSE)
            client.may_send.set()

    async def _release_control(self, client: Client) -> None:
        """Let go of the body; who has watched longest takes over."""
        if client is not self._controller:
            return
        self._controller = self._clients[0] if self._clients else None
        self._setting_up.drop_upload()
        await self.with_session(lambda session: session.release())
        self.send_control({"type": "role", "role": "control"})

    async def _watch(self, look: Callable[[], Awaitable[None]]) -> None:
        """Check again and again. An error is logged once and does not end the checks: nothing awaits this task."""
        reported = ""
        while True:
            await asyncio.sleep(LOOK_PAUSE)
            try:
                await look()
            except Exception as error:
                if repr(error) != reported:
                    LOG.error("a mistake within palpate", exc_info=error)
                reported = repr(error)

    async def _watchdog(self) -> None:
        controller = self._controller
        if controller is None or time.monotonic() - controller.last_message > LOST_AFTER:
            await self.with_session(lambda session: session.release())
        self.send_all(await self.with_session(lambda session: session.recorder.stop_after_failure()))

    async def _send_computed(self) -> None:
        """Give the loop what has become ready, and tell of it."""
        try:
            message = await self.call(self.take_computed)
        except Error as error:
            message = error_message(error)
        self.send_all(message)

    async def _choose(self, name: Any) -> None:
        """Switch to another model; the one shown goes on until the new one is ready."""
        if self._scene_of is None or name not in self._models:
            raise ViewerError(f"there is no model '{str(name)[:40]}'")
        scene, building = self._scene_of(name), self.begin_building()
        solving = self.reporter(f"Solving the {name}", building)
        modes = self.reporter(f"Computing the modes of the {name}", building)
        make = lambda: Session(scene.build(solving, modes), folder=self._recordings)  # noqa: E731
        self.work(self.switch(f"Loading the {name}", make, self.replace, building))

    async def _reshape(self, message: dict[str, Any]) -> None:
        """Give a tool another shape: another loop on the same bodies, while the one before goes on."""
        self.require_idle()
        before = self._session
        built = await self.call(before.reshaped, message)
        if built is None:
            return
        make = lambda: Session(built, before.own_tools, before.maps, self._recordings)  # noqa: E731
        building = self.begin_building()
        text = "Preparing the tool: a press that is held continues with it"
        self.work(self.switch(text, make, self._exchange_tool, building))

    def _exchange_tool(self, session: Session) -> None:
        """Exchange sessions on the same bodies: settings, stores and presses go on."""
        before = self._session
        assert isinstance(before, Session)
        pressed = before.pressed()
        session.copy_settings(before)
        self.exchange(session)
        self._setting_up.note_exchange(before, session)
        session.take_stores_of(before)
        session.press_on(pressed)

    async def send_setup(self) -> None:
        """Send pages whether they may bring files, and the body that is set up."""
        self.send_all(await self.call(self._setting_up.message))


def _bytes(token: str) -> bytes:
    """Bytes of any text of JSON, half surrogate pairs too, which UTF-8 has no bytes for."""
    return token.encode("utf-8", "surrogatepass")
