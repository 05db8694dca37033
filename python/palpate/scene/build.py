"""Building of a scene: meshes, bodies, Green's functions and modes; and where a script presses it."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate import _native, models
from palpate.body import Body, parse
from palpate.errors import Error, SceneError, UnclearUnitError
from palpate.green import BackgroundPrecompute, GreensFunction, precompute, require_precise
from palpate.mesh import TetMesh
from palpate.mesh.elements import EDGES
from palpate.mesh.label_process import label_summary
from palpate.mesh.size import scale_of
from palpate.mesh.tetrahedralize import closed_surface, read_surface, tetrahedralize_with
from palpate.progress import progress_reporter
from palpate.scene.dynamics import BodyMotion
from palpate.scene.files import is_node_file, read_nodes
from palpate.scene.loads import together
from palpate.scene.mistakes import located
from palpate.scene.regions import MaterialTable
from palpate.scene.sizes import Expected, pressing_radii, require_tool_sizes, with_radii
from palpate.scene.tables import BodyTable, SceneTables, SupportsTable
from palpate.segmentation.endings import is_segmentation
from palpate.vectors import conjugate, rotated

if TYPE_CHECKING:
    from distributed import Client

Progress = bool | Callable[[int, int], None]
# How deep a script presses, as a part of the body's longest side: small strains.
DEPTH = 0.03


@dataclass(frozen=True)
class BuiltBody:
    """A body of a scene, ready to be touched."""

    body: Body | None  # None for one from a store, which knows only the surface
    green: GreensFunction
    motion: BodyMotion | None = None  # what moves it; None at rest
    name: str = "body"  # what it is called
    # Of its own frame in the scene: m, and a unit quaternion w x y z.
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    orientation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    # Its displacement beyond small strain by the radius of a sphere, m: as far as it is known, None where nothing is
    # known yet. Empty for a body that stays linear below its contacts.
    series: tuple[tuple[float, _native.Series | None], ...] = ()
    is_growing: bool = False  # whether more of its Green's function is being computed

    @property
    def is_hyperelastic(self) -> bool:
        """Whether its elements are known, and a material of it has a law beyond small strain."""
        return self.body is not None and self.body.is_hyperelastic

    def points_to_scene(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the body's own frame in the scene, m."""
        return rotated(points, self.orientation) + np.array(self.position)

    def points_to_body(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the scene in the body's own frame, m."""
        return rotated(np.asarray(points) - np.array(self.position), conjugate(self.orientation))

    def vectors_to_scene(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors (..., 3) of the body's own frame in the scene."""
        return rotated(vectors, self.orientation)


@dataclass(frozen=True)
class BuiltScene:
    """A scene with its bodies; tools without a radius have one that follows them."""

    scene: SceneTables
    bodies: tuple[BuiltBody, ...]

    def __post_init__(self) -> None:
        for body in self.bodies:
            require_precise(body.green, f"forces on {body.name}")
        object.__setattr__(self, "scene", with_radii(self.scene, [body.green for body in self.bodies]))

    @classmethod
    def of(
        cls, scene: SceneTables, body: Body | None, green: GreensFunction, motion: BodyMotion | None = None
    ) -> BuiltScene:
        """Scene of a single body that is there already, where the scene's own body stands."""
        table = scene.bodies[0]
        return cls(scene, (BuiltBody(body, green, motion, table.title, table.position, table.orientation),))


def build(
    scene: SceneTables,
    progress: Progress,
    modes_progress: Progress | None,
    growing: dict[int, BackgroundPrecompute] | None = None,
    announce: Callable[[Expected], None] | None = None,
    dask: str | Client | None = None,
) -> BuiltScene:
    """See :meth:`palpate.Scene.build`, and with ``growing`` :meth:`palpate.Scene.build_first`."""
    builders = [_Builder(scene, rank, growing, progress, announce, dask) for rank in range(len(scene.bodies))]
    # Before anything is solved.
    require_tool_sizes(scene, max(builder.prepare() for builder in builders))
    return BuiltScene(scene, tuple(builder.build(progress, modes_progress) for builder in builders))


def marked_as_growing(built: BuiltScene, growing: Mapping[int, BackgroundPrecompute]) -> BuiltScene:
    """Mark the bodies that are still being computed."""
    bodies = list(built.bodies)
    for rank, background in growing.items():
        bodies[rank] = replace(bodies[rank], is_growing=not background.is_complete)
    return replace(built, bodies=tuple(bodies))


def mesh_of_body(scene: SceneTables, rank: int = 0) -> TetMesh:
    """Mesh of a body of a scene, read or made from its surface; Error for a file that cannot be read or filled."""
    return _Builder(scene, rank).mesh()


def unsolved_body(scene: SceneTables, rank: int = 0, mesh: TetMesh | None = None) -> Body:
    """Mesh of a body of a scene with its materials, supports and loads, before anything is computed of it.

    ``mesh`` is that of :func:`mesh_of_body`, where it is known. Raises Error for a mesh that cannot be read or made, a
    region or supports that hold nothing.
    """
    return _Builder(scene, rank).body(mesh)


@contextlib.contextmanager
def locating_errors(
    scene: SceneTables, place: Sequence[str | int], kind: type[Error] | None = SceneError
) -> Iterator[None]:
    """Name the line of a table, or of an entry of an array of tables, in an error that it leads to.

    The error becomes one of a ``kind``; None leaves it what it is.
    """
    try:
        yield
    except Error as error:
        table = next(key for key in reversed(place) if isinstance(key, str))
        text = str(error)
        # What was asked for may have the name of its table.
        text = text if text.startswith(f"{table}: ") else f"{table}: {text}"
        message = f"{located(*scene.source, place)}: {text}"
        if isinstance(error, UnclearUnitError):
            raise UnclearUnitError(message, error.fitting) from None
        raise (kind or type(error))(message) from None


def require_files(scene: SceneTables) -> None:
    """See :meth:`palpate.Scene.require_files`."""
    sides = [_Builder(scene, rank).require_files() for rank in range(len(scene.bodies))]
    require_tool_sizes(scene, max(sides, default=math.inf))
    for rank, tool in enumerate(scene.tools):
        with locating_errors(scene, ["tool", rank, "shape"]):
            tool.shape_arguments(scene.folder)


@dataclass
class _Builder:
    """Builds one body of a scene."""

    scene: SceneTables
    rank: int
    growing: dict[int, BackgroundPrecompute] | None = None
    filling: Progress = True
    announce: Callable[[Expected], None] | None = None
    dask: str | Client | None = None
    prepared: GreensFunction | Body | None = None  # the store, or the body before it is solved

    @property
    def table(self) -> BodyTable:
        """Table of the body."""
        return self.scene.bodies[self.rank]

    def prepare(self) -> float:
        """Read or make the body, before anything is solved; returns its longest side, m."""
        if self.table.store is None:
            self.prepared = body = self.body()
            return float(np.ptp(body.mesh.nodes, axis=0).max())
        with self._locating_errors_in_file(["body", self.rank, "store"]):
            self.prepared = green = GreensFunction.load(self.scene.folder / self.table.store)
        return float(green.extents.max())

    def build(self, progress: Progress, modes_progress: Progress | None) -> BuiltBody:
        """Solve the body that was prepared."""
        table, body = self.table, self.prepared
        place = (table.title, table.position, table.orientation)
        if isinstance(body, GreensFunction):
            return BuiltBody(None, body, None, *place)
        assert body is not None
        green = self._green(body, progress)
        dynamics, where = self._table_of_body("dynamics")
        if dynamics is None:
            return BuiltBody(body, green, None, *place)
        with self._locating_errors(where):
            report = progress if modes_progress is None else modes_progress
            motion = dynamics.build(body, self.scene.device.max_stiffness, report)
        return BuiltBody(body, green, motion, *place)

    def _green(self, body: Body, progress: Progress) -> GreensFunction:
        area, where = self._table_of_body("touch")
        with self._locating_errors(where):
            asked = {"precision": self.table.precision, **area.areas(self._file_mesh)}
            if self.announce is not None:
                moves = self._table_of_body("dynamics")[0] is not None
                radii = () if moves else pressing_radii(self.scene, body)
                self.announce(Expected.of(body, **asked, radii=radii))
            if self.dask is not None:
                # A cluster computes all at once.
                return precompute(body, **{**asked, "first": None}, progress=progress, dask=self.dask)
            if self.growing is None or area.first is None:
                return precompute(body, **asked, progress=progress)
            background = self.growing[self.rank] = BackgroundPrecompute(body, **asked)
            with progress_reporter("precomputing what is touched first", progress) as report:
                return background.wait(report)

    def _require_materials(self) -> None:
        """Look at the materials of parts, before a surface is filled for them."""
        base: MaterialTable = self._table_of_body("material")[0]
        regions, where = self._table_of_body("region")
        tables = [([*where, rank], region) for rank, region in enumerate(regions)]
        segments = enumerate(self.table.segment)
        tables += [(["body", self.rank, "segment", rank], segment) for rank, segment in segments]
        for place, table in tables:
            with self._locating_errors(place):
                table.material(base)

    def require_files(self) -> float:
        """Look at what building would read; a surface that is yet to be filled only by itself.

        Returns the longest side of the body, m; that of a segmentation is infinite: it is not known yet.
        """
        self._require_materials()
        table = self.table
        if not table.fills_a_surface:
            return self.prepare()
        with self._locating_errors_in_file(["body", self.rank, "mesh"]):
            if is_segmentation(str(table.mesh)):
                wanted = [segment.name for segment in table.segment]
                label_summary(self.scene.folder / str(table.mesh), table.unit, wanted)
                return math.inf
            read = closed_surface if table.mesher == "netgen" else read_surface
            surface = read(self.scene.folder / str(table.mesh))
            vertices = surface.vertices * scale_of(str(table.mesh), surface.vertices, table.unit)
        supports, where = self._table_of_body("supports")
        with self._locating_errors_in_file(where):
            _predicate_mask(supports.fixed, vertices)
        return float(np.ptp(vertices, axis=0).max())

    def _table_of_body(self, key: str) -> tuple[Any, list[str | int]]:
        """Table of the body, or that of the whole scene; and its place in the file."""
        own = getattr(self.table, key)
        if own is not None:
            return own, ["body", self.rank, key]
        return getattr(self.scene, key), [key]

    def body(self, mesh: TetMesh | None = None) -> Body:
        table, mesh = self.table, self.mesh() if mesh is None else mesh
        if table.element == "linear" and mesh.is_quadratic:
            source = table.mesh or table.title
            with self._locating_errors_in_file(["body", self.rank, "element"]):
                raise SceneError(f"{source} holds 10-node tetrahedra: leave out body.element, or give 'quadratic'")
        if table.adds_middles:
            mesh = mesh.to_quadratic()
        # With the regions of the file, which those of the scene replace.
        self._file_mesh = mesh
        base: MaterialTable = self._table_of_body("material")[0]
        regions, where = self._table_of_body("region")
        labels, of_file = _file_regions(mesh, len(regions))
        names: dict[str, int] = {}
        materials = {label: base.material() for label in np.unique(labels).tolist()}
        for title, material in table.segment_materials(mesh, base).items():
            # A mesh of one region has the label 0 alone.
            materials[of_file.get(title, 0)] = material
        for rank, region in enumerate(regions):
            with self._locating_errors([*where, rank]):
                labels[region.elements(mesh)] = rank + 1
                materials[rank + 1] = region.material(base)
                names[_unused(region.title, names)] = rank + 1
        # What tables have claimed as a whole is left out.
        for name, label in of_file.items():
            if label in labels:
                names[_unused(name, names)] = label
        mesh = TetMesh(mesh.nodes, mesh.tets, labels, names)
        loads, where = self._table_of_body("loads")
        with self._locating_errors_in_file(self._table_of_body("supports")[1]):
            fixed = self._fixed(mesh)
        with self._locating_errors_in_file(["body", self.rank]):
            body = Body(mesh, material=materials, fixed=fixed, loads=together(loads))
        for rank, load in enumerate(loads):
            with self._locating_errors([*where, rank]):
                load.check(body)
        return body

    def _locating_errors(self, place: Sequence[str | int]) -> contextlib.AbstractContextManager[None]:
        return locating_errors(self.scene, place)

    def _locating_errors_in_file(self, place: Sequence[str | int]) -> contextlib.AbstractContextManager[None]:
        """Do the same where the scene is a file: what a program has given needs no line."""
        return locating_errors(self.scene, place, None) if self.scene.source[1] else contextlib.nullcontext()

    def mesh(self) -> TetMesh:
        self._require_materials()
        with self._locating_errors_in_file(["body", self.rank, "model" if self.table.model is not None else "mesh"]):
            return self._read_mesh()

    def _read_mesh(self) -> TetMesh:
        table = self.table
        if table.model is not None:
            return models.load(table.model, paper=table.paper)
        source = self.scene.folder / str(table.mesh)
        if table.fills_a_surface:
            finer = [(ball.center, ball.radius, ball.size) for ball in table.refine]
            element, options = table.element or "quadratic", table.fill_options
            size, unit = table.max_element_size, table.unit
            return tetrahedralize_with(element, source, size, unit, finer, options, progress=self.filling)
        return TetMesh.read(source, table.unit)

    def _fixed(self, mesh: TetMesh) -> Any:
        supports: SupportsTable = self._table_of_body("supports")[0]
        fixed = supports.fixed
        if is_node_file(fixed):
            fixed = read_nodes(self.scene.folder / str(fixed))
        if fixed is None and self.table.model is not None:
            return models.fixed(self.table.model, mesh)
        if fixed is None:
            raise SceneError(f"supports.fixed is missing: '{self.table.title}' needs nodes that are held")
        if isinstance(fixed, str):
            return _predicate_mask(fixed, mesh.nodes)
        if self.table.adds_middles and max(fixed, default=0) < len(mesh.nodes):
            mask = np.zeros(len(mesh.nodes), dtype=bool)
            mask[fixed] = True
            between = mask[mesh.tets[:, EDGES]].all(axis=2)
            mask[mesh.tets[:, 4:][between]] = True
            return mask
        return fixed


def _predicate_mask(fixed: Any, nodes: np.ndarray) -> np.ndarray | None:
    """Nodes that a predicate holds, of which there must be some; None for what is no predicate."""
    if not isinstance(fixed, str) or is_node_file(fixed):
        return None
    mask = parse(fixed)(nodes)
    if not np.any(mask):
        low, high = (bound.round(4).tolist() for bound in (nodes.min(axis=0), nodes.max(axis=0)))
        raise SceneError(f"no node satisfies supports.fixed = '{fixed}': the body reaches from {low} to {high} m")
    return mask


def _file_regions(mesh: TetMesh, tables: int) -> tuple[np.ndarray, dict[str, int]]:
    """Labels (m,) of a file's regions, and their names, beside those from 1 on for the tables of a scene.

    The first region has the label 0, and no name where it is the only one.
    """
    numbers, ranks = np.unique(mesh.regions, return_inverse=True)
    labels = np.where(ranks == 0, 0, tables + ranks).ravel().astype(np.int64)
    if len(numbers) == 1:
        return labels, {}
    named = {number: name for name, number in mesh.region_names.items()}
    labels_of = [0, *range(tables + 1, tables + len(numbers))]
    titles = [named.get(number, f"region {number}") for number in numbers.tolist()]
    return labels, dict(zip(titles, labels_of, strict=True))


def _unused(name: str, names: Mapping[str, int]) -> str:
    """Return a name that is not among those given, with a number behind it where it must."""
    candidates = (name if count == 1 else f"{name} {count}" for count in itertools.count(1))
    return next(candidate for candidate in candidates if candidate not in names)


def press_place(built: BuiltScene) -> tuple[np.ndarray, float]:
    """Where the first tool's origin rests when it just touches from above, m, and how deep it presses, m.

    Raises SceneError for a body whose whole surface is fixed.
    """
    body = built.bodies[0]
    green, nodes = body.green, body.points_to_scene(body.green.surface_positions)
    free = np.flatnonzero(~np.isin(green.surface_nodes, green.fixed_nodes))
    if len(free) == 0:
        raise SceneError("the whole surface is fixed: nothing can be pressed")
    size = float(np.ptp(nodes, axis=0).max())
    highest = free[nodes[free, 2] > nodes[free, 2].max() - 0.01 * size]
    middle = nodes[:, :2].mean(axis=0)
    top = nodes[highest[np.argmin(np.linalg.norm(nodes[highest, :2] - middle, axis=1))]]
    return top + [0, 0, built.scene.tools[0].reach], DEPTH * size
