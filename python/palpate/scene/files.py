"""Text of a scene file from its tables, and files of node numbers, such as of supports that were painted.

A file of nodes has numbers apart by spaces, and comments after ``#``.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from palpate.atomic import written_beside
from palpate.errors import SceneError
from palpate.input_file import require_file

ENDING = ".nodes"
# Numbers in a line of a file that is written.
IN_LINE = 16


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


def is_node_file(value: object) -> bool:
    """Whether a value of a scene is the path of such a file; predicates end otherwise."""
    return isinstance(value, str) and value.endswith(ENDING)


def read_nodes(path: Path) -> list[int]:
    """Read the numbers of a file; SceneError for a file that is missing, or that holds anything else."""
    require_file(path, SceneError)
    numbers: list[int] = []
    for rank, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines()):
        for word in line.partition("#")[0].split():
            if not (word.isascii() and word.isdigit()):
                raise SceneError(f"{path}:{rank + 1}: '{word[:40]}' is no node number")
            numbers.append(int(word))
    if not numbers:
        raise SceneError(f"{path}: holds no node numbers")
    return numbers


def write_nodes(path: Path, nodes: Iterable[int], comment: str) -> None:
    """Write numbers, ascending, after a line of comment."""
    numbers = np.unique(np.fromiter(nodes, dtype=np.int64)).tolist()
    lines = [" ".join(map(str, numbers[at : at + IN_LINE])) for at in range(0, len(numbers), IN_LINE)]
    with written_beside(path) as partial:
        partial.write_text("\n".join([f"# {comment}", *lines, ""]), encoding="utf-8")
