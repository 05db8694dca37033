"""A page that opens before its scene is ready: the surface is drawn as soon as it is read, and stages are shown."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np

from palpate.errors import Error
from palpate.green import BackgroundPrecompute
from palpate.progress import Reporter
from palpate.scene import BuiltScene
from palpate.viewer.computing import Computing
from palpate.viewer.server import ViewerServer
from palpate.viewer.setup_session import SetupSession, ShownSurface
from palpate.viewer.status import error_message
from palpate.viewer.surface_map import SurfaceMap


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
