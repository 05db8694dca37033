"""Session of a body that is set up: the page shows its surface at rest, and no loop runs."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from palpate.errors import ViewerError
from palpate.green import BackgroundPrecompute
from palpate.mesh import TetMesh
from palpate.viewer.messages import encode, numbered
from palpate.viewer.setup_body import SetupBody
from palpate.viewer.shown_body import body_arrays, body_header, drawn_triangles, title_of

# Of a page without a body, m: what the camera's distances follow.
EMPTY_SIZE = 0.1
# Corners of a surface file closer than this part of its longest side are one.
SAME_POINT = 1e-7


class SetupSession:
    """A body that is set up, or an empty page, in the place of a :class:`palpate.viewer.session.Session`."""

    controllable = True
    takes_files = True
    runs = False
    from_all: frozenset[str] = frozenset()
    growing: Mapping[int, BackgroundPrecompute] = {}

    def __init__(self, body: SetupBody | None = None):
        self.body = body
        self.built = SimpleNamespace(bodies=())
        self.recorder = SimpleNamespace(stop=lambda _reason=None: None, stop_after_failure=lambda: None)

    def start(self) -> None:
        """Nothing runs."""

    resume = close = start

    def release(self, tool: int | None = None) -> None:
        """Nothing is touched."""

    def handle(self, message: Mapping[str, Any]) -> bool:
        """Raise ViewerError for all but what a page sends when it opens: nothing can be touched yet."""
        if message["type"] != "release":
            raise ViewerError("nothing can be touched yet: set up a body first")
        return False

    record = reshaped = handle

    def settings(self) -> dict[str, Any]:
        """Message with what the sliders of tools and bodies show: there are none."""
        none: dict[str, list[Any]] = {name: [] for name in ("youngs_modulus", "contact_radius", "friction", "shape")}
        return {"type": "settings", **none, "strain_limit": 0.0, "time_scale": None}

    def shown(self) -> ShownSurface | None:
        """Surface that is drawn."""
        body = self.body
        if body is None:
            return None
        if body.mesh is not None:
            return ShownSurface(body.name, *_outside(body.mesh))
        assert body.read.vertices is not None and body.read.faces is not None
        return ShownSurface(body.name, *merged(body.read.vertices, body.read.faces))

    def scene_message(self) -> bytes:
        """Geometry of what is set up."""
        surface = self.shown()
        shown = [] if surface is None else [surface]
        name = "empty" if surface is None else surface.name
        header = {
            "type": "scene",
            # Another one than that of the scene that is touched: choices of the page for that one are not for this.
            "name": f"set up {name}",
            "title": "Palpate" if surface is None else title_of(name),
            "size": EMPTY_SIZE if surface is None else surface.size,
            "strain_limit": 0.0,
            "defaults": {"youngs_modulus": [], "contact_radius": [], "friction": [], "strain_limit": 0.0},
            "max_force": 0.0,
            "bodies": [one.header for one in shown],
            "tools": [],
            "motion": None,
            "view": None,
            "replay": None,
        }
        return encode(header, numbered([one.arrays for one in shown]))


class ShownSurface:
    """A surface of positions (s, 3), m, and triangles (k, 3), in the form of a scene message."""

    def __init__(self, name: str, positions: np.ndarray, triangles: np.ndarray):
        self.name, self.size = name, float(np.ptp(positions, axis=0).max())
        drawn = drawn_triangles(positions, triangles, np.zeros(len(triangles), dtype=np.int64))
        count = len(drawn.nodes)
        self.header = body_header(name, drawn, len(positions), len(triangles))
        self.arrays = body_arrays(drawn, positions[drawn.nodes], np.arange(count), np.zeros((count, 3)))


def _outside(mesh: TetMesh) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the surface nodes (s, 3), m, and triangles (k, 3) among them."""
    return mesh.nodes[mesh.surface_nodes], np.searchsorted(mesh.surface_nodes, mesh.surface_triangles)


def merged(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the same of the triangles of a surface file, whose corners may stand in it once for each triangle."""
    cell = SAME_POINT * max(float(np.ptp(vertices, axis=0).max()), np.finfo(float).tiny)
    _, first, ranks = np.unique(np.round(vertices / cell), axis=0, return_index=True, return_inverse=True)
    triangles = ranks.ravel()[faces]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    used = np.unique(triangles)
    return vertices[first[used]], np.searchsorted(used, triangles)
