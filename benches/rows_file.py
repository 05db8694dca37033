"""Rows of a long measurement in a file, from which an interrupted run continues."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benches.output import machine
from palpate.atomic import written_beside
from palpate.errors import Error


class RowsFile:
    """Rows of one benchmark with the machine and the settings that they belong to.

    Parameters
    ----------
    path
        None: nothing is kept.
    settings
        Plain data.

    """

    def __init__(self, path: Path | None, settings: dict[str, Any]):
        self._path = path
        self._belongs = {"machine": machine(), "settings": json.loads(json.dumps(settings))}

    def read(self) -> list[dict[str, Any]]:
        """Rows of an earlier run of the same settings on the same machine; none without a file.

        Raises
        ------
        Error
            A file of something else, of other settings or of another machine.

        """
        if self._path is None or not self._path.exists():
            return []
        try:
            held = json.loads(self._path.read_text())
            same = all(held[name] == value for name, value in self._belongs.items())
            rows = list(held["rows"])
        except (ValueError, KeyError, TypeError):
            reason = "is not a file of this benchmark"
        else:
            if same:
                return rows
            reason = "holds rows of other settings or of another machine"
        raise Error(f"{self._path}: {reason}; delete it, or choose another --out")

    def write(self, rows: list[dict[str, Any]]) -> None:
        """Replace the rows."""
        if self._path is not None:
            with written_beside(self._path) as partial:
                partial.write_text(json.dumps({**self._belongs, "rows": rows}, indent=1))
