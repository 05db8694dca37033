"""Open the viewer and serve until interrupted, also before a scene is ready: its surface and the stages are shown."""

from __future__ import annotations

import asyncio
import os
import signal
import webbrowser
from asyncio import FIRST_COMPLETED
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np

from palpate.errors import Error
from palpate.green import BackgroundPrecompute
from palpate.progress import Reporter
from palpate.scene import BuiltScene, Scene
from palpate.simulation import Recording, ReplayedSimulation
from palpate.viewer.computing import Computing
from palpate.viewer.fields import SurfaceMap
from palpate.viewer.replay_session import ReplaySession
from palpate.viewer.server import ViewerServer
from palpate.viewer.setup_session import SetupSession, ShownSurface
from palpate.viewer.status import error_message

PRESS = "Hold the left mouse button on the body to press, drag to slide. Ctrl-C here ends."
SET_UP = "Drop a surface file on the page. Ctrl-C here ends."
REPLAY = "The time line is below the body: space plays and pauses. Ctrl-C here ends."


@dataclass(frozen=True)
class Prepared:
    """A scene that can be touched, what is computed of its bodies later, and maps of a palpation of them."""

    built: BuiltScene
    growing: Mapping[int, BackgroundPrecompute]
    maps: Sequence[SurfaceMap | None] | None = None


class PreparingSession(SetupSession):
    """What a page shows of a scene that is being prepared: nothing yet, or the surface of its body."""

    takes_files = False

    def __init__(self, surface: ShownSurface | None = None):
        super().__init__()
        self._surface = surface

    def shown(self) -> ShownSurface | None:
        """Surface that is drawn."""
        return self._surface


@dataclass(frozen=True)
class Preparation:
    """What prepares a scene."""

    name: str  # of the scene
    # Is called on a thread of its own, with a reporter of stages and a function that draws a surface: its vertices (k,
    # 3), m, and triangles. Returns the scene and what is computed of it later.
    build: Callable[[Reporter, Callable[[np.ndarray, np.ndarray], None]], Prepared]


async def prepare(server: ViewerServer, preparation: Preparation) -> None:
    """Prepare the scene of a server that shows nothing yet, and let it be touched.

    Raises Error, which the pages show too, for a scene that cannot be prepared, or that a page has cancelled.
    """
    building, loop = server.begin_building(), asyncio.get_running_loop()
    reporter = server.reporter(preparation.name, building)
    drawn: list[Future[None]] = []

    async def show(vertices: np.ndarray, triangles: np.ndarray) -> None:
        surface = ShownSurface(preparation.name, vertices, triangles)
        await server.call(server.exchange, PreparingSession(surface))

    def draw(vertices: np.ndarray, triangles: np.ndarray) -> None:
        drawn.append(asyncio.run_coroutine_threadsafe(show(vertices, triangles), loop))

    try:
        prepared = await building.run(
            lambda: preparation.build(reporter, draw), lambda late: Computing(late.growing).close()
        )
        for future in drawn:
            await asyncio.wrap_future(future)
        session = await server.call(server.first_session, prepared.built, prepared.maps, prepared.growing)
        await server.call(server.replace, session)
        await server.send_settings()
        await server.send_setup()
    except Error as error:
        server.send_all(error_message(error))
        raise
    finally:
        building.cancel()
        server.finish_building()


def open_viewer(
    server: ViewerServer, *, browser: bool = True, hint: str = PRESS, preparation: Preparation | None = None
) -> None:
    """Serve until Ctrl-C; the address is printed, and opened where there is a desktop.

    Raises Error for a port in use, or a scene that cannot be prepared.
    """
    asyncio.run(_serve(server, browser, hint, preparation))


def open_replay(
    recording: Recording, scene: Scene | None = None, *, host: str, port: int, browser: bool = True
) -> None:
    """Show a recording in the page until Ctrl-C, made again by the scene given or its own.

    Raises Error for a recording that cannot be made again, or a port in use.
    """
    session = ReplaySession(ReplayedSimulation(recording, scene))
    open_viewer(ViewerServer(session, host=host, port=port), browser=browser, hint=REPLAY)


def _on_signal(loop: asyncio.AbstractEventLoop, number: signal.Signals, happened: asyncio.Event) -> None:
    try:
        loop.add_signal_handler(number, happened.set)
    except NotImplementedError:  # Windows
        signal.signal(number, lambda *_: loop.call_soon_threadsafe(happened.set))


async def _serve(server: ViewerServer, browser: bool, hint: str, preparation: Preparation | None = None) -> None:
    await server.start()
    try:
        finished = asyncio.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            _on_signal(asyncio.get_running_loop(), number, finished)
        address, *others = server.addresses
        print(f"Palpate is at {address}", flush=True)
        for other in others:
            print(f"from other machines at {other}", flush=True)
        print(hint, flush=True)
        if browser and _has_desktop():
            await asyncio.to_thread(webbrowser.open, server.address)
        if preparation is None:
            await finished.wait()
            return
        preparing = asyncio.create_task(prepare(server, preparation))
        await asyncio.wait({preparing, ended := asyncio.create_task(finished.wait())}, return_when=FIRST_COMPLETED)
        if preparing.done():
            # What went wrong ends the program.
            preparing.result()
        else:
            preparing.cancel()
            raise KeyboardInterrupt
        await ended
    finally:
        recorded = await server.stop()
        if recorded is not None:
            failed = "" if recorded["error"] is None else f" up to where it failed ({recorded['error']})"
            print(f"recorded {recorded['path']}{failed}: show it by: {recorded['replay']}", flush=True)


def _has_desktop() -> bool:
    """Whether a browser can show itself: elsewhere webbrowser would start a text browser in the terminal."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
