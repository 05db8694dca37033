"""Open the viewer and serve until interrupted."""

from __future__ import annotations

import asyncio
import os
import signal
import webbrowser
from asyncio import FIRST_COMPLETED

from palpate.scene import Scene
from palpate.simulation import Recording, ReplayedSimulation
from palpate.viewer.preparing import Preparation, prepare
from palpate.viewer.replay_session import ReplaySession
from palpate.viewer.server import ViewerServer

PRESS = "Hold the left mouse button on the body to press, drag to slide. Ctrl-C here ends."
SET_UP = "Drop a surface file on the page. Ctrl-C here ends."
REPLAY = "The time line is below the body: space plays and pauses. Ctrl-C here ends."


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
