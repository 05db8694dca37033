"""The scene file: TOML, checked key by key; quantities take units."""

from __future__ import annotations

import contextlib
import difflib
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
from pydantic import BaseModel, Field, PrivateAttr, ValidationError, model_validator

from palpate import models
from palpate.body import Body, parse
from palpate.errors import Error, SceneError
from palpate.fields import HONEST_STRAIN
from palpate.green import GreensFunction, precompute
from palpate.mesh import TetMesh
from palpate.mesh.elements import EDGES
from palpate.mesh.tetrahedralize import SURFACE_ENDINGS, Element, tetrahedralize_with
from palpate.scene.dynamics import BodyMotion, DynamicsTable
from palpate.scene.loads import LoadTable, together
from palpate.scene.regions import MaterialTable, RegionTable
from palpate.scene.table import Force, Length, Point, Radius, Stiffness, Table, Time

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


# What pydantic adds to the place of a mistake in a value that may be of several kinds.
UNION_MEMBERS = {"str", "int", "list[int]"}
# Keys of former versions, and what they are called now.
RENAMED = {"view.hold_strain": "strain_limit"}


class RefineTable(Table):
    """A ball of finer elements in a mesh made from a surface."""

    center: Point
    radius: Length
    size: Length


class BodyTable(Table):
    """The solid, one of: a mesh file (volume, or surface to be filled), a built-in model, a precomputed store.

    Paths are relative to the scene file. ``paper`` takes the model in the size of the paper. A surface is
    filled with 10-node tetrahedra unless ``element = "linear"``; volume meshes and models are taken as they are, unless
    ``element = "quadratic"`` gives 4-node tetrahedra the middles of their edges as nodes. Supports listed by node then
    fix the middles between them.
    """

    mesh: str | None = None
    model: str | None = None
    store: str | None = None
    paper: bool = False
    unit: str = "m"
    max_element_size: Length | None = None
    element: Element | None = None
    refine: list[RefineTable] = Field(default_factory=list)
    precision: str = Field("f32", pattern="^f(16|32|64)$")

    @model_validator(mode="after")
    def _one_source(self) -> BodyTable:
        if sum(source is not None for source in (self.mesh, self.model, self.store)) != 1:
            raise ValueError("give exactly one of mesh, model and store")
        if self.model is not None and self.model not in models.NAMES:
            raise ValueError(f"unknown model '{self.model}'; there are {', '.join(models.NAMES)}")
        return self

    @property
    def fills_a_surface(self) -> bool:
        """Whether the mesh is yet to be made."""
        return Path(self.mesh or "").suffix.lower() in SURFACE_ENDINGS

    @property
    def adds_middles(self) -> bool:
        """Whether 4-node tetrahedra become 10-node ones."""
        return self.element == "quadratic" or (self.element is None and self.fills_a_surface)


class SupportsTable(Table):
    """Where the body is fixed: a predicate over x, y, z, or node indices; a model has its own."""

    fixed: str | list[int] | None = None


class ToolTable(Table):
    """A spherical tool: its radius, and the radius of the patch it presses."""

    radius: Length = 5e-3
    contact_radius: Radius = 5e-3


class DeviceTable(Table):
    """Limits of the device, kept by the safety stage."""

    max_force: Force = 8.0
    max_slew: Annotated[float, Field(gt=0)] = 500.0
    ramp: Time = 0.25
    max_stiffness: Stiffness = 5000.0


class ViewTable(Table):
    """Where the camera stands and what it looks at, m (by default the whole body), and the strain that limits the tool.

    Linear elasticity balloons beyond about 10 % strain; ``strain_limit = 0`` takes the limit away.
    """

    position: tuple[float, float, float] | None = None
    target: tuple[float, float, float] | None = None
    strain_limit: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = HONEST_STRAIN


class Scene(Table):
    """What to touch, and with what."""

    body: BodyTable
    supports: SupportsTable = SupportsTable()
    material: MaterialTable = MaterialTable()
    region: list[RegionTable] = Field(default_factory=list)
    loads: list[LoadTable] = Field(default_factory=list)
    tool: ToolTable = ToolTable()
    device: DeviceTable = DeviceTable()
    dynamics: DynamicsTable | None = None
    view: ViewTable = ViewTable()

    _folder: Path = PrivateAttr(default_factory=Path)
    _source: tuple[Path, str] | None = PrivateAttr(None)

    def __repr__(self) -> str:
        body = self.body
        source = f"model {body.model}" if body.model else str(body.mesh or body.store)
        moves = "" if self.dynamics is None else ", in motion"
        return f"Scene({source}{moves}, tool of radius {1e3 * self.tool.radius:.4g} mm)"

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Scene:
        """Read a scene file.

        Raises
        ------
        SceneError
            Missing, not TOML, or a wrong key or value, with its line.

        """
        path = Path(path)
        if not path.is_file():
            raise SceneError(f"{path}: no such file")
        text = path.read_text(errors="replace")
        try:
            scene = cls(**tomllib.loads(text))
        except tomllib.TOMLDecodeError as error:
            raise SceneError(f"{path}: {error}") from None
        except ValidationError as error:
            raise SceneError(_explain(path, text, error)) from None
        if scene.body.mesh is not None and scene.supports.fixed is None:
            line = _line_of(text, ["supports"])
            raise SceneError(f"{path}{f':{line}' if line else ''}: the key 'supports.fixed' is missing")
        own = {"material", "region", "loads", "dynamics"} & scene.model_fields_set
        if scene.body.store is not None and (scene.supports.fixed is not None or own):
            raise SceneError(
                f"{path}: a store carries its own material, supports and loads, and cannot move: leave those tables out"
            )
        scene._folder, scene._source = path.parent, (path, text)
        return scene

    @classmethod
    def of_store(cls, path: str | os.PathLike[str]) -> Scene:
        """Scene of a precomputed store, with the default tool and device."""
        return cls(body=BodyTable(store=os.fspath(path)))

    @property
    def name(self) -> str:
        """What the body is called: the model, or the file without its ending."""
        body = self.body
        return body.model or Path(body.mesh or body.store or "").stem

    def build(
        self,
        progress: bool | Callable[[int, int], None] = True,
        modes_progress: bool | Callable[[int, int], None] | None = None,
    ) -> BuiltScene:
        """Mesh if need be, precompute, and find the modes of a body that moves, or take it all from the cache.

        ``progress`` is shown, or told of done and expected; of modes ``modes_progress`` is, unless it is None.

        Raises
        ------
        Error
            A mesh that cannot be read or made, supports that leave it free to move, a store that does not match.

        """
        if self.body.store is not None:
            return BuiltScene(self, None, GreensFunction.load(self._folder / self.body.store))
        mesh = self._mesh()
        if self.body.element == "linear" and mesh.is_quadratic:
            raise SceneError(
                f"{self.body.mesh or self.name} holds 10-node tetrahedra: leave out body.element, or say 'quadratic'"
            )
        if self.body.adds_middles:
            mesh = mesh.to_quadratic()
        labels, materials = np.zeros(len(mesh.tets), dtype=np.int64), {0: self.material.material()}
        for rank, region in enumerate(self.region):
            with self._blaming("region", rank):
                labels[region.elements(mesh)] = rank + 1
                materials[rank + 1] = region.material(self.material)
        mesh = TetMesh(mesh.nodes, mesh.tets, labels)
        body = Body(mesh, material=materials, fixed=self._fixed(mesh), loads=together(self.loads))
        for rank, load in enumerate(self.loads):
            with self._blaming("loads", rank):
                load.check(body)
        green = precompute(body, precision=self.body.precision, progress=progress)
        if self.dynamics is None:
            return BuiltScene(self, body, green)
        with self._blaming("dynamics", 0):
            report = progress if modes_progress is None else modes_progress
            return BuiltScene(self, body, green, self.dynamics.build(body, self.device.max_stiffness, report))

    @contextlib.contextmanager
    def _blaming(self, table: str, rank: int) -> Iterator[None]:
        """Name the line of a table, or of an entry of an array of tables, in an error of the body."""
        try:
            yield
        except Error as error:
            path, text = self._source or (Path(self.name), "")
            line = _line_of(text, [table, rank])
            raise SceneError(f"{path}{f':{line}' if line else ''}: {table}: {error}") from None

    def _mesh(self) -> TetMesh:
        if self.body.model is not None:
            return models.load(self.body.model, paper=self.body.paper)
        source = self._folder / str(self.body.mesh)
        if self.body.fills_a_surface:
            finer = [(ball.center, ball.radius, ball.size) for ball in self.body.refine]
            element = self.body.element or "quadratic"
            return tetrahedralize_with(element, source, self.body.max_element_size, self.body.unit, finer)
        return TetMesh.read(source, self.body.unit)

    def _fixed(self, mesh: TetMesh) -> Any:
        fixed = self.supports.fixed
        if fixed is None and self.body.model is not None:
            return models.fixed(self.body.model, mesh)
        if isinstance(fixed, str):
            mask = parse(fixed)(mesh.nodes)
            if not np.any(mask):
                low, high = mesh.bounds.round(4).tolist()
                raise SceneError(
                    f"no node satisfies supports.fixed = '{fixed}': the body reaches from {low} to {high} m"
                )
            return mask
        if self.body.adds_middles and max(fixed, default=0) < len(mesh.nodes):
            mask = np.zeros(len(mesh.nodes), dtype=bool)
            mask[fixed] = True
            between = mask[mesh.tets[:, EDGES]].all(axis=2)
            mask[mesh.tets[:, 4:][between]] = True
            return mask
        return fixed


@dataclass(frozen=True)
class BuiltScene:
    """A scene with its Green's function, its body where it was not taken from a store, and its motion if it moves."""

    scene: Scene
    body: Body | None
    green: GreensFunction
    motion: BodyMotion | None = None


def _explain(path: Path, text: str, error: ValidationError) -> str:
    """First mistake of the file, with its line and the nearest known key."""
    first = error.errors()[0]
    place = [k for k in first["loc"] if isinstance(k, int) or k not in UNION_MEMBERS]
    keys = [k for k in place if isinstance(k, str)]
    where = ".".join(keys)
    line = _line_of(text, place)
    at = f"{path}:{line}" if line else str(path)
    if first["type"] == "extra_forbidden":
        known = _known_keys(keys[:-1])
        near = [RENAMED[where]] if where in RENAMED else difflib.get_close_matches(keys[-1], known, 1)
        hint = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(known)}"
        return f"{at}: unknown key '{where}'; {hint}"
    if first["type"] == "missing" and isinstance(place[-1], int):
        return f"{at}: {where} has too few entries"
    if first["type"] == "missing":
        return f"{at}: the key '{where}' is missing"
    message = first["msg"].removeprefix("Value error, ")
    return f"{at}: {where}: {message}" + ("" if first["type"] == "value_error" else f", got {first['input']!r}")


def _known_keys(parents: list[str]) -> list[str]:
    model: type[BaseModel] = Scene
    for key in parents:
        annotation = model.model_fields[key].annotation
        # An array of tables is a list of its entries' model.
        annotation = next(iter(get_args(annotation)), annotation)
        assert isinstance(annotation, type)
        model = annotation
    return list(model.model_fields)


def _line_of(text: str, place: Sequence[str | int]) -> int | None:
    """Line of ``[table]`` or the entry of ``[[table]]``, followed by ``key =``; the deepest of them that is there."""
    keys = [k for k in place if isinstance(k, str)]
    entry = place[1] if len(place) > 1 and isinstance(place[1], int) else 0
    table, seen, found = "", -1, None
    for number, line in enumerate(text.splitlines(), 1):
        head = re.match(r"\s*\[\[?\s*([\w.-]+)\s*\]", line)
        if head:
            table = head[1]
            seen += table == keys[0]
            found = number if table == keys[0] and seen == entry else found
            continue
        pair = re.match(r"\s*([\w.-]+)\s*=", line)
        if pair and f"{table}.{pair[1]}".strip(".") == ".".join(keys) and (seen == entry or not table):
            return number
    return found
