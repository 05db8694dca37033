"""Table of an exam: one row for each trial, written as soon as it is answered, read again to resume."""

from __future__ import annotations

import contextlib
import csv
import errno
import io
import os
from pathlib import Path

import numpy as np

from palpate.errors import SceneError
from palpate.exam.course import Course, TrialAnswer
from palpate.exam.library import Library

COLUMNS = (
    *("trial", "seed", "place", "place_x_m", "place_y_m", "place_z_m", "radius_m", "depth_m", "contrast"),
    *("felt_contrast", "answer", "answer_x_m", "answer_y_m", "answer_z_m", "answer_place", "distance_m"),
    *("correct", "time_s"),
)
# What a row says of the question, which must be that of the exam that goes on.
ASKED = COLUMNS[: COLUMNS.index("answer")]


def row_of(course: Course, answered: TrialAnswer) -> dict[str, str]:
    """Row of an answer; what does not apply is empty. ``contrast`` is `E/E0`, ``felt_contrast`` `dK/K`."""
    library, nodule = course.library, answered.trial.nodule
    row = dict.fromkeys(COLUMNS, "")
    row.update(trial=str(answered.trial.number), seed=str(course.seed))
    if nodule is not None:
        hidden = library.nodules[nodule]
        row.update(place=str(hidden.place), radius_m=_text(hidden.radius), depth_m=_text(hidden.depth))
        row.update(contrast=_text(hidden.contrast), felt_contrast=_text(library.felt_contrasts[nodule]))
        _put(row, "place", library.places.points[hidden.place])
    row.update(answer="none" if answered.marked is None else "mark", correct=str(int(answered.correct)))
    if answered.marked is not None:
        _put(row, "answer", np.array(answered.marked))
        row.update(answer_place=str(answered.place))
    if answered.distance is not None:
        row.update(distance_m=_text(answered.distance))
    return {**row, "time_s": f"{answered.seconds:.2f}"}


class Record:
    """The file of an exam; a table that is there already is gone on with."""

    def __init__(self, path: Path):
        self._path = path

    def resume(self, library: Library, seed: int | None) -> Course:
        """Course of the file up to where it was interrupted, or a new one.

        Parameters
        ----------
        library
            The bodies.
        seed
            Of a new one; None takes that of the system. One that goes on has its own.

        Raises
        ------
        SceneError
            A table of another exam, or one that cannot be read, with its line.

        """
        rows = self._read() if self._path.exists() else []
        if not rows:
            chosen = int(np.random.SeedSequence().entropy) % 2**32 if seed is None else seed
            return Course(library, chosen)
        try:
            course = Course(library, int(rows[0]["seed"]))
            for line, row in enumerate(rows, 2):
                self._replay(course, row, line)
        except (ValueError, TypeError):
            raise SceneError(f"{self._path}: cannot be read as the table of an exam; give another --out") from None
        if seed not in (None, course.seed):
            raise SceneError(f"{self._path} was begun with the seed {course.seed}, not {seed}: give another --out")
        return course

    def add(self, course: Course, answered: TrialAnswer) -> None:
        """Write the row of an answer; it is on the disk when this returns."""
        text = io.StringIO(newline="")
        writer = csv.DictWriter(text, COLUMNS)
        whole = self._path.stat().st_size if self._path.exists() else 0
        if whole == 0:
            writer.writeheader()
        writer.writerow(row_of(course, answered))
        try:
            with self._path.open("ab", buffering=0) as stream:
                if stream.write(content := text.getvalue().encode()) != len(content):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), os.fspath(self._path))
                os.fsync(stream.fileno())
        except OSError:
            # The next answer must not be appended to a part of this one.
            with contextlib.suppress(OSError):
                os.truncate(self._path, whole)
            raise

    def _read(self) -> list[dict[str, str]]:
        """Rows of the table, without one that was not written to its end, which is cut off: its trial comes again."""
        content = self._path.read_bytes()
        whole = content.rfind(b"\n") + 1
        reader = csv.DictReader(io.StringIO(content[:whole].decode(errors="replace"), newline=""))
        rows = list(reader)
        if reader.fieldnames is not None and tuple(reader.fieldnames) != COLUMNS:
            raise SceneError(f"{self._path}:1: not the table of an exam; give another --out")
        for line, row in enumerate(rows, 2):
            if None in row:
                raise SceneError(f"{self._path}:{line}: more cells than columns; give another --out")
        if whole < len(content):
            os.truncate(self._path, whole)
        return rows

    def _replay(self, course: Course, row: dict[str, str], line: int) -> None:
        if course.trial is None:
            raise SceneError(f"{self._path}:{line}: more trials than the exam has; give another --out")
        marked = None if row["answer"] == "none" else [float(row[f"answer_{axis}_m"]) for axis in "xyz"]
        expected = row_of(course, course.answer(marked, float(row["time_s"])))
        for key in (*ASKED, "correct"):
            if expected[key] != row[key]:
                raise SceneError(
                    f"{self._path}:{line}: {key} is {row[key] or 'empty'}, this exam has {expected[key] or 'none'}: "
                    "the table belongs to another one; give another --out"
                )


def _put(row: dict[str, str], what: str, point: np.ndarray) -> None:
    row.update({f"{what}_{axis}_m": _text(value) for axis, value in zip("xyz", point, strict=True)})


def _text(value: float) -> str:
    """Six digits: a hundredth of a millimetre in a metre, and the same after being read back."""
    return f"{value:.6g}"
