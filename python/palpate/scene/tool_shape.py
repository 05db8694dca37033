"""Shapes of tools: the keys of each, and surfaces from files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydantic import model_validator

from palpate.mesh.surface_file import SURFACE_ENDINGS
from palpate.mesh.tetrahedralize import closed_surface
from palpate.scene.table import Length, Table
from palpate.units import length_scale

# Keys of each shape, and those of them that it cannot do without.
KEYS: dict[str, tuple[set[str], set[str]]] = {
    "sphere": ({"radius"}, set()),
    "ellipsoid": ({"semi_axes"}, {"semi_axes"}),
    "capsule": ({"radius", "length"}, {"length"}),
    "punch": ({"radius", "rounding"}, set()),
}
KEYS_OF_FILES: tuple[set[str], set[str]] = ({"unit"}, set())
# Part of its radius by which the rim of a punch is rounded by default.
ROUNDING = 0.1

# Kind, three lengths (m), and of a surface its vertices (m) and triangles.
ShapeArguments = tuple[str, tuple[float, float, float], list[list[float]], list[list[int]]]


class ShapeTable(Table):
    """Keys of a tool's shape.

    Capsule and punch lie along z of the tool, their front towards -z; its origin is the middle of the front hemisphere
    or of the face.
    """

    shape: str = "sphere"
    """`sphere`, `ellipsoid`, `capsule`, `punch`, or the path of a closed surface file relative to the scene file."""
    radius: Length | None = None
    """Radius of a sphere, a capsule or a punch. Default: a sixteenth of the longest side of the body."""
    semi_axes: tuple[Length, Length, Length] | None = None
    """Semi-axes of an ellipsoid along its x, y and z."""
    length: Length | None = None
    """Length of a capsule between the centres of its hemispheres."""
    rounding: Length | None = None
    """Radius of the rim of a punch. Default: a tenth of its radius."""
    unit: str = "m"
    """Unit of length of a surface file."""

    @model_validator(mode="after")
    def _keys_of_the_shape(self) -> ShapeTable:
        """Refuse keys that the shape does not take."""
        name = self.shape
        if name not in KEYS and Path(name).suffix.lower() not in SURFACE_ENDINGS:
            known = ", ".join(f"'{key}'" for key in KEYS)
            files = ", ".join(SURFACE_ENDINGS)
            raise ValueError(f"unknown shape '{name}'; known are {known} and surface files ({files})")
        taken, needed = KEYS.get(name, KEYS_OF_FILES)
        for key in sorted(self.model_fields_set & set(ShapeTable.model_fields) - taken - {"shape"}):
            raise ValueError(f"a tool of shape '{name}' takes no '{key}'; it takes {', '.join(sorted(taken))}")
        for key in sorted(needed - self.model_fields_set):
            raise ValueError(f"a tool of shape '{name}' needs the key '{key}'")
        if self.rounding is not None and self.radius is not None and self.rounding > self.radius:
            raise ValueError(f"rounding is {self.rounding:g} m, more than the radius of {self.radius:g} m")
        return self

    def in_folder(self, folder: Path) -> ShapeTable:
        """Return the same tool for a scene of any folder: its surface file by its whole path."""
        return self if self.shape in KEYS else self.model_copy(update={"shape": str((folder / self.shape).absolute())})

    @property
    def reach(self) -> float:
        """From the tool's origin to its front along -z, m; of a surface file 0, because its origin may lie anywhere."""
        radius = self.radius or 0.0
        fronts = {"sphere": radius, "capsule": radius, "ellipsoid": (self.semi_axes or (0.0,))[-1]}
        return fronts.get(self.shape, 0.0)

    def shape_arguments(self, folder: Path) -> ShapeArguments:
        """Put the shape as the force loop takes it; a surface file, relative to ``folder``, is read.

        Raises MeshError for a file that is missing, cannot be read or holds no closed surface.
        """
        radius = self.radius or 0.0
        if self.shape == "sphere":
            return "sphere", (radius, 0.0, 0.0), [], []
        if self.shape == "ellipsoid" and self.semi_axes is not None:
            return "ellipsoid", self.semi_axes, [], []
        if self.shape == "capsule":
            return "capsule", (radius, self.length or 0.0, 0.0), [], []
        if self.shape == "punch":
            return "punch", (radius, self.rounding or ROUNDING * radius, 0.0), [], []
        surface = closed_surface(folder / self.shape)
        vertices = np.asarray(surface.vertices, dtype=float) * length_scale(self.unit)
        return "surface", (0.0, 0.0, 0.0), vertices.tolist(), np.asarray(surface.faces).tolist()
