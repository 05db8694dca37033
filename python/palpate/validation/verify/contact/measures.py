"""Measures of a contact's forces: work, jumps, friction cone.

Each takes the measured forces, so that tests can replace them by those of a wrong law.

Forces are those on the device, N, as :meth:`palpate.Simulation.play` returns them.
"""

from __future__ import annotations

import numpy as np

# Length over which a running cubic follows what a curved body really does, m.
WINDOW = 0.02
# A jump may be this part of the force, or so much, whichever is larger: what a finger may not notice.
JUMP_PART, JUMP_FORCE = 0.005, 0.005


def exponent(depths: np.ndarray, forces: np.ndarray) -> float:
    """Power of the depth that the force follows, by least squares in logarithms."""
    return float(np.polyfit(np.log(depths), np.log(forces), 1)[0])


def ripple(forces: np.ndarray) -> float:
    """Half the range over the mean of magnitudes along a path where the force should not change."""
    magnitude = np.linalg.norm(forces, axis=1)
    return float(np.ptp(magnitude) / 2 / magnitude.mean())


def roughness(step: float, forces: np.ndarray, window: float = WINDOW) -> tuple[float, float]:
    """Root mean square and largest of `F / cubic - 1`, the cubic fitted to magnitudes in a window around each place.

    Half a window at both ends, where a fit is one-sided, is left out.

    Parameters
    ----------
    step
        Distance of the places along the path, m.
    forces
        (n, 3) N, on a path of at least two windows.
    window
        m.

    """
    from scipy.signal import savgol_filter

    magnitude = np.linalg.norm(forces, axis=1)
    half = round(window / step / 2)
    if len(magnitude) < 4 * half:
        raise ValueError(f"a path of {len(magnitude)} places is shorter than two windows of {2 * half}")
    off = (magnitude / savgol_filter(magnitude, 2 * half + 1, 3) - 1)[half:-half]
    return float(np.sqrt(np.mean(off**2))), float(np.abs(off).max())


def largest_jump(forces: np.ndarray) -> float:
    """Largest change of the force vector from tick to tick, over what a jump may be there; at most 1 is smooth."""
    change = np.linalg.norm(np.diff(forces, axis=0), axis=1)
    magnitude = np.linalg.norm(forces, axis=1)
    allowed = np.maximum(JUMP_PART * np.maximum(magnitude[1:], magnitude[:-1]), JUMP_FORCE)
    return float((change / allowed).max())


def attraction(forces: np.ndarray, normals: np.ndarray) -> float:
    """Largest part of a force that draws the tool into the body, over the largest force."""
    magnitude = np.linalg.norm(forces, axis=-1).max()
    return float(max(0.0, -np.einsum("...k,...k->...", forces, normals).min()) / magnitude)


def beyond_cone(forces: np.ndarray, normals: np.ndarray, friction: float) -> float:
    """Largest `|F_t| / (mu F_n) - 1` of the ticks in contact: above zero it is outside of Coulomb's cone."""
    normal = np.einsum("ij,ij->i", forces, normals)
    along = np.linalg.norm(forces - normal[:, None] * normals, axis=1)
    touching = np.linalg.norm(forces, axis=1) > 1e-12
    return float((along[touching] / (friction * normal[touching]) - 1).max())


def given_out(
    positions: np.ndarray, forces: np.ndarray, orientations: np.ndarray | None = None, torques: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Work that hands got back over closed paths, and the most that they had put in, (p,) J each.

    By the trapezoidal rule, `-sum (F_k + F_k+1)/2 . (x_k+1 - x_k)`, and torque with the rotation vector between ticks.

    Parameters
    ----------
    positions, forces
        (p, t, ..., 3): paths, ticks, tools.
    orientations, torques
        (p, t, ..., 4) unit quaternions w x y z, and (p, t, ..., 3) N m; None: the tools do not turn.

    """
    mean = (forces[:, 1:] + forces[:, :-1]) / 2
    power = -np.einsum("pt...k,pt...k->pt...", mean, np.diff(positions, axis=1))
    if orientations is not None and torques is not None:
        turned = rotation_vectors(orientations[:, :-1], orientations[:, 1:])
        power -= np.einsum("pt...k,pt...k->pt...", (torques[:, 1:] + torques[:, :-1]) / 2, turned)
    work = np.cumsum(power.reshape(*power.shape[:2], -1).sum(axis=2), axis=1)
    return -work[:, -1], work.max(axis=1)


def rotation_vectors(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Rotation (..., 3), rad, in the scene, that leads from one orientation to another."""
    w, v = before[..., :1], -before[..., 1:]
    scalar = after[..., :1] * w - (after[..., 1:] * v).sum(axis=-1, keepdims=True)
    vector = after[..., :1] * v + w * after[..., 1:] + np.cross(after[..., 1:], v)
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    angle = 2 * np.arctan2(length, np.abs(scalar))
    return np.where(length > 0, np.sign(scalar) * vector * angle / np.where(length > 0, length, 1.0), 0.0)


def leak(given: np.ndarray, peak: np.ndarray) -> float:
    """Largest work given out over the path's peak energy; negative where every path takes some."""
    touched = peak > 0
    return float((given[touched] / peak[touched]).max())
