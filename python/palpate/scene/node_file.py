"""Files of node numbers, such as of supports that were painted: numbers apart by spaces, and comments after ``#``."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from palpate.atomic import written_beside
from palpate.errors import SceneError
from palpate.input_file import require_file

ENDING = ".nodes"
# Numbers in a line of a file that is written.
IN_LINE = 16


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
