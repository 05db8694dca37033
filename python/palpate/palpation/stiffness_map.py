"""Stiffness map: the contact stiffness of a body over its surface."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.atomic import written_beside
from palpate.errors import SceneError
from palpate.fields import write_result
from palpate.figures import write_figure
from palpate.palpation import pictures
from palpate.palpation.press import (
    FORCE_LIMIT,
    NO_CONTACT,
    OTHER_PLACE,
    STRAIN_LIMIT,
    Measured,
    press_paths,
    read_presses,
)
from palpate.palpation.protocol import Protocol, Sites, sample_sites, sites_at_points
from palpate.palpation.records import XYZ, MapRecord, surface_mesh, write_columns
from palpate.palpation.runs import probe, run_all
from palpate.palpation.strokes import Track, read_strokes, strokes_on
from palpate.scene import BuiltScene, Scene
from palpate.simulation import Simulation

if TYPE_CHECKING:
    import meshio
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class StiffnessMap(MapRecord):
    """Results of a palpation, one row for each of p points. Compared by value, number by number; not hashable.

    Attributes
    ----------
    points, normals
        (p, 3) m on the surface that the tool meets, and outward unit normals (p, 3), in the scene.
    bodies, strokes
        (p,) numbers of the bodies, and of the strokes; -1 of presses.
    force
        (p,) N along the normal at the depth; NaN where something held the tool before, and so are the next two.
    stiffness
        (p,) N/m, the slope dF/dd at the depth.
    secant_stiffness
        (p,) N/m, F/d.
    held_by
        (p,) "strain limit", "force limit", "other place" where the tool touched beside its point first, "no contact"
        where it lost the surface; else empty.
    reached_depth, reached_force
        (p,) m and N, where nothing held the tool yet.
    curves
        One a press, or a stroke.
    skipped
        Points of the grid that were left out, by reason.
    spacing, depth, speed
        Of the protocol: m, m, m/s.
    scene
        What was palpated.
    resumed
        Runs that a partial file knew.

    """

    def __repr__(self) -> str:
        known = self.stiffness[np.isfinite(self.stiffness)]
        range_text = f"{known.min():.4g} to {known.max():.4g} N/m" if len(known) else "no stiffness"
        held = f", {len(self.points) - len(known)} held before" if len(known) < len(self.points) else ""
        return f"StiffnessMap({len(self.points)} points {1e3 * self.depth:.3g} mm deep, {range_text}{held})"

    def to_meshio(self) -> meshio.Mesh:
        """Give the surfaces of all bodies in the scene, the map at their nodes; NaN far from all points.

        Point data are ``stiffness`` and ``secant_stiffness``, N/m.
        """
        return surface_mesh(self, {"stiffness": self.stiffness, "secant_stiffness": self.secant_stiffness})

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write what :meth:`to_meshio` gives as .vtu or .vtk, for ParaView and the page; a file is replaced at once."""
        write_result(self.to_meshio(), path)

    def write_points(self, path: str | os.PathLike[str]) -> None:
        """Write a row for each point as CSV."""
        columns = {
            "point": np.arange(len(self.points)),
            "body": self.bodies,
            "stroke": self.strokes,
            **dict(zip(XYZ, self.points.T, strict=True)),
            **dict(zip(("normal_x", "normal_y", "normal_z"), self.normals.T, strict=True)),
            "force_N": self.force,
            "stiffness_N_per_m": self.stiffness,
            "secant_stiffness_N_per_m": self.secant_stiffness,
            "held_by": self.held_by,
            "reached_depth_m": self.reached_depth,
            "reached_force_N": self.reached_force,
        }
        write_columns(Path(path), columns)

    def write_curves(self, path: str | os.PathLike[str]) -> None:
        """Write a row for each tick of each curve as CSV, with the number of its point or stroke."""
        of = "stroke" if (self.strokes >= 0).any() else "point"
        names = (of, "time_s", "position_m", "depth_m", "normal_force_N", "fx_N", "fy_N", "fz_N", "limited")
        with written_beside(Path(path)) as partial, partial.open("w", encoding="utf-8") as stream:
            stream.write(",".join(names) + "\n")
            for rank, curve in enumerate(self.curves):
                count = np.full(len(curve.time), rank)
                moved = (curve.time, curve.position, curve.depth, curve.normal_force, *curve.force.T)
                formats = ["%d", *["%.9g"] * len(moved), "%d"]
                np.savetxt(stream, np.column_stack([count, *moved, curve.limited]), delimiter=",", fmt=formats)

    def plot(self) -> Figure:
        """Picture of the map on the surface, as a figure of matplotlib; ``savefig`` writes it."""
        return pictures.picture_of_map(self)

    def plot_curves(self) -> Figure:
        """Force against depth of all presses, or along all strokes."""
        return pictures.picture_of_curves(self)

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write all of it into a folder, which is made: points, curves, surface, pictures.

        Returns
        -------
        list
            The files: ``points.csv``, ``curves.csv``, ``curves.png``, ``stiffness.vtu``, ``stiffness.png``.

        """
        where = Path(folder)
        where.mkdir(parents=True, exist_ok=True)
        names = ("points.csv", "curves.csv", "curves.png", "stiffness.vtu", "stiffness.png")
        points, curves, curves_picture, surface, picture = paths = [where / name for name in names]
        self.write_points(points)
        self.write_curves(curves)
        write_figure(self.plot_curves(), curves_picture, grid=False)
        self.write(surface)
        write_figure(self.plot(), picture, grid=False)
        return paths


def stiffness_map(
    scene: Scene | BuiltScene,
    spacing: float | str,
    depth: float | str,
    speed: float | str = 0.01,
    *,
    on: str | None = None,
    points: Sequence[Any] | None = None,
    strokes: bool = False,
    partial: str | os.PathLike[str] | None = None,
    progress: bool | Callable[[int, int], None] = False,
) -> StiffnessMap:
    """Palpate the bodies of a scene with its first tool, at points about equally far apart on their surfaces.

    Each press begins with a body at rest, in the ticks of the force loop but without a clock: the same scene gives the
    same bits. Stiffness is dF/dd and F/d at the depth (:mod:`palpate.palpation.press`).

    Parameters
    ----------
    scene
        What to palpate, and with what. Its limits of strain and of force hold; how a device ramps and slews does not.
    spacing, depth, speed
        Of the points, m; from first touch on, m; of a press or along a stroke, m/s. Text may have a unit: ``"10mm"``.
    on
        Predicate over x, y, z, min and max in a body's own frame that points satisfy, such as ``"z > max - 1mm"``.
    points
        Points in the scene, m, in place of a grid; each is moved onto the closest surface.
    strokes
        Whether lines a spacing apart are slid over at the depth instead.
    partial
        File that keeps finished runs, to go on from; it stays.
    progress
        Whether a bar is shown on a terminal, or a function of (done, total).

    Raises
    ------
    Error
        A spacing wider than the body, a depth beyond the tool, a speed with too few ticks, no point to press, or a
        fault of the loop.

    """
    built = scene if isinstance(scene, BuiltScene) else scene.build()
    protocol = Protocol.of(spacing, depth, speed, strokes)
    simulation = Simulation(probe(built))
    protocol.check(simulation)
    if strokes:
        sites, lines = strokes_on(simulation, protocol, on)
    else:
        sites = sample_sites(simulation, protocol, on) if points is None else sites_at_points(simulation, points)
        lines = []
    return palpated(built, simulation, protocol, sites, lines, None if partial is None else Path(partial), progress)


def palpated(
    built: BuiltScene,
    simulation: Simulation,
    protocol: Protocol,
    sites: Sites,
    strokes: list[np.ndarray],
    partial: Path | None,
    progress: bool | Callable[[int, int], None],
) -> StiffnessMap:
    """Run a protocol at sites, or along strokes over them, and read what it has found."""
    if strokes:
        tracks = [Track.of(simulation, sites, stroke, protocol) for stroke in strokes]
        paths = [path for track in tracks for path in track.paths(simulation, protocol)]
        runs, known = run_all(simulation, paths, partial, progress)
        found, curves = read_strokes(simulation, protocol, tracks, runs)
    else:
        runs, known = run_all(simulation, press_paths(simulation, sites, protocol), partial, progress)
        found, curves = read_presses(simulation, protocol, sites, runs)
    _require_one(found, protocol, partial)
    columns = {name: np.array([getattr(one, name) for one in found]) for name in Measured.__dataclass_fields__}
    return StiffnessMap(
        points=sites.points,
        normals=sites.normals,
        bodies=sites.bodies,
        strokes=np.repeat(np.arange(len(strokes)), [len(s) for s in strokes]) if strokes else np.full(len(found), -1),
        **columns,
        curves=tuple(curves),
        skipped=sites.skipped,
        spacing=protocol.spacing,
        depth=protocol.depth,
        speed=protocol.speed,
        scene=built,
        resumed=known,
    )


def _require_one(found: Sequence[Measured], protocol: Protocol, partial: Path | None) -> None:
    """Refuse a palpation in which no point has a stiffness; its runs are not worth keeping."""
    if any(not one.held_by for one in found):
        return
    if partial is not None:
        partial.unlink(missing_ok=True)
    reasons = [one.held_by for one in found]
    reason = max(dict.fromkeys(reasons), key=reasons.count)
    deepest = max((one.reached_depth for one in found if np.isfinite(one.reached_depth)), default=0.0)
    cures = {
        STRAIN_LIMIT: "set view.strain_limit, 0 for none",
        FORCE_LIMIT: "set device.max_force",
        OTHER_PLACE: "take a smaller tool",
        NO_CONTACT: "press less deep",
    }
    reached = (
        f", at {1e3 * deepest:.2g} mm at most: press less deep, or {cures[reason]}"
        if deepest > 0
        else f": {cures[reason]}"
    )
    raise SceneError(f"no point could be pressed {1e3 * protocol.depth:.3g} mm deep ({reason}{reached})")
