"""Open the viewer and serve until interrupted."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import webbrowser

from palpate.viewer.server import ViewerServer


def open_viewer(server: ViewerServer, *, browser: bool = True) -> None:
    """Serve until Ctrl-C; the address is printed, and opened where there is a desktop."""
    asyncio.run(_serve(server, browser))


async def _serve(server: ViewerServer, browser: bool) -> None:
    await server.start()
    try:
        address, *others = server.addresses
        print(f"Palpate is at {address}", flush=True)
        for other in others:
            print(f"from other machines at {other}", flush=True)
        print("Hold the left mouse button on the body to press, drag to slide. Ctrl-C here ends.", flush=True)
        if browser and _has_desktop():
            await asyncio.to_thread(webbrowser.open, server.address)
        finished = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, finished.set)
        await finished.wait()
    finally:
        await server.stop()


def _has_desktop() -> bool:
    """Whether a browser can show itself: elsewhere webbrowser would start a text browser in the terminal."""
    if sys.platform.startswith(("win", "darwin")):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
