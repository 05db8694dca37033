"""What the tests of the page share: the program a user starts, a page in a real Chromium, and how it is pressed."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# Without a window of its own a browser starts faster, and draws a picture in half of the processor's time.
CHROMIUM = shutil.which("chromium-headless-shell") or shutil.which("chromium") or "/usr/bin/chromium"
FLAGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]

# Drawn in software on a busy machine a page may show two pictures a second: a wait ends by what is seen, and fails only
# after this time, s.
PATIENCE = 60.0

MARKS = [
    pytest.mark.browser,
    pytest.mark.skipif(
        not Path(CHROMIUM).exists(), reason="no Chromium at /usr/bin/chromium (Debian: apt install chromium)"
    ),
]


# The program, but that a page which a busy machine keeps from drawing for 2 s is not taken for one that is gone.
PATIENT = f"from palpate.viewer import server; server.LOST_AFTER = {PATIENCE}; from palpate.cli import main; main()"


class Program:
    """`palpate demo`, or another command with a page, as a user starts it; ``cache`` None is the user's own."""

    def __init__(self, cache: Path | None, *arguments: str, command: str = "demo"):
        words = [sys.executable, "-c", PATIENT, command, *arguments, "--port", "0", "--no-browser"]
        environment = os.environ if cache is None else {**os.environ, "XDG_CACHE_HOME": str(cache)}
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment)
        addresses = (re.search(r"http://\S+", line) for line in self.process.stdout)
        self.address = next(address[0] for address in addresses if address)

    def stop(self) -> int:
        """Exit status after Ctrl-C."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        self.process.stdout.close()
        return self.process.wait(20)


class SharedBrowser:
    """A browser and the demo of the paper's liver: each is started when a test first asks for it."""

    def __init__(self, cache: Path):
        self._cache = cache
        self._chromium: Browser | None = None
        self._program: Program | None = None
        self._open = contextlib.ExitStack()

    def chromium(self) -> Browser:
        from playwright.sync_api import sync_playwright

        if self._chromium is None:
            playwright = self._open.enter_context(sync_playwright())
            self._chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
            self._open.callback(self._chromium.close)
        return self._chromium

    def program(self) -> Program:
        if self._program is None:
            self._program = Program(self._cache, "liver", "--paper")
        return self._program

    def close(self) -> None:
        """End both; a test that asks again starts them anew. The program ends cleanly by Ctrl-C."""
        program, self._program, self._chromium = self._program, None, None
        self._open.close()
        assert program is None or program.stop() == 0


# A browser in which someone has opened More before; a choice of the test itself stays.
MORE_OPEN = """
if (location.protocol === 'http:' && localStorage.getItem('palpate-more') === null)
    localStorage.setItem('palpate-more', '1');
"""


@contextlib.contextmanager
def opened(
    chromium,
    program,
    size: tuple[int, int] = (1280, 720),
    listen=None,
    sharpness: float = 0.25,
    ready=None,
    more: bool = True,
):
    """The page with a scene on it; anything on its console is a failure. ``listen`` gets all that the server sends.

    ``ready`` is a condition of its state by which it is open; without it, that frames are drawn. With ``more`` all
    controls are shown, as to someone who has opened them before.

    Drawing in software takes most of the time of a test: a quarter of the pixels along each side do, where a test does
    not look at them.
    """
    context = chromium.new_context(viewport={"width": size[0], "height": size[1]}, device_scale_factor=sharpness)
    context.set_default_timeout(1e3 * PATIENCE)
    if more:
        context.add_init_script(MORE_OPEN)
    page = context.new_page()
    complaints = []
    page.on(
        "console", lambda message: complaints.append(message.text) if message.type in {"error", "warning"} else None
    )
    page.on("pageerror", lambda error: complaints.append(str(error)))

    def hear(message: str | bytes) -> None:
        """Playwright marks its listeners, which a method of a list does not let it."""
        listen(message)

    if listen is not None:
        page.on("websocket", lambda socket: socket.on("framereceived", hear))
    try:
        page.goto(program.address)
        until(page, ready or (lambda s: s["frames"] > 3))
        yield page
    finally:  # another page would only watch
        context.close()
    # Software rendering tells of its own slowness; that is the test machine's affair.
    assert [text for text in complaints if "GPU stall" not in text] == []


def state(page) -> dict:
    return page.evaluate("window.palpate ? window.palpate.state() : {frames: 0, connected: false}")


def until(page, condition, seconds: float = PATIENCE) -> dict:
    """State of the page once a condition holds (its policy forbids Playwright's own waiting by eval)."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        seen = state(page)
        if condition(seen):
            return seen
        time.sleep(0.04)
    raise AssertionError(f"waited {seconds} s in vain; the last state was {seen}")


def drawn(page, frames: int = 3) -> None:
    """Wait until the page has drawn so many more frames: what was asked of it before is in them."""
    before = state(page)["frames"]
    until(page, lambda s: s["frames"] >= before + frames)


def eventually(page, look, condition, seconds: float = PATIENCE):
    """What is seen once it meets a condition, looked at again after each frame; the last look if it never does."""
    end = time.monotonic() + seconds
    while not condition(seen := look()) and time.monotonic() < end:
        drawn(page, 1)
    return seen


def press(page, notches: int = 0, place: tuple[float, float] | None = None, contacts: int = 1) -> dict:
    """Press on the visible top, or at a place, and go deeper by the wheel; the button stays down.

    Returns once the tool has come to the depth that the pointer wants.
    """
    x, y = place or page.evaluate("window.palpate.pickPoint()")
    page.mouse.move(x, y)
    page.mouse.down()
    settled_depth(page)
    seen = until(page, lambda s: s["contacts"] == contacts and s["forceMagnitude"] > 0.01)
    for _ in range(notches):
        wheel(page, 100)
    return (settled_depth(page) and state(page)) if notches else seen


def repeated_after_overruns(page, attempt, tries: int = 3) -> None:
    """What a test does with a running loop, once more after a reset where the machine left the loop too little time."""
    for left in reversed(range(tries)):
        try:
            return attempt()
        except AssertionError:
            if left == 0 or "took too long" not in (state(page)["fault"] or ""):
                raise
        page.mouse.up()
        page.locator("#fault-reset").click()
        until(page, lambda s: s["fault"] is None)


def wheel(page, pixels: float) -> None:
    """Turn the wheel by so many pixels of the page's layout: Chromium counts those of the screen."""
    page.mouse.wheel(0, pixels * page.evaluate("window.devicePixelRatio"))


def settled_depth(page) -> float:
    """Depth that the pointer wants, m, once it has come to its goal: the same before and after some frames."""
    before, end = -1.0, time.monotonic() + PATIENCE
    while time.monotonic() < end:
        now = state(page)["depth"]
        if now == before:
            return now
        before = now
        drawn(page)
    raise AssertionError("the depth does not settle")


def drag(page, start: tuple[float, float], end: tuple[float, float], steps: int = 20, pause: float = 0.01) -> None:
    """Move the pointer that is down along a line, with a pause after each step, s."""
    for step in range(1, steps + 1):
        part = step / steps
        page.mouse.move(start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1]))
        time.sleep(pause)


# Part of the force that it changes by at rest: the tool comes ever nearer to where the pointer wants it.
STILL = 1e-6
# So far apart forces are compared, in ticks of the loop: on a page that draws nothing new they stand still.
TICKS_APART = 250


def settled_force(page) -> np.ndarray:
    """Force once it stands still within a part of itself."""
    ticks, before, end = -np.inf, np.full(3, np.inf), time.monotonic() + PATIENCE
    while time.monotonic() < end:
        seen = state(page)
        now, passed = np.array(seen["force"]), seen["ticks"] - ticks
        if passed < TICKS_APART:
            time.sleep(0.05)
            continue
        if np.linalg.norm(now) > 0 and np.linalg.norm(now - before) <= STILL * np.linalg.norm(now):
            return now
        ticks, before = seen["ticks"], now
    raise AssertionError("the force does not settle")
