"""Choices for a body that is set up in the page, and the messages that change them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from palpate.body.tissues import TISSUES, Tissue
from palpate.errors import ViewerError
from palpate.mesh.size import COMMON_UNITS
from palpate.viewer.messages import flag, number, vector, whole, word

AXES = "xyz"
# A nodule that is placed first: in the middle, of this part of the body's shortest side, and so many times as stiff.
# Samani et al. 2007 found high-grade carcinoma up to 13 times as stiff as the tissue around it.
NODULE_SIZE, NODULE_FACTOR = 0.15, 5.0
# Tools and nodules are between these parts of the body's longest side.
LEAST_RADIUS, MOST_RADIUS = 1 / 200, 1 / 3


@dataclass(frozen=True)
class Plane:
    """Supports between a side of the body's box and a plane along it: across an axis, so deep from that side, m."""

    axis: int
    above: bool
    depth: float

    @property
    def predicate(self) -> str:
        """As a scene has it."""
        name, depth = AXES[self.axis], f"{1e3 * self.depth:.6g}mm"
        return f"{name} > max - {depth}" if self.above else f"{name} < min + {depth}"


@dataclass(frozen=True)
class Nodule:
    """A ball of another stiffness: m, Pa."""

    center: tuple[float, float, float]
    radius: float
    youngs_modulus: float


@dataclass(frozen=True)
class SegmentChoice:
    """A segment of a label map, and the name of its material."""

    name: str
    tissue: str


@dataclass(frozen=True)
class Choices:
    """What is chosen."""

    unit: str | None  # of the file; None where it may be one of several and nobody has chosen yet
    painted: bool  # whether the supports are those that are painted, in place of those below a plane
    plane: Plane
    tissue: str | None  # name of a material of `TISSUES`
    # Of the tissue, or others that were chosen later; Pa.
    youngs_modulus: float
    poissons_ratio: float
    radius: float  # of the tool, m
    friction: float | None = None
    nodule: Nodule | None = None
    segments: tuple[SegmentChoice, ...] = ()  # within the largest one, which has the material of the body

    def scaled(self, factor: float) -> Choices:
        """Return the same of a body whose lengths are larger by a factor."""
        nodule = self.nodule
        if nodule is not None:
            x, y, z = nodule.center
            nodule = Nodule((x * factor, y * factor, z * factor), nodule.radius * factor, nodule.youngs_modulus)
        plane = replace(self.plane, depth=self.plane.depth * factor)
        return replace(self, plane=plane, radius=self.radius * factor, nodule=nodule)

    def changed(self, message: Mapping[str, Any], low: np.ndarray, high: np.ndarray) -> Choices:
        """Choices with those of a message, for a body between corners (3,), m.

        Raises ViewerError for a message that makes no sense, or a value that the body cannot take.
        """
        readers: dict[str, Callable[[], Any]] = {
            "unit": lambda: _one_of(message, "unit", COMMON_UNITS),
            "painted": lambda: flag(message, "painted"),
            "plane": lambda: _plane(message, high - low),
            "tissue": lambda: _one_of(message, "tissue", [tissue.name for tissue in TISSUES]),
            "radius": lambda: _radius(message, "radius", high - low),
            "nodule": lambda: _nodule(message, low, high),
            "segments": lambda: _segments(message, self.segments),
        }
        keys = set(message) - {"type"}
        if not keys or not keys <= readers.keys():
            raise ViewerError(f"setup takes {', '.join(sorted(readers))}")
        change = {key: read() for key, read in readers.items() if key in keys}
        if "tissue" in change:
            tissue = tissue_named(change["tissue"])
            change |= {"youngs_modulus": tissue.youngs_modulus, "poissons_ratio": tissue.poissons_ratio}
        return replace(self, **change)


def tissue_named(name: str) -> Tissue:
    """Material of the list."""
    return next(tissue for tissue in TISSUES if tissue.name == name)


def first_segments(names: Sequence[str]) -> tuple[SegmentChoice, ...]:
    """Choices for all segments but the first: the material that a segment is called by, else that of the body."""

    def tissue(name: str) -> str:
        return next((t.name for t in TISSUES if t.name in name.lower()), TISSUES[0].name)

    return tuple(SegmentChoice(name, tissue(name)) for name in names[1:])


def _segments(message: Mapping[str, Any], before: Sequence[SegmentChoice]) -> tuple[SegmentChoice, ...]:
    """Materials of the same segments."""
    tables = message["segments"]
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise ViewerError("setup: segments must be a list of objects")
    names = [tissue.name for tissue in TISSUES]
    tables = [{**table, "type": "setup: segments"} for table in tables]
    chosen = [SegmentChoice(word(table, "name"), _one_of(table, "tissue", names)) for table in tables]
    if [segment.name for segment in chosen] != [segment.name for segment in before]:
        raise ViewerError("setup: segments must be those of the file, in its order")
    return tuple(chosen)


def _one_of(message: Mapping[str, Any], key: str, known: Sequence[str]) -> str:
    name = word(message, key)
    if name not in known:
        raise ViewerError(f"setup: {key} must be one of {', '.join(known)}")
    return name


def _table(message: Mapping[str, Any], key: str) -> dict[str, Any]:
    value = message[key]
    if not isinstance(value, dict):
        raise ViewerError(f"setup: {key} must be an object")
    return {**value, "type": f"setup: {key}"}


def _radius(message: Mapping[str, Any], key: str, sides: np.ndarray) -> float:
    radius, longest = number(message, key), float(sides.max())
    # Rounded numbers of the page may lie just beyond.
    if not 0.99 * LEAST_RADIUS * longest <= radius <= 1.01 * MOST_RADIUS * longest:
        low, high = 1e3 * LEAST_RADIUS * longest, 1e3 * MOST_RADIUS * longest
        raise ViewerError(f"setup: the radius goes from {low:.3g} to {high:.3g} mm on this body")
    return radius


def _plane(message: Mapping[str, Any], sides: np.ndarray) -> Plane:
    table = _table(message, "plane")
    axis, depth = whole(table, "axis", 0, 2), number(table, "depth")
    if not 0 < depth <= 1.01 * sides[axis]:
        raise ViewerError(f"setup: the plane goes up to {1e3 * sides[axis]:.3g} mm into this body")
    return Plane(axis, flag(table, "above"), depth)


def _nodule(message: Mapping[str, Any], low: np.ndarray, high: np.ndarray) -> Nodule | None:
    if message["nodule"] is None:
        return None
    table = _table(message, "nodule")
    center, modulus = vector(table, "center"), number(table, "youngs_modulus")
    if not (low <= center).all() or not (center <= high).all():
        raise ViewerError("setup: the middle of the nodule must lie within the body's box")
    if modulus <= 0:
        raise ViewerError("setup: the nodule needs a positive Young's modulus")
    return Nodule(center, _radius(table, "radius", high - low), modulus)
