"""The page of all keys of a scene file, from the pydantic tables: type, default, meaning."""

from __future__ import annotations

import ast
import inspect
import textwrap
import typing
from collections.abc import Iterator
from itertools import pairwise
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from tables import code, table

from palpate.exam import file as exam
from palpate.scene import devices, dynamics, loads, regions, tables
from palpate.scene import table as types
from palpate.study import cases as study

HEAD = """# Keys of a scene file

Every table and every key of a scene file, and those that only an exam file or a study file has.
[The scene file](../scene.md) shows how they are used. A quantity is a number in SI units, or a text with a unit such
as `"4mm"`, `"10kPa"` or `"250ms"`. This page is generated from the program.
"""

# Each table as it is written in a file, and the class that checks it.
TABLES = (
    ("[[body]]", tables.BodyTable),
    ("[[body.refine]]", tables.RefineTable),
    ("[[body.segment]]", regions.SegmentTable),
    ("[material]", regions.MaterialTable),
    ("[[region]]", regions.RegionTable),
    ("[supports]", tables.SupportsTable),
    ("[touch]", regions.TouchTable),
    ("[[loads]]", loads.LoadTable),
    ("[[tool]]", tables.ToolTable),
    ("[[device]]", devices.DeviceTable),
    ("[dynamics]", dynamics.DynamicsTable),
    ("[dynamics.strike]", dynamics.StrikeTable),
    ("[view]", tables.ViewTable),
)
FURTHER = (
    ("Exam files", "[nodule]", exam.NoduleTable),
    ("Exam files", "[nodule.contrast]", exam.ContrastTable),
    ("Exam files", "[exam]", exam.QuestionTable),
    ("Exam files", "[exam.random]", exam.RandomTable),
    ("Study files", "[[press]]", study.PressTable),
)

QUANTITIES = (
    (types.Length, "length"),
    (types.Radius, "length, 0 allowed"),
    (types.Coordinate, "length"),
    (types.Pressure, "pressure"),
    (types.SignedPressure, "pressure"),
    (types.Density, "density"),
    (types.Force, "force"),
    (types.SignedForce, "force"),
    (types.Stiffness, "stiffness"),
    (types.Time, "time"),
    (types.Share, "share"),
    (types.Point, "three lengths"),
    (types.Direction, "three numbers"),
    (types.Acceleration, "three accelerations"),
    (types.ForceVector, "three forces"),
    (tables.Orientation, "four numbers"),
)
WORDS = {
    str: "text",
    int: "whole number",
    float: "number",
    bool: "true or false",
    Any: "any",
    regions.PlaceTable: "shape",
}


def page() -> str:
    """Write the page; a key without a description is an error."""
    named = {cls: name for name, cls in TABLES} | {cls: name for _, name, cls in FURTHER}
    parts = [HEAD, *(section("##", name, cls, named) for name, cls in TABLES)]
    chapters: list[str] = []
    for chapter, name, cls in FURTHER:
        if chapter not in chapters:
            chapters.append(chapter)
            parts.append(f"## {chapter}\n")
        parts.append(section("###", name, cls, named))
    return "\n".join(parts)


def section(level: str, name: str, cls: type[types.Table], named: dict[type, str]) -> str:
    """Write the section of one table."""
    title = {"[[": "tables", "[": "table"}["[[" if name.startswith("[[") else "["]
    head = f"{level} `{name}`\n\nOne of several {title}.\n" if title == "tables" else f"{level} `{name}`\n"
    hints = typing.get_type_hints(cls, include_extras=True)
    texts = descriptions(cls)
    rows = []
    for key, field in cls.model_fields.items():
        if key not in texts:
            raise SystemExit(f"docs: the key '{key}' of {name} ({cls.__name__}) has no description under it")
        shown = field.alias or key
        rows.append((code(shown), kind(hints[key], named), default(field), texts[key]))
    return f"{head}\n{table(('key', 'type', 'default', 'meaning'), rows)}"


def descriptions(cls: type[types.Table]) -> dict[str, str]:
    """Texts that stand as strings under the keys, in the class and those that it is derived from."""
    texts: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if issubclass(base, types.Table):
            (definition,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
            assert isinstance(definition, ast.ClassDef)
            texts |= dict(described(definition.body))
    return texts


def described(statements: list[ast.stmt]) -> Iterator[tuple[str, str]]:
    """Names of annotated attributes, each with the string that stands under it."""
    for statement, after in pairwise(statements):
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            text = after.value if isinstance(after, ast.Expr) else None
            if isinstance(text, ast.Constant) and isinstance(text.value, str):
                yield statement.target.id, text.value


def kind(hint: Any, named: dict[type, str]) -> str:
    """Say in words what a key takes."""
    for known, word in QUANTITIES:
        if hint == known:
            return word
    if hint in WORDS:
        return WORDS[hint]
    if hint in named:
        return f"table {code(named[hint])}"
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Literal:
        return " or ".join(code(f'"{value}"') if isinstance(value, str) else code(str(value)) for value in inner)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(kind(part, named) for part in inner if part is not NoneType))
    if origin is list:
        word = kind(inner[0], named)
        return f"list of: {word}"
    if origin is tuple:
        parts = [kind(part, named) for part in inner if part is not Ellipsis]
        return f"{len(parts)} of: {parts[0]}" if len(inner) > 1 and Ellipsis not in inner else f"list of: {parts[0]}"
    if origin is typing.Annotated:
        return kind(inner[0], named)
    return kind_of_annotated(hint, named)


def kind_of_annotated(hint: Any, named: dict[type, str]) -> str:
    """Say what an annotated type takes, without its checks."""
    if hasattr(hint, "__metadata__"):
        return kind(hint.__origin__, named)
    raise SystemExit(f"docs: a key of type {hint} has no word in scene_pages.py")


def default(field: FieldInfo) -> str:
    """Value that is taken where the key is left out."""
    if field.is_required():
        return "required"
    value = field.default
    if value is PydanticUndefined or value is None or isinstance(value, types.Table) or value in ((), []):
        return ""
    if isinstance(value, tuple):
        return code(f"[{', '.join(f'{part:g}' for part in value)}]")
    if isinstance(value, bool):
        return code(str(value).lower())
    return code(f'"{value}"' if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else str(value))


def all_keys() -> Iterator[tuple[str, str]]:
    """All tables with their keys, for the test that compares the page with the program."""
    for name, cls in [*TABLES, *((name, cls) for _, name, cls in FURTHER)]:
        for key, field in cls.model_fields.items():
            yield name, field.alias or key
