"""A recording as a film for slides: the deformed bodies, the tools and their forces, drawn off screen; MP4 (H.264)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from palpate.atomic import written_beside
from palpate.errors import Error
from palpate.mesh.triangles import area_vectors, units
from palpate.sessions.frames import RecordedFrame, RecordedFrames
from palpate.sessions.shapes import arrow, arrow_scale, tools_of
from palpate.sessions.tables import Report
from palpate.vectors import rotated, turning_z_to

# Pixels of a frame; even, as the encoding wants.
WIDTH, HEIGHT, DPI = 1280, 720, 100
TOOL_COLOR, FORCE_COLOR = (0.30, 0.37, 0.47, 1.0), (0.93, 0.53, 0.05, 1.0)
COLORS = ("tab:orange", "tab:blue", "tab:green", "tab:purple")
# Towards the light, and the part of the brightness that comes from everywhere.
LIGHT, AMBIENT = np.array([0.35, -0.55, 0.76]), 0.6


def write_mp4(frames: RecordedFrames, path: Path, rate: float, report: Report = None) -> None:
    """Write frames as a film; a first pass finds the largest displacement, for the range of the colours.

    Raises Error if imageio-ffmpeg is not installed.
    """
    try:
        import imageio_ffmpeg
    except ImportError:
        raise Error("MP4 needs imageio-ffmpeg: pip install 'palpate[export]'") from None
    largest, total = 0.0, 2 * len(frames)
    for rank, recorded in enumerate(frames):
        for body in recorded.frame.bodies:
            largest = max(largest, float(np.linalg.norm(body.displacements, axis=1).max(initial=0.0)))
        if report is not None:
            report(rank + 1, total)
    picture = Picture(frames, largest)
    with written_beside(path) as partial:
        # Quality 7 of 10: no blocks to be seen on a projector, about a megabyte for ten seconds.
        film = imageio_ffmpeg.write_frames(
            str(partial), (WIDTH, HEIGHT), fps=rate, quality=7, macro_block_size=8, ffmpeg_log_level="error"
        )
        film.send(None)
        try:
            for rank, recorded in enumerate(frames):
                film.send(picture.draw(recorded))
                if report is not None:
                    report(len(frames) + rank + 1, total)
        finally:
            film.close()


class Picture:
    """A figure of matplotlib that is drawn anew for each frame; its colours end at the ``largest`` displacement, m."""

    def __init__(self, frames: RecordedFrames, largest: float):
        from matplotlib import colormaps
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self._largest = largest or 1e-3
        self._colormap = colormaps["viridis"]
        self._tools, self._arrow = tools_of(frames.simulation), arrow()
        self._arrow_scale = arrow_scale(frames.simulation, frames.recording.forces)
        self._figure = Figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI)
        self._canvas = FigureCanvasAgg(self._figure)
        self._patches = self._scene(frames)
        self._now = self._curves(frames)
        self._text = self._figure.text(0.68, 0.82, "", fontsize=15, family="monospace", va="top")

    def draw(self, recorded: RecordedFrame) -> bytes:
        """Pixels of a frame, row by row, red green blue."""
        corners, colors = zip(*self._parts(recorded), strict=True)
        corners = np.concatenate(corners)
        self._patches.set_verts(1e3 * corners)
        self._patches.set_facecolor(_lit(corners, np.concatenate(colors)))
        self._now.set_xdata([recorded.time, recorded.time])
        sizes = np.linalg.norm(recorded.frame.forces, axis=1)
        self._text.set_text("\n".join([f"{recorded.time:7.2f} s", *(f"{size:7.3f} N" for size in sizes)]))
        self._canvas.draw()
        return np.ascontiguousarray(np.asarray(self._canvas.buffer_rgba())[..., :3]).tobytes()

    def _parts(self, recorded: RecordedFrame) -> list[tuple[np.ndarray, np.ndarray]]:
        """Triangles (n, 3, 3), m, and their colours (n, 4): all in one list, which is drawn from back to front."""
        parts = []
        for body in recorded.frame.bodies:
            surface = body.surface_in_scene()
            size = np.linalg.norm(surface.displacements, axis=1)[surface.triangles].mean(axis=1)
            places = surface.positions + surface.displacements
            parts.append((places[surface.triangles], self._colormap(size / self._largest)))
        frame = recorded.frame
        for tool in np.flatnonzero(recorded.present).tolist():
            tip = frame.positions[tool]
            parts.append(_placed(self._tools[tool], tip, frame.orientations[tool], 1.0, TOOL_COLOR))
            force = frame.forces[tool] * self._arrow_scale
            if force.any():
                size = float(np.linalg.norm(force))
                parts.append(_placed(self._arrow, tip, turning_z_to(force), size, FORCE_COLOR))
        return parts

    def _scene(self, frames: RecordedFrames) -> Any:
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection

        axes = self._figure.add_axes((-0.05, 0.0, 0.72, 1.0), projection="3d", computed_zorder=False)
        patches = Poly3DCollection(np.zeros((1, 3, 3)), linewidths=0.2)
        axes.add_collection3d(patches)
        bodies = [body.points_to_scene(body.green.surface_positions) for body in frames.simulation.bodies]
        low, high = 1e3 * np.vstack(bodies).min(axis=0), 1e3 * np.vstack(bodies).max(axis=0)
        # Room above for the tool and its arrow.
        high[2] += 0.3 * (high - low).max()
        for set_limits, bottom, top in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), low, high, strict=True):
            set_limits(bottom, top)
        axes.set_box_aspect(np.maximum(high - low, 1e-3 * (high - low).max()), zoom=1.05)
        axes.view_init(elev=24, azim=-58)
        axes.set_axis_off()
        bar = self._figure.add_axes((0.68, 0.56, 0.26, 0.025))
        colors = ScalarMappable(Normalize(0.0, 1e3 * self._largest), self._colormap)
        self._figure.colorbar(colors, cax=bar, orientation="horizontal", label="displacement [mm]")
        return patches

    def _curves(self, frames: RecordedFrames) -> Any:
        recording, last = frames.recording, frames.rows[-1] + 1
        axes = self._figure.add_axes((0.68, 0.12, 0.29, 0.30))
        rows = slice(frames.rows[0], last)
        forces = np.linalg.norm(recording.forces.reshape(len(recording.ticks), -1, 3), axis=2)[rows]
        for tool, color in zip(range(forces.shape[1]), COLORS, strict=False):
            axes.plot(recording.time[rows], forces[:, tool], color=color, linewidth=1.3, label=f"tool {tool}")
        if forces.shape[1] > 1:
            axes.legend(frameon=False, loc="lower right", bbox_to_anchor=(1, 1), ncols=forces.shape[1])
        axes.set(xlabel="time [s]", ylabel="force on the device [N]", xlim=(recording.time[rows][[0, -1]]))
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25)
        return axes.axvline(recording.time[rows][0], color="0.4", linewidth=1.0)


def _placed(
    shape: trimesh.Trimesh, tip: np.ndarray, orientation: np.ndarray, size: float, color: tuple
) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of a rigid shape where it stands, in one colour."""
    places = rotated(size * shape.vertices, tuple(orientation)) + tip
    return places[shape.faces], np.tile(color, (len(shape.faces), 1))


def _lit(corners: np.ndarray, colors: np.ndarray) -> np.ndarray:
    """Colours (n, 4) of triangles (n, 3, 3) under a light from one side."""
    bright = AMBIENT + (1 - AMBIENT) * np.clip(units(area_vectors(corners)) @ LIGHT, 0.0, 1.0)
    lit = colors.copy()
    lit[:, :3] *= bright[:, None]
    return lit
