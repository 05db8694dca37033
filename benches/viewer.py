"""How long the viewer's event loop stalls while a page presses, moves sliders and changes the model.

A stall is how much later than asked a task of the event loop wakes up. The page is a process of its own, as a browser
is.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import multiprocessing
import os
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import typer

from benches import surfaces as large_surfaces
from benches.output import Json, Table, show
from palpate import models
from palpate.progress import status_line
from palpate.scene import model_scene
from palpate.viewer import messages
from palpate.viewer.server import ViewerServer

# What a hand does at most: a slider reports 25 times a second, the pointer a hundred.
SETTINGS_HZ, PRESSES_HZ = 25.0, 100.0
# Between two beats of the event loop, and between two looks at the threads, s.
BEAT, POLL_SECONDS = 2e-3, 50e-3
# Threads of this process, on Linux.
TASKS = "/proc/self/task"
# A model that is not there after this time is not awaited any longer, s.
LONGEST_SWITCH = 600.0
# Beginnings of refusals of settings and presses that were meant for another model.
LATE = ("the contact radius goes up to", "press: the position")
# Depth of the scripted press, over the size of the body, and presses a second.
DEPTH, PRESSING_HZ = 0.02, 1.0


@dataclass(frozen=True)
class Row:
    """What happened in one phase: a model pressed, or changed for another.

    Attributes
    ----------
    phase
        What the page did.
    seconds
        How long it took.
    longest_stall_ms, mean_stall_ms
        Of the event loop.
    longest_idle_ms
        Of a process beside it that does nothing else: what the machine adds by itself.
    frames_per_second
        Frames that the page got.
    ticks_per_second
        Of the force loop that the page saw: in a change of model the one before.
    settings
        Settings that the server confirmed.
    most_loops
        Most threads of force loops at a time; None where the system does not list threads.

    """

    phase: str
    seconds: float
    longest_stall_ms: float
    mean_stall_ms: float
    longest_idle_ms: float
    frames_per_second: float
    ticks_per_second: float
    settings: int
    most_loops: int | None


@dataclass
class _Phase:
    """What the page saw of a phase; times are of the system's monotonic clock, s."""

    name: str
    begin: float
    end: float = 0.0
    frames: int = 0
    settings: int = 0
    ticks: int = 0
    ticking: float = 0.0


def run(names: Sequence[str] = models.NAMES, paper: bool = False, seconds: float = 4.0) -> list[Row]:
    """Change to each model in turn and press on it for ``seconds``, first with an empty cache, then with a full one."""
    with _empty_cache():
        return asyncio.run(_run(list(names), paper, seconds))


def as_table(rows: Sequence[Row]) -> Table:
    """Return one line per phase."""
    lines = []
    for row in rows:
        stalls = (f"{row.longest_stall_ms:.1f}", f"{row.mean_stall_ms:.2f}", f"{row.longest_idle_ms:.1f}")
        rates = (f"{row.frames_per_second:.0f}", f"{row.ticks_per_second:.0f}")
        loops = "-" if row.most_loops is None else str(row.most_loops)
        lines.append([row.phase, f"{row.seconds:.1f}", *stalls, *rates, loops])
    notes = [
        "stall: longest halt of the event loop, and the mean; idle: of a process beside it that does nothing",
        f"longest stall of the event loop: {max(row.longest_stall_ms for row in rows):.1f} ms",
    ]
    headings = ["", "s", "stall ms", "mean", "idle", "frames/s", "ticks/s", "loops"]
    return Table("The viewer's server under 100 presses and 25 settings a second", headings, lines, notes=notes)


def viewer(
    paper: Annotated[bool, typer.Option("--paper", help="The meshes in the size of the paper; quicker.")] = False,
    seconds: Annotated[float, typer.Option(min=0.1, help="How long each model is pressed.")] = 4.0,
    surfaces: Annotated[bool, typer.Option("--surfaces", help="Large surfaces: frames, and a page.")] = False,
    as_json: Json = False,
) -> None:
    """How long the viewer's server stalls while a page presses, moves sliders and changes the model.

    100 presses and 25 settings a second; each model with an empty cache first, then from the cache. With --surfaces:
    what frames of 20,000, 100,000 and 500,000 triangles weigh, drawn whole and by fewer, and how long a page takes.

    Example: python -m benches viewer --seconds 2
    """
    if surfaces:
        with status_line("measuring frames and a page"):
            domes = large_surfaces.run()
        show(as_json, domes, large_surfaces.as_table(domes))
        return
    with status_line("measuring; an empty cache takes a minute or two"):
        rows = run(paper=paper, seconds=seconds)
    show(as_json, rows, as_table(rows))


async def _run(names: list[str], paper: bool, seconds: float) -> list[Row]:
    built = await asyncio.to_thread(model_scene(names[-1], paper).build, False)
    server = ViewerServer(built, port=0, models=models.NAMES, scene_of=lambda name: model_scene(name, paper))
    await server.start()
    stalls: list[tuple[float, float]] = []
    loops: list[tuple[float, int]] = []
    beating = asyncio.create_task(_beat(stalls))
    try:
        with _watched_threads(loops):
            phases, idle = await _browse(server, names, seconds)
    finally:
        beating.cancel()
        await server.stop()
    return [_row(phase, stalls, idle, loops) for phase in phases]


async def _beat(stalls: list[tuple[float, float]]) -> None:
    """Note when the event loop wakes up, and how late, s."""
    while True:
        before = time.monotonic()
        await asyncio.sleep(BEAT)
        now = time.monotonic()
        stalls.append((now, now - before - BEAT))


async def _browse(server: ViewerServer, names: list[str], seconds: float) -> tuple[list[_Phase], list[Any]]:
    """Let a page in a process of its own do its work; also stalls of a process that has none."""
    context = multiprocessing.get_context("spawn")
    ends, processes = [], []
    for target, arguments in ((_page, (server.port, server.token, names, seconds)), (_idle, ())):
        ours, theirs = context.Pipe()
        processes.append(context.Process(target=target, args=(theirs, *arguments), daemon=True))
        await asyncio.to_thread(processes[-1].start)
        theirs.close()
        ends.append(ours)
    page, idle = ends
    try:
        phases = await asyncio.to_thread(page.recv)
        idle.send(None)
        return phases, await asyncio.to_thread(idle.recv)
    except EOFError:
        raise RuntimeError("the page of the benchmark ended early; its error stands above") from None
    finally:
        for process in processes:
            process.terminate()
            await asyncio.to_thread(process.join)


def _longest_and_mean(stalls: list[tuple[float, float]], phase: _Phase) -> tuple[float, float]:
    """Stalls within a phase, ms; one that lasts all the phase has no beat in it."""
    late = [max(late, 0.0) for when, late in stalls if phase.begin <= when <= phase.end] or [phase.end - phase.begin]
    return 1e3 * max(late), 1e3 * float(np.mean(late))


def _row(
    phase: _Phase, stalls: list[tuple[float, float]], idle: list[tuple[float, float]], loops: list[tuple[float, int]]
) -> Row:
    seconds = phase.end - phase.begin
    longest, mean = _longest_and_mean(stalls, phase)
    seen = [count for when, count in loops if phase.begin <= when <= phase.end]
    return Row(
        phase=phase.name,
        seconds=seconds,
        longest_stall_ms=longest,
        mean_stall_ms=mean,
        longest_idle_ms=_longest_and_mean(idle, phase)[0],
        frames_per_second=phase.frames / seconds,
        ticks_per_second=phase.ticks / phase.ticking if phase.ticking else 0.0,
        settings=phase.settings,
        most_loops=max(seen, default=None),
    )


@contextlib.contextmanager
def _empty_cache() -> Iterator[None]:
    """Keep Green's functions elsewhere meanwhile."""
    before = os.environ.get("XDG_CACHE_HOME")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        try:
            yield
        finally:
            if before is None:
                del os.environ["XDG_CACHE_HOME"]
            else:
                os.environ["XDG_CACHE_HOME"] = before


@contextlib.contextmanager
def _watched_threads(loops: list[tuple[float, int]]) -> Iterator[None]:
    """Count the threads of force loops, beside the event loop."""
    done = threading.Event()

    def watch() -> None:
        while not done.wait(POLL_SECONDS):
            count = servo_threads()
            if count is not None:
                loops.append((time.monotonic(), count))

    thread = threading.Thread(target=watch, name="palpate-bench")
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def servo_threads() -> int | None:
    """Threads of force loops in this process; None on other systems than Linux."""
    if not os.path.isdir(TASKS):
        return None
    count = 0
    for task in os.listdir(TASKS):
        with contextlib.suppress(OSError), open(f"{TASKS}/{task}/comm", "rb") as name:  # it may have ended meanwhile
            count += name.read() == b"palpate-servo\n"
    return count


def _page(sender: Any, port: int, token: str, names: list[str], seconds: float) -> None:
    """Run a page: process of its own."""
    sender.send(asyncio.run(_Page(names, seconds).run(port, token)))
    sender.close()


def _idle(connection: Any) -> None:
    """Beat until a message comes: process of its own."""

    async def beat() -> list[tuple[float, float]]:
        stalls: list[tuple[float, float]] = []
        beating = asyncio.create_task(_beat(stalls))
        await asyncio.to_thread(connection.recv)
        beating.cancel()
        return stalls

    connection.send(asyncio.run(beat()))


class _Page:
    """A client that presses, moves sliders and changes models without a pause."""

    def __init__(self, names: list[str], seconds: float):
        self._names, self._seconds = names, seconds
        self.phases: list[_Phase] = []
        self._scene: dict[str, Any] = {}
        self._top = np.zeros(3)
        self._scenes = 0
        self._ticks: tuple[float, int] | None = None

    async def run(self, port: int, token: str) -> list[_Phase]:
        from websockets.asyncio.client import connect

        address = f"127.0.0.1:{port}"
        options = {"origin": f"http://{address}", "proxy": None, "max_size": None}
        async with connect(f"ws://{address}/socket", **options) as socket:
            self._socket = socket
            await self._send(type="hello", token=token, version=messages.VERSION)
            self._begin("pressed")
            listening = asyncio.create_task(self._listen())
            await self._arrival(0)
            work = (self._press(), self._move_sliders(), self._change_models())
            tasks = [listening, *(asyncio.create_task(one) for one in work)]
            # Only changing models ends by itself; what ends before it is an error, or a server that hung up.
            ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in tasks:
                task.cancel()
            for task in ended:
                task.result()
            if tasks[-1] not in ended:
                raise RuntimeError(f"the server closed the connection: {socket.close_code} {socket.close_reason}")
        self.phases[-1].end = time.monotonic()
        return self.phases[1:]

    async def _change_models(self) -> None:
        for round_name in ("empty cache", "from the cache"):
            for name in self._names:
                await self._change(name, round_name)

    async def _change(self, name: str, round_name: str) -> None:
        self._begin(f"to {name}, {round_name}")
        before = self._scenes
        await self._send(type="model", name=name)
        await self._arrival(before)
        self._begin(f"{name} pressed")
        await asyncio.sleep(self._seconds)

    def _begin(self, name: str) -> None:
        now = time.monotonic()
        if self.phases:
            self.phases[-1].end = now
        self.phases.append(_Phase(name, now))
        self._ticks = None

    async def _arrival(self, before: int) -> None:
        async def there() -> None:
            while self._scenes == before:
                await asyncio.sleep(1e-3)

        await asyncio.wait_for(there(), LONGEST_SWITCH)

    async def _send(self, **message: Any) -> None:
        await self._socket.send(json.dumps(message))

    async def _listen(self) -> None:
        async for raw in self._socket:
            if isinstance(raw, str):
                message = json.loads(raw)
                # What was meant for the model before may reach the one after, and be refused by it.
                if message["type"] == "error" and not message["text"].startswith(LATE):
                    raise RuntimeError(f"the server refused: {message['text']}")
                self.phases[-1].settings += message["type"] == "settings"
                continue
            header, arrays = messages.decode(raw)
            if header["type"] == "scene":
                self._scene, positions = header, arrays["0/nodes"][arrays["0/surface_nodes"]]
                self._top = positions[np.argmax(positions[:, 2])].astype(float)
                self._scenes += 1
                self._ticks = None
            else:
                await self._send(type="ack", frame=header["frame"])
                self._count(header["ticks"])

    def _count(self, ticks: int) -> None:
        phase, now = self.phases[-1], time.monotonic()
        phase.frames += 1
        if self._ticks is not None:
            phase.ticks += ticks - self._ticks[1]
            phase.ticking += now - self._ticks[0]
        self._ticks = now, ticks

    async def _press(self) -> None:
        while True:
            size, radius = self._scene["size"], self._scene["tools"][0]["radius"]
            depth = DEPTH * size * np.sin(2 * np.pi * PRESSING_HZ * time.monotonic())
            place = self._top + [0.0, 0.0, radius - depth]
            await self._send(type="press", tool=0, position=place.tolist(), grab=False)
            await asyncio.sleep(1.0 / PRESSES_HZ)

    async def _move_sliders(self) -> None:
        turn = 0
        while True:
            tool, body = self._scene["tools"][0], self._scene["bodies"][0]
            share = 0.3 + 0.7 * (turn % 14) / 13
            if turn % 2 and body["youngs_modulus"] is not None:
                await self._send(type="set", body=0, youngs_modulus=share * body["youngs_modulus"])
            else:
                await self._send(type="set", tool=0, contact_radius=share * tool["max_contact_radius"])
            turn += 1
            await asyncio.sleep(1.0 / SETTINGS_HZ)
