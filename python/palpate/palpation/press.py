"""Presses: the path of the tool, and the stiffness found from its force.

The tool comes along the inward normal until it has gone `d` beyond first touch. With the component `F` of its force
along the outward normal,

    stiffness          dF/dd at the depth, by a parabola through the last fifth of the press
    secant stiffness   F/d

Hertz's sphere on a half-space has `F = 4/3 E* sqrt(R) d^(3/2)`: `dF/dd = 2 E* sqrt(R d)`, 3/2 of the secant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.palpation.protocol import Protocol, Sites
from palpate.palpation.records import PressCurve
from palpate.palpation.runs import Path3D, Run
from palpate.simulation import Simulation
from palpate.vectors import turning_z_to

# A press begins this part of its depth above the surface. Force so early, of this part of the largest, is that of
# another place of the body.
CLEARANCE, EARLY, EARLY_FORCE = 0.25, 0.1, 0.02
# The slope is that of the last part of the depth.
LAST_PART = 0.2
# A device puts out its largest force to within rounding.
CLAMPED = 1 - 1e-9

STRAIN_LIMIT, FORCE_LIMIT, OTHER_PLACE, NO_CONTACT = "strain limit", "force limit", "other place", "no contact"


@dataclass(frozen=True)
class Measured:
    """Result of one press; a stiffness that could not be measured is NaN."""

    # At the depth: N along the normal, N/m, N/m. NaN where something held the tool before.
    force: float
    stiffness: float
    secant_stiffness: float
    # What did: "strain limit" or "force limit"; "other place" where the tool touched beside its point first, "no
    # contact" where it lost the surface; else empty.
    held_by: str
    # m and N, where nothing held it yet.
    reached_depth: float
    reached_force: float


def depths_of(protocol: Protocol, rate: float) -> np.ndarray:
    """Depth at each tick of a press (t,), m, below zero before the touch; the last one is the protocol's."""
    start = -CLEARANCE * protocol.depth
    return np.linspace(start, protocol.depth, int(np.ceil((protocol.depth - start) * rate / protocol.speed)) + 1)


def standing_on(simulation: Simulation, normals: np.ndarray) -> tuple[np.ndarray, float]:
    """Orientations (n, 4), unit quaternions w x y z, of a first tool whose front faces a surface, and its reach, m.

    Its axis is turned from z to the normal by the smallest rotation; the reach is from its origin to its front.
    """
    tool = simulation.scene.tools[0]
    kind, _, vertices, _ = tool.shape_arguments(simulation.scene.folder)
    return turning_z_to(normals), (-float(np.min(vertices, axis=0)[2]) if kind == "surface" else tool.reach)


def measured(
    depths: np.ndarray, normal_forces: np.ndarray, limited: np.ndarray, clamped: np.ndarray, depth: float
) -> Measured:
    """Read a press: forces along the normal (t,), N, where strain and where force was limited (t,)."""
    early = normal_forces[depths < -EARLY * depth]
    if np.abs(early).max(initial=0.0) > EARLY_FORCE * np.abs(normal_forces).max():
        return not_measured(OTHER_PLACE, 0.0, 0.0)
    if normal_forces[-1] <= 0:
        return not_measured(NO_CONTACT, 0.0, 0.0)
    held = limited | clamped
    window = depths >= (1 - LAST_PART) * depth
    if held[window].any():
        free = np.flatnonzero(~held[depths > 0]) + int((depths <= 0).sum())
        last = int(free[-1]) if len(free) else 0
        reached = (float(depths[last]), float(normal_forces[last])) if len(free) else (0.0, 0.0)
        return not_measured(STRAIN_LIMIT if limited[window].any() else FORCE_LIMIT, *reached)
    force, stiffness = value_and_slope(depths[window], normal_forces[window], depth)
    return Measured(force, stiffness, force / depth, "", depth, force)


def value_and_slope(depths: np.ndarray, forces: np.ndarray, at: float) -> tuple[float, float]:
    """Value, N, and slope, N/m, of a parabola through a curve."""
    scaled = (depths - at) / np.ptp(depths)
    _, slope, value = np.polyfit(scaled, forces, 2)
    return float(value), float(slope / np.ptp(depths))


def not_measured(held_by: str, depth: float, force: float) -> Measured:
    """Return a press that something held: what, and the depth, m, and the force, N, up to which nothing did."""
    return Measured(np.nan, np.nan, np.nan, held_by, depth, force)


def press_paths(simulation: Simulation, sites: Sites, protocol: Protocol) -> list[Path3D]:
    """Path of the tool for each press, along the inward normal."""
    depths = depths_of(protocol, simulation.scene.device.rate)
    turned, reach = standing_on(simulation, sites.normals)
    return [
        Path3D(point + (reach - depths)[:, None] * normal, np.repeat(orientation[None], len(depths), axis=0))
        for point, normal, orientation in zip(sites.points, sites.normals, turned, strict=True)
    ]


def read_presses(
    simulation: Simulation, protocol: Protocol, sites: Sites, runs: Sequence[Run]
) -> tuple[list[Measured], list[PressCurve]]:
    """Read the result of each press, and its curve."""
    rate = simulation.scene.device.rate
    depths = depths_of(protocol, rate)
    time = np.arange(len(depths)) / rate
    found, curves = [], []
    for (forces, limited), normal in zip(runs, sites.normals, strict=True):
        clamped = clamped_ticks(simulation, forces)
        normal_forces = forces @ normal
        found.append(measured(depths, normal_forces, limited, clamped, protocol.depth))
        curves.append(PressCurve(time, depths, np.zeros(len(depths)), forces, normal_forces, limited | clamped))
    return found, curves


def clamped_ticks(simulation: Simulation, forces: np.ndarray) -> np.ndarray:
    """Mask (t,) of the ticks in which a device puts out its largest force, of forces (t, 3), N."""
    return np.linalg.norm(forces, axis=1) >= CLAMPED * simulation.scene.device.max_force
