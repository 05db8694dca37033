"""A body that is set up in the page: its file, its tetrahedra, the choices, and the scene file that they make."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from palpate.body import parse
from palpate.body.default_support import lowest_height
from palpate.body.tissues import TISSUES, Tissue
from palpate.errors import ViewerError
from palpate.mesh import TetMesh
from palpate.mesh.fill_process import ReadFile
from palpate.mesh.shapes import Sphere
from palpate.mesh.size import COMMON_UNITS
from palpate.scene import Scene
from palpate.scene.files import scene_text, write_nodes
from palpate.scene.sizes import PART_OF_BODY
from palpate.units import length_scale
from palpate.viewer.computing import mask_text
from palpate.viewer.messages import flag, number, vector, whole, word

# Of files with two endings both are left out.
_ENDINGS = re.compile(r"(\.seg\.nrrd|\.nii\.gz|\.[^.]*)$", re.IGNORECASE)
# So many scenes of one name are saved in a folder.
MOST_SAVED = 1000

AXES = "xyz"
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

    unit: str | None  # of the file; None while it may be one of several
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


class SetupBody:
    """A body with what is chosen for it.

    Parameters
    ----------
    read
        What its file holds.
    folder
        Where its scene is written to be touched.

    Attributes
    ----------
    mesh
        Its tetrahedra, m; None until they are made.
    notes
        What the mesher reported.
    saved
        Path of the scene file that was saved last, and still is what is chosen.

    """

    def __init__(self, read: ReadFile, folder: Path):
        self.read, self.folder = read, folder
        self.mesh: TetMesh | None = None
        self.notes: list[str] = []
        self.saved: Path | None = None
        self._unit = read.unit
        tissue, longest = TISSUES[0], max(read.sides) * length_scale(read.unit)
        certain = read.unit if len(read.fitting) == 1 else None
        plane = Plane(2, False, 0.1 * max(read.sides[2] * length_scale(read.unit), 1e-9))
        material = (tissue.name, tissue.youngs_modulus, tissue.poissons_ratio)
        self.choices = Choices(certain, False, plane, *material, radius=PART_OF_BODY * longest)
        self._painted = np.zeros(0, dtype=bool)

    @property
    def name(self) -> str:
        """Of the body: its file without the ending."""
        return _ENDINGS.sub("", self.read.file) or Path(self.read.file).stem

    def take_mesh(self, mesh: TetMesh, notes: list[str]) -> None:
        """Take the tetrahedra of the file in the unit that it was read in."""
        factor = length_scale(self._unit) / length_scale(self.read.unit)
        self.mesh = mesh if factor == 1 else _scaled(mesh, factor)
        self.notes = notes
        self._painted = np.zeros(len(mesh.surface_nodes), dtype=bool)
        plane = Plane(2, False, lowest_height(self.mesh))
        # The first region is the largest: it has the material of the body.
        self.choices = replace(self.choices, plane=plane, segments=first_segments(_regions_of(mesh)))

    def change(self, message: Mapping[str, Any]) -> bool:
        """Take choices of a message. Returns whether the body is larger or smaller now.

        Raises ViewerError for choices that make no sense for this body.
        """
        mesh = self._filled()
        changed = self.choices.changed(message, *mesh.bounds)
        self.saved = None
        unit = changed.unit
        if unit is None or unit == self._unit:
            self.choices = changed
            return False
        factor = length_scale(unit) / length_scale(self._unit)
        self._unit, self.mesh, self.choices = unit, _scaled(mesh, factor), changed.scaled(factor)
        return True

    def paint(self, first: int, mask: np.ndarray) -> None:
        """Take a part of the painted supports: bits for the surface nodes from ``first`` on.

        Raises ViewerError for nodes that the surface does not have.
        """
        self._filled()
        if first % 8 or first + np.flatnonzero(mask).max(initial=-1) >= len(self._painted):
            raise ViewerError("hold: nodes must be a mask of surface nodes")
        part = self._painted[first : first + len(mask)]
        part[:] = mask[: len(part)]
        self.saved = None

    def take_settings(self, youngs_modulus: float | None, friction: float) -> None:
        """Take what was changed while the body was touched."""
        before = self.choices
        if youngs_modulus is not None and youngs_modulus != before.youngs_modulus:
            self.choices = replace(self.choices, youngs_modulus=youngs_modulus, tissue=None)
        self.choices = replace(self.choices, friction=friction)
        if self.choices != before:
            self.saved = None

    def message(self) -> dict[str, Any]:
        """Part of the setup message: what is known of the body, and what is chosen."""
        choices, mesh = self.choices, self.mesh
        scale = length_scale(self._unit)
        return {
            "name": self.name,
            "file": self.read.file,
            "unit": choices.unit,
            "units": [{"unit": unit, "size": self._size(length_scale(unit))} for unit in COMMON_UNITS],
            "fitting": list(self.read.fitting),
            "size": self._size(scale),
            "low": [0.0] * 3 if mesh is None else mesh.bounds[0].tolist(),
            "filled": mesh is not None,
            "nodes": 0 if mesh is None else len(mesh.nodes),
            "tets": 0 if mesh is None else len(mesh.tets),
            "notes": self.notes,
            "painted": choices.painted,
            "held": mask_text(self._painted) if self._painted.any() else None,
            "plane": asdict(choices.plane),
            "tissue": choices.tissue,
            "segments": [asdict(segment) for segment in choices.segments],
            "youngs_modulus": choices.youngs_modulus,
            "poissons_ratio": choices.poissons_ratio,
            "radius": choices.radius,
            "nodule": None if choices.nodule is None else asdict(choices.nodule),
            "saved": None if self.saved is None else str(self.saved),
        }

    def _size(self, scale: float) -> list[float]:
        return [side * scale for side in self.read.sides]

    def write(self, folder: Path, name: str) -> Path:
        """Write the scene, its tetrahedra and its painted supports into a folder; return the scene file.

        Raises ViewerError for choices that make no scene.
        """
        mesh, choices = self._filled(), self.choices
        if choices.unit is None:
            raise ViewerError("choose the unit of length of the file first")
        held = self._held(mesh)
        if choices.nodule is not None:
            self._require_nodule(mesh)
        mesh.write(folder / f"{name}.vtu")
        tables: dict[str, Any] = {"body": {"name": self.name, "mesh": f"{name}.vtu", "unit": "m"}}
        comments = {"": f"Set up in the page from {self.read.file}, in {choices.unit}."}
        if choices.painted:
            write_nodes(folder / f"{name}.nodes", held, f"Painted supports: nodes of {name}.vtu, counted from 0")
            tables["supports"] = {"fixed": f"{name}.nodes"}
        else:
            tables["supports"] = {"fixed": choices.plane.predicate}
        tables["material"] = {"youngs_modulus": choices.youngs_modulus, "poissons_ratio": choices.poissons_ratio}
        tissue = next((tissue for tissue in TISSUES if tissue.name == choices.tissue), None)
        if tissue is not None:
            comments["material"] = f"{tissue.title}: {tissue.citation}"
        regions = [_segment_table(mesh, segment) for segment in choices.segments]
        if regions:
            numbered = (f"{mesh.region_names[segment.name]} {segment.name}" for segment in choices.segments)
            comments["region"] = f"Segments by their number in the mesh: {', '.join(numbered)}"
        if choices.nodule is not None:
            regions.append({"shape": "sphere", **asdict(choices.nodule)})
        if regions:
            tables["region"] = regions
        tables["tool"] = {"radius": choices.radius}
        if choices.friction is not None:
            tables["tool"]["friction"] = choices.friction
        path = folder / f"{name}.toml"
        path.write_text(scene_text(tables, comments), encoding="utf-8")
        return path

    def scene(self) -> Scene:
        """Scene of what is chosen, from the files that it would be saved in.

        Raises Error for choices that make no scene.
        """
        place = self.folder / "scene"
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        return Scene.read(self.write(place, self.name))

    def save(self, folder: Path) -> Path:
        """Save the scene under a name that no file in the folder has; Error for a folder that cannot be written."""
        names = [self.name, *(f"{self.name}-{number}" for number in range(2, MOST_SAVED + 1))]
        endings = (".toml", ".vtu", ".nodes")
        free = next((n for n in names if not any((folder / f"{n}{ending}").exists() for ending in endings)), None)
        if free is None:
            raise ViewerError(f"{folder}: there are {MOST_SAVED} scenes of this name already")
        try:
            self.saved = self.write(folder.absolute(), free)
        except OSError as error:
            raise ViewerError(f"cannot save in {folder}: {error.strerror or error}") from None
        return self.saved

    def _held(self, mesh: TetMesh) -> np.ndarray:
        if self.choices.painted:
            held = mesh.surface_nodes[self._painted]
            if not len(held):
                raise ViewerError("nothing is painted: paint where the body is held, or choose Plane")
            return held
        held = np.flatnonzero(parse(self.choices.plane.predicate)(mesh.nodes))
        if len(held) == len(mesh.nodes):
            raise ViewerError("all of the body is held: move the plane back")
        return held

    def _require_nodule(self, mesh: TetMesh) -> None:
        """Refuse a nodule that no element lies in."""
        nodule = self.choices.nodule
        assert nodule is not None
        if not Sphere(nodule.center, nodule.radius)(mesh.nodes[mesh.tets[:, :4]].mean(axis=1)).any():
            raise ViewerError("the nodule is too small for the elements, or outside of the body: make it larger")

    def _filled(self) -> TetMesh:
        if self.mesh is None:
            raise ViewerError("the body is still being filled with tetrahedra")
        return self.mesh


def _regions_of(mesh: TetMesh) -> list[str]:
    """Names of the regions that have elements."""
    there = set(np.unique(mesh.regions).tolist())
    return [name for name, number in mesh.region_names.items() if number in there]


def _segment_table(mesh: TetMesh, segment: SegmentChoice) -> dict[str, Any]:
    """Table of a region for a segment."""
    tissue = tissue_named(segment.tissue)
    material = {"youngs_modulus": tissue.youngs_modulus, "poissons_ratio": tissue.poissons_ratio}
    return {"mesh_region": mesh.region_names[segment.name], **material}


def _scaled(mesh: TetMesh, factor: float) -> TetMesh:
    return TetMesh(mesh.nodes * factor, mesh.tets, mesh.regions, mesh.region_names)
