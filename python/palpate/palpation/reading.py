"""Evaluation of the runs of a palpation: force curves, and the values measured at every point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.palpation.partial import Run
from palpate.palpation.press import FORCE_LIMIT, NO_CONTACT, STRAIN_LIMIT, Measured, depths_of, measured, standing_on
from palpate.palpation.protocol import Protocol, Sites
from palpate.palpation.records import PressCurve
from palpate.palpation.runs import Path3D
from palpate.palpation.strokes import PASSES, Track, slope_of_passes
from palpate.simulation import Simulation

# A device puts out its largest force to within rounding.
CLAMPED = 1 - 1e-9


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
        clamped = _clamped(simulation, forces)
        normal_forces = forces @ normal
        found.append(measured(depths, normal_forces, limited, clamped, protocol.depth))
        curves.append(PressCurve(time, depths, np.zeros(len(depths)), forces, normal_forces, limited | clamped))
    return found, curves


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
        clamped = _clamped(simulation, forces)
        slope = slope_of_passes(normal_forces, protocol)
        # The tool has the surface where it is pushed back, the more the deeper.
        pressed = (np.diff(np.vstack([normal_forces, np.zeros(len(forces))]), axis=0) < 0).all(axis=0)
        for tick in track.ticks:
            force = float(normal_forces[0, tick])
            if not pressed[tick]:
                found.append(Measured(np.nan, np.nan, np.nan, NO_CONTACT, np.nan, force))
            elif limited[tick] or clamped[tick]:
                reason = STRAIN_LIMIT if limited[tick] else FORCE_LIMIT
                found.append(Measured(np.nan, np.nan, np.nan, reason, np.nan, force))
            else:
                at = protocol.depth
                found.append(Measured(force, float(slope[tick]), force / at, "", at, force))
        depth = np.full(len(forces), protocol.depth)
        time = (track.lead + np.arange(len(forces))) / rate
        curves.append(PressCurve(time, depth, track.position, forces, normal_forces[0], limited | clamped))
    return found, curves


def _clamped(simulation: Simulation, forces: np.ndarray) -> np.ndarray:
    return np.linalg.norm(forces, axis=1) >= CLAMPED * simulation.scene.device.max_force
