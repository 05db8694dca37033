"""Cases of a study: every combination of the values in ``[grid]``, for each ``[[case]]``."""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationError, field_validator, model_validator

from palpate.errors import SceneError
from palpate.scene import Scene
from palpate.scene.mistakes import explain, located
from palpate.scene.table import Coordinate, Point, Radius, Table

# What a study may vary.
VARIED = ("body", "material", "region", "supports", "loads", "press")
# A study of more bodies is probably a slip in a grid.
MOST_CASES = 10_000

Key = tuple[str, ...]
Place = tuple[str | int, ...]
# A component in the file that the press leaves free.
FREE = "-"
Component = Annotated[Coordinate | None, BeforeValidator(lambda value: None if value == FREE else value)]


@dataclass(frozen=True)
class Case:
    """One body of a study."""

    number: int  # from 1, in the order of the file
    name: str  # as the file says, or empty
    keys: tuple[Key, ...]  # what it varies
    scene: StudyScene

    def value(self, key: Key) -> Any:
        """Value of a varied key, in SI units, as its table holds it."""
        place: Any = self.scene
        for step in key:
            if isinstance(place, list) and not _is_rank(step):
                place = place[0]
            if isinstance(place, list):
                place = place[int(step)]
                continue
            names = {field.alias or name: name for name, field in type(place).model_fields.items()}
            place = getattr(place, names[step])
        return place


def cases_of(path: Path, text: str, tables: Mapping[str, Any]) -> list[Case]:
    """Bodies of a study file; SceneError for a mistake in it, with its line."""
    base = {name: value for name, value in tables.items() if name not in ("grid", "case")}
    grid, listed = tables.get("grid", {}), tables.get("case", [{}])
    if not isinstance(grid, Mapping) or not isinstance(listed, list):
        raise SceneError(f"{path}: a study has one table [grid], and entries [[case]]")
    axes = list(_leaves(grid))
    for key, values in axes:
        if not isinstance(values, list) or not values:
            at = located(path, text, ["grid", *key])
            raise SceneError(f"{at}: grid.{'.'.join(key)}: give a list of values, such as [1, 2]")
    count = math.prod(len(values) for _, values in axes) * len(listed)
    if count > MOST_CASES:
        raise SceneError(f"{path}: the grid makes {count} bodies; a study takes at most {MOST_CASES}")
    cases = []
    for rank, entry in enumerate(listed):
        own = {key: (value, ("case", rank, *key)) for key, value in _leaves(entry) if key != ("name",)}
        for values in itertools.product(*(values for _, values in axes)):
            of_grid = {key: (value, ("grid", *key)) for (key, _), value in zip(axes, values, strict=True)}
            given: dict[Key, tuple[Any, Place]] = {**of_grid, **own}
            scene = _scene(path, text, base, given)
            cases.append(Case(len(cases) + 1, str(entry.get("name", "")), tuple(given), scene))
    return cases


def _leaves(tables: Mapping[str, Any], above: Key = ()) -> Iterator[tuple[Key, Any]]:
    """Keys of nested tables with what is not a table."""
    for name, value in tables.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, (*above, name))
        else:
            yield (*above, name), value


def _scene(path: Path, text: str, base: Mapping[str, Any], given: Mapping[Key, tuple[Any, Place]]) -> StudyScene:
    """Scene of the file in which the values given stand instead of its own."""
    tables = copy.deepcopy(dict(base))
    for key, (value, place) in given.items():
        try:
            _put(tables, key, value)
        except ValueError as error:
            raise SceneError(f"{located(path, text, place)}: {'.'.join(key)}: {error}") from None
    try:
        scene = StudyScene(**tables)
    except SceneError as error:
        if not isinstance(error.__cause__, ValidationError):
            raise
        raise SceneError(_error_text(path, text, error.__cause__, given)) from None
    scene.replace_source(path, text)
    _check(scene, path, text)
    return scene


def _put(tables: dict[str, Any], key: Key, value: Any) -> None:
    """Let a value stand at a key."""
    if key[0] not in VARIED:
        raise ValueError(f"a study varies {', '.join(VARIED)}")
    table: Any = tables
    for step in key[:-1]:
        if isinstance(table, list):
            table = table[_entry(table, step, key)]
            if _is_rank(step):
                continue
        table = table.setdefault(step, {}) if isinstance(table, dict) else None
    if isinstance(table, list):
        table = table[_entry(table, key[-1], key)]
    if not isinstance(table, dict):
        raise ValueError("there is no such table in this file")
    table[key[-1]] = value


def _entry(tables: Sequence[Any], step: str, key: Key) -> int:
    """Rank of the table that a key means among several of a kind."""
    if not _is_rank(step):
        if len(tables) == 1:
            return 0
        raise ValueError(f"there are {len(tables)} tables [[{key[0]}]]: write {key[0]}.0 for the first, and so on")
    if int(step) >= len(tables):
        raise ValueError(f"the last of the tables [[{key[0]}]] is {key[0]}.{len(tables) - 1}")
    return int(step)


def _error_text(path: Path, text: str, error: ValidationError, given: Mapping[Key, tuple[Any, Place]]) -> str:
    """Say a mistake where it stands: in the grid or in a case, if it is a value from there."""
    explained = explain(path, text, error, StudyTables)
    found = _names(error.errors()[0]["loc"])
    for key, (_, place) in given.items():
        if _names(key) == found[: len(_names(key))]:
            return f"{located(path, text, place)}: {explained.split(': ', 1)[1]}"
    return explained


def _names(place: Sequence[str | int]) -> list[str]:
    return [str(step) for step in place if not _is_rank(str(step))]


def _check(scene: StudyScene, path: Path, text: str) -> None:
    """Refuse what a study cannot ask."""
    body = scene.bodies[0]
    touches = "touch" in scene.model_fields_set or body.touch is not None
    for holds, place, message in (
        (len(scene.bodies) == 1, ["body", 1], "body: a study has one body, which it varies"),
        (body.store is None, ["body", 0, "store"], "body.store: a store cannot be varied; give its mesh or model"),
        (not touches, ["touch"], "touch: the bodies of a study are touched where [[press]] says"),
        ((body.dynamics or scene.dynamics) is None, ["dynamics"], "dynamics: the bodies of a study are at rest"),
    ):
        if not holds:
            raise SceneError(f"{located(path, text, place)}: {message}")


def _is_rank(step: str) -> bool:
    """Whether a step of a place is the number of an entry."""
    return step.isascii() and step.isdigit()


class PressTable(Table):
    """A press: the surface closest to ``point`` (m, in the frame of the body) is moved by ``displacement`` (m).

    A component of ``"-"`` is left free. ``radius`` (m) is that of the patch, 0 a point; by default a sixteenth of the
    body's longest side.
    """

    name: str | None = None
    """Name in the table of results."""
    point: Point
    """Point near the pressed place of the surface."""
    displacement: tuple[Component, Component, Component]
    """Displacement of the patch; `"-"` leaves a component free."""
    radius: Radius | None = None
    """Radius of the patch; 0 is a point. Default: a sixteenth of the longest side of the body."""

    @model_validator(mode="after")
    def _presses(self) -> PressTable:
        if not any(self.displacement):
            raise ValueError("a press needs a displacement: give a component other than 0 and '-'")
        return self


class StudyScene(Scene):
    """One body of a study, with what is asked of it."""

    presses: list[PressTable] = Field(alias="press", min_length=1)

    @field_validator("presses", mode="before")
    @classmethod
    def _single_press(cls, tables: Any) -> Any:
        """Take a single table as the only entry."""
        return tables if isinstance(tables, list) else [tables]


class StudyTables(StudyScene):
    """Everything that may stand in the file."""

    grid: dict[str, Any] = Field(default_factory=dict)
    cases: list[dict[str, Any]] = Field(default_factory=list, alias="case")
