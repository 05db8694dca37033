"""Measurements of doctor: wake-ups of the loop at its real scheduling, the cost of ticks, and the rate of the page."""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import json
import shutil
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.errors import ViewerError
from palpate.scene import model_scene
from palpate.validation.ticks import (
    FRICTION,
    RADIUS,
    LoopTimes,
    Times,
    plate,
    press_centres,
    script,
    tick_times,
    time_loop,
    times_by_kind,
)
from palpate.validation.verify.contact.loop import loop_of, sphere
from palpate.viewer import messages
from palpate.viewer.server import ViewerServer

# The scene of the loop and of the ticks: cells of a plate, and where a sphere slides, from the middle of its top, m.
CELLS, PLACE = (18, 18, 6), (-0.012, -0.012)
PLACES, PLAYS = 40, 25
# How long the page is watched, s, and how long it may take to show itself.
PAGE_SECONDS, PAGE_LIMIT = 4.0, 60.0
# A graphics processor is not asked for: what is measured must not depend on a screen being there.
CHROMIUM_FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


@dataclass(frozen=True)
class PageRate:
    """Frames of the page."""

    # By a Chromium without a screen, which draws in software; None where there is none, or no Playwright to drive it.
    drawn_per_second: float | None
    # That a client of the page's protocol got which draws nothing; None where the page was not built.
    served_per_second: float | None


def loop_times(seconds: float, report: Callable[[float], None] | None = None) -> tuple[LoopTimes, dict[str, Times]]:
    """Return times of the running loop, its tool pressing and sliding, and of every kind of tick played offline."""
    body, green = plate(CELLS)
    simulation = loop_of(body, green, [sphere(RADIUS, FRICTION)])
    path, kinds = script(press_centres(body, [PLACE]), PLACES)
    ticks = times_by_kind(tick_times(simulation, path, PLAYS), kinds)
    return time_loop(simulation, path, seconds, report), ticks


def page_rate() -> PageRate:
    """Measure how often the page of the beam is drawn and served."""
    built = model_scene("beam", True).build(False)
    try:
        return asyncio.run(_page_rate(built))
    except ViewerError:
        return PageRate(None, None)


async def _page_rate(built) -> PageRate:
    server = ViewerServer(built, port=0)
    await server.start()
    try:
        served = await _served(server)
        return PageRate(await _drawn(server), served)
    finally:
        await server.stop()


async def _served(server: ViewerServer) -> float:
    """Frames a second of a client that answers each at once."""
    from websockets.asyncio.client import connect

    address = f"127.0.0.1:{server.port}"
    count, begun = 0, time.monotonic()
    async with connect(f"ws://{address}/socket", origin=f"http://{address}", proxy=None, max_size=None) as socket:
        await socket.send(json.dumps({"type": "hello", "token": server.token, "version": messages.VERSION}))
        async for raw in socket:
            if isinstance(raw, str):
                continue
            header, _ = messages.decode(raw)
            if header["type"] == "frame":
                await socket.send(json.dumps({"type": "ack", "frame": header["frame"]}))
                count += 1
            else:
                count, begun = 0, time.monotonic()
            if time.monotonic() - begun > PAGE_SECONDS:
                break
    return count / (time.monotonic() - begun)


async def _drawn(server: ViewerServer) -> float | None:
    """Frames a second that Chromium draws; None without it, without Playwright, or if it shows none."""
    if importlib.util.find_spec("playwright") is None:
        return None
    from playwright.async_api import Error as BrowserError

    with contextlib.suppress(BrowserError, asyncio.TimeoutError):
        async with browser_page(server.address) as page:
            if page is None:
                return None
            await asyncio.wait_for(_frames_beyond(page, 3), PAGE_LIMIT)
            first, begun = await _frames(page), time.monotonic()
            await asyncio.sleep(PAGE_SECONDS)
            # On a busy machine a frame may take longer than that.
            await asyncio.wait_for(_frames_beyond(page, first), PAGE_LIMIT)
            return (await _frames(page) - first) / (time.monotonic() - begun)
    return None


@contextlib.asynccontextmanager
async def browser_page(address: str) -> AsyncIterator[Any]:
    """Give a page of Chromium at an address; None without Chromium or Playwright."""
    executable = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if executable is None or importlib.util.find_spec("playwright") is None:
        yield None
        return
    from playwright.async_api import async_playwright

    async with async_playwright() as driver:
        browser = await driver.chromium.launch(executable_path=executable, args=list(CHROMIUM_FLAGS))
        try:
            page = await browser.new_page(viewport={"width": 1280, "height": 720})
            await page.goto(address)
            yield page
        finally:
            await browser.close()


async def _frames(page) -> int:
    """Frames that the page has shown so far."""
    return await page.evaluate("window.palpate ? window.palpate.state().frames : 0")


async def _frames_beyond(page, count: int) -> None:
    while await _frames(page) <= count:
        await asyncio.sleep(0.05)


def histogram(delays_us: np.ndarray) -> list[tuple[float, float, int]]:
    """Count delays, us, in bins of a factor of two: lower and upper edge, count; without empty bins at the ends."""
    highest = max(1.0, float(delays_us.max()))
    edges = 2.0 ** np.arange(0, np.ceil(np.log2(highest)) + 2)
    counts = np.histogram(np.maximum(delays_us, 1.0), bins=edges)[0]
    used = np.flatnonzero(counts)
    return [(float(edges[k]), float(edges[k + 1]), int(counts[k])) for k in range(used[0], used[-1] + 1)]
