"""Scalar fields over the body as the page draws them, with ranges that do not flicker; maps of a palpation too."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate.errors import ViewerError
from palpate.fields import ElementStrain, SurfaceStrain, SurfaceStress, extreme_values, largest_magnitude
from palpate.input_file import require_file
from palpate.scene import BuiltBody, BuiltScene
from palpate.simulation import Simulation

# A range never spans less than this part of the body's size, as a strain, or of Young's modulus: rest is not noise
# blown up.
LEAST = 0.005
# Per cent of a map's values between which its colours change; a range that is typed spans at least this part of it.
MAP_RANGE, LEAST_SPAN = (2.0, 98.0), 1e-3
# Nodes of a map's file and of a body are the same within this part of the body's longest side.
SAME_PLACE = 1e-6
# A range grows at once, so that no colour is cut off, and comes down with this time constant, s.
DECAY = 0.8


@dataclass(frozen=True)
class ClientView:
    """What a page looks at: a field by name, the value at which its colours end, and whether it sees the inside."""

    field: str = ""
    full_scale: float | None = None
    cutaway: bool = False


@dataclass(frozen=True)
class Field:
    """What the page may show: its name in messages, its title, its unit; a signed field is zero in the middle.

    One with gaps is not known everywhere.
    """

    name: str
    title: str
    unit: str
    signed: bool = False
    gaps: bool = False


DISPLACEMENT = Field("displacement", "Displacement", "mm")
STRAIN = Field("strain", "Largest principal strain, linear", "%")
FINITE_STRAIN = Field("strain", "Largest principal strain, Green-Lagrange", "%")
SURFACE_STRAIN = Field("strain", "Strain in the surface", "%")
VON_MISES = Field("von_mises", "Von Mises stress", "Pa")
PRINCIPAL = Field("principal_stress", "First principal stress", "Pa", signed=True)
PALPATED = Field("palpated_stiffness", "Palpated stiffness", "N/m", gaps=True)
PALPATED_CHANGE = Field("palpated_change", "Palpated change", "%", signed=True, gaps=True)


@dataclass(frozen=True)
class SurfaceMap:
    """Values at the surface nodes of a body, which a pose does not change."""

    stiffness: np.ndarray  # (s,) N/m, NaN where nothing was palpated
    change: np.ndarray | None = None  # (s,) per cent more than the plain body's; None of a map without it


def read_map(path: Path, built: BuiltScene) -> list[SurfaceMap | None]:
    """Read ``stiffness.vtu`` or ``detection.vtu`` for the bodies of a scene; None for one that it does not hold.

    Raises ViewerError for a file that is missing, cannot be read, is no map, or one of other bodies.
    """
    import meshio

    require_file(path, ViewerError)
    try:
        mesh = (meshio.vtk if path.suffix.lower() == ".vtk" else meshio.vtu).read(path)
    except (Exception, SystemExit) as error:  # meshio raises anything, and exits on what it does not know
        raise ViewerError(
            f"{path}: not a map that can be read: {str(error).splitlines()[0] if str(error) else 'damaged'}"
        ) from None
    if "stiffness" not in mesh.point_data:
        raise ViewerError(f"{path}: no map: it has no point data 'stiffness'; 'palpate map' writes stiffness.vtu")
    maps = [_of_body(body, np.asarray(mesh.points), mesh.point_data) for body in built.bodies]
    if not any(maps):
        raise ViewerError(f"{path}: a map of another body: its points are not the nodes of this surface")
    return maps


def _of_body(body: BuiltBody, points: np.ndarray, data: Mapping[str, np.ndarray]) -> SurfaceMap | None:
    from scipy.spatial import cKDTree

    green = body.green
    places = body.points_to_scene(green.surface_positions + green.free_displacements)
    off, ranks = cKDTree(points).query(places)
    if off.max() > SAME_PLACE * green.extents.max():
        return None
    stiffness = np.asarray(data["stiffness"], dtype=float)[ranks]
    if not np.isfinite(stiffness).any():
        return None
    ratio = data.get("ratio")
    return SurfaceMap(stiffness, None if ratio is None else 100 * (np.asarray(ratio, dtype=float)[ranks] - 1))


@dataclass(frozen=True)
class Picture:
    """A field over a pose: displacements in m and values from 0 to 255 at the surface nodes, or at all (interior).

    Of a field with gaps they are from 1 to 255, and 0 where nothing is known.
    """

    header: dict[str, Any]
    displacements: np.ndarray
    scalar: np.ndarray
    interior: bool

    @property
    def arrays(self) -> dict[str, tuple[str, np.ndarray]]:
        """Arrays of a body in a frame message."""
        return {"displacements": ("f4", self.displacements), "scalar": ("u1", self.scalar)}


class Fields:
    """Fields of one running body; each pose is recovered once for all clients.

    The ``surface_map`` that a palpation has left of it is shown before all else.
    """

    def __init__(self, simulation: Simulation, body: int = 0, surface_map: SurfaceMap | None = None):
        self._simulation, self._body = simulation, body
        self._green = green = simulation.bodies[body].green
        self._size = float(green.extents.max())
        self._measure = measure = green.strain_measure
        self._surface = measure if isinstance(measure, SurfaceStrain) else None
        self._recovery = measure.recovery if isinstance(measure, ElementStrain) else None
        self.offered = [DISPLACEMENT, SURFACE_STRAIN]
        if self._recovery is not None:
            strain = FINITE_STRAIN if simulation.bodies[body].is_hyperelastic else STRAIN
            self.offered = [DISPLACEMENT, strain, VON_MISES, PRINCIPAL]
        self._map = surface_map
        if surface_map is not None:
            known = [PALPATED] if surface_map.change is None else [PALPATED_CHANGE, PALPATED]
            self.offered = [*known, *self.offered]
        self._ranges: dict[str, tuple[float, float]] = {}
        self._pose = _Pose(np.full((1, 3), np.nan))

    def largest_strain(self, displacements: np.ndarray) -> float:
        """Largest strain of a pose (s, 3), m, as :mod:`palpate.fields.strain_measure` has it."""
        pose = self._of(displacements)
        if self._recovery is None:
            return pose.once("largest", lambda: self._measure.largest(displacements))
        return float(largest_magnitude(self._stress(pose).strain).max())

    def picture(self, name: str, displacements: np.ndarray, interior: bool, full_scale: float | None = None) -> Picture:
        """Field of a pose, up to a value that is given in its unit, or to its largest one.

        A name that this body does not offer gives the first field, and that its own range.
        """
        field = next((f for f in self.offered if f.name == name), self.offered[0])
        full_scale = full_scale if field.name == name else None
        inside = interior and self._recovery is not None
        pose = self._of(displacements)
        shown = self._extended(pose) if inside else displacements
        values = self._mapped(field, inside) if field.gaps else self._values(field, pose, shown, inside)
        largest = float(np.nanmax(np.abs(values)))
        low, followed = self._fixed_range(field, values) if field.gaps else (0.0, self._range(field, largest))
        end = followed if full_scale is None else max(full_scale, low + LEAST_SPAN * (followed - low))
        part = 0.5 + 0.5 * values / end if field.signed else (values - low) / (end - low)
        part = np.clip(part, 0.0, 1.0)
        scaled = np.where(np.isnan(part), 0.0, 1.0 + 254.0 * part) if field.gaps else 255.0 * part
        properties = {name: getattr(field, name) for name in ("name", "title", "unit", "signed", "gaps")}
        header = {**properties, "min": low, "max": end, "largest": largest}
        return Picture(header, shown, np.rint(scaled), inside)

    def _mapped(self, field: Field, inside: bool) -> np.ndarray:
        """Values of the map at the nodes that are drawn; NaN inside of the body."""
        assert self._map is not None
        values = self._map.stiffness if field is PALPATED else self._map.change
        assert values is not None
        if not inside:
            return values
        assert self._green.body is not None
        everywhere = np.full(len(self._green.body.mesh.nodes), np.nan)
        everywhere[self._green.surface_nodes] = values
        return everywhere

    def _fixed_range(self, field: Field, values: np.ndarray) -> tuple[float, float]:
        """Find the ends of a map's colours: all of it, but for a stray place or two."""
        if field.signed:
            return 0.0, max(float(np.nanmax(np.abs(values))), 1.0)
        low, high = np.nanpercentile(values, MAP_RANGE).tolist()
        return low, max(high, low + LEAST * abs(low))

    def _values(self, field: Field, pose: _Pose, displacements: np.ndarray, inside: bool) -> np.ndarray:
        """Values in the field's unit at the nodes that are drawn."""
        if field is DISPLACEMENT:
            return 1e3 * np.sqrt(np.einsum("ij,ij->i", displacements, displacements))
        if field is SURFACE_STRAIN:
            assert self._surface is not None
            return 100.0 * self._surface.at_nodes(displacements)
        found = self._stress_inside(pose) if inside else self._stress(pose)
        if field is STRAIN:
            return 100.0 * largest_magnitude(found.strain)
        if field is FINITE_STRAIN:
            return 100.0 * largest_magnitude(found.green_lagrange_strain)
        # A stiffness changed while running scales stress, not strain.
        scale = self._simulation.stiffness_scale_of(self._body)
        return scale * (found.von_mises if field is VON_MISES else extreme_values(found.stress)[0])

    def _range(self, field: Field, largest: float) -> float:
        now = time.monotonic()
        before, then = self._ranges.get(field.name, (0.0, now))
        decayed = largest + (before - largest) * math.exp((then - now) / DECAY)
        span = max(largest, decayed, self._least(field))
        self._ranges[field.name] = span, now
        return span

    def _least(self, field: Field) -> float:
        if field.unit == "mm":
            return 1e3 * LEAST * self._size
        if field.unit == "%":
            return 100.0 * LEAST
        assert self._recovery is not None
        return LEAST * self._recovery.largest_youngs_modulus * self._simulation.stiffness_scale_of(self._body)

    def _of(self, displacements: np.ndarray) -> _Pose:
        """Keep what is known already of a pose that is the one before."""
        if not np.array_equal(self._pose.displacements, displacements):
            self._pose = _Pose(displacements)
        return self._pose

    def _extended(self, pose: _Pose) -> np.ndarray:
        assert self._recovery is not None
        interior = self._recovery.interior
        return pose.once("extended", lambda: interior.extend(pose.displacements))

    def _stress(self, pose: _Pose) -> SurfaceStress:
        assert self._recovery is not None
        recover = self._recovery.recover_inside
        return pose.once("surface", lambda: recover(self._extended(pose)))

    def _stress_inside(self, pose: _Pose) -> SurfaceStress:
        recover = self._green.stress_everywhere.recover_inside
        return pose.once("inside", lambda: recover(self._extended(pose)))


class _Pose:
    """Displacements, and what was computed from them."""

    def __init__(self, displacements: np.ndarray):
        self.displacements = displacements
        self._known: dict[str, Any] = {}

    def once(self, name: str, compute: Callable[[], Any]) -> Any:
        if name not in self._known:
            self._known[name] = compute()
        return self._known[name]
