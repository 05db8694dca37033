"""A file from elsewhere, read and filled by a process of its own: its surface, its steps, and its tetrahedra."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from palpate.errors import MeshError
from palpate.mesh.child import failure_of, run_limited
from palpate.mesh.fill_child import MESH, SURFACE
from palpate.mesh.tetmesh import TetMesh
from palpate.units import length_scale

# Of reading and all meshers together, s: the wrap and each of its meshers have limits of their own.
TIME_LIMIT = 900.0
REPORT = "report.jsonl"


@dataclass(frozen=True, eq=False)
class ReadFile:
    """What is known of a file once it is read."""

    file: str  # its name
    sides: tuple[float, float, float]  # of the box around the body, in the file's unit
    unit: str  # unit of length that it is taken in
    fitting: tuple[str, ...]  # units that it may be in, the likeliest first; one alone is certain
    # Triangles of a surface, m; None for a volume mesh.
    vertices: np.ndarray | None = None
    faces: np.ndarray | None = None


@dataclass
class FillProcess:
    """A file that is read and filled in a child process."""

    folder: Path  # where the file lies, and what is made of it
    file: str
    unit: str | None  # unit of length; None takes the likeliest
    on_read: Callable[[ReadFile], None]  # is called once the file is read: its surface can be drawn
    # Is called with the name of each stage, and with the stages done and all of them.
    on_stage: Callable[[str, int, int], None]
    notes: list[str] = field(default_factory=list)  # what the meshers reported, a line each

    def mesh(self, require_wanted: Callable[[], None] = lambda: None) -> TetMesh:
        """Fill the file; ``require_wanted`` is called ten times a second, and ends the process by raising.

        Raises MeshError for a file that cannot be read or filled, and why.
        """
        report = self.folder / REPORT
        for left in (report, self.folder / SURFACE, self.folder / MESH):
            left.unlink(missing_ok=True)
        command = [sys.executable, "-m", "palpate.mesh.fill_child"]
        command += [str(self.folder), self.file, self.unit or "-", str(report)]
        lines = _Lines(report)

        def watch() -> None:
            require_wanted()
            for line in lines.new():
                self._take(line)

        status = run_limited(command, TIME_LIMIT, watch)
        watch()
        mesh_file = self.folder / MESH
        if not mesh_file.exists():
            raise MeshError(f"{self.file}: its process {failure_of(status, TIME_LIMIT) or 'made no tetrahedra'}")
        with np.load(mesh_file) as arrays:
            return TetMesh(arrays["nodes"], arrays["tets"], arrays["regions"], self._names)

    _names: dict[str, int] = field(default_factory=dict)
    _read: ReadFile | None = None

    def _take(self, line: dict[str, Any]) -> None:
        """Pass a line of the report on."""
        if "error" in line:
            raise MeshError(f"{self.file}: {line['error']}")
        if "note" in line:
            self.notes.append(line["note"])
        if "read" in line:
            sides = tuple(map(float, line["sides"]))
            self._read = ReadFile(self.file, sides, line["unit"], tuple(line["fitting"]))  # type: ignore[arg-type]
        if "stage" in line:
            self.on_stage(line["stage"], line["done"], line["total"])
        if "drawn" in line and self._read is not None:
            with np.load(self.folder / SURFACE) as arrays:
                vertices, faces = arrays["vertices"] * length_scale(self._read.unit), arrays["faces"]
            self._read = replace(self._read, vertices=vertices, faces=faces)
            self.on_read(self._read)
        if "filled" in line:
            self._names = {str(name): int(label) for name, label in line["names"].items()}
            if self._read is not None and self._read.vertices is None:
                self.on_read(self._read)


class _Lines:
    """Whole lines of a file that another process writes."""

    def __init__(self, path: Path):
        self._path, self._at = path, 0

    def new(self) -> list[dict[str, Any]]:
        """Lines since the last call."""
        if not self._path.exists():
            return []
        with self._path.open("rb") as file:
            file.seek(self._at)
            text = file.read()
        whole = text[: text.rfind(b"\n") + 1]
        self._at += len(whole)
        return [json.loads(line) for line in whole.splitlines()]
