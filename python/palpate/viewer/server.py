"""The viewer's server: access, control, and frames at the rate of each client."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import gc
import secrets
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from palpate.errors import Error, SimulationError, ViewerError
from palpate.green import BackgroundPrecompute
from palpate.scene import BuiltScene, Scene
from palpate.viewer import messages
from palpate.viewer.addresses import reachable
from palpate.viewer.background import CancellableTask, Worker
from palpate.viewer.client import Client
from palpate.viewer.computing import Computing
from palpate.viewer.pages import load_pages, respond
from palpate.viewer.session import Session, choices
from palpate.viewer.setting_up import SettingUp
from palpate.viewer.setup_session import SetupSession
from palpate.viewer.status import StatusReporter, status
from palpate.viewer.surface_map import SurfaceMap
from palpate.viewer.upload import MAX_PART

VERSION = version("palpate")
DEFAULT_PORT = 8642
FRAME_RATE = 60.0
# Bounds on what a client may send and how many there may be.
MAX_MESSAGE = 4096
MAX_CLIENTS = 16
HELLO_TIMEOUT = 5.0
# A controller that says nothing for this long, not even that it drew a frame, is lost: its contact is released, s.
LOST_AFTER = 2.0
# Between two looks at a loop that does not run, s.
STOPPED_PAUSE = 0.25
# Between two looks whether a body that is set up has been drawn anew, s.
SET_UP_PAUSE = 0.05
BAD_TOKEN = 4401
# So often threads pass on the interpreter's lock while the server runs, s; Python's own 5 ms add up to a visible halt
# where the event loop takes the lock several times for one message.
SWITCH_INTERVAL = 1e-3


class ViewerServer:
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
        self._session: Session | SetupSession = (
            built if isinstance(built, SetupSession) else SetupSession() if built is None else self.first_session(built)
        )
        self._computing = Computing(growing)
        self._computing.begin()
        self._session.start()
        self._worker = Worker()
        self._setting_up = SettingUp(self, recordings)
        self._models, self._scene_of = list(models), scene_of
        self._clients: list[Client] = []
        self._controller: Client | None = None
        self._building: CancellableTask | None = None
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

    def first_session(self, built: BuiltScene | Session, maps: Sequence[SurfaceMap | None] | None = None) -> Session:
        """Session of what is touched first, recorded if that was asked for."""
        self._maps = maps or self._maps
        session = built if isinstance(built, Session) else self._make_session(built)
        if self._record is not None:
            session.simulation.record(self._record)
        return session

    def _make_session(self, built: BuiltScene) -> Session:
        """Session of what is shown first; a derived class may have a kind of its own."""
        return Session(built, maps=self._maps, folder=self._recordings)

    async def start(self) -> None:
        """Listen.

        Raises
        ------
        ViewerError
            The port is in use, or the address is not this machine's.

        """
        try:
            self._server = await serve(
                self._client,
                self.host,
                self.port,
                process_request=self._request,
                max_size=MAX_PART,
                compression=None,
                ping_interval=5,
                ping_timeout=10,
                close_timeout=1,
                server_header=None,
            )
        except OSError as error:
            self._close_session()
            if error.errno == errno.EADDRINUSE:
                raise ViewerError(
                    f"port {self.port} on {self.host} is in use: choose another with --port, or --port 0 for a free one"
                ) from None
            raise ViewerError(f"cannot listen on {self.host}:{self.port}: {error.strerror or error}") from None
        self.port = self._server.sockets[0].getsockname()[1]
        self._interval = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_INTERVAL)
        # Modules are not garbage: a full collection that looks through them all halts everything for 30 ms.
        gc.collect()
        gc.freeze()
        # Two tasks: what fails in a message must not end the one that lets go of the body.
        self._watches = [asyncio.create_task(self._watchdog()), asyncio.create_task(self._watch_computed())]

    async def stop(self) -> dict[str, Any] | None:
        """Close all connections and stop the loop: the report on the recording that this ends, if it ends one."""
        if self._server is not None:
            gc.unfreeze()
            sys.setswitchinterval(self._interval)
            for watch in self._watches:
                watch.cancel()
            self._server.close()
            await self._server.wait_closed()
        if self._building is not None:
            self._building.cancel()
        return self._close_session()

    def _close_session(self) -> dict[str, Any] | None:
        self._worker.close()
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
        sender = None
        try:
            if self._controller is None and self._session.controllable:
                self._controller = client
            await self._send_greeting(client)
            client.may_send.set()
            sender = asyncio.create_task(self._send_frames(client))
            async for text in connection:
                await self._message(client, text)
        except ConnectionClosed:
            pass
        finally:
            if sender is not None:
                sender.cancel()
            self._clients.remove(client)
            await self._release_control(client)

    async def _send_greeting(self, client: Client) -> None:
        """Tell a page what it needs to know before its first scene."""
        role = "control" if self._controller is client else "watch"
        models = choices(self._models)
        await client.send({"type": "welcome", "role": role, "version": VERSION, "models": models})
        await client.send(await self._worker.call(self._computing.message, self._session))
        if self._setting_up.is_offered:
            await client.send(await self._worker.call(self._setting_up.message))

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
        except Error as error:
            await client.send({"type": "error", "text": str(error)})

    def _require_control(self, client: Client) -> None:
        if client is not self._controller:
            raise ViewerError("another viewer has control; this one watches")

    async def _command(self, message: dict[str, Any]) -> None:
        """Do what the controlling client says."""
        if message["type"] == "cancel":
            if self._building is not None:
                self._building.cancel()
        elif message["type"] == "model":
            await self._choose(message.get("name"))
        elif message["type"] == "shape":
            await self._reshape(message)
        elif message["type"] in self._setting_up.kinds:
            await self._setting_up.command(message)
        elif message["type"] == "paint":
            await self._worker.call(self._computing.paint, self._session, message)
            await self._send_computed()
        elif message["type"] == "record":
            await self.send_all(await self._worker.call(self._session.record, message))
        else:
            session = self._session
            if await self._worker.call(session.handle, message):
                await self.send_all(await self._worker.call(session.settings))

    async def _send_frames(self, client: Client) -> None:
        """Send the latest frame whenever the client has drawn the one before; nothing is ever queued."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                await client.may_send.wait()
                client.may_send.clear()
                session = self._session
                if client.shown is not session:
                    client.shown, client.log_seen = session, (0, 0)
                    await client.connection.send(await self._worker.call(session.scene_message))
                    client.may_send.set()
                    continue
                if not isinstance(session, Session):
                    await asyncio.sleep(SET_UP_PAUSE)
                    client.may_send.set()
                    continue
                client.sent += 1
                try:
                    message, client.log_seen = await self._worker.call(
                        session.frame_message, client.sent, client.log_seen, client.wants
                    )
                except SimulationError as error:
                    # Another model may have taken the place of this one meanwhile.
                    if session is self._session:
                        if client.refused is not session:
                            client.refused = session
                            await client.send({"type": "error", "text": str(error)})
                        await asyncio.sleep(STOPPED_PAUSE)
                    client.may_send.set()
                    continue
                await client.connection.send(message)
                await asyncio.sleep(1.0 / FRAME_RATE)

    async def _release_control(self, client: Client) -> None:
        """Let go of the body; who has watched longest takes over."""
        if client is not self._controller:
            return
        self._controller = self._clients[0] if self._clients else None
        self._setting_up.drop_upload()
        await self._worker.call(self._session.release)
        if self._controller is not None:
            await self._controller.send({"type": "role", "role": "control"})

    async def _watchdog(self) -> None:
        while True:
            await asyncio.sleep(0.25)
            controller = self._controller
            if controller is None or time.monotonic() - controller.last_message > LOST_AFTER:
                await self._worker.call(self._session.release)
            await self.send_all(await self._worker.call(self._session.recorder.stop_after_failure))

    async def _watch_computed(self) -> None:
        while True:
            await asyncio.sleep(0.25)
            await self._send_computed()

    async def _send_computed(self) -> None:
        """Give the loop what has become ready, and tell of it."""
        try:
            message = await self._worker.call(self._computing.step, self._session)
        except Error as error:
            message = {"type": "error", "text": str(error)}
        await self.send_all(message)

    async def send_all(self, message: dict[str, Any] | None, but_control: bool = False) -> None:
        """Send a message to all pages, or to those that watch; None is no message."""
        if message is not None:
            for client in [c for c in self._clients if not (but_control and c is self._controller)]:
                await client.send(message)

    async def send_control(self, message: dict[str, Any]) -> None:
        """Send a message to the page in control."""
        if self._controller is not None:
            await self._controller.send(message)

    @property
    def session(self) -> Session | SetupSession:
        """What is shown."""
        return self._session

    async def call(self, work: Callable[..., Any], *arguments: Any) -> Any:
        """Do ``work(*arguments)`` on the thread of the session."""
        return await self._worker.call(work, *arguments)

    def follow(self, growing: Mapping[int, BackgroundPrecompute] | None) -> None:
        """Take what is computed beside the loop of another scene, in place of what was."""
        self._computing.close()
        self._computing = Computing(growing)
        self._computing.begin()

    async def _choose(self, name: Any) -> None:
        """Switch to another model; the one shown goes on until the new one is ready."""
        if self._scene_of is None or name not in self._models:
            raise ViewerError(f"there is no model '{str(name)[:40]}'")
        scene, building = self._scene_of(name), self.begin_building()
        solving = self.reporter(f"Solving the {name}", building)
        modes = self.reporter(f"Computing the modes of the {name}", building)
        make = lambda: Session(scene.build(solving, modes), folder=self._recordings)  # noqa: E731
        self._build_task = asyncio.create_task(self.switch(f"Loading the {name}", make, self.exchange, building))

    async def _reshape(self, message: dict[str, Any]) -> None:
        """Give a tool another shape: another loop on the same bodies, while the one before goes on."""
        before = self._session
        built = await self._worker.call(before.reshaped, message)
        if built is None:
            return
        make = lambda: Session(built, before.own_tools, before.maps, self._recordings)  # noqa: E731
        building = self.begin_building()
        text = "Preparing the tool: a press that is held continues with it"
        self._build_task = asyncio.create_task(self.switch(text, make, self._keep_settings, building))

    def begin_building(self) -> CancellableTask:
        """Begin something long: one at a time.

        Raises
        ------
        ViewerError
            Another is not done.

        """
        if self._building is not None:
            raise ViewerError("wait until what is being prepared is ready, or cancel it")
        self._building = CancellableTask()
        return self._building

    @property
    def is_building(self) -> bool:
        """Whether something long is under way."""
        return self._building is not None

    async def finish_building(self) -> None:
        """Let another long work begin, and tell pages that this one has ended."""
        self._building = None
        await self.send_all(status(""))

    async def send_setup(self) -> None:
        """Tell pages whether files may be brought, and what is set up."""
        await self.send_all(await self._worker.call(self._setting_up.message))

    def end_building(self) -> None:
        """Let another long work begin."""
        self._building = None

    async def switch(
        self, text: str, make: Callable[[], Session], exchange: Callable[[Session], None], building: CancellableTask
    ) -> None:
        """Make a session beside the one that runs, and put it in its place."""
        try:
            await self.send_all(status(text))
            await self._worker.call(self._session.release)
            session = await building.run(make, Session.close)
            # Two loops at real-time priority would keep each other from their deadlines: the old one ends first.
            why = "a recording is of one scene, and this one has another now"
            await self.send_all(await self._worker.call(self._session.recorder.stop, why))
            await self._worker.call(exchange, session)
            await self.send_all(await self._worker.call(session.settings))
        except Exception as error:
            # None of any kind may leave the pages without a word.
            why = str(error) if isinstance(error, Error) else f"a mistake within palpate, please report it: {error!r}"
            await self.send_all({"type": "error", "text": why})
            await self.send_all(await self._worker.call(self._session.settings))
        finally:
            self._building = None
            await self.send_all(status(""))

    def exchange(self, session: Session) -> None:
        """Put a session in the place of the one that runs, which goes on where the other does not start."""
        before = self._session
        before.close()
        try:
            session.start()
        except BaseException as error:
            session.close()
            before.resume()
            # Its tools may be moved otherwise now: pages get the scene anew.
            for client in self._clients:
                client.shown = None
            if isinstance(error, Error):
                raise type(error)(f"{error}; the scene shown before stays") from error
            raise
        self._session = session

    def _keep_settings(self, session: Session) -> None:
        before = self._session
        session.copy_settings(before)
        self.exchange(session)
        session.press_on(before)

    def reporter(self, text: str, work: CancellableTask) -> StatusReporter:
        """Send all pages how far a long work is."""
        return StatusReporter(text, work, self.send_all)


def _bytes(token: str) -> bytes:
    """Bytes of any text of JSON, half surrogate pairs too, which UTF-8 has no bytes for."""
    return token.encode("utf-8", "surrogatepass")
