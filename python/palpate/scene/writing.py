"""Tables of a scene as the text of a scene file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any


def scene_text(tables: Mapping[str, Any], comments: Mapping[str, str] | None = None) -> str:
    """TOML of tables: a mapping is a table, a list of mappings is an array of tables, with a comment before each.

    ``comments`` has a line by the name of a table; that of ``""`` stands first.
    """
    comments = comments or {}
    blocks = [f"# {comments['']}"] if "" in comments else []
    for name, table in tables.items():
        several = isinstance(table, Sequence)
        for entry in table if several else [table]:
            head = f"[[{name}]]" if several else f"[{name}]"
            lines = [f"# {comments[name]}"] if name in comments else []
            blocks.append("\n".join([*lines, head, *(f"{key} = {_value(value)}" for key, value in entry.items())]))
    return "\n\n".join(blocks) + "\n"


def _value(value: Any) -> str:
    # A basic string of TOML has the escapes of JSON, but for DEL (TOML 1.0, Strings).
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)
