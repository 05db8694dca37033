"""The scene file: TOML, checked key by key; quantities take units."""

from __future__ import annotations

import difflib
import os
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PrivateAttr, ValidationError, model_validator

from palpate import models, units
from palpate.body import Body, Material
from palpate.errors import Error, SceneError
from palpate.green import GreensFunction, precompute
from palpate.mesh import TetMesh, tetrahedralize
from palpate.mesh.elements import EDGES
from palpate.mesh.tetrahedralize import SURFACE_ENDINGS
from palpate.predicate import parse

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def _quantity(read: Callable[[Any], float]) -> BeforeValidator:
    def convert(value: Any) -> float:
        try:
            return read(value)
        except Error as error:
            raise ValueError(str(error)) from None

    return BeforeValidator(convert)


Length = Annotated[float, _quantity(units.length), Field(gt=0, allow_inf_nan=False)]
Radius = Annotated[float, _quantity(units.length), Field(ge=0, allow_inf_nan=False)]
Pressure = Annotated[float, _quantity(units.pressure), Field(gt=0, allow_inf_nan=False)]
Density = Annotated[float, _quantity(units.density), Field(ge=0, allow_inf_nan=False)]
Force = Annotated[float, _quantity(units.force), Field(gt=0, allow_inf_nan=False)]
Stiffness = Annotated[float, _quantity(units.stiffness), Field(gt=0, allow_inf_nan=False)]
Time = Annotated[float, _quantity(units.time), Field(ge=0, allow_inf_nan=False)]


class Table(BaseModel):
    """A table of the file: unknown keys are mistakes."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class BodyTable(Table):
    """The solid, one of: a mesh file (volume, or surface to be filled), a built-in model, a precomputed store.

    Paths are relative to the scene file. ``paper`` takes the model in the size of the paper. ``element = "quadratic"``
    gives 4-node tetrahedra the middles of their edges as nodes; supports listed by node then hold those between them.
    """

    mesh: str | None = None
    model: str | None = None
    store: str | None = None
    paper: bool = False
    unit: str = "m"
    max_element_size: Length | None = None
    element: Literal["linear", "quadratic"] | None = None
    precision: str = Field("f32", pattern="^f(32|64)$")

    @model_validator(mode="after")
    def _one_source(self) -> BodyTable:
        if sum(source is not None for source in (self.mesh, self.model, self.store)) != 1:
            raise ValueError("give exactly one of mesh, model and store")
        if self.model is not None and self.model not in models.NAMES:
            raise ValueError(f"unknown model '{self.model}'; there are {', '.join(models.NAMES)}")
        return self


class MaterialTable(Table):
    """Isotropic material of the whole body."""

    youngs_modulus: Pressure = 10e3
    poissons_ratio: float = Field(0.45, gt=-1, lt=0.5)
    density: Density = 1000.0


class SupportsTable(Table):
    """Where the body is held: a predicate over x, y, z, or node indices; a model has its own."""

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
    """Where the camera stands and what it looks at, m; by default the whole body is seen."""

    position: tuple[float, float, float] | None = None
    target: tuple[float, float, float] | None = None


class Scene(Table):
    """What to touch, and with what."""

    body: BodyTable
    supports: SupportsTable = SupportsTable()
    material: MaterialTable = MaterialTable()
    tool: ToolTable = ToolTable()
    device: DeviceTable = DeviceTable()
    view: ViewTable = ViewTable()

    _folder: Path = PrivateAttr(default_factory=Path)

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
        if scene.body.store is not None and (scene.supports.fixed is not None or "material" in scene.model_fields_set):
            raise SceneError(f"{path}: a store carries its own material and supports: leave those tables out")
        scene._folder = path.parent
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

    def build(self, progress: bool | Callable[[int, int], None] = True) -> BuiltScene:
        """Mesh if need be, and precompute, or take both from the cache.

        Raises
        ------
        Error
            A mesh that cannot be read or made, supports that hold nothing, a store that does not match.

        """
        if self.body.store is not None:
            return BuiltScene(self, None, GreensFunction.load(self._folder / self.body.store))
        mesh = self._mesh()
        if self.body.element == "linear" and mesh.is_quadratic:
            raise SceneError(f"{self.body.mesh} holds 10-node tetrahedra: leave out body.element, or say 'quadratic'")
        if self.body.element == "quadratic":
            mesh = mesh.to_quadratic()
        m = self.material
        body = Body(mesh, material=Material(m.youngs_modulus, m.poissons_ratio, m.density), fixed=self._fixed(mesh))
        return BuiltScene(self, body, precompute(body, precision=self.body.precision, progress=progress))

    def _mesh(self) -> TetMesh:
        if self.body.model is not None:
            return models.load(self.body.model, paper=self.body.paper)
        source = self._folder / str(self.body.mesh)
        if source.suffix.lower() in SURFACE_ENDINGS:
            return tetrahedralize(source, self.body.max_element_size, self.body.unit)
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
        if self.body.element == "quadratic" and max(fixed, default=0) < len(mesh.nodes):
            held = np.zeros(len(mesh.nodes), dtype=bool)
            held[fixed] = True
            between = held[mesh.tets[:, EDGES]].all(axis=2)
            held[mesh.tets[:, 4:][between]] = True
            return held
        return fixed


@dataclass(frozen=True)
class BuiltScene:
    """A scene with its Green's function, and its body where it was not taken from a store."""

    scene: Scene
    body: Body | None
    green: GreensFunction


def _explain(path: Path, text: str, error: ValidationError) -> str:
    """First mistake of the file, with its line and the nearest known key."""
    first = error.errors()[0]
    keys = [str(k) for k in first["loc"] if isinstance(k, str) and k not in {"str", "list[int]"}]
    where = ".".join(keys)
    line = _line_of(text, keys)
    at = f"{path}:{line}" if line else str(path)
    if first["type"] == "extra_forbidden":
        known = _known_keys(keys[:-1])
        near = difflib.get_close_matches(keys[-1], known, 1)
        hint = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(known)}"
        return f"{at}: unknown key '{where}'; {hint}"
    if first["type"] == "missing":
        if isinstance(first["loc"][-1], int):
            return f"{at}: {where}: a value is missing after the first {first['loc'][-1]}"
        return f"{at}: the key '{where}' is missing"
    message = first["msg"].removeprefix("Value error, ")
    return f"{at}: {where}: {message}" + ("" if first["type"] == "value_error" else f", got {first['input']!r}")


def _known_keys(parents: list[str]) -> list[str]:
    model: type[BaseModel] = Scene
    for key in parents:
        annotation = model.model_fields[key].annotation
        assert isinstance(annotation, type)
        model = annotation
    return list(model.model_fields)


def _line_of(text: str, keys: list[str]) -> int | None:
    """Line of ``[table]`` followed by ``key =``, the deepest of them that is there."""
    table, found = "", None
    for number, line in enumerate(text.splitlines(), 1):
        head = re.match(r"\s*\[\s*([\w.-]+)\s*\]", line)
        if head:
            table = head[1]
            found = number if keys[:1] == [table] else found
            continue
        entry = re.match(r"\s*([\w.-]+)\s*=", line)
        if entry and f"{table}.{entry[1]}".strip(".") == ".".join(keys):
            return number
    return found
