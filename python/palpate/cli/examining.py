"""Commands of exams, taken by a person or by a simulated observer of known Weber fraction."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from palpate.cli.app import app
from palpate.cli.checks import require_places
from palpate.cli.option_groups import grouped
from palpate.cli.running import Page
from palpate.errors import SceneError
from palpate.progress import status_line

if TYPE_CHECKING:
    from palpate.exam import Course, Library

exam_app = typer.Typer(help="Exams of touch.", no_args_is_help=True)
app.add_typer(exam_app, name="exam")


@exam_app.callback()
def exam() -> None:
    """Exams of touch; results stay on this machine."""


@exam_app.command()
@grouped
def nodule(
    file: Annotated[
        Path | None, typer.Argument(help="Exam file (.toml); without it, a slab of soft tissue with four places.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for exam.csv, exam.json and exam.png, one for each person.")] = Path(
        "exam"
    ),
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of places and depths; default: that of the file, or a random one.")
    ] = None,
    observer: Annotated[
        float | None,
        typer.Option(min=0.005, max=1, help="A simulated observer with this Weber fraction answers, without a page."),
    ] = None,
    exams: Annotated[int, typer.Option(min=1, help="With --observer: number of exams.")] = 1,
    *,
    page: Page,
) -> None:
    """Find hidden nodules by touch alone in the browser: a staircase gives the contrast that this hand detects.

    The Weber fraction, with its interval, a plot and a table of all trials are written into --out and nowhere else. An
    exam that was interrupted continues with the same command.

    Example: palpate exam nodule --out anna

    Example: palpate exam nodule exam.toml --out ben --seed 7

    Example: palpate exam nodule --observer 0.1 --exams 200
    """
    from palpate.exam import ExamFile, Library

    require_places(None, out, page.address if observer is None else None)
    found = ExamFile.default() if file is None else ExamFile.read(file)
    chosen = found.question.seed if seed is None else seed
    with status_line(f"preparing {found.title}"):
        library = Library(found)
    if observer is not None and exams > 1:
        _print_spread(library, observer, exams, chosen or 0)
        return
    out.mkdir(parents=True, exist_ok=True)
    if observer is None:
        _ask(library, out, chosen, page)
    else:
        _observe(library, observer, chosen or 0, out)


def _ask(library: Library, out: Path, seed: int | None, page: Page) -> None:
    """Exam of a person, from where it was interrupted."""
    from palpate.exam import Record
    from palpate.exam.live import ExamServer, finish
    from palpate.viewer.live import open_viewer

    course = Record(out / "exam.csv").resume(library, seed)
    if course.trial is None:
        print(f"the exam in {out} is over; another one needs another --out")
        print("\n".join(finish(course, out).lines()))
        return
    if course.answers:
        print(f"continuing with trial {course.trial.number} of {course.count}")
    open_viewer(ExamServer(course, out, host=page.host, port=page.port), browser=page.browser)
    if course.trial is not None:
        print(f"{len(course.answers)} of {course.count} trials answered; the same command continues")
    else:
        print(f"wrote {out / 'exam.csv'}, exam.json and exam.png")


def _observe(library: Library, weber_fraction: float, seed: int, out: Path) -> None:
    """One exam of an observer, with all that an exam of a person leaves."""
    from palpate.exam import Record, simulated_exam
    from palpate.exam.live import finish

    table = out / "exam.csv"
    if table.exists():
        raise SceneError(f"{table} is there already: give another --out")
    course: Course = simulated_exam(library, weber_fraction, seed)
    record = Record(table)
    for answered in course.answers:
        record.add(course, answered)
    print("\n".join(finish(course, out).lines()))
    print(f"wrote {table}, exam.json and exam.png")


def _print_spread(library: Library, weber_fraction: float, exams: int, seed: int) -> None:
    """Print what exams find of a known observer, over seeds."""
    from palpate.exam import simulated_exams

    found = simulated_exams(library, weber_fraction, exams, seed)
    ratio = np.array([estimate.weber_fraction for estimate in found]) / weber_fraction
    low, middle, high = np.percentile(ratio, (5, 50, 95))
    covered = np.mean([estimate.low <= weber_fraction <= estimate.high for estimate in found])
    trials = library.exam.question.trials
    print(f"{exams} exams of {trials} trials by an observer of Weber fraction {100 * weber_fraction:.3g} %")
    print(f"median {100 * middle * weber_fraction:.3g} %, {100 * (middle - 1):+.1f} % from the truth")
    print(f"a single exam: {100 * (low - 1):+.0f} to {100 * (high - 1):+.0f} % in nine of ten, ", end="")
    print(f"within 15 % in {100 * np.mean(np.abs(ratio - 1) <= 0.15):.0f} % of exams")
    print(f"the 95 % interval holds the truth in {100 * covered:.0f} % of exams")
