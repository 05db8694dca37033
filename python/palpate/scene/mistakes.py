"""Error messages for scene files, with the line and the nearest known key."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from palpate.units import brief_repr, count_text

# What pydantic adds to the place of a mistake in a value that may be of several kinds.
UNION_MEMBERS = {"str", "int", "list[int]", "bool", "[place]", "[text]", "[nodes]"}
# pydantic's words for kinds of values, as people say them.
WORDS = {
    "boolean": "true or false",
    "integer": "a whole number",
    "integer, got a number with a fractional part": "a whole number",
    "list": "a list, such as [1, 2, 3]",
    "number": "a number",
    "string": "text in quotes",
    "tuple": "a list of numbers",
}

Place = Sequence[str | int]
# A key, bare or in quotes, or several with dots between them.
_KEY = r"""(?:[\w-]+|"[^"]*"|'[^']*')"""
KEYS = rf"{_KEY}(?:\s*\.\s*{_KEY})*"


def explain(path: Path, text: str, error: ValidationError, model: type[BaseModel]) -> str:
    """First mistake of the file, with its line and the nearest known key of ``model``'s tables."""
    first = error.errors()[0]
    found = getattr(first.get("ctx", {}).get("error"), "place", first["loc"])
    place = [k for k in found if isinstance(k, int) or k not in UNION_MEMBERS]
    if place[:1] == ["[[device]]"]:
        place = ["device", *([place[1] + 1, *place[2:]] if len(place) > 1 else [])]
    elif (
        place[:1] == ["device"]
        and not any(isinstance(key, int) for key in place)
        and re.search(r"^\s*\[\[\s*device", text, re.MULTILINE)
    ):
        place[1:1] = [0]
    keys = [k for k in place if isinstance(k, str)]
    where = ".".join(keys)
    at = located(path, text, place)
    if first["type"] == "extra_forbidden":
        known = _known_keys(model, keys[:-1])
        near = difflib.get_close_matches(keys[-1], known, 1)
        hint = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(known)}"
        return f"{at}: unknown key '{where}'; {hint}"
    if first["type"] == "missing" and isinstance(place[-1], int):
        given, owner = place[-1], first["loc"][:-1]
        missing = sum(other["type"] == "missing" and other["loc"][:-1] == owner for other in error.errors())
        return f"{at}: {where} has too few entries: it needs {given + missing}, got {given}"
    if first["type"] == "missing":
        return f"{at}: the key '{where}' is missing"
    if first["type"] == "value_error":
        return f"{at}: {where}: {first['msg'].removeprefix('Value error, ')}"
    return f"{at}: {where}: {_expected(first, keys[-1])}, got {_value_text(first['input'])}"


def reason_of(error: ValidationError) -> str:
    """Why pydantic refuses the first value that it does, without its place."""
    return error.errors()[0]["msg"].removeprefix("Value error, ").replace("Input should be", "must be")


def _expected(mistake: Mapping[str, Any], key: str) -> str:
    """Tell what should have been there, from pydantic's kind of mistake."""
    kind, context = mistake["type"], mistake.get("ctx", {})
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"must be a table: write [{key}] on a line of its own, and its keys below it"
    if kind == "too_short":
        return f"needs at least {count_text(context['min_length'], 'entry', 'entries')}"
    if kind == "too_long":
        return f"takes at most {count_text(context['max_length'], 'entry', 'entries')}"
    expectation = mistake["msg"].removeprefix("Input should be ").removeprefix("a valid ").split(", unable")[0]
    return f"must be {WORDS.get(expectation, expectation)}"


def _value_text(value: Any) -> str:
    """Value as it stands in the file; of several entries their count."""
    if isinstance(value, (list, tuple)) and any(isinstance(entry, Mapping) for entry in value):
        return str(len(value))
    return brief_repr(value)


def located(path: Path, text: str, place: Place) -> str:
    """File and line of a place in it; the file's first line for what is missing from it as a whole."""
    if not text:
        return str(path)
    return f"{path}:{line_of(text, place) or _first_line(text)}"


def _first_line(text: str) -> int:
    """First line that says something."""
    numbers = (number for number, line in enumerate(text.splitlines(), 1) if line.split("#")[0].strip())
    return next(numbers, 1)


def line_of(text: str, place: Place) -> int | None:
    """Line of a table, of an entry of an array of tables, or of a key in it; the deepest of them that is there."""
    counts: dict[tuple[str | int, ...], int] = {}
    table: list[str | int] = []
    found, depth = None, 0
    for number, line in enumerate(text.splitlines(), 1):
        head = re.match(rf"\s*(\[\[?)\s*({KEYS})\s*\]", line)
        pair = re.match(rf"\s*({KEYS})\s*=", line)
        if head:
            table = _place_of_head(_parts(head[2]), head[1] == "[[", counts)
            here = table
        elif pair:
            here = [*table, *_parts(pair[1])]
        else:
            continue
        shared = _shared_keys(here, place)
        if shared > depth:
            found, depth = number, shared
    return found


def _parts(keys: str) -> list[str]:
    """Keys between the dots, without quotes and blanks."""
    return [key.strip().strip("'\"") for key in keys.split(".")]


def _place_of_head(parts: Sequence[str], entry: bool, counts: dict[tuple[str | int, ...], int]) -> list[str | int]:
    """Place of a table's head, given how many entries each array of tables has so far."""
    place: list[str | int] = []
    for rank, part in enumerate(parts):
        place.append(part)
        key = tuple(place)
        if entry and rank == len(parts) - 1:
            counts[key] = counts.get(key, -1) + 1
        if key in counts:
            place.append(counts[key])
    return place


def _shared_keys(here: Place, wanted: Place) -> int:
    """How many keys of ``wanted`` are those of ``here``; 0 if ``here`` leads elsewhere.

    A single table stands for the first entry of an array.
    """
    rest, keys = list(wanted), 0
    for step in here:
        if isinstance(step, int):
            entry = rest.pop(0) if rest and isinstance(rest[0], int) else 0
            if entry != step:
                return 0
            continue
        if rest and isinstance(rest[0], int) and rest.pop(0) != 0:
            return 0
        if not rest or rest.pop(0) != step:
            return 0
        keys += 1
    return keys


def _known_keys(model: type[BaseModel], parents: Sequence[str]) -> list[str]:
    """Keys of the table that ``parents`` lead to."""
    for key in parents:
        field = next(field for name, field in model.model_fields.items() if key in (name, field.alias))
        model = next(
            kind for kind in _kinds(field.annotation) if isinstance(kind, type) and issubclass(kind, BaseModel)
        )
    known = [field.alias or name for name, field in model.model_fields.items()]
    return [key for key in known if key.isidentifier()]


def _kinds(annotation: object) -> list[object]:
    """Flatten an annotation: the members of unions, and the entries of lists."""
    members = get_args(annotation)
    return [annotation] if not members else [kind for member in members for kind in _kinds(member)]
