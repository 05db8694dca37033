"""A scene file with fitted values: only these change; comments and order stay."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from palpate.atomic import written_beside
from palpate.fitting.unknowns import Slot


def write_fitted(text: str, changes: Sequence[tuple[Slot, dict[str, float]]], path: Path) -> None:
    """Write the text of a scene with other values of its materials, beside and renamed."""
    import tomlkit

    document = tomlkit.parse(text)
    for slot, values in changes:
        table = _table_of(document, slot)
        for name, value in values.items():
            table[name] = round(value, 6) if name == "poissons_ratio" else _pressure(value)
    with written_beside(path) as partial:
        partial.write_text(tomlkit.dumps(document), encoding="utf-8")


def _table_of(document: Any, slot: Slot) -> Any:
    """Table of a slot: that of the body, if it has one, else that of the scene."""
    import tomlkit

    body = document.get("body", {})
    body = body[0] if isinstance(body, list) else body
    if slot.rank is not None:
        return (body if slot.key in body else document)[slot.key][slot.rank]
    if "material" in body:
        return body["material"]
    if "material" not in document:
        document["material"] = tomlkit.table()
    return document["material"]


def _pressure(value: float) -> str:
    return f"{value:.6g}Pa" if abs(value) < 1e3 else f"{1e-3 * value:.6g}kPa"
