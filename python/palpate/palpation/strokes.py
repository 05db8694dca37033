"""Strokes: lines over the surface, slid over at constant depth.

Each side of a body is cut by planes a spacing apart, across the second of its axes: where they meet the surface a tool
slides from one end to the other. Each stroke is made three times, at `d`, `d - e` and `d - 2 e`, so that the slope of
force over depth is known all along it: `dF/dd = (3 F(d) - 4 F(d - e) + F(d - 2 e)) / (2 e)`, of second order in `e`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.errors import SceneError
from palpate.palpation.press import (
    FORCE_LIMIT,
    NO_CONTACT,
    STRAIN_LIMIT,
    Measured,
    clamped_ticks,
    not_measured,
    standing_on,
)
from palpate.palpation.protocol import Protocol, Selection, Sites, closest
from palpate.palpation.records import PressCurve
from palpate.palpation.runs import Path3D, Run
from palpate.palpation.sides import Side, distances_to_lines
from palpate.simulation import Simulation

# Step between the passes, of the depth, and how many there are; places a spacing at which a stroke is measured, and the
# fewest of a stroke.
DEPTH_STEP, PASSES = 0.1, 3
PER_SPACING, FEWEST_PLACES = 4, 3
# Part of the spacing by which a plane is moved aside.
ASIDE = 1e-4
# Ends closer than this part of a section's size are one.
SAME_END = 1e-7


@dataclass(frozen=True)
class Track:
    """The line of a stroke, tick by tick from its first place on."""

    # (t, 3) m, and outward unit normals (t, 3), in the scene.
    points: np.ndarray
    normals: np.ndarray
    position: np.ndarray  # (t,) m along the line
    ticks: np.ndarray  # (k,) at which its places are reached
    lead: int  # ticks before, in which the tool comes down

    @classmethod
    def of(cls, simulation: Simulation, sites: Sites, stroke: np.ndarray, protocol: Protocol) -> Track:
        """Line through the sites (k,) of a stroke at the protocol's speed, on the surface at every tick."""
        rate, places = simulation.scene.device.rate, sites.points[stroke]
        apart = np.linalg.norm(np.diff(places, axis=0), axis=1)
        ticks = np.concatenate([[0], np.cumsum(np.maximum(1, np.rint(apart * rate / protocol.speed)).astype(int))])

        def at_ticks(values: np.ndarray) -> np.ndarray:
            return np.interp(np.arange(ticks[-1] + 1), ticks, values)

        chords = np.column_stack([at_ticks(axis) for axis in places.T])
        points, normals, _ = closest(simulation, int(sites.bodies[stroke[0]]), chords)
        lead = int(np.ceil(2 * protocol.depth * rate / protocol.speed)) + 1
        position = at_ticks(np.concatenate([[0.0], np.cumsum(apart)]))
        return cls(points, normals, position, ticks, lead)

    def paths(self, simulation: Simulation, protocol: Protocol) -> list[Path3D]:
        """Paths of the passes, the deepest first: down onto the first place, then along the line."""
        turned, reach = standing_on(simulation, self.normals)
        turned = np.vstack([np.repeat(turned[:1], self.lead, axis=0), turned])
        paths = []
        for depth in protocol.depth * (1 - DEPTH_STEP * np.arange(PASSES)):
            down = np.linspace(-depth, depth, self.lead, endpoint=False)
            before = self.points[0] + (reach - down)[:, None] * self.normals[0]
            paths.append(Path3D(np.vstack([before, self.points + (reach - depth) * self.normals]), turned))
        return paths


def slope_of_passes(forces: np.ndarray, protocol: Protocol) -> np.ndarray:
    """Slope of force over depth (t,), N/m, from forces (3, t), N, of the passes."""
    deep, middle, shallow = forces
    return (3 * deep - 4 * middle + shallow) / (2 * DEPTH_STEP * protocol.depth)


def read_strokes(
    simulation: Simulation, protocol: Protocol, tracks: Sequence[Track], runs: Sequence[Run]
) -> tuple[list[Measured], list[PressCurve]]:
    """Read the result at each place of each stroke, and the curve of its deepest pass."""
    rate = simulation.scene.device.rate
    found, curves = [], []
    for rank, track in enumerate(tracks):
        passes = [tuple(part[track.lead :] for part in run) for run in runs[PASSES * rank : PASSES * (rank + 1)]]
        normal_forces = np.array([np.einsum("ij,ij->i", forces, track.normals) for forces, _ in passes])
        forces, limited = passes[0]
        clamped = clamped_ticks(simulation, forces)
        slope = slope_of_passes(normal_forces, protocol)
        # The tool has the surface where it is pushed back, the more the deeper.
        pressed = (np.diff(np.vstack([normal_forces, np.zeros(len(forces))]), axis=0) < 0).all(axis=0)
        for tick in track.ticks:
            force = float(normal_forces[0, tick])
            if not pressed[tick]:
                found.append(not_measured(NO_CONTACT, np.nan, force))
            elif limited[tick] or clamped[tick]:
                reason = STRAIN_LIMIT if limited[tick] else FORCE_LIMIT
                found.append(not_measured(reason, np.nan, force))
            else:
                at = protocol.depth
                found.append(Measured(force, float(slope[tick]), force / at, "", at, force))
        depth = np.full(len(forces), protocol.depth)
        time = (track.lead + np.arange(len(forces))) / rate
        curves.append(PressCurve(time, depth, track.position, forces, normal_forces[0], limited | clamped))
    return found, curves


def strokes_on(simulation: Simulation, protocol: Protocol, on: str | None) -> tuple[Sites, list[np.ndarray]]:
    """Places of strokes over all bodies, and which of them (k,) each stroke visits, in order.

    Raises SceneError for a spacing wider than every body, no stroke, or a tool that sticks.
    """
    law = simulation.scene.tools[0].contact
    if law != "local":
        raise SceneError(f"strokes are for a tool that slides: contact = 'local', this one has '{law}'")
    selection = Selection(simulation, protocol, on)
    points, normals, bodies, strokes = [], [], [], []
    count = 0
    for body, shape in enumerate(selection.shapes):
        for line, triangles in (line for side in shape.sides for line in _lines(side, protocol.spacing)):
            kept = selection.mask(body, line, triangles)
            for run in _runs(kept):
                feet, along, _ = closest(simulation, body, simulation.bodies[body].points_to_scene(line[run]))
                points.append(feet)
                normals.append(along)
                bodies.append(np.full(len(feet), body))
                strokes.append(np.arange(count, count + len(feet)))
                count += len(feet)
    if not strokes:
        raise SceneError(selection.no_sites_message("no line to stroke"))
    sites = Sites(np.vstack(points), np.vstack(normals), np.concatenate(bodies), selection.excluded)
    return sites, strokes


def _runs(kept: np.ndarray) -> list[np.ndarray]:
    """Ranks of consecutive places of a mask (n,) that are long enough for a stroke."""
    ranks = np.split(np.arange(len(kept)), np.flatnonzero(np.diff(kept)) + 1)
    return [run for run in ranks if len(run) >= FEWEST_PLACES and kept[run[0]]]


def _lines(side: Side, spacing: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Lines over a side: places (k, 3) m along each, and the triangles (k,) that they lie on."""
    from trimesh import Trimesh
    from trimesh.intersections import mesh_plane

    first, second = side.axes()
    surface = Trimesh(side.positions, side.triangles, process=False)
    across = side.positions[side.triangles] @ second
    low, high = float(across.min()), float(across.max())
    count = max(1, int((high - low) / spacing * (1 + 1e-9)))
    lines = []
    for offset in (low + high) / 2 + spacing * (np.arange(count) - (count - 1) / 2):
        # Beside the nodes of a regular mesh, where a plane would cut no triangle in two.
        origin = (offset + ASIDE * spacing) * second
        segments, faces = mesh_plane(surface, second, origin, return_faces=True)
        for chain in _chained(segments):
            forward = chain if (chain[-1] - chain[0]) @ first >= 0 else chain[::-1]
            places = _resampled(forward, spacing / PER_SPACING)
            nearest = distances_to_lines(places, segments[:, 0], segments[:, 1]).argmin(axis=1)
            lines.append((places, side.ranks[faces[nearest]]))
    return lines


def _chained(segments: np.ndarray) -> list[np.ndarray]:
    """Polylines (k, 3) of line segments (n, 2, 3) that share their ends; a closed one ends where it begins."""
    if len(segments) == 0:
        return []
    ends = segments.reshape(-1, 3)
    grid = np.round(ends / (SAME_END * np.ptp(ends, axis=0).max())).astype(np.int64)
    _, first, joined = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    beside: dict[int, set[int]] = {}
    for one, other in joined.reshape(-1, 2).tolist():
        if one != other:
            beside.setdefault(one, set()).add(other)
            beside.setdefault(other, set()).add(one)
    chains = []
    # Open lines from their ends on, then closed ones.
    for start in sorted(beside, key=lambda node: (len(beside[node]) != 1, node)):
        while beside[start]:
            chain = [start]
            while beside[chain[-1]]:
                onwards = min(beside[chain[-1]])
                beside[chain[-1]].remove(onwards)
                beside[onwards].remove(chain[-1])
                chain.append(onwards)
            chains.append(ends[first[chain]])
    return chains


def _resampled(chain: np.ndarray, step: float) -> np.ndarray:
    """Places about a step apart along a polyline, its ends left out by half of that."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(chain, axis=0), axis=1))])
    count = max(1, round(arc[-1] / step))
    at = (np.arange(count) + 0.5) * arc[-1] / count
    return np.column_stack([np.interp(at, arc, axis) for axis in chain.T])
