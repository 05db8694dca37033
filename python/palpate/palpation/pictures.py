"""Pictures of a palpation, as figures of matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.figures import empty_figure
from palpate.mesh import size_text
from palpate.mesh.triangles import area_vectors, node_normals, units
from palpate.palpation.records import MapRecord, Nodule
from palpate.palpation.sides import plane_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# Points that look the same way within this cosine are seen from there, as a plane.
ONE_WAY = np.cos(np.radians(10.0))
# Triangles of a picture are no longer than this part of the spacing; where that would be too many, they stay larger.
FINE, MOST_TRIANGLES = 0.25, 40_000
# Per cent of the values between which colours change: one rim of a hole would take them all.
RANGE = (2.0, 98.0)
# Surface without a value, and light that shapes it: from the viewer's left above.
BARE, AMBIENT = np.array([0.86, 0.86, 0.86]), 0.62
LIGHT = np.array([-0.3, -0.3, 0.9])
# Seen from the middle of the normals where they have one of this length, and from behind.
ELEVATION, MOSTLY = 20.0, 0.3


def picture_of_map(found: MapRecord) -> Figure:
    """Stiffness on the surface, and the points at which it was measured."""
    title = f"stiffness dF/dd at {1e3 * found.depth:.3g} mm depth"
    return _picture(found, found.stiffness, title, "stiffness [N/m]", "viridis", None, ())


def picture_of_ratio(found: MapRecord, ratio: np.ndarray, nodules: Sequence[Nodule]) -> Figure:
    """Stiffness over that of the plain body, (p,), and the nodules."""
    values = 100 * (ratio - 1)
    known = values[np.isfinite(values)]
    end = max(float(np.abs(known).max(initial=0.0)), 1.0)
    title = f"stiffness over that of the plain body, at {1e3 * found.depth:.3g} mm depth"
    return _picture(found, values, title, "change [%]", "coolwarm", (-end, end), nodules)


def picture_of_curves(found: MapRecord) -> Figure:
    """Force against depth of all presses, coloured by stiffness, or along all strokes."""
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection

    figure = empty_figure(7, 4.5)
    axes = figure.subplots()
    strokes = bool((found.strokes >= 0).any())
    largest = max(float(curve.normal_force.max()) for curve in found.curves)
    scale, unit = (1.0, "N") if largest >= 1.0 else (1e3, "mN")
    lines, values = [], []
    for rank, curve in enumerate(found.curves):
        across = curve.position if strokes else curve.depth
        lines.append(np.column_stack([1e3 * across, scale * curve.normal_force]))
        own = found.stiffness[found.strokes == rank] if strokes else found.stiffness[rank : rank + 1]
        own = own[np.isfinite(own)]
        values.append(own.mean() if len(own) else np.nan)
        held = np.flatnonzero(curve.limited)
        axes.plot(*lines[-1][held].T, ".", color="tab:red", markersize=2)
    drawn = LineCollection(lines, cmap=colormaps["viridis"].with_extremes(bad="0.6"), linewidths=1.2)
    drawn.set_array(np.ma.masked_invalid(values))
    axes.add_collection(drawn)
    axes.set_xlim(0.0, max(line[:, 0].max() for line in lines) * 1.02)
    axes.set_ylim(0.0, max(max(line[:, 1].max() for line in lines) * 1.05, 1e-6))
    axes.set_xlabel("position along the stroke [mm]" if strokes else "depth [mm]")
    axes.set_ylabel(f"normal force [{unit}]")
    held = ", red: held by a limit" if any(curve.limited.any() for curve in found.curves) else ""
    text = f"{len(found.curves)} strokes at {1e3 * found.depth:.3g} mm depth" if strokes else f"{len(lines)} presses"
    axes.set_title(f"{text}{held}", loc="left")
    if np.isfinite(values).any():
        label = "mean stiffness [N/m]" if strokes else f"stiffness at {1e3 * found.depth:.3g} mm [N/m]"
        figure.colorbar(drawn, ax=axes, label=label)
    return figure


def _picture(
    found: MapRecord,
    values: np.ndarray,
    title: str,
    label: str,
    colors: str,
    ends: tuple[float, float] | None,
    nodules: Sequence[Nodule],
) -> Figure:
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    known = values[np.isfinite(values)]
    low, high = ends or (np.percentile(known, RANGE).tolist() if len(known) else (0.0, 1.0))
    # A body that is the same everywhere is one colour, not its rounding blown up.
    middle, half = (low + high) / 2, max((high - low) / 2, 5e-3 * max(abs(low), abs(high)), 1e-12)
    shades = ScalarMappable(Normalize(middle - half, middle + half), colormaps[colors])
    mean = found.normals.mean(axis=0)
    mean = mean / max(float(np.linalg.norm(mean)), 1e-12)
    flat = bool((found.normals @ mean).min() > ONE_WAY)
    meshes = [_fine(found, values, body) for body in range(len(found.scene.bodies))]
    if flat:
        figure = empty_figure(6.5, 5.4)
        axes = [figure.subplots()]
        _draw_plane(axes[0], found, values, meshes, mean, shades, nodules)
    else:
        figure = empty_figure(11, 5.2)
        axes = [figure.add_subplot(1, 2, k, projection="3d") for k in (1, 2)]
        azimuth = _azimuth(found, meshes)
        for one, turn in zip(axes, (0.0, 180.0), strict=True):
            _draw_body(one, found, values, meshes, (azimuth + turn, ELEVATION), shades, nodules)
    sides = np.ptp(np.vstack([positions for positions, _, _ in meshes]), axis=0)
    figure.suptitle(title if flat else f"{title}; {size_text(sides)}", x=0.02, ha="left", fontsize=12)
    beyond = (bool((known < shades.norm.vmin).any()), bool((known > shades.norm.vmax).any()))
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[beyond]
    figure.colorbar(shades, ax=axes, label=label, shrink=0.85, extend=extend)
    return figure


def _azimuth(found: MapRecord, meshes: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> float:
    """Direction, degrees about z, that most points are seen from; of points all around half aside of the broad side."""
    mean = found.normals.mean(axis=0)[:2]
    if np.hypot(*mean) > MOSTLY:
        return float(np.degrees(np.arctan2(mean[1], mean[0])))
    sides = np.ptp(np.vstack([positions for positions, _, _ in meshes]), axis=0)
    return -60.0 if sides[0] >= sides[1] else 30.0


def _fine(found: MapRecord, values: np.ndarray, body: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Surface of a body, cut finely: positions (s, 3), triangles (t, 3), values (s,)."""
    from trimesh.remesh import subdivide_to_size

    positions, _, triangles = found.surfaces()[body]
    edge = FINE * found.spacing
    area = np.linalg.norm(area_vectors(positions[triangles]), axis=1).sum()
    edge = max(edge, float(np.sqrt(4 * area / MOST_TRIANGLES)))
    positions, triangles = subdivide_to_size(positions, triangles, edge, max_iter=20)
    own = np.where(found.bodies == body, values, np.nan)
    return positions, triangles, found.at(positions, node_normals(positions, triangles), own)


def _draw_plane(
    axes: Axes,
    found: MapRecord,
    values: np.ndarray,
    meshes: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]],
    up: np.ndarray,
    shades: Any,
    nodules: Sequence[Nodule],
) -> None:
    """Draw the side that faces ``up`` as it is seen from there, in mm."""
    plane = 1e3 * np.array(plane_axes(up))
    for positions, triangles, at_nodes in meshes:
        facing = triangles[units(area_vectors(positions[triangles])) @ up > 0.5]
        if len(facing) == 0:
            continue
        places = positions @ plane.T
        bare = ~np.isfinite(at_nodes[facing]).all(axis=1)
        if bare.any():
            axes.tripcolor(*places.T, facing[bare], facecolors=np.ones(bare.sum()), cmap="gray", vmin=0, vmax=1.16)
        if not bare.all():
            seen = np.nan_to_num(at_nodes)
            axes.tripcolor(*places.T, facing[~bare], seen, shading="gouraud", cmap=shades.cmap, norm=shades.norm)
    known = np.isfinite(values)
    places = found.points @ plane.T
    axes.plot(*places[known].T, "o", markersize=3.5, markerfacecolor="white", markeredgecolor="0.2", linestyle="")
    if not known.all():
        axes.plot(*places[~known].T, "x", markersize=5, color="tab:red", linestyle="", label="held before the depth")
    for rank, nodule in enumerate(nodules):
        text = "nodule" if rank == 0 else None
        axes.plot(*(nodule.place @ plane.T), "+", markersize=16, markeredgewidth=2, color="black", label=text)
    named = [int(np.abs(row).argmax()) for row in plane]
    across = [np.abs(row).max() > 999.0 for row in plane]
    for set_label, axis, true, fallback in zip((axes.set_xlabel, axes.set_ylabel), named, across, "uv", strict=True):
        set_label(f"{'xyz'[axis] if true else fallback} [mm]")
    axes.set_aspect("equal")
    if nodules or not known.all():
        axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.1), frameon=False, ncols=2)


def _draw_body(
    axes: Any,
    found: MapRecord,
    values: np.ndarray,
    meshes: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]],
    view: tuple[float, float],
    shades: Any,
    nodules: Sequence[Nodule],
) -> None:
    """Draw bodies as they are seen from an azimuth and an elevation, degrees, in mm."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    azimuth, elevation = np.radians(view)
    towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    light = np.array([right, np.cross(towards, right), towards]).T @ (LIGHT / np.linalg.norm(LIGHT))
    ends = []
    for positions, triangles, at_nodes in meshes:
        normals = units(area_vectors(positions[triangles]))
        seen = normals @ towards > 0
        means = at_nodes[triangles[seen]].mean(axis=1)
        colors = np.where(np.isfinite(means)[:, None], shades.to_rgba(np.nan_to_num(means))[:, :3], BARE)
        brightness = AMBIENT + (1 - AMBIENT) * np.clip(normals[seen] @ light, 0.0, 1.0)
        colors = colors * brightness[:, None]
        axes.add_collection3d(
            Poly3DCollection(1e3 * positions[triangles[seen]], facecolors=colors, edgecolors=colors, linewidths=0.2)
        )
        ends += [positions.min(axis=0), positions.max(axis=0)]
    low, high = 1e3 * np.min(ends, axis=0), 1e3 * np.max(ends, axis=0)
    lift = 0.004 * (high - low).max() * towards
    facing = found.normals @ towards > 0
    for mask, style in (
        (np.isfinite(values), {"c": "white", "edgecolors": "0.2", "s": 9}),
        (~np.isfinite(values), {"c": "tab:red", "marker": "x", "s": 14}),
    ):
        shown = 1e3 * found.points[mask & facing] + lift
        axes.scatter(*shown.T, depthshade=False, linewidths=0.6, zorder=5, **style)
    for nodule in nodules:
        if found.normals[nodule.point] @ towards > 0:
            axes.scatter(
                *(1e3 * nodule.place + lift), c="black", marker="+", s=160, linewidths=2, zorder=6, depthshade=False
            )
    for set_limits, bottom, top in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), low, high, strict=True):
        set_limits(bottom, top)
    axes.computed_zorder = False
    sides = np.maximum(high - low, 1e-3 * (high - low).max())
    # matplotlib makes the diagonal of the box as long as the axes allow for a cube.
    axes.set_box_aspect(sides, zoom=1.5 * np.linalg.norm(sides) / (np.sqrt(3) * sides.max()))
    axes.set_proj_type("ortho")
    axes.view_init(elev=view[1], azim=view[0])
    axes.set_axis_off()
    axis = int(np.abs(towards[:2]).argmax())
    axes.set_title(f"from {'+' if towards[axis] > 0 else '-'}{'xy'[axis]}, {view[1]:.0f} degrees above", fontsize=10)
