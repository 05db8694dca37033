"""A study: read from a file, run here or by the workers of a cluster, resumed after an interruption."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate import _native
from palpate.atomic import naming
from palpate.cache import digest
from palpate.cluster import connected, result_of, spread, submit
from palpate.errors import SceneError
from palpate.input_file import read_toml, require_file
from palpate.progress import progress_reporter
from palpate.study.answers import Answers, answers, answers_elsewhere, case_key, files_of, mesh_key, operator_key
from palpate.study.cases import Case, cases_of
from palpate.study.result import StudyResult

if TYPE_CHECKING:
    from distributed import Client

# In the folder of the results: what finished bodies have answered.
FINISHED = "finished.jsonl"


class Study:
    """Bodies that differ in some of their values, and presses that each of them is asked for.

    Made by :meth:`read`.

    Attributes
    ----------
    path
        The file.
    cases
        Its bodies.

    """

    def __init__(self, path: Path, cases: Sequence[Case]):
        self.path, self.cases = path, tuple(cases)

    def __repr__(self) -> str:
        presses = len(self.cases[0].scene.presses)
        return f"Study({self.path}, {len(self.cases)} bodies, {presses} presses of each)"

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Study:
        """Read a study file; SceneError if it is missing, not TOML, or has a wrong key or value, with its line."""
        path = Path(path)
        text, tables = read_toml(path, SceneError)
        cases = cases_of(path, text, tables)
        for file in {file for case in cases for file in list(files_of(case.scene).values())[:1]}:
            require_file(file, SceneError)
        return cls(path, cases)

    def run(
        self,
        folder: str | os.PathLike[str],
        dask: str | Client | None = None,
        progress: bool | Callable[[int, int], None] = True,
    ) -> StudyResult:
        """Solve the bodies and press them.

        What a body answers is kept in the folder as soon as it is known: a study that was interrupted, or has grown,
        computes only what is missing. A body that cannot be solved does not stop the others.

        Parameters
        ----------
        folder
            Of the results; made if it is not there.
        dask
            Scheduler, or client of it, whose workers solve the bodies, with the same numbers: see
            :func:`palpate.precompute`.
        progress
            True shows a bar on a terminal; a function is called with bodies done and in all.

        Raises
        ------
        ClusterError
            A cluster that cannot be used, or fails.

        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        keys = [case_key(case.scene) for case in self.cases]
        with _AnswerFile(folder / FINISHED) as finished:
            found = {k: finished.known[key] for k, key in enumerate(keys) if key in finished.known}
            resumed = len(found)
            with progress_reporter("studying", progress) as report:
                for ranks, answered in self._solved(self._groups(found), dask):
                    for rank, answer in zip(ranks, answered, strict=True):
                        found[rank] = answer
                        if not answer.problem:
                            finished.keep(keys[rank], answer)
                    if report is not None:
                        report(len(found), len(self.cases))
        return StudyResult.of(self.path.stem, self.cases, [found[k] for k in range(len(self.cases))], resumed)

    def _groups(self, found: dict[int, Answers]) -> list[list[int]]:
        """Bodies that are missing, those that share an operator together, those of a mesh one after the other."""
        groups: dict[tuple[str, str], list[int]] = {}
        for rank, case in enumerate(self.cases):
            if rank not in found:
                groups.setdefault((mesh_key(case.scene), operator_key(case.scene)), []).append(rank)
        meshes = dict.fromkeys(mesh for mesh, _ in groups)
        return [ranks for mesh in meshes for (of, _), ranks in groups.items() if of == mesh]

    def _solved(self, groups: list[list[int]], dask: str | Client | None) -> Iterator[tuple[list[int], list[Answers]]]:
        """Answers of groups of bodies, in any order."""
        if not groups:
            return
        if dask is None:
            for ranks in groups:
                yield ranks, answers([self.cases[k].scene for k in ranks])
            return
        with connected(dask) as client:

            def start(ranks: list[int], address: str) -> Any:
                scenes = [self.cases[k].scene for k in ranks]
                files = [(name, file.read_bytes()) for name, file in files_of(scenes[0]).items()]
                return submit(client, answers_elsewhere, _native.__version__, scenes, files, address=address)

            with contextlib.closing(spread(client, groups[::-1], start)) as solved:
                for ranks, future in solved:
                    yield ranks, result_of(client, future)


class _AnswerFile:
    """What bodies have answered, a line of JSON each, appended as they are done; torn and damaged ones do not count."""

    def __init__(self, path: Path):
        self.known: dict[str, Answers] = {}
        whole = 0
        for line in path.read_bytes().splitlines(keepends=True) if path.is_file() else ():
            if not line.endswith(b"\n"):
                break
            whole += len(line)
            with contextlib.suppress(ValueError, KeyError, TypeError, AttributeError):
                record = json.loads(line)
                if record.pop("sum") == digest(record):
                    key = record.pop("key")
                    self.known[key] = Answers(**record)
        self._path = path
        self._stream = path.open("r+b" if path.is_file() else "wb")
        self._stream.truncate(whole)
        self._stream.seek(whole)

    def __enter__(self) -> _AnswerFile:
        return self

    def __exit__(self, *_: object) -> None:
        with naming(self._path):
            self._stream.close()

    def keep(self, key: str, answer: Answers) -> None:
        """Add what a body has answered; it is in the system's hands when this returns."""
        line = {"key": key, **asdict(answer)}
        with naming(self._path):
            self._stream.write(json.dumps({**line, "sum": digest(line)}).encode() + b"\n")
            self._stream.flush()
