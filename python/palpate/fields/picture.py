"""A picture of deformed surfaces, for reports and notebooks."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Triangles that are drawn within about a second.
MOST_TRIANGLES = 40_000


@dataclass(frozen=True)
class DeformedSurface:
    """A surface to be drawn."""

    positions: np.ndarray  # (s, 3) m, at rest
    triangles: np.ndarray  # (t, 3) rows of ``positions``, outward
    displacements: np.ndarray  # (s, 3) m


def draw(surfaces: Sequence[DeformedSurface], magnification: float, title: str) -> Figure:
    """Deformed surfaces coloured by the size of the displacement, in mm."""
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = Figure(figsize=(7, 5), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    moved = [1e3 * np.linalg.norm(surface.displacements, axis=1) for surface in surfaces]
    largest = max(float(values.max(initial=0.0)) for values in moved) or 1.0
    ends = []
    for surface, values in zip(surfaces, moved, strict=True):
        places = 1e3 * (surface.positions + magnification * surface.displacements)
        ends += [places.min(axis=0), places.max(axis=0)]
        patches = Poly3DCollection(places[surface.triangles], cmap="viridis", linewidths=0)
        patches.set_array(values[surface.triangles].mean(axis=1))
        patches.set_clim(0.0, largest)
        axes.add_collection3d(patches)
    low, high = np.min(ends, axis=0), np.max(ends, axis=0)
    for set_limits, bottom, top in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), low, high, strict=True):
        set_limits(bottom, top)
    axes.set_box_aspect(np.maximum(high - low, 1e-3 * (high - low).max()))
    axes.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]", title=title)
    figure.colorbar(patches, ax=axes, label="displacement [mm]", shrink=0.7)
    return figure


def as_html(text: str, surfaces: Sequence[DeformedSurface]) -> str:
    """Text of a result, and its picture where that is drawn within a moment, for notebooks."""
    import html

    markup = f"<pre>{html.escape(text)}</pre>"
    if sum(len(surface.triangles) for surface in surfaces) > MOST_TRIANGLES:
        return markup
    picture = io.BytesIO()
    draw(surfaces, 1.0, "").savefig(picture, format="png", dpi=80)
    encoded = base64.b64encode(picture.getvalue()).decode()
    return f'{markup}<img alt="deformed surface" src="data:image/png;base64,{encoded}">'
