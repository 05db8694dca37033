"""The paper's soft models as smooth implicit shapes: negative inside, zero on the surface.

Lengths are in millimetres here, for organs are described in them; ``make_models.py`` converts once. Axes: x to the
body's left, y to its back, z up, so that the camera in front of a model looks along +y with x to the right. Values are
close to signed distances near the surface, which is all that the projection onto it needs.

Sources: Gray's Anatomy (41st edition) for proportions of liver and kidney; primitives after I. Quilez, "Distance
functions" (2008); smooth minimum: cubic polynomial, twice continuously differentiable.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Field = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Shape:
    """An implicit body and how finely its parts want to be meshed."""

    field: Field  # (n, 3) mm -> (n,) mm, negative inside
    low: tuple[float, float, float]  # a box around it, mm
    high: tuple[float, float, float]
    size: Field  # (n, 3) mm -> (n,) wanted edge length relative to the average


def ellipsoid(p: np.ndarray, centre, radii, turn: np.ndarray | None = None) -> np.ndarray:
    """Approximate distance to an ellipsoid; ``turn`` has its axes as rows."""
    q = p - np.asarray(centre, float)
    if turn is not None:
        q = q @ turn.T
    radii = np.asarray(radii, float)
    k0 = np.linalg.norm(q / radii, axis=-1)
    k1 = np.maximum(np.linalg.norm(q / radii**2, axis=-1), 1e-9)
    return np.where(k0 < 0.05, (k0 - 1) * radii.min(), k0 * (k0 - 1) / k1)


def round_cone(p: np.ndarray, a, b, radius_a: float, radius_b: float) -> np.ndarray:
    """Capsule from ``a`` to ``b`` whose radius changes evenly."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    t = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(p - a - t[..., None] * (b - a), axis=-1) - (radius_a + t * (radius_b - radius_a))


def curve(p: np.ndarray, control, radius_start: float, radius_end: float, pieces: int = 24) -> np.ndarray:
    """Tube along a cubic Bezier curve whose radius changes evenly."""
    t = np.linspace(0, 1, pieces + 1)[:, None]
    weights = np.hstack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    points = weights @ np.asarray(control, float)
    radii = radius_start + t[:, 0] * (radius_end - radius_start)
    cones = (round_cone(p, points[k], points[k + 1], radii[k], radii[k + 1]) for k in range(pieces))
    return np.minimum.reduce(list(cones))


def join(a: np.ndarray, b: np.ndarray, k: float) -> np.ndarray:
    """Smooth union: fillet of about ``k``/2 where two bodies meet."""
    h = np.maximum(k - np.abs(a - b), 0) / k
    return np.minimum(a, b) - h**3 * k / 6


def common(a: np.ndarray, b: np.ndarray, k: float) -> np.ndarray:
    """Smooth intersection."""
    return -join(-a, -b, k)


def cut(a: np.ndarray, b: np.ndarray, k: float) -> np.ndarray:
    """Smooth difference: ``a`` without ``b``."""
    return -join(-a, b, k)


def rotation(axis: str, degrees: float) -> np.ndarray:
    """Rows are the axes turned about one of them (right-hand rule)."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    rows = np.eye(3)
    rows[i, i], rows[i, j], rows[j, i], rows[j, j] = c, s, -s, c
    return rows


def _mirrored(p: np.ndarray) -> np.ndarray:
    return np.stack([np.abs(p[..., 0]), p[..., 1], p[..., 2]], axis=-1)


def doll(p: np.ndarray) -> np.ndarray:
    """Plush bear, sitting, 250 mm tall."""
    m = _mirrored(p)
    muzzle = ellipsoid(p, (0, -46, 174), (25, 21, 19))
    ears = ellipsoid(m, (43, -2, 226), (24, 11, 24))
    ears = cut(ears, ellipsoid(m, (43, -17, 227), (15, 11, 15)), 6)
    head = join(join(_skull(p), muzzle, 10), ears, 8)
    head = join(head, ellipsoid(p, (0, -65, 183), (10.5, 8, 8)), 3)
    head = join(head, ellipsoid(m, (19.5, -44, 199), (7.5, 6.5, 7.5)), 2.5)
    return _seated(p, head, 0)


def plain_doll(p: np.ndarray) -> np.ndarray:
    """Plush bear without what triangles of 14 mm cannot show: no eyes, thicker ears and arms."""
    m = _mirrored(p)
    muzzle = ellipsoid(p, (0, -46, 174), (27, 26, 21))
    head = join(join(_skull(p), muzzle, 10), ellipsoid(m, (44, -3, 226), (25, 16, 24)), 6)
    return _seated(p, head, 3.5)


def _skull(p: np.ndarray) -> np.ndarray:
    return ellipsoid(p, (0, -6, 187), (53, 46, 46))


def _seated(p: np.ndarray, head: np.ndarray, stuffing: float) -> np.ndarray:
    """Body of the bear below its head, thicker by ``stuffing`` mm, cut level at z = 0."""
    m = _mirrored(p)
    waist, chest = ellipsoid(p, (0, 0, 62), (56, 50, 66)), ellipsoid(p, (0, 0, 115), (42, 36, 42))
    torso = join(waist, chest, 40) - stuffing
    arms = round_cone(m, (42, -4, 128), (92 + stuffing, -40, 84 + 3 * stuffing), 19, 22) - stuffing
    legs = round_cone(m, (36, -24, 29), (66, -112, 29), 32, 27)
    feet = ellipsoid(m, (69, -124, 39), (28, 18, 41), rotation("z", -18))
    body = join(join(torso, head, 14), arms, 14)
    body = join(body, join(legs, feet, 14), 16)
    return common(body, -p[..., 2], 8)


def kidney(p: np.ndarray) -> np.ndarray:
    """Left kidney, 110 mm long; hilum and a stub of ureter towards -x."""
    x, y, z = p[..., 0], p[..., 1], p[..., 2] - 55
    bent = np.stack([x + 0.0062 * z**2 - 5, y, z], axis=-1)
    upper = ellipsoid(bent, (0, 0, 18), (29, 20, 37))
    lower = ellipsoid(bent, (0, 0, -18), (27, 19, 37))
    bean = join(upper, lower, 40)
    bean = cut(bean, ellipsoid(p, (-41, 0, 56), (23, 60, 27)), 22)
    bean = cut(bean, ellipsoid(p, (-30, -2, 55), (20, 9, 16)), 12)
    ureter = curve(p, [(-6, -1, 56), (-30, -2, 58), (-41, -2, 48), (-41, -2, 26)], 10, 4.5)
    return join(bean, ureter, 6)


def _bump(value: np.ndarray, width: float) -> np.ndarray:
    return np.exp(-((value / width) ** 2))


def _under_side(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of the liver's visceral surface, mm: oblique, hollow, with fossa and notch running to the front edge."""
    u = x - 16
    height = 57 + 0.42 * u - 0.0022 * u**2 + 0.42 * (y + 48)
    height += 14 * _bump(x - 15, 60) * _bump(y + 2, 34)  # where stomach and colon lie
    forward = 1 / (1 + np.exp((y + 5) / 9))
    height += 18 * _bump(x + 26 - 0.2 * (y + 45), 13) * forward  # gallbladder
    return height + 20 * _bump(x - 20, 8) * forward  # round ligament


def liver(p: np.ndarray) -> np.ndarray:
    """Liver seen from the front: right lobe at the left of the picture, 205 mm wide."""
    x, y, z = (p[..., k] for k in range(3))
    right = ellipsoid(p, (-43, 2, 72), (61, 57, 80))
    left = ellipsoid(p, (8, -8, 95), (97, 42, 48), rotation("y", -4))
    body = join(right, left, 30)
    body = common(body, (_under_side(x, y) - z) / 1.25, 9)
    groove = _bump(x - 20 - 0.1 * (z - 60), 12) / (1 + np.exp((y - 10) / 8))
    return body + 3 * groove


def _finer_where_bent(p: np.ndarray, field: Field, radius: float, finest: float) -> np.ndarray:
    """1 where the shape's mean radius of curvature exceeds ``radius`` mm, less in proportion where it is smaller."""
    step = 0.25 * radius
    slopes = []
    for axis in step * np.eye(3):
        gradients = [_gradient(p + side * axis, field)[..., np.argmax(axis)] for side in (1, -1)]
        slopes.append((gradients[0] - gradients[1]) / (2 * step))
    return np.clip(2 / np.maximum(radius * np.abs(sum(slopes)), 1e-9), finest, 1)


def _gradient(p: np.ndarray, field: Field, step: float = 0.1) -> np.ndarray:
    """Return the unit normal of the level through each point."""
    gradient = np.stack([field(p + axis) - field(p - axis) for axis in step * np.eye(3)], axis=-1)
    return gradient / np.maximum(np.linalg.norm(gradient, axis=-1, keepdims=True), 1e-9)


def _finer(p: np.ndarray, spots: list[tuple]) -> np.ndarray:
    """1 far away, less in soft balls ``(centre, radius, factor)``."""
    size = np.ones(p.shape[:-1])
    for centre, radius, factor in spots:
        away = np.linalg.norm(p - np.asarray(centre, float), axis=-1) / radius
        size = np.minimum(size, factor + (1 - factor) * np.clip(away - 0.6, 0, 1))
    return size


def _doll_size(p: np.ndarray) -> np.ndarray:
    m = _mirrored(p)
    spots = [((0, -60, 183), 26, 0.5), ((20, -48, 199), 16, 0.35), ((45, -8, 230), 30, 0.42)]
    return np.minimum(_finer(m, spots), _finer_where_bent(p, doll, 22, 0.6))


def _plain_doll_size(p: np.ndarray) -> np.ndarray:
    m = _mirrored(p)
    return _finer(m, [((44, -3, 228), 40, 0.65), ((0, -58, 174), 45, 0.75), ((70, -24, 104), 60, 0.8)])


def _kidney_size(p: np.ndarray) -> np.ndarray:
    return _finer(p, [((-40, -2, 36), 28, 0.55)])


def _liver_size(p: np.ndarray) -> np.ndarray:
    return _finer_where_bent(p, liver, 30, 0.4)


SHAPES = {
    "doll": Shape(doll, (-125, -150, -6), (125, 60, 262), _doll_size),
    "plain_doll": Shape(plain_doll, (-128, -150, -6), (128, 60, 262), _plain_doll_size),
    "kidney": Shape(kidney, (-58, -35, -5), (45, 35, 125), _kidney_size),
    "liver": Shape(liver, (-120, -75, -20), (125, 75, 165), _liver_size),
}
