"""The first page of a site with several scenes: a picture of each, which opens it.

A picture has the bodies pressed by the first tool, drawn by this program. Triangles are drawn with a depth for each
pixel and lit by their nodes' normals, at twice the size, which is then halved. What is beside the bodies is
transparent, so that a picture stands on any page.
"""

from __future__ import annotations

import html
import io
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.errors import TouchWarning
from palpate.mesh.triangles import area_vectors, node_area_vectors, units
from palpate.scene import BuiltScene
from palpate.scene.build import press_place
from palpate.scene.series import with_whole_series
from palpate.sessions.shapes import ARROW_PART, arrow, tool_surface
from palpate.simulation import Frame, Simulation
from palpate.vectors import rotated, turning_z_to

WIDTH, HEIGHT, SHARPER = 640, 420, 2
# Part of the picture that is filled.
FILLED = 0.9
# Deeper than a scripted press, to be seen; how long the press may take to come to rest, s.
DEEPER, SETTLES = 2.5, 1.2
# From where one looks, and where light comes from.
TOWARDS_VIEWER = units(np.array([0.45, -0.8, 0.42]))
LIGHT, AMBIENT = units(np.array([0.25, -0.45, 0.86])), 0.55
TOOL_COLOR, FORCE_COLOR = (0.55, 0.62, 0.70), (1.0, 0.62, 0.16)
# The dark end of the colours hides a shape in light.
DARKEST = 0.2
# Farther from a tool's tip than so many of its largest radii a body is seen.
BESIDE = 1.15
# A node's normal counts on faces within this cosine of it; others are the sides of an edge.
SMOOTH = 0.9
PICTURES = "pictures"

_PAGE = """<!doctype html>
<html lang="en">
  <head>
    <meta charset="utf-8" />
    <meta name="viewport" content="width=device-width, initial-scale=1" />
    <link rel="icon" href="favicon.svg" />
    <title>Palpate: soft bodies to touch</title>
    <style>
      :root {{ color-scheme: light dark; font: 100%/1.5 system-ui, sans-serif; }}
      body {{ margin: 0 auto; max-width: 76rem; padding: 2rem 1.25rem 3rem;
        color: light-dark(#241f1c, #f0ece8); background: light-dark(#f1eeea, #171514); }}
      h1 {{ margin: 0; font-size: 1.75rem; }}
      p {{ margin: 0.25rem 0 1.75rem; color: light-dark(#645b54, #b3aaa3); max-width: 44rem; }}
      ul {{ display: grid; gap: 1.25rem; grid-template-columns: repeat(auto-fill, minmax(18rem, 1fr));
        list-style: none; margin: 0; padding: 0; }}
      a {{ display: block; overflow: hidden; border-radius: 0.75rem; text-decoration: none; color: inherit;
        background: light-dark(#fdfcfa, #1f1c1b); border: 1px solid light-dark(#d9d2ca, #3a3532); }}
      a:hover, a:focus-visible {{ border-color: light-dark(#1673b8, #6fc3ff); outline: none; }}
      img {{ display: block; width: 100%; height: auto;
        background: radial-gradient(light-dark(#fffdfa, #6a635c), light-dark(#ddd5cc, #201d1c)); }}
      strong, small {{ display: block; padding: 0 1rem; }}
      strong {{ padding-top: 0.75rem; }}
      small {{ padding-bottom: 0.9rem; color: light-dark(#645b54, #b3aaa3); }}
    </style>
  </head>
  <body>
    <h1>Soft bodies to touch</h1>
    <p>Choose a body, then press on it with the pointer. Your browser computes the forces, 1000 times a second.</p>
    <ul>
{cards}
    </ul>
  </body>
</html>
"""
_CARD = """      <li><a href="{page}?scene={name}">
        <img src="{pictures}/{name}.webp" width="{width}" height="{height}" alt="{title}, pressed by a tool" />
        <strong>{title}</strong><small>{facts}</small></a></li>"""


@dataclass(frozen=True)
class Part:
    """Triangles to be drawn: corners and their normals (n, 3, 3), m, and colours (n, 3, 3)."""

    corners: np.ndarray
    normals: np.ndarray
    colors: np.ndarray


def gallery_picture(built: BuiltScene) -> bytes:
    """Draw a scene while it is pressed, as WebP; SceneError for a body that cannot be pressed."""
    from PIL import Image

    pixels = _drawn(_parts(built, _pressed(built)))
    picture = Image.fromarray(pixels, "RGBA").resize((WIDTH, HEIGHT), Image.Resampling.BOX)
    file = io.BytesIO()
    picture.save(file, "WEBP", quality=85, method=6)
    return file.getvalue()


def _pressed(built: BuiltScene) -> Frame:
    """Press within the limits of the scene until the force stands still."""
    built = with_whole_series(built, True)
    place, depth = press_place(built)
    with warnings.catch_warnings(), Simulation(built) as simulation:
        warnings.simplefilter("ignore", TouchWarning)  # for the eye, not for a measurement
        simulation.move(place)
        time.sleep(0.2)
        simulation.move(place - [0, 0, DEEPER * depth])
        time.sleep(SETTLES)
        return simulation.frame()


def _parts(built: BuiltScene, frame: Frame) -> list[Part]:
    from matplotlib import colormaps

    surfaces = [body.surface_in_scene() for body in frame.bodies]
    sizes = [np.linalg.norm(surface.displacements, axis=1) for surface in surfaces]
    tool = tool_surface(built.scene.tools[0], built.scene.folder)
    contact = next((one for one in frame.contacts if one.tool == 0), None)
    # A tool that is limited stays where its contact has it.
    tip = contact.anchor + contact.displacement if contact is not None and contact.limited else frame.positions[0]
    # Colours end where the largest displacement is seen: beside the tool.
    places = [surface.positions + surface.displacements for surface in surfaces]
    reach = BESIDE * float(np.linalg.norm(tool.vertices, axis=1).max())
    beside = [np.linalg.norm(at - tip, axis=1) > reach for at in places]
    largest = max(float(size[seen].max(initial=0.0)) for size, seen in zip(sizes, beside, strict=True)) or 1.0
    parts = []
    for surface, at, size in zip(surfaces, places, sizes, strict=True):
        colors = colormaps["viridis"](DARKEST + (1 - DARKEST) * np.minimum(size / largest, 1.0))[:, :3]
        parts.append(_part(at, surface.triangles, colors))
    placed = rotated(tool.vertices, tuple(frame.orientations[0])) + tip
    parts.append(_part(placed, tool.faces, np.tile(TOOL_COLOR, (len(placed), 1))))
    force = frame.forces[0]
    if force.any():
        shaft = arrow()
        length = 0.8 * ARROW_PART * float(np.ptp(np.concatenate([s.positions for s in surfaces]), axis=0).max())
        foot = tip + tool.vertices[:, 2].max() * units(force)
        placed = rotated(length * shaft.vertices, tuple(turning_z_to(force))) + foot
        parts.append(_part(placed, shaft.faces, np.tile(FORCE_COLOR, (len(placed), 1))))
    return parts


def _part(positions: np.ndarray, triangles: np.ndarray, colors: np.ndarray) -> Part:
    of_faces = units(area_vectors(positions[triangles]))[:, None]
    of_nodes = units(node_area_vectors(positions, triangles))[triangles]
    smooth = np.einsum("tij,tij->ti", np.broadcast_to(of_faces, of_nodes.shape), of_nodes) > SMOOTH
    normals = np.where(smooth[..., None], of_nodes, of_faces)
    return Part(positions[triangles], normals, colors[triangles])


def _drawn(parts: list[Part]) -> np.ndarray:
    """Pixels (height, width, 4), red green blue and opacity."""
    corners, normals, colors = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("corners", "normals", "colors")
    )
    across = units(np.cross([0.0, 0.0, 1.0], TOWARDS_VIEWER))
    view = np.stack([across, -np.cross(TOWARDS_VIEWER, across), TOWARDS_VIEWER])
    placed = corners @ view.T
    low, high = placed.reshape(-1, 3).min(axis=0), placed.reshape(-1, 3).max(axis=0)
    size = SHARPER * np.array([WIDTH, HEIGHT])
    scale = FILLED * (size / (high - low)[:2]).min()
    placed[..., :2] = (placed[..., :2] - 0.5 * (low + high)[:2]) * scale + 0.5 * size
    seen = np.flatnonzero(area_vectors(placed)[:, 2] < 0)  # rows count downwards
    # Beside the light's own direction, the viewer's gives roundness.
    bright = AMBIENT + (1 - AMBIENT) * (
        0.75 * np.clip(normals @ LIGHT, 0, 1) + 0.25 * np.clip(normals @ TOWARDS_VIEWER, 0, 1)
    )
    lit = np.clip(colors * bright[..., None], 0, 1)
    pixels, depths = np.zeros((size[1], size[0], 4), dtype=np.uint8), np.full((size[1], size[0]), -np.inf)
    for k in seen:
        _fill(pixels, depths, placed[k], lit[k])
    return pixels


def _fill(pixels: np.ndarray, depths: np.ndarray, corners: np.ndarray, colors: np.ndarray) -> None:
    """Draw a triangle where it is nearer than what is there: corners (3, 3) in pixels and depth, colours (3, 3)."""
    low, high = np.floor(corners[:, :2].min(axis=0)).astype(int), np.ceil(corners[:, :2].max(axis=0)).astype(int)
    xs, ys = np.arange(low[0], high[0] + 1) + 0.5, np.arange(low[1], high[1] + 1) + 0.5
    (ax, ay, _), (bx, by, _), (cx, cy, _) = corners
    twice = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if twice == 0:
        return
    second = ((xs - ax) * (cy - ay) - (ys[:, None] - ay) * (cx - ax)) / twice
    third = ((ys[:, None] - ay) * (bx - ax) - (xs - ax) * (by - ay)) / twice
    shares = np.stack([1 - second - third, second, third])
    depth = np.tensordot(corners[:, 2], shares, axes=1)
    block = np.s_[low[1] : high[1] + 1, low[0] : high[0] + 1]
    nearer = (shares >= -1e-9).all(axis=0) & (depth > depths[block])
    depths[block][nearer] = depth[nearer]
    pixels[block][nearer] = np.column_stack([255 * shares[:, nearer].T @ colors, np.full(nearer.sum(), 255)]).astype(
        np.uint8
    )


@dataclass(frozen=True)
class Card:
    """What the page shows of a scene."""

    # In addresses, and for people.
    name: str
    title: str
    nodes: int  # of its finite elements, or of the surface where those are not known
    moves: bool  # whether it has a body in motion
    size: int  # bytes to fetch


def gallery_page(cards: Sequence[Card], page: str) -> str:
    """Return the page; ``page`` opens a scene."""
    return _PAGE.format(cards="\n".join(_card(card, page) for card in cards))


def _card(card: Card, page: str) -> str:
    facts = [f"{card.nodes:,} nodes", *(["in motion"] if card.moves else []), f"{card.size / 1e6:.1f} MB"]
    return _CARD.format(
        page=page,
        name=html.escape(card.name),
        title=html.escape(card.title),
        pictures=PICTURES,
        width=WIDTH,
        height=HEIGHT,
        facts=" · ".join(facts),
    )
